"""
What a longer stickout does to the tooltip
==========================================

Machine and spindle are known at the flange as five modes; four stickouts of one carbide tool are clamped in front of
them by receptance coupling. A longer tool is softer, so its peak rises, and slower, so its frequency falls.
"""

import matplotlib.pyplot as plt
import numpy as np

import rcsa_ident as ri
from rcsa_ident.base.units import to_hz
from rcsa_ident.coupling.joint import LumpedJoint
from rcsa_ident.dynamics.coordinates import plane
from rcsa_ident.machine.flange_machine import FlangeMachine

# %%
# Each mode has a translation and a slope at the flange; in front of it stands the joint between spindle and holder.
spindle = ri.normal_modes(
    omega_n=ri.hz(1.0) * np.array([180.0, 1000.0, 1820.0, 2330.0, 3970.0]),
    zeta=np.full(5, 0.05),
    psi=np.array([[0.08, 0.4], [0.15, 1.5], [0.25, 3.0], [0.2, 4.0], [0.15, 8.0]]),
    coordinates=plane("flange"),
)
machine = FlangeMachine((spindle,), (ri.hz(100.0), ri.hz(4500.0)), LumpedJoint(3e9, 6e6, 2000.0, 10.0))
carbide, steel = ri.MATERIALS["carbide"], ri.MATERIALS["steel"]
tool = (ri.BeamSegment(0.026, 0.0096, carbide), ri.BeamSegment(0.0845, 0.012, carbide))
holder = (ri.BeamSegment(0.04, 0.05, steel, 0.012), ri.BeamSegment(0.058, 0.063, steel, 0.020))

# %%
# The contact between tool and holder is springs and dampers along the insertion.
stickouts = np.array([0.050, 0.057, 0.064, 0.071])
omega, peaks = ri.hz(500.0, 4500.0, 5.0), []
fig, ax = plt.subplots(layout="constrained")
for stickout in stickouts:
    assembly = ri.clamped(tool, holder, stickout, insertion=0.0395, contact=ri.Contact(2e10, 6e5, 1e5, 40.0))
    height = np.abs(machine.tip(assembly, omega).between("tip.x", "tip.x"))
    peaks.append((to_hz(omega[height.argmax()]), height.max()))
    ax.semilogy(to_hz(omega), 1e6 * height, label=f"{1e3 * stickout:.0f} mm")
    ax.plot(peaks[-1][0], 1e6 * peaks[-1][1], "o", color=ax.lines[-1].get_color())
    print(f"stickout {1e3 * stickout:.0f} mm: {peaks[-1][0]:.0f} Hz, {1e6 * peaks[-1][1]:.3f} µm/N")
ax.set(xlabel="frequency [Hz]", ylabel="tooltip receptance [µm/N]", title="One tool, four stickouts")
ax.legend(title="stickout")

# %%
# Every millimetre counts: frequencies fall, peaks rise.
frequency, height = np.array(peaks).T
assert np.all(np.diff(frequency) < 0.0)
assert np.all(np.diff(height) > 0.0)
