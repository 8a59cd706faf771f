"""Cutting coefficients from a campaign whose recordings hold forces: mean forces over the feed, or the whole signal."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from rcsa_ident.base.arrays import FloatArray
from rcsa_ident.base.errors import InputError
from rcsa_ident.cutting.calibration import ForceCalibration, calibrate_mean_force, leaning, mean_force_matrix
from rcsa_ident.cutting.conditions import CuttingConditions
from rcsa_ident.cutting.cutter import Cutter
from rcsa_ident.cutting.force_axes import CLEAR, AxesChoice, axes_choices
from rcsa_ident.cutting.force_record import ForceRecord
from rcsa_ident.cutting.signal_fit import Dynamometer, SignalCalibration, calibrate_signal
from rcsa_ident.dynamics.coordinates import Dof
from rcsa_ident.setup.campaign import Campaign
from rcsa_ident.setup.cut import Cut
from rcsa_ident.signals.recording import Quantity, Recording, Sensor
from rcsa_ident.signals.spectra import Comb, line_spectrum, refine_speed
from rcsa_ident.signals.steady_part import hann, steady_part
from rcsa_ident.signals.verdict import chatter

#: Highest line of the full-signal fit [Hz]: below the resonance of most dynamometers.
MAX_FREQUENCY = 2000.0
#: Fewest revolutions of a usable record, and most blocks that it is divided into.
LEAST_REVOLUTIONS, MOST_BLOCKS = 16.0, 24
#: Largest share of lost samples; they are bridged by straight lines.
LOST_SHARE = 1e-3
#: Scatter in two revolutions over the cut's below which nothing is cut, and how many such blocks tell where zero is.
IDLE_SHARE, LEAST_IDLE = 0.1, 4
ReadCut = Callable[[Cut], tuple[Recording, Recording | None]]


@dataclass(frozen=True, slots=True, eq=False)
class MeasuredForce:
    """What one recording says about the cutting force.

    `record`: lines of the forces, as the sensors are told or as `force_axes` found them
    `duration` [s]: of the steady part
    `zeroed`: whether the sensors' zero is known, from the air cut or from stretches in which nothing is cut
    """

    cut_id: str
    record: ForceRecord
    duration: float
    zeroed: bool

    @property
    def mean(self) -> FloatArray:
        """Mean force over whole revolutions, zero taken out: X, Y and, where it is measured, along the axis, shape (c,) [N]."""
        return self.record.mean

    @property
    def once_per_revolution(self) -> FloatArray:
        """Amplitude at the spindle's own order, shape (c,) [N]: of a cutter with several teeth its run-out."""
        return np.abs(self.record.lines[1])


@dataclass(frozen=True, slots=True, eq=False)
class Calibrated:
    """A campaign's coefficients.

    `signal`: with the method of that name
    `choices`: where the axes were asked for: all that are physical, the one that was taken first; else none
    `left_out`: tuple of (cut id, reason)
    """

    forces: ForceCalibration
    signal: SignalCalibration | None
    choices: tuple[AxesChoice, ...]
    used: tuple[MeasuredForce, ...]
    left_out: tuple[tuple[str, str], ...]
    notes: tuple[str, ...]

    def mean_force_model(self, measured: MeasuredForce) -> FloatArray:
        """Return what the coefficients say of a cut's mean force, shape (3,) [N]."""
        row = mean_force_matrix(measured.record.cutter, measured.record.conditions)
        known = [self.forces.of(name)[0] for name in ("K_tc", "K_rc", "K_te", "K_re", "K_ac", "K_ae")]
        return np.asarray(row @ np.array(known))


