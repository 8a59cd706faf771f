"""Identifications of machines that lack one ideal each: does the status say so, do the bands hold, is the cause named?

``python -m benchmarks ideals``. Ten drawn machines (`benchmarks.machines`), 20 speeds with each of two toolings, no trigger, exact
drawings, nothing told; of each one ideal is taken away at half the level at which it was first tried: the sensor looks behind the flange,
the bearings warm up with speeds in order or at random, the force follows a curve of the chip while its straight line is told, or the
joint gives way with amplitude and is clamped anew. Bearings that warm up are tried without a clock, with it, and with a thermometer;
`all` is sensor, bearings, chip law and joint together, with half an hour of warm-up before each tooling and random order.
Errors of the tip are those of `benchmarks.comparison`, against the warm machine at 14 000 rev/min.

Seeds: 7301 to 7310 for the figures, 7101 to 7103 for development; fixed on 2026-11-27, before anything of them was simulated. (7001 to 7008
with no ideal taken away, and 7201 to 7210 had been looked at while `identification.causes` was written.)
"""

from __future__ import annotations

import argparse
import tempfile
import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from threadpoolctl import threadpool_limits

from benchmarks.comparison import FREQUENCY, coverage, in_deviations, relative_error
from benchmarks.machines import random_machine
from benchmarks.page import append_row, read_rows
from benchmarks.study import read_cut, warm
from rcsa_ident.front.samples import simulate_campaign
from rcsa_ident.identification.evidence import EvidenceSelection
from rcsa_ident.identification.result import Identification
from rcsa_ident.io.results.identifications import identification_to_json, machine_from_json
from rcsa_ident.io.results.parts import read_result, write_result
from rcsa_ident.io.settings.machines import STEADY, MachineFile, read_machine
from rcsa_ident.io.settings.setups import read_campaign, read_tooling
from rcsa_ident.setup.campaign import Campaign
from rcsa_ident.setup.cut import Workpiece
from rcsa_ident.signals.measurement import Reading
from rcsa_ident.stability.tip_modes import TIP
from rcsa_ident.virtual.changes import AMBIENT, REFERENCE_SPEED, Changes, ChipLaw, JointChanges, Turn, Warming, changed
from rcsa_ident.workflows.identify import identify, judge, left_out
from rcsa_ident.workflows.simulate import true_receptances

EVALUATION, DEVELOPMENT = tuple(range(7301, 7311)), (7101, 7102, 7103)
SPEEDS = 20
#: Of a thermometer near the front bearings, from the cold machine to the warm one [K].
RISE = 18.0
#: An error above which an answer must not be called converged.
LARGEST = 0.05
#: What the codes of remarks name.
CAUSES = {
    "sensor-distance": "distance",
    "distance-untold": "distance",
    "drifts-with-time": "time",
    "drifts-with-temperature": "temperature",
    "changes-with-speed": "speed",
    "force-orders": "order",
    "force-scales": "scale",
    "clamped-anew": "clamping",
    "joint-gives-way": "clamping",
}
KINDS, KEYS = ("cut", "same", "other"), ("machine", "ideal", "level", "told")


@dataclass(frozen=True, slots=True)
class Ideal:
    """What is taken away, and the cause that should be named in first place.

    `cause`: empty: none
    `seen_at` [m]
    `soft` [-]: factor on the flange joint's stiffness
    `clock`: whether the campaign tells when the cuts of a machine that warms up were made
    """

    cause: str = ""
    seen_at: float = 0.0
    changes: Changes = STEADY
    soft: float = 1.0
    clock: bool = False

    @property
    def bends(self) -> bool:
        """Whether the force follows a curve of the chip."""
        return self.changes.chip_law is not None


def ideals(level: float) -> dict[str, Ideal]:
    """Return them at a level; 1 is that at which they were first tried."""
    in_order, bent, joint = Warming(0.08 * level), ChipLaw(-0.25 * level), JointChanges(0.05 * level, 1e-7, 0.06 * level)
    warmed_up = replace(in_order, shuffled=True, warm_up=1800.0)
    return {
        "none": Ideal(),
        "sensor": Ideal("distance", seen_at=30e-3 * level),
        "warming in order": Ideal("time", changes=Changes(in_order)),
        "warming at random": Ideal("time", changes=Changes(replace(in_order, shuffled=True))),
        "warming, with a clock": Ideal("time", changes=Changes(in_order), clock=True),
        "warming, with a thermometer": Ideal("temperature", changes=Changes(replace(in_order, rise=RISE)), clock=True),
        "chip law": Ideal("order", changes=Changes(chip_law=bent)),
        "joint": Ideal("clamping", changes=Changes(joint=joint), soft=0.25),
        "all": Ideal(seen_at=30e-3 * level, changes=Changes(warmed_up, joint, bent), soft=0.25),
    }


