"""
Huynh and others 2018: a Stäubli TX200 that mills
=================================================

A simulation of a flexible robot that mills aluminium along a block was published with its cutting forces. Arm and cut
are the same here; the tool takes away the material along its path, and its arm gives way to the forces, with the
springs across the axes and the play of the gears.

Source: :cite:`huynh2018`.
"""

import matplotlib.pyplot as plt
import numpy as np

import rcsa_ident as ri
from rcsa_ident.base.units import to_hz
from rcsa_ident.machine.robot.flexible import modes_of
from rcsa_ident.toolpath.march import Cut, mill_block
from rcsa_ident.workflows.paths.robot_milling import arm_carrier, feed_turn

# %%
# The posture of the publication's table 7, and its cut: two unequal teeth of Ø10 mm, 4 mm wide, 1.6 mm deep, 3700 mm/min at 18 700 rev/min.
posture = np.radians([-11.71, 20.78, 147.86, 82.76, 60.80, -166.96])
cutter = ri.Cutter(2, 0.010, np.radians(30.0), pitch=np.radians([170.0, 190.0]))
cut = Cut(cutter, ri.CuttingCoefficients(661.553e6, 253.458 / 661.553), 0.0016, ri.rpm(18_700))
feed = 3.7 / 60.0 / (2.0 * 18_700.0 / 60.0)
drives, every = (ri.FlexibleRobot(ri.sample_robot("tx200"), tilts) for tilts in (False, True))
turn = feed_turn(every, posture, np.array([1.0, 0.0, 0.0]))
carriers = {
    "drives": arm_carrier(drives, posture, turn, play=False),
    "all springs": arm_carrier(every, posture, turn, play=False),
    "all springs, play": arm_carrier(every, posture, turn),
}

# %%
# Table 10: mean along the feed and across it, root mean square of both [N], between 0.4 and 1.4 s; forces on the workpiece.
published = {
    "drives": (8.78, -25.67, 16.28, 44.42),
    "all springs": (8.79, -25.70, 16.29, 44.47),
    "all springs, play": (8.92, -25.43, 16.41, 44.15),
}
fig, (left, right) = plt.subplots(1, 2, figsize=(9.6, 4.0), layout="constrained")
errors = {}
for name, carrier in carriers.items():
    found, _ = mill_block(carrier, cut, 0.09, (-np.inf, -0.001), feed)
    inside = (found.time > 0.4) & (found.time < 1.4)
    force = found.force[inside, :2] * [1.0, -1.0]
    row = np.array([*force.mean(axis=0), *np.sqrt(np.mean(force**2, axis=0))])
    errors[name] = np.max(np.abs(row / published[name] - 1.0))
    print(f"{name:<18} {np.round(row, 2).tolist()} N, published {published[name]}")
    right.plot(1e6 * found.tip[inside, 0][::40], 1e6 * found.tip[inside, 1][::40], ".", ms=2, label=name)
shown = found.time[inside] < found.time[inside][0] + 2.0 * 60.0 / 18_700.0
for k, name in enumerate(("along the feed", "across")):
    left.plot(1e3 * (found.time[inside][shown] - found.time[inside][0]), force[shown, k], label=name)
left.set(xlabel="time [ms]", ylabel="force on the workpiece [N]", title="Two turns, play included", ylim=(-125.0, 75.0))
left.legend(ncols=2, loc="upper right")
right.set(xlabel="tip along the feed [µm]", ylabel="tip across the feed [µm]", title="Where the tip is")
right.legend(markerscale=5)

# %%
# Natural frequencies of this posture are printed, too, for the drives alone.
frequencies = to_hz(modes_of(drives.at(posture))[0])
np.testing.assert_allclose(frequencies, [15.768, 25.056, 27.720, 33.561, 92.587, 138.708], rtol=1e-4)
print("largest error:", {name: f"{100 * error:.2f} %" for name, error in errors.items()})
assert max(errors.values()) < 0.015
