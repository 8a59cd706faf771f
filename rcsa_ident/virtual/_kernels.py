"""The time loop of regenerative milling; arrays and scalars only."""

from __future__ import annotations

import math

import numba
import numpy as np


@numba.njit(cache=True)
def passed(step, ahead, angle, places):
    """Write where in the steps each tooth ahead stood at the angle at which tooth j is now into `places`, shape (teeth, passes).

    step: index of the instant, above 0; ahead: angle from tooth j to tooth j + 1 + k, of the same shape; angle: of tooth 1 in all steps.
    Before the first step the spindle turned as between the first two.
    """
    teeth, passes = ahead.shape
    for j in range(teeth):
        for k in range(passes):
            wanted = angle[step] - ahead[j, k]
            if wanted <= angle[0]:
                places[j, k] = (wanted - angle[0]) / (angle[1] - angle[0])
                continue
            # it turns nearly evenly: the place is one step on, or next to it
            i = min(max(int(places[j, k] + 1.0), 0), step - 1)
            while angle[i] > wanted:
                i -= 1
            while angle[i + 1] < wanted:
                i += 1
            places[j, k] = i + (wanted - angle[i]) / (angle[i + 1] - angle[i])


@numba.njit(cache=True)
def cut_force(position, tooth, edges, places, cut, before, path, force):
    """Write the force at one instant into `force`, in feed and normal direction and along the axis towards the spindle.

    position: feed-axis position of the tool at the instant, shape (2,); tooth: angle of each, shape (teeth,); edges: lag, offset, sine and
    cosine of its lean, width, entry, exit and spread along the helix of each tooth's levels, shape (teeth, levels, 8); places: steps at
    which tooth j + 1 + k stood where j is now, shape (teeth, passes) or, where lags are unlike, (teeth, passes x levels); before: feed per
    step before the first; path: earlier positions.
    cut: angle of tooth 1, rotation in a step, then the force per width and chip, and per width: tangential, radial, axial, and their edges,
    the exponent of the chip in the force per chip, and one over the chip at which that force is the one told.
    """
    force[:] = 0.0
    teeth, levels = edges.shape[0], edges.shape[1]
    passes = teeth
    own = places.shape[1] // passes
    turn = 2.0 * math.pi
    for j in range(teeth):
        for k in range(levels):
            entry, leave, smear = edges[j, k, 5], edges[j, k, 6], max(cut[1], edges[j, k, 7])
            phi = cut[0] + tooth[j] - edges[j, k, 0]
            phi -= turn * math.floor(phi / turn)
            # share of the level and of the step that is inside the immersion
            share = min(max((phi - entry) / smear + 0.5, 0.0), 1.0) - min(max((phi - leave) / smear + 0.5, 0.0), 1.0)
            if phi > turn - smear:
                share += min(max((phi - turn - entry) / smear + 0.5, 0.0), 1.0) - min(max((phi - turn - leave) / smear + 0.5, 0.0), 1.0)
            if share <= 0.0:
                continue
            s, c = math.sin(phi), math.cos(phi)
            chip = 1e300
            for m in range(passes):
                other = (j + 1 + m) % teeth
                back = places[j, m * own + (k if own > 1 else 0)]
                if back < 0.0:
                    # before the first instant the tool moved along its path without vibration
                    x, y = path[0, 2] + before * back, 0.0
                else:
                    i = int(back)
                    part = back - i
                    x = path[i, 0] + part * (path[i + 1, 0] - path[i, 0])
                    y = path[i, 1] + part * (path[i + 1, 1] - path[i, 1])
                left = (position[0] - x) * s + (position[1] - y) * c + edges[j, k, 1] - edges[other, k, 1]
                chip = min(chip, left)
            if chip <= 0.0:
                continue
            sine, cosine = edges[j, k, 2], edges[j, k, 3]
            chip *= sine
            if cut[8] != 0.0:
                chip *= (chip * cut[9]) ** cut[8]
            share *= edges[j, k, 4]
            tangential = share * (cut[2] * chip + cut[5])
            radial = share * (cut[3] * chip + cut[6])
            axial = share * (cut[4] * chip + cut[7])
            inward = radial * sine + axial * cosine
            force[0] += -c * tangential - s * inward
            force[1] += s * tangential - c * inward
            force[2] += radial * cosine - axial * sine


