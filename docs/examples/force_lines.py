"""The milling force of a stable cut, twice: its closed-form lines, and a sampled revolution.

A four-fluted helical cutter with unequal pitch mills half-immersed; the sum of its lines must be the force over the angle.
"""

import numpy as np

import rcsa_ident as ri
from rcsa_ident.cutting.force import force_history, force_lines

CUTTER = ri.Cutter(teeth=4, diameter=0.012, helix=np.radians(30.0), pitch=np.radians([85.0, 95.0, 88.0, 92.0]))
COEFFICIENTS = ri.CuttingCoefficients(902e6, 0.26, tangential_edge=8e3, radial_edge=5e3)
CUT = ri.MillingProcess(CUTTER, COEFFICIENTS, ri.Engagement.from_immersion(0.5, "down"), feed_per_tooth=1e-4)
CONDITIONS = CUT.conditions(speed=ri.rpm(12_000), depth=2e-3)

ANGLE = np.linspace(0.0, 2.0 * np.pi, 720, endpoint=False)
ORDERS = np.arange(0, 400)
LINES = force_lines(CUTTER, CONDITIONS, COEFFICIENTS, ORDERS)
FROM_LINES = np.real(np.exp(1j * np.outer(ANGLE, ORDERS)) @ LINES)
SAMPLED = force_history(CUTTER, CONDITIONS, COEFFICIENTS, ANGLE, slices=200)[:, :2]
