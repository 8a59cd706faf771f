import json
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from benchmarks import comparison, search_trace, study, yardstick
from benchmarks.comparison import BANDS, FREQUENCY, compared, compared_at_speeds, coverage, in_deviations, relative_error
from benchmarks.machines import CONDITIONS, SENSOR_TESTS
from benchmarks.page import read_rows
from benchmarks.study import INSIDE, Run, planned
from benchmarks.study_table import counts, coupled_table, line, sensors_table, table
from rcsa_ident.base.errors import InputError
from rcsa_ident.coupling.joint import LumpedJoint
from rcsa_ident.dynamics.coordinates import Dof, plane
from rcsa_ident.dynamics.modal import ModalModel
from rcsa_ident.dynamics.uncertain import UncertainReceptance
from rcsa_ident.identification.evidence import EvidenceSelection
from rcsa_ident.identification.genetic_algorithm import PaperGeneticAlgorithm
from rcsa_ident.identification.search import SearchSettings
from rcsa_ident.io.curves.tips import write_frf_csv
from rcsa_ident.io.settings.machines import read_machine
from rcsa_ident.io.settings.setups import read_tooling
from rcsa_ident.machine.flange_machine import FlangeMachine
from rcsa_ident.stability.tip_modes import TIP

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


def test_a_failed_identification_predicts_no_motion(tmp_path):
    files = [TOOLINGS / f"{name}.toml" for name in ("S1-ER32", "S2-PG25", "S3-PG25-long", "S4-shrink")]
    found = compared(None, SimpleNamespace(toolings=files[:2], truth_toolings=files[2:]), tmp_path)
    assert found == {kind: {"errors": [1.0] * n, "bands": None} for kind, n in (("cut", 4), ("similar", 2), ("different", 2))}


class Known:
    """A machine that knows the truth but for a factor on each term at each speed."""

    def __init__(self, truth, factors, speed=None):
        self.truth, self.factors, self.speed = truth, factors, speed

    def at(self, speed):
        return Known(self.truth, self.factors, round(speed))

    def tip(self, tooling, omega):
        values = np.array(self.factors.get((tooling.name, self.speed), np.ones((2, 2)))) * self.truth[tooling.name, self.speed]
        return UncertainReceptance(omega, values, TIP, TIP)


def test_cross_terms_are_compared_at_the_worst_of_three_speeds(tmp_path):
    names = ("S1-ER32", "S2-PG25", "S3-PG25-long", "S4-shrink")
    files = [TOOLINGS / f"{name}.toml" for name in names]
    (tmp_path / "tip").mkdir()
    frequency = np.arange(5.0, 4500.1, 5.0)
    rng = np.random.default_rng(3)
    truth = {}
    for name in names:
        for speed, ending in ((800, "-7639rpm"), (1000, ""), (1200, "-11459rpm")):
            # every curve has as large a norm in the band as its entry says
            values = np.exp(2j * np.pi * rng.random((frequency.size, 2, 2))) * [[1.0, 0.1], [0.2, 2.0]]
            further = {"XY": values[:, 0, 1], "YX": values[:, 1, 0]}
            parts = {f"{key}_{part}": getattr(v, full) for key, v in further.items() for part, full in (("re", "real"), ("im", "imag"))}
            write_frf_csv(tmp_path / "tip" / f"{name}{ending}.csv", frequency, {"X": values[:, 0, 0], "Y": values[:, 1, 1]}, parts)
            truth[name, speed] = values[(frequency >= 599.0) & (frequency <= 4001.0)]
    factors = {
        ("S1-ER32", 800): [[1.1, 1.0], [1.0, 1.0]],
        ("S1-ER32", 1200): [[1.0, 1.0], [1.0, 0.8]],
        ("S3-PG25-long", 1000): [[1.0, 1.5], [1.0, 1.0]],
        ("S4-shrink", 1200): [[1.0, 1.5], [0.0, 1.0]],
    }
    plan = SimpleNamespace(spindle_speeds=(800.0, 1000.0, 1200.0))
    turning = SimpleNamespace(speed_dependent=True)
    setup = SimpleNamespace(toolings=files[:2], truth_toolings=files[2:], plan=plan, spindle=turning)
    found = compared_at_speeds(Known(truth, factors), setup, tmp_path)
    assert found["cut"]["errors"] == pytest.approx([0.1, 0.2, 0.0, 0.0], abs=1e-4)
    assert found["cut"]["cross"] == found["cut"]["cross_own"] == pytest.approx([0.0, 0.0], abs=1e-4)
    assert found["similar"]["errors"] == pytest.approx([0.0, 0.0], abs=1e-4)
    # 0.5 of 0.1, over 1 and over itself
    assert (found["similar"]["cross"], found["similar"]["cross_own"]) == ([pytest.approx(0.05)], [pytest.approx(0.5)])
    # YX is lost: 0.2 over 2
    assert (found["different"]["cross"], found["different"]["cross_own"]) == ([pytest.approx(0.1)], [pytest.approx(1.0)])
    lost = compared_at_speeds(None, setup, tmp_path)
    assert lost["cut"]["errors"] == [1.0] * 4
    assert (lost["cut"]["cross"], lost["cut"]["cross_own"]) == ([pytest.approx(0.1)] * 2, [1.0] * 2)
    assert all(lost[kind]["bands"] is None for kind in lost)
    # a machine that no speed changes has one file of each tooling, true of all speeds
    for path in (tmp_path / "tip").glob("*rpm.csv"):
        path.unlink()
    setup.spindle.speed_dependent = False
    same = {(name, speed): truth[name, 1000] for name, speed in truth}
    found = compared_at_speeds(Known(same, {("S2-PG25", 800): [[1.0, 1.0], [1.0, 1.3]]}), setup, tmp_path)
    assert found["cut"]["errors"] == pytest.approx([0.0, 0.0, 0.0, 0.3], abs=1e-4)


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
    assert "- 2, trigger; 5, trigger: a doubt" in text


