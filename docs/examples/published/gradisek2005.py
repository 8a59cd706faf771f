"""
Gradišek and others 2005: four modes, half immersion
====================================================

A mill of four modes, three along X and one along Y, cuts half-immersed in down-milling with four teeth. Exact methods
and the zero-order method stand beside each other; reference limits are those of spectral elements.

Source: :cite:`gradisek2005`.
"""

import matplotlib.pyplot as plt
import numpy as np

import rcsa_ident as ri
from rcsa_ident.base.units import to_rpm

# %%
# Frequency [Hz], damping ratio and modal mass [kg] of each mode; K_t 697 MPa, K_n 255.8 MPa.
x = np.array([[441.64, 0.028722, 11.125], [563.6, 0.055801, 1.4986], [778.56, 0.058996, 13.063]])
y = np.array([[516.2, 0.025004, 1.199]])
models = {}
for axis, table in ((ri.Dof.X, x), (ri.Dof.Y, y)):
    frequency, zeta, mass = table.T
    models[axis] = ri.normal_modes(ri.hz(1.0) * frequency, zeta, mass[:, None] ** -0.5, (ri.Coordinate("tip", axis),))
tip = ri.TipModes.of(models)
cut = ri.MillingProcess(ri.Cutter(4, 0.012), ri.CuttingCoefficients(6.97e8, 2.558 / 6.97), ri.Engagement.from_immersion(0.5, "down"))

speeds = ri.rpm(1500, 12_000, 50)
exact = ri.stability_lobes(tip, cut, speeds, 12e-3, ri.FullDiscretisation())
mean = ri.stability_lobes(tip, cut, speeds, 12e-3)

# %%
# At these four speeds the limit is known to five digits.
rpm, reference = np.array([2000.0, 5000.0, 7000.0, 10_000.0]), np.array([2.78505, 1.49104, 6.36278, 1.64411])
found = {
    type(method).__name__: 1e3 * ri.stability_lobes(tip, cut, ri.rpm(1.0) * rpm, 30e-3, method).limit_depth
    for method in (ri.FullDiscretisation(), ri.MultiFrequency(), ri.ZeroOrder())
}
fig, ax = plt.subplots(layout="constrained")
ax.plot(to_rpm(speeds), 1e3 * exact.limit_depth, label="full discretisation")
ax.plot(to_rpm(speeds), 1e3 * mean.limit_depth, "--", lw=1.1, label="zero-order method")
ax.plot(rpm, reference, "ko", label="spectral elements")
ax.set(xlabel="spindle speed [rev/min]", ylabel="stability limit [mm]", ylim=(0.0, 9.0), title="Four modes, half-immersion down-milling")
ax.legend(loc="upper left")

# %%
# What the methods are off by.
for name, limit in found.items():
    print(f"{name:<20} {np.round(limit, 5).tolist()} mm, off by at most {100 * np.max(np.abs(limit / reference - 1.0)):.3f} %")
np.testing.assert_allclose(found["MultiFrequency"], reference, rtol=1e-3)
assert np.max(np.abs(found["FullDiscretisation"] / reference - 1.0)) < 1e-5
