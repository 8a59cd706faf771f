"""
A slow spindle
==============

At a slow spindle a wave on the surface is met again long after the vibration that cut it has died away. Such a vibration may
grow from tooth to tooth a million times, while it drifts to where the teeth leave the material, and die away there: every
multiplier is small, the cut is "stable", and the tool is broken. Where a vibration grows a thousandfold the marching methods
call it a limit, too, and say so.
"""

import matplotlib.pyplot as plt
import numpy as np

import rcsa_ident as ri
from rcsa_ident.base.units import to_rpm

# %%
# A well damped mode of 900 Hz in a slot, from 500 rev/min (54 waves from tooth to tooth) to 3000 (9 waves).
mode = ri.normal_modes([ri.hz(900.0)], [0.1], [[5.0]], (ri.Coordinate("tip", ri.Dof.Y),))
slot = ri.MillingProcess(
    ri.Cutter(2, 0.012), ri.CuttingCoefficients(7e8, 0.3), ri.Engagement.from_immersion(1.0, "up"), feed_per_tooth=1e-4
)
tip, speeds = ri.TipModes.of({ri.Dof.Y: mode}), np.geomspace(ri.rpm(500), ri.rpm(3000), 13)
methods = {"zero order": ri.ZeroOrder(), "time domain": ri.TimeDomain(), "full discretisation": ri.FullDiscretisation()}
lobes = {name: ri.stability_lobes(tip, slot, speeds, 6e-3, method) for name, method in methods.items()}
for warning in lobes["full discretisation"].warnings:
    print(warning)

# %%
# The time domain pushes a cut off its steady state by a millionth of the chip, once, and calls it chatter where a fiftieth has
# come of it. The mean over a turn, of which the zero order is made, knows nothing of what passes within it.
fig, ax = plt.subplots(figsize=(7.0, 4.0), layout="constrained")
for name, found in lobes.items():
    ax.semilogx(to_rpm(speeds), 1e3 * found.limit_depth, label=name, lw=2.5 if name.startswith("full") else 1.2)
ax.set(xlabel="spindle speed [rev/min]", ylabel="stability limit [mm]", ylim=(0.0, 4.0), title="A slot, one mode of 900 Hz, 10 % damped")
ax.set_xticks([500, 1000, 2000, 3000], ["500", "1000", "2000", "3000"])
ax.set_xticks([], minor=True)
ax.legend(loc="lower right")

# %%
# Slowly, full discretisation stays below the time domain, and the zero order is twice as high; above 2000 rev/min nothing
# passes, and two independent methods agree.
zero, time, full = (found.limit_depth for found in lobes.values())
slow, fast = to_rpm(speeds) < 700.0, to_rpm(speeds) > 2000.0
assert np.all(full[slow] < time[slow])
assert np.all(zero[slow] > 1.5 * full[slow])
assert np.all(np.abs(full[fast] / time[fast] - 1.0) < 0.01)
