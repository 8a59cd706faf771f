"""Force streams against the service as its command starts it: a minute at its pace beside an identification, an hour as fast as it goes.

The signals are those of the virtual machine in the cut of [inprocess] (`turning`), 51.2 kHz, gap and fixture's acceleration of two axes:
half a second more than the first second in air, then the cut, under a spindle whose speed wanders. The service knows the machine as it was
identified from the sample runs. The client is this process, on the same cores.
"""

from __future__ import annotations

import argparse
import functools
import os
import tempfile
import threading
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from api.client import Client
from api.stream_client import Event, Forces, ForceStream
from benchmarks.observer import DATA
from benchmarks.service import serving
from benchmarks.stream_crowd import crowd, hello, prepared
from benchmarks.timing import row
from tests.fixtures.service import processes
from tests.fixtures.turning_cut import TurningCut, turning_cut
from tests.fixtures.virtual_cut import relative_error

#: Samples of a frame: 20 ms.
FRAME = 1024
ENTRY, WANDER, SAG = 1.5, 3e-4, 1e-3


def run(seconds: float = 60.0, beside: bool = True) -> list[dict[str, Any]]:
    """Stream for so long at the pace of the samples; `beside`: while an identification runs."""
    turning = turning_cut()
    samples, true = (np.concatenate(parts) for parts in zip(*turning.blocks(seconds, ENTRY, 4096, WANDER, SAG), strict=True))
    frames = samples.astype(np.float32)
    with tempfile.TemporaryDirectory() as folder, serving(Path(folder)) as (port, service):
        url = f"http://127.0.0.1:{port}"
        with Client(url) as client:
            machine = prepared(client, result_text())
            jobs = begun(client, machine) if beside else []
            before = taken()
            found = paced(port, service, machine, turning, frames)
            found["taken"] = taken() - before
            states = [client.job(job).state for job in jobs]
            state = f"; identifications one after the other, now {', '.join(states)}" if jobs else ""
            if jobs and "running" not in states:
                raise RuntimeError("nothing ran beside the stream at its end")
            for job in (job for job, state in zip(jobs, states, strict=True) if state in ("queued", "running")):
                client.cancel(job)
    return told(found, frames.shape[0], true, turning.rate, state)


def result_text() -> str:
    """RESULT.json of the sample runs; RCSA_IDENT_OBSERVER_RESULT names one that is there."""
    given = os.environ.get("RCSA_IDENT_OBSERVER_RESULT")
    if given:
        return Path(given).read_text(encoding="utf-8")
    import subprocess
    import sys

    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "RESULT.json"
        subprocess.run(
            [sys.executable, "-m", "rcsa_ident.cli", "identify", str(DATA / "sample_runs"), "--out", str(path), "--json"],
            check=True, stdout=subprocess.DEVNULL, env=os.environ | {"OPENBLAS_NUM_THREADS": "1"},
        )  # fmt: skip
        return path.read_text(encoding="utf-8")


def begun(client: Client, machine: str) -> list[str]:
    """Upload the sample runs, have them identified again and again, and return the jobs once the first runs."""
    campaign = client.upload_folder(machine, DATA / "sample_runs").id
    jobs = [client.identify_campaign(campaign, seed=seed).id for seed in range(1, 13)]
    while client.job(jobs[0]).state == "queued":
        time.sleep(0.2)
    time.sleep(5.0)
    return jobs