def straight(workpiece: Workpiece, law: ChipLaw, feed: float) -> Workpiece:
    """Return the workpiece that is told of a curved law: its least squares line from a tenth of the feed to the feed."""
    chip = np.linspace(0.1 * feed, feed, 50)
    curve = chip * (chip / law.thickness) ** law.exponent
    slope, edge = np.polyfit(chip, curve, 1)
    known = workpiece.coefficients
    more = edge * known.tangential
    lined = replace(
        known,
        tangential=slope * known.tangential,
        tangential_edge=known.tangential_edge + more,
        radial_edge=known.radial_edge + known.radial_ratio * more,
    )
    return replace(workpiece, coefficients=lined)


def machine_without(seed: int, ideal: Ideal, folder: Path) -> MachineFile:
    """Return a drawn machine without an ideal; its files are written into the folder unless they are there."""
    path = folder / "machine" / "machine.toml"
    machine = read_machine(path if path.is_file() else random_machine(seed, path.parent))
    joint = replace(
        machine.spindle.joint,
        translational_stiffness=ideal.soft * machine.spindle.joint.translational_stiffness,
        rotational_stiffness=ideal.soft * machine.spindle.joint.rotational_stiffness,
    )
    speeds = np.linspace(machine.plan.spindle_speeds[0], machine.plan.spindle_speeds[-1], SPEEDS)
    return replace(
        machine,
        spindle=replace(machine.spindle, seen_at=ideal.seen_at, joint=joint),
        sensors=replace(machine.sensors, trigger=False),
        plan=replace(machine.plan, spindle_speeds=tuple(speeds.tolist())),
        changes=ideal.changes,
    )


def campaign_of(scratch: Path, seed: int, name: str, level: float, told: bool) -> tuple[MachineFile, Campaign, list[Reading]]:
    """Return the machine, its campaign with what is told of it, and the verdicts; simulated where that is not done yet."""
    ideal = ideals(level)[name]
    machine = machine_without(seed, ideal, scratch / str(seed))
    folder = scratch / str(seed) / f"{_file_name(name)}-{level:g}"
    if not (folder / "campaign.toml").is_file():
        simulate_campaign(machine, folder, seed)
    campaign = read_campaign(folder)
    if not told:
        campaign = replace(campaign, sensors=tuple(replace(each, distance=None) for each in campaign.sensors))
    if not ideal.clock:
        campaign = replace(campaign, cuts=tuple(replace(each, started=None) for each in campaign.cuts))
    law = ideal.changes.chip_law
    if law is not None:
        campaign = replace(campaign, workpiece=straight(campaign.workpiece, law, machine.plan.feed_per_tooth))
    return machine, campaign, judge(campaign, lambda cut: read_cut(campaign, cut))


def _file_name(ideal: str) -> str:
    return ideal.replace(",", "").replace(" ", "-")


def warm_machine(machine: MachineFile) -> MachineFile:
    """Return the machine as it is once it is warm, its joint as drawn."""
    turn = Turn(0, 0, 0.0, (1.0,) * len(machine.spindle.bearings))
    warm_only = replace(machine.changes, joint=None)
    return replace(machine, spindle=changed(machine.spindle, warm_only, turn, 0.0))


def errors_of(found: Identification, campaign: Campaign, machine: MachineFile, path: Path) -> dict[str, Any]:
    """Return errors and band coverage of the tips, as ``cut``, ``same`` and ``other`` holder."""
    write_result(path, identification_to_json(found, campaign, []))
    answer, truth = machine_from_json(read_result(path), str(path)), warm_machine(machine)
    # by a thermometer the warm machine is that of the warmest cut
    standing = answer.at_temperature(None if answer.thermometer is None else AMBIENT + RISE).at(REFERENCE_SPEED)
    omega = 2.0 * np.pi * FREQUENCY
    rows: dict[str, Any] = {}
    for kind, paths in zip(KINDS, (machine.toolings, *((each,) for each in machine.truth_toolings)), strict=True):
        errors, z = [], []
        for tool in paths:
            tooling = read_tooling(tool)
            true = true_receptances(truth, tooling, REFERENCE_SPEED)
            at = np.searchsorted(true.frequency_hz, FREQUENCY - 1e-6)
            tip = standing.tip(tooling, omega)
            deviation = tip.deviation()
            for i, row in enumerate(TIP):
                here = tip.between(str(row), str(row))
                errors.append(relative_error(here, true.tip[at, i, i]))
                if (row, row) in deviation:
                    z.append(in_deviations(here - true.tip[at, i, i], deviation[row, row]))
        rows[kind] = {"error": float(f"{max(errors):.4g}"), "band": coverage(np.concatenate(z))["90"] if z else None}
    return rows


