"""
From recordings of ordinary cuts to a tool that never cut
=========================================================

Sixteen stable cuts with two toolings, recorded by displacement sensors at the spindle's flange, tell the machine. A
third tooling, longer and never clamped, then gets its stability lobes, a spindle speed and a recommended depth
without a hammer test.
"""

from dataclasses import replace

import matplotlib.pyplot as plt
import numpy as np

import rcsa_ident as ri
from rcsa_ident.base.units import to_rpm

# %%
# The sample runs were made by the virtual machine; of their 80 cuts every fifth is enough here. ``ri.sample_campaign`` makes new ones.
samples = "../../../data/sample_runs"
campaign = ri.read_campaign(samples)
found = ri.identify(replace(campaign, cuts=campaign.cuts[::5]), seed=1, processes=1)
print(found)

# %%
# Feed and the spindle's power belong to the question. Recommended cuts hold for 95 % of the machines that the cuts leave possible.
tool = ri.sample_tooling("S3-PG25-long")
advice = ri.advise(found, tool, ri.CutSpec(feed_per_tooth=0.1e-3), drive=ri.SpindleDrive.flat(power=10e3))
print(advice)

# %%
# Only a virtual machine tells the truth: its tip's FRF, and the lobes that follow.
best = advice.recommended[0]
tip = ri.read_tip(f"{samples}.truth/tip/{tool.name}.csv")
process = ri.CutSpec().process(tool.cutter, campaign.workpiece)
speeds = advice.lobes.spindle_speed
true = ri.stability_lobes(tip, process, speeds, max_depth=10e-3).limit_depth
band = 1e3 * np.quantile(advice.lobes.drawn, (0.025, 0.975), axis=0)

fig, ax = plt.subplots(layout="constrained")
ax.fill_between(to_rpm(speeds), *band, color="C0", alpha=0.2, lw=0.0, label="95 % of the possible machines")
ax.plot(to_rpm(speeds), 1e3 * advice.lobes.limit_depth, label="predicted limit")
ax.plot(to_rpm(speeds), 1e3 * true, "--", color="0.2", lw=1.1, label="true limit")
ax.plot(to_rpm(best.spindle_speed), 1e3 * best.depth, "*", color="C2", ms=14, label="recommended cut")
ax.set(xlabel="spindle speed [rev/min]", ylabel="axial depth [mm]", ylim=(0.0, 3.0), title=f"{tool.name}, never clamped before")
ax.legend(loc="upper left")

# %%
# The recommended cut is stable on the true machine, and not far below its limit.
limit = ri.stability_lobes(tip, process, best.spindle_speed, max_depth=10e-3).limit_depth[0]
print(f"{to_rpm(best.spindle_speed):.0f} rev/min, {1e3 * best.depth:.2f} mm; the true limit is {1e3 * limit:.2f} mm")
assert found.status == "converged"
assert 0.7 * limit < best.depth < limit
