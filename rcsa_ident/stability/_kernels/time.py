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
    """A cut at a speed: what all its teeth share."""

    #: Angle [rad].
    step: float
    speed: float
    #: Forces per area, and per width.
    k_tangential: float
    k_radial: float
    k_axial: float
    edge_tangential: float
    edge_radial: float
    edge_axial: float
    #: Indentation force per width, times cutting speed over velocity into the material.
    rub: float
    friction: float
    #: Amplitude and ratio of a varying speed.
    swing: float
    swings: float
    #: Whether teeth may leave the cut and the flank rubs one way only.
    leaves: bool
    #: Whether a tooth cuts what others have left, or a surface that knows no vibration.
    regenerate: bool


#: Columns of a piece of edge before those of the teeth ahead of it.
PIECE = 9


class Memory(NamedTuple):
    """What the next step begins with; a march changes it in place."""

    #: Complex, shape (m,).
    state: np.ndarray
    #: In r directions, feed and normal first, shape (r,).
    force: np.ndarray
    #: Ring of tips at the steps before, shape (n, r).
    past: np.ndarray


@numba.njit(cache=True)
def force_at(step, here, velocity, past, pieces, plan, speed, normal, out):
    """Force on the tool at a step, in r directions: feed and normal, with z, with the slopes.

    Parameters
    ----------
    here, velocity : arrays (r,)
        The tip.
    past : array (n, r)
        Ring of tips at the steps before this one, which has the number `step`.
    pieces : array (s, 9 + 3 teeth)
        Of each piece of a tooth's edge: angle ahead of tooth 1's tip, within a turn, angles between which it cuts, width, sine and cosine
        of its normal's angle, radius, height, radius by which it rubs, then for each tooth ahead: steps ago, feed since then, by how much
        less it stands out.
    speed : float
        Of the spindle, now.
    normal : array (r,)
        Room for the outward normal of a piece.
    out : array (r,)
    """
    size, count, directions = past.shape[0], (pieces.shape[1] - PIECE) // 3, here.size
    # half a step ahead, so that an edge whose step reaches over the angle 0 stands below it
    theta = (plan.step * step + 0.5 * plan.step) % (2.0 * math.pi)
    for a in range(directions):
        out[a] = 0.0
    for i in range(pieces.shape[0]):
        piece = pieces[i]
        phi = theta + piece[0]
        phi -= 0.5 * plan.step if phi < 2.0 * math.pi else 0.5 * plan.step + 2.0 * math.pi
        # the share of the step about this place in which the edge is inside: without it the entry would jump by a step
        low, high = max(phi - 0.5 * plan.step, piece[1]), min(phi + 0.5 * plan.step, piece[2])
        inside = (high - low) / plan.step
        if inside <= 0.0:
            continue
        phi = 0.5 * (low + high)
        s, c, sine, cosine, r, z = math.sin(phi), math.cos(phi), piece[4], piece[5], piece[6], piece[7]
        normal[0], normal[1] = sine * s, sine * c
        if directions > 2:
            normal[2] = -cosine
        if directions > 3:
            lever = z * sine + r * cosine
            normal[3], normal[4] = lever * s, lever * c
        out_now = 0.0
        for a in range(directions):
            out_now += normal[a] * here[a]
        chip, nearest = 1e300, 1e300
        for k in range(count):
            ago, feed, less = piece[PIECE + 3 * k], piece[PIECE + 1 + 3 * k], piece[PIECE + 2 + 3 * k]
            still, moved = sine * (feed * s + less), 0.0
            if plan.regenerate:
                whole = int(ago)
                part = ago - whole
                first = (step - whole) % size
                second = first - 1 if first > 0 else size - 1
                moved = out_now
                for a in range(directions):
                    moved -= normal[a] * ((1.0 - part) * past[first, a] + part * past[second, a])
            # without loss of contact the surface that decides is that of a tool which does not vibrate
            distance = still + moved if plan.leaves else still
            if distance < nearest:
                nearest, chip = distance, still + moved
        if nearest <= 0.0:
            continue
        tangential = plan.k_tangential * chip + plan.edge_tangential
        radial = plan.k_radial * chip + plan.edge_radial
        axial = plan.k_axial * chip + plan.edge_axial
        into = 0.0
        for a in range(directions):
            into += normal[a] * velocity[a]
        if not plan.leaves or into > 0.0:
            rub = plan.rub / (speed * piece[8])
            radial += rub * into
            tangential += plan.friction * rub * into
        weight, inward = inside * piece[3], radial * sine + axial * cosine
        feedwards, sidewards, upward = -tangential * c - inward * s, tangential * s - inward * c, radial * cosine - axial * sine
        out[0] += weight * feedwards
        out[1] += weight * sidewards
        if directions > 2:
            out[2] += weight * upward
        if directions > 3:
            out[3] += weight * (z * feedwards - r * upward * s)
            out[4] += weight * (z * sidewards - r * upward * c)


@numba.njit(cache=True)
def simulate(modes, pieces, plan, memory, start, samples):
    """March `samples.shape[0]` steps on, from step number `start`.

    Parameters
    ----------
    modes, plan, memory : ModeArrays, TimePlan, Memory
        In feed and normal direction.
    pieces
        As in `force_at`.
    samples : array (count, 3 r)
        Written: tip, its velocity and the force, in r directions each, at each step.
    """
    pole, outputs, inputs, constant = modes
    state, force, past = memory
    m, size, r = pole.size, past.shape[0], past.shape[1]
    decay = np.empty(m, dtype=np.complex128)
    before, now = np.empty((m, r), dtype=np.complex128), np.empty((m, r), dtype=np.complex128)
    free, here, velocity, new, normal = np.empty(m, dtype=np.complex128), np.empty(r), np.empty(r), np.empty(r), np.empty(r)
    jump = np.zeros((r, r))
    for k in range(m):
        for a in range(r):
            for b in range(r):
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
                for b in range(r):
                    before[k, b] = h * (first - second) * inputs[k, b]
                    now[k, b] = h * second * inputs[k, b]
            prepared = True
        for k in range(m):
            free[k] = decay[k] * state[k]
            for b in range(r):
                free[k] += before[k, b] * force[b]
        for a in range(r):
            new[a] = force[a]
        for _ in range(3):
            for a in range(r):
                here[a], velocity[a] = 0.0, 0.0
                for b in range(r):
                    here[a] += constant[a, b] * new[b]
                    velocity[a] += jump[a, b] * new[b]
            for k in range(m):
                p = free[k]
                for b in range(r):
                    p += now[k, b] * new[b]
                for a in range(r):
                    y = 2.0 * outputs[a, k] * p
                    here[a] += y.real
                    velocity[a] += (pole[k] * y).real
            force_at(step, here, velocity, past, pieces, plan, speed, normal, new)
        for k in range(m):
            state[k] = free[k]
            for b in range(r):
                state[k] += now[k, b] * new[b]
        for a in range(r):
            force[a] = new[a]
            here[a], velocity[a] = 0.0, 0.0
            for b in range(r):
                here[a] += constant[a, b] * new[b]
                velocity[a] += jump[a, b] * new[b]
            for k in range(m):
                y = 2.0 * outputs[a, k] * state[k]
                here[a] += y.real
                velocity[a] += (pole[k] * y).real
        for a in range(r):
            past[step % size, a] = here[a]
            samples[n, a], samples[n, r + a], samples[n, 2 * r + a] = here[a], velocity[a], new[a]


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
