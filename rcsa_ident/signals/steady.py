"""A recording's steady part: its speed, its lines, and the absolute displacement of the flange in them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rcsa_ident.base.arrays import ComplexArray, FloatArray
from rcsa_ident.base.errors import Unsteady
from rcsa_ident.base.units import to_hz
from rcsa_ident.dynamics.coordinates import Dof
from rcsa_ident.signals.active_segment import loud_part
from rcsa_ident.signals.motion import MotionChannels, motion_channels
from rcsa_ident.signals.recording import Recording
from rcsa_ident.signals.sound.rotation import Rotation, follow_changes
from rcsa_ident.signals.sound.speed_search import rotation_near
from rcsa_ident.signals.spectra import LineSpectrum, line_spectrum, refine_speed, segment_lines
from rcsa_ident.signals.steady_part import steady_part, steady_window

#: Least number of revolutions of a steady part.
LEAST_REVOLUTIONS = 8.0


@dataclass(frozen=True, slots=True, eq=False)
class SteadyRecord:
    """The steady part of a recording.

    `channels`: those of the recording that matter: of the machine's axes with a displacement sensor; where there is none, of those with an
        accelerometer on the spindle's housing
    `window`, `part`: slice, what was looked at (all of a recording that is not long, see `steady_window`), and the steady part in it
    `teeth`: 1 for an air cut
    `lines`: lines of these channels; phases from the recording's first sample
    `deviation`: array or None, shape (n,) [rad]; of the spindle's angle in the steady part from that at its mean speed; None where it turns
        evenly
    `outputs` [m], shape (orders, channels): displacement that each of them shows
    `output_variance` [m^2], shape (orders, channels): variance of the real and of the imaginary part each
    `rotation`: of the spindle in the steady part, as accelerometers on the housing told it; None where the flange's displacement did
    """

    recording: Recording
    channels: MotionChannels
    window: slice
    part: slice
    teeth: int
    lines: LineSpectrum
    deviation: FloatArray | None
    outputs: ComplexArray
    output_variance: FloatArray
    rotation: Rotation | None = None

    @property
    def axes(self) -> tuple[Dof, ...]:
        """Machine axes whose motion was recorded."""
        return self.channels.axes

    @property
    def flange(self) -> ComplexArray:
        """Absolute displacement of the flange, or of the housing, at each order, shape (orders, axes) [m]."""
        return self._summed(self.outputs)

    @property
    def variance(self) -> FloatArray:
        """Variance of its real and of its imaginary part each, shape (orders, axes) [m^2]."""
        return self._summed(self.output_variance)

    def absolute(self, omega: FloatArray) -> ComplexArray:
        """Return the share of each channel in the absolute displacement of the flange, or of the housing, shape (n, channels, axes)."""
        weights: ComplexArray = self._summed(self.channels.weights(omega))
        return weights

    def _summed(self, outputs: NDArray[Any]) -> NDArray[Any]:
        return np.stack([np.sum(outputs[..., self.channels.searched(axis)], axis=-1) for axis in self.axes], axis=-1)

    @property
    def housing(self) -> bool:
        """Whether it is the housing's motion alone that was recorded, and not the flange's."""
        return not self.channels.of_flange

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
        return self.recording.samples[self.part][:, self.channels.columns[: len(self.axes)]]

    def seen_by(self, channels: MotionChannels) -> SteadyRecord:
        """Return the same part of the recording, as other channels of it show it: accelerometers at another place."""
        rate = self.recording.rate
        samples = self.recording.samples[self.part][:, channels.columns]
        # every line of an acceleration, as in `steady_record`
        every = line_spectrum(samples, rate, self.spindle_speed, rate, self.deviation)
        kept = slice(self.highest_order + 1)
        lines = replace(every, amplitude=every.amplitude[kept], variance=every.variance[kept], scatter=every.scatter[kept])
        lines = _from_first_sample(lines, self.part, rate)
        return record_of_lines(self.recording, channels, self.window, self.part, self.teeth, lines, self.deviation, self.rotation)

    def segments(self, order: np.ndarray, count: int) -> ComplexArray:
        """Return the absolute displacement in half-overlapping Hann segments, shape (count, orders, axes) [m]."""
        samples = self.recording.samples[self.part][:, self.channels.columns]
        omega = order * self.spindle_speed
        lines = segment_lines(samples, self.recording.rate, self.spindle_speed, order, count, self.deviation)
        lines = lines * np.exp(-1j * omega * self.part.start / self.recording.rate)[:, None]
        return self._summed(np.einsum("smc,mck->smk", lines, self.channels.weights(omega)))


def steady_record(
    recording: Recording,
    axes: Sequence[Dof],
    programmed: float,
    max_frequency: float,
    teeth: int,
    whole: bool = False,
    housing: bool = True,
) -> SteadyRecord:
    """Return the steady part of a recording with its speed and lines.

    `axes`: as `measured_axes` returns them
    `programmed` [rad/s]: the spindle speed that was set; the true one is looked for near it
    `max_frequency` [Hz]: highest line
    `teeth`: 1 for an air cut
    `whole`: look at all of a long recording, not at a window, and take its speed as constant: for who goes through all of it so
    `housing`: accelerometers on the housing beside displacement sensors are read, too
    Raises `InputError` if the displacement of an axis is missing, or as `MotionChannels`.
    Raises `Unsteady` if there is no steady part; what was found says why.
    """
    rate, n = recording.rate, recording.samples.shape[0]
    least = LEAST_REVOLUTIONS * 2.0 * np.pi / programmed * rate
    if n < least:
        raise _no_steady_part(f"too short: {n / rate:.3g} s hold fewer than {LEAST_REVOLUTIONS:.0f} revolutions")
    channels = motion_channels(recording.sensors, axes, housing)
    columns = channels.columns
    window = slice(0, n) if whole else steady_window(recording, columns[: len(axes)], programmed, teeth)
    samples = recording.samples[window][:, columns]
    displacement = samples[:, : len(axes)]
    accelerations = not channels.of_flange
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
    highest = rate if accelerations or channels.beside else max_frequency
    lines = line_spectrum(samples[steady], rate, speed, highest, deviation).up_to(max_frequency)
    part = slice(window.start + steady.start, window.start + steady.stop)
    lines = _from_first_sample(lines, part, rate)
    return record_of_lines(recording, channels, window, part, teeth, lines, deviation, rotation)


def _from_first_sample(lines: LineSpectrum, part: slice, rate: float) -> LineSpectrum:
    """Lines of a part with their phases from the recording's first sample."""
    if not part.start:
        return lines
    shift = np.exp(-1j * np.arange(lines.amplitude.shape[0]) * lines.spindle_speed * part.start / rate)
    return replace(lines, amplitude=lines.amplitude * shift[:, None])


