"""Both planes together: from what each has found for itself to one machine, as far across as the evidence asks for."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from rcsa_ident.base.arrays import FloatArray
from rcsa_ident.base.scaleout import Map
from rcsa_ident.identification.candidate import Candidate
from rcsa_ident.identification.coupled.data import CoupledData
from rcsa_ident.identification.coupled.misfit import CoupledMisfit
from rcsa_ident.identification.coupled.score import coupled_start
from rcsa_ident.identification.joint_fit import ROUGHLY, AxisSearch, refine_and_learn_noise, tooth_angles
from rcsa_ident.identification.levenberg_marquardt import Solution, refine
from rcsa_ident.identification.model_order import Report, drop_modes, evidence, exchange_modes, grow_modes
from rcsa_ident.identification.priors import Priors
from rcsa_ident.identification.progress import Stage
from rcsa_ident.identification.task import Phase, finite, perform
from rcsa_ident.identification.unknowns import CoupledLayout, Layout, Unknowns, pack, planes, unpack

#: Model errors from coarse to fine: what each plane has found for itself was bent to explain the other one's forces.
SHARES = (0.05, 0.01, 0.003)
#: The first of them with gyroscopic coupling, which starts as weak as this share of its prior: at none it would have no gradient.
WITH_SKEW, FIRST_SKEW = 0.01, 0.3
#: Gain in evidence for which the spindle is believed to turn the other way: two valleys of one sense differ by up to half of it, and
#: where gyroscopic moments are strong the wrong sense loses by thousands.
OTHER_SENSE = 300.0
#: Discs whose slopes make the gyroscopic coupling of the last fit; starts have one.
DISCS = 2
#: Modes that the last fit adds at most where all outputs ask for them.
ADDED = 5
#: Starts that go on.
WALKED = 2
#: The last polish stops where two steps in a row lower the cost by less than this share.
WELL = 1e-4

#: Unknowns of both planes side by side, their layout, and the cuts' delays and angles.
Apart = tuple[FloatArray, Layout, FloatArray]


@dataclass(frozen=True, slots=True, eq=False)
class CoupledSearch:
    """What a start has come to.

    `evidence` [-]: minus twice the log evidence
    `model_error`: tuple of float [-], share of each axis' lines that counts as unexplained
    `cut_weight`, shape (k,): factor on the weights of each cut's lines
    """

    candidate: Candidate
    evidence: float
    model_error: tuple[float, ...]
    cut_weight: FloatArray


@dataclass(frozen=True, slots=True, eq=False)
class CoupledStart:
    """A polish of both planes as one machine, from what they have come to as two; it answers with a `CoupledSearch`.

    `data`: with the flange's motion as the only output
    `apart`: (array, Layout, array); where it begins: unknowns of planes without fixture and tooth angles, their layout, the cuts' delays
        and angles
    `weight`, shape (k,): factor on each cut's weights
    `turning`: as in `CoupledLayout`; where it is not 0 there is gyroscopic coupling
    `softening`: whether the stiffness changes with the spindle's speed
    """

    phase: ClassVar[Phase] = Phase.COUPLED
    data: CoupledData
    priors: Priors
    apart: Apart
    weight: FloatArray
    turning: int
    softening: bool

    def run(self) -> CoupledSearch:
        """Refine from coarse to fine."""
        theta, planes_layout, nuisance = self.apart
        theta, layout = coupled_start(theta, planes_layout, turning=self.turning)
        if layout.softening and not self.softening:
            theta, layout = with_softening(theta, layout, False)
        for share in SHARES:
            if share == WITH_SKEW:
                if self.turning:
                    theta, layout = with_discs(theta, layout, 1, self.priors)
                theta, layout = with_softening(theta, layout, self.softening)
            misfit = CoupledMisfit(self.data, self.priors, (share, share), self.weight)
            found = refine(misfit, theta, layout, nuisance, 60, grid=32 if share >= WITH_SKEW else 0, tolerance=ROUGHLY)
            theta, nuisance = found.theta, found.evaluation.nuisance
        return CoupledSearch(found.candidate, evidence(found, misfit), misfit.model_error, self.weight)


@dataclass(frozen=True, slots=True, eq=False)
class CoupledWalk:
    """The way of a start to its own noise, its sense of rotation and as many modes as the evidence asks for; it answers as a start does.

    `data`: with the flange's motion as the only output
    """

    phase: ClassVar[Phase] = Phase.COUPLED
    data: CoupledData
    priors: Priors
    start: CoupledSearch

    def run(self) -> CoupledSearch:
        """Polish, turn round, drop and exchange modes."""

        def misfit_of(shares: tuple[float, ...], weight: FloatArray) -> CoupledMisfit:
            return CoupledMisfit(self.data, self.priors, shares, weight)

        start = self.start
        found, misfit = refine_and_learn_noise(misfit_of, start.candidate.point, start.model_error, start.cut_weight, _unheard, ROUGHLY)
        if _layout(found.layout).turning:
            other = refine(misfit, *turned_round(found), 60, tolerance=ROUGHLY)
            if evidence(other, misfit) < evidence(found, misfit) - OTHER_SENSE:
                found = other
        found = drop_modes(found, misfit)
        found = exchange_modes(found, misfit, self.data.base.band_hz, rounds=1)
        return CoupledSearch(found.candidate, evidence(found, misfit), misfit.model_error, misfit.cut_weight)


def _unheard(stage: Stage, cost: float, solution: Solution) -> None:
    """A task in another process tells nothing on its way."""


def with_discs(theta: FloatArray, layout: CoupledLayout, discs: int, priors: Priors) -> tuple[FloatArray, CoupledLayout]:
    """Return a vector with more discs than it has, the new ones so weak that nothing changes but the gradient."""
    wider = replace(layout, skew=discs)
    rng = np.random.default_rng(discs)
    new = FIRST_SKEW * np.sqrt(priors.skew) * rng.standard_normal(wider.block.size - layout.block.size)
    return np.concatenate([theta[: layout.tail], new, theta[layout.tail :]]), wider


def with_softening(theta: FloatArray, layout: CoupledLayout, softening: bool) -> tuple[FloatArray, CoupledLayout]:
    """Return a vector with a stiffness that changes with speed, by nothing so far, or without; the same where it is so already."""
    if layout.softening == softening:
        return theta, layout
    other = replace(layout, softening=softening)
    discs = layout.block.discs(theta)
    return np.concatenate([pack(unpack(theta, layout.block), other.block, discs), theta[layout.tail :]]), other


def coupled_starts(
    data: CoupledData, priors: Priors, searched: list[AxisSearch], apart: Candidate, weight: FloatArray, map: Map = map
) -> list[CoupledSearch]:
    """Return where both planes come to as one machine, best first: from different starts, of which the best `WALKED` walk on.

    Each plane's own search has bent its modes to explain the other one's forces; the fit of both apart has one joint, but has bent them
    further. What changes with speed may be the stiffness, or gyroscopic moments alone.

    `searched`: of X and of Y
    `apart`: of both planes as if they did not feel each other
    `weight`, shape (k,): factor on each cut's weights there
    `map`: the builtin, or a pool's
    """
    summed = data.summed()
    of_searches, of_fit = _side_by_side(summed, searched), _flange_alone(apart)
    turning = int(data.turns)
    kinds = [(of_searches, turning, False), (of_fit, turning, False)]
    if data.base.speed_changes:
        kinds.append((of_searches, turning, True))
    if turning:
        kinds.append((of_searches, 0, False))
    tasks = [CoupledStart(summed, priors, start, weight, turning, softening) for start, turning, softening in kinds]
    starts = sorted(finite(map(perform, tasks)), key=lambda start: start.evidence)
    walked = finite(map(perform, [CoupledWalk(summed, priors, start) for start in starts[:WALKED]]))
    return sorted(walked, key=lambda start: start.evidence)


def _side_by_side(data: CoupledData, searched: list[AxisSearch]) -> Apart:
    """Both searches' answers, with the mean of their joints and forces."""
    best = [s.candidates[0] for s in searched]
    named, coefficients = len(data.base.coefficients), len(data.base.coefficient_spread)
    force = np.zeros(coefficients)
    force[:named] = np.mean([c.theta[c.layout.force][:named] for c in best], axis=0)
    joint = np.mean([c.theta[c.layout.joint] for c in best], axis=0)
    layout = Layout(tuple(planes(c.layout).axes[0] for c in best), coefficients)
    return np.concatenate([*(c.theta[c.layout.axis(0)] for c in best), joint, force]), layout, best[0].nuisance


