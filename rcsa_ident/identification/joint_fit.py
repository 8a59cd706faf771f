"""The last polish: both axes with one joint and one delay per cut, gap and fixture apart, forces uncertain, speed if it matters."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from rcsa_ident.arrays import FloatArray
from rcsa_ident.identification.data import IdentificationData
from rcsa_ident.identification.levenberg_marquardt import Solution, refine
from rcsa_ident.identification.misfit import Misfit
from rcsa_ident.identification.model_order import Report, cut_weights, evidence, exchange_modes, grow_modes, model_error
from rcsa_ident.identification.parameters import Layout, pack, unpack
from rcsa_ident.identification.priors import Priors

Map = Callable[[Callable[[Any], Any], Iterable[Any]], Iterable[Any]]
#: Relative range of speeds below which nothing is asked about a change with speed.
LEAST_SPEED_RANGE = 0.05
#: Modes per axis beyond what the evidence asks for.
GROWN = 1
#: Least model error of a first polish of both axes together, and whose joint and force it starts from (None is their mean).
STARTS = ((0.005, None), (0.02, 0), (0.005, 1), (0.02, 1), (0.02, None))
#: Costs closer than this are one answer.
SAME_POLISH = 5.0
#: Evidences closer than this belong to one answer, with a mode more or less that hardly matters.
SAME_ANSWER = 60.0


@dataclass(frozen=True, slots=True, eq=False)
class AxisSearch:
    """What the search of one axis came to.

    Parameters
    ----------
    solutions : list of Solution
        By evidence, best first.
    evidences : list of float
    model_error : float
    cut_weight : array, shape (k,)
    trace : list of (axis, stage, cost)
    """

    solutions: list[Solution]
    evidences: list[float]
    model_error: float
    cut_weight: FloatArray
    trace: list[tuple[str, str, float]]

    @property
    def confirmed(self) -> bool:
        """Whether two independent starts have come to the same answer."""
        return len(self.evidences) > 1 and self.evidences[1] - self.evidences[0] < SAME_ANSWER

    def joined(self, other: AxisSearch) -> AxisSearch:
        """Return both searches' solutions in the order of their evidence; what was learned of the noise is the better one's."""
        better = self if self.evidences[0] <= other.evidences[0] else other
        solutions, evidences = [*self.solutions, *other.solutions], [*self.evidences, *other.evidences]
        order = sorted(range(len(solutions)), key=evidences.__getitem__)
        trace = [*self.trace, *other.trace]
        return AxisSearch([solutions[i] for i in order], [evidences[i] for i in order], better.model_error, better.cut_weight, trace)


def ranked(solutions: list[Solution], misfit: Misfit, trace: list[tuple[str, str, float]]) -> AxisSearch:
    """Return solutions of one axis by their evidence."""
    values = [evidence(s, misfit) for s in solutions]
    order = sorted(range(len(solutions)), key=values.__getitem__)
    return AxisSearch([solutions[i] for i in order], [values[i] for i in order], misfit.model_error[0], misfit.cut_weight, trace)


def fit_jointly(
    data: IdentificationData, priors: Priors, searched: list[AxisSearch], report: Report, map: Map = map
) -> tuple[Solution, Misfit, Solution]:
    """Return the solution of all axes together, the misfit whose minimum it is, and what the evidence alone would have chosen.

    Parameters
    ----------
    data : IdentificationData
        With both outputs, where they were recorded.
    searched : list of AxisSearch
        One for each axis.
    report : callable
    map : callable
        The builtin, or a pool's.
    """
    found, misfit = _settled(data, priors, _together(data, priors, searched, map), *_noise(searched), report)
    middle, half = data.speed_range
    if half > LEAST_SPEED_RANGE * middle:
        moving, other = _settled(data, priors, _start(data, found, True), misfit.model_error, misfit.cut_weight, report)
        if evidence(moving, other) < evidence(found, misfit):
            found, misfit = moving, other
    omega = np.concatenate([a.omega for a in data.axes])
    band = float(omega.min() / (2.0 * np.pi)), float(omega.max() / (2.0 * np.pi))

    found = exchange_modes(found, misfit, band, report, rounds=2)
    chosen = found
    for _ in range(GROWN):
        found = grow_modes(found, misfit, band)
        report("grow", found.cost, found)
    return *_settled(data, priors, found, misfit.model_error, misfit.cut_weight, report), chosen


def _together(data: IdentificationData, priors: Priors, searched: list[AxisSearch], map: Map) -> Solution:
    """Return the axes' answers polished together with one joint and one force.

    Where each axis has found its own joint and its own force, what lies between them may end in another valley: from a few
    starts, until two have come to the same answer.
    """
    jobs = [(data, priors, searched, start) for start in STARTS]
    found = list(map(_from_start, jobs[:2]))
    for job in jobs[2:]:
        found.sort(key=lambda s: s.cost)
        if found[1].cost - found[0].cost < SAME_POLISH:
            break
        found.append(_from_start(job))
    return min(found, key=lambda s: s.cost)


def _from_start(job: tuple[IdentificationData, Priors, list[AxisSearch], tuple[float, int | None]]) -> Solution:
    """Polish all axes together, first roughly and with the flange's motion alone; joint and force are those of one axis or their mean."""
    data, priors, searched, (coarse, source) = job
    best = [s.solutions[0] for s in searched]
    shares, weight = _noise(searched)
    chosen = best if source is None else [best[source % len(best)]]
    layout = Layout(tuple(s.layout.axes[0] for s in best), len(data.coefficient_spread))
    force = np.zeros(layout.coefficients)
    named = len(data.coefficients)
    force[:named] = np.mean([s.theta[s.layout.force][:named] for s in chosen], axis=0)
    joint = np.mean([s.theta[s.layout.joint] for s in chosen], axis=0)
    theta = np.concatenate([*(s.theta[s.layout.axis(0)] for s in best), joint, force])
    rough = Misfit(data.summed(), priors, tuple(max(f, coarse) for f in shares), weight)
    start = refine(rough, theta, layout, best[0].evaluation.nuisance, 40, grid=32)
    return refine(Misfit(data, priors, shares, weight), *_start(data, start, False), 60)


