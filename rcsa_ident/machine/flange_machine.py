"""A machine that is known by its flange's receptance: modes, a measurement, or another structure."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from rcsa_ident.base.arrays import FloatArray, frozen
from rcsa_ident.base.errors import InputError
from rcsa_ident.base.units import to_hz
from rcsa_ident.coupling.joint import LumpedJoint
from rcsa_ident.dynamics.coordinates import Coordinate, Dof
from rcsa_ident.dynamics.receptance import Receptance, Substructure
from rcsa_ident.machine.axial_flange import AxialFlange
from rcsa_ident.machine.flange_part import FlangePart, JointedFlange, independent_parts
from rcsa_ident.machine.machine import STEP, Machine
from rcsa_ident.machine.measured import MeasuredFlange


@dataclass(frozen=True, eq=False, repr=False)
class FlangeMachine(Machine):
    """A machine that is known by its flange's receptance: modes, a measurement, or another structure, taken for exact.

    Parameters
    ----------
    flanges : tuple of Substructure
        Coordinates at ``flange``, each of one substructure alone; those of one feel nothing of another's.
    known : (float, float) [rad/s]
        Lowest and highest frequency at which the flange is known.
    joint : LumpedJoint, mapping of Dof to LumpedJoint, or None
        Of all bending planes, or by the planes' machine axes. None (or not in the mapping) where the flange holds the joint's compliance,
        as one that was decoupled from clamped tool-holders does.
    name : str
    ends : bool
        Whether nothing at all is known beyond `known`, as of a measurement.
    axial : AxialFlange or None
        What an axial tap showed.
    assumed : tuple of str
        What was remarked as its file was read.

    Examples
    --------
    >>> from rcsa_ident.dynamics.modal import normal_modes
    >>> from rcsa_ident.dynamics.coordinates import plane
    >>> modes = normal_modes([6000.0], [0.05], [[0.2, 0.1]], plane("flange"))
    >>> machine = FlangeMachine((modes,), (600.0, 30_000.0), LumpedJoint(3e9, 6e6))
    >>> machine.receptance([1000.0]).values.shape
    (1, 2, 2)
    """

    flanges: tuple[Substructure, ...]
    known: tuple[float, float]
    joint: LumpedJoint | Mapping[Dof, LumpedJoint] | None = None
    name: str = "flange"
    ends: bool = False
    axial: AxialFlange | None = None
    assumed: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        if not self.flanges or not 0.0 <= self.known[0] < self.known[1]:
            raise InputError("flange", f"{len(self.flanges)} from {self.known[0]:g} to {self.known[1]:g} rad/s", "one or more, in a band")
        taken = [c for part in self.parts for c in part.coordinates]
        twice = dict.fromkeys(str(c) for c in taken if taken.count(c) > 1)
        if twice:
            raise InputError("flange coordinates", f"{', '.join(twice)} of several flanges", "each bending plane of one flange alone")

    @cached_property
    def parts(self) -> tuple[FlangePart, ...]:
        """Bending planes, or both together where they feel each other."""
        found = []
        for flange in self.flanges:
            look = flange.receptance(frozen(np.linspace(*self.known, 5)))
            for group in independent_parts(look):
                own = flange if group == look.rows else _Group(flange, group)
                found.append(FlangePart(group, JointedFlange(own, self._joint(group))))
        return tuple(found)

    @cached_property
    def remarks(self) -> tuple[str, ...]:
        """What speaks against everything that is computed with it: frequencies that lie too far apart, an axis that feeds energy in."""
        found = [*self.assumed]
        for flange in self.flanges:
            if isinstance(flange, MeasuredFlange):
                low, high = max(flange.band[0], self.known[0]), min(flange.band[1], self.known[1])
                omega = self.lines()
                remark = flange.coarse(omega[(omega >= low) & (omega <= high)])
                if remark is not None:
                    found.append(remark.of(", ".join(c.dof.upper() for c in flange.coordinates if not c.dof.is_slope)))
        return (*found, *(() if self.axial is None else self.axial.remarks(self.band)))

    def _joint(self, group: tuple[Coordinate, ...]) -> LumpedJoint | None:
        if not isinstance(self.joint, Mapping):
            return self.joint
        first, *others = (self.joint.get(c.dof.plane) for c in group)
        if any(each != first for each in others):
            raise InputError("flange joint", "another one for X than for Y", "one joint for bending planes that feel each other")
        return first

    @property
    def band(self) -> tuple[float, float]:
        """Lowest and highest frequency at which the flange is known [rad/s]."""
        return self.known

    def lines(self, beyond: float = 1.0) -> FloatArray:
        """Return frequencies [rad/s] 1 Hz apart; of a measurement between its first and last one, whatever is asked for beyond."""
        if not self.ends:
            return super().lines(beyond)
        low, high = (w / (2.0 * np.pi) for w in self.known)
        inner = np.arange(np.ceil(low / STEP + 1e-9), np.floor(high / STEP - 1e-9) + 0.5) * STEP
        return 2.0 * np.pi * np.concatenate([[low], inner[(inner > low) & (inner < high)], [high]])

    def __str__(self) -> str:
        low, high = (to_hz(w) for w in self.known)
        return f"{self.name}: {', '.join(axis.upper() for axis in self.axes)}, {low:.0f} to {high:.0f} Hz"


@dataclass(frozen=True, eq=False)
class _Group:
    """Some of a flange's directions, which feel nothing of the others."""

    flange: Substructure
    coordinates: tuple[Coordinate, ...]

    def receptance(self, omega: FloatArray) -> Receptance:
        return self.flange.receptance(omega).block(self.coordinates)
