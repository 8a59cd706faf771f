"""The default method: explore, refine from coarse to fine noise, drop and exchange modes by evidence, polish both axes."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from rcsa_ident.arrays import ComplexArray, FloatArray
from rcsa_ident.coupling.joint import LumpedJoint
from rcsa_ident.dynamics.modal import ModalModel
from rcsa_ident.identification.data import IdentificationData
from rcsa_ident.identification.misfit import Misfit
from rcsa_ident.identification.order import drop_modes, evidence, exchange_modes, model_error
from rcsa_ident.identification.parameters import joint_of, modes_of, split, unpack
from rcsa_ident.identification.polish import Solution, polish
from rcsa_ident.identification.posterior import Posterior, spread
from rcsa_ident.identification.priors import Priors
from rcsa_ident.identification.result import AxisResult, Identification, Status
from rcsa_ident.identification.search import SearchSettings, explore, with_mode_below

Map = Callable[[Callable[[Any], Any], Iterable[Any]], Iterable[Any]]

#: Above this share of unexplained signal the force model or the recordings are wrong.
WORST_MODEL_ERROR = 0.02
#: Solutions whose evidence lies closer than this are told apart by chance only.
EVIDENCE_TIE = 6.0
FEWEST_CUTS = 8
#: Mean squared residual of a cut above which it contradicts the others.
WORST_CUT = 25.0
#: Half of the lines must carry at least this many times their noise (its amplitude's root mean square).
LEAST_SIGNAL = 3.0


@dataclass(frozen=True, slots=True)
class DefaultMethod:
    """Variance-weighted misfit with delays profiled per cut; passive by construction; the data choose the number of modes.

    Parameters
    ----------
    priors : Priors
    search : SearchSettings
    coarse : tuple of float
        Model errors of the stages before the data's own: they smooth the landscape.
    candidates : int
        Members of the population that are refined and compared.
    """

    priors: Priors = field(default_factory=Priors)
    search: SearchSettings = field(default_factory=SearchSettings)
    coarse: tuple[float, float] = (0.3, 0.05)
    candidates: int = 4

    @property
    def name(self) -> str:
        """As in a result file."""
        return "default"

    def run(self, data: IdentificationData, seed: int, map: Map = map) -> Identification:
        """Return the identification.

        Parameters
        ----------
        data : IdentificationData
        seed : int
            Same seed, same answer, whatever `map` is.
        map : callable
            The builtin, or a pool's: axes are searched side by side.
        """
        sequences = np.random.SeedSequence(seed).spawn(len(data.axes))
        jobs = [(self, data.only(a.axis), s) for a, s in zip(data.axes, sequences, strict=True)]
        searched = list(map(_search_axis, jobs))
        if len(searched) == 2:
            crossed = [(self, job[1], own, other) for job, own, other in zip(jobs, searched, searched[::-1], strict=True)]
            searched = list(map(_from_other_axis, crossed))
        return _finish(self, data, searched, seed)


@dataclass(frozen=True, slots=True, eq=False)
class _AxisSearch:
    solutions: list[Solution]  # by evidence, best first
    evidences: list[float]
    model_error: float
    trace: list[tuple[str, str, float]]


def _search_axis(job: tuple[DefaultMethod, IdentificationData, np.random.SeedSequence]) -> _AxisSearch:
    method, data, sequence = job
    rng = np.random.default_rng(sequence)
    axis = data.axes[0]
    trace: list[tuple[str, str, float]] = []

    def report(stage: str, cost: float) -> None:
        trace.append((str(axis.axis), stage, cost))

    band = float(axis.omega.min() / (2 * np.pi)), float(axis.omega.max() / (2 * np.pi))
    coarse, fine = method.coarse
    population = explore(Misfit(data, method.priors, (coarse,)), method.search, band, rng, report)
    misfit = Misfit(data, method.priors, (fine,))
    refined = []
    for member in population[: method.candidates]:
        found = polish(misfit, member.theta, member.orders, member.evaluation.nuisance, 60, grid=32)
        theta = with_mode_below(found.theta, found.orders[0], band[0])
        moved = polish(misfit, theta, found.orders, found.evaluation.nuisance, 60, grid=32)
        refined.append(min(found, moved, key=lambda s: s.cost))
        report("refine", refined[-1].cost)
    refined.sort(key=lambda s: s.cost)
    share = fine
    best = refined[0]
    for _ in range(4):
        share = model_error(best, misfit)[0]
        misfit = Misfit(data, method.priors, (share,))
        best = polish(misfit, best.theta, best.orders, best.evaluation.nuisance, 60, tolerance=1e-3)
        report("learn noise", best.cost)
    best = exchange_modes(drop_modes(best, misfit, report), misfit, band, report)
    # with the right modes less is left unexplained than with the first ones
    share = model_error(best, misfit)[0]
    misfit = Misfit(data, method.priors, (share,))
    best = polish(misfit, best.theta, best.orders, best.evaluation.nuisance, 100)
    report("learn noise", best.cost)
    return _ranked([best], misfit, share, trace)


def _ranked(solutions: list[Solution], misfit: Misfit, share: float, trace: list[tuple[str, str, float]]) -> _AxisSearch:
    values = [evidence(s, misfit) for s in solutions]
    order = sorted(range(len(solutions)), key=values.__getitem__)
    return _AxisSearch([solutions[i] for i in order], [values[i] for i in order], share, trace)


def _from_other_axis(job: tuple[DefaultMethod, IdentificationData, _AxisSearch, _AxisSearch]) -> _AxisSearch:
    """Start an axis once more from the other axis' answer: the same spindle, with somewhat other bearings and support."""
    method, data, own, other = job
    start = other.solutions[0]
    rough = Misfit(data, method.priors, (method.coarse[1],))
    misfit = Misfit(data, method.priors, (own.model_error,))
    found = polish(rough, start.theta, start.orders, start.evaluation.nuisance, 60, grid=32)
    found = drop_modes(polish(misfit, found.theta, found.orders, found.evaluation.nuisance, 100), misfit)
    trace = [*own.trace, (str(data.axes[0].axis), "from the other axis", found.cost)]
    return _ranked([*own.solutions, found], misfit, own.model_error, trace)


