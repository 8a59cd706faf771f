"""compare: hammer files beside a result file."""

from __future__ import annotations

import json

import numpy as np
import pytest

from rcsa_ident.dynamics.coordinates import Dof
from rcsa_ident.io.curves.tips import write_frf_csv
from rcsa_ident.io.results.identifications import machine_from_json
from rcsa_ident.io.results.parts import read_result
from rcsa_ident.io.settings.setups import read_tooling
from tests.cli.measurements import run

pytestmark = pytest.mark.slow


@pytest.fixture
def hammer(result_file, tmp_path):
    """The result's own machine, its tip 3 % lower in frequency and 10 % more compliant; the bare flange as it is."""
    data = read_result(result_file)
    machine = machine_from_json(data, str(result_file))
    frequency = np.arange(*data["band_hz"], 2.0)
    omega = 2.0 * np.pi * frequency
    tip = machine.tip(read_tooling(tmp_path / "T1.toml"), omega / 0.97, spread=False)
    write_frf_csv(tmp_path / "tip.csv", frequency, {axis.upper(): 1.1 * tip.between(f"tip.{axis}", f"tip.{axis}") for axis in machine.axes})
    flange = machine.identified[Dof.X].spindle.receptance(omega).values[:, 0, 0]
    write_frf_csv(tmp_path / "flange.csv", frequency, {"X": flange})
    return tmp_path


def test_table_figure_and_json(result_file, hammer):
    out = hammer / "compare.png"
    arguments = ("compare", result_file, hammer / "T1.toml", "--hammer", hammer / "tip.csv", "--hammer", f"flange={hammer / 'flange.csv'}")
    text = run(*arguments, "--out", out).output
    assert out.read_bytes().startswith(b"\x89PNG")
    assert "FRAC 1.000" in text
    answer = json.loads(run(*arguments, "--json").output.splitlines()[-1])
    rows = {(r["place"], r["axis"]): r for r in answer["responses"]}
    assert set(rows) == {("tip", "X"), ("tip", "Y"), ("flange", "X")}
    assert rows["flange", "X"]["relative_difference"] < 1e-6
    found = [m for m in rows["tip", "X"]["modes"] if "identified_hz" in m]
    assert found
    for mode in found:
        assert mode["identified_hz"] / mode["hammer_hz"] == pytest.approx(1.0 / 0.97, abs=3e-3)
        assert mode["identified_peak_m_per_n"] / mode["hammer_peak_m_per_n"] == pytest.approx(1.0 / 1.1, rel=0.02)


def test_what_is_refused(result_file, hammer):
    tooling = hammer / "T1.toml"
    same = run("compare", result_file, tooling, "--hammer", hammer / "tip.csv", "--hammer", f"tip={hammer / 'tip.csv'}", code=2)
    assert "one for each place and axis" in same.output
    assert "one of tip, cross" in run("compare", result_file, tooling, "--hammer", "tap=a.csv", code=2).output
    assert "no such file" in run("compare", result_file, tooling, "--hammer", hammer / "none.csv", code=2).output
