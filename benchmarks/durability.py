"""What kill -9 costs: a worker, the service, everything of it, or PostgreSQL, at random moments during uploads and identifications.

``python -m benchmarks durability [--moments 20] [--cuts 80 | --short] [--database sqlite|postgresql] [--target TARGET] [--seed 1]``

A client uploads a campaign and has its machine identified, again and again, and tries again whatever was not answered or answered 503.
Somebody else kills processes meanwhile, and starts the service or the database again where they were hit. At the end every upload that
was answered is compared with what was sent, every job that was accepted has to be done, and every result has to be that of a run that
nobody disturbed, byte for byte.
"""

from __future__ import annotations

import argparse
import hashlib
import os
import random
import signal
import socket
import subprocess
import sys
import tempfile
import threading
import time
import tomllib
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, TypeVar

import httpx2

from api.client import Client, ServiceError
from api.schemas.jobs import JobAnswer
from api.stores.sql import open_store
from benchmarks.service import others
from tests.api import identifying
from tests.fixtures.postgres import Server, new_database, server

ROOT = Path(__file__).resolve().parents[1]
SAMPLES = ROOT / "data" / "sample_runs"
TARGETS = ("worker", "service", "everything", "database")
#: For which a killed database stays away [s].
AWAY = 3.0
T = TypeVar("T")


@dataclass
class Service:
    """The service as its command starts it, on a port that stays."""

    data: Path
    log: Path
    database: Server | None = None
    port: int = 0
    process: subprocess.Popen[bytes] | None = None

    def __post_init__(self) -> None:
        self.url = new_database(self.database.url) if self.database else ""

    def start(self) -> None:
        """Start it, and return when it answers."""
        if not self.port:
            with socket.socket() as free:
                free.bind(("127.0.0.1", 0))
                self.port = int(free.getsockname()[1])
        settings = {"DATA": str(self.data), "PORT": str(self.port), "WORKERS": "1", "REQUESTS_PER_MINUTE": "1000000", "BURST": "1000000"}
        settings |= {"JOB_NICE": "0"} | ({"DATABASE": self.url} if self.url else {})
        environment = {f"RCSA_IDENT_{name}": value for name, value in settings.items()}
        words = [sys.executable, "-c", "from api.serve import main; main()"]
        with self.log.open("ab") as log:
            self.process = subprocess.Popen(words, env={**os.environ, "PYTHONPATH": str(ROOT), **environment}, stderr=log)
        while True:
            with suppress(httpx2.TransportError):
                if httpx2.get(f"{self.address}/health", timeout=10.0).status_code == 200:
                    return
            if self.process.poll() is not None:
                raise RuntimeError(f"the service does not start: {self.log}")
            time.sleep(0.1)

    @property
    def address(self) -> str:
        """Where it listens."""
        return f"http://127.0.0.1:{self.port}"

    def hit(self, target: str) -> None:
        """Kill some of its processes, without a farewell."""
        assert self.process is not None
        if target == "worker":
            store = open_store(self.url or f"sqlite:///{self.data / 'service.db'}")
            _kill([int(row.process.split(":")[0]) for row in store.jobs.workers()])
            store.close()
            return
        if target == "database":
            assert self.database is not None
            self.database.kill()
            time.sleep(AWAY)
            self.database.start()
            return
        _kill([self.process.pid, *(others(self.process.pid) if target == "everything" else [])])
        self.process.wait()
        self.start()

    def stop(self) -> None:
        """End it."""
        assert self.process is not None
        _kill([self.process.pid, *others(self.process.pid)])
        self.process.wait()


def _kill(pids: list[int]) -> None:
    for pid in pids:
        with suppress(ProcessLookupError):
            os.kill(pid, signal.SIGKILL)


@dataclass
class Shop:
    """A client that does not give up, and what it was promised."""

    service: Service
    keys: dict[str, Any]
    uploads: dict[tuple[str, str], str] = field(default_factory=dict)
    jobs: list[str] = field(default_factory=list)
    again: Counter[str] = field(default_factory=Counter)
    phase: str = "upload"
    enough: threading.Event = field(default_factory=threading.Event)
    seconds: dict[str, float] = field(default_factory=dict)

    def insist(self, what: str, call: Callable[[Client], T]) -> T:
        """Ask until there is an answer; what the service refuses for good is raised."""
        while True:
            try:
                with Client(self.service.address) as client:
                    return call(client)
            except httpx2.TransportError:
                self.again[what] += 1
            except ServiceError as error:
                # another content than before is none of ours: what was cut off comes again
                if error.status not in (408, 429, 503):
                    raise
                self.again[what] += 1
            time.sleep(0.3)

    def round(self, number: int) -> None:
        """Upload a campaign, and again until it is enough; then have the machine identified from the last one, and wait for the end."""
        self.phase, start = "upload", time.monotonic()
        machine = self.insist("machine", lambda c: c.make_machine(f"M{number}", repeat=f"machine-{number}")).id
        passes = 0
        while passes == 0 or not self.enough.is_set():
            name = f"campaign-{number}-{passes}"
            campaign = self.insist("campaign", lambda c, name=name: c.make_campaign(machine, self.keys, repeat=name)).id
            passes += 1
            for cut in self.keys["cuts"]:
                for kind in ("air", "cut"):
                    file = SAMPLES / cut[kind]
                    answer = self.insist("upload", lambda c, campaign=campaign, file=file: c.upload(campaign, file))
                    self.uploads[campaign, answer.name] = hashlib.sha256(file.read_bytes()).hexdigest()
        self.seconds["upload"], self.phase, start = time.monotonic() - start, "identification", time.monotonic()
        job = self.insist("job", lambda c: c.identify_campaign(campaign, repeat=f"job-{number}")).id
        self.jobs.append(job)
        while self.state(job).finished is None:
            pass
        self.seconds["identification"] = time.monotonic() - start

    def state(self, job: str) -> JobAnswer:
        """Return a job, after some seconds where it has not ended."""
        return self.insist("look", lambda c: c.job(job, wait=3))

    def lost(self) -> int:
        """Count uploads that were answered and are not what was sent."""
        count = 0
        with tempfile.TemporaryDirectory() as folder:
            copy = Path(folder) / "copy"
            for (campaign, name), digest in self.uploads.items():
                try:
                    self.insist("check", lambda c, campaign=campaign, name=name: c.recording_file(campaign, name, copy))
                    count += hashlib.sha256(copy.read_bytes()).hexdigest() != digest
                except ServiceError:
                    count += 1
        return count


