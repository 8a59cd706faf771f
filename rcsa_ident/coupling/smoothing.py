"""Three complex entries over frequency that may not bend faster than a damped mode does: a Gaussian prior as a band matrix."""

from __future__ import annotations

import numpy as np
import scipy.linalg

from rcsa_ident.base.arrays import ComplexArray, FloatArray

#: Weights of the second differences, and one over their standard deviations.
Bend = tuple[FloatArray, FloatArray]


def bending(omega: FloatArray, size: FloatArray, least_damping: float) -> Bend:
    """Return weights of the second differences at inner frequencies, shape (n - 2, 3), and one over their standard deviation, (n - 2, 3).

    The peak of a mode with damping zeta bends by 2 |h| (step / (zeta omega))^2 from one frequency to the next.

    `omega` [rad/s], shape (n,): ascending
    `size`, shape (n, 3): usual size |h| of the three entries
    `least_damping` [-]: damping ratio below which no mode is expected
    """
    before, after = np.diff(omega)[:-1], np.diff(omega)[1:]
    weights = np.stack([2.0 * after, -2.0 * (before + after), 2.0 * before], axis=1) / (before + after)[:, None]
    relative = 2.0 * before * after / (least_damping * omega[1:-1]) ** 2
    return weights, 1.0 / (np.maximum(relative, 1e-4)[:, None] * size[1:-1])


def second_differences(bend: Bend, x: ComplexArray) -> ComplexArray:
    """Return the second differences in their standard deviations, shape (n - 2, 3)."""
    weights, inverse = bend
    return (weights[:, :1] * x[:-2] + weights[:, 1:2] * x[1:-1] + weights[:, 2:] * x[2:]) * inverse


def _prior_bands(bend: Bend, n: int) -> FloatArray:
    """The prior's precision by diagonals: [k, i, e] couples entry e of frequencies i and i + k, shape (3, n, 3)."""
    weights, inverse = bend
    bands = np.zeros((3, n, 3))
    for p in range(3):
        for q in range(p, 3):
            bands[q - p, p : n - 2 + p] += (weights[:, p] * weights[:, q])[:, None] * inverse**2
    return bands


def _banded(precision: ComplexArray, bend: Bend, size: FloatArray) -> ComplexArray:
    """Lower form of the whole precision, all unknowns divided by `size`; shape (7, 3 n)."""
    n = precision.shape[0]
    scaled = precision * size[:, :, None] * size[:, None, :]
    prior = _prior_bands(bend, n)
    band = np.zeros((7, n, 3), dtype=complex)
    for e in range(3):
        for f in range(e + 1):
            band[e - f, :, f] = scaled[:, e, f]
    for k in range(3):
        band[3 * k, : n - k] += prior[k, : n - k] * size[: n - k] * size[k:]
    return band.reshape(7, 3 * n)


def band_solve(precision: ComplexArray, right: ComplexArray, bend: Bend, size: FloatArray, at: ComplexArray | None = None) -> ComplexArray:
    """Return the solution x of (precision + prior) x = right - prior at, shape (n, 3).

    `precision`, shape (n, 3, 3): what the measurements say at each frequency, Hermitian
    `right`, shape (n, 3)
    `bend`: the prior, from `bending`
    `size`, shape (n, 3): scale of the unknowns: the equations are solved in units of it
    `at`, shape (n, 3): point of linearisation from which the prior already pulls; by default 0
    """
    n = right.shape[0]
    target = right * size
    if at is not None:
        weights, inverse = bend
        drawn = second_differences(bend, at) * inverse
        for p in range(3):
            target[p : n - 2 + p] -= weights[:, p : p + 1] * drawn * size[p : n - 2 + p]
    band = _banded(precision, bend, size)
    band[0] *= 1.0 + 1e-12
    return scipy.linalg.solveh_banded(band, target.reshape(-1), lower=True).reshape(n, 3) * size


def band_covariance(precision: ComplexArray, bend: Bend, size: FloatArray, window: int = 60, margin: int = 60) -> ComplexArray:
    """Return the diagonal blocks of the inverse of precision + prior, shape (n, 3, 3).

    Window by window: what lies farther away than the margin no longer matters.

    `precision`, shape (n, 3, 3)
    `bend`: the prior, from `bending`
    `size`, shape (n, 3): scale of the unknowns
    `window`, `margin`: frequencies whose blocks come from one inverse, and how many more stand on each side of them
    """
    n = precision.shape[0]
    band = _banded(precision, bend, size)
    band[0] *= 1.0 + 1e-12
    found = np.empty((n, 3, 3), dtype=complex)
    for start in range(0, n, window):
        low, high = max(start - margin, 0), min(start + window + margin, n)
        part = band[:, 3 * low : 3 * high].copy()
        width = 3 * (high - low)
        for k in range(1, 7):
            part[k, max(width - k, 0) :] = 0.0
        inverse = scipy.linalg.solveh_banded(part, np.eye(width, dtype=complex), lower=True).reshape(high - low, 3, high - low, 3)
        for i in range(start, min(start + window, n)):
            found[i] = inverse[i - low, :, i - low, :]
    return found * size[:, :, None] * size[:, None, :]
