"""From one cut's recordings to points of the cross FRF, with everything that is uncertain about them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from rcsa_ident.cutting.coefficients import CuttingCoefficients
from rcsa_ident.cutting.conditions import CuttingConditions
from rcsa_ident.cutting.cutter import Cutter
from rcsa_ident.cutting.force import force_lines
from rcsa_ident.dynamics.arrays import ComplexArray, FloatArray
from rcsa_ident.dynamics.coordinates import Dof
from rcsa_ident.errors import InputError
from rcsa_ident.signals.recording import Quantity, Recording
from rcsa_ident.signals.spectra import LineSpectrum, line_spectrum, refine_speed
from rcsa_ident.signals.verdict import Verdict, chatter, raw_faults, speed_faults, tooth_count_fault
from rcsa_ident.signals.windows import steady_part

#: Highest line that is used [Hz].
MAX_FREQUENCY = 4300.0
#: Share of the largest force line below which a line says nothing.
WEAKEST_FORCE = 1e-3


@dataclass(frozen=True, slots=True, eq=False)
class AxisLines:
    """Lines of one axis at the tooth-passing harmonics of one cut.

    Parameters
    ----------
    order : array of int, shape (n,)
        Multiples of the spindle frequency.
    omega : array, shape (n,) [rad/s]
    cut, air : complex arrays, shape (n,) [m/N]
        Absolute flange displacement over the simulated force with tooth 1 at immersion 0 at the record's start; the air
        cut's line is turned by the best estimate of the angle between both records.
    variance : array, shape (n,) [m^2/N^2]
        Of the real and of the imaginary part of cut - air each.
    coherence : array, shape (n,) [-]
    force : complex array, shape (n,) [N]
    """

    order: np.ndarray
    omega: FloatArray
    cut: ComplexArray
    air: ComplexArray
    variance: FloatArray
    coherence: FloatArray
    force: ComplexArray

    @property
    def receptance(self) -> ComplexArray:
        """Flange displacement per tip force, up to the cut's delay: true value times e^{-i omega delay}."""
        return self.cut - self.air


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
        When tooth 1 stood at immersion 0, from a trigger whose tooth angle is known.
    """

    cut_id: str
    tooling: str
    spindle_speed: float
    axes: Mapping[Dof, AxisLines]
    alignment_std: float
    delay: float | None = None
    delay_std: float | None = None


@dataclass(frozen=True, slots=True)
class Reading:
    """A record's verdict and, where it is usable, its measurement."""

    verdict: Verdict
    measurement: CutMeasurement | None = None


def measure_cut(
    cut_id: str,
    tooling: str,
    cut: Recording,
    air: Recording | None,
    cutter: Cutter,
    conditions: CuttingConditions,
    coefficients: CuttingCoefficients,
    max_frequency: float = MAX_FREQUENCY,
) -> Reading:
    """Return the cross FRF's points of one cut, or why there are none.

    Parameters
    ----------
    cut, air : Recording
        Displacement channels for X and/or Y, accelerometers of the fixture where there are some.
    conditions : CuttingConditions
        As programmed; forces are simulated at the speed found in the record.

    Raises
    ------
    InputError
        If no displacement channel is there.
    """
    faults = raw_faults(cut) + tuple(f"air cut: {fault}" for fault in (raw_faults(air) if air is not None else ()))
    if faults:
        return Reading(Verdict(faults))
    axes = [axis for axis in (Dof.X, Dof.Y) if cut.channel(Quantity.DISPLACEMENT, axis) is not None]
    if not axes:
        raise InputError("sensors", "no displacement", "a displacement sensor for X or Y", cut_id)
    channels = _displacement_columns(cut, axes)
    found = _lines(cut, channels, conditions.spindle_speed, max_frequency, cutter.teeth)
    if isinstance(found, str):
        return Reading(Verdict((found,)))
    speed, lines, displacement = found
    highest = lines.amplitude.shape[0] - 1
    faults = speed_faults(displacement, cut.rate, speed, conditions.spindle_speed, highest)
    if faults:
        return Reading(Verdict(faults))
    notes: list[str] = []
    absolute, noise = _absolute(cut, lines, axes)
    still, still_noise, alignment_std = np.zeros_like(absolute), np.zeros_like(noise), 0.0
    if air is None:
        notes.append("no air cut: run-out and roundness of the flange are left in the lines that the teeth share with them")
    else:
        turned = _air_lines(cut, air, axes, absolute, speed, conditions.spindle_speed, max_frequency, cutter.teeth)
        if isinstance(turned, str):
            return Reading(Verdict((f"air cut: {turned}",)))
        still, still_noise, alignment_std = turned
    difference = absolute - still
    harmonic = np.arange(cutter.teeth, highest + 1, cutter.teeth)
    if harmonic.size == 0:
        return Reading(Verdict((f"no tooth-passing line below {max_frequency:.0f} Hz",)))
    forced = np.abs(difference[harmonic]).max(axis=0)
    reasons = [chatter(lines, _displacement_indices(cut, axes), forced, (0.5 * cutter.teeth * speed / (2 * np.pi), max_frequency))]
    if air is not None and cutter.equally_spaced:
        reasons.append(tooth_count_fault(np.sum(np.abs(difference) ** 2, axis=1), cutter.teeth))
    if any(reasons):
        return Reading(Verdict(tuple(r for r in reasons if r)))
    true_conditions = CuttingConditions(
        speed, conditions.axial_depth, conditions.feed_per_tooth, conditions.engagement, conditions.feed_angle
    )
    force = force_lines(cutter, true_conditions, coefficients, harmonic)
    strong = np.abs(force).max()
    result: dict[Dof, AxisLines] = {}
    for i, axis in enumerate(axes):
        f = force[:, 0 if axis is Dof.X else 1]
        keep = np.abs(f) > WEAKEST_FORCE * strong
        if not keep.any():
            continue
        m = harmonic[keep]
        variance = (noise[m, i] + still_noise[m, i]) / np.abs(f[keep]) ** 2
        response = np.abs(difference[m, i] / f[keep]) ** 2
        result[axis] = AxisLines(
            m, m * speed, absolute[m, i] / f[keep], still[m, i] / f[keep], variance, response / (response + 2.0 * variance), f[keep]
        )
    delay, delay_std = _trigger_delay(cut, speed)
    measurement = CutMeasurement(cut_id, tooling, speed, result, alignment_std, delay, delay_std)
    return Reading(Verdict((), tuple(notes)), measurement)


