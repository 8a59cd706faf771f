"""A tool along a path through stock, as a job: one step, whose progress is told as it goes."""

from __future__ import annotations

import json
import time
from functools import partial

from api.codec import Unknown, decode, encode
from api.jobs.job_context import JobContext
from api.stores.jobs import Job, Outcome
from api.work import paths
from api.work.paths import PathRequest
from api.work.pool import guarded
from api.work.requests import MachineText, ToolingSource
from rcsa_ident.base.errors import InputError

#: What makes a job shorter, by its kind.
_SHORTER = {
    "removal": "a shorter one, places farther apart, larger cells",
    "stability": "a shorter one, places farther apart, larger cells, no bands, zero-order",
    "milling": "a shorter one, larger cells, fewer steps a turn",
}


def asked(machine: MachineText | None, called: str, tooling: ToolingSource, request: PathRequest) -> str:
    """Return the text of a job: machine, what answers call it, tooling and path as they are now."""
    return encode((machine, called, tooling, request))


def carry(job: Job, context: JobContext, most: float) -> Outcome:
    """Cut along the path of a job's text ``question``.

    `most` [s]: of work; how many unlike cuts a path has is known only when it is cut
    Raises `InputError`: another version of the service has accepted the question, and this one cannot read it; or it is too much work.
    """
    try:
        machine, called, tooling, request = decode(str(context.text("question")))
    except Unknown:
        raise InputError("question", "one of another version of the service", "the same question, asked again") from None
    start = time.monotonic()

    def told(stage: str, done: int, total: int) -> None:
        context.progress(stage, done, total)
        if time.monotonic() - start > most:
            found = f"one that takes more than {most:g} s; {done} of {total} were done ({stage})"
            raise InputError("path", found, _SHORTER[request.kind])

    found = context.remember("path", partial(guarded, paths.cut, machine, tooling, request, told))
    answer = json.dumps({"machine": called, **json.loads(found["answer"])}, allow_nan=False)
    return Outcome("done", "", texts={"answer": answer, "table": found["table"]})
