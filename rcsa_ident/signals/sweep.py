"""A pass whose spindle speed changes on purpose: cut into windows, each a cut of nearly one speed whose lines know how fast they sweep."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from rcsa_ident.base.arrays import FloatArray
from rcsa_ident.base.errors import InputError
from rcsa_ident.base.remarks import Remark
from rcsa_ident.base.units import to_hz, to_rpm
from rcsa_ident.cutting.coefficients import CuttingCoefficients
from rcsa_ident.cutting.conditions import CuttingConditions
from rcsa_ident.cutting.cutter import Cutter
from rcsa_ident.dynamics.coordinates import Dof
from rcsa_ident.signals._kernels import angle_signal, angle_sums, turned
from rcsa_ident.signals.alignment import angle_to_air, rising
from rcsa_ident.signals.measurement import (
    MAX_FREQUENCY,
    NO_AIR,
    CutMeasurement,
    Reading,
    cross_lines,
    cut_faults,
    forced_orders,
    visible_harmonics,
)
from rcsa_ident.signals.motion import motion_channels, workpiece_channels
from rcsa_ident.signals.recording import LONGEST, Quantity, Recording
from rcsa_ident.signals.sound.line_prominence import LineGains
from rcsa_ident.signals.sound.rotation import Pace, follow, speed_path
from rcsa_ident.signals.spectra import LineSpectrum, line_spectrum
from rcsa_ident.signals.steady import SteadyRecord, record_of_lines
from rcsa_ident.signals.verdict import RecordCode, Verdict, examined, raw_faults

#: Length of a window [s], share of its speed that it sweeps at most, and the revolutions that it holds all the same.
WINDOW, _SWEPT, _TURNS = 0.28, 0.02, 20.0
#: Windows that a pass holds at least.
_FEWEST = 2
#: Shortest and longest window in which the speed is looked for [s], the order that stays within a window's resolution there, least
#: standard deviation of its change between windows, and distance of trial speeds, as shares.
_SHORT, _SPREAD, _LEAST_CHANGE, _STEP = (0.05, 0.25), 4.0, 4e-3, 2.5e-4
#: Longest pass, as so many times what is looked at of a cut.
_LONGEST_PASSES = 2
#: The speed is looked for so far beyond the programmed ends, as a share.
_BEYOND = 0.03
#: A pass's first and last speed may lie so far beside the programmed ones, as a share.
_BESIDE = 0.01
#: Standard deviation of an angle that was followed, where no air cut tells what a cutter's run-out adds to the flange's [rad].
_ANGLE_STD = 5e-3
#: Standard deviation of a block's angle from which on a flange is too round to tell it [rad]: forty orders of noise seem to tell 0.02.
_ROUND = 0.005
#: Change of the lines of the teeth from quarter to quarter above which a window is no even cut: a resonance does less; and in the first
#: and the last window, as so many times its neighbour's and more: there the tool enters and leaves.
_UNEVEN, _ENTERS = 0.6, (2.0, 0.05)
#: Share of a pass's windows that must be usable.
_LEAST_USABLE = 0.5


#: Note on a pass with accelerometers on the housing beside displacement sensors.
UNUSED = Remark(RecordCode.HOUSING, "the accelerometers on the spindle's housing are not used in a pass whose speed changes")
#: The same of accelerometers on table or workpiece.
WORKPIECE_UNUSED = Remark(RecordCode.WORKPIECE, "the accelerometers on table or workpiece are not used in a pass whose speed changes")


@dataclass(frozen=True, slots=True, eq=False)
class _Turning:
    """How the spindle turned through a pass: angle [rad] at each sample, from tooth 1 at immersion 0 where that is known (`absolute`), its
    standard deviation, and whether the teeth's own orders had to tell it."""

    recording: Recording
    angle: FloatArray
    std: float
    absolute: bool
    by_teeth: bool

    @property
    def mean_speed(self) -> float:
        """Over the pass [rad/s]."""
        return float(self.angle[-1] - self.angle[0]) / (self.angle.size - 1) * self.recording.rate

    def window(self, part: slice, axes: tuple[Dof, ...], teeth: int, max_frequency: float) -> tuple[SteadyRecord, float]:
        """The lines of a window, with phases from its first sample, and the share by which those of the teeth change within it."""
        recording = self.recording
        channels = motion_channels(recording.sensors, axes, housing=False)
        cut = replace(recording, samples=recording.samples[part])
        step, middle, at = self.line(part)
        angle = self.angle[part]
        deviation = angle - middle - step * at
        samples, rate, speed = cut.samples[:, channels.columns], recording.rate, float(step * recording.rate)
        lines = line_spectrum(samples, rate, speed, max_frequency, deviation)
        # what the amplitudes change within the window is no noise, and must not leak into other orders
        lines = line_spectrum(samples - _changing(lines, angle - middle), rate, speed, max_frequency, deviation)
        uneven = _unevenness(lines, teeth, len(axes))
        # neighbours differ since the speed changes, not by noise
        lines = replace(lines, scatter=np.zeros_like(lines.scatter))
        everything = slice(0, angle.size)
        return record_of_lines(cut, channels, everything, everything, teeth, lines, deviation), uneven

    def line(self, part: slice) -> tuple[float, float, FloatArray]:
        """The line through a window's angles: per sample, in its middle [rad], and the samples from there, shape (n,)."""
        angle = self.angle[part]
        at = np.arange(angle.size) - 0.5 * (angle.size - 1)
        middle, step = np.polynomial.polynomial.polyfit(at, angle, 1)
        return float(step), float(middle), at

    def start(self, part: slice) -> float:
        """Angle of that line at a window's first sample [rad]: its lines' phases are from there."""
        step, middle, at = self.line(part)
        return middle + step * float(at[0])

    def acceleration(self, part: slice) -> float:
        """Of the spindle in a window [rad/s^2]."""
        at = self.line(part)[2] / self.recording.rate
        return float(2.0 * np.polynomial.polynomial.polyfit(at, self.angle[part], 2)[2])


