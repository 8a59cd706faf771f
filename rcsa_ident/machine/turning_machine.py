"""A machine whose spindle turns: modes of both bending planes with gyroscopic moments, at any spindle speed."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from rcsa_ident.base.errors import InputError
from rcsa_ident.base.units import to_hz, to_rpm
from rcsa_ident.coupling.joint import LumpedJoint
from rcsa_ident.dynamics.turning_modes import TurningModes
from rcsa_ident.machine.axial_flange import AxialFlange
from rcsa_ident.machine.flange_part import FlangePart, JointedFlange
from rcsa_ident.machine.machine import Machine
from rcsa_ident.machine.mode_synthesis import FLANGE


@dataclass(frozen=True, eq=False, repr=False)
class TurningMachine(Machine):
    """A machine as modes at its flange that turn with the spindle, and with them the tool-holders on it; taken for exact.

    `modes`: over `FLANGE`, at the speed at which the machine stands
    `known`: (float, float) [rad/s]; lowest and highest frequency at which it is known
    `speeds`: (float, float) [rad/s]; lowest and highest spindle speed at which it is known
    `joint`: None where the modes hold the joint's compliance
    `axial`: what an axial tap showed
    """

    modes: TurningModes
    known: tuple[float, float]
    speeds: tuple[float, float]
    joint: LumpedJoint | None = None
    name: str = "turning spindle"
    axial: AxialFlange | None = None

    def __post_init__(self) -> None:
        if self.modes.coordinates != FLANGE:
            found = ", ".join(str(c) for c in self.modes.coordinates)
            raise InputError("modes", f"over {found}", f"over {', '.join(str(c) for c in FLANGE)}")
        if not 0.0 <= self.known[0] < self.known[1]:
            raise InputError("known", self.known, "a lowest and a highest frequency [rad/s]")
        if not 0.0 < self.speeds[0] <= self.speeds[1]:
            raise InputError("speeds", self.speeds, "a lowest and a highest spindle speed above 0 [rad/s]")

    @cached_property
    def parts(self) -> tuple[FlangePart, ...]:
        """Both bending planes, which feel each other."""
        return (FlangePart(FLANGE, JointedFlange(self.modes, self.joint)),)

    @property
    def band(self) -> tuple[float, float]:
        """Lowest and highest frequency at which it is known [rad/s]."""
        return self.known

    @property
    def turning(self) -> float:
        """Spindle speed of the machine and of the tool-holders on it [rad/s]."""
        return self.modes.speed

    @property
    def speed_range(self) -> tuple[float, float]:
        """Lowest and highest spindle speed at which it is known [rad/s]."""
        return self.speeds

    def at(self, speed: float | None) -> TurningMachine:
        """Return the machine at a spindle speed [rad/s], by default as it stands; beyond its speeds it is that of the nearest one."""
        return self if speed is None else replace(self, modes=self.modes.at(float(np.clip(speed, *self.speeds))))

    def speed_answered(self, speed: float | None = None) -> float:
        """Return the spindle speed [rad/s] of what `at(speed)` answers."""
        return self.at(speed).modes.speed

    def __str__(self) -> str:
        low, high = (to_hz(w) for w in self.known)
        slow, fast = (to_rpm(w) for w in self.speeds)
        return f"{self.name}: {self.modes.omega_n.size} modes, {low:.0f} to {high:.0f} Hz, {slow:.0f} to {fast:.0f} rev/min"
