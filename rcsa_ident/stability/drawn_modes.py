"""Machines drawn from a tip's spread as modes: poles that all of them share, residues of each draw's own, and the limits of each."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.sparse.csgraph import connected_components

from rcsa_ident.base.arrays import ComplexArray, FloatArray
from rcsa_ident.cutting.process import MillingProcess
from rcsa_ident.dynamics.rational import common_poles, shared_residues
from rcsa_ident.stability.discretisation import FullDiscretisation
from rcsa_ident.stability.first_instability import first_loss
from rcsa_ident.stability.monodromy import MonodromyOperator
from rcsa_ident.stability.multiplier_limits import ROUGH, Growth, islands_from, longest_step
from rcsa_ident.stability.tip_modes import DAMPED_OUTSIDE, FIT_TOLERANCE, TipModes, slope_length

#: Size below which a receptance counts as so large when changes of it are weighed, as a share of its root mean square.
_FLOOR = 1e-2
#: Changes that all draws share in different amounts: those smaller than this share of the largest are left to the residues, and at most.
_SMALL, _CHANGES = 5e-3, 8
#: Distance of the poles beside each known one, in half-power bandwidths: together they move as the mode does.
_BESIDE = 0.3
#: Change of the logarithm of the depth at which secant steps end, their largest, their number, and how far they may lead away.
_NEAR, _LONGEST, _STEPS, _FAR = 0.02, 0.5, 8, 1.5
#: Share of the depth between the two looks that tell how the growth changes with it.
_APART = 0.01
#: Share of the guess from which, and tolerance to which, the limit is looked for where these steps do not find it.
_FROM, _TOLERANCE = 0.05, 5e-3
_METHOD = FullDiscretisation()


@dataclass(frozen=True, slots=True, eq=False)
class DrawnTips:
    """Tips that a machine may have, as modes, each with cutting coefficients of its own.

    `error`: norm of what the modes leave of the receptances, as a share, the worst draw's
    """

    modes: tuple[TipModes, ...]
    processes: tuple[MillingProcess, ...]
    error: float

    def limits(self, known: MonodromyOperator, speeds: FloatArray, limit: FloatArray, guess: FloatArray, max_depth: float) -> FloatArray:
        """Return the stability limit of each draw by its own period map, shape (draws, n) [m], infinite beyond `max_depth`.

        `known`: of the tip that is the middle of the draws
        `speeds`, `limit`: arrays, shape (n,) [rad/s], [m]; where limits are wanted, and those of `known`
        `guess` [m], shape (draws, n): where each search begins
        `max_depth` [m]
        """
        deepest = known.process.within_reach(1.1 * max_depth)
        cuts = [_METHOD.monodromy(modes, process) for modes, process in zip(self.modes, self.processes, strict=True)]
        step, found = longest_step(known), np.empty((len(cuts), speeds.size))
        for i, speed in enumerate(speeds.tolist()):
            slope = _slope(Growth(known, speed, step, ROUGH), min(limit[i], deepest))
            start: ComplexArray | None = None
            for k, cut in enumerate(cuts):
                growth = Growth(cut, speed, step, ROUGH)
                growth.start = start
                found[k, i] = _loss_near(growth, min(guess[k, i], deepest), slope, deepest)
                start = growth.start
        return np.where(found <= max_depth, found, np.inf)


def _slope(growth: Growth, depth: float) -> float:
    """Change of the growth with the logarithm of the depth."""
    return (growth(depth * (1.0 + _APART)) - growth(depth * (1.0 - _APART))) / (2.0 * _APART)


def _loss_near(growth: Growth, guess: float, slope: float, deepest: float) -> float:
    """Return where the growth changes its sign near a depth, else the first place where it does; infinite where it does not."""
    at, value = np.log(guess), growth(guess)
    begun = at
    for _ in range(_STEPS):
        if not slope > 0.0:
            break
        change = float(np.clip(-value / slope, -_LONGEST, _LONGEST))
        if at + change >= np.log(deepest) and value < 0.0:
            change = np.log(deepest) - at
            if change <= 0.0:
                return np.inf
        if abs(at + change - begun) > _FAR:
            break
        if abs(change) < _NEAR:
            return float(np.exp(at + change))
        before, last = value, at
        at += change
        value = growth(float(np.exp(at)))
        slope = (value - before) / (at - last)
    found = first_loss(growth, _FROM * guess, deepest, _TOLERANCE, careful_from=islands_from(growth.cut.process))
    return np.inf if found is None else found


def drawn_tips(
    omega: FloatArray, values: ComplexArray, drawn: ComplexArray, modes: TipModes, processes: Sequence[MillingProcess]
) -> DrawnTips:
    """Return drawn receptances as modes.

    Parameters
    ----------
    omega : array, shape (n,) [rad/s]
        Above 0.
    values, drawn : complex arrays, shapes (n, r, r), (draws, n, r, r) [m/N]
        The receptance in the middle of the draws, and the draws.
    modes : TipModes
        Of the middle: beside its poles those of the draws are looked for.
    processes : sequence of MillingProcess
        The cut of each draw.

    Notes
    -----
    A draw is the middle and changes of it, in amounts of its own. Poles that stand for the middle and for the largest of the changes
    alike are found by vector fitting [gustavsen1999]; with them every draw is linear in its residues, and one least squares finds all.
    """
    size = slope_length(values)
    scale = np.outer(size, size)
    scaled = np.concatenate([values[None], drawn]) * scale
    there = np.any(scaled, axis=(0, 1))
    count, group = connected_components(there, directed=False)
    parts: list[list[TipModes]] = [[] for _ in drawn]
    worst = 0.0
    for rows in (np.flatnonzero(group == k) for k in range(count)):
        block = scaled[:, :, rows][..., rows]
        if not np.any(block):
            continue
        flat = block.reshape(len(block), omega.size, -1)
        rms = np.sqrt(np.mean(np.abs(flat[0]) ** 2, axis=0))
        allowed = np.maximum(np.abs(flat[0]), _FLOOR * np.maximum(rms, _FLOOR * rms.max()))
        own = np.unique(modes.pole[np.any(modes.outputs[rows] != 0.0, axis=0)])
        curves = np.concatenate([flat[:1], _principal(flat, allowed)])
        pole = common_poles(omega, curves, _beside(own), FIT_TOLERANCE * allowed, DAMPED_OUTSIDE)
        fits, error = shared_residues(omega, flat, allowed, pole, (rows.size, rows.size))
        worst = max(worst, error)
        turn = np.diag(1.0 / size)[:, rows]
        for part, fit in zip(parts, fits[1:], strict=True):
            part.append(TipModes.joined([fit.projected(turn, turn.T)]))
    return DrawnTips(tuple(TipModes.joined(part) for part in parts), tuple(processes), worst)


def _beside(pole: ComplexArray) -> ComplexArray:
    """Each pole, and one beside it that vibrates."""
    waves = pole[pole.imag > 0.0]
    return np.concatenate([pole, waves - 1j * _BESIDE * waves.real])


def _principal(flat: ComplexArray, allowed: FloatArray) -> ComplexArray:
    """The largest changes that draws have in different amounts, shape (q, n, e), each as large as it is in the draws' mean square."""
    change = ((flat[1:] - flat[0]) / allowed).reshape(len(flat) - 1, -1)
    _, values, shapes = np.linalg.svd(change, full_matrices=False)
    count = min(int(np.sum(values > _SMALL * values[0])), _CHANGES)
    found: ComplexArray = (values[:count, None] * shapes[:count] / np.sqrt(len(change))).reshape(count, *flat.shape[1:]) * allowed
    return found


def of_draw(process: MillingProcess, factors: FloatArray | None, draws: int) -> list[MillingProcess]:
    """Return the cut of each draw: its coefficients times factors of K_tc and K_rc / K_tc, shape (draws, 2)."""
    if factors is None:
        return [process] * draws
    c = process.coefficients
    return [
        replace(process, coefficients=replace(c, tangential=float(c.tangential * f), radial_ratio=float(c.radial_ratio * g)))
        for f, g in factors
    ]
