"""The march through time against a slow one; these tests run again without the compiler."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.linalg

from rcsa_ident.cutting.process import ProcessDamping, SpeedVariation
from rcsa_ident.stability import _time_kernels as kernels
from rcsa_ident.stability.time_domain import _Cut
from tests.stability.mills import RPM, SKEWED, mill, tip

SPEED, DEPTH = 9000.0 * RPM, 1.5e-3
CASES = {
    "half": mill(2, 0.5, feed_per_tooth=1e-4),
    "helix, edges, rubbing": mill(3, 0.4, helix=0.6, feed_per_tooth=5e-5, damping=ProcessDamping(3e13, 6e-5), feed_angle=0.5),
    "run-out": mill(2, 0.5, runout=[0.0, 60e-6], feed_per_tooth=5e-5),
    "pitch": mill(3, 0.5, pitch=np.radians([100.4, 120.9, 138.7]), feed_per_tooth=5e-5),
    "a varying speed": mill(2, 0.5, feed_per_tooth=5e-5, speed_variation=SpeedVariation(0.3, 0.5)),
}


def force_of(process, step, here, velocity, path, number, slices, plan, speed):
    """The force of all teeth, over the share of the step about each tooth's place in which it cuts."""
    cutter, total = process.cutter, np.zeros(2)
    for j in range(cutter.teeth):
        for lag, entry, leave, width in slices:
            middle = (step * number + cutter.tooth_angle[j] - lag + 0.5 * step) % (2.0 * np.pi) - 0.5 * step
            low, high = max(middle - 0.5 * step, entry), min(middle + 0.5 * step, leave)
            if high <= low:
                continue
            normal = np.array([np.sin(0.5 * (low + high)), np.cos(0.5 * (low + high))])
            chips, still, back = [], [], 0.0
            for k in range(cutter.teeth):
                ahead = (j + k + 1) % cutter.teeth
                back += cutter.pitch[(j + k) % cutter.teeth]
                moved = process.feed_per_tooth * cutter.teeth * back / (2.0 * np.pi) * normal[0]
                moved += cutter.runout[j] - cutter.runout[ahead]
                then = np.array([np.interp(number - back / step, *axis) for axis in path])
                still.append(moved)
                chips.append(moved + normal @ (here - then))
            decides = np.argmin(chips if plan.leaves else still)
            if (chips if plan.leaves else still)[decides] <= 0.0:
                continue
            tangential = plan.k_tangential * chips[decides] + plan.edge_tangential
            radial = plan.k_radial * chips[decides] + plan.edge_radial
            into = normal @ velocity
            if into > 0.0 or not plan.leaves:
                rub = plan.rub / (speed * plan.radius) * into
                tangential, radial = tangential + plan.friction * rub, radial + rub
            pair = np.array([-tangential * normal[1] - radial * normal[0], tangential * normal[0] - radial * normal[1]])
            total += (high - low) / step * width * pair
    return total


@pytest.mark.parametrize("leaves", [True, False])
@pytest.mark.parametrize("name", CASES)
def test_march(name, leaves):
    """State space, matrix exponentials and forces found until they stand still."""
    process = CASES[name]
    cut = _Cut(tip(SKEWED), process, SPEED, leaves)
    run = cut.begin(DEPTH).pushed(2e-5)
    first, m = run.number, len(SKEWED)
    order = np.arange(first - run.memory.past.shape[0], first)
    tips = run.memory.past[order % run.memory.past.shape[0]]
    fast_from = run.memory.state.copy(), run.memory.force.copy()
    count = 40
    samples = run.march(count)
    # real coordinates of each mode: p and its mirror
    pole, outputs, inputs, _ = cut.arrays
    free = np.diag(np.concatenate([pole, pole.conj()]))
    out, into = np.hstack([outputs, outputs.conj()]), np.vstack([inputs, inputs.conj()])
    state, force = np.concatenate([fast_from[0], fast_from[0].conj()]), fast_from[1]
    times = cut.time(cut.step * np.arange(first - 1, first + count))
    for i in range(count):
        number, h = first + i, times[i + 1] - times[i]
        block = np.zeros((2 * m + 4, 2 * m + 4), dtype=complex)
        block[: 2 * m, : 2 * m], block[: 2 * m, 2 * m : 2 * m + 2] = free, into
        block[2 * m : 2 * m + 2, 2 * m + 2 :] = np.eye(2) / h
        step = scipy.linalg.expm(block * h)
        v = process.speed_variation
        speed = SPEED * (1.0 if v is None else 1.0 + v.amplitude * np.sin(v.ratio * SPEED * times[i + 1]))
        new, path = force, [(order, tips[:, 0]), (order, tips[:, 1])]
        for _ in range(12):
            after = step[: 2 * m, : 2 * m] @ state + step[: 2 * m, 2 * m : 2 * m + 2] @ force
            after = after + step[: 2 * m, 2 * m + 2 :] @ (new - force)
            here, velocity = np.real(out @ after), np.real(out @ (free @ after + into @ new))
            new = force_of(process, cut.step, here, velocity, path, number, run.slices, run.plan, speed)
        state, force = after, new
        order, tips = np.append(order, number), np.vstack([tips, here])
        np.testing.assert_allclose(samples[i, :2], here, rtol=0, atol=1e-4 * np.abs(samples[:, :2]).max())
        np.testing.assert_allclose(samples[i, 4:], new, rtol=0, atol=4e-4 * np.abs(samples[:, 4:]).max())
    np.testing.assert_allclose(run.memory.state, state[:m], rtol=0, atol=1e-3 * np.abs(state).max())
    np.testing.assert_allclose(
        samples[:, 2:4], np.gradient(samples[:, :2], times[1:], axis=0), rtol=0, atol=0.1 * np.abs(samples[:, 2:4]).max()
    )


def test_a_tooth_in_the_air_pushes_nothing():
    cut = _Cut(tip(SKEWED), CASES["half"], SPEED, True)
    run = cut.begin(DEPTH)

    def force(number, here, plan):
        out = np.empty(2)
        kernels.force_at(number, here, np.zeros(2), 0.0 * run.memory.past, cut.teeth, run.slices, plan, SPEED, out)
        return out

    np.testing.assert_array_equal(force(int(0.25 * np.pi / cut.step), np.zeros(2), run.plan), 0.0)
    number = int(0.7 * np.pi / cut.step)
    assert np.all(np.abs(force(number, np.zeros(2), run.plan)) > 1.0)
    # pushed out of the cut by more than the feed
    phi = cut.step * number
    away = -2e-4 * np.array([np.sin(phi), np.cos(phi)])
    np.testing.assert_array_equal(force(number, away, run.plan), 0.0)
    # the linear equations know no air
    assert np.any(force(number, away, run.plan._replace(leaves=False)))


def test_clock():
    plan = _Cut(tip(SKEWED), CASES["half"], 900.0, True).begin(DEPTH).plan._replace(swing=0.7, swings=0.3)
    for t in (1e-3, 0.02, 0.11):
        swing = 0.3 * 900.0
        angle = 900.0 * (t + 0.7 / swing * (1.0 - np.cos(swing * t)))
        assert kernels._time(angle, 0.9 * t, plan) == pytest.approx(t, rel=1e-12)
