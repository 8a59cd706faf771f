"""From the last fit to the answer: machine, deviations, and what speaks against it."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np

from rcsa_ident.base.arrays import ComplexArray, FloatArray
from rcsa_ident.base.remarks import Remark
from rcsa_ident.cutting.force_directions import WORTH, gain_across, turned
from rcsa_ident.dynamics.coordinates import plane
from rcsa_ident.dynamics.modal import ModalModel
from rcsa_ident.identification.causes import Causes, causes
from rcsa_ident.identification.coupled.data import CoupledData
from rcsa_ident.identification.coupled.posterior import CoupledPosterior, CoupledUnknowns
from rcsa_ident.identification.coupled.score import Coupling
from rcsa_ident.identification.data import LEVER, IdentificationData
from rcsa_ident.identification.diagnostics import (
    because,
    deviation_of_tip,
    diagnose,
    learned,
    not_as_predicted,
    not_judged,
    remarks,
    two_solutions,
)
from rcsa_ident.identification.further_unknowns import GIVING_WAY, GRIP, GivingWay, Grips, Warming
from rcsa_ident.identification.joint_fit import AxisSearch
from rcsa_ident.identification.learned_changes import LearnedChanges
from rcsa_ident.identification.learned_unknowns import changes_learned
from rcsa_ident.identification.levenberg_marquardt import Solution
from rcsa_ident.identification.misfit import Misfit
from rcsa_ident.identification.model_order import evidence
from rcsa_ident.identification.posterior import Posterior, Warmed
from rcsa_ident.identification.result import AxisResult, Identification, IdentificationCode, MetTest, Standstill
from rcsa_ident.identification.status import Status
from rcsa_ident.identification.unknowns import JOINT, CoupledLayout, Layout, ModalBlock, parameter_names, planes, unpack
from rcsa_ident.identification.validation import Prediction, judged, predictions, validated, widening
from rcsa_ident.machine.flange_part import JointedFlange
from rcsa_ident.tool_holder.drawings import KnownToolings

#: Factor on the posterior's standard deviations for what no model of finitely many modes can tell of itself: on three virtual
#: machines drawn for development (`benchmarks.machines`), the errors' root mean square was that many deviations. Of both planes together,
#: on three coupled ones, it was 1.5; 1.7 makes the 90 % band hold as much.
#: With a stiffness that warms up, 90 % bands of 1.4 held 67 to 97 % on three machines (`benchmarks.ideals`, seeds 7101 to 7103).
WIDER, WIDER_TOGETHER, WIDER_WARMING = 1.4, 1.7, 2.1
#: Share of the largest motion above which it is told how much of it the other axis' force makes.
LARGE = 0.3
PLANES_NOT_ASKED = (
    "with hammer tests, or accelerometers on the housing alone, X and Y are taken for planes that feel nothing of each other: that was "
    "not asked"
)
MOSTLY_PASSES = (
    "most of the lines are from passes whose speed changes: of fourteen virtual machines one came out wrong by 7 %, and its lines did not "
    "show it; some cuts that keep their speed beside them would confirm the answer"
)
HOUSING_LEFT_OUT = (
    "X and Y feel each other, and both together are fitted to the flange's motion alone: the accelerometers on the housing were not used"
)
#: Directions of modes that are turned less leave the planes apart [rad].
TURNED = np.radians(5.0)
NOT_TURNED = (
    "X and Y feel each other, but no mode is turned by 5 degrees out of them: cross-talk of the sensors and wrong forces look like that"
)
#: Toolings that contradict each other where the flange's sensors look elsewhere than at the flange.
ENOUGH_FOR_DISTANCE = 3
DISTANCE_UNTOLD = (
    "the distance of the sensors behind the flange is unknown: 15 mm make tips in another holder wrong by 2 % in the median, 14 % at "
    "worst, and two toolings rarely show it; measure distance_behind_flange_mm with a ruler"
)
#: Places of the joint's stiffnesses among what is told of an axis.
_CLAMPED = np.array([-4, -3])
#: Said of a campaign whose cuts push the tool in like directions.
ANOTHER_FEED = "all cuts push the tool in like directions: cuts fed along Y beside those along X would about halve the uncertainty"


class Fit(ABC):
    """What the last fit has come to.

    A subclass holds `data` (all cuts), `solution`, `misfit` (whose minimum it is) and `rival`: what the evidence alone would have chosen.
    """

    data: IdentificationData
    solution: Solution
    misfit: Misfit
    rival: Solution
    #: With the cuts that judge the answer.
    whole: IdentificationData | None

    @property
    @abstractmethod
    def wider(self) -> float:
        """Factor on the standard deviations."""

    @abstractmethod
    def machines(self) -> dict[str, Any]:
        """Return the fields `axes` and, where both planes are one machine, `whole` of the answer."""

    @abstractmethod
    def doubts(self) -> tuple[list[Remark], list[Remark]]:
        """Return the reasons for `suspect` and the notes that belong to this kind of fit."""

    @property
    def rough_values(self) -> FloatArray:
        """What the drawings did not tell, shape (u,), in units of its spreads."""
        return np.asarray(self.solution.theta[self._rough_entries(self.solution)])

    def _rough_entries(self, solution: Solution) -> np.ndarray:
        """Places of that in a solution's vector."""
        place = self.data.rough_place
        return solution.layout.force.start + np.arange(place.start, place.stop)

    def _toolings(self) -> KnownToolings | None:
        """What is known of the toolings; None where their drawings are exact."""
        rough = self.data.rough
        if rough is None:
            return None
        own = self._rough_entries(self.solution)
        # wider bands do not make less known than was known before
        covariance = self.covariance[np.ix_(own, own)]
        return KnownToolings(rough.unknowns, rough.spread, self.rough_values, covariance, self.data.used_toolings)

    @cached_property
    def evidence(self) -> float:
        """Minus twice the log evidence [-]: less is better."""
        return evidence(self.solution, self.misfit)

    @cached_property
    def causes(self) -> Causes:
        """What may stand behind what the model leaves unexplained."""
        return causes(self.solution, self.misfit, self.wider)

    @cached_property
    def predictions(self) -> tuple[Prediction, ...]:
        """How the lines of each tooling are predicted by the other ones."""
        return (
            *predictions(self.solution, self.misfit, self.wider),
            *(() if self.whole is None else judged(self.solution, self.misfit, self.whole, self.wider)),
        )

    @cached_property
    def covariance(self) -> FloatArray:
        """Covariance of all unknowns, shape (p, p): wider where a cause acts that is not in the model, or a prediction fails."""
        return self.causes.mixed(self.of_the_noise) * widening(self.predictions) ** 2

    @cached_property
    def of_the_noise(self) -> FloatArray:
        """The same where the model holds, shape (p, p)."""
        found = self.wider**2 * np.linalg.inv(self.solution.evaluation.hessian)
        return 0.5 * (found + found.T)

    @cached_property
    def changes(self) -> LearnedChanges:
        """What was learned beyond the machine."""
        return changes_learned(self.data, self.solution, self.covariance)

    def answer(self, seed: int, method: str) -> Identification:
        """Return the answer, without its trace. `method`: its name in a result file."""
        data, solution, misfit = self.data, self.solution, self.misfit
        evaluation, force = solution.evaluation, solution.layout.force
        assert evaluation.linear is not None
        reasons, notes = self.doubts()
        reasons = [*because(self.causes), *reasons, *not_as_predicted(self.predictions)]
        if not validated(self.predictions):
            notes = [not_judged(self.predictions), *notes]
        if not data.distance_told and len(self._compared) < ENOUGH_FOR_DISTANCE:
            notes = [Remark(IdentificationCode.DISTANCE_UNTOLD, DISTANCE_UNTOLD), *notes]
        notes = [*learned(self.changes), *notes]
        if 2 * data.swept_cuts > data.cuts:
            reasons = [*reasons, Remark(IdentificationCode.MOSTLY_PASSES, MOSTLY_PASSES)]
        # wider bands do not make less known than was known before
        known = np.minimum(np.sqrt(np.diag(self.covariance)[force]), misfit.data.coefficient_spread)
        scales = zip(solution.theta[force].tolist(), known.tolist(), strict=True)
        return Identification(
            status=Status.SUSPECT if reasons else Status.CONVERGED if self._validated else Status.NOT_VALIDATED,
            reasons=tuple(reasons),
            seed=seed,
            method=method,
            predictions=self.predictions,
            **self.machines(),
            cut_ids=data.cut_ids[: data.cuts],
            delay=evaluation.nuisance[: data.cuts, 0],
            delay_std=evaluation.linear.delay_std(self.of_the_noise)[: data.cuts],
            spindle_speed=data.spindle_speed[: data.cuts],
            trace=(),
            notes=tuple(notes),
            # the smooth errors stand behind them, unnamed
            coefficients=dict(zip(data.coefficients, scales, strict=False)),
            toolings=self._toolings(),
            changes=self.changes,
        )

    @property
    def _validated(self) -> bool:
        """Whether the toolings predict each other, and could not do so with sensors that look elsewhere: two always find modes for that."""
        return validated(self.predictions) and (self.data.distance_told or len(self._compared) >= ENOUGH_FOR_DISTANCE)

    @property
    def _compared(self) -> tuple[str, ...]:
        """Toolings that learn or judge."""
        return (self.data if self.whole is None else self.whole).used_toolings

    def _gain(self, k: int) -> tuple[float, float]:
        """Value and standard deviation of the gain of a hammer test, as a logarithm."""
        place = self.solution.layout.force.start + len(self.data.coefficients) + k
        return float(self.solution.theta[place]), float(np.sqrt(self.covariance[place, place]))

    def _still(self, i: int) -> Standstill | None:
        """What standing still changes in an axis, where cuts and tests at standstill tell it."""
        if not self.data.stands_still:
            return None
        layout = planes(self.solution.layout)
        places = layout.axis(i).start + np.arange(layout.axes[i].size)[layout.axes[i].parts["standstill"]]
        if not places.size:
            return None
        values, deviations = self.solution.theta[places].tolist(), np.sqrt(np.diag(self.covariance)[places]).tolist()
        return Standstill(values[0], deviations[0], values[1], deviations[1])

    def _tests(self, i: int) -> tuple[MetTest, ...]:
        """How the hammer tests of an axis were met."""
        data, misfit, evaluation = self.data, self.misfit, self.solution.evaluation
        axis = misfit.data.axes[i]
        rest = evaluation.residual.lines[i]
        half = rest.size // 2
        found = []
        for k, test in enumerate(data.tests):
            own = np.flatnonzero(axis.cut == data.cuts + k)
            if not own.size:
                continue
            gain, std = self._gain(k)
            squares = (rest[own] ** 2 + rest[half + own] ** 2) / misfit.cut_weight[data.cuts + k]
            model = np.sum(evaluation.models[i], axis=1)[own] * np.exp(-1j * axis.omega[own] * evaluation.nuisance[data.cuts + k, 0])
            found.append(MetTest(test, model, float(np.exp(gain)), float(np.exp(gain)) * std, float(squares.mean() / 2.0)))
        return tuple(found)

    def _axis(self, i: int, **machine: Any) -> AxisResult:
        """The answer of one axis: its machine as it is given, and how its lines were met."""
        data, misfit, solution = self.misfit.data, self.misfit, self.solution
        axis = data.axes[i]
        rest = solution.evaluation.residual.lines[i]
        half = rest.size // 2
        squares = (rest[:half] ** 2 + rest[half:] ** 2).reshape(-1, axis.outputs).mean(axis=1)
        tooling = data.cut_tooling[axis.cut]
        per_tooling = {name: float(squares[tooling == t].mean() / 2.0) for t, name in enumerate(data.toolings) if np.any(tooling == t)}
        measured = misfit.without_delay(i, solution.theta, solution.layout, solution.evaluation.nuisance)
        response = np.abs(measured) ** 2
        lines = {
            "omega": axis.omega,
            "value": measured,
            "model": np.sum(solution.evaluation.models[i][:, axis.searched], axis=1),
            "tooling": tooling,
            "cut": axis.cut,
            "coherence": response / np.maximum(response + 2.0 * axis.noise, 1e-300),
        }
        return AxisResult(
            chi2_per_point=float(squares.mean() / 2.0),
            per_tooling=per_tooling,
            model_error=misfit.model_error[i],
            measured={name: values[axis.cut < data.cuts] for name, values in lines.items()} if data.tests else lines,
            tests=self._tests(i),
            standstill=self._still(i),
            **machine,
        )


