"""`both_planes` of RESULT.json: it comes back bit by bit, in single speed bands too; what does not fit is named."""

from __future__ import annotations

import copy
import json
from dataclasses import replace

import numpy as np
import pytest

from rcsa_ident.base.errors import InputError
from rcsa_ident.identification.coupled.posterior import CoupledUnknowns
from rcsa_ident.identification.unknowns import CoupledLayout
from rcsa_ident.io.results.identifications import identification_to_json, machine_from_json, speed_band_to_json
from rcsa_ident.io.results.parts import plain, read_result, write_result
from rcsa_ident.workflows.identify import mode_deviations
from tests.fixtures import by_hand, coupled_by_hand
from tests.identification.coupled.models import coupled_vector

OMEGA = 2.0 * np.pi * np.linspace(300.0, 3000.0, 50)


@pytest.fixture(params=[0, 1, -1])
def turning(request):
    return request.param


@pytest.fixture
def path(tmp_path, turning):
    found = coupled_by_hand.identification(turning)
    content = identification_to_json(found, by_hand.campaign(tmp_path), by_hand.LEFT_OUT, mode_deviations(found))
    write_result(tmp_path / "R.json", content)
    return tmp_path / "R.json"


def same(one, other):
    assert one.best.layout == other.best.layout
    np.testing.assert_array_equal(one.best.theta, other.best.theta)
    np.testing.assert_array_equal(one.covariance, other.covariance)
    np.testing.assert_array_equal(one.rivals[0].theta, other.rivals[0].theta)
    np.testing.assert_allclose(one.speed_range, other.speed_range, rtol=1e-14)


def test_it_comes_back_bit_by_bit(path, turning):
    found = coupled_by_hand.identification(turning)
    machine = machine_from_json(read_result(path), str(path))
    same(machine.whole, found.whole)
    one, other = (each.tip(by_hand.tooling(), OMEGA) for each in (machine, found.machine))
    np.testing.assert_allclose(one.values, other.values, rtol=1e-10)


def test_its_modes_are_to_be_read(path):
    modes = read_result(path)["both_planes"]["modes"]
    np.testing.assert_allclose([m["direction_deg"] for m in modes], np.degrees(coupled_by_hand.ANGLES), atol=0.1)
    assert all(0.0 < m["natural_frequency_std_hz"] < 20.0 and 0.0 < m["damping_ratio_std"] < 0.01 for m in modes)


def test_a_speed_band_has_its_own(tmp_path, path, turning):
    data = json.loads(path.read_text(encoding="utf-8"))
    coupled, plain = coupled_by_hand.identification(turning), by_hand.identification()
    data["speed_bands"] = [speed_band_to_json((600.0, 1000.0), coupled), speed_band_to_json((1000.0, 1400.0), plain)]
    write_result(path, data)
    one, two = machine_from_json(read_result(path), str(path)).speed_models
    same(one.whole, coupled.whole)
    assert two.whole is None


@pytest.mark.parametrize(
    ("where", "value", "words"),
    [
        (("covariance", "matrix"), [[1.0]], "both_planes.covariance.matrix"),
        (("covariance", "matrix"), [1.0, [2.0]], "both_planes.covariance.matrix"),
        (("covariance",), {}, "both_planes.covariance.matrix"),
        (("covariance",), 3, "both_planes.covariance"),
        (("unknowns",), [1.0, 2.0], "both_planes.unknowns: found 2 numbers"),
        (("layout",), None, "both_planes.layout"),
        (("layout", "modes"), 3, "both_planes.unknowns"),
        (("layout", "turning"), 2, "both_planes.layout.turning"),
        (("layout", "softening"), 1, "both_planes.layout.softening"),
        (("speed_range_rpm",), [3.0, 2.0], "both_planes.speed_range_rpm"),
        (("rivals",), [{"unknowns": [1.0]}], "both_planes.rivals[0].layout"),
        (("modes",), [{}], "both_planes.modes[0].natural_frequency_hz"),
        (("modes", 1, "direction_deg"), None, "both_planes.modes[1].direction_deg"),
        (("modes", 1, "phi"), [[1.0, 2.0]], "both_planes.modes[1].phi"),
        (("modes", 1, "phi"), [[1.0, 2.0]] * 3 + [[1.0, None]], "both_planes.modes[1].phi"),
        (("in_words",), 3, "both_planes.in_words"),
    ],
)  # fmt: skip
def test_what_does_not_fit_is_named(path, where, value, words):
    data = json.loads(path.read_text(encoding="utf-8"))
    place = data["both_planes"]
    for key in where[:-1]:
        place = place[key]
    place[where[-1]] = value
    with pytest.raises(InputError) as error:
        machine_from_json(data, "R.json")
    assert str(error.value).startswith("R.json: ")
    assert words in str(error.value)


def test_a_covariance_is_one(path):
    data = json.loads(path.read_text(encoding="utf-8"))
    broken = copy.deepcopy(data)
    broken["both_planes"]["covariance"]["matrix"][0][0] = -1.0
    with pytest.raises(InputError, match="variance below 0"):
        machine_from_json(broken, "R.json")


def test_one_without_rivals_comes_back(tmp_path):
    found = coupled_by_hand.identification(1)
    found = replace(found, whole=replace(found.whole, rivals=()))
    data = json.loads(json.dumps(plain(identification_to_json(found, by_hand.campaign(tmp_path), []))))
    assert machine_from_json(data, "R.json").whole.rivals == ()


def test_rivals_of_any_number_of_modes_and_discs(tmp_path):
    layouts = CoupledLayout(2), CoupledLayout(5, softening=True, skew=2, turning=1), CoupledLayout(3, skew=1, turning=-1)
    rivals = tuple(CoupledUnknowns(coupled_vector(layout), layout) for layout in layouts)
    found = coupled_by_hand.identification(1)
    found = replace(found, whole=replace(found.whole, rivals=rivals))
    data = json.loads(json.dumps(plain(identification_to_json(found, by_hand.campaign(tmp_path), []))))
    for read, wrote in zip(machine_from_json(data, "R.json").whole.rivals, rivals, strict=True):
        assert read.layout == wrote.layout
        np.testing.assert_array_equal(read.theta, wrote.theta)


@pytest.mark.parametrize("key", ["layout", "unknowns", "covariance", "speed_range_rpm", "rivals", "modes"])
def test_what_is_missing_is_named(path, key):
    data = json.loads(path.read_text(encoding="utf-8"))
    del data["both_planes"][key]
    with pytest.raises(InputError, match=rf"R\.json: both_planes\.{key}: found nothing, allowed is"):
        machine_from_json(data, "R.json")
