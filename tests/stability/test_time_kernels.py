"""The march through time against a slow one; these tests run again without the compiler."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import scipy.linalg

from rcsa_ident.cutting.process import ProcessDamping, SpeedVariation
from rcsa_ident.cutting.rows import places_of
from rcsa_ident.stability._kernels import time as kernels
from rcsa_ident.stability.time_domain import _Cut
from rcsa_ident.stability.tip_modes import ModeArrays
from tests.stability import shaped_mills as mills
from tests.stability.mills import RPM, SKEWED, mill, tip

SPEED, DEPTH = 9000.0 * RPM, 1.5e-3
CASES = {
    "half": (tip(SKEWED), mill(2, 0.5, feed_per_tooth=1e-4)),
    "helix, edges, rubbing": (
        tip(SKEWED),
        mill(3, 0.4, helix=0.6, feed_per_tooth=5e-5, damping=ProcessDamping(3e13, 6e-5), feed_angle=0.5),
    ),
    "run-out": (tip(SKEWED), mill(2, 0.5, runout=[0.0, 60e-6], feed_per_tooth=5e-5)),
    "pitch": (tip(SKEWED), mill(3, 0.5, pitch=np.radians([100.4, 120.9, 138.7]), feed_per_tooth=5e-5)),
    "a varying speed": (
        tip(SKEWED),
        mill(2, 0.5, feed_per_tooth=5e-5, speed_variation=SpeedVariation(0.3, 0.3), damping=ProcessDamping(1e14, 6e-5)),
    ),
    "a ball": (mills.tip(mills.M1), replace(mills.BALL, feed_per_tooth=1e-4, damping=ProcessDamping(3e13, 6e-5))),
    "a face mill, slopes": (mills.tip(mills.M2, -7.0), replace(mills.FACE, feed_per_tooth=1e-4)),
    "a helix of each tooth": (mills.tip(mills.M1[:2]), replace(mills.HELIX, feed_per_tooth=1e-4)),
}


def force_of(process, step, here, velocity, path, number, depth, plan, speed):
    """The force of all teeth, over the share of the step about each tooth's place in which it cuts, in as many directions as `here`."""
    directions, cutter, known = here.size, process.cutter, process.coefficients
    total = np.zeros(directions)
    for z, r, kappa, width, start, end in slices_of(process, depth):
        # how a rigid cutter's point moves with the tip, (x, y, z) by direction
        for j in range(cutter.teeth):
            lag = 2.0 * z * np.tan(cutter.helices[j]) / cutter.diameter
            middle = (step * number + cutter.tooth_angle[j] - lag + 0.5 * step) % (2.0 * np.pi) - 0.5 * step
            low, high = max(middle - 0.5 * step, start), min(middle + 0.5 * step, end)
            if high <= low:
                continue
            s, c = np.sin(0.5 * (low + high)), np.cos(0.5 * (low + high))
            jacobian = np.array([[1, 0, 0, z, 0], [0, 1, 0, 0, z], [0, 0, 1, -r * s, -r * c]])[:, :directions]
            out = np.array([np.sin(kappa) * s, np.sin(kappa) * c, -np.cos(kappa)])
            normal = jacobian.T @ out
            chips, still, back = [], [], 0.0
            for k in range(cutter.teeth):
                ahead = (j + k + 1) % cutter.teeth
                one, two = (j + k) % cutter.teeth, ahead
                back += cutter.pitch[one] + 2.0 * z / cutter.diameter * (np.tan(cutter.helices[one]) - np.tan(cutter.helices[two]))
                moved = process.feed_per_tooth * cutter.teeth * back / (2.0 * np.pi) * s
                moved += cutter.runout[j] - cutter.runout[ahead]
                then = np.array([np.interp(number - back / step, *axis) for axis in path])
                still.append(np.sin(kappa) * moved)
                chips.append(np.sin(kappa) * moved + normal @ (here - then))
            decides = np.argmin(chips if plan.leaves else still)
            if (chips if plan.leaves else still)[decides] <= 0.0:
                continue
            chip = known.tangential * chips[decides]
            tangential, radial = chip + known.tangential_edge, known.radial_ratio * chip + known.radial_edge
            axial = known.axial_ratio * chip + known.axial_edge
            into = normal @ velocity
            if process.damping is not None and (into > 0.0 or not plan.leaves):
                rub = (
                    (2.0 if plan.leaves else 1.0) * process.damping.strength / (speed * max(r, 0.1 * cutter.outline.largest_radius)) * into
                )
                tangential, radial = tangential + process.damping.friction * rub, radial + rub
            upward = np.array([-np.cos(kappa) * s, -np.cos(kappa) * c, -np.sin(kappa)])
            pushes = tangential * np.array([-c, s, 0.0]) - radial * out + axial * upward
            total += (high - low) / step * width * (jacobian.T @ pushes)
    return total


