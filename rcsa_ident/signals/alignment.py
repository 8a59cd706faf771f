"""Where the teeth stand: the angle between a cut and its air cut, and the time of a trigger's edge."""

from __future__ import annotations

import numpy as np

from rcsa_ident.base.arrays import ComplexArray, FloatArray
from rcsa_ident.signals.recording import Quantity, Recording, Sensor
from rcsa_ident.signals.steady import SteadyRecord

#: Correlation of both profiles below which they say nothing of the angle.
LEAST_CORRELATION = 0.8
#: An edge is not trusted to less than this share of a sample, however many there are.
EDGE_LIMIT = 0.02


def align(cut: ComplexArray, air: ComplexArray, teeth: int, highest: int = 16) -> tuple[float, float]:
    """Return the angle by which the air cut's profile must be turned to lie under the cut's, and its standard deviation.

    Only orders that the teeth do not share carry it: run-out and roundness of the flange. Cutter run-out adds force on
    them; what it leaves unexplained widens the standard deviation.

    `cut`, `air` [m], shape (orders, axes): lines of both records, orders from 0
    `highest`: highest order that is looked at
    Returns (float, float) [rad]: the angle in [0, 2 pi); a standard deviation of pi / sqrt(3) where it cannot be told.
    """
    order, cross = _overlap(cut, air, teeth, highest)
    unknown = 0.0, np.pi / np.sqrt(3.0)
    if order.size == 0:
        return unknown
    trial = np.linspace(0.0, 2.0 * np.pi, 64 * int(order.max()), endpoint=False)
    angle = float(trial[np.argmax(_agreement(order, cross, trial))])
    for _ in range(20):
        turned = cross * np.exp(1j * order * angle)
        curvature = np.sum(order**2 * turned.real)
        change = -np.sum(order * turned.imag) / curvature if curvature > 0.0 else 0.0
        angle += change
        if abs(change) < 1e-12:
            break
    c, a = cut[order], air[order]
    size = np.sqrt(np.sum(np.abs(c) ** 2) * np.sum(np.abs(a) ** 2))
    if not _agreement(order, cross, np.array([angle]))[0] > LEAST_CORRELATION * size:
        return unknown
    left = np.sum(np.abs(c - a * np.exp(1j * order * angle)[:, None]) ** 2)
    information = np.sum(order[:, None] ** 2 * np.abs(a) ** 2)
    degrees_of_freedom = max(2 * c.size - 1, 1)
    # residuals of run-out orders are not alike: half of them may carry all of it
    std = np.sqrt(2.0 * left / degrees_of_freedom / information) + 1e-4
    return angle % (2.0 * np.pi), float(min(std, unknown[1]))


def trigger_edge(
    recording: Recording, speed: float, window: slice = slice(None), deviation: FloatArray | None = None
) -> tuple[float, float] | None:
    """Return the time of the first trigger edge, from all edges of the record (or a window) together, and its standard deviation [s].

    A sampled edge is seen at the first sample behind it. Each one thus bounds the first edge's time from both sides;
    the time lies in what all bounds share, as wide as it is. Where edges jitter by more than a sample nothing is shared
    and their mean is taken.

    `speed` [rad/s]: spindle speed, as found in the record
    `window`: slice, where the speed was found, if not in the whole record
    `deviation` [rad]: of the spindle's angle in the window from that at this speed, where it does not turn evenly; the time is that at
        which the edge would come if it did
    Returns (float, float) [s], or None without a trigger, or if its edges do not come at the spindle's pace.
    """
    found = recording.channel(Quantity.TRIGGER, None, window)
    if found is None:
        return None
    sensor, x = found
    edges = rising(x).astype(float)
    if edges.size < 2:
        return None
    if deviation is not None:
        # the edge lies half a sample before the one that shows it
        edges += np.interp(edges - 0.5, np.arange(deviation.size), deviation) / speed * recording.rate
    edges += window.start or 0
    period = 2.0 * np.pi / speed / sensor.pulses_per_revolution * recording.rate
    pace = np.mean(np.exp(2j * np.pi * edges / period))
    if np.abs(pace) < 0.5:
        return None
    phase = np.angle(pace) / (2.0 * np.pi) * period
    late = np.mod(edges - phase + 0.5 * period, period) - 0.5 * period
    # a stray edge does not belong to the mark
    good = np.abs(late - np.median(late)) < 2.0 + 0.01 * period
    late, first = late[good], edges[good][0] - late[good][0]
    low, high = np.max(late) - 1.0, np.min(late)
    if high > low:
        time, std = first + 0.5 * (low + high), (high - low) / np.sqrt(12.0)
    else:
        time, std = first + late.mean() - 0.5, np.sqrt((late.var() + 1.0 / 12.0) / late.size)
    return float(time / recording.rate - sensor.delay), float(max(std, EDGE_LIMIT) / recording.rate)


