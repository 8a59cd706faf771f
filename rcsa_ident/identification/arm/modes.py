"""One mode of the spindle more, the arm as it is."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from rcsa_ident.identification.arm.unknowns import PosedLayout, pack, unpack
from rcsa_ident.identification.levenberg_marquardt import Solution
from rcsa_ident.identification.misfit import Misfit
from rcsa_ident.identification.modal_parameters import ModalParameters
from rcsa_ident.identification.model_order import PROMISING, Trial, new_modes
from rcsa_ident.identification.unknowns import Unknowns


class PosedGrowth:
    """All modes belong to the spindle; an arm has as many as it has freedoms."""

    def groups(self, layout: Unknowns) -> int:
        """Return 1: every line feels every mode."""
        del layout
        return 1

    def more(self, solution: Solution, misfit: Misfit, i: int, band_hz: tuple[float, float]) -> list[Trial]:
        """Return the robots whose spindle has one mode more in front, at the frequencies and along the shapes that promise most."""
        del i
        spindle = _spindle(solution)
        modes = new_modes(solution, misfit, (0, 1), band_hz, PROMISING)
        return [_with(solution, spindle.with_mode(omega_n, shape, zeta)) for omega_n, zeta, shape in modes]


POSED = PosedGrowth()


def layout_of(layout: Unknowns) -> PosedLayout:
    """Return a layout that is a robot's."""
    assert isinstance(layout, PosedLayout)
    return layout


def _spindle(solution: Solution) -> ModalParameters:
    return unpack(solution.theta, layout_of(solution.layout)).spindle


def _with(solution: Solution, spindle: ModalParameters) -> Trial:
    old = layout_of(solution.layout)
    robot = replace(unpack(solution.theta, old), spindle=spindle)
    return np.concatenate([pack(robot, old), solution.theta[old.tail :]]), replace(old, modes=spindle.order)
