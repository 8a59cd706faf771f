"""
Five lobe methods, and islands of chatter
=========================================

Two teeth, a twentieth of the diameter, a mode at 922 Hz: period doubling lies far below what the mean force lets
expect. Methods that know the harmonics agree; the zero-order method, which only knows the mean, does not. With a
helix the doubling has islands.
"""

import matplotlib.pyplot as plt
import numpy as np

import rcsa_ident as ri
from rcsa_ident.base.units import to_rpm

mode = ri.normal_modes([ri.hz(922.0)], [0.011], [[1.0 / np.sqrt(0.03993)]], (ri.Coordinate("tip", ri.Dof.X),))
tip, aluminium = ri.TipModes.of({ri.Dof.X: mode}), ri.CuttingCoefficients(6e8, 1.0 / 3.0)
straight = ri.MillingProcess(ri.Cutter(teeth=2, diameter=0.012), aluminium, ri.Engagement.from_immersion(0.05, "down"))
helical = ri.MillingProcess(ri.Cutter(2, 0.012, np.radians(30.0)), aluminium, ri.Engagement.from_immersion(0.05, "up"))

# %%
# One speed by every method: they share no code below the verb but the two that discretise.
methods = (ri.ZeroOrder(), ri.MultiFrequency(), ri.SemiDiscretisation(), ri.FullDiscretisation(), ri.TimeDomain())
limits = {type(m).__name__: ri.stability_lobes(tip, straight, ri.rpm(18_000), max_depth=0.03, method=m).limit_depth[0] for m in methods}
for name, limit in limits.items():
    print(f"{name:<20} {1e3 * limit:6.2f} mm")

# %%
# The map of the helical mill follows every boundary, of islands, too; only a share of its points is computed.
found = ri.stability_map(tip, helical, ri.rpm(8000, 24_000, 50), np.linspace(0.3e-3, 18e-3, 120))
print(found)
fig, ax = plt.subplots(layout="constrained")
ax.contourf(to_rpm(found.spindle_speed), 1e3 * found.depth, found.stable.T, levels=[-0.5, 0.5, 1.5], colors=["#F3D3C4", "#D5EBE3"])
ax.contour(to_rpm(found.spindle_speed), 1e3 * found.depth, found.growth.T, levels=[0.0], colors="#0072B2", linewidths=1.6)
ax.set(xlabel="spindle speed [rev/min]", ylabel="axial depth [mm]", title="5 % immersion, helix 30°: stable (green), chatter (red)")

# %%
# All that know harmonics give the same limit, the mean alone more than three times as much; islands stand at several speeds.
exact = limits["FullDiscretisation"]
assert all(abs(limit / exact - 1.0) < 0.01 for name, limit in limits.items() if name != "ZeroOrder")
assert limits["ZeroOrder"] > 3.0 * exact
assert np.sum(np.any(np.diff(found.stable.astype(int), axis=1) == 1, axis=1)) >= 10
assert found.evaluations < 0.6 * found.growth.size
