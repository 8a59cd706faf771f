"""The time-domain method: limits of the linear equations, contact, forces that are known, another simulator's answers."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from rcsa_ident.base.errors import InputError
from rcsa_ident.cutting.coefficients import CuttingCoefficients
from rcsa_ident.cutting.force import force_history, force_lines, runout_force_lines
from rcsa_ident.cutting.process import ProcessDamping, SpeedVariation
from rcsa_ident.dynamics.coordinates import Coordinate
from rcsa_ident.stability import time_domain
from rcsa_ident.stability.discretisation import FullDiscretisation
from rcsa_ident.stability.first_instability import first_loss
from rcsa_ident.stability.lobes import stability_lobes
from rcsa_ident.stability.multiplier_limits import Growth, longest_step
from rcsa_ident.stability.time_domain import TimeDomain, _Cut, milling_history
from rcsa_ident.virtual.limit import true_limit
from rcsa_ident.virtual.reduction import Poles
from tests.oracles.literature import LIMIT_RPM, SLOT_LIMIT_MM
from tests.stability.mills import ONE, PASSING, RPM, SKEWED, SLOW, mill, slow_slot, tip

LINEAR, CONTACT, FULL = TimeDomain(contact_loss=False), TimeDomain(), FullDiscretisation()
EDGED = CuttingCoefficients(6e8, 0.3, tangential_edge=2e4, radial_edge=1.5e4)
#: So stiff that nothing vibrates.
STIFF = ((0, 3000.0, 0.05, 1e5), (1, 3500.0, 0.05, 1e5))


@pytest.mark.slow
def test_published_slot():
    found = stability_lobes(tip(ONE), mill(2, 1.0), LIMIT_RPM[:3] * RPM, 30e-3, LINEAR)
    np.testing.assert_allclose(found.limit_depth * 1e3, SLOT_LIMIT_MM["one"][:3], rtol=1e-2)


EQUAL = {
    "half": mill(3, 0.5, feed_angle=0.4),
    "helix, little": mill(2, 0.1, "up", np.radians(40.0), feed_angle=0.4),
    "edges": mill(2, 0.5, coefficients=EDGED),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", EQUAL)
def test_equal_teeth_stay_in_the_cut(name):
    """A disturbance that is small against the feed lifts no tooth: the same limit with contact and without."""
    speeds = np.array([6000.0, 18_000.0]) * RPM
    exact = stability_lobes(tip(SKEWED), EQUAL[name], speeds, 20e-3, FULL)
    for method in (LINEAR, CONTACT):
        found = stability_lobes(tip(SKEWED), EQUAL[name], speeds, 20e-3, method)
        np.testing.assert_allclose(found.limit_depth, exact.limit_depth, rtol=1e-2)
        np.testing.assert_allclose(found.chatter_frequency, exact.chatter_frequency, rtol=5e-3)
        np.testing.assert_array_equal(found.lobe, exact.lobe)
        np.testing.assert_array_equal(found.flip, exact.flip)


def test_a_cut_that_begins_with_a_tooth_in_it():
    """Three teeth, half immersion: one is in the material at angle 0. What is not the steady state there would chatter, too."""
    speeds = np.array([30_000.0]) * RPM
    soft = ((0, 900.0, 0.02, 0.02), (1, 500.0, 0.9, 0.01))
    exact, found = (stability_lobes(tip(soft), mill(3, 0.5, feed_angle=0.4), speeds, 20e-3, m).limit_depth for m in (FULL, CONTACT))
    np.testing.assert_allclose(found, exact, rtol=1e-2)
    cut = _Cut(tip(soft), mill(3, 0.5, feed_angle=0.4), speeds[0], True)
    run = cut.begin(1e-3)
    run.march(cut.per_period)
    before = run.vector
    run.march(cut.per_period)
    np.testing.assert_allclose(run.vector, before, rtol=0, atol=1e-9 * np.abs(before).max())


@pytest.mark.slow
def test_modes_that_die_before_the_next_tooth_cuts():
    """Heavily damped modes forget a push in the air: what carries a disturbance on is the surface."""
    heavy = ((0, 700.0, 0.9, 0.01), (0, 1500.0, 0.7, 0.02), (1, 800.0, 0.99, 0.01))
    speeds = np.array([4300.0, 8000.0]) * RPM
    found = stability_lobes(tip(heavy), mill(2, 0.5), speeds, 60e-3, LINEAR).limit_depth
    cut = FULL.monodromy(tip(heavy), mill(2, 0.5))
    exact = [first_loss(Growth(cut, float(speed), longest_step(cut)), 1e-4, 60e-3, 1e-3) for speed in speeds]
    np.testing.assert_allclose(found, exact, rtol=1.2e-2)


@pytest.mark.slow
@pytest.mark.parametrize(("wear", "zeta", "immersion", "rpm"), [*SLOW, (None, 0.1, 0.3, 800.0), (5e-5, 0.02, 1.0, 1600.0)])
def test_vibrations_that_grow_before_they_die_away(wear, zeta, immersion, rpm):
    """Chatter in time is a push that grows 20 000 times: somewhat deeper than where noise grows a thousandfold, far below multipliers."""
    modes, process, speeds = tip(((1, 900.0, zeta, 0.04),)), slow_slot(wear, immersion), np.array([rpm]) * RPM
    found, exact = (float(stability_lobes(modes, process, speeds, 40e-3, m).limit_depth[0]) for m in (LINEAR, FULL))
    assert 1.05 < found / exact < 1.4


@pytest.mark.parametrize("leaves", [False, True])
@pytest.mark.parametrize("rpm", [30.0, 100.0, 200.0])
def test_what_grows_beyond_all_numbers_is_chatter(rpm, leaves):
    """Within one tooth of a slow spindle a deep cut grows by more than a number holds."""
    cut = _Cut(tip(PASSING), slow_slot(None), rpm * RPM, leaves)
    for depth in (10e-3, 60e-3):
        assert 5.0 < cut.growth(depth, 150) < 1000.0
    assert cut.growth(0.1e-3, 150) < 0.0


@pytest.mark.slow
def test_rubbing_that_a_step_does_not_resolve_is_asked_of_finer_steps(monkeypatch):
    """The flank's force is that of the step before: where it would take most of the velocity, the steps alone had a limit."""
    asked = tip(PASSING), slow_slot(1e-4), np.array([1600.0]) * RPM, 20e-3
    found = stability_lobes(*asked, CONTACT)
    assert found.warnings == ()
    coarse, fine = (_Cut(*asked[:2], float(asked[2][0]), True, finer) for finer in (1, 8))
    limit = float(found.limit_depth[0])
    assert not coarse.resolves(limit)
    assert fine.growth(0.98 * limit, 150) < 0.0 < fine.growth(1.02 * limit, 150)
    monkeypatch.setattr(time_domain, "_FINER", (1,))
    alone = stability_lobes(*asked, CONTACT)
    assert alone.warnings[0].startswith("at 1 of 1 speeds the limit is that of the simulation's steps")
    assert alone.limit_depth[0] < 0.9 * limit


