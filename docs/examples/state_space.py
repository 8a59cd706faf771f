"""Active damping designed with python-control, and what it does to the stability lobes.

The tip's modes leave as a state space, an actuator there feeds the filtered velocity back in both directions, and the closed loop
comes back as modes that every lobe method takes. A force -c v on a mode adds c / (2 m omega_n) to its damping ratio.
"""

import control
import numpy as np

import rcsa_ident as ri

NATURAL, ZETA, MASS, ADDED = ri.hz(922.0), 0.011, 0.03993, 0.03
TIP = (ri.Coordinate("tip", ri.Dof.X), ri.Coordinate("tip", ri.Dof.Y))
MACHINE = ri.normal_modes([NATURAL, NATURAL], [ZETA, ZETA], np.eye(2) / np.sqrt(MASS), TIP)

# c s / (1 + s / corner): a damper from the displacement, with an actuator that follows up to its corner
DAMPER, CORNER = 2.0 * MASS * NATURAL * ADDED, 20.0 * NATURAL
FEEDBACK = control.ss(control.tf([DAMPER, 0.0], [1.0 / CORNER, 1.0]))
CLOSED = control.feedback(MACHINE.to_control(), control.append(FEEDBACK, FEEDBACK))

BARE, DAMPED = ri.TipModes.joined([MACHINE.pole_residue()]), ri.TipModes.from_control(CLOSED)
CUT = ri.MillingProcess(ri.Cutter(2, diameter=0.012), ri.CuttingCoefficients(6e8, 1.0 / 3.0), ri.Engagement.from_immersion(0.5, "down"))
SPEEDS = ri.rpm(1.0) * np.array([6000.0, 9000.0, 13_000.0])
LOBES = {
    (name, type(method).__name__): ri.stability_lobes(tip, CUT, SPEEDS, 0.05, method)
    for name, tip in (("bare", BARE), ("damped", DAMPED))
    for method in (ri.ZeroOrder(), ri.FullDiscretisation())
}
