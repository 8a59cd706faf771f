"""WebSocket of an open stream: frames are received, the observer is designed, forces are sent, and every end has its reason."""

from __future__ import annotations

import asyncio
import functools
import logging
from collections.abc import Awaitable, Callable
from typing import Any

from fastapi import WebSocket
from fastapi.concurrency import run_in_threadpool
from fastapi.exceptions import RequestValidationError
from starlette.websockets import WebSocketDisconnect

from api import problems
from api.components import Components
from api.live.stream_opening import Opening
from api.problems import Problem
from api.schemas.forces import Hello
from api.security import Caller, still_valid
from api.stores.entities import Damaged, Unavailable
from api.streams.frames import TooLarge, WrongKind, object_of, samples_of, samples_of_text
from api.streams.hub import Full, Hub
from api.streams.listener import Listener
from api.streams.session import End, Session, Stage
from api.work.pool import Busy
from rcsa_ident.base.errors import InputError, Unsteady

log = logging.getLogger("rcsa_ident.service")
#: Time limits for sending what remains at the end, and for finding a steady part to design the observer from [s].
LINGER, SETTLING = 5.0, 120.0
#: Pause between two attempts to design an observer [s].
PAUSE = 0.5
#: Interval between two checks of the API key [s].
LOOK = 3.0
#: A larger jump of the sample index is an error of the sender, not a gap [s].
MOST_AHEAD = 3600.0
#: Frames that are taken without a look at others' requests: a millisecond.
TOGETHER = 16
UNEXPECTED = End(1011, 500, "an internal error occurred; it is logged under this session's id")
_WORDS = {1009: 413, 1003: 415}


async def serve_owner(
    websocket: WebSocket, components: Components, caller: Caller, session: Session, opening: Opening, hello: Hello
) -> End:
    """Serve the client that a session belongs to."""
    hub, listener = components.streams, Listener(len(session.about.axes), hello.format == "json", hello.envelope)
    hub.listen(session, listener)
    about = session.about
    listener.tell("opened", session=about.id, axes=list(about.axes), sampling_rate_hz=about.rate, settle_samples=opening.settle)
    tasks = [
        _session_task(hub, session, _receive_frames(websocket, hub, session, hello.format == "json", opening.source is None)),
        _session_task(hub, session, _prepare(components, session, opening)),
        _session_task(hub, session, _watch_key(components, caller)),
    ]
    return await _until_over(websocket, session, listener, tasks)


async def serve_viewer(websocket: WebSocket, components: Components, caller: Caller, session: Session, hello: Hello) -> End:
    """Serve a viewer, whose end does not end the session."""
    listener, about = Listener(len(session.about.axes), hello.format == "json", hello.envelope), session.about
    components.streams.listen(session, listener)
    listener.tell("watching", session=about.id, name=about.name, axes=list(about.axes), sampling_rate_hz=about.rate)
    if session.stage is Stage.LIVE:
        listener.tell("ready", **session.ready)
    try:
        tasks = [asyncio.create_task(_until_disconnect(websocket)), asyncio.create_task(_watch_key(components, caller))]
        return await _until_over(websocket, session, listener, tasks)
    finally:
        session.listeners.remove(listener)


async def _until_disconnect(websocket: WebSocket) -> None:
    """Wait for the viewer to disconnect; its messages are ignored."""
    while (await websocket.receive())["type"] != "websocket.disconnect":
        pass
    raise WebSocketDisconnect


async def _watch_key(components: Components, caller: Caller) -> None:
    """Check periodically that the API key is still valid."""
    while True:
        await asyncio.sleep(LOOK)
        if not await run_in_threadpool(still_valid, components, caller):
            raise Problem(401, "the API key has been revoked, or has expired")


def _session_task(hub: Hub, session: Session, doing: Awaitable[None]) -> asyncio.Task[None]:
    """Run a task of a session; an error ends the session with its reason."""

    async def guarded() -> None:
        try:
            await doing
        except WebSocketDisconnect:
            hub.close(session, End())
            raise
        except Exception as error:
            end = end_of(error)
            if end.status == 500:
                log.error("unexpected", exc_info=error)
            hub.close(session, end)

    return asyncio.create_task(guarded())


async def _until_over(websocket: WebSocket, session: Session, listener: Listener, tasks: list[asyncio.Task[None]]) -> End:
    """Send events and forces until the session is over or its client has disconnected."""
    sending = asyncio.create_task(_send(websocket, session, listener))
    over = asyncio.create_task(session.over.wait())
    try:
        waiting: set[asyncio.Task[Any]] = {over, sending, *tasks}
        while not over.done() and not sending.done():
            done, waiting = await asyncio.wait(waiting, return_when=asyncio.FIRST_COMPLETED)
            for task in done:
                # the client has disconnected
                task.result()
        # a client that does not read delays the end only briefly
        await asyncio.wait_for(sending, LINGER)
    except TimeoutError:
        pass
    finally:
        await _cancel({sending, over, *tasks})
    return session.end


