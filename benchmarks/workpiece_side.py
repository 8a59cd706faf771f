"""Stability limits on machines whose table gives way, with accelerometers on it and without.

``python -m benchmarks workpiece_side``. Each machine is a drawn one (development seeds by default) whose table has a mode along X and one
along Y, 300 to 900 Hz, 5 to 20 N/um, 2 to 6 % damping, drawn by a seed of their own. Its campaign is that of the study without trigger,
with a pair of accelerometers on the table and cuts so shallow that none chatters. The identification is asked for limits of the
toolings that cut, of those that never did, and of these with a stickout that is a quarter shorter, stiffer beside the table; once as it is
and once as if nobody had looked at the table, which leaves the spindle's side as it is, to the last bit. The truth is full discretisation
on the poles of the machine's own equations and the table's modes together.
"""

from __future__ import annotations

import argparse
import tempfile
from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.lobes_truth import STEEP
from benchmarks.machines import CUT, HELD_OUT, MARGIN, true_tip, under
from benchmarks.page import append_row, read_rows, write_block
from benchmarks.study import machine_of, read_cut
from rcsa_ident.base.arrays import FloatArray
from rcsa_ident.base.units import from_hz, to_hz, to_rpm
from rcsa_ident.cutting.process import MillingProcess
from rcsa_ident.dynamics.receptance import Receptance
from rcsa_ident.front.samples import simulate_campaign
from rcsa_ident.identification.evidence import EvidenceSelection
from rcsa_ident.identification.machine import IdentifiedMachine
from rcsa_ident.identification.result import Identification
from rcsa_ident.io.settings.machines import MachineFile
from rcsa_ident.io.settings.setups import read_campaign, read_tooling
from rcsa_ident.io.settings.stickouts import read_stickouts
from rcsa_ident.setup.cut import CutSpec
from rcsa_ident.setup.tooling import Tooling
from rcsa_ident.stability.discretisation import FullDiscretisation
from rcsa_ident.stability.lobes import stability_lobes
from rcsa_ident.stability.tip_modes import TipModes
from rcsa_ident.virtual.reduction import poles, reduced
from rcsa_ident.virtual.rotor import rotor
from rcsa_ident.virtual.workpiece_side import SideMode, VirtualWorkpieceSide
from rcsa_ident.workflows.identify import identify, judge
from rcsa_ident.workflows.tool_change import ToolChange

#: Seeds of the machines that this was developed on.
SEEDS = (501, 502, 503)
#: Speeds for each tooling, and the depth beyond which a cut is taken to be stable [m].
SPEEDS, DEEPEST = 24, 20e-3
#: Share of the true limit by which one may be too deep before it is told.
TOO_DEEP = 1.05
#: Stickout of the short toolings, over that of those that never cut.
SHORT = 0.75
#: Which toolings a row of the table is of.
KINDS = {"that cut": CUT, "that never cut": HELD_OUT, "that never cut, a quarter shorter": tuple(f"{name}, short" for name in HELD_OUT)}
BLOCK = "workpiece side"


def drawn_table(seed: int) -> VirtualWorkpieceSide:
    """Return the table of a machine: one mode along each axis."""
    rng = np.random.default_rng([seed, 13])

    def mode() -> SideMode:
        return SideMode(from_hz(rng.uniform(300.0, 900.0)), rng.uniform(0.02, 0.06), float(np.exp(rng.uniform(*np.log([5e6, 20e6])))))

    return VirtualWorkpieceSide((mode(),), (mode(),))


def machine_with_table(scratch: Path, seed: int) -> MachineFile:
    """Return a drawn machine on its table, with cuts that are stable there by the study's margin (zero-order limit)."""
    machine = replace(under(machine_of(scratch, str(seed)), "no-trigger"), workpiece_side=drawn_table(seed))
    plan, least = machine.plan, np.inf
    speeds = np.linspace(0.99 * min(plan.spindle_speeds), 1.01 * max(plan.spindle_speeds), 2000)
    for path in machine.toolings:
        tooling = read_tooling(path)
        lobes = stability_lobes(_relative(machine, true_tip(machine, tooling)), _process(machine, tooling), speeds, 1.0)
        least = min(least, float(lobes.limit_depth.min()))
    return replace(machine, plan=replace(plan, axial_depth=min(plan.axial_depth, least / MARGIN)))


def _relative(machine: MachineFile, tip: Receptance) -> Receptance:
    assert machine.workpiece_side is not None
    return Receptance(tip.omega, tip.values + machine.workpiece_side.receptance(tip.omega), tip.rows, tip.cols)


