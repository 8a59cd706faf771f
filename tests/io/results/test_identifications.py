"""RESULT.json and the machine in it: the posterior comes back bit by bit, from old files too; what does not fit is named."""

from __future__ import annotations

import copy
import json
import math
from dataclasses import replace

import numpy as np
import pytest

from rcsa_ident.base.errors import InputError
from rcsa_ident.dynamics.coordinates import Dof
from rcsa_ident.identification.learned_changes import LearnedChanges, LearnedWarming
from rcsa_ident.io.results.identifications import (
    identification_to_json,
    machine_from_json,
    speed_band_to_json,
)
from rcsa_ident.io.results.parts import read_result, write_result
from rcsa_ident.signals.recording import Quantity, Role, Sensor
from tests.fixtures import by_hand


@pytest.fixture(params=[False, True], ids=["still", "softening"])
def softening(request):
    return request.param


@pytest.fixture
def found(softening):
    return by_hand.identification(softening)


@pytest.fixture
def path(tmp_path, found):
    write_result(tmp_path / "R.json", identification_to_json(found, by_hand.campaign(tmp_path), by_hand.LEFT_OUT))
    return tmp_path / "R.json"


def test_the_posterior_comes_back_bit_by_bit(path, found, softening):
    machine = machine_from_json(read_result(path), str(path)).identified
    omega = 2.0 * np.pi * np.linspace(300.0, 3000.0, 50)
    for axis, part in found.axes.items():
        read, wrote = machine[axis].posterior, part.posterior
        assert read.layout == wrote.layout
        assert read.layout.softening is softening
        np.testing.assert_array_equal(read.theta, wrote.theta)
        np.testing.assert_array_equal(read.covariance, wrote.covariance)
        np.testing.assert_array_equal(read.rivals[0], wrote.rivals[0])
        assert len(read.rivals) == 1
        np.testing.assert_allclose(read.speed_range, wrote.speed_range, rtol=1e-15)
        here, there = (p.machine(axis)[0].receptance(omega).values for p in (read, wrote))
        np.testing.assert_array_equal(here, there)
        np.testing.assert_array_equal(machine[axis].spindle.modes.phi, part.modes.phi)
        assert machine[axis].joint == part.joint


def test_the_file_says_which_machine_changes_with_speed(path, softening):
    axis = read_result(path)["axes"]["X"]
    assert axis["layout"] == {"modes": 2, "softening": softening}
    assert axis["speed_range_rpm"] == pytest.approx([600.0 * 30.0 / math.pi, 1400.0 * 30.0 / math.pi])
    names = axis["covariance"]["parameters"]
    assert len(names) == len(axis["unknowns"]) == len(axis["covariance"]["matrix"])
    assert any(name.startswith("softening") for name in names) is softening


def test_writing_again_what_was_read_gives_the_same_bytes(path, tmp_path):
    write_result(tmp_path / "again.json", read_result(path))
    assert (tmp_path / "again.json").read_bytes() == path.read_bytes()


def test_coefficients_are_factors_and_micrometres(path):
    data = read_result(path)
    assert data["coefficients"] == {
        "tangential coefficient": {"scale": pytest.approx(1.25), "std": pytest.approx(0.025)},
        "run-out of T1": {"runout_um": pytest.approx(-1.0), "std_um": pytest.approx(0.5)},
    }
    assert data["notes"] == ["joint: its rotational damping cannot be told"]


def test_the_workpiece_comes_back_with_what_cuts_left_open_of_it(path, tmp_path, found):
    """K_tc was found a quarter higher, to 2 %: so far the told one may be off. Of k_rc nothing was found."""
    told, read = by_hand.campaign(tmp_path).workpiece, machine_from_json(read_result(path), "").workpiece
    assert read == replace(told, coefficients=replace(told.coefficients, tangential_spread=read.coefficients.tangential_spread))
    assert read.coefficients.tangential_spread == pytest.approx(math.hypot(math.log(1.25), 0.02))
    # the file and the answer itself say the same
    assert replace(found, workpiece=told).machine.workpiece.coefficients.tangential_spread == pytest.approx(
        read.coefficients.tangential_spread
    )


