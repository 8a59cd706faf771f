"""Stability limits from the identification against the virtual machine's own, in the time domain.

``python -m benchmarks lobes_truth --scratch DIR``. The truth is the growth of a small disturbance in the time march of the full
reduced machine at the spindle speed, its softening and gyroscopic moments included (`rcsa_ident.virtual.limit`). Beside it stand
limits by zero-order and by multi-frequency lobes, from the true tip receptances (the error of the method alone) and from the
identified ones, for the toolings that never cut. Depths are compared where the truth changes by less than 20 % over +-1 % of
speed; the share of speeds left out is told. On coupled machines the limits are also those that the direct receptances alone give.
Random cuts with depths from half to twice the true limit, even in the logarithm, at
any speed, are classed stable or not. Machines, campaigns and results are those of ``python -m benchmarks study`` in the same
scratch folder; what is missing there is made. True limits are kept there, too.
"""

from __future__ import annotations

import argparse
import hashlib
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.machines import CONDITIONS, named
from benchmarks.page import append_row, read_rows
from benchmarks.study import Run, machine_of, perform
from rcsa_ident.base.arrays import FloatArray
from rcsa_ident.base.errors import InputError
from rcsa_ident.cutting.conditions import CuttingConditions
from rcsa_ident.cutting.process import MillingProcess
from rcsa_ident.dynamics.coordinates import Coordinate, Dof
from rcsa_ident.dynamics.receptance import Receptance
from rcsa_ident.dynamics.uncertain import UncertainReceptance
from rcsa_ident.identification.machine import IdentifiedMachine
from rcsa_ident.io.results.identifications import machine_from_json
from rcsa_ident.io.results.parts import read_result
from rcsa_ident.io.settings.machines import MachineFile
from rcsa_ident.io.settings.setups import read_tooling
from rcsa_ident.setup.tooling import Tooling
from rcsa_ident.stability.lobes import stability_lobes
from rcsa_ident.stability.methods import StabilityMethod
from rcsa_ident.stability.multi_frequency import MultiFrequency
from rcsa_ident.stability.result import StabilityLobes
from rcsa_ident.stability.zero_order import ZeroOrder
from rcsa_ident.virtual.limit import STEP, multiplier, true_limit
from rcsa_ident.virtual.milling import mill_cut
from rcsa_ident.virtual.reduction import Poles, ReducedRotor, poles, reduced
from rcsa_ident.virtual.rotor import rotor

RPM = np.pi / 30.0
#: Speeds per tooling, where around each the truth is looked at, and the change beyond which a speed is left out.
SPEEDS, AROUND, STEEP = 24, (0.99, 0.995, 1.0, 1.005, 1.01), 0.2
#: Random cuts over all machines and toolings, the range of their depths in true limits, machines drawn from each posterior.
CUTS, DEPTHS, DRAWS = 200, (0.5, 2.0), 100
#: Frequencies [Hz] of the receptances, and the depth beyond which a cut is taken to be stable [m].
FREQUENCY, DEEPEST = np.arange(20.0, 6000.1, 2.0), 30e-3
#: A depth at which every cut is stable [m].
SHALLOWEST = 5e-5
#: Error of the depth that is aimed for.
AIM = 0.05
METHODS: dict[str, StabilityMethod] = {"zero-order": ZeroOrder(), "multi-frequency": MultiFrequency()}
#: What the names of limits without cross terms end with.
DIRECT_ALONE = ", without cross terms"
#: Tooth periods of a simulated cut, and those at its end that are compared with as many before them.
TEETH, LAST = 300, 30


