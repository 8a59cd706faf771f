"""Cuts on the virtual machine, and what is true of it."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np

from rcsa_ident.base.arrays import ComplexArray, FloatArray
from rcsa_ident.base.scaleout import Map
from rcsa_ident.cutting.conditions import CuttingConditions
from rcsa_ident.setup.cut import Workpiece
from rcsa_ident.setup.tooling import Tooling
from rcsa_ident.virtual.campaign import SimulatedCut, SimulatedRecord, TrueFlange, TrueReceptances
from rcsa_ident.virtual.changes import Changes, Turn, changed, course_of
from rcsa_ident.virtual.disturbances import Disturbances, turning
from rcsa_ident.virtual.machine import CutPlan, VirtualSpindle
from rcsa_ident.virtual.milling import Course, CutHistory, mill_cut, rigid_force_lines, synchronous_lines
from rcsa_ident.virtual.reduction import Poles, ReducedRotor, alike, poles, reduced
from rcsa_ident.virtual.robot import VirtualRobot, robot_cut_id, robot_rotor
from rcsa_ident.virtual.rotor import frequency_response, rotor
from rcsa_ident.virtual.sensors import Clamping, SensorSuite, accelerometer_places, clamp, padding, record
from rcsa_ident.virtual.workpiece_side import VirtualWorkpieceSide

#: Instants of the time march per sample of the records.
OVERSAMPLING = 8
#: Parts of a pass in each of which a machine that changes with the speed is taken for constant.
PARTS = 24
#: What pushes a tool on a robot.
ALL_TIPS = ("tip.x", "tip.y", "tip.z")
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

    @property
    def disturbances(self) -> Disturbances: ...

    @property
    def changes(self) -> Changes: ...

    @property
    def workpiece_side(self) -> VirtualWorkpieceSide | None: ...


class VirtualRobotSetup(VirtualSetup, Protocol):
    """The same of a virtual robot, which makes the cuts of its plan at each of some postures."""

    @property
    def robot(self) -> VirtualRobot: ...

    @property
    def postures(self) -> FloatArray: ...


@dataclass(frozen=True, slots=True, eq=False)
class _Job:
    """One pair of records, cut and air, with its own share of chance."""

    id: str
    tooling: Tooling
    dynamics: Poles | tuple[Poles, ...]
    clamping: Clamping
    conditions: CuttingConditions
    last_speed: float | None
    duration: float
    rng: np.random.Generator


def simulate(setup: VirtualSetup, toolings: Sequence[Tooling], seed: int, map: Map = map) -> Iterator[SimulatedCut]:
    """Yield every tooling's cut at every speed of the plan, in the order in which they are made.

    `seed`: same seed, same records
    `map`: runs the cuts; they do not depend on each other's order
    """
    yield from map(_Worker(setup), list(_jobs(setup, toolings, seed)))


def simulate_robot(setup: VirtualRobotSetup, toolings: Sequence[Tooling], seed: int, map: Map = map) -> Iterator[SimulatedCut]:
    """Yield every tooling's cut at every posture and speed of the plan, in order. `seed`: same seed, same records."""
    rng = np.random.default_rng(seed)
    jobs = []
    for tooling in toolings:
        chance = rng.spawn(1)[0]
        # one clamping for all postures
        clamping = clamp(setup.sensors, tooling.cutter.tooth_angle, chance)
        for number, posture in enumerate(setup.postures):
            small = reduced(robot_rotor(setup.robot, posture, tooling.assembly), inputs=ALL_TIPS, planes=1)
            for name, speed, last, duration in setup.plan.cuts:
                id, conditions = robot_cut_id(tooling.name, number, name), setup.plan.conditions(speed)
                jobs.append(_Job(id, tooling, poles(small, speed, ALL_TIPS), clamping, conditions, last, duration, chance.spawn(1)[0]))
    yield from map(_Worker(setup), jobs)


def true_robot_tip(robot: VirtualRobot, posture: FloatArray, tooling: Tooling, omega: FloatArray, speed: float = 0.0) -> ComplexArray:
    """Return the tip's receptance over X, Y and Z of the spindle, from the full equations, shape (n, 3, 3) [m/N].

    `posture` [rad], shape (j,); `omega` [rad/s], shape (n,)
    `speed` [rad/s]: of the spindle
    """
    return frequency_response(robot_rotor(robot, posture, tooling.assembly), omega, speed, ALL_TIPS, ALL_TIPS)


