"""Regenerative milling in time with teeth that leave the cut; arrays and scalars only.

Steps are equal in rotation. The structure moves exactly under a force that is linear over each step; the force at a step's end is
found with the motion there by two corrections. The chip of a tooth is the smallest distance to what the teeth before it left, over
one revolution of them, so that a tooth that misses leaves the surface as it was.

`plan` holds STEP (angle), SPEED, KT, KR, TE, RE (forces per area and per width), ENTRY, EXIT, RUB (indentation force per width, times
cutting speed over velocity into the material), FRICTION, RADIUS, WIDTH (of a slice), SWING, SWINGS (amplitude and ratio of a varying
speed), LEAVES (whether teeth may leave the cut and the flank rubs one way only), REGENERATE.
"""

from __future__ import annotations

import math

import numba
import numpy as np

STEP, SPEED, KT, KR, TE, RE, ENTRY, EXIT, RUB, FRICTION, RADIUS, WIDTH, SWING, SWINGS, LEAVES, REGENERATE, COUNT = range(17)


@numba.njit(cache=True)
def force_at(step, here, velocity, past, teeth, lag, plan, speed, out):
    """Force on the tool (feed, normal) at a step.

    Parameters
    ----------
    here, velocity : arrays (2,)
        The tip, feed and normal.
    past : array (n, 2)
        Ring of tips, feed and normal, at the steps before this one, which has the number `step`.
    teeth : array (z, 2 + 3 z)
        Angle ahead of tooth 1, runout, then for each tooth ahead: steps ago, feed since then, its runout.
    lag : array (s,)
        Angle by which each slice lags the tip.
    out : array (2,)
    """
    out[0], out[1] = 0.0, 0.0
    size, count, theta = past.shape[0], teeth.shape[0], plan[STEP] * step
    rub = plan[RUB] / (speed * plan[RADIUS])
    for j in range(count):
        for lagging in lag:
            phi = (theta + teeth[j, 0] - lagging + 0.5 * plan[STEP]) % (2.0 * math.pi) - 0.5 * plan[STEP]
            # the share of the step about this place in which the tooth is inside: without it the entry would jump by a step
            low, high = max(phi - 0.5 * plan[STEP], plan[ENTRY]), min(phi + 0.5 * plan[STEP], plan[EXIT])
            inside = (high - low) / plan[STEP]
            if inside <= 0.0:
                continue
            phi = 0.5 * (low + high)
            s, c = math.sin(phi), math.cos(phi)
            chip, nearest = 1e300, 1e300
            for k in range(count):
                ago, feed, other = teeth[j, 2 + 3 * k], teeth[j, 3 + 3 * k], teeth[j, 4 + 3 * k]
                still, moved = feed * s + teeth[j, 1] - other, 0.0
                if plan[REGENERATE] > 0.0:
                    whole = int(ago)
                    part = ago - whole
                    a = (step - whole) % size
                    b = (step - whole - 1) % size
                    x = here[0] - (1.0 - part) * past[a, 0] - part * past[b, 0]
                    y = here[1] - (1.0 - part) * past[a, 1] - part * past[b, 1]
                    moved = s * x + c * y
                # without loss of contact the surface that decides is that of a tool which does not vibrate
                distance = still + moved if plan[LEAVES] > 0.0 else still
                if distance < nearest:
                    nearest, chip = distance, still + moved
            if nearest <= 0.0:
                continue
            tangential = plan[KT] * chip + plan[TE]
            radial = plan[KR] * chip + plan[RE]
            into = s * velocity[0] + c * velocity[1]
            if plan[LEAVES] == 0.0 or into > 0.0:
                radial += rub * into
                tangential += plan[FRICTION] * rub * into
            out[0] -= inside * plan[WIDTH] * (tangential * c + radial * s)
            out[1] += inside * plan[WIDTH] * (tangential * s - radial * c)


