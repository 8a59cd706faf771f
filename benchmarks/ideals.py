"""Identifications of machines that lack one ideal each: does the status say so, do the bands hold, is the cause named?

``python -m benchmarks ideals``. Ten drawn machines (`benchmarks.machines`), 20 speeds with each of two toolings, no trigger, exact
drawings, nothing told; of each one ideal is taken away at half the level at which it was first tried: the sensor looks behind the flange,
the bearings warm up with speeds in order or at random, the force follows a curve of the chip while its straight line is told, or the
joint gives way with amplitude and is clamped anew. Bearings that warm up are tried without a clock, with it, and with a thermometer;
`all` is sensor, bearings, chip law and joint together, with half an hour of warm-up before each tooling and random order; with rough
drawings toolings, coefficients, sensors and depths are those of `benchmarks.rough_machines`, too.
Errors of the tip are those of `benchmarks.comparison`, against the warm machine at 14 000 rev/min.

Seeds: 7301 to 7310 for the figures, 7101 to 7103 for development; fixed on 2026-11-27, before anything of them was simulated. (7001 to
7008 with no ideal taken away, and 7201 to 7210 had been looked at while `identification.causes` was written. That a spindle may have turned
before the first cut was seen on 7307 and 7305, `all`.)
"""

from __future__ import annotations

import argparse
import itertools
import tempfile
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from threadpoolctl import threadpool_limits

from benchmarks.comparison import FREQUENCY, coverage, in_deviations, relative_error
from benchmarks.machines import CUT, random_machine
from benchmarks.page import append_row, read_rows
from benchmarks.rough_machines import RoughMachine, as_seen, rough_machine
from benchmarks.rough_recommendation import case as recommended_cut
from benchmarks.rough_recommendation import table as recommended_table
from benchmarks.study import read_cut, warm
from rcsa_ident.identification.evidence import EvidenceSelection
from rcsa_ident.identification.machine import IdentifiedMachine
from rcsa_ident.io.results.identifications import identification_to_json, machine_from_json
from rcsa_ident.io.results.parts import read_result, write_result
from rcsa_ident.io.settings.machines import STEADY, MachineFile, read_machine
from rcsa_ident.io.settings.setups import read_campaign, read_tooling
from rcsa_ident.io.settings.simulations import write_simulation
from rcsa_ident.setup.campaign import Campaign
from rcsa_ident.setup.cut import Workpiece
from rcsa_ident.setup.tooling import Tooling
from rcsa_ident.signals.measurement import Reading
from rcsa_ident.stability.tip_modes import TIP
from rcsa_ident.virtual.changes import AMBIENT, REFERENCE_SPEED, Changes, ChipLaw, JointChanges, Turn, Warming, changed, course_of
from rcsa_ident.workflows.identify import identify, judge, left_out
from rcsa_ident.workflows.simulate import simulate, true_flange, true_receptances

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
KINDS, KEYS = ("cut", "same", "other"), ("machine", "ideal", "level", "told", "search")


@dataclass(frozen=True, slots=True)
class Ideal:
    """What is taken away, and the cause that should be named in first place.

    `cause`: empty: none
    `seen_at` [m]
    `soft` [-]: factor on the flange joint's stiffness
    `clock`: whether the campaign tells when the cuts of a machine that warms up were made
    `rough`: whether toolings, coefficients, sensors and depths are those of `benchmarks.rough_machines`, too
    """

    cause: str = ""
    seen_at: float = 0.0
    changes: Changes = STEADY
    soft: float = 1.0
    clock: bool = False
    rough: bool = False


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
        "all": (every := Ideal(seen_at=30e-3 * level, changes=Changes(warmed_up, joint, bent), soft=0.25)),
        "all, with a clock": replace(every, clock=True),
        "all, with a thermometer": replace(every, clock=True, changes=replace(every.changes, warming=replace(warmed_up, rise=RISE))),
        "all, with a clock, rough drawings": replace(every, clock=True, rough=True),
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


