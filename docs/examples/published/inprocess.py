"""
The in-process method: its printed modes of a spindle
=====================================================

Modes of a machine and its spindle, identified from cuts by a genetic algorithm, were printed together with what
chattered in a validation. Here those of Y carry a nominal drawing of its second tooling. Two things come out: which
way the printed slopes count, and that some printed modes feed energy in.

Source: :cite:`inprocess`.
"""

import matplotlib.pyplot as plt
import numpy as np

import rcsa_ident as ri
from rcsa_ident.base.units import to_hz
from rcsa_ident.coupling.joint import LumpedJoint
from rcsa_ident.coupling.rcsa import couple
from rcsa_ident.dynamics.coordinates import plane
from rcsa_ident.dynamics.modal import ModalModel
from rcsa_ident.dynamics.receptance import dissipation
from rcsa_ident.tool_holder.geometry import Material, ToolAssembly
from rcsa_ident.tool_holder.model import tool_holder_receptance

# %%
# Table A.5: frequency [Hz], damping [%], Re and Im of translation [1e-4 sqrt(s/kg)] and slope [1e-4 rad sqrt(s/(kg m²))]; the
# joint is that of table A.6.
printed = """
 600.0 20.0 -15.3  14.3 -153.3 -143.7
 894.8 12.3  -8.7   8.7  -87.5  -87.5
1171.4 13.3  16.3 -16.3  163.4    9.6
1682.6  5.0   6.6  -6.3   65.6   63.2
1792.2  5.0   4.2  -4.2   42.3   42.0
2191.8  5.0  14.0   0.4   69.9    1.8
2228.9 12.2 -17.8  17.8  -89.0   89.0
2347.7  5.0 -17.9  17.9  -89.3   32.5
2501.8  5.4 -10.4 -10.4 -104.5  -45.9
3000.0  7.6  10.8  10.8  107.6  -15.3
"""
f, zeta, t_re, t_im, r_re, r_im = np.array(printed.split(), dtype=float).reshape(-1, 6).T
joint = LumpedJoint(999.4e12, 999.8e12, 794.5, 20.0)

# %%
# The drawing is nominal: stickout 60.9 mm as published, diameters as such a tool and holder have them.
carbide, steel = Material(600e9, 14_400.0, 0.22, 0.003), Material(205e9, 7850.0, 0.3, 0.003)
tool = (ri.BeamSegment(0.03, 0.0096, carbide), ri.BeamSegment(0.0309, 0.012, carbide))
holder = (ri.BeamSegment(0.05, 0.04, steel), ri.BeamSegment(0.024, 0.045, steel, 0.014), ri.BeamSegment(0.026, 0.063, steel, 0.02))
omega = ri.hz(600.0, 3500.0, 5.0)
front = tool_holder_receptance(ToolAssembly(tool, holder, 0.0), omega, ri.Dof.Y)

tips, least = {}, 0.0
for name, sign in (("slopes as printed", 1.0), ("slopes negated", -1.0)):
    phi = 1e-4 * np.stack([t_re + 1j * t_im, sign * (r_re + 1j * r_im)], axis=1)
    flange = ModalModel(ri.hz(1.0) * f, zeta / 100.0, phi, np.zeros((2, 2)), plane("flange", ri.Dof.Y)).receptance(omega)
    tips[name] = couple(front, flange, joint)["tip", "tip"][:, 0, 0]
    least = min(least, dissipation(omega, flange.values).min())

# %%
# A point's receptance that dissipates has a negative imaginary part at all frequencies.
fig, (top, bottom) = plt.subplots(2, 1, figsize=(7.2, 5.2), sharex=True, layout="constrained")
for (name, tip), colour in zip(tips.items(), ("C1", "C0"), strict=True):
    top.plot(to_hz(omega), 1e6 * np.abs(tip), color=colour, label=name)
    bottom.plot(to_hz(omega), 1e6 * tip.imag, color=colour)
for told in (2400.0, 2700.0):
    top.axvline(told, color="0.5", ls="--", lw=1.0)
top.set(ylabel="magnitude [µm/N]", title="Tip of the second tooling, Y (dashed: modes that the source names)")
top.legend(loc="upper left")
bottom.axhspan(0.0, 3.0, color="C1", alpha=0.1, lw=0.0)
bottom.set(xlabel="frequency [Hz]", ylabel="imaginary part [µm/N]", ylim=(-1.5, 3.0), title="Above zero the tip feeds energy in")

# %%
# As printed the tip feeds energy in nearly everywhere, with the slopes negated hardly anywhere; the flange does so either way.
share = {name: np.mean(tip.imag > 0.0) for name, tip in tips.items()}
peak = to_hz(omega[np.argmax(np.abs(tips["slopes negated"]))])
print({name: f"{100 * each:.0f} % of the lines feed energy in" for name, each in share.items()})
print(f"strongest peak at {peak:.0f} Hz; the source names 2400 and 2700 Hz; least dissipation at the flange {least:.2f} of the mobility")
assert abs(peak / 2700.0 - 1.0) < 0.05
assert least < -1.0
assert share["slopes negated"] < 0.05 < 0.95 < share["slopes as printed"]
