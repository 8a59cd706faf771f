"""Mills that the tests of the marching methods share, as modes and as the tables that slow twins take."""

from __future__ import annotations

import numpy as np

from rcsa_ident.cutting.coefficients import CuttingCoefficients
from rcsa_ident.cutting.conditions import Engagement
from rcsa_ident.cutting.cutter import Cutter
from rcsa_ident.cutting.process import MillingProcess, ProcessDamping
from rcsa_ident.dynamics.coordinates import Coordinate, Dof
from rcsa_ident.dynamics.modal import ModalModel, normal_modes
from rcsa_ident.stability.tip_modes import TipModes
from tests.oracles.literature import FOUR_MODES, INSPERGER_STEPAN

RPM = np.pi / 30.0
#: Modes as axis (0 or 1), natural frequency [Hz], damping ratio, mass [kg].
Table = tuple[tuple[int, float, float, float], ...]
_I = INSPERGER_STEPAN
ONE: Table = ((0, _I["natural_frequency_hz"], _I["damping_ratio"], _I["modal_mass"]),)
TWO: Table = (*ONE, (1, *ONE[0][1:]))
SKEWED: Table = ((0, 780.0, 0.03, 0.05), (1, 930.0, 0.02, 0.04), (1, 1350.0, 0.03, 0.08))
FOUR: Table = tuple((axis, *row) for axis, name in ((0, "x"), (1, "y")) for row in FOUR_MODES[name].tolist())
COEFFICIENTS = CuttingCoefficients(_I["tangential"], _I["normal"] / _I["tangential"])
FOUR_COEFFICIENTS = CuttingCoefficients(FOUR_MODES["tangential"], FOUR_MODES["normal"] / FOUR_MODES["tangential"])
#: A mode in a slow slot, whose vibrations grow for many passes before they die away.
PASSING: Table = ((1, 900.0, 0.02, 0.04),)
#: Slow slots of such: wear land [m], damping ratio, immersion and speed [rev/min].
SLOW = [(1e-4, 0.02, 1.0, 1600.0), (2e-5, 0.02, 1.0, 800.0), (None, 0.1, 1.0, 400.0), (None, 0.1, 0.05, 800.0), (5e-5, 0.02, 0.3, 800.0)]
SLOT = Engagement(0.0, np.pi)
HALF = Engagement.from_immersion(0.5, "down")


def plane(axis: Dof, table: Table, residual: float = 0.0) -> ModalModel:
    """Modes of one direction."""
    _, frequency, zeta, mass = np.array([row for row in table if row[0] == int(axis is Dof.Y)]).T
    shape, where = 1.0 / np.sqrt(mass)[:, None], (Coordinate("tip", axis),)
    return normal_modes(2.0 * np.pi * frequency, zeta, shape, where, np.array([[residual]]))


def tip(table: Table, residual: tuple[float, float] = (0.0, 0.0), turn: float = 0.0) -> TipModes:
    """The tip's modes; `turn` is the machine turned about the spindle."""
    axes = [axis for i, axis in enumerate((Dof.X, Dof.Y)) if any(row[0] == i for row in table)]
    found = TipModes.of({axis: plane(axis, table, residual[int(axis is Dof.Y)]) for axis in axes})
    c, s = np.cos(turn), np.sin(turn)
    rotation = np.array([[c, -s], [s, c]])
    return TipModes(found.pole, rotation @ found.outputs, found.inputs @ rotation.T, rotation @ found.constant @ rotation.T)


def mill(teeth: int = 2, immersion: float = 0.5, strategy: str = "down", helix: float = 0.0, **more) -> MillingProcess:
    """A cut with a cutter of 12 mm; `pitch` and `runout` are the cutter's."""
    own = {name: np.asarray(more.pop(name)) for name in ("pitch", "runout") if name in more}
    coefficients = more.pop("coefficients", COEFFICIENTS)
    return MillingProcess(Cutter(teeth, 0.012, helix, **own), coefficients, Engagement.from_immersion(immersion, strategy), **more)


def slow_slot(wear_land: float | None, immersion: float = 1.0) -> MillingProcess:
    """Two teeth, as `PASSING` wants them."""
    damping = None if wear_land is None else ProcessDamping(1e14, wear_land)
    return mill(2, immersion, "up", coefficients=CuttingCoefficients(7e8, 0.3), damping=damping, feed_per_tooth=1e-4)
