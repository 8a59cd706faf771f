"""The tip of one tooling as labelled cuts have taught it: draws of its modes, of the coefficients and of the limit's own error."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from rcsa_ident.base.arrays import FloatArray
from rcsa_ident.cutting.coefficients import CuttingCoefficients
from rcsa_ident.cutting.process import MillingProcess
from rcsa_ident.dynamics.coordinates import Coordinate
from rcsa_ident.machine.machine import STIFFNESS_SPREAD, TipSource
from rcsa_ident.setup.cut import Workpiece
from rcsa_ident.setup.tooling import Tooling
from rcsa_ident.stability.labels.averaging import belief_in, trust_in
from rcsa_ident.stability.labels.coverage import Covered, TestedAnswers, covered
from rcsa_ident.stability.labels.cut_margins import CutMargins, points_of
from rcsa_ident.stability.labels.label_posterior import FEWEST, LabelModel, LabelPosterior
from rcsa_ident.stability.labels.label_process import LabelProcess
from rcsa_ident.stability.labels.tested_cuts import TestedCuts, Verdict
from rcsa_ident.stability.labels.uncertain_tip import TipLimits, UncertainTip
from rcsa_ident.stability.methods import StabilityMethod
from rcsa_ident.stability.result import StabilityLobes
from rcsa_ident.stability.tip_modes import TIP, TipModes
from rcsa_ident.tool_holder.geometry import ToolAssembly

#: Draws of what was believed before labels, and their seed.
_BEFORE, _SEED = 200, 1
#: What is said of a posterior that few draws stand for.
THIN = "only {:.0f} of the draws agree with the labels, fewer than {:.0f}: probabilities are rough"

#: What is said where the labels alone are the better explanation, by so much of the log evidence.
WORSE = (
    "a process without physics explains the labels better (log evidence {:.0f}, physics {:.0f}): limits of this tip are not reliable away "
    "from the labels"
)
_BETTER = 10.0


@dataclass(frozen=True, eq=False, repr=False)
class LearntTip(TipSource):
    """What is believed of a tooling's tip after labelled cuts, or before the first of them; it answers for that tooling alone.

    `coefficients`: means before the labels
    `method`: that the limits were computed by: their error is that method's, too, so that no other one takes its place
    `cuts`: those that were learnt from
    `process`: the labels without physics; None without labels
    """

    prior: UncertainTip
    coefficients: CuttingCoefficients
    method: StabilityMethod
    model: LabelModel
    cuts: TestedCuts
    posterior: LabelPosterior
    process: LabelProcess | None = None

    @property
    def band(self) -> None:
        """Modes are told at all frequencies."""
        return

    @property
    def workpiece(self) -> Workpiece:
        """The coefficients as they were before the labels; what a draw differs by multiplies whatever a cut names."""
        return Workpiece("of the labelled cuts", self.coefficients)

    @property
    def remarks(self) -> tuple[str, ...]:
        """Labels that contradict each other, a posterior that few draws stand for, and physics that tells less than labels alone."""
        said = [THIN.format(self.posterior.effective, FEWEST)] if self.thin else []
        if self.process is not None and self.process.log_evidence - self.posterior.log_evidence > _BETTER:
            said.append(WORSE.format(self.process.log_evidence, self.posterior.log_evidence))
        return (*self.cuts.contradictions, *said)

    @property
    def trust(self) -> float:
        """Weight of physics near labels."""
        return 1.0 if self.process is None else trust_in(self.posterior.log_evidence - self.process.log_evidence)

    @property
    def thin(self) -> bool:
        """Whether so few of the draws agree with the labels that probabilities are rough."""
        return self.posterior.effective < FEWEST

    @cached_property
    def middle(self) -> TipModes:
        """Modes of the medians of all draws."""
        return self.prior.at(np.median(self.posterior.z, axis=0))

    def lines(self, beyond: float = 1.0) -> FloatArray:
        """Return the frequencies that resolve its modes."""
        del beyond
        return self.middle.receptance().omega

    def tip(
        self,
        tooling: Tooling | ToolAssembly,
        omega: FloatArray | None = None,
        spread: bool = True,
        stiffness_spread: float = STIFFNESS_SPREAD,
        directions: Sequence[Coordinate] = TIP,
    ) -> TipModes:
        """Return the modes in the middle of all draws, whatever tooling is named."""
        del tooling, omega, spread, stiffness_spread, directions
        return self.middle

    def drawn_limits(self, process: MillingProcess, speeds: FloatArray, max_depth: float, draws: int) -> tuple[FloatArray, FloatArray]:
        """Return limits of the first draws, their errors included, shape (draws, n) [m], and the chatter frequencies [rad/s]."""
        limits = TipLimits(self.prior, process, self.method, max_depth)(self.posterior.z[:draws], speeds)
        places = np.unique(speeds, return_inverse=True)
        asked = TestedCuts(places[0], np.ones(places[0].size), (Verdict.MARGINAL,) * places[0].size)
        error = self.posterior.errors(self.model.discrepancy, points_of(asked, process))[:draws, places[1]]
        # beyond the largest depth nothing was looked for, and no error makes a limit of it
        found = np.where(limits.log_limit < np.log(max_depth) - 1e-9, np.exp(limits.log_limit + error), np.inf)
        return found, limits.chatter

    def limits(self, process: MillingProcess, speeds: FloatArray, max_depth: float, draws: int) -> StabilityLobes:
        """Return the limits up to which one half of the draws is stable, and those of each draw.

        `process`: with the coefficients' means
        `speeds` [rad/s], shape (n,): rising
        `max_depth` [m]
        `draws`: at most so many of the draws, and one at least
        """
        # an error may bring a limit back from beyond the largest depth
        deeper = max_depth * float(np.exp(2.0 * self.model.discrepancy.deviation))
        drawn, chatter = self.drawn_limits(process, speeds, deeper, max(draws, 1))
        drawn = np.where(drawn <= max_depth, drawn, np.inf)
        middle = np.quantile(drawn, 0.5, axis=0, method="nearest")
        nearest = np.argmin(np.abs(np.where(np.isinf(drawn), max_depth, drawn) - np.minimum(middle, max_depth)), axis=0)
        heard = np.where(np.isinf(middle), np.nan, chatter[nearest, np.arange(speeds.size)])
        passing = process.cutter.teeth * speeds
        lobe = np.where(np.isfinite(heard), np.floor(np.nan_to_num(heard) / passing), -1).astype(np.intp)
        return StabilityLobes(speeds, middle, heard, lobe, max_depth, self.method.name, drawn=drawn)

    def stable_by_draw(self, process: MillingProcess, cuts: TestedCuts) -> FloatArray:
        """Return the probability of each draw that each cut is called stable, by physics alone, shape (r, n)."""
        margins = CutMargins(self.prior, process, self.method, cuts)
        points, place = np.unique(margins.points, axis=0, return_inverse=True)
        error = self.posterior.errors(self.model.discrepancy, points)[:, place]
        return self.model.noise.stable(margins(self.posterior.z).margin + error)

    def answers(self, process: MillingProcess, cuts: TestedCuts) -> TestedAnswers:
        """Return what is believed of cuts: by physics and by the labels alone, and whether labels cover them.

        In a direction that has no label it is what was believed before the first one, as far as that told the labels that came, and else
        an even chance.

        `process`: of what a cut does not tell of itself
        """
        found = self.stable_by_draw(process, cuts).mean(axis=0)
        if self.process is None:
            return TestedAnswers(found, (Covered.NO,) * found.size)
        without, near = self.process.told(self.process.features_of(cuts, process))
        found = self.trust * found + (1.0 - self.trust) * without
        points, edges = self.posterior.points, frozenset(own.edge_state for own in self.cuts.own)
        cover = covered(points, edges, cuts, process, near)
        outside = ~np.isin(points_of(cuts, process)[:, 2], points[:, 2])
        if outside.any():
            found[outside] = self._before(process, cuts.at_places(np.flatnonzero(outside)))
        return TestedAnswers(found, cover)

    def _before(self, process: MillingProcess, cuts: TestedCuts) -> FloatArray:
        """The same before the first label."""
        z = np.random.default_rng(_SEED).standard_normal((_BEFORE, self.prior.size))
        margin = CutMargins(self.prior, process, self.method, cuts)(z).margin
        error = self.model.discrepancy.deviation * np.random.default_rng(_SEED).standard_normal(margin.shape)
        belief = belief_in(self.posterior.log_score_before, int(np.sum(self.cuts.counts)))
        found: FloatArray = 0.5 + belief * (self.model.noise.stable(margin + error).mean(axis=0) - 0.5)
        return found

    def __str__(self) -> str:
        return f"of one tooling, learnt from {len(self.cuts.verdict)} labelled cuts: {self.middle}"
