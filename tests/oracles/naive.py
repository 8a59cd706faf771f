"""Slow twins of what the package does fast: plain loops, no cleverness, no code shared with it."""

from __future__ import annotations

import cmath
import math
from collections.abc import Callable
from itertools import pairwise

import numpy as np


def pole_sum(omega, pole, residue):
    """sum_k residue[k] / (i omega - pole[k]) by loops, shapes (n,), (m,), (m, q) -> (n, q)."""
    values = [[0j] * residue.shape[1] for _ in omega]
    for i, w in enumerate(omega):
        for k, p in enumerate(pole):
            for j in range(residue.shape[1]):
                values[i][j] += complex(residue[k, j]) / (1j * w - complex(p))
    return np.array(values)


def directional_matrix(phi: float, radial_ratio: float) -> np.ndarray:
    """[alpha] of one tooth at immersion phi, the paper's eq. 3."""
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
