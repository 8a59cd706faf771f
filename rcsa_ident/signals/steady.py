"""A recording's steady part: its speed, its lines, and the absolute displacement of the flange in them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from rcsa_ident.arrays import ComplexArray, FloatArray
from rcsa_ident.dynamics.coordinates import Dof
from rcsa_ident.errors import InputError, Unsteady
from rcsa_ident.signals.loud_part import loud_part
from rcsa_ident.signals.recording import Quantity, Recording, Role
from rcsa_ident.signals.rotation import Rotation, follow_changes
from rcsa_ident.signals.spectra import LineSpectrum, line_spectrum, refine_speed, segment_lines
from rcsa_ident.signals.speed_search import rotation_near
from rcsa_ident.signals.steady_part import steady_part, steady_window
from rcsa_ident.units import to_hz

#: Least number of revolutions of a steady part.
LEAST_REVOLUTIONS = 8.0


@dataclass(frozen=True, slots=True, eq=False)
class SteadyRecord:
    """The steady part of a recording.

    Parameters
    ----------
    recording : Recording
    axes : tuple of Dof
        Machine axes with a displacement sensor; where there is none, those with an accelerometer on the spindle's housing.
    columns : tuple of int
        Channels of the recording that matter: the axes' own, then the accelerations of the displacement sensors' fixture.
    window, part : slice
        What was looked at (all of a recording that is not long, see `steady_window`), and the steady part in it.
    teeth : int
        1 for an air cut.
    lines : LineSpectrum
        Lines of these channels; phases from the recording's first sample.
    deviation : array or None, shape (n,) [rad]
        Of the spindle's angle in the steady part from that at its mean speed; None where it turns evenly.
    outputs : complex array, shape (orders, axes, o) [m]
        Displacement at each order: gap and fixture, or the gap alone where no axis has the fixture's acceleration; the housing's, where
        that was recorded.
    output_variance : array, shape (orders, axes, o) [m^2]
        Variance of the real and of the imaginary part each.
    rotation : Rotation or None
        Of the spindle in the steady part, as accelerometers on the housing told it; None where the flange's displacement did.
    """

    recording: Recording
    axes: tuple[Dof, ...]
    columns: tuple[int, ...]
    window: slice
    part: slice
    teeth: int
    lines: LineSpectrum
    deviation: FloatArray | None
    outputs: ComplexArray
    output_variance: FloatArray
    rotation: Rotation | None = None

    @property
    def flange(self) -> ComplexArray:
        """Absolute displacement of the flange, or of the housing, at each order, shape (orders, axes) [m]."""
        return np.sum(self.outputs, axis=2)

    @property
    def variance(self) -> FloatArray:
        """Variance of its real and of its imaginary part each, shape (orders, axes) [m^2]."""
        return np.sum(self.output_variance, axis=2)

    def has_fixture(self, axis: Dof) -> bool:
        """Return whether the fixture's motion along an axis was recorded."""
        return not self.housing and self.recording.accelerometer(axis, Role.FIXTURE) is not None

    @property
    def housing(self) -> bool:
        """Whether it is the housing whose motion was recorded, and not the flange's."""
        return self.recording.sensors[self.columns[0]].quantity is Quantity.ACCELERATION

    @property
    def spindle_speed(self) -> float:
        """Spindle speed, found in the record itself [rad/s]."""
        return self.lines.spindle_speed

    @property
    def angle(self) -> FloatArray:
        """The spindle's angle at the samples of the steady part, shape (n,) [rad]."""
        even = self.spindle_speed / self.recording.rate * np.arange(self.part.stop - self.part.start)
        return even if self.deviation is None else even + self.deviation

    @property
    def wander(self) -> float | None:
        """Standard deviation of the spindle speed within the record, of two revolutions each, as a share; None where it turns evenly."""
        if self.deviation is None or (self.rotation is not None and not self.rotation.uneven):
            return None
        turns = self.deviation[:: max(round(4.0 * np.pi / self.spindle_speed * self.recording.rate), 1)]
        return float(np.std(np.diff(turns)) / (4.0 * np.pi))

    @property
    def highest_order(self) -> int:
        """Highest multiple of the spindle's frequency among the lines."""
        return self.lines.amplitude.shape[0] - 1

    @property
    def motion(self) -> FloatArray:
        """Samples of the axes' own channels in the steady part, shape (n, axes) [m], those of a housing [m/s^2]."""
        return self.recording.samples[self.part][:, self.columns[: len(self.axes)]]

    def segments(self, order: np.ndarray, count: int) -> ComplexArray:
        """Return the absolute displacement in half-overlapping Hann segments, shape (count, orders, axes) [m]."""
        samples = self.recording.samples[self.part][:, self.columns]
        omega = order * self.spindle_speed
        lines = segment_lines(samples, self.recording.rate, self.spindle_speed, order, count, self.deviation)
        lines = lines * np.exp(-1j * omega * self.part.start / self.recording.rate)[:, None]
        return np.einsum("smc,mca->sma", lines, _weights(self.recording, self.axes, self.columns, omega))


