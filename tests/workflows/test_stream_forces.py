"""Live forces: any blocks, the batch's figures, a spindle that wanders, samples that were lost."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rcsa_ident.base.errors import InputError
from rcsa_ident.workflows.estimate_forces import MonitoredCut, observe
from rcsa_ident.workflows.stream_forces import LONGEST_BRIDGE, LiveObserver, live_observer
from tests.fixtures.flange_machine import flange_machine
from tests.fixtures.force_stream import RATE, SECOND, streamed, turning
from tests.fixtures.virtual_cut import CASE, relative_error


@cache
def designed(air: bool = True) -> MonitoredCut:
    samples = streamed()[0][:SECOND] if air else streamed()[0][2 * SECOND : 2 * SECOND + SECOND // 2]
    record = turning().recording(samples)
    assembly = turning().made.tooling.assembly
    return observe(flange_machine(), assembly, 2, record, record if air else None, CASE.spindle_speed)


@cache
def observer(follow: bool = True, air: bool = True) -> LiveObserver:
    return live_observer(designed(air), turning().recording(streamed()[0][:SECOND]), follow)


def run(live: LiveObserver, samples, cuts=(), state=None):
    state, forces = live.init() if state is None else state, []
    for part in np.split(samples, sorted(cuts)):
        state, block = live.run(state, part[:, :2], part[:, 2:])
        forces.append(block.force)
    return state, np.concatenate(forces)


def errors(force, true, begin, end):
    part = slice(round(begin * RATE), round(end * RATE))
    return relative_error(force[part], true[part], RATE)


@pytest.mark.slow
@settings(max_examples=25, deadline=None)
@given(st.lists(st.integers(0, 6000), max_size=12), st.booleans())
def test_blocks_of_any_size_give_what_the_observer_gives_of_the_whole(cuts, air):
    """Without a spindle to follow it is `ForceObserver.run` itself."""
    samples = streamed()[0][:6000]
    live = observer(follow=False, air=air)
    batch = live.observer.run(live.observer.init(), samples[:, :2], samples[:, 2:])[1].force
    np.testing.assert_allclose(run(live, samples, cuts)[1], batch, atol=1e-9 * np.abs(batch).max(), rtol=0)


@pytest.mark.slow
@settings(max_examples=15, deadline=None)
@given(st.lists(st.integers(0, 12000), max_size=8))
def test_blocks_of_any_size_follow_the_spindle_alike(cuts):
    samples = streamed(3e-4, 1e-3)[0][SECOND : SECOND + 12000]
    state, force = run(observer(), samples, cuts)
    whole, batch = run(observer(), samples)
    np.testing.assert_allclose(force, batch, atol=1e-9 * np.abs(batch).max(), rtol=0)
    assert state.angle.slope == pytest.approx(whole.angle.slope, rel=1e-9)
    assert whole.angle.first > 0


@pytest.mark.slow
def test_the_force_of_a_cut_that_follows_air():
    """Run-out from the first second, two thirds of a second before the tool enters."""
    samples, true = streamed()
    force = run(observer(), samples)[1]
    assert np.all(errors(force, true, 1.6, 3.0) < 0.04)
    # in air there is next to none
    assert np.all(np.std(force[SECOND : round(1.45 * RATE)], axis=0) < 0.05 * np.std(true[2 * SECOND :], axis=0))


@pytest.mark.slow
@pytest.mark.parametrize(("wander", "sag"), [(3e-4, 0.0), (0.0, 1e-3), (3e-4, 1e-3)])
def test_run_out_turns_with_a_spindle_that_does_not_keep_its_speed(wander, sag):
    samples, true = streamed(wander, sag)
    followed, fixed = (run(observer(follow), samples)[1] for follow in (True, False))
    assert np.all(errors(followed, true, 2.0, 3.0) < 0.06)
    assert np.all(errors(fixed, true, 2.0, 3.0) > 0.3)


@pytest.mark.slow
def test_the_speed_is_told():
    state = run(observer(), streamed(0.0, 1e-3)[0])[0]
    assert observer().drift(state) == pytest.approx(-1e-3, rel=0.01)
    without = live_observer(designed(air=False), turning().recording(streamed()[0][2 * SECOND : 2 * SECOND + SECOND // 2]))
    assert not without.run_out
    state = run(without, streamed(0.0, 1e-3)[0][2 * SECOND :])[0]
    assert without.drift(state) == pytest.approx(-1e-3, rel=0.01)


@pytest.mark.slow
def test_an_angle_that_is_not_told_is_said_and_left_alone():
    samples = streamed()[0]
    state = run(observer(), samples[:SECOND])[0]
    noise = 1e-6 * np.random.default_rng(3).standard_normal((SECOND // 2, 4))
    lost = run(observer(), noise, state=state)[0]
    assert state.angle.known
    assert not lost.angle.known
    assert lost.angle.slope == state.angle.slope


@pytest.mark.parametrize("gap", [0.001, 0.02, 0.09])
def test_a_short_gap_is_bridged(gap):
    """As good right behind it as anywhere; with zeros in the place of what was lost it is not."""
    samples, true = streamed()
    begin, count = 2 * SECOND, round(gap * RATE)
    state = run(observer(), samples[:begin])[0]
    after = slice(begin + count, begin + count + SECOND // 4)
    bridged = run(observer(), samples[after], state=observer().bridge(state, count))[1]
    whole = run(observer(), samples)[1][after]
    size = np.std(true[after], axis=0)
    assert np.all(np.std(bridged[:1000] - whole[:1000], axis=0) < 0.05 * size)
    blind = run(observer(), np.zeros((count, 4)), state=state)[0]
    worse = run(observer(), samples[after], state=blind)[1]
    assert np.all(np.std(worse[:1000] - whole[:1000], axis=0) > 3.0 * np.std(bridged[:1000] - whole[:1000], axis=0))


def test_in_a_gap_the_oscillators_go_on_whatever_stands_for_the_lost_samples():
    """Noise in the memory of the last revolution: forces expected in the gap do not know of it."""
    samples, _ = streamed()
    state = run(observer(), samples[: 2 * SECOND])[0]
    inner, count = observer().observer, 500
    noise = 1e-6 * np.random.default_rng(2).standard_normal((2, count, 2))
    expected = [inner.bridge(state.observer, gap, 1e4 * gap)[1] for gap in noise]
    np.testing.assert_array_equal(expected[0].force, expected[1].force)
    whole = run(observer(), samples[: 2 * SECOND + count])[1][-count:]
    assert np.all(np.std(expected[0].force - whole, axis=0) < 0.1 * np.std(whole, axis=0))
    # and what comes behind the gap shows that the stream's own bridge is of that kind
    confused = replace(state, gap=state.gap + 3e-8 * np.random.default_rng(3).standard_normal(state.gap.shape))
    after = [observer().bridge(each, count).observer.filters[0].modes for each in (state, confused)]
    np.testing.assert_array_equal(after[0], after[1])


def test_behind_a_long_gap_the_observer_begins_anew():
    samples, true = streamed()
    begin, count = round(1.8 * RATE), round(2.0 * LONGEST_BRIDGE * RATE)
    state = observer().bridge(run(observer(), samples[:begin])[0], count)
    assert state.count == begin + count
    assert state.gap.shape == (0, 2)
    np.testing.assert_array_equal(state.observer.filters[0].modes, 0.0)
    force = np.zeros_like(true)
    force[begin + count :] = run(observer(), samples[begin + count :], state=state)[1]
    assert np.all(errors(force, true, 2.1, 3.0) < 0.06)


def test_a_gap_before_the_first_revolution_is_no_fault():
    state = observer().bridge(observer().init(), 7)
    assert state.count == state.observer.count == 7
    fixed = observer(follow=False)
    shifted = run(fixed, streamed()[0][7:2000], state=fixed.bridge(fixed.init(), 7))[1]
    assert np.all(np.isfinite(shifted))


def test_nothing_in_nothing_out():
    state, block = observer().run(observer().init(), np.zeros((0, 2)), np.zeros((0, 2)))
    assert block.force.shape == (0, 2)
    assert state.count == 0


@pytest.mark.slow
def test_run_out_of_one_axis_alone_is_refused():
    found = designed()
    half = replace(found.observer.axes[0], run_out=None)
    mixed = replace(found, observer=replace(found.observer, axes=(half, found.observer.axes[1])))
    with pytest.raises(InputError, match="run-out"):
        live_observer(mixed, turning().recording(streamed()[0][:SECOND]))
