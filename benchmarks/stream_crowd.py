"""Many force streams at once, and what others wait for an answer beside them: ``python -m benchmarks streaming --crowd 100``.

The senders are a process of their own on the same cores: sockets that never block, frames that are made before. A frame whose forerunner
is not yet taken is left out and counted, as a logger would lose it. ``--lonely`` sends one sample a frame and leaves every second out:
no observer can be made of them.
"""

from __future__ import annotations

import json
import multiprocessing
import socket
import struct
import tempfile
import time
from collections import Counter
from contextlib import suppress
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

import numpy as np

from api.client import Client
from benchmarks.observer import DATA
from benchmarks.service import ask, serving
from benchmarks.timing import row
from tests.fixtures.force_stream import result
from tests.fixtures.service import processes
from tests.fixtures.turning_cut import turning_cut

#: Seconds of a load, seconds of samples that are sent again and again, and the pause between two questions of the others [s].
SECONDS, SAMPLES, PAUSE = 20.0, 3.0, 0.01


def prepared(client: Client, result: str) -> str:
    """Write machine and tooling, and return the machine's id."""
    machine = client.make_machine("HPM sample machine").id
    client.identify(machine, result)
    text = (DATA / "machines" / "toolings" / "S2-PG25.toml").read_text(encoding="utf-8")
    client.write_tooling("T1", text.replace("teeth = 4", "teeth = 2"))
    return machine


def hello(machine: str, rate: float, **further: Any) -> dict[str, Any]:
    """Return the first message; signals are in SI."""
    sensors = {
        f"{place}_{axis}": {"quantity": quantity, "axis": axis.upper()}
        for place, quantity in (("gap", "displacement"), ("fix", "acceleration"))
        for axis in "xy"
    }
    return {
        "machine": machine, "tooling": "T1", "spindle_speed_rpm": 12000, "sampling_rate_hz": rate, "channels": list(sensors),
        "sensors": sensors, "begins": "air",
    } | further  # fmt: skip


def crowd(streams: int, per_second: float, samples: int, lonely: bool) -> list[dict[str, Any]]:
    """Open streams and send each so many frames per second; return what a request of somebody else takes meanwhile.

    `per_second` [1/s]: frames of a stream
    `samples`: of a frame
    `lonely`: whether every second frame is left out, so that no observer begins
    """
    limits = {"RCSA_IDENT_STREAMS": str(streams), "RCSA_IDENT_STREAMS_PER_GROUP": str(streams)}
    with tempfile.TemporaryDirectory() as folder, serving(Path(folder), **limits) as (port, service):
        with Client(f"http://127.0.0.1:{port}") as client:
            machine = prepared(client, result())
        ours, theirs = multiprocessing.get_context("spawn").Pipe()
        opening = json.dumps(hello(machine, turning_cut().rate, settle_s=0.2))
        sender = multiprocessing.get_context("spawn").Process(
            target=send, args=(theirs, port, opening, streams, per_second, samples, lonely), daemon=True
        )
        alone = waited(port, SECONDS / 4.0)
        sender.start()
        # whose end, if it comes early, is then an error here
        theirs.close()
        ours.recv()
        before, begin = processes(service), time.perf_counter()
        beside = waited(port, SECONDS)
        wall, after = time.perf_counter() - begin, processes(service)
        ours.send("end")
        counts: Counter[str] = ours.recv()
        sender.join()
    words = f"{counts['sent']} frames sent, {counts['left out']} left out, {counts['forces'] / 1e6:.0f} MB of forces"
    claim = f"{streams} streams of {per_second:g} frames per second: reads beside them, p99"
    rows = [row(claim, *quantiles(beside, alone, 0.99), words)]
    rows += [row(f"  {name}", *quantiles(beside, alone, part), "") for name, part in (("median", 0.5), ("longest", 1.0))]
    shares = {name: (after[name].seconds - before[name].seconds) / wall for name in after}
    rows += [row(f"  share of a core, {name}", 100.0 * share, None, "%", "") for name, share in shares.items()]
    return rows


def quantiles(beside: list[float], alone: list[float], part: float) -> tuple[float, float, str]:
    """Return a quantile of both, and their unit."""
    return float(np.quantile(beside, part)) * 1e3, float(np.quantile(alone, part)) * 1e3, "ms"


