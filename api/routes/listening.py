"""What one recording says by itself, and hits of a hammer to an FRF: nothing is stored."""

from __future__ import annotations

from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path, PurePosixPath
from typing import Annotated, Any, Literal

from fastapi import APIRouter, Query, Request
from fastapi.concurrency import run_in_threadpool
from fastapi.responses import FileResponse
from starlette.background import BackgroundTask

from api.components import Components, ThisService
from api.conventions import BODY, guard, problems, while_there
from api.reading import reader_tasks
from api.reading.campaign_text import FORMATS, Upload, recording_name
from api.reading.uploads import Received
from api.schemas.listening import ListenAnswer, TapAnswer
from api.security import Guarded, WhoAsks
from api.transfer.body_stream import announced_length, append, check_room, complete, new_part, refuse_encoded, storage_problems
from api.transfer.multipart import FORM, form
from rcsa_ident.base.errors import InputError
from rcsa_ident.base.plausibility import RATE, SENSOR_MASS, SPINDLE_SPEED
from rcsa_ident.io.recordings.open_recording import TEXT

router = APIRouter(tags=["listen"], route_class=Guarded)
BINARY, CSV, UFF, JSON = "application/octet-stream", "text/csv", "application/x-uff", "application/json"
#: Formats by the type of a body whose name is not told.
_KINDS = {"audio/wav": ".wav", "audio/x-wav": ".wav", "audio/flac": ".flac", "audio/ogg": ".ogg", "audio/mpeg": ".mp3", CSV: ".csv"}
_FORMATS = tuple(dict.fromkeys((*FORMATS, *TEXT)))
_MOST_HITS = 50
_WORD = r"^[^\x00-\x1f\x7f]{1,128}$"
Name = Annotated[str, Query(max_length=300, description="Name of the file, where the body is one; its suffix is the format.")]
Word = Annotated[str | None, Query(pattern=_WORD)]
Sensitivity = Annotated[
    float | None, Query(gt=0, allow_inf_nan=False, description="Signal per SI unit of a channel in volts or in an unknown unit.")
]
Speed = Annotated[float | None, Query(ge=SPINDLE_SPEED.possible[0], le=SPINDLE_SPEED.possible[1], allow_inf_nan=False)]
Rate = Annotated[
    float | None, Query(ge=RATE.possible[0], le=RATE.possible[1], allow_inf_nan=False, description="Of a file that tells none.")
]
_ONE: dict[str, Any] = {"type": "string", "format": "binary"}


def _body(field: str, part: dict[str, Any]) -> dict[str, Any]:
    parts = {"type": "object", "required": [field], "properties": {field: part}, "additionalProperties": False}
    return {"required": True, "content": {**{kind: {"schema": _ONE} for kind in (BINARY, *_KINDS)}, FORM: {"schema": parts}}}


@router.post(
    "/listen",
    summary="What a recording says by itself: speed, verdict, chatter, speeds to try; nothing is stored",
    description="Any sensor and any format, as `rcsa-ident listen --json` answers it; the recording is the body, or the part `recording` "
    "of a form.",
    openapi_extra=guard("run", requestBody=_body("recording", _ONE), **{"x-content-types": (BINARY, *_KINDS, FORM)}),
    responses=problems(*BODY),
)
async def listen(
    request: Request,
    components: ThisService,
    caller: WhoAsks,
    name: Name = "",
    channel: Annotated[list[Annotated[str, Query(pattern=_WORD)]], Query(max_length=64, description="That are listened to.")] = [],  # noqa: B006
    quantity: Literal["acceleration", "sound", "displacement", "force"] | None = None,
    teeth: Annotated[int | None, Query(ge=1, le=100, description="Heard if left out.")] = None,
    speed_rpm: Speed = None,
    speeds_from: Speed = None,
    speeds_to: Speed = None,
    rate_hz: Rate = None,
    sensitivity: Sensitivity = None,
    curves: Annotated[bool, Query(description="Also what a page draws.")] = False,
) -> ListenAnswer:
    if (speeds_from is None) != (speeds_to is None):
        raise InputError("speeds_from" if speeds_from is None else "speeds_to", "nothing", "both of them, or neither")
    asked = {
        "channel": channel, "quantity": quantity, "teeth": teeth, "speed_rpm": speed_rpm, "speeds_from": speeds_from,
        "speeds_to": speeds_to, "rate_hz": rate_hz, "sensitivity": sensitivity, "curves": curves,
    }  # fmt: skip
    async with _files(request, components, caller.group, "recording", name, 1) as (file,):
        found = components.reader.run(reader_tasks.listen, file[1].path, file[0], asked)
        with storage_problems():
            return ListenAnswer.model_validate(await while_there(request, found))


