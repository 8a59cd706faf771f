import json
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from benchmarks import search_trace, study, yardstick
from benchmarks.page import read_rows
from benchmarks.study import (
    BANDS,
    FREQUENCY,
    INSIDE,
    Run,
    compared,
    coverage,
    in_deviations,
    planned,
    relative_error,
)
from benchmarks.study_table import counts, line, table
from rcsa_ident.coupling.joint import LumpedJoint
from rcsa_ident.dynamics.coordinates import Dof, plane
from rcsa_ident.dynamics.modal import ModalModel
from rcsa_ident.identification.evidence import EvidenceSelection
from rcsa_ident.identification.genetic_algorithm import PaperGeneticAlgorithm
from rcsa_ident.identification.search import SearchSettings
from rcsa_ident.io.curves import write_frf_csv
from rcsa_ident.io.machines import read_machine
from rcsa_ident.io.setups import read_tooling
from rcsa_ident.machine.flange_machine import FlangeMachine

TOOLINGS = study.MACHINES / "toolings"


def test_relative_error_by_hand():
    true = np.array([3.0, 4.0j])
    assert relative_error(true, true) == 0.0
    assert relative_error(np.zeros(2), true) == 1.0
    # off by 1 in a vector of length 5
    assert relative_error(np.array([3.0 + 0.6j, 4.0j + 0.8]), true) == pytest.approx(0.2)


def test_errors_in_deviations_by_hand():
    error = np.array([1.0 + 4.0j, -3.0 + 0.0j])
    z = in_deviations(error, (np.array([2.0, 1.0]), np.array([1.0, 0.0])))
    assert z.tolist() == [0.5, -3.0, 4.0, 0.0]
    assert np.isinf(in_deviations(np.array([1.0 + 0.0j]), (np.zeros(1), np.zeros(1)))[0])


def test_coverage_by_hand():
    found = coverage(np.array([0.0, 0.5, -0.7, 1.6, -2.0]))
    assert (found["50"], found["90"]) == (0.4, 0.8)
    assert found["rms"] == pytest.approx(np.sqrt((0.25 + 0.49 + 2.56 + 4.0) / 5.0))


def test_coverage_of_an_honest_band_is_what_its_name_says():
    rng = np.random.default_rng(1)
    deviation = rng.uniform(0.5, 2.0, 40000), rng.uniform(0.1, 0.2, 40000)
    error = deviation[0] * rng.standard_normal(40000) + 1j * deviation[1] * rng.standard_normal(40000)
    found = coverage(in_deviations(error, deviation))
    assert [found[name] for name in BANDS] == pytest.approx([0.5, 0.9], abs=0.005)
    assert found["rms"] == pytest.approx(1.0, abs=0.01)
    narrow = coverage(in_deviations(error, (0.5 * deviation[0], 0.5 * deviation[1])))
    # P(|z| < 0.6745 / 2) and P(|z| < 1.645 / 2)
    assert [narrow[name] for name in BANDS] == pytest.approx([0.2641, 0.5892], abs=0.005)


@pytest.fixture
def machine():
    flanges = []
    for axis, shift in ((Dof.X, 1.0), (Dof.Y, 0.9)):
        omega_n = 2.0 * np.pi * shift * np.array([900.0, 2000.0])
        phi = np.array([[0.2, 0.1], [0.3, -0.6]]) * (1.0 - 1.0j) / (2.0 * np.sqrt(omega_n))[:, None]
        flanges.append(ModalModel(omega_n, np.array([0.05, 0.04]), phi, np.zeros((2, 2)), plane("flange", axis)))
    return FlangeMachine(tuple(flanges), (2.0 * np.pi * 600.0, 2.0 * np.pi * 4000.0), LumpedJoint(3e9, 6e6, 2e3, 10.0))


