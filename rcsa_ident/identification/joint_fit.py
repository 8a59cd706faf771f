"""The last polish: both axes with one joint and one delay per cut, gap and fixture apart, forces uncertain, speed if it matters."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from typing import ClassVar

import numpy as np

from rcsa_ident.base.arrays import FloatArray
from rcsa_ident.base.scaleout import Map
from rcsa_ident.identification.candidate import Candidate
from rcsa_ident.identification.data import IdentificationData
from rcsa_ident.identification.levenberg_marquardt import Solution, refine
from rcsa_ident.identification.misfit import Misfit
from rcsa_ident.identification.model_order import Report, cut_weights, evidence, exchange_modes, grow_modes, model_error
from rcsa_ident.identification.priors import Priors
from rcsa_ident.identification.progress import Stage, Step
from rcsa_ident.identification.task import Phase, finite, perform
from rcsa_ident.identification.unknowns import Layout, Unknowns, pack, planes, unpack

#: Modes per axis beyond what the evidence asks for.
GROWN = 1
#: Least model error of a first polish of both axes together, and whose joint and force it starts from (None is their mean).
STARTS = ((0.005, None), (0.02, 0), (0.005, 1), (0.02, 1), (0.02, None))
#: Costs closer than this are one answer.
SAME_POLISH = 5.0
#: Evidences closer than this belong to one answer, with a mode more or less that hardly matters.
SAME_ANSWER = 60.0
#: Polishes before the last one stop where two steps in a row lower the cost by less than this share.
ROUGHLY = 1e-3


@dataclass(frozen=True, slots=True, eq=False)
class AxisSearch:
    """What the search of one axis came to.

    `candidates`: by evidence, best first
    `evidences`: minus twice the log evidence of each
    `model_error` [-]: share of each line that is left unexplained, as the best search has learned it
    `cut_weight`, shape (k,): factor on the weights of each cut's lines, as the best search has learned it
    """

    candidates: list[Candidate]
    evidences: list[float]
    model_error: float
    cut_weight: FloatArray
    trace: list[Step]

    @property
    def confirmed(self) -> bool:
        """Whether two independent starts have come to the same answer."""
        return len(self.evidences) > 1 and self.evidences[1] - self.evidences[0] < SAME_ANSWER

    def joined(self, other: AxisSearch) -> AxisSearch:
        """Return both searches' candidates in the order of their evidence; what was learned of the noise is the better one's."""
        better = self if self.evidences[0] <= other.evidences[0] else other
        candidates, evidences = [*self.candidates, *other.candidates], [*self.evidences, *other.evidences]
        order = sorted(range(len(candidates)), key=evidences.__getitem__)
        trace = [*self.trace, *other.trace]
        return AxisSearch([candidates[i] for i in order], [evidences[i] for i in order], better.model_error, better.cut_weight, trace)


def axis_search(solution: Solution, misfit: Misfit, trace: list[Step]) -> AxisSearch:
    """Return the search of one axis that has come to a solution of a misfit."""
    return AxisSearch([solution.candidate], [evidence(solution, misfit)], misfit.model_error[0], misfit.cut_weight, trace)


def first_starts(data: IdentificationData, priors: Priors, searched: list[AxisSearch], map: Map = map) -> list[Candidate]:
    """Return both axes' answers polished together with one joint and one force, from two starts, best first."""
    found = finite(map(perform, [JointStart(data, priors, searched, *start) for start in STARTS[:2]]))
    return sorted(found, key=lambda candidate: candidate.cost)


def fit_roughly(
    data: IdentificationData, priors: Priors, searched: list[AxisSearch], first: Candidate, report: Report
) -> tuple[Solution, Misfit]:
    """Return about where a start leads with a stiffness that is free to change with speed, and the misfit there.

    `data`: as in `fit_jointly`
    `first`: from `first_starts`
    `report`: callable of (stage, cost, solution)
    """

    misfit_of = partial(Misfit, data, priors)
    start = _start(data, first, data.speed_changes)
    return refine_and_learn_noise(misfit_of, start, *learned_noise(searched), report, ROUGHLY)