def paced(port: int, service: int, machine: str, turning: TurningCut, frames: np.ndarray) -> dict[str, Any]:
    """Send each frame when its last sample would have been taken, and return forces, delays and counters."""
    sent, came = np.zeros(frames.shape[0]), np.zeros(frames.shape[0])
    force, statuses, end = np.full((frames.shape[0], 2), np.nan), list[dict[str, Any]](), dict[str, Any]()
    ready = [np.inf]
    with ForceStream(f"ws://127.0.0.1:{port}", hello(machine, turning.rate)) as stream:

        def listen() -> None:
            for message in stream.received():
                now = time.perf_counter()
                if isinstance(message, Forces):
                    part = slice(message.first, message.first + message.values.shape[0])
                    force[part], came[part] = message.values, now
                elif isinstance(message, Event) and message.name == "ready":
                    ready[0] = now
                elif isinstance(message, Event) and message.name == "status":
                    statuses.append(dict(message.content))
                elif isinstance(message, Event) and message.name == "end":
                    end.update(message.content)

        thread = threading.Thread(target=listen)
        thread.start()
        before, begin = processes(service), time.perf_counter()
        for first in range(0, frames.shape[0], FRAME):
            part = frames[first : first + FRAME]
            due = begin + (first + part.shape[0]) / turning.rate
            time.sleep(max(due - time.perf_counter(), 0.0))
            stream.send(part, first)
            sent[first : first + FRAME] = time.perf_counter()
        stream.end()
        thread.join()
        wall, after = time.perf_counter() - begin, processes(service)
    shares = {name: (after[name].seconds - before[name].seconds) / wall for name in after if name in before}
    return {"force": force, "delay": came - sent, "caught_up": sent > ready[0] + 1.0, "end": end, "shares": shares, "statuses": statuses,
            "ready": ready[0] - begin}  # fmt: skip


def told(found: dict[str, Any], count: int, true: np.ndarray, rate: float, beside: str) -> list[dict[str, Any]]:
    """Return what a stream at its pace has shown."""
    end, force = found["end"], found["force"]
    got = int(np.sum(np.isfinite(force[:, 0])))
    lost = (
        f"sent {count}, while the observer settled {end['settling']}, received {got}, lost {end['lost']}, dropped {end['dropped']}, "
        f"unread {end['unread']}"
    )
    delay = found["delay"][found["caught_up"]][FRAME - 1 :: FRAME] * 1e3
    seconds = [status["delay_max_ms"] for status in found["statuses"] if status["stage"] == "live"][3:]
    missing = float(count - end["settling"] - got)
    rows = [row(f"stream of {count / rate:.0f} s at its pace: samples that are missing", missing, None, "samples", lost + beside)]
    for name, value in (
        ("median", np.median(delay)),
        ("95 %", np.quantile(delay, 0.95)),
        ("99.9 %", np.quantile(delay, 0.999)),
        ("longest", delay.max()),
    ):
        rows.append(
            row(f"  from a frame's sending to its forces here, {name}", float(value), None, "ms", f"frames of {1e3 * FRAME / rate:.0f} ms")
        )
    rows.append(
        row(
            "  in the service alone, longest",
            float(max(seconds)),
            None,
            "ms",
            "from a frame's arrival to its forces, without the first 3 s",
        )
    )
    share = 100.0 * found["taken"] / (count / rate) / (os.cpu_count() or 1)
    rows.append(row("  of all cores, taken by the host of this virtual machine", share, None, "%", "while it does, nobody here is served"))
    rows.append(row("  from the first sample to an observer", found["ready"], None, "s", "1 s of it the samples that it is made from"))
    for name, share in found["shares"].items():
        rows.append(row(f"  share of a core, {name}", 100.0 * share, None, "%", ""))
    for begin, finish in ((2.0, 10.0), (count / rate - 8.0, count / rate)):
        part = slice(round(begin * rate), round(finish * rate))
        error = relative_error(force[part], true[part], rate)
        words = f"X {error[0]:.4f} Y {error[1]:.4f}; 300-4300 Hz, mean removed; live, of {np.std(true[part], axis=0).round(1)} N"
        rows.append(row(f"  rms error over rms force, {begin:.0f} to {finish:.0f} s", float(error.max()), None, "-", words))
    return rows


