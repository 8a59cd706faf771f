"""What drawings that are only roughly right cost: ten machines whose toolings, forces and sensors differ from what is told.

``python -m benchmarks rough``. The campaigns are those of `benchmarks.rough_machines`. For each tooling that cut, for one that never did
in a holder that cut and for one in another: error of the tooltip, error of the true machine under the drawn tooling (what a tap test of
the machine and a drawing would give), error of the identified machine under the true tooling, and how often the bands hold the truth.
Every finished machine is a line of ``rough.jsonl`` in the scratch folder.
"""

from __future__ import annotations

import argparse
import tempfile
import time
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.comparison import FREQUENCY, coverage, in_deviations, relative_error
from benchmarks.machines import CUT, HELD_OUT
from benchmarks.page import DOCS, append_row, read_rows, write_block, write_rows
from benchmarks.rough_machines import ROUGH, rough_campaign, truth_of
from benchmarks.study import read_cut, warm
from rcsa_ident.identification.evidence import EvidenceSelection
from rcsa_ident.io.curves.tips import read_frf_csv
from rcsa_ident.io.results.identifications import identification_to_json, machine_from_json
from rcsa_ident.io.results.parts import read_result, write_result
from rcsa_ident.io.settings.setups import read_campaign
from rcsa_ident.io.settings.simulations import true_name
from rcsa_ident.stability.tip_modes import TIP
from rcsa_ident.tool_holder.spread import EXACT
from rcsa_ident.workflows.identify import data_of, judge, left_out
from rcsa_ident.workflows.simulate import true_receptances

#: What stands in the table's first column, by the toolings of a machine.
KINDS = {"first": "cut", "second": "cut", "similar": "never cut, same holder", "different": "never cut, other holder"}


def identified(scratch: Path, seed: int, exact: bool) -> dict[str, Any]:
    """Return a row: errors and bands of one machine's toolings.

    `seed`: of the machine
    `exact`: take all drawings for exact, as the package did before it knew of spreads
    """
    warm()
    machine, folder = rough_campaign(scratch, seed)
    campaign = read_campaign(folder)
    if exact:
        campaign = replace(campaign, toolings={name: replace(each, spread=EXACT) for name, each in campaign.toolings.items()})
    begin = time.perf_counter()
    readings = judge(campaign, partial(read_cut, campaign))
    read = time.perf_counter()
    found = EvidenceSelection().run(data_of(campaign, readings), 1)
    done = time.perf_counter()
    path = scratch / "results" / f"rough-{seed}{'-exact' if exact else ''}.json"
    path.parent.mkdir(exist_ok=True)
    write_result(path, identification_to_json(found, campaign, left_out(readings)))
    answer = machine_from_json(read_result(path), str(path))
    omega = 2.0 * np.pi * FREQUENCY
    toolings = {}
    for name in (*CUT, *HELD_OUT):
        setup, true_tooling = machine.true[name]
        drawn = machine.toolings[name]
        told = replace(drawn, spread=EXACT) if exact else drawn
        true = read_frf_csv(truth_of(folder) / "tip" / true_name(name))
        at = np.searchsorted(true.frequency, FREQUENCY - 1e-6)
        under = true_receptances(setup, replace(true_tooling, assembly=drawn.assembly))
        tip, of_true = answer.tip(told, omega), answer.tip(replace(true_tooling, spread=EXACT), omega, spread=False)
        deviation, errors, floor, machines, z = tip.deviation(), [], [], [], []
        for i, row in enumerate(TIP):
            truth = true.values[row.dof.upper()][at]
            here = tip.between(str(row), str(row))
            errors.append(relative_error(here, truth))
            floor.append(relative_error(under.tip[at, i, i], truth))
            machines.append(relative_error(of_true.between(str(row), str(row)), truth))
            z.append(in_deviations(here - truth, deviation[row, row]))
        toolings[name] = {
            "errors": _digits(errors),
            "floor": _digits(floor),
            "machine": _digits(machines),
            "bands": coverage(np.concatenate(z)),
            "same_tool": name in HELD_OUT and drawn.tool_model in {machine.toolings[each].tool_model for each in CUT},
        }
    return {
        "machine": seed,
        "exact": exact,
        "status": str(found.status),
        "reasons": list(found.reasons),
        "modes": [int(axis.modes.omega_n.size) for axis in found.axes.values()],
        "model_error": _digits([axis.model_error for axis in found.axes.values()]),
        "seconds": {"read": round(read - begin, 2), "identify": round(done - read, 2)},
        "toolings": toolings,
    }


