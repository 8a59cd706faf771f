"""What a corner radius does to an identification, and to the forces that it stands on.

``python -m benchmarks corner_radius``. A virtual machine cuts 0.4 mm deep, once with sharp end mills and once with a corner radius of
0.5 mm: nothing else differs, not even the noise. Each campaign is identified with cutters as they are; the second one also as if they were
sharp, which is what was computed before shapes were known, and as if a sharp drawing were good for 0.3 mm. Errors are those of
`benchmarks.comparison`, [X, Y] of each tooling; a summary has their root mean square over all toolings. The virtual machine takes
cutters apart in its own way: levels, arcs and chips in the time domain.

The first table is of the forces alone: how wrong the lines of the cylinder are at the first five tooth orders, for half-immersion
down-milling with a Ø12 mm end mill of four teeth and 30 degrees.
"""

from __future__ import annotations

import argparse
import tempfile
import time
from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np

from benchmarks.comparison import compared
from benchmarks.machines import named, under
from benchmarks.study import machine_of, read_cut, truth_folder
from rcsa_ident.cutting.coefficients import CuttingCoefficients
from rcsa_ident.cutting.conditions import CuttingConditions, Engagement
from rcsa_ident.cutting.corner import with_corner
from rcsa_ident.cutting.cutter import Cutter
from rcsa_ident.cutting.force import force_lines
from rcsa_ident.cutting.materials import material
from rcsa_ident.identification.evidence import EvidenceSelection
from rcsa_ident.io.settings.machines import MachineFile
from rcsa_ident.io.settings.setups import read_campaign, read_tooling
from rcsa_ident.io.settings.simulations import write_simulation
from rcsa_ident.setup.campaign import Campaign
from rcsa_ident.setup.tooling import Tooling
from rcsa_ident.tool_holder.spread import EXACT
from rcsa_ident.workflows.identify import identify, judge
from rcsa_ident.workflows.simulate import simulate, true_flange, true_receptances

#: Corner radius, depth, and what a drawing that says nothing is good for [m].
RADIUS, DEPTH, DOUBT = 0.5e-3, 0.4e-3, 0.3e-3
#: Materials of the force table, and the paper's coefficients, which know no edges and no axial force.
MATERIALS = ("EN AW-6082-T6", "EN AW-7075-T6", "Titanium Ti-6Al-4V")
PAPER = CuttingCoefficients(902e6, 0.26)
#: As those of EN AW-6082-T6, whose axial force is the largest of the library's: cut and known alike.
CUT_WITH = "EN AW-6082-T6"


def rounded(tooling: Tooling, radius: float) -> Tooling:
    """Return a tooling whose cutter has a corner radius [m]."""
    return replace(tooling, cutter=with_corner(tooling.cutter, radius))


def force_errors(coefficients: CuttingCoefficients, radius: float, depth: float) -> np.ndarray:
    """Return by how much the cylinder's lines are wrong in X and Y, as shares of the norm of the true ones at five tooth orders."""
    cutter, orders = Cutter(4, 0.012, np.radians(30.0)), 4 * np.arange(1, 6)
    cut = CuttingConditions(900.0, depth, 0.1e-3, Engagement.from_immersion(0.5, "down"))
    true, sharp = (force_lines(each, cut, coefficients, orders) for each in (with_corner(cutter, radius), cutter))
    return np.linalg.norm(sharp - true, axis=0) / np.linalg.norm(true, axis=0)


def force_table() -> str:
    """Return the table of the forces: the smallest and the largest error over the sets of coefficients."""
    sets = [PAPER, *(material(name).coefficients for name in MATERIALS)]
    lines = ["| depth, mm | corner radius, mm | X, % | Y, % |", "|---|---|---|---|"]
    for depth in (0.4e-3, 1e-3):
        for radius in (0.2e-3, 0.5e-3, 1e-3):
            errors = 100.0 * np.array([force_errors(each, radius, depth) for each in sets])
            spans = " | ".join(f"{low:.0f}–{high:.0f}" for low, high in zip(errors.min(axis=0), errors.max(axis=0), strict=True))
            lines.append(f"| {1e3 * depth:g} | {1e3 * radius:g} | {spans} |")
    return "\n".join(lines)


