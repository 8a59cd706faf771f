"""
Du and others 2023: a robot's tool that the cut bends
=====================================================

A milling robot is soft: the cut bends the tool away, so that teeth enter later, and the worn flank damps. Both lift
the limit. At 8200 rev/min the publication tells by how much: a quarter. What it leaves open, diameter and compliance
of the machine, is taken here as 10 mm of solid carbide and 0.26 µm/N.

Source: :cite:`du2023`.
"""

import matplotlib.pyplot as plt
import numpy as np

import rcsa_ident as ri
from rcsa_ident.base.units import to_rpm
from rcsa_ident.cutting.deflection import ToolDeflection, deflected_edge, deflected_process

# %%
# One mode a direction, three teeth, 45° helix, four of ten millimetres in down-milling of aluminium.
modes = {}
for axis, hertz, zeta, shape in ((ri.Dof.X, 2060.49, 0.0237, 3.232), (ri.Dof.Y, 2045.24, 0.0207, 4.119)):
    modes[axis] = ri.normal_modes([ri.hz(hertz)], [zeta], [[shape]], (ri.Coordinate("tip", axis),))
tip, cutter = ri.TipModes.of(modes), ri.Cutter(3, 0.010, np.radians(45.0))
coefficients = ri.CuttingCoefficients(855e6, 270.93 / 855.0, tangential_edge=15.64e3, radial_edge=14.167e3)
half = ri.Engagement.from_immersion(0.4, "down")
sharp = ri.MillingProcess(cutter, coefficients, half)
worn = ri.MillingProcess(cutter, coefficients, half, damping=ri.ProcessDamping(1.5e14, 40e-6, 0.3))
bent = ToolDeflection(0.061, 600e9 * np.pi / 64.0 * 0.01**4, 0.26e-6, feed_rate=0.01)
cuts = {"rigid, sharp": sharp, "bent": deflected_process(sharp, bent), "damped": worn, "bent and damped": deflected_process(worn, bent)}

# %%
# Lobes of the two ends of the comparison, and all four at 8200 rev/min.
speeds, method = ri.rpm(6800, 9600, 200), ri.FullDiscretisation()
at_8200 = {name: ri.stability_lobes(tip, cut, ri.rpm(8200), 20e-3, method).limit_depth[0] for name, cut in cuts.items()}
edge = deflected_edge(sharp, bent, ri.rpm(10_000), 6.85e-3)
fig, (left, right) = plt.subplots(1, 2, figsize=(9.6, 4.0), width_ratios=(1.5, 1.0), layout="constrained")
for name in ("rigid, sharp", "bent and damped"):
    left.plot(
        to_rpm(speeds),
        1e3 * ri.stability_lobes(tip, cuts[name], speeds, 10e-3, ri.FullDiscretisation(tolerance=1e-2)).limit_depth,
        label=name,
    )
left.axvline(8200.0, color="0.5", ls="--", lw=1.0)
left.set(xlabel="spindle speed [rev/min]", ylabel="stability limit [mm]", ylim=(0.0, 9.0), title="Lobes")
left.legend()
right.barh(list(at_8200), [1e3 * each for each in at_8200.values()], color=["C0", "C2", "C4", "C1"])
right.invert_yaxis()
right.set(xlabel="stability limit [mm]", title="At 8200 rev/min")

# %%
# Published is a gain of 25 %, and an entry that the bending delays by more than a degree.
gain = at_8200["bent and damped"] / at_8200["rigid, sharp"] - 1.0
shift = np.degrees(edge.start[0] - half.entry)
print(f"deformation and damping: +{100 * gain:.1f} % (published: +25 %); entry later by {shift:.2f} degrees (published: more than 1)")
assert shift > 1.0
assert abs(gain - 0.25) < 0.03
