"""May a record be trusted? Every reason why not, with its numbers."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from rcsa_ident.base.arrays import ComplexArray, FloatArray
from rcsa_ident.base.plausibility import RATE
from rcsa_ident.base.remarks import Remark, RemarkCode
from rcsa_ident.base.shown import Shown
from rcsa_ident.base.units import from_hz, to_hz, to_rpm
from rcsa_ident.signals.channel_scan import scan
from rcsa_ident.signals.recording import Quantity, Recording
from rcsa_ident.signals.spectra import LineSpectrum, follow_speed, line_spectrum, refine_speed
from rcsa_ident.signals.steady_part import hann

#: Least and largest swing, peak to peak, of what a milling spindle does and a sensor tells.
PLAUSIBLE = {Quantity.DISPLACEMENT: (2e-9, 2e-3, "m"), Quantity.ACCELERATION: (1e-4, 1e5, "m/s^2")}
#: A peak off the spindle's orders is chatter above this share of the largest tooth-passing line.
CHATTER_SHARE = 0.3
#: Distance, as a logarithm of frequency, within which a line's background lies.
_BESIDE = 0.4
#: Of frequencies [rad/s], what of each channel is in an absolute motion; see `chatter`.
Absolute = Callable[[FloatArray], ComplexArray]
#: Share of the programmed speed within which a wrong one is looked for.
WIDE_SEARCH = 0.12
#: Share of its power by which a tooth-passing line stands above what run-out does at other orders.
ALONE = 20.0
#: Squared amplitude over variance above which a line is one.
VISIBLE = 40.0
#: Phase [rad] that a drifting speed may add to the highest line over the record.
DRIFT_PHASE = 0.5
#: Change of speed within a record, standard deviation as a share: with a damping ratio of 0.02, a line on a resonance is then 2 % too low.
MOST_WANDER = 0.003


class RecordCode(RemarkCode):
    """What may be said of a record; the last nine speak of one that may be used."""

    UNREADABLE = "unreadable"
    NOT_FINITE = "not-finite"
    LOST_SAMPLES = "lost-samples"
    FROZEN = "frozen"
    NO_SIGNAL = "no-signal"
    SATURATED = "saturated"
    NOT_STEADY = "not-steady"
    WRONG_SPEED = "wrong-speed"
    SPEED_DRIFT = "speed-drift"
    NO_LINE = "no-line"
    NO_CUTTING = "no-cutting"
    CHATTER = "chatter"
    TOOTH_COUNT = "tooth-count"
    IMPLAUSIBLE = "implausible"
    LONG = "long"
    FOLLOWED = "followed"
    HOUSING = "housing"
    WORKPIECE = "workpiece"
    CLOCK = "clock"
    NO_AIR_CUT = "no-air-cut"
    LOSSY = "lossy"
    CUT_OFF = "cut-off"
    ASSUMED = "assumed"


def assumed(what: str, unit: str, meant: str) -> Remark:
    """Return the remark on a unit that a file does not state, or states as one that does not say what is measured.

    `what`, `unit`: a channel, a column or a file, and its unit, empty where the file states none
    `meant`: the quantity with its unit that is assumed

    Examples
    --------
    >>> print(assumed("column 2", "", "acceleration [m/s²]"))
    column 2 has no unit: acceleration [m/s²] is assumed
    """
    stated = f"has the unit {unit}, which does not say what is measured" if unit else "has no unit"
    return Remark(RecordCode.ASSUMED, f"{what} {stated}: {meant} is assumed")


@dataclass(frozen=True, slots=True, repr=False)
class Verdict(Shown):
    """What was found in a record.

    `reasons`: why the record is left out; empty where it is used
    `notes`: what the user should know though it is used
    """

    reasons: tuple[Remark, ...] = ()
    notes: tuple[Remark, ...] = ()

    @property
    def usable(self) -> bool:
        """True where nothing speaks against the record."""
        return not self.reasons

    def __str__(self) -> str:
        return "usable" if self.usable else f"left out: {'; '.join(self.reasons)}"


def examined(recording: Recording) -> Verdict:
    """Return what the samples themselves say, in one pass over them: why they are left out (lost, frozen, saturated, silent), and what
    speaks for a wrong unit or sensitivity: motion that no spindle makes, or that no sensor resolves."""
    columns = [i for i, sensor in enumerate(recording.sensors) if sensor.quantity in PLAUSIBLE]
    unusual = RATE.remark("sampling_rate_hz", recording.rate)
    reasons, notes = [], [*recording.notes, *([] if unusual is None else [unusual])]
    for i, found in zip(columns, scan(recording, columns), strict=True):
        sensor = recording.sensors[i]
        if found.lost:
            first = found.first_lost / recording.rate
            words = f"drop-outs: {found.lost} samples of {sensor.name} are missing, the first at {first:.4g} s"
            reasons.append(Remark(RecordCode.LOST_SAMPLES, words))
        elif found.low == found.high:
            reasons.append(Remark(RecordCode.NO_SIGNAL, f"no signal: {sensor.name} has the constant value {found.first:.4g}"))
        elif found.clipped:
            words = f"saturation: {found.clipped} samples of {sensor.name} are at its limits, {found.low:.4g} and {found.high:.4g}"
            reasons.append(Remark(RecordCode.SATURATED, words))
        elif found.frozen is not None:
            start, length = found.frozen
            words = f"drop-outs: {sensor.name} is frozen for {length} samples at {start / recording.rate:.4g} s"
            reasons.append(Remark(RecordCode.FROZEN, words))
        least, most, unit = PLAUSIBLE[sensor.quantity]
        swing = max(found.high - found.low, 0.0)
        if swing > most or 0.0 < swing < least:
            words = f"{sensor.name} has a peak-to-peak amplitude of {swing:.3g} {unit}: check its unit and sensitivity"
            notes.append(Remark(RecordCode.IMPLAUSIBLE, words))
    return Verdict(tuple(reasons), tuple(notes))


def raw_faults(recording: Recording) -> tuple[Remark, ...]:
    """Return what is wrong with the samples themselves: lost, frozen, saturated, silent."""
    return examined(recording).reasons


def speed_faults(samples: FloatArray, lines: LineSpectrum, programmed: float, deviation: FloatArray | None = None) -> tuple[Remark, ...]:
    """Return what is wrong with the speed: far from the programmed one, or drifting within the record and not followed.

    `samples`, shape (n, c): displacements
    `lines`: their lines, in its first channels; others may follow
    `programmed` [rad/s]: the spindle speed that was set
    `deviation` [rad], shape (n,): of the spindle's angle from that at the lines' speed, as it was followed
    """
    speed, rate = lines.spindle_speed, lines.rate
    order = np.arange(1, lines.amplitude.shape[0])[:, None]
    power = np.abs(lines.amplitude[1:, : samples.shape[1]]) ** 2
    information = power / np.maximum(lines.variance[1:, : samples.shape[1]], 1e-300)
    visible = bool(np.max(information) > VISIBLE)
    if _explained(lines, samples.shape[1]) < 0.5:
        other = refine_speed(samples, rate, programmed, search=WIDE_SEARCH)
        if _explained(line_spectrum(samples, rate, other, order.size * speed / (2.0 * np.pi)), samples.shape[1]) > 0.5:
            speed, visible = other, True
    if not visible:
        # an air cut of a round flange tells no speed
        return ()
    if abs(speed / programmed - 1.0) > 0.0095:
        words = f"speed: the record repeats at {to_rpm(speed):.1f} rev/min, the programmed speed is {to_rpm(programmed):.0f} rev/min"
        return (Remark(RecordCode.WRONG_SPEED, words),)
    duration = samples.shape[0] / rate
    half = samples.shape[0] // 2
    if half < 4.0 * rate * 2.0 * np.pi / speed:
        return ()
    parts = (None, None) if deviation is None else (deviation[:half], deviation[half:])
    first = follow_speed(samples[:half], rate, speed, deviation=parts[0])
    second = follow_speed(samples[half:], rate, speed, deviation=parts[1])
    # a speed that changes linearly bends the phase of order m by m * change * T / 8 between the middle and the ends
    phase = order.size * abs(second - first) * duration / 4.0
    # halves have an eighth of the record's information on the speed each
    std = 4.0 / np.sqrt(np.sum(order**2 * information) * duration**2 / 12.0)
    if phase > DRIFT_PHASE and abs(second - first) > 5.0 * std:
        words = (
            f"speed drifts from {to_rpm(first):.1f} to {to_rpm(second):.1f} rev/min: "
            f"the phase of the highest line deviates by {phase:.2g} rad (limit {DRIFT_PHASE} rad)"
        )
        return (Remark(RecordCode.SPEED_DRIFT, words),)
    return ()


def smeared(wander: float | None) -> Remark | None:
    """Return a remark if the speed changes so much within a record that its lines are those of no one speed, else None.

    `wander`: standard deviation of the speed as a share; None where it does not change
    """
    if wander is None or wander <= MOST_WANDER:
        return None
    words = (
        f"speed drifts: it changes by {100.0 * wander:.2g} % (standard deviation) within the record, at most {100.0 * MOST_WANDER:.2g} %"
    )
    return Remark(RecordCode.SPEED_DRIFT, f"{words} can be followed without smearing the lines")


def _explained(lines: LineSpectrum, channels: int) -> float:
    """Share of the displacements' power that lies in the lines."""
    power = 0.5 * np.sum(np.abs(lines.amplitude[1:, :channels]) ** 2)
    return float(power / (power + np.sum(np.mean(lines.off_orders[:, :channels] ** 2, axis=0))))


