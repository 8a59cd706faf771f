"""
Stability lobes from a modal model
==================================

One mode at 922 Hz, alike in X and Y, carries a mill with two teeth through a slot. The modal model alone gives the
stability lobes: the depth at which chatter begins at every spindle speed, and where it is worth working.
"""

import matplotlib.pyplot as plt
import numpy as np

import rcsa_ident as ri
from rcsa_ident.base.units import to_hz, to_rpm

# %%
# A mode is a natural frequency, a damping ratio and a mass-normalised shape; 0.03993 kg is its modal mass at the tip.
shape = [[1.0 / np.sqrt(0.03993)]]
modes = {axis: ri.normal_modes([ri.hz(922.0)], [0.011], shape, (ri.Coordinate("tip", axis),)) for axis in (ri.Dof.X, ri.Dof.Y)}
slot = ri.MillingProcess(ri.Cutter(teeth=2, diameter=0.01), ri.CuttingCoefficients(6e8, 1.0 / 3.0), ri.Engagement.from_immersion(1.0, "up"))

lobes = ri.stability_lobes(ri.TipModes.of(modes), slot, ri.rpm(5000, 25_000, 25), max_depth=5e-3)
print(lobes)

# %%
# Below the absolute limit no speed chatters. Pockets stand where a tooth passes once in a whole number of vibrations.
speed, limit = to_rpm(lobes.spindle_speed), 1e3 * lobes.limit_depth
fig, ax = plt.subplots(layout="constrained")
ax.fill_between(speed, limit, 1.0, color="#C8501A", alpha=0.12, lw=0.0, label="chatter")
ax.plot(speed, limit, label="stability limit")
ax.axhline(1e3 * lobes.absolute_limit, color="0.3", ls="--", lw=1.0, label=f"absolute limit, {1e3 * lobes.absolute_limit:.4f} mm")
ax.set(xlabel="spindle speed [rev/min]", ylabel="axial depth [mm]", xlim=(5000, 25_000), ylim=(0.0, 1.0), title="Slot, two teeth, 922 Hz")
ax.legend(loc="upper left")

# %%
# In closed form the lowest limit of this slot is 0.04793 mm, where chatter has 923.59 Hz.
assert not lobes.warnings
np.testing.assert_allclose(to_hz(lobes.absolute_frequency), 923.59, rtol=1e-4)
assert abs(lobes.absolute_limit / 0.04793e-3 - 1.0) < 1e-3
