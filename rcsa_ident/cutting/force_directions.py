"""In how many directions cuts push the tool: what tells apart planes that feel each other.

A cut's tooth-passing line pushes along one complex direction (Fx, Fy). Lines of one frequency whose directions are all alike tell the
motion under that direction alone, however many they are. The smallest singular value of their unit vectors, one below the other, says
how much the direction across them is told: 0 where it is not, 1 / sqrt(2) of the root of their number where all are told alike.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from rcsa_ident.base.arrays import ComplexArray, FloatArray
from rcsa_ident.cutting.coefficients import CuttingCoefficients
from rcsa_ident.cutting.conditions import CuttingConditions
from rcsa_ident.cutting.cutter import Cutter
from rcsa_ident.cutting.force import force_and_slope

#: Ratio of the ends of a band of frequencies in which a machine is taken for the same.
BAND = 1.35
#: Least force of a line [N].
LEAST_FORCE = 1e-3
#: What a second set of cuts gains at least to be worth another set-up: ratio of mean smallest singular values.
WORTH = 1.2


def told_across(omega: FloatArray, force: ComplexArray) -> tuple[FloatArray, FloatArray]:
    """Return middles of bands [rad/s] and how much the least told direction of the force is told in each, from 0 to 1 / sqrt(2).

    `omega` [rad/s], shape (n,)
    `force` [N], shape (n, 2): of each line along X and Y, up to a phase; bands with one line alone tell nothing across it
    """
    size = np.linalg.norm(force, axis=1)
    # what rounding leaves of a constant force is no line
    pushed = size > LEAST_FORCE
    omega, unit = omega[pushed], force[pushed] / size[pushed, None]
    if not omega.size:
        return np.zeros(0), np.zeros(0)
    number = np.floor(np.log(omega / omega.min()) / np.log(BAND)).astype(int)
    bands = np.unique(number)
    found = np.zeros(bands.size)
    for k, b in enumerate(bands):
        values = np.linalg.svd(unit[number == b], compute_uv=False)
        found[k] = values[-1] / np.sqrt(np.sum(number == b)) if values.size == 2 else 0.0
    return omega.min() * BAND ** (bands + 0.5), found


def gain_across(one: Sequence[tuple[FloatArray, ComplexArray]], other: Sequence[tuple[FloatArray, ComplexArray]]) -> float:
    """Return how much better the least told direction is told where half of some cuts are made in another way [-].

    `one`, `other`: sequences of (omega, force); lines of the same cuts, made the first way and the other
    """
    mixed = [each[k % 2] for k, each in enumerate(zip(one, other, strict=True))]
    before, after = (_mean_told(lines) for lines in (one, mixed))
    return after / before if before > 0.0 else (np.inf if after > 0.0 else 1.0)


def _mean_told(lines: Sequence[tuple[FloatArray, ComplexArray]]) -> float:
    told = told_across(np.concatenate([omega for omega, _ in lines]), np.concatenate([force for _, force in lines]))[1]
    return float(np.mean(told)) if told.size else 0.0


def turned(lines: Sequence[tuple[FloatArray, ComplexArray]]) -> list[tuple[FloatArray, ComplexArray]]:
    """Return the lines of the same cuts fed at right angles: from +X to +Y."""
    return [(omega, np.stack([-force[:, 1], force[:, 0]], axis=1)) for omega, force in lines]


def lines_of(
    cutter: Cutter, conditions: CuttingConditions, coefficients: CuttingCoefficients, highest: float
) -> tuple[FloatArray, ComplexArray]:
    """Return frequencies [rad/s] and forces [N], shape (n, 2), of a cut's tooth-passing lines up to a frequency [rad/s]."""
    order = np.arange(cutter.teeth, int(highest / conditions.spindle_speed) + 1, cutter.teeth)
    return order * conditions.spindle_speed, force_and_slope(cutter, conditions, coefficients, order)[0]
