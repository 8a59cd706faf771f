"""Time of an identification beside that of another state of this project, in turn on the same machine.

``python -m benchmarks identification [--against CHECKOUT] [--campaign FOLDER] [--seeds 1 2 3] [--jobs 1 2]``. Each checkout has a process
of its own that has run once before; the clock runs from the lines to the answer, and the shortest of the rounds counts. The final cost
tells whether a shorter time was bought with a worse answer; costs of states with other priors do not compare.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

HERE = Path(__file__).resolve().parents[1]
#: Run in each checkout's own process. Before it had its name, the method was called by another.
WORKER = r"""
import json, multiprocessing, sys, time, warnings
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
warnings.simplefilter("ignore")
from benchmarks.study import read_data
try:
    from rcsa_ident.identification.evidence import EvidenceSelection as Method
except ImportError:
    from rcsa_ident.identification.default import DefaultMethod as Method

def main():
    data = read_data(Path(sys.argv[1]))[2]
    jobs = int(sys.argv[2])
    pool = ProcessPoolExecutor(jobs, multiprocessing.get_context("spawn")) if jobs > 1 else None
    run = (lambda seed: Method().run(data, seed, pool.map)) if pool else (lambda seed: Method().run(data, seed))
    run(77)
    print("ready", flush=True)
    for line in sys.stdin:
        wall, busy = time.perf_counter(), time.process_time()
        found = run(int(line))
        wall, busy = time.perf_counter() - wall, time.process_time() - busy
        last = found.trace[-1]
        cost = last.cost if hasattr(last, "cost") else last[2]
        modes = [int(each.modes.omega_n.size) for each in found.axes.values()]
        print(json.dumps([wall, busy, float(cost), str(found.status), modes]), flush=True)

if __name__ == "__main__":
    main()
"""


def worker(checkout: Path, campaign: Path, jobs: int) -> subprocess.Popen[str]:
    """Return a process that reads seeds and writes what came out, ready for the first; what is spawned imports its file anew."""
    script = Path(tempfile.mkdtemp()) / "timed.py"
    script.write_text(WORKER)
    environment = {**os.environ, "PYTHONPATH": str(checkout), "OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"}
    command = [sys.executable, str(script), str(campaign), str(jobs)]
    return subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, env=environment, cwd=checkout)


def ask(process: subprocess.Popen[str], seed: int) -> list[Any]:
    assert process.stdin is not None
    assert process.stdout is not None
    process.stdin.write(f"{seed}\n")
    process.stdin.flush()
    answer: list[Any] = json.loads(process.stdout.readline())
    return answer


def main(given: list[str]) -> None:
    """Print a table, one row a checkout, number of jobs and seed."""
    raw = argparse.RawDescriptionHelpFormatter
    parser = argparse.ArgumentParser(prog="benchmarks identification", description=__doc__, formatter_class=raw)
    parser.add_argument("--against", type=Path, nargs="*", default=[], metavar="CHECKOUT", help="folders of other states of this project")
    parser.add_argument("--campaign", type=Path, default=HERE / "data" / "sample_runs", help="folder; default: the sample runs")
    parser.add_argument("--seeds", type=int, nargs="+", default=[1, 2, 3])
    parser.add_argument("--jobs", type=int, nargs="+", default=[1, 2], help="processes")
    parser.add_argument("--rounds", type=int, default=2)
    arguments = parser.parse_args(given)
    checkouts = [*(each.resolve() for each in arguments.against), HERE]
    print("| state | processes | seed | s | processor s | final cost | status | modes |\n|---|---|---|---|---|---|---|---|")
    for jobs in arguments.jobs:
        workers = [worker(each, arguments.campaign.resolve(), jobs) for each in checkouts]
        total = [0.0] * len(workers)
        for each in workers:
            assert each.stdout is not None
            if each.stdout.readline().strip() != "ready":
                raise SystemExit("a checkout could not read the campaign")
        for seed in arguments.seeds:
            found = [[ask(each, seed) for each in workers] for _ in range(arguments.rounds)]
            for k, checkout in enumerate(checkouts):
                wall, busy, cost, status, modes = min(each[k] for each in found)
                total[k] += wall
                print(f"| {checkout.name} | {jobs} | {seed} | {wall:.2f} | {busy:.2f} | {cost:.14g} | {status} | {modes} |", flush=True)
        for each in workers:
            assert each.stdin is not None
            each.stdin.close()
            each.wait()
        for checkout, seconds in zip(checkouts, total, strict=True):
            print(f"\n{checkout.name}, {jobs} processes: {seconds:.1f} s in all, {seconds / total[-1]:.2f} of this state's", flush=True)
