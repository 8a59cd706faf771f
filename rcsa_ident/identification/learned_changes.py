"""What may be learned of a machine beyond its modes: how it warms up, and by how much forces and joints differ from what was told."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from rcsa_ident.cutting.coefficients import ForceLaw
from rcsa_ident.dynamics.coordinates import Dof


@dataclass(frozen=True, slots=True)
class LearnedWarming:
    """How natural frequencies change from the coldest cut to the warmest one.

    `frequency`, `deviation` [-]: relative change of the mode that changes most, and its standard deviation
    `time_constant` [s], `exponent` [-]: of the heat of friction; None where a thermometer is followed
    `coldest`, `warmest` [°C]: that the thermometer showed; None without one
    `warmed_up`: whether the spindle had turned before the cuts: how warm it would become at last nobody has seen
    """

    frequency: float
    deviation: float
    time_constant: float | None = None
    exponent: float | None = None
    coldest: float | None = None
    warmest: float | None = None
    warmed_up: bool = False

    @property
    def state(self) -> str:
        """For which state of the machine the answer holds."""
        return "machine as warm as in its cuts" if self.warmed_up else "warm machine"

    @property
    def thermometer(self) -> tuple[float, float] | None:
        """Lowest and highest temperature [°C] that are known; None where no thermometer is followed."""
        return None if self.coldest is None or self.warmest is None else (self.coldest, self.warmest)

    @property
    def words(self) -> str:
        """In a sentence."""
        way = "fall" if self.frequency < 0.0 else "rise"
        moved = f"natural frequencies {way} by up to {abs(100.0 * self.frequency):.2g} % from cold to warm"
        if self.time_constant is not None:
            return f"{moved}, time constant {self.time_constant / 60.0:.2g} min"
        return f"{moved}, from {self.coldest:.3g} to {self.warmest:.3g} °C"


@dataclass(frozen=True, slots=True)
class LearnedFactor:
    """By how much something differs from what was told.

    `log` [-]: complex logarithm of the factor; `deviation` [-]: standard deviation of its real part
    """

    log: complex
    deviation: float

    @property
    def share(self) -> float:
        """Relative difference of its size [-]."""
        return float(np.expm1(self.log.real))

    @property
    def words(self) -> str:
        """In words, as ``6.1 % lower``."""
        return f"{abs(100.0 * self.share):.2g} % {'lower' if self.share < 0.0 else 'higher'}"


@dataclass(frozen=True, slots=True)
class LearnedChanges:
    """All of that; nothing by default.

    `orders`: mapping of (axis, kind of cut, order of the spindle) to factor on the simulated force
    `scales`: mapping of cut to factor on its force
    `joints`: mapping of tooling to factor on the joint's stiffness
    `amplitude`: factor on the joint's stiffness from the quietest to the loudest cut
    `law`: what stands behind `orders`; None where nobody asked
    """

    warming: LearnedWarming | None = None
    orders: Mapping[tuple[Dof, int, int], LearnedFactor] = field(default_factory=dict)
    scales: Mapping[str, LearnedFactor] = field(default_factory=dict)
    joints: Mapping[str, LearnedFactor] = field(default_factory=dict)
    amplitude: LearnedFactor | None = None
    law: ForceLaw | None = None

    def __bool__(self) -> bool:
        return self.warming is not None or self.amplitude is not None or bool(self.orders or self.scales or self.joints)

    @property
    def words(self) -> tuple[str, ...]:
        """In sentences, those of forces for the lowest order of each axis and kind of cut."""
        told = [] if self.warming is None else [self.warming.words]
        told += [self.law.words] if self.law is not None and self.law.words else []
        several = len({kind for _, kind, _ in self.orders}) > 1
        lowest: dict[tuple[Dof, int], int] = {}
        for axis, kind, order in self.orders:
            lowest[axis, kind] = min(order, lowest.get((axis, kind), order))
        for (axis, kind), order in lowest.items():
            of = f", cuts of kind {kind + 1}" if several else ""
            known = self.orders[axis, kind, order]
            told.append(f"force in {axis.upper()} at {order} times the spindle speed{of}: {known.words} than the model")
        if self.scales:
            told.append(self.scales_in_words)
        told += [f"joint stiffness of tooling {name}: {each.words} than the mean" for name, each in self.joints.items()]
        if self.amplitude is not None:
            told.append(self.amplitude_in_words)
        return tuple(told)

    @property
    def scales_in_words(self) -> str:
        """By how much forces differ from cut to cut."""
        return f"forces differ from cut to cut by {100.0 * float(np.std([each.log.real for each in self.scales.values()])):.2g} %"

    @property
    def amplitude_in_words(self) -> str:
        """By how much the joint gives way in the loudest cut."""
        assert self.amplitude is not None
        return f"joint stiffness in the loudest cut: {self.amplitude.words} than in the quietest"
