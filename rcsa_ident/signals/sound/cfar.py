"""Lines that stand out of the noise around them, with a stated probability of false alarm.

The mean over K windows of the power in a bin of Gaussian noise follows a Gamma distribution of shape K, whatever the noise's level; a
sum over neighbouring bins one of a larger shape. A cell is a line where it exceeds `scale` times the k-th smallest of n cells around
it (ordered statistics: a few other lines among these change little). The probability that noise does so,

    P = E[Q(K, a G^-1(u))],  u ~ Beta(k, n - k + 1),

with the distribution G of a cell and its complement Q, does not know the level of the noise: the rate of false alarms is constant.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from scipy.optimize import brentq
from scipy.special import betaincinv, gammaincc, gammaincinv

from rcsa_ident.base.arrays import FloatArray

#: Cells to both sides that tell the noise, and which of them, as a share.
REFERENCE, RANK = 32, 0.5
#: Correlation of the powers of neighbouring bins of a Hann window, of those next to them, and of windows that overlap by half.
_NEXT, _SECOND, _OVERLAP = 4.0 / 9.0, 1.0 / 36.0, 1.0 / 36.0
#: Nodes and weights of the integral over the ordered cell's quantiles.
_NODES = np.polynomial.legendre.leggauss(100)
#: Power of the nodes, which brings them close to the least quantiles: alarms at small probabilities come from these.
_CLOSE = 5.0
#: Bins whose median tells the colour of the noise.
_BAND = 40


def averages(windows: int) -> float:
    """Return how many independent windows so many Hann windows, overlapping by half, are worth."""
    return windows**2 / (windows + 2.0 * (windows - 1) * _OVERLAP)


def summed(width: int) -> float:
    """Return how many independent bins so many neighbours of a Hann window's spectrum are worth."""
    return width**2 / (width + 2.0 * (width - 1) * _NEXT + 2.0 * max(width - 2, 0) * _SECOND)


def false_alarm(scale: float, shape: float, cells: int = REFERENCE) -> float:
    """Return the probability that a cell of noise exceeds `scale` times the middle one of so many around it.

    `shape`: of the Gamma distribution of a cell: windows times bins that are averaged

    Examples
    --------
    >>> k, n = 16, 32  # of single windows there is a product
    >>> bool(np.isclose(false_alarm(5.0, 1.0), np.prod([(n - i) / (n - i + 5.0) for i in range(k)])))
    True
    """
    rank = max(round(RANK * cells), 1)
    node, weight = _NODES
    # the distribution of the ordered cell, over its own quantiles
    place = 0.5 * (node + 1.0)
    order = betaincinv(rank, cells - rank + 1, place**_CLOSE)
    return float(np.sum(0.5 * _CLOSE * place ** (_CLOSE - 1.0) * weight * gammaincc(shape, scale * gammaincinv(shape, order))))


@lru_cache(maxsize=256)
def scale_of(probability: float, shape: float, cells: int = REFERENCE) -> float:
    """Return the scale at which noise raises a false alarm with a probability."""
    most = 2.0
    while false_alarm(most, shape, cells) > probability and most < 1e12:
        most *= 2.0
    return float(np.exp(brentq(lambda log: np.log(false_alarm(np.exp(log), shape, cells) / probability), -3.0, np.log(most))))


def stands_out(power: FloatArray, windows: float, probability: float, width: int = 1) -> tuple[np.ndarray, FloatArray]:
    """Return which cells of a spectrum are lines, and the noise in them.

    `power`, shape (b, c): mean over windows; of bins without lines of the orders only, as they follow each other
    `windows`: independent windows in the mean
    `probability`: of a false alarm in a cell
    `width`: bins that are summed: lines that wander spread over several
    Returns `line`, array of bool, shape (b, c).
    Returns `noise`, array, shape (b, c): mean power of noise in a bin.
    """
    bins = power.shape[0]
    # cells that share bins, or the wings of a line, tell nothing of the noise beside it
    stride, guard = max(width, 2), 2 * width + 2
    each = min(REFERENCE // 2, (bins - 2 * guard) // (2 * stride))
    if each < 4:
        return np.zeros(power.shape, dtype=bool), power
    colour = _colour(power)
    sums = np.cumsum(np.concatenate([np.zeros((1, power.shape[1])), power / colour]), axis=0)
    ends = np.clip(np.arange(bins)[:, None] + np.array([-(width // 2), width - width // 2]), 0, bins)
    cell = (sums[ends[:, 1]] - sums[ends[:, 0]]) / (ends[:, 1] - ends[:, 0])[:, None]
    reach = guard + stride * (each - 1)
    # at the ends those of one side are farther away
    middle = np.clip(np.arange(bins), reach, bins - 1 - reach)
    offsets = np.concatenate([-guard - stride * np.arange(each), guard + stride * np.arange(each)])
    shape = windows * summed(width)
    rank = max(round(RANK * 2 * each), 1)
    level = np.partition(cell[middle[:, None] + offsets], rank - 1, axis=1)[:, rank - 1]
    noise = colour * level / (gammaincinv(shape, (rank - 0.5) / (2 * each)) / shape)
    return cell > scale_of(probability, round(shape, 6), 2 * each) * level, noise


def _colour(power: FloatArray) -> FloatArray:
    """What the noise looks like from afar: medians of bands, and straight lines between their logarithms."""
    bands = max(power.shape[0] // _BAND, 1)
    middles = (np.arange(bands) + 0.5) * power.shape[0] / bands
    level = np.log([np.median(each, axis=0) + 1e-300 for each in np.array_split(power, bands)])
    return np.exp(np.stack([np.interp(np.arange(power.shape[0]), middles, column) for column in level.T], axis=1))
