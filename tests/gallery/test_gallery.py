"""The worked examples of docs/examples: each states, solves and is checked here."""

from __future__ import annotations

import importlib.util
from pathlib import Path

import numpy as np
import pytest

from tests.fixtures.campaign import part_of_the_sample_runs
from tests.fixtures.paths import ROOT, SAMPLES

EXAMPLES = ROOT / "docs" / "examples"


def example(name: str):  # type: ignore[no-untyped-def]
    path = EXAMPLES / f"{name}.py"
    assert len(path.read_text().splitlines()) <= 60
    spec = importlib.util.spec_from_file_location(path.stem, path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_every_example_is_checked():
    checked = "".join(path.read_text() for path in sorted(Path(__file__).parent.glob("test_*.py")))
    assert [path.stem for path in EXAMPLES.glob("*.py") if f'example("{path.stem}")' not in checked] == []


def test_stickout():
    frequency, height = np.array(example("stickout").PEAKS).T
    assert np.all(np.diff(frequency) < 0.0)
    assert np.all(np.diff(height) > 0.0)


def test_force_lines():
    ex = example("force_lines")
    error = np.linalg.norm(ex.FROM_LINES - ex.SAMPLED) / np.linalg.norm(ex.SAMPLED)
    assert error < 0.01


def test_lobes_from_modes():
    lobes = example("lobes_from_modes").LOBES
    np.testing.assert_allclose(lobes.absolute_limit, 0.04793e-3, rtol=1e-3)
    np.testing.assert_allclose(lobes.absolute_frequency / (2.0 * np.pi), 923.59, rtol=1e-4)
    assert not lobes.warnings


@pytest.mark.slow(15)
def test_recordings_to_speed(tmp_path, monkeypatch, capsys):
    """A tool that never cut: the recommended cut is stable on the true machine, and not far from its limit."""
    monkeypatch.chdir(tmp_path)
    # where recordings are, none are made: every third of the sample runs' cuts
    (tmp_path / "sample_runs").mkdir()
    part_of_the_sample_runs(tmp_path / "sample_runs", 3)
    ex = example("recordings_to_speed")
    assert ex.found.status == "converged"
    best = ex.advice.recommended[0]
    assert best.spindle_speed == pytest.approx(ex.ri.rpm(14_550), rel=0.01)
    tip = ex.ri.read_tip(SAMPLES.with_suffix(".truth") / "tip" / f"{ex.tool.name}.csv")
    process = ex.ri.CutSpec().process(ex.tool.cutter, ex.campaign.workpiece)
    true = ex.ri.stability_lobes(tip, process, best.spindle_speed, max_depth=10e-3).limit_depth[0]
    assert 0.7 * true < best.depth < true
    assert ex.ri.read_result("RESULT.json").status == "converged"
    assert ex.ri.read_forces("FORCES.csv").force.shape == ex.forces.estimate.force.shape
    # printed as it stands in the advice, which a method that fits the cut has computed
    assert f"{best.spindle_speed / ex.ri.rpm(1.0):.0f} rev/min" in capsys.readouterr().out
