"""What path compensation leaves: static references, and the published corner slot of a KR210, known exactly and each spring within a tenth.

Compensated and simulated by the same equations where the arm is exact; the arms that stand for a real one have other springs.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from benchmarks.timing import once, row
from rcsa_ident.front.samples import sample_robot, sample_tooling
from rcsa_ident.machine.robot.flexible import FlexibleRobot
from rcsa_ident.machine.robot.kinematics import tool_point_at
from rcsa_ident.machine.robot.model import RobotModel
from rcsa_ident.toolpath.blending import Controller, FirstOrderLag, QuadraticBlend
from rcsa_ident.toolpath.forces import ForceAlongPath
from rcsa_ident.toolpath.path import ToolPath
from rcsa_ident.workflows.paths.robot import IdealForce, Method, Mirror, RobotPath, compensate
from rcsa_ident.workflows.paths.robot_compensation import ahead_of_forces, mirrored_postures, reached

POSTURE = np.radians([0.0, 20.0, 30.0, 10.0, -40.0, 0.0])
#: Of the two sides of the published slot [N], its feed [m/s], and what the controller leaves of its corner [m].
FORCES, FEED, CORNER = np.array([[-130.0, 58.0, 24.0], [108.0, 59.0, 39.0]]), 0.05, 1.6e-3
#: Length of a side, and between places that are corrected [m].
SIDE, SPACING = 0.15, 1e-3
#: Of the springs that stand for the real arm: largest error, seed, arms.
OFF, SEED, ARMS = 0.1, 4, 5


def tight(model: RobotModel) -> RobotModel:
    """Return an arm without play."""
    return replace(model, joints=tuple(replace(joint, backlash=0.0) for joint in model.joints))


def corner(model: RobotModel) -> ToolPath:
    """Return a right angle in the plane across the tool, from the tip's place at the posture."""
    assembly, tool = sample_tooling("S3-PG25-long").assembly, tool_point_at(model, POSTURE)
    axis, first = -tool.turn[:, 2], tool.turn[:, 0]
    tip = tool.offset - (assembly.stickout + assembly.holder_length) * axis
    places = np.array([tip, tip + SIDE * first, tip + SIDE * (first + np.cross(axis, first))])
    return ToolPath(places, axes=np.tile(axis, (3, 1)), feed=np.full(3, FEED)).resampled(SPACING)


def slot(model: RobotModel, controller: Controller, weight: bool) -> RobotPath:
    """Return the published experiment."""
    path = corner(model)
    middle = 0.5 * path.times[-1]
    instants = np.array([0.0, middle - 1e-3, middle + 1e-3, path.times[-1]])
    force = ForceAlongPath(instants, FORCES[[0, 0, 1, 1]]).low_passed()
    return RobotPath(FlexibleRobot(model), POSTURE, sample_tooling("S3-PG25-long").assembly, path, force, controller, weight)


def others(model: RobotModel) -> list[FlexibleRobot]:
    """Return arms each of whose springs is off by at most a tenth; last, since many errors even out, one that is softer throughout."""
    rng, stiffness = np.random.default_rng(SEED), model.chain().stiffness
    factors = [*rng.uniform(1.0 - OFF, 1.0 + OFF, (ARMS, stiffness.size)), np.full(stiffness.size, 1.0 - OFF)]
    return [FlexibleRobot(model.with_springs(stiffness * each)) for each in factors]


def run() -> list[dict[str, Any]]:
    """Static references first; then each of method, controller, play and weight on the corner slot."""
    rows, model = [], sample_robot("kr210")
    still = FlexibleRobot(tight(model))
    place, posture = tool_point_at(model, POSTURE).offset, POSTURE[None]
    push = np.array([[-58.0, -130.0, 35.0, 0.0, 0.0, 0.0]])

    def left(commanded: np.ndarray, arm: FlexibleRobot) -> float:
        return float(np.max(np.abs(reached(arm, commanded, push)[0] - place)))

    given_way = left(posture, still)
    for name, commanded, published in (
        ("ideal force", ahead_of_forces(still, posture, push), 0.011),
        ("mirrored once", mirrored_postures(still, posture, push), 0.05),
    ):
        off = [left(commanded, FlexibleRobot(tight(arm.model))) for arm in others(model)]
        said = f"{1e3 * given_way:.3f} mm before; springs off by {100 * OFF:.0f} %: {1e6 * min(off):.1f} to {1e6 * max(off):.1f} um"
        rows.append(row(f"compensation: at rest, {name} (peer: published)", 1e6 * left(commanded, still), published, "um", said))
    blend, lag = QuadraticBlend.leaving(CORNER, np.hypot(FEED, FEED)), FirstOrderLag(CORNER / (0.509 * FEED))
    cases: list[tuple[str, RobotModel, Controller, bool]] = [
        ("blend", tight(model), blend, False),
        ("blend, play", model, blend, False),
        ("blend, play, weight", model, blend, True),
        ("lag, play, weight", model, lag, True),
    ]
    methods: list[tuple[str, Method]] = [("ideal force", IdealForce()), ("mirrored once", Mirror())]
    for title, arm, controller, weight in cases:
        for name, method in methods:
            task = slot(arm, controller, weight)
            seconds = once(lambda task=task, method=method: compensate(task, method))  # type: ignore[misc]
            found = compensate(task, method, arms=others(arm))
            off = [each.rms for each in found.draws]
            less = [100.0 * (1.0 - each / found.before.rms) for each in (found.after.rms, max(off))]
            before, after, own = (1e3 * each.corner for each in (found.before, found.after, found.controller))
            said = (
                f"rms {1e3 * found.before.rms:.3f} -> {1e3 * found.after.rms:.4f} mm, springs off: {1e3 * min(off):.4f} to "
                f"{1e3 * max(off):.4f} mm (-{less[1]:.0f} % at worst); corner {before:.2f} -> {after:.2f} mm, controller alone {own:.2f}; "
                f"{len(found.path)} places in {seconds:.1f} s"
            )
            rows.append(row(f"compensation: corner, {title}, {name} (peer: published)", less[0], 58.0, "% less", said))
    return rows
