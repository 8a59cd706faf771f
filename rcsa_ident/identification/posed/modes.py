"""One mode of the spindle less or more, the arm as it is."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from rcsa_ident.identification.coupled.modes import PROMISING, merged, selected, with_mode
from rcsa_ident.identification.coupled.parameters import CoupledParameters
from rcsa_ident.identification.levenberg_marquardt import Solution
from rcsa_ident.identification.misfit import Misfit
from rcsa_ident.identification.model_order import CLOSE, Trial, new_modes
from rcsa_ident.identification.parameters import Unknowns
from rcsa_ident.identification.posed.parameters import PosedLayout, pack_robot, unpack_robot


class PosedSteps:
    """All modes belong to the spindle; an arm has as many as it has freedoms."""

    def groups(self, layout: Unknowns) -> int:
        """Return 1: every line feels every mode."""
        del layout
        return 1

    def fewer(self, solution: Solution, smallest: int) -> list[Trial]:
        """Return the robots whose spindle has one mode less, or two close ones made one."""
        spindle = _spindle(solution)
        if spindle.order <= smallest:
            return []
        everyone = np.arange(spindle.order)
        trials = [_with(solution, selected(spindle, everyone != k)) for k in everyone]
        order = np.argsort(spindle.omega_n, kind="stable").tolist()
        for low, high in zip(order, order[1:], strict=False):
            if spindle.omega_n[high] < CLOSE * spindle.omega_n[low]:
                trials.append(_with(solution, selected(merged(spindle, low, high), everyone != high)))
        return trials

    def more(self, solution: Solution, misfit: Misfit, i: int, band_hz: tuple[float, float]) -> list[Trial]:
        """Return the robots whose spindle has one mode more in front, at the frequencies and along the shapes that promise most."""
        del i
        spindle = _spindle(solution)
        modes = new_modes(solution, misfit, (0, 1), band_hz, PROMISING)
        return [_with(solution, with_mode(spindle, omega_n, shape, zeta)) for omega_n, zeta, shape in modes]


POSED = PosedSteps()


def layout_of(layout: Unknowns) -> PosedLayout:
    """Return a layout that is a robot's."""
    assert isinstance(layout, PosedLayout)
    return layout


def _spindle(solution: Solution) -> CoupledParameters:
    return unpack_robot(solution.theta, layout_of(solution.layout)).spindle


def _with(solution: Solution, spindle: CoupledParameters) -> Trial:
    old = layout_of(solution.layout)
    layout = replace(old, spindle=replace(old.spindle, modes=spindle.order))
    robot = replace(unpack_robot(solution.theta, old), spindle=spindle)
    return np.concatenate([pack_robot(robot, layout), solution.theta[old.tail :]]), layout