def coupled_row(machine, errors, cross, own, status="converged"):
    found = row(machine, errors, errors, status, condition="no-trigger")
    for kind, count in (("cut", 2), ("similar", 1), ("different", 1)):
        found[kind] |= {"cross": [cross] * count, "cross_own": [own] * count}
    return found


def test_the_table_of_coupled_machines_holds_their_cross_terms():
    rows = [coupled_row("coupled-201", [0.004, 0.006], 0.002, 0.04), coupled_row("coupled-202", [0.06, 0.02], 0.01, 0.2, "suspect")]
    text = coupled_table(rows)
    assert "| no-trigger | similar | 2 | 0.0130 | 0.0600 | 0.0060 | 0.0100 | 0.1200 | 0.2000 | 1 of 2 | 5.0 |" in text
    assert "| coupled-201 | no-trigger | 1 | 0.0010 | 0.0010 | 0.0020 | 0.0400 | 0.0040 | 0.0060 |" in text
    assert "Of 2 runs, 0 are `converged` with an error above 0.05" in text
    assert "- coupled-202, no-trigger: a doubt" in text
    assert "XY over direct, over own 0.0020  0.0400" in line(rows[0])


def test_every_set_of_sensors_has_its_row():
    errors = {name: 0.001 * (k + 1) for k, name in enumerate(SENSOR_TESTS)}
    rows = [row("1", [0.001], [value], "suspect", condition=name) for name, value in errors.items()]
    rows = [{**each, "cut": {"errors": [0.002, 0.004], "bands": None}} for each in rows]
    for each in rows:
        each["different"]["bands"] = {"50": 0.5, "90": 0.75, "rms": 1.0}
    found = sensors_table(rows).splitlines()
    for name, value in errors.items():
        assert name in CONDITIONS
        (line_of,) = [text for text in found if f"`{name}`" in text]
        cells = [cell.strip() for cell in line_of.split("|")[3:-1]]
        assert cells == ["1", f"{value:.4f}", f"{value:.4f}", "0.0030", "0.0040", "75 %", "0 of 1"]


def test_the_published_method_is_not_run_on_coupled_machines():
    runs = planned(["1", "coupled-201"], ["no-trigger"], ["default", "paper, literal"], [1])
    assert [(r.machine, r.method) for r in runs] == [("1", "default"), ("1", "paper, literal"), ("coupled-201", "default")]


def test_every_run_is_planned_once():
    runs = planned(["1", "2", INSIDE], ["trigger", "no-trigger"], ["default", "paper, literal"], [1, 2])
    assert len(set(runs)) == len({r.name for r in runs}) == len(runs) == 2 * (2 + 2 * 2) + 2 * 2
    assert Run("1", "trigger", "paper, literal", 1) not in runs
    assert Run(INSIDE, "no-trigger", "paper, literal", 2) in runs
    assert all(r.condition == "no-trigger" for r in runs if r.machine == INSIDE)


def test_a_study_goes_on_behind_a_campaign_that_is_refused(tmp_path, monkeypatch, capsys):
    def read_data(folder, condition):
        raise InputError("toolings", "one alone", "two")

    monkeypatch.setattr(study, "warm", lambda: None)
    monkeypatch.setattr(study, "machine_of", lambda scratch, name: None)
    monkeypatch.setattr(study, "read_data", read_data)
    monkeypatch.setattr(study, "campaign_folder", lambda scratch, *campaign: scratch / campaign[0])
    assert study.run(tmp_path, ["1", "2"], ["trigger"], ["default"]) == []
    assert capsys.readouterr().out.count("refused: toolings: found one alone") == 2
    assert not (tmp_path / "results.jsonl").exists()


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
    for module in (comparison, yardstick):
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