def _finish(method: DefaultMethod, data: IdentificationData, searched: list[_AxisSearch], seed: int) -> Identification:
    """Polish all axes together: one delay per cut, one joint."""
    trace = [entry for s in searched for entry in s.trace]
    orders = tuple(s.solutions[0].orders[0] for s in searched)
    parts = [split(s.solutions[0].theta, s.solutions[0].orders) for s in searched]
    theta = np.concatenate([*(p[0][0] for p in parts), np.mean([p[1] for p in parts], axis=0)])
    nuisance = searched[0].solutions[0].evaluation.nuisance
    shares = tuple(s.model_error for s in searched)
    solution = polish(Misfit(data, method.priors, tuple(max(f, 0.02) for f in shares)), theta, orders, nuisance, 40, grid=32)
    for _ in range(3):
        misfit = Misfit(data, method.priors, shares)
        solution = polish(misfit, solution.theta, orders, solution.evaluation.nuisance, 300, tolerance=1e-5)
        trace.append(("both", "polish", solution.cost))
        learned = model_error(solution, misfit)
        if all(abs(a / b - 1.0) < 0.05 for a, b in zip(learned, shares, strict=True)):
            break
        shares = learned
    covariance = np.linalg.inv(solution.evaluation.hessian)
    delay_std = misfit.delay_std(solution.evaluation.nuisance)
    axes = {}
    for i, axis in enumerate(data.axes):
        axes[axis.axis] = _axis_result(i, data, misfit, solution, covariance)
    reasons = _doubts(data, searched, solution, misfit)
    return Identification(
        status=Status.SUSPECT if reasons else Status.CONVERGED,
        reasons=tuple(reasons),
        seed=seed,
        method=method.name,
        axes=axes,
        cut_ids=data.cut_ids,
        delay=solution.evaluation.nuisance[:, 0],
        delay_std=delay_std,
        spindle_speed=data.spindle_speed,
        trace=tuple(trace),
    )


def _axis_result(i: int, data: IdentificationData, misfit: Misfit, solution: Solution, covariance: FloatArray) -> AxisResult:
    axis = data.axes[i]
    parts, joint = split(solution.theta, solution.orders)
    first = sum(p.size for p in parts[:i])
    entries = np.r_[first : first + parts[i].size, solution.theta.size - 4 : solution.theta.size]
    rest = solution.evaluation.residual.lines[i]
    squares = np.abs(rest) ** 2
    tooling = data.cut_tooling[axis.cut]
    per_tooling = {name: float(squares[tooling == t].mean() / 2.0) for t, name in enumerate(data.toolings) if np.any(tooling == t)}
    measured = misfit.without_delay(axis, solution.evaluation.nuisance)
    response = np.abs(measured) ** 2
    return AxisResult(
        modes=modes_of(unpack(parts[i], solution.orders[i]), axis.axis),
        joint=joint_of(joint),
        chi2_per_point=float(squares.mean() / 2.0),
        per_tooling=per_tooling,
        model_error=misfit.model_error[i],
        parameters=parameter_names(solution.orders[i]),
        covariance=covariance[np.ix_(entries, entries)],
        theta=solution.theta[entries],
        measured={
            "omega": axis.omega,
            "value": measured,
            "model": solution.evaluation.models[i],
            "tooling": tooling,
            "cut": axis.cut,
            "coherence": response / np.maximum(response + 2.0 * axis.variance, 1e-300),
        },
    )