@dataclass(frozen=True, eq=False)
class PlaneFit(Fit):
    """Each axis with its own machine.

    `searched`: one for each axis
    `deferred`: whether a cause explains what the planes seem to feel of each other, so that this was not asked
    """

    data: IdentificationData
    searched: list[AxisSearch]
    solution: Solution
    misfit: Misfit
    rival: Solution
    whole: IdentificationData | None = None
    deferred: bool = False

    @property
    def wider(self) -> float:
        """Factor on the standard deviations."""
        return WIDER_WARMING if self.data.warmth.size else WIDER

    def machines(self) -> dict[str, Any]:
        """Return each axis with its posterior."""
        axes = {}
        for i, axis in enumerate(self.data.axes):
            modes, joint = self.posteriors[i].machine(axis.axis)
            names = parameter_names(self.posteriors[i].layout)
            axes[axis.axis] = self._axis(i, modes=modes, joint=joint, parameters=names, posterior=self.posteriors[i])
        return {"axes": axes}

    @cached_property
    def posteriors(self) -> list[Posterior]:
        """What is known of each axis and of the joint."""
        # whoever clamps a tooling clamps it anew, and a tap moves it less than any cut
        spreads = [{Grips: GRIP, GivingWay: GIVING_WAY}.get(type(each), 0.0) for each in self.data.further]
        return self._posteriors(self.covariance, float(np.hypot.reduce(spreads, initial=0.0)))

    def _posteriors(self, whole: FloatArray, clamping: float = 0.0) -> list[Posterior]:
        layout, others = planes(self.solution.layout), planes(self.rival.layout)
        found = []
        for i in range(len(self.data.axes)):
            told, own = _told(layout, i, self.data.steady)
            other = _told(others, i, self.data.steady)[0] @ self.rival.theta
            covariance = told @ whole @ told.T
            covariance[np.ix_(_CLAMPED, _CLAMPED)] += clamping**2
            toolings = {}
            if self.data.rough is not None:
                rough = self._rough_entries(self.solution)
                toolings = {
                    "tooling_cross": told @ whole[:, rough],
                    "tooling_covariance": whole[np.ix_(rough, rough)],
                    "rival_toolings": (self.rival.theta[self._rough_entries(self.rival)] - self.rough_values,),
                }
            more = self._warmed(i, told, whole)
            found.append(Posterior(told @ self.solution.theta, covariance, own, self.data.speed_range, (other,), **toolings, warmed=more))
        return found

    def _warmed(self, i: int, told: FloatArray, whole: FloatArray) -> Warmed | None:
        """How an axis changes with what a thermometer shows."""
        if not any(isinstance(each, Warming) and each.time_constant is None for each in self.data.further):
            return None
        own, rival = (_of_warming(planes(each.layout), i) for each in (self.solution, self.rival))
        block = planes(self.rival.layout).axes[i]
        other = self.rival.theta[rival] if block.warming else np.zeros(block.pairs)
        return Warmed(self.solution.theta[own], told @ whole[:, own], whole[np.ix_(own, own)], (other,))

    def doubts(self) -> tuple[list[Remark], list[Remark]]:
        """Return the reasons for `suspect` and the notes."""
        data = self.data
        # further or quieter cuts help against noise alone
        known = self._posteriors(self.of_the_noise)
        bands = [deviation_of_tip(posterior, axis) for posterior, axis in zip(known, data.axes, strict=True)]
        reasons = diagnose(data, self.solution, self.misfit, bands, two_solutions(data, self.searched))
        pairs = zip(data.axes, self.posteriors, strict=True)
        natural = {str(axis.axis).upper(): posterior.machine(axis.axis)[0].omega_n for axis, posterior in pairs}
        found = remarks(data, self.solution, self.misfit, self.covariance, natural)
        if (data.tests or not data.of_flange) and len(data.axes) > 1:
            found.append(Remark(IdentificationCode.PLANES_NOT_ASKED, PLANES_NOT_ASKED))
        return reasons, found


