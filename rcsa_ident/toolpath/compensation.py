"""Paths to command so that a machine that gives way under its process ends where it should [bauer2013].

Two ways, of whatever machine: what it does is asked of functions. Ahead of the force, all freedoms are turned to where their springs answer
with the torques of the ideal motion, and the place they come to is commanded. Mirrored, the deviation that a simulation or a measurement
of the commanded path shows is taken off it.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from enum import StrEnum
from typing import TypeVar

import numpy as np

from rcsa_ident.base.arrays import FloatArray
from rcsa_ident.base.errors import InputError, positive
from rcsa_ident.toolpath.deviation import Deviation
from rcsa_ident.toolpath.path import ToolPath

#: Largest correction of a place [m]: one that is asked for more is not understood.
LARGEST = 2e-3
Sent = TypeVar("Sent")


class Place(StrEnum):
    """What became of a place that was to be corrected."""

    CORRECTED = "corrected"
    RAPID = "not corrected: a rapid move"
    SATURATED = "saturated: corrected by the largest that is allowed"
    JOINT_RANGE = "not corrected: the corrected place is beyond the joints' range"
    OUT_OF_REACH = "not corrected: the corrected place is out of the arm's reach"


@dataclass(frozen=True, slots=True, eq=False)
class CompensatedPath:
    """A path to command, and what it leaves.

    `correction` [m], shape (k, 3)
    `became`: of each place
    `controller`, `before`, `after`: of drives that give way to nothing; of the path as it was and of the commanded one, on the machine that
        compensates
    `draws`: of the commanded path on other machines that what is known allows
    `postures` [rad], shape (k, j): of an arm's drives along it
    `loose` [m], shape (k,): how far an arm's tool may be to either side within the play of drives that no torque holds on one
    """

    path: ToolPath
    correction: FloatArray
    became: tuple[Place, ...]
    controller: Deviation
    before: Deviation
    after: Deviation
    draws: tuple[Deviation, ...] = ()
    postures: FloatArray | None = None
    loose: FloatArray | None = None

    @property
    def limited(self) -> tuple[int, ...]:
        """Places, from 0, that are corrected by less than asked for, or not at all."""
        return tuple(k for k, each in enumerate(self.became) if each not in (Place.CORRECTED, Place.RAPID))


def ahead_of_force(
    angles: FloatArray, torques: FloatArray, twist: Callable[[FloatArray], FloatArray], place: Callable[[FloatArray], Sent]
) -> Sequence[Sent]:
    """Return the places to command along a path, q + K^-1 tau, play to the torque's side.

    `angles` [rad], shape (k, n): of all freedoms on the ideal path, those included that no drive moves
    `torques` [N m], shape (k, n): that the springs must give there: of the motion, less those of the forces on the tool
    `twist`: from torques (n,) that springs must give to how far they are turned for it (n,)
    `place`: from angles (n,) to what the machine is sent to

    Examples
    --------
    A rod of 1 m on a spring of 1e5 N m/rad that must give 100 N m:

    >>> ahead_of_force(np.zeros((1, 1)), np.full((1, 1), 100.0), lambda t: t / 1e5, lambda q: float(q[0]))
    [0.001]
    """
    if np.shape(angles) != np.shape(torques):
        raise InputError("torques", np.shape(torques), f"{np.shape(angles)}, as the angles have")
    return [place(each + twist(torque)) for each, torque in zip(angles, torques, strict=True)]


def mirrored(places: FloatArray, reached: Callable[[FloatArray], FloatArray], passes: int = 1) -> FloatArray:
    """Return the places to command, shape (k, 3) [m]: p - (p_reached - p), again from there as often as wanted.

    `places` [m], shape (k, 3): where the tool should be
    `reached`: from commanded places (k, 3) to where the tool is then, (k, 3)

    Examples
    --------
    A machine that gives way by a thousandth of where it is sent:

    >>> mirrored(np.array([[1.0, 0.0, 0.0]]), lambda sent: 1.001 * sent).round(6).tolist()
    [[0.999, 0.0, 0.0]]
    """
    if passes < 1:
        raise InputError("passes", passes, "at least one")
    commanded = np.asarray(places, dtype=float)
    for _ in range(passes):
        commanded = commanded - (reached(commanded) - places)
    return commanded


def limited(correction: FloatArray, largest: float) -> tuple[FloatArray, np.ndarray]:
    """Return corrections, shape (k, 3) [m], none longer than the largest [m], and which ones were.

    Examples
    --------
    >>> limited(np.array([[3e-3, 0.0, 4e-3], [1e-3, 0.0, 0.0]]), 2.5e-3)[0].tolist()
    [[0.0015, 0.0, 0.002], [0.001, 0.0, 0.0]]
    """
    size = np.linalg.norm(correction, axis=1, keepdims=True)
    longer = size > positive("largest correction", largest, "m")
    return np.where(longer, correction * (largest / np.where(longer, size, 1.0)), correction), longer[:, 0]