def measure_pass(
    cut_id: str,
    tooling: str,
    cut: Recording,
    air: Recording | None,
    cutter: Cutter,
    conditions: CuttingConditions,
    last_speed: float,
    coefficients: CuttingCoefficients,
    max_frequency: float = MAX_FREQUENCY,
) -> Reading:
    """Return the cross FRF's points of a pass whose speed changes, window by window, or why there are none.

    The spindle's angle is followed through the pass by the orders that are none of the teeth's: roundness and run-out of the flange turn
    with it, whatever the structure does. All windows share one unknown angle, or none with a trigger of known tooth angle.

    `cut`: with displacement channels for X and/or Y
    `air`: the same speeds without cutting
    `conditions`: as programmed, with the first speed; the feed per tooth is kept
    `last_speed` [rad/s]
    `max_frequency` [Hz]: highest line
    Raises `InputError` if there is no displacement channel, or the air cut lacks one.
    """
    axes = _moved_axes(cut)
    if air is not None and _moved_axes(air) != axes:
        raise InputError("sensors", "other displacements in the air cut", "the same sensors for a cut and its air cut")
    first_speed, looked_at = conditions.spindle_speed, examined(cut)
    programmed = 0.5 * (first_speed + last_speed)
    notes = looked_at.notes
    if motion_channels(cut.sensors, axes).beside:
        notes = (*notes, UNUSED)
    if workpiece_channels(cut.sensors) is not None:
        notes = (*notes, WORKPIECE_UNUSED)

    def left_out(*reasons: Remark) -> Reading:
        return Reading(cut_id, tooling, programmed, Verdict(reasons, notes))

    faults = looked_at.reasons + _length_faults(cut, (first_speed, last_speed))
    if air is not None:
        faults += tuple(fault.of("air cut") for fault in raw_faults(air) + _length_faults(air, (first_speed, last_speed)))
    if faults:
        return left_out(*faults)
    turning = _turning(cut, axes, (first_speed, last_speed), cutter.teeth)
    fault = _speed_fault(turning, (first_speed, last_speed))
    if fault is not None:
        return replace(left_out(fault), spindle_speed=turning.mean_speed)
    still = None if air is None else _turning(air, axes, (first_speed, last_speed), 1)
    fault = None if still is None else _air_fault(still, (first_speed, last_speed))
    if fault is not None:
        return replace(left_out(fault.of("air cut")), spindle_speed=turning.mean_speed)
    parts = _windows(turning)
    read = [turning.window(part, axes, cutter.teeth, max_frequency) for part in parts]
    uneven = _entering([each for _, each in read])
    found: list[CutMeasurement] = []
    bad: list[Remark] = []
    harmonics: dict[Dof, int] = {}
    for part, (steady, _), entering in zip(parts, read, uneven, strict=True):
        harmonic = np.arange(cutter.teeth, steady.highest_order + 1, cutter.teeth)
        if harmonic.size == 0:
            bad.append(Remark(RecordCode.NO_LINE, f"no tooth-passing line below {max_frequency:.0f} Hz"))
            continue
        if entering:
            bad.append(Remark(RecordCode.NOT_STEADY, "the tool enters the material, leaves it, or cuts unevenly"))
            continue
        beside, angle, alignment_std = None, 0.0, 0.0
        if still is not None:
            place = _at_speed(still, steady.spindle_speed, part.stop - part.start)
            beside, _ = still.window(place, axes, 1, 1.02 * max_frequency)
            angle, alignment_std = angle_to_air(steady, beside, cutter.teeth)
        reasons = cut_faults(steady, beside, angle, harmonic, cutter, max_frequency)
        if reasons:
            bad.append(reasons[0])
            continue
        orders = forced_orders(cutter, steady.highest_order)
        kept = cross_lines(steady, beside, angle, orders, cutter, conditions, coefficients)
        speed = steady.spindle_speed
        std = float(np.hypot(turning.std, _ANGLE_STD if beside is None else alignment_std)) / speed
        for axis, count in visible_harmonics(steady).items():
            harmonics[axis] = max(harmonics.get(axis, 0), count)
        found.append(
            CutMeasurement(
                cut_id,
                tooling,
                speed,
                kept,
                alignment_std,
                -(turning.start(part) % (2.0 * np.pi)) / speed,
                std,
                turning.absolute,
                clamping=cut_id,
                acceleration=turning.acceleration(part),
                length=(part.stop - part.start) / cut.rate,
            )
        )
    mean = turning.mean_speed
    if len(found) < _LEAST_USABLE * len(parts):
        worst = max(bad, key=lambda reason: sum(other.code is reason.code for other in bad))
        words = f"{len(bad)} of {len(parts)} windows are not usable, of most: {worst}"
        return replace(left_out(Remark(worst.code, words)), spindle_speed=mean)
    if bad:
        words = f"{len(bad)} of {len(parts)} windows are left out; the first: {bad[0]}"
        notes = (*notes, Remark(bad[0].code, words))
    if turning.by_teeth:
        words = "the flange is too round to tell the spindle's angle: the teeth's own lines did, and what the structure turns is in it"
        notes = (*notes, Remark(RecordCode.FOLLOWED, words))
    verdict = Verdict((), notes if air is not None else (*notes, NO_AIR))
    return Reading(cut_id, tooling, programmed, verdict, tuple(found), mean, harmonics)