@numba.njit(cache=True)
def mill(decay, gain, shape, state, teeth, ahead, cut, turn, course, force):
    """March the spindle through a cut and return its outputs, shape (n, o).

    decay: e^{pole dt}, shape (p, m), in p equal parts of the cut one after the other; gain: of the old and the new force, shape
    (p, 2, m, 2), or (p, 2, m, 3) where the force along z counts, too; shape: outputs of the poles, shape (p, o, m), the first two
    the tip's X and Y, doubled for the conjugate poles; state: of the poles at the start, shape (m,);
    teeth: angles and edges as in `cut_force`; ahead: angles as in `passed`; cut: as in `cut_force`; turn: feed axes in machine axes, shape
    (2, 2); course: angle of tooth 1, way of the feed and share of the width that is cut, shape (n, 3); force: shape (n, 3), is filled: in
    machine axes, and along z. The force between two instants is linear, so the march is exact in it.
    """
    n = force.shape[0]
    tooth, edges = teeth
    parts, m = decay.shape
    outputs = shape.shape[1]
    result = np.zeros((n, outputs))
    # the tool's place along feed and normal, and its way without vibration
    path, angle = np.zeros((n, 3)), np.empty(n)
    for i in range(n):
        path[i, 2], angle[i] = course[i, 1], course[i, 0]
    before = course[1, 1] - course[0, 1]
    places, now = np.empty_like(ahead), np.empty_like(cut)
    for j in range(ahead.shape[0]):
        for k in range(ahead.shape[1]):
            places[j, k] = -ahead[j, k] / (angle[1] - angle[0])
    for k in range(1, cut.size):
        now[k] = cut[k]
    local = np.zeros(3)
    position = np.zeros(2)
    inputs = gain.shape[3]
    axial = inputs == 3
    instant = np.zeros((parts, 2, inputs))
    for p in range(parts):
        for k in range(m):
            for a in range(2):
                for b in range(inputs):
                    instant[p, a, b] += (shape[p, a, k] * gain[p, 1, k, b]).real
    free = np.zeros(2)
    for i in range(n):
        p = i * parts // n
        if i > 0:
            fx, fy = force[i - 1, 0], force[i - 1, 1]
            for k in range(m):
                state[k] = decay[p, k] * state[k] + gain[p, 0, k, 0] * fx + gain[p, 0, k, 1] * fy
            if axial:
                for k in range(m):
                    state[k] += gain[p, 0, k, 2] * force[i - 1, 2]
        free[0] = 0.0
        free[1] = 0.0
        for k in range(m):
            free[0] += shape[p, 0, k].real * state[k].real - shape[p, 0, k].imag * state[k].imag
            free[1] += shape[p, 1, k].real * state[k].real - shape[p, 1, k].imag * state[k].imag
        gx, gy, gz = 0.0, 0.0, 0.0
        if i > 0:
            gx, gy, gz = force[i - 1, 0], force[i - 1, 1], force[i - 1, 2]
        now[0] = angle[i]
        if i > 0:
            passed(i, ahead, angle, places)
        # the new force moves the tip within the step by a compliance that is small against the cut's
        for _ in range(3 if i > 0 else 1):
            x = free[0]
            y = free[1]
            if i > 0:
                x += instant[p, 0, 0] * gx + instant[p, 0, 1] * gy
                y += instant[p, 1, 0] * gx + instant[p, 1, 1] * gy
                if axial:
                    x += instant[p, 0, 2] * gz
                    y += instant[p, 1, 2] * gz
            position[0] = turn[0, 0] * x + turn[1, 0] * y + course[i, 1]
            position[1] = turn[0, 1] * x + turn[1, 1] * y
            cut_force(position, tooth, edges, places, now, before, path, local)
            gx = course[i, 2] * (turn[0, 0] * local[0] + turn[0, 1] * local[1])
            gy = course[i, 2] * (turn[1, 0] * local[0] + turn[1, 1] * local[1])
            gz = course[i, 2] * local[2]
        force[i, 0] = gx
        force[i, 1] = gy
        force[i, 2] = gz
        path[i, 0] = position[0]
        path[i, 1] = position[1]
        if i > 0:
            for k in range(m):
                state[k] += gain[p, 1, k, 0] * gx + gain[p, 1, k, 1] * gy
            if axial:
                for k in range(m):
                    state[k] += gain[p, 1, k, 2] * gz
        for a in range(outputs):
            value = 0.0
            for k in range(m):
                value += shape[p, a, k].real * state[k].real - shape[p, a, k].imag * state[k].imag
            result[i, a] = value
    return result