@pytest.mark.slow
def test_rubbing_while_it_moves_in():
    """Half the time, twice as much: about the limit of the viscous force, not of the bare tooth."""
    bare, worn = mill(3, 0.5, helix=0.5), mill(3, 0.5, helix=0.5, damping=ProcessDamping(3e13, 8e-5))
    speeds = np.array([4000.0]) * RPM
    none, viscous = (stability_lobes(tip(SKEWED), p, speeds, 20e-3, FULL).limit_depth[0] for p in (bare, worn))
    linear, contact = (stability_lobes(tip(SKEWED), worn, speeds, 20e-3, m).limit_depth[0] for m in (LINEAR, CONTACT))
    assert linear == pytest.approx(viscous, rel=1e-2)
    assert contact == pytest.approx(viscous, rel=0.05)
    assert viscous > 1.15 * none


@pytest.mark.slow
def test_another_simulator():
    """The march of a disturbance on the virtual machine's poles."""
    modes, process = tip(SKEWED, turn=0.3), mill(2, 0.4, helix=0.5, feed_angle=0.4)
    where = (Coordinate.parse("tip.x"), Coordinate.parse("tip.y"))
    poles = Poles(modes.pole, modes.inputs, modes.outputs, where)
    for rpm in (9000.0, 15_000.0):
        speed = rpm * RPM
        other = true_limit(poles, process.cutter, process.conditions(speed, 1e-3), process.coefficients, (0.05e-3, 20e-3), 1e-4, 2e-6)
        full, linear = (stability_lobes(modes, process, [speed], 20e-3, m) for m in (FullDiscretisation(tolerance=1e-5), LINEAR))
        assert full.limit_depth[0] == pytest.approx(other.depth, rel=1e-3)
        assert linear.limit_depth[0] == pytest.approx(other.depth, rel=1e-2)