def true_receptances(setup: VirtualSetup, tooling: Tooling, speed: float | None = None) -> TrueReceptances:
    """Return tip-tip and flange-tip from the full equations: the tool's own, whatever gives way on the workpiece's side.

    `speed` [rad/s]: of the spindle; by default the mean of the programmed speeds
    """
    frequency, speed = _truth_frequency(), float(np.mean(setup.plan.programmed)) if speed is None else speed
    outputs = ("tip.x", "tip.y", "flange.x", "flange.y")
    values = frequency_response(rotor(setup.spindle, tooling.assembly), 2.0 * np.pi * frequency, speed, outputs=outputs)
    return TrueReceptances(tooling.name, speed, frequency, values[:, :2], values[:, 2:])


def truth_speeds(setup: VirtualSetup) -> tuple[float, ...]:
    """Return the spindle speeds [rad/s] at which the truth is wanted: the mean of the plan's, then, where it matters, its ends."""
    programmed = setup.plan.programmed
    ends = (min(programmed), max(programmed)) if setup.spindle.speed_dependent else ()
    return tuple(dict.fromkeys((float(np.mean(programmed)), *ends)))


def true_flange(setup: VirtualSetup) -> TrueFlange:
    """Return the flange receptances without a tooling, from the full equations at the mean of the programmed speeds."""
    frequency, speed = _truth_frequency(), float(np.mean(setup.plan.programmed))
    planes = ("flange.x", "flange.x'", "flange.y", "flange.y'")
    values = frequency_response(rotor(setup.spindle, None), 2.0 * np.pi * frequency, speed, inputs=planes, outputs=planes)
    return TrueFlange(frequency, values)


def _truth_frequency() -> FloatArray:
    first, last, step = TRUTH_FREQUENCIES
    return np.arange(first, last + 0.5 * step, step)


def _jobs(setup: VirtualSetup, toolings: Sequence[Tooling], seed: int) -> Iterable[_Job]:
    rng, changes = np.random.default_rng(seed), setup.changes
    course = course_of(setup.plan, setup.spindle, changes, len(toolings), seed)
    for number, tooling in enumerate(toolings):
        # a child of its own for each tooling and cut, so that one more speed does not change the other records
        chance = rng.spawn(1)[0]
        clamping = clamp(setup.sensors, tooling.cutter.tooth_angle, chance)
        chances = chance.spawn(len(setup.plan.cuts))
        small = reduced(rotor(setup.spindle, tooling.assembly))
        dynamics = None if setup.spindle.speed_dependent else poles(small)
        for turn in (each for each in course if each.tooling == number):
            name, speed, last, duration = setup.plan.cuts[turn.cut]
            if changes.of_the_machine:
                small, dynamics = reduced(rotor(_in_cut(setup, tooling, turn, seed), tooling.assembly)), None
            own = _along(small, speed, last, setup.plan.settling / duration) if dynamics is None else dynamics
            own = _with(setup.workpiece_side, own)
            conditions = setup.plan.conditions(speed)
            yield _Job(f"{tooling.name}-{name}", tooling, own, clamping, conditions, last, duration, chances[turn.cut])


def _in_cut(setup: VirtualSetup, tooling: Tooling, turn: Turn, seed: int) -> VirtualSpindle:
    """The spindle as it is in one cut; how far its joint gives way there is that of the tool that does not vibrate."""
    changes, spindle = setup.changes, setup.spindle
    if changes.joint is None:
        return changed(spindle, changes, turn, 0.0)
    clamping = changes.joint.clamping(seed, turn.tooling)
    still = changed(spindle, changes, turn, clamping)
    speed = setup.plan.cuts[turn.cut][1]
    lines = rigid_force_lines(tooling.cutter, setup.plan.conditions(speed), setup.workpiece.coefficients, law=changes.chip_law)
    highest = int(2.0 * np.pi * TRUTH_FREQUENCIES[1] / speed)
    face = {"face": tooling.assembly.stickout + tooling.assembly.holder_length}
    motion = frequency_response(
        rotor(still, tooling.assembly, points=face),
        speed * np.arange(1, highest + 1),
        speed,
        outputs=("face.x", "face.y", "flange.x", "flange.y"),
    )
    across = np.einsum("nij,nj->ni", motion[:, :2] - motion[:, 2:], lines[1 : highest + 1, :2])
    return changed(spindle, changes, turn, clamping, float(np.linalg.norm(across)))


def _along(small: ReducedRotor, speed: float, last: float | None, settling: float) -> Poles | tuple[Poles, ...]:
    """The machine at a speed, or part by part between the first and the last one of a pass that settles before, a share of its length."""
    if last is None:
        return poles(small, speed)
    # the speed changes from the record's first sample on; its padding is short beside a part
    gone = np.maximum((np.arange(PARTS) + 0.5) / PARTS * (1.0 + settling) - settling, 0.0)
    found = [poles(small, speed + float(gone[0]) * (last - speed))]
    for share in gone[1:].tolist():
        found.append(alike(found[-1], poles(small, speed + share * (last - speed))))
    return tuple(found)