def _process(machine: MachineFile, tooling: Tooling) -> MillingProcess:
    return MillingProcess(tooling.cutter, machine.workpiece.coefficients, machine.plan.engagement, machine.plan.feed_angle)


def identified(scratch: Path, machine: MachineFile, seed: int) -> Identification:
    """Return the identification of the machine's campaign, from its files."""
    folder = scratch / f"{seed}" / "workpiece-side"
    if not folder.is_dir():
        simulate_campaign(machine, folder, seed)
    campaign = read_campaign(folder)
    return identify(campaign, judge(campaign, partial(read_cut, campaign)), EvidenceSelection(), 1)


def true_limits(machine: MachineFile, tooling: Tooling, speeds: FloatArray) -> FloatArray:
    """Return the limits of tool and table together, shape (n,) [m]; the machine as it is at each speed."""
    assert machine.workpiece_side is not None
    model, found = reduced(rotor(machine.spindle, tooling.assembly)), []
    for speed in speeds.tolist():
        whole = machine.workpiece_side.under(poles(model, speed))
        tip = [[str(c) for c in whole.coordinates].index(f"tip.{axis}") for axis in "xy"]
        modes = TipModes(whole.pole, whole.outputs[tip], whole.inputs, np.zeros((2, 2)))
        found.append(FullDiscretisation().lobes(modes, _process(machine, tooling), np.array([speed]), DEEPEST).limit_depth[0])
    return np.array(found)