@dataclass(frozen=True, slots=True)
class Case:
    """A machine that lacks an ideal.

    `told`, `setup`: the machine that is told, and the one that cuts
    `drawn`, `true`: mapping of name to Tooling, as told and as they are: those that cut, one in the same holder, one in another
    `rough`: whose sensors see its cuts; None where they are as told
    """

    told: MachineFile
    setup: MachineFile
    drawn: Mapping[str, Tooling]
    true: Mapping[str, Tooling]
    rough: RoughMachine | None = None

    @property
    def kinds(self) -> dict[str, Sequence[str]]:
        """Names of the toolings by their kind."""
        *cut, same, other = self.drawn
        return dict(zip(KINDS, (cut, (same,), (other,)), strict=True))

    @property
    def warm(self) -> MachineFile:
        """The machine as it is once it is warm, its joint as drawn."""
        return self._as(replace(self.setup.changes, joint=None), np.ones(len(self.setup.spindle.bearings)), 0.0)

    def cutting(self, seed: int) -> MachineFile:
        """Return the machine as it was in its cuts on average: as warm, its joint so clamped, half of what it gives way."""
        changes, toolings = self.setup.changes, range(len(self.kinds["cut"]))
        turns = course_of(self.setup.plan, self.setup.spindle, changes, len(toolings), seed)
        clamping = 0.0 if changes.joint is None else float(np.mean([changes.joint.clamping(seed, each) for each in toolings]))
        return self._as(changes, np.mean([turn.warmth for turn in turns], axis=0), clamping)

    def _as(self, changes: Changes, warmth: np.ndarray, clamping: float) -> MachineFile:
        turn = Turn(0, 0, 0.0, tuple(warmth.tolist()))
        amplitude = 0.0 if changes.joint is None else changes.joint.amplitude
        return replace(self.setup, spindle=changed(self.setup.spindle, changes, turn, clamping, amplitude))

    def simulated(self, folder: Path, seed: int) -> None:
        """Write its campaign into a folder."""
        cut = self.kinds["cut"]
        cuts = simulate(self.setup, [self.true[name] for name in cut], seed)
        if self.rough is not None:
            cuts = (as_seen(self.rough, each) for each in cuts)
        write_simulation(folder, self.told, [self.drawn[name] for name in cut], cuts, (), true_flange(self.setup), seed=seed)


def case_of(seed: int, ideal: Ideal, scratch: Path) -> Case:
    """Return a drawn machine without an ideal; its files are written into the scratch folder unless they are there."""
    if ideal.rough:
        rough = rough_machine(scratch, seed)
        setup, true = rough.true[CUT[0]][0], {name: tooling for name, (_, tooling) in rough.true.items()}
        return Case(_without(rough.told, ideal), _without(setup, ideal), rough.toolings, true, rough)
    path = scratch / str(seed) / "machine" / "machine.toml"
    machine = _without(read_machine(path if path.is_file() else random_machine(seed, path.parent)), ideal)
    toolings = {tool.stem: read_tooling(tool) for tool in (*machine.toolings, *machine.truth_toolings)}
    return Case(machine, machine, toolings, toolings)


def _without(machine: MachineFile, ideal: Ideal) -> MachineFile:
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


def campaign_of(scratch: Path, seed: int, name: str, level: float, told: bool) -> tuple[Case, Campaign, list[Reading]]:
    """Return the machine, its campaign with what is told of it, and the verdicts; simulated where that is not done yet."""
    ideal = ideals(level)[name]
    case = case_of(seed, ideal, scratch)
    folder = scratch / str(seed) / f"{_file_name(name)}-{level:g}"
    if not (folder / "campaign.toml").is_file():
        case.simulated(folder, seed)
    campaign = read_campaign(folder)
    if not told:
        campaign = replace(campaign, sensors=tuple(replace(each, distance=None) for each in campaign.sensors))
    if not ideal.clock:
        campaign = replace(campaign, cuts=tuple(replace(each, started=None) for each in campaign.cuts))
    law = ideal.changes.chip_law
    if law is not None:
        campaign = replace(campaign, workpiece=straight(campaign.workpiece, law, case.told.plan.feed_per_tooth))
    return case, campaign, judge(campaign, lambda cut: read_cut(campaign, cut))


def _file_name(ideal: str) -> str:
    return ideal.replace(",", "").replace(" ", "-")


