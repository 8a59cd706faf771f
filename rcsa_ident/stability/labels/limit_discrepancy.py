"""What no parameter of the model explains of the stability limit: an error of its logarithm that is smooth in speed."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.linalg

from rcsa_ident.base.arrays import FloatArray
from rcsa_ident.base.errors import positive

#: Variance that keeps speeds which nearly coincide apart, as a share.
_NUGGET = 1e-8


@dataclass(frozen=True, slots=True)
class LimitDiscrepancy:
    """A Gaussian process of mean 0 over the logarithm of speed, added to the logarithm of the limit [kennedy2001].

    cov(d(Omega), d(Omega')) = s^2 exp(-log(Omega / Omega')^2 / (2 l^2)): ratios of speeds, because lobes repeat by them.

    `deviation` [-]: s, standard deviation; 0.2 stands for limits that are 20 % off
    `length` [-]: l, ratio of speeds over which errors are alike, as a logarithm

    Examples
    --------
    >>> LimitDiscrepancy(0.2, 0.1).covariance(np.array([500.0]), np.array([500.0, 1000.0])).round(3).tolist()
    [[0.04, 0.0]]
    """

    deviation: float = 0.35
    length: float = 0.3

    def __post_init__(self) -> None:
        positive("deviation", self.deviation)
        positive("length", self.length)

    def covariance(self, one: FloatArray, other: FloatArray) -> FloatArray:
        """Return the covariances between two sets of speeds, shape (n, m)."""
        apart = np.log(one[:, None] / other) / self.length
        found: FloatArray = self.deviation**2 * np.exp(-0.5 * apart**2)
        return found

    def root(self, speeds: FloatArray) -> FloatArray:
        """Return R with R R^T the covariance at speeds that differ, shape (n, n): R times standard normals is a draw."""
        return self._root(self.covariance(speeds, speeds))

    def given(self, speeds: FloatArray, values: FloatArray, at: FloatArray, rng: np.random.Generator) -> FloatArray:
        """Return a draw at other speeds for each row of errors that are known, shape (d, n) -> (d, m).

        `speeds` [rad/s], shape (n,); `values` [-], shape (d, n)
        `at` [rad/s], shape (m,): where one of them is a known speed, what is known there comes back
        """
        if speeds.size == 0:
            return rng.standard_normal((len(values), at.size)) @ self.root(at).T
        across, root = self.covariance(at, speeds), self.root(speeds)
        share = scipy.linalg.cho_solve((root, True), across.T).T
        left = self.covariance(at, at) - share @ across.T
        noise: FloatArray = rng.standard_normal((len(values), at.size)) @ self._root(left).T
        return values @ share.T + noise

    def _root(self, covariance: FloatArray) -> FloatArray:
        """Cholesky factor; what rounding leaves below zero is lifted."""
        small = _NUGGET * self.deviation**2
        found: FloatArray = np.linalg.cholesky(covariance + small * np.eye(len(covariance)))
        return found
