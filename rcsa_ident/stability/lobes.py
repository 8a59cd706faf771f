"""One verb for all lobe methods, and what they need to know of the tip."""

from __future__ import annotations

import numpy as np

from rcsa_ident.arrays import FloatArray
from rcsa_ident.cutting.process import MillingProcess
from rcsa_ident.dynamics.coordinates import Coordinate, Dof
from rcsa_ident.dynamics.receptance import Receptance
from rcsa_ident.errors import InputError, positive
from rcsa_ident.stability.methods import StabilityMethod
from rcsa_ident.stability.result import StabilityLobes
from rcsa_ident.stability.tip_modes import TipModes
from rcsa_ident.stability.zero_order import ZeroOrder

_ZERO_ORDER = ZeroOrder()


def stability_lobes(
    tip: Receptance | TipModes,
    process: MillingProcess,
    speeds: FloatArray,
    max_depth: float,
    method: StabilityMethod = _ZERO_ORDER,
) -> StabilityLobes:
    """Return the stability limit of a milling cut over spindle speed.

    Parameters
    ----------
    tip : Receptance or TipModes
        Between ``tip.x`` and ``tip.y`` (machine axes) with their cross terms; `uncoupled_planes` makes a receptance from two
        bending planes. Further coordinates are left aside. Methods that march through time need modes, the others take both.
    process : MillingProcess
    speeds : array, shape (n,) [rad/s]
        In any order.
    max_depth : float [m]
        Limits beyond it are not of interest.
    method : StabilityMethod, default ZeroOrder()

    Raises
    ------
    InputError
        If the tip's coordinates are missing, or a speed or the depth is not usable.
    """
    speeds = np.atleast_1d(np.asarray(speeds, dtype=float))
    if speeds.ndim != 1 or speeds.size == 0 or not np.all(np.isfinite(speeds) & (speeds > 0.0)):
        raise InputError("speeds", speeds.tolist(), "one or more finite spindle speeds above 0 [rad/s]")
    return method.lobes(tip, process, speeds, positive("max_depth", max_depth, "m"))


def uncoupled_planes(x: Receptance | None, y: Receptance | None) -> Receptance:
    """Return the tip's 2 x 2 receptance of a machine whose bending planes do not feel each other.

    Parameters
    ----------
    x : Receptance or None
        With ``tip.x``, as coupling gives it for the X plane; None is a rigid direction.
    y : Receptance or None
        With ``tip.y``, at the same frequencies.
    """
    known = [h for h in (x, y) if h is not None]
    if not known:
        raise InputError("tip receptances", "none", "at least one flexible direction")
    omega = known[0].omega
    if len(known) == 2 and not np.array_equal(omega, known[1].omega):
        raise InputError("y receptance", f"{known[1].omega.size} frequencies", f"the {omega.size} frequencies of the x receptance")
    values = np.zeros((omega.size, 2, 2), dtype=complex)
    for i, (h, name) in enumerate(((x, "tip.x"), (y, "tip.y"))):
        if h is not None:
            values[:, i, i] = h.between(name, name)
    coordinates = (Coordinate("tip", Dof.X), Coordinate("tip", Dof.Y))
    return Receptance(omega, values, coordinates, coordinates)