def test_standard_deviations_stand_beside_the_modes(tmp_path, found):
    deviations = {Dof.X: (np.array([2.0 * np.pi, 4.0 * np.pi]), np.array([0.001, 0.002]))}
    data = identification_to_json(found, by_hand.campaign(tmp_path), [], deviations)
    x, y = (data["axes"][name]["modes"] for name in "XY")
    assert [mode["natural_frequency_std_hz"] for mode in x] == pytest.approx([1.0, 2.0])
    assert [mode["damping_ratio_std"] for mode in x] == [0.001, 0.002]
    assert "natural_frequency_std_hz" not in y[0]


def test_a_file_from_before_the_layout_holds_a_machine_that_stays(tmp_path):
    found = by_hand.identification()
    data = identification_to_json(found, by_hand.campaign(tmp_path), [])
    for key in ("notes", "coefficients"):
        del data[key]
    for axis in data["axes"].values():
        for key in ("layout", "speed_range_rpm", "rivals"):
            del axis[key]
    for key in [key for key in data["workpiece"] if "spread" in key]:
        del data["workpiece"][key]
    write_result(tmp_path / "old.json", data)
    read = machine_from_json(read_result(tmp_path / "old.json"), "").identified[Dof.X].posterior
    wrote = found.axes[Dof.X].posterior
    assert read.layout == wrote.layout
    assert read.speed_range == (0.0, 0.0)
    assert read.rivals == ()
    np.testing.assert_array_equal(read.theta, wrote.theta)


def test_without_a_posterior_the_modes_remain(tmp_path):
    found = by_hand.identification()
    found = replace(found, axes={a: replace(p, posterior=None, parameters=()) for a, p in found.axes.items()})
    data = identification_to_json(found, by_hand.campaign(tmp_path), [])
    assert "unknowns" not in data["axes"]["X"]
    part = machine_from_json(data, "").identified[Dof.X]
    assert part.posterior is None
    assert part.at(Dof.X, 900.0)[0] is part.spindle.modes


def edited(path, where, value):
    data = json.loads(path.read_text(encoding="utf-8"))
    inner = data
    for key in where[:-1]:
        inner = inner[key]
    inner[where[-1]] = value
    return data


@pytest.mark.parametrize(
    ("where", "value", "words"),
    [
        (("layout", "modes"), 3, "axes.X.unknowns"),
        (("layout", "modes"), 0, "axes.X.layout.modes"),
        (("layout", "modes"), 2.5, "axes.X.layout.modes"),
        (("layout", "softening"), "no", "axes.X.layout.softening: found the text \"no\", allowed is true or false"),
        (("layout",), [], "axes.X.layout"),
        (("unknowns",), [1.0, 2.0], "axes.X.unknowns: found 2 numbers"),
        (("speed_range_rpm",), [2000.0, 1000.0], "axes.X.speed_range_rpm"),
        (("rivals",), 3.0, "axes.X.rivals"),
        (("rivals",), [[1.0] * 5], "axes.X.rivals[0]: found 5 numbers"),
        (("rivals",), [["a"]], "axes.X.rivals[0]"),
    ],
)  # fmt: skip
def test_a_posterior_that_does_not_fit_is_named(path, where, value, words):
    data = edited(path, ("axes", "X", *where), value)
    with pytest.raises(InputError) as error:
        machine_from_json(data, "R.json")
    assert str(error.value).startswith("R.json: ")
    assert words in str(error.value)


