"""
Cutting coefficients from mean forces
=====================================

Five slots at different feeds on a dynamometer: the mean forces grow in a straight line with the feed. Its slope tells
the cutting coefficients, what is left at no feed those of the edge. Each cut's depth is off by a percent, as on a
machine.
"""

import matplotlib.pyplot as plt
import numpy as np

import rcsa_ident as ri
from rcsa_ident.cutting.calibration import calibrate_mean_force
from rcsa_ident.cutting.force import force_history

# %%
# The force of a helical cutter, sampled over a revolution, stands for the dynamometer.
cutter, slot = ri.Cutter(teeth=4, diameter=0.012, helix=np.radians(30.0)), ri.Engagement.from_immersion(1.0, "down")
feeds = np.array([0.04, 0.06, 0.08, 0.10, 0.12]) * 1e-3
true = ri.material("5A06 aluminium").coefficients
cuts = [(cutter, ri.MillingProcess(cutter, true, slot, feed_per_tooth=feed).conditions(ri.rpm(6000), 1e-3)) for feed in feeds]
angle = np.linspace(0.0, 2.0 * np.pi, 720, endpoint=False)
depth_error = 0.01 * np.random.default_rng(1).normal(size=feeds.size)
force = np.array([force_history(*cut, true, angle)[:, :2].mean(axis=0) for cut in cuts]) * (1.0 + depth_error[:, None])

found = calibrate_mean_force(cuts, force)
expected = np.array([true.tangential, true.tangential * true.radial_ratio, true.tangential_edge, true.radial_edge])

# %%
# Intervals of 95 % come with every coefficient.
fig, (left, right) = plt.subplots(1, 2, figsize=(9.0, 3.8), layout="constrained")
for k, name in enumerate("XY"):
    left.plot(1e3 * feeds, force[:, k], "o", color=f"C{k}", label=f"mean force along {name}")
    line = np.polyfit(feeds, force[:, k], 1)
    left.plot([0.0, 0.13], np.polyval(line, [0.0, 0.13e-3]), color=f"C{k}", lw=1.0)
left.set(xlabel="feed per tooth [mm]", ylabel="force on the tool [N]", xlim=(0.0, 0.13), title="Five slots")
left.legend()
names = ["$K_{tc}$", "$K_{rc}$", "$K_{te}$", "$K_{re}$"]
right.errorbar(found.value / expected, range(4), xerr=found.half_width / expected, fmt="o", capsize=4, color="C2")
right.axvline(1.0, color="0.4", lw=1.0)
right.set(yticks=range(4), yticklabels=names, xlabel="found over true [-]", ylim=(3.5, -0.5), title="Found, with intervals of 95 %")

# %%
# The truth lies inside all four intervals, and K_tc is known to better than a tenth.
for name, value, half in zip(("K_tc", "K_rc", "K_te", "K_re"), found.value, found.half_width, strict=True):
    print(f"{name}: {value:.4g} ± {half:.2g}")
assert np.all(np.abs(found.value - expected) < found.half_width)
assert found.half_width[0] < 0.1 * expected[0]
