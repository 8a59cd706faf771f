"""
The milling force as lines at the spindle's orders
==================================================

A stable cut repeats itself every turn, so its force is a sum of lines at multiples of the spindle frequency. They are
known in closed form, for helical edges and unequal pitch, too. Their sum must be the force over the angle, sampled
slice by slice.
"""

import matplotlib.pyplot as plt
import numpy as np

import rcsa_ident as ri
from rcsa_ident.cutting.force import force_history, force_lines

# %%
# Four flutes, unequally spaced, half-immersed in down-milling.
cutter = ri.Cutter(teeth=4, diameter=0.012, helix=np.radians(30.0), pitch=np.radians([85.0, 95.0, 88.0, 92.0]))
coefficients = ri.CuttingCoefficients(902e6, 0.26, tangential_edge=8e3, radial_edge=5e3)
cut = ri.MillingProcess(cutter, coefficients, ri.Engagement.from_immersion(0.5, "down"), feed_per_tooth=1e-4)
conditions = cut.conditions(speed=ri.rpm(12_000), depth=2e-3)

angle, orders = np.linspace(0.0, 2.0 * np.pi, 720, endpoint=False), np.arange(400)
lines = force_lines(cutter, conditions, coefficients, orders)
from_lines = np.real(np.exp(1j * np.outer(angle, orders)) @ lines)
sampled = force_history(cutter, conditions, coefficients, angle, slices=200)[:, :2]

# %%
# Equal teeth would leave only every fourth order; these leave all of them.
fig, (left, right) = plt.subplots(1, 2, figsize=(9.0, 3.8), layout="constrained")
for k, name in enumerate("XY"):
    left.plot(np.degrees(angle), sampled[:, k], lw=4.0, alpha=0.3, color=f"C{k}", label=f"{name}, sampled")
    left.plot(np.degrees(angle), from_lines[:, k], lw=1.1, color=f"C{k}", label=f"{name}, sum of lines")
    right.stem(orders[:25] + 0.3 * k, np.abs(lines[:25, k]), linefmt=f"C{k}-", markerfmt=f"C{k}o", basefmt=" ", label=name)
left.set(xlabel="spindle angle [deg]", ylabel="force on the tool [N]", xticks=range(0, 361, 90), title="One turn")
left.legend(ncols=2, loc="upper right")
left.set_ylim(top=1.45 * sampled.max())
right.set(xlabel="order of the spindle frequency [-]", ylabel="amplitude [N]", title="Its lines")
right.legend()

# %%
# Both ways to the force agree.
error = np.linalg.norm(from_lines - sampled) / np.linalg.norm(sampled)
print(f"largest force {sampled.max():.0f} N, the two differ by {100 * error:.2f} %")
assert error < 0.01
