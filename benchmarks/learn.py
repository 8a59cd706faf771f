"""One cut or one tap of a new tool: how well its tip is known before, after one slow cut, after three, and after one tap.

``python -m benchmarks learn``. Machines, drawings and truths are those of `benchmarks.rough`, whose results are made where they are not
there; each tooling that never cut makes the slowest stable cut of its machine's plan, and then cuts at three of its speeds; beside that its
tip is hit at standstill along X and Y, 1 nm/N of noise a line of 2 Hz, gains 1 % off (standard deviations). Every
finished row is a line of ``learn.jsonl`` in the scratch folder. *With the machine as it was* takes the learned tooling on the machine of
the first campaign; *as these cuts teach it* on the machine that has learned beside the tooling (the option `--machine` of the command).
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

from benchmarks.comparison import FREQUENCY, coverage, in_deviations, relative_error
from benchmarks.hammer import AXES, GAIN, NOISE
from benchmarks.machines import HELD_OUT
from benchmarks.page import DOCS, append_row, read_rows, write_block, write_rows
from benchmarks.rough import KINDS, identified
from benchmarks.rough_machines import ROUGH, ROUGH_DEVELOPMENT, RoughMachine, rough_campaign, truth_of
from benchmarks.study import read_cut
from rcsa_ident.base.arrays import ComplexArray
from rcsa_ident.identification.hammer_lines import HammerLines
from rcsa_ident.identification.machine import IdentifiedMachine
from rcsa_ident.io.curves.tips import read_frf_csv
from rcsa_ident.io.results.identifications import machine_from_json
from rcsa_ident.io.results.parts import read_result
from rcsa_ident.io.settings.setups import read_campaign
from rcsa_ident.io.settings.simulations import true_name
from rcsa_ident.setup.campaign import Campaign, HammerTest
from rcsa_ident.setup.tooling import Tooling
from rcsa_ident.signals.measurement import Reading
from rcsa_ident.stability.tip_modes import TIP
from rcsa_ident.virtual.rotor import frequency_response, rotor
from rcsa_ident.workflows.identify import hammer_lines, judge
from rcsa_ident.workflows.learn_toolings import learn_toolings

#: Speeds of a plan, and which of them are cut, by their number.
COUNT = 40
CUTS = {"one": (0,), "three": (0, 7, 17)}
#: Columns of the table: what is predicted, and by which machine.
STAGES = {
    "before": "before",
    "one": "one cut, machine as it was",
    "one-taught": "one cut, machine as it teaches",
    "three": "three, machine as it was",
    "three-taught": "three, machine as they teach",
    "tap": "one tap, machine as it was",
    "tap-taught": "one tap, machine as it teaches",
}
#: Frequencies of a tap [rad/s].
TAP = 2.0 * np.pi * np.arange(100.0, 4301.0, 2.0)


def compared(machine: IdentifiedMachine, tooling: Tooling, truth: Path) -> dict[str, Any]:
    """Return errors [X, Y] of a tip and how often its 90 % band holds."""
    omega = 2.0 * np.pi * FREQUENCY
    true = read_frf_csv(truth / "tip" / true_name(tooling.name))
    at = np.searchsorted(true.frequency, FREQUENCY - 1e-6)
    tip = machine.tip(tooling, omega)
    deviation, errors, z = tip.deviation(), [], []
    for row in TIP:
        found, here = tip.between(str(row), str(row)), true.values[row.dof.upper()][at]
        errors.append(float(f"{relative_error(found, here):.4g}"))
        z.append(in_deviations(found - here, deviation[row, row]))
    return {"errors": errors, "band": round(coverage(np.concatenate(z))["90"], 3)}


def learned(scratch: Path, seed: int, name: str) -> dict[str, Any]:
    """Return a row: what is known of one tooling of a machine, stage by stage."""
    path = scratch / "results" / f"rough-{seed}.json"
    if not path.exists():
        identified(scratch, seed, False)
    machine = machine_from_json(read_result(path), str(path))
    drawn, folder = rough_campaign(scratch, seed)
    stages = {"before": compared(machine, drawn.toolings[name], truth_of(folder))}
    notes = []
    for label, speeds in CUTS.items():
        campaign, readings = _stable_cuts(scratch, seed, name, label, speeds)
        found = learn_toolings(machine, campaign, readings)
        tooling = found.toolings[0]
        notes += [note for note in (tooling.contradiction, *found.notes) if note]
        stages[label] = compared(machine, tooling.tooling, truth_of(folder))
        stages[f"{label}-taught"] = compared(found.machine, tooling.tooling, truth_of(folder))
    campaign, tests = tapped(drawn, folder, seed, name)
    found = learn_toolings(machine, campaign, [], tests)
    tooling = found.toolings[0]
    notes += [note for note in (tooling.contradiction, *found.notes) if note]
    stages["tap"] = compared(machine, tooling.tooling, truth_of(folder))
    stages["tap-taught"] = compared(found.machine, tooling.tooling, truth_of(folder))
    return {"machine": seed, "tooling": name, "stages": stages, "notes": notes}


def tapped(drawn: RoughMachine, folder: Path, seed: int, name: str) -> tuple[Campaign, tuple[HammerLines, ...]]:
    """Return a campaign of the hits of one tooling's tip, and their lines."""
    rng = np.random.default_rng([seed, 2, list(drawn.toolings).index(name)])
    setup, true = drawn.true[name]
    model = rotor(setup.spindle, true.assembly)
    read: dict[str, ComplexArray] = {}
    for axis in AXES:
        value = frequency_response(model, TAP, 0.0, (f"tip.{axis}",), (f"tip.{axis}",))[:, 0, 0]
        noise = NOISE * (rng.standard_normal(TAP.size) + 1j * rng.standard_normal(TAP.size))
        read[axis] = (1.0 + GAIN * rng.standard_normal()) * value + noise
    tests = tuple(HammerTest(f"{name} {axis}", name, axis, 0.0, 0.0, Path(axis)) for axis in AXES)
    told = read_campaign(folder)
    campaign = replace(told, toolings={name: drawn.toolings[name]}, cuts=(), tests=tests)
    return campaign, hammer_lines(campaign, lambda test: (TAP / (2.0 * np.pi), read[test.axis]))


