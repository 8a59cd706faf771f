"""Recommended cuts on machines and toolings that are only roughly known: do they hold what their sentence promises?

``python -m benchmarks rough_recommendation --scratch F``. Machines, drawings and results are those of ``benchmarks rough`` in the same
scratch folder. For each of a machine's four toolings, two that cut and two that never did, cuts are drawn by chance as in ``benchmarks
recommendation``. What is recommended comes from the identified machine, the drawn tooling and the told coefficients alone; the truth is
the growth of a small disturbance in the true machine with the true tooling and coefficients, held at the middle of the asked speeds.
Cases of one machine share its errors: the interval is that of machines drawn again with replacement.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.machines import CUT, HELD_OUT
from benchmarks.page import DOCS, append_row, read_rows, write_block, write_rows
from benchmarks.recommendation import DEEPEST, FEED, Truth, drawn_cut
from benchmarks.rough import KINDS
from benchmarks.rough_machines import ROUGH, rough_machine
from rcsa_ident.cutting.coefficients import CuttingCoefficients
from rcsa_ident.cutting.conditions import CuttingConditions
from rcsa_ident.io.results.identifications import machine_from_json
from rcsa_ident.io.results.parts import read_result
from rcsa_ident.io.settings.machines import MachineFile
from rcsa_ident.machine.machine import TipSource
from rcsa_ident.setup.cut import CutSpec
from rcsa_ident.setup.tooling import Tooling
from rcsa_ident.virtual.reduction import poles, reduced
from rcsa_ident.virtual.rotor import rotor
from rcsa_ident.workflows.advise import advise
from rcsa_ident.workflows.tool_change import ToolChange

#: Cuts of each tooling, and the draws of machines behind the interval.
CUTS, AGAIN = 5, 2000


def case(
    answer: TipSource, drawn: Tooling, told: CuttingCoefficients, setup: MachineFile, tooling: Tooling, rng: np.random.Generator
) -> dict[str, Any]:
    """Return what is recommended for a random cut of a tooling, and what is true of it.

    `answer`: what was identified of the machine
    `drawn`, `told`: the tooling as drawn, and the coefficients that are told
    `setup`, `tooling`: machine and tooling as they are
    `rng`: draws the cut
    """
    engagement, feed_angle, speeds = drawn_cut(rng)
    cut = CutSpec(engagement, feed_angle, FEED, None, {"tangential": told.tangential, "radial_ratio": told.radial_ratio})
    advice = advise(ToolChange(answer, drawn, cut, speeds, DEEPEST))
    dynamics = poles(reduced(rotor(setup.spindle, tooling.assembly)), 0.5 * float(speeds[0] + speeds[-1]))
    truth = Truth(dynamics, tooling, CuttingConditions(1.0, 1.0, FEED, engagement, feed_angle), setup.workpiece.coefficients)
    deep = [point for point in advice.recommended if np.isfinite(point.depth)]
    return {
        "recommended": truth.of(deep[0]) if deep else None,
        "dominates": str(advice.band),
    }


def table(rows: Sequence[Mapping[str, Any]]) -> str:
    """Return how many recommendations hold and how deep they go, by kind of tooling and in all."""
    rng = np.random.default_rng(1)
    lines = [
        "| toolings | recommended cuts | stable over ±1 % of speed (90 % interval over machines) | depth over the true limit there, median "
        "(10 %, 90 %) |",
        "|---|---|---|---|",
    ]
    for kind in (*dict.fromkeys(KINDS.values()), "all"):
        own = [row for row in rows if row["recommended"] is not None and kind in ("all", KINDS[row["tooling"]])]
        if not own:
            continue
        holds, shares = (np.array([row["recommended"][key] for row in own], dtype=float) for key in ("holds", "share"))
        seeds = np.array([row["machine"] for row in own])
        machines = np.unique(seeds)
        sums, counts = (np.array([np.sum(of[seeds == seed]) for seed in machines]) for of in (holds, np.ones(seeds.size)))
        drawn = rng.integers(machines.size, size=(AGAIN, machines.size))
        low, high = np.quantile(sums[drawn].sum(axis=1) / counts[drawn].sum(axis=1), (0.05, 0.95))
        tenth, median, most = np.quantile(shares, (0.1, 0.5, 0.9))
        lines.append(
            f"| {kind} | {len(own)} | {100.0 * holds.mean():.1f} % ({100.0 * low:.0f} to {100.0 * high:.0f} %) | "
            f"{median:.2f} ({tenth:.2f}, {most:.2f}) |"
        )
    return "\n".join(lines)


def main(arguments: Sequence[str]) -> None:
    """Run the cases and print their table."""
    parser = argparse.ArgumentParser(
        prog="benchmarks rough_recommendation", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--scratch", type=Path, required=True, help="folder in which `benchmarks rough` has left its results")
    parser.add_argument("--machines", nargs="+", type=int, default=list(ROUGH), help="seeds")
    parser.add_argument("--cuts", type=int, default=CUTS, help="of each tooling")
    parser.add_argument("--page", action="store_true", help="write the table into docs/study.md and docs/study_rough_recommendation.jsonl")
    given = parser.parse_args(arguments)
    path = given.scratch / "rough_recommendation.jsonl"
    known = {(row["machine"], row["tooling"], row["cut"]): row for row in read_rows(path)}
    for seed in given.machines:
        machine, found = rough_machine(given.scratch, seed), given.scratch / "results" / f"rough-{seed}.json"
        answer = machine_from_json(read_result(found), str(found)).kept()
        for place, name in enumerate((*CUT, *HELD_OUT)):
            for k in range(given.cuts):
                if (seed, name, k) in known:
                    continue
                told, rng = machine.told.workpiece.coefficients, np.random.default_rng([seed, place, k])
                row = {"machine": seed, "cut": k, "tooling": name} | case(answer, machine.toolings[name], told, *machine.true[name], rng)
                known[seed, name, k] = row
                append_row(path, row)
                print(json.dumps(row), flush=True)
    rows = [row for (seed, _, cut), row in known.items() if seed in given.machines and cut < given.cuts]
    print(f"\n{table(rows)}")
    if given.page:
        write_rows(DOCS / "study_rough_recommendation.jsonl", rows)
        write_block("rough_recommendation", table(rows))
