"""[inprocess], Fig. 8, on the sample machine: its four cases (Table 3), each with 33 cuts that the virtual machine tries.

Lobes come from the identified sample runs, whose cuts were half-immersion, stable and of the first two toolings alone; whether a cut
chatters is told by a march of the true machine. Cuts lie between 0.6 and 1.6 times the zero-order limit of the true receptance; those
whose disturbance changes by less than 1.5 % from tooth to tooth are marginal. About two minutes.

``python -m benchmarks tested_cuts [FIGURE.png]`` draws them.
"""

from __future__ import annotations

import argparse
import json
import tempfile
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.timing import row

MACHINES = Path(__file__).resolve().parents[1] / "data" / "machines"
SAMPLES = MACHINES.parent / "sample_runs"
#: Tooling, radial depth [mm], feed direction.
CASES = (("S1-ER32", 12.0, "+Y"), ("S2-PG25", 12.0, "+Y"), ("S3-PG25-long", 8.4, "+X"), ("S4-shrink", 12.0, "+Y"))
FEED, SPEEDS, CUTS, MARGINAL, SEED = 5e-5, 11, 3, 0.015, 4


def run(figure: Path | None = None) -> list[dict[str, Any]]:
    """A row for each method, all cases together."""
    rows = []
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        _command("identify", SAMPLES, "--out", folder / "R.json", "--processes", 1)
        (folder / "CASES.toml").write_text("".join(_case(folder, k, *case) for k, case in enumerate(CASES)), encoding="utf-8")
        for method in ("zero-order", "full-discretisation"):
            draw = ("--plot", figure) if figure is not None and method == "full-discretisation" else ()
            speeds = ("--speed-from", 7500, "--speed-to", 20500, "--max-depth-mm", 6)
            found = json.loads(_command("cases", folder / "R.json", folder / "CASES.toml", *speeds, "--method", method, *draw))["cases"]
            tested = [case["tested"] for case in found]
            total = {key: sum(t[key] for t in tested) for key in tested[0] if key != "share_right"}
            right = total["stable_stable"] + total["chatter_chatter"]
            decided = right + total["stable_chatter"] + total["chatter_stable"]
            each = ", ".join(f"{t['stable_stable'] + t['chatter_chatter']}" for t in tested)
            marginal = total["stable_marginal"] + total["chatter_marginal"]
            words = f"{right} of {decided} ({each}), {marginal} marginal; {total['stable_chatter']} unexpected chatter"
            rows.append(row(f"four cases of Table 3, cuts told right, {method}", 100.0 * right / decided, None, "%", words))
    return rows


def _command(*arguments: object) -> str:
    """Run a command and return what it prints."""
    from typer.testing import CliRunner

    from rcsa_ident.cli import app

    done = CliRunner().invoke(app, [*(str(a) for a in arguments), "--json"])
    if done.exit_code:
        raise RuntimeError(done.output)
    return done.stdout.splitlines()[-1]


def _case(folder: Path, number: int, name: str, radial_mm: float, feed: str) -> str:
    """One case of the file, its cuts tried and written beside it."""
    from rcsa_ident.cutting.conditions import CuttingConditions, Engagement
    from rcsa_ident.cutting.process import MillingProcess
    from rcsa_ident.dynamics.receptance import Receptance
    from rcsa_ident.io.settings.cuts import FEED_DIRECTIONS
    from rcsa_ident.io.settings.machines import read_machine
    from rcsa_ident.io.settings.setups import read_tooling
    from rcsa_ident.stability.lobes import stability_lobes
    from rcsa_ident.stability.tip_modes import TIP
    from rcsa_ident.virtual.limit import multiplier
    from rcsa_ident.virtual.reduction import poles, reduced
    from rcsa_ident.virtual.rotor import rotor

    setup, path = read_machine(MACHINES / "hpm.toml"), MACHINES / "toolings" / f"{name}.toml"
    tooling, coefficients, rng = read_tooling(path), setup.workpiece.coefficients, np.random.default_rng(SEED + number)
    model = reduced(rotor(setup.spindle, tooling.assembly))
    engagement = Engagement.from_immersion(radial_mm * 1e-3 / tooling.cutter.diameter, "up")
    process = MillingProcess(tooling.cutter, coefficients, engagement, FEED_DIRECTIONS[feed], FEED)
    omega = 2.0 * np.pi * np.arange(100.0, 6000.0)
    rows = []
    for rpm in np.round(np.linspace(8000.0, 20000.0, SPEEDS) + rng.uniform(-300.0, 300.0, SPEEDS)):
        speed = rpm * np.pi / 30.0
        dynamics = poles(model, speed)
        names = [str(c) for c in dynamics.coordinates]
        tip = dynamics.response(omega)[:, [names.index("tip.x"), names.index("tip.y")]]
        around = stability_lobes(Receptance(omega, tip, TIP, TIP), process, np.array([speed]), 5e-3).limit_depth[0]
        for share in np.exp(rng.uniform(np.log(0.6), np.log(1.6), CUTS)):
            depth = max(round(min(around, 5e-3) * share / 5e-5), 1) * 5e-5
            cut = CuttingConditions(speed, depth, FEED, engagement, process.feed_angle)
            grows = abs(multiplier(dynamics, tooling.cutter, cut, coefficients)) - 1.0
            verdict = "marginal" if abs(grows) < MARGINAL else "chatter" if grows > 0.0 else "stable"
            rows.append(f"{rpm:g},{depth * 1e3:.2f},{verdict}")
    (folder / f"CUTS{number}.csv").write_text("spindle_speed_rpm,axial_depth_mm,verdict\n" + "\n".join(rows) + "\n", encoding="utf-8")
    title = f"case {number + 1}: {name}, {'slot' if radial_mm == 12.0 else 'up-milling'}, feed {feed}"
    keys = {"name": title, "tooling": path.as_posix(), "feed_direction": feed, "strategy": "up", "tests": f"CUTS{number}.csv"}
    texts = "".join(f"{key} = {json.dumps(value)}\n" for key, value in keys.items())
    return f"[[cases]]\n{texts}radial_depth_mm = {radial_mm}\nfeed_per_tooth_mm = {FEED * 1e3}\n"


def main(arguments: list[str]) -> None:
    """Print the rows; an argument names the figure to draw."""
    parser = argparse.ArgumentParser(prog="benchmarks tested_cuts", description=__doc__)
    parser.add_argument("figure", nargs="?", type=Path, help="PNG or SVG of the cases")
    for each in run(parser.parse_args(arguments).figure):
        print(f"{each['claim']:<60} {each['ours']:.1f} {each['unit']}  {each['accuracy']}")
