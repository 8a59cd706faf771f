"""The study of the identification: drawn machines, with trigger, without, and at three times the noise, beside [inprocess].

``python -m benchmarks study``. Everything goes through files: a machine file is drawn, its cuts are simulated, written, read, judged
and identified, the result is written and read; its tooltip FRFs are compared with the virtual machine's own full equations.
Every finished run is a line of ``results.jsonl`` in the scratch folder; a study that was interrupted goes on from there.

`benchmarks.comparison` says what the errors are. Beside the ten machines of the first study stand ten whose planes are coupled
(``--machines drawn coupled``): seeds 201 to 210, and 301 to 303 for development, fixed on 2026-11-22, before the package
identified cross terms; the ten had not been simulated by then, nor their truth computed.
"""

from __future__ import annotations

import argparse
import contextlib
import multiprocessing
import shutil
import tempfile
import time
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from functools import cache, partial
from pathlib import Path
from typing import Any

from benchmarks.comparison import compared, compared_at_speeds
from benchmarks.machines import (
    CONDITIONS,
    SENSOR_TESTS,
    TURNED_SAMPLE,
    USUAL,
    Condition,
    drawn,
    is_coupled,
    named,
    random_machine,
    turned_sample,
    under,
)
from benchmarks.page import DOCS, append_row, draw_study, read_rows, write_block, write_rows
from benchmarks.study_table import coupled_table, line, sensors_table, table
from rcsa_ident.base.errors import InputError
from rcsa_ident.front.compile_kernels import STEPS
from rcsa_ident.front.samples import simulate_campaign
from rcsa_ident.identification.data import IdentificationData
from rcsa_ident.identification.evidence import EvidenceSelection
from rcsa_ident.identification.genetic_algorithm import WIDE, NoiseWeightedCost, PaperGeneticAlgorithm
from rcsa_ident.io.recordings.readers import read_recording
from rcsa_ident.io.results.identifications import identification_to_json, machine_from_json
from rcsa_ident.io.results.parts import read_result, write_result
from rcsa_ident.io.settings.machines import MachineFile, read_machine
from rcsa_ident.io.settings.setups import read_campaign
from rcsa_ident.setup.campaign import Campaign
from rcsa_ident.setup.cut import Cut
from rcsa_ident.signals.measurement import Reading
from rcsa_ident.signals.recording import Quantity, Recording
from rcsa_ident.workflows.identify import Method, clock_error, data_of, judge, left_out

MACHINES = Path(__file__).resolve().parent.parent / "data" / "machines"
#: The machine that lies inside the search space of the published algorithm, seed of its cuts.
INSIDE, INSIDE_SEED = "table2", 101
METHODS: dict[str, Method] = {
    "default": EvidenceSelection(),
    "paper, literal": PaperGeneticAlgorithm(),
    "paper, noise weights": PaperGeneticAlgorithm(NoiseWeightedCost()),
    "paper, noise weights, wide boxes": PaperGeneticAlgorithm(NoiseWeightedCost(), WIDE),
}


@dataclass(frozen=True, slots=True)
class Run:
    """One identification: the name of a drawn machine is its seed, other names are those of ``data/machines``."""

    machine: str
    condition: str
    method: str
    seed: int

    @property
    def name(self) -> str:
        """As part of a file's name."""
        return "-".join(f"{self.machine} {self.condition} {self.method} {self.seed}".replace(",", "").split())


def run_of(row: dict[str, Any]) -> Run:
    """Return what a row of results belongs to."""
    return Run(row["machine"], row["condition"], row["method"], row["seed"])


def machine_of(scratch: Path, name: str) -> MachineFile:
    """Return a machine of the study; a drawn one is written first."""
    chosen = drawn(name)
    if name in TURNED_SAMPLE:
        return turned_sample(MACHINES / "hpm.toml", name)
    if chosen is None:
        return read_machine(MACHINES / f"{name}.toml")
    folder = scratch / name / "machine"
    if not folder.is_dir():
        folder.parent.mkdir(exist_ok=True)
        with tempfile.TemporaryDirectory(dir=scratch) as half, contextlib.suppress(OSError):
            # another process may have drawn the same machine meanwhile
            random_machine(chosen[0], Path(half) / "machine", chosen[1]).parent.rename(folder)
    return read_machine(folder / "machine.toml")