def parameter_names(order: int) -> tuple[str, ...]:
    """Return the names of an axis' unknowns and the joint's, in the vector's order."""
    names = [f"log natural_frequency_rad_s[{n}]" for n in range(order)]
    names += [f"psi_{k}[{n}]" for n in range(order) for k in ("t", "lever*r")]
    for i in range(order):
        for j in range(i + 1):
            names.append(f"log damping_factor[{i},{i}]" if i == j else f"damping_factor[{i},{j}]")
    names += [f"residual_factor[{i},{j}]" for i, j in ((0, 0), (1, 0), (1, 1))]
    return (*names, "log joint.k_t", "log joint.k_r", "log joint.c_t", "log joint.c_r")


def _doubts(data: IdentificationData, searched: list[_AxisSearch], solution: Solution, misfit: Misfit) -> list[str]:
    """Every reason why the answer should not be believed at once, in words with numbers."""
    reasons = []
    if not solution.converged:
        reasons.append(f"not converged: the polish still gained after {solution.steps} steps")
    for axis in data.axes:
        noise = np.sqrt(2.0 * axis.variance)
        signal = float(np.median(np.abs(axis.measured) / np.where(noise > 0.0, noise, 1e-300)))
        if signal < LEAST_SIGNAL:
            reasons.append(f"{str(axis.axis).upper()}: half of the lines are below {signal:.2g} times their noise")
    for axis, share in zip(data.axes, misfit.model_error, strict=True):
        if share > WORST_MODEL_ERROR:
            reasons.append(
                f"{str(axis.axis).upper()}: {100 * share:.1f} % of each line stay unexplained (at most {100 * WORST_MODEL_ERROR:g} %): "
                "cutting coefficients, toolings, tooth count or sensor signs may be wrong, or the dynamics change with speed"
            )
    reasons += _contradicting_cuts(data, solution)
    for axis, found in zip(data.axes, searched, strict=True):
        if len(found.solutions) > 1 and found.evidences[1] - found.evidences[0] < EVIDENCE_TIE:
            difference, band = _difference(misfit.data.only(axis.axis), *found.solutions[:2])
            if difference > max(0.1, 3.0 * band):
                reasons.append(
                    f"{str(axis.axis).upper()}: two solutions of equal evidence differ by {100 * difference:.0f} % at the flange, "
                    f"more than their deviation of {100 * band:.0f} %"
                )
    if len(data.toolings) < 2:
        reasons.append("one tooling only: flange translation and slope can't be told apart; cut with a second, different holder")
    for t, name in enumerate(data.toolings):
        count = int(np.sum(data.cut_tooling == t))
        if count < FEWEST_CUTS:
            reasons.append(f"few cuts: {count} with {name}, at least {FEWEST_CUTS} are wanted")
    return reasons


def _contradicting_cuts(data: IdentificationData, solution: Solution) -> list[str]:
    squares, lines = np.zeros(len(data.cut_ids)), np.zeros(len(data.cut_ids))
    for axis, rest in zip(data.axes, solution.evaluation.residual.lines, strict=True):
        squares += np.bincount(axis.cut, np.abs(rest) ** 2, minlength=squares.size)
        lines += 2.0 * np.bincount(axis.cut, minlength=squares.size)
    worse = squares / np.maximum(lines, 1.0)
    named = [f"{data.cut_ids[k]} ({worse[k]:.0f} times its variance)" for k in np.argsort(-worse) if worse[k] > WORST_CUT]
    return [f"cuts that contradict the others: {', '.join(named[:5])}"] if named else []


def _difference(data: IdentificationData, one: Solution, two: Solution) -> tuple[float, float]:
    """Relative difference of the flange receptance of two solutions of an axis over the band, and the first one's deviation."""
    axis = data.axes[0].axis
    omega = np.linspace(data.axes[0].omega.min(), data.axes[0].omega.max(), 200)

    def flange(modes: ModalModel, joint: LumpedJoint) -> ComplexArray:
        return modes.receptance(omega).values[:, 0, 0]

    first, second = (Posterior(s.theta, np.linalg.inv(s.evaluation.hessian)) for s in (one, two))
    value, other = flange(*first.machine(axis)), flange(*second.machine(axis))
    size = np.linalg.norm(value)
    if size == 0.0:
        return 0.0, 0.0
    return float(np.linalg.norm(value - other) / size), float(np.linalg.norm(spread(first, axis, flange)) / size)
