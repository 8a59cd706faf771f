"""Searches compared over time: the default, differential evolution, CMA-ES and the published genetic algorithm.

``python -m benchmarks search_trace``. All get the X axis of the same campaigns, without trigger, and one process each; a clock of
processor time runs from the lines to the answer. Differential evolution and CMA-ES work on the default's cost, priors included, at a
model error of `SHARE`, on its own vector and from its own starts, with every cut's delay profiled inside. The published algorithm has
its own cost; it is run anew up to each number of generations. After the clock has stopped, each best-so-far is measured by what all
have in common: mean squared residual at `SHARE` of each line, and the error of the tooltip FRFs of toolings that never cut.
"""

from __future__ import annotations

import argparse
import importlib.util
import tempfile
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.machines import DEVELOPMENT
from benchmarks.page import append_row, draw_searches, read_rows, write_block
from benchmarks.study import campaign_folder, machine_of, read_data, truth_folder, warm
from benchmarks.yardstick import SHARE, Yardstick
from rcsa_ident.base.arrays import FloatArray
from rcsa_ident.base.errors import InputError
from rcsa_ident.coupling.joint import LumpedJoint
from rcsa_ident.dynamics.coordinates import Dof
from rcsa_ident.dynamics.modal import ModalModel
from rcsa_ident.identification.data import IdentificationData
from rcsa_ident.identification.evidence import EvidenceSelection
from rcsa_ident.identification.genetic_algorithm import NoiseWeightedCost, PaperGeneticAlgorithm
from rcsa_ident.identification.misfit import Misfit
from rcsa_ident.identification.modal_parameters import flange_modes
from rcsa_ident.identification.progress import Stage, Step
from rcsa_ident.identification.search import starts
from rcsa_ident.identification.unknowns import Layout, flange_layout, joint_of, split, unpack

CONDITION, AXIS = "no-trigger", Dof.X
#: Delays tried over a tooth-passing period in each evaluation; the default's own exploration tries as many.
GRID = 32
#: Half-width of the box around the mean start, as in the default's exploration, and the population of differential evolution.
REACH, POPULATION = 6.0, 60
#: Generations after which the published algorithm is looked at.
GENERATIONS = (30, 100, 300, 1000, 2500, 5000)
#: Stages of the default that try one candidate after the other; the last drops modes one by one.
SIDE_BY_SIDE = (Stage.SEARCH, Stage.REFINE, Stage.MODES)
#: Best-so-fars this close in time, as a ratio, are one point.
SPACING = 1.15


@dataclass(slots=True)
class Recorder:
    """Keeps what a search has found, with the processor time that it took: what else the machine does plays no part."""

    clock: Callable[[], float] = time.process_time
    begin: float = field(init=False)
    best: float = field(init=False, default=np.inf)
    points: list[tuple[float, float, Any]] = field(init=False, default_factory=list)

    def __post_init__(self) -> None:
        self.begin = self.clock()

    @property
    def seconds(self) -> float:
        """Since the search began."""
        return self.clock() - self.begin

    def offer(self, cost: float, found: Any) -> None:
        """Keep a candidate if it is the best so far."""
        if cost >= self.best:
            return
        self.best = cost
        self.add(cost, found)

    def add(self, cost: float, found: Any) -> None:
        """Keep a state of the search, whatever its cost; of those that follow each other closely the first and the last."""
        now = self.seconds
        if len(self.points) > 1 and now < SPACING * self.points[-2][0]:
            self.points.pop()
        self.points.append((now, cost, found))


class Candidates:
    """The default's cost of vectors of one axis, with the delays profiled inside, and the box around its starts."""

    def __init__(self, data: IdentificationData, seed: int) -> None:
        method = EvidenceSelection()
        # the flange's motion as one output, as the default's exploration has it
        data = data.summed()
        self.misfit = Misfit(data, method.priors, (SHARE,))
        self.layout = flange_layout(method.search.modes)
        self.nuisance = np.zeros((len(data.cut_ids), 2))
        omega = data.axes[0].omega
        band = float(omega.min() / (2.0 * np.pi)), float(omega.max() / (2.0 * np.pi))
        self.starts = starts(POPULATION, method.search.modes, band, self.misfit, np.random.default_rng(seed))
        centre = self.starts.mean(axis=0)
        self.low, self.high = np.minimum(centre - REACH, -REACH), np.maximum(centre + REACH, REACH)
        self.cost(self.starts[0])

    def cost(self, theta: FloatArray) -> float:
        """Return the cost of a vector."""
        return self.misfit.evaluate(theta, self.layout, self.nuisance, GRID).cost


