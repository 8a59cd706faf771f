"""How far many cuts on one tip are from chatter: what the tip leaves open is worked out once, the period map is asked near the limit."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cache
from typing import NamedTuple

import numpy as np

from rcsa_ident.base.arrays import FloatArray
from rcsa_ident.cutting.process import MillingProcess
from rcsa_ident.dynamics.receptance import Receptance
from rcsa_ident.dynamics.uncertain import UncertainReceptance
from rcsa_ident.stability.drawn_modes import DrawnTips, drawn_tips, of_draw
from rcsa_ident.stability.first_instability import first_loss
from rcsa_ident.stability.lobes import (
    Draws,
    affordable,
    as_modes,
    directions_for,
    draws_of,
    left_by_modes,
    stability_lobes,
    unusual_speeds,
)
from rcsa_ident.stability.methods import StabilityMethod
from rcsa_ident.stability.monodromy import MonodromyOperator
from rcsa_ident.stability.multiplier_limits import BEFORE, ROUGH, Growth, Passage, dominant, islands_from, longest_step
from rcsa_ident.stability.result import held_by
from rcsa_ident.stability.stability_map import MonodromyMethod
from rcsa_ident.stability.strength import PASSING, Search, strength
from rcsa_ident.stability.tip_modes import TipModes, receptance_of
from rcsa_ident.stability.zero_order import ZeroOrder

#: Farther from chatter than this nobody asks how far: a margin is told up to it. Up to the second islands are looked for.
FARTHEST, NEAR = 4.0, 1.25
#: Tolerance of a margin, as a share; beyond that ratio of the depths and tolerance.
_TOLERANCE, _LONG, _ROUGHLY = 0.01, 1.6, 0.03
#: Share of the zero-order limit from which the limit of a cut that chatters is looked for.
_BELOW = 0.7
#: Margins and shares that nobody asks about.
_FAR = 1e3
#: Share of the drawn machines that a lower margin holds for.
HELD = 0.95
#: Lower margins between which drawn machines are asked by their own period maps, and how many of them: those next to the one that decides.
_DOUBTFUL, _ASKED = (0.8, 1.25), 8
_ZERO_ORDER = ZeroOrder()


class Margin(NamedTuple):
    """Of one cut.

    `times`: how many times as deep it becomes unstable, or how many times stronger its material may be where it changes along the edge
    `low`: what `HELD` of the drawn machines reach; `times` where none are drawn
    `chatter_frequency` [rad/s]: at the limit; not a number where none was found
    """

    times: float
    low: float
    chatter_frequency: float
    warnings: tuple[str, ...]


@dataclass(frozen=True, slots=True, eq=False)
class AskedTip:
    """A tip at one spindle speed that is asked about many cuts.

    `tip`: as the method wants it, in the directions that count for the cuts
    `nodes`: its receptance at as many frequencies as the zero-order method needs
    `drawn`: machines that may stand in its place; None where nothing is left open
    `tips`: these as modes; None where nobody has asked for them
    `said`: what speaks against all of its margins
    """

    tip: Receptance | TipModes
    nodes: Receptance
    drawn: Draws | None
    method: StabilityMethod
    speed: float
    tips: DrawnTips | None = None
    said: tuple[str, ...] = ()

    @classmethod
    def of(
        cls, tip: Receptance | TipModes, process: MillingProcess, speed: float, method: StabilityMethod, draws: int, seed: int = 1
    ) -> AskedTip:
        """Return a tip that is ready to be asked.

        `tip`: in the directions that the cuts ask for
        `process`: one of the cuts
        `speed` [rad/s]
        `draws`: machines drawn where the tip has a spread; below 2 none are drawn
        """
        known, said, drawn = tip, list[str](), None
        if isinstance(known, TipModes):
            known = known.planar if process.is_plain else known
        elif method.needs == "modes":
            known, told = as_modes(directions_for(process, known))
            said.append(told)
        if isinstance(tip, UncertainReceptance):
            drawn = draws_of(tip, process, draws, seed) if draws > 1 and tip.complete else None
            if drawn is not None and not process.is_plain:
                # proportions are those of X and Y: the other directions would be most of what goes to other processes
                drawn = drawn._replace(tips=np.ascontiguousarray(drawn.tips[..., :2, :2]))
            tip = tip.thinned()
        # what draws others out of itself stays here: this goes to other processes
        both = directions_for(process, receptance_of(tip)), receptance_of(known)
        nodes, whole = (Receptance(each.omega, each.values, each.rows, each.cols) for each in both)
        asked = known if method.needs == "modes" else whole
        return cls(asked, nodes, drawn, method, speed, None, (*said, *unusual_speeds(process, np.array([speed]))))

    @property
    def speeds(self) -> FloatArray:
        """The speed, shape (1,) [rad/s]."""
        return np.array([self.speed])

    def margin(self, process: MillingProcess, depth: float) -> Margin:
        """Return the margin of a cut of a depth [m]; its lower one is in the proportion of the drawn machines' zero-order limits."""
        times, chatter, warnings = self._deeper(process, depth) if process.is_plain else self._stronger(process, depth)
        low = times
        if self.drawn is not None:
            simple, shares = self._shares(process, depth)
            # where no limit was found it is farther than that
            near = times if times < FARTHEST else max(times, min(simple, _FAR))
            low = min(times, float(held_by(near * np.minimum(shares, _FAR)[:, None], HELD)[0]))
        remarks = *process.remarks, *process.cutter.cylinder_remarks(times * depth)
        return Margin(times, low, chatter, (*warnings, *remarks, *self.said))

    def _shares(self, process: MillingProcess, depth: float) -> tuple[float, FloatArray]:
        """The zero-order margin, and the limits of the drawn machines beside that one."""
        assert self.drawn is not None
        return _ZERO_ORDER.shares(self.nodes, self.drawn.tips, process, self.speed, depth, self.drawn.factors)

    def _deeper(self, process: MillingProcess, depth: float) -> tuple[float, float, tuple[str, ...]]:
        """How many times as deep a cut becomes unstable, how it vibrates there, and what speaks against it."""
        # the edge of a plain cut has no end
        deepest = FARTHEST * depth
        if not isinstance(self.method, MonodromyMethod) or not isinstance(self.tip, TipModes):
            found = stability_lobes(self.tip, process, self.speeds, deepest, self.method, 0)
            return min(float(found.limit_depth[0]) / depth, FARTHEST), float(found.chatter_frequency[0]), found.warnings
        affordable(self.method, self.tip, process, self.speeds, deepest)
        cut = self.method.monodromy(self.tip, process)
        step, islands = longest_step(cut), islands_from(process)
        growth, passage = cache(Growth(cut, self.speed, step, ROUGH)), Passage(cut, self.speed, step)
        if growth(depth) < 0.0:
            # closely at first, where islands may stand, then in long steps
            low, near = depth, NEAR * depth
            limit = first_loss(growth, depth, near, _TOLERANCE, careful_from=islands)
            limit = first_loss(growth, near, deepest, _ROUGHLY, _LONG) if limit is None else limit
        else:
            low = min(_BELOW * float(_ZERO_ORDER.lobes(self.nodes, process, self.speeds, deepest).limit_depth[0]), 0.5 * depth)
            limit = first_loss(growth, low, depth, _TOLERANCE, careful_from=islands)
        high = deepest if limit is None else limit
        passes = passage(BEFORE * high) >= 0.0
        limit = first_loss(passage, low, high, _TOLERANCE) if passes else limit
        said = (PASSING,) if passes else ()
        if limit is None:
            return FARTHEST, np.nan, said
        return limit / depth, dominant(cut.multiplier(self.speed, limit, step, waves=True, residual=ROUGH)), said

    def _stronger(self, process: MillingProcess, depth: float) -> tuple[float, float, tuple[str, ...]]:
        """How many times stronger the material may be."""
        about, chatter = _ZERO_ORDER.strength(self.nodes, process, self.speed, depth, FARTHEST)
        times = float(np.clip(about, 1.0 / FARTHEST, FARTHEST))
        if isinstance(self.method, ZeroOrder):
            return times, chatter, ()
        return strength(self.method, self.tip, process, self.speed, depth, Search(FARTHEST, _TOLERANCE, times))

    def doubtful(self, process: MillingProcess, margin: Margin) -> bool:
        """Whether the lower margin of a cut is so near to one that drawn machines are to be asked by their own period maps."""
        known = self.drawn is not None and isinstance(self.method, MonodromyMethod) and process.is_plain
        return known and margin.times < FARTHEST and _DOUBTFUL[0] < margin.low < _DOUBTFUL[1]

    def with_drawn_modes(self, process: MillingProcess) -> AskedTip:
        """Return the tip with its drawn machines as modes; `process` is one of the cuts."""
        assert self.drawn is not None
        assert isinstance(self.tip, TipModes)
        each = of_draw(process, self.drawn.factors, len(self.drawn.tips))
        return replace(self, tips=drawn_tips(self.drawn.omega, self.drawn.middle, self.drawn.tips, self.tip, each))

    def settled(self, process: MillingProcess, depth: float, margin: Margin) -> Margin:
        """Return a margin whose lower one was looked at by period maps: those of the drawn machines next to the one that decides.

        It is moved by the median of what they are beside their proportion.
        """
        assert self.drawn is not None
        assert isinstance(self.tip, TipModes)
        assert self.tips is not None
        factors, (_, shares) = self.drawn.factors, self._shares(process, depth)
        order, count = np.argsort(shares, kind="stable"), min(_ASKED, shares.size)
        first = int(np.clip((1.0 - HELD) * shares.size - 0.5 * count, 0, shares.size - count))
        asked = order[first : first + count]
        limit, own = margin.times * depth, None if factors is None else factors[asked]
        guess = limit * shares[asked]
        tips = DrawnTips(tuple(self.tips.modes[k] for k in asked), tuple(of_draw(process, own, count)), self.tips.error)
        known: MonodromyOperator = self.method.monodromy(self.tip, process)  # type: ignore[attr-defined]
        found = tips.limits(known, self.speeds, np.array([limit]), guess[:, None], FARTHEST * depth)[:, 0]
        moved = float(np.median(np.minimum(found, FARTHEST * depth) / guess))
        said = (*margin.warnings, *left_by_modes(self.tips))
        return margin._replace(low=min(margin.low * moved, margin.times), warnings=said)
