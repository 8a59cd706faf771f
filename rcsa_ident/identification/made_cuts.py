"""When the cuts of a campaign were made, how warm the machine was, and which of them judge the answer."""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np

from rcsa_ident.arrays import FloatArray

#: From one cut to the next where nobody tells it [s].
USUAL_PAUSE = 90.0


@dataclass(frozen=True, slots=True, eq=False)
class MadeCuts:
    """What a campaign tells of its cuts beside their recordings; arrays of shape (k,).

    Parameters
    ----------
    started : array [s]
        When each began, since the first one; at even distances in the campaign's order where nobody tells it.
    temperature : array [°C]
        Near the bearings; not a number where nobody tells it.
    judged : array of bool
        Whether the cut is predicted, and nothing is learned from it.
    """

    started: FloatArray
    temperature: FloatArray
    judged: np.ndarray

    def of(self, keep: np.ndarray) -> MadeCuts:
        """Return the same of some cuts, by their indices."""
        return MadeCuts(*(getattr(self, each.name)[keep] for each in fields(self)))


def in_order(count: int) -> MadeCuts:
    """Return so many cuts, of which nothing is told but their order."""
    return MadeCuts(USUAL_PAUSE * np.arange(count), np.full(count, np.nan), np.zeros(count, dtype=bool))
