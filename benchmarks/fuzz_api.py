"""Fuzzing of the REST interface: the harness of tests/api/made_up.py with other seeds and more cases of each operation.

``python -m benchmarks fuzz_api --seed 1 --examples 200`` sends every operation 200 requests that its description allows and 200 that it
does not, and ends with the first answer that is a server error or of a status, type or body that the description does not name.
``--rounds`` goes on with the next seeds.
"""

from __future__ import annotations

import argparse
import tempfile
import time
from pathlib import Path

from benchmarks.service import machine_text


def main(arguments: list[str]) -> None:
    """Run rounds, and print what each has sent."""
    parser = argparse.ArgumentParser(prog="benchmarks fuzz_api", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--examples", type=int, default=100)
    parser.add_argument("--rounds", type=int, default=1)
    given = parser.parse_args(arguments)
    from tests.api.made_up import answers

    for number in range(given.seed, given.seed + given.rounds):
        begun, operations = time.process_time(), 0
        with tempfile.TemporaryDirectory() as folder:
            for operation, statuses in answers(Path(folder), machine_text(), number, given.examples):
                operations += 1
                print(f"{operation.label:<70} {', '.join(map(str, sorted(statuses)))}", flush=True)
        print(f"seed {number}: {operations} operations, {given.examples} cases each, allowed and not; {time.process_time() - begun:.0f} s")
