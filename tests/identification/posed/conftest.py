"""A campaign on a virtual robot, simulated and read once, and what the command finds in it."""

from functools import partial

import pytest

from rcsa_ident.io.recordings import read_cut
from rcsa_ident.io.robot_results import read_robot_result
from rcsa_ident.io.robots import robot_keys
from rcsa_ident.io.setups import read_campaign
from rcsa_ident.io.toml_text import toml_of
from rcsa_ident.workflows.identify import judge
from tests.identification.posed.robots import run, sheet, write_campaign


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return write_campaign(tmp_path_factory.mktemp("robot"))


@pytest.fixture(scope="module")
def cuts(folder):
    """The campaign and its readings."""
    campaign = read_campaign(folder)
    return campaign, tuple(judge(campaign, partial(read_cut, campaign.sensors, campaign.sampling_rate)))


@pytest.fixture(scope="module")
def robot_file(folder):
    path = folder.parent / "robot.toml"
    path.write_text(toml_of(robot_keys(sheet())))
    return path


@pytest.fixture(scope="module")
def told(folder, robot_file):
    """What the command says, and the posterior that it has written."""
    out = folder.parent / "RESULT.json"
    answer = run("robot", "identify", robot_file, folder, "--out", out, "--json")
    return answer, out, read_robot_result(out)