def slices_of(process, depth):
    """Height, radius, angle of the normal, width and immersion of slices: of a cylinder as many as the code takes, of a shape its nodes."""
    cutter = process.cutter
    if process.is_plain:
        count = max(1, int(np.ceil(12.0 * depth * 2.0 * np.tan(cutter.helix) / cutter.diameter)))
        z = depth * (np.arange(count) + 0.5) / count
        return [(each, 0.5 * cutter.diameter, 0.5 * np.pi, depth / count, *process.engagement.angles) for each in z]
    found = []
    for piece in places_of(cutter, process.engagement, depth, along=True):
        for arc in piece.arcs:
            found += [(*place, *angles) for *place, angles in zip(piece.z, piece.r, piece.kappa, piece.width, arc, strict=True)]
    return found


@pytest.mark.parametrize("leaves", [True, False])
@pytest.mark.parametrize("name", CASES)
def test_march(name, leaves):
    """State space, matrix exponentials and forces found until they stand still."""
    modes, process = CASES[name]
    cut = _Cut(modes, process, SPEED, leaves)
    run = cut.begin(DEPTH).pushed(2e-5)
    first, m, r = run.number, modes.pole.size, cut.directions
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
        block = np.zeros((2 * m + 2 * r, 2 * m + 2 * r), dtype=complex)
        block[: 2 * m, : 2 * m], block[: 2 * m, 2 * m : 2 * m + r] = free, into
        block[2 * m : 2 * m + r, 2 * m + r :] = np.eye(r) / h
        step = scipy.linalg.expm(block * h)
        v = process.speed_variation
        speed = SPEED * (1.0 if v is None else 1.0 + v.amplitude * np.sin(v.ratio * SPEED * times[i + 1]))
        new, path = force, [(order, tips[:, a]) for a in range(r)]
        for _ in range(12):
            after = step[: 2 * m, : 2 * m] @ state + step[: 2 * m, 2 * m : 2 * m + r] @ force
            after = after + step[: 2 * m, 2 * m + r :] @ (new - force)
            here, velocity = np.real(out @ after), np.real(out @ (free @ after + into @ new))
            new = force_of(process, cut.step, here, velocity, path, number, DEPTH, run.plan, speed)
        state, force = after, new
        order, tips = np.append(order, number), np.vstack([tips, here])
        np.testing.assert_allclose(samples[i, :r], here, rtol=0, atol=1e-4 * np.abs(samples[:, :r]).max())
        np.testing.assert_allclose(samples[i, 2 * r :], new, rtol=0, atol=4e-4 * np.abs(samples[:, 2 * r :]).max())
    np.testing.assert_allclose(run.memory.state, state[:m], rtol=0, atol=1e-3 * np.abs(state).max())
    np.testing.assert_allclose(
        samples[:, r : 2 * r], np.gradient(samples[:, :r], times[1:], axis=0), rtol=0, atol=0.1 * np.abs(samples[:, r : 2 * r]).max()
    )


def test_flanks_rub_at_the_speed_of_the_moment():
    """A quarter of a wave of the speed after the start it is 30 % off, and so is what rubs."""
    modes, process = CASES["a varying speed"]
    # both ways, as in the linear equations
    cut = _Cut(modes, process, SPEED, False)
    run = cut.begin(DEPTH).pushed(2e-5)
    first, r = run.number, cut.directions
    order = np.arange(first - run.memory.past.shape[0], first)
    tips = run.memory.past[order % run.memory.past.shape[0]]
    # a wave takes 1 / 0.3 turns
    samples = run.march(int(0.5 * np.pi / 0.3 / cut.step))
    largest = np.abs(samples[:, 2 * r :]).max()
    i = int(np.flatnonzero(np.abs(samples[:, 2 * r :]).max(axis=1) > 0.3 * largest)[-1])
    number, v = first + i, process.speed_variation
    speed = SPEED * (1.0 + v.amplitude * np.sin(v.ratio * SPEED * cut.time(cut.step * np.array([number]))[0]))
    assert abs(speed / SPEED - 1.0) > 0.25
    path = [(np.append(order, np.arange(first, number)), np.append(tips[:, a], samples[:i, a])) for a in range(r)]
    moved = process, cut.step, samples[i, :r], samples[i, r : 2 * r], path, number, DEPTH, run.plan
    np.testing.assert_allclose(samples[i, 2 * r :], force_of(*moved, speed), rtol=0.0, atol=4e-4 * largest)
    assert np.abs(samples[i, 2 * r :] - force_of(*moved, SPEED)).max() > 4e-3 * largest