def test_speed_bands_come_back_with_their_edges(tmp_path, path, found):
    data = json.loads(path.read_text(encoding="utf-8"))
    assert machine_from_json(data, "").speed_models == ()
    edges = [(600.0, 1000.0), (1000.0, 1400.0)]
    data["speed_bands"] = [speed_band_to_json(speeds, found) for speeds in edges]
    write_result(path, data)
    read = machine_from_json(read_result(path), str(path)).speed_models
    for (speeds, machine, _), wanted in zip(read, edges, strict=True):
        assert speeds == pytest.approx(wanted, rel=1e-14)
        np.testing.assert_array_equal(machine[Dof.Y].posterior.theta, found.axes[Dof.Y].posterior.theta)


@pytest.mark.parametrize(
    ("key", "value", "words"),
    [
        ("speed_range_rpm", [3.0, 2.0], "speed_bands[0].speed_range_rpm"),
        ("status", "good", "speed_bands[0].status"),
        ("axes", {}, "speed_bands[0].axes"),
    ],
)
def test_a_broken_speed_band_is_not_read(path, found, key, value, words):
    data = json.loads(path.read_text(encoding="utf-8"))
    band = copy.deepcopy(speed_band_to_json((600.0, 1000.0), found))
    data["speed_bands"] = [band | {key: value}]
    path.write_text(json.dumps(data), encoding="utf-8")
    with pytest.raises(InputError) as error:
        read_result(path)
    assert words in str(error.value)


@pytest.mark.parametrize("looks", [{}, {"distance": 0.0, "distance_spread": 0.0}, {"distance": -0.0125, "distance_spread": 2e-3}])
def test_sensors_come_back_with_where_they_look(tmp_path, found, looks):
    campaign = by_hand.campaign(tmp_path)
    gap = Sensor("gap_y", Quantity.DISPLACEMENT, Dof.Y, 2.0, **looks)
    told = replace(campaign, sensors=(*campaign.sensors, gap))
    write_result(tmp_path / "S.json", identification_to_json(replace(found, sensors=told.sensors), told, []))
    read = machine_from_json(read_result(tmp_path / "S.json"), "S.json")
    (again,) = (sensor for sensor in read.sensors if sensor.name == "gap_y")
    assert (again.distance, again.distance_spread) == (pytest.approx(gap.distance), pytest.approx(gap.distance_spread))


def test_sensors_come_back_with_role_and_mount(tmp_path, found):
    campaign = by_hand.campaign(tmp_path)
    felt = Sensor("felt_x", Quantity.ACCELERATION, Dof.X, 2.0, 1e-5, 9e3, role=Role.SPINDLE, mount_resonance=8e3, rotation=-0.03)
    told = replace(campaign, sensors=(*campaign.sensors, felt))
    write_result(tmp_path / "S.json", identification_to_json(replace(found, sensors=told.sensors), told, []))
    read = machine_from_json(read_result(tmp_path / "S.json"), "S.json")
    assert next(sensor for sensor in read.sensors if sensor.name == "felt_x") == felt


def warming_file(folder, softening=False, **changed):
    data = identification_to_json(by_hand.warming_identification(softening), by_hand.campaign(folder), by_hand.LEFT_OUT)
    write_result(folder / "W.json", data | changed)
    return folder / "W.json"


def test_what_was_learned_comes_back(tmp_path, softening):
    path = warming_file(tmp_path, softening)
    read, wrote = machine_from_json(read_result(path), str(path)), by_hand.warming_identification(softening).machine
    assert read.warming == wrote.warming
    law, told = by_hand.CHANGES.law, read.workpiece.coefficients
    assert [read.workpiece.at(feed).tangential for feed in (0.1e-3, 0.3e-3)] == pytest.approx(
        [told.tangential, 3.0**-0.08 * told.tangential]
    )
    assert read.workpiece.law.entry[0] == pytest.approx(law.entry[0])
    for axis, part in wrote.identified.items():
        there, here = part.posterior.warmed, read.identified[axis].posterior.warmed
        for name in ("change", "cross", "covariance"):
            np.testing.assert_array_equal(getattr(here, name), getattr(there, name))
        np.testing.assert_array_equal(here.rivals[0], there.rivals[0])
    omega = 2.0 * np.pi * np.linspace(300.0, 3000.0, 50)
    found, expected = (each.at_temperature(25.0).tip(by_hand.tooling(), omega) for each in (read, wrote))
    np.testing.assert_allclose(found.values, expected.values, rtol=1e-12)
    for pair, deviation in expected.deviation().items():
        np.testing.assert_allclose(found.deviation()[pair], deviation, rtol=1e-9)


