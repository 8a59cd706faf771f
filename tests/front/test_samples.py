"""Sample data that travel with the package: a machine that makes its recordings where there are none."""

from __future__ import annotations

import tomllib
from functools import partial
from pathlib import Path

import pytest

import rcsa_ident as ri
from rcsa_ident.cli import demo
from rcsa_ident.cli.common import Stages
from rcsa_ident.front import samples
from rcsa_ident.front.processes import Workers
from rcsa_ident.io.settings.machines import read_machine
from tests.fixtures.paths import MACHINES, ROOT, SAMPLES, TOOLINGS


@pytest.fixture
def quick_truth(monkeypatch):
    monkeypatch.setattr("rcsa_ident.workflows.simulate.TRUTH_FREQUENCIES", (100.0, 4500.0, 400.0))


def test_the_wheel_carries_what_a_checkout_has(tmp_path, monkeypatch):
    """Of a checkout the folder of its machines; in an installed package the copy that the wheel's settings ask for."""
    assert samples.sample_data() == MACHINES
    wheel = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["hatch"]["build"]["targets"]["wheel"]
    (source, target), (arms, packed) = wheel["force-include"].items()
    assert ROOT / source == MACHINES
    assert (arms, packed) == ("data/robots", "rcsa_ident/sample_robots")
    installed = tmp_path / target
    installed.mkdir(parents=True)
    (installed / "hpm.toml").touch()
    monkeypatch.setattr("rcsa_ident.base.sample_files.files", lambda package: tmp_path / package)
    assert samples.sample_data() == installed
    (installed / "hpm.toml").unlink()
    with pytest.raises(ri.InputError, match="sample data"):
        samples.sample_data()


def test_published_arms():
    assert [ri.sample_robot(name).name for name in ("tx200", "kr210", "kr500")] == ["Stäubli TX200", "KUKA KR210", "KUKA KR500 R2830"]
    with pytest.raises(ri.InputError, match="one of kr210, kr500, tx200"):
        ri.sample_robot("scara")


@pytest.mark.slow
def test_a_campaign_on_the_spot(tmp_path, quick_truth):
    folder = tmp_path / "new" / "runs"
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(samples, "make_sample_campaign", partial(samples.make_sample_campaign, cuts=2))
        campaign = ri.sample_campaign(folder, processes=2)
    assert [cut.tooling for cut in campaign.cuts] == ["S1-ER32", "S2-PG25"]
    assert {path.name for path in folder.parent.iterdir()} == {"runs", "runs.truth"}
    assert {path.stem for path in (folder.parent / "runs.truth" / "tip").iterdir()} == set(samples.sample_toolings())
    written = {path: path.stat().st_mtime_ns for path in folder.rglob("*")}
    assert samples.make_sample_campaign(folder, cuts=4) == folder
    assert {path: path.stat().st_mtime_ns for path in folder.rglob("*")} == written


def test_what_is_ended_half_way_leaves_nothing(tmp_path, quick_truth):
    def stop(done, total):
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        samples.make_sample_campaign(tmp_path / "runs", cuts=2, progress=stop)
    assert list(tmp_path.iterdir()) == []


def test_both_toolings_cut_alike(tmp_path):
    with pytest.raises(ri.InputError, match="a multiple of 2"):
        samples.make_sample_campaign(tmp_path / "runs", cuts=5)
    assert samples.SAMPLE_CUTS % len(read_machine(MACHINES / "hpm.toml").toolings) == 0


def test_the_demo_takes_what_is_there(tmp_path, monkeypatch):
    made: list[Path] = []
    monkeypatch.setattr(samples, "make_sample_campaign", lambda folder, **_: made.append(folder) or folder)
    monkeypatch.chdir(tmp_path)
    quiet = Stages(quiet=True)
    assert demo._data(None, Path("report"), Workers(), quiet) == (Path("report/sample_runs"), sorted(TOOLINGS.glob("*.toml")))
    assert made == [Path("report/sample_runs")]
    assert demo._data(Path("mine"), Path("report"), Workers(), quiet) == (Path("mine"), [])
    monkeypatch.chdir(ROOT)
    assert demo._data(None, Path("report"), Workers(), quiet)[0].resolve() == SAMPLES
    assert len(made) == 1
