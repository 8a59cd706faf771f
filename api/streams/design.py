"""Design of a stream's observer in a worker, from the first second of the stream or from the replayed recording."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from api.codec import encode
from api.streams.engine import Column, Plan
from api.work.forces import ReadPair, observed
from api.work.machine_cache import read
from api.work.requests import MachineText, ToolingSource
from api.work.toolings import tooling_from
from rcsa_ident.base.errors import InputError
from rcsa_ident.base.units import to_hz, to_rpm
from rcsa_ident.dynamics.coordinates import Dof
from rcsa_ident.signals.recording import Quantity, Recording, Role, Sensor


@dataclass(frozen=True, slots=True)
class StreamQuestion:
    """Properties of a stream.

    `rate` [Hz]
    `speed` [rad/s]: None: from the trigger
    `sensors`: of the channels, in their order
    `axes`: in the order of the columns of the forces
    `begins`: air: the spindle first turns in air, which shows its run-out; cut: the stream begins in the cut
    """

    rate: float
    speed: float | None
    sensors: tuple[Sensor, ...]
    axes: tuple[str, ...]
    begins: str
    method: str


def design(
    machine: MachineText, tooling: ToolingSource, question: StreamQuestion, first: int, raw: bytes, air: ReadPair | None
) -> tuple[str, dict[str, Any]]:
    """Return the encoded plan of a stream for the stream process, and the content of the client's event `ready`.

    `first`: index of the first sample
    `raw`: float64[samples, channels], as received
    `air`: reads an uploaded air cut
    """
    samples = np.frombuffer(raw, "<f8").reshape(-1, len(question.sensors))
    recording = Recording(question.rate, samples / np.array([s.sensitivity for s in question.sensors]), question.sensors)
    still = recording if question.begins == "air" else None if air is None else air()[0]
    return _planned(machine, tooling, question, first, recording, still, follow=True)


def design_replay(machine: MachineText, tooling: ToolingSource, question: StreamQuestion, source: ReadPair) -> tuple[str, dict[str, Any]]:
    """Return the same for a recording, whose streamed forces equal those of the whole recording to the last digit.

    `question`: the sensors are those of the recording, the samples in SI
    `source`: reads the recording and its air cut
    """
    recording, air = source()
    return _planned(machine, tooling, question, 0, recording, air, follow=False)


def _planned(
    machine: MachineText,
    tooling: ToolingSource,
    question: StreamQuestion,
    first: int,
    recording: Recording,
    air: Recording | None,
    follow: bool,
) -> tuple[str, dict[str, Any]]:
    from rcsa_ident.workflows.stream_forces import live_observer

    known, tool = read(machine.text), tooling_from(tooling)
    found = observed(known, tool, recording, air, question.speed, question.method)
    axes = tuple(axis.upper() for axis in found.estimate.axes)
    if set(axes) != set(question.axes):
        raise InputError("axes", list(question.axes), f"{' and '.join(axes)}: the axes with a displacement sensor and an identification")
    names = [sensor.name for sensor in question.sensors]

    def column(sensor: Sensor | None) -> Column | None:
        # the samples of a replay are already in SI
        return None if sensor is None else Column(names.index(sensor.name), sensor.sensitivity if follow else 1.0)

    planes = [Dof(axis.lower()) for axis in axes]
    gap = tuple(c for c in (column(recording.sensor(Quantity.DISPLACEMENT, plane)) for plane in planes) if c is not None)
    shaken = tuple(column(recording.accelerometer(plane, Role.FIXTURE)) for plane in planes)
    order = tuple(axes.index(axis) for axis in question.axes)
    # a replay tells what an upload of the recording does
    settling = found.observer.settling if follow else round(found.estimate.start * recording.rate)
    plan = Plan(live_observer(found, recording, follow), gap, shaken, len(names), first, order, settling)
    deviation = found.estimate.standard_deviation
    delay = max(found.response[axis].delay_at_lines for axis in found.response) * recording.rate
    ready = {
        "axes": list(question.axes),
        "sampling_rate_hz": recording.rate,
        "spindle_speed_rpm": to_rpm(found.spindle_speed),
        "band_hz": [to_hz(w) for w in found.band],
        "delay_samples": round(float(delay), 3),
        "std_n": {axis: float(deviation[-1, axes.index(axis)]) for axis in question.axes},
        "first": first + settling,
        "left_out_s": settling / recording.rate,
        "notes": [*tool.remarks, *known.remarks, *(found.notes if follow else found.remarks)],
    }
    return encode(plan), ready
