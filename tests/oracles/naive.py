"""Slow twins of what the package does fast: plain loops, no cleverness, no code shared with it."""

from __future__ import annotations

import cmath
import math
from collections.abc import Callable
from itertools import pairwise

import numpy as np
import scipy.linalg
import scipy.sparse.linalg


def pole_sum(omega, pole, residue):
    """sum_k residue[k] / (i omega - pole[k]) by loops, shapes (n,), (m,), (m, q) -> (n, q)."""
    values = [[0j] * residue.shape[1] for _ in omega]
    for i, w in enumerate(omega):
        for k, p in enumerate(pole):
            for j in range(residue.shape[1]):
                values[i][j] += complex(residue[k, j]) / (1j * w - complex(p))
    return np.array(values)


def directional_matrix(phi: float, radial_ratio: float) -> np.ndarray:
    """[alpha] of one tooth at immersion phi ([inprocess], eq. 3)."""
    s, c = math.sin(phi), math.cos(phi)
    return np.array([[-s * (c + radial_ratio * s), -c * (c + radial_ratio * s)], [s * (s - radial_ratio * c), c * (s - radial_ratio * c)]])


def mean_directional_matrix(
    teeth: int, entry: float, exit_: float, radial_ratio: float, feed_angle: float, samples: int = 20000
) -> np.ndarray:
    """Midpoint mean of the directional matrix over a revolution, in machine axes."""
    step = (exit_ - entry) / samples
    total = sum(directional_matrix(entry + (i + 0.5) * step, radial_ratio) for i in range(samples)) * step
    c, s = math.cos(feed_angle), math.sin(feed_angle)
    turn = np.array([[c, -s], [s, c]])
    return teeth / (2.0 * math.pi) * turn @ total @ turn.T


def zero_order_limit(
    receptance: Callable[[float], np.ndarray],
    alpha: np.ndarray,
    tangential: float,
    pitch: np.ndarray,
    speed: float,
    frequencies: np.ndarray,
) -> tuple[float, float]:
    """Return limit depth and chatter frequency of one speed by a search over frequency, `receptance(w)` a 2 x 2 matrix.

    All w are sought at which a K_tc W(w) mu(w) = 1 has a real positive a, W the mean of 1 - e^{-i w tau} over the teeth:
    sign changes of the imaginary part, then bisection.
    """

    def values(w: float) -> list[complex]:
        factor = sum(1.0 - cmath.exp(-1j * w * p / speed) for p in pitch) / len(pitch)
        return [factor * mu for mu in np.linalg.eigvals(alpha @ receptance(w))]

    best, place = math.inf, math.nan
    previous = values(frequencies[0])
    for low, high in pairwise(frequencies):
        here = values(high)
        if abs(here[0] - previous[0]) + abs(here[1] - previous[1]) > abs(here[1] - previous[0]) + abs(here[0] - previous[1]):
            here.reverse()
        for old, new in zip(previous, here, strict=True):
            if old.imag * new.imag > 0.0 or max(old.real, new.real) <= 0.0:
                continue
            a, b, fa, fb = low, high, old, new
            for _ in range(60):
                middle = 0.5 * (a + b)
                f = min(values(middle), key=lambda v: abs(v - 0.5 * (fa + fb)))
                if f.imag * fa.imag > 0.0:
                    a, fa = middle, f
                else:
                    b, fb = middle, f
            if f.real > 0.0 and 1.0 / (tangential * f.real) < best:
                best, place = 1.0 / (tangential * f.real), middle
        previous = here
    return best, place


def directional_integral(phi: np.ndarray, tangential: float, radial: float) -> np.ndarray:
    """Force on the tool (feed, normal) per chip of teeth at the immersions phi, K_t and K_r each times one: shape (n, 2, 2)."""
    s, c = np.sin(phi), np.cos(phi)
    forward, normal = -(tangential * c + radial * s), tangential * s - radial * c
    return np.stack([np.stack([forward * s, forward * c], axis=-1), np.stack([normal * s, normal * c], axis=-1)], axis=-2)


