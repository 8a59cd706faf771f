"""Tips over speed: each speed in one block, each block the machine at its middle, spreads between a few anchors."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rcsa_ident.dynamics.coordinates import Dof
from rcsa_ident.machine.speed_dependence import BLOCK, STRAIGHT, tips_over_speed
from tests.fixtures import by_hand

OMEGA = 2.0 * np.pi * np.arange(300.0, 3000.0, 10.0)
LOW, HIGH = 600.0, 1400.0


def tips(machine, speeds, spread=False):
    return list(tips_over_speed(machine, by_hand.tooling(), OMEGA, np.asarray(speeds, dtype=float), spread))


@pytest.mark.slow
@settings(max_examples=30, deadline=None)
@given(st.lists(st.floats(100.0, 4000.0), min_size=1, max_size=40))
def test_each_speed_is_in_one_narrow_block_that_feels_its_middle(speeds):
    """What lies outside the identified speeds belongs to the nearest of them."""
    speeds = np.array(speeds)
    machine = by_hand.machine(softening=True, axes=(Dof.X,))
    found = tips(machine, speeds)
    assert sorted(np.concatenate([places for places, _ in found]).tolist()) == list(range(speeds.size))
    for places, tip in found:
        own = np.clip(speeds[places], LOW, HIGH)
        assert own.max() <= own.min() * (1.0 + BLOCK) * (1.0 + 1e-12)
        alone = machine.at(0.5 * float(own.min() + own.max())).tip(by_hand.tooling(), OMEGA, spread=False)
        np.testing.assert_array_equal(tip.values, alone.values)
        assert tip.variation is None


def test_blocks_are_narrow_enough():
    assert BLOCK <= 0.025
    assert len(tips(by_hand.machine(softening=True), np.linspace(LOW, HIGH, 400))) > 30


@pytest.mark.parametrize("spread", [False, True])
def test_a_machine_that_stays_has_one_tip(spread):
    machine = by_hand.machine()
    ((places, tip),) = tips(machine, [1300.0, 200.0, 700.0], spread)
    np.testing.assert_array_equal(places, [0, 1, 2])
    alone = machine.tip(by_hand.tooling(), OMEGA, spread)
    np.testing.assert_array_equal(tip.values, alone.values)
    np.testing.assert_array_equal(tip.spread, alone.spread)


def test_single_models_take_their_speeds():
    """In the order in which the speeds ask for them; one of them changes with speed itself."""
    slow, fast = by_hand.machine(0.9), by_hand.machine(1.1, softening=True)
    machine = by_hand.over_speed([((LOW, 1000.0), slow), ((1000.0, HIGH), fast)])
    found = tips(machine, [1390.0, 700.0, 1010.0, 20.0])
    assert [places.tolist() for places, _ in found] == [[2], [0], [1, 3]]
    for (_, tip), (model, speed) in zip(found, [(fast, 1010.0), (fast, 1390.0), (slow, None)], strict=True):
        np.testing.assert_array_equal(tip.values, model.at(speed).tip(by_hand.tooling(), OMEGA, spread=False).values)


@pytest.mark.slow
def test_spreads_at_the_anchors_are_the_machines_own_and_straight_lines_between_them():
    machine = by_hand.machine(softening=True)
    speeds = np.linspace(LOW, HIGH, 60)
    found = tips(machine, speeds, True)
    ends = np.clip([speeds.min(), speeds.max()], LOW, HIGH)
    anchors = np.linspace(*ends, int(np.ceil(np.log(HIGH / LOW) / np.log(STRAIGHT))) + 1)
    own = [machine.at(speed).tip(by_hand.tooling(), OMEGA).spread for speed in anchors]
    for places, tip in found:
        here = 0.5 * (speeds[places].min() + speeds[places].max())
        k = min(int(np.searchsorted(anchors, here, side="right")) - 1, anchors.size - 2)
        share = (here - anchors[k]) / (anchors[k + 1] - anchors[k])
        expected = (1.0 - share) * own[k] + share * own[k + 1]
        np.testing.assert_allclose(tip.spread, expected, rtol=0.0, atol=1e-9 * np.abs(expected).max())
        assert tip.complete


def test_a_single_speed_has_its_own_spread():
    machine = by_hand.machine(softening=True)
    ((_, tip),) = tips(machine, [1234.0], True)
    alone = machine.at(1234.0).tip(by_hand.tooling(), OMEGA)
    np.testing.assert_allclose(tip.spread, alone.spread, rtol=0.0, atol=1e-12 * np.abs(alone.spread).max())


def test_where_one_axis_alone_is_doubted_that_one_varies_at_every_speed():
    machine = by_hand.machine(softening=True)
    half = replace(machine, identified={**machine.identified, Dof.Y: replace(machine.identified[Dof.Y], posterior=None)})
    for _, tip in tips(half, [700.0, 1300.0], True):
        assert tip.variation.covers == {0}
        assert not tip.complete
