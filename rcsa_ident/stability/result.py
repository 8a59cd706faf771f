"""The answer of every lobe method."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rcsa_ident.arrays import FloatArray, frozen
from rcsa_ident.errors import InputError


@dataclass(frozen=True, slots=True, eq=False)
class StabilityLobes:
    """The smallest depth at which a cut loses stability, over spindle speed.

    Parameters
    ----------
    spindle_speed : array, shape (n,) [rad/s]
    limit_depth : array, shape (n,) [m]
        Infinite where the cut is stable up to the depth that was asked for.
    chatter_frequency : array, shape (n,) [rad/s]
        NaN where `limit_depth` is infinite: nothing vibrates there.
    lobe : array of int, shape (n,)
        Whole waves between two teeth; -1 where `limit_depth` is infinite.
    absolute_limit : float [m]
        No speed is unstable below it; infinite if there is no such depth.
    absolute_frequency : float [rad/s]
        Chatter frequency at the absolute limit, NaN if there is none.
    method : str
        What computed it.
    warnings : tuple of str
        Why the answer may be wrong; empty where nothing is known against it.
    flip : array of bool, shape (n,), default all False
        Where stability is lost by period doubling (an eigenvalue of -1 per tooth period); elsewhere the vibration is quasi-periodic.
    """

    spindle_speed: FloatArray
    limit_depth: FloatArray
    chatter_frequency: FloatArray
    lobe: NDArray[np.intp]
    absolute_limit: float
    absolute_frequency: float
    method: str
    warnings: tuple[str, ...] = ()
    flip: NDArray[np.bool_] | None = None

    def __post_init__(self) -> None:
        for name in ("spindle_speed", "limit_depth", "chatter_frequency"):
            object.__setattr__(self, name, frozen(getattr(self, name)))
        object.__setattr__(self, "lobe", frozen(self.lobe, np.intp))
        flip = np.zeros(self.spindle_speed.shape, dtype=bool) if self.flip is None else self.flip
        object.__setattr__(self, "flip", frozen(flip, np.bool_))
        for name in ("limit_depth", "chatter_frequency", "lobe", "flip"):
            shape = getattr(self, name).shape
            if shape != self.spindle_speed.shape:
                raise InputError(name, shape, f"the speeds' shape, {self.spindle_speed.shape}")

    @property
    def stable(self) -> NDArray[np.bool_]:
        """True where no limit was found up to the depth that was asked for, shape (n,)."""
        return np.isinf(self.limit_depth)