async def _cancel(tasks: set[asyncio.Task[Any]]) -> None:
    """Cancel tasks; their outcomes have been handled."""
    for task in tasks:
        task.cancel()
    # not gathered: their cancellation would look like one of this task
    for task in (await asyncio.wait(tasks))[0]:
        if not task.cancelled():
            task.exception()


async def _send(websocket: WebSocket, session: Session, listener: Listener) -> None:
    while not session.over.is_set() or listener.pending:
        await listener.awake.wait()
        for each in listener.taken():
            await (websocket.send_text(each) if isinstance(each, str) else websocket.send_bytes(each))
        if session.over.is_set():
            listener.awake.set()


async def _receive_frames(websocket: WebSocket, hub: Hub, session: Session, text: bool, feeds: bool) -> None:
    """Receive frames until the client ends the stream."""
    channels, taken = session.about.channels, 0
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
            raise WrongKind("frame", "bytes" if raw is not None else "text", "JSON" if text else "bytes, as declared in the first message")
        first, samples = samples_of_text(words, channels) if words is not None else samples_of(raw or b"", channels)
        ahead = first - session.counts.following
        if session.counts.following >= 0 and ahead > MOST_AHEAD * session.about.rate:
            raise InputError("first", first, f"an index at most an hour ahead of the last one, {session.counts.following}")
        hub.offer(session, first, samples)
        # frames that have come together are taken in parts, others' requests between them
        taken += 1
        if taken % TOGETHER == 0:
            await asyncio.sleep(0.0)
    await finish(hub, session)


async def finish(hub: Hub, session: Session) -> None:
    """End a session once the forces of all its samples have been computed, including those the observer is still designed from."""
    session.finishing = True
    session.arrived.set()
    if session.stage is not Stage.LIVE or session.counts.backlog:
        await session.drained.wait()
    if session.stage is Stage.ENDED:
        return
    hub.tell_status(session, "end")
    hub.close(session, End())


async def _prepare(components: Components, session: Session, opening: Opening) -> None:
    """Have the observer designed and start the stream; play the recording of a replay."""
    hub, loop = components.streams, asyncio.get_running_loop()
    limit, refused = loop.time() + SETTLING, None
    while session.stage is not Stage.LIVE:
        window = (0, None) if opening.source is not None else hub.window(session, opening.settle)
        if session.stage is Stage.ENDED:
            return
        if window is None and session.finishing:
            # too few samples for an observer, and no more will arrive
            session.drained.set()
            return
        if window is None:
            session.arrived.clear()
            try:
                async with asyncio.timeout_at(limit):
                    await session.arrived.wait()
            except TimeoutError:
                found = f"no {opening.settle} samples without a gap within {SETTLING:g} s"
                raise refused or InputError("samples", found, "samples without gaps, until the observer is made") from None
            continue
        session.stage = Stage.DESIGNING
        try:
            plan, ready = await _retried(functools.partial(opening.design, components.work, *window))
        except InputError as error:
            if opening.source is not None or not isinstance(error, Unsteady) or loop.time() > limit:
                raise refused or error from None
            # the spindle may have been accelerating, or the tool entering: the next second may be steady
            refused, detail = error, problems.of_input(error)
            for listener in session.listeners:
                listener.tell("settling", detail=detail.detail, errors=detail.errors)
            session.stage = Stage.SETTLING if session.stage is Stage.DESIGNING else session.stage
            components.metrics.missed(0, session.skip(window[0] + opening.settle))
            await asyncio.sleep(PAUSE)
            continue
        hub.begin(session, plan, window[0], {"session": session.about.id, **ready})
    if opening.source is not None:
        await opening.feed(hub, session)
        await finish(hub, session)


async def _retried(call: Callable[[], Awaitable[Any]], seconds: float = 30.0) -> Any:
    """Return the answer of a call, repeated while the queue is full."""
    loop = asyncio.get_running_loop()
    limit = loop.time() + seconds
    while True:
        try:
            return await call()
        except Busy:
            if loop.time() > limit:
                raise
            await asyncio.sleep(0.5)


def end_of(error: Exception) -> End:
    """Return the end of a stream that an error causes."""
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
    if isinstance(error, Damaged):
        return End(1011, 500, str(error))
    if isinstance(error, Full):
        return End(1013, 503, str(error))
    if isinstance(error, Busy | Unavailable):
        return End(1013, 503, "too many queries are waiting for an answer, or the database does not answer")
    return UNEXPECTED
