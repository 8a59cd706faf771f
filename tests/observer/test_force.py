"""The force observer on a virtual machine's record at 12 000 rev/min, with dynamics fitted at the flange, not the true ones."""

from __future__ import annotations

from dataclasses import replace

import control
import numpy as np
import pytest

from rcsa_ident.base.errors import InputError
from rcsa_ident.observer.force import ForceObserver, RunOut, restore_mean_force
from rcsa_ident.observer.kalman import kalman_filter
from rcsa_ident.observer.tuning import PaperWalk, Resonators, Tuning, harmonics
from rcsa_ident.workflows.estimate_forces import observe
from tests.fixtures.flange_machine import BAND, flange_machine, paper_cut
from tests.fixtures.virtual_cut import relative_error, true_response

RATE = 25600.0
PROGRAMMED = 12000.0 * np.pi / 30.0


def monitored(method, smooth=False, air=True, cut=None):
    made = paper_cut()
    record, still = cut or made.cut, made.air if air else None
    return observe(flange_machine(), made.tooling.assembly, 2, record, still, PROGRAMMED, method, None, smooth)


@pytest.fixture(scope="module")
def oscillating():
    return monitored(Resonators())


@pytest.fixture(scope="module")
def walking():
    return monitored(PaperWalk())


@pytest.fixture(scope="module")
def signals():
    samples = paper_cut().cut.samples
    return samples[:, :2], samples[:, 2:4]


def without_run_out(observer):
    return replace(observer, axes=tuple(replace(each, run_out=None) for each in observer.axes))


def error(found, lag=0.0):
    return relative_error(found.estimate.force, paper_cut().force, RATE, lag)


@pytest.mark.slow
def test_oscillators_follow_a_steady_cut_without_lag(oscillating):
    """300 to 4300 Hz, mean removed, live."""
    assert np.all(error(oscillating) < 0.04)
    assert np.all(error(oscillating) < error(oscillating, 1.0))
    assert np.all(error(oscillating) < error(oscillating, -1.0))


@pytest.mark.slow
def test_the_papers_walk_lags_by_the_machines_delay(walking):
    assert np.all(error(walking) > 0.5)
    assert np.all(error(walking, 5.75) < 0.25)


@pytest.mark.slow
@pytest.mark.parametrize("method", [Resonators(), PaperWalk()])
def test_the_smoother_has_neither_lag_nor_loss(method):
    assert np.all(error(monitored(method, smooth=True)) < 0.03)


@pytest.mark.slow
def test_bands_hold_the_error(oscillating):
    """Within the band the error is not larger than told; there is no noise without an error, either."""
    made = paper_cut()
    told = oscillating.estimate.standard_deviation[-1]
    scatter = error(oscillating) * np.std(made.force, axis=0)
    assert np.all(scatter < 1.2 * told)
    assert np.all(told < 0.15 * np.std(made.force, axis=0))
    assert np.all(told < 0.02 * np.array([each.standard_deviation(1)[0, 0] for each in oscillating.observer.filters]))


