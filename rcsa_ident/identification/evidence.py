"""The default method: explore, refine from coarse to fine noise, drop and exchange modes by evidence, polish both axes."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from rcsa_ident.arrays import FloatArray
from rcsa_ident.dynamics.coordinates import Dof
from rcsa_ident.identification.data import IdentificationData
from rcsa_ident.identification.diagnostics import diagnose, remarks
from rcsa_ident.identification.joint_fit import AxisSearch, Map, fit_jointly, ranked
from rcsa_ident.identification.levenberg_marquardt import Solution, refine
from rcsa_ident.identification.misfit import Misfit
from rcsa_ident.identification.model_order import GIVE_UP_SOON, Report, cut_weights, drop_modes, exchange_modes, model_error
from rcsa_ident.identification.parameters import JOINT, AxisLayout, Layout, pack, parameter_names, unpack
from rcsa_ident.identification.posterior import Posterior
from rcsa_ident.identification.priors import Priors
from rcsa_ident.identification.result import AxisResult, Identification, Status
from rcsa_ident.identification.search import SearchSettings, explore

#: Told of axis, stage, cost, unknowns and their layout.
Progress = Callable[[str, str, float, FloatArray, Layout], None]


#: Share of the lines by which force model, tool-holder or sensors may be wrong alike at neighbouring frequencies.
SMOOTH_ERROR = 2e-3
#: Factor on the posterior's standard deviations for what no model of finitely many modes can tell of itself: on three virtual
#: machines drawn for development (`benchmarks.machines`), the errors' root mean square was that many deviations.
WIDER = 1.4
#: Searches from new starts, until one axis has come to the same answer twice.
ATTEMPTS = 3


@dataclass(frozen=True, slots=True)
class EvidenceSelection:
    """Variance-weighted misfit with delays profiled per cut; passive by construction; the data choose the number of modes.

    Parameters
    ----------
    priors : Priors
    search : SearchSettings
    coarse : tuple of float
        Model errors of the stages before the data's own: they smooth the landscape.
    candidates : int
        Members of the population that are refined and compared.
    start : mapping of Dof to Posterior, optional
        An earlier answer of the same machine: with it nothing is explored, its modes are refined with the new cuts.
    """

    priors: Priors = field(default_factory=Priors)
    search: SearchSettings = field(default_factory=SearchSettings)
    coarse: tuple[float, float] = (0.3, 0.05)
    candidates: int = 3
    start: Mapping[Dof, Posterior] | None = None

    @property
    def name(self) -> str:
        """As in a result file."""
        return "default"

    def run(self, data: IdentificationData, seed: int, map: Map = map, progress: Progress | None = None) -> Identification:
        """Return the identification.

        Parameters
        ----------
        data : IdentificationData
        seed : int
            Same seed, same answer, whatever `map` is.
        map : callable
            The builtin, or a pool's: axes are searched side by side.
        progress : callable of (axis, stage, cost, theta, layout), optional
            Told of every step; with a pool's map it has to be picklable.
        """
        sequence = np.random.SeedSequence(seed)
        summed = data.summed()
        parts = [summed.only(a.axis).with_smooth_errors(SMOOTH_ERROR) for a in data.axes]
        searched: list[AxisSearch] = []
        for _ in range(ATTEMPTS):
            jobs = [_Job(self, part, own, progress) for part, own in zip(parts, sequence.spawn(len(parts)), strict=True)]
            found = list(map(_search_axis, jobs))
            if len(found) == 2:
                found = list(map(_from_other_axis, [(job, *pair) for job, pair in zip(jobs, (found, found[::-1]), strict=True)]))
            searched = [a.joined(b) for a, b in zip(searched, found, strict=True)] if searched else found
            if self.start is not None or any(s.confirmed for s in searched):
                break
        return _result(self, data, searched, seed, map, progress)


@dataclass(frozen=True, slots=True, eq=False)
class _Job:
    """The search of one axis."""

    method: EvidenceSelection
    data: IdentificationData
    sequence: np.random.SeedSequence
    progress: Progress | None

    def reporter(self, trace: list[tuple[str, str, float]]) -> Report:
        return _reporter(str(self.data.axes[0].axis), trace, self.progress)


def _reporter(axis: str, trace: list[tuple[str, str, float]], progress: Progress | None) -> Report:
    def report(stage: str, cost: float, solution: Solution) -> None:
        trace.append((axis, stage, cost))
        if progress is not None:
            progress(axis, stage, cost, solution.theta, solution.layout)

    return report


def _search_axis(job: _Job) -> AxisSearch:
    method, data = job.method, job.data
    rng = np.random.default_rng(job.sequence)
    axis = data.axes[0]
    trace: list[tuple[str, str, float]] = []
    report = job.reporter(trace)
    band = float(axis.omega.min() / (2 * np.pi)), float(axis.omega.max() / (2 * np.pi))
    coarse, fine = method.coarse
    known = None if method.start is None else method.start.get(axis.axis)
    if known is None:
        population = explore(Misfit(data, method.priors, (coarse,)), method.search, band, rng, report)
        starts = [(s.theta, s.layout.axes[0], s.evaluation.nuisance) for s in population[: method.candidates]]
    else:
        # the last polish asks again whether the machine changes with speed
        plain = pack(unpack(known.theta[:-JOINT], known.layout))
        starts = [(np.concatenate([plain, known.theta[-JOINT:]]), AxisLayout(known.layout.modes), np.zeros((len(data.cut_ids), 2)))]
    misfit = Misfit(data, method.priors, (fine,))
    force = np.zeros(len(data.coefficient_spread))
    refined = []
    for theta, layout, nuisance in starts:
        theta = np.concatenate([theta, force])
        refined.append(refine(misfit, theta, Layout((layout,), force.size), nuisance, 60, grid=32))
        report("refine", refined[-1].cost, refined[-1])
    refined.sort(key=lambda s: s.cost)
    best = refined[0]
    for _ in range(4):
        share = model_error(best, misfit)
        misfit = Misfit(data, method.priors, share, cut_weights(best, misfit))
        best = refine(misfit, best.theta, best.layout, best.evaluation.nuisance, 60, tolerance=1e-3)
        report("learn noise", best.cost, best)
    best = exchange_modes(drop_modes(best, misfit, report), misfit, band, report)
    # with the right modes less is left unexplained than with the first ones
    misfit = Misfit(data, method.priors, model_error(best, misfit), cut_weights(best, misfit))
    best = refine(misfit, best.theta, best.layout, best.evaluation.nuisance, 100)
    report("learn noise", best.cost, best)
    return ranked([best], misfit, trace)


def _from_other_axis(job: tuple[_Job, AxisSearch, AxisSearch]) -> AxisSearch:
    """Start an axis once more from the other axis' answer: the same spindle, with somewhat other bearings and support."""
    own_job, own, other = job
    method, data = own_job.method, own_job.data
    trace = list(own.trace)
    report = own_job.reporter(trace)
    start = other.solutions[0]
    rough = Misfit(data, method.priors, (method.coarse[1],))
    misfit = Misfit(data, method.priors, (own.model_error,), own.cut_weight)
    found = refine(rough, start.theta, start.layout, start.evaluation.nuisance, 60, grid=32)
    found = drop_modes(refine(misfit, found.theta, found.layout, found.evaluation.nuisance, 100), misfit, give_up=GIVE_UP_SOON)
    report("from the other axis", found.cost, found)
    return ranked([*own.solutions, found], misfit, trace)


