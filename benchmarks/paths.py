"""Two routes to chatter along a path, and what a program costs: the period map of delays, and a tool that takes away its material.

Both are given the same modes of the tip and nothing else in common: full-discretisation says at which depth a straight cut becomes
unstable, and the march through columns of material is asked at shares of that depth whether it chatters. The pocket is the program of the
tests: helix, arcs, walls, 60 x 40 mm.
"""

from __future__ import annotations

import time
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.timing import row
from rcsa_ident.base.arrays import FloatArray
from rcsa_ident.base.units import from_rpm
from rcsa_ident.cutting.conditions import Engagement
from rcsa_ident.cutting.cutter import Cutter
from rcsa_ident.dynamics.coordinates import Coordinate, Dof
from rcsa_ident.dynamics.modal import normal_modes
from rcsa_ident.io.paths.tool_paths import read_tool_path
from rcsa_ident.machine.known_tip import KnownTip
from rcsa_ident.setup.cut import CutSpec
from rcsa_ident.setup.tooling import BareCutter
from rcsa_ident.stability.discretisation import FullDiscretisation
from rcsa_ident.stability.tip_modes import TipModes
from rcsa_ident.toolpath.path import ToolPath
from rcsa_ident.workflows.paths.milling import mill_path
from rcsa_ident.workflows.paths.removal import field_of, remove_along
from rcsa_ident.workflows.paths.stability import cuts_along, stations_along
from rcsa_ident.workflows.tool_change import ToolChange

TOOL, FEED = BareCutter("end mill", Cutter(3, 0.01, np.radians(30.0))), 5e-5
#: Immersions and the sides of their blocks [m], spindle speeds [rev/min], shares of the limit.
CUTS = (
    (Engagement(0.0, np.pi), (-0.02, 0.02)),
    (Engagement.from_immersion(0.5, "down"), (-0.02, 0.0)),
    (Engagement.from_immersion(0.3, "up"), (0.002, 0.02)),
)
SPEEDS, SHARES = (5000.0, 8000.0, 11000.0, 15000.0, 19000.0), (0.7, 0.85, 0.95, 1.05, 1.15, 1.3)
DEEPEST, LENGTH = 0.015, 0.04
PROGRAM = Path(__file__).parents[1] / "tests" / "fixtures" / "programs" / "pocket.nc"


def tip() -> KnownTip:
    """922 Hz along X and 1300 Hz along Y."""
    modes = {
        axis: normal_modes([2.0 * np.pi * hz], [0.03], [[kg**-0.5]], (Coordinate("tip", axis),))
        for axis, hz, kg in ((Dof.X, 922.0, 0.5), (Dof.Y, 1300.0, 0.4))
    }
    return KnownTip(TipModes.of(modes))


def question(rpm: float, engagement: Engagement, tooling: BareCutter = TOOL) -> ToolChange:
    """Aluminium."""
    cut = CutSpec(engagement, 0.0, FEED, coefficients={"tangential": 8e8, "radial_ratio": 0.3})
    return ToolChange(tip(), tooling, cut, np.array([from_rpm(rpm)]), DEEPEST, FullDiscretisation(), 0)


def run() -> list[dict[str, Any]]:
    """Verdicts, and the times of a pocket."""
    return [*verdicts(), *pocket()]


def chatters(change: ToolChange, depth: float, sides: tuple[float, float]) -> bool:
    """Whether the march along a straight pass chatters."""
    speed = float(change.speeds[0])
    path = ToolPath(np.array([[-0.006, 0.0, -depth], [LENGTH, 0.0, -depth]]), feed=np.full(2, FEED * 3.0 * speed / (2.0 * np.pi)))
    field = field_of(TOOL, (np.array([0.0, sides[0], -0.03]), np.array([LENGTH, sides[1], 0.0])), cell=0.5e-3)
    return mill_path(change, path, field).status == "chatter"


def verdicts() -> list[dict[str, Any]]:
    """Share of marches that agree with the limit, for each share of it."""
    agree: dict[float, list[bool]] = {share: [] for share in SHARES}
    for engagement, sides in CUTS:
        for rpm in SPEEDS:
            change = question(rpm, engagement)
            limit = float(change.limits().limit_depth[0])
            for share in SHARES:
                if limit * share < DEEPEST:
                    agree[share].append(chatters(change, limit * share, sides) == (share > 1.0))
    return [
        row(f"paths: marches at {share:g} of the limit that say as it does", 100.0 * float(np.mean(told)), None, "%", f"{len(told)} cuts")
        for share, told in agree.items()
    ]


def pocket() -> list[dict[str, Any]]:
    """What removal, judgement and march of a program take."""
    tooling = BareCutter("end mill", Cutter(2, 0.01, np.radians(30.0)))
    path, change = read_tool_path(PROGRAM), question(8000.0, CUTS[0][0], tooling)
    corners: tuple[FloatArray, FloatArray] = np.array([0.0, 0.0, -0.01]), np.array([0.06, 0.04, 0.0])
    found: list[tuple[float, str, str]] = []
    for _ in range(2):  # the second one is compiled
        found = []
        start = time.perf_counter()
        removal = remove_along(tooling, path, field_of(tooling, corners), 1e-3)
        found.append((time.perf_counter() - start, "removal and arcs", f"{len(removal.path) - 1} moves"))
        start = time.perf_counter()
        judged = cuts_along(change, removal.path, removal.engagement, stations_along(change.machine, tooling, removal.path))
        chattering = int(np.count_nonzero(judged.margin < 1.0))
        found.append((time.perf_counter() - start, "margins", f"{judged.groups} different cuts, {chattering} moves chatter"))
        start = time.perf_counter()
        milled = mill_path(change, path, field_of(tooling, corners))
        found.append((time.perf_counter() - start, "march", f"{milled.time.size} turns, {len(milled.chattering)} moves chatter"))
    process = float(path.times[-1])
    return [row(f"paths: {what} of a pocket, time beside the {process:.0f} s of the cut", s, process, "s", told) for s, what, told in found]
