"""The answer of an identification, and its story."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np

from rcsa_ident.base.arrays import ComplexArray, FloatArray
from rcsa_ident.base.errors import InputError
from rcsa_ident.base.remarks import Remark, RemarkCode, says
from rcsa_ident.base.shown import Shown
from rcsa_ident.coupling.joint import LumpedJoint
from rcsa_ident.cutting.coefficients import ForceLaw
from rcsa_ident.cutting.force import ForceCoefficient, ForceTerm
from rcsa_ident.dynamics.coordinates import Dof
from rcsa_ident.dynamics.modal import ModalModel
from rcsa_ident.identification.coupled.posterior import CoupledPosterior
from rcsa_ident.identification.hammer_lines import HammerLines
from rcsa_ident.identification.learned_changes import LearnedChanges
from rcsa_ident.identification.machine import IdentifiedMachine
from rcsa_ident.identification.posterior import MachineAxis, Posterior
from rcsa_ident.identification.progress import Step
from rcsa_ident.identification.status import Status
from rcsa_ident.identification.validation import Prediction
from rcsa_ident.machine.spindle import Spindle
from rcsa_ident.machine.workpiece_side import WorkpieceSide
from rcsa_ident.setup.cut import Workpiece
from rcsa_ident.signals.measurement import MAX_FREQUENCY
from rcsa_ident.signals.recording import Sensor
from rcsa_ident.tool_holder.drawings import KnownToolings
from rcsa_ident.tool_holder.learnt import LearnedValue


class IdentificationCode(RemarkCode):
    """What may be said of an identification: why it has failed, reasons for doubt, and what the data cannot tell."""

    NO_FINITE_FIT = "no-finite-fit"
    NOT_CONVERGED = "not-converged"
    WEAK_SIGNAL = "weak-signal"
    UNEXPLAINED = "unexplained"
    CONTRADICTING_CUTS = "contradicting-cuts"
    DRIFTS_WITH_TIME = "drifts-with-time"
    DRIFTS_WITH_TEMPERATURE = "drifts-with-temperature"
    CHANGES_WITH_SPEED = "changes-with-speed"
    FORCE_ORDERS = "force-orders"
    FORCE_SCALES = "force-scales"
    CLAMPED_ANEW = "clamped-anew"
    JOINT_GIVES_WAY = "joint-gives-way"
    SENSOR_DISTANCE = "sensor-distance"
    NOT_AS_PREDICTED = "not-as-predicted"
    DISTANCE_UNTOLD = "distance-untold"
    TWO_SOLUTIONS = "two-solutions"
    NO_AGREEMENT = "no-agreement"
    WIDE_POSTERIOR = "wide-posterior"
    ONE_TOOLING = "one-tooling"
    FEW_TOOLINGS = "few-toolings"
    FEW_CUTS = "few-cuts"
    LINES_MISSED = "lines-missed"
    NOT_PASSIVE = "not-passive"
    JOINT_UNKNOWN = "joint-unknown"
    NOT_JUDGED = "not-judged"
    MANY_MODES = "many-modes"
    NOT_TURNED = "not-turned"
    MODES_OUTSIDE_BAND = "modes-outside-band"
    COEFFICIENT_UNKNOWN = "coefficient-unknown"
    PLANES_COUPLED = "planes-coupled"
    ONE_AXIS = "one-axis"
    ONE_FEED = "one-feed-direction"
    HOUSING_ALONE = "housing-alone"
    HOUSING_LEFT_OUT = "housing-left-out"
    PLANES_NOT_ASKED = "planes-not-asked"
    DRAWINGS_EXACT = "drawings-exact"
    CUTS_WEIGHTED_DOWN = "cuts-weighted-down"
    MOSTLY_PASSES = "mostly-passes"
    WORKPIECE_SIDE = "workpiece-side"


@dataclass(frozen=True, slots=True, eq=False)
class MetTest:
    """How the answer meets one hammer test.

    `model` [m/N], shape (n,): at the test's lines, its gain and what standing still changes included
    `gain`, `gain_std` [-]: by which the test differs from the model, and its standard deviation
    `chi2_per_point` [-]: mean squared residual in standard deviations, before the test was given less weight
    """

    lines: HammerLines
    model: ComplexArray
    gain: float
    gain_std: float
    chi2_per_point: float

    @property
    def error(self) -> float:
        """Norm of the model's difference from the test, over the test's."""
        return float(np.linalg.norm(self.model - self.lines.value) / np.linalg.norm(self.lines.value))


class Standstill(NamedTuple):
    """By which shares a machine whose spindle stands still differs from one whose spindle turns, with their standard deviations.

    `frequency`, `frequency_std` [-]: of all natural frequencies
    `damping`, `damping_std` [-]: of all damping
    """

    frequency: float
    frequency_std: float
    damping: float
    damping_std: float


@dataclass(frozen=True, slots=True, eq=False)
class AxisResult:
    """What was found for one machine axis.

    `modes`: modes of machine and spindle at the flange: translation and slope
    `chi2_per_point` [-]: mean squared residual in standard deviations of noise and model error
    `per_tooling`: the same for each tooling by itself
    `model_error` [-]: share of each line that neither the model nor the records' noise explains, learned from the residuals
    `parameters`: names of the unknowns of flange and joint, in the posterior's order
    `posterior`: None where the method gives no covariance
    `measured`: mapping with arrays omega, value, model, cut (index), coherence. Lines without delay beside the model's: what a plot shows.
        The cuts' alone; empty arrays without cuts.
    `tests`: the axis' hammer tests
    `standstill`: where such tests at standstill stand beside cuts
    """

    modes: ModalModel
    joint: LumpedJoint
    chi2_per_point: float
    per_tooling: Mapping[str, float]
    model_error: float
    parameters: tuple[str, ...]
    posterior: Posterior | None
    measured: Mapping[str, FloatArray]
    tests: tuple[MetTest, ...] = ()
    standstill: Standstill | None = None

    @property
    def machine(self) -> MachineAxis:
        """This axis as a tip feels it."""
        return MachineAxis(Spindle(self.modes), self.joint, self.posterior)


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Identification(Shown):
    """Modes of machine and spindle, joint, delays; with status, statistics, seed.

    `reasons`: why it is suspect or has failed
    `notes`: what the data cannot tell, and what was done about single cuts
    `coefficients`: mapping of ForceCoefficient to (float, float); what was found of the forces' uncertain coefficients and its standard
        deviation: logarithms of scales, run-outs in units of the cutting model's reference
    `cut_ids`: tuple of str, length k
    `delay`, `delay_std` [s], shape (k,): tooth 1 stands at immersion 0 that much after the record's start
    `spindle_speed` [rad/s], shape (k,)
    `trace`: the search in order
    `campaign`: its name
    `workpiece`: that it cut
    `sensors`: that recorded it
    `whole`: where both planes had to be fitted together; `axes` then hold each plane at standstill, without the other one
    `toolings`: what the cuts told of toolings whose drawings are not exact
    `learned`: the same in the terms of the campaign's drawings
    `workpiece_side`: what accelerometers on table or workpiece showed
    `predictions`: how the lines of each tooling are predicted by the other ones
    `changes`: what was learned beyond the machine: warming, forces and joints that differ from what was told
    """

    status: Status
    reasons: tuple[Remark, ...]
    seed: int
    method: str
    axes: Mapping[Dof, AxisResult]
    cut_ids: tuple[str, ...]
    delay: FloatArray
    delay_std: FloatArray
    spindle_speed: FloatArray
    trace: tuple[Step, ...]
    notes: tuple[Remark, ...] = ()
    coefficients: Mapping[ForceCoefficient, tuple[float, float]] = field(default_factory=dict)
    campaign: str = ""
    workpiece: Workpiece | None = None
    sensors: tuple[Sensor, ...] = ()
    whole: CoupledPosterior | None = None
    toolings: KnownToolings | None = None
    learned: tuple[LearnedValue, ...] = ()
    workpiece_side: WorkpieceSide | None = None
    predictions: tuple[Prediction, ...] = ()
    changes: LearnedChanges = field(default_factory=LearnedChanges)

    @property
    def at_minimum(self) -> bool:
        """False where the search has failed, or still gained when its steps ran out: there is no answer to be used."""
        return self.status is not Status.FAILED and not says(self.reasons, IdentificationCode.NOT_CONVERGED)

    @property
    def band(self) -> tuple[float, float]:
        """Lowest and highest identified line [rad/s]; all that a recording may hold where the identification carries no lines."""
        omega = [axis.measured["omega"] for axis in self.axes.values() if "omega" in axis.measured]
        omega += [test.lines.omega for axis in self.axes.values() for test in axis.tests]
        omega = [each for each in omega if each.size]
        if not omega:
            return 0.0, 2.0 * np.pi * MAX_FREQUENCY
        return float(min(w.min() for w in omega)), float(max(w.max() for w in omega))

    @property
    def coupling(self) -> str:
        """How X and Y feel each other, in words; empty where they do not."""
        return next((note for note in self.notes if says([note], IdentificationCode.PLANES_COUPLED)), "")

    @property
    def machine(self) -> IdentifiedMachine:
        """The machine that was found: it takes any tooling. Raises `InputError` if the identification has failed: there is none."""
        if not self.axes:
            raise InputError("identification", f"{self.status}: {'; '.join(self.reasons)}", "one that found a machine")
        return IdentifiedMachine(
            {axis: part.machine for axis, part in self.axes.items()},
            self.band,
            status=self.status,
            reasons=self.reasons,
            identified_workpiece=workpiece_after(
                self.workpiece, {c.term: v for c, v in self.coefficients.items() if not c.tooling}, self.changes.law
            ),
            sensors=self.sensors,
            name=self.campaign,
            whole=self.whole,
            toolings=self.toolings,
            workpiece_side=self.workpiece_side,
            warming=self.changes.warming,
        )

    def __str__(self) -> str:
        modes = {str(axis): part.modes.omega_n.size for axis, part in self.axes.items()}
        tests = sum(len(part.tests) for part in self.axes.values())
        return in_words(str(self.status), len(self.cut_ids), modes, self.reasons, tests)


def workpiece_after(
    told: Workpiece | None, found: Mapping[ForceTerm, tuple[float, float]], law: ForceLaw | None = None
) -> Workpiece | None:
    """Return a campaign's workpiece whose coefficients are as well known as its cuts have left them.

    `found`: mapping of ForceTerm to (float, float) [-]; logarithms of the factors on what was told, and their standard deviations; what is
        not there is known as told
    `law`: of the force, as factors on it have shown it
    """
    if told is None:
        return None
    known = told.coefficients
    asked = ((ForceTerm.TANGENTIAL, known.tangential_spread), (ForceTerm.RATIO, known.ratio_spread))
    return replace(told, coefficients=known.after(*(found.get(term, (0.0, spread)) for term, spread in asked)), law=law)


def in_words(status: str, cuts: int, modes: Mapping[str, int], reasons: Sequence[str], tests: int = 0) -> str:
    """Return what an identification has come to: a line, and a second one where something speaks against it.

    `cuts`: that were used
    `modes`: mapping of axis to int, how many each has
    `reasons`: why it is not simply converged
    `tests`: hammer tests that were used
    """
    used = [f"{cuts} cuts"] * bool(cuts or not tests) + [f"{tests} hammer test{'s'[: tests != 1]}"] * bool(tests)
    line = ", ".join([status, *used, *(f"{axis.upper()} {count} mode{'s'[: count != 1]}" for axis, count in modes.items())])
    further = f" (and {len(reasons) - 1} more)" if len(reasons) > 1 else ""
    return f"{line}\n{reasons[0]}{further}" if reasons else line
