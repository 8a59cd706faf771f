"""What is said where a machine is asked beyond what is known of it: frequencies, and speeds that it was not cut at."""

from __future__ import annotations

import numpy as np

from rcsa_ident.base.arrays import FloatArray
from rcsa_ident.base.units import to_hz, to_rpm
from rcsa_ident.machine.machine import TipSource
from rcsa_ident.stability.result import StabilityLobes


def outside_band(lobes: StabilityLobes, band: tuple[float, float]) -> str | None:
    """Return a sentence where the limiting vibration lies outside the band in which the machine is known, else None."""
    low, high = (to_hz(w) for w in band)
    frequency = to_hz(lobes.chatter_frequency[np.isfinite(lobes.chatter_frequency)])
    outside = (frequency < low) | (frequency > high)
    if not outside.any():
        return None
    worst = float(frequency[outside][np.argmax(np.abs(frequency[outside] - 0.5 * (low + high)))])
    return (
        f"at {int(outside.sum())} of {lobes.spindle_speed.size} speeds chatter is expected outside the identified band "
        f"{low:.0f}-{high:.0f} Hz (as far as {worst:.0f} Hz): the machine is extrapolated there"
    )


def outside_speeds(machine: TipSource, speeds: FloatArray) -> list[str]:
    """Return a sentence where a machine that changes with speed is asked for speeds that it was not cut at."""
    known = machine.speed_range
    # the last digit of a speed that was written in rev/min is nobody's wish
    if known is None or (speeds.min() >= known[0] * (1.0 - 1e-9) and speeds.max() <= known[1] * (1.0 + 1e-9)):
        return []
    low, high = (to_rpm(speed) for speed in known)
    return [
        f"the machine was identified from {low:.0f} to {high:.0f} rev/min; outside this range its dynamics at the nearest speed are used"
    ]
