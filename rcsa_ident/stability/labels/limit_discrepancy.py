"""What no parameter of the model explains of the stability limit: an error of its logarithm, smooth in speed and width."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.linalg

from rcsa_ident.base.arrays import FloatArray
from rcsa_ident.base.errors import InputError, positive

#: Variance that keeps points which nearly coincide apart, as a share.
_NUGGET = 1e-8


@dataclass(frozen=True, slots=True)
class LimitDiscrepancy:
    """A Gaussian process of mean 0 over the logarithms of speed and width, added to the logarithm of the limit [kennedy2001].

    cov(d, d') = s^2 exp(-log(Omega / Omega')^2 / (2 l^2) - log(a_e / a_e')^2 / (2 w^2)) r: ratios of speeds, because lobes repeat by
    them; r is `across` where one cut is milled up and the other one down, and 1 elsewhere.

    `deviation` [-]: s, standard deviation; 0.2 stands for limits that are 20 % off
    `length` [-]: l, ratio of speeds over which errors are alike, as a logarithm
    `width` [-]: w, the same of radial widths
    `across` [-]: correlation of the errors of up and down milling

    Points are rows of speed [rad/s], radial immersion [-] and 1 for up milling, 0 for down milling.

    Examples
    --------
    >>> down, faster, up = np.array([[500.0, 0.5, 0.0]]), np.array([[1000.0, 0.5, 0.0]]), np.array([[500.0, 0.5, 1.0]])
    >>> LimitDiscrepancy(0.2, 0.1).covariance(down, np.concatenate([down, faster, up])).round(3).tolist()
    [[0.04, 0.0, 0.012]]
    """

    deviation: float = 0.35
    length: float = 0.3
    width: float = 1.0
    across: float = 0.3

    def __post_init__(self) -> None:
        for name in ("deviation", "length", "width"):
            positive(name, getattr(self, name))
        if not 0.0 <= self.across <= 1.0:
            raise InputError("across", self.across, "a correlation from 0 to 1")

    def covariance(self, one: FloatArray, other: FloatArray) -> FloatArray:
        """Return the covariances between two sets of points, shapes (n, 3), (m, 3) -> (n, m)."""
        apart = np.log(one[:, None, :2] / other[:, :2]) / np.array([self.length, self.width])
        alike = np.where(one[:, None, 2] == other[:, 2], 1.0, self.across)
        found: FloatArray = self.deviation**2 * alike * np.exp(-0.5 * np.sum(apart**2, axis=2))
        return found

    def root(self, points: FloatArray) -> FloatArray:
        """Return R with R R^T the covariance at points that differ, shape (n, n): R times standard normals is a draw."""
        return self._root(self.covariance(points, points))

    def given(self, points: FloatArray, values: FloatArray, at: FloatArray, rng: np.random.Generator) -> FloatArray:
        """Return a draw at other points for each row of errors that are known, shape (d, n) -> (d, m).

        `points`, shape (n, 3); `values` [-], shape (d, n)
        `at`, shape (m, 3): where one of them is a known point, what is known there comes back
        """
        if len(points) == 0:
            return rng.standard_normal((len(values), len(at))) @ self.root(at).T
        across, root = self.covariance(at, points), self.root(points)
        share = scipy.linalg.cho_solve((root, True), across.T).T
        left = self.covariance(at, at) - share @ across.T
        noise: FloatArray = rng.standard_normal((len(values), len(at))) @ self._root(left).T
        return values @ share.T + noise

    def _root(self, covariance: FloatArray) -> FloatArray:
        """Cholesky factor; what rounding leaves below zero is lifted."""
        small = _NUGGET * self.deviation**2
        found: FloatArray = np.linalg.cholesky(covariance + small * np.eye(len(covariance)))
        return found
