"""Stability lobes of a two-tooth mill in slotting from a modal model alone, beside the published minimum.

The case is the one that most of this literature starts from (one mode at 922 Hz, alike in both directions).
"""

import numpy as np

import rcsa_ident as ri

SHAPE = [[1.0 / np.sqrt(0.03993)]]
MODES = {axis: ri.normal_modes([ri.hz(922.0)], [0.011], SHAPE, (ri.Coordinate("tip", axis),)) for axis in (ri.Dof.X, ri.Dof.Y)}
SLOT = ri.MillingProcess(ri.Cutter(teeth=2, diameter=0.01), ri.CuttingCoefficients(6e8, 1.0 / 3.0), ri.Engagement.from_immersion(1.0, "up"))

LOBES = ri.stability_lobes(ri.TipModes.of(MODES), SLOT, ri.rpm(5000, 25_000, 50), max_depth=5e-3)

if __name__ == "__main__":
    print(LOBES)
    LOBES.save("lobes.svg")
