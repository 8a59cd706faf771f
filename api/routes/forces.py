"""Forces of a recording, uploaded with the query or of a campaign."""

from __future__ import annotations

import contextlib
from collections.abc import AsyncIterator, Mapping
from pathlib import Path
from typing import Any

from fastapi import APIRouter, Request, Response
from fastapi.concurrency import run_in_threadpool
from fastapi.responses import FileResponse
from starlette.background import BackgroundTask

from api.components import Components, ThisService
from api.conventions import BODY, guard, problems, while_there
from api.lookups import known_machine, pair_reader, tooling_source, uploaded
from api.problems import Problem
from api.reading import reader_tasks
from api.reading.campaign_text import FORMATS, Upload
from api.reading.uploads import Received
from api.schemas.campaigns import given_sensors
from api.schemas.common import body_of
from api.schemas.forces import ForceAnswer, ForceQuery, ForceUpload
from api.security import Guarded, WhoAsks
from api.transfer.body_stream import storage_problems
from api.transfer.multipart import FORM, form
from api.work.forces import ForceQuestion, ReadPair, forces, sensors_of
from api.work.requests import MachineText, ToolingSource
from rcsa_ident.base.errors import InputError
from rcsa_ident.signals.recording import Sensor

router = APIRouter(tags=["forces"], route_class=Guarded)
CSV, JSON = "text/csv", "application/json"
_BODY = {
    "required": True,
    "content": {
        JSON: {"schema": {"$ref": "#/components/schemas/ForceQuery"}},
        FORM: {
            "schema": {
                "type": "object",
                "required": ["query", "recording"],
                "properties": {
                    "query": {"$ref": "#/components/schemas/ForceUpload"},
                    "recording": {"type": "string", "format": "binary", "description": "The suffix of its file name is the format."},
                    "air": {
                        "type": "string",
                        "format": "binary",
                        "description": "Recording of an air cut with the same clamping and speed.",
                    },
                },
                "additionalProperties": False,
            },
            "encoding": {"query": {"contentType": JSON}},
        },
    },
}


@router.post(
    "/forces",
    summary="Forces of a recording; Accept: text/csv for FORCES.csv",
    description="Either a form with the recording, or JSON that names a recording of a campaign. "
    "Without an air cut run-out remains in the forces.",
    openapi_extra=guard("run", requestBody=_BODY, **{"x-content-types": (JSON, FORM)}),
    response_model=ForceAnswer,
    responses={200: {"description": "Forces.", "content": {CSV: {"schema": {"type": "string"}}}}, **problems(404, 408, *BODY)},
)
async def estimate(request: Request, components: ThisService, caller: WhoAsks) -> Any:
    csv = CSV in request.headers.get("accept", "")
    if request.headers["content-type"].split(";")[0].strip().lower() == JSON:
        query = body_of(ForceQuery, await request.body())
        found = await run_in_threadpool(_of_campaign, components, caller.group, query)
        return await _answered(request, components, caller.group, *found, csv)
    with components.uploads.admitted(caller.group):
        async with form(request, components, caller.group, ("query",), ("recording", "air")) as (texts, files):
            missing = "query" if "query" not in texts else "recording" if "recording" not in files else ""
            if missing:
                raise Problem(
                    422, f"the form has no part named {missing}", [{"field": missing, "found": "nothing", "allowed": "a part of this name"}]
                )
            upload = body_of(ForceUpload, texts["query"])
            machine, tooling, question, sensors = await run_in_threadpool(_of_upload, components, caller.group, upload)
            async with _read(components, caller.group, files, sensors, upload.sampling_rate_hz) as source:
                return await _answered(request, components, caller.group, machine, tooling, question, source, csv)


def _of_campaign(components: Components, group: str, query: ForceQuery) -> tuple[MachineText, ToolingSource, ForceQuestion, ReadPair]:
    found = uploaded(components, group, query.campaign, query.recording)
    tooling = found.tooling if query.tooling is None else tooling_source(components, group, query.tooling)
    return known_machine(components, group, query.machine), tooling, query.question(found.speed), pair_reader(found.cut, found.air)


def _of_upload(
    components: Components, group: str, upload: ForceUpload
) -> tuple[MachineText, ToolingSource, ForceQuestion, tuple[Sensor, ...]]:
    machine = known_machine(components, group, upload.machine)
    sensors = given_sensors(upload.sensors) or sensors_of(machine.text)
    return machine, tooling_source(components, group, upload.tooling), upload.question(), sensors


@contextlib.asynccontextmanager
async def _read(
    components: Components, group: str, files: Mapping[str, tuple[str, Received]], sensors: tuple[Sensor, ...], rate: float | None
) -> AsyncIterator[ReadPair]:
    """Function that reads the samples of a form's files, normalised by the reader process and deleted at the end of the context."""
    targets: dict[str, Path] = {}
    try:
        for name, (file, received) in files.items():
            if not file.lower().endswith(FORMATS):
                raise InputError(name, file[-80:], f"a file name that ends in one of {', '.join(FORMATS)}")
            targets[name] = await run_in_threadpool(components.files.spare, group)
            with storage_problems():
                await components.reader.run(reader_tasks.read_alone, Upload(received.path, file, targets[name]), sensors, rate)
        yield pair_reader(targets["recording"], targets.get("air"))
    finally:
        for path in targets.values():
            path.unlink(missing_ok=True)


async def _answered(
    request: Request,
    components: Components,
    group: str,
    machine: MachineText,
    tooling: ToolingSource,
    question: ForceQuestion,
    source: ReadPair,
    csv: bool,
) -> Any:
    run = components.work.run
    if not csv:
        return ForceAnswer.model_validate(await while_there(request, run(forces, machine, tooling, question, source)))
    path: Path = await run_in_threadpool(components.files.spare, group)
    try:
        await while_there(request, run(forces, machine, tooling, question, source, path))
    except BaseException:
        path.unlink(missing_ok=True)
        raise
    name: Response = FileResponse(path, media_type=CSV, filename="FORCES.csv", background=BackgroundTask(path.unlink, missing_ok=True))
    return name
