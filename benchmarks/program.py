"""A program of many different cuts on an identified machine: margins with their bands, in seconds, and how true the bands are.

``python -m benchmarks program RESULT.json TOOL.toml [--cuts 10000] [--draws 200] [--processes 1 2]``. Each move has an engagement, a
direction and a depth of its own, drawn by a seed: up- and down-milling from 3 % of the diameter to a slot, and one in ten in two layers.
Any number of processes must give the same answer to the last digit. Some cuts next to the limit stand beside the limits of lobes, which
ask the period map of every drawn machine.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from threadpoolctl import threadpool_limits

from rcsa_ident.base.units import from_rpm
from rcsa_ident.front.processes import workers
from rcsa_ident.io.results.identifications import machine_from_json
from rcsa_ident.io.results.parts import read_result
from rcsa_ident.io.settings.setups import read_tooling
from rcsa_ident.setup.cut import CutSpec
from rcsa_ident.stability.discretisation import FullDiscretisation
from rcsa_ident.stability.margins import FARTHEST, HELD
from rcsa_ident.toolpath.engagement import PathEngagement
from rcsa_ident.toolpath.path import ToolPath
from rcsa_ident.workflows.paths.stability import DRAWS, CutsAlong, cuts_along, plain, stations_along
from rcsa_ident.workflows.tool_change import ToolChange

#: Of the cuts: share in two layers, depth in the middle [m] and the spread of its logarithm; feed per tooth [m], spindle speed [rev/min].
LAYERED, DEPTH, SPREAD, FEED, SPEED = 0.1, 1.5e-3, 0.5, 5e-5, 12000.0


def program(cuts: int, teeth: int, seed: int = 1) -> tuple[ToolPath, PathEngagement]:
    """Return a path of so many different cuts, and where the tool is in the material on each of its moves."""
    rng = np.random.default_rng(seed)
    way = rng.uniform(-np.pi, np.pi, cuts)
    places = np.concatenate([np.zeros((1, 3)), np.cumsum(1e-3 * np.stack([np.cos(way), np.sin(way), 0.0 * way], axis=1), axis=0)])
    depth = DEPTH * np.exp(SPREAD * rng.standard_normal(cuts))
    layered, up = rng.random(cuts) < LAYERED, rng.random((cuts, 2)) < 0.5
    arc = np.arccos(1.0 - 2.0 * np.exp(rng.uniform(np.log(0.03), 0.0, (cuts, 2))))
    arc[~layered, 1], up[~layered, 1] = arc[~layered, 0], up[~layered, 0]
    start, end = np.where(up, 0.0, np.pi - arc), np.where(up, arc, np.pi)
    height = np.stack([0.25 * depth, 0.75 * depth], axis=1)
    feed = np.full(cuts + 1, FEED * teeth * from_rpm(SPEED) / (2.0 * np.pi))
    extent = np.stack([0.0 * depth, depth], axis=1)
    engaged = PathEngagement(
        np.repeat(np.arange(cuts), 2), height.ravel(), start.ravel(), end.ravel(), extent, np.zeros(cuts), 1e-9 * np.ones(cuts)
    )
    return ToolPath(places, feed=feed, speed=np.full(cuts + 1, from_rpm(SPEED))), engaged


def main(arguments: Sequence[str]) -> None:
    """Print seconds, and what of the margins chatters, may chatter and is far from it."""
    parser = argparse.ArgumentParser(prog="benchmarks program", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("result", type=Path, metavar="RESULT.json")
    parser.add_argument("tooling", type=Path, metavar="TOOL.toml")
    parser.add_argument("--cuts", type=int, default=10_000)
    parser.add_argument("--draws", type=int, default=DRAWS)
    parser.add_argument("--processes", type=int, nargs="+", default=[1, 2], help="numbers of processes, one run each")
    parser.add_argument(
        "--looked-at", type=int, default=40, help="doubtful cuts whose drawn machines are all asked by their own period maps"
    )
    given = parser.parse_args(arguments)
    tooling, machine = read_tooling(given.tooling), machine_from_json(read_result(given.result), str(given.result))
    spec = CutSpec(feed_per_tooth=FEED, coefficients={"tangential": 8e8, "radial_ratio": 0.3})
    change = ToolChange(machine, tooling, spec, np.array([from_rpm(SPEED)]), 1.0, FullDiscretisation(), given.draws)
    with threadpool_limits(1):
        path, engaged = program(given.cuts, tooling.cutter.teeth)
        first: CutsAlong | None = None
        for processes in given.processes:
            with workers(processes, ("rcsa_ident.workflows.paths.judged_cuts",)) as pool:
                start = time.perf_counter()
                found = cuts_along(change, path, engaged, stations_along(machine, tooling, path), map_=pool.map)
                print(f"{processes} processes: {time.perf_counter() - start:.1f} s, {told(found)}", flush=True)
            first = first or found
            assert all(np.array_equal(getattr(first, name), getattr(found, name), equal_nan=True) for name in ("margin", "margin_low"))
        if first is not None and given.looked_at:
            print(looked_at(change, engaged, path, first, given.looked_at))


def looked_at(change: ToolChange, engaged: PathEngagement, path: ToolPath, found: CutsAlong, most: int) -> str:
    """Return how far margins and lower margins next to one are from those of the lobes' own search, with all drawn machines."""
    near = np.flatnonzero((np.abs(found.margin_low - 1.0) < 0.2) & ~found.of_strength)[:most]
    apart = []
    for move in near.tolist():
        engagement = engaged.at(move)
        assert engagement is not None
        arc, depth = plain(engagement, change.tooling.cutter)
        angle = float(np.arctan2(*path.moves[move, 1::-1]))
        one = replace(change, cut=replace(change.cut, engagement=arc, feed_angle=angle, feed_per_tooth=float(found.feed_per_tooth[move])))
        lobes = one.limits(max_depth=FARTHEST * depth)
        both = np.array([lobes.limit_depth[0], lobes.limit_quantile(HELD)[0]]) / depth
        apart.append(np.abs(np.array([found.margin[move], found.margin_low[move]]) / both - 1.0))
    (margin, low), (most_margin, most_low) = np.median(apart, axis=0), np.max(apart, axis=0)
    apart_by = f"margins differ by {margin:.1e} (at most {most_margin:.1e}), lower ones by {low:.1e} ({most_low:.1e})"
    return f"{near.size} cuts next to one, beside lobes with {change.draws} drawn machines' period maps: {apart_by}"


def told(found: CutsAlong) -> str:
    """Return the numbers of cuts by their margins."""
    low, margin = found.margin_low[found.cutting], found.margin[found.cutting]
    counts = np.count_nonzero(margin < 1.0), np.count_nonzero((margin >= 1.0) & (low < 1.0)), np.count_nonzero(margin >= FARTHEST)
    return f"{found.groups} different cuts; {counts[0]} chatter, {counts[1]} more may, {counts[2]} are at {FARTHEST:g} or beyond"
