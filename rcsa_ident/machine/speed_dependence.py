"""Tips over the spindle's speed: speeds that are close together share one receptance, those of a machine that stays share the same one."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from rcsa_ident.base.arrays import FloatArray
from rcsa_ident.dynamics.coordinates import Coordinate
from rcsa_ident.dynamics.uncertain import AtNodes, Mixed, UncertainReceptance, curves_of, nodes_of
from rcsa_ident.machine.machine import STIFFNESS_SPREAD, TipSource
from rcsa_ident.setup.tooling import Tooling
from rcsa_ident.stability.methods import coarse_to_fine
from rcsa_ident.stability.tip_modes import TIP, TipModes
from rcsa_ident.tool_holder.geometry import ToolAssembly

#: Places of some speeds, and the tip that they share.
Tips = Iterator[tuple[NDArray[np.intp], UncertainReceptance | TipModes]]
#: Speeds of one block share one tip receptance: relative width of a block. On a spindle that turns (gyroscopic moments alone, 6000 to
#: 22 000 rev/min in 321 speeds, 53 tips) limits are off by 1e-4 in the median and 8e-4 at the most; errors go with the width.
BLOCK = 0.025
#: Largest ratio of speeds over which the spread that the posterior leaves is taken for a straight line.
STRAIGHT = 1.6


def tips_over_speed(
    machine: TipSource,
    tooling: Tooling | ToolAssembly,
    omega: FloatArray,
    speeds: FloatArray,
    spread: bool = True,
    stiffness_spread: float = STIFFNESS_SPREAD,
    directions: Sequence[Coordinate] = TIP,
) -> Tips:
    """Yield the tip, relative to the workpiece, for each block of speeds that share one, beside the places of these speeds.

    Blocks that lie far apart come first.

    `omega` [rad/s], shape (k,): of the receptances
    `speeds` [rad/s], shape (n,): in any order; each is in one block
    `spread`: with what is not known of the machine
    `stiffness_spread`: standard deviation of the tool-holder's stiffness, as a share
    `directions`: of the tip, as `Machine.tip` takes them
    """

    def tip_of(model: TipSource, spread: bool) -> UncertainReceptance | TipModes:
        return model.relative_tip(tooling, omega, spread, stiffness_spread, directions)

    for model, places in machine.models(speeds):
        own, known = speeds[places], model.speed_range
        if known is None:
            yield places, tip_of(model, spread)
            continue
        blocks = _blocks(own, known)
        tips = _ChangingTip(model, tip_of, own, known, spread)
        middles = [tips.middle(own[block]) for block in blocks]
        if tips.coupled:
            tips.share_nodes(middles)
        for k in coarse_to_fine(len(blocks)):
            yield places[blocks[k]], tips.at(middles[k])


def _blocks(speeds: FloatArray, known: tuple[float, float]) -> list[NDArray[np.intp]]:
    """Places of the speeds of each block; what lies beyond the known range belongs to its ends."""
    number = np.floor(np.log(np.clip(speeds, *known) / known[0]) / np.log1p(BLOCK)).astype(int)
    return [np.flatnonzero(number == n) for n in np.unique(number)]


class _ChangingTip:
    """Tips of one model that changes: each its own, with a spread that is interpolated between a few."""

    def __init__(
        self,
        model: TipSource,
        tip_of: Callable[[TipSource, bool], UncertainReceptance | TipModes],
        speeds: FloatArray,
        known: tuple[float, float],
        spread: bool,
    ) -> None:
        self.model, self.tip_of, self.known = model, tip_of, known
        self.anchors, self.tips = np.zeros(0), list[UncertainReceptance | TipModes]()
        self.own = dict[float, UncertainReceptance | TipModes]()
        if spread:
            low, high = np.clip([speeds.min(), speeds.max()], *known)
            pieces = int(np.ceil(np.log(high / low) / np.log(STRAIGHT)))
            self.anchors = np.linspace(low, high, pieces + 1) if high > (1.0 + BLOCK) * low else np.array([0.5 * (low + high)])
            self.tips = [self._tip(speed, True) for speed in self.anchors.tolist()]

    def _tip(self, speed: float, spread: bool) -> UncertainReceptance | TipModes:
        return self.tip_of(self.model.at(speed), spread)

    def middle(self, speeds: FloatArray) -> float:
        """Return the middle of a block's speeds, as far as they are known."""
        return float(np.mean(np.clip([speeds.min(), speeds.max()], *self.known)))

    @property
    def coupled(self) -> bool:
        """Whether there is a spread, over planes that feel each other."""
        known = [tip.values for tip in self.tips if isinstance(tip, UncertainReceptance) and tip.variation is not None]
        return any(np.any(values[:, ~np.eye(values.shape[1], dtype=bool)]) for values in known)

    def share_nodes(self, speeds: Sequence[float]) -> None:
        """Let all blocks draw at the same frequencies: variations over both planes at once are too dear to be worked out for each."""
        self.own = {speed: self._tip(speed, False) for speed in speeds}
        anchors = [tip for tip in self.tips if isinstance(tip, UncertainReceptance) and tip.variation is not None]
        curves = [curve for tip in self.own.values() if isinstance(tip, UncertainReceptance) for curve in curves_of(tip.values)]
        curves += [curve for tip in anchors if tip.variation is not None for curve in tip.variation.guides()]
        if len(anchors) == len(self.tips) and curves:
            nodes = nodes_of(curves)
            self.tips = [replace(tip, variation=AtNodes(tip.variation, nodes)) for tip in anchors if tip.variation is not None]

    def at(self, speed: float) -> UncertainReceptance | TipModes:
        """Return the tip at the middle of a block's speeds."""
        tip = self.own[speed] if speed in self.own else self._tip(speed, False)
        if not self.tips or isinstance(tip, TipModes):
            return tip
        # the directions are those of the covariance, the same at all speeds: their responses can be interpolated
        place = float(np.interp(speed, self.anchors, np.arange(self.anchors.size)))
        first = min(int(place), self.anchors.size - 1)
        ends = (self.tips[first], self.tips[min(first + 1, self.anchors.size - 1)])
        known = [end.variation for end in ends if isinstance(end, UncertainReceptance) and end.variation is not None]
        return replace(tip, variation=Mixed(known[0], known[1], place - first)) if len(known) == 2 else tip
