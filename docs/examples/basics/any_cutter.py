"""
A cutter that is no cylinder
============================

A face mill with a lead angle of 45° pushes along the axis and tilts the tip; a cylinder of the same diameter does
neither. Its limits are computed along the true edge, and the cylinder's beside them.
"""

from dataclasses import replace

import matplotlib.pyplot as plt
import numpy as np

import rcsa_ident as ri
from rcsa_ident.base.units import to_rpm
from rcsa_ident.cutting.conditions import Block
from rcsa_ident.cutting.profile import Profile

# %%
# The outline is drawn from a few dimensions; the block under the mill reaches from y = -18.9 to 25.2 mm beside the path.
outline = Profile.face(0.063, np.radians(45.0), 0.03)
mill = ri.Cutter(5, 0.063, profile=outline)
coefficients = ri.CuttingCoefficients(2000e6, 0.4, 0.25)
cut = ri.MillingProcess(mill, coefficients, Block(-0.0189, 0.0252))
cylinder = replace(cut, cutter=ri.Cutter(5, 0.063))

# %%
# X, Y and Z each have a mode: 310, 335 and 410 Hz.
modes = {}
for axis, hertz, zeta, stiffness in ((ri.Dof.X, 310.0, 0.035, 3.2e7), (ri.Dof.Y, 335.0, 0.035, 2.8e7), (ri.Dof.Z, 410.0, 0.04, 5e7)):
    modes[axis] = ri.normal_modes([ri.hz(hertz)], [zeta], [[ri.hz(hertz) / np.sqrt(stiffness)]], (ri.Coordinate("tip", axis),))
tip, speeds, exact = ri.TipModes.of(modes), ri.rpm(600, 1500, 10), ri.FullDiscretisation()
limits = [ri.stability_lobes(tip, each, speeds, 6e-3, exact).limit_depth for each in (cut, cylinder)]

# %%
# Left the outline, right the limits.
fig, (left, right) = plt.subplots(1, 2, figsize=(9.2, 3.9), width_ratios=(1.0, 1.5), layout="constrained")
r, z = 1e3 * outline.outline(6e-3).T
for side in (-1.0, 1.0):
    left.fill_betweenx(z, 0.0, side * r, color="0.88")
    left.plot(side * r, z, color="C0", lw=2.0)
left.set(xlabel="radius [mm]", ylabel="height above the floor [mm]", ylim=(-0.5, 8.0), title="Edge, 45°")
right.plot(to_rpm(speeds), 1e3 * limits[0], label="true edge")
right.plot(to_rpm(speeds), 1e3 * limits[1], "--", label="as a cylinder")
right.set(xlabel="spindle speed [rev/min]", ylabel="stability limit [mm]", ylim=(0.0, 4.0), title="Face mill Ø63 mm in steel")
right.legend()

# %%
# Two independent methods (Hill's determinant, a marched Floquet multiplier) gave 1.1564, 1.4180, 1.1642 and 2.3103 mm at these speeds.
found = ri.stability_lobes(tip, cut, ri.rpm(700, 1300, 200), 6e-3, ri.FullDiscretisation(tolerance=2e-4)).limit_depth
print("limits [mm]:", np.round(1e3 * found, 4).tolist())
np.testing.assert_allclose(1e3 * found, [1.1564, 1.4180, 1.1642, 2.3103], rtol=4e-4)
assert np.median(limits[1] / limits[0]) < 1.0
