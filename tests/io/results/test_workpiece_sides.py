"""What gives way on the workpiece's side, in RESULT.json and back."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

from rcsa_ident.base.errors import InputError
from rcsa_ident.dynamics.coordinates import Dof
from rcsa_ident.io.results.identifications import identification_to_json, machine_from_json
from rcsa_ident.io.results.parts import read_result, write_result
from rcsa_ident.io.results.updated_results import taught_result
from rcsa_ident.machine.workpiece_side import WorkpieceAxis, WorkpieceSide
from rcsa_ident.signals.recording import Role
from tests.fixtures import by_hand

ROOT = 0.01 * np.random.default_rng(1).normal(size=(6, 6))
SIDE = WorkpieceSide(
    {
        Dof.X: WorkpieceAxis(
            "table_x", Role.TABLE, np.array([3e3, 9e3]), np.array([0.05, 0.02]), np.array([1.2e7, 4e7]), ROOT @ ROOT.T, 80, 1.1, 0.02
        ),
        Dof.Y: WorkpieceAxis("part_y", Role.WORKPIECE, np.zeros(0), np.zeros(0), np.zeros(0), np.zeros((0, 0)), 75, 0.9, 5e-4),
    }
)


@pytest.fixture(scope="module")
def path(tmp_path_factory):
    folder = tmp_path_factory.mktemp("result")
    found = replace(by_hand.identification(), workpiece_side=SIDE)
    write_result(folder / "R.json", identification_to_json(found, by_hand.campaign(folder), []))
    return folder / "R.json"


def test_it_comes_back(path):
    read = machine_from_json(read_result(path), str(path)).workpiece_side
    assert read.axes.keys() == SIDE.axes.keys()
    for axis, each in SIDE.axes.items():
        for name in ("omega_n", "zeta", "stiffness"):
            np.testing.assert_allclose(getattr(read.axes[axis], name), getattr(each, name), rtol=1e-15)
        np.testing.assert_array_equal(read.axes[axis].covariance, each.covariance)
        for name in ("sensor", "role", "lines", "chi2_per_point", "model_error"):
            assert getattr(read.axes[axis], name) == getattr(each, name)


def test_it_is_written_in_the_fields_units(path):
    x = json.loads(path.read_text())["workpiece_side"]["X"]
    assert x["modes"][0]["natural_frequency_hz"] == pytest.approx(3e3 / (2.0 * np.pi))
    assert x["modes"][0]["stiffness_std_n_per_m"] == pytest.approx(1.2e7 * np.sqrt((ROOT @ ROOT.T)[4, 4]))
    assert (x["sensor"], x["role"], x["covariance"]["parameters"][2]) == ("table_x", "table", "log damping_ratio of mode 1")
    assert json.loads(path.read_text())["workpiece_side"]["Y"]["modes"] == []


def test_a_machine_that_is_taught_keeps_it(path):
    data = read_result(path)
    machine = machine_from_json(data, "")
    assert taught_result(data, machine, "again")["workpiece_side"] == data["workpiece_side"]


def test_a_result_without_it_has_none(tmp_path):
    data = identification_to_json(by_hand.identification(), by_hand.campaign(tmp_path), [])
    assert "workpiece_side" not in data
    assert machine_from_json(data, "").workpiece_side is None


@pytest.mark.parametrize(
    ("where", "value", "words"),
    [
        (("Z",), {}, "workpiece_side: found Z, allowed is X, Y or both"),
        (("X", "role"), "spindle", "workpiece_side.X.role: found the text \"spindle\", allowed is one of table, workpiece"),
        (("X", "modes", 0, "stiffness_n_per_m"), -1.0, "workpiece_side.X.modes[0].stiffness_n_per_m: found -1"),
        (("X", "modes", 0, "damping_ratio"), 1.5, "workpiece_side.X.modes[0].damping_ratio: found 1.5"),
        (("X", "covariance", "matrix"), [[1.0]], "workpiece_side.X.covariance.matrix: found a list of 1, allowed is 6 rows"),
        (("Y", "modes"), "none", "workpiece_side.Y.modes: found the text \"none\""),
    ],
)  # fmt: skip
def test_a_broken_one_is_refused(path, where, value, words):
    data = json.loads(path.read_text())
    place = data["workpiece_side"]
    for key in where[:-1]:
        place = place[key]
    place[where[-1]] = value
    with pytest.raises(InputError) as error:
        machine_from_json(data, "R.json")
    assert str(error.value).startswith("R.json: ")
    assert words in str(error.value)