def test_tooltips_are_compared_with_the_truth_of_their_own_tooling_and_axis(machine, tmp_path):
    paths = {name: TOOLINGS / f"{name}.toml" for name in ("S1-ER32", "S2-PG25", "S3-PG25-long", "S4-shrink")}
    (tmp_path / "tip").mkdir()
    frequency = np.arange(5.0, 4500.1, 5.0)
    # true curves that are a known factor away: the error is |1 - 1 / factor|
    factors = {"S1-ER32": (1.0, 1.25), "S2-PG25": (0.8, 1.0), "S3-PG25-long": (2.0, 1.0), "S4-shrink": (1.0, 0.5)}
    for name, path in paths.items():
        tip = machine.tip(read_tooling(path), 2.0 * np.pi * frequency)
        values = {row.dof.upper(): f * tip.between(str(row), str(row)) for row, f in zip(tip.rows, factors[name], strict=True)}
        write_frf_csv(tmp_path / "tip" / f"{name}.csv", frequency, values)
    files = tuple(paths.values())
    found = compared(machine, SimpleNamespace(toolings=files[:2], truth_toolings=files[2:]), tmp_path)
    assert found["cut"]["errors"] == pytest.approx([0.0, 0.2, 0.25, 0.0], abs=1e-4)
    assert found["similar"]["errors"] == pytest.approx([0.5, 0.0], abs=1e-4)
    assert found["different"]["errors"] == pytest.approx([0.0, 1.0], abs=1e-4)
    assert all(found[kind]["bands"] is None for kind in found)
    assert (FREQUENCY[0], FREQUENCY[-1], FREQUENCY.size) == (600.0, 4000.0, 681)


def row(machine, similar, different, status="converged", method="default", condition="trigger"):
    bands = {"50": 0.5, "90": 0.9, "rms": 1.0} if method == "default" else None
    errors = {"cut": [0.001] * 4, "similar": similar, "different": different}
    return {
        "machine": machine,
        "condition": condition,
        "method": method,
        "seed": 1,
        "status": status,
        "reasons": [] if status == "converged" else ["a doubt"],
        "cuts": 80,
        "modes": [6, 7],
        "model_error": [0.003, 0.004],
        "seconds": {"read": 1.0, "identify": 4.0},
        **{kind: {"errors": e, "bands": bands} for kind, e in errors.items()},
    }


ROWS = [
    row("1", [0.002, 0.01], [0.02, 0.025]),
    row("2", [0.004, 0.004], [0.011, 0.012], "suspect"),
    row("3", [0.002, 0.011], [0.02, 0.02]),
    row("4", [0.02, 0.02], [0.03, 0.051]),
    row("5", [0.5, 0.5], [0.9, 0.8], "suspect"),
    row("5", [0.9, 0.9], [0.9, 0.9], method="paper, literal"),
    row("table2", [0.9, 0.9], [0.9, 0.9]),
]


def test_status_is_counted_against_the_truth():
    # only drawn machines and the default method; both aims hold for X and Y of a good run
    assert counts(ROWS) == {"runs": 5, "converged above": 1, "good": 2, "good but suspect": 1}


def test_the_table_holds_all_machines_and_says_median_and_worst():
    text = table(ROWS)
    similar = np.median([0.002, 0.01, 0.004, 0.004, 0.002, 0.011, 0.02, 0.02, 0.5, 0.5])
    assert f"| drawn | trigger | default | 5 | {similar:.4f} | 0.5000 | 0.0225 | 0.9000 | 3 of 5 | 5.0 | - |" in text
    ratios = f"{0.9 / similar:.3g}, {0.9 / 0.0225:.3g}, 1"
    assert f"| drawn | trigger | paper, literal | 1 | 0.9000 | 0.9000 | 0.9000 | 0.9000 | 1 of 1 | 5.0 | {ratios} |" in text
    assert "| table2 | trigger | default | 1 |" in text
    assert all(f"| {name} | trigger | 1 |" in text for name in ("1", "2", "3", "4", "5", "table2"))
    assert "- 5, trigger: a doubt" in text


def test_every_run_is_planned_once():
    runs = planned(["1", "2", INSIDE], ["trigger", "no-trigger"], ["default", "paper, literal"], [1, 2])
    assert len(set(runs)) == len({r.name for r in runs}) == len(runs) == 2 * (2 + 2 * 2) + 2 * 2
    assert Run("1", "trigger", "paper, literal", 1) not in runs
    assert Run(INSIDE, "no-trigger", "paper, literal", 2) in runs
    assert all(r.condition == "no-trigger" for r in runs if r.machine == INSIDE)


