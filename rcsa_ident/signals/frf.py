"""Cross FRF estimators: tip force to flange displacement."""

from __future__ import annotations

import numpy as np
from scipy.signal import get_window

from rcsa_ident.dynamics.arrays import ComplexArray, FloatArray


def segment_lines(samples: FloatArray, rate: float, omega: FloatArray, segments: int = 8) -> ComplexArray:
    """Return amplitudes at given frequencies in half-overlapping Hann segments, phases from the record's start.

    Parameters
    ----------
    samples : array, shape (n, c)
    rate : float [Hz]
    omega : array, shape (m,) [rad/s]

    Returns
    -------
    complex array, shape (segments, m, c)
    """
    n = samples.shape[0]
    length = 2 * n // (segments + 1)
    window = get_window("hann", length)
    window = 2.0 * window / window.sum()
    starts = [s * (n - length) // max(segments - 1, 1) for s in range(segments)]
    parts = []
    for start in starts:
        t = (start + np.arange(length)) / rate
        part = samples[start : start + length]
        parts.append(np.exp(-1j * np.outer(omega, t)) @ ((part - part.mean(axis=0)) * window[:, None]))
    return np.array(parts)


def h1(displacement: ComplexArray, force: ComplexArray) -> ComplexArray:
    """Return E[D F*] / E[F F*]: least error where the displacement is noisy; averages over the first axis."""
    return _mean(displacement, force) / _mean(force, force)


def h2(displacement: ComplexArray, force: ComplexArray) -> ComplexArray:
    """Return E[D D*] / E[F D*]: least error where the force is noisy."""
    return _mean(displacement, displacement) / _mean(force, displacement)


def hv(displacement: ComplexArray, force: ComplexArray) -> ComplexArray:
    """Return the geometric mean of H1 and H2, with H1's phase."""
    one = h1(displacement, force)
    return one / np.abs(one) * np.sqrt(np.abs(one) * np.abs(h2(displacement, force)))


def air_corrected(displacement: ComplexArray, force: ComplexArray, air: ComplexArray) -> ComplexArray:
    """Return (S_dd - S_aa) / (S_fd - S_fa), the paper's eqs. 8 and 16, with S_fd = E[F D*].

    Spectra are subtracted, not lines: what the air cut shares with the cut is only taken out in the mean, which is
    exact where both are uncorrelated.
    """
    return (_mean(displacement, displacement) - _mean(air, air)) / (_mean(force, displacement) - _mean(force, air))


def coherence(displacement: ComplexArray, force: ComplexArray) -> FloatArray:
    """Return |E[D F*]|^2 / (E[D D*] E[F F*]), 0 to 1."""
    cross = np.abs(_mean(displacement, force)) ** 2
    return (cross / (_mean(displacement, displacement) * _mean(force, force))).real


def _mean(a: ComplexArray, b: ComplexArray) -> ComplexArray:
    return np.mean(a * np.conj(b), axis=0)