def _flange_alone(apart: Candidate) -> Apart:
    """The fit of both planes without fixture and tooth angles."""
    old, theta = planes(apart.layout), apart.theta
    layout = Layout(tuple(replace(axis, places=0) for axis in old.axes), old.coefficients)
    parts = [pack(unpack(theta[old.axis(i)], old.axes[i]), axis) for i, axis in enumerate(layout.axes)]
    return np.concatenate([*parts, theta[old.joint], theta[old.force]]), layout, apart.nuisance


def fit_coupled(data: CoupledData, priors: Priors, best: CoupledSearch, report: Report) -> tuple[Solution, CoupledMisfit, Solution]:
    """Return the solution of both planes together, its misfit, and a rival with one mode more.

    A whole machine's modes reach across both planes: one more than the evidence asks for is worse as an answer, but how far it differs
    belongs to what is not known.

    `data`: with both outputs where they were recorded
    `best`: where it begins: the first of `coupled_starts`
    `report`: callable of (stage, cost, solution)
    """

    def misfit_of(shares: tuple[float, ...], weight: FloatArray) -> CoupledMisfit:
        return CoupledMisfit(data, priors, shares, weight)

    def learned(
        start: tuple[FloatArray, Unknowns, FloatArray], shares: tuple[float, ...], weight: FloatArray, tolerance: float
    ) -> tuple[Solution, CoupledMisfit]:
        found, misfit = refine_and_learn_noise(misfit_of, start, shares, weight, report, tolerance)
        assert isinstance(misfit, CoupledMisfit)
        return found, misfit

    found, misfit = learned(_with_all_outputs(data, best.candidate, priors), best.model_error, best.cut_weight, ROUGHLY)
    if data.base.speed_changes:
        layout = _layout(found.layout)
        other_kind = *with_softening(found.theta, layout, not layout.softening), found.evaluation.nuisance
        other, its_misfit = learned(other_kind, misfit.model_error, misfit.cut_weight, ROUGHLY)
        if evidence(other, its_misfit) < evidence(found, misfit):
            found, misfit = other, its_misfit
    start = found.candidate
    for _ in range(1 + ADDED):
        found, misfit = learned(start.point, misfit.model_error, misfit.cut_weight, WELL)
        # all outputs may show a mode that the flange's own motion does not
        grown = grow_modes(found, misfit, data.base.band_hz)
        report(Stage.GROW, grown.cost, grown)
        if evidence(grown, misfit) >= evidence(found, misfit) - 1.0:
            break
        start = grown.candidate
    return found, misfit, grown