def test_an_interrupted_study_goes_on(tmp_path, monkeypatch):
    path = tmp_path / "results.jsonl"
    path.write_text(json.dumps(ROWS[0]) + "\n" + json.dumps(ROWS[1])[:40])
    assert read_rows(path) == ROWS[:1]
    done = []

    def perform(scratch, run):
        done.append(run.machine)
        return row(run.machine, [0.01, 0.01], [0.02, 0.02])

    monkeypatch.setattr(study, "perform", perform)
    monkeypatch.setattr(study, "campaign_folder", lambda scratch, *campaign: scratch / campaign[0])
    rows = study.run(tmp_path, ["1", "2"], ["trigger"], ["default"])
    assert done == ["2"]
    assert rows[0] == ROWS[0]
    assert read_rows(path) == rows


@pytest.fixture(scope="module")
def scratch(tmp_path_factory):
    """A campaign of few cuts, its truth on few frequencies."""
    folder = tmp_path_factory.mktemp("study")
    machine = read_machine(study.MACHINES / "hpm.toml")
    few = replace(machine, plan=replace(machine.plan, spindle_speeds=machine.plan.spindle_speeds[::20]))
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("rcsa_ident.workflows.simulate.TRUTH_FREQUENCIES", (100.0, 4500.0, 100.0))
        patch.setattr(study, "machine_of", lambda scratch, name: few)
        study.campaign_folder(folder, "hpm", "no-trigger")
    return folder


@pytest.fixture
def coarse(monkeypatch):
    for module in (study, yardstick):
        monkeypatch.setattr(module, "FREQUENCY", np.arange(600.0, 4000.1, 100.0))
    for module in (study, search_trace):
        monkeypatch.setattr(module, "warm", lambda: None)


@pytest.mark.slow
def test_a_run_goes_through_files_and_comes_back_as_a_row(scratch, coarse, monkeypatch):
    # the published algorithm, stopped early: fast, far off, and without bands
    monkeypatch.setattr(study, "METHODS", {"quick, bad": PaperGeneticAlgorithm(population=4, generations=2)})
    row = study.perform(scratch, Run("hpm", "no-trigger", "quick, bad", 3))
    assert json.loads(json.dumps(row)) == row
    assert [row[key] for key in ("machine", "condition", "method", "seed", "status", "cuts")] == [
        "hpm", "no-trigger", "quick, bad", 3, "suspect", 4,
    ]  # fmt: skip
    assert all(len(row[kind]["errors"]) == count and row[kind]["bands"] is None for kind, count in (("cut", 4), ("similar", 2)))
    assert min(row["different"]["errors"]) > 0.1
    assert "quick, bad" in line(row)
    written = json.loads((scratch / "results" / "hpm-no-trigger-quick-bad-3.json").read_text())
    assert (written["seed"], written["method"]) == (3, "paper")


@pytest.mark.slow
def test_a_search_is_followed_and_measured(scratch, coarse):
    row = search_trace.perform(scratch, "hpm", "differential evolution", 1, 0.3)
    points = np.array(row["points"])
    assert points.shape[1] == 5
    assert np.all(np.diff(points[:, 0]) > 0.0)
    assert np.all(np.diff(points[:, 1]) < 0.0)
    assert np.all(points[:, 2:] > 0.0)


@pytest.mark.slow
def test_the_default_is_followed_to_its_end(scratch, coarse, monkeypatch):
    quick = EvidenceSelection(search=SearchSettings(modes=3, population=4, generations=1, steps=1), candidates=1)
    monkeypatch.setattr(search_trace, "EvidenceSelection", lambda: quick)
    points = np.array(search_trace.perform(scratch, "hpm", "default", 1, 0.0)["points"])
    assert len(points) > 2
    assert np.all(np.diff(points[:, 0]) > 0.0)
    # the last two are the same machine, from the progress and from the result
    np.testing.assert_allclose(points[-1, 2:], points[-2, 2:], rtol=1e-6)
