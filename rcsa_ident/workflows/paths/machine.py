"""The path to command so that a machine whose tool gives way under forces cuts where it should."""

from __future__ import annotations

import numpy as np

from rcsa_ident.base.arrays import FloatArray
from rcsa_ident.base.units import from_hz
from rcsa_ident.machine.machine import Machine
from rcsa_ident.setup.tooling import Tooling
from rcsa_ident.stability.tip_modes import DIRECTIONS
from rcsa_ident.toolpath.compensation import LARGEST, CompensatedPath, Place, limited, mirrored
from rcsa_ident.toolpath.deviation import Deviation
from rcsa_ident.toolpath.forces import ForceAlongPath
from rcsa_ident.toolpath.path import ToolPath

#: Of a machine that is known by its modes this stands for rest [Hz]; a measured one is asked where its measurement begins.
_REST = 1.0


def compliance_at_rest(machine: Machine, tooling: Tooling, draws: int, rng: np.random.Generator) -> tuple[FloatArray, FloatArray]:
    """Return how far the tip of a tooling gives way to a steady force, shape (3, 3) [m/N], and draws of it, (draws, 3, 3).

    Along machine X, Y and Z; a direction of which nothing is known is rigid. No draws where nothing is doubted.
    """
    assert machine.band is not None
    # beside it the highest: how fine the tool-holder's mesh is goes by that
    omega = np.array([machine.band[0] if machine.ends else from_hz(_REST), machine.band[1]])
    tip = machine.tip(tooling, omega, spread=draws > 0, directions=DIRECTIONS[:3]).among(DIRECTIONS[:3])
    drawn = tip.drawn(draws, rng)[:, 0].real if draws and tip.variation is not None else np.empty((0, 3, 3))
    return tip.values[0].real, drawn


def compensate_machine(
    path: ToolPath, force: ForceAlongPath, compliance: FloatArray, draws: FloatArray, largest: float = LARGEST
) -> CompensatedPath:
    """Return the path to command so that a tool that gives way in proportion to the force goes where the path has it.

    The machine is taken to answer each force as it does at rest, and its controller to go where it is sent.

    Parameters
    ----------
    path : ToolPath
        In the machine's axes; its places are those that are corrected.
    force : ForceAlongPath
    compliance : array, shape (3, 3) [m/N]
    draws : array, shape (s, 3, 3) [m/N]
        Others that what is known allows.
    largest : float [m]
        No place is corrected by more; where that would be, it is told.

    Examples
    --------
    A slender end mill that 200 N push 0.1 mm aside:

    >>> path = ToolPath(np.array([[0.0, 0.0, 0.0], [0.1, 0.0, 0.0]]), feed=np.full(2, 0.05))
    >>> push = ForceAlongPath(np.array([0.0]), np.array([[0.0, 200.0, 0.0]]))
    >>> found = compensate_machine(path, push, np.diag([5e-7, 5e-7, 0.0]), np.empty((0, 3, 3)))
    >>> found.path.places[:, 1].round(9).tolist(), round(1e3 * found.before.rms, 6), found.after.rms
    ([-0.0001, -0.0001], 0.1, 0.0)
    """
    cutting = path.beside_cutting
    forces = np.where(cutting[:, None], force.at(path.times), 0.0)
    commanded = mirrored(path.places, lambda places: places + forces @ compliance.T)
    correction, saturated = limited(commanded - path.places, largest)
    became = np.where(saturated, Place.SATURATED, np.where(cutting, Place.CORRECTED, Place.RAPID))

    def left(own: FloatArray, sent: FloatArray) -> Deviation:
        return Deviation.of(path, sent + forces @ own.T, path.places)

    sent = path.places + correction
    return CompensatedPath(
        path.through(sent),
        correction,
        tuple(map(Place, became)),
        Deviation.of(path, path.places, path.places),
        left(compliance, path.places),
        left(compliance, sent),
        tuple(left(each, sent) for each in draws),
    )