def _displacement_indices(recording: Recording, axes: list[Dof]) -> list[int]:
    kinds = [(sensor.quantity, sensor.axis) for sensor in recording.sensors]
    return [kinds.index((Quantity.DISPLACEMENT, axis)) for axis in axes]


def _displacement_columns(recording: Recording, axes: list[Dof]) -> FloatArray:
    return recording.samples[:, _displacement_indices(recording, axes)]


def _lines(
    recording: Recording, displacement: FloatArray, programmed: float, max_frequency: float, teeth: int
) -> tuple[float, LineSpectrum, FloatArray] | str:
    """Speed, lines of displacement and acceleration together, and the displacement in the steady part."""
    if displacement.shape[0] < 8.0 * 2.0 * np.pi / programmed * recording.rate:
        return f"too short: {displacement.shape[0] / recording.rate:.3g} s hold fewer than 8 revolutions"
    rough = refine_speed(displacement, recording.rate, programmed)
    part = steady_part(displacement, recording.rate, rough, teeth)
    if part.stop - part.start < 8.0 * 2.0 * np.pi / programmed * recording.rate:
        return "no steady part of at least 8 revolutions"
    whole = part == slice(0, displacement.shape[0])
    speed = rough if whole else refine_speed(displacement[part], recording.rate, rough)
    lines = line_spectrum(recording.samples[part], recording.rate, speed, max_frequency)
    if part.start:
        shift = np.exp(-1j * np.arange(lines.amplitude.shape[0]) * speed * part.start / recording.rate)
        lines = LineSpectrum(speed, lines.amplitude * shift[:, None], lines.variance, lines.scatter, lines.rest, lines.rate)
    return speed, lines, displacement[part]


def _absolute(recording: Recording, lines: LineSpectrum, axes: list[Dof]) -> tuple[ComplexArray, FloatArray]:
    """Absolute flange displacement, gap plus fixture (-a / omega^2), and its variance; shapes (orders, axes)."""
    order = np.arange(lines.amplitude.shape[0])
    omega = order * lines.spindle_speed
    safe = np.where(order == 0, np.inf, omega)
    amplitude = np.zeros((order.size, len(axes)), dtype=complex)
    variance = np.zeros((order.size, len(axes)))
    for i, axis in enumerate(axes):
        for quantity, factor in ((Quantity.DISPLACEMENT, np.ones(order.size)), (Quantity.ACCELERATION, -1.0 / safe**2)):
            for c, sensor in enumerate(recording.sensors):
                if sensor.quantity is quantity and sensor.axis is axis:
                    weight = factor / sensor.response(omega)
                    amplitude[:, i] += weight * lines.amplitude[:, c]
                    variance[:, i] += np.abs(weight) ** 2 * _line_variance(lines, c)
                    break
    return amplitude, variance


def _line_variance(lines: LineSpectrum, channel: int) -> FloatArray:
    """Noise floor beside each line, raised where the quarters of the record scatter more than it explains."""
    floor, scatter = lines.variance[:, channel], lines.scatter[:, channel]
    ratio = scatter[1:] / np.maximum(floor[1:], 1e-300)
    return floor * max(1.0, float(np.median(ratio)))


