"""Tooltip error on toolings that were never cut: five campaigns x three search seeds, beside the paper's method.

||dC11|| / ||C11|| over 600-4000 Hz in 5 Hz steps against the virtual machine's own full equations. Everything goes through
files: recordings are simulated, written, read, judged and identified. The paper's method gets the same lines in the same run,
with its best delay for each cut: literal, with noise weights, and with noise weights and boxes wide enough to hold the truth.
"""

from __future__ import annotations

import multiprocessing
import tempfile
import time
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.timing import row
from rcsa_ident.cli.simulation import simulate_campaign
from rcsa_ident.dynamics.coordinates import Dof
from rcsa_ident.identification.default import DefaultMethod
from rcsa_ident.identification.paper import WIDE, NoiseWeightedCost, PaperGeneticAlgorithm
from rcsa_ident.identification.result import Identification
from rcsa_ident.io.curves import FrfCurves, read_frf_csv
from rcsa_ident.io.recordings import read_recording
from rcsa_ident.io.setups import read_campaign, read_tooling
from rcsa_ident.machine.spindle import Spindle
from rcsa_ident.machining_setup import Campaign, Cut, Tooling
from rcsa_ident.signals.recording import Recording
from rcsa_ident.workflows.identify import data_of, judge
from rcsa_ident.workflows.tip import MachineAxis, tooltip

MACHINES = Path(__file__).resolve().parent.parent / "data" / "machines"
SIMILAR, DIFFERENT = "S3-PG25-long", "S4-shrink"
CAMPAIGNS, SEEDS = (101, 102, 103, 104, 105), (1, 2, 3)
METHODS = {
    "default": DefaultMethod(),
    "paper, literal": PaperGeneticAlgorithm(),
    "paper, noise weights": PaperGeneticAlgorithm(NoiseWeightedCost()),
    "paper, noise weights, wide boxes": PaperGeneticAlgorithm(NoiseWeightedCost(), WIDE),
}
FREQUENCY = np.arange(600.0, 4000.1, 5.0)


def run() -> list[dict[str, Any]]:
    """About 25 minutes on two cores; prints each identification as it comes."""
    errors: dict[str, dict[str, list[float]]] = {name: {SIMILAR: [], DIFFERENT: []} for name in METHODS}
    seconds: dict[str, list[float]] = {name: [] for name in METHODS}
    with ProcessPoolExecutor(2, multiprocessing.get_context("spawn")) as pool, tempfile.TemporaryDirectory() as scratch:
        for campaign_seed in CAMPAIGNS:
            folder = Path(scratch) / f"campaign{campaign_seed}"
            simulate_campaign(MACHINES / "hpm.toml", folder, campaign_seed, mapper=pool.map)
            begin = time.perf_counter()
            campaign = read_campaign(folder)
            judged = judge(campaign, partial(read_cut, campaign), partial(pool.map, chunksize=4))
            data = data_of(campaign, judged)
            reading = time.perf_counter() - begin
            for seed in SEEDS:
                for name, found, took in _both_ways(data, seed, pool.map):
                    seconds[name].append(took + reading)
                    line = []
                    for wanted in (SIMILAR, DIFFERENT):
                        tooling = read_tooling(MACHINES / "toolings" / f"{wanted}.toml")
                        truth = read_frf_csv(folder.with_name(folder.name + ".truth") / "tip" / f"{wanted}.csv")
                        both = tip_errors(found, tooling, truth)
                        errors[name][wanted] += both
                        line += both
                    text = " ".join(f"{value:.4f}" for value in line)
                    print(f"campaign {campaign_seed} seed {seed} {name:<34} {text} {found.status} {took:.1f} s", flush=True)
    rows = []
    for wanted, words in ((SIMILAR, "similar holder"), (DIFFERENT, "different holder")):
        ours = np.array(errors["default"][wanted])
        for name in METHODS:
            values = np.array(errors[name][wanted])
            accuracy = f"n = {values.size}, {np.median(seconds[name]):.1f} s each"
            rows.append(row(f"tooltip error, {words}, median: {name}", float(np.median(ours)), float(np.median(values)), "-", accuracy))
            rows.append(row(f"tooltip error, {words}, worst: {name}", float(ours.max()), float(values.max()), "-", accuracy))
    return rows


def _both_ways(data: Any, seed: int, map: Callable[..., Iterable[Any]]) -> Iterator[tuple[str, Identification, float]]:
    for name, method in METHODS.items():
        begin = time.perf_counter()
        found = method.run(data, seed, map)
        yield name, found, time.perf_counter() - begin


def read_cut(campaign: Campaign, cut: Cut) -> tuple[Recording, Recording | None]:
    """Return the recordings of a cut."""
    read = partial(read_recording, sensors=campaign.sensors, default_rate=campaign.sampling_rate)
    return read(cut.recording), None if cut.air is None else read(cut.air)


def tip_errors(found: Identification, tooling: Tooling, truth: FrfCurves) -> list[float]:
    """Return ||dC11|| / ||C11|| of each axis."""
    machine = {axis: MachineAxis(Spindle(result.modes), result.joint) for axis, result in found.axes.items()}
    response = tooltip(machine, tooling.assembly, 2.0 * np.pi * FREQUENCY, bands=False)
    errors = []
    for axis, name in ((Dof.X, "X"), (Dof.Y, "Y")):
        true = truth.values[name][np.searchsorted(truth.frequency, FREQUENCY - 1e-6)]
        errors.append(float(np.linalg.norm(response.tip(axis) - true) / np.linalg.norm(true)))
    return errors