def turned_round(found: Solution) -> tuple[FloatArray, CoupledLayout, FloatArray]:
    """Return where the search for the same machine begins whose spindle turns the other way: gyroscopic moments change their sign."""
    layout = _layout(found.layout)
    theta = found.theta.copy()
    discs = layout.block.discs(theta)
    discs[:, 0] *= -1.0
    return theta, replace(layout, turning=-layout.turning), found.evaluation.nuisance


def _layout(layout: Unknowns) -> CoupledLayout:
    assert isinstance(layout, CoupledLayout)
    return layout


def _with_all_outputs(data: CoupledData, found: Candidate, priors: Priors) -> tuple[FloatArray, CoupledLayout, FloatArray]:
    """Return a vector with all that the data may tell, from one of the flange's motion alone: what is new starts at nothing."""
    old, theta, nuisance = _layout(found.layout), found.theta, found.nuisance
    angles = theta[old.clamping]
    if old.skew:
        theta, old = with_discs(theta, old, DISCS, priors)
    layout = replace(old, fixture=data.base.axes[0].outputs == 2, clampings=data.base.clampings)
    if not old.clampings and layout.clampings:
        angles, nuisance = tooth_angles(data.base, nuisance)
    machine = pack(unpack(theta, old.block), layout.block, old.block.discs(theta))
    return np.concatenate([machine, theta[old.joint], theta[old.force], angles]), layout, nuisance
