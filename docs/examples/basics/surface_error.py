"""
Where a stable cut leaves the wall
==================================

A stable cut can still spoil the part: the tool vibrates with the teeth and leaves the wall beside the programmed one.
How far depends on the spindle speed, and it is worst just where the lobes are highest. Here a finishing cut looks for
a speed that has both, depth and form.
"""

import matplotlib.pyplot as plt
import numpy as np

import rcsa_ident as ri
from rcsa_ident.base.units import to_rpm

# %%
# One mode in each direction, three straight teeth, 5 % immersion in down-milling.
modes = {}
for axis, hertz, kilogram in ((ri.Dof.X, 922.0, 0.12), (ri.Dof.Y, 980.0, 0.1)):
    modes[axis] = ri.normal_modes([ri.hz(hertz)], [0.03], [[kilogram**-0.5]], (ri.Coordinate("tip", axis),))
tip = ri.TipModes.of(modes)
aluminium = ri.CuttingCoefficients(8e8, 0.3)
cut = ri.MillingProcess(ri.Cutter(3, 0.012), aluminium, ri.Engagement.from_immersion(0.05, "down"), feed_per_tooth=8e-5)
speeds, depth = ri.rpm(8000, 24_000, 50), 2e-3
surface = ri.surface_location_error(tip, cut, speeds, depth)
lobes = ri.stability_lobes(tip, cut, speeds, 12e-3, ri.FullDiscretisation())
print(surface)

# %%
# At which speeds is the cut stable with a reserve of a third, and the wall within two micrometres?
good = (lobes.limit_depth > 1.5 * depth) & (np.abs(surface.largest) < 2e-6)
fig, (top, bottom) = plt.subplots(2, 1, figsize=(7.2, 5.2), sharex=True, layout="constrained")
top.plot(to_rpm(speeds), np.minimum(1e3 * lobes.limit_depth, 12.0))
top.axhline(1e3 * depth, color="0.3", ls="--", lw=1.0, label="this cut, 2 mm")
top.set(ylabel="stability limit [mm]", ylim=(0.0, 12.3), title="Full discretisation")
top.legend()
bottom.plot(to_rpm(speeds), 1e6 * surface.mean, color="C1")
bottom.axhspan(-2.0, 2.0, color="C2", alpha=0.15, lw=0.0)
bottom.plot(to_rpm(speeds[good]), 1e6 * surface.mean[good], ".", color="C2", ms=7, label="stable, and within 2 µm")
bottom.set(xlabel="spindle speed [rev/min]", ylabel="surface location error [µm]", title="Positive: material is left")
bottom.legend()

# %%
# Far below the resonances the wall is off by the static deflection at the teeth's exit; at 1 / 3 of the natural frequency of Y it is worst.
worst = to_rpm(speeds[np.argmax(np.abs(surface.mean))])
print(f"worst at {worst:.0f} rev/min: {1e6 * np.abs(surface.mean).max():.1f} µm; {good.sum()} of {good.size} speeds are good")
assert abs(worst / (60.0 * 980.0 / 3.0) - 1.0) < 0.05
assert 0 < good.sum() < good.size // 2
