"""One mode less or more for a machine whose planes feel each other."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np

from rcsa_ident.base.arrays import FloatArray
from rcsa_ident.identification.coupled.parameters import DIRECTIONS, EVERY_PAIR, CoupledLayout, CoupledParameters, pack, unpack
from rcsa_ident.identification.levenberg_marquardt import Solution
from rcsa_ident.identification.misfit import Misfit
from rcsa_ident.identification.model_order import CLOSE, Trial, new_modes, rank_one
from rcsa_ident.identification.parameters import Unknowns, lower_factor

#: New modes that are tried at a time.
PROMISING = 4


class CoupledSteps:
    """All modes belong to one machine."""

    def groups(self, layout: Unknowns) -> int:
        """Return 1: every line feels every mode."""
        del layout
        return 1

    def fewer(self, solution: Solution, smallest: int) -> list[Trial]:
        """Return the machines without one of their modes, or with two close ones made one."""
        machine, discs = _machine(solution)
        if machine.order <= 2 * smallest:
            return []
        everyone = np.arange(machine.order)
        trials = [_with(solution, selected(machine, everyone != k), discs[:, :, everyone != k]) for k in everyone]
        order = np.argsort(machine.omega_n, kind="stable")
        for low, high in pairwise(order.tolist()):
            if machine.omega_n[high] < CLOSE * machine.omega_n[low]:
                trials.append(_with(solution, selected(merged(machine, low, high), everyone != high), discs[:, :, everyone != high]))
        return trials

    def more(self, solution: Solution, misfit: Misfit, i: int, band_hz: tuple[float, float]) -> list[Trial]:
        """Return the machines with one more mode in front, at the frequencies and along the shapes that promise most."""
        del i
        machine, discs = _machine(solution)
        grown = np.pad(discs, ((0, 0), (0, 0), (1, 0)))
        modes = new_modes(solution, misfit, (0, 1), band_hz, PROMISING)
        return [_with(solution, with_mode(machine, omega_n, shape, zeta), grown) for omega_n, zeta, shape in modes]


COUPLED = CoupledSteps()


def selected(machine: CoupledParameters, modes: np.ndarray) -> CoupledParameters:
    """Return the machine with some of its modes (a mask or indices), their damping as it was."""
    block = np.ix_(modes, modes)
    return CoupledParameters(
        machine.omega_n[modes],
        machine.psi[modes],
        lower_factor(machine.factor[modes]),
        machine.residual,
        machine.fixture[modes],
        machine.fixture_residual,
        machine.softening[block] if machine.softening.size else machine.softening,
        machine.skew[block] if machine.skew.size else machine.skew,
    )


def with_mode(machine: CoupledParameters, omega_n: float, psi: FloatArray, zeta: float) -> CoupledParameters:
    """Return the machine with one more mode in front, uncoupled to the others, which the fixture does not feel.

    Parameters
    ----------
    machine : CoupledParameters
    omega_n : float [rad/s]
    psi : array, shape (4,) [1/sqrt(kg)]
    zeta : float [-]
        Damping ratio.
    """
    factor = np.zeros((machine.order + 1, machine.order + 1))
    factor[0, 0], factor[1:, 1:] = np.sqrt(2.0 * zeta * omega_n), machine.factor
    return CoupledParameters(
        np.append(omega_n, machine.omega_n),
        np.concatenate([psi[None], machine.psi]),
        factor,
        machine.residual,
        np.concatenate([np.zeros((1, 2)), machine.fixture]),
        machine.fixture_residual,
        *(np.pad(each, ((1, 0), (1, 0))) if each.size else each for each in (machine.softening, machine.skew)),
    )


def _machine(solution: Solution) -> tuple[CoupledParameters, FloatArray]:
    """The machine, and its gyroscopic coupling's a and b, shape (skew, 2, m)."""
    layout = solution.layout
    assert isinstance(layout, CoupledLayout)
    assert layout.skew != EVERY_PAIR
    return unpack(solution.theta, layout), solution.theta[layout.skews].reshape(layout.skew, 2, layout.modes)


def _with(solution: Solution, machine: CoupledParameters, discs: FloatArray) -> Trial:
    old = solution.layout
    assert isinstance(old, CoupledLayout)
    layout = replace(old, modes=machine.order)
    return np.concatenate([pack(machine, layout, discs), solution.theta[old.tail :]]), layout


def merged(machine: CoupledParameters, low: int, high: int) -> CoupledParameters:
    """Return the machine whose mode `low` does, as well as one can, what `low` and `high` do."""
    both = machine.psi[[low, high]]
    psi, omega_n, fixture = machine.psi.copy(), machine.omega_n.copy(), machine.fixture.copy()
    psi[low] = rank_one((both.T @ both)[np.triu_indices(DIRECTIONS)])
    # both modes' motion of the fixture, and whichever sign the new shape has
    fixture[low] = (both @ psi[low]) @ machine.fixture[[low, high]] / (psi[low] @ psi[low])
    share = np.sum(both**2, axis=1) / max(float(np.sum(both**2)), 1e-300)
    omega_n[low] = np.exp(share @ np.log(machine.omega_n[[low, high]]))
    return replace(machine, psi=psi, omega_n=omega_n, fixture=fixture)
