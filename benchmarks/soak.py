"""A service at about half of what it can do, for an hour: what of it grows, and whether it ever fails.

``python -m benchmarks soak [--minutes 60]``

Clients ask for tips, lobes, cards and lists, upload by tus and delete, stream forces, have machines identified, and hang up in the middle.
Each rests for as long as it was served. Memory, descriptors and threads of the service's processes, the files of its folder and the rows of
its databases are noted every ten seconds. A line is fitted to each after the first ten minutes, in a short run after half of it: what
rises by less than it scatters about its line, or by less than a hundredth, is flat. The exit code is 1 where something else is not flat
than what is kept for ever, where an answer is 500 or above, and where the service has logged an error.
"""

from __future__ import annotations

import argparse
import itertools
import json
import os
import socket
import sqlite3
import struct
import sys
import tempfile
import threading
import time
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import closing
from functools import partial
from pathlib import Path

import httpx2
import numpy as np

from api.client import Client
from api.stream_client import ForceStream
from benchmarks.service import machine_text, memory, new_tooling, others, use
from benchmarks.streaming import FRAME, hello, prepared
from tests.api import identifying, recordings
from tests.api.test_tus import NAME, begun, sent
from tests.fixtures.force_stream import RATE, result, streamed
from tests.fixtures.service import Served, serving

#: Seconds between two notes, minutes before what is there at the beginning has come, and seconds of a stream.
EVERY, SETTLED, STREAM = 10.0, 10.0, 10.0
#: What is kept for ever by default: the trail of changes.
KEPT = ("rows of the trail", "MB of databases")
#: Works through what it does piece by piece, and yields between these.
Guest = Callable[[Client, Served], Iterator[None]]


def asking(client: Client, served: Served, *, first: int) -> Iterator[None]:
    """Ask for the tip, the lobes and the card of a tooling that nobody has asked for, write it, and look through the lists."""
    machine = client.make_machine(f"asked {first}").id
    client.identify(machine, machine_text())
    for seed in itertools.count(first):
        tooling = new_tooling(seed)
        client.tooltip(machine, tooling)
        yield
        client.lobes(machine, tooling, speeds={"step_rpm": 100})
        yield
        client.advice(machine, tooling, cut={"feed_per_tooth_mm": 0.1})
        client.write_tooling("T1" if seed % 2 else "T2", tooling)
        client.drawing("T1" if seed % 2 else "T2")
        yield
        lists = (client.machines(), client.toolings(), client.campaigns(machine), client.jobs(), itertools.islice(client.changes(), 50))
        for items in lists:
            list(items)
        client.modes(machine)
        client.usage()
        yield


def uploading(client: Client, served: Served) -> Iterator[None]:
    """Upload by tus in two parts and delete what has come of it, every third time before the second part."""
    id = client.make_campaign(client.make_machine("uploads").id, recordings.declared(1)).id
    raw = recordings.content(served.data.parent)
    for number in itertools.count():
        # the same content again would not be read
        raw = raw[:-4] + struct.pack("<f", 1e-3 * (number % 1000))
        half = len(raw) // 2
        where = begun(client.http, f"/v1/campaigns/{id}/uploads", len(raw))
        sent(client.http, where, raw[:half], 0).raise_for_status()
        if number % 3:
            sent(client.http, where, raw[half:], half).raise_for_status()
            client.signal(id, NAME)
        client.forget_recording(id, NAME)
        yield


def streaming(client: Client, served: Served) -> Iterator[None]:
    """Stream forces at the pace of the samples; every second stream breaks without a word."""
    machine = prepared(client, result())
    samples = streamed(seconds=STREAM)[0].astype(np.float32)
    for number in itertools.count():
        with ForceStream(f"ws://127.0.0.1:{served.port}", hello(machine, RATE, settle_s=0.2)) as stream:
            begin = time.monotonic()
            for first in range(0, samples.shape[0], FRAME):
                stream.send(samples[first : first + FRAME], first)
                for _ in stream.received(0.0):
                    pass
                time.sleep(max(begin + (first + FRAME) / RATE - time.monotonic(), 0.0))
            if number % 2:
                stream.socket.socket.shutdown(socket.SHUT_RDWR)
            else:
                stream.end()
                for _ in stream.received():
                    pass
        yield


def identifying_machines(client: Client, served: Served) -> Iterator[None]:
    """Have a machine identified, lose the events of the job, and delete all of it once it is done; every third job is cancelled."""
    for number in itertools.count():
        machine = client.make_machine("identified").id
        job = client.identify_campaign(identifying.uploaded(client, machine), seed=7).id
        next(client.events(job))
        if number % 3 == 2:
            client.cancel(job)
        state = client.wait(job).state
        assert state == ("cancelled" if number % 3 == 2 else "done"), state
        client.forget_machine(machine)
        yield


