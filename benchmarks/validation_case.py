"""A line of the page of validated figures, and the modules that hold such lines."""

from __future__ import annotations

from collections.abc import Callable
from enum import StrEnum
from pathlib import Path
from typing import Any, NamedTuple

#: Modules with `CASES`, in the page's order.
GROUPS = {
    "Closed forms: structures": "validation_structures",
    "Closed forms: cuts, observers, paths": "validation_closed_forms",
    "Published mills and forces, and other programs on them": "validation_stability",
    "Published arms, and other programs on them": "validation_robots",
    "Files that others recorded": "validation_files",
    "The study: virtual machines": "validation_study",
    "Not reproduced": "validation_missed",
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

    `source`: key of docs/references.bib in square brackets with its figure or table; of a file its name and public address
    `expected`: float, sequence or callable; as published; what a closed form or another program says is computed
    `ours`: returns as many values
    `tolerance`: of `measure`; not read where a value may be anything up to, or down to, the expected one. None where nothing holds the row.
    `test`: tests that hold it, or another command that shows it; where nothing holds it, why
    `slow`: takes more than about two seconds
    `needs`: file that lies beside the project, or a module that it does not ask for
    """

    name: str
    source: str
    expected: Any
    ours: Callable[[], Any]
    unit: str
    tolerance: float | None
    test: str
    measure: Measure = Measure.EACH
    slow: bool = False
    needs: Path | str | None = None