def silence(power: FloatArray, variance: FloatArray) -> Remark | None:
    """Return a remark if no cutting force shows in the tooth-passing lines, else None.

    `power`, `variance` [m^2], shape (n, axes): squared amplitudes, and variance of their real part
    """
    ratio = power / np.maximum(2.0 * variance, 1e-300)
    # pure noise has a mean of 1, and its largest of n is rarely above log(n) + 7
    if np.max(ratio) > np.log(ratio.size) + 7.0:
        return None
    words = f"no cutting: the largest tooth-passing line is {np.sqrt(power.max()) * 1e9:.3g} nm, which is at the noise level"
    return Remark(RecordCode.NO_CUTTING, words)


def chatter(
    lines: LineSpectrum,
    channels: list[int],
    forced: FloatArray,
    band: tuple[float, float],
    air: LineSpectrum | None = None,
    absolute: Absolute | None = None,
) -> Remark | None:
    """Return a remark if a vibration off the spindle's orders stands out, else None.

    `channels`: the displacements among its channels
    `forced`: array, one entry per displacement [m]; largest tooth-passing amplitude
    `band`: (float, float) [Hz]; frequencies between which chatter is looked for
    `air`: of the air cut: what is there, too, is no chatter
    `absolute`: of frequencies [rad/s], what of each channel is in the absolute motion along each displacement, shape (n, channels, c): a
        spindle that swings with its housing moves no displacement sensor that stands on it
    """
    n, step = lines.rest.shape[0], to_hz(lines.spindle_speed)
    amplitude = _spectrum(lines, channels, absolute)
    forced = np.resize(forced, amplitude.shape[1])
    frequency = np.fft.rfftfreq(n, 1.0 / lines.rate)
    order = frequency / step
    # a Hann line reaches two bins to each side of the spindle's orders
    clear = np.abs(order - np.round(order)) * step > 3.0 * lines.rate / n
    inside = clear & (frequency > band[0]) & (frequency < band[1])
    if not inside.any():
        return None
    still = np.zeros_like(amplitude) if air is None else _near(air, channels, frequency, absolute)
    for c in range(amplitude.shape[1]):
        candidates = np.where(inside & (amplitude[:, c] > 2.0 * still[:, c]), amplitude[:, c], 0.0)
        peak = int(np.argmax(candidates))
        if candidates[peak] == 0.0:
            continue
        # what was felt as an acceleration has a floor that falls with frequency
        beside = inside & (np.abs(np.log(np.maximum(frequency, band[0]) / frequency[peak])) < _BESIDE)
        floor = float(np.median(amplitude[inside if c < len(channels) else beside, c]))
        if candidates[peak] > CHATTER_SHARE * forced[c] and candidates[peak] > 10.0 * floor:
            words = (
                f"chatter: {candidates[peak] * 1e6:.3g} µm at {frequency[peak]:.0f} Hz, which is not a multiple of the spindle frequency, "
                f"{step:.1f} Hz (largest tooth-passing line {forced[c] * 1e6:.3g} µm)"
            )
            return Remark(RecordCode.CHATTER, words)
    return None


