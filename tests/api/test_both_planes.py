"""A machine whose planes feel each other over REST: cross terms, speed, modes with their directions, and a warm start from it."""

from __future__ import annotations

import json

import numpy as np
import pytest

from api.work import machine_cache
from rcsa_ident.base.errors import InputError
from rcsa_ident.base.units import to_rpm
from rcsa_ident.io.curves.tips import read_frf_csv
from tests.api.in_process import refused
from tests.fixtures import by_hand, coupled_by_hand

MIDDLE = to_rpm(by_hand.SPEEDS[0])


@pytest.fixture(params=[0, 1], ids=["oblique", "gyroscopic"])
def turning(request):
    return request.param


@pytest.fixture
def text(tmp_path, turning):
    return coupled_by_hand.result_text(tmp_path, turning)


@pytest.fixture
def shop(client, text):
    id = client.make_machine("coupled").id
    client.identify(id, text)
    client.write_tooling("T1", by_hand.TOOLING)
    return client, id


def curve(each):
    return np.array(each.re) + 1j * np.array(each.im)


def test_a_tip_has_its_cross_terms_and_its_speed(shop, turning, tmp_path):
    client, id = shop
    found = client.tooltip(id, "T1", from_hz=400, to_hz=2500, step_hz=5)
    assert found.spindle_speed_rpm == (pytest.approx(MIDDLE) if turning else None)
    machine = coupled_by_hand.machine(turning)
    tip = machine.tip(by_hand.tooling(), 2.0 * np.pi * np.array(found.frequency_hz))
    assert set(found.axes) == {"X", "Y"}
    for name, each in {**found.axes, **found.cross}.items():
        row, col = f"tip.{name[0].lower()}", f"tip.{name[-1].lower()}"
        np.testing.assert_allclose(curve(each), tip.between(row, col), rtol=1e-6, atol=1e-14)
        assert max(each.re_std) > 0.0
    assert set(found.cross) == {"XY", "YX"}
    (tmp_path / "F.csv").write_text(client.tooltip_file(id, "T1", from_hz=400, to_hz=2500, step_hz=5))
    columns = read_frf_csv(tmp_path / "F.csv").bands
    np.testing.assert_allclose(columns["XY_re"] + 1j * columns["XY_im"], curve(found.cross["XY"]), rtol=1e-9)
    assert np.all(columns["XY_re_std"] > 0.0)
    there = client.tooltip(id, "T1", from_hz=400, to_hz=2500, step_hz=5, spindle_speed_rpm=7000, bands=False)
    assert there.spindle_speed_rpm == (7000.0 if turning else None)
    assert (curve(there.cross["XY"]) == pytest.approx(curve(found.cross["XY"]), rel=1e-6)) != bool(turning)


def test_its_modes_say_their_directions(shop, turning):
    client, id = shop
    both = client.modes(id).both_planes
    assert both.in_words == coupled_by_hand.WORDS
    assert both.gyroscopic is bool(turning)
    np.testing.assert_allclose([mode.direction_deg for mode in both.modes], np.degrees(coupled_by_hand.ANGLES), atol=0.1)
    flange = client.frf(id)
    assert set(flange.cross) == {"XY", "YX"}
    assert flange.spindle_speed_rpm == (pytest.approx(MIDDLE) if turning else None)
    # the whole file comes back
    assert len(client.identification(id).both_planes.modes) == 4


@pytest.mark.slow
def test_lobes_and_advice_take_them(shop, tmp_path):
    client, id = shop
    speeds = {"from_rpm": 6000, "to_rpm": 13000, "step_rpm": 1000}
    found = client.lobes(id, "T1", speeds=speeds, bands=False, recommend=False).toolings[0]
    alone = json.loads(client.identification(id).model_dump_json())
    del alone["both_planes"]
    other = client.make_machine("apart").id
    client.identify(other, json.dumps(alone))
    apart = client.lobes(other, "T1", speeds=speeds, bands=False, recommend=False).toolings[0]
    assert np.max(np.abs(np.array(found.limit_depth_mm) / np.array(apart.limit_depth_mm) - 1.0)) > 0.02
    assert client.advice(id, "T1", speeds=speeds, cut={"feed_per_tooth_mm": 0.1}).toolings[0].highest_removal


def test_a_further_identification_starts_from_it(text):
    starts = machine_cache.starts(text)
    assert [start.layout.modes for start in starts.values()] == [2, 2]


@pytest.mark.parametrize(
    ("where", "value", "words"),
    [
        (("covariance", "matrix"), [[1.0], 2.0], "both_planes.covariance.matrix"),
        (("covariance",), {}, "both_planes.covariance.matrix"),
        (("unknowns",), [0.0] * 1000, "both_planes.unknowns"),
        (("modes",), [{}] * 1000, "both_planes.modes"),
    ],
)
def test_what_does_not_fit_is_refused(client, text, where, value, words):
    data = json.loads(text)
    place = data["both_planes"]
    for key in where[:-1]:
        place = place[key]
    place[where[-1]] = value
    problem = refused(422, client.identify, client.make_machine("broken").id, json.dumps(data))
    assert words in str(problem)


def test_a_measured_flange_starts_nothing(tmp_path):
    with pytest.raises(InputError, match="start"):
        machine_cache.starts(by_hand.flange_file(tmp_path / "F.csv").read_text())
