"""Live forces over a WebSocket: samples in, forces out, also to viewers."""

from __future__ import annotations

import asyncio
import contextlib
import json
import logging
import math

from fastapi import APIRouter, WebSocket
from fastapi.responses import JSONResponse
from starlette.requests import HTTPConnection
from starlette.websockets import WebSocketDisconnect, WebSocketState

from api import problems
from api.components import Components, ThisService
from api.connections import network_of
from api.conventions import guard
from api.conventions import problems as documented
from api.live.stream_connection import LINGER, UNEXPECTED, end_of, serve_owner, serve_viewer
from api.live.stream_opening import open_logger, open_replay
from api.log_lines import tell
from api.problems import Problem
from api.schemas.common import body_of
from api.schemas.forces import Hello, ReplayHello, StreamHello, StreamsAnswer, StreamSummary, WatchHello
from api.security import HEADER, Caller, Guarded, WhoAsks, admitted, is_foreign, new_id
from api.shares import GROUP
from api.streams.frames import TooLarge, WrongKind, object_of
from api.streams.session import End, Session

router = APIRouter(tags=["forces"], route_class=Guarded)
log = logging.getLogger("rcsa_ident.service")
#: Time limit for the first message [s].
HELLO = 10.0
#: Largest first message [characters].
MOST_HELLO = 300_000


@router.get(
    "/forces/streams",
    summary="Open force streams",
    description="A stream is opened over the WebSocket `/v1/forces/stream`; its messages are described in docs/streaming.md.",
    openapi_extra=guard("read"),
    responses=documented(),
)
async def streams(components: ThisService, caller: WhoAsks) -> StreamsAnswer:
    return StreamsAnswer(items=[_summary(session) for session in components.streams.list(caller.group)])


def _summary(session: Session) -> StreamSummary:
    about, counts = session.about, session.counts
    return StreamSummary(
        session=about.id,
        name=about.name,
        machine=about.machine,
        tooling=about.tooling,
        started=about.started,
        stage=str(session.stage),
        sampling_rate_hz=about.rate,
        axes=list(about.axes),
        samples=counts.samples,
        lost=counts.lost,
        dropped=counts.dropped,
    )


@router.websocket("/forces/stream")
async def stream(websocket: WebSocket) -> None:
    components: Components = websocket.app.state.components
    id = new_id()
    tell(request_id=id)
    try:
        caller = await _admit(websocket, components)
    except Problem as problem:
        document = JSONResponse(problems.content_of(problem, id), problem.status, problem.headers, problems.MEDIA_TYPE)
        await websocket.send_denial_response(document)
        return
    await websocket.accept()
    end = UNEXPECTED
    try:
        end = await _serve(websocket, components, caller, id)
    except WebSocketDisconnect:
        return
    except Exception as error:
        end = end_of(error)
        if end.status == 500:
            log.error("unexpected", exc_info=error)
    finally:
        with contextlib.suppress(Exception):
            await _farewell(websocket, end, id)


async def _admit(websocket: HTTPConnection, components: Components) -> Caller | None:
    """Return the caller, None where the first message has the key; pages of other origins are refused, whatever the browser would send."""
    if is_foreign(websocket):
        raise Problem(403, "a page of another origin cannot open a stream")
    where = network_of(websocket.client.host) if websocket.client is not None else "nobody"
    _check_rate(components, f"open {where}")
    if components.settings.asks_for_keys and not websocket.headers.get(HEADER):
        return None
    return await admitted(websocket, components)


def _check_rate(components: Components, who: str) -> None:
    seconds = components.rates.wait(who)
    if seconds > 0.0:
        raise Problem(429, "streams are opened too often", headers={"Retry-After": str(math.ceil(seconds))})


async def _serve(websocket: WebSocket, components: Components, caller: Caller | None, id: str) -> End:
    """Read the first message, serve the stream, and return its end."""
    raw = await _hello(websocket)
    data = object_of(raw)
    kind: type[Hello] = WatchHello if "watch" in data else ReplayHello if "replay" in data else StreamHello
    hello = body_of(kind, raw.encode("utf-8", "replace"))
    if caller is None:
        caller = await admitted(websocket, components, hello.key)
    GROUP.set(caller.group)
    tell(key=caller.id, group=caller.group)
    _check_rate(components, caller.id)
    scope = "read" if isinstance(hello, WatchHello) and not caller.may("run") else "run"
    if not caller.may(scope):
        raise Problem(403, f"the API key does not have the scope {scope}")
    log.info("stream", extra={"fields": {"kind": kind.__name__}})
    hub = components.streams
    if isinstance(hello, WatchHello):
        session = hub.get(caller.group, hello.watch)
        if session is None:
            raise Problem(404, "there is no such stream")
        return await serve_viewer(websocket, components, caller, session, hello)
    if isinstance(hello, ReplayHello):
        opening = await open_replay(components, caller.group, hello)
    else:
        assert isinstance(hello, StreamHello)
        opening = await open_logger(components, caller.group, hello)
    about = opening.about(id, caller.group, components.settings.stream_buffer_seconds)
    session = hub.open(about)
    tell(**session.ids)
    try:
        return await serve_owner(websocket, components, caller, session, opening, hello)
    except WebSocketDisconnect:
        hub.close(session, End())
        raise
    except BaseException as error:
        hub.close(session, end_of(error) if isinstance(error, Exception) else End(1001, 503, "the service is shutting down"))
        raise


async def _hello(websocket: WebSocket) -> str:
    try:
        message = await asyncio.wait_for(websocket.receive(), HELLO)
    except TimeoutError:
        raise Problem(408, f"no first message within {HELLO:g} s") from None
    if message["type"] == "websocket.disconnect":
        raise WebSocketDisconnect(message.get("code", 1006))
    text = message.get("text")
    if text is None:
        raise WrongKind("first message", "bytes", "a JSON object")
    if len(text) > MOST_HELLO:
        raise TooLarge("first message", f"{len(text)} characters", f"at most {MOST_HELLO}")
    return text


async def _farewell(websocket: WebSocket, end: End, id: str) -> None:
    """Send the reason and close the WebSocket."""
    if websocket.client_state is WebSocketState.DISCONNECTED or websocket.application_state is WebSocketState.DISCONNECTED:
        return
    if end.status:
        document = problems.content_of(Problem(end.status, end.detail, end.errors), id)
        await asyncio.wait_for(websocket.send_text(json.dumps({"event": "problem", "problem": document})), LINGER)
    # a reason has at most 123 bytes
    await websocket.close(end.code, end.detail.encode()[:120].decode("utf-8", "ignore"))
