"""Stability limits over speed, with those of the machines that the records allow, and where the wall comes to lie."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from rcsa_ident.arrays import FloatArray, frozen
from rcsa_ident.cutting.process import MillingProcess
from rcsa_ident.dynamics.coordinates import Dof
from rcsa_ident.dynamics.receptance import Receptance
from rcsa_ident.errors import InputError
from rcsa_ident.stability.lobes import uncoupled_planes
from rcsa_ident.stability.result import StabilityLobes
from rcsa_ident.stability.surface_error import SurfaceError, surface_location_error
from rcsa_ident.stability.tested_cuts import Tally, TestedCuts, tally
from rcsa_ident.stability.tip_modes import TipModes
from rcsa_ident.stability.zero_order import ZeroOrder
from rcsa_ident.tool_holder.geometry import ToolAssembly
from rcsa_ident.workflows.lobes import LobeConditions, drawn_limits, tooling_lobes
from rcsa_ident.workflows.speeds import MachineOverSpeed, joined_lobes, responses_over_speed
from rcsa_ident.workflows.tip import STIFFNESS_SPREAD

#: How much deeper than asked for the zero-order method looks, for proportions.
_DEEPER = 5.0


@dataclass(frozen=True, slots=True, eq=False)
class Limits:
    """Stability limits over spindle speed, with those of the machines that the records allow.

    Parameters
    ----------
    lobes : StabilityLobes
        Speeds ascending.
    max_depth : float [m]
        That was asked for.
    drawn : array, shape (d, n) [m], or None
        Limits of machines drawn from the posterior.
    """

    lobes: StabilityLobes
    max_depth: float
    drawn: FloatArray | None = None

    def __post_init__(self) -> None:
        speed = self.lobes.spindle_speed
        if np.any(np.diff(speed) <= 0.0):
            raise InputError("speeds", speed.tolist(), "speeds that rise [rad/s]")
        if self.drawn is not None:
            object.__setattr__(self, "drawn", frozen(self.drawn))
            if self.drawn.ndim != 2 or self.drawn.shape[0] == 0 or self.drawn.shape[1] != speed.size:
                raise InputError("drawn", self.drawn.shape, f"shape (draws, {speed.size})")

    @property
    def nominal(self) -> FloatArray:
        """The limit of the machine as it was identified, up to the depth that was asked for, shape (n,) [m]."""
        return np.minimum(self.lobes.limit_depth, self.max_depth)

    @property
    def band(self) -> tuple[FloatArray, FloatArray] | None:
        """Depths between which 95 % of the drawn limits lie, shape (n,) each [m], infinite beyond what was asked for; None without them."""
        if self.drawn is None:
            return None
        limits = np.where(self.drawn > self.max_depth, np.inf, self.drawn)
        # an infinite limit has its rank like any other, but can't be interpolated
        low, high = np.quantile(limits, (0.025, 0.975), axis=0, method="nearest")
        return low, high

    def limit_quantile(self, probability: float) -> FloatArray:
        """Return the depth up to which at least this share of the drawn machines is stable, shape (n,) [m]; 1 is what all have in common.

        Without drawn machines it is the nominal limit.
        """
        if not 0.0 < probability <= 1.0:
            raise InputError("probability", probability, "above 0 and not above 1")
        if self.drawn is None:
            return self.nominal
        ranked = np.sort(np.minimum(self.drawn, self.max_depth), axis=0)
        return ranked[int((1.0 - probability) * ranked.shape[0] + 1e-9)]

    def probability(self, place: int, depth: float) -> float | None:
        """Return the share of the drawn machines that are stable at a speed's place and a depth, or None without them."""
        return None if self.drawn is None else float(np.mean(self.drawn[:, place] >= depth))


def least_within_tolerance(speed: FloatArray, limit: FloatArray, tolerance: float) -> FloatArray:
    """Return the smallest limit within a share of each speed on both sides, shape (n,).

    Parameters
    ----------
    speed : array, shape (n,)
        Rising; nothing is known beyond its ends.
    limit : array, shape (n,)
        Finite; straight lines in between.
    tolerance : float
        As 0.02 for 2 %.
    """
    if not 0.0 <= tolerance < 0.5:
        raise InputError("tolerance", tolerance, "a share from 0 to below 0.5")
    if tolerance == 0.0:
        return np.array(limit, dtype=float)
    low, high = speed * (1.0 - tolerance), speed * (1.0 + tolerance)
    least = np.minimum(np.interp(low, speed, limit), np.interp(high, speed, limit))
    first, last = np.searchsorted(speed, low), np.searchsorted(speed, high, side="right")
    return np.array([min(edge, limit[a:b].min()) for edge, a, b in zip(least.tolist(), first.tolist(), last.tolist(), strict=True)])


