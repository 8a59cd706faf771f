"""How much physics counts: beside labels without physics, and where there are no labels."""

from __future__ import annotations

import numpy as np
from scipy.special import expit

#: Odds of physics before the first cut, and cuts that count for one: those of a session are alike.
_BEFORE, _ALIKE = 4.0, 2.0


def trust_in(evidence: float) -> float:
    """Return the weight of physics near labels, an average of models by their evidence [hoeting1999].

    `evidence`: log evidence of physics less that of the labels without it: how each tells one cut after the other, none of which it has
        seen

    Examples
    --------
    >>> [round(trust_in(each), 3) for each in (8.0, 0.0, -8.0, -40.0)]
    [0.995, 0.8, 0.068, 0.0]
    """
    return float(expit(np.log(_BEFORE) + evidence / _ALIKE))


def belief_in(log_score: float, labels: int) -> float:
    """Return the weight of what was believed before labels beside an even chance, where no label tells anything.

    `log_score`: mean logarithm of the probability that it gave each verdict
    `labels`: how many

    Examples
    --------
    >>> [round(belief_in(each, 20), 3) for each in (-0.4, -0.7, -2.0)]
    [0.949, 0.483, 0.0]
    """
    return float(expit(labels * (log_score + np.log(2.0)) / _ALIKE))