@numba.njit(cache=True)
def simulate(pole, outputs, inputs, constant, teeth, lag, plan, state, force, past, start, samples):
    """March `samples.shape[0]` steps on, from step number `start`.

    Parameters
    ----------
    outputs, inputs, constant : shapes (2, m), (m, 2), (2, 2)
        In feed and normal direction.
    state : complex array (m,), force : array (2,), past : array (n, 2)
        Changed in place: what the next call begins with.
    samples : array (count, 6)
        Written: tip, its velocity and the force, feed and normal, at each step.
    """
    m, size = pole.size, past.shape[0]
    decay = np.empty(m, dtype=np.complex128)
    before, now = np.empty((m, 2), dtype=np.complex128), np.empty((m, 2), dtype=np.complex128)
    free, here, velocity, new = np.empty(m, dtype=np.complex128), np.empty(2), np.empty(2), np.empty(2)
    jump = np.zeros((2, 2))
    for k in range(m):
        for a in range(2):
            for b in range(2):
                jump[a, b] += (2.0 * outputs[a, k] * inputs[k, b]).real
    prepared = False
    time = 0.0
    for n in range(samples.shape[0]):
        step = start + n
        h = plan[STEP] / plan[SPEED]
        if plan[SWING] > 0.0:
            # Newton's method for the time of this rotation, from that of the last one
            swing = plan[SWINGS] * plan[SPEED]
            then = _time(plan[STEP] * (step - 1), plan[STEP] * (step - 1) / plan[SPEED] if n == 0 else time, plan)
            time = _time(plan[STEP] * step, then + h, plan)
            h = time - then
            speed = plan[SPEED] * (1.0 + plan[SWING] * math.sin(swing * time))
        else:
            speed = plan[SPEED]
        if plan[SWING] > 0.0 or not prepared:
            for k in range(m):
                x = pole[k] * h
                decay[k] = np.exp(x)
                if abs(x) > 1e-3:
                    first = (decay[k] - 1.0) / x
                    second = (first - 1.0) / x
                else:
                    first = 1.0 + x * (0.5 + x / 6.0)
                    second = 0.5 + x * (1.0 / 6.0 + x / 24.0)
                for b in range(2):
                    before[k, b] = h * (first - second) * inputs[k, b]
                    now[k, b] = h * second * inputs[k, b]
            prepared = True
        for k in range(m):
            free[k] = decay[k] * state[k] + before[k, 0] * force[0] + before[k, 1] * force[1]
        new[0], new[1] = force[0], force[1]
        for _ in range(3):
            for a in range(2):
                here[a] = constant[a, 0] * new[0] + constant[a, 1] * new[1]
                velocity[a] = jump[a, 0] * new[0] + jump[a, 1] * new[1]
                for k in range(m):
                    p = free[k] + now[k, 0] * new[0] + now[k, 1] * new[1]
                    y = 2.0 * outputs[a, k] * p
                    here[a] += y.real
                    velocity[a] += (pole[k] * y).real
            force_at(step, here, velocity, past, teeth, lag, plan, speed, new)
        for k in range(m):
            state[k] = free[k] + now[k, 0] * new[0] + now[k, 1] * new[1]
        force[0], force[1] = new[0], new[1]
        for a in range(2):
            here[a] = constant[a, 0] * new[0] + constant[a, 1] * new[1]
            velocity[a] = jump[a, 0] * new[0] + jump[a, 1] * new[1]
            for k in range(m):
                y = 2.0 * outputs[a, k] * state[k]
                here[a] += y.real
                velocity[a] += (pole[k] * y).real
            past[step % size, a] = here[a]
            samples[n, a], samples[n, 2 + a], samples[n, 4 + a] = here[a], velocity[a], new[a]


@numba.njit(cache=True)
def _time(angle, guess, plan):
    swing = plan[SWINGS] * plan[SPEED]
    time = guess
    for _ in range(50):
        angle_there = plan[SPEED] * (time + plan[SWING] / swing * (1.0 - math.cos(swing * time)))
        change = (angle_there - angle) / (plan[SPEED] * (1.0 + plan[SWING] * math.sin(swing * time)))
        time -= min(max(change, -1.0 / swing), 1.0 / swing)
        if abs(change) * swing < 1e-14:
            break
    return time
