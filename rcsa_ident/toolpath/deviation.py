"""How far a tool is from the path that it should take."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rcsa_ident.base.arrays import FloatArray, frozen
from rcsa_ident.base.errors import InputError
from rcsa_ident.toolpath.path import ToolPath

#: A controller that leaves no more than this of a path goes straight there [m].
_STRAIGHT = 1e-5


@dataclass(frozen=True, slots=True, eq=False)
class Deviation:
    """How far a tool is from its path.

    `across` [m], shape (k, 3): from each of the path's places to where the tool is when it should be there, what lies along the path left
        aside
    `straight`: array of bool, shape (k,); places of moves at a feed where the controller goes where it is sent
    `blended`: array of bool, shape (k,); places of such moves that the controller cuts short

    Examples
    --------
    A tool that is pushed 0.3 mm aside and 0.1 mm ahead:

    >>> path = ToolPath(np.array([[0.0, 0.0, 0.0], [0.1, 0.0, 0.0]]), feed=np.full(2, 0.05))
    >>> found = Deviation.of(path, path.places + [1e-4, 3e-4, 0.0], path.places)
    >>> round(1e3 * found.rms, 6), found.corner
    (0.3, 0.0)
    """

    across: FloatArray
    straight: np.ndarray
    blended: np.ndarray

    @classmethod
    def of(cls, path: ToolPath, tips: FloatArray, followed: FloatArray) -> Deviation:
        """Return the deviation of tips, shape (k, 3) [m], from a path's places.

        `tips` [m], shape (k, 3)
        `followed` [m], shape (k, 3): where the controller alone would have the tool, without forces and compensation
        """
        for name, places in (("tips", tips), ("followed", followed)):
            if np.shape(places) != path.places.shape:
                raise InputError(name, np.shape(places), f"a place for each of the path's, shape {path.places.shape}")
        along = _directions(path)
        cutting = path.beside_cutting
        straight = np.linalg.norm(_across(followed - path.places, along), axis=1) < _STRAIGHT
        return cls(frozen(_across(tips - path.places, along)), cutting & straight, cutting & ~straight)

    @property
    def rms(self) -> float:
        """Where the controller goes straight [m]."""
        return float(np.sqrt(np.mean(self._sizes(self.straight) ** 2))) if self.straight.any() else 0.0

    @property
    def largest(self) -> float:
        """Where the controller goes straight [m]."""
        return float(np.max(self._sizes(self.straight), initial=0.0))

    @property
    def corner(self) -> float:
        """Largest where the controller cuts corners short [m]; 0 where it does not."""
        return float(np.max(self._sizes(self.blended), initial=0.0))

    def _sizes(self, places: np.ndarray) -> FloatArray:
        return np.linalg.norm(self.across[places], axis=1)


def _directions(path: ToolPath) -> FloatArray:
    """The way ahead at each place, shape (k, 3): in a corner between both moves, zero beside rapid moves alone."""
    moves = path.moves * path.cutting[:, None]
    size = np.linalg.norm(moves, axis=1, keepdims=True)
    unit = np.divide(moves, size, out=np.zeros_like(moves), where=size > 1e-12)
    both = np.concatenate([unit, np.zeros((1, 3))]) + np.concatenate([np.zeros((1, 3)), unit])
    size = np.linalg.norm(both, axis=1, keepdims=True)
    return np.divide(both, size, out=np.zeros_like(both), where=size > 1e-9)


def _across(off: FloatArray, along: FloatArray) -> FloatArray:
    return off - np.sum(off * along, axis=1, keepdims=True) * along