def answer_of(path: Path) -> IdentifiedMachine:
    """Return the machine of a result as it stands at `REFERENCE_SPEED`, warm: by a thermometer that of the warmest cut."""
    answer = machine_from_json(read_result(path), str(path))
    return answer.at_temperature(None if answer.thermometer is None else AMBIENT + RISE)


def errors_of(case: Case, path: Path) -> dict[str, Any]:
    """Return errors and band coverage of the tips of a result, as ``cut``, ``same`` and ``other`` holder."""
    standing, truth = answer_of(path).at(REFERENCE_SPEED), case.warm
    omega = 2.0 * np.pi * FREQUENCY
    rows: dict[str, Any] = {}
    for kind, names in case.kinds.items():
        errors, z = [], []
        for name in names:
            true = true_receptances(truth, case.true[name], REFERENCE_SPEED)
            at = np.searchsorted(true.frequency_hz, FREQUENCY - 1e-6)
            tip = standing.tip(case.drawn[name], omega)
            deviation = tip.deviation()
            for i, row in enumerate(TIP):
                here = tip.between(str(row), str(row))
                errors.append(relative_error(here, true.tip[at, i, i]))
                if (row, row) in deviation:
                    z.append(in_deviations(here - true.tip[at, i, i], deviation[row, row]))
        rows[kind] = {"error": float(f"{max(errors):.4g}"), "band": coverage(np.concatenate(z))["90"] if z else None}
    return rows


def other_state(case: Case, seed: int) -> list[float]:
    """Return by how much the tips of the machine as it was in its cuts differ from those of the warm one, for each kind of tooling.

    An identification that knew the first exactly would be wrong by that.
    """
    found = []
    for names in case.kinds.values():
        pairs = [
            [true_receptances(each, case.true[name], REFERENCE_SPEED).tip for each in (case.cutting(seed), case.warm)] for name in names
        ]
        found.append(max(relative_error(there[:, i, i], warm[:, i, i]) for there, warm in pairs for i in range(len(TIP))))
    return found


def result_path(scratch: Path, seed: int, name: str, level: float, search: int = 1) -> Path:
    """Return where the result of a run lies."""
    return scratch / str(seed) / f"{_file_name(name)}-{level:g}{'' if search == 1 else f'-seed-{search}'}.json"


def identified(scratch: Path, seed: int, name: str, level: float, told: bool = False, search: int = 1) -> dict[str, Any]:
    """Return the row of one machine without one ideal. `search`: seed of the search."""
    warm()
    # small matrices: on a machine with other work further threads make it slower forty times
    with threadpool_limits(1):
        case, campaign, readings = campaign_of(scratch, seed, name, level, told)
        began = time.process_time()
        found = identify(campaign, readings, EvidenceSelection(), search)
        seconds = time.process_time() - began
        path = result_path(scratch, seed, name, level, search)
        write_result(path, identification_to_json(found, campaign, []))
    return {
        "machine": seed,
        "ideal": name,
        "level": level,
        "told": told,
        "search": search,
        "status": str(found.status),
        "reasons": [f"{each.code}: {each}" for each in (*found.reasons, *found.notes)],
        "modes": [int(axis.modes.omega_n.size) for axis in found.axes.values()],
        "unexplained": [float(f"{axis.model_error:.4g}") for axis in found.axes.values()],
        "left_out": len(left_out(readings)),
        "seconds": round(seconds, 1),
        **errors_of(case, path),
    }


def recommendation(scratch: Path, seed: int, name: str, level: float, number: int) -> dict[str, Any]:
    """Return what the identified machine recommends for a cut of the tooling in the other holder, and what is true of it.

    The truth holds the straight line of the force: disturbances grow by its slope. `number`: of the cut, which is drawn by chance
    """
    case = case_of(seed, ideals(level)[name], scratch)
    tooling, law, truth = case.kinds["other"][0], case.setup.changes.chip_law, case.warm
    if law is not None:
        truth = replace(truth, workpiece=straight(truth.workpiece, law, truth.plan.feed_per_tooth))
    told = truth.workpiece.coefficients if case.rough is None else case.told.workpiece.coefficients
    rng = np.random.default_rng([seed, 3, number])
    answer = answer_of(result_path(scratch, seed, name, level)).kept()
    found = recommended_cut(answer, case.drawn[tooling], told, truth, case.true[tooling], rng)
    return {"machine": seed, "ideal": name, "level": level, "cut": number, "tooling": "different"} | found


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


