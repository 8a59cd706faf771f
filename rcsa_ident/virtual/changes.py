"""What changes on a virtual machine from cut to cut: bearings that warm up, a joint that gives way with amplitude and is clamped anew."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg import expm

from rcsa_ident.base.arrays import FloatArray
from rcsa_ident.base.errors import InputError, non_negative, positive
from rcsa_ident.base.units import from_rpm
from rcsa_ident.virtual.machine import CutPlan, VirtualSpindle

#: Speed at which a share of one is lost once all is warm [rad/s].
REFERENCE_SPEED = from_rpm(14_000.0)
#: Heat capacity of the housing over that of all bearings, and conductance to the air over that from bearings to housing.
_HOUSING_CAPACITY, _TO_THE_AIR = 6.0, 4.0
#: Of a shop, and so of the cold machine [°C].
AMBIENT = 22.0


@dataclass(frozen=True, slots=True)
class Warming:
    """Bearings that lose stiffness as they warm up: each heats itself and gives its heat to the housing, and that gives it to the air.

    `loss` [-]: share of the stiffness that the bearings lose from cold to warm at `REFERENCE_SPEED`; negative: gain
    `time_constant` [s]: of a bearing against its housing
    `exponent` [-]: of the speed in the heat of friction
    `running`, `pause` [s]: in which the spindle turns for each cut, its way in the air included, and stands after it
    `warm_up` [s]: for which it turns at the middle speed before each tooling's first cut
    `shuffled`: whether the speeds come in random order
    `rise` [K]: what a thermometer near the front bearings shows of a warmth of 1 over the ambient; None: the machine has none
    `reading` [K]: standard deviation of what it shows
    """

    loss: float
    time_constant: float = 900.0
    exponent: float = 1.25
    running: float = 60.0
    pause: float = 20.0
    warm_up: float = 0.0
    shuffled: bool = False
    rise: float | None = None
    reading: float = 0.2

    def __post_init__(self) -> None:
        if not -0.5 <= self.loss <= 0.5:
            raise InputError("warming.loss_percent", 100.0 * self.loss, "-50 to 50 [%]")
        positive("warming.time_constant_s", self.time_constant, "s")
        positive("warming.running_s", self.running, "s")
        non_negative("warming.pause_s", self.pause, "s")
        non_negative("warming.warm_up_s", self.warm_up, "s")
        if self.rise is not None:
            positive("warming.rise_c", self.rise, "K")
        non_negative("warming.reading_sd_c", self.reading, "K")


@dataclass(frozen=True, slots=True)
class JointChanges:
    """A flange joint that is not the same in every cut: k = k0 e^c (1 - softening A / (A + amplitude)) with c new in each clamping.

    `softening` [-]: share of the stiffness that large vibrations take
    `amplitude` [m]: relative motion A of the faces at which half of that is lost
    `reclamping` [-]: standard deviation of c
    """

    softening: float = 0.0
    amplitude: float = 1e-7
    reclamping: float = 0.0

    def __post_init__(self) -> None:
        if not 0.0 <= self.softening < 1.0:
            raise InputError("joint_changes.softening_percent", 100.0 * self.softening, "0 to below 100 [%]")
        positive("joint_changes.amplitude_um", self.amplitude, "m")
        non_negative("joint_changes.reclamping_percent", self.reclamping)

    def clamping(self, seed: int, tooling: int) -> float:
        """Return c of a tooling of a campaign."""
        return self.reclamping * float(np.random.default_rng([seed, 78, tooling]).normal())


@dataclass(frozen=True, slots=True)
class ChipLaw:
    """The force per width of cut, K h (h / thickness)^exponent: a curve where the campaign is told a straight line.

    `exponent` [-]
    `thickness` [m]: chip at which K is that of the workpiece's tangential coefficient
    """

    exponent: float
    thickness: float = 5e-5

    def __post_init__(self) -> None:
        if not -0.9 <= self.exponent <= 0.0:
            raise InputError("chip_law.exponent", self.exponent, "-0.9 to 0")
        positive("chip_law.thickness_mm", self.thickness, "m")


@dataclass(frozen=True, slots=True)
class Changes:
    """All that changes; nothing by default."""

    warming: Warming | None = None
    joint: JointChanges | None = None
    chip_law: ChipLaw | None = None

    @property
    def of_the_machine(self) -> bool:
        """Whether the machine itself is another one in every cut."""
        return self.warming is not None or self.joint is not None


@dataclass(frozen=True, slots=True)
class Turn:
    """One cut in the course of a campaign.

    `tooling`, `cut`: places in the campaign's toolings and in the plan's cuts
    `started` [s]: since the campaign began
    `warmth`: tuple of float [-], of each bearing: 1 where it is as warm as it becomes at `REFERENCE_SPEED`
    `temperature` [°C]: that a thermometer near the front bearings shows; None without one
    """

    tooling: int
    cut: int
    started: float
    warmth: tuple[float, ...]
    temperature: float | None = None


def course_of(plan: CutPlan, spindle: VirtualSpindle, changes: Changes, toolings: int, seed: int) -> list[Turn]:
    """Return a campaign's cuts in the order in which they are made, with the warmth of the bearings in each.

    `toolings`: how many
    `seed`: of the order of the speeds, where that is random, and of what the thermometer shows
    """
    warming, bearings = changes.warming, len(spindle.bearings)
    order = [np.arange(len(plan.cuts)) for _ in range(toolings)]
    if warming is None:
        return [Turn(t, int(k), 0.0, (0.0,) * bearings) for t, own in enumerate(order) for k in own]
    if warming.shuffled:
        rng = np.random.default_rng([seed, 77])
        order = [rng.permutation(each) for each in order]
    state, now, found, chance = np.zeros(bearings + 1), 0.0, list[Turn](), np.random.default_rng([seed, 79])
    middle = 0.5 * (min(plan.programmed) + max(plan.programmed))
    for t, own in enumerate(order):
        state, now = _after(state, warming, middle, warming.warm_up), now + warming.warm_up
        for k in own:
            _, first, last, _ = plan.cuts[k]
            # recorded in the middle of it
            speed = first if last is None else 0.5 * (first + last)
            state = _after(state, warming, speed, 0.5 * warming.running)
            warmth = tuple(state[:bearings].tolist())
            # the bearings are in the file from the flange on
            shown = None if warming.rise is None else AMBIENT + warming.rise * warmth[0] + warming.reading * float(chance.normal())
            found.append(Turn(t, int(k), now + 0.5 * warming.running, warmth, shown))
            state = _after(_after(state, warming, speed, 0.5 * warming.running), warming, 0.0, warming.pause)
            now += warming.running + warming.pause
    return found


def _after(state: FloatArray, warming: Warming, speed: float, time: float) -> FloatArray:
    """Temperatures of bearings and housing some time later; a bearing's heat and conductance are one, its capacity the time constant."""
    count = state.size - 1
    rate = np.zeros((count + 2, count + 2))
    rate[:count, :count] = -np.eye(count)
    rate[:count, count] = 1.0
    capacity = _HOUSING_CAPACITY * count
    rate[count, :count] = 1.0 / capacity
    rate[count, count] = -(1.0 + _TO_THE_AIR) * count / capacity
    # warm at the reference speed is 1 for every bearing
    heat = (speed / REFERENCE_SPEED) ** warming.exponent * _TO_THE_AIR / (1.0 + _TO_THE_AIR)
    rate[:count, count + 1] = heat
    found: FloatArray = (expm(rate * time / warming.time_constant) @ np.append(state, 1.0))[: count + 1]
    return found


def changed(spindle: VirtualSpindle, changes: Changes, turn: Turn, clamping: float, amplitude: float = 0.0) -> VirtualSpindle:
    """Return the spindle as it is in one cut.

    `clamping`: logarithm of the joint's stiffness over the drawn one, of this clamping
    `amplitude` [m]: relative motion of the joint's faces
    """
    bearings, joint = spindle.bearings, spindle.joint
    if changes.warming is not None:
        left = [1.0 - changes.warming.loss * warmth for warmth in turn.warmth]
        bearings = tuple(
            replace(each, stiffness=(each.stiffness[0] * share, each.stiffness[1] * share))
            for each, share in zip(bearings, left, strict=True)
        )
    if changes.joint is not None:
        own = changes.joint
        share = float(np.exp(clamping)) * (1.0 - own.softening * amplitude / (amplitude + own.amplitude))
        joint = replace(
            joint,
            translational_stiffness=joint.translational_stiffness * share,
            rotational_stiffness=joint.rotational_stiffness * share,
        )
    return replace(spindle, bearings=bearings, joint=joint)
