"""Filters in modal coordinates, one complex number a mode; arrays and scalars only.

A mode's state is (re, im); `decay` rotates and shrinks it, `observed` says what of it is measured: re * observed[0] +
im * observed[1]. Modes stand in the order plant, force, noise. The force is the sum of the force modes' real parts; it
enters the real part of every plant mode, and the measurement directly times `through`.
"""

from __future__ import annotations

import numba
import numpy as np


@numba.njit(cache=True, fastmath=True)
def modal_filter(decay, gain, through, signal, state):
    """Return a filter's output, shape (n,): through u + sum of 2 Re(gain x), x[k+1] = decay x[k] + u[k]; `state` is (2, m)."""
    m = decay.shape[1]
    result = np.empty(signal.size)
    for k in range(signal.size):
        u = signal[k]
        y = 0.0
        for i in range(m):
            re, im = state[0, i], state[1, i]
            y += gain[0, i] * re - gain[1, i] * im
            state[0, i] = decay[0, i] * re - decay[1, i] * im + u
            state[1, i] = decay[0, i] * im + decay[1, i] * re
        result[k] = through * u + 2.0 * y
    return result


@numba.njit(cache=True, fastmath=True)
def kalman_steps(decay, observed, plants, forces, through, gain, first, measured, state, result):
    """Filter samples: predict, compare, correct. About 10 multiplications a mode and step.

    gain: shape (s, 2, m), the last one is kept from then on; first: steps done before; measured: shape (n,); state: shape
    (2, m), goes on; result: shape (n, 3), is filled: force, its first mode alone, innovation.
    """
    m = decay.shape[1]
    last = gain.shape[0] - 1
    force = 0.0
    for i in range(plants, plants + forces):
        force += state[0, i]
    for k in range(measured.size):
        now = gain[min(first + k, last)]
        y = 0.0
        for i in range(plants):
            re, im = state[0, i], state[1, i]
            new = decay[0, i] * re - decay[1, i] * im + force
            im = decay[0, i] * im + decay[1, i] * re
            y += observed[0, i] * new + observed[1, i] * im
            state[0, i] = new
            state[1, i] = im
        force = 0.0
        for i in range(plants, plants + forces):
            re, im = state[0, i], state[1, i]
            new = decay[0, i] * re - decay[1, i] * im
            state[1, i] = decay[0, i] * im + decay[1, i] * re
            state[0, i] = new
            force += new
        for i in range(plants + forces, m):
            re, im = state[0, i], state[1, i]
            new = decay[0, i] * re - decay[1, i] * im
            im = decay[0, i] * im + decay[1, i] * re
            y += observed[0, i] * new + observed[1, i] * im
            state[0, i] = new
            state[1, i] = im
        innovation = measured[k] - y - through * force
        force = 0.0
        for i in range(m):
            state[0, i] += now[0, i] * innovation
            state[1, i] += now[1, i] * innovation
        for i in range(plants, plants + forces):
            force += state[0, i]
        result[k, 0] = force
        result[k, 1] = state[0, plants]
        result[k, 2] = innovation


@numba.njit(cache=True, fastmath=True)
def smoothed_force(decay, observed, plants, forces, through, gain, variance, row, innovation, force):
    """Return the force given all samples, shape (n,), by the backward recursion of Bryson and Frazier [bryson1963].

    variance: of the innovation, shape (s,); row: covariance of the force with the state after each correction, shape (s, 2, m);
    of these and of `gain` the last stays; innovation, force: of the forward filter from the first sample on, shape (n,).
    """
    m = decay.shape[1]
    last = gain.shape[0] - 1
    result = np.empty(force.size)
    adjoint = np.zeros((2, m))
    for k in range(force.size - 1, -1, -1):
        j = min(k, last)
        correction, shared = 0.0, 0.0
        for i in range(m):
            correction += row[j, 0, i] * adjoint[0, i] + row[j, 1, i] * adjoint[1, i]
            shared += gain[j, 0, i] * adjoint[0, i] + gain[j, 1, i] * adjoint[1, i]
        result[k] = force[k] - correction
        # through the correction of this sample, then through the prediction from the one before
        back = innovation[k] / variance[j] + shared
        entering = 0.0
        for i in range(plants):
            re, im = adjoint[0, i] - observed[0, i] * back, adjoint[1, i] - observed[1, i] * back
            entering += re
            adjoint[0, i] = decay[0, i] * re + decay[1, i] * im
            adjoint[1, i] = decay[0, i] * im - decay[1, i] * re
        for i in range(plants, plants + forces):
            re, im = adjoint[0, i] - through * back, adjoint[1, i]
            adjoint[0, i] = decay[0, i] * re + decay[1, i] * im + entering
            adjoint[1, i] = decay[0, i] * im - decay[1, i] * re
        for i in range(plants + forces, m):
            re, im = adjoint[0, i] - observed[0, i] * back, adjoint[1, i] - observed[1, i] * back
            adjoint[0, i] = decay[0, i] * re + decay[1, i] * im
            adjoint[1, i] = decay[0, i] * im - decay[1, i] * re
    return result