def by_machine(rows: Sequence[dict[str, Any]]) -> str:
    """Return a line for each machine: what the seed of the search changes."""
    lines = [
        "| machine, taken away | runs | error cut / same / other holder: median | least | worst | 90 % bands hold (least) | converged |",
        "|---|---|---|---|---|---|---|",
    ]
    for seed, name in dict.fromkeys((row["machine"], row["ideal"]) for row in rows):
        own = [row for row in rows if (row["machine"], row["ideal"]) == (seed, name)]
        errors, bands = (np.array([[row[kind][key] for kind in KINDS] for row in own], dtype=float) for key in ("error", "band"))
        middle, least, most = (" / ".join(f"{value:.3f}" for value in of(errors, axis=0)) for of in (np.median, np.min, np.max))
        held, converged = f"{100 * bands.mean():.0f} % ({100 * bands.min():.0f})", sum(row["status"] == "converged" for row in own)
        lines.append(f"| {seed}, {name} | {len(own)} | {middle} | {least} | {most} | {held} | {converged} |")
    return "\n".join(lines)


def main(arguments: Sequence[str]) -> None:
    """Run the machines and print the table."""
    parser = argparse.ArgumentParser(prog="benchmarks ideals", description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--scratch", type=Path, help="folder of campaigns and results; default: a new temporary one")
    parser.add_argument("--machines", nargs="+", type=int, default=list(EVALUATION), help="seeds")
    parser.add_argument("--ideals", nargs="+", choices=tuple(ideals(1.0)), default=list(ideals(1.0)))
    parser.add_argument("--level", type=float, default=0.5, help="1 is that at which each was first tried")
    parser.add_argument("--told", action="store_true", help="the campaign tells where the sensors look")
    parser.add_argument("--recommend", type=int, default=0, metavar="CUTS", help="of the tooling in the other holder of each machine")
    parser.add_argument("--searches", type=int, default=1, help="seeds of the search of each run; the table holds all of them")
    given = parser.parse_args(arguments)
    scratch = given.scratch or Path(tempfile.mkdtemp(prefix="rcsa-ident-ideals-"))
    scratch.mkdir(parents=True, exist_ok=True)
    path = scratch / "ideals.jsonl"
    known = {tuple(row[key] for key in KEYS): row for row in read_rows(path)}
    rows = []
    for name, seed, search in itertools.product(given.ideals, given.machines, range(1, given.searches + 1)):
        key = (seed, name, given.level, given.told, search)
        if key not in known:
            known[key] = identified(scratch, *key)
            append_row(path, known[key])
        rows.append(known[key])
        told = {kind: known[key][kind] for kind in KINDS}
        print(seed, name, search, known[key]["status"], told, known[key]["reasons"][:1], flush=True)
    print(f"\n{table(rows)}")
    if given.searches > 1:
        print(f"\n{by_machine(rows)}")
    for name in (each for each in given.ideals if ideals(given.level)[each].changes.of_the_machine):
        apart = [other_state(case_of(seed, ideals(given.level)[name], scratch), seed) for seed in given.machines]
        middle = " / ".join(f"{value:.3f}" for value in np.median(apart, axis=0))
        print(f"{name}: the machine as it was in its cuts differs from the warm one by {middle} in the median, {np.max(apart):.3f} at most")
    for name in given.ideals if given.recommend else ():
        path = scratch / f"{_file_name(name)}-{given.level:g}-recommended.jsonl"
        known = {(row["machine"], row["cut"]): row for row in read_rows(path)}
        for seed, number in itertools.product(given.machines, range(given.recommend)):
            if (seed, number) not in known:
                known[seed, number] = recommendation(scratch, seed, name, given.level, number)
                append_row(path, known[seed, number])
        print(f"\n{name}\n\n{recommended_table(list(known.values()))}")
