"""From one cut's recordings to points of the cross FRF, with everything that is uncertain about them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from rcsa_ident.arrays import ComplexArray, FloatArray
from rcsa_ident.cutting.coefficients import CuttingCoefficients
from rcsa_ident.cutting.conditions import CuttingConditions
from rcsa_ident.cutting.cutter import Cutter
from rcsa_ident.cutting.force import force_and_slope
from rcsa_ident.dynamics.coordinates import Dof
from rcsa_ident.errors import InputError, Unsteady
from rcsa_ident.signals.alignment import angle_to_air, trigger_delay
from rcsa_ident.signals.frf import Estimator, LineEstimator, turned_air
from rcsa_ident.signals.recording import Recording
from rcsa_ident.signals.steady import SteadyRecord, measured_axes, steady_record
from rcsa_ident.signals.verdict import Verdict, chatter, implausible, raw_faults, silence, speed_faults, tooth_count_fault

#: Highest line that is used [Hz].
MAX_FREQUENCY = 4300.0
#: Share of the largest force line below which a line says nothing.
WEAKEST_FORCE = 1e-3
#: An air cut may turn this much more slowly, and still needs the cut's highest line.
_AIR_BEYOND = 1.02
DEFAULT_ESTIMATOR = LineEstimator()
#: Note on a cut without an air cut.
NO_AIR = "no air cut: run-out and roundness of the flange remain in the lines at the tooth-passing harmonics"


@dataclass(frozen=True, slots=True, eq=False)
class AxisLines:
    """Lines of one axis at the tooth-passing harmonics of one cut.

    Parameters
    ----------
    order : array of int, shape (n,)
        Multiples of the spindle frequency.
    omega : array, shape (n,) [rad/s]
    cut, air : complex arrays, shape (n, o) [m/N]
        Displacement over the simulated force with tooth 1 at immersion 0 at the record's start; the air cut's line is turned
        by the best estimate of the angle between both records. Outputs are gap and fixture, whose sum is the flange's absolute
        motion, or that alone.
    variance : array, shape (n, o) [m^2/N^2]
        Of the real and of the imaginary part of cut - air each.
    coherence : array, shape (n,) [-]
        Of the flange's motion.
    force : complex array, shape (n,) [N]
    force_slope : complex array, shape (n, 5) [-]
        Change of the force's logarithm with `cutting.force.SLOPES`.
    """

    order: np.ndarray
    omega: FloatArray
    cut: ComplexArray
    air: ComplexArray
    variance: FloatArray
    coherence: FloatArray
    force: ComplexArray
    force_slope: ComplexArray

    @property
    def outputs(self) -> int:
        """1 or 2."""
        return self.cut.shape[1]

    @property
    def receptance(self) -> ComplexArray:
        """Flange displacement per tip force, up to the cut's delay, shape (n,): true value times e^{-i omega delay}."""
        return np.sum(self.cut - self.air, axis=1)

    def summed(self) -> AxisLines:
        """Return the lines with the flange's motion as the only output."""
        cut, air, variance = (np.sum(each, axis=1, keepdims=True) for each in (self.cut, self.air, self.variance))
        return replace(self, cut=cut, air=air, variance=variance)


@dataclass(frozen=True, slots=True, eq=False)
class CutMeasurement:
    """What one cut says about the cross FRF.

    Parameters
    ----------
    cut_id, tooling : str
    spindle_speed : float [rad/s]
        From the record.
    axes : mapping of Dof to AxisLines
    alignment_std : float [rad]
        Standard deviation of the angle between cut and air cut; 0 without an air cut.
    delay, delay_std : float or None [s]
        When tooth 1 stood at immersion 0, from a trigger whose tooth angle is known; else the time of the trigger's edge.
    tooth_angle_known : bool
    """

    cut_id: str
    tooling: str
    spindle_speed: float
    axes: Mapping[Dof, AxisLines]
    alignment_std: float
    delay: float | None = None
    delay_std: float | None = None
    tooth_angle_known: bool = True


@dataclass(frozen=True, slots=True)
class Reading:
    """A record's verdict and, where it is usable, its measurement.

    Parameters
    ----------
    spindle_speed : float or None [rad/s]
        From the record, also of one that is not usable, unless nothing can be told of it.
    harmonics : mapping of Dof to int
        Multiples of the tooth-passing frequency, of an air cut of the spindle's, that stand above the noise beside them.
    """

    verdict: Verdict
    measurement: CutMeasurement | None = None
    spindle_speed: float | None = None
    harmonics: Mapping[Dof, int] = field(default_factory=dict)


