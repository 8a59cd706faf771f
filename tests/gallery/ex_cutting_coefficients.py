"""Cutting coefficients of a slot from mean forces at five feeds, and the library beside them.

The forces are sampled over a revolution of a helical cutter; each cut's depth is off by a percent, as on a machine.
"""

from __future__ import annotations

import numpy as np

from rcsa_ident.cutting.calibration import calibrate_mean_force
from rcsa_ident.cutting.conditions import CuttingConditions, Engagement
from rcsa_ident.cutting.cutter import Cutter
from rcsa_ident.cutting.force import force_history
from rcsa_ident.cutting.materials import material

CUTTER = Cutter(teeth=4, diameter=0.012, helix=np.radians(30.0))
SLOT = Engagement(0.0, np.pi)
FEEDS = np.array([0.04, 0.06, 0.08, 0.10, 0.12]) * 1e-3
TRUE = material("5A06 aluminium").coefficients

CUTS = [(CUTTER, CuttingConditions(6000.0 * np.pi / 30.0, 1e-3, feed, SLOT)) for feed in FEEDS]
ANGLE = np.linspace(0.0, 2.0 * np.pi, 720, endpoint=False)
DEPTH_ERROR = 0.01 * np.random.default_rng(1).normal(size=FEEDS.size)
FORCE = np.array([force_history(*cut, TRUE, ANGLE)[:, :2].mean(axis=0) for cut in CUTS]) * (1.0 + DEPTH_ERROR[:, None])

FOUND = calibrate_mean_force(CUTS, FORCE)
