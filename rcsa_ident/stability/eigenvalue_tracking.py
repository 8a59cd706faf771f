"""Eigenvalues followed along a frequency, to where they become real."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rcsa_ident.base.arrays import ComplexArray, FloatArray

#: An eigenvalue that comes so close to the real axis, as a share of its way between two frequencies, may have touched it.
NEAR = 0.15


@dataclass(frozen=True, slots=True, eq=False)
class Crossing:
    """An interval of w in which an eigenvalue becomes real; both ends alike for a flip."""

    low: float
    high: float
    first: complex
    last: complex

    @property
    def share(self) -> float:
        """Where in the interval the straight line between both ends is real."""
        return 0.0 if self.low == self.high else self.first.imag / (self.first.imag - self.last.imag)

    @property
    def value(self) -> float:
        """What it is there, the inverse of a depth [1/m]."""
        return self.first.real + self.share * (self.last.real - self.first.real)


@dataclass(frozen=True, slots=True, eq=False)
class Branches:
    """Eigenvalues, shape (n, 2 h), and their vectors, shape (n, 2 h, 2 h), at some frequencies."""

    omega: FloatArray
    value: ComplexArray
    vector: ComplexArray

    def take(self, places: np.ndarray) -> Branches:
        return Branches(self.omega[places], self.value[places], self.vector[places])

    def joined(self, other: Branches) -> Branches:
        both = ((getattr(self, name), getattr(other, name)) for name in ("omega", "value", "vector"))
        return Branches(*(np.concatenate(pair) for pair in both))


def crossings_between(low: Branches, high: Branches, least: float) -> tuple[list[tuple[int, Crossing]], np.ndarray]:
    """Crossings of the real axis beyond `least` between the ends of intervals, each with its interval's number, and the
    intervals that have to be halved: where branches can't be told apart, or may touch the axis in between.
    """
    # branches that matter at none of the frequencies go
    most = max(int(np.sum(np.abs(end.value) > 0.5 * least, axis=1).max(initial=1)) for end in (low, high))
    (one, first), (two, second) = (_largest(end, most) for end in (low, high))
    # a branch keeps its shape where another, of a nearby value, has one of its own: sine of the angle between the vectors
    cosine = np.abs(first.conj().swapaxes(1, 2) @ second)
    distance = np.sqrt(np.maximum(1.0 - cosine**2, 0.0))
    nearest = np.argmin(distance, axis=2)
    best = np.take_along_axis(distance, nearest[:, :, None], axis=2)
    partner = np.take_along_axis(two, nearest, axis=1)
    close = distance < 2.0 * best
    mutual = np.take_along_axis(np.argmin(distance, axis=1), nearest, axis=1) == np.arange(most)
    clear = mutual & (close.sum(axis=2) <= 1)
    counts = np.maximum(one.real, partner.real) > least
    turned = one.imag * partner.imag < 0.0
    other = np.any(close & (two.imag[:, None, :] * one.imag[:, :, None] < 0.0), axis=2)
    touching = (one.imag * partner.imag > 0.0) & (np.minimum(np.abs(one.imag), np.abs(partner.imag)) < NEAR * np.abs(partner - one))
    crossings = [
        (int(k), Crossing(float(low.omega[k]), float(high.omega[k]), complex(one[k, i]), complex(partner[k, i])))
        for k, i in zip(*np.nonzero(turned & counts), strict=True)
    ]
    return crossings, np.any(counts & (((turned | other) & ~clear) | touching), axis=1)


def _largest(end: Branches, count: int) -> tuple[ComplexArray, ComplexArray]:
    """The `count` largest eigenvalues at each frequency, with their vectors."""
    order = np.argsort(-np.abs(end.value), axis=1)[:, :count]
    return np.take_along_axis(end.value, order, axis=1), np.take_along_axis(end.vector, order[:, None, :], axis=2)
