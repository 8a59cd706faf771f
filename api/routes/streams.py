"""Live forces over a WebSocket: samples in, forces out, and others who watch."""

from __future__ import annotations

import asyncio
import contextlib
import json
import logging
import math
from collections.abc import Awaitable, Callable
from typing import Any
from urllib.parse import urlsplit

from fastapi import APIRouter, WebSocket
from fastapi.concurrency import run_in_threadpool
from fastapi.exceptions import RequestValidationError
from fastapi.responses import JSONResponse
from starlette.requests import HTTPConnection
from starlette.websockets import WebSocketDisconnect, WebSocketState

from api import problems
from api.parts import Parts, ThisService
from api.problems import Problem
from api.routes.common import guard
from api.routes.common import problems as documented
from api.routes.openings import Opening, logger, replayed
from api.schemas.common import body_of
from api.schemas.forces import Hello, ReplayHello, StreamHello, StreamsAnswer, StreamSummary, WatchHello
from api.security import HEADER, Caller, Guarded, WhoAsks, caller_of, new_id
from api.stores.records import Unavailable
from api.streams.frames import TooLarge, WrongKind, object_of, samples_of, samples_of_text
from api.streams.hub import Full, Hub
from api.streams.session import End, Listener, Session, Stage
from api.work.pool import Busy
from rcsa_ident.errors import InputError

router = APIRouter(tags=["forces"], route_class=Guarded)
log = logging.getLogger("rcsa_ident.service")
#: Time for the first message, for what waits for a reader at the end, and for a steady part that an observer can be made from [s].
HELLO, LINGER, SETTLING = 10.0, 5.0, 120.0
#: Bytes of a first message.
MOST_HELLO = 300_000
_WORDS = {1009: 413, 1003: 415}


@router.get(
    "/forces/streams",
    summary="Open force streams",
    description="A stream is opened over the WebSocket `/v1/forces/stream`; its messages are described in docs/streaming.md.",
    openapi_extra=guard("read"),
    responses=documented(),
)
async def streams(parts: ThisService, caller: WhoAsks) -> StreamsAnswer:
    return StreamsAnswer(items=[_summary(session) for session in parts.streams.list(caller.group)])


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
    parts: Parts = websocket.app.state.parts
    id = new_id()
    try:
        caller = await _admitted(websocket, parts)
    except Problem as problem:
        document = JSONResponse(problems.told(problem, id), problem.status, problem.headers, problems.MEDIA_TYPE)
        await websocket.send_denial_response(document)
        return
    await websocket.accept()
    end = End(1011, 500, "something unexpected happened; the log has it under this session")
    try:
        end = await _served(websocket, parts, caller, id)
    except WebSocketDisconnect:
        return
    except Exception as error:
        end = ended(error)
        if end.status == 500:
            log.error("unexpected", exc_info=error, extra={"fields": {"request_id": id}})
    finally:
        with contextlib.suppress(Exception):
            await _farewell(websocket, end, id)


async def _admitted(websocket: HTTPConnection, parts: Parts) -> Caller | None:
    """Return who asks, None where the first message is to tell; a page from elsewhere is not let in, whatever the browser would send."""
    origin, host = websocket.headers.get("origin"), websocket.headers.get("host", "")
    if origin is not None and (urlsplit(origin).scheme not in ("http", "https") or urlsplit(origin).netloc.lower() != host.lower()):
        raise Problem(403, "a page of another origin can not open a stream")
    where = websocket.client.host if websocket.client is not None else "nobody"
    _paced(parts, f"open {where}")
    if parts.settings.asks_for_keys and not websocket.headers.get(HEADER):
        return None
    return await run_in_threadpool(caller_of, websocket, parts)


def _paced(parts: Parts, who: str) -> None:
    seconds = parts.rates.wait(who)
    if seconds > 0.0:
        raise Problem(429, "too many streams are opened", headers={"Retry-After": str(math.ceil(seconds))})


async def _served(websocket: WebSocket, parts: Parts, caller: Caller | None, id: str) -> End:
    """Read the first message, do what it says, and return how it ended."""
    raw = await _hello(websocket)
    data = object_of(raw)
    kind: type[Hello] = WatchHello if "watch" in data else ReplayHello if "replay" in data else StreamHello
    hello = body_of(kind, raw.encode("utf-8", "replace"))
    if caller is None:
        caller = await run_in_threadpool(caller_of, websocket, parts, hello.key)
    _paced(parts, caller.id)
    scope = "read" if isinstance(hello, WatchHello) and not caller.may("run") else "run"
    if not caller.may(scope):
        raise Problem(403, f"the key has not the scope {scope}")
    log.info("stream", extra={"fields": {"request_id": id, "kind": kind.__name__, "key": caller.id, "group": caller.group}})
    hub = parts.streams
    if isinstance(hello, WatchHello):
        session = hub.get(caller.group, hello.watch)
        if session is None:
            raise Problem(404, "there is no such stream")
        return await _watched(websocket, hub, session, hello)
    if isinstance(hello, ReplayHello):
        opening = await replayed(parts, caller.group, hello)
    else:
        assert isinstance(hello, StreamHello)
        opening = await logger(parts, caller.group, hello)
    about = opening.about(id, caller.group, parts.settings.stream_buffer_seconds)
    session = hub.open(about)
    try:
        return await _owned(websocket, parts, session, opening, hello)
    except WebSocketDisconnect:
        hub.close(session, End())
        raise
    except BaseException as error:
        hub.close(session, ended(error) if isinstance(error, Exception) else End(1001, 503, "the service ends"))
        raise