def judge_pass_air(cut_id: str, tooling: str, air: Recording, speeds: tuple[float, float], max_frequency: float = MAX_FREQUENCY) -> Reading:
    """Return the verdict on the air cut of a pass alone.

    `speeds`: (float, float) [rad/s]; at which the pass begins and ends
    `max_frequency` [Hz]: highest line
    Raises `InputError` if there is no displacement channel.
    """
    axes, programmed, looked_at = _moved_axes(air), 0.5 * sum(speeds), examined(air)
    faults = looked_at.reasons + _length_faults(air, speeds)
    if faults:
        return Reading(cut_id, tooling, programmed, Verdict(faults, looked_at.notes))
    turning = _turning(air, axes, speeds, 1)
    fault = _air_fault(turning, speeds)
    if fault is not None:
        return Reading(cut_id, tooling, programmed, Verdict((fault,), looked_at.notes), (), turning.mean_speed)
    harmonics: dict[Dof, int] = {}
    for part in _windows(turning):
        for axis, count in visible_harmonics(turning.window(part, axes, 1, max_frequency)[0]).items():
            harmonics[axis] = max(harmonics.get(axis, 0), count)
    return Reading(cut_id, tooling, programmed, looked_at, (), turning.mean_speed, harmonics)


def _moved_axes(recording: Recording) -> tuple[Dof, ...]:
    """Axes along which the flange's displacement was recorded."""
    axes = tuple(axis for axis in (Dof.X, Dof.Y) if recording.sensor(Quantity.DISPLACEMENT, axis) is not None)
    if not axes:
        allowed = "a displacement sensor for X or Y: a pass whose speed changes is followed by the flange's run-out"
        raise InputError("sensors", "no displacement", allowed)
    return axes


