"""From one cut's recordings to points of the cross FRF, with everything that is uncertain about them."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from datetime import datetime

import numpy as np

from rcsa_ident.base.arrays import ComplexArray
from rcsa_ident.base.errors import InputError, Unsteady
from rcsa_ident.base.remarks import Remark, says
from rcsa_ident.base.shown import Shown
from rcsa_ident.base.units import to_hz
from rcsa_ident.cutting.coefficients import CuttingCoefficients
from rcsa_ident.cutting.conditions import CuttingConditions
from rcsa_ident.cutting.cutter import Cutter
from rcsa_ident.cutting.force import SLOPES, ForceTerm, force_and_slope
from rcsa_ident.dynamics.coordinates import Dof
from rcsa_ident.signals.alignment import angle_to_air, followed, trigger_delay
from rcsa_ident.signals.frf import AxisLines, Estimator, LineEstimator, turned_air
from rcsa_ident.signals.listening import heard_in_a_cut
from rcsa_ident.signals.motion import measured_axes, motion_channels, workpiece_channels
from rcsa_ident.signals.recording import Recording, Sensor
from rcsa_ident.signals.steady import SteadyRecord, steady_record
from rcsa_ident.signals.verdict import RecordCode, Verdict, chatter, examined, raw_faults, silence, smeared, speed_faults, tooth_count_fault

#: Highest line that is used [Hz].
MAX_FREQUENCY = 4300.0
#: Share of the largest force line below which a line says nothing.
WEAKEST_FORCE = 1e-3
#: Share of a force line that the usual run-out may change at orders that only unlike teeth have: there it is of the first order.
_MOST_RUNOUT = 0.02
#: An air cut may turn this much more slowly, and still needs the cut's highest line.
_AIR_BEYOND = 1.02
_MOTION = "a displacement sensor for X or Y, or an accelerometer on the spindle's housing"
DEFAULT_ESTIMATOR = LineEstimator()
#: Note on a cut without an air cut.
NO_AIR = Remark(RecordCode.NO_AIR_CUT, "no air cut: run-out and roundness of the flange remain in the lines at the tooth-passing harmonics")
#: Note on a cut without a displacement sensor.
HOUSING = Remark(
    RecordCode.HOUSING,
    "the motion of the spindle's housing, from its acceleration: the flange's own motion follows from several toolings",
)


@dataclass(frozen=True, slots=True, eq=False)
class CutMeasurement:
    """What one cut says about the cross FRF.

    `cut_id`, `tooling`: name of the cut and of its tooling
    `spindle_speed` [rad/s]: as found in the record
    `alignment_std` [rad]: standard deviation of the angle between cut and air cut; 0 without an air cut
    `delay`, `delay_std` [s]: when tooth 1 stood at immersion 0, from a trigger whose tooth angle is known; else the time of the trigger's
        edge
    `clamping`: cuts of one such name share the unknown angle between the time that `delay` tells and immersion 0; by default the tooling's
    `acceleration` [rad/s^2]: by which the spindle speed changes, in the window of a pass: the lines are means over the frequencies that it
        sweeps
    `length` [s]: of that window; 0 of a whole record
    `workpiece`: what accelerometers on table or workpiece show, over the force on the tool: minus what gives way there
    """

    cut_id: str
    tooling: str
    spindle_speed: float
    axes: Mapping[Dof, AxisLines]
    alignment_std: float
    delay: float | None = None
    delay_std: float | None = None
    tooth_angle_known: bool = True
    clamping: str = ""
    acceleration: float = 0.0
    length: float = 0.0
    workpiece: Mapping[Dof, AxisLines] = field(default_factory=dict)

    @property
    def housing(self) -> bool:
        """Whether the lines are those of the spindle's housing alone, and none of the flange's."""
        return bool(self.axes) and not any(lines.of_flange for lines in self.axes.values())


@dataclass(frozen=True, slots=True, repr=False)
class Reading(Shown):
    """A cut whose recordings were read: their verdict and, where they are usable, the measurement.

    `programmed_speed` [rad/s]: in the middle of a pass
    `measurements`: one of a cut that keeps its speed, one for each window of a pass, none of a cut that is not usable
    `spindle_speed` [rad/s]: as found in the record, also in one that is not usable, unless nothing can be told of it
    `harmonics`: multiples of the tooth-passing frequency, of an air cut of the spindle's, that stand above the noise beside them
    `started`: when the cut's recording began, where its file says it; `seconds`: how long it lasts
    """

    cut_id: str
    tooling: str
    programmed_speed: float
    verdict: Verdict
    measurements: tuple[CutMeasurement, ...] = ()
    spindle_speed: float | None = None
    harmonics: Mapping[Dof, int] = field(default_factory=dict)
    started: datetime | None = None
    seconds: float = 0.0

    @property
    def measurement(self) -> CutMeasurement | None:
        """That of a usable cut that keeps its speed; None of others."""
        return self.measurements[0] if len(self.measurements) == 1 else None

    def __str__(self) -> str:
        lines = sum(each.omega.size for measurement in self.measurements for each in measurement.axes.values())
        windows = f" in {len(self.measurements)} windows" if len(self.measurements) > 1 else ""
        return f"{self.cut_id}: {self.verdict}" + (f", {lines} lines{windows}" if self.verdict.usable else "")


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

    `cut_id`, `tooling`: name of the cut and of its tooling, for the result and for messages
    `cut`: displacement channels for X and/or Y, accelerometers of the fixture where there are some, and accelerometers on the spindle's
        housing beside them or in their place
    `air`: the same in the air, where it was recorded
    `conditions`: the cut as programmed; forces are simulated at the speed found in the record
    `max_frequency` [Hz]: highest line
    `estimator`: `LineEstimator`, or `AirCorrectedSpectra` for that of [inprocess]
    Raises `InputError` if no such channel is there, or the air cut lacks one.
    """
    axes = measured_axes(cut.sensors)
    if not axes:
        raise InputError("sensors", nothing_of_the_spindle(cut.sensors), _MOTION, cut_id)
    if air is not None:
        _same_sensors(cut, air, axes)
    programmed, looked_at = conditions.spindle_speed, examined(cut)
    notes = looked_at.notes

    def left_out(reasons: tuple[Remark, ...], speed: float | None = None, harmonics: Mapping[Dof, int] | None = None) -> Reading:
        return Reading(cut_id, tooling, programmed, Verdict(reasons, notes), (), speed, harmonics or {})

    faults = looked_at.reasons + tuple(fault.of("air cut") for fault in (raw_faults(air) if air is not None else ()))
    if faults:
        return left_out(faults)
    try:
        steady = steady_record(cut, axes, programmed, max_frequency, cutter.teeth)
    except Unsteady as error:
        return left_out((_not_steady(error),))
    notes += _remarkable(steady)
    found = steady.spindle_speed, visible_harmonics(steady)
    harmonic = np.arange(cutter.teeth, steady.highest_order + 1, cutter.teeth)
    faults = _speed_faults(steady, programmed)
    if faults:
        # what vibrates beside the orders makes a speed look as if it drifted
        drifting = faults[0].code is RecordCode.SPEED_DRIFT and smeared(steady.wander) is None
        chattering = _chatter(steady, steady.flange, harmonic, cutter.teeth, max_frequency) if drifting else None
        return left_out(faults if chattering is None else (chattering,), *found)
    try:
        still = None if air is None else steady_record(air, axes, programmed, _AIR_BEYOND * max_frequency, 1)
        faults = () if still is None else _speed_faults(still, programmed)
    except Unsteady as error:
        faults = (_not_steady(error),)
    if faults:
        return left_out((faults[0].of("air cut"),), *found)
    if harmonic.size == 0:
        return left_out((Remark(RecordCode.NO_LINE, f"no tooth-passing line below {max_frequency:.0f} Hz"),), *found)
    angle, alignment_std = 0.0, 0.0
    if steady.housing:
        # a housing is not out of round: nothing of the air cut stands at the teeth's orders
        still = None
    if still is not None:
        angle, alignment_std = angle_to_air(steady, still, cutter.teeth)
    reasons = cut_faults(steady, still, angle, harmonic, cutter, max_frequency)
    if reasons:
        return left_out(reasons, *found)
    kept = cross_lines(steady, still, angle, forced_orders(cutter, steady.highest_order), cutter, conditions, coefficients, estimator)
    speed = steady.spindle_speed
    trigger = trigger_delay(cut, speed, cutter.teeth, *followed(steady))
    felt = workpiece_lines(steady, still, angle, harmonic, cutter, conditions, coefficients)
    measurement = CutMeasurement(cut_id, tooling, speed, kept, alignment_std, *trigger, workpiece=felt)
    verdict = Verdict((), (*notes, HOUSING) if steady.housing else notes if air is not None else (*notes, NO_AIR))
    return Reading(cut_id, tooling, programmed, verdict, (measurement,), *found)


