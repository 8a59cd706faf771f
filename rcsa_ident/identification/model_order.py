"""How many modes: as many as the data pay for, by Laplace's approximation of the evidence [mackay1992]."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from itertools import pairwise

import numpy as np

from rcsa_ident.base.arrays import FloatArray
from rcsa_ident.identification.levenberg_marquardt import Solution, refine
from rcsa_ident.identification.misfit import Misfit
from rcsa_ident.identification.modal_parameters import ModalParameters
from rcsa_ident.identification.progress import Stage
from rcsa_ident.identification.unknowns import DIRECTIONS, Unknowns, pack, unpack

#: Walks down end where the evidence lies this far behind the best seen: nothing below comes back from there. The second one is
#: for a model that a walk has ended with before.
GIVE_UP, GIVE_UP_SOON = 60.0, 15.0
#: Omissions of which the cost is lowest before anything is fitted anew; the others are not tried.
TRIED = 5
#: Steps of a polish on the way down, and how many times the best trial's cost another one may have to be polished, too.
WALK, FAR = 10, 3.0
#: Mean square of a cut's residuals, over the median of all cuts, above which it contradicts the others.
OUTLYING = 25.0
#: Damping ratios with which a new mode is tried, and at how many frequencies.
NEW_DAMPING = (0.015, 0.06, 0.25)
PLACES = 30
#: Modes whose frequencies lie closer than this ratio may be one.
CLOSE = 1.2
#: New modes that are tried at a time: of a plane, and where every line feels all of them.
PROMISING_OF_PLANE, PROMISING = 3, 4

#: Told of a stage, the cost or evidence that it came to, and its solution.
Report = Callable[[Stage, float, Solution], None]
#: A vector and its layout that were not fitted yet.
Trial = tuple[FloatArray, Unknowns]


def evidence(solution: Solution, misfit: Misfit) -> float:
    """Return minus twice the log evidence, up to a constant of the data: less is better.

    cost + log det(lines' covariance) + log det(posterior information) - log det(prior information); a mode that the data do
    not need costs the determinants, one that they need costs the first term.
    """
    sign, volume = np.linalg.slogdet(solution.evaluation.hessian)
    # modes may stand in any order and each shape may have either sign: as many equal minima
    alike = 2.0 * sum(math.lgamma(modes + 1) + modes * math.log(2.0) for modes in solution.layout.modes_of_axes)
    known = misfit.prior(solution.layout).log_volume
    noise = -2.0 * sum(float(np.sum(np.log(misfit.weight(i)))) for i in range(len(misfit.data.axes)))
    value = float(solution.cost + noise + volume - known - alike)
    return value if sign > 0.0 and np.isfinite(value) else np.inf


def fewer(solution: Solution, smallest: int) -> list[Trial]:
    """Return all models with one mode less: each is left out in turn, and close ones are made one. `smallest`: fewest modes of a plane."""
    trials = []
    for k, block in solution.layout.modal:
        machine = unpack(solution.theta[solution.layout.places[k]], block)
        if machine.order > smallest * block.directions // 2:
            left_out = [(machine, mode) for mode in range(machine.order)]
            left_out += [(merged(machine, low, high), high) for low, high in close_pairs(machine)]
            trials += [_with_modes(solution, k, each.without_mode(mode), partial(np.delete, obj=mode, axis=2)) for each, mode in left_out]
    return trials


def more(solution: Solution, misfit: Misfit, k: int, band_hz: tuple[float, float]) -> list[Trial]:
    """Return the models with one more mode in front, at the frequencies and along the shapes where the linearised misfit promises most.

    A mode with shape psi adds psi psi^T / (omega_n^2 - omega^2 + 2 i zeta omega_n omega) to the flange's receptance: linear in
    the entries of psi psi^T, so that all frequencies are judged by one least-squares solution each, the other unknowns and the
    cuts' delays following.

    `solution`: with normal equations
    `k`: block of modes, of a plane or of a whole machine
    `band_hz`: (float, float) [Hz]; lowest and highest line
    """
    layout, block = solution.layout, dict(solution.layout.modal)[k]
    axes, count = (range(len(misfit.data.axes)), PROMISING) if block.directions == DIRECTIONS else ((k,), PROMISING_OF_PLANE)
    machine = unpack(solution.theta[layout.places[k]], block)
    modes = new_modes(solution, misfit, tuple(axes), band_hz, count)
    return [
        _with_modes(solution, k, machine.with_mode(omega_n, shape, zeta), partial(np.pad, pad_width=((0, 0), (0, 0), (1, 0))))
        for omega_n, zeta, shape in modes
    ]


def _with_modes(solution: Solution, k: int, machine: ModalParameters, discs: Callable[[FloatArray], FloatArray]) -> Trial:
    """The vector with other modes in block `k`; `discs` makes their gyroscopic coupling's a and b of the old one's."""
    old, block = solution.layout, dict(solution.layout.modal)[k]
    place, layout = old.places[k], old.with_modes(k, machine.order)
    own = pack(machine, dict(layout.modal)[k], discs(block.discs(solution.theta[place])))
    return np.concatenate([solution.theta[: place.start], own, solution.theta[place.stop :]]), layout


def drop_modes(
    solution: Solution,
    misfit: Misfit,
    report: Report | None = None,
    smallest: int = 2,
    give_up: float = GIVE_UP,
) -> Solution:
    """Return the best of the models with ever fewer modes.

    Every mode of every axis in turn is left out, and close modes are merged; the likeliest omissions get two steps, the two best
    of them are polished and the better one is kept, until the evidence has clearly turned.

    `solution`: polished
    `report`: callable of (stage, cost, solution)
    `smallest`: fewest modes of an axis
    `give_up`: the walk ends where the evidence lies this far behind the best seen
    """
    best, best_evidence = solution, evidence(solution, misfit)
    here = solution
    while True:
        nuisance = here.evaluation.nuisance
        trials = [(misfit.evaluate(theta, layout, nuisance).cost, theta, layout) for theta, layout in fewer(here, smallest)]
        if not trials:
            break
        trials.sort(key=lambda t: t[0])
        tried = [refine(misfit, theta, layout, nuisance, max_steps=2) for _, theta, layout in trials[:TRIED]]
        here = _polished(tried, misfit, 2, WALK)
        value = evidence(here, misfit)
        if report is not None:
            report(Stage.MODES, value, here)
        if value < best_evidence:
            best, best_evidence = here, value
        elif value > best_evidence + give_up:
            break
    return best if best is solution else _polished([best], misfit, 1)


def exchange_modes(
    solution: Solution,
    misfit: Misfit,
    band_hz: tuple[float, float],
    report: Report | None = None,
    rounds: int = 3,
) -> Solution:
    """Return the best model that is reached by adding a mode where it helps most and dropping those that are not needed.

    A walk downwards alone can't mend a mode that once settled in the wrong place; this one can. It ends with the first round
    that gains nothing.

    `solution`: polished
    `band_hz`: (float, float) [Hz]; lowest and highest line
    `report`: callable of (stage, cost, solution)
    `rounds`: most rounds
    """
    best, best_evidence = solution, evidence(solution, misfit)
    for _ in range(rounds):
        trials = []
        for k, _ in best.layout.modal:
            for theta, layout in more(best, misfit, k, band_hz):
                trials.append(refine(misfit, theta, layout, best.evaluation.nuisance, max_steps=6))
        reached = drop_modes(_polished(trials, misfit, 2), misfit, give_up=GIVE_UP_SOON)
        value = evidence(reached, misfit)
        if report is not None:
            report(Stage.EXCHANGE, reached.cost, reached)
        if value >= best_evidence - 1.0:
            break
        best, best_evidence = reached, value
    return best


def grow_modes(solution: Solution, misfit: Misfit, band_hz: tuple[float, float]) -> Solution:
    """Return the model with one more mode for each axis, whether or not the evidence asks for it.

    A machine has more modes than the data can show. A model that leaves them out is sure of what it cannot know; with them the
    posterior is as wide as it should be.

    `solution`: polished
    `band_hz`: (float, float) [Hz]; lowest and highest line
    """
    for k, _ in solution.layout.modal:
        trials = []
        for theta, layout in more(solution, misfit, k, band_hz):
            trials.append(refine(misfit, theta, layout, solution.evaluation.nuisance, max_steps=6))
        solution = _polished(trials, misfit, 1)
    return solution


def new_modes(
    solution: Solution, misfit: Misfit, axes: Sequence[int], band_hz: tuple[float, float], count: int
) -> list[tuple[float, float, FloatArray]]:
    """Return natural frequency [rad/s], damping ratio and shape of the modes that promise most, best first; see `promising`.

    `solution`: with normal equations; its compliance tells what the shape has an entry for
    `axes`: whose lines such a mode moves
    `band_hz`: (float, float) [Hz]
    """
    linear = solution.evaluation.linear
    assert linear is not None
    entries = linear.compliance[axes[0]].shape[1]
    directions = int(np.sqrt(2 * entries))
    place_hz = 2.0 * np.pi * np.geomspace(0.3 * band_hz[0], 2.5 * band_hz[1], PLACES)
    frequency, damping = np.tile(place_hz, len(NEW_DAMPING)), np.repeat(NEW_DAMPING, PLACES)
    rows = {}
    for i in axes:
        omega = np.repeat(misfit.data.axes[i].omega, misfit.data.axes[i].outputs)[:, None]
        shape = 1.0 / (frequency**2 - omega**2 + 2j * damping * frequency * omega)
        columns = (linear.compliance[i][:, None, :] * shape[:, :, None]).reshape(-1, frequency.size * entries)
        rows[i] = np.concatenate([columns.real, columns.imag])
    gradient, own, mixed = linear.border(rows, entries, solution.evaluation.residual)
    posterior = np.linalg.solve(solution.evaluation.hessian, np.column_stack([mixed, linear.gradient]))
    promise, shapes = np.zeros(frequency.size), np.zeros((frequency.size, directions))
    for k in range(frequency.size):
        part = slice(entries * k, entries * (k + 1))
        matrix = own[k] - mixed[:, part].T @ posterior[:, part] + 1e-9 * np.trace(own[k]) * np.eye(entries)
        right = gradient[part] - mixed[:, part].T @ posterior[:, -1]
        shapes[k] = rank_one(-np.linalg.solve(matrix, right))
        # what the nearest rank-one shape keeps of the promise
        kept = np.outer(shapes[k], shapes[k])[np.triu_indices(directions)]
        promise[k] = 2.0 * kept @ right + kept @ matrix @ kept
    if not np.all(np.isfinite(promise)):
        raise FloatingPointError("no finite promise of another mode")
    best = promise.reshape(len(NEW_DAMPING), PLACES).argmin(axis=0) * PLACES + np.arange(PLACES)
    hill = promise[best]
    # one of each hill: its neighbours lead to the same place
    tops = np.flatnonzero((hill <= np.append(np.inf, hill[:-1])) & (hill <= np.append(hill[1:], np.inf)))
    chosen = best[tops[np.argsort(hill[tops], kind="stable")][:count]]
    return [(float(frequency[k]), float(damping[k]), shapes[k]) for k in chosen]


def close_pairs(machine: ModalParameters) -> list[tuple[int, int]]:
    """Return each two modes that are neighbours and stand close, by frequency."""
    order = np.argsort(machine.omega_n, kind="stable")
    return [(low, high) for low, high in pairwise(order.tolist()) if machine.omega_n[high] < CLOSE * machine.omega_n[low]]


def merged(machine: ModalParameters, low: int, high: int) -> ModalParameters:
    """Return the machine whose mode `low` does, as well as one can, what `low` and `high` do; `high` is still there."""
    both = machine.psi[[low, high]]
    psi, omega_n, places = machine.psi.copy(), machine.omega_n.copy(), machine.places.copy()
    psi[low] = rank_one(np.array([both[:, i] @ both[:, j] for i, j in zip(*np.triu_indices(both.shape[1]), strict=True)]))
    # both modes' motion of the other places, and whichever sign the new shape has
    places[low] = (machine.places[[low, high]].T @ both) @ psi[low] / (psi[low] @ psi[low])
    share = np.sum(both**2, axis=1) / max(float(np.sum(both**2)), 1e-300)
    omega_n[low] = np.exp(share @ np.log(machine.omega_n[[low, high]]))
    return replace(machine, psi=psi, omega_n=omega_n, places=places)


def rank_one(entries: FloatArray) -> FloatArray:
    """Shape psi whose psi psi^T is nearest to a symmetric matrix, given by its upper triangle's rows: (tt, tr, rr) of one plane."""
    size = int(np.sqrt(2 * entries.size))
    matrix = np.zeros((size, size))
    rows, cols = np.triu_indices(size)
    matrix[rows, cols] = matrix[cols, rows] = entries
    values, vectors = np.linalg.eigh(matrix)
    return np.sqrt(max(values[-1], 1e-4)) * vectors[:, -1]


def _polished(trials: list[Solution], misfit: Misfit, count: int, steps: int = 30) -> Solution:
    """The best of the first `count` trials after they have been polished; what lies far behind is left out."""
    trials = sorted(trials, key=lambda s: s.cost)[:count]
    near = [trials[0], *(t for t in trials[1:] if t.cost < FAR * trials[0].cost)]
    return min((refine(misfit, t.theta, t.layout, t.evaluation.nuisance, steps) for t in near), key=lambda s: s.cost)


def model_error(solution: Solution, misfit: Misfit, smallest: float = 5e-4) -> tuple[float, ...]:
    """Return, per axis, the share of each line that the residuals show to be unexplained beyond the records' noise.

    The share f solves sum |rest|^2 / (variance + f^2 |h|^2 / 2) = degrees of freedom, the data's less those that parameters
    and cuts have used.

    `solution`: with normal equations
    `smallest`: floor: no simulated force is better than that
    """
    layout, data = solution.layout, misfit.data
    jacobian = misfit.prior(layout).jacobian
    # parameters that the data have moved away from their priors
    used = solution.theta.size - float(np.trace(np.linalg.solve(solution.evaluation.hessian, jacobian.T @ jacobian)))
    used += 2.0 * len(data.cut_ids)
    free = max(1.0 - used / misfit.points, 0.1)
    shares = []
    for i, (axis, rest) in enumerate(zip(data.axes, solution.evaluation.residual.lines, strict=True)):
        weight = misfit.weight(i).ravel()
        # beside cuts, what hammer tests leave unexplained is theirs alone: see `cut_weights`
        asked = np.repeat((axis.cut < data.cuts) | (data.cuts == 0), axis.outputs)
        # a cut that contradicts the others does not count against them here, either
        counted = np.repeat(misfit.cut_weight[axis.cut], axis.outputs)
        squares = counted * (rest[: weight.size] ** 2 + rest[weight.size :] ** 2) / weight
        size = axis.power.ravel()
        freedom = 2.0 * float(np.sum(asked)) * free
        shares.append(unexplained_share(squares[asked], axis.variance.ravel()[asked], size[asked], freedom, smallest))
    return tuple(shares)


def cut_weights(solution: Solution, misfit: Misfit) -> FloatArray:
    """Return a factor on each cut's weights, shape (k,): 1, or less for a cut whose lines miss the model far more than most do.

    A cut whose mean square is more than `OUTLYING` times the median gets as much variance as it shows, a hammer test beside cuts
    whatever it shows: nobody else knows how well it was hit.
    """
    cuts = len(misfit.data.cut_ids)
    squares, lines = np.zeros(cuts), np.zeros(cuts)
    for i, (axis, rest) in enumerate(zip(misfit.data.axes, solution.evaluation.residual.lines, strict=True)):
        weight = misfit.weight(i)
        each = (rest[: weight.size] ** 2 + rest[weight.size :] ** 2).reshape(weight.shape).sum(axis=1)
        squares += np.bincount(axis.cut, each, minlength=cuts)
        lines += 2.0 * axis.outputs * np.bincount(axis.cut, minlength=cuts)
    # as the cut would stand with its full weight
    mean = squares / np.maximum(lines, 1.0) / misfit.cut_weight
    own = np.arange(cuts) < misfit.data.cuts if misfit.data.cuts else np.ones(cuts, dtype=bool)
    usual = float(np.median(mean[own & (lines > 0.0)])) if np.any(own & (lines > 0.0)) else 0.0
    out = mean > np.where(own, OUTLYING, 1.0) * usual
    return np.where(out & (usual > 0.0), usual / np.maximum(mean, 1e-300), 1.0)


def unexplained_share(squares: FloatArray, noise: FloatArray, size: FloatArray, freedom: float, smallest: float) -> float:
    """Return the share f with sum squares / (noise + f^2 size / 2) = freedom, `smallest` at least and 1 at most.

    By bisection of its logarithm: the sum falls with it.

    `squares`, shape (n,): squared residuals of lines, real and imaginary part together
    `noise`, shape (n,): variance of the real and of the imaginary part each
    `size`, shape (n,): power of the lines
    """
    low, high = smallest, 1.0
    # lines of nothing, in a record without noise, say nothing about shares
    informative = (noise > 0.0) | (size > 0.0)
    squares, noise, size = squares[informative], noise[informative], size[informative]
    if np.sum(squares / (noise + 0.5 * low**2 * size)) <= freedom:
        return smallest
    for _ in range(60):
        middle = float(np.sqrt(low * high))
        if np.sum(squares / (noise + 0.5 * middle**2 * size)) > freedom:
            low = middle
        else:
            high = middle
    return high
