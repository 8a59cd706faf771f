"""The default method: explore, refine from coarse to fine noise, drop and exchange modes by evidence, polish both axes."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import ClassVar

import numpy as np

from rcsa_ident.base.arrays import FloatArray
from rcsa_ident.base.scaleout import Map
from rcsa_ident.dynamics.coordinates import Dof
from rcsa_ident.identification.assemble_result import CoupledFit, Fit, PlaneFit
from rcsa_ident.identification.candidate import Candidate
from rcsa_ident.identification.causes import BELIEVED, Cause, causes, further_unknowns
from rcsa_ident.identification.coupled.data import CoupledData, couplable, coupled_data
from rcsa_ident.identification.coupled.fit import coupled_starts, fit_coupled
from rcsa_ident.identification.coupled.misfit import CoupledMisfit
from rcsa_ident.identification.coupled.score import STRIKES, Coupling, coupling
from rcsa_ident.identification.data import SMOOTH_ERROR, IdentificationData
from rcsa_ident.identification.diagnostics import failed, not_finite
from rcsa_ident.identification.further_unknowns import Further, Warming
from rcsa_ident.identification.joint_fit import (
    AxisSearch,
    axis_search,
    first_starts,
    fit_jointly,
    fit_roughly,
    fit_with_places,
    grow_jointly,
    learned_noise,
)
from rcsa_ident.identification.levenberg_marquardt import Solution, refine
from rcsa_ident.identification.misfit import Misfit
from rcsa_ident.identification.model_order import (
    GIVE_UP_SOON,
    Report,
    cut_weights,
    drop_modes,
    evidence,
    exchange_modes,
    model_error,
)
from rcsa_ident.identification.posterior import PlaneUnknowns, Posterior
from rcsa_ident.identification.priors import Priors
from rcsa_ident.identification.progress import BOTH, Progress, Stage, Step
from rcsa_ident.identification.result import Identification
from rcsa_ident.identification.search import SearchSettings, explore
from rcsa_ident.identification.sweep_correction import start_without_further, unswept, without_further
from rcsa_ident.identification.task import Phase, finite, perform
from rcsa_ident.identification.unknowns import JOINT, Layout, ModalBlock, pack, planes, unpack

#: Searches from new starts, until one axis has come to the same answer twice.
ATTEMPTS = 3
#: Further searches among lines that were freed of their sweeps, until two have come to evidences as near as this.
FREED_ATTEMPTS, SAME = 3, 20.0
#: Further searches where drawings are rough, at the toolings of the best answer so far.
ROUGH_ATTEMPTS = 4
#: Courses of warmth that are tried, each about the one before.
COURSES = 4
#: Windows of a tooling's passes that are enough to find its modes; the polish takes all.
ENOUGH = 40
#: Score beyond which planes plainly feel each other once a stiffness that changes with speed is in the fit: 0 to 36 where they do not,
#: 55 and more where they do (no benchmark prints scores); and by how much the fit of both together has to be better to need no other:
#: exchanging and adding modes gains a few hundred, planes that feel each other thousands.
PLAIN, PLAIN_GAIN = 50.0, 1000.0
#: Share of what planes that feel each other would explain from which a cause is asked first. It was 1.3 and more on two machines with wrong
#: forces, a warming spindle and new clampings (7101 and 7102 of `benchmarks.ideals`), 0.3 on one whose planes feel each other alone; no
#: benchmark prints it.
LIKE_COUPLING = 0.6


@dataclass(frozen=True, slots=True)
class EvidenceSelection:
    """Variance-weighted misfit with delays profiled per cut; passive by construction; the data choose the number of modes.

    `coarse`: model errors of the stages before the data's own: they smooth the landscape
    `candidates`: members of the population that are refined and compared
    `start`: an earlier answer of the same machine: with it nothing is explored, its modes are refined with the new cuts
    """

    priors: Priors = field(default_factory=Priors)
    search: SearchSettings = field(default_factory=SearchSettings)
    coarse: tuple[float, float] = (0.3, 0.05)
    candidates: int = 3
    start: Mapping[Dof, Posterior | PlaneUnknowns] | None = None

    @property
    def name(self) -> str:
        """Name of the method in a result file."""
        return "default"

    def run(self, data: IdentificationData, seed: int, map: Map = map, progress: Progress | None = None) -> Identification:
        """Return the identification.

        `seed`: same seed, same answer, whatever `map` is
        `map`: the builtin, or a pool's: axes are searched side by side
        `progress`: told of every step; with a pool's map it has to be picklable
        """
        if not_finite(data):
            return failed(data, seed, self.name)
        told = data.softening_spread
        if told is not None and told != self.priors.softening:
            return replace(self, priors=replace(self.priors, softening=told)).run(data, seed, map, progress)
        whole, data = data, data.learned_from()
        try:
            sequence, trace, freed = np.random.SeedSequence(seed), list[Step](), data
            found = self._found(data, data, sequence, map, trace, progress)
            for _ in range(FREED_ATTEMPTS if data.sweeps else 0):
                # what the sweeps do looks like other modes: by an answer the lines are freed of it, and searched anew
                freed = unswept(data, self.priors, found.solution.theta, found.solution.layout)
                other = self._found(data, freed, sequence, map, trace, progress)
                # each on the lines that it has freed itself: on two machines wrong valleys were worse by hundreds and by thousands
                found, worse = sorted((found, other), key=lambda fit: fit.evidence)
                if worse.evidence - found.evidence < SAME:
                    break
            if data.rough is not None:
                found = self._agreed(data, found, sequence, map, trace, progress)
            if data.sweeps:
                found = self._asked(data, found, map, _report_to(BOTH, trace, progress))
            if whole is not data:
                assert isinstance(found, PlaneFit | CoupledFit)
                found = replace(found, whole=whole)
            if isinstance(found, PlaneFit) and not data.sweeps and not data.tests and data.rough is None:
                first, found = found, self._freed(found, whole, sequence, map, trace, progress)
                if found.data.further or first.deferred:
                    found = self._asked_of_the_rest(first, found, map, _report_to(BOTH, trace, progress))
            return replace(found.answer(seed, self.name), trace=tuple(trace))
        except (ArithmeticError, np.linalg.LinAlgError):
            return failed(data, seed, self.name)

    def _agreed(
        self,
        data: IdentificationData,
        first: Fit,
        sequence: np.random.SeedSequence,
        map: Map,
        trace: list[Step],
        progress: Progress | None,
    ) -> Fit:
        """Return the likeliest of several searches, at toolings that are ever nearer to the true ones, until two have come to one answer.

        Modes that were found at the drawn toolings mimic what is wrong with these.
        """
        found = [first]
        for _ in range(ROUGH_ATTEMPTS):
            at_answer = data.with_toolings_at(found[0].rough_values)
            found.append(self._found(at_answer, at_answer, sequence, map, trace, progress))
            found.sort(key=lambda fit: fit.evidence)
            if found[1].evidence - found[0].evidence < SAME:
                break
        return found[0]

    def _freed(
        self,
        found: PlaneFit,
        whole: IdentificationData,
        sequence: np.random.SeedSequence,
        map: Map,
        trace: list[Step],
        progress: Progress | None,
    ) -> PlaneFit:
        """Return the fit with what its lines ask for beyond it, cause by cause, each searched anew and kept where it is likelier.

        `whole`: with the cuts that judge the answer, which the causes act on, too
        """
        refused: set[Cause] = set()
        while True:
            asked = [each for each in found.causes.believed if each.cause not in refused]
            further = next(((each.cause, more) for each in asked if (more := further_unknowns(each, whole)) is not None), None)
            if further is None:
                return found
            refused.add(further[0])
            try:
                other = self._with(further[1], whole, sequence, map, trace, progress)
            except (ArithmeticError, np.linalg.LinAlgError):
                continue
            if other is not None and other.evidence < found.evidence - BELIEVED:
                found, whole = other, other.data if other.whole is None else other.whole

    def _with(
        self,
        more: Further,
        whole: IdentificationData,
        sequence: np.random.SeedSequence,
        map: Map,
        trace: list[Step],
        progress: Progress | None,
    ) -> PlaneFit | None:
        """Return the fit with further unknowns, the likeliest where a course is linearised anew; None where planes are not apart."""
        best: PlaneFit | None = None
        for _ in range(COURSES):
            on_all = more.on(whole)
            data = on_all.learned_from()
            found = self._found(data, data, sequence, map, trace, progress)
            if not isinstance(found, PlaneFit):
                return best
            if best is not None and found.evidence > best.evidence:
                return best
            best = found if data is on_all else replace(found, whole=on_all)
            nearer = more.moved(found.solution.theta[found.solution.layout.force][data.course_place]) if isinstance(more, Warming) else None
            if nearer is None:
                return best
            more = nearer
        return best

    def _found(
        self,
        data: IdentificationData,
        freed: IdentificationData,
        sequence: np.random.SeedSequence,
        map: Map,
        trace: list[Step],
        progress: Progress | None,
    ) -> Fit:
        """Return the fit of a search; its steps come behind those of `trace`."""
        searched = self._search(freed, sequence, map, progress)
        trace += [step for search in searched for step in search.trace]
        return self._fit(data, freed, searched, map, _report_to(BOTH, trace, progress))

    def _search(self, data: IdentificationData, sequence: np.random.SeedSequence, map: Map, progress: Progress | None) -> list[AxisSearch]:
        """Return the search of each axis, again from new starts until one has come to the same answer twice.

        Where the lines leave side minima that neither axis can tell from its own, all starts are tried and the likeliest counts.
        """
        asked, data = _searched_cuts(data), data.as_drawn()
        summed = data.of_cuts(asked).summed() if asked.size < len(data.cut_ids) else data.summed()
        parts = [summed.only(a.axis).with_smooth_errors(SMOOTH_ERROR) for a in data.axes]
        searched: list[AxisSearch] = []
        for _ in range(ATTEMPTS):
            tasks = [SearchAxis(self, part, own, progress) for part, own in zip(parts, sequence.spawn(len(parts)), strict=True)]
            found = finite(map(perform, tasks))
            if not data.side_minima:
                found = self._from_each_other(parts, found, map, progress)
            searched = [a.joined(b) for a, b in zip(searched, found, strict=True)] if searched else found
            if self.start is not None or (not data.side_minima and any(s.confirmed for s in searched)):
                break
        if data.side_minima:
            searched = self._from_each_other(parts, searched, map, progress)
        return searched if asked.size == len(data.cut_ids) else [_of_all(search, asked, len(data.cut_ids)) for search in searched]

    def _from_each_other(
        self, parts: list[IdentificationData], found: list[AxisSearch], map: Map, progress: Progress | None
    ) -> list[AxisSearch]:
        """Return the search of each axis joined by one more from the other axis' answer, where there are two."""
        if len(found) != 2:
            return found
        both = zip(parts, found, found[::-1], strict=True)
        return finite(map(perform, [SearchFromOtherAxis(self, part, own, other, progress) for part, own, other in both]))

    def _fit(self, data: IdentificationData, freed: IdentificationData, searched: list[AxisSearch], map: Map, report: Report) -> Fit:
        """Return the fit of both axes: apart, or together where they feel each other.

        Where that is plain from the first, both are fitted together at once. Elsewhere it is asked after the last fit of both apart,
        and the evidence has the last word: a stiffness that changes with speed, a mode in the wrong place or one too few look like it.
        Lines of passes are freed of their sweeps ever better: as the searches took them, `freed`, then by each fit; whether their planes
        feel each other is asked of the last answer alone, as lines that still sweep may feign it.
        """
        if data.beside:
            return self._fit_with_places(data, freed, searched, map, report)
        smooth = freed.with_smooth_errors(SMOOTH_ERROR)
        first = first_starts(smooth, self.priors, searched, map)
        if data.sweeps:
            smooth = unswept(data, self.priors, first[0].theta, first[0].layout).with_smooth_errors(SMOOTH_ERROR)
        asked = couplable(smooth) and not data.sweeps and data.rough is None and not data.further
        points = coupled_data(smooth) if asked else None
        together: CoupledFit | None = None
        deferred = False
        if points is not None and self._felt(points, first[0], *learned_noise(searched)).score > PLAIN:
            apart, misfit = fit_roughly(smooth, self.priors, searched, first[0], report)
            felt = self._felt(points, apart.candidate, misfit.model_error, misfit.cut_weight)
            deferred = felt.score > PLAIN and _has_a_cause(felt, apart, misfit)
            if felt.score > PLAIN and not deferred:
                together = self._together(data, points, felt, searched, apart.candidate, misfit, map, report)
                if together.evidence < evidence(apart, misfit) - PLAIN_GAIN:
                    return together
        apart, misfit = fit_jointly(smooth, self.priors, searched, first, report, map)
        if data.sweeps:
            smooth = unswept(data, self.priors, apart.theta, apart.layout).with_smooth_errors(SMOOTH_ERROR)
        grown = grow_jointly(smooth, self.priors, apart, misfit, report)
        if points is not None and together is None:
            felt = self._felt(points, apart.candidate, misfit.model_error, misfit.cut_weight)
            deferred = felt.score > STRIKES and _has_a_cause(felt, *grown[:2])
            if felt.score > STRIKES and not deferred:
                together = self._together(data, points, felt, searched, apart.candidate, misfit, map, report)
        if together is not None and together.evidence < evidence(*grown[:2]):
            return together
        return PlaneFit(data, searched, *grown, deferred=deferred)

    def _fit_with_places(
        self, data: IdentificationData, freed: IdentificationData, searched: list[AxisSearch], map: Map, report: Report
    ) -> Fit:
        """Return the same where further places are among the outputs, from what the others have come to without them.

        Whether planes feel each other is decided by the flange's lines alone: evidences of different lines cannot be compared, and both
        planes together are fitted without further places.
        """
        fewer = self._fit(data.first(), freed.first(), searched, map, report)
        if isinstance(fewer, CoupledFit):
            return replace(fewer, data=data)
        assert isinstance(fewer, PlaneFit)
        smooth = freed.with_smooth_errors(SMOOTH_ERROR)
        chosen, misfit = fit_with_places(smooth, self.priors, fewer.rival, fewer.misfit, report)
        return PlaneFit(data, searched, *grow_jointly(smooth, self.priors, chosen, misfit, report), deferred=fewer.deferred)

    def _asked(self, data: IdentificationData, found: Fit, map: Map, report: Report) -> Fit:
        """Return the answer of passes, or that of both planes as one machine where they feel each other."""
        assert isinstance(found, PlaneFit)
        apart, misfit = found.solution, found.misfit
        smooth = unswept(data, self.priors, apart.theta, apart.layout).with_smooth_errors(SMOOTH_ERROR)
        if not couplable(smooth):
            return found
        together = self._as_one(data, apart, misfit.with_data(smooth, misfit.cut_weight), found.searched, map, report)
        return found if together is None else min(found, together, key=lambda fit: fit.evidence)

    def _asked_of_the_rest(self, first: PlaneFit, found: PlaneFit, map: Map, report: Report) -> Fit:
        """Return the answer with what its lines asked for, or that of both planes as one machine where the rest still asks for that.

        Both are compared among the flange's lines, freed of what was learned; and, where a cause has put off that question, among the
        lines as they were.

        `first`: the fit before anything was learned
        """
        if not couplable(found.data):
            return found
        freed = without_further(found.data, self.priors, found.solution)
        lines = freed.first()
        misfit = found.misfit.with_data(lines.with_smooth_errors(SMOOTH_ERROR), found.misfit.cut_weight)
        apart = refine(misfit, *start_without_further(found.data, found.solution, lines), 100)
        together = self._as_one(lines, apart, misfit, found.searched, map, report)
        if together is None:
            return found
        if found.data.further and first.deferred and not first.data.beside:
            other = self._as_one(first.data, first.solution, first.misfit, first.searched, map, report)
            if other is not None and other.evidence < found.evidence:
                return replace(other, whole=first.whole)
        if together.evidence > evidence(apart, misfit):
            return found
        whole = None if found.whole is None else without_further(found.whole, self.priors, found.solution)
        return replace(together, data=freed, whole=whole, freed_of=found.changes)

    def _as_one(
        self, data: IdentificationData, apart: Solution, misfit: Misfit, searched: list[AxisSearch], map: Map, report: Report
    ) -> CoupledFit | None:
        """Return the fit of both planes as one machine; None where the misfit's lines do not ask for it at the fit of planes apart."""
        points = coupled_data(misfit.data)
        felt = self._felt(points, apart.candidate, misfit.model_error, misfit.cut_weight)
        return self._together(data, points, felt, searched, apart.candidate, misfit, map, report) if felt.score > STRIKES else None

    def _felt(self, points: CoupledData, apart: Candidate, model_error: tuple[float, ...], weight: FloatArray) -> Coupling:
        """Return what the lines say against planes that feel nothing of each other, with the noise that was learned."""
        misfit = CoupledMisfit(points, self.priors, model_error, weight)
        return coupling(apart.theta, planes(apart.layout), apart.nuisance, misfit)

    def _together(
        self,
        data: IdentificationData,
        points: CoupledData,
        felt: Coupling,
        searched: list[AxisSearch],
        apart: Candidate,
        misfit: Misfit,
        map: Map,
        report: Report,
    ) -> CoupledFit:
        """Return the fit of both planes as one machine."""
        starts = coupled_starts(points, self.priors, searched, apart, misfit.cut_weight, map)
        return CoupledFit(data, points, felt, *fit_coupled(points, self.priors, starts[0], report))