@pytest.mark.parametrize("warmed_up", [False, True])
def test_warming_by_the_clock_comes_back(tmp_path, warmed_up):
    wrote = LearnedWarming(-0.02, 0.001, 840.0, 1.2, warmed_up=warmed_up)
    found = by_hand.warming_identification(changes=LearnedChanges(wrote))
    write_result(tmp_path / "C.json", identification_to_json(found, by_hand.campaign(tmp_path), by_hand.LEFT_OUT))
    read = machine_from_json(read_result(tmp_path / "C.json"), "C.json").warming
    assert (read.time_constant, read.exponent, read.warmed_up) == (840.0, 1.2, warmed_up)


def test_the_file_says_what_was_learned(tmp_path):
    learned = read_result(warming_file(tmp_path))["learned"]
    assert learned["in_words"] == list(by_hand.CHANGES.words)
    assert learned["warming"] == pytest.approx(
        {"by": "temperature", "frequency_percent": -5.0, "frequency_std_percent": 0.2, "coldest_c": 22.0, "warmest_c": 38.0}
    )
    assert [(each["axis"], each["kind"], each["order"]) for each in learned["force_orders"]] == [("X", 1, 4), ("X", 1, 8)]
    assert learned["force_orders"][0]["percent"] == pytest.approx(-6.0)
    assert learned["force_orders"][0]["angle_deg"] == pytest.approx(math.degrees(0.02))
    law = learned["force_law"]
    assert law["chip_exponent"] == {"value": -0.08, "std": 0.02}
    assert law["tangential_edge_n_per_mm"] == pytest.approx({"value": -1.9, "std": 0.3})
    assert law["entry_deg"] == [{"kind": 1, "value": pytest.approx(math.degrees(0.01)), "std": pytest.approx(math.degrees(0.002))}]
    assert law["explained_percent"] == pytest.approx(79.0)
    assert law["feed_per_tooth_mm"] == pytest.approx(0.1)
    assert learned["joints"]["T1"] == pytest.approx({"percent": 4.0, "std_percent": 1.56})
    assert learned["joint_in_loudest_cut"]["percent"] == pytest.approx(-3.0)
    assert learned["force_scales"].keys() == {"T1-0", "T1-1"}


def test_a_file_of_what_was_not_learned_says_nothing(path):
    data = read_result(path)
    assert "learned" not in data
    assert "warming" not in data["axes"]["X"]
    assert machine_from_json(data, str(path)).warming is None


@pytest.mark.parametrize(
    ("at", "value", "field"),
    [
        (("learned", "warming", "by"), "clock", "learned.warming.by"),
        (("learned", "warming", "warmest_c"), 22.0, "learned.warming.warmest_c"),
        (("learned", "warming", "frequency_std_percent"), -1.0, "learned.warming.frequency_std_percent"),
        (("axes", "X", "warming", "unknowns"), [0.1], "axes.X.warming.unknowns"),
        (("axes", "X", "warming", "cross"), [[0.1]], "axes.X.warming.cross"),
        (("axes", "X", "warming", "covariance"), 1.0, "axes.X.warming.covariance"),
        (("axes", "X", "warming", "rivals"), [], "axes.X.warming.rivals"),
    ],
)
def test_what_does_not_fit_of_it_is_named(tmp_path, at, value, field):
    data = read_result(warming_file(tmp_path))
    place = data
    for key in at[:-1]:
        place = place[key]
    place[at[-1]] = value
    with pytest.raises(InputError, match=field.replace(".", r"\.")):
        machine_from_json(data, "W.json")
