"""Forces on a machine whose axes feel each other: one observer with both forces, beside one that leaves the cross terms out."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import control
import numpy as np
import pytest

from rcsa_ident.cutting.cutter import Cutter
from rcsa_ident.dynamics.coordinates import Dof
from rcsa_ident.observer.tuning import PaperWalk, Resonators
from rcsa_ident.workflows.estimate_forces import MonitoredCut, observe, wear_of
from rcsa_ident.workflows.stream_forces import live_observer
from tests.fixtures.oblique_cut import measured_flange, oblique_cut, oblique_machine
from tests.fixtures.virtual_cut import CASE, relative_error

pytestmark = pytest.mark.slow


def watch(machine=None, cut=None, **options) -> MonitoredCut:
    made = oblique_cut()
    return observe(machine or oblique_machine(), made.tooling.assembly, 2, cut or made.cut, made.air, CASE.spindle_speed, **options)


@cache
def found() -> MonitoredCut:
    return watch()


def error(estimate) -> np.ndarray:
    return relative_error(estimate.force, oblique_cut().force, oblique_cut().cut.rate)


def signals(count=None):
    samples = oblique_cut().cut.samples[:count]
    return samples[:, :2], samples[:, 2:4]


def test_cross_terms_are_worth_many_times_the_error():
    """X feels two and a half times its own force along Y, by 13 % of it."""
    without = watch(measured_flange(cross=False))
    assert len(found().observer.filters) == 1
    assert len(without.observer.filters) == 2
    assert np.all(error(found().estimate) < 0.03)
    assert error(without.estimate)[0] > 0.25
    assert error(without.estimate)[1] > 3.0 * error(found().estimate)[1]


def test_an_oblique_measured_flange_has_them_too():
    """At the cut's speed, though its tool-holder does not turn with it."""
    measured = watch(measured_flange(cross=True))
    assert len(measured.observer.filters) == 1
    assert np.all(error(measured.estimate) < 0.06)


def test_it_is_the_machine_at_the_recordings_speed():
    """The observer of a machine that stands at another speed is that of the same machine brought to the record's."""
    there = watch(oblique_machine().at(found().spindle_speed))
    np.testing.assert_array_equal(there.estimate.force, found().estimate.force)


@pytest.mark.witness
@pytest.mark.parametrize("method", [Resonators(), PaperWalk()])
def test_the_smoother_has_neither_lag_nor_loss(method):
    assert np.all(error(watch(method=method, smooth=True).estimate) < 0.03)


def test_bands_hold_the_error():
    told = found().estimate.standard_deviation[-1]
    scatter = error(found().estimate) * np.std(oblique_cut().force, axis=0)
    assert np.all(scatter < 1.2 * told)
    assert np.all(told < 0.25 * np.std(oblique_cut().force, axis=0))


def test_a_live_stream_in_blocks_is_the_record():
    observer, (gap, acceleration) = found().observer, signals(4000)
    whole = observer.run(observer.init(), gap, acceleration)[1]
    for live in (observer, live_observer(found(), oblique_cut().cut, follow=False)):
        state, forces = live.init(), []
        for start, end in ((0, 1), (1, 500), (500, 500), (500, 1501), (1501, 4000)):
            state, block = live.run(state, gap[start:end], acceleration[start:end])
            forces.append(block.force)
        np.testing.assert_allclose(np.concatenate(forces), whole.force, rtol=0.0, atol=1e-12 * np.abs(whole.force).max())
    np.testing.assert_array_equal(observer.observe(gap, acceleration).force, whole.force)


def test_a_stream_follows_the_spindle_and_bridges_what_was_lost():
    gap, acceleration = signals()
    live = live_observer(found(), oblique_cut().cut)
    assert all(each.run_out is None for each in live.observer.axes)
    assert live.observer.filters is found().observer.filters
    state, first = live.run(live.init(), gap[:5000], acceleration[:5000])
    state = live.bridge(state, 37)
    state, second = live.run(state, gap[5037:], acceleration[5037:])
    force = np.concatenate([first.force, np.zeros((37, 2)), second.force])
    settled = slice(-4240, -600)
    off = force[settled] - found().estimate.force[settled]
    assert np.all(np.std(off, axis=0) < 0.02 * np.std(oblique_cut().force, axis=0))


