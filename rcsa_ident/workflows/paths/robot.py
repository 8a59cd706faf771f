"""What an arm makes of a path while forces act on its tool, and the path to command so that the tool goes where it should."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Protocol

import numpy as np

from rcsa_ident.base.arrays import FloatArray
from rcsa_ident.base.errors import InputError, positive
from rcsa_ident.machine.robot.compliance import PLAY_HELD
from rcsa_ident.machine.robot.flexible import FlexibleRobot
from rcsa_ident.machine.robot.kinematics import postures_of, tool_point_at
from rcsa_ident.machine.robot.motion import ArmUnderForce
from rcsa_ident.tool_holder.clamped import bending_at_rest
from rcsa_ident.tool_holder.geometry import ToolAssembly
from rcsa_ident.toolpath.blending import Controller, QuadraticBlend
from rcsa_ident.toolpath.compensation import LARGEST, CompensatedPath, Place, ahead_of_force, limited, mirrored
from rcsa_ident.toolpath.deviation import Deviation
from rcsa_ident.toolpath.forces import ForceAlongPath
from rcsa_ident.toolpath.path import ToolPath
from rcsa_ident.workflows.robot_postures import flange_for, following

#: Time step, and how many of them a stretch may take.
STEP, MOST_STEPS = 1e-3, 1_000_000
#: Places that a path may have once it is cut into short moves.
MOST_PLACES = 50_000
#: A correction that turns a joint further takes another of the arm's postures [rad].
_TURNED_OVER = 0.2


@dataclass(frozen=True, eq=False)
class RobotPath:
    """An arm that is sent along a path, and the forces on its tool.

    `start` [rad], shape (6,): near the first place's posture
    `assembly`: the tool-holder and the tool; they bend as they do at rest, clamped to the arm
    `path`: of the tool's tip in the base's axes; its places are those that are corrected
    `weight`: whether the arm has its weight. Its sag at the path's first place counts as known: the work was touched in there.
    `step` [s]
    """

    robot: FlexibleRobot
    start: FloatArray
    assembly: ToolAssembly
    path: ToolPath
    force: ForceAlongPath
    controller: Controller = field(default_factory=lambda: QuadraticBlend(0.1))
    weight: bool = True
    step: float = STEP

    def __post_init__(self) -> None:
        positive("step", self.step, "s")
        if len(self.path) > MOST_PLACES:
            raise InputError("path", f"{len(self.path)} places", f"at most {MOST_PLACES}: longer moves between them, or a part of the path")
        if not self.stretches:
            raise InputError("path", "no move", "one or more at a feed")

    def on(self, robot: FlexibleRobot) -> RobotPath:
        """Return the same task for another arm; the postures stay, the arms differ by springs and masses."""
        other = replace(self, robot=robot)
        other.__dict__["postures"] = self.postures
        return other

    @cached_property
    def arm(self) -> ArmUnderForce:
        """The arm with its tool."""
        return ArmUnderForce(self.robot, self.assembly.stickout + self.assembly.holder_length, self.weight)

    @cached_property
    def postures(self) -> FloatArray:
        """That bring the tip to the path's places, shape (k, 6) [rad]."""
        return following(self.robot.model, self.start, self.path.places, self.path.axes, self.assembly)

    @cached_property
    def stretches(self) -> tuple[slice, ...]:
        """Places of moves at a feed, one after the other; between them are rapid moves, which are not marched through."""
        ends = np.flatnonzero(np.diff(np.concatenate([[False], self.path.cutting, [False]]).astype(int)))
        found = tuple(slice(a, b + 1) for a, b in zip(ends[::2], ends[1::2], strict=True))
        return tuple(each for each in found if self.path.times[each.stop - 1] > self.path.times[each.start])

    @cached_property
    def sunk(self) -> FloatArray:
        """How far the tip stands from where the angles say at the first place, no force on it, shape (3,) [m]."""
        return self.arm.tip(self.arm.at_rest(self.postures[0], np.zeros(3))) - self.arm.tip(self.postures[0])

    def sent(self, stretch: slice, postures: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return instants [s] of the path's time, and where drives are held that are sent through postures (k, 6), shape (t, 6) [rad]."""
        times = self.path.times[stretch]
        lead = self.controller.lead + self.controller.delay
        count = int(np.ceil((times[-1] - times[0] + 2.0 * lead) / self.step)) + 1
        if count > MOST_STEPS:
            raise InputError("path", f"{times[-1] - times[0]:.0f} s without a rapid move", f"at most {MOST_STEPS * self.step:.0f} s")
        instants = times[0] - lead + self.step * np.arange(count)
        # of places that take no time the last one counts
        kept = np.append(np.diff(times) > 0.0, True)
        sent = np.stack([np.interp(instants, times[kept], own) for own in postures[stretch][kept].T], axis=1)
        return instants, self.controller.follow(sent, self.step)

    def followed(self, postures: FloatArray) -> FloatArray:
        """Return where the drives alone, sent through postures (k, 6), would have the tip at the path's places, shape (k, 3) [m]."""
        found = np.array([self.arm.tip(each) for each in postures])
        for stretch in self.stretches:
            instants, held = self.sent(stretch, postures)
            found[stretch] = [self.arm.tip(each) for each in self._late(stretch, instants, held)]
        return found

    def gone(self, postures: FloatArray) -> FloatArray:
        """Return where the tip is at the path's places when drives are sent through postures (k, 6), shape (k, 3) [m].

        A march through time for each stretch at a feed, from rest; beside them the places are those that the drives are sent to. An arm of
        which no masses are known is at rest at each place.
        """
        tips = np.array([self.arm.tip(each) for each in postures])
        for stretch in self.stretches:
            instants, held = self.sent(stretch, postures)
            forces = self.force.at(self.path.times[stretch])
            if self.robot.model.weighed:
                marched = self.arm.along(held, self.force.at(instants - self.controller.delay), self.step)
                angles = self._late(stretch, instants, marched)
            else:
                angles = np.array([self.arm.at_rest(*each) for each in zip(self._late(stretch, instants, held), forces, strict=True)])
            tips[stretch] = [self.arm.tip(each) - self.sunk for each in angles] + self.bent(stretch)
        return tips

    def bent(self, stretch: slice) -> FloatArray:
        """Return how far the tool's tip is bent aside at the places of a stretch, shape (m, 3) [m]."""
        forces, axes = self.force.at(self.path.times[stretch]), self.path.axes[stretch]
        return self._bending * (forces - np.sum(forces * axes, axis=1, keepdims=True) * axes)

    @cached_property
    def _bending(self) -> float:
        return bending_at_rest(self.assembly)

    def sent_to(self, places: FloatArray) -> tuple[FloatArray, list[Place]]:
        """Return postures for places, shape (k, 6) [rad], each the nearest to the ideal one, and what became of each.

        The tool keeps its axis. A place that no posture within the joints' limits reaches is left where the path has it, and told.
        """
        model, sideways = self.robot.model, tool_point_at(self.robot.model, self.start).turn[:, 0]
        found, became = self.postures.copy(), [Place.CORRECTED] * len(places)
        for k, (place, axis) in enumerate(zip(places, self.path.axes, strict=True)):
            flange = flange_for(model, sideways, place, axis, self.assembly)
            ways = postures_of(model, flange, near=self.postures[k])
            if not len(ways):
                beyond = len(postures_of(model, flange, within_limits=False)) > 0
                became[k] = Place.JOINT_RANGE if beyond else Place.OUT_OF_REACH
                continue
            nearest = ways[np.argmin(np.max(np.abs(ways - self.postures[k]), axis=1))]
            if np.max(np.abs(nearest - self.postures[k])) > _TURNED_OVER:
                became[k] = Place.JOINT_RANGE
                continue
            found[k] = nearest
        return found, became

    def _late(self, stretch: slice, instants: FloatArray, values: FloatArray) -> FloatArray:
        """What stands at instants, shape (t, m), when the tool should be at the places of a stretch."""
        at = self.path.times[stretch] + self.controller.delay
        return np.stack([np.interp(at, instants, own) for own in values.T], axis=1)

    @cached_property
    def ahead_of_forces(self) -> tuple[FloatArray, FloatArray]:
        """Places to command by the ideal-force method, shape (k, 3) [m], and how far play that no torque holds reaches, (k,) [m]."""
        chain = self.robot.model.chain(self.robot.tilts)
        full = np.array([chain.angles(each) for each in self.postures])
        asked = np.zeros_like(full)
        moving = np.zeros(len(full), dtype=bool)
        for stretch in self.stretches:
            instants, held = self.sent(stretch, self.postures)
            rate = np.gradient(held, self.step, axis=0)
            gain = np.gradient(rate, self.step, axis=0)
            times = self.path.times[stretch]
            forces = self.force.at(times)
            # the drives move so a delay later than they are sent
            each = [[np.interp(times + self.controller.delay, instants, own) for own in values.T] for values in (rate, gain)]
            for k, rates, gains, force in zip(range(stretch.start, stretch.stop), *np.array(each).transpose(0, 2, 1), forces, strict=True):
                asked[k] = self.arm.asked(full[k], chain.angles(rates), chain.angles(gains), force)
                moving[k] = True
        for k in np.flatnonzero(~moving):
            asked[k] = self.arm.asked(full[k], np.zeros(full.shape[1]), np.zeros(full.shape[1]), np.zeros(3))
        places = ahead_of_force(full, asked, self.arm.twist, self.arm.tip)
        loose = np.zeros(len(full))
        for k in np.flatnonzero(moving):
            free = np.where(np.abs(asked[k]) < PLAY_HELD, self.arm.play, 0.0)
            loose[k] = np.linalg.norm(np.abs(self.arm.motion(full[k])) @ free)
        commanded = np.array(places) + self.sunk
        for stretch in self.stretches:
            commanded[stretch] -= self.bent(stretch)
        return commanded, loose


class Method(Protocol):
    """How a path is compensated."""

    def commanded(self, task: RobotPath) -> FloatArray:
        """Return the places to command, shape (k, 3) [m]."""


@dataclass(frozen=True, slots=True)
class IdealForce:
    """Every freedom is turned to where its spring answers the torques of the ideal motion [bauer2013]."""

    def commanded(self, task: RobotPath) -> FloatArray:
        """Return the places to command, shape (k, 3) [m]."""
        return task.ahead_of_forces[0]


@dataclass(frozen=True, slots=True)
class Mirror:
    """What gives way in a march along the commanded path is taken off it; what the controller leaves of corners is not."""

    passes: int = 1

    def commanded(self, task: RobotPath) -> FloatArray:
        """Return the places to command, shape (k, 3) [m]."""

        def reached(places: FloatArray) -> FloatArray:
            postures, _ = task.sent_to(places)
            return places + task.gone(postures) - task.followed(postures)

        return mirrored(task.path.places, reached, self.passes)


def compensate(task: RobotPath, method: Method, largest: float = LARGEST, arms: Sequence[FlexibleRobot] = ()) -> CompensatedPath:
    """Return the path to command so that the tool goes where the task's path has it.

    `largest` [m]: no place is corrected by more; where that would be, it is told
    `arms`: on which the commanded path is tried, too: draws of what is known of the arm
    Raises `InputError` if the path itself is out of the arm's reach.
    """
    positive("largest correction", largest, "m")
    followed = task.followed(task.postures)
    moving = np.zeros(len(task.path), dtype=bool)
    for stretch in task.stretches:
        moving[stretch] = True
    correction = np.where(moving[:, None], method.commanded(task) - task.path.places, 0.0)
    correction, saturated = limited(correction, largest)
    postures, became = task.sent_to(task.path.places + correction)
    for k in np.flatnonzero(saturated):
        became[k] = Place.SATURATED if became[k] is Place.CORRECTED else became[k]
    for k in np.flatnonzero(~moving):
        became[k] = Place.RAPID
    correction[[each in (Place.JOINT_RANGE, Place.OUT_OF_REACH) for each in became]] = 0.0

    def left(own: RobotPath, sent: FloatArray) -> Deviation:
        return Deviation.of(own.path, own.gone(sent), followed)

    return CompensatedPath(
        task.path.through(task.path.places + correction),
        correction,
        tuple(became),
        Deviation.of(task.path, followed, followed),
        left(task, task.postures),
        left(task, postures),
        tuple(left(task.on(arm), postures) for arm in arms),
        postures,
        task.ahead_of_forces[1],
    )
