"""The page of all validated figures, written from the rows that `benchmarks.validation` keeps."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from benchmarks.validation_case import GROUPS
from benchmarks.validation_missed import WORDS

MISSED = "Not reproduced"
HEAD = """# Validation

Published figures, closed forms and public recordings beside what the package makes of them, in one place. Written by
`python -m benchmarks validation --out docs/validation.md` from [validation.jsonl](validation.jsonl), which has more digits.
`python -m benchmarks validation --only NAME` measures the rows whose name or group holds NAME; `--reuse docs/validation.jsonl` measures
only what is missing there.

- *expected*: as printed, in closed form, as recorded, or as another program computed it from published data. The source says which. Sources
  in square brackets are those of [references.md](references.md).
- *error*: the largest of all values of the row; of each value itself unless another measure stands behind it. Rows of more than eight
  values show the one that is farthest off.
- *allowed*: what the test in the last column holds; `tests/benchmarks/test_validation.py` holds it of every row that stands here.
- *commit*: the one at which the row was measured.

{summary}
"""
FILES = """The files are other people's and are not part of the project: each row names the file and where it is public.
"""
STUDY = """Virtual machines whose truth is known, drawn from seeds that were fixed before the methods were tuned
([study.md](study.md)). Nothing is run again for this page: the rows are read from what the study left, the commit is that of the
file's last change. Expected are the aims that were set; the 90 % band should hold 85 to 95 % of the truth.
"""
NOTES = {"Files that others recorded": FILES, "The study: virtual machines": STUDY}


def number(value: float) -> str:
    """Return a value with the digits that a reader needs."""
    return f"{value:.5g}".replace("e-0", "e-").replace("e+0", "e+")


def values(row: dict[str, Any], key: str) -> str:
    """Return the cell of expected or own values."""
    shown = ", ".join(number(each) for each in row[key])
    return f"{shown} ({row['values']} values)" if row["values"] > len(row[key]) and key == "expected" else shown


def deviation(row: dict[str, Any]) -> str:
    """Return the cell of the error."""
    if row["measure"] in ("at most", "at least"):
        return "beyond it" if row["error"] > 0.0 else "within"
    error = number(row["error"])
    if row["measure"] == "absolute":
        return f"{error} {row['unit']}".strip()
    share = row["error"] * 100.0
    told = f"{share:.2g} %" if share >= 0.001 else error
    return told if row["measure"] == "of each value" else f"{told} of the largest"


def allowed(row: dict[str, Any]) -> str:
    """Return the cell of the tolerance."""
    if row["measure"] in ("at most", "at least"):
        return row["measure"]
    tolerance = row["tolerance"]
    return number(tolerance) if row["measure"] == "absolute" or tolerance < 1e-5 else f"{100.0 * tolerance:.3g} %"


def command(test: str) -> str:
    """Return the cell of the command."""
    return f"`{test if test.startswith('python') else 'pytest ' + test}`"


def _cells(*cells: str) -> str:
    return "| " + " | ".join(each.replace("|", "\\|") for each in cells) + " |"


def table(rows: Sequence[dict[str, Any]]) -> list[str]:
    """Return the lines of a group's table."""
    lines = ["| what | source | expected | ours | unit | error | allowed | commit | shown by |", "|---|---|---|---|---|---|---|---|---|"]
    for row in rows:
        own = values(row, "expected"), values(row, "ours"), row["unit"], deviation(row), allowed(row)
        lines.append(_cells(row["name"], row["source"], *own, row["commit"], command(row["test"])))
    return lines


def missed(rows: Sequence[dict[str, Any]]) -> list[str]:
    """Return the lines of what is not reproduced."""
    lines = ["| what | source | expected | ours | unit | apart | commit | why |", "|---|---|---|---|---|---|---|---|"]
    for row in rows:
        own = values(row, "expected"), values(row, "ours"), row["unit"], deviation(row)
        lines.append(_cells(row["name"], row["source"], *own, row["commit"], row["test"]))
    return [*lines, "", *(f"- {each}" for each in WORDS)]


def summary(rows: Sequence[dict[str, Any]]) -> str:
    """Return a line for each group: how many rows, and the one that uses most of what is allowed."""
    lines = ["| | rows | nearest to what is allowed |", "|---|---|---|"]
    for group in GROUPS:
        own = [row for row in rows if row["group"] == group]
        within = [row for row in own if row["tolerance"] and row["measure"] not in ("at most", "at least")]
        near = max(within, key=lambda row: row["error"] / row["tolerance"], default=None)
        told = "" if near is None else f"{near['name']}: {deviation(near)} of {allowed(near)}"
        lines.append(_cells(group, str(len(own)), told))
    return "\n".join(lines)


def page(rows: Sequence[dict[str, Any]]) -> str:
    """Return the page."""
    parts = [HEAD.format(summary=summary(rows))]
    for group in GROUPS:
        own = [row for row in rows if row["group"] == group]
        if group == MISSED:
            parts.append("\n".join(["## What is not reproduced, and why", "", *missed(own), ""]))
        else:
            note = [NOTES[group]] if group in NOTES else []
            parts.append("\n".join([f"## {group}", "", *note, *table(own), ""]))
    return "\n".join(parts)