def test_compensated_with_the_machine_it_is_flat_at_the_orders():
    for axis in (Dof.X, Dof.Y):
        response = found().response[axis]
        low, high = (w / (2.0 * np.pi) for w in response.usable(response.line[0], at_lines=True))
        assert low < 410.0
        assert high > 4000.0
        assert abs(response.delay_at_lines) * oblique_cut().cut.rate < 0.1
    (together,), omega = found().observer.filters, 2.0 * np.pi * np.array([390.0, 400.0, 1234.0, 4100.0])
    solved = together.state_space().response(omega)
    np.testing.assert_allclose(np.hstack(together.response(omega)), solved, atol=1e-7 * np.abs(solved).max())


@pytest.mark.parametrize("place", [0, 1])
def test_one_sensor_axis_says_what_it_takes_for_its_own_force(place):
    cut, air = oblique_cut().cut, oblique_cut().air
    kept = [place, 2 + place]
    one, still = (replace(each, samples=each.samples[:, kept], sensors=tuple(each.sensors[i] for i in kept)) for each in (cut, air))
    alone = observe(oblique_machine(), oblique_cut().tooling.assembly, 2, one, still, CASE.spindle_speed)
    assert alone.estimate.axes == ((Dof.X, Dof.Y)[place],)
    own, other = ("X", "Y")[place], ("Y", "X")[place]
    said = [note for note in alone.notes if "feel each other" in note]
    assert len(said) == 1
    assert f"{own} and {other} feel each other, and {other} has no displacement sensor" in said[0]
    share = float(said[0].split(" by ")[1].split(" %")[0])
    omega = 2.0 * np.pi * np.arange(200.0, 5000.0, 20.0)
    from rcsa_ident.virtual.rotor import frequency_response, rotor

    model = rotor(oblique_cut().spindle, oblique_cut().tooling.assembly)
    true = np.linalg.norm(frequency_response(model, omega, CASE.spindle_speed, outputs=("flange.x", "flange.y")), axis=0)
    assert share == pytest.approx(100.0 * true[place, 1 - place] / true[place, place], abs=2.0)
    assert not any("feel each other" in note for note in found().notes)


def test_wear_of_the_paper_case():
    """K_tc and K_rc of the virtual workpiece (902 MPa, 0.26), no edges; without the cross terms they are wrong."""
    cutter = Cutter(2, 0.012, oblique_cut().tooling.cutter.helix)
    worn = wear_of(found(), cutter, CASE)
    assert worn.separable
    np.testing.assert_allclose(worn.coefficient[:, :2].mean(axis=0), [902e6, 0.26 * 902e6], rtol=0.04)
    wrong = wear_of(watch(measured_flange(cross=False)), cutter, CASE)
    assert worn.misfit < 0.5 * wrong.misfit


def test_exported_to_python_control():
    """Filters, plant and force models of both axes as one sampled state space, in the steady state."""
    observer = found().observer
    (together,) = observer.filters
    last = {name: getattr(together, name)[-1:] for name in ("gain", "variance", "row", "force_variance")}
    steady = replace(observer, axes=tuple(replace(each, run_out=None) for each in observer.axes), filters=(replace(together, **last),))
    gap, acceleration = signals(1500)
    gap = gap - gap[0]
    system = steady.to_control()
    assert system.input_labels == ["gap_x", "acceleration_x", "gap_y", "acceleration_y"]
    assert system.output_labels == ["force_x", "force_y", "innovation_x", "innovation_y"]
    inputs = np.stack([gap[:, 0], acceleration[:, 0], gap[:, 1], acceleration[:, 1]])
    shown = control.forced_response(system, inputs=inputs).outputs
    expected = steady.run(steady.init(), gap, acceleration)[1]
    np.testing.assert_allclose(shown[:2].T, expected.force, atol=1e-6 * np.abs(expected.force).max())
    np.testing.assert_allclose(shown[2:].T, expected.innovation, atol=1e-6 * np.abs(expected.innovation).max())
    # axes of their own leave together, too
    apart = watch(measured_flange(cross=False)).observer.to_control()
    assert apart.input_labels == system.input_labels
    assert apart.output_labels == system.output_labels
    assert np.all(apart.D[0, 2:] == 0.0)