@pytest.mark.parametrize("helix", [0.0, 0.6])
def test_force_of_a_stiff_tool(helix):
    """Mean and lines of the force against closed forms, edges included."""
    process = mill(3, 0.4, helix=helix, feed_angle=0.5, coefficients=EDGED, feed_per_tooth=8e-5)
    speed, depth = 6000.0 * RPM, 2e-3
    history = milling_history(tip(STIFF), process, speed, depth, 2.0)
    conditions = process.conditions(speed, depth)
    orders = np.array([0, 3, 6, 9])
    lines = force_lines(process.cutter, conditions, process.coefficients, orders)
    count = history.time.size // 2
    wave = np.exp(-1j * orders[:, None] * history.angle[-count:])
    found = np.where(orders[:, None] == 0, 1.0, 2.0) * (wave @ history.force[-count:]) / count
    np.testing.assert_allclose(found, lines, rtol=0, atol=6e-3 * np.abs(lines).max())
    known = force_history(process.cutter, conditions, process.coefficients, history.angle, 64)[:, :2]
    error = np.sqrt(np.mean((history.force - known) ** 2)) / np.sqrt(np.mean(known**2))
    # jumps where a straight edge enters are spread over a step, a helix stands in slices of some degrees
    assert error < 0.08


def test_force_of_uneven_teeth():
    process = mill(2, 0.5, coefficients=EDGED, feed_per_tooth=5e-5, runout=[0.0, 60e-6])
    speed, depth = 6000.0 * RPM, 2e-3
    history = milling_history(tip(STIFF), process, speed, depth, 3.0)
    lines = runout_force_lines(process.cutter, process.conditions(speed, depth), process.coefficients, np.array([0, 1, 2]))
    count = history.time.size // 3
    found = np.array([np.mean(np.exp(-1j * k * history.angle[-count:])[:, None] * history.force[-count:], axis=0) for k in range(3)])
    np.testing.assert_allclose(found * np.array([1.0, 2.0, 2.0])[:, None], lines, rtol=0, atol=1e-2 * np.abs(lines).max())


def test_steady_state_does_work_and_repeats():
    """In a stable cut all periods are alike, and what the force does is what dampers and spindle share: displacement follows H."""
    process = mill(2, 0.5, feed_per_tooth=8e-5, helix=0.3)
    speed, depth = 7000.0 * RPM, 0.2e-3
    modes = tip(SKEWED)
    history = milling_history(modes, process, speed, depth, 8.0)
    tooth = history.time.size // 16
    np.testing.assert_allclose(history.tip[-tooth:], history.tip[:tooth], rtol=0, atol=1e-6 * np.abs(history.tip).max())
    # tip = H force at the lines
    orders = 2 * np.arange(1, 9)
    wave = np.exp(-1j * orders[:, None] * history.angle[-2 * tooth :])
    force, motion = wave @ history.force[-2 * tooth :], wave @ history.tip[-2 * tooth :]
    expected = np.einsum("kab,kb->ka", modes.response(orders * speed), force)
    np.testing.assert_allclose(motion, expected, rtol=0, atol=2e-3 * np.abs(expected).max())
    # over a period the force's work is what the dampers take: positive
    work = np.sum(history.force[-tooth:] * history.velocity[-tooth:]) * (history.time[1] - history.time[0])
    assert work > 0.0
    velocity = np.gradient(history.tip, history.time, axis=0)
    np.testing.assert_allclose(history.velocity[5:-5], velocity[5:-5], rtol=0, atol=2e-2 * np.abs(velocity).max())


