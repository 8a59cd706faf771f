"""
Insperger and Stépán 2004: the mill with two teeth
==================================================

The mill that most of the literature on milling stability begins with: two teeth, one mode of 922 Hz, a slot.
Semi-discretisation was published with it. The chart is drawn here, and its multipliers and limits stand beside those
of spectral elements that two resolutions give alike to 7e-9.

Source: :cite:`insperger2004`.
"""

import matplotlib.pyplot as plt
import numpy as np

import rcsa_ident as ri
from rcsa_ident.base.units import to_rpm
from rcsa_ident.stability.multiplier_limits import longest_step

# %%
# Natural frequency 922 Hz, damping ratio 1.1 %, modal mass 0.03993 kg; K_t 600 MPa, K_n 200 MPa.
mode = ri.normal_modes([ri.hz(922.0)], [0.011], [[0.03993**-0.5]], (ri.Coordinate("tip", ri.Dof.X),))
tip = ri.TipModes.of({ri.Dof.X: mode})
slot = ri.MillingProcess(ri.Cutter(2, 0.012), ri.CuttingCoefficients(6e8, 1.0 / 3.0), ri.Engagement.from_immersion(1.0, "down"))
chart = ri.stability_map(tip, slot, ri.rpm(5000, 25_000, 50), np.linspace(0.01e-3, 5e-3, 100))

# %%
# First loss of stability at eight speeds, and the largest multiplier per tooth at 5000 rev/min.
rpm = np.array([5000, 7500, 10_000, 12_500, 15_000, 17_500, 20_000, 25_000])
reference = np.array([0.40863, 0.32057, 0.32238, 2.70702, 0.38659, 0.50761, 1.41751, 3.93993])
semi = ri.stability_lobes(tip, slot, ri.rpm(1.0) * rpm, 30e-3, ri.SemiDiscretisation()).limit_depth
full = ri.stability_lobes(tip, slot, ri.rpm(1.0) * rpm, 30e-3, ri.FullDiscretisation()).limit_depth
operator = ri.FullDiscretisation().monodromy(tip, slot)
depths, multipliers = np.array([0.2, 0.5, 0.7, 1.0]), np.array([0.81974278, 1.07397559, 1.22155614, 1.40647353])
found = np.array([abs(operator.multiplier(ri.rpm(5000), 1e-3 * a, 0.5 * longest_step(operator)).value) for a in depths])

fig, ax = plt.subplots(layout="constrained")
ax.contourf(to_rpm(chart.spindle_speed), 1e3 * chart.depth, chart.stable.T, levels=[-0.5, 0.5, 1.5], colors=["#F3D3C4", "#D5EBE3"])
ax.contour(to_rpm(chart.spindle_speed), 1e3 * chart.depth, chart.growth.T, levels=[0.0], colors="#0072B2", linewidths=1.6)
ax.plot(rpm, reference, "ko", ms=6, label="spectral elements")
ax.set(xlabel="spindle speed [rev/min]", ylabel="axial depth [mm]", ylim=(0.0, 5.0), title="Slot, one mode: stable (green), chatter (red)")
ax.legend(loc="upper left")

# %%
# Both discretisations meet the eight limits, full discretisation the multipliers to the seventh digit.
for name, limit in (("semi-discretisation", semi), ("full discretisation", full)):
    print(f"{name}: limits within {100 * np.max(np.abs(1e3 * limit / reference - 1.0)):.3f} %")
print(f"multipliers within {np.max(np.abs(found / multipliers - 1.0)):.1e}")
np.testing.assert_allclose(1e3 * semi, reference, rtol=2e-3)
np.testing.assert_allclose(1e3 * full, reference, rtol=5e-4)
assert np.max(np.abs(found / multipliers - 1.0)) < 1e-5