def by_default(data: IdentificationData, seed: int, seconds: float) -> Recorder:
    """The default method, followed by its progress: what it would go on with at each time."""
    recorder = Recorder()
    lowest: dict[Stage, float] = {}

    def follow(step: Step) -> None:
        assert step.candidate is not None
        if step.stage not in lowest:
            # another stage has another cost
            lowest.clear()
        # of candidates that are tried one after the other the best counts, of all else the latest
        if step.stage not in SIDE_BY_SIDE or step.cost < lowest.get(step.stage, np.inf):
            lowest[step.stage] = step.cost
            recorder.add(step.cost, (np.array(step.candidate.theta), step.candidate.layout))

    found = EvidenceSelection().run(data, seed, map, follow)
    recorder.points.append((recorder.seconds, np.nan, (found.axes[AXIS].modes, found.axes[AXIS].joint)))
    return recorder


def by_differential_evolution(data: IdentificationData, seed: int, seconds: float) -> Recorder:
    """SciPy's differential evolution, its settings as they come, from the default's starts."""
    from scipy.optimize import differential_evolution

    candidates = Candidates(data, seed)
    recorder = Recorder()

    def cost(theta: FloatArray) -> float:
        value = candidates.cost(theta)
        recorder.offer(value, (np.array(theta), candidates.layout))
        return value

    differential_evolution(
        cost,
        list(zip(candidates.low, candidates.high, strict=True)),
        init=candidates.starts,
        maxiter=10**9,
        tol=0.0,
        polish=False,
        rng=np.random.default_rng(seed),
        callback=lambda intermediate_result: recorder.seconds > seconds,
    )
    return recorder


def by_cma_es(data: IdentificationData, seed: int, seconds: float) -> Recorder:
    """CMA-ES through pymoo, from the best of the default's starts, restarted with growing populations until the time is over."""
    from pymoo.algorithms.soo.nonconvex.cmaes import CMAES
    from pymoo.core.problem import Problem
    from pymoo.optimize import minimize

    candidates = Candidates(data, seed)
    recorder = Recorder()

    class Costs(Problem):
        def __init__(self) -> None:
            super().__init__(n_var=candidates.low.size, n_obj=1, xl=candidates.low, xu=candidates.high)

        def _evaluate(self, x: Any, out: dict[str, Any], *args: Any, **kwargs: Any) -> None:
            values = []
            for theta in np.asarray(x, dtype=float):
                values.append(candidates.cost(theta))
                recorder.offer(values[-1], (np.array(theta), candidates.layout))
            out["F"] = np.array(values)[:, None]

    start = min(candidates.starts, key=candidates.cost)
    # in units of the box: half the spread of the starts, where they do not differ as much as the shapes do
    spread = np.maximum(0.5 * candidates.starts.std(axis=0), 0.05) / (candidates.high - candidates.low)
    algorithm = CMAES(x0=start, sigma=1.0, CMA_stds=spread.tolist(), restarts=50, incpopsize=2)
    minimize(Costs(), algorithm, _until(recorder, seconds), seed=seed, verbose=False)
    return recorder


def _until(recorder: Recorder, seconds: float) -> Any:
    from pymoo.core.termination import Termination

    class Stop(Termination):
        def _update(self, algorithm: Any) -> float:
            return recorder.seconds / seconds

    return Stop()


def by_paper(data: IdentificationData, seed: int, seconds: float, weighted: bool = False) -> Recorder:
    """The published algorithm, literally or with noise weights, run anew up to each number of generations."""
    method = PaperGeneticAlgorithm(NoiseWeightedCost()) if weighted else PaperGeneticAlgorithm()
    whole = Recorder()
    for generations in GENERATIONS:
        recorder = Recorder()
        found = replace(method, generations=generations).run(data, seed, map)
        whole.points.append((recorder.seconds, found.trace[-1].cost, (found.axes[AXIS].modes, found.axes[AXIS].joint)))
    return whole


def by_paper_weighted(data: IdentificationData, seed: int, seconds: float) -> Recorder:
    """The published algorithm with noise weights."""
    return by_paper(data, seed, seconds, weighted=True)


