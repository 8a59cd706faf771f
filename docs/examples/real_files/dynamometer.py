"""
Cutting coefficients from a real dynamometer
============================================

Three full slots in aluminium at 300, 900 and 1500 mm/min, forces exported by the dynamometer's own program
(leekunhwee/ForceCalculation on GitHub). The channels are told as its housing names them, but the feed lay along its
Y; which channel shows which axis is found from the cuts. With five feeds and axes put right by hand, 959 ± 140 MPa
were published.
"""

from functools import partial

import matplotlib.pyplot as plt
import numpy as np
from kept import real_files

import rcsa_ident as ri
from rcsa_ident.io.recordings.readers import read_cut
from rcsa_ident.setup.campaign import Campaign
from rcsa_ident.setup.cut import Cut
from rcsa_ident.setup.tooling import BareCutter
from rcsa_ident.workflows.calibrate import calibrate

feeds = (300, 900, 1500)
names = [f"dynamometer/6-n6000f{feed}ap3ae25.csv" for feed in feeds]
files = real_files("https://github.com/leekunhwee/ForceCalculation", "dynamometer.png", *names)
if files:
    cutter, slot = ri.Cutter(2, 0.025, np.radians(30.0)), ri.Engagement.from_immersion(1.0, "down")
    sensors = tuple(ri.Sensor(f"F{axis}", ri.Quantity.FORCE, ri.Dof(axis)) for axis in "xyz")
    cuts = []
    for feed, file in zip(feeds, files, strict=True):
        process = ri.MillingProcess(cutter, ri.CuttingCoefficients(9e8, 0.3), slot, feed_per_tooth=feed / 12_000 * 1e-3)
        cuts.append(Cut(f"{feed} mm/min", "T1", process.conditions(ri.rpm(6000), 3e-3), file))
    campaign = Campaign("dynamometer", 10_000.0, sensors, None, {"T1": BareCutter("T1", cutter)}, tuple(cuts))
    found = calibrate(campaign, partial(read_cut, sensors, campaign.sampling_rate), any_axes=True)
    print(found.notes[-1] if found.notes else found.forces)

    (tangential, half), (radial, radial_half) = found.forces.of("K_tc"), found.forces.of("K_rc")
    fig, (left, right) = plt.subplots(1, 2, figsize=(9.6, 3.9), width_ratios=(1.4, 1.0), layout="constrained")
    means = np.array([measured.record.mean[:2] for measured in found.used])
    model = np.array([found.mean_force_model(measured)[:2] for measured in found.used])
    per_tooth = np.array(feeds) / 12_000
    for k, name in enumerate(("along the feed", "across")):
        left.plot(per_tooth, means[:, k], "o", color=f"C{k}", label=f"measured, {name}")
        left.plot(per_tooth, model[:, k], color=f"C{k}", lw=1.1)
    left.set(xlabel="feed per tooth [mm]", ylabel="mean force on the tool [N]", title="Three slots, two teeth, 3 mm deep")
    left.legend()
    values, halves = 1e-6 * np.array([tangential, 959e6]), 1e-6 * np.array([half, 140e6])
    right.errorbar(values, [0, 1], xerr=halves, fmt="o", capsize=5, color="C2")
    right.set(yticks=[0, 1], yticklabels=["here", "published"], ylim=(-0.5, 1.5), xlabel="$K_{tc}$ [MPa]", title="With 95 % intervals")

    print(f"K_tc {1e-6 * tangential:.0f} ± {1e-6 * half:.0f} MPa, axes {', '.join(found.choices[0].shown())}")
    assert [each[-1] for each in found.choices[0].shown()] == ["Y", "X", "Z"]
    assert abs(tangential / 959e6 - 1.0) < 0.05