def _of_warming(layout: Layout, i: int) -> np.ndarray:
    """Places of what an axis changes by as it warms up."""
    block = layout.axes[i]
    return layout.axis(i).start + np.arange(block.size)[block.parts["warming"]]


def _told(layout: Layout, i: int, steady: float) -> tuple[FloatArray, ModalBlock]:
    """What is told of an axis' flange and the joint, linear in the vector, shape (p, size), and its layout.

    A warm machine is the warmer the faster it turns, by `steady` from the middle of the speeds to their end.
    """
    block = layout.axes[i]
    warms = block.warming and steady != 0.0
    own = replace(block, places=0, standstill=False, warming=False, softening=block.softening or warms)
    found, start = np.zeros((own.size + JOINT, layout.size)), layout.axis(i).start
    found[np.arange(block.machine.size), start + block.machine] = 1.0
    found[-JOINT:, layout.joint] = np.eye(JOINT)
    if warms:
        found[own.parts["softening"], start + np.arange(block.size)[block.parts["warming"]]] += steady * np.eye(block.pairs)
    return found, own


@dataclass(frozen=True, eq=False)
class CoupledFit(Fit):
    """Both planes as one machine.

    `coupling`: what spoke against planes that feel nothing of each other
    `freed_of`: what was learned of the lines before, and taken from them
    """

    data: IdentificationData
    points: CoupledData
    coupling: Coupling
    solution: Solution
    misfit: Misfit
    rival: Solution
    whole: IdentificationData | None = None
    freed_of: LearnedChanges = field(default_factory=LearnedChanges)

    @property
    def wider(self) -> float:
        """Factor on the standard deviations."""
        return WIDER_TOGETHER

    def machines(self) -> dict[str, Any]:
        """Return both planes as one machine, and each at standstill without the other."""
        standing, joint = self.posterior.best.standing(), self.posterior.best.joint
        axes = {}
        for i, axis in enumerate(self.data.axes):
            own = slice(2 * i, 2 * i + 2)
            modes = ModalModel(
                standing.omega_n, standing.zeta, standing.phi[:, own], standing.residual[own, own], plane("flange", axis.axis)
            )
            axes[axis.axis] = self._axis(i, modes=modes, joint=joint, parameters=(), posterior=None)
        return {"axes": axes, "whole": self.posterior}

    @cached_property
    def posterior(self) -> CoupledPosterior:
        """What is known of both planes and of the joint."""
        return self._posterior(self.covariance)

    def _posterior(self, whole: FloatArray) -> CoupledPosterior:
        layout = _coupled(self.solution)
        entries = np.r_[layout.block.machine, layout.joint]
        return CoupledPosterior(_unknowns(self.solution), whole[np.ix_(entries, entries)], self.data.speed_range, (_unknowns(self.rival),))

    def doubts(self) -> tuple[list[Remark], list[Remark]]:
        """Return the reasons for `suspect` and the notes, first of them how much the planes feel each other."""
        value, changes = self._posterior(self.of_the_noise).part(None).response(self._contribution)
        assert changes is not None
        bands = [float(np.linalg.norm(changes[:, :, i, i]) / max(float(np.linalg.norm(value[:, i, i])), 1e-300)) for i in range(2)]
        reasons = diagnose(self.data, self.solution, self.misfit, bands)
        natural = {"X and Y": self.posterior.best.standing().omega_n}
        found = remarks(self.data, self.solution, self.misfit, self.covariance, natural)
        told = [Remark(IdentificationCode.PLANES_COUPLED, self._in_words(value))]
        if _coupled(self.solution).turning == 0 and self._turned() < TURNED:
            told.append(Remark(IdentificationCode.NOT_TURNED, NOT_TURNED))
        if self.data.beside:
            told.append(Remark(IdentificationCode.HOUSING_LEFT_OUT, HOUSING_LEFT_OUT))
        if self._gain_of_another_feed() > WORTH:
            told.append(Remark(IdentificationCode.ONE_FEED, ANOTHER_FEED))
        return reasons, [*told, *found]

    @property
    def changes(self) -> LearnedChanges:
        """What was learned before."""
        return self.freed_of

    def _turned(self) -> float:
        """By how much the mode that is turned most is turned out of X and Y [rad]."""
        squares = unpack(self.solution.theta, _coupled(self.solution).block).psi ** 2
        x, y = squares[:, :2].sum(axis=1), squares[:, 2:].sum(axis=1)
        return float(np.arctan(np.sqrt(np.max(np.minimum(x, y) / np.maximum(np.maximum(x, y), 1e-300)))))

    def _gain_of_another_feed(self) -> float:
        """How much better both planes would be told apart if half of the cuts were fed at right angles."""
        points = self.points
        lines = [(points.omega[own], points.force[own]) for own in (np.flatnonzero(points.speed == s) for s in np.unique(points.speed))]
        return gain_across(lines, turned(lines))

    def _contribution(self, machine: JointedFlange) -> ComplexArray:
        """What a tip of the cut toolings feels of the machine, A12 (A22 + W)^-1 A21, shape (p, 2, 2)."""
        points, turning = self.points, _coupled(self.solution).turning
        scale = np.array([1.0, LEVER, 1.0, LEVER])
        tip = points.tip[turning]
        # A12 of a tool-holder that turns is A21 of one that turns the other way, transposed
        back = points.tip[-turning].transpose(0, 2, 1)
        together = points.flange[turning] + np.outer(scale, scale) * machine.interface(points.omega)
        found: ComplexArray = back @ np.linalg.solve(together, tip)
        return found

    def _in_words(self, contribution: ComplexArray) -> str:
        """How strong the coupling is, where, and of which kind."""
        size = np.abs(contribution)
        shares = []
        for i, j in ((0, 1), (1, 0)):
            own = size[:, j, j]
            large = np.flatnonzero(own > LARGE * own.max())
            share = size[large, i, j] / own[large]
            shares.append((float(share.max()), float(self.points.omega[large[share.argmax()]])))
        (x_by_y, at_x), (y_by_x, at_y) = shares
        share, omega, force, moved = (x_by_y, at_x, "Y", "X") if x_by_y >= y_by_x else (y_by_x, at_y, "X", "Y")
        kinds = {
            0: "their principal directions lie out of X and Y",
            1: "the spindle's gyroscopic moments couple them, more so the faster it turns",
            -1: "gyroscopic moments couple them, and the spindle seems to turn the other way: a left-hand cutter, or X and Y exchanged",
        }
        return (
            f"X and Y feel each other: a force in {force} moves the tool in {moved} by up to {100.0 * share:.0f} % of what it moves it in "
            f"{force} (at {omega / (2.0 * np.pi):.0f} Hz): {kinds[_coupled(self.solution).turning]}; everything computed with this machine "
            "takes it into account"
        )


def _coupled(solution: Solution) -> CoupledLayout:
    assert isinstance(solution.layout, CoupledLayout)
    return solution.layout


def _unknowns(solution: Solution) -> CoupledUnknowns:
    layout = _coupled(solution)
    return CoupledUnknowns(solution.theta[np.r_[layout.block.machine, layout.joint]], layout.flange)
