"""Cutting coefficients of a slot from mean forces at five feeds, and the library beside them.

The forces are sampled over a revolution of a helical cutter; each cut's depth is off by a percent, as on a machine.
"""

import numpy as np

import rcsa_ident as ri
from rcsa_ident.cutting.calibration import calibrate_mean_force
from rcsa_ident.cutting.force import force_history

CUTTER, SLOT = ri.Cutter(teeth=4, diameter=0.012, helix=np.radians(30.0)), ri.Engagement.from_immersion(1.0, "down")
FEEDS = np.array([0.04, 0.06, 0.08, 0.10, 0.12]) * 1e-3
TRUE = ri.material("5A06 aluminium").coefficients

CUTS = [(CUTTER, ri.MillingProcess(CUTTER, TRUE, SLOT, feed_per_tooth=feed).conditions(ri.rpm(6000), 1e-3)) for feed in FEEDS]
ANGLE = np.linspace(0.0, 2.0 * np.pi, 720, endpoint=False)
DEPTH_ERROR = 0.01 * np.random.default_rng(1).normal(size=FEEDS.size)
FORCE = np.array([force_history(*cut, TRUE, ANGLE)[:, :2].mean(axis=0) for cut in CUTS]) * (1.0 + DEPTH_ERROR[:, None])

FOUND = calibrate_mean_force(CUTS, FORCE)
