"""One mode less or more for a machine whose planes feel each other."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from rcsa_ident.base.arrays import FloatArray
from rcsa_ident.identification.levenberg_marquardt import Solution
from rcsa_ident.identification.misfit import Misfit
from rcsa_ident.identification.modal_parameters import ModalParameters
from rcsa_ident.identification.model_order import PROMISING, Trial, close_pairs, merged, new_modes
from rcsa_ident.identification.unknowns import EVERY_PAIR, CoupledLayout, Unknowns, pack, unpack


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
        left_out = [(machine, k) for k in range(machine.order)]
        left_out += [(merged(machine, low, high), high) for low, high in close_pairs(machine)]
        return [_with(solution, each.without_mode(k), np.delete(discs, k, axis=2)) for each, k in left_out]

    def more(self, solution: Solution, misfit: Misfit, i: int, band_hz: tuple[float, float]) -> list[Trial]:
        """Return the machines with one more mode in front, at the frequencies and along the shapes that promise most."""
        del i
        machine, discs = _machine(solution)
        grown = np.pad(discs, ((0, 0), (0, 0), (1, 0)))
        modes = new_modes(solution, misfit, (0, 1), band_hz, PROMISING)
        return [_with(solution, machine.with_mode(omega_n, shape, zeta), grown) for omega_n, zeta, shape in modes]


COUPLED = CoupledSteps()


def _machine(solution: Solution) -> tuple[ModalParameters, FloatArray]:
    """The machine, and its gyroscopic coupling's a and b, shape (skew, 2, m)."""
    layout = solution.layout
    assert isinstance(layout, CoupledLayout)
    assert layout.skew != EVERY_PAIR
    return unpack(solution.theta, layout.block), layout.block.discs(solution.theta)


def _with(solution: Solution, machine: ModalParameters, discs: FloatArray) -> Trial:
    old = solution.layout
    assert isinstance(old, CoupledLayout)
    layout = replace(old, modes=machine.order)
    return np.concatenate([pack(machine, layout.block, discs), solution.theta[old.tail :]]), layout