def measured_axes(recording: Recording) -> tuple[Dof, ...]:
    """Return the axes with a displacement sensor; where there is none at all, those with an accelerometer on the spindle's housing."""
    shown = tuple(axis for axis in (Dof.X, Dof.Y) if recording.sensor(Quantity.DISPLACEMENT, axis) is not None)
    return shown or tuple(axis for axis in (Dof.X, Dof.Y) if recording.accelerometer(axis, Role.SPINDLE) is not None)


def steady_record(
    recording: Recording, axes: Sequence[Dof], programmed: float, max_frequency: float, teeth: int, whole: bool = False
) -> SteadyRecord:
    """Return the steady part of a recording with its speed and lines.

    Parameters
    ----------
    recording : Recording
    axes : sequence of Dof
        As `measured_axes` returns them.
    programmed : float [rad/s]
        The spindle speed that was set; the true one is looked for near it.
    max_frequency : float [Hz]
        Highest line.
    teeth : int
        1 for an air cut.
    whole : bool
        Look at all of a long recording, not at a window, and take its speed as constant: for who goes through all of it so.

    Raises
    ------
    InputError
        If the displacement of an axis is missing.
    Unsteady
        If there is no steady part; what was found says why.
    """
    rate, n = recording.rate, recording.samples.shape[0]
    least = LEAST_REVOLUTIONS * 2.0 * np.pi / programmed * rate
    if n < least:
        raise _no_steady_part(f"too short: {n / rate:.3g} s hold fewer than {LEAST_REVOLUTIONS:.0f} revolutions")
    columns = motion_columns(recording, axes)
    window = slice(0, n) if whole else steady_window(recording, columns[: len(axes)], programmed, teeth)
    samples = recording.samples[window][:, columns]
    displacement = samples[:, : len(axes)]
    accelerations = recording.sensors[columns[0]].quantity is Quantity.ACCELERATION
    # idle or not: an accelerometer hears the machine's noise all along, and nothing else that turns
    rough = programmed if accelerations else refine_speed(displacement, rate, programmed)
    steady = loud_part(displacement, rate) if accelerations else steady_part(displacement, rate, rough, teeth)
    if steady.stop - steady.start < least:
        raise _no_steady_part(f"no steady part of at least {LEAST_REVOLUTIONS:.0f} revolutions")
    everything = steady == slice(0, samples.shape[0]) and not accelerations
    speed = rough if everything else refine_speed(displacement[steady], rate, rough)
    deviation, rotation = None, None
    if accelerations:
        rotation = rotation_near(displacement[steady], rate, to_hz(speed))
        speed, deviation = rotation.about(speed)
    elif not whole:
        speed, deviation = _turning(displacement[steady], rate, speed)
    # in acceleration lines grow with the frequency: those above what is wanted would leak into the others
    lines = line_spectrum(samples[steady], rate, speed, rate if accelerations else max_frequency, deviation).up_to(max_frequency)
    part = slice(window.start + steady.start, window.start + steady.stop)
    if part.start:
        shift = np.exp(-1j * np.arange(lines.amplitude.shape[0]) * speed * part.start / rate)
        lines = replace(lines, amplitude=lines.amplitude * shift[:, None])
    return record_of_lines(recording, axes, columns, window, part, teeth, lines, deviation, rotation)


