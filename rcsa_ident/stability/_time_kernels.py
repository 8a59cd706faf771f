"""Regenerative milling in time with teeth that leave the cut; arrays and scalars only.

Steps are equal in rotation. The structure moves exactly under a force that is linear over each step; the force at a step's end is
found with the motion there by two corrections. The chip of a tooth is the smallest distance to what the teeth before it left, over
one revolution of them, so that a tooth that misses leaves the surface as it was.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numba
import numpy as np


class TimePlan(NamedTuple):
    """A cut at a speed and a depth: what all its teeth share."""

    #: Angle [rad].
    step: float
    speed: float
    #: Forces per area, and per width.
    k_tangential: float
    k_radial: float
    edge_tangential: float
    edge_radial: float
    #: Indentation force per width, times cutting speed over velocity into the material.
    rub: float
    friction: float
    radius: float
    #: Amplitude and ratio of a varying speed.
    swing: float
    swings: float
    #: Whether teeth may leave the cut and the flank rubs one way only.
    leaves: bool
    #: Whether a tooth cuts what others have left, or a surface that knows no vibration.
    regenerate: bool


class Memory(NamedTuple):
    """What the next step begins with; a march changes it in place."""

    #: Complex, shape (m,).
    state: np.ndarray
    #: Feed and normal, shape (2,).
    force: np.ndarray
    #: Ring of tips, feed and normal, at the steps before, shape (n, 2).
    past: np.ndarray


@numba.njit(cache=True)
def force_at(step, here, velocity, past, teeth, slices, plan, speed, out):
    """Force on the tool (feed, normal) at a step.

    Parameters
    ----------
    here, velocity : arrays (2,)
        The tip, feed and normal.
    past : array (n, 2)
        Ring of tips, feed and normal, at the steps before this one, which has the number `step`.
    teeth : array (z, 2 + 3 z)
        Angle ahead of tooth 1, runout, then for each tooth ahead: steps ago, feed since then, its runout.
    slices : array (s, 4)
        Of the edge: angle by which it lags the tip, angles between which it cuts, width.
    speed : float
        Of the spindle, now.
    out : array (2,)
    """
    out[0], out[1] = 0.0, 0.0
    size, count, theta = past.shape[0], teeth.shape[0], plan.step * step
    rub = plan.rub / (speed * plan.radius)
    for j in range(count):
        for i in range(slices.shape[0]):
            phi = (theta + teeth[j, 0] - slices[i, 0] + 0.5 * plan.step) % (2.0 * math.pi) - 0.5 * plan.step
            # the share of the step about this place in which the tooth is inside: without it the entry would jump by a step
            low, high = max(phi - 0.5 * plan.step, slices[i, 1]), min(phi + 0.5 * plan.step, slices[i, 2])
            inside = (high - low) / plan.step
            if inside <= 0.0:
                continue
            phi = 0.5 * (low + high)
            s, c = math.sin(phi), math.cos(phi)
            chip, nearest = 1e300, 1e300
            for k in range(count):
                ago, feed, other = teeth[j, 2 + 3 * k], teeth[j, 3 + 3 * k], teeth[j, 4 + 3 * k]
                still, moved = feed * s + teeth[j, 1] - other, 0.0
                if plan.regenerate:
                    whole = int(ago)
                    part = ago - whole
                    a = (step - whole) % size
                    b = (step - whole - 1) % size
                    x = here[0] - (1.0 - part) * past[a, 0] - part * past[b, 0]
                    y = here[1] - (1.0 - part) * past[a, 1] - part * past[b, 1]
                    moved = s * x + c * y
                # without loss of contact the surface that decides is that of a tool which does not vibrate
                distance = still + moved if plan.leaves else still
                if distance < nearest:
                    nearest, chip = distance, still + moved
            if nearest <= 0.0:
                continue
            tangential = plan.k_tangential * chip + plan.edge_tangential
            radial = plan.k_radial * chip + plan.edge_radial
            into = s * velocity[0] + c * velocity[1]
            if not plan.leaves or into > 0.0:
                radial += rub * into
                tangential += plan.friction * rub * into
            out[0] -= inside * slices[i, 3] * (tangential * c + radial * s)
            out[1] += inside * slices[i, 3] * (tangential * s - radial * c)


@numba.njit(cache=True)
def simulate(modes, teeth, slices, plan, memory, start, samples):
    """March `samples.shape[0]` steps on, from step number `start`.

    Parameters
    ----------
    modes, plan, memory : ModeArrays, TimePlan, Memory
        In feed and normal direction.
    teeth, slices
        As in `force_at`.
    samples : array (count, 6)
        Written: tip, its velocity and the force, feed and normal, at each step.
    """
    pole, outputs, inputs, constant = modes
    state, force, past = memory
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
        h = plan.step / plan.speed
        if plan.swing > 0.0:
            # Newton's method for the time of this rotation, from that of the last one
            swing = plan.swings * plan.speed
            then = _time(plan.step * (step - 1), plan.step * (step - 1) / plan.speed if n == 0 else time, plan)
            time = _time(plan.step * step, then + h, plan)
            h = time - then
            speed = plan.speed * (1.0 + plan.swing * math.sin(swing * time))
        else:
            speed = plan.speed
        if plan.swing > 0.0 or not prepared:
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
            force_at(step, here, velocity, past, teeth, slices, plan, speed, new)
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
    swing = plan.swings * plan.speed
    time = guess
    for _ in range(50):
        angle_there = plan.speed * (time + plan.swing / swing * (1.0 - math.cos(swing * time)))
        change = (angle_there - angle) / (plan.speed * (1.0 + plan.swing * math.sin(swing * time)))
        time -= min(max(change, -1.0 / swing), 1.0 / swing)
        if abs(change) * swing < 1e-14:
            break
    return time
