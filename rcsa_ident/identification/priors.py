"""What is known before any cut: gentle Gaussian priors in place of hard boxes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rcsa_ident.arrays import FloatArray
from rcsa_ident.identification.parameters import DAMPING_UNIT, axis_size, lower_triangle, split


@dataclass(frozen=True, slots=True)
class Priors:
    """Means and standard deviations; wide enough for any spindle with a hollow-taper or steep-taper interface.

    Parameters
    ----------
    frequency_hz, frequency_spread : float [Hz], [-]
        Centre of the natural frequencies and spread of their logarithm.
    shape : float [1/sqrt(kg)]
        Of a mass-normalised shape: 1 is a modal mass of 1 kg at the flange.
    damping_ratio, damping_spread : float [-]
        Centre of a mode's own damping ratio and spread of its logarithm.
    damping_coupling : float [-]
        Spread of the damping factor's off-diagonal, in its unit.
    residual : float [-]
        Spread of the residual compliance's factor, in its unit of sqrt(1 nm/N).
    joint : tuple of float
        Centres of k_t [N/m], k_r [N m/rad], c_t [N s/m], c_r [N m s/rad].
    joint_spread : float [-]
        Of their logarithms.
    """

    frequency_hz: float = 1500.0
    frequency_spread: float = 1.0
    shape: float = 1.0
    damping_ratio: float = 0.04
    damping_spread: float = 0.8
    damping_coupling: float = 0.6
    residual: float = 3.0
    joint: tuple[float, float, float, float] = (2e9, 5e6, 1e3, 10.0)
    joint_spread: float = 1.5


def prior_rows(theta: FloatArray, orders: tuple[int, ...], priors: Priors) -> tuple[FloatArray, FloatArray]:
    """Return the priors as residuals with unit variance, shape (p,), and their Jacobian, shape (p, p).

    A mode's damping ratio is prior-bound through its own diagonal, 2 log L_nn - log(2 zeta omega_n), so its row has two
    entries; every other row has one.
    """
    parts, joint = split(theta, orders)
    residual = np.empty(theta.size)
    jacobian = np.zeros((theta.size, theta.size))
    first = 0
    for part, m in zip(parts, orders, strict=True):
        diagonal = lower_triangle(m)[2]
        spread = np.concatenate(
            [
                np.full(m, priors.frequency_spread),
                np.full(2 * m, priors.shape),
                np.where(diagonal, 0.5 * priors.damping_spread, priors.damping_coupling),
                np.full(3, priors.residual),
            ]
        )
        centre = np.zeros(part.size)
        centre[:m] = np.log(2.0 * np.pi * priors.frequency_hz)
        own = 3 * m + np.flatnonzero(diagonal)
        centre[own] = 0.5 * (np.log(2.0 * priors.damping_ratio) + part[:m]) - np.log(DAMPING_UNIT)
        block = slice(first, first + axis_size(m))
        residual[block] = (part - centre) / spread
        jacobian[range(block.start, block.stop), range(block.start, block.stop)] = 1.0 / spread
        jacobian[first + own, first + np.arange(m)] = -0.5 / spread[own]
        first += axis_size(m)
    residual[first:] = (joint - np.log(priors.joint)) / priors.joint_spread
    jacobian[range(first, theta.size), range(first, theta.size)] = 1.0 / priors.joint_spread
    return residual, jacobian


def log_volume(orders: tuple[int, ...], priors: Priors) -> float:
    """Return log det of the priors' information matrix: the evidence compares it with the posterior's."""
    size = sum(axis_size(m) for m in orders) + 4
    jacobian = prior_rows(np.zeros(size), orders, priors)[1]
    return float(2.0 * np.linalg.slogdet(jacobian)[1])