def _turning(recording: Recording, axes: tuple[Dof, ...], speeds: tuple[float, float], teeth: int) -> _Turning:
    """Follow the spindle through a pass; an air cut has 1 tooth."""
    columns = motion_channels(recording.sensors, axes, housing=False).columns[: len(axes)]
    samples, rate = np.asarray(recording.samples)[:, columns], recording.rate
    low, high = to_hz(min(speeds)), to_hz(max(speeds))
    pace = _pace(low, high, samples.shape[0] / rate)
    middles, path = speed_path(LineGains(samples - samples.mean(axis=0), rate), (1.0 - _BEYOND) * low, (1.0 + _BEYOND) * high, pace)
    rotation = follow(samples, rate, middles, path, teeth)
    by_teeth = bool(np.median(rotation.information) < 1.0 / _ROUND**2)
    if by_teeth:
        rotation = follow(samples, rate, middles, path, 1)
    found = _from_trigger(recording, rotation.angle, teeth)
    off, std = (0.0, 0.0) if found is None else found
    return _Turning(recording, rotation.angle - off, std, found is not None, by_teeth)


def _length_faults(recording: Recording, speeds: tuple[float, float]) -> tuple[Remark, ...]:
    """A remark if a pass is too short for its windows, or so long that it is none."""
    n, rate = recording.samples.shape[0], recording.rate
    least = _FEWEST * _TURNS * 2.0 * np.pi / min(speeds)
    if n / rate < least:
        return (Remark(RecordCode.NOT_STEADY, f"too short: {n / rate:.3g} s, a pass at these speeds takes at least {least:.2g} s"),)
    if n > _LONGEST_PASSES * LONGEST:
        most = _LONGEST_PASSES * LONGEST / rate
        return (Remark(RecordCode.NOT_STEADY, f"too long: {n / rate:.4g} s, a pass of this rate takes at most {most:.3g} s"),)
    return ()


def _speed_fault(turning: _Turning, speeds: tuple[float, float]) -> Remark | None:
    """A remark if the spindle did not turn from one speed to the other."""
    tenth = turning.angle.size // 10
    ends = [float(turning.angle[a + tenth - 1] - turning.angle[a]) / (tenth - 1) * turning.recording.rate for a in (0, -tenth)]
    # a record may begin before the speed changes and end after it, and a clock is not perfect
    if all(abs(found / told - 1.0) < _BESIDE + 0.1 * abs(speeds[1] / speeds[0] - 1.0) for found, told in zip(ends, speeds, strict=True)):
        return None
    found, told = (f"from {to_rpm(first):.0f} to {to_rpm(last):.0f} rev/min" for first, last in (ends, speeds))
    return Remark(RecordCode.WRONG_SPEED, f"speed: the spindle turned {found}, programmed is {told}")


def _air_fault(turning: _Turning, speeds: tuple[float, float]) -> Remark | None:
    """A remark if the spindle was not seen to turn from one speed to the other in an air cut, in which no tooth tells it."""
    if turning.by_teeth:
        first, last = (to_rpm(speed) for speed in speeds)
        return Remark(RecordCode.WRONG_SPEED, f"speed: nothing is seen to turn from {first:.0f} to {last:.0f} rev/min")
    return _speed_fault(turning, speeds)


def _unevenness(lines: LineSpectrum, teeth: int, axes: int) -> float:
    """Root mean square of what the teeth's lines change from quarter to quarter of a window, over themselves, as accelerations."""
    order = np.arange(teeth, lines.amplitude.shape[0], teeth)
    weight = order[:, None] ** 4
    power = np.sum(weight * np.abs(lines.amplitude[order, :axes]) ** 2)
    # the scatter is the variance that the mean of four quarters would have
    return float(np.sqrt(24.0 * np.sum(weight * lines.scatter[order, :axes]) / max(power, 1e-300)))


