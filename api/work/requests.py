"""What a query asks, in SI: plain nouns that cross processes and outlive them in a job."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, TypeVar

import numpy as np

from rcsa_ident.base.errors import InputError
from rcsa_ident.machine.machine import TipSource
from rcsa_ident.setup.cut import CutSpec
from rcsa_ident.setup.tooling import Tooling
from rcsa_ident.stability.labels.tested_cuts import TestedCuts, Verdict
from rcsa_ident.stability.lobes import DRAWS, method_named
from rcsa_ident.stability.zero_order import ZeroOrder
from rcsa_ident.workflows.tool_change import ToolChange

_T = TypeVar("_T")
_R = TypeVar("_R")


def anonymous(read: Callable[[_T], _R], each: _T) -> _R:
    """Return what is read of a cut or a hammer test; errors do not tell where the service keeps its files."""
    try:
        return read(each)
    except InputError as error:
        raise InputError(error.field, error.found, error.allowed) from None


class TooLong(InputError):
    """Work that is too much for one answer. `seconds` [s]: that it takes, estimated."""

    def __init__(self, field: str, found: object, allowed: str, where: str = "", seconds: float = 0.0) -> None:
        super().__init__(field, found, allowed, where)
        self.seconds = seconds

    def __reduce__(self) -> tuple[type[TooLong], tuple[object, ...]]:
        return type(self), (self.field, self.found, self.allowed, self.where, self.seconds)


@dataclass(frozen=True, slots=True)
class MachineText:
    """What is known of a machine: RESULT.json, FLANGE.csv, or in its place a robot at a posture or a tapped tip.

    By the digest a worker knows it.
    """

    digest: str
    text: str


@dataclass(frozen=True, slots=True)
class ToolingSource:
    """A tooling as a file's text or as the keys of one, and what the answer calls it."""

    name: str
    text: str = ""
    keys: Mapping[str, Any] | None = None


@dataclass(frozen=True, slots=True)
class TipRequest:
    """Tooltip FRF.

    `low` [Hz]: None is 100 Hz, or where a measured flange begins
    `step` [Hz]
    `high` [Hz]: None is the end of the identified band
    `speed` [rad/s]
    `stiffness_spread`: as a share
    `work_seconds` [s]: longer work is refused
    `temperature` [°C]: near the bearings
    """

    low: float | None
    high: float | None
    step: float
    speed: float | None
    bands: bool
    stiffness_spread: float
    work_seconds: float
    temperature: float | None = None


@dataclass(frozen=True, slots=True)
class LobeRequest:
    """Stability limits.

    `speeds`: tuple of float [rad/s], rising
    `max_depth` [m]
    `method`: one of `stability.lobes.METHODS`
    `work_seconds` [s]: longer work is refused
    `tested`: tuple of (speed [rad/s], depth [m], "stable", "chatter" or "marginal"); cuts that were tried
    `recommend`: whether cuts are recommended, too: zero-order limits alone are there at once
    `temperature` [°C]: near the bearings
    """

    cut: CutSpec
    speeds: tuple[float, ...]
    max_depth: float
    method: str
    bands: bool
    stiffness_spread: float
    work_seconds: float
    recommend: bool = True
    tested: tuple[tuple[float, float, str], ...] = ()
    temperature: float | None = None

    @property
    def preview(self) -> bool:
        """Whether it is answered at once."""
        return self.method == ZeroOrder.name and not self.recommend

    def change(self, machine: TipSource, tooling: Tooling) -> ToolChange:
        """Return the question for a machine and a tooling."""
        draws = DRAWS if self.bands else 0
        method = method_named(self.method)
        speeds, spread = np.array(self.speeds), self.stiffness_spread
        here = machine.at_temperature(self.temperature)
        return ToolChange(here, tooling, self.cut, speeds, self.max_depth, method, draws, spread, self.recommend)

    @property
    def tested_cuts(self) -> TestedCuts | None:
        """The cuts that were tried, if there are some."""
        if not self.tested:
            return None
        speed, depth, verdict = zip(*self.tested, strict=True)
        return TestedCuts(np.array(speed), np.array(depth), tuple(Verdict(each) for each in verdict))


@dataclass(frozen=True, slots=True)
class AdviceRequest:
    """What a machinist asks of lobes.

    `max_power` [W]; `max_torque` [N m]; `max_speed` [rad/s]
    `tolerance`, `probability`, `reserve`: shares
    `depth` [m]: at which speeds may one cut so deep?
    `planned`: tuple of (speed [rad/s], depth [m])
    """

    lobes: LobeRequest
    max_power: float | None = None
    max_torque: float | None = None
    max_speed: float | None = None
    tolerance: float = 0.01
    probability: float = 0.95
    reserve: float = 0.1
    depth: float | None = None
    planned: tuple[tuple[float, float], ...] = ()