def _stable_cuts(scratch: Path, seed: int, name: str, label: str, speeds: tuple[int, ...]) -> tuple[Campaign, list[Reading]]:
    """Return a campaign and what its cuts show; where all of them chatter, as on a shop floor the next speeds are cut."""
    for further in range(COUNT - speeds[-1]):
        own = f"learn-{name}-{label}" + (f"-{further}" if further else "")
        _, folder = rough_campaign(scratch, seed, (name,), own, tuple(speed + further for speed in speeds))
        campaign = read_campaign(folder)
        readings = judge(campaign, partial(read_cut, campaign))
        if any(reading.verdict.usable for reading in readings):
            return campaign, readings
    raise RuntimeError(f"machine {seed}, {name}: no stable cut")


def table(rows: Sequence[dict[str, Any]]) -> str:
    """Return the table of all rows."""
    lines = ["| tooling | known by | error: median | worst | 90 % band holds |", "|---|---|---|---|---|"]
    for name in HELD_OUT:
        for stage, words in STAGES.items():
            own = [row["stages"][stage] for row in rows if row["tooling"] == name]
            errors = np.array([each["errors"] for each in own])
            held = 100.0 * np.mean([each["band"] for each in own])
            lines.append(f"| {KINDS[name]} | {words} | {np.median(errors):.3f} | {errors.max():.3f} | {held:.0f} % |")
    return "\n".join(lines)


def main(arguments: Sequence[str]) -> None:
    """Let machines learn toolings, by default those of development."""
    parser = argparse.ArgumentParser(prog="benchmarks learn", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--scratch", type=Path, help="folder of campaigns and results; default: a new temporary one")
    known = f"seeds, as {ROUGH[0]} to {ROUGH[-1]} of the study; default: those of development"
    parser.add_argument("--machines", nargs="+", type=int, default=list(ROUGH_DEVELOPMENT), help=known)
    parser.add_argument("--page", action="store_true", help="write the table into docs/study.md and docs/study_learn.jsonl")
    given = parser.parse_args(arguments)
    scratch = given.scratch or Path(tempfile.mkdtemp(prefix="rcsa-ident-learn-"))
    scratch.mkdir(parents=True, exist_ok=True)
    path = scratch / "learn.jsonl"
    done = {(row["machine"], row["tooling"]): row for row in read_rows(path)}
    for key in ((seed, name) for seed in given.machines for name in HELD_OUT):
        if key not in done:
            done[key] = learned(scratch, *key)
            append_row(path, done[key])
        print(*key, {stage: (each["errors"], each["band"]) for stage, each in done[key]["stages"].items()}, *done[key]["notes"], flush=True)
    rows = [done[seed, name] for seed in given.machines for name in HELD_OUT]
    print(f"\n{table(rows)}")
    if given.page:
        write_rows(DOCS / "study_learn.jsonl", rows)
        write_block("learn", table(rows))
