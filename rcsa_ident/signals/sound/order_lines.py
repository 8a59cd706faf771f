"""Lines at the multiples of a spindle's followed angle, window by window: what they explain, and which of them keep their phase."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.linalg import solve_toeplitz

from rcsa_ident.base.arrays import ComplexArray, FloatArray
from rcsa_ident.signals._kernels import angle_signal, angle_sums, turned

#: Rate below which a recorder of motion is taken to have no filter against folding [Hz], and the highest order that is looked for then.
UNFILTERED, FOLDED_ORDERS = 10e3, 30
#: Share of a window's samples below which a combination of orders is not told from the others: two that fold onto one line.
_TOLD_APART = 1e-6
#: Standard deviations by which the mean product of neighbours stands above nothing where a line keeps its phase.
_SURE = 3.0


@dataclass(frozen=True, slots=True, eq=False)
class OrderLines:
    """Lines at the multiples of the spindle's angle, fitted in windows that follow each other.

    `power`, shape (m + 1,): mean square of the line of each order, all channels together; 0 where windows do not share its phase
    `explained`: share of the variance about the windows' means that the fits explain, both per degree of freedom
    `energy`: mean square about the means, all channels together
    `amplitude`, shape (w, m + 1, c): Re sum_m amplitude[w, m] e^{i m angle} is what is fitted in each window
    `length`: samples of a window
    """

    power: FloatArray
    explained: float
    energy: float
    amplitude: ComplexArray
    length: int

    def rest(self, samples: FloatArray, angle: FloatArray) -> FloatArray:
        """Return what the fits leave of the samples that they were fitted to, shape (w length, c).

        `samples`, shape (n, c); `angle` [rad], shape (n,)
        """
        return _centred(samples, self.length) - angle_signal(self.amplitude, turned(angle), self.length)


def order_lines(samples: FloatArray, angle: FloatArray, length: int, highest: int) -> OrderLines:
    """Return the lines at multiples of an angle, by least squares in each window.

    Orders above half the sampling rate are fitted where they stand folded back: the angle at the samples is all that is asked.

    `samples`, shape (n, c); `angle` [rad], shape (n,)
    `length`: samples of a window; at most n
    `highest`: highest order
    """
    n = samples.shape[0]
    starts = np.arange(0, n - length + 1, length)
    windows, flat, turn = starts.size, np.ones(length), turned(angle)
    centred = _centred(samples, length)
    # unknowns of a window are complex exponentials of the orders -m to m, whose products are exponentials of twice as many orders: the
    # same one for all pairs that are as far apart
    products = _both_sides(angle_sums(np.ones((n, 1)), turn, starts, flat, 2 * highest))[:, :, 0]
    sums = _both_sides(angle_sums(centred, turn, starts, flat, highest))
    if highest * (angle[-1] - angle[0]) < np.pi * n:
        solution = np.array([solve_toeplitz(own[2 * highest :], right) for own, right in zip(products, sums, strict=True)])
        used = sums.shape[0] * sums.shape[1]
    else:
        order = np.arange(2 * highest + 1)
        value, vector = np.linalg.eigh(products[:, order[:, None] - order[None, :] + 2 * highest])
        inverse = np.where(value > _TOLD_APART * length, 1.0 / np.maximum(value, 1e-300), 0.0)[:, :, None]
        solution, used = vector @ (inverse * (np.conj(np.swapaxes(vector, 1, 2)) @ sums)), int(np.sum(inverse > 0.0))
    energy, explained = float(np.sum(centred**2)), float(np.real(np.sum(np.conj(solution) * sums)))
    free = max(windows * length - used, 1)
    left = max(energy - explained, 0.0) / free
    share = 1.0 - left / (energy / (windows * (length - 1)) + 1e-300)
    amplitude = solution[:, highest:]
    weights = np.where(np.arange(highest + 1) == 0, 1.0, 2.0)[None, :, None]
    return OrderLines(_steady_power(amplitude), share, energy / (windows * length), weights * amplitude, length)


def _centred(samples: FloatArray, length: int) -> FloatArray:
    """Samples about the mean of each window; those behind the last window are left out."""
    windows = samples.shape[0] // length
    parts = samples[: windows * length].reshape(windows, length, -1)
    return np.ascontiguousarray(np.reshape(parts - parts.mean(axis=1, keepdims=True), (windows * length, -1)))


def _both_sides(sums: ComplexArray) -> ComplexArray:
    """Sums of the orders -m to m from those of 0 to m, shape (w, m + 1, c)."""
    return np.concatenate([np.conj(sums[:, :0:-1]), sums], axis=1)


def _steady_power(amplitude: ComplexArray) -> FloatArray:
    """Mean square of the lines that windows share: the product of neighbours has no share of noise, which does not know what it was."""
    pairs = np.sum(np.real(amplitude[1:] * np.conj(amplitude[:-1])) if amplitude.shape[0] > 1 else np.abs(amplitude) ** 2, axis=2)
    mean = pairs.mean(axis=0)
    power = 2.0 * np.where(mean > _SURE * pairs.std(axis=0) / np.sqrt(pairs.shape[0]), mean, 0.0)
    power[0] = 0.0
    return power
