"""
A milling robot at one posture and along a line
===============================================

A robot is a machine with a posture. The Stäubli TX200 is described by its joints, links and springs; at a posture it
carries a spindle and a tool like any machine, and has lobes. Along a line the posture changes, and the limits with
it.
"""

import matplotlib.pyplot as plt
import numpy as np

import rcsa_ident as ri
from rcsa_ident.base.units import to_hz, to_rpm
from rcsa_ident.workflows.robot_postures import at_posture, following, limits_along
from rcsa_ident.workflows.tool_change import ToolChange

# %%
# The description travels with the package; ``ri.read_robot`` reads that of another arm.
arm = ri.FlexibleRobot(ri.sample_robot("tx200"))
posture = np.radians([-11.71, 20.78, 110.0, 82.76, 60.80, -166.96])
machine, tool = ri.PosedRobot(arm, posture), ri.sample_tooling("S1-ER32")
told = at_posture(arm, posture)
frequencies = to_hz(told.natural_frequencies)
print("natural frequencies [Hz]:", np.round(frequencies[:6], 2).tolist())
print("compliance along x, y, z [µm/N]:", np.round(1e6 * np.diag(told.compliance), 3).tolist())

# %%
# The arm's own modes lie far below those of tool and holder.
omega = ri.hz(1.0) * np.geomspace(5.0, 4000.0, 1500)
tip = machine.tip(tool, omega)

# %%
# A line of 0.8 m away from the base, the tool upright; at each place of all postures that reach it the one that turns the joints least.
way = np.linspace(0.0, 0.8, 21)
places = np.array([0.9, -0.2, 0.2]) + way[:, None] * [1.0, 0.0, 0.0]
postures = following(arm.model, posture, places, np.tile([0.0, 0.0, 1.0], (way.size, 1)), tool.assembly)
cut, speeds = ri.CutSpec(coefficients={"tangential": 660e6, "radial_ratio": 0.38}), ri.rpm(600, 6000, 50)
limits, _ = limits_along(ToolChange(machine, tool, cut, speeds, 10e-3, recommend=False), postures)

fig, (left, right) = plt.subplots(1, 2, figsize=(10.0, 4.0), layout="constrained")
for axis in "xy":
    left.loglog(to_hz(omega), 1e6 * np.abs(tip.between(f"tip.{axis}", f"tip.{axis}")), label=axis.upper())
left.set(xlabel="frequency [Hz]", ylabel="tooltip receptance [µm/N]", title="At the posture")
left.legend()
mesh = right.pcolormesh(to_rpm(speeds), way, 1e3 * limits, shading="nearest", cmap="viridis", vmin=0.0, vmax=1.2)
fig.colorbar(mesh, ax=right, label="stability limit [mm]", extend="max")
right.set(xlabel="spindle speed [rev/min]", ylabel="way along the line [m]", title="Along the line")
right.grid(False)

# %%
# Stretched out the arm is softer, and its own modes limit the cut. Every joint stands within its limits here; at the published
# posture, where the third one does not, the natural frequencies are those that others computed (validation).
print(f"highest limit: {1e3 * limits[0].max():.2f} mm near the base, {1e3 * limits[-1].max():.2f} mm stretched out")
assert arm.model.beyond_limits(posture) == ()
assert limits[-1].max() < 0.6 * limits[0].max()
