"""Zero-order lobes and the way from a tooling file to them."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.timing import Race, best_of, row
from rcsa_ident.coupling.joint import LumpedJoint
from rcsa_ident.cutting.coefficients import CuttingCoefficients
from rcsa_ident.cutting.conditions import Engagement
from rcsa_ident.cutting.directional import mean_directional_matrix
from rcsa_ident.cutting.process import MillingProcess
from rcsa_ident.dynamics.coordinates import Dof, plane
from rcsa_ident.dynamics.modal import normal_modes
from rcsa_ident.dynamics.receptance import Receptance
from rcsa_ident.io.settings.setups import read_tooling
from rcsa_ident.machine.flange_machine import FlangeMachine
from rcsa_ident.stability.lobes import stability_lobes
from rcsa_ident.tool_holder.model import tool_holder_poles

TOOLING = Path(__file__).resolve().parent.parent / "data" / "machines" / "toolings" / "S3-PG25-long.toml"


COEFFICIENTS, ENGAGEMENT = CuttingCoefficients(902e6, 0.26), Engagement.from_immersion(0.5, "down")
#: Frequencies [rad/s] and speeds.
OMEGA, SPEEDS = 2.0 * np.pi * np.linspace(300.0, 4300.0, 4000), np.arange(4000.0, 20001.0, 50.0) * np.pi / 30.0


def run() -> list[dict[str, Any]]:
    """4000 frequencies, 321 speeds."""
    machine = lobes_machine()

    def chain() -> np.ndarray:
        # a tooling that was never asked before: its poles are kept otherwise
        tool_holder_poles.cache_clear()
        fresh = read_tooling(TOOLING)
        process = MillingProcess(fresh.cutter, COEFFICIENTS, ENGAGEMENT)
        return stability_lobes(machine.tip(fresh, OMEGA), process, SPEEDS, 1.0).limit_depth

    rows = [race.row() for race in races()]
    return [*rows, row("tooling file -> tooltip FRF (4000 frequencies) -> zero-order lobes", best_of(chain) * 1e3, None, "ms", "no peer")]


def races() -> list[Race]:
    """The closed form, beside itself in vectorised NumPy."""
    tooling = read_tooling(TOOLING)
    tip, teeth = lobes_machine().tip(tooling, OMEGA), tooling.cutter.teeth

    def ours() -> np.ndarray:
        return stability_lobes(tip, MillingProcess(tooling.cutter, COEFFICIENTS, ENGAGEMENT), SPEEDS, 1.0).limit_depth

    alpha = mean_directional_matrix(teeth, ENGAGEMENT, COEFFICIENTS)

    def vectorised() -> np.ndarray:
        return _textbook(tip, alpha, COEFFICIENTS.tangential, teeth, SPEEDS)

    finite = np.isfinite(vectorised()) & np.isfinite(ours())
    told = f"median difference {np.median(np.abs(ours()[finite] / vectorised()[finite] - 1.0)):.1e}"
    claim = "zero-order lobes, 4000 frequencies x 321 speeds"
    return [Race(claim, "NumPy, vectorised", "numpy", ours, vectorised, told, (1, 1), "ms", 1e3)]


def lobes_machine() -> FlangeMachine:
    """Five modes each way."""
    omega_n = 2.0 * np.pi * np.array([180.0, 998.0, 1820.0, 2330.0, 3970.0])
    psi = np.array([[0.08, 0.4], [0.15, 1.5], [0.25, 3.0], [0.2, 4.0], [0.15, 8.0]])
    flanges = tuple(normal_modes(omega_n, np.full(5, 0.05), psi, plane("flange", axis)) for axis in (Dof.X, Dof.Y))
    return FlangeMachine(flanges, (2.0 * np.pi * 300.0, 2.0 * np.pi * 4300.0), LumpedJoint(3e9, 6e6, 2e3, 10.0))


def _textbook(tip: Receptance, alpha: np.ndarray, stiffness: float, teeth: int, speeds: np.ndarray) -> np.ndarray:
    """The closed form point by point: a speed's limit is the least depth of any lobe point in its bin."""
    eigenvalues = np.linalg.eigvals(alpha @ tip.values)
    limit = np.full(speeds.size, np.inf)
    step = speeds[1] - speeds[0]
    for value in eigenvalues.T:
        good = value.real > 0.0
        depth = 1.0 / (2.0 * stiffness * value.real[good])
        phase = np.pi + 2.0 * np.angle(value[good])
        for lobe in range(200):
            speed = 2.0 * np.pi * tip.omega[good] / (teeth * (phase + 2.0 * np.pi * lobe))
            place = np.round((speed - speeds[0]) / step).astype(int)
            inside = (place >= 0) & (place < speeds.size)
            if lobe > 5 and not inside.any():
                break
            np.minimum.at(limit, place[inside], depth[inside])
    return limit