def campaign_folder(scratch: Path, name: str, condition: str) -> Path:
    """Return the folder of a campaign, simulated if it is not there; what was half done is not taken for done."""
    folder = scratch / name / (CONDITIONS[condition].campaign or condition)
    if folder.is_dir():
        return folder
    seed = (drawn(name) or (INSIDE_SEED,))[0]
    with tempfile.TemporaryDirectory(dir=scratch) as half:
        made = simulate_campaign(under(machine_of(scratch, name), condition), Path(half) / "campaign", seed)
        folder.parent.mkdir(exist_ok=True)
        shutil.rmtree(truth_folder(folder), ignore_errors=True)
        made.truth.rename(truth_folder(folder))
        made.folder.rename(folder)
    return folder


def truth_folder(campaign: Path) -> Path:
    """Return where the truth of a campaign lies."""
    return campaign.with_name(f"{campaign.name}.truth")


def read_cut(campaign: Campaign, cut: Cut) -> tuple[Recording, Recording | None]:
    """Return the recordings of a cut."""
    read = partial(read_recording, sensors=campaign.sensors, default_rate=campaign.sampling_rate)
    return read(cut.recording), None if cut.air is None else read(cut.air)


def read_data(folder: Path, condition: Condition = CONDITIONS["no-trigger"]) -> tuple[Campaign, list[Reading], IdentificationData]:
    """Return a campaign with its verdicts and its lines, the clock's error told as the condition says."""
    campaign = read_campaign(folder)
    if condition.clock == "exactly" and condition.disturbances is not None:
        campaign = replace(campaign, clock_error=condition.disturbances.clock_error)
    if condition.housing is not None:
        told = tuple(sensor for sensor in campaign.sensors if sensor.quantity is not Quantity.DISPLACEMENT)
        campaign = replace(campaign, sensors=told)
    readings = judge(campaign, partial(read_cut, campaign))
    if condition.clock == "from the speeds":
        campaign = replace(campaign, clock_error=clock_error(readings) or 0.0)
        readings = judge(campaign, partial(read_cut, campaign))
    return campaign, readings, data_of(campaign, readings)


@cache
def warm() -> None:
    """Load the compiled kernels, once in a process: the clock measures the method."""
    for step in STEPS.values():
        step()


def perform(scratch: Path, run: Run) -> dict[str, Any] | None:
    """Identify a campaign from its files and compare the result with the truth; None where what is usable of it is refused."""
    warm()
    folder = campaign_folder(scratch, run.machine, run.condition)
    setup = machine_of(scratch, run.machine)
    begin = time.perf_counter()
    try:
        campaign, readings, data = read_data(folder, CONDITIONS[run.condition])
    except InputError as error:
        print(f"{run.name}: refused: {error}", flush=True)
        return None
    read = time.perf_counter()
    found = METHODS[run.method].run(data, run.seed, map)
    done = time.perf_counter()
    path = scratch / "results" / f"{run.name}.json"
    path.parent.mkdir(exist_ok=True)
    write_result(path, identification_to_json(found, campaign, left_out(readings)))
    compare = compared_at_speeds if is_coupled(run.machine) else compared
    machine = machine_from_json(read_result(path), str(path)) if found.axes else None
    return {
        "machine": run.machine,
        "condition": run.condition,
        "method": run.method,
        "seed": run.seed,
        "status": str(found.status),
        "reasons": list(found.reasons),
        "cuts": len(data.cut_ids),
        "modes": [int(axis.modes.omega_n.size) for axis in found.axes.values()],
        "model_error": [float(f"{axis.model_error:.4g}") for axis in found.axes.values()],
        "seconds": {"read": round(read - begin, 2), "identify": round(done - read, 2)},
        **compare(machine, setup, truth_folder(folder)),
    }