def _noise(searched: list[AxisSearch]) -> tuple[tuple[float, ...], FloatArray]:
    """Model error of each axis, and the cuts' weights, as the searches have learned them."""
    return tuple(s.model_error for s in searched), np.min([s.cut_weight for s in searched], axis=0)


def _settled(
    data: IdentificationData,
    priors: Priors,
    start: Solution | tuple[FloatArray, Layout, FloatArray],
    shares: tuple[float, ...],
    weight: FloatArray,
    report: Report,
) -> tuple[Solution, Misfit]:
    """Polish and learn the noise in turns until it stays."""
    theta, layout, nuisance = (start.theta, start.layout, start.evaluation.nuisance) if isinstance(start, Solution) else start
    for _ in range(4):
        misfit = Misfit(data, priors, shares, weight)
        found = refine(misfit, theta, layout, nuisance, 300, tolerance=1e-5)
        report("polish", found.cost, found)
        learned = model_error(found, misfit)
        if all(abs(a / b - 1.0) < 0.05 for a, b in zip(learned, shares, strict=True)):
            break
        theta, nuisance, shares, weight = found.theta, found.evaluation.nuisance, learned, cut_weights(found, misfit)
    return found, misfit


def _start(data: IdentificationData, found: Solution, softening: bool) -> tuple[FloatArray, Layout, FloatArray]:
    """Return a vector with all that the data may tell, from one with less: what is new starts at nothing."""
    old = found.layout
    axes = tuple(replace(a, fixture=axis.outputs == 2, softening=softening) for a, axis in zip(old.axes, data.axes, strict=True))
    layout = Layout(axes, len(data.coefficient_spread), data.clampings)
    parts = [pack(unpack(found.theta[old.axis(i)], old.axes[i]), axes[i]) for i in range(len(axes))]
    force = np.zeros(layout.coefficients)
    force[: old.coefficients] = found.theta[old.force]
    nuisance = found.evaluation.nuisance
    angles = found.theta[old.clamping]
    if not old.clampings and layout.clampings:
        angles, nuisance = _tooth_angles(data, nuisance)
    return np.concatenate([*parts, found.theta[old.joint], force, angles]), layout, nuisance


def _tooth_angles(data: IdentificationData, nuisance: FloatArray) -> tuple[FloatArray, FloatArray]:
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
