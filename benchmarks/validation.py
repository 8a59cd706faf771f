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
import subprocess
import time
from collections.abc import Callable, Iterator, Sequence
from enum import StrEnum
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from benchmarks.page import DOCS, read_rows, write_rows

ROOT = DOCS.parent
#: More values than these are told by their number and the one that is farthest off.
SHOWN = 8
#: Modules with `CASES`, in the page's order.
GROUPS = {
    "Closed forms: structures": "validation_structures",
    "Closed forms: cuts, observers, paths": "validation_closed_forms",
    "Published: stability, forces": "validation_stability",
    "Published: robots": "validation_robots",
    "Real files": "validation_files",
    "The study: virtual machines whose seeds were held out": "validation_study",
}


class Measure(StrEnum):
    """How far apart two answers are."""

    EACH = "of each value"
    LARGEST = "of the largest"
    ABSOLUTE = "absolute"
    AT_MOST = "at most"
    AT_LEAST = "at least"


class Case(NamedTuple):
    """One line of the page.

    Parameters
    ----------
    name : str
    source : str
        Key of docs/references.bib in square brackets with its figure or table; of a file its name and public address.
    expected : float, sequence or callable
        As published; what a closed form or another program says is computed.
    ours : callable
        Returns as many values.
    unit : str
    tolerance : float
        Of `measure`; not read where a value may be anything up to, or down to, the expected one.
    test : str
        Tests that hold it: the argument of pytest.
    measure : Measure
    slow : bool
        Takes more than about two seconds.
    needs : path or None
        File that lies beside the project.
    """

    name: str
    source: str
    expected: Any
    ours: Callable[[], Any]
    unit: str
    tolerance: float
    test: str
    measure: Measure = Measure.EACH
    slow: bool = False
    needs: Path | None = None


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
        "holds": bool(error <= (case.tolerance if case.measure not in (Measure.AT_MOST, Measure.AT_LEAST) else 0.0)),
        "test": case.test,
        "commit": commit,
        "seconds": round(time.process_time() - start, 1),
    }


def _digits(value: Any) -> float:
    return float(f"{value:.6g}")


def head() -> str:
    """Return the commit, with a + where the package differs from it."""
    git = ("git", "-C", str(ROOT))
    short = subprocess.run([*git, "rev-parse", "--short", "HEAD"], capture_output=True, text=True, check=True).stdout.strip()
    changed = subprocess.run([*git, "status", "--porcelain", "rcsa_ident"], capture_output=True, text=True, check=True).stdout
    return short + ("+" if changed.strip() else "")


def main(arguments: Sequence[str]) -> None:
    """Measure, print a line each, and write rows and page."""
    parser = argparse.ArgumentParser(
        prog="benchmarks validation", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--out", type=Path, help="PAGE.md to write; its rows stand beside it as PAGE.jsonl")
    parser.add_argument("--only", metavar="NAME", help="only cases whose group or name holds this; the page's other rows stay")
    parser.add_argument("--reuse", type=Path, metavar="FILE.jsonl", help="rows that are not measured again")
    given = parser.parse_args(arguments)
    kept = {} if given.out is None else {row["name"]: row for row in read_rows(given.out.with_suffix(".jsonl"))}
    reused = {} if given.reuse is None else {row["name"]: row for row in read_rows(given.reuse)}
    commit, rows = head(), []
    for group, case in cases():
        asked = given.only is None or given.only.lower() in f"{group} {case.name}".lower()
        there = case.needs is None or case.needs.exists()
        if asked and there and case.name not in reused:
            row = measured(group, case, commit)
            said = "" if row["holds"] else "  MORE THAN ALLOWED"
            print(f"{case.name}: {row['error']:.2g} {case.measure} ({case.tolerance:g} allowed), {row['seconds']} s{said}", flush=True)
        else:
            row = reused.get(case.name) or kept.get(case.name)
        if row is not None:
            rows.append(row)
    if given.out is not None:
        from benchmarks.validation_page import page

        write_rows(given.out.with_suffix(".jsonl"), rows)
        given.out.write_text(page(rows), encoding="utf-8")
