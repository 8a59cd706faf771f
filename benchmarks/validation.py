"""Everything that others published, wrote down in closed form or recorded, beside what the package makes of it, on one page.

``python -m benchmarks validation --out docs/validation.md`` measures every case and writes the page from the rows, which are kept beside
it in ``docs/validation.jsonl``, each with the commit at which it was measured. ``--only NAME`` measures the cases whose group or name
holds NAME; ``--reuse FILE.jsonl`` takes the rows that stand there already and measures what is missing.

A case is a line of a registry: what is asked, the published values or the closed form, what the package says, and how far both may be
apart. Files that others recorded lie beside the project, not in it: without them their rows stay as they were.
"""

from __future__ import annotations

import argparse
import importlib
import importlib.util
import subprocess
import time
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.page import DOCS, read_rows, write_rows
from benchmarks.validation_case import GROUPS, Case, Measure
from benchmarks.validation_page import page

ROOT = DOCS.parent
#: More values than these are told by their number and the one that is farthest off.
SHOWN = 8


def there(case: Case) -> bool:
    """Whether what a case needs is there."""
    if isinstance(case.needs, str):
        return importlib.util.find_spec(case.needs) is not None
    return case.needs is None or case.needs.exists()


def cases() -> Iterator[tuple[str, Case]]:
    """Yield every case with its group."""
    for group, module in GROUPS.items():
        for case in importlib.import_module(f"benchmarks.{module}").CASES:
            yield group, case


def distance(expected: Any, ours: Any, measure: Measure) -> tuple[float, int]:
    """Return the error and the place of the value that it is of."""
    wanted, found = (np.atleast_1d(np.asarray(each)).ravel() for each in (expected, ours))
    if wanted.shape != found.shape:
        raise ValueError(f"{wanted.size} values were expected, {found.size} found")
    apart = np.abs(found - wanted)
    if measure is Measure.EACH:
        apart = apart / np.abs(wanted)
    elif measure is Measure.LARGEST:
        apart = apart / np.max(np.abs(wanted))
    elif measure is not Measure.ABSOLUTE:
        apart = (found - wanted) if measure is Measure.AT_MOST else (wanted - found)
    worst = int(np.argmax(apart))
    return float(apart[worst]), worst


def measured(group: str, case: Case, commit: str) -> dict[str, Any]:
    """Return a case's row."""
    start = time.process_time()
    wanted = case.expected() if callable(case.expected) else case.expected
    found = case.ours()
    error, worst = distance(wanted, found, case.measure)
    pair = [np.atleast_1d(np.asarray(each)).ravel() for each in (wanted, found)]
    count = pair[0].size
    if count > SHOWN:
        pair = [each[worst : worst + 1] for each in pair]
    values = [[_digits(abs(x) if np.iscomplexobj(each) else x) for x in each] for each in pair]
    return {
        "group": group,
        "name": case.name,
        "source": case.source,
        "expected": values[0],
        "ours": values[1],
        "values": count,
        "unit": case.unit,
        "measure": str(case.measure),
        "error": float(f"{error:.2g}"),
        "tolerance": case.tolerance,
        "holds": holds(error, case),
        "test": case.test,
        "commit": commit,
        "seconds": round(time.process_time() - start, 1),
    }


def holds(error: float, case: Case) -> bool:
    """Whether a case is as near as it has to be; what nothing holds is never too far."""
    if case.tolerance is None:
        return True
    return error <= (0.0 if case.measure in (Measure.AT_MOST, Measure.AT_LEAST) else case.tolerance)


def commit_of(case: Case, here: str) -> str:
    """Return the commit at which a row is measured; of what is read from a file of the repository, that of its last change."""
    if isinstance(case.needs, Path) and case.needs.is_relative_to(ROOT):
        return _git("log", "-1", "--format=%h", "--", str(case.needs))
    return here


def _digits(value: Any) -> float:
    return float(f"{value:.6g}")


def head() -> str:
    """Return the commit, with a + where the package differs from it."""
    return _git("rev-parse", "--short", "HEAD") + ("+" if _git("status", "--porcelain", "rcsa_ident") else "")


def _git(*arguments: str) -> str:
    return subprocess.run(["git", "-C", str(ROOT), *arguments], capture_output=True, text=True, check=True).stdout.strip()


def main(arguments: Sequence[str]) -> None:
    """Measure, print a line each, and write rows and page."""
    parser = argparse.ArgumentParser(
        prog="benchmarks validation", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--out", type=Path, help="PAGE.md to write; its rows stand beside it as PAGE.jsonl")
    parser.add_argument("--only", metavar="NAME", help="only cases whose group or name holds this; the page's other rows stay")
    parser.add_argument("--reuse", type=Path, metavar="FILE.jsonl", help="rows that are not measured again")
    given = parser.parse_args(arguments)
    path = None if given.out is None else given.out.with_suffix(".jsonl")
    rows = {row["name"]: row for each in (path, given.reuse) if each is not None for row in read_rows(each)}
    reused = set() if given.reuse is None else {row["name"] for row in read_rows(given.reuse)}
    commit, every = head(), list(cases())
    for group, case in every:
        asked = given.only is None or given.only.lower() in f"{group} {case.name}".lower()
        if not asked or not there(case) or case.name in reused:
            continue
        row = rows[case.name] = measured(group, case, commit_of(case, commit))
        said = "" if row["holds"] else "  MORE THAN ALLOWED"
        allowed = "" if case.tolerance is None else f" ({case.tolerance:g} allowed)"
        print(f"{case.name}: {row['error']:.2g} {case.measure}{allowed}, {row['seconds']} s{said}", flush=True)
        if path is not None:
            # whatever interrupts the rest
            write_rows(path, [rows[each.name] for _, each in every if each.name in rows])
    if path is not None:
        found = [rows[each.name] for _, each in every if each.name in rows]
        write_rows(path, found)
        given.out.write_text(page(found), encoding="utf-8")
