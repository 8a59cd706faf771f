"""Physics beside labels without physics: how much each counts."""

from __future__ import annotations

import numpy as np
from scipy.special import expit

from rcsa_ident.base.arrays import FloatArray
from rcsa_ident.stability.labels.coverage import COVERED, PARTLY

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


def weight_of_labels(near: FloatArray, trust: float) -> FloatArray:
    """Return the weight of labels without physics, shape (n,): 1 - trust near a label, its square where labels end.

    There physics goes on, unless cuts that it had not seen refuted it.

    `trust`: weight of physics near labels
    """
    inside = np.clip((near - PARTLY) / (COVERED - PARTLY), 0.0, 1.0)
    found: FloatArray = (1.0 - trust) * (1.0 - trust * (1.0 - inside))
    return found
