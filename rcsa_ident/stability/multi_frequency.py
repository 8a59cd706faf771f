"""Multi-frequency stability limit: the directional coefficients with all their harmonics, from receptances alone."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import ClassVar, Literal

import numpy as np

from rcsa_ident.base.arrays import FloatArray
from rcsa_ident.base.errors import InputError
from rcsa_ident.cutting.process import MillingProcess
from rcsa_ident.dynamics.receptance import Receptance
from rcsa_ident.stability.depth_march import finer, ladder, march
from rcsa_ident.stability.hill import Hill, PeriodicTeeth, TipMotion
from rcsa_ident.stability.methods import MethodName, Watch, coarse_to_fine
from rcsa_ident.stability.regeneration import check_constant
from rcsa_ident.stability.result import StabilityLobes
from rcsa_ident.stability.tip_modes import TIP, TipModes, receptance_of

#: Share of the peak that the receptance may still have at the top of its band: 15 % there changed limits by 0.1 %, 57 % by 6 %.
_LEFT = 0.2
#: Of a speed, as counted on identified machines: frequencies that matrices are asked at, and rows for each harmonic below the receptance's
#: end (two directions, both signs, but for those that are silent).
_MATRICES, _ROWS = 100.0, 3.2
#: Depth of a plain cut whose helix does not show [m].
_THIN = 1e-9


@dataclass(frozen=True, slots=True)
class MultiFrequency:
    """Truncated Hill determinant of the periodic delay equation [merdol2004].

    With [alpha(t)] = sum_r [alpha_r] e^{i r w_T t}, w_T the tooth-passing frequency, a force with the harmonics
    F_k e^{i (w + k w_T) t} repeats itself for

        F_k = a K_tc (1 - e^{-i w T}) sum_l [alpha_{k-l}] G(w + l w_T) F_l,

    beside it what process damping makes of the velocity i (w + l w_T) G F_l.

    At each w the eigenvalues of the right-hand side without a are followed; a is the inverse of one that is real and
    positive. One tooth-passing interval holds all w that differ, and conjugate symmetry leaves half of it; at its end,
    w = w_T / 2, lie the flips. The helix spreads a tooth's cut over the angle, [alpha_r] falls with the depth, and each
    crossing is refined at its own depth. The absolute limit is not known without all speeds: NaN.

    Parameters
    ----------
    harmonics : int or None, default None
        Harmonics of [alpha(t)] that are kept. None keeps all, with every harmonic of the force inside the receptance's
        band: exact, but for what lies beyond the band. 0 is the zero-order limit.
    watch : callable or None
        Told of each speed once its limit is known.

    Examples
    --------
    >>> import rcsa_ident as ri
    >>> mode = ri.normal_modes([ri.hz(900.0)], [0.02], [[5.0]], (ri.Coordinate("tip", ri.Dof.Y),))
    >>> cut = ri.MillingProcess(ri.Cutter(2, 0.012), ri.CuttingCoefficients(7e8, 0.3), ri.Engagement.from_immersion(0.5, "down"))
    >>> tip = ri.TipModes.of({ri.Dof.Y: mode})
    >>> lobes = ri.stability_lobes(tip, cut, ri.rpm(8000, 16_000, 2000), 10e-3, ri.MultiFrequency())
    >>> (1e3 * lobes.limit_depth).round(2).tolist()
    [0.62, 0.33, 1.25, 0.82, 0.33]
    """

    name: ClassVar[str] = MethodName.MULTI_FREQUENCY.value
    needs: ClassVar[Literal["receptance", "modes"]] = "receptance"
    seconds_per_operation: ClassVar[float] = 5e-9
    gives_maps: ClassVar[bool] = False

    harmonics: int | None = None
    watch: Watch | None = field(default=None, repr=False, compare=False)

    def __post_init__(self) -> None:
        if self.harmonics is not None and not 0 <= self.harmonics <= 200:
            raise InputError("harmonics", self.harmonics, "None, or a whole number from 0 to 200")

    def operations(self, process: MillingProcess, speeds: FloatArray, top: float, max_depth: float) -> FloatArray:
        """Return the matrices of each speed times the cubes of their sizes: what their eigenvalues cost."""
        passing = process.cutter.symmetry * speeds
        reach = top / passing if self.harmonics is None else np.full(speeds.size, float(self.harmonics))
        return _MATRICES * (4.0 + _ROWS * reach) ** 3

    def lobes(self, tip: Receptance | TipModes, process: MillingProcess, speeds: FloatArray, max_depth: float) -> StabilityLobes:
        """Return the limit at each speed by itself."""
        cutter = process.cutter
        check_constant(process)
        receptance = receptance_of(tip, wide=True)
        if process.is_plain:
            receptance = receptance.block(TIP)
        motion = TipMotion.of(receptance)
        teeth = PeriodicTeeth(process, self.harmonics, motion.directions)
        guesses = _guesses(receptance, process, speeds, max_depth)
        limit = np.full(speeds.size, np.inf)
        chatter = np.full(speeds.size, np.nan)
        lobe = np.full(speeds.size, -1, dtype=np.intp)
        lost = 0
        for i in coarse_to_fine(speeds.size):
            speed = float(speeds[i])
            found = Hill(motion, teeth, speed, float(guesses[i])).limit(process.within_reach(max_depth))
            if found is not None:
                limit[i] = found.depth
                chatter[i] = np.nan if found.chatter is None else found.chatter
                lobe[i] = -1 if found.chatter is None else int(found.chatter / (cutter.teeth * speed))
                lost += found.chatter is None
            if self.watch is not None:
                self.watch(speed, float(limit[i]), float(chatter[i]))
        doubts = _doubts(motion, chatter)
        if lost:
            doubts.append(f"at {lost} of {speeds.size} speeds the limit is not converged: it may be percents off")
        # a flip vibrates at an odd multiple of half the frequency with which the cut repeats itself, and nothing else quite does
        flip = np.abs(chatter / (teeth.base * speeds) % 1.0 - 0.5) < 1e-9
        return StabilityLobes(speeds, limit, chatter, lobe, max_depth, self.name, warnings=tuple(doubts), flip=flip)


def _guesses(receptance: Receptance, process: MillingProcess, speeds: FloatArray, max_depth: float) -> FloatArray:
    """Depths near which the limits are looked for at first: where the stiffness changes with the depth, those of the zero order."""
    if process.is_plain:
        return np.full(speeds.size, _THIN)
    steps = ladder(process, receptance.values.shape[1], max_depth)
    found = march(*finer(receptance), process, steps, speeds).limit
    return np.where(np.isfinite(found), found, process.within_reach(max_depth))


def _doubts(tip: TipMotion, chatter: FloatArray) -> list[str]:
    doubts = []
    left = float(np.max(np.abs(tip.values[-1]))) / tip.size
    if left > _LEFT:
        top = tip.omega[-1] / (2.0 * np.pi)
        doubts.append(f"the receptance ends at {top:.0f} Hz with {100.0 * left:.0f} % of its largest value: harmonics beyond are left out")
    near = np.unique(np.searchsorted(tip.omega, chatter[np.isfinite(chatter)]).clip(1, tip.omega.size - 1))
    step = np.max(np.abs(tip.values[near] - tip.values[near - 1]), axis=1) / np.max(np.abs(tip.values[near]), axis=1)
    if np.any(step > 0.35):
        k = near[int(np.argmax(step))]
        spacing = (tip.omega[k] - tip.omega[k - 1]) / (2.0 * np.pi)
        doubts.append(f"the receptance is coarse at a critical mode ({spacing:.3g} Hz between lines): the limit may be percents off")
    return doubts
