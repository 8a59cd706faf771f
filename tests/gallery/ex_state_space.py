"""Active damping designed with python-control, and what it does to the stability lobes.

The tip's modes leave as a state space, an actuator there feeds the filtered velocity back in both directions, and the closed loop
comes back as modes that every lobe method takes. A force -c v on a mode adds c / (2 m omega_n) to its damping ratio.
"""

from __future__ import annotations

import control
import numpy as np

from rcsa_ident.cutting.coefficients import CuttingCoefficients
from rcsa_ident.cutting.conditions import Engagement
from rcsa_ident.cutting.cutter import Cutter
from rcsa_ident.cutting.process import MillingProcess
from rcsa_ident.dynamics.modal import normal_modes
from rcsa_ident.stability.full_discretisation import FullDiscretisation
from rcsa_ident.stability.lobes import stability_lobes
from rcsa_ident.stability.tip_modes import TIP, TipModes
from rcsa_ident.stability.zero_order import ZeroOrder

NATURAL, ZETA, MASS, ADDED = 2.0 * np.pi * 922.0, 0.011, 0.03993, 0.03
MACHINE = normal_modes([NATURAL, NATURAL], [ZETA, ZETA], np.eye(2) / np.sqrt(MASS), TIP)

# c s / (1 + s / corner): a damper from the displacement, with an actuator that follows up to its corner
DAMPER, CORNER = 2.0 * MASS * NATURAL * ADDED, 20.0 * NATURAL
FEEDBACK = control.ss(control.tf([DAMPER, 0.0], [1.0 / CORNER, 1.0]))
CLOSED = control.feedback(MACHINE.to_control(), control.append(FEEDBACK, FEEDBACK))

BARE, DAMPED = TipModes.joined([MACHINE.pole_residue()]), TipModes.from_control(CLOSED)
CUT = MillingProcess(Cutter(teeth=2, diameter=0.012), CuttingCoefficients(6e8, 1.0 / 3.0), Engagement.from_immersion(0.5, "down"))
SPEEDS = np.array([6000.0, 9000.0, 13_000.0]) * np.pi / 30.0
LOBES = {
    (name, type(method).__name__): stability_lobes(tip, CUT, SPEEDS, 0.05, method)
    for name, tip in (("bare", BARE), ("damped", DAMPED))
    for method in (ZeroOrder(), FullDiscretisation())
}
