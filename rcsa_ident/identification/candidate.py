"""A point that a search has come to, without the equations that led there."""

from __future__ import annotations

from dataclasses import dataclass

from rcsa_ident.base.arrays import FloatArray
from rcsa_ident.identification.unknowns import Unknowns


@dataclass(frozen=True, slots=True, eq=False)
class Candidate:
    """What a search goes on from, what is said of it while it runs, and what a service keeps of it.

    `theta`, shape (p,): unknowns, see `parameters`
    `nuisance`, shape (k, 2): delay [s] and angle to the air cut [rad] of each cut, at their optimum for these unknowns
    `cost` [-]: chi2 with priors
    `information`, shape (p, p): Gauss-Newton matrix of half the cost; its inverse is the covariance of the unknowns
    """

    theta: FloatArray
    layout: Unknowns
    nuisance: FloatArray
    cost: float
    information: FloatArray

    @property
    def point(self) -> tuple[FloatArray, Unknowns, FloatArray]:
        """Unknowns, their layout and the cuts' delays and angles: where `refine` starts."""
        return self.theta, self.layout, self.nuisance