def setup_of(scratch: Path, name: str) -> MachineFile:
    """Return a machine whose cuts are `DEPTH` deep, in a material with edges and an axial force."""
    machine = under(machine_of(scratch, name), "no-trigger")
    known = replace(material(CUT_WITH).coefficients, tangential_spread=0.05, ratio_spread=0.05, edge_spread=0.1)
    workpiece = replace(machine.workpiece, coefficients=known)
    return replace(machine, plan=replace(machine.plan, axial_depth=DEPTH), workpiece=workpiece)


def campaign_of(scratch: Path, setup: MachineFile, name: str, radius: float) -> tuple[Campaign, Path]:
    """Return the campaign of cutters with a corner radius, as if they were drawn sharp, and where the truth lies."""
    folder = scratch / name / f"radius-{1e3 * radius:g}"
    toolings = [read_tooling(path) for path in setup.toolings]
    if not folder.is_dir():
        known = [*toolings, *(read_tooling(path) for path in setup.truth_toolings)]
        cuts = simulate(setup, [rounded(each, radius) for each in toolings], 1)
        folder.parent.mkdir(parents=True, exist_ok=True)
        write_simulation(folder, setup, toolings, cuts, (true_receptances(setup, each) for each in known), true_flange(setup))
    return replace(read_campaign(folder), workpiece=setup.workpiece), truth_folder(folder)


def told(campaign: Campaign, radius: float, doubt: float = 0.0) -> Campaign:
    """Return the campaign with a corner radius, and how well that is known [m]."""
    spread = replace(EXACT, corner_radius=doubt)
    return replace(campaign, toolings={n: replace(rounded(t, radius), spread=spread) for n, t in campaign.toolings.items()})


def run(scratch: Path, names: Sequence[str], seeds: Sequence[int]) -> None:
    """Print the table of the identifications, medians over the search's seeds in percent, each row as it is there; then the summary."""
    head = ("machine", "cut with", "identified with", "status", "cuts", "cut", "never cut, same holder", "other holder", "s")
    print("| " + " | ".join(head) + " |", "|---" * len(head) + "|", sep="\n", flush=True)
    summary = ["", "| machine | sharp | told | untold | ± 0.3 mm |", "|---|---|---|---|---|"]
    for name in names:
        setup = setup_of(scratch, name)
        whole = []
        cases = (
            (0.0, 0.0, 0.0, "sharp", "sharp"),
            (RADIUS, RADIUS, 0.0, "0.5 mm", "0.5 mm"),
            (RADIUS, 0.0, 0.0, "0.5 mm", "sharp (before)"),
            (RADIUS, 0.0, DOUBT, "0.5 mm", "sharp ± 0.3 mm"),
        )
        for cut, believed, doubt, *words in cases:
            campaign, truth = campaign_of(scratch, setup, name, cut)
            campaign = told(campaign, believed, doubt)
            begin = time.perf_counter()
            readings = judge(campaign, partial(read_cut, campaign))
            runs = [identify(campaign, readings, EvidenceSelection(), seed) for seed in seeds]
            seconds = (time.perf_counter() - begin) / len(runs)
            errors = [compared(each.machine, setup, truth) for each in runs]
            medians = {kind: np.median([each[kind]["errors"] for each in errors], axis=0) for kind in errors[0]}
            told_errors = " | ".join(", ".join(f"{100.0 * e:.2g}" for e in median) for median in medians.values())
            status = ", ".join(dict.fromkeys(str(each.status) for each in runs))
            row = f"| {name} | {words[0]} | {words[1]} | {status} | {len(runs[0].cut_ids)} | {told_errors} | {seconds:.0f} |"
            print(row, flush=True)
            whole.append(f"{100.0 * np.sqrt(np.mean(np.square(np.concatenate(list(medians.values()))))):.2g} ({status})")
        summary.append(f"| {name} | {' | '.join(whole)} |")
    print("\n".join(summary))


def main(arguments: Sequence[str]) -> None:
    """Print both tables: minutes for each machine."""
    parser = argparse.ArgumentParser(
        prog="benchmarks corner_radius", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--scratch", type=Path, help="folder of campaigns; default: a new temporary one")
    parser.add_argument(
        "--machines", nargs="*", default=["hpm"], help="drawn for the ten of the study, seeds of drawn machines, or names in data/machines"
    )
    parser.add_argument("--seeds", type=int, nargs="+", default=[1, 2, 3], help="of the search: one seed's errors scatter by a factor of 3")
    given = parser.parse_args(arguments)
    print(force_table(), flush=True)
    if given.machines:
        run(given.scratch or Path(tempfile.mkdtemp(prefix="rcsa-ident-corner-")), named(given.machines), given.seeds)