def limits(machine: IdentifiedMachine, setup: MachineFile, tooling: Tooling, speeds: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the limits that users are told, shape (n,), and the ends of their 95 % band, shape (2, n) [m]."""
    plan, known = setup.plan, setup.workpiece.coefficients
    cut = CutSpec(plan.engagement, plan.feed_angle, coefficients={"tangential": known.tangential, "radial_ratio": known.radial_ratio})
    found = ToolChange(machine, tooling, cut, speeds, DEEPEST, FullDiscretisation()).fitting_limits(speeds).lobes
    band = np.full((2, speeds.size), np.nan) if found.band is None else np.array(found.band)
    return found.limit_depth, band


def toolings(setup: MachineFile) -> list[tuple[str, Tooling]]:
    """Return the toolings by what they are to the identification."""
    drawn = [read_tooling(path) for path in (*setup.toolings, *setup.truth_toolings)]
    stickouts = [[SHORT * each.assembly.stickout] for each in drawn[len(CUT) :]]
    short = [read_stickouts(path, own)[0] for path, own in zip(setup.truth_toolings, stickouts, strict=True)]
    return list(zip((name for names in KINDS.values() for name in names), (*drawn, *short), strict=True))


def compare(setup: MachineFile, found: Identification, seed: int) -> list[dict[str, Any]]:
    """Return a row for each tooling: true limits, and those with and without the table's modes."""
    rows, rng = [], np.random.default_rng([seed, 17])
    low, high = min(setup.plan.spindle_speeds), max(setup.plan.spindle_speeds)
    with_table = found.machine
    for name, tooling in toolings(setup):
        speeds = low + (high - low) * (np.arange(SPEEDS) + rng.random(SPEEDS)) / SPEEDS
        around = np.array([true_limits(setup, tooling, share * speeds) for share in (0.99, 1.0, 1.01)])
        row: dict[str, Any] = {"seed": seed, "tooling": name, "status": str(found.status), "speeds_rpm": to_rpm(speeds).tolist()}
        row |= {"true": around[1].tolist(), "change": (np.ptp(around, axis=0) / around[1]).tolist()}
        for case, machine in (("with", with_table), ("without", replace(with_table, workpiece_side=None))):
            depth, band = limits(machine, setup, tooling, speeds)
            row |= {case: depth.tolist(), f"{case} band": band.tolist()}
        rows.append(row)
        print(line(row), flush=True)
    return rows


def _kept(row: dict[str, Any], case: str) -> tuple[FloatArray, FloatArray]:
    """Limits over the true ones, and whether these lie in the band, where the truth is not steep."""
    true = np.array(row["true"])
    kept = (np.array(row["change"]) < STEEP) & np.isfinite(true)
    low, high = np.array(row[f"{case} band"])[:, kept]
    return np.array(row[case])[kept] / true[kept], (low <= true[kept]) & (true[kept] <= high)


def line(row: dict[str, Any]) -> str:
    """Return a tooling in one line."""
    parts = []
    for case in ("with", "without"):
        ratio, _ = _kept(row, case)
        parts.append(f"{case} the table's modes: median {np.median(np.abs(ratio - 1.0)):.3f} worst {np.abs(ratio - 1.0).max():.3f}")
    return f"{row['seed']} {row['tooling']:<16} {row['status']}; " + "; ".join(parts)


def table(rows: Sequence[dict[str, Any]]) -> str:
    """Return the summary over all machines, toolings that cut and others apart."""
    count, total = sum(_kept(row, "with")[0].size for row in rows), sum(len(row["true"]) for row in rows)
    seeds = dict.fromkeys(row["seed"] for row in rows)
    lines = [
        f"{len(seeds)} machines, {total} limits; at {total - count} the true limit changes by {100 * STEEP:.0f} % or more over ±1 % of "
        "speed, or is beyond what was looked at: left out.",
        "",
        "| toolings | table | median error | 90 % | worst | too deep by 5 % or more | truth in the 95 % band |",
        "|---|---|---|---|---|---|---|",
    ]
    for kind, names in KINDS.items():
        for case, words in (("with", "accelerometers on it"), ("without", "no sensor on it")):
            found = [_kept(row, case) for row in rows if row["tooling"] in names]
            ratio, inside = (np.concatenate(each) for each in zip(*found, strict=True))
            error = np.abs(ratio - 1.0)
            cells = " | ".join(f"{100.0 * value:.1f} %" for value in (np.median(error), np.quantile(error, 0.9), error.max()))
            lines.append(f"| {kind} | {words} | {cells} | {np.sum(ratio > TOO_DEEP)} of {ratio.size} | {100.0 * np.mean(inside):.0f} % |")
    return "\n".join(lines)


def told(setup: MachineFile, found: Identification, seed: int) -> dict[str, Any]:
    """Return the table's true modes beside those that were found."""
    assert setup.workpiece_side is not None
    rows = {}
    for axis, each in ({} if found.workpiece_side is None else found.workpiece_side.axes).items():
        true = setup.workpiece_side.x if axis == "x" else setup.workpiece_side.y
        rows[axis.upper()] = {
            "true": [[to_hz(mode.natural_frequency), mode.damping_ratio, mode.stiffness] for mode in true],
            "found": np.stack([to_hz(each.omega_n), each.zeta, each.stiffness], axis=1).tolist(),
            "std": np.stack([to_hz(each.deviations[0]), *each.deviations[1:]], axis=1).tolist(),
            "lines": each.lines,
            "chi2_per_point": each.chi2_per_point,
            "model_error": each.model_error,
        }
    return {"seed": seed, "depth": setup.plan.axial_depth, "cuts": len(found.cut_ids), "modes": rows}


def modes_table(rows: Sequence[dict[str, Any]]) -> str:
    """Return the tables' modes, true and found."""
    lines = ["| machine | axis | true: Hz | ζ % | N/µm | found: Hz | ζ % | N/µm |", "|---|---|---|---|---|---|---|---|"]
    for row in rows:
        for axis, each in row["modes"].items():
            true = ["; ".join(f"{size * mode[k]:.4g}" for mode in each["true"]) for k, size in enumerate((1.0, 1e2, 1e-6))]
            pairs = list(zip(each["found"], each["std"], strict=True))
            found = ["; ".join(f"{size * m[k]:.4g} ± {size * s[k]:.2g}" for m, s in pairs) for k, size in enumerate((1.0, 1e2, 1e-6))]
            lines.append(f"| {row['seed']} | {axis} | " + " | ".join([*true, *found]) + " |")
    return "\n".join(lines)


def main(arguments: Sequence[str]) -> None:
    """Run the comparison and print its tables."""
    parser = argparse.ArgumentParser(
        prog="benchmarks workpiece_side", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--scratch", type=Path, help="folder of campaigns and results; default: a new temporary one")
    parser.add_argument("--seeds", nargs="+", type=int, default=SEEDS, help="of the machines")
    parser.add_argument("--page", action="store_true", help="write the tables of docs/study.md")
    given = parser.parse_args(arguments)
    scratch = given.scratch or Path(tempfile.mkdtemp(prefix="rcsa-ident-study-"))
    scratch.mkdir(parents=True, exist_ok=True)
    path, modes_path = scratch / "workpiece_side.jsonl", scratch / "workpiece_side_modes.jsonl"
    for seed in given.seeds:
        if any(row["seed"] == seed for row in read_rows(modes_path)):
            continue
        setup = machine_with_table(scratch, seed)
        found = identified(scratch, setup, seed)
        for row in compare(setup, found, seed):
            append_row(path, row)
        append_row(modes_path, told(setup, found, seed))
    kept = ([row for row in read_rows(each) if row["seed"] in given.seeds] for each in (path, modes_path))
    rows, modes = (sorted(each, key=lambda row: row["seed"]) for each in kept)
    text = f"{table(rows)}\n\n{modes_table(modes)}"
    print(f"\n{text}")
    if given.page:
        write_block(BLOCK, text)
