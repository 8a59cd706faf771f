"""First use of a new installation: what compiling each kernel costs, and all of them together (``rcsa-ident warm``).

``python -m benchmarks compile [--steps "lobes" "tips"] [--rows 30] [--json]``. Every run has a cache of its own that begins empty. Seconds
of a kernel are its processor's, without those of the kernels that it calls; LLVM's are those that numba spends in its library.
"""

from __future__ import annotations

import argparse
import json
import os
import resource
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Sequence
from typing import Any

#: In the order of the table's columns.
_PHASES = ("types", "other passes", "LLVM")


def main(arguments: list[str]) -> None:
    """Print the table of kernels, and what ``rcsa-ident warm`` takes with an empty cache and with a full one."""
    parser = argparse.ArgumentParser(prog="benchmarks compile", description=__doc__)
    parser.add_argument("--steps", nargs="*", help="steps of the warming, by default all")
    parser.add_argument("--rows", type=int, default=30, help="kernels that are shown")
    parser.add_argument("--json", action="store_true")
    parser.add_argument("--inside", action="store_true", help=argparse.SUPPRESS)
    given = parser.parse_args(arguments)
    if given.inside:
        print(json.dumps(compiled(given.steps)))
        return
    with tempfile.TemporaryDirectory() as cache:
        steps = [] if given.steps is None else ["--steps", *given.steps]
        told = json.loads(_run([sys.executable, "-m", "benchmarks", "compile", "--inside", *steps], cache)[0].splitlines()[-1])
    if given.steps is None:
        with tempfile.TemporaryDirectory() as cache:
            told["warm"] = {name: dict(zip(("wall", "cpu"), _run(_WARM, cache)[1:], strict=True)) for name in ("empty cache", "full cache")}
    if given.json:
        print(json.dumps(told, indent=1))
    else:
        print(table(told, given.rows), end="")


_WARM = [sys.executable, "-m", "rcsa_ident.cli", "warm"]


def _run(command: Sequence[str], cache: str) -> tuple[str, float, float]:
    """Run a command with a cache; return what it prints, its wall seconds, and its processor's with those of its own processes."""
    before, start = resource.getrusage(resource.RUSAGE_CHILDREN), time.perf_counter()
    done = subprocess.run(command, env=os.environ | {"NUMBA_CACHE_DIR": cache}, stdout=subprocess.PIPE, text=True, check=True)
    wall, after = time.perf_counter() - start, resource.getrusage(resource.RUSAGE_CHILDREN)
    return done.stdout, wall, after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def compiled(steps: Sequence[str] | None) -> dict[str, Any]:
    """Run steps of the warming in this process and return what they compile: module, name, signatures, seconds by phase."""
    from numba.core import event

    from rcsa_ident.front.compile_kernels import STEPS

    seconds: dict[tuple[str, str], Counter[str]] = {}
    signatures: Counter[tuple[str, str]] = Counter()
    # what runs, innermost last: kernel, phase, start, seconds of what runs inside
    running: list[list[Any]] = []

    class Phase(event.Listener):
        def on_start(self, told: event.Event) -> None:
            kernel, phase = running[-1][0] if running else None, "other passes"
            if told.kind == "numba:compile":
                function = told.data["dispatcher"].py_func
                kernel = (function.__module__, function.__qualname__)
                signatures[kernel] += 1
            elif told.kind == "numba:llvm_lock":
                phase = "LLVM"
            elif told.data["name"].startswith("nopython_type_inference"):
                phase = "types"
            running.append([kernel, phase, time.process_time(), 0.0])

        def on_end(self, told: event.Event) -> None:
            kernel, phase, start, inside = running.pop()
            took = time.process_time() - start
            if kernel is not None:
                seconds.setdefault(kernel, Counter())[phase] += took - inside
            if running:
                running[-1][3] += took

    for kind in ("numba:compile", "numba:run_pass", "numba:llvm_lock"):
        event.register(kind, Phase())
    taken = {}
    for name in steps or STEPS:
        start = time.process_time()
        STEPS[name]()
        taken[name] = time.process_time() - start
    rows = [
        {"module": key[0], "kernel": key[1], "signatures": signatures[key], **{p: each[p] for p in _PHASES}}
        for key, each in seconds.items()
    ]
    return {"steps": taken, "kernels": sorted(rows, key=lambda row: -_total(row))}


def table(told: dict[str, Any], most: int) -> str:
    """Return the tables as text."""
    rows = told["kernels"]
    own = [row for row in rows if row["module"].startswith("rcsa_ident")]
    library = [row for row in rows if row not in own]
    lines = [f"{'kernel':<58}{'signatures':>11}{'seconds':>9}" + "".join(f"{phase:>14}" for phase in _PHASES)]
    lines += [_line(f"{row['module'].removeprefix('rcsa_ident.')}.{row['kernel']}", [row]) for row in own[:most]]
    lines += [_line(f"{len(own)} kernels", own), _line(f"{len(library)} functions of numba's library", library), _line("together", rows)]
    lines += ["", *(f"step {name:<20}{seconds:7.1f} s of processor" for name, seconds in told["steps"].items())]
    for name, each in told.get("warm", {}).items():
        lines.append(f"rcsa-ident warm, {name}: {each['wall']:.1f} s, {each['cpu']:.1f} s of processor")
    return "\n".join(lines) + "\n"


def _line(name: str, rows: Sequence[dict[str, Any]]) -> str:
    count = sum(row["signatures"] for row in rows)
    return f"{name:<58}{count:>11}{sum(map(_total, rows)):>9.2f}" + "".join(
        f"{sum(row[phase] for row in rows):>14.2f}" for phase in _PHASES
    )


def _total(row: dict[str, Any]) -> float:
    return sum(row[phase] for phase in _PHASES)
