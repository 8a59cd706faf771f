"""What is told of a campaign's cuts beside their lines: delays, when they were made, how warm it was, and which judge the answer."""

from __future__ import annotations

from dataclasses import dataclass, field, fields
from functools import cached_property

import numpy as np

from rcsa_ident.base.arrays import FloatArray, frozen

#: From one cut to the next where nobody tells it [s].
USUAL_PAUSE = 90.0


@dataclass(frozen=True, eq=False)
class CutPrior:
    """What is known beforehand of each cut's delay and of the angle to its air cut; arrays of shape (k,).

    `delay` [s]: from a trigger of known tooth angle
    `delay_weight` [1/s^2]: inverse variance of it; 0 without such a trigger
    `angle_weight` [1/rad^2]: inverse variance of the angle between cut and air cut, whose mean is 0
    `tooth_period` [s]: in which the delay may lie anywhere where nothing is known of it: a turn where teeth are unlike
    `pitches`: how many teeth pass in it; by default one
    """

    delay: FloatArray
    delay_weight: FloatArray
    angle_weight: FloatArray
    tooth_period: FloatArray
    pitches: FloatArray = field(default=None)  # type: ignore[arg-type]

    def __post_init__(self) -> None:
        if self.pitches is None:
            object.__setattr__(self, "pitches", np.ones_like(self.delay))
        for each in fields(self):
            object.__setattr__(self, each.name, frozen(getattr(self, each.name)))

    @cached_property
    def weights(self) -> FloatArray:
        """Weights of delay and angle, shape (k, 2)."""
        return np.stack([self.delay_weight, self.angle_weight], axis=1)

    @property
    def columns(self) -> FloatArray:
        """All side by side, shape (k, 5)."""
        return np.stack([getattr(self, each.name) for each in fields(self)], axis=1)

    @cached_property
    def rows(self) -> FloatArray:
        """The first four side by side, as the kernel takes them, shape (k, 4)."""
        return np.stack([self.delay, self.delay_weight, self.angle_weight, self.tooth_period], axis=1)


@dataclass(frozen=True, slots=True, eq=False)
class MadeCuts:
    """What a campaign tells of its cuts beside their recordings; arrays of shape (k,).

    `started` [s]: when each began, since the first one; at even distances in the campaign's order where nobody tells it
    `temperature` [°C]: near the bearings; not a number where nobody tells it
    `judged`: whether the cut is predicted, and nothing is learned from it
    `kind`: the same for cuts of like engagement and feed per tooth
    """

    started: FloatArray
    temperature: FloatArray
    judged: np.ndarray
    kind: np.ndarray

    def of(self, keep: np.ndarray) -> MadeCuts:
        """Return the same of some cuts, by their indices."""
        return MadeCuts(*(getattr(self, each.name)[keep] for each in fields(self)))


def in_order(count: int) -> MadeCuts:
    """Return so many cuts, of which nothing is told but their order."""
    return MadeCuts(USUAL_PAUSE * np.arange(count), np.full(count, np.nan), np.zeros(count, dtype=bool), np.zeros(count, dtype=np.intp))
