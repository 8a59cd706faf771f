"""What stands behind the flange as it is believed to be, and as it may be instead.

A machine enters a tip's receptance only as W = B33 + K^-1 (eq. 12 of the coupling); neither W nor its change along a direction of the
posterior knows the tooling.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, Protocol

import numpy as np

from rcsa_ident.base.arrays import ComplexArray, FloatArray
from rcsa_ident.base.errors import InputError
from rcsa_ident.coupling.joint import LumpedJoint
from rcsa_ident.dynamics.coordinates import Coordinate, Dof, plane
from rcsa_ident.dynamics.receptance import Receptance, Substructure


@dataclass(frozen=True, slots=True, eq=False)
class JointedFlange:
    """A flange and the joint in front of it.

    `flange`: coordinates at ``flange``
    `joint`: None where the flange's receptance holds the joint's compliance already
    """

    flange: Substructure
    joint: LumpedJoint | None

    def interface(self, omega: FloatArray) -> ComplexArray:
        """Return W = B33 + K^-1, shape (n, b, b)."""
        b33 = self.flange.receptance(omega)
        if self.joint is None:
            return b33.values
        values, i = b33.values.copy(), np.arange(len(b33.rows))
        values[:, i, i] += self.joint.compliance_along(omega, [c.dof for c in b33.rows])
        return values


@dataclass(frozen=True, slots=True, eq=False)
class Perturbation:
    """Two candidates on both sides of the believed one, along a direction that is independent of the others.

    `weight`: one standard deviation over the distance of both
    """

    ahead: JointedFlange
    behind: JointedFlange
    weight: float


@dataclass(frozen=True, slots=True, eq=False)
class Doubt:
    """What is not known of a candidate.

    `rivals`: other models of the same data: how far each differs is one more direction
    `shifts`, shape (steps + rivals, u): how far what is known of toolings, in its own units, moves with each of them
    `left`, shape (u, u): covariance of what is known of toolings, the machine given
    """

    steps: Sequence[Perturbation] = ()
    rivals: Sequence[JointedFlange] = ()
    shifts: FloatArray = field(default_factory=lambda: np.zeros((0, 0)))
    left: FloatArray = field(default_factory=lambda: np.zeros((0, 0)))


class Doubtful(Protocol):
    """Whoever can tell what is not known of a machine."""

    def doubt(self, *question: Any) -> Doubt:
        """Return it for a bending plane, a spindle speed, or both."""
        ...


@dataclass(frozen=True, eq=False)
class OpenQuestion:
    """What a posterior leaves open, worked out when it is asked for; another process works it out for itself.

    `question`: what its `doubt` is asked
    """

    posterior: Doubtful
    question: tuple[Any, ...]

    @cached_property
    def answer(self) -> Doubt:
        """The answer, kept."""
        return self.posterior.doubt(*self.question)

    def __call__(self) -> Doubt:
        """Return the answer."""
        return self.answer

    def __reduce__(self) -> tuple[type[OpenQuestion], tuple[Doubtful, tuple[Any, ...]]]:
        return type(self), (self.posterior, self.question)


@dataclass(frozen=True, slots=True, eq=False)
class FlangePart:
    """Directions of the flange that feel each other, and none beside them: one bending plane, or both.

    `coordinates`: tuple of Coordinate, length b; translation and slope, plane by plane
    `doubt`: callable, returns Doubt; or None. Asked only where a spread is wanted. None where the candidate is taken for exact.
    """

    coordinates: tuple[Coordinate, ...]
    believed: JointedFlange
    doubt: Callable[[], Doubt] | None = field(default=None)

    def response(self, respond: Callable[[JointedFlange], ComplexArray]) -> tuple[ComplexArray, ComplexArray | None]:
        """Return what the believed candidate responds, shape (n, ...), and its changes along all directions, shape (p, n, ...).

        `respond`: JointedFlange to complex array
        """
        here = respond(self.believed)
        if self.doubt is None:
            return here, None
        doubt = self.doubt()
        changes = [(respond(s.ahead) - respond(s.behind)) * s.weight for s in doubt.steps]
        changes += [respond(rival) - here for rival in doubt.rivals]
        return here, np.array(changes) if changes else np.zeros((1, *here.shape), dtype=complex)


def independent_parts(flange: Receptance) -> list[tuple[Coordinate, ...]]:
    """Return the coordinates of each group that feels nothing of the others: bending planes without cross terms stand apart.

    Raises `InputError` if a bending plane is not known by translation and slope, or something else is.
    """
    axes = dict.fromkeys(c.dof.plane for c in flange.rows)
    planes: list[tuple[Coordinate, ...]] = [plane("flange", axis) for axis in axes if axis is not Dof.Z]
    whole = tuple(c for each in planes for c in each)
    if set(whole) != set(flange.rows):
        allowed = "translation and slope of each bending plane, at the flange"
        raise InputError("flange coordinates", ", ".join(str(c) for c in flange.rows), allowed)
    values = flange.block(whole).values
    return planes if not np.any(values[:, :2, 2:]) and not np.any(values[:, 2:, :2]) else [whole]
