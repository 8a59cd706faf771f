"""What gives way behind the flange along the spindle's axis: one axial tap of any tooling tells it for all of them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

import numpy as np

from rcsa_ident.base.arrays import ComplexArray, FloatArray
from rcsa_ident.base.errors import InputError
from rcsa_ident.base.shown import Shown
from rcsa_ident.base.units import to_hz
from rcsa_ident.dynamics.coordinates import Coordinate, Dof
from rcsa_ident.dynamics.poles import PoleResidue, frequencies
from rcsa_ident.dynamics.rational import fitted_poles
from rcsa_ident.dynamics.receptance import Receptance
from rcsa_ident.machine.flange_part import FlangePart, JointedFlange

#: The only direction of it.
AXIAL = (Coordinate("flange", Dof.Z),)
#: What a fit may be beside receptances without noise, and the damping ratio of poles outside the band, at least.
_TOLERANCE, _DAMPED_OUTSIDE = 1e-3, 0.1
#: Share of the frequencies at which it may feed energy in before that is said, and how much of its magnitude that is.
_MOST_ACTIVE, _ACTIVE = 0.05, 0.02
#: A machine that is known so much below or above what was tapped, as a share of the tap's ends, is said.
_SHORT_BELOW, _SHORT_ABOVE = 0.8, 1.05


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class AxialFlange(Shown):
    """The receptance of machine and spindle at the flange along the axis, with the joint's compliance in it, as poles.

    `modes`: of one input and one output [m/N]
    `band`: (float, float) [rad/s]; lowest and highest frequency at which it was measured; beyond it the poles answer
    `tooling`: that was tapped; empty where nobody knows
    """

    modes: PoleResidue
    band: tuple[float, float]
    tooling: str = ""

    def __post_init__(self) -> None:
        if self.modes.constant.shape != (1, 1):
            raise InputError("axial flange", self.modes.constant.shape, "poles of one direction")
        if not np.all(self.modes.pole.real < 0.0):
            raise InputError("axial flange", self.modes.pole.tolist(), "damped poles: negative real parts [rad/s]")

    @classmethod
    def fitted(cls, omega: FloatArray, values: ComplexArray, noise: FloatArray | None = None, tooling: str = "") -> Self:
        """Return the poles of a measured or decoupled receptance.

        `omega` [rad/s], shape (n,): rising, above 0
        `values` [m/N], shape (n,)
        `noise`, shape (n,): standard deviation of the real and of the imaginary part each
        `tooling`: that was tapped
        """
        if omega.size < 8 or not np.all(np.diff(omega) > 0.0) or omega[0] <= 0.0:
            raise InputError("axial frequencies", f"{omega.size} of them", "at least 8 that rise, above 0 [rad/s]")
        if not np.all(np.isfinite(values)):
            raise InputError("axial receptance", "not finite", "finite numbers")
        spread = None if noise is None else noise[:, None, None]
        poles, _ = fitted_poles(omega, values[:, None, None], _TOLERANCE, _DAMPED_OUTSIDE, spread)
        return cls(poles, (float(omega[0]), float(omega[-1])), tooling)

    @property
    def coordinates(self) -> tuple[Coordinate, ...]:
        """``flange.z``."""
        return AXIAL

    @property
    def part(self) -> FlangePart:
        """The same as a part of a machine, which feels nothing of the others."""
        return FlangePart(AXIAL, JointedFlange(self, None))

    def receptance(self, omega: FloatArray) -> Receptance:
        """Return the receptance over ``flange.z``, shape (n, 1, 1)."""
        return Receptance(omega, self.modes.response(omega), AXIAL, AXIAL)

    def remarks(self, band: tuple[float, float] | None) -> tuple[str, ...]:
        """Return what speaks against it: a flange that feeds energy in, or one that was tapped over less than the machine's band.

        `band`: (float, float) or None [rad/s]; at which the machine is known
        """
        told = []
        low, high = (to_hz(w) for w in self.band)
        if band is not None and (to_hz(band[0]) < _SHORT_BELOW * low or to_hz(band[1]) > _SHORT_ABOVE * high):
            told.append(
                f"along the axis it was tapped from {low:.0f} to {high:.0f} Hz, the machine is known from {to_hz(band[0]):.0f} to "
                f"{to_hz(band[1]):.0f} Hz: between them nothing but the poles that were found says how the axis moves"
            )
        values = self.modes.response(np.linspace(*self.band, 500))[:, 0, 0]
        share = float(np.mean(values.imag > _ACTIVE * np.abs(values)))
        if share > _MOST_ACTIVE:
            told.append(
                f"along the axis the flange would feed energy in at {100.0 * share:.0f} % of the frequencies: the tap's calibration or "
                "sign, or the drawing of the tooling that was tapped, is wrong"
            )
        return tuple(told)

    def __str__(self) -> str:
        low, high = (to_hz(w) for w in self.band)
        tapped = f", tapped with {self.tooling}" if self.tooling else ""
        return f"{frequencies('poles along the axis', np.abs(self.modes.pole))}, {low:.0f} to {high:.0f} Hz{tapped}"
