"""Recommended cuts against the virtual machine's own time march: do they hold what their sentence promises?

``python -m benchmarks recommendation``. Each case is a drawn machine (seeds of their own, no machine of the study), one of its four
toolings, and a cut drawn by chance: immersion from 5 % to a slot, up or down milling, any feed direction, speeds over a range of its
own. The tip is the true one, so that what is seen is the error of the method and of the recommendation, not of an identification. The
truth is the growth of a small disturbance in the march of the full reduced machine (`rcsa_ident.virtual.limit`), of which the lobes
know nothing. A recommended cut holds where it is stable at its depth over +-1 % of its speed; beside it stands what zero-order limits
alone would have recommended.
"""

from __future__ import annotations

import argparse
import json
import tempfile
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.machines import random_machine, true_tip
from rcsa_ident.base.units import from_rpm, to_rpm
from rcsa_ident.cutting.conditions import CuttingConditions, Engagement
from rcsa_ident.cutting.force import CuttingCoefficients
from rcsa_ident.io.settings.machines import MachineFile, read_machine
from rcsa_ident.io.settings.setups import read_tooling
from rcsa_ident.machine.known_tip import KnownTip
from rcsa_ident.setup.cut import CutSpec
from rcsa_ident.setup.tooling import Tooling
from rcsa_ident.stability.advice import highest_removal
from rcsa_ident.stability.discretisation import FullDiscretisation
from rcsa_ident.stability.lobes import stability_lobes
from rcsa_ident.stability.operating_point import OperatingPoint
from rcsa_ident.virtual.limit import multiplier, true_limit
from rcsa_ident.virtual.reduction import Poles, poles, reduced
from rcsa_ident.virtual.rotor import rotor
from rcsa_ident.workflows.advise import advise
from rcsa_ident.workflows.tool_change import ToolChange

#: Machines have four toolings each; their seeds begin here, far from those of the study.
CASES, FIRST_SEED = 200, 9001
#: Where around the recommended speed a cut has to be stable.
AROUND = (0.99, 0.995, 1.0, 1.005, 1.01)
#: Deepest cut that is asked about [m], and one at which every cut is stable.
DEEPEST, SHALLOWEST = 20e-3, 2e-5
FEED = 1e-4


def drawn_cut(rng: np.random.Generator) -> tuple[Engagement, float, np.ndarray]:
    """Return engagement, feed direction and speeds [rad/s] of a random cut."""
    immersion = 1.0 if rng.random() < 0.15 else float(np.exp(rng.uniform(np.log(0.05), 0.0)))
    engagement = Engagement.from_immersion(immersion, str(rng.choice(["up", "down"])))
    low = rng.uniform(3000.0, 12000.0)
    return engagement, float(rng.uniform(0.0, 2.0 * np.pi)), from_rpm(np.arange(low, low * rng.uniform(1.5, 3.0), 50.0))


@dataclass(frozen=True, slots=True)
class Truth:
    """A cut on a virtual machine, its dynamics held at one speed."""

    dynamics: Poles
    tooling: Tooling
    conditions: CuttingConditions
    coefficients: CuttingCoefficients

    def stable(self, speed: float, depth: float) -> bool:
        """Return whether a small disturbance dies away."""
        cut = replace(self.conditions, spindle_speed=speed, axial_depth=depth)
        return abs(multiplier(self.dynamics, self.tooling.cutter, cut, self.coefficients)) < 1.0

    def limit(self, speed: float) -> float:
        """Return the least depth at which none does [m]; infinite beyond `DEEPEST`."""
        cut = replace(self.conditions, spindle_speed=speed)
        return true_limit(self.dynamics, self.tooling.cutter, cut, self.coefficients, (SHALLOWEST, DEEPEST)).depth

    def of(self, point: OperatingPoint) -> dict[str, Any]:
        """Return how a recommended cut stands: stable over the speed's tolerance, and its depth over the true limit there."""
        speeds = [share * point.spindle_speed for share in AROUND]
        return {
            "rpm": to_rpm(point.spindle_speed),
            "depth_mm": 1e3 * point.depth,
            "holds": all(self.stable(speed, point.depth) for speed in speeds),
            "share": point.depth / min(self.limit(point.spindle_speed), DEEPEST),
            "share_of_least": point.depth / min(min(self.limit(speed) for speed in speeds), DEEPEST),
        }


