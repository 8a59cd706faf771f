"""What a limit of a cutter with a shape costs, beside one of the cylinder of the same diameter, by full discretisation with one tolerance.

The cuts are those of `cylinder_error`: there stand the limits themselves.
"""

from __future__ import annotations

from functools import partial
from typing import Any

from benchmarks.cylinder_error import ROUGHERS, Case, cylinder, limits_of
from benchmarks.timing import best_of, row
from tests.stability import shaped_mills as mills

CASES: tuple[tuple[str, Case], ...] = (
    ("45° face mill, 3 directions", mills.LIMITS["A"][:3]),
    ("45° face mill, 5 directions", mills.LIMITS["A, slope -7"][:3]),
    ("high feed into a block", mills.LIMITS["B"][:3]),
    ("ball in a slot", mills.LIMITS["C"][:3]),
    ("bull nose", mills.LIMITS["D"][:3]),
    ("helix of each tooth", mills.LIMITS["E A"][:3]),
    ("helix of each tooth and unequal pitch", mills.LIMITS["E B"][:3]),
    ("rougher", ROUGHERS[1]),
)


def run() -> list[dict[str, Any]]:
    """A limit at one speed, mean over those of the case."""
    return [_row(*each) for each in CASES]


def _row(name: str, case: Case) -> dict[str, Any]:
    ours, peer = (1e3 * best_of(partial(limits_of, *each), 5) / len(case[2]) for each in (case, cylinder(case)))
    return row(f"a limit, {name}", ours, peer, "ms", f"{ours / peer:.1f} times the cylinder's")