def fit_jointly(
    data: IdentificationData, priors: Priors, searched: list[AxisSearch], first: list[Candidate], report: Report, map: Map = map
) -> tuple[Solution, Misfit]:
    """Return the solution of all axes together, with as many modes as the evidence asks for, and its misfit.

    `data`: all axes, with both outputs where they were recorded
    `searched`: one for each axis
    `first`: from `first_starts`
    `report`: callable of (stage, cost, solution)
    `map`: the builtin, or a pool's
    """

    misfit_of = partial(Misfit, data, priors)
    start = _from_several_starts(data, priors, searched, first, map).point
    found, misfit = refine_and_learn_noise(misfit_of, start, *learned_noise(searched), report)
    if data.speed_changes:
        with_softening = _start(data, found.candidate, True)
        moving, other = refine_and_learn_noise(misfit_of, with_softening, misfit.model_error, misfit.cut_weight, report, ROUGHLY)
        # a fine polish gains less than what separates two answers
        if evidence(moving, other) < evidence(found, misfit) + SAME_ANSWER:
            moving, other = refine_and_learn_noise(misfit_of, moving.candidate.point, other.model_error, other.cut_weight, report)
        if evidence(moving, other) < evidence(found, misfit):
            found, misfit = moving, other
    return exchange_modes(found, misfit, data.band_hz, report, rounds=2), misfit


def fit_with_places(data: IdentificationData, priors: Priors, found: Solution, misfit: Misfit, report: Report) -> tuple[Solution, Misfit]:
    """Return the solution for lines that show further places, from one for those without, and its misfit.

    `data`: as in `fit_jointly`
    `misfit`: of the solution without them: what it has learned of the noise
    `report`: callable of (stage, cost, solution)
    """
    start = _start(data, found.candidate, any(axis.softening for axis in planes(found.layout).axes))
    found, misfit = refine_and_learn_noise(partial(Misfit, data, priors), start, misfit.model_error, misfit.cut_weight, report)
    return exchange_modes(found, misfit, data.band_hz, report, rounds=2), misfit


def grow_jointly(
    data: IdentificationData, priors: Priors, chosen: Solution, misfit: Misfit, report: Report
) -> tuple[Solution, Misfit, Solution]:
    """Return the solution with more modes than the evidence asks for, the misfit whose minimum it is, and what the evidence has chosen.

    `data`: as in `fit_jointly`
    `chosen`: from `fit_jointly`
    `misfit`: its misfit
    `report`: callable of (stage, cost, solution)
    """

    misfit_of = partial(Misfit, data, priors)
    found = chosen
    for _ in range(GROWN):
        found = grow_modes(found, misfit, data.band_hz)
        report(Stage.GROW, found.cost, found)
    return *refine_and_learn_noise(misfit_of, found.candidate.point, misfit.model_error, misfit.cut_weight, report), chosen


def _from_several_starts(
    data: IdentificationData, priors: Priors, searched: list[AxisSearch], first: list[Candidate], map: Map
) -> Candidate:
    """Return the axes' answers polished together with one joint and one force.

    Where each axis has found its own joint and its own force, what lies between them may end in another valley: from a few
    starts, two at a time, until two have come to the same answer.
    """
    found = sorted(first, key=lambda candidate: candidate.cost)
    for pair in (STARTS[2:4], STARTS[4:]):
        if found[1].cost - found[0].cost < SAME_POLISH:
            break
        for answer in map(perform, [JointStart(data, priors, searched, *start) for start in pair]):
            found = sorted([*found, *finite([answer])], key=lambda candidate: candidate.cost)
            # of a map that has done both at once the second counts no more, as it does not where it would be done now
            if found[1].cost - found[0].cost < SAME_POLISH:
                break
    return found[0]


@dataclass(frozen=True, slots=True, eq=False)
class JointStart:
    """A first polish of all axes together, at first roughly and with the flange's motion alone; it answers with a `Candidate`.

    `searched`: one for each axis
    `coarse`: least model error of the rough polish
    `source`: axis whose joint and force it starts from; None is the mean over the axes
    """

    phase: ClassVar[Phase] = Phase.BOTH_AXES
    data: IdentificationData
    priors: Priors
    searched: list[AxisSearch]
    coarse: float
    source: int | None

    def run(self) -> Candidate:
        """Return the polished candidate."""
        data, priors = self.data, self.priors
        best = [s.candidates[0] for s in self.searched]
        shares, weight = learned_noise(self.searched)
        chosen = best if self.source is None else [best[self.source % len(best)]]
        layout = Layout(tuple(planes(c.layout).axes[0] for c in best), len(data.coefficient_spread))
        force = np.zeros(layout.coefficients)
        named = len(data.coefficients)
        force[:named] = np.mean([c.theta[c.layout.force][:named] for c in chosen], axis=0)
        force[data.rough_place] = data.rough_start
        joint = np.mean([c.theta[c.layout.joint] for c in chosen], axis=0)
        theta = np.concatenate([*(c.theta[c.layout.axis(0)] for c in best), joint, force])
        rough = Misfit(data.summed(), priors, tuple(max(f, self.coarse) for f in shares), weight)
        start = refine(rough, theta, layout, best[0].nuisance, 40, grid=32)
        return refine(Misfit(data, priors, shares, weight), *_start(data, start.candidate, False), 60).candidate