def nothing_of_the_spindle(sensors: Sequence[Sensor]) -> str:
    """Return what is found where no sensor shows the spindle's motion, in words."""
    felt = workpiece_channels(sensors)
    return "no displacement" if felt is None else f"{felt.sensors[0].name} on the {felt.sensors[0].role}, and none on the spindle"


def _same_sensors(cut: Recording, air: Recording, axes: Sequence[Dof]) -> None:
    """Refuse an air cut that lacks one of the cut's channels of motion, or has others."""
    told, found = ([(s.quantity, s.axis) for s in motion_channels(each.sensors, axes).sensors] for each in (cut, air))
    if told != found:
        missing = next((each for each in told if told.count(each) > found.count(each)), None)
        words = "other sensors" if missing is None else f"no {missing[0]} {str(missing[1]).upper()}"
        raise InputError("sensors", f"{words} in the air cut", "the same sensors for a cut and its air cut")


def forced_orders(cutter: Cutter, highest: int) -> np.ndarray:
    """Return the spindle's orders, up to the highest, at which a cutter that runs true has a force: all of them where teeth are unlike."""
    return np.arange(cutter.repeats, highest + 1, cutter.repeats)


def cross_lines(
    steady: SteadyRecord,
    still: SteadyRecord | None,
    angle: float,
    harmonic: np.ndarray,
    cutter: Cutter,
    conditions: CuttingConditions,
    coefficients: CuttingCoefficients,
    estimator: Estimator = DEFAULT_ESTIMATOR,
) -> dict[Dof, AxisLines]:
    """Return the lines of each axis over the simulated force, without those at which the force says nothing.

    `still`: of the air cut
    `angle` [rad]: by which that must be turned to lie under the cut
    `harmonic`: array of int, shape (n,); orders of the lines
    `conditions`: as programmed; the speed is that of the record
    """
    axes, speed = steady.axes, steady.spindle_speed
    force, slope = force_and_slope(cutter, replace(conditions, spindle_speed=speed), coefficients, harmonic)
    weakest = WEAKEST_FORCE * np.abs(force).max()
    measured = [0 if axis is Dof.X else 1 for axis in axes]
    other = [1 - m for m in measured]
    own = (harmonic % cutter.teeth == 0)[:, None] | (np.abs(slope[:, measured, SLOPES.index(ForceTerm.RUNOUT)]) < _MOST_RUNOUT)
    strong = (np.abs(force[:, measured]) > weakest) & own
    pushed = np.where(strong, force[:, measured], max(weakest, 1e-300))
    lines = estimator.lines(steady, still, angle, harmonic, pushed, slope[:, measured])
    both = {a: replace(lines[a], across=force[:, o], across_slope=slope[:, o]) for a, o in zip(axes, other, strict=True)}
    return {axis: both[axis].of(k) for axis, k in zip(axes, strong.T, strict=True) if k.any()}


