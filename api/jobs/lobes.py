"""Stability lobes that take long, as a job: one step for each tooling."""

from __future__ import annotations

import json
from collections.abc import Sequence
from functools import partial
from typing import Any

from api.jobs.codec import Unknown, decode, encode
from api.jobs.job_context import JobContext
from api.stores.jobs import Job, Outcome
from api.work import tasks
from api.work.pool import guarded
from api.work.requests import LobeRequest, MachineText, ToolingSource
from rcsa_ident.errors import InputError


def asked(machine: MachineText, toolings: Sequence[ToolingSource], question: LobeRequest) -> str:
    """Return the text of a job: machine and toolings as they are now, whatever becomes of them while it waits."""
    return encode((machine, tuple(toolings), question))


def carry(job: Job, context: JobContext) -> Outcome:
    """Compute the lobes of all toolings, whose questions are the job's text ``question``.

    Raises
    ------
    InputError
        Another version of the service has accepted the question, and this one cannot read it.
    """
    try:
        machine, toolings, question = decode(str(context.jobs.text(job.id, "question")))
    except Unknown:
        raise InputError("question", "one of another version of the service", "the same question, asked again") from None
    found: list[dict[str, Any]] = []
    for i, tooling in enumerate(toolings):
        context.progress("lobes", i, len(toolings))
        found.append(context.remember(f"lobes.{i}", partial(guarded, tasks.lobes, machine, tooling, question)))
    context.progress("lobes", len(toolings), len(toolings))
    return Outcome("done", "", texts={"answer": json.dumps({"machine": job.machine, "toolings": found}, allow_nan=False)})
