"""Which whole multiple or part of a found frequency is the spindle's: probabilities from the lines that each would have.

A candidate of frequency f with N teeth says where lines are: at k N f of the teeth, nearly all of them, and at the other multiples of f
of the run-out, strongest at low orders. In the spectrum over the spindle's angle a cell of noise has a power of Gamma distribution
with as many averages as there are windows; a line's power is anything above it (log-uniform). Each cell gives a Bayes factor, and the
product over the cells of a candidate, with how much of the lines' power its teeth hold, its likelihood beside noise alone.
"""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.special import gammainc, gammaln, logsumexp

from rcsa_ident.base.arrays import FloatArray
from rcsa_ident.signals.steady_part import hann

#: Largest part of the spindle's frequency that may have been found, and most teeth that are thought of where no number is told.
_PARTS, _TEETH = 6, 8
#: Revolutions of the slowest candidate in a window, and the window's usual length [s].
_TURNS, _SECONDS = 8.0, 2.0
#: Bins to each side that a line takes, and the outermost of those that its noise is the median of.
_OWN, _BESIDE = 1, 12
#: Probability that the first tooth-passing line is seen, and by what share it falls from one to the next.
_TOOTH, _FALLS = 0.9, 0.8
#: Shares of the lines between the teeth's that the run-out makes visible, and how likely each is before anything is heard.
_VISIBLE, _PRIOR = np.array([0.01, 0.1, 0.3, 0.6, 0.9]), np.array([0.1, 0.225, 0.225, 0.225, 0.225])
#: Change of the logarithm of power from one tooth-passing line to the next that a structure's modes make, and lines that are compared.
_ROUGH, _COMPARED = np.log(10.0), 8
#: Decades of power that a line may have above the noise, and the most that one counts (logarithm): what many say outweighs a strong one.
_DECADES, _MOST = 6.0, 3.0
#: Power of the prior of the share of the lines' power that the teeth hold: density proportional to share^_CUT.
_CUT = 3.0
#: Logarithm of the odds that what was found is the spindle's, before the number of teeth speaks.
_FOUND = 8.0
#: Highest frequency over the sampling rate, and highest order of the found frequency.
_BAND, _ORDERS = 0.4, 48


def multiples(teeth: int | None) -> list[Fraction]:
    """Return the factors by which a found frequency may differ from the spindle's.

    What is found may be tooth passages, or every second of them, if the number of teeth is divided by it; or a part of the spindle's
    frequency. Where no number is told nothing speaks against what was found.
    """
    if teeth is None:
        return [Fraction(1)]
    parts = [Fraction(1, count) for count in range(teeth, 1, -1) if teeth % count == 0]
    return [*parts, *(Fraction(times) for times in range(1, _PARTS + 1))]


def log_odds(samples: FloatArray, rate: float, angle: FloatArray, factors: Sequence[Fraction], teeth: int | None) -> FloatArray:
    """Return the logarithm of each candidate's likelihood beside that of noise alone, shape (f,).

    `samples`, shape (n, c); `rate` [Hz]
    `angle` [rad], shape (n,): of what turns at the found frequency
    `factors`: frequency of each candidate over the found one
    `teeth`: as told
    """
    power, floor, step, windows = _order_spectrum(samples, rate, angle, float(min(factors)))
    nyquist = np.pi * (angle.size - 1) / (angle[-1] - angle[0])
    bins = min(power.shape[0] - _OWN - 1, int(min(2.0 * _BAND * nyquist, _ORDERS) / step))
    found = np.full(len(factors), -np.inf)
    for i, factor in enumerate(factors):
        order = np.arange(1, max(int(bins * step / float(factor)), 1) + 1)
        at = np.minimum(np.round(order * float(factor) / step).astype(int), bins)
        worth, line = _cells(power, floor, at, windows)
        counts = np.arange(1, _TEETH + 1) if teeth is None else np.array([teeth])
        found[i] = logsumexp([_of_teeth(order, worth, line, int(each)) for each in counts]) - np.log(counts.size)
        found[i] += _FOUND * (factor == 1)
    return found