def record_of_lines(
    recording: Recording,
    axes: Sequence[Dof],
    columns: tuple[int, ...],
    window: slice,
    part: slice,
    teeth: int,
    lines: LineSpectrum,
    deviation: FloatArray | None,
    rotation: Rotation | None = None,
) -> SteadyRecord:
    """Return the steady record with these lines of its channels; parameters as those of `SteadyRecord`."""
    weight = _weights(recording, axes, columns, np.arange(lines.amplitude.shape[0]) * lines.spindle_speed)
    noise = np.stack([_line_variance(lines, c, teeth) for c in range(len(columns))], axis=1)
    kinds = [slice(0, len(axes)), slice(len(axes), None)][: 1 if len(columns) == len(axes) else 2]
    outputs = np.stack([np.einsum("mc,mca->ma", lines.amplitude[:, k], weight[:, k]) for k in kinds], axis=2)
    variance = np.stack([np.einsum("mc,mca->ma", noise[:, k], np.abs(weight[:, k]) ** 2) for k in kinds], axis=2)
    return SteadyRecord(recording, tuple(axes), columns, window, part, teeth, lines, deviation, outputs, variance, rotation)


def _turning(displacement: FloatArray, rate: float, speed: float) -> tuple[float, FloatArray | None]:
    """The spindle's mean speed, followed where it changes, and what its angle deviates from that."""
    rotation = follow_changes(displacement, rate, to_hz(speed))
    return (speed, None) if rotation is None else rotation.about(speed)


def _no_steady_part(found: str) -> Unsteady:
    return Unsteady("recording", found, "a steady record of the programmed speed")


def motion_columns(recording: Recording, axes: Sequence[Dof]) -> tuple[int, ...]:
    """Return the channels of the axes' motion, then those of the displacement sensors' fixture."""
    shown = [recording.sensor(Quantity.DISPLACEMENT, axis) for axis in axes]
    fixed = [recording.accelerometer(axis, Role.FIXTURE) for axis in axes]
    if all(sensor is None for sensor in shown):
        shown, fixed = [recording.accelerometer(axis, Role.SPINDLE) for axis in axes], []
    for axis, sensor in zip(axes, shown, strict=True):
        if sensor is None:
            raise InputError("sensors", f"no displacement {axis.upper()}", "the same sensors for a cut and its air cut")
    return tuple(recording.sensors.index(sensor) for sensor in (*shown, *fixed) if sensor is not None)


def _weights(recording: Recording, axes: Sequence[Dof], columns: Sequence[int], omega: FloatArray) -> ComplexArray:
    """Share of each channel in each axis: the gap plus the fixture's motion -a / omega^2, sensors undone; (orders, channels, axes)."""
    twice = np.where(omega == 0.0, 0.0, -1.0 / np.where(omega == 0.0, 1.0, omega) ** 2)
    weights = np.zeros((omega.size, len(columns), len(axes)), dtype=complex)
    for c, column in enumerate(columns):
        sensor = recording.sensors[column]
        factor = 1.0 if sensor.quantity is Quantity.DISPLACEMENT else twice
        weights[:, c, [axis is sensor.axis for axis in axes].index(True)] = factor / sensor.response(omega)
    return weights


def _line_variance(lines: LineSpectrum, channel: int, teeth: int) -> FloatArray:
    """Noise floor beside each line, raised where the record's quarters scatter more than it explains.

    What scatters in proportion to the lines (a force that is not quite steady, for those of the teeth) is found from all of
    a kind together, since one line's scatter is itself known to a factor only.
    """
    floor, scatter = np.maximum(lines.variance[:, channel], 1e-300), lines.scatter[:, channel]
    power = np.abs(lines.amplitude[:, channel]) ** 2
    floor = floor * max(1.0, float(np.median(scatter[1:] / floor[1:])))
    order = np.arange(power.size)
    share = np.zeros(power.size)
    for kind in ((order > 0) & (order % teeth == 0), order % teeth != 0):
        scale = (power / floor)[kind]
        excess = np.sum((scatter / floor - 1.0)[kind] * scale) / max(np.sum(scale**2), 1e-300)
        share[kind] = max(excess, 0.0)
    return floor + share * power