def learned_noise(searched: list[AxisSearch]) -> tuple[tuple[float, ...], FloatArray]:
    """Return the model error of each axis, and the cuts' weights, as the searches have learned them."""
    return tuple(s.model_error for s in searched), np.min([s.cut_weight for s in searched], axis=0)


def refine_and_learn_noise(
    misfit_of: Callable[[tuple[float, ...], FloatArray], Misfit],
    start: tuple[FloatArray, Unknowns, FloatArray],
    shares: tuple[float, ...],
    weight: FloatArray,
    report: Report,
    tolerance: float = 1e-5,
) -> tuple[Solution, Misfit]:
    """Polish and learn the noise in turns until it stays.

    `misfit_of`: the model error of each axis and the cuts' weights to a misfit
    `start`: (array, Unknowns, array); unknowns, their layout, the cuts' delays and angles
    `shares`: tuple of float [-], model error of each axis to begin with
    `weight`, shape (k,): factor on each cut's weights to begin with
    `report`: callable of (stage, cost, solution)
    `tolerance`: as in `refine`
    """
    theta, layout, nuisance = start
    for _ in range(4):
        misfit = misfit_of(shares, weight)
        found = refine(misfit, theta, layout, nuisance, 300, tolerance=tolerance)
        report(Stage.POLISH, found.cost, found)
        learned = model_error(found, misfit)
        if all(abs(a / b - 1.0) < 0.05 for a, b in zip(learned, shares, strict=True)):
            break
        theta, nuisance, shares, weight = found.theta, found.evaluation.nuisance, learned, cut_weights(found, misfit)
    return found, misfit


def _start(data: IdentificationData, found: Candidate, softening: bool) -> tuple[FloatArray, Layout, FloatArray]:
    """Return a vector with all that the data may tell, from one with less: what is new starts at nothing."""
    old = planes(found.layout)
    axes = tuple(
        replace(
            a,
            places=axis.places,
            softening=softening,
            warming=data.warmth.size > 0,
            standstill=data.stands_still and bool(np.any(axis.still)),
        )
        for a, axis in zip(old.axes, data.axes, strict=True)
    )
    layout = Layout(axes, len(data.coefficient_spread), data.clampings)
    parts = [pack(unpack(found.theta[old.axis(i)], old.axes[i]), axes[i]) for i in range(len(axes))]
    force = np.zeros(layout.coefficients)
    force[: old.coefficients] = found.theta[old.force]
    nuisance = found.nuisance
    angles = found.theta[old.clamping]
    if not old.clampings and layout.clampings:
        angles, nuisance = tooth_angles(data, nuisance)
    return np.concatenate([*parts, found.theta[old.joint], force, angles]), layout, nuisance


def tooth_angles(data: IdentificationData, nuisance: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return each clamping's tooth angle from delays fitted without it, and the delays in the tooth-passing period that it means."""
    angles, nuisance = np.zeros(data.clampings), nuisance.copy()
    period = data.cut_prior.tooth_period
    for c in range(data.clampings):
        of = data.clamping == c
        turned = (nuisance[of, 0] - data.edge[of, 0]) / period[of]
        pitch = period[of] * data.spindle_speed[of]
        mean = np.angle(np.mean(np.exp(2j * np.pi * turned))) / (2.0 * np.pi)
        angles[c] = mean * pitch[0]
        expected = data.edge[of, 0] + angles[c] / data.spindle_speed[of]
        nuisance[of, 0] += period[of] * np.round((expected - nuisance[of, 0]) / period[of])
    return angles, nuisance
