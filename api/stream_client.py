"""Client of a force stream for data loggers: sends samples, receives forces and events, from one thread or two.

Needs nothing but this package's own base.

Examples
--------
::

    from api.stream_client import ForceStream, Forces

    hello = {"machine": "m1", "tooling": "T1", "spindle_speed_rpm": 12000, "sampling_rate_hz": 51200,
             "channels": ["flange_x", "flange_y"], "begins": "air"}
    with ForceStream("ws://127.0.0.1:8000", hello, key="ri_...") as stream:
        for block in logger:                     # arrays, shape (n, 2), signals as the sensors give them
            stream.send(block)
            for message in stream.received(0.0):
                if isinstance(message, Forces):
                    print(message.first, message.values[-1])
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from contextlib import ExitStack
from dataclasses import dataclass
from typing import Any

import numpy as np
from websockets.exceptions import ConnectionClosed, InvalidStatus
from websockets.sync.client import connect

from api.streams.frames import packed, unpacked
from rcsa_ident.base.arrays import FloatArray


@dataclass(frozen=True, slots=True, eq=False)
class Forces:
    """Forces of some samples.

    Parameters
    ----------
    first : int
        Index of the first sample.
    values : array, shape (n, a) [N]
        With an envelope (n, a, 2): lowest and highest of each bucket.
    """

    first: int
    values: FloatArray


@dataclass(frozen=True, slots=True)
class Event:
    """An event of the stream: opened, settling, ready, status, restarted or end.

    Parameters
    ----------
    name : str
    content : mapping
    """

    name: str
    content: Mapping[str, Any]


class StreamRefused(Exception):
    """The service has ended the stream.

    Parameters
    ----------
    code : int
        Close code of the WebSocket, or the HTTP status where it was not opened.
    problem : mapping
        Problem document; empty where there is none.
    """

    def __init__(self, code: int, problem: Mapping[str, Any]) -> None:
        super().__init__(f"{code}: {problem.get('detail', 'no problem document')}")
        self.code, self.problem = code, dict(problem)


class ForceStream:
    """An open stream.

    Parameters
    ----------
    url : str
        ``ws://host:port`` or ``wss://host``.
    hello : mapping
        The first message; `docs/streaming.md` tells its keys.
    key : str, optional
    """

    def __init__(self, url: str, hello: Mapping[str, Any], key: str | None = None) -> None:
        self.buckets, self.text = hello.get("envelope") is not None, hello.get("format") == "json"
        self.following, self._problem, self._opened = 0, dict[str, Any](), ExitStack()
        headers = {} if key is None else {"X-API-Key": key}
        try:
            # measured samples do not shrink
            opening = connect(f"{url}/v1/forces/stream", additional_headers=headers, compression=None, max_size=None)
            self.socket = self._opened.enter_context(opening)
        except InvalidStatus as error:
            raise StreamRefused(error.response.status_code, _object(error.response.body)) from None
        self.socket.send(json.dumps(dict(hello)))

    def __enter__(self) -> ForceStream:
        return self

    def __exit__(self, *_: object) -> None:
        self._opened.close()

    def send(self, samples: FloatArray, first: int | None = None) -> None:
        """Send samples, shape (n, c), by default directly after the previous ones.

        Raises
        ------
        StreamRefused
            The service has ended the stream.
        """
        first = self.following if first is None else first
        values = np.asarray(samples, dtype=float)
        self._send(json.dumps({"first": first, "samples": values.tolist()}) if self.text else packed(first, values))
        self.following = first + values.shape[0]

    def end(self) -> None:
        """End the stream after the forces of all samples sent so far."""
        self._send('{"event": "end"}')

    def received(self, timeout: float | None = None) -> Iterator[Forces | Event]:
        """Yield forces and events until the stream ends or nothing arrives for so long [s]; 0 for those that have arrived already.

        Raises
        ------
        StreamRefused
            The service has ended the stream with a problem.
        """
        while True:
            try:
                raw = self.socket.recv(timeout)
            except TimeoutError:
                return
            except ConnectionClosed as closed:
                self._ended(closed)
                return
            if isinstance(raw, bytes):
                yield Forces(*unpacked(raw, self.buckets))
                continue
            data = json.loads(raw)
            if "event" not in data:
                yield Forces(data["first"], np.array(data["samples"], dtype=float))
            elif data["event"] == "problem":
                self._problem = data["problem"]
            else:
                yield Event(data.pop("event"), data)

    def _send(self, message: str | bytes) -> None:
        try:
            self.socket.send(message)
        except ConnectionClosed:
            # a problem document before the close has the reason
            for _ in self.received(1.0):
                pass
            raise StreamRefused(1000, {"detail": "the stream has ended"}) from None

    def _ended(self, closed: ConnectionClosed) -> None:
        code = 1006 if closed.rcvd is None else closed.rcvd.code
        reason = "" if closed.rcvd is None else closed.rcvd.reason
        if code != 1000:
            raise StreamRefused(code, self._problem or {"detail": reason or "the connection has broken"}) from None


def _object(raw: bytes | bytearray | None) -> dict[str, Any]:
    try:
        found = json.loads(raw or b"{}")
    except ValueError:
        return {}
    return found if isinstance(found, dict) else {}