@dataclass(slots=True)
class Truth:
    """A tooling on a virtual machine. `kept`: where true limits are written to and read from."""

    setup: MachineFile
    tooling: Tooling
    kept: Path
    model: ReducedRotor = field(init=False)
    known: dict[float, float] = field(init=False)

    def __post_init__(self) -> None:
        self.model = reduced(rotor(self.setup.spindle, self.tooling.assembly))
        self.known = {row["speed_rpm"]: float(row["limit"]) for row in read_rows(self.kept)}

    def dynamics(self, speed: float) -> Poles:
        """Return the machine at a spindle speed [rad/s]."""
        return poles(self.model, speed)

    def conditions(self, speed: float, depth: float = 0.0) -> CuttingConditions:
        """Return the plan's cut at another speed and depth."""
        return replace(self.setup.plan.conditions(speed), axial_depth=depth)

    def limit(self, speed: float) -> float:
        """Return the depth at which a cut loses stability [m]; infinite beyond `DEEPEST`."""
        key = round(speed / RPM, 6)
        if key not in self.known:
            arguments = (self.dynamics(speed), self.tooling.cutter, self.conditions(speed), self.setup.workpiece.coefficients)
            found = true_limit(*arguments, (SHALLOWEST, DEEPEST)).depth
            self.known[key] = found
            append_row(self.kept, {"speed_rpm": key, "limit": str(found)})
        return self.known[key]

    def stable(self, speed: float, depth: float) -> bool:
        """Return whether a small disturbance of a cut dies away."""
        cut = self.conditions(speed, depth)
        return abs(multiplier(self.dynamics(speed), self.tooling.cutter, cut, self.setup.workpiece.coefficients)) < 1.0

    def settles(self, speed: float, depth: float) -> bool:
        """Return whether a cut comes to repeat itself from tooth to tooth: simulated from its start, with teeth that leave it."""
        cut, cutter = self.conditions(speed, depth), self.tooling.cutter
        period = 2.0 * np.pi / (cutter.teeth * speed)
        count = int(np.ceil(period / STEP))
        history = mill_cut(self.dynamics(speed), cutter, cut, self.setup.workpiece.coefficients, period / count, TEETH * count)
        change = np.abs(np.diff(history.tip.reshape(TEETH, -1), axis=0)).max(axis=1)
        last, before = change[-LAST:].max(), change[-2 * LAST : -LAST].max()
        return bool(last < 1e-3 * cut.feed_per_tooth or last < 0.8 * before)

    def tip(self, speed: float) -> Receptance:
        """Return the true receptance at a speed, with cross terms."""
        names = tuple(Coordinate("tip", axis) for axis in (Dof.X, Dof.Y))
        machine = self.dynamics(speed)
        rows = [[str(c) for c in machine.coordinates].index(str(c)) for c in names]
        return Receptance(2.0 * np.pi * FREQUENCY, machine.response(2.0 * np.pi * FREQUENCY)[:, rows], names, names)


@dataclass(slots=True)
class Found:
    """A tooling on an identified machine."""

    machine: IdentifiedMachine
    tooling: Tooling
    alone: UncertainReceptance | None = None

    def tip(self, speed: float) -> UncertainReceptance:
        """Return the tip's receptance at a speed, with its spread."""
        if self.machine.speed_range is not None:
            return self.machine.at(speed).tip(self.tooling, 2.0 * np.pi * FREQUENCY)
        if self.alone is None:
            self.alone = self.machine.tip(self.tooling, 2.0 * np.pi * FREQUENCY)
        return self.alone


def asked(truth: Truth, tip: Receptance, speed: float, method: StabilityMethod, draws: int) -> StabilityLobes:
    """Return the limit at one speed."""
    plan, known = truth.setup.plan, truth.setup.workpiece.coefficients
    process = MillingProcess(truth.tooling.cutter, known, plan.engagement, plan.feed_angle)
    return stability_lobes(tip, process, np.array([speed]), DEEPEST, method, draws)


