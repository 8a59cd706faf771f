"""The first loss of stability of one low-immersion cut by every method, and the map of its islands.

Two teeth, a twentieth of the diameter, a mode at 922 Hz: period doubling lies far below what the mean force lets expect.
"""

import numpy as np

import rcsa_ident as ri

MODE = ri.normal_modes([ri.hz(922.0)], [0.011], [[1.0 / np.sqrt(0.03993)]], (ri.Coordinate("tip", ri.Dof.X),))
TIP = ri.TipModes.of({ri.Dof.X: MODE})
ALUMINIUM = ri.CuttingCoefficients(6e8, 1.0 / 3.0)
CUT = ri.MillingProcess(ri.Cutter(teeth=2, diameter=0.012), ALUMINIUM, ri.Engagement.from_immersion(0.05, "down"))
HELICAL = ri.MillingProcess(ri.Cutter(2, 0.012, np.radians(30.0)), ALUMINIUM, ri.Engagement.from_immersion(0.05, "up"))
METHODS = (ri.ZeroOrder(), ri.MultiFrequency(), ri.SemiDiscretisation(), ri.FullDiscretisation(), ri.TimeDomain())

LIMITS = {type(m).__name__: ri.stability_lobes(TIP, CUT, ri.rpm(18_000), max_depth=0.03, method=m).limit_depth[0] for m in METHODS}
MAP = ri.stability_map(TIP, HELICAL, ri.rpm(8000, 24_000, 250), np.linspace(0.3e-3, 18e-3, 60))

if __name__ == "__main__":
    for name, limit in LIMITS.items():
        print(f"{name:<20} {1e3 * limit:6.2f} mm")
    print(MAP)
    MAP.save("islands.svg")
