"""Tasks about forces: those of a recording, and the observer of a stream."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from api.work.machine_cache import is_result, read
from api.work.requests import MachineText, ToolingSource
from api.work.toolings import tooling_from, weigh
from rcsa_ident.base.errors import InputError
from rcsa_ident.base.units import to_hz, to_rpm
from rcsa_ident.cutting.conditions import Engagement
from rcsa_ident.machine.machine import Machine
from rcsa_ident.signals.recording import Recording, Sensor

#: Buckets of an answer's envelope, and most samples of one answer.
BUCKETS, MOST_SAMPLES = 2000, 8_000_000

ReadPair = Callable[[], tuple[Recording, Recording | None]]


@dataclass(frozen=True, slots=True)
class WornQuestion:
    """Cut whose cutting coefficients are estimated revolution by revolution: depth and feed [m], angles [rad]."""

    axial_depth: float
    feed_per_tooth: float
    engagement: Engagement
    feed_angle: float


@dataclass(frozen=True, slots=True)
class ForceQuestion:
    """Query for the forces of a recording.

    `speed` [rad/s]: None: from the trigger
    `method`: resonators or paper
    `idle`: least share of the time in which no tooth cuts
    """

    speed: float | None
    method: str = "resonators"
    smooth: bool = False
    idle: float | None = None
    wear: WornQuestion | None = None


def sensors_of(text: str) -> tuple[Sensor, ...]:
    """Return the sensors of a RESULT.json."""
    import json

    from rcsa_ident.io.curves.forces import sensors_of_result

    try:
        return sensors_of_result(json.loads(text) if is_result(text) else {"sensors": {}}, "")
    except InputError as error:
        if error.field != "sensors":
            raise
        found = "none, and the identification of the machine remembers none"
        raise InputError("sensors", found, "a table of sensors, as in campaign.toml") from None


def forces(machine: MachineText, tooling: ToolingSource, question: ForceQuestion, source: ReadPair, csv: Path | None = None) -> Any:
    """Return the forces of a recording as an answer, or write FORCES.csv and return None. `source`: reads the recording and its air cut."""
    from rcsa_ident.io.curves.forces import write_forces_csv
    from rcsa_ident.observer.force import restore_mean_force

    known, tool = read(machine.text), tooling_from(tooling)
    cut, air = source()
    found = observed(known, tool, cut, air, question.speed, question.method, question.smooth)
    estimate, level = found.estimate, None
    if question.idle is not None:
        estimate, level = restore_mean_force(estimate, question.idle)
    if csv is not None:
        columns = (
            {axis.upper(): values[:, i] for i, axis in enumerate(estimate.axes)} for values in (estimate.force, estimate.standard_deviation)
        )
        write_forces_csv(csv, estimate.time, *columns)
        return None
    size = max(-(-estimate.force.shape[0] // BUCKETS), 1)
    begin = np.arange(0, estimate.force.shape[0], size)
    low, high = np.minimum.reduceat(estimate.force, begin), np.maximum.reduceat(estimate.force, begin)
    axes, lines = {}, {}
    for i, axis in enumerate(estimate.axes):
        force = estimate.force[:, i]
        axes[axis.upper()] = {
            "std_n": float(np.median(estimate.standard_deviation[:, i])),
            "mean_n": None if level is None else float(level[i]),
            "rms_n": float(np.std(force)),
            "peak_n": float(np.max(np.abs(force))),
            "low": low[:, i].tolist(),
            "high": high[:, i].tolist(),
        }
        lines[axis.upper()] = _harmonics(force, cut.rate, found.spindle_speed, found.band)
    answer = {
        "spindle_speed_rpm": to_rpm(found.spindle_speed),
        "sampling_rate_hz": cut.rate,
        "band_hz": [to_hz(w) for w in found.band],
        "notes": [*tool.remarks, *known.remarks, *found.remarks],
        "axes": axes,
        "left_out_s": estimate.start,
        "time_s": estimate.time[begin].tolist(),
        "harmonics": lines,
        "wear": None if question.wear is None else _wear(found, tool, question.wear),
    }
    _check_finite(answer)
    return answer


def observed(
    machine: Machine, tool: Any, cut: Recording, air: Recording | None, speed: float | None, method: str, smooth: bool = False
) -> Any:
    """Return the estimated forces of a cut, a `MonitoredCut`."""
    from rcsa_ident.observer.tuning import PaperWalk, Resonators
    from rcsa_ident.workflows.estimate_forces import observe

    samples = cut.samples.shape[0] + (0 if air is None else air.samples.shape[0])
    if samples > MOST_SAMPLES:
        raise InputError("recording", f"{samples} samples", f"at most {MOST_SAMPLES} in one answer, the air cut's among them")
    assert machine.band is not None
    weigh(tool.assembly, 1.3 * to_hz(machine.band[1]))
    how = PaperWalk() if method == "paper" else Resonators()
    return observe(machine, tool.assembly, tool.cutter.teeth, cut, air, speed, how, None, smooth)


def _harmonics(force: Any, rate: float, speed: float, band: tuple[float, float]) -> list[dict[str, Any]]:
    """Amplitudes at the harmonics of the spindle frequency in the band."""
    from rcsa_ident.signals.spectra import line_spectrum

    if force.size < 4.0 * 2.0 * np.pi / speed * rate:
        return []
    amplitude = np.abs(line_spectrum(force[:, None], rate, speed, to_hz(band[1])).amplitude[:, 0])
    order = np.arange(amplitude.size)
    inside = order[(order * speed >= band[0]) & (order * speed <= band[1])]
    return [{"order": int(m), "frequency_hz": float(to_hz(m * speed)), "amplitude_n": float(amplitude[m])} for m in inside]


def _wear(found: Any, tool: Any, question: WornQuestion) -> dict[str, Any]:
    from rcsa_ident.cutting.conditions import CuttingConditions
    from rcsa_ident.dynamics.coordinates import Dof
    from rcsa_ident.workflows.estimate_forces import wear_of

    if set(found.estimate.axes) != {Dof.X, Dof.Y}:
        raise InputError("cut", f"forces of axis {', '.join(found.estimate.axes)} only", "forces of both axes, X and Y")
    cut = CuttingConditions(found.spindle_speed, question.axial_depth, question.feed_per_tooth, question.engagement, question.feed_angle)
    worn = wear_of(found, tool.cutter, cut)
    slope, slope_std = worn.trend()
    rows = {}
    for c, name in enumerate(worn.names):
        unit, factor = ("MPa", 1e-6) if name.endswith("c") else ("N/mm", 1e-3)
        rows[name] = {
            "mean": float(np.mean(worn.coefficient[:, c])) * factor,
            "std": float(np.median(worn.standard_deviation[:, c])) * factor,
            "trend_per_s": float(slope[c]) * factor,
            "trend_std_per_s": float(slope_std[c]) * factor,
            "unit": unit,
        }
    return {"coefficients": rows, "separable": bool(worn.separable), "misfit": float(worn.misfit)}


def _check_finite(value: Any) -> None:
    if isinstance(value, dict):
        value = list(value.values())
    if isinstance(value, list):
        for each in value:
            _check_finite(each)
    elif isinstance(value, float) and not math.isfinite(value):
        raise InputError("recording", "forces that are not finite", "signals whose forces are finite")
