"""May a record be trusted? Every reason why not, in words with its numbers."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.signal import get_window

from rcsa_ident.dynamics.arrays import FloatArray
from rcsa_ident.signals.recording import Quantity, Recording
from rcsa_ident.signals.spectra import LineSpectrum, follow_speed

#: Equal samples in a row that a live analogue channel does not produce.
FROZEN_SAMPLES = 12
#: A peak off the spindle's orders is chatter above this share of the largest tooth-passing line.
CHATTER_SHARE = 0.3
#: Phase [rad] that a drifting speed may add to the highest line over the record.
DRIFT_PHASE = 0.5


@dataclass(frozen=True, slots=True)
class Verdict:
    """What was found in a record.

    Parameters
    ----------
    reasons : tuple of str
        Why the record is left out; empty where it is used.
    notes : tuple of str
        What the user should know though it is used.
    """

    reasons: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()

    @property
    def usable(self) -> bool:
        """True where nothing speaks against the record."""
        return not self.reasons


def raw_faults(recording: Recording) -> tuple[str, ...]:
    """Return what is wrong with the samples themselves: lost, frozen, saturated, silent."""
    found: list[str] = []
    for i, sensor in enumerate(recording.sensors):
        if sensor.quantity in (Quantity.TRIGGER, Quantity.FORCE):
            continue
        x = recording.samples[:, i]
        lost = int(np.isnan(x).sum())
        if lost:
            first = float(np.argmax(np.isnan(x))) / recording.rate
            found.append(f"drop-outs: {lost} samples of {sensor.name} are missing, the first at {first:.4g} s")
            continue
        if np.ptp(x) == 0.0:
            found.append(f"no signal: {sensor.name} has the constant value {x[0]:.4g}")
            continue
        start, length = _runs(x)
        extreme = (x[start] == x.max()) | (x[start] == x.min())
        if np.sum(extreme & (length >= 3)) >= 2:
            clipped = int(length[extreme & (length >= 3)].sum())
            found.append(f"saturation: {clipped} samples of {sensor.name} stand at its limits {x.min():.4g} and {x.max():.4g}")
        elif length.max() >= FROZEN_SAMPLES:
            k = int(np.argmax(length))
            found.append(f"drop-outs: {sensor.name} is frozen for {length[k]} samples at {start[k] / recording.rate:.4g} s")
    return tuple(found)


def _runs(x: FloatArray) -> tuple[np.ndarray, np.ndarray]:
    """Start and length of each run of equal values."""
    start = np.concatenate([[0], np.flatnonzero(np.diff(x) != 0.0) + 1])
    return start, np.diff(np.concatenate([start, [x.size]]))


def speed_faults(samples: FloatArray, rate: float, speed: float, programmed: float, highest_order: int) -> tuple[str, ...]:
    """Return what is wrong with the speed: far from the programmed one, or drifting within the record."""
    found: list[str] = []
    rpm = 30.0 / np.pi
    if abs(speed / programmed - 1.0) > 0.0095:
        found.append(f"speed: no spindle speed near the programmed {programmed * rpm:.0f} rev/min (best within 1 %: {speed * rpm:.1f})")
        return tuple(found)
    half = samples.shape[0] // 2
    if half > 4.0 * rate * 2.0 * np.pi / speed:
        first = follow_speed(samples[:half], rate, speed)
        second = follow_speed(samples[half:], rate, speed)
        # a speed that changes linearly bends the phase of order m by m * change * T / 8 at the middle
        phase = highest_order * abs(second - first) * samples.shape[0] / rate / 4.0
        if phase > DRIFT_PHASE:
            found.append(
                f"speed drifts from {first * rpm:.1f} to {second * rpm:.1f} rev/min: "
                f"the highest line's phase bends by {phase:.2g} rad (at most {DRIFT_PHASE})"
            )
    return tuple(found)


def chatter(lines: LineSpectrum, channels: list[int], forced: FloatArray, band: tuple[float, float]) -> str | None:
    """Return a sentence if a vibration off the spindle's orders stands out, else None.

    Parameters
    ----------
    lines : LineSpectrum
    channels : list of int
        The displacements among its channels.
    forced : array, one entry per displacement [m]
        Largest tooth-passing amplitude.
    band : (float, float) [Hz]
        Where to look.
    """
    n = lines.rest.shape[0]
    window = get_window("hann", n)
    amplitude = 2.0 * np.abs(np.fft.rfft(lines.rest[:, channels] * window[:, None], axis=0)) / window.sum()
    frequency = np.fft.rfftfreq(n, 1.0 / lines.rate)
    order = frequency * 2.0 * np.pi / lines.spindle_speed
    # a Hann line reaches two bins to each side of the spindle's orders
    clear = np.abs(order - np.round(order)) > 3.0 * 2.0 * np.pi * lines.rate / n / lines.spindle_speed
    inside = clear & (frequency > band[0]) & (frequency < band[1])
    if not inside.any():
        return None
    for c in range(amplitude.shape[1]):
        candidates = np.where(inside, amplitude[:, c], 0.0)
        peak = int(np.argmax(candidates))
        floor = float(np.median(amplitude[inside, c]))
        if candidates[peak] > CHATTER_SHARE * forced[c] and candidates[peak] > 10.0 * floor:
            return (
                f"chatter: {candidates[peak] * 1e6:.3g} µm at {frequency[peak]:.0f} Hz, no multiple of the spindle's "
                f"{lines.spindle_speed / (2 * np.pi):.1f} Hz (largest tooth-passing line {forced[c] * 1e6:.3g} µm)"
            )
    return None


def tooth_count_fault(power: FloatArray, teeth: int) -> str | None:
    """Return a sentence if the cut's own lines do not stand where `teeth` teeth would put them, else None.

    Parameters
    ----------
    power : array, shape (m + 1,)
        Squared amplitude of cut less air cut at each spindle order, all channels together.
    """
    order = np.arange(power.size)
    shared = (order % teeth == 0) & (order > 0)
    # run-out of the cutter lies on the other orders, below the teeth's own lines
    others = ~shared & (order > 0) & (order <= 3 * teeth)
    first = shared & (order <= 3 * teeth)
    if teeth > 1 and power[others].sum() > power[first].sum():
        strongest = int(order[1:][np.argmax(power[1:])])
        return f"wrong tooth count: the strongest line of the cut is order {strongest}, not a multiple of {teeth} teeth"
    odd = shared & (order % (2 * teeth) != 0) & (order <= 4 * teeth)
    even = (order % (2 * teeth) == 0) & (order > 0) & (order <= 4 * teeth)
    background = power[others].mean() if others.any() else 0.0
    if odd.any() and even.any() and power[odd].max() < 1e-3 * power[even].max() and power[odd].max() < 4.0 * background:
        return f"wrong tooth count: of the multiples of {teeth} teeth only every second is there, as with {2 * teeth}"
    return None