def _spectrum(lines: LineSpectrum, channels: list[int], absolute: Absolute | None) -> FloatArray:
    """Amplitudes of what displacements hold beside the orders, and behind them those of the absolute motion, shape (bins, c or 2 c)."""
    window = hann(lines.rest.shape[0])
    if absolute is None:
        return 2.0 * np.abs(np.fft.rfft(lines.off_orders[:, channels] * window[:, None], axis=0)) / window.sum()
    every = 2.0 * np.fft.rfft(lines.off_orders * window[:, None], axis=0) / window.sum()
    weights = absolute(from_hz(np.fft.rfftfreq(window.size, 1.0 / lines.rate)))
    return np.abs(np.concatenate([every[:, channels], np.einsum("nk,nkc->nc", every, weights)], axis=1))


def _near(lines: LineSpectrum, channels: list[int], frequency: FloatArray, absolute: Absolute | None) -> FloatArray:
    """Largest amplitude that a record holds beside the orders near each frequency, shape (f, c)."""
    amplitude = _spectrum(lines, channels, absolute)
    own = np.arange(amplitude.shape[0]) * lines.rate / lines.rest.shape[0]
    step = max(own[1], frequency[1])
    places = [frequency + shift * step for shift in range(-3, 4)]
    return np.stack([np.max([np.interp(place, own, column) for place in places], axis=0) for column in amplitude.T], axis=1)


