"""Opening of a stream: from its first message to machine, tooling, channels and the source of its samples."""

from __future__ import annotations

import asyncio
import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from fastapi.concurrency import iterate_in_threadpool, run_in_threadpool

from api.components import Components
from api.lookups import air_cut, channels_of, known_machine, pair_reader, tooling_source, uploaded
from api.schemas.campaigns import given_sensors
from api.schemas.forces import ReplayHello, StreamHello
from api.security import now
from api.streams.design import StreamQuestion, design, design_replay
from api.streams.hub import Hub
from api.streams.session import About, Session, Stage
from api.work.forces import ReadPair, sensors_of
from api.work.pool import Work
from api.work.requests import MachineText, ToolingSource
from rcsa_ident.base.arrays import FloatArray
from rcsa_ident.base.errors import InputError
from rcsa_ident.base.units import from_rpm
from rcsa_ident.signals.recording import Quantity, Sensor

#: Fewest revolutions to design an observer from.
REVOLUTIONS = 12
#: Lengths of the parts that a replay reads, and of those that it feeds [s].
PART, TICK = 1.0, 0.02


@dataclass(frozen=True, slots=True)
class Source:
    """An uploaded recording, and its air cut where there is one."""

    cut: Path
    air: Path | None
    rate: float


@dataclass(frozen=True, slots=True)
class Opening:
    """Everything that a session begins with.

    `settle`: samples that the observer is designed from; 0 for a replay
    `air`: reads an uploaded air cut
    `source`: of a replay
    """

    machine: MachineText
    tooling: ToolingSource
    machine_id: str
    name: str
    question: StreamQuestion
    settle: int
    air: ReadPair | None = None
    source: Source | None = None

    def about(self, id: str, group: str, seconds: float) -> About:
        """Return the description of the session."""
        rate, q = self.question.rate, self.question
        return About(
            id, group, self.name, self.machine_id, self.tooling.name, now(), rate, q.axes, len(q.sensors), math.ceil(seconds * rate)
        )

    async def design(self, work: Work, first: int, samples: FloatArray | None) -> tuple[str, dict[str, Any]]:
        """Return the plan of the observer and the content of the client's event `ready`, computed by a worker."""
        if self.source is not None:
            return await work.run(design_replay, self.machine, self.tooling, self.question, pair_reader(self.source.cut, self.source.air))
        assert samples is not None
        raw = samples.astype("<f8").tobytes()
        return await work.run(design, self.machine, self.tooling, self.question, first, raw, self.air)

    async def feed(self, hub: Hub, session: Session) -> None:
        """Play the recording at its rate; it pauses where the service lags behind."""
        from api.reading.samples import blocks

        assert self.source is not None
        loop, rate = asyncio.get_running_loop(), self.question.rate
        begin, tick = loop.time(), max(1, round(TICK * rate * max(self.source.rate, 1.0)))
        async for start, part in iterate_in_threadpool(blocks(self.source.cut, math.ceil(PART * rate))):
            for first in range(0, part.samples.shape[0], tick):
                await session.room.wait()
                if session.stage is Stage.ENDED or session.finishing:
                    return
                samples = part.samples[first : first + tick]
                due = begin + (start + first + samples.shape[0]) / (rate * self.source.rate)
                await asyncio.sleep(max(due - loop.time(), 0.0))
                hub.offer(session, start + first, samples)


async def open_logger(components: Components, group: str, hello: StreamHello) -> Opening:
    """Return the opening of a data logger's stream."""

    def look() -> Opening:
        known = known_machine(components, group, hello.machine)
        tooling = tooling_source(components, group, hello.tooling)
        channels = channels_of(hello.channels, given_sensors(hello.sensors) or sensors_of(known.text))
        speed = None if hello.spindle_speed_rpm is None else from_rpm(hello.spindle_speed_rpm)
        if speed is None and not any(sensor.quantity is Quantity.TRIGGER for sensor in channels):
            raise InputError("spindle_speed_rpm", "nothing, and no trigger channel", "the programmed speed [rev/min]")
        axes = tuple(hello.axes) if hello.axes is not None else displacement_axes(channels)
        if len(set(axes)) < len(axes):
            raise InputError("axes", list(axes), "each axis once")
        seconds = max(hello.settle_s, 0.0 if speed is None else REVOLUTIONS * 2.0 * math.pi / speed)
        if seconds > 0.5 * components.settings.stream_buffer_seconds:
            raise InputError(
                "spindle_speed_rpm", hello.spindle_speed_rpm, f"a speed at which {REVOLUTIONS} revolutions fit into the buffer"
            )
        settle = math.ceil(seconds * hello.sampling_rate_hz)
        air = None
        if hello.air is not None:
            if hello.begins == "air":
                raise InputError("air", "a recording, and a stream that begins in air", "one of the two")
            air = air_cut(components, group, hello.air.campaign, hello.air.recording)
        question = StreamQuestion(hello.sampling_rate_hz, speed, channels, axes, hello.begins, hello.method)
        return Opening(known, tooling, hello.machine, hello.name, question, settle, air)

    return await run_in_threadpool(look)


async def open_replay(components: Components, group: str, hello: ReplayHello) -> Opening:
    """Return the opening of a replayed recording."""

    def look() -> Opening:
        found = uploaded(components, group, hello.replay.campaign, hello.replay.recording)
        machine_id = hello.machine or found.machine
        known = known_machine(components, group, machine_id)
        tooling = found.tooling if hello.tooling is None else tooling_source(components, group, hello.tooling)
        axes = displacement_axes(found.sensors)
        question = StreamQuestion(found.rate, found.speed, found.sensors, axes, "cut", hello.method)
        source = Source(found.cut, found.air, hello.replay.rate)
        return Opening(known, tooling, machine_id, hello.name or hello.replay.recording, question, 0, None, source)

    return await run_in_threadpool(look)


def displacement_axes(channels: Sequence[Sensor]) -> tuple[str, ...]:
    """Return the axes with a displacement sensor, X first."""
    axes = tuple(sorted(s.axis.upper() for s in channels if s.quantity is Quantity.DISPLACEMENT and s.axis is not None))
    if not axes:
        raise InputError("channels", "no displacement", "a displacement sensor for X or Y")
    return axes
