"""Every task that somebody else's program does, too, on both sides in one run: how many times longer the peer takes.

``python -m benchmarks all --out docs/benchmarks.md``. Each task is a `benchmarks.timing.Race`: both sides get the same input and are asked
for the same answer, to the accuracy that stands in the row. They take turns, round by round, in processor time, so that what else the
host does falls on both. Seconds are never told: they are the machine's. Peers that are not installed are named; ROSS and Pinocchio are
nobody's requirement here (``pip install ross-rotordynamics "plotly<6" pin``).
"""

from __future__ import annotations

import argparse
import importlib
import os
import platform
import time
from collections.abc import Iterator, Sequence
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

import numpy as np
from threadpoolctl import threadpool_limits

from benchmarks.timing import Race

#: Modules with `races`, in the order of the chain.
MODULES = ("core_peers", "candidate", "forces", "lobes", "stability", "observer", "robot", "urdf", "removal")
#: What runs the numbers on both sides, and peers that may be missing.
BESIDE, OPTIONAL = ("numpy", "scipy", "numba"), {"ross-rotordynamics": "ROSS", "pin": "Pinocchio"}
ROUNDS = 7
HEAD = """# Benchmarks beside peers

Written by `python -m benchmarks all --out docs/benchmarks.md`: every task that another program, or the usual route through NumPy and
SciPy, does as well, on both sides in one process with one thread. The sides take turns in {rounds} rounds, in processor time. A ratio says
how many times longer the peer takes; below 1 the peer is faster. No seconds are told: they are those of a machine, and change with what
else it does.

{machine}. {versions}.{missing}

Where the peer is NumPy or SciPy, it is vectorised where the task allows it, not a slow twin. Kernels are compiled before the first
round. How accurate both are stands in the row: a ratio without it says nothing.

| task | peer | accuracy of both | peer's time over ours: median | least | most |
|---|---|---|---|---|---|
"""
TAIL = """
What a ratio leaves out: Pinocchio and filterpy are called from Python, as they are used there, while ours run many steps in one compiled
loop; manifold3d gives a closed solid, of which dexels are samples; emcee's walkers explore without being told a prior to draw from; the
polish of SciPy gets its derivatives from differences, ours in closed form. Searches beside other searches stand in [study.md](study.md)
(`python -m benchmarks search_trace`), robots beside Gaussian processes in [robots.md](robots.md), readers of long recordings in
`python -m benchmarks reading`, whole services in [service.md](service.md). There is no public program for stability lobes of milling in
Python: the peer there is the dense form that all published codes share.

What has no peer: `python -m benchmarks walks` counts how straight the code itself is, from a tooling in a REST body to lobes, from
recordings to an identification, and from a cut to forces: the rooms that each walk enters, climbs to a higher floor, and returns.
"""


def races(modules: Sequence[str] = MODULES) -> Iterator[Race]:
    """Yield all tasks whose peers are installed."""
    for name in modules:
        yield from importlib.import_module(f"benchmarks.{name}").races()


def line(race: Race, ratios: Sequence[float]) -> str:
    """Return a row of the table."""
    least, median, most = (f"{value:.2g}" if value < 100.0 else f"{value:.0f}" for value in np.quantile(ratios, (0.0, 0.5, 1.0)))
    return f"| {race.claim} | {race.peer} ({race.package} {version(race.package)}) | {race.accuracy} | **{median}** | {least} | {most} |"


def processor() -> str:
    """Return the processor's name and the number of cores."""
    cores = os.cpu_count()
    try:
        text = Path("/proc/cpuinfo").read_text(encoding="utf-8")
        name = next(each.split(":", 1)[1].strip() for each in text.splitlines() if each.startswith("model name"))
    except (OSError, StopIteration):
        name = platform.processor() or platform.machine()
    return f"{name}, {cores} cores, {platform.system()}, Python {platform.python_version()}"


def page(lines: Sequence[str]) -> str:
    """Return the page."""
    missing = [name for package, name in OPTIONAL.items() if not _installed(package)]
    words = f" Not installed: {', '.join(missing)}." if missing else ""
    versions = ", ".join(f"{name} {version(name)}" for name in BESIDE)
    head = HEAD.format(rounds=ROUNDS, machine=processor(), versions=versions, missing=words)
    return head + "\n".join(lines) + "\n" + TAIL


def _installed(package: str) -> bool:
    try:
        version(package)
    except PackageNotFoundError:
        return False
    return True


def main(arguments: Sequence[str]) -> None:
    """Run the races, print a row each, and write the page."""
    parser = argparse.ArgumentParser(prog="benchmarks all", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path, help="PAGE.md to write")
    parser.add_argument("--only", nargs="+", choices=MODULES, default=MODULES, help="modules")
    parser.add_argument("--rounds", type=int, default=ROUNDS)
    given = parser.parse_args(arguments)
    lines, began = [], time.perf_counter()
    with threadpool_limits(1):
        for race in races(given.only):
            lines.append(line(race, race.ratios(given.rounds)))
            print(lines[-1], flush=True)
    print(f"{len(lines)} tasks in {time.perf_counter() - began:.0f} s")
    if given.out is not None:
        given.out.write_text(page(lines), encoding="utf-8")
