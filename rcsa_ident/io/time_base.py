"""From a column of times to a sampling rate and the index of every sample."""

from __future__ import annotations

import re

import numpy as np

from rcsa_ident.base.arrays import FloatArray
from rcsa_ident.signals.told_units import seconds_in

#: Of a step: a time may stand this far from its place for other reasons than rounding.
JITTER = 0.02

#: Names of columns of times, also with more behind; ``t`` is one by itself, and ``T`` may be a temperature.
_TIME = re.compile(
    r"\s*(?:(?:rel|elapsed|abs)\w*[ _])?(?:time|timestamp|zeit|zeitstempel|temps|abscissa|x[ _-]?value)(?![^\W_])", re.IGNORECASE
)
_SUFFIX = re.compile(r"_\(?(s|ms|us|µs|μs|ns|sec|msec|usec|min|h)\)?$", re.IGNORECASE)


def time_unit(name: str, unit: str = "") -> str | None:
    """Return the unit of a column of times, empty where neither its name nor `unit` tells it; None of another column.

    >>> time_unit("time_ms"), time_unit("Time"), time_unit("t", "us"), time_unit("force")
    ('ms', '', 'us', None)
    """
    plain = name.strip()
    told = seconds_in(unit) is not None
    suffix = _SUFFIX.search(plain)
    base = plain[: suffix.start()] if suffix else plain
    if _TIME.match(plain) or base == "t" or (base == "T" and (told or suffix)):
        return unit.strip() or (suffix[1] if suffix else "")
    # oscilloscopes name the column by its unit
    return plain if len(plain) > 2 and seconds_in(plain) is not None and not unit else None


class Irregular(Exception):
    """The times are no multiples of one step."""

    def __init__(self, row: int, found: str, allowed: str) -> None:
        self.row, self.found, self.allowed = row, found, allowed
        super().__init__(f"row {row}: {found}")


def uniform(time: FloatArray, expected: float | None = None) -> tuple[float, np.ndarray]:
    """Return the rate [Hz] and the index of each sample, shape (n,), from times that were rounded when written.

    `time` [s], shape (n,)
    `expected` [Hz]: taken as it is where the times agree with it within their rounding; so is the roundest number of hertz that they allow
    Raises `Irregular`, which names the row where a time is missing, does not rise or stands between two steps.
    """
    if time.size < 2:
        raise Irregular(0, f"{time.size} samples", "at least two times, which give the sampling interval")
    if not np.all(np.isfinite(time)):
        row = int(np.argmin(np.isfinite(time)))
        raise Irregular(row, "no number" if np.isnan(time[row]) else str(time[row]), "a time [s]")
    step = np.diff(time)
    if np.any(step <= 0.0):
        row = int(np.argmax(step <= 0.0)) + 1
        raise Irregular(row, f"{time[row]:.9g} after {time[row - 1]:.9g}", "increasing times [s]")
    resolution = _resolution(time)
    typical = float(np.median(step))
    if not 1e-12 <= typical <= 1e12:
        raise Irregular(1, f"a sampling interval of {typical:.3g} s", "sampling intervals from 1e-12 to 1e12 s")
    # steps of rounded times differ by the rounding, their mean hardly does
    typical = float(np.mean(step[np.abs(step - typical) <= max(1.1 * resolution, 0.1 * typical)]))
    index = np.concatenate([[0.0], np.cumsum(np.rint(step / typical))])
    total = index[-1] + 1.0
    if total > 2 * time.size:
        raise Irregular(
            int(np.argmax(step)) + 1, f"{total - time.size:.6g} samples lost of {total:.6g}", "at most half of the samples lost"
        )
    everyone = np.arange(time.size, dtype=float)
    # a coarse clock cannot tell a gap from rounding: then only gapless times are taken
    fine = resolution <= 0.25 * typical
    trials = [(index, JITTER * typical), (index if fine else everyone, 0.6 * resolution + (JITTER * typical if fine else 0.0))]
    for places, tolerance in trials:
        fitted = _fit(places, time)
        if np.max(np.abs(_residual(places, time, fitted))) <= tolerance and np.diff(places).min() >= 1.0:
            break
    else:
        raise _first_irregular(time, step / typical, typical)
    places = places.astype(np.int64)
    rate = 1.0 / fitted[1]
    rounding = 0.6 * resolution + 1e-9 * typical
    # of the rates that the rounded times allow, the roundest is the likeliest
    for candidate in (expected, *(round(rate / unit) * unit for unit in (100.0, 10.0, 1.0))):
        if candidate and np.ptp(time - places / candidate) <= 2.0 * rounding:
            return float(candidate), places
    return float(rate), places


def _fit(places: FloatArray, time: FloatArray) -> tuple[float, float]:
    """Start and step of the straight line through the times, by least squares."""
    centred = places - places.mean()
    slope = float(centred @ (time - time.mean()) / (centred @ centred))
    return float(time.mean() - slope * places.mean()), slope


def _residual(places: FloatArray, time: FloatArray, fitted: tuple[float, float]) -> FloatArray:
    return time - fitted[0] - fitted[1] * places


def _resolution(time: FloatArray) -> float:
    """Unit of the last decimal that the times were written with [s]; both ends of the column tell it."""
    ends = np.concatenate([time[:1000], time[-1000:]])
    for decimals in range(13):
        scaled = ends * 10.0**decimals
        if np.all(np.abs(scaled - np.rint(scaled)) <= 1e-6 + 4.0 * np.spacing(np.abs(scaled))):
            return 10.0**-decimals
    return float(np.spacing(np.abs(ends).max()))


def _first_irregular(time: FloatArray, steps: FloatArray, typical: float) -> Irregular:
    off = np.abs(steps - np.rint(steps))
    row = int(np.argmax((off > 5.0 * JITTER) | (steps < 0.5)))
    row = int(np.argmax(off)) if off[row] <= 5.0 * JITTER and steps[row] >= 0.5 else row
    found = f"{time[row + 1]:.9g}, {steps[row]:.4g} sampling intervals after the previous time"
    return Irregular(row + 1, found, f"whole multiples of the sampling interval, {typical:.6g} s")