def identified(scratch: Path, seed: int, name: str, level: float, told: bool = False) -> dict[str, Any]:
    """Return the row of one machine without one ideal."""
    warm()
    # small matrices: on a machine with other work further threads make it slower forty times
    with threadpool_limits(1):
        machine, campaign, readings = campaign_of(scratch, seed, name, level, told)
        began = time.process_time()
        found = identify(campaign, readings, EvidenceSelection(), 1)
        seconds = time.process_time() - began
    return {
        "machine": seed,
        "ideal": name,
        "level": level,
        "told": told,
        "status": str(found.status),
        "reasons": [f"{each.code}: {each}" for each in (*found.reasons, *found.notes)],
        "modes": [int(axis.modes.omega_n.size) for axis in found.axes.values()],
        "unexplained": [float(f"{axis.model_error:.4g}") for axis in found.axes.values()],
        "left_out": len(left_out(readings)),
        "seconds": round(seconds, 1),
        **errors_of(found, campaign, machine, scratch / str(seed) / f"{_file_name(name)}-{level:g}.json"),
    }


def named(row: dict[str, Any], cause: str) -> bool:
    """Whether the first cause that is said of a run, as a reason or as learned, is this one; an untold distance is asked for."""
    said = [reason.partition(":")[0] for reason in row["reasons"]]
    return next((CAUSES[code] for code in said if code in CAUSES), "") == cause


def table(rows: Sequence[dict[str, Any]]) -> str:
    """Return a line for each ideal that was taken away."""
    lines = [
        "| taken away | runs | error cut / same / other holder: median | worst | 90 % bands hold | converged | ... with an error above "
        f"{LARGEST:g} | cause named first | seconds |",
        "|---|---|---|---|---|---|---|---|---|",
    ]
    for name, ideal in ideals(1.0).items():
        own = [row for row in rows if row["ideal"] == name]
        if not own:
            continue
        errors = np.array([[row[kind]["error"] for kind in KINDS] for row in own])
        bands = np.mean([[row[kind]["band"] for kind in KINDS] for row in own])
        converged = [row["status"] == "converged" for row in own]
        wrong = sum(fine and bool(worst > LARGEST) for fine, worst in zip(converged, errors.max(axis=1), strict=True))
        middle = " / ".join(f"{value:.3f}" for value in np.median(errors, axis=0))
        first = f"{sum(named(row, ideal.cause) for row in own)} of {len(own)}" if ideal.cause else "-"
        lines.append(
            f"| {name} | {len(own)} | {middle} | {errors.max():.3f} | {100.0 * bands:.0f} % | {sum(converged)} | {wrong} | {first} | "
            f"{np.median([row['seconds'] for row in own]):.1f} |"
        )
    return "\n".join(lines)


def main(arguments: Sequence[str]) -> None:
    """Run the machines and print the table."""
    parser = argparse.ArgumentParser(prog="benchmarks ideals", description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--scratch", type=Path, help="folder of campaigns and results; default: a new temporary one")
    parser.add_argument("--machines", nargs="+", type=int, default=list(EVALUATION), help="seeds")
    parser.add_argument("--ideals", nargs="+", choices=tuple(ideals(1.0)), default=list(ideals(1.0)))
    parser.add_argument("--level", type=float, default=0.5, help="1 is that at which each was first tried")
    parser.add_argument("--told", action="store_true", help="the campaign tells where the sensors look")
    given = parser.parse_args(arguments)
    scratch = given.scratch or Path(tempfile.mkdtemp(prefix="rcsa-ident-ideals-"))
    scratch.mkdir(parents=True, exist_ok=True)
    path = scratch / "ideals.jsonl"
    known = {tuple(row[key] for key in KEYS): row for row in read_rows(path)}
    rows = []
    for name in given.ideals:
        for seed in given.machines:
            key = (seed, name, given.level, given.told)
            if key not in known:
                known[key] = identified(scratch, *key)
                append_row(path, known[key])
            rows.append(known[key])
            told = {kind: known[key][kind] for kind in KINDS}
            print(seed, name, known[key]["status"], told, known[key]["reasons"][:1], flush=True)
    print(f"\n{table(rows)}")
