"""Files that others measured: a face mill's tap tests, and 118 cuts that were labelled stable or chatter.

They lie beside the project, not in it; without them there are no rows. The peers are the published figures.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.timing import once, row
from rcsa_ident.cutting.coefficients import CuttingCoefficients
from rcsa_ident.cutting.conditions import Engagement
from rcsa_ident.cutting.cutter import Cutter
from rcsa_ident.cutting.process import MillingProcess
from rcsa_ident.dynamics.coordinates import Coordinate, Dof
from rcsa_ident.dynamics.modal import normal_modes
from rcsa_ident.io.curves.frf_files import Source, read_tap_tests
from rcsa_ident.machine.known_tip import measured_tip
from rcsa_ident.stability.discretisation import FullDiscretisation
from rcsa_ident.stability.labels.tested_cuts import Tally, TestedCuts, Verdict, tally
from rcsa_ident.stability.lobes import stability_lobes
from rcsa_ident.stability.methods import StabilityMethod
from rcsa_ident.stability.multi_frequency import MultiFrequency
from rcsa_ident.stability.result import StabilityLobes
from rcsa_ident.stability.tip_modes import TipModes
from rcsa_ident.stability.zero_order import ZeroOrder

FILES = Path(__file__).resolve().parents[2] / "shared" / "data"
FACE_MILL = tuple(FILES / f"facemill_{axis}.frf" for axis in "xy")
CUTS = FILES / "labelled_cuts_118.csv"
DOWN = Engagement.from_immersion(0.5, "down")
METHODS: dict[str, StabilityMethod] = {
    "zero-order": ZeroOrder(),
    "multi-frequency": MultiFrequency(),
    "full-discretisation": FullDiscretisation(),
}


def run() -> list[dict[str, Any]]:
    """The rows of the files that are there."""
    rows = []
    if all(path.exists() for path in FACE_MILL):
        found = face_mill()
        assert found.absolute_limit is not None
        assert found.absolute_frequency is not None
        hertz = found.absolute_frequency / (2.0 * np.pi)
        rows.append(row("face mill, zero-order minimum", 1e3 * found.absolute_limit, 1.015, "mm", f"{hertz:.0f} Hz, published 1441 Hz"))
    if CUTS.exists():
        for name, method in METHODS.items():
            labelled(method)  # the first call compiles
            told: list[Tally] = []
            seconds = once(lambda method=method, told=told: told.append(labelled(method)))  # type: ignore[misc]
            (t,) = told
            cases = (
                f"{t.stable_stable} + {t.chatter_chatter} right, {t.stable_chatter} unexpected, {t.chatter_stable} stable above the limit"
            )
            rows.append(row(f"118 labelled cuts told right, {name}", 100.0 * t.share_right, 73.7, "%", f"{cases}; {seconds:.2f} s"))
    return rows


def face_mill() -> StabilityLobes:
    """Zero-order lobes of the face mill, half-immersion down-milling of steel."""
    curves = read_tap_tests([Source(path, (axis, axis)) for axis, path in zip("XY", FACE_MILL, strict=True)])
    tip = measured_tip({Dof(axis.lower()): curve for (axis, _), curve in curves.items()})
    process = MillingProcess(Cutter(2, 31.75e-3), CuttingCoefficients(1319.4e6, 788.8 / 1319.4), DOWN)
    return stability_lobes(tip, process, np.arange(2000.0, 20001.0, 50.0) * np.pi / 30.0, 0.02)


def labelled(method: StabilityMethod) -> Tally:
    """The 118 cuts beside the lobes of the dynamics that were believed before them: nothing is fitted to the cuts."""
    speed, depth, chatter = np.loadtxt(CUTS, delimiter=",", encoding="utf-8-sig").T
    cuts = TestedCuts(
        speed * 1e4 * np.pi / 30.0, depth * 1e-3, tuple(Verdict.CHATTER if c else Verdict.STABLE for c in chatter.astype(bool).tolist())
    )
    prior = {Dof.X: (782.7, 0.0184, 6.5616e6), Dof.Y: (752.8, 0.0186, 4.8852e6)}
    process = MillingProcess(Cutter(2, 12e-3), CuttingCoefficients(10.95e8, 1.76 / 10.95), DOWN)
    speeds = np.unique(cuts.spindle_speed)
    tip = TipModes.of({axis: _mode(axis, *mode) for axis, mode in prior.items()})
    found = stability_lobes(tip, process, speeds, 5e-3, method)
    return tally(cuts, found.limit_depth[np.searchsorted(speeds, cuts.spindle_speed)])


def _mode(axis: Dof, hertz: float, zeta: float, stiffness: float) -> Any:
    omega = 2.0 * np.pi * hertz
    return normal_modes(np.array([omega]), np.array([zeta]), np.array([[omega / np.sqrt(stiffness)]]), (Coordinate("tip", axis),))