def workpiece_lines(
    steady: SteadyRecord,
    still: SteadyRecord | None,
    angle: float,
    harmonic: np.ndarray,
    cutter: Cutter,
    conditions: CuttingConditions,
    coefficients: CuttingCoefficients,
) -> dict[Dof, AxisLines]:
    """Return the lines of accelerometers on table and workpiece over the simulated force on the tool; parameters as in `cross_lines`.

    Nothing turns there: an air cut's lines are noise, and are subtracted only where one of those at the teeth's orders is not.
    """
    channels = workpiece_channels(steady.recording.sensors)
    if channels is None:
        return {}
    air = None
    if still is not None and workpiece_channels(still.recording.sensors) == channels:
        beside = still.seen_by(channels)
        own = harmonic[harmonic <= beside.highest_order]
        air = beside if any(_visible(beside, own).values()) else None
    return cross_lines(steady.seen_by(channels), air, angle, harmonic, cutter, conditions, coefficients)


def judge_air(cut_id: str, tooling: str, air: Recording, conditions: CuttingConditions, max_frequency: float = MAX_FREQUENCY) -> Reading:
    """Return the verdict on an air cut alone, as `measure_cut` judges it beside a cut.

    `conditions`: the cut as programmed: its speed counts
    `max_frequency` [Hz]: highest line
    Raises `InputError` if there is neither a displacement channel nor an accelerometer on the spindle's housing.
    """
    axes, programmed = measured_axes(air.sensors), conditions.spindle_speed
    if not axes:
        raise InputError("sensors", nothing_of_the_spindle(air.sensors), _MOTION)
    looked_at = examined(air)
    if not looked_at.usable:
        return Reading(cut_id, tooling, programmed, looked_at)
    try:
        still = steady_record(air, axes, programmed, _AIR_BEYOND * max_frequency, 1)
    except Unsteady as error:
        return Reading(cut_id, tooling, programmed, Verdict((_not_steady(error),), looked_at.notes))
    verdict = Verdict(_speed_faults(still, programmed), (*looked_at.notes, *_remarkable(still)))
    return Reading(cut_id, tooling, programmed, verdict, (), still.spindle_speed, visible_harmonics(still))


