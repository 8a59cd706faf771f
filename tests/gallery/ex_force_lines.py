"""The milling force of a stable cut, twice: its closed-form lines, and a sampled revolution.

A four-fluted helical cutter with unequal pitch mills half-immersed; the sum of its lines must be the force over the angle.
"""

from __future__ import annotations

import numpy as np

from rcsa_ident.cutting.coefficients import CuttingCoefficients
from rcsa_ident.cutting.conditions import CuttingConditions, Engagement
from rcsa_ident.cutting.cutter import Cutter
from rcsa_ident.cutting.force import force_history, force_lines

CUTTER = Cutter(teeth=4, diameter=0.012, helix=np.radians(30.0), pitch=np.radians([85.0, 95.0, 88.0, 92.0]))
CONDITIONS = CuttingConditions(
    spindle_speed=12000.0 * np.pi / 30.0,
    axial_depth=2e-3,
    feed_per_tooth=1e-4,
    engagement=Engagement.from_immersion(0.5, "down"),
)
COEFFICIENTS = CuttingCoefficients(902e6, 0.26, tangential_edge=8e3, radial_edge=5e3)

ANGLE = np.linspace(0.0, 2.0 * np.pi, 720, endpoint=False)
ORDERS = np.arange(0, 400)
LINES = force_lines(CUTTER, CONDITIONS, COEFFICIENTS, ORDERS)
FROM_LINES = np.real(np.exp(1j * np.outer(ANGLE, ORDERS)) @ LINES)
SAMPLED = force_history(CUTTER, CONDITIONS, COEFFICIENTS, ANGLE, slices=200)[:, :2]
