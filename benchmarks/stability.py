"""Maps and limits by methods that march through time, beside a textbook semi-discretisation in vectorised NumPy.

No public Python package computes milling stability; the peer is the dense form that all public codes share: the transition matrix of a
period is multiplied out and all of its eigenvalues are computed, for all depths at once. Both sides have the limit within 1 % of the
converged one; the peer's intervals are chosen for that, speed by speed.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import scipy.linalg

from benchmarks.timing import Race, best_of, once, row
from rcsa_ident.cutting.coefficients import CuttingCoefficients
from rcsa_ident.cutting.conditions import Engagement
from rcsa_ident.cutting.cutter import Cutter
from rcsa_ident.cutting.deflection import ToolDeflection, deflected_edge, deflected_process
from rcsa_ident.cutting.process import MillingProcess, ProcessDamping
from rcsa_ident.dynamics.coordinates import Coordinate, Dof
from rcsa_ident.dynamics.modal import normal_modes
from rcsa_ident.stability.discretisation import FullDiscretisation
from rcsa_ident.stability.lobes import stability_lobes
from rcsa_ident.stability.stability_map import stability_map
from rcsa_ident.stability.tip_modes import TipModes

RPM = np.pi / 30.0
#: The two-tooth mill of [insperger2004].
FREQUENCY, DAMPING, MASS = 922.0, 0.011, 0.03993
KT, KN = 6e8, 2e8
SPEEDS, DEPTHS = np.linspace(5000.0, 25000.0, 200), np.linspace(5e-5, 5e-3, 100)
#: Intervals per natural period with which the limits of the peer are within 1 % at 95 % of the speeds, and the fewest that it takes.
PEER_INTERVALS, PEER_FEWEST = 30.0, 60


def modes(axis: Dof, frequency: Any, damping: Any, mass: Any) -> Any:
    """Return normal modes of the tip in one direction."""
    shape = 1.0 / np.sqrt(np.atleast_1d(mass))[:, None]
    return normal_modes(2.0 * np.pi * np.atleast_1d(frequency), np.atleast_1d(damping), shape, (Coordinate("tip", axis),))


def run() -> list[dict[str, Any]]:
    """Map of the 1-dof mill, map of a mill with twenty modes, the deflected tool of the published robot cut."""
    one = TipModes.of({Dof.X: modes(Dof.X, FREQUENCY, DAMPING, MASS)})
    slot = MillingProcess(Cutter(2, 0.012), CuttingCoefficients(KT, KN / KT), Engagement(0.0, np.pi))
    reference = stability_lobes(one, slot, SPEEDS * RPM, DEPTHS[-1], FullDiscretisation(tolerance=1e-4)).limit_depth
    found: dict[str, Any] = {}

    def traced() -> Any:
        found["traced"] = stability_map(one, slot, SPEEDS * RPM, DEPTHS)
        return found["traced"]

    def full() -> Any:
        found["full"] = stability_map(one, slot, SPEEDS * RPM, DEPTHS, full=True)
        return found["full"]

    def lobes() -> Any:
        found["lobes"] = stability_lobes(one, slot, SPEEDS * RPM, DEPTHS[-1], FullDiscretisation(tolerance=1e-2))
        return found["lobes"]

    def peer() -> Any:
        found["peer"] = np.array([_textbook(speed * RPM, DEPTHS) for speed in SPEEDS])
        return found["peer"]

    seconds = {name: best_of(each, 3) for name, each in (("traced", traced), ("full", full), ("lobes", lobes))}
    seconds["peer"] = once(peer)
    wrong = int(np.sum(found["traced"].stable != found["full"].stable))
    error = {name: _error(found[name].limit_depth, reference) for name in ("traced", "full", "lobes")}
    error["peer"] = _error(_crossings(found["peer"], DEPTHS), reference)
    counted = f"{found['traced'].evaluations} multipliers, {wrong} points differ from the full grid"
    accuracy = "limit within {:.2f} %, peer {:.2f} %; "
    rows = [
        row(
            "1-dof slot, 200 x 100 map, boundary followed",
            seconds["traced"],
            seconds["peer"],
            "s",
            accuracy.format(error["traced"], error["peer"]) + counted,
        ),
        row("1-dof slot, 200 x 100 map, every point", seconds["full"], seconds["peer"], "s", accuracy.format(error["full"], error["peer"])),
        row("1-dof slot, limit at 200 speeds", seconds["lobes"], seconds["peer"], "s", accuracy.format(error["lobes"], error["peer"])),
    ]
    return [*rows, _many_modes(), *_robot_cut()]


def races() -> list[Race]:
    """Limits of the one-mode slot at nine speeds; both sides within 1 % of the converged ones."""
    one = TipModes.of({Dof.X: modes(Dof.X, FREQUENCY, DAMPING, MASS)})
    slot = MillingProcess(Cutter(2, 0.012), CuttingCoefficients(KT, KN / KT), Engagement(0.0, np.pi))
    speeds = np.linspace(9000.0, 21000.0, 9)
    reference = stability_lobes(one, slot, speeds * RPM, DEPTHS[-1], FullDiscretisation(tolerance=1e-4)).limit_depth

    def ours() -> np.ndarray:
        return stability_lobes(one, slot, speeds * RPM, DEPTHS[-1], FullDiscretisation(tolerance=1e-2)).limit_depth

    def theirs() -> np.ndarray:
        return _crossings(np.array([_textbook(speed * RPM, DEPTHS) for speed in speeds]), DEPTHS)

    told = f"limits within {_error(ours(), reference):.2f} %, peer {_error(theirs(), reference):.2f} %"
    claim, peer = "limits of a one-mode slot at nine speeds", "NumPy, semi-discretisation of the textbook at 100 depths"
    return [Race(claim, peer, "numpy", ours, theirs, told, (1, 1), "ms", 1e3)]


def _many_modes() -> dict[str, Any]:
    rng = np.random.default_rng(3)

    def ten(axis: Dof) -> Any:
        return modes(axis, np.sort(rng.uniform(400.0, 4000.0, 10)), rng.uniform(0.01, 0.05, 10), 10.0 ** rng.uniform(-1.3, 0.5, 10))

    tip = TipModes.of({Dof.X: ten(Dof.X), Dof.Y: ten(Dof.Y)})
    cutter = Cutter(4, 0.012, np.radians(30.0))
    process = MillingProcess(
        cutter, CuttingCoefficients(9e8, 0.26), Engagement.from_immersion(0.5, "down"), damping=ProcessDamping(1.5e14, 40e-6)
    )
    found: dict[str, Any] = {}

    def trace() -> Any:
        found["map"] = stability_map(tip, process, np.linspace(4000.0, 20000.0, 200) * RPM, DEPTHS)
        return found["map"]

    stability_map(tip, process, np.array([400.0]), DEPTHS[:2])
    seconds = once(trace)
    accuracy = f"{found['map'].evaluations} multipliers, crossings within {100.0 * found['map'].error:.2f} %"
    return row("2-dof, 10 modes a direction, helix, process damping, 200 x 100 map", seconds, None, "s", accuracy)


def _robot_cut() -> list[dict[str, Any]]:
    """Limits of the robot cut of [du2023] with a tool of 10 mm, beside reference figures of the same model."""
    tip = TipModes.of({Dof.X: modes(Dof.X, 2060.49, 0.0237, 3.232**-2), Dof.Y: modes(Dof.Y, 2045.24, 0.0207, 4.119**-2)})
    cutter, engagement = Cutter(3, 0.010, np.radians(45.0)), Engagement.from_immersion(0.4, "down")
    coefficients = CuttingCoefficients(855e6, 270.93 / 855.0, tangential_edge=15.64e3, radial_edge=14.167e3)
    plain = MillingProcess(cutter, coefficients, engagement)
    rubbing = MillingProcess(cutter, coefficients, engagement, damping=ProcessDamping(1.5e14, 40e-6, 0.3))
    bent = ToolDeflection(0.061, 600e9 * np.pi / 64.0 * 0.01**4, 0.26e-6, feed_rate=0.01)
    speeds = np.array([3600.0, 4100.0, 7200.0, 8000.0, 8200.0, 10000.0]) * RPM
    columns = {
        "none": (plain, None, [1.28, 2.73, 1.26, 3.39, 5.02, 4.38]),
        "deflection": (plain, bent, [1.28, 2.74, 1.26, 3.42, 5.05, 4.41]),
        "process damping": (rubbing, None, [2.54, 5.19, 1.67, 4.49, 6.26, 5.41]),
        "both": (rubbing, bent, [2.56, 5.25, 1.67, 4.53, 6.34, 5.46]),
    }
    rows, at_8200 = [], {}
    for name, (process, deflection, reference) in columns.items():
        cut = process if deflection is None else deflected_process(process, deflection)
        limit = 1e3 * stability_lobes(tip, cut, speeds, 0.02, FullDiscretisation()).limit_depth
        at_8200[name] = float(limit[4])
        worst = 100.0 * float(np.max(np.abs(limit / np.array(reference) - 1.0)))
        shown = ", ".join(f"{value:.3f}" for value in limit)
        rows.append(
            row(f"robot cut, {name}: limit at 8200 rev/min", at_8200[name], reference[4], "mm", f"worst of six {worst:.2f} % ({shown})")
        )
    gain = 100.0 * (at_8200["both"] / at_8200["none"] - 1.0)
    rows.append(row("robot cut: deflection and damping at 8200 rev/min", gain, 26.3, "%", "published +25 %"))
    edge = deflected_edge(plain, bent, 10000.0 * RPM, 8e-3)
    shallow = deflected_edge(plain, bent, 10000.0 * RPM, 6.85e-3)
    plateau = f"same at 6.85 and 8 mm to {abs(edge.deflection[0] - shallow.deflection[0]) * 1e9:.2g} nm"
    rows.append(row("robot cut: deflection of the tip at 10 000 rev/min", 1e3 * float(edge.deflection[0]), 0.0944, "mm", plateau))
    shift = float(np.degrees(edge.start[0] - engagement.entry))
    rows.append(row("robot cut: later entry of the tip at 10 000 rev/min", shift, 1.106, "deg", "published above 1 deg"))
    return rows


def _error(limit: np.ndarray, reference: np.ndarray) -> float:
    """The error that 95 % of the speeds stay below [%]: beside the others two lobes meet, and a hair's breadth of speed decides."""
    both = np.isfinite(limit) & np.isfinite(reference)
    return 100.0 * float(np.quantile(np.abs(limit[both] / reference[both] - 1.0), 0.95))