@pytest.mark.slow
def test_the_start_dies_out_while_the_observer_settles(oscillating, signals):
    """Begun anew within the record, it shows hundreds of times the force, and after its settling time the same as one begun before."""
    observer, begin = oscillating.observer, 2000
    whole = observer.run(observer.init(), *signals)[1].force[begin:]
    later = observer.run(replace(observer.init(), count=begin), *(each[begin:] for each in signals))[1].force
    rest = slice(observer.settling, None)
    size = np.std(whole[rest], axis=0)
    assert np.all(np.max(np.abs(later), axis=0) > 50.0 * size)
    assert np.all(np.std((later - whole)[rest], axis=0) < 0.03 * size)
    assert np.all(np.std((later - whole)[: rest.start // 2], axis=0) > size)


@pytest.mark.slow
@pytest.mark.parametrize("method", [Resonators(), PaperWalk()])
def test_the_settling_time_is_that_of_the_slowest_pole(method):
    """Of python-control's observer, filters and all."""
    observer = monitored(method).observer
    slowest = np.abs(observer.to_control().poles()).max()
    assert slowest**observer.settling < 0.02 < slowest ** (observer.settling - 1) * 1.0001


@pytest.mark.slow
def test_compensated_with_the_true_machine_it_is_flat(oscillating, walking):
    """Times the true C31: oscillators are right at all orders of the spindle, the walk nearly everywhere."""
    for i in (0, 1):
        response = true_response(oscillating, paper_cut(), i)
        low, high = (w / (2.0 * np.pi) for w in response.usable(response.line[0], at_lines=True))
        assert low < 410.0
        assert high > 4000.0
        assert abs(response.delay_at_lines) * RATE < 0.1
        response = true_response(walking, paper_cut(), i)
        assert response.usable(1.3 * walking.band[0])[1] / (2.0 * np.pi) > 3000.0
        assert 4.0 < response.delay_at_lines * RATE < 7.0
        smooth = true_response(walking, paper_cut(), i, smoothed=True)
        assert smooth.flatness(walking.band) < 1.0
        assert abs(smooth.delay(walking.band)) * RATE < 0.1


@pytest.mark.slow
def test_run_out_of_the_flange_is_taken_out(oscillating):
    """Four micrometres of it beside about one of vibration: without the air cut the forces are wrong."""
    assert np.all(error(monitored(Resonators(), air=False)) > 3.0 * error(oscillating))


@pytest.mark.slow
def test_the_fixtures_motion_is_added(oscillating):
    cut = paper_cut().cut
    alone = replace(cut, samples=cut.samples[:, :2], sensors=cut.sensors[:2])
    assert np.all(error(monitored(Resonators(), cut=alone)) > 1.5 * error(oscillating))


@pytest.mark.slow
def test_a_live_stream_in_blocks_is_the_record(oscillating, signals):
    observer, (gap, acceleration) = oscillating.observer, signals
    whole = observer.run(observer.init(), gap, acceleration)[1]
    state, forces = observer.init(), []
    for start, end in ((0, 1), (1, 500), (500, 500), (500, 1501), (1501, 4000)):
        state, block = observer.run(state, gap[start:end], acceleration[start:end])
        forces.append(block.force)
    np.testing.assert_allclose(np.concatenate(forces), whole.force[:4000], rtol=0.0, atol=1e-12 * np.abs(whole.force).max())
    state, one = observer.step(state, gap[4000], acceleration[4000])
    np.testing.assert_allclose(one.force[0], whole.force[4000], rtol=0.0, atol=1e-12 * np.abs(whole.force).max())
    assert state.count == 4001
    np.testing.assert_array_equal(observer.observe(gap, acceleration).force, whole.force)


@pytest.mark.slow
def test_a_constant_in_the_gap_changes_nothing(oscillating, signals):
    observer, (gap, acceleration) = oscillating.observer, signals
    one = observer.observe(gap[:3000], acceleration[:3000]).force
    two = observer.observe(gap[:3000] + 3e-4, acceleration[:3000]).force
    np.testing.assert_allclose(two, one, atol=1e-6 * np.abs(one).max())


@pytest.mark.slow
def test_estimates_are_linear_in_the_signals(oscillating, signals):
    bare = without_run_out(oscillating.observer)
    gap, acceleration = (part[:2000] for part in signals)
    shaken = np.random.default_rng(1).normal(size=gap.shape) * 1e-7
    for smooth in (False, True):
        one, two, both = (
            bare.observe(g, a, smooth).force
            for g, a in ((gap, acceleration), (shaken, 0.0 * shaken), (2.0 * gap - shaken, 2.0 * acceleration))
        )
        np.testing.assert_allclose(both, 2.0 * one - two, atol=1e-8 * np.abs(both).max())


@pytest.mark.slow
def test_exported_to_python_control(oscillating, signals):
    """Filters, plant and force model as one sampled state space: it is the observer whose gain is steady from the first sample on."""
    whole = without_run_out(oscillating.observer)
    alone = ForceObserver(whole.axes[1:], (kalman_filter(whole.filters[1].model, longest_settling=0),))
    gap, acceleration = (each[:, 1] for each in signals)
    gap = gap - gap[0]
    system = alone.to_control()
    assert (system.input_labels, system.output_labels) == (["gap_y", "acceleration_y"], ["force_y", "innovation_y"])
    found = control.forced_response(system, inputs=np.stack([gap, acceleration])).outputs
    expected = alone.run(alone.init(), gap[:, None], acceleration[:, None])[1]
    np.testing.assert_allclose(found[0], expected.force[:, 0], atol=1e-7 * np.abs(expected.force).max())
    np.testing.assert_allclose(found[1], expected.innovation[:, 0], atol=1e-7 * np.abs(expected.innovation).max())
    deaf = replace(alone, axes=(replace(alone.axes[0], acceleration_filter=None),))
    assert deaf.to_control().input_labels == ["gap_y"]


def test_run_out_signal_is_its_lines():
    lines = RunOut(1200.0, np.array([1.0, 3.0]), np.array([1e-6 + 2e-6j, -1e-6j]), np.array([0.1, 0.0]))
    t = np.arange(40, 90) / RATE
    gap, acceleration = lines.signals(40, 50, 1.0 / RATE)
    np.testing.assert_allclose(gap, (lines.gap[0] * np.exp(1200j * t) + lines.gap[1] * np.exp(3600j * t)).real, atol=1e-17)
    np.testing.assert_allclose(acceleration, 0.1 * np.cos(1200.0 * t), atol=1e-12)
    for orders in ([0.0, 1.0], [1.5, 2.0], [2.0, 1.0]):
        with pytest.raises(InputError, match="orders"):
            RunOut(1200.0, np.array(orders), np.zeros(2), np.zeros(2))


def test_harmonics_of_a_cut():
    assert harmonics(100.0, 4, (390.0, 1300.0), run_out=False).tolist() == [400.0, 800.0, 1200.0]
    assert harmonics(100.0, 4, (200.0, 500.0)).tolist() == [200.0, 300.0, 400.0, 500.0]


@pytest.mark.slow
def test_tuning_does_what_it_says(oscillating):
    """A smoothed walk keeps 0.1 dB at the worst place below the bandwidth, by the closed form of a stationary Wiener filter."""
    transfer, noise = oscillating.observer.axes[0].transfer, 2e-9
    for bandwidth in (1000.0, 3000.0):
        walk = Tuning(noise, 2.0 * np.pi * bandwidth, 1e-3).random_walk(transfer)
        omega = 2.0 * np.pi * np.linspace(BAND[0] * 0.7 / (2.0 * np.pi), bandwidth, 300)
        signal = np.abs(transfer.response(omega)) ** 2 * (walk.intensity / omega) ** 2
        kept = 20.0 * np.log10(signal / (signal + noise**2 / RATE))
        assert kept.min() == pytest.approx(-0.1, abs=0.01)
    with pytest.raises(InputError, match="bandwidth"):
        Tuning(noise, 2.0 * np.pi * 100.0, 1e-3).random_walk(transfer)
    with pytest.raises(InputError, match="harmonics"):
        Tuning(noise, 2.0 * np.pi * 3000.0, 1e-3).resonators(transfer, np.array([10.0]))


@pytest.mark.slow
def test_oscillators_follow_a_change_within_the_response_time(oscillating, signals):
    """The vibration doubles at once: half a revolution later most of the new force is there."""
    observer = without_run_out(oscillating.observer)
    gap, acceleration = (part[:6000] - part[:6000].mean(axis=0) for part in signals)
    turned = oscillating.observer.axes[0].run_out.signals(0, 6000, 1.0 / RATE)[0]
    gap = gap - np.stack([turned, oscillating.observer.axes[1].run_out.signals(0, 6000, 1.0 / RATE)[0]], axis=1)
    doubled = np.where(np.arange(6000)[:, None] < 3840, 1.0, 2.0)
    one, two = (observer.observe(f * gap, f * acceleration).force for f in (1.0, doubled))
    period = 128
    ratio = [
        np.linalg.norm(two[k : k + period]) / np.linalg.norm(one[k : k + period]) for k in (3840 - period, 3840 + period, 3840 + 5 * period)
    ]
    assert ratio[0] == pytest.approx(1.0, abs=1e-9)
    assert ratio[1] > 1.6
    assert ratio[2] == pytest.approx(2.0, abs=0.05)


@pytest.mark.slow
def test_the_mean_comes_from_the_time_between_the_teeth(oscillating):
    """Two teeth, half immersed: for a third of the time no edge cuts (the helix lags a little)."""
    made = paper_cut()
    raised, level = restore_mean_force(oscillating.estimate, 0.4)
    mean = np.mean(made.force, axis=0)
    np.testing.assert_allclose(level, mean, atol=0.04 * np.std(made.force, axis=0).max())
    np.testing.assert_allclose(raised.force, oscillating.estimate.force + level)
    again, more = restore_mean_force(raised, 0.4)
    np.testing.assert_allclose(more, 0.0, atol=1e-9)
    np.testing.assert_allclose(again.force, raised.force, atol=1e-9)
    with pytest.raises(InputError, match="idle"):
        restore_mean_force(oscillating.estimate, 0.0)


@pytest.mark.slow
def test_signals_are_checked(oscillating, signals):
    observer, (gap, acceleration) = oscillating.observer, signals
    with pytest.raises(InputError, match="one column"):
        observer.run(observer.init(), gap[:, :1])
    with pytest.raises(InputError, match="acceleration"):
        observer.run(observer.init(), gap)
    lost = np.array(gap[:10])
    lost[3] = np.nan
    with pytest.raises(InputError, match="lost"):
        observer.run(observer.init(), lost, acceleration[:10])