@router.post(
    "/tap",
    summary="Hits of a hammer to a receptance; Accept: text/csv for FRF.csv, application/x-uff for UFF 58; nothing is stored",
    description="One recording with several hits as the body, or several recordings as parts `hits` of a form.",
    openapi_extra=guard(
        "run",
        requestBody=_body("hits", {"type": "array", "items": _ONE, "minItems": 1, "maxItems": _MOST_HITS}),
        **{"x-content-types": (BINARY, *_KINDS, FORM)},
    ),
    response_model=TapAnswer,
    responses={
        200: {"description": "A receptance.", "content": {CSV: {"schema": {"type": "string"}}, UFF: {"schema": {"type": "string"}}}},
        **problems(*BODY),
    },
)
async def tap(
    request: Request,
    components: ThisService,
    caller: WhoAsks,
    name: Name = "",
    axis: Annotated[Literal["X", "Y"], Query(description="Machine axis of hammer and response.")] = "X",
    force: Word = None,
    response: Word = None,
    quantity: Annotated[
        Literal["acceleration", "velocity", "displacement"],
        Query(description="What the response measures where its unit does not say."),
    ] = "acceleration",
    estimator: Literal["h1", "h2", "hv"] = "h1",
    sensor_mass_g: Annotated[
        float, Query(ge=0, le=SENSOR_MASS.possible[1], allow_inf_nan=False, description="Of a sensor at the point that is hit.")
    ] = 0.0,
    rate_hz: Rate = None,
    force_sensitivity: Sensitivity = None,
    response_sensitivity: Sensitivity = None,
    reverse: Annotated[bool, Query(description="The sensor or the hammer is reversed: turn the sign.")] = False,
) -> Any:
    accept = request.headers.get("accept", "")
    kind, suffix = next(((kind, suffix) for kind, suffix in ((CSV, ".csv"), (UFF, ".uff")) if kind in accept), (JSON, ""))
    asked = {
        "axis": axis, "force": force, "response": response, "quantity": quantity, "estimator": estimator, "sensor_mass_g": sensor_mass_g,
        "rate_hz": rate_hz, "force_sensitivity": force_sensitivity, "response_sensitivity": response_sensitivity,
        "reverse": reverse, "file": suffix,
    }  # fmt: skip
    target: Path = await run_in_threadpool(components.files.spare, caller.group)
    try:
        async with _files(request, components, caller.group, "hits", name, _MOST_HITS) as files:
            uploads = [Upload(received.path, file, target) for file, received in files]
            with storage_problems():
                found = await while_there(request, components.reader.run(reader_tasks.tap, asked, *uploads))
        if not suffix:
            return TapAnswer.model_validate(found)
        return FileResponse(target, media_type=kind, filename=f"FRF{suffix}", background=BackgroundTask(target.unlink, missing_ok=True))
    except BaseException:
        target.unlink(missing_ok=True)
        raise


@asynccontextmanager
async def _files(
    request: Request, components: Components, group: str, field: str, name: str, most: int
) -> AsyncIterator[list[tuple[str, Received]]]:
    """Names and files of a request, on the disk until the end of the context: its body, or the parts of its form."""
    kind = request.headers["content-type"].split(";")[0].strip().lower()
    refuse_encoded(request)
    with components.uploads.admitted(group):
        await check_room(components, group, announced_length(request))
        if kind == FORM:
            async with form(request, components, group, (), (field,), several=most > 1) as (_, parts):
                if not 1 <= len(parts) <= most:
                    raise InputError(field, f"{len(parts)} of them", f"1 to {most} files")
                yield [(checked_name(file), received) for file, received in parts.values()]
            return
        file = checked_name(recording_name(name) if name else f"recording{_KINDS.get(kind, '')}")
        async with new_part(components, group) as part:
            await append(request, components, group, part)
            yield [(file, await complete(part))]


def checked_name(name: str, field: str = "name") -> str:
    """Return the name of a recording whose suffix is a known format."""
    if PurePosixPath(name).suffix.lower() not in _FORMATS:
        raise InputError(field, name[-80:] or "nothing", f"the name of a file that ends in one of {', '.join(_FORMATS)}")
    return name