def waited(port: int, seconds: float) -> list[float]:
    """Ask for a list of machines again and again, and return what each answer took [s]."""
    found, end = [], time.perf_counter() + seconds
    while time.perf_counter() < end:
        begin = time.perf_counter()
        ask(port, "GET", "/v1/machines", None)
        found.append(time.perf_counter() - begin)
        time.sleep(PAUSE)
    return found


class Sender:
    """The client of one stream. `opening`: its first message."""

    def __init__(self, port: int, opening: str) -> None:
        self.link = socket.create_connection(("127.0.0.1", port))
        self.rest, self.pongs, self.first, self.ticks, self.ready = memoryview(b""), b"", 0, 0, False
        self.link.sendall(
            b"GET /v1/forces/stream HTTP/1.1\r\nHost: 127.0.0.1\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
            b"Sec-WebSocket-Version: 13\r\nSec-WebSocket-Key: AAAAAAAAAAAAAAAAAAAAAA==\r\n\r\n"
        )
        answer = self.link.recv(4096)
        if b" 101 " not in answer:
            raise RuntimeError(answer.decode(errors="replace"))
        self.link.sendall(framed(1, opening.encode()))
        self.link.setblocking(False)

    def send(self, values: np.ndarray, skipped: int) -> bool:
        """Send a frame and leave so many samples out behind it; return whether it went."""
        self.flush()
        gone = not self.rest
        if gone:
            head = struct.pack("<QII", self.first, *values.shape)
            self.rest, self.pongs = memoryview(self.pongs + framed(2, head + values.tobytes())), b""
            self.flush()
        self.first += values.shape[0] + skipped
        return gone

    def flush(self) -> None:
        """Send what is left of a frame."""
        with suppress(BlockingIOError):
            while self.rest:
                self.rest = self.rest[self.link.send(self.rest) :]

    def read(self) -> int:
        """Take what has come, and return its bytes; the end of a stream is an error."""
        got = b""
        with suppress(BlockingIOError):
            got = self.link.recv(1 << 20)
            problem = got.find(b'"event": "problem"')
            if problem >= 0 or not got:
                raise RuntimeError(got[problem:].decode(errors="replace") or "the stream has ended")
        self.ready = self.ready or b'"event": "ready"' in got
        # pings of four bytes; what only looks like one in a force has an answer that the service ignores
        self.pongs += b"".join(framed(10, each[:4]) for each in got.split(b"\x89\x04")[1:] if len(each) >= 4)
        return len(got)


def framed(kind: int, content: bytes) -> bytes:
    """Return a message of a client, under a mask of zeros."""
    size = len(content)
    short = struct.pack("!BB", 0x80 | kind, 0x80 | size) if size < 126 else struct.pack("!BBH", 0x80 | kind, 0xFE, size)
    return short + bytes(4) + content


def send(parent: Connection, port: int, opening: str, streams: int, per_second: float, samples: int, lonely: bool) -> None:
    """In a process: open the streams, send at their pace, say when every observer has begun, and count until the parent says so."""
    turning = turning_cut()
    made = np.concatenate([part for part, _ in turning.blocks(SAMPLES, 1.5, 4096)]).astype(np.float32)
    parts = [np.ascontiguousarray(made[at : at + samples]) for at in range(0, made.shape[0] - samples, samples)]
    crowd: list[Sender] = []
    counts, begin, told, tick = Counter[str](), time.perf_counter(), False, 0
    while not parent.poll():
        # few wait for an observer at once, as loggers are not all switched on in one moment
        if len(crowd) < streams and (lonely or sum(not each.ready for each in crowd) < 3):
            crowd.append(Sender(port, opening))
        for k, each in enumerate(crowd):
            due = begin + (tick + k / streams) / per_second
            time.sleep(max(due - time.perf_counter(), 0.0))
            # each hears the record from its beginning, which is air: an observer settles on nothing else
            counts["sent" if each.send(parts[each.ticks % len(parts)], samples if lonely else 0) else "left out"] += 1
            each.ticks += 1
            counts["forces"] += each.read()
        tick += 1
        if not told and len(crowd) == streams and (lonely or all(each.ready for each in crowd)):
            told = True
            counts.clear()
            parent.send("ready")
    parent.send(counts)