def _has_a_cause(felt: Coupling, apart: Solution, misfit: Misfit) -> bool:
    """Whether a cause that can be learned explains so much of what the planes seem to feel of each other that it is asked first."""
    plausible = [each for each in causes(apart, misfit).believed if each.share > LIKE_COUPLING * felt.explained]
    return any(further_unknowns(each, misfit.data) is not None for each in plausible)


def _searched_cuts(data: IdentificationData) -> np.ndarray:
    """Indices of the cuts that searches look at: of many windows of passes every second, third, ... of each tooling."""
    keep = np.ones(len(data.cut_ids), dtype=bool)
    if data.sweeps:
        for tooling in range(len(data.toolings)):
            own = np.flatnonzero(data.cut_tooling[: data.cuts] == tooling)
            step = max(own.size // ENOUGH, 1)
            keep[own[np.arange(own.size) % step != step // 2]] = False
    return np.flatnonzero(keep)


def _of_all(search: AxisSearch, asked: np.ndarray, count: int) -> AxisSearch:
    """The search of some cuts as one of all: what was not asked starts where nothing is known of its delay and counts fully."""
    candidates = []
    for each in search.candidates:
        nuisance = np.zeros((count, 2))
        nuisance[asked] = each.nuisance
        candidates.append(replace(each, nuisance=nuisance))
    weight = np.ones(count)
    weight[asked] = search.cut_weight
    return replace(search, candidates=candidates, cut_weight=weight)


def _report_to(axis: str, trace: list[Step], progress: Progress | None) -> Report:
    """Return what keeps each stage of a search in its trace, and tells of it."""

    def report(stage: Stage, cost: float, solution: Solution) -> None:
        step = Step(axis, stage, cost, sum(solution.layout.modes_of_axes))
        trace.append(step)
        if progress is not None:
            progress(replace(step, candidate=solution.candidate))

    return report


@dataclass(frozen=True, slots=True, eq=False)
class SearchAxis:
    """The search of one axis, from random starts or from an earlier answer; it answers with an `AxisSearch`.

    `data`: of one axis, with one output
    """

    phase: ClassVar[Phase] = Phase.SEARCH
    method: EvidenceSelection
    data: IdentificationData
    sequence: np.random.SeedSequence
    progress: Progress | None

    def run(self) -> AxisSearch:
        """Explore, refine, learn the noise, and let the evidence choose the modes."""
        method, data, axis = self.method, self.data, self.data.axes[0]
        trace: list[Step] = []
        report = _report_to(str(axis.axis), trace, self.progress)
        band = float(axis.omega.min() / (2 * np.pi)), float(axis.omega.max() / (2 * np.pi))
        misfit = Misfit(data, method.priors, (method.coarse[1],))
        force = np.zeros(len(data.coefficient_spread))
        refined = []
        for theta, layout, nuisance in self._starts(band, report):
            theta = np.concatenate([theta, force])
            refined.append(refine(misfit, theta, Layout((layout,), force.size), nuisance, 60, grid=32))
            report(Stage.REFINE, refined[-1].cost, refined[-1])
        refined = sorted((s for s in refined if np.isfinite(s.cost)), key=lambda s: s.cost)
        if not refined:
            raise FloatingPointError("no start has a finite misfit")
        best = refined[0]
        for _ in range(4):
            share = model_error(best, misfit)
            misfit = Misfit(data, method.priors, share, cut_weights(best, misfit))
            best = refine(misfit, best.theta, best.layout, best.evaluation.nuisance, 60, tolerance=1e-3)
            report(Stage.NOISE, best.cost, best)
        best = exchange_modes(drop_modes(best, misfit, report), misfit, band, report)
        # with the right modes less is left unexplained than with the first ones
        misfit = Misfit(data, method.priors, model_error(best, misfit), cut_weights(best, misfit))
        best = refine(misfit, best.theta, best.layout, best.evaluation.nuisance, 100)
        report(Stage.NOISE, best.cost, best)
        return axis_search(best, misfit, trace)

    def _starts(self, band: tuple[float, float], report: Report) -> list[tuple[FloatArray, ModalBlock, FloatArray]]:
        """Unknowns of flange and joint, their layout, and the cuts' delays and angles: explored, or those of the earlier answer."""
        method, data = self.method, self.data
        known = None if method.start is None else method.start.get(data.axes[0].axis)
        if known is None:
            rng = np.random.default_rng(self.sequence)
            population = explore(Misfit(data, method.priors, (method.coarse[0],)), method.search, band, rng, report)
            return [(s.theta, planes(s.layout).axes[0], s.evaluation.nuisance) for s in population[: method.candidates]]
        # the last polish asks again whether the machine changes with speed
        machine, layout = unpack(known.theta[:-JOINT], known.layout), ModalBlock(known.layout.modes, data.axes[0].places)
        # a place that the earlier answer does not know moves about as the flange does
        like = replace(machine, places=machine.psi[:, :1], place_residual=np.zeros((1, 2)))
        return [(np.concatenate([pack(like, layout), known.theta[-JOINT:]]), layout, np.zeros((len(data.cut_ids), 2)))]


@dataclass(frozen=True, slots=True, eq=False)
class SearchFromOtherAxis:
    """One more search of an axis, from the other axis' answer: the same spindle, with somewhat other bearings and support.

    It answers with an `AxisSearch` of its own candidates and the new one.

    `data`: of one axis, with one output
    """

    phase: ClassVar[Phase] = Phase.OTHER_AXIS
    method: EvidenceSelection
    data: IdentificationData
    own: AxisSearch
    other: AxisSearch
    progress: Progress | None

    def run(self) -> AxisSearch:
        """Refine the other axis' answer, and drop the modes that this axis does not need."""
        method, data, own = self.method, self.data, self.own
        trace: list[Step] = []
        report = _report_to(str(data.axes[0].axis), trace, self.progress)
        rough = Misfit(data, method.priors, (method.coarse[1],))
        misfit = Misfit(data, method.priors, (own.model_error,), own.cut_weight)
        found = refine(rough, *self.other.candidates[0].point, 60, grid=32)
        found = drop_modes(refine(misfit, found.theta, found.layout, found.evaluation.nuisance, 100), misfit, give_up=GIVE_UP_SOON)
        report(Stage.OTHER_AXIS, found.cost, found)
        return own.joined(axis_search(found, misfit, trace))
