"""The web service under load on loopback: zero-order lobes of a new tooling each, and reads beside them.

``run()`` starts the service as its command does, writes the identification of a machine into it, and asks from several clients at once,
each over a connection of its own. The clients run on the same cores. Time by the clock depends on what else runs on these; beside it
stands the time of a core that the service takes for an answer, and what its processes keep in memory.
"""

from __future__ import annotations

import copy
import json
import os
import random
import socket
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from http.client import HTTPConnection
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.timing import row

#: Seconds of each load, and clients at once.
SECONDS, CLIENTS = 10.0, 2


def run(result: Path | None = None) -> list[dict[str, Any]]:
    """Lobes with bands and without, as a machine at the presetting station asks, and reads.

    `result`: RESULT.json; by default a machine of seven modes an axis with a full posterior
    """
    text = machine_text() if result is None else result.read_text(encoding="utf-8")
    rows = []
    with tempfile.TemporaryDirectory() as folder, serving(Path(folder)) as (port, process):
        rows.append(row("memory of the service's processes, idle", use(process)[1], None, "MB", "shared pages count once each"))
        machine = ask(port, "POST", "/v1/machines", {"name": "m"})["id"]
        ask(port, "PUT", f"/v1/machines/{machine}/identification", text)
        for words, further in (
            ("321 speeds with bands", {}),
            ("161 speeds with bands", {"speeds": {"step_rpm": 100}}),
            ("321 speeds without bands", {"bands": False}),
            ("321 speeds with bands, five toolings in one query", {"several": 5}),
            ("321 speeds with bands, and recommended cuts", {"recommend": True}),
        ):
            asked = {"several": 1, "recommend": False} | further
            count = asked.pop("several")

            def lobes(seed: int, count: int = count, asked: dict[str, Any] = asked) -> tuple[str, str, Any]:
                toolings = [new_tooling(1000 * k + seed) for k in range(count)]
                return "POST", "/v1/lobes", {"machine": machine, "toolings": toolings, **asked}

            # each worker meets the machine once
            load(port, lobes, 2.0)
            rows += measured(process, f"zero-order lobes of a new tooling, {words}", lambda lobes=lobes: load(port, lobes, SECONDS))
        rows += measured(process, "reads of a machine", lambda: load(port, lambda _: ("GET", f"/v1/machines/{machine}", None), SECONDS))
        rows.append(row("memory of the service's processes after all that", use(process)[1], None, "MB", ""))
    return rows


def measured(process: int, words: str, loaded: Callable[[], tuple[int, float, float, float]]) -> list[dict[str, Any]]:
    """Return the rows of one load: answers per second, their times, and what the service worked for each."""
    before = use(process)[0]
    count, rate, middle, p95 = loaded()
    work = (use(process)[0] - before) / count
    return [
        row(words, rate, None, "1/s", "answers of the commands"),
        row(f"  half of them within, {CLIENTS} clients", middle * 1e3, None, "ms", ""),
        row("  19 of 20 within", p95 * 1e3, None, "ms", ""),
        row("  of a core for an answer, without the clients", work * 1e3, None, "ms", ""),
    ]


def use(process: int) -> tuple[float, float]:
    """Return the seconds of a core that a process and its descendants have taken, and their memory [MB]; zeros where nobody tells."""
    mine = {process} | others(process)
    ticks = sum(int(field) for id in mine for field in (_stat(id) or ["0"] * 13)[11:13])
    return ticks / os.sysconf("SC_CLK_TCK"), sum(memory(id) for id in mine)


def others(process: int) -> set[int]:
    """Return the processes that a process has started, and theirs."""
    parents = {}
    for folder in Path("/proc").glob("[0-9]*"):
        fields = _stat(int(folder.name))
        if fields:
            parents[int(folder.name)] = int(fields[1])
    mine = {process}
    while more := {id for id, parent in parents.items() if parent in mine} - mine:
        mine |= more
    return mine - {process}


def _stat(process: int) -> list[str]:
    """Fields behind the name, none where there is no such process."""
    try:
        return Path(f"/proc/{process}/stat").read_text(encoding="utf-8", errors="replace").rpartition(")")[2].split()
    except OSError:
        return []


def memory(process: int) -> float:
    """What a process has in memory; of pages that several share, its part [MB]."""
    try:
        lines = Path(f"/proc/{process}/smaps_rollup").read_text(encoding="utf-8").splitlines()
    except OSError:
        return 0.0
    return sum(int(line.split()[1]) for line in lines if line.startswith("Pss:")) / 1e3


def new_tooling(seed: int) -> dict[str, Any]:
    """Return a tooling that nobody has asked for: stickout, fluted part and collet of their own."""
    rng = random.Random(seed)
    stickout, fluted = rng.uniform(50.0, 90.0), rng.uniform(20.0, 35.0)
    tool = [(fluted, rng.uniform(9.2, 10.0), "carbide"), (stickout + 40.0 - fluted, 12.0, "carbide")]
    holder = [(rng.uniform(40.0, 50.0), rng.uniform(32.0, 50.0)), (30.0, 63.0)]
    return {
        "cutter": {"teeth": 4, "diameter_mm": 12.0},
        "tool": {"stickout_mm": stickout, "segments": [_segment(*s) for s in tool]},
        "holder": {"insertion_mm": 40.0, "segments": [_segment(*s, "steel") | {"inner_diameter_mm": 12.0} for s in holder]},
        "contact": {
            "translational_stiffness": 2e10, "rotational_stiffness": 6e5, "translational_damping": 6e4, "rotational_damping": 9.0,
        },
    }  # fmt: skip