SEARCHES: dict[str, Callable[[IdentificationData, int, float], Recorder]] = {
    "default": by_default,
    "differential evolution": by_differential_evolution,
    "CMA-ES": by_cma_es,
    "paper, literal": by_paper,
    "paper, noise weights": by_paper_weighted,
}


def machine_at(theta: FloatArray, layout: Layout) -> tuple[ModalModel, LumpedJoint]:
    """Return modes and joint of a vector of one axis, at the campaign's middle speed."""
    (part,), joint = split(theta, layout)
    return flange_modes(unpack(part, layout.axes[0]), AXIS), joint_of(joint)


def perform(scratch: Path, machine: str, method: str, seed: int, seconds: float) -> dict[str, Any]:
    """Let one search run and measure what it found on its way: points of (seconds, own cost, misfit, errors)."""
    warm()
    folder = campaign_folder(scratch, machine, CONDITION)
    data = read_data(folder)[2].only(AXIS)
    yardstick = Yardstick(data, machine_of(scratch, machine), truth_folder(folder))
    points = []
    for took, cost, found in SEARCHES[method](data, seed, seconds).points:
        try:
            found = found if isinstance(found[0], ModalModel) else machine_at(*found)
        except InputError:
            # early candidates may have a mode so damped that rounding leaves it no frequency: nothing to measure yet
            continue
        points.append([float(f"{value:.4g}") for value in (took, cost, *yardstick.measure(*found))])
    return {"machine": machine, "method": method, "seed": seed, "points": points}


def run(
    scratch: Path, machines: Sequence[str], methods: Sequence[str], seeds: Sequence[int], seconds: float = 120.0
) -> list[dict[str, Any]]:
    """Return a row for every search, one after the other; what ``search_trace.jsonl`` in `scratch` holds is not run again."""
    scratch.mkdir(parents=True, exist_ok=True)
    path = scratch / "search_trace.jsonl"
    known = {(r["machine"], r["method"], r["seed"]): r for r in read_rows(path)}
    wanted = [(machine, method, seed) for machine in machines for seed in seeds for method in methods]
    for key in wanted:
        if key not in known:
            known[key] = perform(scratch, *key, seconds)
            append_row(path, known[key])
            took, _, misfit, *errors = known[key]["points"][-1]
            print(f"{key[0]} seed {key[2]} {key[1]:<24} {took:6.1f} s  misfit {misfit:.3g}  errors {errors}", flush=True)
    return [known[key] for key in wanted]


def table(rows: Sequence[dict[str, Any]]) -> str:
    """Return the ends of all searches as Markdown."""
    lines = ["| machine | search | seed | seconds | misfit | similar | different |", "|---|---|---|---|---|---|---|"]
    for row in rows:
        took, _, misfit, similar, different = row["points"][-1]
        lines.append(
            f"| {row['machine']} | {row['method']} | {row['seed']} | {took:.1f} | {misfit:.3g} | {similar:.4f} | {different:.4f} |"
        )
    return "\n".join(lines) + "\n"


def main(arguments: Sequence[str]) -> None:
    """Run the searches one after the other: about an hour."""
    parser = argparse.ArgumentParser(
        prog="benchmarks search_trace", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--scratch", type=Path, help="folder of campaigns and results; default: a new temporary one")
    parser.add_argument("--machines", nargs="+", default=[str(s) for s in DEVELOPMENT], help="seeds, or names in data/machines")
    parser.add_argument("--methods", nargs="+", choices=tuple(SEARCHES), default=tuple(SEARCHES))
    parser.add_argument("--seeds", nargs="+", type=int, default=[1, 2], help="of the searches")
    parser.add_argument("--seconds", type=float, default=120.0, help="for differential evolution and CMA-ES each")
    parser.add_argument("--page", action="store_true", help="write table and picture into docs/study.md")
    given = parser.parse_args(arguments)
    scratch = given.scratch or Path(tempfile.mkdtemp(prefix="rcsa-ident-study-"))
    print(f"scratch folder: {scratch}", flush=True)
    methods = list(given.methods)
    if "CMA-ES" in methods and importlib.util.find_spec("cma") is None:
        print("CMA-ES is left out: the package cma is not installed (pip install cma)")
        methods.remove("CMA-ES")
    rows = run(scratch, given.machines, methods, given.seeds, given.seconds)
    print(f"\n{table(rows)}")
    if given.page:
        draw_searches(rows)
        write_block("searches", table(rows))
