"""The verbs read what they need themselves, tell how far they are only to somebody, and refuse in words."""

from __future__ import annotations

import io
import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import rcsa_ident as ri
from rcsa_ident.front import verbs
from rcsa_ident.identification.arm.posterior import RobotPosterior, RobotUnknowns
from rcsa_ident.identification.arm.result import RobotIdentification
from rcsa_ident.identification.arm.unknowns import PosedLayout, arm_priors
from rcsa_ident.identification.status import Status
from rcsa_ident.identification.unknowns import prior_rows
from tests.fixtures import by_hand
from tests.fixtures.paths import SAMPLES
from tests.fixtures.waiting import PATIENCE


class Answered:
    """A method that has its answer already."""

    def run(self, data, seed, map, progress=None):
        known = by_hand.identification()
        return replace(known, cut_ids=tuple(data.cut_ids), seed=seed, delay=known.delay[: len(data.cut_ids)])


@pytest.fixture
def two_cuts():
    campaign = ri.read_campaign(SAMPLES)
    return replace(campaign, cuts=campaign.cuts[:2])


def test_rpm_and_hz():
    assert ri.rpm(60) == pytest.approx(2.0 * np.pi)
    speeds = ri.rpm(4000, 20_000, 50)
    assert speeds.size == 321
    assert speeds[-1] == pytest.approx(ri.rpm(20_000))
    assert ri.hz(100, 105, 2).tolist() == pytest.approx([ri.hz(100), ri.hz(102), ri.hz(104)])
    with pytest.raises(ri.InputError, match="last and step"):
        ri.rpm(4000, 20_000)
    with pytest.raises(ri.InputError, match="greater than 0"):
        ri.rpm(-1)
    with pytest.raises(ri.InputError, match="4000"):
        ri.rpm(4000, 3000, 50)


def test_identify_reads_and_judges_itself(two_cuts, capsys):
    found = ri.identify(two_cuts, seed=7, method=Answered(), processes=1)
    assert found.identification.cut_ids == tuple(cut.id for cut in two_cuts.cuts)
    assert [reading.verdict.usable for reading in found.readings] == [True, True]
    assert found.data["campaign"]["name"] == two_cuts.name
    assert found.data["seed"] == 7
    assert found.machine.sensors == two_cuts.sensors
    assert capsys.readouterr() == ("", "")


def test_a_robot_is_identified_by_the_same_verb(two_cuts, monkeypatch, tmp_path):
    sheet = ri.sample_robot("tx200")
    priors = arm_priors(sheet)
    layout = PosedLayout(priors.springs, len(sheet.joints) + (sheet.payload is not None), 1)
    rows = prior_rows(layout, priors)
    best = RobotUnknowns(rows.centre, layout)
    posterior = RobotPosterior(sheet, True, best, 1e-4 * np.eye(layout.size), rows.spread)

    def answered(campaign, readings, robot, seed, map):
        ids = tuple(cut.id for cut in campaign.cuts)
        return RobotIdentification(Status.CONVERGED, (), (), seed, posterior, (0.01, 0.01), 1.0, ids, np.zeros((1, 6)), (5.0, 400.0))

    monkeypatch.setattr("rcsa_ident.workflows.identify_robot.identify_robot", answered)
    found = ri.identify(two_cuts, seed=7, robot=sheet, processes=1)
    assert (found.status, found.reasons, found.left_out, found.data["seed"]) == (Status.CONVERGED, (), {}, 7)
    np.testing.assert_array_equal(ri.read_robot_result(found.save(tmp_path / "RESULT.json")).best.theta, best.theta)
    with pytest.raises(ri.InputError, match="begins at the data sheet"):
        ri.identify(two_cuts, method="paper", robot=sheet)


def test_progress_is_one_line_that_ends_with_the_answer(two_cuts, monkeypatch):
    told = io.StringIO()
    monkeypatch.setattr(sys, "stderr", told)
    found = ri.identify(two_cuts, method=Answered(), processes=1, progress=True)
    words = told.getvalue()
    assert words.endswith(f"\r{found}\n")
    assert words.removesuffix(f"{found}\n").count("\n") == 0
    for part in ("recording 1 of 2", "recording 2 of 2", "searching modes"):
        assert part in words


def test_somebody_looks_on_in_a_terminal_or_a_notebook(monkeypatch):
    assert not verbs._somebody_looks()
    monkeypatch.setattr(sys.stderr, "isatty", lambda: True, raising=False)
    assert verbs._somebody_looks()
    monkeypatch.undo()
    shell = type("ZMQInteractiveShell", (), {})
    monkeypatch.setitem(sys.modules, "IPython", type("IPython", (), {"get_ipython": staticmethod(shell)}))
    assert verbs._somebody_looks()


def test_an_unknown_method(two_cuts):
    with pytest.raises(ri.InputError, match="one of default, paper"):
        ri.identify(two_cuts, method="best")
    with pytest.raises(ri.InputError, match="default method"):
        ri.identify(two_cuts, method="paper", start=ri.identify(two_cuts, method=Answered(), processes=1))


