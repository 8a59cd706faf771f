"""Passes whose speed changes, to make next: how fast, how long, how deep, and what they will be good for."""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from rcsa_ident.base.arrays import FloatArray, frozen
from rcsa_ident.base.errors import InputError, positive
from rcsa_ident.base.plausibility import LARGEST_SWEEP, LEAST_SWEEP
from rcsa_ident.base.units import from_rpm, to_rpm
from rcsa_ident.cutting.coefficients import CuttingCoefficients
from rcsa_ident.cutting.conditions import CuttingConditions
from rcsa_ident.dynamics.coordinates import Dof
from rcsa_ident.identification.machine import IdentifiedMachine
from rcsa_ident.setup.tooling import Tooling
from rcsa_ident.signals.measurement import MAX_FREQUENCY
from rcsa_ident.signals.sweep import WINDOW
from rcsa_ident.workflows.plan import CutConstraints, check, limits_at
from rcsa_ident.workflows.prospects import apart, together

#: Speeds at which a pass's stability is asked lie so far apart, as a share: a lobe is wider.
_STEP = 2e-3


@dataclass(frozen=True, slots=True)
class PlannedPass:
    """A pass to make.

    `conditions`: with the first speed
    `last_speed` [rad/s]; `seconds` [s]
    `limit_depth` [m]: up to which it is expected to be stable at every speed that it crosses; infinite beyond what was looked at
    `teeth`: of the cutter
    """

    tooling: str
    conditions: CuttingConditions
    last_speed: float
    seconds: float
    limit_depth: float
    teeth: int

    @property
    def path(self) -> float:
        """Length of the path at a constant feed per tooth [m]."""
        turns = 0.5 * (self.conditions.spindle_speed + self.last_speed) / (2.0 * np.pi) * self.seconds
        return self.conditions.feed_per_tooth * self.teeth * turns


@dataclass(frozen=True, slots=True, eq=False)
class PlannedPasses:
    """Passes to make, tooling by tooling, from the slowest up.

    `passes`: tuple of PlannedPass, length n
    `targets`: tuple of str, length t; the toolings whose tooltips are wanted
    `band` [-], shape (n + 1, t): expected relative standard deviation of each target's tooltip FRF, before and after each pass
    `warnings`: passes that were left out since no depth is stable
    """

    passes: tuple[PlannedPass, ...]
    targets: tuple[str, ...]
    band: FloatArray
    warnings: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        object.__setattr__(self, "band", frozen(self.band))


def plan_passes(
    machine: IdentifiedMachine,
    toolings: Sequence[Tooling],
    targets: Sequence[Tooling],
    allowed: CutConstraints,
    coefficients: CuttingCoefficients,
    noise: float,
    model_error: Mapping[Dof, float],
    band_hz: tuple[float, float],
    count: int,
    seconds: float = 4.0,
) -> PlannedPasses:
    """Return passes that cross all allowed speeds one after the other, each as deep as it is stable at every speed that it crosses.

    `machine`: with posteriors
    `toolings`, `targets`: to cut with; whose tooltip FRFs are wanted
    `noise`, `model_error`, `band_hz`: as in `plan_cuts`
    `count`: passes of each tooling
    `seconds` [s]: length of each
    Raises `InputError` if an axis has no posterior, the speeds of a pass lie too close or too far apart, or no pass is stable.
    """
    check(machine, toolings, targets, count, band_hz)
    positive("seconds of a pass", seconds, "s")
    rpm = to_rpm(np.linspace(allowed.lowest, allowed.highest, count + 1))
    # whole rev/min, inside what is allowed
    ends = from_rpm(np.clip(np.round(rpm), np.ceil(rpm[0] - 1e-6), np.floor(rpm[-1] + 1e-6)))
    # the first pass changes by most
    share = float(ends[1] / ends[0] - 1.0)
    if not min(share, float(ends[-1] / ends[-2] - 1.0)) >= LEAST_SWEEP or share > LARGEST_SWEEP:
        changes = f"{count} of {to_rpm(allowed.lowest):.0f} to {to_rpm(allowed.highest):.0f} rev/min"
        raise InputError("passes", changes, f"passes that change the speed by {100 * LEAST_SWEEP:g} to {100 * LARGEST_SWEEP:g} %")
    found: list[PlannedPass] = []
    warnings = []
    for tooling in toolings:
        for first, last in itertools.pairwise(ends.tolist()):
            speeds = np.geomspace(first, last, max(int(np.log(last / first) / _STEP), 2))
            limit = float(limits_at(machine, tooling, allowed, coefficients, allowed.feed_angle, speeds).min())
            stable = [depth for depth in allowed.depths if allowed.margin * depth <= limit]
            if not stable or first * tooling.cutter.teeth > 2.0 * np.pi * MAX_FREQUENCY:
                why = f"stable everywhere are {1e3 * limit / allowed.margin:.3g} mm" if not stable else "its lines lie above the band"
                between = f"{to_rpm(first):.0f} to {to_rpm(last):.0f} rev/min"
                warnings.append(f"no pass with {tooling.name} from {between}: {why}")
                continue
            conditions = CuttingConditions(
                first, max(stable), allowed.feed_of(tooling.cutter, max(stable)), allowed.engagement, allowed.feed_angle
            )
            found.append(PlannedPass(tooling.name, conditions, last, seconds, limit, tooling.cutter.teeth))
    if not found:
        raise InputError("passes", f"none stable ({warnings[0]})", "depths, speeds and toolings of which at least one is")
    made = [(each.tooling, cut) for each in found for cut in _windows(each)]
    asked = machine, made, toolings, targets, coefficients, noise, model_error, band_hz
    prospects = together(*asked) if machine.coupled_planes else apart(*asked)
    behind = np.concatenate([[0], np.cumsum([len(_windows(each)) for each in found])])
    band = np.array([prospects.deviation(prospects.covariance(list(range(last)))) for last in behind.tolist()])
    return PlannedPasses(tuple(found), tuple(target.name for target in targets), band, tuple(warnings))


def _windows(each: PlannedPass) -> list[CuttingConditions]:
    """Cuts of one speed that tell what a pass's windows do."""
    count = max(int(each.seconds / WINDOW), 1)
    places = (np.arange(count) + 0.5) / count
    first = each.conditions.spindle_speed
    return [replace(each.conditions, spindle_speed=first + place * (each.last_speed - first)) for place in places.tolist()]
