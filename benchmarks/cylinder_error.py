"""Limits of cutters of every shape beside those of the cylinder of the same diameter, as which all of them were computed before.

Cutters and machines are made up (`tests/stability/shaped_mills.py`). The cylinder has the same teeth, pitch, mean helix, coefficients and
angles of engagement at its diameter, and a tip that moves in X and Y alone. Ours is the limit of the shape, the peer the cylinder's, at
the speed where the two are farthest apart; a ratio above 1 is unsafe. Behind them stand the ratios over all speeds, and those that two
roads found which are no part of this package.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from benchmarks.timing import row
from rcsa_ident.base.arrays import FloatArray
from rcsa_ident.cutting.conditions import widest
from rcsa_ident.cutting.cutter import Cutter
from rcsa_ident.cutting.process import MillingProcess
from rcsa_ident.cutting.profile import Profile
from rcsa_ident.stability.discretisation import FullDiscretisation
from rcsa_ident.stability.lobes import stability_lobes
from rcsa_ident.stability.tip_modes import TipModes
from tests.stability import shaped_mills as mills

METHOD = FullDiscretisation(tolerance=1e-3)
#: A cut, the tip that it shakes, speeds [rev/min].
Case = tuple[MillingProcess, TipModes, Sequence[float]]


class Compared(NamedTuple):
    """Cases of one kind, and the ratios that had been found of them; `equal` is of a cylinder whose pitch is taken as equal, too."""

    claim: str
    cases: tuple[Case, ...]
    found: str
    equal: bool = False


def _named(*names: str) -> tuple[Case, ...]:
    return tuple(mills.LIMITS[name][:3] for name in names)


ROUGHERS = tuple((mills.rougher(1e-3 * feed), mills.tip(mills.M1[:2]), mills.ROUGHER_SPEEDS) for feed in mills.ROUGHER)
COMPARED = (
    Compared("45° face mill Ø63, sharp and with a corner radius", _named("A", "A, corner"), "0.93 to 0.98"),
    Compared("45° face mill Ø63, tip tilts by 7 rad per metre", _named("A, slope -7"), "0.72"),
    Compared("45° face mill Ø160, tip tilts by 7 rad per metre", _named("A Ø160, slope -7"), "about 0.38"),
    Compared("high feed into a block", _named("B"), "0.61 to 1.45"),
    Compared("high feed with a stepover", _named("B, stepover"), "0.77 to 1.85"),
    Compared("high feed into a block, soft Z axis", _named("B, Z soft"), "0.92 to 4.0"),
    Compared("ball in a slot", _named("C", "C, deep"), "0.80 to 1.07"),
    Compared("ball at a shoulder", _named("C, block"), "0.81 to 0.89"),
    Compared("ball in a slot, soft Z axis", _named("C, Z soft"), "up to 1.30"),
    Compared("bull nose, 3 mm on Ø16", _named("D"), "0.95 to 1.17"),
    Compared("bull nose, soft Z axis", _named("D, Z soft"), "up to 1.72"),
    Compared("helix of each tooth", _named("E A"), "0.79 to 0.91"),
    Compared("helix of each tooth and unequal pitch, as mean helix", _named("E B"), "0.75 to 0.94"),
    Compared("helix of each tooth and unequal pitch, as equal teeth", _named("E B"), "0.43 to 0.99", equal=True),
    Compared("rougher, three feeds", ROUGHERS, "0.24 to 0.47"),
)


def run() -> list[dict[str, Any]]:
    """All kinds of cutters at the speeds of their cases."""
    return [_row(each) for each in COMPARED]


def limits(compared: Compared) -> tuple[FloatArray, FloatArray]:
    """Return the limits of the shapes and of their cylinders [m] at all speeds of the cases, one after the other."""
    pairs = [[limits_of(*case), limits_of(*cylinder(case, compared.equal))] for case in compared.cases]
    true, flat = np.concatenate(pairs, axis=1)
    return true, flat


def cylinder(case: Case, equal: bool = False) -> Case:
    """Return what a case was computed as: a cylinder, and what of the tip moves in X and Y."""
    process, tip, rpm = case
    true = process.cutter
    cutter = Cutter(true.teeth, true.diameter, float(np.mean(true.helices)))
    cutter = cutter if equal else replace(cutter, pitch=true.pitch)
    plain = replace(process, cutter=cutter, engagement=widest(process.engagement, Profile.flat(true.diameter), 1e-3))
    kept = np.any(tip.outputs[:2] != 0.0, axis=0)
    return plain, TipModes(tip.pole[kept], tip.outputs[:2, kept], tip.inputs[kept, :2], tip.constant[:2, :2]), rpm


def limits_of(process: MillingProcess, tip: TipModes, rpm: Sequence[float]) -> FloatArray:
    """Return the limits of a case at its speeds [m]."""
    return stability_lobes(tip, process, np.array(rpm) * mills.RPM, mills.deepest(process), METHOD).limit_depth


def _row(compared: Compared) -> dict[str, Any]:
    true, flat = limits(compared)
    worst = int(np.argmax(np.abs(np.log(flat / true))))
    over = f"{np.min(flat / true):.2f} to {np.max(flat / true):.2f} at {true.size} speeds, found before: {compared.found}"
    return row(compared.claim, 1e3 * true[worst], 1e3 * flat[worst], "mm", over)