def measure_force(
    cut_id: str,
    clamping: str,
    recording: Recording,
    air: Recording | None,
    cutter: Cutter,
    conditions: CuttingConditions,
    max_frequency: float = MAX_FREQUENCY,
) -> MeasuredForce:
    """Return lines and mean of the force in the steady part of a recording.

    `recording`: with force sensors along X and Y, and along the axis (Z) where there is one
    `air`: the same without cutting: where zero is. Without it the record's own idle stretches tell, before and after the cut; between them
        a charge amplifier drifts evenly.
    `max_frequency` [Hz]
    Raises `InputError`: a force sensor is missing, or the record has no steady part.
    """
    samples, sensors = _forces(recording, cut_id)
    if np.any(np.isnan(samples)):
        samples = _bridged(samples, cut_id)
    rate = recording.rate
    programmed = conditions.spindle_speed
    least = LEAST_REVOLUTIONS * 2.0 * np.pi / programmed * rate
    if samples.shape[0] < least:
        raise InputError("recording", f"{samples.shape[0] / rate:.3g} s", f"at least {LEAST_REVOLUTIONS:.0f} revolutions", cut_id)
    transverse = samples[:, :2]
    rough = refine_speed(transverse, rate, programmed)
    part = steady_part(transverse, rate, rough, cutter.teeth)
    if part.stop - part.start < least:
        raise InputError("recording", "no steady cut", f"at least {LEAST_REVOLUTIONS:.0f} revolutions of steady cutting", cut_id)
    inside = samples[part]
    speed = rough if part == slice(0, samples.shape[0]) else refine_speed(inside[:, :2], rate, rough)
    spectrum = line_spectrum(inside, rate, speed, max_frequency)
    forced = np.abs(spectrum.amplitude[cutter.teeth :: cutter.teeth, :2]).max(axis=0)
    if chatter(spectrum, [0, 1], forced, (0.5 * cutter.teeth * speed / (2.0 * np.pi), max_frequency)) is not None:
        power = np.sum(np.abs(np.fft.rfft(spectrum.rest[:, :2] * hann(inside.shape[0])[:, None], axis=0)) ** 2, axis=1)
        raise InputError("recording", f"chatter at {np.argmax(power) * rate / inside.shape[0]:.0f} Hz", "a stable cut", cut_id)
    omega = np.arange(spectrum.amplitude.shape[0]) * speed
    undo = np.stack([1.0 / sensor.response(omega) for sensor in sensors], axis=1)
    blocks = _block_deviations(spectrum.rest, rate, speed, omega.size) * undo[None]
    variance = np.maximum(spectrum.variance, 1e-300) * np.abs(undo) ** 2
    lines = spectrum.amplitude * undo
    zero = _idle_level(samples, part, round(4.0 * np.pi / speed * rate)) if air is None else _air_level(air, samples.shape[1], cut_id)
    if zero is not None:
        lines[0] -= zero
    record = ForceRecord(cutter, replace(conditions, spindle_speed=speed), clamping, lines, variance, blocks)
    return MeasuredForce(cut_id, record, inside.shape[0] / rate, zero is not None)


def _forces(recording: Recording, cut_id: str) -> tuple[FloatArray, list[Sensor]]:
    found = [recording.channel(Quantity.FORCE, axis) for axis in (Dof.X, Dof.Y, Dof.Z)]
    missing = [axis.upper() for axis, f in zip((Dof.X, Dof.Y), found, strict=False) if f is None]
    if missing:
        raise InputError("sensors", f"no force along {' and '.join(missing)}", 'sensors with quantity = "force" for X and Y', cut_id)
    kept = [f for f in found if f is not None]
    return np.stack([f[1] for f in kept], axis=1), [f[0] for f in kept]


def _air_level(air: Recording, channels: int, cut_id: str) -> FloatArray:
    still, _ = _forces(air, cut_id)
    if still.shape[1] != channels:
        raise InputError("sensors", "other forces in the air cut", "the same sensors for a cut and its air cut", cut_id)
    return np.asarray(np.nanmean(still, axis=0))


