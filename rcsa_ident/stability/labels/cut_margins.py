"""How far each tested cut is from its own loss of stability, on draws of a tip: at its own depth, width, direction and feed."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from rcsa_ident.base.arrays import FloatArray
from rcsa_ident.base.errors import InputError
from rcsa_ident.cutting.process import MillingProcess
from rcsa_ident.stability.labels.tested_cuts import TestedCuts, immersion_of
from rcsa_ident.stability.labels.uncertain_tip import TipLimits, UncertainTip
from rcsa_ident.stability.methods import StabilityMethod
from rcsa_ident.stability.monodromy import MonodromyOperator
from rcsa_ident.stability.multiplier_limits import ROUGH, dominant, longest_step
from rcsa_ident.stability.stability_map import MonodromyMethod
from rcsa_ident.stability.tip_modes import TipModes

#: Modes below this share of the strongest one's peak do not tell how a tool that cuts nothing comes to rest.
_STRONG = 0.05
#: Margins are no larger than the logarithm of this.
_CALM = 30.0
#: Limits are looked for up to so many times a cut's depth, by methods that have no multipliers.
_DEEPER = 4.0


@dataclass(frozen=True, slots=True, eq=False)
class DrawnMargins:
    """Margins of draws of a tip at tested cuts.

    `margin` [-], shape (d, n): logarithm of limit over depth, where limit and growth are in proportion; negative where the cut grows
    `chatter` [rad/s], shape (d, n): frequency of the most persistent vibration; NaN where nobody asked
    """

    margin: FloatArray
    chatter: FloatArray


@dataclass(frozen=True, eq=False)
class CutMargins:
    """Margins of tested cuts as a function of the numbers of an uncertain tip.

    With a depth b the vibration that dies away slowest decays at the rate c(b) = -log|multiplier| / period. Where the rate falls in
    proportion to the depth, c(b) = c(0) (1 - b / limit), so that log(limit / b) = -log(1 - c(b) / c(0)): that is the margin. It is asked
    at the cut itself, so that a cut that is stable above an unstable depth is one.

    `process`: that is asked about, with the means of the coefficients; what a cut tells of itself takes its place
    """

    tip: UncertainTip
    process: MillingProcess
    method: StabilityMethod
    cuts: TestedCuts

    @cached_property
    def points(self) -> FloatArray:
        """Speed [rad/s], radial immersion, and 1 for up milling, of each cut, shape (n, 3)."""
        return points_of(self.cuts, self.process)

    def __call__(self, z: FloatArray) -> DrawnMargins:
        """Return the margins of draws, shape (d, size)."""
        margin, chatter = np.full((2, len(z), len(self.cuts.verdict)), np.nan)
        for places, process in self.cuts.alike(self.process):
            if isinstance(self.method, MonodromyMethod):
                for k, each in enumerate(z):
                    margin[k, places], chatter[k, places] = self._at_the_cuts(each, self.tip.process(each, process), places)
                continue
            speed, depth = self.cuts.spindle_speed[places], self.cuts.axial_depth[places]
            speeds, own = np.unique(speed, return_inverse=True)
            found = TipLimits(self.tip, process, self.method, _DEEPER * float(depth.max()))(z, speeds)
            margin[:, places], chatter[:, places] = found.log_limit[:, own] - np.log(depth), found.chatter[:, own]
        return DrawnMargins(margin, chatter)

    def _at_the_cuts(self, z: FloatArray, process: MillingProcess, places: NDArray[np.intp]) -> tuple[FloatArray, FloatArray]:
        speeds, depths, heard = (v[places] for v in (self.cuts.spindle_speed, self.cuts.axial_depth, self.cuts.chatter_frequency))
        margin, chatter = np.full((2, places.size), np.nan)
        for speed, cut in self._operators(z, process, np.unique(speeds)):
            step, rest = longest_step(cut), _rest(cut.modes)
            for depth in np.unique(depths[speeds == speed]):
                here = (speeds == speed) & (depths == depth)
                asked = bool(np.isfinite(heard[here]).any())
                found = cut.multiplier(speed, depth, step, waves=asked, residual=ROUGH)
                decay = -np.log(max(abs(found.value), 1e-300)) / found.period
                margin[here] = -np.log(max(1.0 - decay / rest, 1.0 / _CALM))
                chatter[here] = dominant(found) if asked else np.nan
        return margin, chatter

    def _operators(self, z: FloatArray, process: MillingProcess, speeds: FloatArray) -> Iterator[tuple[float, MonodromyOperator]]:
        cut = None
        for speed in speeds.tolist():
            if cut is None or self.tip.softening:
                assert isinstance(self.method, MonodromyMethod)
                cut = self.method.monodromy(self.tip.at(z, speed), process)
            yield speed, cut


def _rest(modes: TipModes) -> float:
    """Rate at which the slowest strong mode comes to rest [1/s]."""
    return float(np.min(-modes.pole.real[modes.strength >= _STRONG * modes.strength.max()]))


def points_of(cuts: TestedCuts, process: MillingProcess) -> FloatArray:
    """Return speed [rad/s], radial immersion, and 1 for up milling, of each cut, shape (n, 3)."""
    rows = []
    for speed, own in zip(cuts.spindle_speed.tolist(), cuts.own, strict=True):
        try:
            share, strategy = immersion_of(own.process(process).engagement, process.cutter.diameter)
        except InputError:
            # one engagement that no width tells, of all cuts
            if own.radial_width is not None or own.radial_immersion is not None or own.strategy:
                raise
            share, strategy = 1.0, "down"
        rows.append((speed, share, float(strategy == "up")))
    return np.array(rows).reshape(-1, 3)