@numba.njit(cache=True, fastmath=True)
def coupled_steps(decay, inputs, observed, ends, through, gain, first, measured, state, result):
    """As `kalman_steps`, of several forces that feel each other and as many measurements; the plant's modes are shared.

    inputs: shape (c, 2, plants), what each force adds to the plant's modes; observed: shape (c, 2, m); ends: shape (c + 1,), where
    the plant's modes end and then each force's; through: shape (c, c) [measurement, force]; gain: shape (s, c, 2, m); measured:
    shape (n, c); result: shape (n, 3, c).
    """
    m, count, plants = decay.shape[1], ends.size - 1, ends[0]
    last = gain.shape[0] - 1
    force, innovation = np.zeros(count), np.empty(count)
    for c in range(count):
        for i in range(ends[c], ends[c + 1]):
            force[c] += state[0, i]
    for k in range(measured.shape[0]):
        now = gain[min(first + k, last)]
        for i in range(m):
            re, im = state[0, i], state[1, i]
            state[0, i] = decay[0, i] * re - decay[1, i] * im
            state[1, i] = decay[0, i] * im + decay[1, i] * re
        for c in range(count):
            for i in range(plants):
                state[0, i] += inputs[c, 0, i] * force[c]
                state[1, i] += inputs[c, 1, i] * force[c]
        for c in range(count):
            force[c] = 0.0
            for i in range(ends[c], ends[c + 1]):
                force[c] += state[0, i]
        for c in range(count):
            y = 0.0
            for i in range(plants):
                y += observed[c, 0, i] * state[0, i] + observed[c, 1, i] * state[1, i]
            for i in range(ends[count], m):
                y += observed[c, 0, i] * state[0, i] + observed[c, 1, i] * state[1, i]
            for j in range(count):
                y += through[c, j] * force[j]
            innovation[c] = measured[k, c] - y
            result[k, 2, c] = innovation[c]
        for c in range(count):
            for i in range(m):
                state[0, i] += now[c, 0, i] * innovation[c]
                state[1, i] += now[c, 1, i] * innovation[c]
        for c in range(count):
            force[c] = 0.0
            for i in range(ends[c], ends[c + 1]):
                force[c] += state[0, i]
            result[k, 0, c] = force[c]
            result[k, 1, c] = state[0, ends[c]]


@numba.njit(cache=True, fastmath=True)
def coupled_smoothed(decay, inputs, observed, ends, through, gain, row, weighed, force):
    """As `smoothed_force`, of the forces that `coupled_steps` gives, shape (n, c).

    row: covariance of each force with the state after each correction, shape (s, c, 2, m); weighed: the innovations times the
    inverse of their covariance, shape (n, c); force: of the forward filter, shape (n, c).
    """
    m, count, plants = decay.shape[1], ends.size - 1, ends[0]
    last = gain.shape[0] - 1
    result = np.empty(force.shape)
    adjoint, back, entering = np.zeros((2, m)), np.empty(count), np.empty(count)
    for k in range(force.shape[0] - 1, -1, -1):
        j = min(k, last)
        for c in range(count):
            correction, shared = 0.0, 0.0
            for i in range(m):
                correction += row[j, c, 0, i] * adjoint[0, i] + row[j, c, 1, i] * adjoint[1, i]
                shared += gain[j, c, 0, i] * adjoint[0, i] + gain[j, c, 1, i] * adjoint[1, i]
            result[k, c] = force[k, c] - correction
            back[c] = weighed[k, c] + shared
        # through the correction of this sample
        for c in range(count):
            for i in range(m):
                adjoint[0, i] -= observed[c, 0, i] * back[c]
                adjoint[1, i] -= observed[c, 1, i] * back[c]
            for f in range(count):
                for i in range(ends[f], ends[f + 1]):
                    adjoint[0, i] -= through[c, f] * back[c]
        # and through the prediction from the one before
        for c in range(count):
            entering[c] = 0.0
            for i in range(plants):
                entering[c] += inputs[c, 0, i] * adjoint[0, i] + inputs[c, 1, i] * adjoint[1, i]
        for i in range(m):
            re, im = adjoint[0, i], adjoint[1, i]
            adjoint[0, i] = decay[0, i] * re + decay[1, i] * im
            adjoint[1, i] = decay[0, i] * im - decay[1, i] * re
        for c in range(count):
            for i in range(ends[c], ends[c + 1]):
                adjoint[0, i] += entering[c]
    return result