def _entering(uneven: Sequence[float]) -> list[bool]:
    """Which windows of a pass are not wholly in the material, or not evenly, by how much their lines change within them."""
    found = [each > _UNEVEN for each in uneven]
    if len(uneven) > 2:
        found[0] |= uneven[0] > _ENTERS[0] * uneven[1] + _ENTERS[1]
        found[-1] |= uneven[-1] > _ENTERS[0] * uneven[-2] + _ENTERS[1]
    return found


def _changing(lines: LineSpectrum, angle: FloatArray) -> FloatArray:
    """By how much lines' amplitudes differ within a window from their means, up to second order in time: the signal of that."""
    n, highest = angle.size, lines.amplitude.shape[0] - 1
    time = 2.0 * (np.arange(n) + 0.5) / n - 1.0
    found, start, turn = np.zeros_like(lines.rest), np.zeros(1, dtype=int), turned(angle)
    for polynomial in (time, 1.5 * time**2 - 0.5):
        amplitude = angle_sums(lines.rest, turn, start, 2.0 * polynomial / np.sum(polynomial**2), highest)
        # the mean itself is the drift's
        amplitude[:, 0] = 0.0
        found += polynomial[:, None] * angle_signal(amplitude, turn, n)
    return found


def _pace(low: float, high: float, seconds: float) -> Pace:
    """How a frequency is followed that is told to go from one to the other [Hz]: windows so short that the teeth's lines stay lines."""
    window = float(np.clip(1.0 / np.sqrt(_SPREAD * (high - low) / seconds), *_SHORT))
    return Pace(window, max(_LEAST_CHANGE, (high / low - 1.0) * 0.5 * window / seconds), _STEP)


def _from_trigger(recording: Recording, angle: FloatArray, teeth: int) -> tuple[float, float] | None:
    """By how much a followed angle exceeds that of tooth 1 from immersion 0, and its standard deviation [rad], from all edges of a trigger
    together; None without one whose tooth angle is known. With several pulses a turn it is known up to a whole number of teeth."""
    sensor = recording.sensor(Quantity.TRIGGER)
    if sensor is None or sensor.tooth_angle is None or teeth % sensor.pulses_per_revolution != 0:
        return None
    edges = rising(np.asarray(recording.samples)[:, recording.sensors.index(sensor)])
    if edges.size < _TURNS:
        return None
    # a sampled edge is seen at the first sample behind it
    at = np.interp(edges - 0.5 - sensor.delay * recording.rate, np.arange(angle.size), angle)
    apart = 2.0 * np.pi / sensor.pulses_per_revolution
    turned = np.exp(1j * (at - sensor.tooth_angle) * 2.0 * np.pi / apart)
    off = float(np.angle(np.median(turned.real) + 1j * np.median(turned.imag))) * apart / (2.0 * np.pi)
    late = np.mod(at - sensor.tooth_angle - off + 0.5 * apart, apart) - 0.5 * apart
    # a stray edge does not belong to the mark
    good = late[np.abs(late) < 5.0 * np.median(np.abs(late)) + 1e-12]
    return off + float(good.mean()), float(good.std() / np.sqrt(good.size))


def _windows(turning: _Turning) -> list[slice]:
    """Windows that follow each other and leave little of the pass out."""
    rate, n = turning.recording.rate, turning.angle.size
    speeds = np.diff(turning.angle[:: max(n // 64, 1)]) / max(n // 64, 1) * rate
    change = float(np.ptp(speeds) / speeds.min()) / (n / rate)
    length = max(min(WINDOW, _SWEPT / max(change, 1e-9)), _TURNS * 2.0 * np.pi / float(speeds.min()))
    count = max(int(n / rate / length), 1)
    ends = np.linspace(0, n, count + 1).astype(int)
    return [slice(a, b) for a, b in itertools.pairwise(ends.tolist())]


def _at_speed(turning: _Turning, speed: float, length: int) -> slice:
    """The window of an air cut in which the spindle turns as fast as in one of the cut."""
    n, rate = turning.angle.size, turning.recording.rate
    length = min(length, n)
    starts = np.arange(0, n - length + 1, max(length // 16, 1))
    means = (turning.angle[starts + length - 1] - turning.angle[starts]) / (length - 1) * rate
    start = int(starts[np.argmin(np.abs(means - speed))])
    return slice(start, start + length)