def hanging_up(client: Client, served: Served) -> Iterator[None]:
    """Leave in the middle of a header, of a body, and before the answer to a question that takes a while."""
    machine = client.make_machine("left alone").id
    client.identify(machine, machine_text())
    for seed in itertools.count(10**6):
        body = json.dumps({"machine": machine, "toolings": [new_tooling(seed)], "speeds": {"step_rpm": 25}})
        head = "POST /v1/lobes HTTP/1.1\r\nHost: 127.0.0.1\r\nContent-Type: application/json\r\n"
        whole = (head + f"Content-Length: {len(body)}\r\n\r\n{body}").encode()
        for part in (len(head) // 2, len(whole) - len(body) // 2, len(whole)):
            with socket.create_connection(("127.0.0.1", served.port)) as link:
                link.sendall(whole[:part])
                time.sleep(0.05)
            yield


def rested(guest: Guest, served: Served, end: float, statuses: Counter[int], failed: list[str]) -> None:
    """Be a client until the end: after each piece of work it rests for as long as that took."""
    try:
        with httpx2.Client(
            base_url=served.url, timeout=60.0, event_hooks={"response": [lambda a: statuses.update([a.status_code])]}
        ) as http:
            begin = time.monotonic()
            for _ in guest(Client(http=http), served):
                time.sleep(max(min(time.monotonic() - begin, end - time.monotonic()), 0.0))
                begin = time.monotonic()
                if begin >= end:
                    return
    except Exception as error:
        failed.append(f"{guest}: {error!r}")


def noted(served: Served) -> dict[str, float]:
    """Return what the service takes at this moment."""
    found: Counter[str] = Counter()
    for pid in {served.process.pid, *others(served.process.pid)}:
        folder, kind = Path(f"/proc/{pid}"), "service"
        try:
            if pid != served.process.pid:
                words = (folder / "cmdline").read_bytes()
                named = {b"api.confined": "queries and reader", b"spawn_main": "jobs"}
                kind = next((kind for word, kind in named.items() if word in words), "others")
                kind = "streams" if (folder / "comm").read_text(encoding="utf-8") == "rcsa-streams\n" else kind
            found[f"descriptors, {kind}"] += len(list((folder / "fd").iterdir()))
            found[f"threads, {kind}"] += len(list((folder / "task").iterdir()))
            found[f"MB, {kind}"] += memory(pid)
            found["processes"] += 1
        except OSError:
            # it has ended meanwhile
            continue
    for path in served.data.glob("*.db"):
        with closing(sqlite3.connect(f"{path.as_uri()}?mode=ro", uri=True)) as database:
            tables = [row[0] for row in database.execute("SELECT name FROM sqlite_master WHERE type = 'table'")]
            for table in tables:
                kind = "rows of the trail" if table == "changes" else f"rows of {path.name}"
                found[kind] += database.execute(f'SELECT count(*) FROM "{table}"').fetchone()[0]
        found["MB of databases"] += path.stat().st_size / 1e6
    files = [path for path in served.data.rglob("*") if ".db" not in path.name]
    return found | {"files in the folder": len(files)}


def slope(hours: np.ndarray, values: np.ndarray) -> tuple[float, bool]:
    """Return what a quantity rises by in an hour, and whether it is flat."""
    line = np.polyfit(hours, values, 1)
    rise = line[0] * (hours[-1] - hours[0])
    scatter = float(np.std(values - np.polyval(line, hours)))
    return float(line[0]), bool(rise <= max(scatter, 0.01 * float(np.mean(values)), 1e-9))


def main(arguments: list[str]) -> None:
    """Run the service under its clients, and tell what grew."""
    parser = argparse.ArgumentParser(prog="benchmarks soak", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--minutes", type=float, default=60.0)
    minutes = parser.parse_args(arguments).minutes
    # as many processes of each kind as the service has by default
    settings = {"WORKERS": str(os.cpu_count()), "JOB_WORKERS": "1", "LOBE_WORKERS": "1", "PATH_WORKERS": "1"}
    statuses, failed, notes, times = Counter[int](), list[str](), list[dict[str, float]](), list[float]()
    crowd: list[Guest] = [partial(asking, first=0), partial(asking, first=10**5), uploading, streaming, identifying_machines, hanging_up]
    with tempfile.TemporaryDirectory(prefix="rcsa-soak-") as text:
        with serving(Path(text) / "data", **{f"RCSA_IDENT_{name}": value for name, value in settings.items()}) as served:
            begin = time.monotonic()
            end = begin + 60.0 * minutes
            threads = [threading.Thread(target=rested, args=(each, served, end, statuses, failed), daemon=True) for each in crowd]
            for thread in threads:
                thread.start()
            for due in np.arange(begin, end, EVERY):
                time.sleep(max(due - time.monotonic(), 0.0))
                notes.append(noted(served))
                times.append(time.monotonic() - begin)
            for thread in threads:
                thread.join()
            share = use(served.process.pid)[0] / (time.monotonic() - begin)
        errors = [line for line in served.log.read_text(encoding="utf-8").splitlines() if '"level": "error"' in line]
    print(f"{minutes:g} minutes, {100.0 * share:.0f} % of a core; answers {dict(sorted(statuses.items()))}")
    for line in (*failed, *errors):
        print(line[:2000])
    later = np.array(times) >= 60.0 * min(SETTLED, 0.5 * minutes)
    hours, bad = np.array(times)[later] / 3600.0, bool(failed or errors) or any(status >= 500 for status in statuses)
    print(f"{'':<32} {'first':>9} {'then':>9} {'last':>9} {'an hour':>9}")
    for name in sorted(set().union(*notes)):
        values = np.array([each.get(name, 0.0) for each in notes])
        rise, flat = slope(hours, values[later])
        bad |= not flat and name not in KEPT
        told = "flat" if flat else "kept for ever" if name in KEPT else "GROWS"
        print(f"{name:<32} {values[0]:9.1f} {values[later][0]:9.1f} {values[-1]:9.1f} {rise:+9.2f}  {told}")
    sys.exit(1 if bad else 0)
