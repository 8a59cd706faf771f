"""What is known before any cut: gentle Gaussian priors in place of hard boxes."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Protocol

import numpy as np

from rcsa_ident.base.arrays import FloatArray, frozen


@dataclass(frozen=True, slots=True)
class Priors:
    """Means and standard deviations; wide enough for any spindle with a hollow-taper or steep-taper interface.

    `frequency_hz`, `frequency_spread`: float [Hz], [-]; centre of the natural frequencies and spread of their logarithm
    `shape` [1/sqrt(kg)]: spread of a mass-normalised shape: 1 is a modal mass of 1 kg at the flange
    `damping_ratio`, `damping_spread` [-]: centre of a mode's own damping ratio and spread of its logarithm
    `damping_coupling` [-]: spread of the damping factor's off-diagonal, in its unit
    `residual` [-]: spread of the residual compliance's factor, in its unit of sqrt(1 nm/N)
    `joint`: centres of k_t [N/m], k_r [N m/rad], c_t [N s/m], c_r [N m s/rad]
    `joint_spread` [-]: spread of the logarithms of these
    `softening` [-]: spread of the stiffness' change from the middle of the campaign's speeds to its ends, as a share
    `standstill`: (float, float) [-]; spreads of the shares by which natural frequencies and damping differ while the spindle stands still
    `skew` [-]: spread of an entry of the gyroscopic coupling G: 0.05 splits a pair of modes at 20 000 rev/min by 8 Hz to either side
    `pull` [sqrt(kg)]: spread of what the housing's motion pulls a mode of a carried spindle with: a shaft of some kilograms
    `tooth_angle` [rad]: spread of a clamping's unknown tooth angle: wider than a turn, any angle will do
    """

    frequency_hz: float = 1500.0
    frequency_spread: float = 1.2
    shape: float = 0.6
    damping_ratio: float = 0.04
    damping_spread: float = 1.0
    damping_coupling: float = 0.7
    residual: float = 2.0
    joint: tuple[float, float, float, float] = (2e9, 5e6, 1e3, 10.0)
    joint_spread: float = 1.5
    softening: float = 0.03
    standstill: tuple[float, float] = (0.01, 0.2)
    skew: float = 0.05
    pull: float = 2.0
    tooth_angle: float = 10.0


class Known(Protocol):
    """What is known of a vector beforehand, as residuals of unit variance that change linearly with it."""

    @property
    def jacobian(self) -> FloatArray:
        """Derivative of the residuals, shape (p, p)."""
        ...

    @property
    def information(self) -> FloatArray:
        """jacobian^T jacobian, shape (p, p)."""
        ...

    @property
    def log_volume(self) -> float:
        """log det of the information matrix."""
        ...

    def residual(self, theta: FloatArray) -> FloatArray:
        """Return the residuals at a vector, shape (p,)."""
        ...


@dataclass(frozen=True, eq=False)
class PriorRows:
    """The priors as residuals of unit variance, (theta - centre) / spread, where a mode's damping follows its frequency.

    `centre`, `spread`, shape (p,)
    `own`: diagonal entries of the damping factors: 2 log L_nn - log(2 zeta omega_n) is what is known, so these rows have a second entry, at
        `frequency`
    `frequency`: places of the modes' frequencies, in the order of `own`
    `jacobian`, shape (p, p): derivative of the residuals; it is the same for every vector
    """

    centre: FloatArray
    spread: FloatArray
    own: np.ndarray
    frequency: np.ndarray
    jacobian: FloatArray

    @cached_property
    def information(self) -> FloatArray:
        """jacobian^T jacobian, shape (p, p)."""
        return frozen(self.jacobian.T @ self.jacobian)

    @property
    def log_volume(self) -> float:
        """log det of the priors' information matrix: the evidence compares it with the posterior's."""
        return float(-2.0 * np.sum(np.log(self.spread)))

    def residual(self, theta: FloatArray) -> FloatArray:
        """Return the residuals at a vector, shape (p,)."""
        away = theta - self.centre
        away[self.own] -= 0.5 * theta[self.frequency]
        return away / self.spread