def test_a_tooth_in_the_air_pushes_nothing():
    cut = _Cut(*CASES["half"], SPEED, True)
    run = cut.begin(DEPTH)

    def force(number, here, plan):
        out = np.empty(2)
        kernels.force_at(number, here, np.zeros(2), 0.0 * run.memory.past, run.pieces, plan, SPEED, np.empty(2), out)
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
    plan = _Cut(*CASES["half"], 900.0, True).begin(DEPTH).plan._replace(swing=0.7, swings=0.3)
    for t in (1e-3, 0.02, 0.11):
        swing = 0.3 * 900.0
        angle = 900.0 * (t + 0.7 / swing * (1.0 - np.cos(swing * t)))
        assert kernels._time(angle, 0.9 * t, plan) == pytest.approx(t, rel=1e-12)


@pytest.mark.parametrize("name", CASES)
def test_pieces_of_an_edge_push_on_their_own(name):
    """The force of all is the sum of what each pushes with, also where some are in the air and others are not."""
    cut = _Cut(*CASES[name], SPEED, True)
    run, rng = cut.begin(DEPTH), np.random.default_rng(4)
    alone, whole = np.empty((len(run.pieces), cut.directions)), np.empty(cut.directions)
    mixed = 0
    for number in rng.integers(0, 4000, 12):
        here, velocity, past = (scale * rng.standard_normal(shape) for scale, shape in (
            (4e-5, cut.directions), (0.05, cut.directions), (4e-5, run.memory.past.shape)
        ))  # fmt: skip
        for i in range(len(run.pieces)):
            kernels.force_at(number, here, velocity, past, run.pieces[i : i + 1], run.plan, SPEED, np.empty(cut.directions), alone[i])
        kernels.force_at(number, here, velocity, past, run.pieces, run.plan, SPEED, np.empty(cut.directions), whole)
        np.testing.assert_allclose(whole, alone.sum(axis=0), rtol=1e-9, atol=1e-9 * np.abs(alone).max())
        pushes = np.any(alone != 0.0, axis=1)
        mixed += np.any(np.diff(pushes.astype(int)) == 1)
    assert mixed > 0


def test_a_step_of_any_pole():
    """A force that falls to zero over the step, by Gauss's quadrature, also of poles that hardly move in a step."""
    h, rng = 1e-4, np.random.default_rng(5)
    x = np.array([0.0, 1e-6j, 9.9e-4, -7e-4 + 7e-4j, -1.01e-3, -0.3 + 2.0j, -5.0])
    node, weight = np.polynomial.legendre.leggauss(30)
    falls = 0.5 * weight @ (np.exp(0.5 * (node[:, None] + 1.0) * x) * 0.5 * (node[:, None] + 1.0))
    outputs, inputs = (rng.standard_normal(shape) + 1j * rng.standard_normal(shape) for shape in ((2, 7), (7, 2)))
    force = rng.standard_normal(2)
    # of the force's size, so that neither drowns
    state = h * (rng.standard_normal(7) + 1j * rng.standard_normal(7))
    expected = np.exp(x) * state + h * falls * (inputs @ force)
    cut = _Cut(*CASES["half"], SPEED, True)
    run = cut.begin(DEPTH)
    plan, memory = run.plan._replace(step=h * SPEED), kernels.Memory(state, force.copy(), np.zeros((10, 2)))
    samples = np.empty((1, 6))
    modes = ModeArrays(x / h, outputs, inputs, np.zeros((2, 2)))
    kernels.simulate(modes, run.pieces[:0], plan, memory, 5, samples)
    np.testing.assert_allclose(memory.state, expected, rtol=2e-10)
    np.testing.assert_allclose(samples[0, :2], 2.0 * np.real(outputs @ expected), rtol=1e-9)
    np.testing.assert_allclose(samples[0, 2:4], 2.0 * np.real(outputs @ (x / h * expected)), rtol=1e-9)
    np.testing.assert_array_equal(memory.past[5], samples[0, :2])