def _idle_level(samples: FloatArray, part: slice, length: int) -> FloatArray | None:
    """Level of what is idle before and after the steady part, carried to its middle, shape (c,); None where nothing is idle."""
    loud = _blocks(samples[part], length).std(axis=1).sum(axis=1)
    found = []
    for start, stop in ((0, part.start), (part.stop, samples.shape[0])):
        blocks = _blocks(samples[start:stop], length)
        idle = np.flatnonzero(blocks.std(axis=1).sum(axis=1) < IDLE_SHARE * np.median(loud))
        if idle.size >= LEAST_IDLE:
            found.append((start + (idle.mean() + 0.5) * length, np.median(blocks[idle].mean(axis=1), axis=0)))
    if not found:
        return None
    (first, level), (last, later) = found[0], found[-1]
    share = (0.5 * (part.start + part.stop) - first) / (last - first) if len(found) > 1 else 0.0
    return np.asarray(level + share * (later - level))


def _blocks(samples: FloatArray, length: int) -> FloatArray:
    """Whole blocks of so many samples, shape (b, length, c)."""
    count = samples.shape[0] // length
    return samples[: count * length].reshape(count, length, samples.shape[1])


def _bridged(samples: FloatArray, cut_id: str) -> FloatArray:
    """Straight lines over lost samples, as long as they are few."""
    lost = np.isnan(samples)
    if lost.mean() > LOST_SHARE:
        raise InputError("recording", f"{100.0 * lost.mean():.1f} % of the samples are lost", f"at most {100.0 * LOST_SHARE:g} %", cut_id)
    time = np.arange(samples.shape[0])
    columns = [np.interp(time, time[~gone], column[~gone]) for column, gone in zip(samples.T, lost.T, strict=True)]
    return np.stack(columns, axis=1)


