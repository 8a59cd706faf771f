"""A machine whose forces are known, its signals, and both sides of a stream for tests."""

from __future__ import annotations

import json
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from fastapi.testclient import TestClient
from starlette.testclient import WebSocketTestSession

from api.main import create_app
from api.settings import Settings
from api.streams.design import design
from api.streams.frames import packed
from benchmarks.observer import DATA
from rcsa_ident.io.results import plain, spindle_to_json
from tests.api.conftest import URL, Here, Near, embedded
from tests.observer.flange_machine import BAND, flange_machine
from tests.workflows.test_stream_forces import RATE, SECOND, streamed

STREAM = "ws://localhost/v1/forces/stream"
CHANNELS = ["gap_x", "gap_y", "fix_x", "fix_y"]
#: V/m, V/(m/s^2).
SENSITIVITY = np.array([1e4, 1e4, 1e-3, 1e-3])
SENSORS = {
    f"{place}_{axis}": {"quantity": quantity, "axis": axis.upper(), "sensitivity": sensitivity}
    for place, quantity, sensitivity in (("gap", "displacement", 1e4), ("fix", "acceleration", 1e-3))
    for axis in "xy"
}


@cache
def result() -> str:
    """RESULT.json of the sample machine as a tap test at its flange would give it."""
    axes = {axis.upper(): spindle_to_json(part.spindle.modes, part.joint) for axis, part in flange_machine().whole.items()}
    data = {
        "schema_version": 1, "status": "converged", "reasons": [], "seed": 1, "method": "default", "software": "by hand",
        "campaign": {"name": "by hand", "cuts_used": 80, "cuts_left_out": []}, "sensors": SENSORS,
        "workpiece": {"name": "EN AW-6082", "tangential_coefficient_mpa": 902.0, "radial_ratio": 0.26},
        "band_hz": [w / (2.0 * np.pi) for w in BAND], "axes": axes, "delays": {},
    }  # fmt: skip
    return json.dumps(plain(data))


@cache
def tooling() -> str:
    """The tooling of the cut, with two teeth."""
    text = (Path(DATA) / "machines" / "toolings" / "S2-PG25.toml").read_text(encoding="utf-8")
    return text.replace("teeth = 4", "teeth = 2")


def signals(begin: float, end: float, *, wander: float = 0.0, sag: float = 0.0) -> np.ndarray:
    """What the sensors give [V]: air until 1.5 s, then the cut."""
    samples = streamed(wander, sag)[0][round(begin * SECOND) : round(end * SECOND)]
    return (samples * SENSITIVITY).astype(np.float32).astype(float)


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


def hello(machine: str, **changed: Any) -> dict[str, Any]:
    """The first message of a data logger whose stream begins in the cut."""
    return {
        "machine": machine, "tooling": "T1", "spindle_speed_rpm": 12000, "sampling_rate_hz": RATE, "channels": CHANNELS, "settle_s": 0.2,
    } | changed  # fmt: skip


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
