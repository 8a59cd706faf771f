"""A machine that changes with a temperature over REST: the state that an answer holds for, and what was learned."""

from __future__ import annotations

import numpy as np
import pytest

from tests.api.in_process import refused
from tests.fixtures import by_hand

LINES = {"from_hz": 400, "to_hz": 2500, "step_hz": 5}
SPEEDS = {"from_rpm": 6000, "to_rpm": 9000, "step_rpm": 500}
CUT = {"immersion": 0.5, "feed_per_tooth_mm": 0.1}


@pytest.fixture
def shop(client, tmp_path):
    id = client.make_machine("warms up").id
    client.identify(id, by_hand.warming_text(tmp_path))
    client.write_tooling("T1", by_hand.TOOLING)
    return client, id


def test_a_tip_at_a_temperature(shop):
    client, id = shop
    found = client.tooltip(id, "T1", **LINES, temperature_c=25.0)
    machine = by_hand.warming_identification(True).machine.at_temperature(25.0)
    tip = machine.tip(by_hand.tooling(), 2.0 * np.pi * np.array(found.frequency_hz))
    curve = found.axes["X"]
    np.testing.assert_allclose(np.array(curve.re) + 1j * np.array(curve.im), tip.between("tip.x", "tip.x"), rtol=1e-6)
    np.testing.assert_allclose(curve.re_std, next(iter(tip.deviation().values()))[0], rtol=1e-5)
    assert found.state == "at 25 °C, 9549 rev/min"
    assert client.tooltip(id, "T1", **LINES).state == "warm machine, 9549 rev/min"
    assert client.tooltip(id, "T1", **LINES, temperature_c=45.0).warnings[-1].startswith("the cuts were made at 22 to 38 °C")


@pytest.mark.parametrize(("more", "state"), [({"temperature_c": 25.0}, "at 25 °C"), ({}, "warm machine")])
def test_lobes_and_advice_say_their_state(shop, more, state):
    client, id = shop
    asked = {"speeds": SPEEDS, "cut": CUT, "bands": False} | more
    assert [each.state for each in client.lobes(id, "T1", **asked).toolings] == [state]
    assert [each.state for each in client.advice(id, "T1", **asked).toolings] == [state]


def test_what_was_learned_stands_beside_the_modes(shop):
    client, id = shop
    assert client.modes(id).learned == list(by_hand.CHANGES.words)
    assert client.machine(id).identification.temperature_c == [22.0, 38.0]


def test_a_temperature_that_changes_nothing_is_refused(client, tmp_path):
    id = client.make_machine("steady").id
    client.identify(id, by_hand.result_text(tmp_path))
    client.write_tooling("T1", by_hand.TOOLING)
    assert client.machine(id).identification.temperature_c is None
    cuts = {"speeds": SPEEDS, "cut": CUT}
    for ask, more in ((client.tooltip, LINES), (client.lobes, cuts), (client.advice, cuts)):
        (error,) = refused(422, ask, id, "T1", **more, temperature_c=24.0).errors
        assert error.field == "temperature_c"
        assert "it depends on no temperature" in str(error)
    assert refused(422, client.tooltip, id, "T1", **LINES, temperature_c=295.15).errors[0].field == "temperature_c"
    assert client.tooltip(id, "T1", **LINES).state is None
    assert client.modes(id).learned == []