def test_chatter_leaves_the_cut_and_stays_bounded():
    process = mill(2, 0.5, feed_per_tooth=8e-5)
    limit = stability_lobes(tip(SKEWED), process, [8000.0 * RPM], 20e-3, FULL).limit_depth[0]
    calm, wild = (milling_history(tip(SKEWED), process, 8000.0 * RPM, s * limit, 150.0, push=1e-7) for s in (0.8, 1.6))

    def ripple(h):
        tooth = 2 * round(np.pi / (h.angle[1] - h.angle[0]))
        return np.abs(h.tip[-tooth:] - h.tip[-2 * tooth : -tooth]).max()

    assert ripple(calm) < 1e-8
    # several feeds, and no further: teeth that leave the material feel no force
    assert 0.2 * 8e-5 < ripple(wild) < 100 * 8e-5
    phi = np.mod(wild.angle, np.pi)
    late = wild.force[-2000:][(phi > 0.6 * np.pi)[-2000:]]
    assert np.any(np.all(late == 0.0, axis=1))
    assert not np.any(np.all(calm.force[np.mod(calm.angle, np.pi) > 0.6 * np.pi] == 0.0, axis=1))


def test_time_of_a_varying_speed():
    process = mill(2, 0.5, feed_per_tooth=5e-5, speed_variation=SpeedVariation(0.4, 0.5))
    history = milling_history(tip(STIFF), process, 700.0, 1e-3, 4.0)
    swing, angle = 0.5 * 700.0, history.angle
    np.testing.assert_allclose(700.0 * (history.time + 0.4 / swing * (1.0 - np.cos(swing * history.time))), angle, rtol=1e-9)


def test_a_rubbing_tooth_takes_energy():
    """Beside a cut without it the tip moves less when it is pushed."""
    process = mill(2, 1.0, feed_per_tooth=8e-5)
    worn = replace(process, damping=ProcessDamping(3e13, 8e-5))
    a, b = (milling_history(tip(SKEWED), p, 3000.0 * RPM, 0.1e-3, 3.0, push=1e-6) for p in (process, worn))
    steady = [milling_history(tip(SKEWED), p, 3000.0 * RPM, 0.1e-3, 3.0) for p in (process, worn)]
    one, two = (np.abs(x.tip - y.tip)[-200:].max() for x, y in zip((a, b), steady, strict=True))
    assert two < one


@pytest.mark.parametrize(
    ("call", "field"),
    [
        (lambda: TimeDomain(periods=10), "periods"),
        (lambda: TimeDomain(tolerance=1.0), "tolerance"),
        (lambda: milling_history(tip(ONE), mill(), 900.0, 1e-3, 2.0), "feed_per_tooth"),
        (lambda: milling_history(tip(ONE), mill(feed_per_tooth=1e-4), 0.0, 1e-3, 2.0), "speed"),
        (lambda: milling_history(tip(ONE), mill(feed_per_tooth=1e-4), 900.0, -1e-3, 2.0), "depth"),
        (lambda: milling_history(tip(ONE), mill(feed_per_tooth=1e-4), 900.0, 1e-3, 0.0), "revolutions"),
        (lambda: stability_lobes(tip(ONE), mill(runout=[0.0, 1e-5]), [900.0], 1e-3, TimeDomain()), "feed_per_tooth"),
        (lambda: TimeDomain().lobes(tip(ONE).receptance(), mill(), np.array([900.0]), 1e-3), "tip"),
        (lambda: stability_lobes(tip(ONE), mill(speed_variation=SpeedVariation(0.1, np.pi / 7)), [900.0], 1e-3, TimeDomain()), "ratio"),
    ],
)
def test_bad_input(call, field):
    with pytest.raises(InputError) as error:
        call()
    assert error.value.field == field