def case(machine: MachineFile, tooling: Tooling, rng: np.random.Generator) -> dict[str, Any]:
    """Return what is recommended for a random cut, and what is true of it."""
    engagement, feed_angle, speeds = drawn_cut(rng)
    middle, known = 0.5 * float(speeds[0] + speeds[-1]), machine.workpiece.coefficients
    tip = true_tip(machine, tooling, middle)
    cut = CutSpec(engagement, feed_angle, FEED, None, {"tangential": known.tangential, "radial_ratio": known.radial_ratio})
    change = ToolChange(KnownTip(tip), tooling, cut, speeds, DEEPEST)
    began = time.process_time()
    advice = advise(change)
    seconds = time.process_time() - began
    dynamics = poles(reduced(rotor(machine.spindle, tooling.assembly)), middle)
    truth = Truth(dynamics, tooling, CuttingConditions(1.0, 1.0, FEED, engagement, feed_angle), known)
    row: dict[str, Any] = {"seconds": seconds, "modes": dynamics.pole.size, "agrees": None}
    for name, points in (("recommended", advice.recommended), ("zero-order", highest_removal(advice.usable, change.process))):
        # where nothing limits the cut no depth is recommended
        deep = [point for point in points if np.isfinite(point.depth)]
        row[name] = truth.of(deep[0]) if deep else None
    if row["recommended"] is not None:
        best = next(point for point in advice.recommended if np.isfinite(point.depth))
        near = stability_lobes(tip, change.process, best.spindle_speed * np.array(AROUND), DEEPEST, FullDiscretisation())
        row["agrees"] = bool(near.nominal.min() >= best.depth)
    return row


def table(rows: Sequence[Mapping[str, Any]]) -> str:
    """Return the summary over all cases."""
    seconds = np.array([row["seconds"] for row in rows])
    agrees = [row["agrees"] for row in rows if row["agrees"] is not None] or [np.nan]
    lines = [
        f"{len(rows)} cases, {min(row['modes'] for row in rows)} to {max(row['modes'] for row in rows)} modes; an answer takes "
        f"{np.median(seconds):.2f} s of one core in the median, {seconds.max():.2f} s at most; by full discretisation "
        f"{np.mean(agrees):.1%} of the recommended cuts are stable over +-1 % of speed.",
        "",
        "| depth from | cuts | stable over +-1 % of speed in the time march | depth over the true limit there, median (10 %, 90 %) "
        "| over the least true limit within +-1 % |",
        "|---|---|---|---|---|",
    ]
    for name in ("recommended", "zero-order"):
        found = [row[name] for row in rows if row[name] is not None]
        if not found:
            continue
        holds = sum(each["holds"] for each in found)
        shares = " | ".join(
            f"{np.median(values):.3f} ({np.quantile(values, 0.1):.2f}, {np.quantile(values, 0.9):.2f})"
            for values in (np.array([each[key] for each in found]) for key in ("share", "share_of_least"))
        )
        lines.append(f"| {name} | {len(found)} | {holds} ({holds / len(found):.1%}) | {shares} |")
    return "\n".join(lines)


def _kept(path: Path | None) -> dict[int, dict[str, Any]]:
    """Return the rows of an earlier run by the number of their case."""
    if path is None or not path.exists():
        return {}
    rows = (json.loads(line) for line in path.read_text(encoding="utf-8").splitlines())
    return {row.pop("case"): row for row in rows}


def main(arguments: Sequence[str]) -> None:
    """Run the cases and print their table."""
    parser = argparse.ArgumentParser(
        prog="benchmarks recommendation", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--cases", type=int, default=CASES)
    parser.add_argument("--first", type=int, default=0, help="the number of the first case, for a run in parts")
    parser.add_argument("--rows", type=Path, help="file of one line a case; a case that stands there is not run again")
    given = parser.parse_args(arguments)
    kept_rows = _kept(given.rows)
    with tempfile.TemporaryDirectory(prefix="rcsa-ident-") as folder:
        for number in range(given.first, given.first + given.cases):
            if number in kept_rows:
                continue
            seed, place = FIRST_SEED + number // 4, number % 4
            kept = Path(folder) / str(seed)
            machine = read_machine(kept / "machine.toml" if kept.exists() else random_machine(seed, kept))
            tooling = read_tooling((*machine.toolings, *machine.truth_toolings)[place])
            row = kept_rows[number] = case(machine, tooling, np.random.default_rng([seed, place]))
            if given.rows:
                with given.rows.open("a", encoding="utf-8") as rows:
                    print(json.dumps({"case": number} | row), file=rows)
            failed = row["recommended"] is not None and not row["recommended"]["holds"]
            if failed or given.cases <= 8:
                print(f"machine {seed}, tooling {tooling.name}: {row}", flush=True)
    print(table(list(kept_rows.values())))