def _with(side: VirtualWorkpieceSide | None, dynamics: Poles | tuple[Poles, ...]) -> Poles | tuple[Poles, ...]:
    """The machine with what gives way on the workpiece's side."""
    if side is None:
        return dynamics
    return side.under(dynamics) if isinstance(dynamics, Poles) else tuple(side.under(each) for each in dynamics)


@dataclass(frozen=True, slots=True, eq=False)
class _Worker:
    """Makes the two records of a job; a picklable callable for a process pool."""

    setup: VirtualSetup

    def __call__(self, job: _Job) -> SimulatedCut:
        suite, plan, disturbances = self.setup.sensors, self.setup.plan, self.setup.disturbances
        count = round(job.duration * suite.rate)
        # the clock of the recorder may be off: nobody who reads the record knows
        suite = replace(suite, rate=suite.rate * (1.0 + disturbances.clock_error))
        lines = np.zeros((0, 2), dtype=complex)
        step, lead = 1.0 / (suite.rate * OVERSAMPLING), padding(OVERSAMPLING) * OVERSAMPLING
        settling = round(plan.settling / step)
        total, first = settling + OVERSAMPLING * (count - 1) + 2 * lead + 1, settling + lead
        inside = slice(first, first + OVERSAMPLING * (count - 1) + 1, OVERSAMPLING)
        records = {}
        for kind in ("cut", "air"):
            speed = job.conditions.spindle_speed * (1.0 + suite.speed_error * job.rng.normal())
            start = 2.0 * np.pi * job.rng.random()
            change = 0.0 if job.last_speed is None else speed * (job.last_speed / job.conditions.spindle_speed - 1.0) / job.duration
            angle = turning(disturbances, speed, start, step, total, first, job.rng, change)
            history = None
            if kind == "cut":
                conditions = replace(job.conditions, spindle_speed=speed)
                cutter = replace(job.tooling.cutter, runout=job.clamping.runout)
                feed = conditions.feed_per_tooth * cutter.teeth / (2.0 * np.pi)
                # the feed follows a speed that is programmed to change, not one that wanders
                way = speed * step * np.arange(total) + 0.5 * change * np.maximum(step * (np.arange(total) - first), 0.0) ** 2
                course = Course(angle, feed * way, _width(plan, job.duration, step, total, first))
                coefficients = self.setup.workpiece.coefficients
                law = self.setup.changes.chip_law
                history = mill_cut(job.dynamics, cutter, conditions, coefficients, step, total, course=course, law=law).after(settling)
                highest = int(2.0 * np.pi * TRUTH_FREQUENCIES[1] / speed)
                lines = _lines(plan, history, lead, highest + 1)
            own = suite, job.clamping, angle[inside], job.conditions.feed_angle, OVERSAMPLING, history, job.rng, disturbances
            side = self.setup.workpiece_side
            channels = record(*own, accelerometer_places(len(self.setup.spindle.housing_positions), None if side is None else side.role))
            speed = float(np.mean(np.diff(angle[inside]))) * suite.rate if disturbances.speed_wander > 0.0 or change != 0.0 else speed
            records[kind] = SimulatedRecord(speed, start, channels)
        return SimulatedCut(job.id, job.tooling.name, records, lines)


def _width(plan: CutPlan, last: float, step: float, count: int, first: int) -> FloatArray:
    """Share of the axial depth that is in the material at each instant; the record begins at instant number `first`, and ends at `last`."""
    time = (np.arange(count) - first) * step
    # instants, in case one of the two has no length
    entry, leave = max(0.5 * plan.entry, step), max(0.5 * plan.leave, step)
    rising = np.clip((time - plan.entry) / entry + 1.0, 0.0, 1.0) if plan.entry > 0.0 else np.ones(count)
    falling = np.clip((last - plan.leave - time) / leave + 1.0, 0.0, 1.0) if plan.leave > 0.0 else np.ones(count)
    return rising * falling


def _lines(plan: CutPlan, history: CutHistory, lead: int, orders: int) -> np.ndarray:
    """Lines of the true force where the tool is wholly in the material."""
    first = lead + round(plan.entry / history.step)
    last = history.angle.size - lead - round(plan.leave / history.step)
    inside = slice(0, None) if plan.entry == plan.leave == 0.0 else slice(first, last)
    return synchronous_lines(history.angle[inside], history.force[inside], orders)