def _crossings(radius: np.ndarray, depths: np.ndarray) -> np.ndarray:
    """First depth at which the spectral radius passes 1, on straight lines between the depths."""
    limit = np.full(radius.shape[0], np.inf)
    for i, line in enumerate(radius):
        above = np.flatnonzero(line > 1.0)
        if above.size and above[0] > 0:
            k = above[0]
            limit[i] = depths[k - 1] + (depths[k] - depths[k - 1]) * (1.0 - line[k - 1]) / (line[k] - line[k - 1])
    return limit


def _textbook(speed: float, depths: np.ndarray) -> np.ndarray:
    """Spectral radius of the 1-dof slot by first-order semi-discretisation with dense matrices, all depths at once."""
    period = np.pi / speed
    count = max(PEER_FEWEST, int(np.ceil(PEER_INTERVALS * FREQUENCY * period)))
    h, size = period / count, count + 2
    omega = 2.0 * np.pi * FREQUENCY
    part = (np.arange(count)[:, None] + np.linspace(0.0, 1.0, 11)) * np.pi / count
    cut = np.trapezoid((KT * np.cos(part) + KN * np.sin(part)) * np.sin(part), dx=0.1, axis=1)
    # rows that say how the state now, and what the tool did, follow from the state and the past a period ago
    state = np.zeros((depths.size, 2, size))
    state[:, 0, 0] = state[:, 1, 1] = 1.0
    past = np.zeros((2 * count + 1, depths.size, size))
    past[count] = state[:, 0]
    for i in range(count):
        past[i, :, size - 1 - i] = 1.0
    block = np.zeros((depths.size, 4, 4))
    block[:, 0, 1] = 1.0
    block[:, 1, 1] = -2.0 * DAMPING * omega
    block[:, 2, 3] = 1.0 / h
    for i in range(count):
        force = depths * cut[i] / MASS
        block[:, 1, 0] = -(omega**2) - force
        block[:, 1, 2] = force
        step = scipy.linalg.expm(block * h)
        begin, end = past[i], past[i + 1]
        state = step[:, :2, :2] @ state + step[:, :2, 2:3] * begin[:, None, :] + step[:, :2, 3:4] * (end - begin)[:, None, :]
        past[count + i + 1] = state[:, 0]
    # the new vector: state, then the tool at the nodes of this period from the newest to the oldest
    matrix = np.zeros((depths.size, size, size))
    matrix[:, :2] = state
    for i in range(count):
        matrix[:, size - 1 - i] = past[count + i]
    return np.max(np.abs(np.linalg.eigvals(matrix)), axis=1)
