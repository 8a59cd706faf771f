"""``both_planes`` of RESULT.json: the machine comes back bit by bit, its directions can be read, what does not fit is named."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

from rcsa_ident.errors import InputError
from rcsa_ident.identification.coupled.parameters import EVERY_PAIR, CoupledLayout, parameter_names
from rcsa_ident.identification.coupled.posterior import CoupledPosterior, CoupledUnknowns
from rcsa_ident.io.both_planes import both_planes_from_json, both_planes_to_json
from rcsa_ident.io.identifications import identification_to_json, machine_from_json, speed_band_to_json
from rcsa_ident.io.results import read_result, write_result
from rcsa_ident.io.validated_table import Table
from rcsa_ident.units import to_rpm
from tests.fixtures import by_hand
from tests.identification.coupled.models import coupled_vector

LAYOUT = CoupledLayout(3, softening=True, skew=1, turning=1)
RIVALS = (CoupledLayout(2, skew=2, turning=1),)
#: A rival with too few unknowns.
SHORT = {"layout": {"modes": 2, "discs": 0, "turning": 0}, "unknowns": [0.0]}
OMEGA = 2.0 * np.pi * np.linspace(300.0, 3000.0, 20)


def unknowns(layout=LAYOUT, seed=1):
    return CoupledUnknowns(coupled_vector(layout, seed), layout)


def posterior(layout=LAYOUT, rivals=RIVALS):
    best = unknowns(layout)
    root = 1e-3 * np.random.default_rng(4).standard_normal((best.theta.size, best.theta.size))
    return CoupledPosterior(best, root @ root.T, by_hand.SPEEDS, tuple(unknowns(rival, 2) for rival in rivals))


def identification(known):
    """An answer both of whose planes are one machine: its axes have no unknowns of their own."""
    found = by_hand.identification()
    axes = {axis: replace(part, posterior=None, parameters=()) for axis, part in found.axes.items()}
    return replace(found, axes=axes, whole=known)


@pytest.fixture
def path(tmp_path):
    write_result(tmp_path / "R.json", identification_to_json(identification(posterior()), by_hand.campaign(tmp_path), []))
    return tmp_path / "R.json"


def back(known):
    """Through the text of a file."""
    return both_planes_from_json(Table(json.loads(json.dumps(both_planes_to_json(known))), "R.json", "both_planes"))


@pytest.mark.parametrize("layout", [LAYOUT, CoupledLayout(4), CoupledLayout(2, skew=2, turning=-1), CoupledLayout(2, turning=1)])
@pytest.mark.parametrize("rivals", [(), (CoupledLayout(2),), (CoupledLayout(5, softening=True), CoupledLayout(2, skew=1, turning=-1))])
def test_it_comes_back_bit_by_bit(layout, rivals):
    wrote = posterior(layout, rivals)
    read = back(wrote)
    for one, other in zip((read.best, *read.rivals), (wrote.best, *wrote.rivals), strict=True):
        assert one.layout == other.layout
        np.testing.assert_array_equal(one.theta, other.theta)
    np.testing.assert_array_equal(read.covariance, wrote.covariance)
    np.testing.assert_allclose(read.speed_range, wrote.speed_range, rtol=1e-14)
    for speed in (None, 600.0, 2000.0):
        here, there = (known.candidate(known.best, speed).flange.receptance(OMEGA).values for known in (read, wrote))
        np.testing.assert_allclose(here, there, rtol=1e-10)


def test_a_result_holds_it_and_its_machine_is_one(path):
    machine, wrote = machine_from_json(read_result(path), str(path)), posterior()
    np.testing.assert_array_equal(machine.whole.best.theta, wrote.best.theta)
    assert machine.turning == pytest.approx(by_hand.SPEEDS[0])
    assert len(machine.parts) == 1
    write_result(path.with_name("again.json"), read_result(path))
    assert path.with_name("again.json").read_bytes() == path.read_bytes()


def test_planes_apart_have_no_such_block(tmp_path):
    data = identification_to_json(by_hand.identification(), by_hand.campaign(tmp_path), [])
    assert "both_planes" not in data
    assert machine_from_json(data, "").whole is None


def test_what_is_there_to_be_read():
    known = posterior()
    data = both_planes_to_json(known)
    assert data["layout"] == {"modes": 3, "softening": True, "discs": 1, "turning": 1}
    assert data["covariance"]["parameters"] == list(parameter_names(LAYOUT))
    assert len(data["unknowns"]) == len(data["covariance"]["matrix"]) == LAYOUT.size
    assert data["speed_range_rpm"] == pytest.approx([to_rpm(600.0), to_rpm(1400.0)])
    skew = np.array(data["gyroscopic"])
    np.testing.assert_array_equal(skew, -skew.T)
    # standing modes make the standing machine
    total = np.array(data["residual_compliance"]) + np.zeros((OMEGA.size, 4, 4), dtype=complex)
    for mode in data["modes"]:
        phi = np.array(mode["phi"]) @ [1.0, 1.0j]
        natural, zeta = 2.0 * np.pi * mode["natural_frequency_hz"], mode["damping_ratio"]
        pole = natural * (-zeta + 1j * np.sqrt(1.0 - zeta**2))
        for p, shape in ((pole, phi), (pole.conjugate(), phi.conjugate())):
            total += np.outer(shape, shape) / (1j * OMEGA - p)[:, None, None]
    expected = known.best.standing().receptance(OMEGA).values
    scale = np.abs(expected).max(axis=0)
    np.testing.assert_allclose(total / scale, expected / scale, atol=1e-9)


@pytest.mark.parametrize("degrees", [-80.0, -30.0, 0.0, 20.0, 60.0, 90.0])
def test_directions_are_angles_from_x(degrees):
    """Modes that move the flange along one line and across it, either sign of the shape."""
    layout = CoupledLayout(2)
    theta = coupled_vector(layout)
    angle = np.radians(degrees)
    theta[layout.shapes] = np.concatenate(
        [np.kron([np.cos(angle), np.sin(angle)], [0.3, 0.1]), -np.kron([-np.sin(angle), np.cos(angle)], [0.2, 0.4])]
    )
    theta[layout.damping.start + 1] = 0.0
    data = both_planes_to_json(posterior_of(theta, layout))
    order = np.argsort(theta[:2])
    for mode, expected in zip(data["modes"], np.array([degrees, degrees + 90.0])[order], strict=True):
        assert -90.0 < mode["direction_deg"] <= 90.0 + 1e-9
        assert (mode["direction_deg"] - expected + 90.0 + 1e-6) % 180.0 - 90.0 == pytest.approx(0.0, abs=1e-3)


def posterior_of(theta, layout):
    return CoupledPosterior(CoupledUnknowns(theta, layout), np.eye(theta.size), by_hand.SPEEDS)


def without_first(rows):
    return rows[1:]


def ragged(rows):
    return [rows[0][:-1], *rows[1:]]


@pytest.mark.parametrize(
    ("where", "value", "words"),
    [
        (("layout",), [], "both_planes.layout: found an empty list, allowed is a table"),
        (("layout", "modes"), 4, "both_planes.unknowns: found 47 numbers, allowed is 62"),
        (("layout", "modes"), 0, "both_planes.layout.modes: found 0, allowed is a whole number at least 1 and at most 200"),
        (("layout", "modes"), 2.5, "both_planes.layout.modes"),
        (("layout", "softening"), "no", 'both_planes.layout.softening: found the text "no", allowed is true or false'),
        (("layout", "discs"), -1, "both_planes.layout.discs: found -1, allowed is a whole number at least 0"),
        (("layout", "turning"), 2, "both_planes.layout.turning: found 2, allowed is a whole number at least -1 and at most 1"),
        (("unknowns",), [1.0, 2.0], "both_planes.unknowns: found 2 numbers, allowed is 47"),
        (("unknowns",), ["a"], "both_planes.unknowns: found"),
        (("covariance",), 3.0, "both_planes.covariance"),
        (("covariance", "matrix"), None, "both_planes.covariance.matrix: found null, allowed is 47 rows"),
        (("covariance", "matrix"), "x", "both_planes.covariance.matrix: found"),
        (("covariance", "matrix"), without_first, "both_planes.covariance.matrix: found 46 rows of 47 numbers, allowed is 47 rows"),
        (("covariance", "matrix"), ragged, "both_planes.covariance.matrix: found rows of different lengths"),
        (("covariance", "matrix"), [[float("nan")] * 47] * 47, "both_planes.covariance.matrix: found numbers that are not finite"),
        (("speed_range_rpm",), [2000.0, 1000.0], "both_planes.speed_range_rpm: found [2000.0, 1000.0]"),
        (("speed_range_rpm",), [-1.0, 1000.0], "both_planes.speed_range_rpm"),
        (("rivals",), 3.0, "both_planes.rivals: found 3.0"),
        (("rivals",), [{}], "both_planes.rivals[0].layout: found nothing"),
        (("rivals",), [SHORT], "both_planes.rivals[0].unknowns: found 1 numbers"),
    ],
)  # fmt: skip
def test_what_does_not_fit_is_named(path, where, value, words):
    data = json.loads(path.read_text(encoding="utf-8"))
    inner = data["both_planes"]
    for key in where[:-1]:
        inner = inner[key]
    inner[where[-1]] = value(inner[where[-1]]) if callable(value) else value
    with pytest.raises(InputError) as error:
        machine_from_json(data, "R.json")
    assert str(error.value).startswith("R.json: ")
    assert words in str(error.value)


@pytest.mark.parametrize("key", ["layout", "unknowns", "covariance", "speed_range_rpm", "rivals"])
def test_what_is_missing_is_named(path, key):
    data = json.loads(path.read_text(encoding="utf-8"))
    del data["both_planes"][key]
    with pytest.raises(InputError, match=rf"R\.json: both_planes\.{key}: found nothing, allowed is"):
        machine_from_json(data, "R.json")


def test_a_matrix_that_is_missing_is_named(path):
    data = json.loads(path.read_text(encoding="utf-8"))
    del data["both_planes"]["covariance"]["matrix"]
    with pytest.raises(InputError, match=r"both_planes\.covariance\.matrix: found nothing"):
        machine_from_json(data, "R.json")


def test_ranges_of_speed_keep_their_planes_together(path):
    """A machine with models of single ranges: one whose planes feel each other answers as one, one whose do not answers apart."""
    data = json.loads(path.read_text(encoding="utf-8"))
    soft = posterior(CoupledLayout(2))
    bands = [((600.0, 1000.0), identification(soft)), ((1000.0, 1400.0), by_hand.identification())]
    data["speed_bands"] = [speed_band_to_json(speeds, found) for speeds, found in bands]
    write_result(path, data)
    machine = machine_from_json(read_result(path), str(path))
    one, other = machine.at(700.0), machine.at(1300.0)
    np.testing.assert_array_equal(one.whole.best.theta, soft.best.theta)
    assert len(one.parts) == 1
    assert other.whole is None
    assert len(other.parts) == 2
    assert machine.at(None).whole.best.layout == LAYOUT
    for model, places in machine.models(np.array([700.0, 1300.0])):
        assert (model.whole is None) is (places.tolist() == [1])


def test_every_pair_has_its_name_but_no_file():
    """The score test alone asks for each pair: what a search comes to stands in discs."""
    layout = CoupledLayout(2, skew=EVERY_PAIR)
    data = both_planes_to_json(posterior(layout))
    with pytest.raises(InputError, match="discs"):
        both_planes_from_json(Table(data, "R.json", "both_planes"))


def test_no_further_search_begins_from_both_planes(path):
    """A search starts from each axis' own unknowns, which such a machine does not have: it says so, not that a covariance is missing."""
    with pytest.raises(InputError, match=r"both_planes: found planes that feel each other, allowed is a result whose axes"):
        machine_from_json(read_result(path), "").posteriors()
