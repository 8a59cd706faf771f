"""Previews of a recording with a limited number of points: envelope over time and amplitude spectrum."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from api.reading.samples import blocks, length
from rcsa_ident.base.arrays import FloatArray
from rcsa_ident.signals.recording import Quantity, Recording
from rcsa_ident.signals.steady_part import hann

_BLOCK = 1 << 20
#: Longest record of a spectrum, taken from the middle of a longer recording.
_LONGEST = 1 << 21
_UNITS = {Quantity.DISPLACEMENT: "m", Quantity.ACCELERATION: "m/s^2", Quantity.FORCE: "N", Quantity.TRIGGER: ""}


def envelope(path: Path, points: int) -> dict[str, Any]:
    """Return minimum and maximum of each channel over at most `points` intervals of equal length, and the starts of those [s].

    An interval without any valid sample has None.
    """
    rate, count = length(path)
    width = -(-count // points)
    low: list[FloatArray] = []
    high: list[FloatArray] = []
    found: Recording | None = None
    for _, found in blocks(path, width * max(_BLOCK // width, 1)):
        samples = found.samples
        starts = np.arange(0, samples.shape[0], width)
        low.append(np.fmin.reduceat(samples, starts))
        high.append(np.fmax.reduceat(samples, starts))
    assert found is not None
    lows, highs = np.concatenate(low), np.concatenate(high)
    channels = {
        sensor.name: {"unit": _UNITS[sensor.quantity], "low": _finite(lows[:, i]), "high": _finite(highs[:, i])}
        for i, sensor in enumerate(found.sensors)
    }
    return {"time_s": (np.arange(lows.shape[0]) * width / rate).tolist(), "channels": channels}


def spectrum(path: Path, speed_rpm: float | None, points: int) -> dict[str, Any]:
    """Return the amplitude spectrum of each channel (Hann window), the maximum of each of at most `points` bands; lost samples are zero.

    `speed_rpm`: spindle speed, whose multiples are returned as harmonics
    """
    rate, count = length(path)
    start = max(0, (count - _LONGEST) // 2)
    samples, sensors = _part(path, start, min(count, _LONGEST))
    present = np.isfinite(samples)
    samples = np.where(present, samples - np.nanmean(np.where(present.any(axis=0), samples, 0.0), axis=0), 0.0)
    window = hann(samples.shape[0]) if samples.shape[0] > 2 else np.ones(samples.shape[0])
    amplitude = 2.0 * np.abs(np.fft.rfft(samples * window[:, None], axis=0)) / window.sum()
    width = -(-amplitude.shape[0] // points)
    starts = np.arange(0, amplitude.shape[0], width)
    largest = np.maximum.reduceat(amplitude, starts)
    # for each band the frequency of its strongest line in any channel
    within = [int(s + np.argmax(amplitude[s : s + width].max(axis=1))) for s in starts]
    frequency = np.array(within) * rate / samples.shape[0]
    step = 0.0 if speed_rpm is None else speed_rpm / 60.0
    harmonics = np.arange(1, min(int(0.5 * rate / step), 1000) + 1) * step if step > 0.0 else np.zeros(0)
    channels = {
        sensor.name: {"unit": _UNITS[sensor.quantity], "amplitude": np.nan_to_num(largest[:, i]).tolist()}
        for i, sensor in enumerate(sensors)
    }
    return {"frequency_hz": frequency.tolist(), "channels": channels, "harmonics_hz": harmonics.tolist()}


def _part(path: Path, start: int, count: int) -> tuple[FloatArray, Any]:
    parts, sensors = [], None
    for first, found in blocks(path, _BLOCK):
        sensors = found.sensors
        if first + found.samples.shape[0] > start and first < start + count:
            parts.append(found.samples[max(start - first, 0) : start + count - first])
    return np.concatenate(parts), sensors


def _finite(values: FloatArray) -> list[float | None]:
    return [float(v) if np.isfinite(v) else None for v in values]