async def _hello(websocket: WebSocket) -> str:
    try:
        message = await asyncio.wait_for(websocket.receive(), HELLO)
    except TimeoutError:
        raise Problem(408, f"no first message in {HELLO:g} s") from None
    if message["type"] == "websocket.disconnect":
        raise WebSocketDisconnect(message.get("code", 1006))
    text = message.get("text")
    if text is None:
        raise WrongKind("first message", "bytes", "a JSON object")
    if len(text) > MOST_HELLO:
        raise TooLarge("first message", f"{len(text)} characters", f"at most {MOST_HELLO}")
    return text


async def _owned(websocket: WebSocket, parts: Parts, session: Session, opening: Opening, hello: Hello) -> End:
    """Serve the client that a session belongs to."""
    hub, listener = parts.streams, Listener(len(session.about.axes), hello.format == "json", hello.envelope)
    hub.listen(session, listener)
    about = session.about
    listener.tell("opened", session=about.id, axes=list(about.axes), sampling_rate_hz=about.rate, settle_samples=opening.settle)
    tasks = [
        _told(hub, session, _received(websocket, hub, session, hello.format == "json", opening.source is None)),
        _told(hub, session, _prepared(parts, session, opening)),
    ]
    return await _until_over(websocket, session, listener, tasks)


async def _watched(websocket: WebSocket, hub: Hub, session: Session, hello: Hello) -> End:
    """Serve a viewer; a session does not end with it."""
    listener, about = Listener(len(session.about.axes), hello.format == "json", hello.envelope), session.about
    hub.listen(session, listener)
    listener.tell("watching", session=about.id, name=about.name, axes=list(about.axes), sampling_rate_hz=about.rate)
    if session.stage is Stage.LIVE:
        listener.tell("ready", **session.ready)
    try:
        gone = asyncio.create_task(_silent(websocket))
        return await _until_over(websocket, session, listener, [gone])
    finally:
        session.listeners.remove(listener)


async def _silent(websocket: WebSocket) -> None:
    """Return when a viewer goes; what it says meanwhile nobody needs."""
    while (await websocket.receive())["type"] != "websocket.disconnect":
        pass
    raise WebSocketDisconnect


def _told(hub: Hub, session: Session, doing: Awaitable[None]) -> asyncio.Task[None]:
    """Do something for a session; what fails ends it with the reason."""

    async def guarded() -> None:
        try:
            await doing
        except WebSocketDisconnect:
            hub.close(session, End())
            raise
        except Exception as error:
            end = ended(error)
            if end.status == 500:
                log.error("unexpected", exc_info=error, extra={"fields": {"session": session.about.id}})
            hub.close(session, end)

    return asyncio.create_task(guarded())


async def _until_over(websocket: WebSocket, session: Session, listener: Listener, tasks: list[asyncio.Task[None]]) -> End:
    """Send what there is until the session is over, or its reader has gone."""
    sending = asyncio.create_task(_sent(websocket, session, listener))
    over = asyncio.create_task(session.over.wait())
    try:
        waiting: set[asyncio.Task[Any]] = {over, sending, *tasks}
        while not over.done() and not sending.done():
            done, waiting = await asyncio.wait(waiting, return_when=asyncio.FIRST_COMPLETED)
            for task in done:
                # a reader that has gone
                task.result()
        # who does not read does not hold the end up for long
        await asyncio.wait_for(sending, LINGER)
    except TimeoutError:
        pass
    finally:
        await _ended({sending, over, *tasks})
    return session.end


async def _ended(tasks: set[asyncio.Task[Any]]) -> None:
    """Have tasks ended; what became of them has been told."""
    for task in tasks:
        task.cancel()
    # not gathered: were this task cancelled meanwhile, it would be told that they were
    for task in (await asyncio.wait(tasks))[0]:
        if not task.cancelled():
            task.exception()


async def _sent(websocket: WebSocket, session: Session, listener: Listener) -> None:
    while not session.over.is_set() or listener.pending:
        await listener.awake.wait()
        for each in listener.taken():
            await (websocket.send_text(each) if isinstance(each, str) else websocket.send_bytes(each))
        if session.over.is_set():
            listener.awake.set()