def _result(
    method: EvidenceSelection, data: IdentificationData, searched: list[AxisSearch], seed: int, map: Map, progress: Progress | None
) -> Identification:
    trace = [entry for s in searched for entry in s.trace]
    solution, misfit, chosen = fit_jointly(
        data.with_smooth_errors(SMOOTH_ERROR), method.priors, searched, _reporter("both", trace, progress), map
    )
    evaluation, force = solution.evaluation, solution.layout.force
    assert evaluation.linear is not None
    covariance = WIDER**2 * np.linalg.inv(evaluation.hessian)
    covariance = 0.5 * (covariance + covariance.T)
    axes = {axis.axis: _axis_result(i, data, misfit, solution, covariance, chosen) for i, axis in enumerate(data.axes)}
    reasons = diagnose(data, searched, solution, misfit, [p for p in (axis.posterior for axis in axes.values()) if p is not None])
    # wider bands do not make less known than was known before
    known = np.minimum(np.sqrt(np.diag(covariance)[force]), misfit.data.coefficient_spread)
    scales = zip(solution.theta[force].tolist(), known.tolist(), strict=True)
    return Identification(
        status=Status.SUSPECT if reasons else Status.CONVERGED,
        reasons=tuple(reasons),
        seed=seed,
        method=method.name,
        axes=axes,
        cut_ids=data.cut_ids,
        delay=evaluation.nuisance[:, 0],
        delay_std=evaluation.linear.delay_std(covariance),
        spindle_speed=data.spindle_speed,
        trace=tuple(trace),
        notes=tuple(remarks(data, solution, misfit, covariance)),
        # the smooth errors stand behind them, unnamed
        coefficients=dict(zip(data.coefficients, scales, strict=False)),
    )


def _axis_result(
    i: int, data: IdentificationData, misfit: Misfit, solution: Solution, covariance: np.ndarray, rival: Solution
) -> AxisResult:
    axis, layout = data.axes[i], solution.layout
    own = replace(layout.axes[i], fixture=False)
    entries = np.r_[layout.axis(i).start + layout.axes[i].machine, layout.joint]
    other = rival.theta[np.r_[rival.layout.axis(i).start + rival.layout.axes[i].machine, rival.layout.joint]]
    posterior = Posterior(solution.theta[entries], covariance[np.ix_(entries, entries)], own, data.speed_range, (other,))
    modes, joint = posterior.machine(axis.axis)
    rest = solution.evaluation.residual.lines[i]
    half = rest.size // 2
    squares = (rest[:half] ** 2 + rest[half:] ** 2).reshape(-1, axis.outputs).mean(axis=1)
    tooling = data.cut_tooling[axis.cut]
    per_tooling = {name: float(squares[tooling == t].mean() / 2.0) for t, name in enumerate(data.toolings) if np.any(tooling == t)}
    measured = misfit.without_delay(i, solution.evaluation.nuisance)
    response = np.abs(measured) ** 2
    return AxisResult(
        modes=modes,
        joint=joint,
        chi2_per_point=float(squares.mean() / 2.0),
        per_tooling=per_tooling,
        model_error=misfit.model_error[i],
        parameters=parameter_names(own),
        posterior=posterior,
        measured={
            "omega": axis.omega,
            "value": measured,
            "model": np.sum(solution.evaluation.models[i], axis=1),
            "tooling": tooling,
            "cut": axis.cut,
            "coherence": response / np.maximum(response + 2.0 * axis.noise, 1e-300),
        },
    )
