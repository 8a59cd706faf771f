"""How well probabilities told labels, and the numbers that `benchmarks labelled_cuts` and its page share."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from rcsa_ident.base.arrays import FloatArray
from rcsa_ident.base.units import from_rpm
from rcsa_ident.stability.labels.tested_cuts import TestedCuts, Verdict

#: Draws of the prior, without softening; random orders.
POOL, ORDERS = 6000, 10
#: Standard deviation of the stiffness that 1000 rev/min take away or add.
SOFTENING = 0.01 / from_rpm(1000.0)


@dataclass(frozen=True, slots=True)
class Score:
    """How well probabilities told labels.

    `log_score`: mean logarithm of the probability of what was seen
    `expected`: accuracy that the probabilities themselves expect
    """

    right: float
    cuts: int
    log_score: float
    expected: float

    @classmethod
    def of(cls, probability: FloatArray, cuts: TestedCuts) -> Score:
        """Score probabilities that cuts are stable."""
        stable = cuts.seen(Verdict.STABLE)
        seen = np.where(stable, probability, 1.0 - probability)
        return cls(
            int(np.sum((probability > 0.5) == stable)),
            stable.size,
            float(np.mean(np.log(seen))),
            float(np.mean(np.maximum(probability, 1.0 - probability))),
        )

    @classmethod
    def mean(cls, scores: Sequence[Score]) -> Score:
        """Mean of several, over as many cuts each."""
        right, log_score, expected = np.mean([(s.right, s.log_score, s.expected) for s in scores], axis=0).tolist()
        return cls(right, scores[0].cuts, log_score, expected)

    def __str__(self) -> str:
        share, expected = 100.0 * self.right / self.cuts, 100.0 * self.expected
        return f"{self.right:.4g} of {self.cuts} ({share:.1f} %), log score {self.log_score:.3f}, expected {expected:.1f} %"
