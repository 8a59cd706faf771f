"""A machine whose table gives way over REST: its modes, limits of tool and table together, and tips of the tool alone."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

from rcsa_ident.dynamics.coordinates import Dof
from rcsa_ident.io.results.identifications import identification_to_json
from rcsa_ident.io.results.parts import layout, plain
from rcsa_ident.machine.workpiece_side import WorkpieceAxis, WorkpieceSide
from rcsa_ident.signals.recording import Role
from tests.api.in_process import refused
from tests.fixtures import by_hand

X = WorkpieceAxis(
    "table_x", Role.TABLE, 2.0 * np.pi * np.array([500.0]), np.array([0.03]), np.array([4e5]), np.diag([1e-6, 1e-4, 1e-4]), 80, 1.1, 0.02
)
Y = WorkpieceAxis("table_y", Role.TABLE, np.zeros(0), np.zeros(0), np.zeros(0), np.zeros((0, 0)), 75, 0.9, 2e-3)
SIDE = WorkpieceSide({Dof.X: X, Dof.Y: Y})
SPEEDS = {"from_rpm": 6000, "to_rpm": 13000, "step_rpm": 500}


@pytest.fixture
def text(tmp_path):
    found = replace(by_hand.identification(), workpiece_side=SIDE)
    return layout(plain(identification_to_json(found, by_hand.campaign(tmp_path), []))) + "\n"


@pytest.fixture
def shop(client, text):
    id = client.make_machine("on a table").id
    client.identify(id, text)
    client.write_tooling("T1", by_hand.TOOLING)
    return client, id


def test_its_modes_are_told(shop):
    client, id = shop
    side = client.modes(id).workpiece_side
    mode = side["X"].modes[0]
    assert (mode.natural_frequency_hz, mode.stiffness_n_per_m) == (pytest.approx(500.0), 4e5)
    assert mode.stiffness_std_n_per_m == pytest.approx(4e3)
    assert (side["X"].sensor, side["X"].role, side["X"].lines, side["X"].misfit_per_point) == ("table_x", "table", 80, 1.1)
    assert side["Y"].modes == []


def test_limits_are_those_of_both_and_a_tip_is_the_tools(shop, tmp_path):
    client, id = shop
    rigid = client.make_machine("rigid").id
    client.identify(rigid, by_hand.result_text(tmp_path))
    assert client.modes(rigid).workpiece_side == {}
    one, other = (client.lobes(each, "T1", speeds=SPEEDS, bands=False, recommend=False).toolings[0] for each in (id, rigid))
    assert np.max(np.array(other.limit_depth_mm) / np.array(one.limit_depth_mm)) > 3.0
    tips = [client.tooltip(each, "T1", from_hz=400, to_hz=900, step_hz=5) for each in (id, rigid)]
    assert tips[0].axes == tips[1].axes
    assert any("table_x (on the table) is taken to move as the workpiece does" in warning for warning in tips[0].warnings)
    assert any("stability limits and recommendations hold for tool and workpiece together" in warning for warning in one.warnings)


@pytest.mark.parametrize(
    ("where", "value", "words"),
    [
        (("X", "modes"), [{}] * 1000, "workpiece_side.X.modes"),
        (("X", "modes", 0, "stiffness_n_per_m"), 1e-320, "finite"),
        (("X", "covariance"), {}, "workpiece_side.X.covariance.matrix"),
        (("X",), [], "workpiece_side.X"),
    ],
)
def test_what_does_not_fit_is_refused(client, text, where, value, words):
    data = json.loads(text)
    place = data["workpiece_side"]
    for key in where[:-1]:
        place = place[key]
    place[where[-1]] = value
    problem = refused(422, client.identify, client.make_machine("broken").id, json.dumps(data))
    assert words in str(problem)
