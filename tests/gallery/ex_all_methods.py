"""The first loss of stability of one low-immersion cut by every method, and the map of its islands.

Two teeth, a twentieth of the diameter, a mode at 922 Hz: period doubling lies far below what the mean force lets expect.
"""

from __future__ import annotations

import numpy as np

from rcsa_ident.cutting.coefficients import CuttingCoefficients
from rcsa_ident.cutting.conditions import Engagement
from rcsa_ident.cutting.cutter import Cutter
from rcsa_ident.cutting.process import MillingProcess
from rcsa_ident.dynamics.coordinates import Coordinate, Dof
from rcsa_ident.dynamics.modal import normal_modes
from rcsa_ident.stability.full_discretisation import FullDiscretisation
from rcsa_ident.stability.lobes import stability_lobes
from rcsa_ident.stability.multi_frequency import MultiFrequency
from rcsa_ident.stability.semi_discretisation import SemiDiscretisation
from rcsa_ident.stability.stability_map import stability_map
from rcsa_ident.stability.time_domain import TimeDomain
from rcsa_ident.stability.tip_modes import TipModes
from rcsa_ident.stability.zero_order import ZeroOrder

MODE = normal_modes([2.0 * np.pi * 922.0], [0.011], [[1.0 / np.sqrt(0.03993)]], (Coordinate("tip", Dof.X),))
TIP = TipModes.of({Dof.X: MODE})
CUT = MillingProcess(Cutter(teeth=2, diameter=0.012), CuttingCoefficients(6e8, 1.0 / 3.0), Engagement.from_immersion(0.05, "down"))
HELICAL = MillingProcess(Cutter(2, 0.012, np.radians(30.0)), CuttingCoefficients(6e8, 1.0 / 3.0), Engagement.from_immersion(0.05, "up"))
METHODS = (ZeroOrder(), MultiFrequency(), SemiDiscretisation(), FullDiscretisation(), TimeDomain())

LIMITS = {type(m).__name__: stability_lobes(TIP, CUT, [18_000.0 * np.pi / 30.0], 0.03, m).limit_depth[0] for m in METHODS}
MAP = stability_map(TIP, HELICAL, np.linspace(8000.0, 24_000.0, 65) * np.pi / 30.0, np.linspace(0.3e-3, 18e-3, 60))