def taken() -> float:
    """Return the time that the host of a virtual machine has kept its cores for others [s]."""
    return int(Path("/proc/stat").read_text(encoding="utf-8").split(maxsplit=9)[8]) / os.sysconf("SC_CLK_TCK")


def hour(seconds: float) -> None:
    """Stream so many seconds as fast as they are answered, and print memory every ten minutes of the stream."""
    turning = turning_cut()
    samples = np.concatenate([part for part, _ in turning.blocks(21.5, ENTRY, 4096)]).astype(np.float32)
    # whole revolutions of the cut, again and again
    lead, again = samples[: round(1.5 * turning.rate)], samples[round(1.5 * turning.rate) :]
    total, mark = round(seconds * turning.rate), 0.0
    answered, end = [0], dict[str, Any]()
    with tempfile.TemporaryDirectory() as folder, serving(Path(folder)) as (port, service):
        with Client(f"http://127.0.0.1:{port}") as client:
            machine = prepared(client, result_text())
        print(f"before: {memory(service)}", flush=True)
        with ForceStream(f"ws://127.0.0.1:{port}", hello(machine, turning.rate)) as stream:
            moved = threading.Condition()

            def listen() -> None:
                for message in stream.received():
                    with moved:
                        if isinstance(message, Forces):
                            answered[0] = message.first + message.values.shape[0]
                        elif isinstance(message, Event) and message.name == "end":
                            end.update(message.content)
                        moved.notify()

            def near(sent: int) -> bool:
                return sent - answered[0] < 2.0 * turning.rate

            thread = threading.Thread(target=listen)
            thread.start()
            first, begin = 0, time.perf_counter()
            while first < total:
                place = first if first < lead.shape[0] else (first - lead.shape[0]) % again.shape[0]
                source = lead if first < lead.shape[0] else again
                part = source[place : place + 4096][: total - first]
                stream.send(part, first)
                first += part.shape[0]
                with moved:
                    moved.wait_for(functools.partial(near, first), 120.0)
                if first >= mark * turning.rate:
                    print(f"{mark / 60.0:5.0f} min: {memory(service)}", flush=True)
                    mark += 600.0
            stream.end()
            thread.join()
        wall = time.perf_counter() - begin
        print(f"end: {memory(service)}")
        print(
            f"{seconds:.0f} s of stream in {wall:.0f} s; samples {end['samples']} of {total}, lost {end['lost']}, dropped {end['dropped']}"
        )


def memory(service: int) -> str:
    """Say how much memory the service takes."""
    return ", ".join(f"{name} {spent.megabytes:.1f} MB" for name, spent in sorted(processes(service).items()))


def main(arguments: Sequence[str]) -> None:
    """Run the stream at its pace, or the long one."""
    parser = argparse.ArgumentParser(prog="benchmarks streaming", description=__doc__)
    parser.add_argument("--seconds", type=float, default=60.0)
    parser.add_argument("--alone", action="store_true", help="without an identification beside it")
    parser.add_argument("--long", type=float, metavar="SECONDS", help="so many seconds of stream as fast as it goes, with memory")
    parser.add_argument("--crowd", type=int, metavar="STREAMS", help="so many streams at once, and what others wait for meanwhile")
    parser.add_argument("--frames", type=float, default=50.0, help="of a stream of the crowd per second")
    parser.add_argument("--samples", type=int, default=FRAME, help="of a frame of the crowd")
    parser.add_argument("--lonely", action="store_true", help="the crowd leaves every second frame out")
    given = parser.parse_args(arguments)
    if given.long is not None:
        hour(given.long)
        return
    crowded = given.crowd is not None
    for each in crowd(given.crowd, given.frames, given.samples, given.lonely) if crowded else run(given.seconds, not given.alone):
        peer = "" if each["peer"] is None else f"(without {each['peer']:.4g})"
        print(f"{each['claim']:<72} {each['ours']:<8.4g} {each['unit']:<8} {peer} {each['accuracy']}", flush=True)
