"""Stability lobes of a two-tooth mill in slotting from a modal model alone, beside the published minimum.

The case is the one that most of this literature starts from (one mode at 922 Hz, alike in both directions).
"""

from __future__ import annotations

import numpy as np

from rcsa_ident.cutting.coefficients import CuttingCoefficients
from rcsa_ident.cutting.conditions import Engagement
from rcsa_ident.cutting.cutter import Cutter
from rcsa_ident.cutting.process import MillingProcess
from rcsa_ident.dynamics.coordinates import Coordinate
from rcsa_ident.dynamics.modal import normal_modes
from rcsa_ident.stability.lobes import stability_lobes, uncoupled_planes

OMEGA = 2.0 * np.pi * np.arange(600.0, 1300.0, 0.5)


def direction(axis: str):  # type: ignore[no-untyped-def]
    """Return the tip's receptance in one direction."""
    shape = [[1.0 / np.sqrt(0.03993)]]
    return normal_modes([2.0 * np.pi * 922.0], [0.011], shape, (Coordinate.parse(f"tip.{axis}"),)).receptance(OMEGA)


LOBES = stability_lobes(
    uncoupled_planes(direction("x"), direction("y")),
    MillingProcess(Cutter(teeth=2, diameter=0.01), CuttingCoefficients(6e8, 1.0 / 3.0), Engagement.from_immersion(1.0, "up")),
    speeds=np.arange(5000.0, 25001.0, 50.0) * np.pi / 30.0,
    max_depth=5e-3,
)
