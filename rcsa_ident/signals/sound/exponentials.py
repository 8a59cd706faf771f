"""Sums of decaying exponentials by the rotation of a signal's subspace, ESPRIT [roy1989], at one window and one order."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import scipy.linalg
import scipy.signal

from rcsa_ident.base.arrays import ComplexArray, FloatArray

#: Most rows and columns of the matrix whose subspace is taken.
_ROWS, _COLUMNS = 200, 600
#: Singular values below this share of the largest are noise, whatever the order.
_RANK = 1e-4
#: Share of the window's energy below which an exponential is left out.
_ENERGY = 3e-5


class Exponentials(NamedTuple):
    """Exponentials of one window. `pole` [1/s], shape (m,): above the real axis. `amplitude`, shape (m,): at the window's first sample."""

    pole: ComplexArray
    amplitude: FloatArray


class Subspace:
    """The signal subspace of a window; orders are cut out of it.

    `signal`, shape (n,): real, or complex where it is a band that was moved to zero
    """

    def __init__(self, signal: FloatArray | ComplexArray, most: int) -> None:
        self.signal = signal
        rows = min(signal.size // 2, _ROWS)
        columns = min(signal.size - rows + 1, _COLUMNS)
        matrix = scipy.linalg.hankel(signal[:rows], signal[rows - 1 : rows - 1 + columns])
        square = matrix @ matrix.conj().T
        most = min(most, rows - 2)
        size, vectors = scipy.linalg.eigh(square, subset_by_index=(rows - most, rows - 1), check_finite=False)
        known = size[::-1] > _RANK**2 * max(size[-1], 0.0)
        self.vectors = vectors[:, ::-1][:, : int(np.sum(known))]

    def exponentials(self, order: int, rate: float) -> Exponentials:
        """Return the exponentials of an order. `order`: dimension of the subspace: two for each real exponential. `rate` [Hz]."""
        space = self.vectors[:, :order]
        if space.shape[1] < 1:
            return Exponentials(np.zeros(0, dtype=complex), np.zeros(0))
        # columns are orthonormal: without its last row the space's normal matrix is the identity less one dyad
        last = space[-1]
        shifted = space[:-1].conj().T @ space[1:]
        shifted = shifted + np.outer(last.conj(), last @ shifted) / max(1.0 - float(np.vdot(last, last).real), 1e-12)
        turn = np.linalg.eigvals(shifted)
        turn = turn[(np.abs(turn) > 0.2) & (np.abs(turn) < 1.02)]
        if not turn.size:
            return Exponentials(np.zeros(0, dtype=complex), np.zeros(0))
        waves = _powers(turn, self.signal.size)
        size = np.linalg.norm(waves, axis=0)
        normal = (waves / size).conj().T @ (waves / size)
        normal[np.diag_indices_from(normal)] += 1e-10
        weight = np.linalg.solve(normal, (waves / size).conj().T @ self.signal) / size
        energy = size**2 * np.abs(weight) ** 2
        strong = energy > _ENERGY * np.sum(np.abs(self.signal) ** 2)
        if np.isrealobj(self.signal):
            strong &= turn.imag > 0.0
            weight = 2.0 * weight
        return Exponentials(np.log(turn[strong]) * rate, np.abs(weight[strong]))


def _powers(base: ComplexArray, count: int) -> ComplexArray:
    """Powers from 0 on, shape (count, m): doubled again and again, which is many times cheaper than a logarithm and an exponential each."""
    found, step = np.ones((1, base.size), dtype=complex), base
    while len(found) < count:
        found, step = np.concatenate([found, found * step]), step * step
    return found[:count]


def zoomed(samples: FloatArray, rate: float, centre: float, band: float) -> tuple[ComplexArray, float]:
    """Return a band of a signal, moved to zero, and its own rate [Hz].

    `samples`, shape (n,); `rate` [Hz]
    `centre`, `band` [Hz]: middle and width
    """
    step = max(int(rate / (1.5 * band)), 1)
    taps = scipy.signal.firwin(6 * step + 1, 0.5 * band, fs=rate)
    moved = samples * np.exp(-2j * np.pi * centre / rate * np.arange(samples.size))
    return np.asarray(scipy.signal.oaconvolve(moved, taps, mode="valid")[::step]), rate / step


def peaks(samples: FloatArray, rate: float, lowest: float, highest: float, apart: float, most: int) -> list[float]:
    """Return the frequencies of a long ring's strongest spectral peaks [Hz].

    `samples`, shape (n,)
    `rate`, `lowest`, `highest`, `apart` [Hz]: no two are closer than `apart`
    """
    size = np.abs(np.fft.rfft(samples * np.hanning(2 * samples.size)[samples.size :]))
    frequency = np.fft.rfftfreq(samples.size, 1.0 / rate)
    size[(frequency < lowest) | (frequency > highest)] = 0.0
    found: list[float] = []
    strongest = size.max()
    for place in np.argsort(size)[::-1]:
        if size[place] < 0.02 * strongest or len(found) == most:
            break
        if all(abs(frequency[place] - f) > apart for f in found):
            found.append(float(frequency[place]))
    return found