def declared(cuts: int) -> dict[str, Any]:
    """Return the keys of the sample campaign with its first cuts of each tooling."""
    data = tomllib.loads((SAMPLES / "campaign.toml").read_text(encoding="utf-8"))
    each = max(cuts // len(data["toolings"]), 1)
    chosen = [cut for name in data["toolings"] for cut in [c for c in data["cuts"] if c["tooling"] == name][:each]]
    toolings = {name: tomllib.loads((SAMPLES / path).read_text(encoding="utf-8")) for name, path in data["toolings"].items()}
    return data | {"cuts": chosen, "toolings": toolings}


def study(database: Server | None, moments: int, keys: dict[str, Any], seed: int, targets: Sequence[str]) -> dict[str, Any]:
    """Return what so many kills have cost, on a database or, without one, on the embedded store."""
    rng = random.Random(seed)
    with tempfile.TemporaryDirectory(prefix="rcsa-durability-") as folder:
        service = Service(Path(folder) / "data", Path(folder) / "log", database)
        service.start()
        try:
            calm = Shop(service, keys)
            start = time.monotonic()
            calm.enough.set()
            calm.round(0)
            (first,) = calm.jobs
            expected = calm.insist("result", lambda c: c.result(first))
            shop = Shop(service, keys)
            over, failure = threading.Event(), []

            def work() -> None:
                try:
                    number = 1
                    while not over.is_set():
                        shop.round(number)
                        number += 1
                except Exception as error:
                    failure.append(error)

            thread = threading.Thread(target=work)
            thread.start()
            hits: Counter[str] = Counter()
            while sum(hits.values()) < moments and thread.is_alive():
                # moments lie apart so that what is at work comes a little further in the mean
                time.sleep(rng.uniform(0.02, 0.5) * calm.seconds[shop.phase])
                # during an upload no worker is at work
                target = rng.choice([each for each in targets if each != "worker" or shop.phase != "upload"] or targets)
                hits[f"{target}, {shop.phase}"] += 1
                service.hit(target)
                if 2 * sum(hits.values()) >= moments:
                    # the other half meets identifications
                    shop.enough.set()
            over.set()
            thread.join()
            if failure:
                raise failure[0]
            states = Counter(shop.state(job).state for job in shop.jobs)
            same = sum(shop.insist("result", lambda c, job=job: c.result(job)) == expected for job in shop.jobs)
            return {
                "database": "PostgreSQL" if database else "SQLite",
                "kills": dict(sorted(hits.items())),
                "uploads answered": len(shop.uploads),
                "uploads lost": shop.lost(),
                "jobs accepted": len(shop.jobs),
                "jobs lost": len(shop.jobs) - states["done"],
                "results equal to the undisturbed run": same,
                "asked again": dict(shop.again),
                "seconds without kills": {phase: round(seconds, 1) for phase, seconds in calm.seconds.items()},
                "seconds": round(time.monotonic() - start, 1),
            }
        finally:
            service.stop()


@contextmanager
def _database(kind: str) -> Iterator[Server | None]:
    if kind == "sqlite":
        yield None
        return
    with server(safe=True) as running:
        yield running


def main(arguments: list[str]) -> None:
    """Run the study and print its counts."""
    parser = argparse.ArgumentParser(
        prog="benchmarks durability", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--moments", type=int, default=20)
    parser.add_argument("--cuts", type=int, default=80)
    parser.add_argument("--short", action="store_true", help="a campaign of four cuts along one axis, which is soon identified")
    parser.add_argument("--database", choices=("sqlite", "postgresql"), action="append")
    parser.add_argument("--target", choices=TARGETS, action="append", help="what is killed, by default each; a file has no server to kill")
    parser.add_argument("--seed", type=int, default=1)
    given = parser.parse_args(arguments)
    keys, bad = identifying.declared() if given.short else declared(given.cuts), False
    for kind in given.database or ("sqlite", "postgresql"):
        with _database(kind) as database:
            targets = [each for each in given.target or TARGETS if each != "database" or database]
            found = study(database, given.moments, keys, given.seed, targets)
        for name, value in found.items():
            print(f"{name:<38} {value}", flush=True)
        bad |= bool(found["uploads lost"] or found["jobs lost"]) or found["results equal to the undisturbed run"] != found["jobs accepted"]
    sys.exit(1 if bad else 0)