def _remarkable(steady: SteadyRecord) -> tuple[Remark, ...]:
    """Notes: that a long recording was looked at in a window only, and that a speed was followed."""
    seconds, rate = steady.recording.samples.shape[0] / steady.recording.rate, steady.recording.rate
    first, last = steady.window.start / rate, steady.window.stop / rate
    notes = []
    if last - first < seconds:
        words = f"long: of {seconds:.4g} s those from {first:.4g} to {last:.4g} s are used, where the cut is steady"
        notes.append(Remark(RecordCode.LONG, words))
    if steady.wander is not None:
        words = f"the speed changes by {100.0 * steady.wander:.2g} % (standard deviation) within the record, and is followed"
        notes.append(Remark(RecordCode.FOLLOWED, words))
    return tuple(notes)


def _not_steady(error: Unsteady) -> Remark:
    return Remark(RecordCode.NOT_STEADY, str(error.found))


def _speed_faults(steady: SteadyRecord, programmed: float) -> tuple[Remark, ...]:
    """The first reason against the speed of a steady part."""
    smear = smeared(steady.wander)
    faults = speed_faults(steady.motion, steady.lines, programmed, steady.deviation)
    if steady.housing:
        # the highest lines of accelerometers are noise: what the following leaves of them is in their scatter
        faults = tuple(fault for fault in faults if fault.code is not RecordCode.SPEED_DRIFT)
    return (*faults, *((smear,) if smear else ()))[:1]


def visible_harmonics(steady: SteadyRecord) -> dict[Dof, int]:
    """Return how many multiples of the tooth-passing frequency are no noise, for each axis."""
    return _visible(steady, np.arange(steady.teeth, steady.highest_order + 1, steady.teeth))