def _of_teeth(order: np.ndarray, worth: FloatArray, line: FloatArray, teeth: int) -> float:
    """Logarithm of the likelihood of lines at the orders 1, 2, ... of a cutter with so many teeth, each cell beside noise alone."""
    tooth = order % teeth == 0
    if not tooth.any():
        return -np.inf
    own = worth[tooth]
    seen = _TOOTH * _FALLS ** np.arange(own.size)
    teeth_say = np.sum(np.log(1.0 - seen + seen * np.exp(own)))
    between = np.log(1.0 - _VISIBLE[:, None] + _VISIBLE[:, None] * np.exp(worth[~tooth])).sum(axis=1)
    runout_says = logsumexp(between + np.log(_PRIOR))
    held = (line[tooth].sum() + 1e-300) / (line.sum() + 1e-300)
    there = line[tooth][:_COMPARED]
    rough = np.sum(np.abs(np.diff(np.log(there[there > 0.0])))) / _ROUGH
    return float(teeth_say + runout_says + _CUT * np.log(held) + np.log(1.0 + _CUT) - rough)


def _order_spectrum(samples: FloatArray, rate: float, angle: FloatArray, slowest: float) -> tuple[FloatArray, FloatArray, float, float]:
    """Mean power and noise in the bins of the spectrum over the angle, shape (b, c), the orders between bins, and the averages."""
    n = angle.size
    even = CubicSpline(angle, samples)(np.linspace(angle[0], angle[-1], n))
    turns = (angle[-1] - angle[0]) / (2.0 * np.pi)
    wanted = max(_SECONDS * turns * rate / n, _TURNS / slowest)
    length = min(round(wanted * n / turns), n)
    window, starts = hann(length)[:, None], np.arange(0, n - length + 1, max(length // 2, 1))
    spectra = (np.fft.rfft(even[s : s + length] * window, axis=0) for s in starts)
    power = np.mean([each.real**2 + each.imag**2 for each in spectra], axis=0)
    reach = np.r_[-_BESIDE : -2 * _OWN, 2 * _OWN + 1 : _BESIDE + 1]
    floor = np.median(power[np.clip(np.arange(power.shape[0])[:, None] + reach, 2, power.shape[0] - 1)], axis=1)
    # Hann windows that overlap by half share a thirty-sixth of their power
    windows = starts.size**2 / (starts.size + 2.0 * (starts.size - 1) / 36.0)
    return power, floor, n / length / turns, windows


def _cells(power: FloatArray, floor: FloatArray, at: np.ndarray, windows: float) -> tuple[FloatArray, FloatArray]:
    """Logarithm of each cell's Bayes factor, a line beside noise, in the channel where it is largest, and the line's power there."""
    near = at[:, None] + np.arange(-_OWN, _OWN + 1)
    top = power[near].max(axis=1)
    # the median of a Gamma distribution lies a little below its mean
    noise = floor[at] / (1.0 - 1.0 / (9.0 * windows)) ** 3
    ratio = top / (noise + 1e-300)
    tried = 2.0 * power.shape[1]
    density = windows * np.log(windows) - gammaln(windows) + (windows - 1.0) * np.log(ratio + 1e-300) - windows * ratio
    density = density + np.log(tried) + (tried - 1.0) * np.log(np.maximum(gammainc(windows, windows * ratio), 1e-300))
    line = -np.log(np.maximum(ratio, 1.0) * _DECADES * np.log(10.0))
    worth = np.where(ratio > 1.0, line - density, -_MOST)
    best = np.argmax(ratio, axis=1)
    each = np.arange(at.size)
    return np.clip(worth[each, best], -_MOST, _MOST), np.sum(np.maximum(top - 3.0 * noise, 0.0), axis=1)
