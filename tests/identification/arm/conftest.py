"""A campaign on a virtual robot, simulated and read once, and what the command finds in it."""

from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory

import pytest

from rcsa_ident.io.recordings.readers import read_cut
from rcsa_ident.io.results.robot_results import read_robot_result
from rcsa_ident.io.settings.robots import robot_keys
from rcsa_ident.io.settings.setups import read_campaign
from rcsa_ident.io.toml_text import toml_of
from rcsa_ident.workflows.identify import judge
from tests.fixtures.kept import kept
from tests.identification.arm.robots import run, sheet, write_campaign


def _files():
    with TemporaryDirectory() as scratch:
        written = write_campaign(Path(scratch))
        return {path.relative_to(scratch): path.read_bytes() for path in written.rglob("*") if path.is_file()}


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return _put(tmp_path_factory.mktemp("robot"))


def _put(place):
    """Write the campaign there."""
    for name, content in kept(_files).items():
        (place / name).parent.mkdir(parents=True, exist_ok=True)
        (place / name).write_bytes(content)
    return place / "campaign"


@pytest.fixture(scope="module")
def cuts(folder):
    """The campaign and its readings."""
    campaign = read_campaign(folder)
    return campaign, tuple(judge(campaign, partial(read_cut, campaign.sensors, campaign.sampling_rate)))


@pytest.fixture(scope="module")
def robot_file(folder):
    return _described(folder.parent)


def _described(place):
    path = place / "robot.toml"
    path.write_text(toml_of(robot_keys(sheet())))
    return path


@pytest.fixture(scope="module")
def told(folder):
    """What the command says, and the posterior that it has written."""
    answer, text = kept(_told)
    out = folder.parent / "RESULT.json"
    out.write_text(text, encoding="utf-8")
    return answer, out, read_robot_result(out)


def _told():
    with TemporaryDirectory() as scratch:
        place = Path(scratch)
        out = place / "RESULT.json"
        answer = run("robot", "identify", _described(place), _put(place), "--out", out, "--json")
        return answer, out.read_text(encoding="utf-8")