def measure_cut(
    cut_id: str,
    tooling: str,
    cut: Recording,
    air: Recording | None,
    cutter: Cutter,
    conditions: CuttingConditions,
    coefficients: CuttingCoefficients,
    max_frequency: float = MAX_FREQUENCY,
    estimator: Estimator = DEFAULT_ESTIMATOR,
) -> Reading:
    """Return the cross FRF's points of one cut, or why there are none.

    Parameters
    ----------
    cut, air : Recording
        Displacement channels for X and/or Y, accelerometers of the fixture where there are some.
    conditions : CuttingConditions
        As programmed; forces are simulated at the speed found in the record.
    max_frequency : float [Hz]
    estimator : Estimator
        `LineEstimator`, or `AirCorrectedSpectra` for that of [inprocess].

    Raises
    ------
    InputError
        If no displacement channel is there, or the air cut lacks one.
    """
    axes = measured_axes(cut)
    if not axes:
        raise InputError("sensors", "no displacement", "a displacement sensor for X or Y", cut_id)
    programmed, notes = conditions.spindle_speed, implausible(cut)
    faults = raw_faults(cut) + tuple(f"air cut: {fault}" for fault in (raw_faults(air) if air is not None else ()))
    if faults:
        return Reading(Verdict(faults, notes))
    try:
        steady = steady_record(cut, axes, programmed, max_frequency, cutter.teeth)
    except Unsteady as error:
        return Reading(Verdict((str(error.found),), notes))
    found = steady.spindle_speed, _harmonics(steady)
    faults = _speed_faults(steady, programmed)
    if faults:
        return Reading(Verdict(faults, notes), None, *found)
    try:
        still = None if air is None else steady_record(air, axes, programmed, _AIR_BEYOND * max_frequency, 1)
        faults = () if still is None else _speed_faults(still, programmed)
    except Unsteady as error:
        faults = (str(error.found),)
    if faults:
        return Reading(Verdict((f"air cut: {faults[0]}",), notes), None, *found)
    harmonic = np.arange(cutter.teeth, steady.highest_order + 1, cutter.teeth)
    if harmonic.size == 0:
        return Reading(Verdict((f"no tooth-passing line below {max_frequency:.0f} Hz",), notes), None, *found)
    angle, alignment_std = 0.0, 0.0
    if still is not None:
        angle, alignment_std = angle_to_air(steady, still, cutter.teeth)
    reasons = _cut_faults(steady, still, angle, harmonic, cutter, max_frequency)
    if reasons:
        return Reading(Verdict(reasons, notes), None, *found)
    speed = steady.spindle_speed
    force, slope = force_and_slope(cutter, replace(conditions, spindle_speed=speed), coefficients, harmonic)
    strong = WEAKEST_FORCE * np.abs(force).max()
    seen = [0 if axis is Dof.X else 1 for axis in axes]
    keep = np.abs(force[:, seen]) > strong
    points = estimator.points(steady, still, angle, harmonic, np.where(keep, force[:, seen], max(strong, 1e-300)))
    result = {}
    for i, (axis, k) in enumerate(zip(axes, keep.T, strict=True)):
        # an axis without the fixture's acceleration has the gap alone
        outputs = slice(None) if steady.has_fixture(axis) else slice(0, 1)
        if k.any():
            cut_points, air_points, variance = (each[k, i, outputs] for each in (points.cut, points.air, points.variance))
            force_k, slope_k = force[k, seen[i]], slope[k, seen[i]]
            result[axis] = AxisLines(
                harmonic[k], harmonic[k] * speed, cut_points, air_points, variance, points.coherence[k, i], force_k, slope_k
            )
    measurement = CutMeasurement(cut_id, tooling, speed, result, alignment_std, *trigger_delay(cut, speed, cutter.teeth))
    return Reading(Verdict((), notes if air is not None else (*notes, NO_AIR)), measurement, *found)


def judge_air(air: Recording, conditions: CuttingConditions, max_frequency: float = MAX_FREQUENCY) -> Reading:
    """Return the verdict on an air cut alone, as `measure_cut` judges it beside a cut.

    Raises
    ------
    InputError
        If no displacement channel is there.
    """
    axes, notes = measured_axes(air), implausible(air)
    if not axes:
        raise InputError("sensors", "no displacement", "a displacement sensor for X or Y")
    faults = raw_faults(air)
    if faults:
        return Reading(Verdict(faults, notes))
    try:
        still = steady_record(air, axes, conditions.spindle_speed, _AIR_BEYOND * max_frequency, 1)
    except Unsteady as error:
        return Reading(Verdict((str(error.found),), notes))
    return Reading(Verdict(_speed_faults(still, conditions.spindle_speed), notes), None, still.spindle_speed, _harmonics(still))


def _speed_faults(steady: SteadyRecord, programmed: float) -> tuple[str, ...]:
    """The first reason against the speed of a steady part."""
    return speed_faults(steady.displacement, steady.lines, programmed)[:1]


def _harmonics(steady: SteadyRecord) -> dict[Dof, int]:
    """Multiples of the tooth-passing frequency that are no noise, for each axis."""
    order = np.arange(steady.teeth, steady.highest_order + 1, steady.teeth)
    ratio = np.abs(steady.flange[order]) ** 2 / np.maximum(2.0 * steady.variance[order], 1e-300)
    # pure noise has a mean of 1, and its largest of n is rarely above log(n) + 7
    count = np.sum(ratio > np.log(max(order.size, 1)) + 7.0, axis=0)
    return {axis: int(n) for axis, n in zip(steady.axes, count, strict=True)}


def _cut_faults(
    cut: SteadyRecord, air: SteadyRecord | None, angle: float, harmonic: np.ndarray, cutter: Cutter, max_frequency: float
) -> tuple[str, ...]:
    """Reasons against a cut that only show beside its air cut."""
    difference, noise = cut.flange, cut.variance
    if air is not None:
        turned, more = turned_air(air, angle, cut.highest_order)
        difference, noise = difference - turned, noise + more
    forced = np.abs(difference[harmonic])
    band = (0.5 * cutter.teeth * cut.spindle_speed / (2.0 * np.pi), max_frequency)
    reasons = [silence(forced**2, noise[harmonic]), chatter(cut.lines, list(range(len(cut.axes))), forced.max(axis=0), band)]
    if air is not None and cutter.equally_spaced and reasons[0] is None:
        reasons.append(tooth_count_fault(np.sum(np.abs(difference) ** 2, axis=1), cutter.teeth))
    return tuple(reason for reason in reasons if reason is not None)