def test_start_takes_a_result_or_its_machine(nouns):
    for start in (nouns.read, nouns.machine):
        assert set(verbs._method("default", start).start) == {"x", "y"}
    assert type(verbs._method("paper", None)).__name__ == "PaperGeneticAlgorithm"


def test_processes_do_not_run_the_script_again(tmp_path):
    """A script without a guard: spawned processes import its module, unless they are told of none."""
    (tmp_path / "script.py").write_text(
        "import os\n"
        "from rcsa_ident.front.processes import workers\n"
        "print('once', flush=True)\n"
        "with workers(2, ()) as pool:\n"
        "    print(len(set(pool.map(os.path.basename, ['a/b', 'c/d', 'e/f']))))\n"
        "import __main__; print(__main__.__file__ == __file__)\n"
    )
    done = subprocess.run([sys.executable, "script.py"], cwd=tmp_path, capture_output=True, text=True, check=True)
    assert done.stdout.split() == ["once", "3", "True"]


@pytest.mark.slow
def test_a_method_of_the_script_identifies_with_several_processes(tmp_path):
    """What its long work goes through cannot be found by the helpers: it is done here, and said."""
    (tmp_path / "script.py").write_text(
        "import sys\n"
        "from dataclasses import replace\n"
        "import rcsa_ident as ri\n"
        "from tests.fixtures import by_hand\n"
        "class MyMethod:\n"
        "    def one(self, axis): return axis.upper()\n"
        "    def run(self, data, seed, map, progress=None):\n"
        "        print(*map(self.one, ['x', 'y']))\n"
        "        known = by_hand.identification()\n"
        "        return replace(known, cut_ids=tuple(data.cut_ids), delay=known.delay[: len(data.cut_ids)])\n"
        "campaign = ri.read_campaign(sys.argv[1])\n"
        "campaign = replace(campaign, cuts=campaign.cuts[:2])\n"
        "print(ri.identify(campaign, method=MyMethod(), processes=2))\n"
    )
    root = Path(__file__).parents[2]
    done = subprocess.run(
        [sys.executable, "script.py", str(SAMPLES)],
        cwd=tmp_path,
        env=os.environ | {"PYTHONPATH": str(root)},
        capture_output=True,
        text=True,
        timeout=PATIENCE,
        check=True,
    )
    assert done.stdout.splitlines()[0] == "X Y"
    assert "2 cuts" in done.stdout
    assert "MyMethod is defined in the script that runs" in done.stderr


def test_forces_of_a_file_need_sensors(nouns):
    with pytest.raises(ri.InputError, match="sensors"):
        ri.estimate_forces(nouns.flange, nouns.tooling, "cut.h5")


@pytest.mark.slow
def test_advise_takes_a_result(nouns):
    speeds = ri.rpm(6000, 9000, 500)
    here, there = (ri.advise(each, nouns.tooling, speeds=speeds) for each in (nouns.read, nouns.machine))
    assert np.array_equal(here.lobes.limit_depth, there.lobes.limit_depth)
    assert here.remarks


def test_sample_toolings():
    assert ri.sample_tooling("S3-PG25-long").cutter.teeth == 4
    with pytest.raises(ri.InputError, match="one of S1-ER32, S2-PG25, S3-PG25-long, S4-shrink"):
        ri.sample_tooling("S9")


@pytest.mark.slow
def test_a_sample_campaign_that_is_there_is_read(tmp_path):
    (tmp_path / "runs").symlink_to(SAMPLES, target_is_directory=True)
    assert len(ri.sample_campaign(tmp_path / "runs").cuts) == 80


def test_a_folder_with_something_else(tmp_path):
    (tmp_path / "mine.txt").write_text("mine")
    with pytest.raises(ri.InputError, match="an empty folder"):
        ri.sample_campaign(tmp_path, processes=1)


@pytest.mark.parametrize("name", ["httpx2", "api.client"])
def test_connect_says_what_is_missing(name, monkeypatch):
    for loaded in [each for each in sys.modules if each.startswith("api.client")]:
        monkeypatch.delitem(sys.modules, loaded)
    monkeypatch.setitem(sys.modules, name, None)
    expected = (ri.InputError, "no httpx2") if name == "httpx2" else (ModuleNotFoundError, "api.client")
    with pytest.raises(expected[0], match=expected[1]):
        ri.connect()


def test_connect_beside_another_api(tmp_path):
    """Another package called api stands in front of this one."""
    (tmp_path / "api").mkdir()
    (tmp_path / "api" / "__init__.py").write_text("")
    code = "import rcsa_ident as ri\ntry:\n    ri.connect()\nexcept ri.InputError as error:\n    print(error)"
    done = subprocess.run([sys.executable, "-c", code], cwd=tmp_path, capture_output=True, text=True, check=True)
    assert "a package of that name from elsewhere" in done.stdout
    assert str(tmp_path / "api" / "__init__.py") in done.stdout


def test_connect():
    pytest.importorskip("httpx2")
    from api.client import Client

    with ri.connect("http://127.0.0.1:9", key="k") as shop:
        assert isinstance(shop, Client)
        assert shop.headers == {"X-API-Key": "k"}