def _block_deviations(rest: FloatArray, rate: float, speed: float, orders: int) -> FloatArray:
    """Lines of what is left of the record in blocks of whole revolutions, phases from the record's start; shape (b, orders, c)."""
    n, step = rest.shape[0], speed / rate
    turns = int(n * step / (2.0 * np.pi))
    each = max(turns // MOST_BLOCKS, 1)
    count = turns // each
    order = np.arange(orders)
    blocks = []
    for b in range(count):
        start = round(b * each * 2.0 * np.pi / step)
        stop = min(round((b + 1) * each * 2.0 * np.pi / step), n)
        sums = Comb(step).sums(np.ascontiguousarray(rest[start:stop]), orders - 1) * (2.0 / (stop - start))
        sums[0] *= 0.5
        middle = start + 0.5 * (stop - start - 1)
        blocks.append(sums * np.exp(-1j * order * step * middle)[:, None])
    return np.array(blocks)


def calibrate(
    campaign: Campaign,
    read: ReadCut,
    signal: bool = False,
    max_frequency: float = MAX_FREQUENCY,
    dynamometer: Dynamometer | None = None,
    free_helix: bool = False,
    any_axes: bool = False,
    progress: Callable[[int, int], None] | None = None,
) -> Calibrated:
    """Return the cutting coefficients of a campaign of cuts at several feeds.

    `campaign`: with force sensors; its workpiece's coefficients are not used
    `read`: given a cut, returns its recordings. A recording that cannot be used is left out with its reason.
    `signal`: fit the whole signal; else mean forces
    `max_frequency` [Hz]: highest line of the signal's fit
    `dynamometer`: what to find of the sensor, with the signal's fit; see `calibrate_signal`
    `any_axes`: find which channel shows which axis and sign; else they are as told
    """
    if not campaign.cuts:
        raise InputError("cuts", "none", "recordings of the cutting force")
    used, left_out = [], []
    for done, cut in enumerate(campaign.cuts, start=1):
        cutter = campaign.toolings[cut.tooling].cutter
        try:
            used.append(measure_force(cut.id, cut.tooling, *read(cut), cutter, cut.conditions, max_frequency))
        except InputError as error:
            left_out.append((cut.id, str(error)))
        if progress is not None:
            progress(done, len(campaign.cuts))
    if not used:
        raise InputError("cuts", f"none of {len(campaign.cuts)} usable ({left_out[0][1]})", "recordings of the cutting force")
    unzeroed = [measured.cut_id for measured in used if not measured.zeroed]
    notes = [f"{', '.join(unzeroed)}: no air cut and no idle stretch, the sensors' own zero is used"] if unzeroed else []
    notes += campaign.cylinder_remarks({measured.cut_id for measured in used})
    choices = axes_choices([measured.record for measured in used]) if any_axes else ()
    if choices:
        used = [replace(measured, record=_turned(measured.record, choices[0].axes)) for measured in used]
        notes += _on_axes(choices, campaign.sensors)
    found = calibrate_signal([m.record for m in used], dynamometer, free_helix, _start(used)) if signal else None
    forces = _mean(used) if found is None else _with_axial(found, used)
    if len(choices) > 1 and choices[1].unexplained < CLEAR * choices[0].unexplained:
        forces = replace(forces, reasons=(*forces.reasons, "two choices of the sensors' axes explain the force over time nearly alike"))
    return Calibrated(forces, found, choices, tuple(used), tuple(left_out), tuple(notes))


def _turned(record: ForceRecord, axes: FloatArray) -> ForceRecord:
    """The record of the force on the tool; a channel along the axis that other cuts do not have is left out."""
    return (record if record.lines.shape[1] == axes.shape[0] else record.transverse).seen_through(axes)


def _on_axes(choices: Sequence[AxesChoice], sensors: Sequence[Sensor]) -> list[str]:
    """What was chosen in words, and the next choice."""
    told = {sensor.axis: sensor.name for sensor in reversed(sensors) if sensor.quantity is Quantity.FORCE}
    names = [told[axis] for axis in (Dof.X, Dof.Y, Dof.Z) if axis in told]

    def words(choice: AxesChoice) -> str:
        return ", ".join(f"{name} shows {axis}" for name, axis in zip(names, choice.shown(), strict=False))

    first = choices[0]
    left = f"{100.0 * first.unexplained:.0f} % of the force over time unexplained"
    notes = [f"axes of the force on the tool: {words(first)} ({left}){', as told' if first.as_told else ''}"]
    if len(choices) > 1:
        notes.append(f"next choice of axes: {words(choices[1])} ({100.0 * choices[1].unexplained:.0f} %)")
    return notes


def _start(used: Sequence[MeasuredForce]) -> FloatArray | None:
    """Coefficients of the mean forces, where there are feeds enough and they are a cut's."""
    try:
        mean = _mean(used)
    except InputError:
        return None
    return None if mean.reasons else np.array([mean.of(name)[0] for name in ("K_tc", "K_rc", "K_te", "K_re")])


def _mean(used: Sequence[MeasuredForce]) -> ForceCalibration:
    count = min(m.mean.size for m in used)
    return calibrate_mean_force([(m.record.cutter, m.record.conditions) for m in used], np.array([m.mean[:count] for m in used]))


def _with_axial(found: SignalCalibration, used: Sequence[MeasuredForce]) -> ForceCalibration:
    """The signal's coefficients, with the axial ones from the mean forces where these are measured."""
    if min(m.mean.size for m in used) < 3:
        return found.forces
    mean, forces = _mean(used), found.forces
    if any(leaning(m.record.cutter, m.record.conditions) for m in used):
        # the signal's radial coefficients hold what the axial ones do in X and Y: taken beside them, that would count twice
        return replace(mean, notes=(*mean.notes, "the edge leans: all coefficients from mean forces along three axes"))
    covariance = np.zeros((6, 6))
    covariance[:4, :4], covariance[4:, 4:] = forces.covariance, mean.covariance[4:, 4:]
    return replace(
        forces,
        names=mean.names,
        value=np.concatenate([forces.value, mean.value[4:]]),
        covariance=covariance,
        half_width=np.concatenate([forces.half_width, mean.half_width[4:]]),
        notes=(*forces.notes, "axial coefficients from mean forces"),
    )
