"""Forces as sums over rows of edge, beside the closed forms of a cylinder that were written before shapes were known."""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np

from benchmarks.timing import Race, best_of, row
from rcsa_ident.cutting.coefficients import CuttingCoefficients
from rcsa_ident.cutting.conditions import CuttingConditions, Engagement
from rcsa_ident.cutting.cutter import Cutter
from rcsa_ident.cutting.force import force_and_slope, unit_lines
from rcsa_ident.cutting.profile import Profile
from tests.oracles import cylinder_forces

#: As many lines as a cut at 8000 rev/min shows of four teeth.
ORDERS = 4 * np.arange(1, 9)
#: As many as unlike teeth may tell.
MANY = np.arange(1, 65)
COEFFICIENTS = CuttingCoefficients(902e6, 0.26, 0.1, 12e3, 10e3)
CUT = CuttingConditions(840.0, 0.4e-3, 1e-4, Engagement.from_immersion(0.5, "down"), 0.3)


def run() -> list[dict[str, Any]]:
    """Force lines per coefficient with and without run-out, unequal pitch and many orders, with all slopes, of a corner radius."""
    return [*(race.row() for race in races()), _rounded()]


def races() -> list[Race]:
    """All that has closed forms."""
    unequal = Cutter(4, 0.012, np.radians(30.0), pitch=np.radians([84.0, 96.0, 84.0, 96.0]))
    return [
        _lines("8 orders", _cylinder(False), ORDERS),
        _lines("8 orders, run-out", _cylinder(True), ORDERS, runout=True),
        _lines("8 orders, unequal pitch", unequal, ORDERS),
        _lines("64 orders", _cylinder(False), MANY),
        _lines("64 orders, unequal pitch", unequal, MANY),
        _slopes(),
    ]


def cylinder_lines(runout: bool) -> np.ndarray:
    """Lines of a cylinder at eight orders as sums over rows, per unit of K_tc, K_rc, K_te and K_re."""
    return np.asarray(unit_lines(_cylinder(runout), CUT, ORDERS, runout=runout)[..., :4])


def closed_lines(runout: bool) -> np.ndarray:
    """The same by the closed forms."""
    return _closed(_cylinder(runout), ORDERS, runout)


def _cylinder(runout: bool) -> Cutter:
    return Cutter(4, 0.012, np.radians(30.0), runout=2e-6 * np.cos(0.5 * np.pi * np.arange(4) - 0.2) if runout else None)


def _told(cutter: Cutter, orders: np.ndarray) -> tuple[Any, ...]:
    engagement = CUT.engagement
    assert isinstance(engagement, Engagement)
    rest = (CUT.axial_depth, CUT.feed_per_tooth, engagement.entry, engagement.exit, CUT.feed_angle, orders)
    return (cutter.diameter, cutter.helix, *rest)


def _closed(cutter: Cutter, orders: np.ndarray, runout: bool) -> np.ndarray:
    if runout:
        return np.asarray(cylinder_forces.unit_lines(cutter.pitch, cutter.runout, *_told(cutter, orders)))
    return np.asarray(cylinder_forces.true_unit_lines(cutter.pitch, *_told(cutter, orders)))


def _lines(name: str, cutter: Cutter, orders: np.ndarray, runout: bool = False) -> Race:
    ours, peer = unit_lines(cutter, CUT, orders, runout=runout), _closed(cutter, orders, runout)
    error = float(np.max(np.abs(ours[..., :4] - peer) / np.abs(peer).max(axis=(0, 1))))
    return Race(
        f"lines of a cylinder per coefficient: {name}",
        "closed forms along the helix, NumPy",
        "numpy",
        partial(unit_lines, cutter, CUT, orders, runout=runout),
        partial(_closed, cutter, orders, runout),
        f"{error:.0e}",
    )


def _slopes() -> Race:
    """The peer asks its closed forms for each coefficient by itself and for run-out, as it was done."""
    cutter, eccentric = _cylinder(False), _cylinder(True)

    def before() -> None:
        for _ in range(5):
            _closed(cutter, ORDERS, False)
        _closed(eccentric, ORDERS, True)

    ours = partial(force_and_slope, cutter, CUT, COEFFICIENTS, ORDERS)
    return Race("lines of a cylinder with their slopes", "closed forms along the helix, NumPy", "numpy", ours, before, "the same lines")


def _rounded() -> dict[str, Any]:
    cutter = Cutter(4, 0.012, np.radians(30.0), profile=Profile.bull_nose(0.012, 0.5e-3))
    time = best_of(lambda: unit_lines(cutter, CUT, ORDERS))
    return row("lines of a bull nose per coefficient", 1e6 * time, None, "us", "")
