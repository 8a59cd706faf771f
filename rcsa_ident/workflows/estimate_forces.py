"""Cutting forces of a recording on an identified machine: everything from the channels to newtons with their bands."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from rcsa_ident.base.arrays import ComplexArray, FloatArray, frozen
from rcsa_ident.base.errors import InputError, Unsteady
from rcsa_ident.base.shown import Drawn
from rcsa_ident.base.units import to_hz, to_rpm
from rcsa_ident.coupling.rcsa import SPINDLE
from rcsa_ident.cutting.conditions import CuttingConditions
from rcsa_ident.cutting.cutter import Cutter
from rcsa_ident.dynamics.coordinates import Coordinate, Dof
from rcsa_ident.dynamics.receptance import Receptance
from rcsa_ident.machine.machine import Machine
from rcsa_ident.observer.coupled_transfer import coupled_transfer
from rcsa_ident.observer.design import AxisSettings, axis_observer, coupled_observer
from rcsa_ident.observer.force import ForceEstimate, ForceObserver, RunOut, force_observer
from rcsa_ident.observer.force_model import ForceModel
from rcsa_ident.observer.response import ObserverFRF, observer_response
from rcsa_ident.observer.transfer_function import HIGHEST, TransferFunction, transfer_function
from rcsa_ident.observer.tuning import ObserverMethod, Resonators, Tuning, harmonics
from rcsa_ident.observer.wear import WearIndicators, wear_indicators
from rcsa_ident.signals.alignment import angle_to_air
from rcsa_ident.signals.measurement import NO_AIR
from rcsa_ident.signals.motion import measured_axes, motion_channels
from rcsa_ident.signals.recording import Quantity, Recording, Role
from rcsa_ident.signals.spectra import line_spectrum
from rcsa_ident.signals.steady import SteadyRecord, steady_record
from rcsa_ident.signals.verdict import raw_faults, speed_faults
from rcsa_ident.tool_holder.geometry import ToolAssembly

#: The band begins this much below the lowest identified line: a model is as good a little beyond its last point.
BELOW = 0.7
#: Step of the receptances that the transfer function is fitted to [Hz].
STEP_HZ = 5.0
#: An air cut's line is taken out where its power stands this far above its variance.
VISIBLE = 9.0
#: A standard deviation of the angle between cut and air cut above which taking out run-out does more harm than good [rad].
LOOSE_ANGLE = 0.1
#: Share of the vibration's power at the spindle's orders below which the speed is wrong, and below which that is worth a word.
UNRELATED, PERIODIC = 0.5, 0.9
METHOD = Resonators()


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class MonitoredCut(Drawn):
    """Forces of a recording and what they rest on.

    Parameters
    ----------
    estimate : ForceEstimate
        Without the observer's start; of a recording that is too short for that, the second half.
    observer : ForceObserver
        As it was made for this machine, tooling, sensors and speed: ready to stream.
    spindle_speed : float [rad/s]
        From the record.
    teeth : int
    band : two floats [rad/s]
        In which forces are estimated.
    response : mapping of Dof to ObserverFRF
        Compensated with the identified machine.
    model_error : mapping of Dof to float [N]
        Standard deviation of the force that the machine's posterior leaves; part of the estimate's bands.
    noise : mapping of Dof to float [m]
        Standard deviation of a displacement sample, found between the record's lines.
    notes : tuple of str
        What the user should know of recording and machine.

    Examples
    --------
    >>> import rcsa_ident as ri
    >>> found, campaign = ri.read_result("RESULT.json"), ri.read_campaign("sample_runs")
    >>> monitored = ri.estimate_forces(found, campaign.toolings["S2-PG25"], campaign.cuts[15])
    >>> monitored.estimate.force.shape
    (3584, 2)
    >>> print(monitored.save("FORCES.csv"))
    FORCES.csv
    """

    estimate: ForceEstimate
    observer: ForceObserver
    spindle_speed: float
    teeth: int
    band: tuple[float, float]
    response: Mapping[Dof, ObserverFRF]
    model_error: Mapping[Dof, float]
    noise: Mapping[Dof, float]
    notes: tuple[str, ...] = field(default=())

    def __str__(self) -> str:
        low, high = (to_hz(w) for w in self.band)
        return f"{self.estimate}, {to_rpm(self.spindle_speed):.0f} rev/min, {low:.0f} to {high:.0f} Hz"

    @property
    def remarks(self) -> tuple[str, ...]:
        """The notes, and whether the recording ended before the observer could settle for good."""
        estimate, needed = self.estimate, self.observer.settling * self.estimate.step
        if estimate.start > needed - 0.5 * estimate.step:
            return self.notes
        length = estimate.start + estimate.force.shape[0] * estimate.step
        return (
            *self.notes,
            f"the observer needs {needed:.2g} s to settle and the recording lasts {length:.2g} s: its first half is left out, "
            "and forces soon behind it may still be wrong",
        )


def observe(
    machine: Machine,
    assembly: ToolAssembly,
    teeth: int,
    cut: Recording,
    air: Recording | None,
    programmed: float | None = None,
    method: ObserverMethod = METHOD,
    bandwidth: float | None = None,
    smooth: bool = False,
) -> MonitoredCut:
    """Return the forces of one recording.

    `machine`: its flange without the joint in front of it, and the joint: the sensor looks at the spindle
    `assembly`: of the tooling that was cut with; it need not be one of the identification's
    `cut`, `air`: the air cut, where there is one, with the same clamping and speed: its run-out is taken out
    `programmed` [rad/s]: spindle speed, to 1 %; by default from the trigger
    `method`: `Resonators` or `PaperWalk`
    `bandwidth` [rad/s]: up to which the observer shall follow the force; by default the end of the identified band
    `smooth`: every sample given the whole record, without lag; else as it would be live
    Raises `InputError` if the recording has no displacement or no speed, or the machine's flange holds the joint's compliance, as a
        decoupled one does.
    Raises `Unsteady` if it has lost samples, no steady part, or a vibration that does not follow the speed.
    """
    faults = (*raw_faults(cut), *(f"air cut: {fault}" for fault in (raw_faults(air) if air is not None else ())))
    if faults:
        raise Unsteady("recording", "; ".join(faults), "a record without lost, frozen or clipped samples")
    axes = tuple(axis for axis in measured_axes(cut.sensors) if axis in machine.axes)
    if not axes or cut.sensor(Quantity.DISPLACEMENT) is None:
        raise InputError("sensors", "no displacement along an identified axis", "a displacement sensor for X or Y")
    turned = [s for s in motion_channels(cut.sensors, axes, housing=False).sensors if s.rotation != 0.0]
    if turned:
        found = f"{np.degrees(turned[0].rotation):g}"
        raise InputError(f"sensors.{turned[0].name}.rotation_deg", found, "0: forces need sensors along the machine's axes")
    machine.check_behind_joint(axes)
    programmed = trigger_speed(cut) if programmed is None else programmed
    assert machine.band is not None
    identified = machine.band
    top = min(identified[1], HIGHEST * 2.0 * np.pi * cut.rate)
    steady = steady_record(cut, axes, programmed, top / (2.0 * np.pi), teeth, whole=True, housing=False)
    speed = steady.spindle_speed
    notes: list[str] = [*speed_faults(steady.motion, steady.lines, programmed)]
    _periodic(steady, programmed, notes)
    answers = identified if machine.ends else (0.0, np.inf)
    band = _band(identified, max(BELOW * identified[0], answers[0]), top, speed, teeth, notes)
    run_out = _run_out(steady, air, axes, programmed, top, teeth, notes)
    known = machine.speed_range
    if known is not None and not known[0] * (1.0 - 1e-9) <= speed <= known[1] * (1.0 + 1e-9):
        low, high = (to_rpm(each) for each in known)
        notes.append(
            f"the machine was identified from {low:.0f} to {high:.0f} rev/min, the recording was made at {to_rpm(speed):.0f} rev/min"
        )
    omega = 2.0 * np.pi * np.arange(max(0.25 * band[0] / (2.0 * np.pi), STEP_HZ), 1.3 * band[1] / (2.0 * np.pi), STEP_HZ)
    omega = omega[(omega >= answers[0]) & (omega <= answers[1])]
    here = machine.at(speed)
    behind = _looks(cut, axes)
    coupled = here.coupled(assembly, omega, axes, behind)
    tuning = {axis: Tuning(_noise(steady, i), bandwidth or band[1], _response_time(method, speed)) for i, axis in enumerate(axes)}
    together = _feel_each_other(here, axes)
    if not together:
        _unseen(here, coupled, axes, omega, band, notes)
    cross = _cross(coupled, axes)
    shown = np.stack([_gap_response(cut, axis, omega) for axis in axes], axis=1)

    def settings(transfer: TransferFunction, i: int) -> AxisSettings:
        force = method.force_model(tuning[axes[i]], transfer, speed, teeth)
        return _settings(steady, axes[i], i, omega, force, tuning[axes[i]].noise_floor, method, speed, run_out)

    if together:
        both = coupled_transfer(omega, cross, 1.0 / cut.rate, band, shown)
        observer = coupled_observer([settings(both.direct(i), i) for i in range(len(axes))], both)
    else:
        single = [transfer_function(omega, cross[:, i, i], 1.0 / cut.rate, band, shown[:, i]) for i in range(len(axes))]
        observer = force_observer([axis_observer(settings(transfer, i), transfer) for i, transfer in enumerate(single)])
    whole = observer.observe(*_signals(cut, axes), smooth=smooth)
    estimate = whole.after(min(observer.settling, whole.force.shape[0] // 2))
    if not method.colours_noise:
        estimate = replace(estimate, force=_above(estimate.force, band[0], estimate.step))
    errors: dict[Dof, float] = {}
    for group in observer.groups:
        errors |= _model_error(here, axes[group], behind, assembly, estimate, band, speed)
    response = _responses(observer, omega, cross, cut, speed, smooth)
    return MonitoredCut(
        _widened(estimate, [errors[axis] for axis in axes]),
        observer,
        speed,
        teeth,
        band,
        response,
        errors,
        {axis: each.noise_floor for axis, each in tuning.items()},
        tuple(notes),
    )


def trigger_speed(recording: Recording) -> float:
    """Return the spindle's mean speed from a recording's trigger [rad/s].

    Raises `InputError` without a trigger, or with fewer than three edges.
    """
    found = recording.channel(Quantity.TRIGGER)
    if found is None:
        raise InputError("spindle_speed", "none, and no trigger in the recording", "the programmed spindle speed [rev/min]")
    sensor, signal = found
    high = signal > 0.5 * (np.nanmin(signal) + np.nanmax(signal))
    edges = np.flatnonzero(high[1:] & ~high[:-1])
    if edges.size < 3:
        found_edges = f"none, and {edges.size} rising edges of the trigger"
        raise Unsteady("spindle_speed", found_edges, "the programmed spindle speed [rev/min], or three rising edges or more")
    # the median shrugs off a stray or a lost edge
    return float(2.0 * np.pi * recording.rate / np.median(np.diff(edges)) / sensor.pulses_per_revolution)


def _periodic(steady: SteadyRecord, programmed: float, notes: list[str]) -> None:
    """Refuse a speed whose orders the vibration does not follow; say where a good part of it does not."""
    signals = steady.motion - steady.motion.mean(axis=0)
    share = 1.0 - float(np.sum(steady.lines.off_orders[:, : signals.shape[1]] ** 2) / max(np.sum(signals**2), 1e-300))
    if share < UNRELATED:
        found = f"{to_rpm(programmed):.0f} rev/min, whose orders account for {100.0 * share:.0f} % of the vibration"
        raise Unsteady("spindle_speed", found, "the spindle speed to within 1 % [rev/min], in a cut without chatter")
    if share < PERIODIC:
        notes.append(f"{100.0 * (1.0 - share):.0f} % of the vibration is not at orders of the spindle: chatter, or an unsteady cut")


def _band(identified: tuple[float, float], low: float, top: float, speed: float, teeth: int, notes: list[str]) -> tuple[float, float]:
    """Where forces are estimated, and what that leaves out."""
    hz = 2.0 * np.pi
    if low >= 0.9 * top:
        raise InputError("band", f"{low / hz:.0f} to {top / hz:.0f} Hz", "one that the sampling rate can hold")
    fundamental = speed * teeth
    if fundamental < low:
        share = f"harmonics below {low / hz:.0f} Hz are left out"
        notes.append(
            f"the tooth-passing frequency, {fundamental / hz:.0f} Hz, lies below the range in which the identified model is valid: {share}"
        )
    elif fundamental < identified[0]:
        notes.append(
            f"the tooth-passing frequency, {fundamental / hz:.0f} Hz, lies below the identified band, which begins at "
            f"{identified[0] / hz:.0f} Hz: its part of the force is extrapolated"
        )
    return low, top


def _run_out(
    cut: SteadyRecord, air: Recording | None, axes: tuple[Dof, ...], programmed: float, top: float, teeth: int, notes: list[str]
) -> tuple[FloatArray, ComplexArray] | None:
    """Orders and the air cut's lines of the cut's columns, turned to lie under it, shapes (o,) and (o, c)."""
    if air is None:
        notes.append(NO_AIR)
        return None
    still = steady_record(air, axes, programmed, 1.02 * top / (2.0 * np.pi), 1, whole=True, housing=False)
    angle, std = angle_to_air(cut, still, teeth)
    if std > LOOSE_ANGLE:
        notes.append(f"the angle between cut and air cut is known only to {np.degrees(std):.0f}°: run-out is not subtracted")
        return None
    count = min(cut.highest_order, still.highest_order)
    order = np.arange(1, count + 1)
    lines, noise = still.lines.amplitude[1 : count + 1], still.lines.variance[1 : count + 1]
    places = [_place(still, kind) for kind in _kinds(cut)]
    lines, noise = lines[:, places], noise[:, places]
    shown = np.abs(lines) ** 2 > VISIBLE * noise
    turned = np.where(shown, lines, 0.0) * np.exp(1j * order * angle)[:, None]
    keep = shown.any(axis=1)
    return order[keep].astype(float), turned[keep]


def _kinds(steady: SteadyRecord) -> list[tuple[Quantity, Dof | None]]:
    return [(sensor.quantity, sensor.axis) for sensor in steady.channels.sensors]


def _place(steady: SteadyRecord, kind: tuple[Quantity, Dof | None]) -> int:
    kinds = _kinds(steady)
    if kind not in kinds:
        raise InputError("sensors", f"no {kind[0]} {kind[1]} in the air cut", "the same sensors for a cut and its air cut")
    return kinds.index(kind)


def _noise(steady: SteadyRecord, column: int) -> float:
    """Standard deviation of a channel's sample, from the quieter half of what stands between the lines."""
    count = steady.part.stop - steady.part.start
    floor = np.sort(steady.lines.variance[1:, column])
    return float(np.sqrt(max(np.median(floor[: max(floor.size // 2, 1)]), 1e-300) * count / 2.0))


def _response_time(method: ObserverMethod, speed: float) -> float:
    return float(method.response_turns * 2.0 * np.pi / speed)


def _gap_response(recording: Recording, axis: Dof, omega: FloatArray) -> ComplexArray:
    """Frequency response of an axis' displacement sensor, shape (n,)."""
    shown = recording.channel(Quantity.DISPLACEMENT, axis)
    assert shown is not None
    return shown[0].response(omega)


def _settings(
    steady: SteadyRecord,
    axis: Dof,
    column: int,
    omega: FloatArray,
    force: ForceModel,
    noise: float,
    method: ObserverMethod,
    speed: float,
    run_out: tuple[FloatArray, ComplexArray] | None,
) -> AxisSettings:
    """What the record says of one axis."""
    fixture = steady.recording.accelerometer(axis, Role.FIXTURE)
    place = None if fixture is None else _kinds(steady).index((Quantity.ACCELERATION, axis))
    turned = None
    if run_out is not None:
        order, lines = run_out
        turned = RunOut(speed, order, lines[:, column], np.zeros(order.size) if place is None else lines[:, place])
    colours = method.colours_noise
    return AxisSettings(
        axis,
        force,
        noise,
        acceleration_noise=_noise(steady, place) if place is not None and colours else 0.0,
        accelerometer=place is not None,
        sensor_ratio=None if fixture is None else (omega, _gap_response(steady.recording, axis, omega) / fixture.response(omega)),
        run_out=turned,
        spindle_speed=speed if colours else 0.0,
    )


def _responses(
    observer: ForceObserver, omega: FloatArray, cross: ComplexArray, recording: Recording, speed: float, smooth: bool
) -> dict[Dof, ObserverFRF]:
    """The observer's responses, compensated with the identified machine's C31."""
    axes, lines = [each.axis for each in observer.axes], harmonics(speed, 1, observer.axes[0].transfer.band)

    def seen(values: ComplexArray, w: FloatArray) -> ComplexArray:
        return values * np.stack([_gap_response(recording, axis, w) for axis in axes], axis=1)[:, :, None]

    at_lines = np.empty((lines.size, *cross.shape[1:]), dtype=complex)
    for place in np.ndindex(cross.shape[1:]):
        one = cross[:, *place]
        at_lines[:, *place] = np.interp(lines, omega, one.real) + 1j * np.interp(lines, omega, one.imag)
    found = observer_response(observer, omega, seen(cross, omega), lines, seen(at_lines, lines), smooth)
    return dict(zip(axes, found, strict=True))


def _signals(recording: Recording, axes: tuple[Dof, ...]) -> tuple[FloatArray, FloatArray | None]:
    """Gap and acceleration of the axes, shape (n, a) each; an axis without accelerometer has zeros, and no use for them."""
    gap, acceleration = [], []
    for axis in axes:
        shown, fixture = recording.channel(Quantity.DISPLACEMENT, axis), recording.accelerometer(axis, Role.FIXTURE)
        assert shown is not None
        gap.append(shown[1])
        acceleration.append(np.zeros_like(shown[1]) if fixture is None else recording.samples[:][:, recording.sensors.index(fixture)])
    return np.stack(gap, axis=1), np.stack(acceleration, axis=1)


def _looks(recording: Recording, axes: Sequence[Dof]) -> dict[Dof, float]:
    """How far behind the flange each axis' displacement sensor looks [m]: at the flange itself where nobody has told it."""
    shown = {axis: recording.sensor(Quantity.DISPLACEMENT, axis) for axis in axes}
    return {axis: sensor.distance for axis, sensor in shown.items() if sensor is not None and sensor.distance is not None}


def _cross(coupled: Receptance, axes: Sequence[Dof]) -> ComplexArray:
    """C31: the spindle's motions (rows) over forces at the tip (columns), shape (n, a, a) [m/N]."""
    columns = [np.stack([coupled.between(f"{SPINDLE}.{row}", f"tip.{axis}") for row in axes], axis=1) for axis in axes]
    return np.stack(columns, axis=2)


def _feel_each_other(machine: Machine, axes: tuple[Dof, ...]) -> bool:
    """Whether a force along one of the axes moves the machine along another."""
    return len(axes) > 1 and any(set(axes) <= {c.dof for c in part.coordinates} for part in machine.parts)


def _unseen(
    machine: Machine, coupled: Receptance, axes: tuple[Dof, ...], omega: FloatArray, band: tuple[float, float], notes: list[str]
) -> None:
    """Say what an axis feels of one that nobody measures: its force is taken for one along the axis itself."""
    inside = (omega >= band[0]) & (omega <= band[1])
    for axis in axes:
        part = next(part for part in machine.parts if any(c.dof is axis for c in part.coordinates))
        for other in (c.dof for c in part.coordinates if not c.dof.is_slope and c.dof not in axes):
            own, felt = (np.linalg.norm(coupled.between(f"{SPINDLE}.{axis}", f"tip.{of}")[inside]) for of in (axis, other))
            name, its = axis.upper(), other.upper()
            notes.append(
                f"{name} and {its} feel each other, and {its} has no displacement sensor: a force in {its} moves the spindle in {name} by "
                f"{100.0 * felt / own:.0f} % of what one in {name} does, and is taken for a force in {name}"
            )


def _model_error(
    machine: Machine,
    axes: tuple[Dof, ...],
    behind: Mapping[Dof, float],
    assembly: ToolAssembly,
    estimate: ForceEstimate,
    band: tuple[float, float],
    speed: float,
) -> dict[Dof, float]:
    """Standard deviation of the forces that is left by what is not known of the machine [N]: the forces' lines, each with its C31's.

    Axes that feel each other share the error, dF = C31^-1 dC31 F, with the entries of C31 taken as independent.
    """
    columns = [estimate.axes.index(axis) for axis in axes]
    amplitude = line_spectrum(estimate.force[:, columns], 1.0 / estimate.step, speed, to_hz(band[1])).amplitude
    order = np.arange(amplitude.shape[0])
    order = order[(order * speed >= band[0]) & (order * speed <= band[1])]
    power = np.abs(amplitude[order]) ** 2
    coupled = machine.coupled(assembly, order * speed, axes, behind)
    deviation = coupled.deviation()
    if (Coordinate(SPINDLE, axes[0]), Coordinate("tip", axes[0])) not in deviation:
        return dict.fromkeys(axes, 0.0)
    squares = {entry: known[0] ** 2 + known[1] ** 2 for entry, known in deviation.items()}
    entries = [[(Coordinate(SPINDLE, row), Coordinate("tip", axis)) for axis in axes] for row in axes]
    cross = _cross(coupled, axes)
    # an inverse over which to divide: an axis that stands alone has its own entry's
    size = np.abs(cross) ** 2 if len(axes) == 1 else 1.0 / np.abs(np.linalg.inv(cross)) ** 2
    found = {}
    for f, axis in enumerate(axes):
        parts = [power[:, j] * (squares[entry] / size[:, f, i]) for i, row in enumerate(entries) for j, entry in enumerate(row)]
        found[axis] = float(np.sqrt(0.5 * np.sum(sum(parts))))
    return found


def _above(force: FloatArray, low: float, step: float) -> FloatArray:
    """Forces without what lies below the band: the walk of [inprocess] puts the sensors' drift and integrated noise there."""
    from scipy.signal import butter, sosfiltfilt

    sections = butter(4, 0.5 * low / (2.0 * np.pi), "highpass", fs=1.0 / step, output="sos")
    return frozen(sosfiltfilt(sections, force, axis=0))


def _widened(estimate: ForceEstimate, errors: list[float]) -> ForceEstimate:
    """The estimate with the machine's own uncertainty in its bands."""
    return replace(estimate, standard_deviation=frozen(np.hypot(estimate.standard_deviation, np.array(errors))))


def wear_of(found: MonitoredCut, cutter: Cutter, conditions: CuttingConditions) -> WearIndicators:
    """Return the cutting coefficients of each revolution of a monitored cut.

    `found`: with both axes
    `conditions`: depth, feed and immersion of the cut; the speed is the record's own
    """
    estimate = found.estimate
    columns = [estimate.axes.index(axis) for axis in (Dof.X, Dof.Y)]
    own = replace(conditions, spindle_speed=found.spindle_speed)
    return wear_indicators(estimate.force[:, columns], estimate.step, cutter, own, found.band, first=round(estimate.start / estimate.step))