def compare(truth: Truth, found: Found, rng: np.random.Generator, cuts: int) -> dict[str, Any]:
    """Return true and computed limits [m] at speeds drawn one from each of `SPEEDS` even intervals, and the classed cuts."""
    low, high = min(truth.setup.plan.spindle_speeds), max(truth.setup.plan.spindle_speeds)
    speeds = low + (high - low) * (np.arange(SPEEDS) + rng.random(SPEEDS)) / SPEEDS
    around = np.array([[truth.limit(share * speed) for share in AROUND] for speed in speeds])
    limits: dict[str, list[float]] = {}
    for speed in speeds:
        for name, lobes in _limits(truth, found, speed):
            limits.setdefault(name, []).append(float(lobes.limit_depth[0]))
    drawn = [_cut(truth, found, low + (high - low) * rng.random(), rng) for _ in range(cuts)]
    return {
        "speeds_rpm": (speeds / RPM).tolist(),
        "true": around[:, len(AROUND) // 2].tolist(),
        "change": (np.ptp(around, axis=1) / around[:, len(AROUND) // 2]).tolist(),
        "limits": limits,
        "cuts": drawn,
    }


def _limits(truth: Truth, found: Found, speed: float, draws: int = 0) -> Iterator[tuple[str, StabilityLobes]]:
    true, identified = truth.tip(speed), found.tip(speed)
    for name, method in METHODS.items():
        yield f"true receptance, {name}", asked(truth, true, speed, method, 0)
        yield f"identified, {name}", asked(truth, identified, speed, method, draws)
        if truth.setup.spindle.coupled:
            yield f"true receptance, {name}{DIRECT_ALONE}", asked(truth, _direct(true), speed, method, 0)
            yield f"identified, {name}{DIRECT_ALONE}", asked(truth, _direct(identified), speed, method, 0)


def _direct(tip: Receptance) -> Receptance:
    """The receptance without its cross terms and its spread."""
    return Receptance(tip.omega, tip.values * np.eye(len(tip.rows)), tip.rows, tip.cols)


def _cut(truth: Truth, found: Found, speed: float, rng: np.random.Generator) -> dict[str, Any]:
    """One random cut: what is true, what each method says, and how probable the posterior calls it."""
    limit = truth.limit(speed)
    depth = min(limit * float(np.exp(rng.uniform(*np.log(DEPTHS)))), 0.999 * DEEPEST)
    row = {"rpm": speed / RPM, "depth": depth, "limit": limit, "stable": truth.stable(speed, depth), "settles": truth.settles(speed, depth)}
    limits = dict(_limits(truth, found, speed, DRAWS))
    said = {name: bool(depth < lobes.limit_depth[0]) for name, lobes in limits.items()}
    return row | {"said": said, "probability": {name: limits[f"identified, {name}"].probability(0, depth) for name in METHODS}}


def evaluate(scratch: Path, machine: str, condition: str, seed: int, cuts: int) -> list[dict[str, Any]]:
    """Return a row for each of the machine's toolings that never cut."""
    setup = machine_of(scratch, machine)
    run = Run(machine, condition, "default", seed)
    path = scratch / "results" / f"{machine}-{condition}-default-{seed}.json"
    if not path.exists():
        perform(scratch, run)
    data = read_result(path)
    identified = machine_from_json(data, str(path))
    rows = []
    for place, file in enumerate(setup.truth_toolings):
        tooling = read_tooling(file)
        # a machine that is drawn anew has limits of its own
        known, plan = setup.workpiece.coefficients, setup.plan
        what = repr((setup.spindle, known.tangential, known.radial_ratio, plan.engagement, plan.feed_angle))
        digest = hashlib.sha256(what.encode() + file.read_bytes()).hexdigest()[:12]
        kept = scratch / "true_limits" / f"{machine}-{file.stem}-{digest}.jsonl"
        kept.parent.mkdir(exist_ok=True)
        # speeds and cuts are those of the machine and the tooling, whatever was identified
        rng = np.random.default_rng([sum(machine.encode()), place])
        row = compare(Truth(setup, tooling, kept), Found(identified, tooling), rng, cuts)
        rows.append({"machine": machine, "condition": condition, "seed": seed, "tooling": file.stem, "status": data["status"], **row})
        print(line(rows[-1]), flush=True)
    return rows


def errors_of(row: Mapping[str, Any], name: str, steep: bool = False) -> FloatArray:
    """Return |limit / true - 1| where the truth is not steep, or where it is; an infinite limit has an infinite error."""
    true, limit = np.array(row["true"], dtype=float), np.array(row["limits"][name], dtype=float)
    kept = ((np.array(row["change"]) >= STEEP) == steep) & np.isfinite(true)
    return np.abs(limit[kept] / true[kept] - 1.0)


def line(row: Mapping[str, Any]) -> str:
    """Return a tooling in one line: median and worst error of each way, and the cuts classed right."""
    parts = []
    for name in row["limits"]:
        error = errors_of(row, name)
        right = sum(cut["said"][name] == cut["stable"] for cut in row["cuts"])
        parts.append(f"{name} {np.median(error):.3f} {error.max():.3f} cuts {right}/{len(row['cuts'])}")
    kept = errors_of(row, name).size
    return f"{row['machine']:>6} {row['tooling']:<10} {row['status']:<9} {kept}/{len(row['true'])} speeds; " + "; ".join(parts)


def table(rows: Sequence[Mapping[str, Any]]) -> str:
    """Return the summary over all machines and toolings, a line for each way to the limit."""
    kept = sum(errors_of(row, "identified, zero-order").size for row in rows)
    total = sum(len(row["true"]) for row in rows)
    cuts = [cut for row in rows for cut in row["cuts"]]
    lines = [
        f"{total} speeds of {len(rows)} toolings that never cut; at {total - kept} ({100.0 * (1.0 - kept / total):.0f} %) the true limit "
        f"changes by {100.0 * STEEP:.0f} % or more over +-1 % of speed: left out. {len(cuts)} random cuts.",
        "",
        "| limit from | median error | 90 % | worst | within 5 % | where it is steep | cuts classed right | wrong, 5-95 % probable |",
        "|---|---|---|---|---|---|---|---|",
    ]
    for name in dict.fromkeys(name for row in rows for name in row["limits"]):
        # limits without cross terms are those of coupled machines only
        having = [row for row in rows if name in row["limits"]]
        error = np.concatenate([errors_of(row, name) for row in having])
        asked_for = [cut for row in having for cut in row["cuts"]]
        right = [cut["said"][name] == cut["stable"] for cut in asked_for]
        spread = name.startswith("identified") and not name.endswith(DIRECT_ALONE)
        wrong = [cut["probability"][name.split(", ")[1]] for cut, r in zip(asked_for, right, strict=True) if not r]
        open_ = [p for p in wrong if p is not None and 0.05 <= p <= 0.95] if spread else None
        quantiles = " | ".join(f"{100.0 * q:.2f} %" for q in (np.median(error), np.quantile(error, 0.9), error.max()))
        doubtful = "-" if open_ is None else f"{len(open_)} of {len(wrong)}"
        steep = np.concatenate([errors_of(row, name, steep=True) for row in having])
        share = " | ".join(f"{100.0 * np.mean(e < AIM):.1f} %" if e.size else "-" for e in (error, steep))
        lines.append(f"| {name} | {quantiles} | {share} | {sum(right)} of {len(right)} | {doubtful} |")
    agree = np.mean([cut["settles"] == cut["stable"] for cut in cuts])
    lines += ["", f"Simulated from their start, with teeth that leave the cut, {100.0 * agree:.1f} % of the cuts end as the growth says."]
    return "\n".join(lines)


def run(scratch: Path, machines: Sequence[str], condition: str = "no-trigger", seed: int = 1, cuts: int = CUTS) -> list[dict[str, Any]]:
    """Return the rows of all machines; the cuts are spread evenly over machines and toolings."""
    scratch.mkdir(parents=True, exist_ok=True)
    toolings = sum(len(machine_of(scratch, name).truth_toolings) for name in machines)
    rows = []
    for name in machines:
        try:
            rows += evaluate(scratch, name, condition, seed, -(-cuts // toolings))
        except InputError as error:
            # a failed identification has no limits
            print(f"{name}: {error}", flush=True)
    return rows


def main(arguments: Sequence[str]) -> None:
    """Run the comparison and print its table."""
    parser = argparse.ArgumentParser(
        prog="benchmarks lobes_truth", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--scratch", type=Path, help="folder of campaigns and results of the study; default: a new temporary one")
    parser.add_argument("--machines", nargs="+", default=["drawn"], help="as of the study (default: drawn)")
    parser.add_argument("--condition", choices=tuple(CONDITIONS), default="no-trigger")
    parser.add_argument("--seed", type=int, default=1, help="of the search")
    parser.add_argument("--cuts", type=int, default=CUTS)
    given = parser.parse_args(arguments)
    scratch = given.scratch or Path(tempfile.mkdtemp(prefix="rcsa-ident-study-"))
    rows = run(scratch, named(given.machines), given.condition, given.seed, given.cuts)
    if rows:
        print(f"\n{table(rows)}")
