"""How a longer stickout moves the tooltip's first bending mode, on a machine that is described by five modes.

States the machine and a carbide tool in a holder, clamps four stickouts, and looks at the strongest peak: a longer tool is
softer (its peak rises) and slower (its frequency falls).
"""

import numpy as np

import rcsa_ident as ri
from rcsa_ident.coupling.joint import LumpedJoint
from rcsa_ident.dynamics.coordinates import plane
from rcsa_ident.machine.flange_machine import FlangeMachine

SPINDLE = ri.normal_modes(
    omega_n=ri.hz(1.0) * np.array([180.0, 1000.0, 1820.0, 2330.0, 3970.0]),
    zeta=np.full(5, 0.05),
    psi=np.array([[0.08, 0.4], [0.15, 1.5], [0.25, 3.0], [0.2, 4.0], [0.15, 8.0]]),
    coordinates=plane("flange"),
)
MACHINE = FlangeMachine((SPINDLE,), (ri.hz(100.0), ri.hz(4500.0)), LumpedJoint(3e9, 6e6, 2000.0, 10.0))
CARBIDE, STEEL = ri.MATERIALS["carbide"], ri.MATERIALS["steel"]
TOOL = (ri.BeamSegment(0.026, 0.0096, CARBIDE), ri.BeamSegment(0.0845, 0.012, CARBIDE))
HOLDER = (ri.BeamSegment(0.04, 0.05, STEEL, 0.012), ri.BeamSegment(0.058, 0.063, STEEL, 0.020))


def strongest_peak(stickout: float) -> tuple[float, float]:
    """Return frequency [Hz] and height [m/N] of the tooltip's strongest peak."""
    assembly = ri.clamped(TOOL, HOLDER, stickout, insertion=0.0395, contact=ri.Contact(2e10, 6e5, 1e5, 40.0))
    tip = MACHINE.tip(assembly, ri.hz(500.0, 4500.0, 5.0))
    height = np.abs(tip.between("tip.x", "tip.x"))
    return float(tip.omega[np.argmax(height)] / ri.hz(1.0)), float(height.max())


PEAKS = [strongest_peak(stickout) for stickout in (0.050, 0.057, 0.064, 0.071)]

if __name__ == "__main__":
    for frequency, height in PEAKS:
        print(f"{frequency:6.0f} Hz  {1e6 * height:.3f} µm/N")
