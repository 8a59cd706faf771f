"""Exploration: pymoo's genetic algorithm [blank2020] over starts, each of which takes a few damped Gauss-Newton steps."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from rcsa_ident.base.arrays import FloatArray
from rcsa_ident.identification.levenberg_marquardt import Solution, refine
from rcsa_ident.identification.misfit import Misfit
from rcsa_ident.identification.progress import Stage
from rcsa_ident.identification.unknowns import DAMPING_UNIT, JOINT, Layout, flange_layout, lower_triangle, pack, split, unpack


@dataclass(frozen=True, slots=True)
class SearchSettings:
    """How far the search looks.

    `modes`: more than a spindle has in the band: what is not needed is dropped later
    `steps`: Gauss-Newton steps of a candidate per generation: real work beside the search's own cost
    """

    modes: int = 10
    population: int = 8
    generations: int = 3
    steps: int = 8


def starts(count: int, modes: int, band_hz: tuple[float, float], misfit: Misfit, rng: np.random.Generator) -> FloatArray:
    """Return random vectors, shape (count, p): a mode below the band, one above it, the others in it, light or heavy damping, uncoupled.

    Where it is not the flange's motion that was measured, the place moves about as the flange does.

    Every machine has modes below and above what is excited; a search that starts without them ends without them.

    `count`, `modes`: number of vectors, and of modes in each
    `band_hz`: (float, float) [Hz]; lowest and highest line
    `misfit`: of one output; its priors give the joint's centre
    """
    low, high = band_hz
    layout = flange_layout(modes, places=misfit.data.axes[0].places).axes[0]
    theta = np.zeros((count, layout.size + JOINT))
    frequency = rng.uniform(low, 1.08 * high, (count, modes))
    frequency[:, 0] = rng.uniform(0.2, 0.6, count) * low
    frequency[:, 1] = rng.uniform(1.3, 2.0, count) * high
    frequency = np.sort(frequency, axis=1)
    theta[:, :modes] = np.log(2.0 * np.pi * frequency)
    theta[:, modes : 3 * modes] = 0.1 * rng.standard_normal((count, 2 * modes))
    theta[:, 3 * modes - 2 : 3 * modes] *= 5.0
    own = 3 * modes + np.flatnonzero(lower_triangle(modes)[2])
    damping = np.exp(rng.uniform(np.log(0.03), np.log(0.15), (count, modes)))
    theta[:, own] = 0.5 * np.log(2.0 * damping * 2.0 * np.pi * frequency) - np.log(DAMPING_UNIT)
    theta[:, layout.core - 3 : layout.core] = [1.0, 0.1, 1.0]
    if layout.places:
        theta[:, layout.core : layout.core + modes] = theta[:, modes : 3 * modes : 2]
    theta[:, -JOINT:] = np.log(misfit.priors.joint)
    return theta


def explore(
    misfit: Misfit,
    settings: SearchSettings,
    band_hz: tuple[float, float],
    rng: np.random.Generator,
    report: Callable[[Stage, float, Solution], None] | None = None,
) -> list[Solution]:
    """Return the last population, best first, for one axis.

    `misfit`: the misfit of one axis, with a coarse model error (0.3): it smooths the landscape while the delays are found
    `band_hz`: (float, float) [Hz]; lowest and highest line
    `report`: callable of (stage, cost, solution)
    """
    from pymoo.algorithms.soo.nonconvex.ga import GA
    from pymoo.core.problem import Problem
    from pymoo.operators.crossover.sbx import SBX
    from pymoo.operators.mutation.pm import PM

    first = starts(settings.population, settings.modes, band_hz, misfit, rng)
    layout = flange_layout(settings.modes, places=misfit.data.axes[0].places)
    centre, reach = first.mean(axis=0), np.full(first.shape[1], 6.0)
    problem = Problem(n_var=first.shape[1], n_obj=1, xl=np.minimum(centre - reach, -reach), xu=np.maximum(centre + reach, reach))
    algorithm = GA(
        pop_size=settings.population,
        sampling=first,
        crossover=SBX(prob=0.9, eta=10),
        mutation=PM(prob=1.0, prob_var=3.0 / first.shape[1], eta=10),
        eliminate_duplicates=True,
    )
    algorithm.setup(problem, termination=("n_gen", settings.generations), seed=int(rng.integers(2**31)), verbose=False)
    reached: dict[bytes, Solution] = {}
    while algorithm.has_next():
        offspring = algorithm.ask()
        if offspring is None:  # the population has collapsed: all children were duplicates
            break
        improved = []
        for individual in offspring:
            theta = _by_frequency(np.asarray(individual.X, dtype=float), layout)
            solution = refine(misfit, theta, layout, np.zeros((len(misfit.data.cut_ids), 2)), settings.steps, grid=32)
            inside = np.clip(solution.theta, problem.xl, problem.xu)
            reached[inside.tobytes()] = solution
            improved.append(inside)
            if report is not None:
                report(Stage.SEARCH, solution.cost, solution)
        # what the steps have gained is inherited (Lamarck's way)
        offspring.set("X", np.array(improved))
        offspring.set("F", np.array([[reached[x.tobytes()].cost] for x in improved]))
        algorithm.tell(infills=offspring)
    last = {x.tobytes() for x in algorithm.pop.get("X")}
    return sorted((reached[key] for key in last), key=lambda s: s.cost)


def _by_frequency(theta: FloatArray, layout: Layout) -> FloatArray:
    """Sort the modes by frequency, so that crossover mixes like with like."""
    (part,), joint = split(theta, layout)
    axis = layout.axes[0]
    order = np.argsort(part[: axis.modes], kind="stable")
    if np.array_equal(order, np.arange(axis.modes)):
        return theta
    return np.concatenate([pack(unpack(part, axis).selected(order), axis), joint])
