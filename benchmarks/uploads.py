"""Uploads of the web service beside the disk's own speed, in one run, and the time from the last byte to the verdict.

``run()`` starts the service as its command does, on this disk, and uploads a large recording in both ways, an ordinary one, and the sample
campaign as a whole. The client runs on the same cores.
"""

from __future__ import annotations

import socket
import subprocess
import tempfile
import time
from http.client import HTTPConnection
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.service import ask, serving
from benchmarks.timing import row

SAMPLES = Path(__file__).resolve().parents[1] / "data" / "sample_runs"
#: Of the large recording [bytes], about, and how often it is uploaded.
SIZE, REPEATS = 65_000_000, 3
_BINARY = {"Content-Type": "application/octet-stream"}


def run() -> list[dict[str, Any]]:
    """Bytes per second of a large upload, seconds to a verdict, seconds for a campaign of 160 files."""
    rows = []
    with tempfile.TemporaryDirectory(dir=".") as text:
        folder = Path(text)
        large = recording(folder / "large.h5")
        size = large.stat().st_size
        disk = min(_disk(large, folder / "copy") for _ in range(REPEATS))
        with serving(folder / "data") as (port, _):
            machine = ask(port, "POST", "/v1/machines", {"name": "m"})["id"]
            path = f"/v1/campaigns/{campaign_of(port, machine)}/recordings/"
            # what reads is imported and compiled by the first
            _put(port, path + "c0.h5", large)
            verdict = min(_put(port, path + f"c{k + 1}.h5", large, k)[1] for k in range(REPEATS))
            # the same again is taken in, hashed and synced, but not read
            whole = min(sum(_put(port, path + "c1.h5", large, 0)) for _ in range(REPEATS))
            _post(port, path.rstrip("/"), large, "f0.h5", 9)
            form = min(sum(_post(port, path.rstrip("/"), large, "f0.h5", 9)) for _ in range(REPEATS))
            accuracy = "taken in, hashed and synced; peer: dd with a sync"
            for words, seconds in (("PUT", whole), ("multipart", form)):
                rows.append(row(f"upload of {size / 1e6:.0f} MB, {words}", size / 1e6 / seconds, size / 1e6 / disk, "MB/s", accuracy))
            words = f"from the last byte of {SIZE / 16 / 51200.0:.0f} s of four channels to the verdict"
            rows.append(row(words, verdict, None, "s", "synced, read, judged"))
            rows += _samples(port, machine)
    return rows


def _disk(source: Path, target: Path) -> float:
    """Seconds of dd with a sync at the end."""
    start = time.perf_counter()
    subprocess.run(["dd", f"if={source}", f"of={target}", "bs=1M", "conv=fsync"], check=True, capture_output=True)
    return time.perf_counter() - start


def recording(path: Path) -> Path:
    """Write four channels of a cut at 51.2 kHz, as long as `SIZE` asks for."""
    from rcsa_ident.io.recordings.hdf5 import write_hdf5

    rng = np.random.default_rng(1)
    count = SIZE // 16
    time_ = np.arange(count) / 51200.0
    tones = sum(np.cos(2.0 * np.pi * 533.3 * k * time_) / k for k in range(1, 6))
    channels = {name: (0.1 * tones + 1e-3 * rng.standard_normal(count)).astype(np.float32) for name in _sensors()}
    write_hdf5(path, 51200.0, channels)
    return path


def _sensors() -> dict[str, Any]:
    kinds = {"flange": ("displacement", 1.0e4), "fixture": ("acceleration", 1.0e-3)}
    return {
        f"{place}_{axis}": {"quantity": quantity, "axis": axis.upper(), "sensitivity": sensitivity}
        for place, (quantity, sensitivity) in kinds.items()
        for axis in "xy"
    }


def campaign_of(port: int, machine: str) -> str:
    """Make a campaign whose cuts are large recordings, c0.h5, f0.h5 and so on, and return its id."""
    from benchmarks.service import new_tooling

    conditions = {
        "tooling": "T1", "spindle_speed_rpm": 8000.0, "axial_depth_mm": 0.4, "feed_per_tooth_mm": 0.1,
        "entry_angle_deg": 90.0, "exit_angle_deg": 180.0, "feed_direction": "+X",
    }  # fmt: skip
    names = [f"{kind}{k}.h5" for kind in "cf" for k in range(REPEATS + 1)]
    keys = {
        "sensors": _sensors(), "workpiece": {"name": "EN AW-6082", "tangential_coefficient_mpa": 902.0, "radial_ratio": 0.26},
        "toolings": {"T1": new_tooling(1)}, "cuts": [{"id": name, **conditions, "cut": name} for name in names],
    }  # fmt: skip
    found: str = ask(port, "POST", f"/v1/machines/{machine}/campaigns", keys)["id"]
    return found


def _sent(port: int, method: str, path: str, headers: dict[str, str], parts: list[bytes]) -> tuple[float, float]:
    """Seconds until the last byte has left, and from there to the answer."""
    connection = HTTPConnection("127.0.0.1", port, timeout=120)
    connection.connect()
    assert connection.sock is not None
    # what waits in the kernel has not arrived
    connection.sock.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, 1 << 18)
    start = time.perf_counter()
    connection.putrequest(method, path)
    for name, value in {**headers, "Content-Length": str(sum(map(len, parts)))}.items():
        connection.putheader(name, value)
    connection.endheaders()
    for part in parts:
        connection.send(part)
    sent = time.perf_counter()
    answer = connection.getresponse()
    content = answer.read()
    end = time.perf_counter()
    connection.close()
    if answer.status not in (200, 201) or b'"status":4' in content:
        raise RuntimeError(f"{method} {path}: {answer.status} {content[:300]!r}")
    return sent - start, end - sent


def _varied(file: Path, seed: int) -> bytes:
    """The file with other samples at its end: the same content again would not be read."""
    raw = bytearray(file.read_bytes())
    raw[-4:] = np.float32(1e-3 * (seed + 1)).tobytes()
    return bytes(raw)


def _put(port: int, path: str, file: Path, seed: int = -2) -> tuple[float, float]:
    return _sent(port, "PUT", path, _BINARY, [_varied(file, seed)])


def _post(port: int, path: str, file: Path, name: str, seed: int) -> tuple[float, float]:
    begin = f'--x\r\nContent-Disposition: form-data; name="files"; filename="{name}"\r\n\r\n'.encode()
    parts = [begin, _varied(file, seed + 100), b"\r\n--x--\r\n"]
    return _sent(port, "POST", path, {"Content-Type": "multipart/form-data; boundary=x"}, parts)


def _samples(port: int, machine: str) -> list[dict[str, Any]]:
    """The sample campaign, file by file as its client does."""
    from api.client import Client

    with Client(f"http://127.0.0.1:{port}") as client:
        start, count, times = time.perf_counter(), 0, []

        def told(_: object) -> None:
            nonlocal count
            count += 1
            times.append(time.perf_counter())

        found = client.upload_folder(machine, SAMPLES, told)
        seconds = time.perf_counter() - start
        each = float(np.median(np.diff(times)))
    size = sum(path.stat().st_size for path in SAMPLES.rglob("*.h5"))
    accuracy = f"{found.usable} of {len(found.cuts)} cuts usable"
    return [
        row(f"the sample campaign, {count} files of {size / 1e6:.0f} MB", seconds, None, "s", accuracy),
        row("  one of its files, upload to verdict", each, None, "s", "median"),
    ]
