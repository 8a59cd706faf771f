"""A service in this process with a machine whose forces are known, and both sides of a stream."""

from __future__ import annotations

import json
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from fastapi.testclient import TestClient
from starlette.testclient import WebSocketTestSession

from api.main import create_app
from api.settings import Settings
from api.streams.design import design
from api.streams.frames import packed
from tests.api.in_process import URL, Here, Near, embedded
from tests.fixtures.force_stream import result, tooling

STREAM = "ws://localhost/v1/forces/stream"


class Remembering(Here):
    """Work in this process that makes no observer twice."""

    made: dict[Any, Any] = {}  # noqa: RUF012  (of all tests)

    async def run(self, call: Any, *arguments: Any) -> Any:
        if call is not design or arguments[-1] is not None:
            return await super().run(call, *arguments)
        if arguments not in self.made:
            self.made[arguments] = await super().run(call, *arguments)
        return self.made[arguments]


@contextmanager
def streaming(folder: Path, host: Any = None, **settings: Any) -> Iterator[tuple[TestClient, str]]:
    """A service with the machine and the tooling T1, and the machine's id."""
    store = embedded(folder)
    near = Near() if host is None else host
    app = create_app(Settings(data=folder, **settings), store, Remembering(), Here(), near)
    with TestClient(app, base_url=URL, raise_server_exceptions=False) as http:
        id = http.post("/v1/machines", json={"name": "m"}).json()["id"]
        written = http.put(f"/v1/machines/{id}/identification", content=result(), headers={"Content-Type": "application/json"})
        assert written.status_code == 201, written.text
        assert http.put("/v1/toolings/T1", content=tooling(), headers={"Content-Type": "application/toml"}).status_code == 201
        yield http, id


def send(socket: WebSocketTestSession, first: int, samples: np.ndarray, text: bool = False) -> None:
    """Send a frame."""
    if text:
        socket.send_text(json.dumps({"first": first, "samples": samples.tolist()}))
    else:
        socket.send_bytes(packed(first, samples))


def until(socket: WebSocketTestSession, *names: str) -> tuple[dict[str, Any], list[Any]]:
    """Return the first event of one of these names, and all frames before it, as they came."""
    frames: list[Any] = []
    while True:
        message = socket.receive()
        if message["type"] == "websocket.close":
            raise AssertionError(f"closed: {message}")
        if message.get("bytes") is not None:
            frames.append(message["bytes"])
            continue
        data = json.loads(message["text"])
        if data.get("event") in names:
            return data, frames
        if "event" not in data:
            frames.append(data)
        elif data["event"] == "problem":
            raise AssertionError(data)


def closed(socket: WebSocketTestSession) -> tuple[int, dict[str, Any]]:
    """Return code and problem document of a stream that the service ends."""
    problem: dict[str, Any] = {}
    while True:
        message = socket.receive()
        if message["type"] == "websocket.close":
            return message["code"], problem
        if message.get("text") is not None:
            data = json.loads(message["text"])
            if data.get("event") == "problem":
                problem = data["problem"]