def planned(machines: Sequence[str], conditions: Sequence[str], methods: Sequence[str], seeds: Sequence[int]) -> list[Run]:
    """Return the runs: the default method's under all conditions, the published one's without trigger, on machines that are not coupled."""
    runs = []
    for machine in machines:
        for condition in conditions if machine != INSIDE else ["no-trigger"]:
            chosen = [m for m in methods if m == "default" or (condition == "no-trigger" and not is_coupled(machine))]
            runs += [Run(machine, condition, method, seed) for method in chosen for seed in seeds]
    return runs


def run(
    scratch: Path,
    machines: Sequence[str],
    conditions: Sequence[str] = USUAL,
    methods: Sequence[str] = tuple(METHODS),
    seeds: Sequence[int] = (1,),
    processes: int = 1,
) -> list[dict[str, Any]]:
    """Return a row for every run that is not refused, in order; rows that ``results.jsonl`` in `scratch` holds are not computed again."""
    scratch.mkdir(parents=True, exist_ok=True)
    path = scratch / "results.jsonl"
    known = {run_of(r): r for r in read_rows(path)}
    runs = planned(machines, conditions, methods, seeds)
    todo = [r for r in runs if r not in known]
    campaigns = dict.fromkeys((r.machine, CONDITIONS[r.condition].campaign or r.condition) for r in todo)
    with ProcessPoolExecutor(processes, multiprocessing.get_context("spawn")) as pool:
        mapper: Callable[..., Iterable[Any]] = pool.map if processes > 1 else map
        for folder in mapper(partial(_simulated, scratch), campaigns):
            print(f"campaign: {folder}", flush=True)
        for row in mapper(partial(perform, scratch), todo):
            if row is None:
                continue
            append_row(path, row)
            known[run_of(row)] = row
            print(line(row), flush=True)
    return [known[r] for r in runs if r in known]


def _simulated(scratch: Path, campaign: tuple[str, str]) -> str:
    return str(campaign_folder(scratch, *campaign).relative_to(scratch))


def main(arguments: Sequence[str]) -> None:
    """Run the study, by default all of it: hours on two cores."""
    parser = argparse.ArgumentParser(prog="benchmarks study", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--scratch", type=Path, help="folder of campaigns and results; default: a new temporary one")
    parser.add_argument(
        "--machines",
        nargs="+",
        default=["drawn", INSIDE],
        help="drawn or coupled, for the ten of either kind; turned-sample, for the sample machine with coupled planes; seeds; "
        "coupled-SEED; names in data/machines (default: drawn table2)",
    )
    parser.add_argument("--conditions", nargs="+", choices=tuple(CONDITIONS), default=USUAL)
    parser.add_argument("--methods", nargs="+", choices=tuple(METHODS), default=tuple(METHODS))
    parser.add_argument("--seeds", nargs="+", type=int, default=[1], help="of the search")
    parser.add_argument("--processes", type=int, default=1)
    parser.add_argument("--page", action="store_true", help="write tables, picture and docs/study.jsonl for docs/study.md")
    given = parser.parse_args(arguments)
    scratch = given.scratch or Path(tempfile.mkdtemp(prefix="rcsa-ident-study-"))
    print(f"scratch folder: {scratch}", flush=True)
    rows = run(scratch, named(given.machines), given.conditions, given.methods, given.seeds, given.processes)
    kinds = {
        "sensors": [row for row in rows if row["condition"] in SENSOR_TESTS],
        "study": [row for row in rows if not is_coupled(row["machine"]) and row["condition"] in USUAL],
        "workshop": [row for row in rows if not is_coupled(row["machine"]) and row["condition"].startswith("workshop")],
        "passes": [row for row in rows if not is_coupled(row["machine"]) and row["condition"].startswith("passes")],
        "coupled": [row for row in rows if row["machine"] not in TURNED_SAMPLE and is_coupled(row["machine"])],
        "turned_sample": [row for row in rows if row["machine"] in TURNED_SAMPLE],
    }
    for name, members in kinds.items():
        if not members:
            continue
        kind = sensors_table if name == "sensors" else coupled_table if is_coupled(members[0]["machine"]) else table
        text = kind(members)
        print(f"\n{text}")
        if given.page:
            write_rows(DOCS / ("study.jsonl" if name == "study" else f"study_{name}.jsonl"), members)
            write_block(name, text)
            if name == "study":
                draw_study(members)