def milling_multiplier(
    modes: tuple[tuple[int, float, float, float], ...],
    windows: list[tuple[float, float, float, float]],
    stiffness: tuple[float, float],
    edges: np.ndarray,
    clock: Callable[[np.ndarray], np.ndarray],
    turn: float = 0.0,
    lag: float = 0.0,
    slices: int = 1,
    rub: tuple[float, float] = (0.0, 0.0),
    points: int = 8,
) -> complex:
    """The largest Floquet multiplier of a milling cut by dense first-order semi-discretisation with matrix exponentials.

    `modes`: axis (0 or 1), natural frequency [Hz], damping ratio, mass [kg]
    `windows`: (angle ahead of tooth 1, start, end, delay angle) of each tooth
    `stiffness`, `rub`: tangential and radial, depth times K and depth times the viscous force per velocity
    `edges`: angles of the steps from 0 to a period
    `clock`: time of an angle
    `lag`: angle between the two ends of the edge
    """
    n, m = edges.size - 1, len(modes)
    time, period = clock(edges), edges[-1]
    free, out, into = np.zeros((2 * m, 2 * m)), np.zeros((2, 2 * m)), np.zeros((2 * m, 2))
    for k, (axis, frequency, zeta, mass) in enumerate(modes):
        wn = 2.0 * np.pi * frequency
        free[k, m + k], free[m + k, k], free[m + k, m + k] = 1.0, -(wn**2), -2.0 * zeta * wn
        out[axis, k], into[m + k, axis] = 1.0, 1.0 / mass
    rate = np.hstack([np.zeros((2, m)), out[:, :m]])
    rotation = np.array([[math.cos(turn), -math.sin(turn)], [math.sin(turn), math.cos(turn)]])
    total = 2 * m + 2 * n
    unit = np.eye(total)
    state = unit[: 2 * m]
    past = [unit[2 * m + 2 * i : 2 * m + 2 * i + 2] for i in range(n)] + [out @ state]
    seconds = np.concatenate([time[:-1] - time[-1], time])
    delays = sorted({w[3] for w in windows})
    node, share = np.polynomial.legendre.leggauss(points)
    node, share = 0.5 * (node + 1.0), 0.5 * share

    def before(angle: float) -> np.ndarray:
        """Where the tip was, on straight lines over time; `angle` from minus a period on."""
        when = float(clock(np.array([angle]))[0]) if angle >= 0.0 else float(clock(np.array([angle + period]))[0] - time[-1])
        j = min(max(int(np.searchsorted(seconds, when + 1e-12 * time[-1], side="right")) - 1, 0), len(past) - 2)
        part = (when - seconds[j]) / (seconds[j + 1] - seconds[j])
        return past[j] if abs(part) < 1e-9 else (1.0 - part) * past[j] + part * past[j + 1]

    for i in range(n):
        h = time[i + 1] - time[i]
        place = edges[i] + node * (edges[i + 1] - edges[i])
        cut = {d: np.zeros((2, 2)) for d in delays}
        damping = np.zeros((2, 2))
        for offset, start, end, d in windows:
            for z in (np.arange(slices) + 0.5) / slices:
                phi = np.mod(place + offset - lag * z, 2.0 * np.pi)
                inside = (share * ((phi >= start) & (phi < end)) / slices)[:, None, None]
                cut[d] += np.sum(inside * directional_integral(phi, *stiffness), axis=0)
                damping += np.sum(inside * directional_integral(phi, *rub), axis=0)
        cut = {d: rotation @ value @ rotation.T for d, value in cut.items()}
        matrix = free + into @ (sum(cut.values()) @ out + rotation @ damping @ rotation.T @ rate)
        size = 2 * m
        step = scipy.linalg.expm(
            np.block(
                [
                    [matrix * h, into * h, np.zeros((size, 2))],
                    [np.zeros((2, size + 2)), np.eye(2)],
                    [np.zeros((2, size + 4))],
                ]
            )
        )
        begin, end_ = np.zeros((2, total)), np.zeros((2, total))
        for d in delays:
            if np.any(cut[d]):
                begin -= cut[d] @ before(edges[i] - d)
                end_ -= cut[d] @ before(edges[i + 1] - d)
        after = step[:size, :size] @ state + step[:size, size : size + 2] @ begin + step[:size, size + 2 :] @ (end_ - begin)
        state = after
        past.append(out @ state)
    monodromy = np.concatenate([state, *past[n : 2 * n]])
    values = scipy.sparse.linalg.eigs(monodromy, 6, v0=np.cos(np.arange(float(total))), tol=1e-10, return_eigenvectors=False)
    return complex(values[np.argmax(np.abs(values))])


def runs_of_equal(x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Start and length of each run of equal values."""
    start = np.concatenate([[0], np.flatnonzero(np.diff(x) != 0.0) + 1])
    return start, np.diff(np.concatenate([start, [x.size]]))


def frozen_run(x: np.ndarray, least: int = 12) -> tuple[int, int] | None:
    """Start and length of the longest run that a live channel does not produce, from all runs at once."""
    start, length = runs_of_equal(x)
    jump = np.abs(np.diff(x[start]))
    if length[-1] >= 4 * least and length[-1] >= 4 * length[:-1].max(initial=0):
        return int(start[-1]), int(length[-1])
    ends = np.flatnonzero(length[:-1] >= max(least, 4.0 * np.quantile(length, 0.97)))
    ends = ends[jump[ends] > 1.5 * jump.min()]
    longest = ends[np.argmax(length[ends])] if ends.size else None
    return None if longest is None else (int(start[longest]), int(length[longest]))


def clipped_samples(x: np.ndarray) -> int:
    """Samples in runs of three at an extreme value that is five times as frequent as the level next to it, from all levels at once."""
    start, length = runs_of_equal(x)
    runs = [length[(x[start] == limit) & (length >= 3)] for limit in (x.min(), x.max())]
    level, count = np.unique(x, return_counts=True)
    if max(run.size for run in runs) < 2 or level.size < 12:
        return 0
    piled = count[0] > 5.0 * count[1], count[-1] > 5.0 * count[-2]
    return sum(int(run.sum()) for run, full in zip(runs, piled, strict=True) if full and run.size >= 2)


def smallest_chip(moved, step, phi):
    """Return the smallest of moved sin(phi) + step, and whose it is, at each angle: chip and surface of one tooth at one height."""
    distances = np.asarray(moved)[:, None] * np.sin(phi) + np.asarray(step)[:, None]
    return distances.min(axis=0), distances.argmin(axis=0)