def _visible(steady: SteadyRecord, order: np.ndarray) -> dict[Dof, int]:
    """How many lines of these orders are no noise, for each axis."""
    ratio = np.abs(steady.flange[order]) ** 2 / np.maximum(2.0 * steady.variance[order], 1e-300)
    # pure noise has a mean of 1, and its largest of n is rarely above log(n) + 7
    count = np.sum(ratio > np.log(max(order.size, 1)) + 7.0, axis=0)
    return {axis: int(n) for axis, n in zip(steady.axes, count, strict=True)}


def cut_faults(
    cut: SteadyRecord, air: SteadyRecord | None, angle: float, harmonic: np.ndarray, cutter: Cutter, max_frequency: float
) -> tuple[Remark, ...]:
    """Return the reasons against a cut that only show beside its air cut; parameters as in `cross_lines`."""
    difference, noise = cut.flange, cut.variance
    if air is not None:
        turned, more = turned_air(air, angle, cut.highest_order)
        difference, noise = difference - turned, noise + more
    forced = np.abs(difference[harmonic])
    reasons = [silence(forced**2, noise[harmonic]), _chatter(cut, difference, harmonic, cutter.teeth, max_frequency, air)]
    if air is not None and cutter.equally_spaced and reasons[0] is None:
        reasons.append(tooth_count_fault(np.sum(np.abs(difference) ** 2, axis=1), cutter.teeth))
    return tuple(reason for reason in reasons if reason is not None)


def _chatter(
    cut: SteadyRecord, motion: ComplexArray, harmonic: np.ndarray, teeth: int, max_frequency: float, air: SteadyRecord | None = None
) -> Remark | None:
    """A remark if a vibration off the spindle's orders stands out among these lines."""
    if harmonic.size == 0:
        return None
    if cut.rotation is not None:
        return heard_in_a_cut(cut.motion, cut.recording.rate, cut.rotation, teeth)
    forced = np.abs(motion[harmonic]).max(axis=0)
    band = (0.5 * teeth * to_hz(cut.spindle_speed), max_frequency)
    # without accelerometers beside them, displacements are all that is known
    absolute = cut.absolute if len(cut.channels.columns) > len(cut.axes) else None
    return chatter(cut.lines, list(range(len(cut.axes))), forced, band, None if air is None else air.lines, absolute)


def fits_by_chance(cuts: Sequence[tuple[str, bool | None]]) -> list[Remark | None]:
    """Return the reason against each cut that fits a tooth count which most cuts of its tooling contradict, else None.

    `cuts`: sequence of (tooling, whether the tooth count fits); None of a cut that was left out for another reason: it says nothing of the
        tooth count
    """
    against, fitting = (Counter(tooling for tooling, fits in cuts if fits is each) for each in (False, True))

    def reason(tooling: str, fits: bool | None) -> Remark | None:
        wrong, right = against[tooling], fitting[tooling]
        if not fits or wrong <= right:
            return None
        words = f"wrong tooth count (or chatter): {wrong} of {wrong + right} cuts with {tooling} contradict it, and this one fits by chance"
        return Remark(RecordCode.TOOTH_COUNT, words)

    return [reason(*cut) for cut in cuts]


def among_fellows(readings: Sequence[Reading]) -> list[Reading]:
    """Return the readings of a campaign, those left out that fit a wrong tooth count by chance (`fits_by_chance`)."""

    def fits(verdict: Verdict) -> bool | None:
        return True if verdict.usable else False if says(verdict.reasons, RecordCode.TOOTH_COUNT) else None

    reasons = fits_by_chance([(each.tooling, fits(each.verdict)) for each in readings])
    return [
        each if reason is None else replace(each, verdict=replace(each.verdict, reasons=(reason,)), measurements=())
        for each, reason in zip(readings, reasons, strict=True)
    ]