async def _received(websocket: WebSocket, hub: Hub, session: Session, text: bool, feeds: bool) -> None:
    """Take frames until the client has no more."""
    channels = session.about.channels
    while True:
        message = await websocket.receive()
        if message["type"] == "websocket.disconnect":
            raise WebSocketDisconnect(message.get("code", 1006))
        raw, words = message.get("bytes"), message.get("text")
        if words is not None and len(words) < 100 and object_of(words).get("event") == "end":
            break
        if not feeds:
            raise WrongKind("message", "a frame", 'nothing but {"event": "end"}: the samples are those of the recording')
        if (words is not None) is not text:
            raise WrongKind("frame", "bytes" if raw is not None else "text", "JSON" if text else "bytes, as the hello says")
        first, samples = samples_of_text(words, channels) if words is not None else samples_of(raw or b"", channels)
        ahead = first - session.counts.following
        if session.counts.following >= 0 and ahead > MOST_AHEAD * session.about.rate:
            raise InputError("first", first, f"an index at most an hour ahead of the last one, {session.counts.following}")
        hub.offer(session, first, samples)
    await finished(hub, session)


#: An index further ahead is a fault of its sender, not a gap [s].
MOST_AHEAD = 3600.0


async def finished(hub: Hub, session: Session) -> None:
    """End a session when all its samples have their forces, those among them that an observer still has to be made from."""
    session.finishing = True
    session.arrived.set()
    if session.stage is not Stage.LIVE or session.counts.backlog:
        await session.drained.wait()
    hub.tell_status(session, "end")
    hub.close(session, End())


async def _prepared(parts: Parts, session: Session, opening: Opening) -> None:
    """Have the observer made, then stream; of a replay also feed it."""
    hub, loop = parts.streams, asyncio.get_running_loop()
    limit, refused = loop.time() + SETTLING, None
    while session.stage is not Stage.LIVE:
        window = (0, None) if opening.source is not None else session.window(opening.settle)
        if session.stage is Stage.ENDED:
            return
        if window is None and session.finishing:
            # too few samples for an observer, and no more will come
            session.drained.set()
            return
        if window is None:
            session.arrived.clear()
            await session.arrived.wait()
            continue
        session.stage = Stage.DESIGNING
        try:
            plan, ready = await _patiently(lambda window=window: opening.design(parts.work, *window))  # type: ignore[misc]
        except InputError as error:
            if opening.source is not None or loop.time() > limit:
                raise refused or error from None
            # perhaps the spindle has still come up to speed, or the tool has entered: the next second may do
            refused, detail = error, problems.of_input(error)
            for listener in session.listeners:
                listener.tell("settling", detail=detail.detail, errors=detail.errors)
            session.stage = Stage.SETTLING if session.stage is Stage.DESIGNING else session.stage
            parts.metrics.missed(0, session.skip(window[0] + opening.settle))
            continue
        hub.begin(session, plan, window[0], {"session": session.about.id, **ready})
    if opening.source is not None:
        await opening.feed(hub, session)
        await finished(hub, session)


async def _patiently(call: Callable[[], Awaitable[Any]], seconds: float = 30.0) -> Any:
    """Return what a call answers; where too much waits, ask again."""
    loop = asyncio.get_running_loop()
    limit = loop.time() + seconds
    while True:
        try:
            return await call()
        except Busy:
            if loop.time() > limit:
                raise
            await asyncio.sleep(0.5)


def ended(error: Exception) -> End:
    """Return how an error ends a stream."""
    found: Problem
    if isinstance(error, InputError):
        found = problems.of_input(error)
        code = 1009 if isinstance(error, TooLarge) else 1003 if isinstance(error, WrongKind) else 1008
        return End(code, _WORDS.get(code, 422), found.detail, tuple(found.errors))
    if isinstance(error, RequestValidationError):
        found = problems.of_validation(error.errors())
        return End(1008, 422, found.detail, tuple(found.errors))
    if isinstance(error, Problem):
        return End(1008, error.status, error.detail, tuple(error.errors))
    if isinstance(error, Full):
        return End(1013, 503, str(error))
    if isinstance(error, Busy | Unavailable):
        return End(1013, 503, "too much waits for an answer, or the store does not answer now")
    return End(1011, 500, "something unexpected happened; the log has it under this session")


async def _farewell(websocket: WebSocket, end: End, id: str) -> None:
    """Tell why, and close."""
    if websocket.client_state is WebSocketState.DISCONNECTED or websocket.application_state is WebSocketState.DISCONNECTED:
        return
    if end.status:
        document = problems.told(Problem(end.status, end.detail, end.errors), id)
        await asyncio.wait_for(websocket.send_text(json.dumps({"event": "problem", "problem": document})), LINGER)
    # a reason has at most 123 bytes
    await websocket.close(end.code, end.detail.encode()[:120].decode("utf-8", "ignore"))
