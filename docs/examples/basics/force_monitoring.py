"""
Cutting forces from the spindle's vibration
===========================================

Once the machine is identified, the sensors at the flange are a dynamometer: a Kalman filter turns their displacement
into the force at the tip. Here one of the sample cuts is monitored; the virtual machine that made it also knows the
lines of its true force.
"""

from dataclasses import replace

import matplotlib.pyplot as plt
import numpy as np

import rcsa_ident as ri
from rcsa_ident.base.units import to_rpm

# %%
# Sixteen cuts to identify from; another one to monitor.
samples = "../../../data/sample_runs"
campaign = ri.read_campaign(samples)
found = ri.identify(replace(campaign, cuts=campaign.cuts[::5]), seed=1, processes=1)
cut = campaign.cuts[63]
forces = ri.estimate_forces(found, campaign.toolings[cut.tooling], cut, smooth=True)
print(f"{cut}\n{forces}")

# %%
# Amplitudes of the estimated force at the tooth-passing frequency and its multiples, beside the true ones.
estimate, speed = forces.estimate, forces.spindle_speed
time = estimate.start + estimate.step * np.arange(estimate.force.shape[0])
table = np.genfromtxt(f"{samples}.truth/forces/{cut.id}.csv", delimiter=",", names=True)
inside = (table["order"] % forces.teeth == 0) & (table["order"] * speed > forces.band[0]) & (table["order"] * speed < forces.band[1])
orders = table["order"][inside]
turns = 2.0 * np.pi / speed
whole = time < time[0] + turns * np.floor((time[-1] - time[0]) / turns)
waves = np.exp(-1j * np.outer(orders, speed * time[whole]))
lines = {axis: 2.0 * np.abs(waves @ estimate.force[whole, k]) / np.sum(whole) for k, axis in enumerate("XY")}
true = {axis: np.abs(table[f"{axis}_re"] + 1j * table[f"{axis}_im"])[inside] for axis in "XY"}

# %%
# The mean force moves nothing that vibrates and stays unknown; every line of the band is there.
fig, (left, right) = plt.subplots(1, 2, figsize=(9.0, 3.8), layout="constrained")
shown = time < time[0] + 2.0 * turns
for k, axis in enumerate("XY"):
    left.plot(1e3 * (time[shown] - time[0]), estimate.force[shown, k], label=axis)
    right.plot(orders + 0.4 * k, true[axis], "_", color="0.2", ms=14, mew=2.0, label="true" if k else None)
    right.plot(orders + 0.4 * k, lines[axis], "o", ms=5, label=f"{axis}, estimated")
left.set(xlabel="time [ms]", ylabel="force without its mean [N]", title=f"Two turns at {to_rpm(speed):.0f} rev/min")
left.legend(ncols=2, loc="upper right")
left.set_ylim(top=1.5 * estimate.force[shown].max())
right.set(xlabel="order of the spindle frequency [-]", ylabel="amplitude [N]", title="Lines", xticks=orders)
right.legend()

# %%
# All lines together are right to a few percent.
error = {axis: np.linalg.norm(lines[axis] - true[axis]) / np.linalg.norm(true[axis]) for axis in "XY"}
print("error of the lines:", {axis: f"{100 * each:.1f} %" for axis, each in error.items()})
assert max(error.values()) < 0.05
