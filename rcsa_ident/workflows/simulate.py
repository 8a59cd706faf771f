"""Cuts on the virtual machine, and what is true of it."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np

from rcsa_ident.arrays import FloatArray
from rcsa_ident.cutting.conditions import CuttingConditions
from rcsa_ident.cutting.cutter import Cutter
from rcsa_ident.machining_setup import Tooling, Workpiece
from rcsa_ident.scaleout import Map
from rcsa_ident.virtual.campaign import SimulatedCut, SimulatedRecord, TrueFlange, TrueReceptances
from rcsa_ident.virtual.machine import CutPlan, VirtualSpindle
from rcsa_ident.virtual.milling import CutHistory, mill_cut, synchronous_lines
from rcsa_ident.virtual.reduction import Poles, poles, reduced
from rcsa_ident.virtual.rotor import frequency_response, rotor
from rcsa_ident.virtual.sensors import Clamping, SensorSuite, clamp, padding, record

#: Instants of the time march per sample of the records.
OVERSAMPLING = 8
#: Frequencies of the true receptances [Hz]: first, last, step.
TRUTH_FREQUENCIES = (5.0, 4500.0, 5.0)


class VirtualSetup(Protocol):
    """A virtual machine with its sensors, what it cuts, and how."""

    @property
    def spindle(self) -> VirtualSpindle: ...

    @property
    def sensors(self) -> SensorSuite: ...

    @property
    def workpiece(self) -> Workpiece: ...

    @property
    def plan(self) -> CutPlan: ...


@dataclass(frozen=True, slots=True, eq=False)
class _Job:
    """One pair of records, cut and air, with its own share of chance."""

    id: str
    tooling: Tooling
    dynamics: Poles
    clamping: Clamping
    conditions: CuttingConditions
    rng: np.random.Generator


def simulate(setup: VirtualSetup, toolings: Sequence[Tooling], seed: int, map: Map = map) -> Iterator[SimulatedCut]:
    """Yield every tooling's cut at every speed of the plan, in order.

    Parameters
    ----------
    setup : VirtualSetup
    toolings : sequence of Tooling
    seed : int
        Same seed, same records.
    map : callable
        Runs the cuts; they do not depend on each other's order.
    """
    yield from map(_Worker(setup), list(_jobs(setup, toolings, np.random.default_rng(seed))))


def true_receptances(setup: VirtualSetup, tooling: Tooling, speed: float | None = None) -> TrueReceptances:
    """Return tip-tip and flange-tip from the full equations.

    Parameters
    ----------
    setup : VirtualSetup
    tooling : Tooling
    speed : float [rad/s], optional
        Of the spindle; by default the mean of the programmed speeds.
    """
    frequency, speed = _truth_frequency(), float(np.mean(setup.plan.spindle_speeds)) if speed is None else speed
    outputs = ("tip.x", "tip.y", "flange.x", "flange.y")
    values = frequency_response(rotor(setup.spindle, tooling.assembly), 2.0 * np.pi * frequency, speed, outputs=outputs)
    return TrueReceptances(tooling.name, speed, frequency, values[:, :2], values[:, 2:])


def truth_speeds(setup: VirtualSetup) -> tuple[float, ...]:
    """Return the spindle speeds [rad/s] at which the truth is wanted: the mean of the plan's, then, where it matters, its ends."""
    programmed = setup.plan.spindle_speeds
    ends = (min(programmed), max(programmed)) if setup.spindle.speed_dependent else ()
    return tuple(dict.fromkeys((float(np.mean(programmed)), *ends)))


def true_flange(setup: VirtualSetup) -> TrueFlange:
    """Return the flange receptances without a tooling, from the full equations at the mean of the programmed speeds."""
    frequency, speed = _truth_frequency(), float(np.mean(setup.plan.spindle_speeds))
    planes = ("flange.x", "flange.x'", "flange.y", "flange.y'")
    values = frequency_response(rotor(setup.spindle, None), 2.0 * np.pi * frequency, speed, inputs=planes, outputs=planes)
    return TrueFlange(frequency, values)


def _truth_frequency() -> FloatArray:
    first, last, step = TRUTH_FREQUENCIES
    return np.arange(first, last + 0.5 * step, step)


def _jobs(setup: VirtualSetup, toolings: Sequence[Tooling], rng: np.random.Generator) -> Iterable[_Job]:
    for tooling in toolings:
        # a child of its own for each tooling and cut, so that one more speed does not change the other records
        chance = rng.spawn(1)[0]
        clamping = clamp(setup.sensors, tooling.cutter.tooth_angle, chance)
        small = reduced(rotor(setup.spindle, tooling.assembly))
        dynamics = None if setup.spindle.speed_dependent else poles(small)
        for i, speed in enumerate(setup.plan.spindle_speeds):
            own = poles(small, speed) if dynamics is None else dynamics
            yield _Job(f"{tooling.name}-{i:02d}", tooling, own, clamping, setup.plan.conditions(speed), chance.spawn(1)[0])


@dataclass(frozen=True, slots=True, eq=False)
class _Worker:
    """Makes the two records of a job; a picklable callable for a process pool."""

    setup: VirtualSetup

    def __call__(self, job: _Job) -> SimulatedCut:
        suite, plan = self.setup.sensors, self.setup.plan
        lines = np.zeros((0, 2), dtype=complex)
        count = round(plan.duration * suite.rate)
        records = {}
        for kind in ("cut", "air"):
            speed = job.conditions.spindle_speed * (1.0 + suite.speed_error * job.rng.normal())
            angle = 2.0 * np.pi * job.rng.random()
            history = None
            if kind == "cut":
                conditions = replace(job.conditions, spindle_speed=speed)
                cutter = replace(job.tooling.cutter, runout=job.clamping.runout)
                history = _history(self.setup, job.dynamics, cutter, conditions, angle, count)
                highest = int(2.0 * np.pi * TRUTH_FREQUENCIES[1] / speed)
                lines = synchronous_lines(history.angle, history.force, highest + 1)
            channels = record(suite, job.clamping, speed, angle, job.conditions.feed_angle, count, OVERSAMPLING, history, job.rng)
            records[kind] = SimulatedRecord(speed, angle, channels)
        return SimulatedCut(job.id, job.tooling.name, records, lines)


def _history(setup: VirtualSetup, dynamics: Poles, cutter: Cutter, conditions: CuttingConditions, angle: float, count: int) -> CutHistory:
    """The cut with what the filters need before and after, and the settling before that dropped."""
    suite = setup.sensors
    step = 1.0 / (suite.rate * OVERSAMPLING)
    lead = padding(OVERSAMPLING)
    settling = round(setup.plan.settling / step)
    total = settling + OVERSAMPLING * (count - 1 + 2 * lead) + 1
    start = angle - conditions.spindle_speed * step * (settling + OVERSAMPLING * lead)
    return mill_cut(dynamics, cutter, conditions, setup.workpiece.coefficients, step, total, start).after(settling)
