"""How a cut's label follows from where the stability limit is: the probability of what was seen."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.special import ndtr

from rcsa_ident.base.arrays import FloatArray
from rcsa_ident.base.errors import InputError, positive
from rcsa_ident.stability.labels.tested_cuts import ORDINAL, TestedCuts, Verdict


@dataclass(frozen=True, slots=True)
class LabelNoise:
    """Labels of cuts beside a stability limit a(Omega), which is itself no sharp line.

    P(called stable | limit) = e + (1 - 2 e) Phi(log(a / depth) / w): the normal distribution of a limit that differs from cut to cut,
    and a share e of labels that are wrong however far the cut is from the limit. A cut far inside tells next to nothing, one that was
    called the opposite of what it must be costs log(1 / e) and no more.

    `width` [-]: w, standard deviation of the logarithm of the limit from one cut to another: stock, wear, the eye of whoever judged
    `wrong` [-]: e, above 0 and below one half: nothing outweighs the logarithm of 0
    `marginal` [-]: a cut is called marginal where the logarithm of its depth is that near to the limit's
    `frequency` [-]: standard deviation of the logarithm of a measured chatter frequency, the model's own error included
    """

    width: float = 0.3
    wrong: float = 0.02
    marginal: float = 0.1
    frequency: float = 0.02

    def __post_init__(self) -> None:
        for name in ("width", "marginal", "frequency"):
            positive(name, getattr(self, name))
        if not 0.0 < self.wrong < 0.5:
            raise InputError("wrong", self.wrong, "a share above 0 and below 0.5")

    def stable(self, margin: FloatArray) -> FloatArray:
        """Return the probability that a cut is called stable, of log(limit / depth), of any shape.

        >>> LabelNoise(width=0.1, wrong=0.02).stable(np.array([-1.0, 0.0, 1.0])).round(3).tolist()
        [0.02, 0.5, 0.98]
        """
        found: FloatArray = self.wrong + (1.0 - 2.0 * self.wrong) * ndtr(margin / self.width)
        return found

    def log_likelihood(self, cuts: TestedCuts, margin: FloatArray) -> FloatArray:
        """Return the log probability of all verdicts together, shape (...).

        `cuts`: TestedCuts, n of them
        `margin` [-], shape (..., n): log(limit / depth) of each cut, or what stands for it where islands are
        """
        found = np.zeros(margin.shape[:-1])
        for verdict, count in zip(ORDINAL, cuts.counts.T, strict=True):
            where = count > 0.0
            if where.any():
                found += np.log(self._probability(verdict, margin[..., where])) @ count[where]
        return found

    def _probability(self, verdict: Verdict, margin: FloatArray) -> FloatArray:
        if verdict is Verdict.MARGINAL:
            return self._marginal(margin)
        return self.stable(margin if verdict is Verdict.STABLE else -margin)

    def heard(self, cuts: TestedCuts, chatter: FloatArray) -> FloatArray:
        """Return the log density of the measured chatter frequencies over that of any other line of a spectrum, shape (...).

        `cuts`: TestedCuts, n of them
        `chatter` [rad/s], shape (..., n): frequency of each cut's chatter at the limit; NaN where none is expected
        """
        known = np.isfinite(cuts.chatter_frequency)
        measured, expected = cuts.chatter_frequency[known], chatter[..., known]
        off = np.log(np.where(np.isnan(expected), measured, expected) / measured) / self.frequency
        near = np.where(np.isnan(expected), 0.0, np.exp(-0.5 * off**2))
        found: FloatArray = np.sum(np.log(self.wrong + (1.0 - self.wrong) * near), axis=-1)
        return found

    def _marginal(self, margin: FloatArray) -> FloatArray:
        within = ndtr((self.marginal + margin) / self.width) - ndtr((margin - self.marginal) / self.width)
        found: FloatArray = self.wrong + (1.0 - self.wrong) * within
        return found
