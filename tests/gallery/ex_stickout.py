"""How a longer stickout moves the tooltip's first bending mode, on a machine that is described by five modes.

States the machine and a carbide tool in a holder, couples four stickouts, and looks at the strongest peak: a longer tool is
softer (its peak rises) and slower (its frequency falls).
"""

from __future__ import annotations

import numpy as np

from rcsa_ident.coupling.joint import LumpedJoint
from rcsa_ident.coupling.rcsa import couple
from rcsa_ident.dynamics.coordinates import plane
from rcsa_ident.dynamics.modal import normal_modes
from rcsa_ident.tool_holder.geometry import MATERIALS, BeamSegment, Contact, clamped
from rcsa_ident.tool_holder.model import tool_holder_receptance

OMEGA = 2.0 * np.pi * np.arange(500.0, 4500.0, 5.0)
SPINDLE = normal_modes(
    omega_n=2.0 * np.pi * np.array([180.0, 1000.0, 1820.0, 2330.0, 3970.0]),
    zeta=np.full(5, 0.05),
    psi=np.array([[0.08, 0.4], [0.15, 1.5], [0.25, 3.0], [0.2, 4.0], [0.15, 8.0]]),
    coordinates=plane("flange"),
)
JOINT = LumpedJoint(3e9, 6e6, 2000.0, 10.0)
TOOL = (BeamSegment(0.026, 0.0096, MATERIALS["carbide"]), BeamSegment(0.0845, 0.012, MATERIALS["carbide"]))
HOLDER = (BeamSegment(0.04, 0.05, MATERIALS["steel"], 0.012), BeamSegment(0.058, 0.063, MATERIALS["steel"], 0.020))


def strongest_peak(stickout: float) -> tuple[float, float]:
    """Return frequency [Hz] and height [m/N] of the tooltip's strongest peak."""
    assembly = clamped(TOOL, HOLDER, stickout, 0.0395, Contact(2e10, 6e5, 1e5, 40.0))
    coupled = couple(tool_holder_receptance(assembly, OMEGA), SPINDLE.receptance(OMEGA), JOINT)
    height = np.abs(coupled["tip", "tip"][:, 0, 0])
    return float(OMEGA[np.argmax(height)] / (2.0 * np.pi)), float(height.max())


PEAKS = [strongest_peak(stickout) for stickout in (0.050, 0.057, 0.064, 0.071)]