def table(rows: Sequence[dict[str, Any]]) -> str:
    """Return the table of all rows, those that took drawings for exact apart."""
    lines = [
        "| toolings | drawings taken as | error: median | worst | true machine under the drawing: median | found machine under the true "
        "tooling: median | 90 % band holds |",
        "|---|---|---|---|---|---|---|",
    ]
    for kind in dict.fromkeys(_kind(name, row["toolings"][name]) for name in KINDS for row in rows):
        for exact in sorted({row["exact"] for row in rows}, reverse=True):
            own = [of for row in rows if row["exact"] is exact for name, of in row["toolings"].items() if _kind(name, of) == kind]
            errors, floor, machines = (np.array([each[key] for each in own]) for key in ("errors", "floor", "machine"))
            bands = np.mean([each["bands"]["90"] for each in own])
            lines.append(
                f"| {kind} | {'exact' if exact else 'rough'} | {np.median(errors):.3f} | {errors.max():.3f} | {np.median(floor):.3f} | "
                f"{np.median(machines):.3f} | {100.0 * bands:.0f} % |"
            )
    return "\n".join(lines)


def _kind(name: str, tooling: Mapping[str, Any]) -> str:
    """The kind of a tooling; in the same holder a tool may be of a model that cut or of another one."""
    if name != "similar":
        return KINDS[name]
    return f"{KINDS[name]}, tool of {'a model that cut' if tooling['same_tool'] else 'another model'}"


def _digits(values: Sequence[float]) -> list[float]:
    return [float(f"{value:.4g}") for value in values]


def main(arguments: Sequence[str]) -> None:
    """Identify the machines, by default the ten of the study."""
    parser = argparse.ArgumentParser(prog="benchmarks rough", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--scratch", type=Path, help="folder of campaigns and results; default: a new temporary one")
    parser.add_argument("--machines", nargs="+", type=int, default=list(ROUGH), help="seeds")
    parser.add_argument("--exact", action="store_true", help="take the drawings for exact, too, as a row of its own")
    parser.add_argument("--page", action="store_true", help="write the table into docs/study.md and docs/study_rough.jsonl")
    given = parser.parse_args(arguments)
    scratch = given.scratch or Path(tempfile.mkdtemp(prefix="rcsa-ident-rough-"))
    scratch.mkdir(parents=True, exist_ok=True)
    path = scratch / "rough.jsonl"
    known = {(row["machine"], row["exact"]): row for row in read_rows(path)}
    for seed in given.machines:
        for exact in (False, True) if given.exact else (False,):
            if (seed, exact) not in known:
                known[seed, exact] = identified(scratch, seed, exact)
                append_row(path, known[seed, exact])
            row = known[seed, exact]
            errors = {name: each["errors"] for name, each in row["toolings"].items()}
            bands = {name: round(each["bands"]["90"], 2) for name, each in row["toolings"].items()}
            print(seed, "exact" if exact else "rough", row["status"], row["seconds"], errors, bands, flush=True)
    rows = [row for (seed, exact), row in known.items() if seed in given.machines and (given.exact or not exact)]
    print(f"\n{table(rows)}")
    if given.page:
        write_rows(DOCS / "study_rough.jsonl", rows)
        write_block("rough", table(rows))
