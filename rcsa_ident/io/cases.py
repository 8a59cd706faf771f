"""CASES.toml: configurations of machine and process that were tested, each with its cuts."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

from rcsa_ident.cutting.conditions import AnyEngagement
from rcsa_ident.errors import InputError
from rcsa_ident.io.cuts import ENGAGEMENT_KEYS, engagement_of, feed_angle_of
from rcsa_ident.io.setups import read_tooling
from rcsa_ident.io.tested_cuts import read_tested_cuts
from rcsa_ident.io.toml_text import read_toml
from rcsa_ident.io.validated_table import Table
from rcsa_ident.machining_setup import Tooling
from rcsa_ident.plausibility import FEED_PER_TOOTH
from rcsa_ident.stability.tested_cuts import TestedCuts

_CASE = ("name", "tooling", "feed_direction", *ENGAGEMENT_KEYS, "feed_per_tooth_mm", "tests", "idle")


class Case(NamedTuple):
    """One configuration.

    Parameters
    ----------
    name : str
    tooling : Tooling
    engagement : Engagement, Block, Stepover or EngagementMap
    feed_angle : float [rad]
    feed_per_tooth : float or None [m]
    cuts : TestedCuts or None
    idle : tuple of str
        Tap-test FRFs of this tooling, each as ``X=FILE``, ``Y=FILE`` or ``FILE``.
    """

    name: str
    tooling: Tooling
    engagement: AnyEngagement
    feed_angle: float
    feed_per_tooth: float | None
    cuts: TestedCuts | None
    idle: tuple[str, ...]


def read_cases(path: str | Path) -> list[Case]:
    """Return the cases of a file; the paths in it are relative to it.

    Raises
    ------
    InputError
        Names the file, the key, what was found and what is allowed.
    """
    top = Table(read_toml(path, "cases"), str(path), known=("cases",))
    return [_case(table, Path(path).parent, i) for i, table in enumerate(top.tables("cases", _CASE), start=1)]


def _case(table: Table, folder: Path, number: int) -> Case:
    tooling = read_tooling(folder / table.text("tooling"))
    idle = table.value("idle", "a list of texts, as X=FILE", [])
    if not isinstance(idle, list) or not all(isinstance(text, str) for text in idle):
        table.refuse("idle", f"{idle!r}", "a list of texts, as X=FILE")
    feed = table.quantity("feed_per_tooth_mm", FEED_PER_TOOTH, None)
    return Case(
        table.text("name", f"case {number}"),
        tooling,
        engagement_of(table, tooling.cutter, lambda own, key: folder / own.text(key)),
        feed_angle_of(table) if "feed_direction" in table else 0.0,
        None if feed is None else feed * 1e-3,
        read_tested_cuts(folder / table.text("tests")) if "tests" in table else None,
        tuple(_beside(text, folder) for text in idle),
    )


def _beside(text: str, folder: Path) -> str:
    axes, sign, name = text.partition("=")
    if sign and 1 <= len(axes) <= 2 and set(axes.upper()) <= set("XYZ"):
        return f"{axes}={folder / name}"
    if not text.strip():
        raise InputError("idle", "an empty text", "X=FILE, Y=FILE or FILE")
    return str(folder / text)
