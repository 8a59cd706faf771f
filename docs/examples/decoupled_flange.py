"""A spindle's flange from three artefacts: tip, flange and across measured with each, rotations never.

The flange that comes out carries a tool that was not measured; its tip is that of the machine.
"""

import numpy as np

import rcsa_ident as ri
from rcsa_ident.coupling.flange_fit import Observation, least_squares_flange
from rcsa_ident.coupling.joint import LumpedJoint
from rcsa_ident.coupling.rcsa import couple
from rcsa_ident.dynamics.coordinates import plane
from rcsa_ident.machine.measured import MeasuredFlange
from rcsa_ident.tool_holder.geometry import ToolAssembly
from rcsa_ident.tool_holder.model import tool_holder_receptance

OMEGA = ri.hz(400.0, 2990.0, 10.0)
JOINT = LumpedJoint(2e9, 5e6, 2000.0, 10.0)
MACHINE = ri.normal_modes(
    ri.hz(1.0) * np.array([700.0, 1300.0, 2500.0, 3600.0]),
    np.array([0.05, 0.04, 0.05, 0.06]),
    np.array([[0.3, 3.0], [-0.25, 2.0], [0.2, -4.0], [0.1, 5.0]]),
    plane("flange"),
)
STEEL = ri.MATERIALS["steel"]


def artefact(length: float, diameter: float) -> ri.Receptance:
    """Return the receptances of a steel cylinder on a holder's root."""
    root = (ri.BeamSegment(0.03, 0.05, STEEL), ri.BeamSegment(0.026, 0.063, STEEL, 0.02))
    return tool_holder_receptance(ToolAssembly((ri.BeamSegment(length, diameter, STEEL),), root, 0.0), OMEGA)


RNG = np.random.default_rng(1)
MEASURED = []
for LENGTH in (0.02, 0.06, 0.10):
    HOLDER = artefact(LENGTH, 0.04)
    ASSEMBLY = couple(HOLDER, MACHINE.receptance(OMEGA), JOINT)
    for ROW, COL in (("tip", "tip"), ("spindle", "tip"), ("spindle", "spindle")):
        H = ASSEMBLY[ROW, COL][:, 0, 0]
        NOISE = 0.01 * np.abs(H)
        MEASURED.append(Observation(HOLDER, ROW, COL, H + NOISE * (RNG.normal(size=H.size) + 1j * RNG.normal(size=H.size)), NOISE))

FOUND = least_squares_flange(MEASURED, JOINT)
NEVER_MEASURED = artefact(0.08, 0.03)
TIP = couple(NEVER_MEASURED, MeasuredFlange(FOUND.receptance).receptance(OMEGA), JOINT)["tip", "tip"][:, 0, 0]
TRUE_TIP = couple(NEVER_MEASURED, MACHINE.receptance(OMEGA), JOINT)["tip", "tip"][:, 0, 0]
