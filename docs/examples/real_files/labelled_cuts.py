"""
118 labelled cuts, and what forty of them teach
===============================================

Others made 118 cuts over speed and depth and labelled each as stable or chatter; 40 training cuts and the probable
modes before them were published with it (gengxiangc/BSLD on GitHub). Here the forty teach modes, coefficients and a
smooth error of the limit, each cut asked by full discretisation; scored are the cuts that were not learned from.
"""

import matplotlib.pyplot as plt
import numpy as np
from kept import real_files

import rcsa_ident as ri
from rcsa_ident.base.units import to_rpm
from rcsa_ident.setup.tooling import BareCutter
from rcsa_ident.stability.labels.label_posterior import Effort
from rcsa_ident.stability.labels.tested_cuts import TestedCuts, Verdict
from rcsa_ident.stability.labels.uncertain_tip import UncertainTip
from rcsa_ident.workflows.learn_from_cuts import Believed, learn_from_cuts

files = real_files("https://github.com/gengxiangc/BSLD", "labelled_cuts.png", "labelled_cuts_118.csv", "labelled_cuts_training_40.csv")
if files:
    tables = [np.loadtxt(file, delimiter=",", encoding="utf-8-sig") for file in files]  # speed [1e4 rev/min], depth [mm], chatter
    every, training = (
        TestedCuts(ri.rpm(1.0) * np.round(1e4 * t[:, 0]), 1e-3 * t[:, 1], tuple(Verdict.CHATTER if c else Verdict.STABLE for c in t[:, 2]))
        for t in tables
    )
    known = {tuple(np.round(row[:2], 6)) for row in tables[1]}
    unseen = np.array([tuple(np.round(row[:2], 6)) not in known for row in tables[0]])

    # published before any label: frequency [Hz], damping ratio and stiffness [N/m] with 80 Hz, 0.008 and 2 N/µm of standard deviation
    models, spreads = {}, []
    for axis, hertz, zeta, stiffness in ((ri.Dof.X, 782.7, 0.0184, 6.5616e6), (ri.Dof.Y, 752.8, 0.0186, 4.8852e6)):
        models[axis] = ri.normal_modes([ri.hz(hertz)], [zeta], [[ri.hz(hertz) / np.sqrt(stiffness)]], (ri.Coordinate("tip", axis),))
        spreads.append((80.0 / hertz, 0.008 / zeta, 2e6 / stiffness))
    prior = UncertainTip.independent(ri.TipModes.of(models), np.array(spreads).T, (1.5 / 10.95, 0.5 / 1.76))
    half = ri.Engagement.from_immersion(0.5, "down")
    tooling, cut = BareCutter("two teeth", ri.Cutter(2, 0.012)), ri.CutSpec(half)
    believed, method = Believed(prior, ri.CuttingCoefficients(10.95e8, 1.76 / 10.95)), ri.FullDiscretisation(tolerance=1e-2)
    learnt = learn_from_cuts(believed, tooling, cut, training, method, effort=Effort(first=300, further=100, rounds=2, kept=50))

    process, speeds = cut.process(tooling.cutter, learnt.workpiece), np.unique(every.spindle_speed)
    drawn, _ = learnt.drawn_limits(process, speeds, 12e-3, 50)
    stable = learnt.answers(process, every).stable
    right = (stable > 0.5) == every.seen(Verdict.STABLE)

    fig, ax = plt.subplots(figsize=(8.0, 4.4), layout="constrained")
    low, middle, high = 1e3 * np.quantile(drawn, (0.05, 0.5, 0.95), axis=0, method="nearest")
    ax.fill_between(to_rpm(speeds), low, high, color="C0", alpha=0.2, lw=0.0, label="limit, 90 % of the draws")
    ax.plot(to_rpm(speeds), middle, label="limit, median")
    for verdict, mark, colour in ((Verdict.STABLE, "o", "C2"), (Verdict.CHATTER, "x", "C1")):
        seen = every.seen(verdict)
        ax.plot(to_rpm(every.spindle_speed[seen]), 1e3 * every.axial_depth[seen], mark, color=colour, ms=5, label=f"{verdict}")
    ax.plot(to_rpm(every.spindle_speed[~unseen]), 1e3 * every.axial_depth[~unseen], "s", mfc="none", mec="0.4", ms=9, label="learned from")
    ax.set(xlabel="spindle speed [rev/min]", ylabel="axial depth [mm]", ylim=(0.0, 4.5), title="118 real cuts after forty labels")
    ax.legend(ncols=3, loc="upper right")

    print(f"told right: {right.sum()} of 118, {right[unseen].sum()} of the {unseen.sum()} unseen (published: 83.1 % and 79.7 %)")
    print(f"effective draws: {learnt.posterior.effective:.0f}")
    assert unseen.sum() == 79
    assert right.mean() > 0.80