def _stands_out(own: FloatArray, rest: FloatArray, claimed: FloatArray) -> bool:
    """True where several lines of another comb are strong, and those that the teeth should have are no more than background.

    A poorly aligned air cut (the wrong comb spoils it, too) leaves run-out on all other orders, so the background is high.
    """
    if own.size < 2 or rest.size == 0 or claimed.max() > 2.0 * rest.max():
        return False
    return bool(np.sort(own)[-2] > 4.0 * max(rest.max(), claimed.max()))


def tooth_count_fault(power: FloatArray, teeth: int) -> Remark | None:
    """Return a remark if the cut's own lines do not stand where `teeth` teeth would put them, else None.

    `power`, shape (m + 1,): squared amplitude of cut less air cut at each spindle order, all channels together
    `teeth`: number of teeth that the cutter is said to have
    """
    order = np.arange(power.size)
    shared = (order % teeth == 0) & (order > 0)
    others = ~shared & (order > 0) & (order <= 3 * teeth)
    first = shared & (order <= 3 * teeth)
    for count in range(min(2 * teeth, power.size) - 1, 1, -1):
        # run-out spreads over all orders that the teeth do not share, another number of teeth stands on its own multiples alone
        own, rest = others & (order % count == 0), others & (order % count != 0)
        claimed = first & (order % count != 0)
        if teeth > 1 and claimed.any() and _stands_out(power[own], power[rest], power[claimed]):
            return _wrong_count(f"wrong tooth count (or chatter): the lines of the cut are at multiples of {count}, not of {teeth}")
        if teeth > 1 and own.any() and power[own].max() > ALONE * power[rest].max(initial=0.0):
            missed = power[first & (order % count != 0)].max(initial=0.0)
            if power[own].max() > (0.03 * power[first].max() if teeth % count == 0 else missed):
                strongest = int(order[own][np.argmax(power[own])])
                return _wrong_count(f"wrong tooth count (or chatter): order {strongest} of the cut fits {count} teeth, not {teeth}")
    if teeth > 1 and power[others].max() > ALONE * power[first].max():
        strongest = int(order[others][np.argmax(power[others])])
        return _wrong_count(
            f"wrong tooth count (or chatter): the strongest line of the cut is order {strongest}, not a multiple of {teeth} teeth"
        )
    odd = shared & (order % (2 * teeth) != 0) & (order <= 4 * teeth)
    even = (order % (2 * teeth) == 0) & (order > 0) & (order <= 4 * teeth)
    background = power[others].mean() if others.any() else 0.0
    if odd.any() and even.any() and power[odd].max() < 1e-2 * power[even].max() and power[odd].max() < 4.0 * background:
        return _wrong_count(f"wrong tooth count: only every second multiple of {teeth} is present, as with {2 * teeth} teeth")
    return None


def _wrong_count(words: str) -> Remark:
    return Remark(RecordCode.TOOTH_COUNT, words)