def _segment(length: float, diameter: float, material: str) -> dict[str, Any]:
    return {"length_mm": length, "outer_diameter_mm": diameter, "material": material}


def machine_text() -> str:
    """Return RESULT.json of two axes, seven modes each, with the posterior of 56 unknowns and a rival that an identification has."""
    from rcsa_ident.dynamics.coordinates import Dof
    from rcsa_ident.identification.modal_parameters import flange_of
    from rcsa_ident.identification.posterior import Posterior
    from rcsa_ident.identification.unknowns import ModalBlock, pack, parameter_names
    from rcsa_ident.io.results.parts import plain, spindle_to_json

    natural = 2.0 * np.pi * np.array([620.0, 998.0, 1285.0, 1820.0, 2330.0, 3100.0, 3970.0])
    psi = np.array([[0.1, 0.6], [0.15, 1.5], [0.2, -1.0], [0.25, 3.0], [0.2, -4.0], [0.12, 6.0], [0.15, 8.0]])
    joint = np.log([3e9, 6e6, 2e3, 10.0])
    axes = {}
    for name, axis, shift in (("X", Dof.X, 1.0), ("Y", Dof.Y, 0.97)):
        layout = ModalBlock(7)
        damping = np.diag(np.sqrt(0.1 * shift * natural))
        theta = np.concatenate([pack(flange_of(shift * natural, psi, damping, np.diag([2e-5, 2e-5])), layout), joint])
        few = ModalBlock(6)
        rival = np.concatenate([pack(flange_of(shift * natural[:6], psi[:6], damping[:6, :6], np.diag([3e-5, 3e-5])), few), joint])
        rng = np.random.default_rng(1)
        half = 0.003 * rng.standard_normal((theta.size, theta.size)) / np.sqrt(theta.size)
        covariance = half @ half.T
        known = Posterior(theta, 0.5 * (covariance + covariance.T), layout)
        axes[name] = spindle_to_json(*known.machine(axis)) | {
            "unknowns": theta, "rivals": [rival], "covariance": {"parameters": parameter_names(layout), "matrix": known.covariance},
        }  # fmt: skip
    data = {
        "schema_version": 1, "status": "converged", "reasons": [], "seed": 1, "method": "default", "software": "by hand",
        "campaign": {"name": "by hand", "cuts_used": 80, "cuts_left_out": []}, "sensors": {},
        "workpiece": {"name": "EN AW-6082", "tangential_coefficient_mpa": 902.0, "radial_ratio": 0.26},
        "band_hz": [500.0, 4300.0], "axes": axes, "delays": {},
    }  # fmt: skip
    return json.dumps(plain(data))


def load(port: int, question: Callable[[int], tuple[str, str, Any]], seconds: float) -> tuple[int, float, float, float]:
    """Ask from several clients for so long, and return answers, answers per second, and the times of half and of 95 % of them [s]."""
    times: list[float] = []
    numbers = iter(range(10**9))
    lock = threading.Lock()
    end = time.perf_counter() + seconds

    def client() -> None:
        connection = HTTPConnection("127.0.0.1", port, timeout=60)
        while time.perf_counter() < end:
            with lock:
                asked = question(next(numbers))
            start = time.perf_counter()
            ask(port, *copy.deepcopy(asked), connection=connection)
            times.append(time.perf_counter() - start)
        connection.close()

    threads = [threading.Thread(target=client) for _ in range(CLIENTS)]
    start = time.perf_counter()
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    rate = len(times) / (time.perf_counter() - start)
    return len(times), rate, float(np.quantile(times, 0.5)), float(np.quantile(times, 0.95))


def ask(port: int, method: str, path: str, body: Any, connection: HTTPConnection | None = None) -> Any:
    """Return the content of an answer below 300."""
    own = HTTPConnection("127.0.0.1", port, timeout=60) if connection is None else connection
    text = body if isinstance(body, str) else None if body is None else json.dumps(body)
    own.request(method, path, text, {} if body is None else {"Content-Type": "application/json"})
    answer = own.getresponse()
    content = answer.read()
    if connection is None:
        own.close()
    if answer.status >= 300:
        raise RuntimeError(f"{method} {path}: {answer.status} {content[:300]!r}")
    return json.loads(content)


@contextmanager
def serving(folder: Path, **further: str) -> Iterator[tuple[int, int]]:
    """Run the service on a free port of loopback, with further settings, until it is ready, and end it; yields the port and its process."""
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = int(free.getsockname()[1])
    settings = {"RCSA_IDENT_DATA": str(folder), "RCSA_IDENT_PORT": str(port), "RCSA_IDENT_WORKERS": "2"}
    limits = {"RCSA_IDENT_REQUESTS_PER_MINUTE": "1000000", "RCSA_IDENT_BURST": "1000000"}
    words = [sys.executable, "-c", "from api.serve import main; main()"]
    with subprocess.Popen(words, env={**os.environ, **settings, **limits, **further}, stderr=subprocess.DEVNULL) as process:
        try:
            for _ in range(600):
                try:
                    ask(port, "GET", "/ready", None)
                    break
                except (OSError, RuntimeError):
                    time.sleep(0.1)
            yield port, process.pid
        finally:
            process.terminate()
