"""CASES.toml: configurations of machine and process that were tested, each with its cuts."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, NamedTuple

from rcsa_ident.base.plausibility import FEED_PER_TOOTH
from rcsa_ident.cutting.conditions import AnyEngagement
from rcsa_ident.io.settings.cuts import ENGAGEMENT_KEYS, engagement_of, feed_angle_of
from rcsa_ident.io.settings.setups import read_tooling
from rcsa_ident.io.settings.tested_cuts import read_tested_cuts
from rcsa_ident.io.toml_text import read_toml
from rcsa_ident.io.validated_table import Table
from rcsa_ident.setup.tooling import Tooling
from rcsa_ident.stability.labels.tested_cuts import TestedCuts

_CASE = ("name", "tooling", "feed_direction", *ENGAGEMENT_KEYS, "feed_per_tooth_mm", "tests", "idle")


class Case(NamedTuple):
    """One configuration.

    `feed_angle` [rad]; `feed_per_tooth` [m]
    `idle`: tap-test FRFs of this tooling, each as ``X=FILE``, ``Y=FILE`` or ``FILE``
    `tests`: the file of the cuts
    """

    name: str
    tooling: Tooling
    engagement: AnyEngagement
    feed_angle: float
    feed_per_tooth: float | None
    cuts: TestedCuts | None
    idle: tuple[str, ...]
    tests: Path | None = None


def read_cases(path: str | Path) -> list[Case]:
    """Return the cases of a file; the paths in it are relative to it.

    Raises `InputError`, which names the file, the key, what was found and what is allowed.
    """
    return cases_of(read_toml(path, "cases"), str(path), Path(path).parent, read_tooling, read_tested_cuts)


def cases_of(
    data: Mapping[str, Any],
    where: str,
    folder: Path,
    tooling: Callable[[Path], Tooling],
    tests: Callable[[Path], TestedCuts],
) -> list[Case]:
    """Return the cases of a table of keys as `read_cases` finds them in a file.

    `data`: the table's keys
    `where`: the file, for the messages
    `folder`: that the paths in it are relative to
    `tooling`, `tests`: given a path, return the tooling, or the tested cuts, of that file
    """
    top = Table(data, where, known=("cases",))
    return [_case(table, folder, tooling, tests, i) for i, table in enumerate(top.tables("cases", _CASE), start=1)]


def _case(table: Table, folder: Path, toolings: Callable[[Path], Tooling], tests: Callable[[Path], TestedCuts], number: int) -> Case:
    tooling = toolings(folder / table.text("tooling"))
    allowed = "a list of texts, as X=FILE, Y=FILE or FILE"
    idle = table.value("idle", allowed, [], {"type": "array", "items": {"type": "string", "pattern": r"\S"}})
    if not isinstance(idle, list) or not all(isinstance(text, str) for text in idle):
        table.refuse("idle", f"{idle!r}", allowed)
    if not all(text.strip() for text in idle):
        table.refuse("idle", "an empty text", allowed)
    file = folder / table.text("tests") if "tests" in table else None
    feed = table.quantity("feed_per_tooth_mm", FEED_PER_TOOTH, None)
    return Case(
        table.text("name", f"case {number}"),
        tooling,
        engagement_of(table, tooling.cutter, lambda own, key: folder / own.text(key)),
        feed_angle_of(table) if "feed_direction" in table else 0.0,
        None if feed is None else feed * 1e-3,
        None if file is None else tests(file),
        tuple(_beside(text, folder) for text in idle),
        file,
    )


def _beside(text: str, folder: Path) -> str:
    axes, sign, name = text.partition("=")
    if sign and 1 <= len(axes) <= 2 and set(axes.upper()) <= set("XYZ"):
        return f"{axes}={folder / name}"
    return str(folder / text)