def record_of_lines(
    recording: Recording,
    channels: MotionChannels,
    window: slice,
    part: slice,
    teeth: int,
    lines: LineSpectrum,
    deviation: FloatArray | None,
    rotation: Rotation | None = None,
) -> SteadyRecord:
    """Return the steady record with these lines of its channels; parameters as those of `SteadyRecord`."""
    weight = channels.weights(np.arange(lines.amplitude.shape[0]) * lines.spindle_speed)
    noise = np.stack([_line_variance(lines, c, teeth) for c in range(len(channels.columns))], axis=1)
    outputs = np.einsum("mc,mck->mk", lines.amplitude, weight)
    variance = np.einsum("mc,mck->mk", noise, np.abs(weight) ** 2)
    return SteadyRecord(recording, channels, window, part, teeth, lines, deviation, outputs, variance, rotation)


def _turning(displacement: FloatArray, rate: float, speed: float) -> tuple[float, FloatArray | None]:
    """The spindle's mean speed, followed where it changes, and what its angle deviates from that."""
    rotation = follow_changes(displacement, rate, to_hz(speed))
    return (speed, None) if rotation is None else rotation.about(speed)


def _no_steady_part(found: str) -> Unsteady:
    return Unsteady("recording", found, "a steady record of the programmed speed")


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