def _air_lines(
    cut: Recording,
    air: Recording,
    axes: list[Dof],
    cut_lines: ComplexArray,
    cut_speed: float,
    programmed: float,
    max_frequency: float,
    teeth: int,
) -> tuple[ComplexArray, FloatArray, float] | str:
    """The air cut's lines in the cut's time, their variance, and the standard deviation of the angle between both."""
    found = _lines(air, _displacement_columns(air, axes), programmed, max_frequency * 1.02, teeth=1)
    if isinstance(found, str):
        return found
    speed, lines, displacement = found
    faults = speed_faults(displacement, air.rate, speed, programmed, lines.amplitude.shape[0] - 1)
    if faults:
        return faults[0]
    amplitude, variance = _absolute(air, lines, axes)
    orders = cut_lines.shape[0]
    if amplitude.shape[0] < orders:
        missing = orders - amplitude.shape[0]
        amplitude = np.pad(amplitude, ((0, missing), (0, 0)))
        variance = np.pad(variance, ((0, missing), (0, 0)), mode="edge")
    amplitude, variance = amplitude[:orders], variance[:orders]
    edges = trigger_edge(cut, cut_speed), trigger_edge(air, speed)
    if edges[0] is not None and edges[1] is not None:
        (at_cut, std_cut), (at_air, std_air) = edges
        angle = speed * at_air - cut_speed * at_cut
        std = float(np.hypot(speed * std_air, cut_speed * std_cut))
    else:
        angle, std = align(cut_lines, amplitude, teeth)
    return amplitude * np.exp(1j * np.arange(orders) * angle)[:, None], variance, std


def align(cut: ComplexArray, air: ComplexArray, teeth: int, highest: int = 16) -> tuple[float, float]:
    """Return the angle by which the air cut's profile must be turned to lie under the cut's, and its standard deviation.

    Only orders that the teeth do not share carry it: run-out and roundness of the flange. Cutter run-out adds force on
    them; what it leaves unexplained widens the standard deviation.

    Parameters
    ----------
    cut, air : complex arrays, shape (orders, axes) [m]

    Returns
    -------
    (float, float) [rad]
    """
    order = np.arange(1, min(highest, cut.shape[0] - 1) + 1)
    order = order[order % teeth != 0] if teeth > 1 else order
    c, a = cut[order], air[order]
    # least squares |c - a e^{i m angle}|^2 is the largest real part of sum conj(c) a e^{i m angle}
    cross = np.sum(np.conj(c) * a, axis=1)
    trial = np.linspace(0.0, 2.0 * np.pi, 64 * int(order.max()), endpoint=False)
    angle = float(trial[np.argmax(np.real(np.exp(1j * np.outer(trial, order)) @ cross))])
    for _ in range(20):
        turned = cross * np.exp(1j * order * angle)
        curvature = np.sum(order**2 * turned.real)
        change = -np.sum(order * turned.imag) / curvature if curvature > 0.0 else 0.0
        angle += change
        if abs(change) < 1e-12:
            break
    left = np.sum(np.abs(c - a * np.exp(1j * order * angle)[:, None]) ** 2)
    information = np.sum(order[:, None] ** 2 * np.abs(a) ** 2)
    if information == 0.0:
        return 0.0, np.pi
    degrees_of_freedom = max(2 * c.size - 1, 1)
    # residuals of run-out orders are not alike: half of them may carry all of it
    return angle, float(min(np.sqrt(2.0 * left / degrees_of_freedom / information) + 1e-4, np.pi))


def trigger_edge(recording: Recording, speed: float) -> tuple[float, float] | None:
    """Return the time of the first trigger edge from all edges of the record together, and its standard deviation [s].

    A sampled edge is seen at the first sample behind it, half a sample late on average.
    """
    found = recording.channel(Quantity.TRIGGER)
    if found is None:
        return None
    sensor, x = found
    high = x > 0.5 * (x.min() + x.max())
    edges = np.flatnonzero(high[1:] & ~high[:-1]) + 1
    if edges.size < 2 or np.ptp(x) == 0.0:
        return None
    times = (edges - 0.5) / recording.rate - sensor.delay
    period = 2.0 * np.pi / speed / sensor.pulses_per_revolution
    count = np.round((times - times[0]) / period)
    first = float(np.mean(times - count * period))
    return first, float(max(np.sqrt(1.0 / 12.0 / edges.size), 0.02) / recording.rate)


def _trigger_delay(recording: Recording, speed: float) -> tuple[float | None, float | None]:
    edge = trigger_edge(recording, speed)
    found = recording.channel(Quantity.TRIGGER)
    if edge is None or found is None or found[0].tooth_angle is None:
        return None, None
    return edge[0] - found[0].tooth_angle / speed, edge[1]
