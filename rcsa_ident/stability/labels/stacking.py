"""Physics and labels without physics, averaged by how well each told cuts of sessions that it had not seen."""

from __future__ import annotations

import numpy as np
from scipy.special import expit

from rcsa_ident.base.arrays import FloatArray
from rcsa_ident.stability.labels.tested_cuts import ORDINAL, TestedCuts, Verdict

#: Groups that are left out where cuts name no sessions.
_GROUPS = 8
#: Odds of physics before the first cut, and cuts that count for one.
_BEFORE, _ALIKE = 4.0, 2.0


def groups_of(cuts: TestedCuts) -> list[FloatArray]:
    """Return the places of cuts that are left out together: sessions, or neighbouring speeds where fewer than two sessions are told."""
    sessions = np.array([own.session for own in cuts.own])
    names = np.unique(sessions)
    if names.size > 1:
        return [np.flatnonzero(sessions == name) for name in names]
    speeds, place = np.unique(cuts.spindle_speed, return_inverse=True)
    part = np.arange(speeds.size) * min(_GROUPS, speeds.size) // max(speeds.size, 1)
    return [np.flatnonzero(part[place] == k) for k in np.unique(part)]


def stable_share(cuts: TestedCuts) -> FloatArray:
    """Return how far verdicts call each cut stable, shape (n,): 1, 0, one half where it is marginal, and between where they differ."""
    weight = {Verdict.STABLE: 1.0, Verdict.MARGINAL: 0.5, Verdict.CHATTER: 0.0}
    found: FloatArray = cuts.shares @ np.array([weight[each] for each in ORDINAL])
    return found


def log_score(probability: FloatArray, share: FloatArray) -> float:
    """Return the mean logarithm of the probability of what was seen."""
    return float(np.mean(share * np.log(probability) + (1.0 - share) * np.log1p(-probability)))


def trust_in(evidence: float, left_out: float) -> float:
    """Return the weight of physics beside labels without physics: pseudo model averaging [yao2018].

    `evidence`: log evidence of physics less that of the labels without it: how each tells one cut after the other
    `left_out`: the same of groups of cuts that neither had seen, summed over all cuts: how each tells what is new

    The mean of both counts, and cuts of a session are alike, so that two count for one.

    Examples
    --------
    >>> [round(trust_in(10.0, -2.0), 2), round(trust_in(0.0, 0.0), 2), round(trust_in(-10.0, -30.0), 3)]
    [0.97, 0.8, 0.0]
    """
    return float(expit(np.log(_BEFORE) + 0.5 * (evidence + left_out) / _ALIKE))