def angle_to_air(cut: SteadyRecord, air: SteadyRecord, teeth: int) -> tuple[float, float]:
    """Return the angle by which the air cut must be turned to lie under the cut, and its standard deviation [rad].

    From the triggers where both recordings have one, else from the flange's profile.
    """
    edges = [trigger_edge(each.recording, each.spindle_speed, *followed(each)) for each in (cut, air)]
    if edges[0] is None or edges[1] is None:
        return align(cut.flange, air.flange, teeth)
    turned, std = ((air.spindle_speed * a, cut.spindle_speed * c) for a, c in zip(edges[1], edges[0], strict=True))
    pulses = _trigger(cut.recording).pulses_per_revolution
    # several marks a turn look alike: the profile says which
    trial = turned[0] - turned[1] + 2.0 * np.pi * np.arange(pulses) / pulses
    best = int(np.argmax(_agreement(*_overlap(cut.flange, air.flange, teeth, 16), trial))) if pulses > 1 else 0
    return float(trial[best]), float(np.hypot(*std))


def trigger_delay(
    recording: Recording, speed: float, teeth: int, window: slice = slice(None), deviation: FloatArray | None = None
) -> tuple[float | None, float | None, bool]:
    """Return when tooth 1 stands at immersion 0, its standard deviation [s], and whether the tooth angle at the edge is known.

    Where it is not, the time is that of the edge: the delay is later by the angle, the same in all cuts of a clamping. With
    several pulses a turn both are known only up to the time between them, which is enough where a whole number of teeth
    passes in it. None without a trigger that helps.

    `speed` [rad/s]: spindle speed, as found in the record
    `window`: slice, where the speed was found, if not in the whole record
    `deviation` [rad]: as in `trigger_edge`
    """
    edge = trigger_edge(recording, speed, window, deviation)
    sensor = None if edge is None else _trigger(recording)
    if edge is None or sensor is None or teeth % sensor.pulses_per_revolution != 0:
        return None, None, True
    if sensor.tooth_angle is None:
        return *edge, False
    return edge[0] - sensor.tooth_angle / speed, edge[1], True


def followed(steady: SteadyRecord) -> tuple[slice, FloatArray | None]:
    """Return where the speed of a record is known, all that was looked at if it does not change, and the angle's deviation there."""
    return (steady.window, None) if steady.deviation is None else (steady.part, steady.deviation)


def _trigger(recording: Recording) -> Sensor:
    return next(sensor for sensor in recording.sensors if sensor.quantity is Quantity.TRIGGER)


def rising(x: FloatArray) -> np.ndarray:
    """Return the samples at which a signal has just passed the middle between its extremes upwards; lost samples hide edges."""
    if np.all(np.isnan(x)) or np.nanmax(x) == np.nanmin(x):
        return np.zeros(0, dtype=int)
    middle = 0.5 * (np.nanmax(x) + np.nanmin(x))
    return np.flatnonzero((x[1:] > middle) & (x[:-1] <= middle)) + 1


def _overlap(cut: ComplexArray, air: ComplexArray, teeth: int, highest: int) -> tuple[np.ndarray, ComplexArray]:
    """Orders that the teeth do not share, and sum conj(cut) air over the axes at each."""
    order = np.arange(1, min(highest, cut.shape[0] - 1) + 1)
    order = order[order % teeth != 0] if teeth > 1 else order
    return order, np.sum(np.conj(cut[order]) * air[order], axis=1)


def _agreement(order: np.ndarray, cross: ComplexArray, trial: FloatArray) -> FloatArray:
    """Least squares |cut - air e^{i m angle}|^2 is the largest of this."""
    return np.real(np.exp(1j * np.outer(trial, order)) @ cross)