def pad_speeds(speeds: FloatArray, tolerance: float, also: Sequence[float] = ()) -> FloatArray:
    """Return the speeds with as many beyond both ends as a tolerance needs, and some of their own between them, rising."""
    speeds = np.unique(np.asarray(speeds, dtype=float))
    step = float(np.min(np.diff(speeds), initial=0.02 * speeds[0] if speeds.size < 2 else np.inf))
    inner = np.concatenate([speeds, np.asarray(also, dtype=float)])
    low, high = inner.min() * (1.0 - tolerance), inner.max() * (1.0 + tolerance)
    below = np.arange(speeds[0] - step, low - step, -step) if low < speeds[0] else np.zeros(0)
    above = np.arange(speeds[-1] + step, high + step, step) if high > speeds[-1] else np.zeros(0)
    found = np.unique(np.concatenate([inner, below[below > 0.0], above]))
    # the same speed twice, but for its last digit
    return found[np.concatenate([[True], np.diff(found) > 1e-9 * found[1:]])]


def tip_limits(tip: Receptance | TipModes, conditions: LobeConditions) -> Limits:
    """Return the limits of a tip that is known exactly; speeds in any order."""
    ordered = replace(conditions, speeds=np.unique(conditions.speeds))
    return Limits(ordered.lobes(tip), ordered.max_depth)


def machine_limits(
    machine: MachineOverSpeed,
    assembly: ToolAssembly,
    omega: FloatArray,
    conditions: LobeConditions,
    draws: int = 60,
    stiffness_spread: float = STIFFNESS_SPREAD,
    seed: int = 1,
) -> Limits:
    """Return the limits of a tooling on an identified machine, with those of machines drawn from its posterior.

    Parameters
    ----------
    draws : int
        0 leaves the posterior aside.

    Notes
    -----
    Drawn machines are asked by the zero-order method, in milliseconds each; of another method's limit they are in the proportion
    that they have to the zero-order limit of the identified machine at the same speed, which its warnings tell.
    """
    conditions = replace(conditions, speeds=np.unique(conditions.speeds))
    found: list[StabilityLobes] = []
    order: list[NDArray[np.intp]] = []
    drawn = np.full((draws, conditions.speeds.size), np.nan)
    told: tuple[str, ...] = ()
    for places, response in responses_over_speed(machine, assembly, omega, conditions.speeds, draws > 0, stiffness_spread):
        here = replace(conditions, speeds=conditions.speeds[places])
        order.append(places)
        found.append(tooling_lobes(response, here))
        quick = here if isinstance(here.method, ZeroOrder) else replace(here, method=ZeroOrder(), max_depth=_DEEPER * here.max_depth)
        limits = drawn_limits(response, quick, draws, seed) if draws > 0 else None
        if limits is not None and quick is not here:
            limits = _in_proportion(limits, tooling_lobes(response, quick).limit_depth, found[-1].limit_depth)
            told = ("what the records leave open is told in the proportion that it has by the zero-order method",)
        if limits is not None:
            drawn[:, places] = limits
    known = draws > 0 and not np.any(np.isnan(drawn))
    lobes = joined_lobes(found, order)
    lobes = replace(lobes, warnings=(*lobes.warnings, *told)) if known else lobes
    return Limits(lobes, conditions.max_depth, drawn if known else None)


def _in_proportion(drawn: FloatArray, nominal: FloatArray, wanted: FloatArray) -> FloatArray:
    """Limits that are to `wanted` as the drawn ones are to `nominal`; where one of these is infinite no proportion is known."""
    ratio = np.divide(wanted, nominal, out=np.ones(nominal.shape), where=np.isfinite(wanted) & np.isfinite(nominal))
    return np.where(np.isinf(nominal) & np.isfinite(wanted), wanted, drawn * ratio)


def classify_tested_cuts(cuts: TestedCuts, conditions: LobeConditions, limits: Callable[[LobeConditions], Limits]) -> Tally:
    """Return how many tested cuts lie on the side of the limit where they were seen, each asked at its own speed.

    Parameters
    ----------
    conditions : LobeConditions
        Its speeds do not count, and its depth only if it is deeper than all cuts.
    limits : function
        Of conditions with rising speeds.
    """
    deepest = 1.01 * float(cuts.axial_depth.max())
    own = replace(conditions, speeds=np.unique(cuts.spindle_speed), max_depth=max(conditions.max_depth, deepest))
    lobes = limits(own).lobes
    return tally(cuts, lobes.limit_depth[np.searchsorted(lobes.spindle_speed, cuts.spindle_speed)])


def machine_surface(
    machine: MachineOverSpeed, assembly: ToolAssembly, omega: FloatArray, process: MillingProcess, speeds: FloatArray, depth: float
) -> SurfaceError:
    """Return the surface location error of a tooling on an identified machine, each speed with the machine as it is there."""
    speeds = np.asarray(speeds, dtype=float)
    error, parts = np.zeros((speeds.size, 0)), list[SurfaceError]()
    for places, response in responses_over_speed(machine, assembly, omega, speeds, False, STIFFNESS_SPREAD):
        tip = uncoupled_planes(response.coupled.get(Dof.X), response.coupled.get(Dof.Y))
        part = surface_location_error(tip, process, speeds[places], depth)
        error = np.zeros((speeds.size, part.height.size)) if not parts else error
        error[places] = part.error
        parts.append(part)
    warnings = tuple(dict.fromkeys(warning for part in parts for warning in part.warnings))
    return SurfaceError(speeds, parts[0].height, error, parts[0].wall, warnings)
