"""Exploration: pymoo's genetic algorithm over starts, each of which takes a few damped Gauss-Newton steps."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from rcsa_ident.arrays import FloatArray
from rcsa_ident.identification.misfit import Misfit
from rcsa_ident.identification.parameters import (
    DAMPING_UNIT,
    axis_size,
    lower_triangle,
    pack,
    selected,
    split,
    unpack,
    with_mode,
    without_mode,
)
from rcsa_ident.identification.polish import Solution, polish


@dataclass(frozen=True, slots=True)
class SearchSettings:
    """How far the search looks.

    Parameters
    ----------
    modes : int
        More than a spindle has in the band: what is not needed is dropped later.
    population, generations : int
    steps : int
        Gauss-Newton steps of a candidate per generation: real work beside the search's own cost.
    """

    modes: int = 10
    population: int = 12
    generations: int = 6
    steps: int = 8


def starts(count: int, modes: int, band_hz: tuple[float, float], misfit: Misfit, rng: np.random.Generator) -> FloatArray:
    """Return random vectors, shape (count, p): frequencies spread over the band and around it, light uncoupled damping."""
    size = axis_size(modes) + 4
    low, high = 0.2 * band_hz[0], 1.08 * band_hz[1]
    theta = np.zeros((count, size))
    frequency = np.sort(rng.uniform(low, high, (count, modes)), axis=1)
    theta[:, :modes] = np.log(2.0 * np.pi * frequency)
    theta[:, modes : 3 * modes] = 0.1 * rng.standard_normal((count, 2 * modes))
    own = 3 * modes + np.flatnonzero(lower_triangle(modes)[2])
    theta[:, own] = 0.5 * np.log(2.0 * 0.05 * 2.0 * np.pi * frequency) - np.log(DAMPING_UNIT)
    theta[:, -7:-4] = [1.0, 0.1, 1.0]
    theta[:, -4:] = np.log(misfit.priors.joint)
    return theta


def explore(
    misfit: Misfit,
    settings: SearchSettings,
    band_hz: tuple[float, float],
    rng: np.random.Generator,
    report: Callable[[str, float], None] | None = None,
) -> list[Solution]:
    """Return the last population, best first, for one axis.

    Parameters
    ----------
    misfit : Misfit
        Of one axis, with a coarse model error (0.3): it smooths the landscape while the delays are found.
    band_hz : (float, float)
        Lowest and highest line.
    """
    from pymoo.algorithms.soo.nonconvex.ga import GA
    from pymoo.core.problem import Problem
    from pymoo.operators.crossover.sbx import SBX
    from pymoo.operators.mutation.pm import PM

    first = starts(settings.population, settings.modes, band_hz, misfit, rng)
    orders = (settings.modes,)
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
            theta = _by_frequency(np.asarray(individual.X, dtype=float), settings.modes)
            solution = polish(misfit, theta, orders, np.zeros((len(misfit.data.cut_ids), 2)), settings.steps, grid=32)
            inside = np.clip(solution.theta, problem.xl, problem.xu)
            reached[inside.tobytes()] = solution
            improved.append(inside)
            if report is not None:
                report("search", solution.cost)
        # what the steps have gained is inherited (Lamarck's way)
        offspring.set("X", np.array(improved))
        offspring.set("F", np.array([[reached[x.tobytes()].cost] for x in improved]))
        algorithm.tell(infills=offspring)
    last = {x.tobytes() for x in algorithm.pop.get("X")}
    return sorted((reached[key] for key in last), key=lambda s: s.cost)


def with_mode_below(theta: FloatArray, modes: int, lowest_hz: float) -> FloatArray:
    """Move the mode of least shape below the lowest line, where it stands for all that the machine does there.

    Searches end without such a mode more often than not: while the noise is coarse nothing asks for one, and later no
    small step leads there.
    """
    (part,), joint = split(theta, (modes,))
    axis = unpack(part, modes)
    weakest = int(np.argmin(np.sum(axis.psi**2, axis=1)))
    return np.concatenate([pack(with_mode(without_mode(axis, weakest), np.pi * lowest_hz, (0.2, 0.2))), joint])


def _by_frequency(theta: FloatArray, modes: int) -> FloatArray:
    """Sort the modes by frequency, so that crossover mixes like with like."""
    (part,), joint = split(theta, (modes,))
    order = np.argsort(part[:modes], kind="stable")
    if np.array_equal(order, np.arange(modes)):
        return theta
    return np.concatenate([pack(selected(unpack(part, modes), order)), joint])
