"""Stability lobes that take long, as a job: one step for each tooling, whose limits are told as they come."""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from functools import partial
from typing import Any

from api.codec import Unknown, decode, encode
from api.jobs.job_context import JobContext
from api.stores.jobs import PARTIAL, Job, Outcome
from api.work import tasks
from api.work.pool import guarded
from api.work.requests import LobeRequest, MachineText, ToolingSource
from rcsa_ident.base.errors import InputError
from rcsa_ident.base.units import to_hz, to_rpm

#: Of the progress, which counts speeds over all toolings.
STAGE = "speeds"


def asked(machine: MachineText, toolings: Sequence[ToolingSource], question: LobeRequest) -> str:
    """Return the text of a job: machine and toolings as they are now, whatever becomes of them while it waits."""
    return encode((machine, tuple(toolings), question))


class _Known:
    """The limits of one of several toolings that are known, told whenever there is another.

    `speeds`: sequence of float [rad/s], that were asked for; a recommendation needs some beside them, too
    """

    def __init__(self, context: JobContext, speeds: Sequence[float], tooling: str, index: int, toolings: int) -> None:
        self.context, self.speeds, self.tooling, self.index, self.toolings = context, frozenset(speeds), tooling, index, toolings
        self.found: dict[float, tuple[float, float]] = {}

    def __call__(self, speed: float, limit: float, chatter: float) -> None:
        self.found[speed] = limit, chatter
        self.progress()
        self.context.curve(f"partial {self.index}", self.rows, PARTIAL)

    def progress(self) -> None:
        """Tell how far the job is: toolings come one after the other."""
        count = len(self.speeds)
        self.context.progress(STAGE, self.index * count + len(self.speeds & self.found.keys()), self.toolings * count)

    def rows(self) -> dict[str, Any]:
        """Return what is known, as `PartialLobes`."""
        rising = sorted(self.found)
        limits, chatter = ([self.found[speed][k] for speed in rising] for k in (0, 1))
        return {
            "tooling": self.tooling,
            "index": self.index,
            "spindle_speed_rpm": [to_rpm(speed, 6) for speed in rising],
            "limit_depth_mm": [1e3 * limit if math.isfinite(limit) else None for limit in limits],
            "chatter_frequency_hz": [to_hz(each) if math.isfinite(each) else None for each in chatter],
        }


def carry(job: Job, context: JobContext) -> Outcome:
    """Compute the lobes of all toolings, whose questions are the job's text ``question``.

    Raises `InputError`: another version of the service has accepted the question, and this one cannot read it.
    """
    try:
        machine, toolings, question = decode(str(context.text("question")))
    except Unknown:
        raise InputError("question", "one of another version of the service", "the same question, asked again") from None
    found: list[dict[str, Any]] = []
    known = [_Known(context, question.speeds, tooling.name, i, len(toolings)) for i, tooling in enumerate(toolings)]
    for i, tooling in enumerate(toolings):
        known[i].progress()
        found.append(context.remember(f"lobes.{i}", partial(_answered, machine, tooling, question, known[i])))
    context.progress(STAGE, len(toolings) * len(question.speeds), len(toolings) * len(question.speeds))
    return Outcome("done", "", texts={"answer": json.dumps({"machine": _called(job), "toolings": found}, allow_nan=False)})


def _answered(machine: MachineText, tooling: ToolingSource, question: LobeRequest, watch: _Known) -> Any:
    """The lobes of a tooling, as plain as an answer at once has them: no word of the library is to be remembered beside them."""
    return json.loads(json.dumps(guarded(tasks.lobes, machine, tooling, question, watch), allow_nan=False))


def _called(job: Job) -> str:
    """What an answer calls the machine, the robot or the tip."""
    if job.machine:
        return job.machine
    asked = json.loads(job.request)
    # a job of an earlier release knows no tip
    if asked.get("tip") is not None:
        return "tip"
    robot = asked["robot"]["robot"]
    return str(robot if isinstance(robot, str) else robot["robot"]["name"])
