"""A spindle as modes at its flange, one bending plane per machine axis."""

from __future__ import annotations

from dataclasses import dataclass

from rcsa_ident.base.arrays import FloatArray
from rcsa_ident.dynamics.coordinates import Coordinate
from rcsa_ident.dynamics.modal import ModalModel
from rcsa_ident.dynamics.receptance import Receptance


@dataclass(frozen=True, slots=True)
class Spindle:
    """Modes of machine and spindle at the flange, in one bending plane. `modes`: coordinates ``flange`` translation and slope."""

    modes: ModalModel

    @property
    def coordinates(self) -> tuple[Coordinate, ...]:
        """Translation and slope of the flange."""
        return self.modes.coordinates

    def receptance(self, omega: FloatArray) -> Receptance:
        """Return the flange's receptance B33 ([inprocess], eq. 13), shape (n, 2, 2)."""
        return self.modes.receptance(omega)
