"""Virtual robots drawn by chance: springs, dampers and masses differ from the data sheet, a spindle of shaft and bearings is in the hand.

The arm is that of ``data/robots/tx200.toml``, the spindle that of ``data/machines/hpm.toml`` in a lighter housing. The seeds of
`EVALUATION` were fixed on 2026-11-25, after fits to robots 1 and 2 and before any of them was drawn.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from rcsa_ident.base.arrays import FloatArray
from rcsa_ident.base.errors import InputError
from rcsa_ident.base.scaleout import Map
from rcsa_ident.base.units import from_rpm
from rcsa_ident.cutting.conditions import Engagement
from rcsa_ident.io.settings.machines import MachineFile, RobotSetup, read_machine
from rcsa_ident.io.settings.robots import read_robot
from rcsa_ident.io.settings.setups import read_tooling
from rcsa_ident.io.settings.simulations import write_robot_campaign
from rcsa_ident.machine.robot.kinematics import postures_of
from rcsa_ident.machine.robot.model import Body, Frame, RobotModel
from rcsa_ident.setup.tooling import Tooling
from rcsa_ident.virtual.machine import CutPlan
from rcsa_ident.virtual.robot import VirtualRobot
from rcsa_ident.workflows.simulate import simulate_robot

DATA = Path(__file__).parents[1] / "data"
DEVELOPMENT, EVALUATION = (1, 2), (11, 12, 13)
#: Spread of the logarithms of stiffness and damping about the data sheet's (of the latter about three times it: the sheet's ratios of
#: damping, around one per cent, are below what arms have), and of the links' masses.
SPRINGS, MASSES, DAMPED = 0.35, 0.03, 3.0
#: Of the housing, its centre behind the flange: together with the shaft 45 kg.
HOUSING = Body(32.0, np.array([0.0, 0.0, -0.19]), np.diag([0.7, 0.7, 0.2]))
#: Where tools work, upright: corners of a box for the tool-holder's flange [m].
BOX = np.array([[0.9, -0.7, 0.2], [1.6, 0.7, 0.9]])
#: Spindle speeds of the cuts at each posture [rev/min]: slow ones shake the arm, the last one the spindle.
SPEEDS = (500.0, 1100.0, 2400.0, 5300.0, 11600.0)
#: Cut with, two teeth each; never cut with.
CUT, NEVER_CUT = ("S1-ER32", "S2-PG25"), ("S3-PG25-long", "S4-shrink")
TEETH = 2


def sheet() -> RobotModel:
    """Return the arm as its data sheet has it, its payload left to the robot that is drawn."""
    return read_robot(DATA / "robots/tx200.toml")


def drawn(seed: int, masses: float = MASSES) -> VirtualRobot:
    """Return a robot. `masses`: spread of the logarithm of each link's mass."""
    rng = np.random.default_rng(seed)

    def factor(spread: float) -> float:
        return float(np.exp(spread * rng.standard_normal()))

    joints = []
    for joint in sheet().joints:
        tilts = tuple(
            replace(t, stiffness=t.stiffness * factor(SPRINGS), damping=DAMPED * t.damping * factor(SPRINGS)) for t in joint.tilts
        )
        own = replace(joint, stiffness=joint.stiffness * factor(SPRINGS), damping=DAMPED * joint.damping * factor(SPRINGS), tilts=tilts)
        heavier = factor(masses)
        joints.append(replace(own, body=Body(heavier * own.body.mass, own.body.centre, heavier * own.body.inertia)))
    arm = replace(sheet(), joints=tuple(joints))
    return VirtualRobot(replace(arm, payload=HOUSING.seen_from(arm.tool_point)), replace(machine().spindle, gyroscopic=False))


def known(robot: VirtualRobot) -> RobotModel:
    """Return what is known of a drawn robot before it cuts: the data sheet, and the spindle's own mass."""
    return replace(sheet(), payload=robot.drawn().payload)


def machine() -> MachineFile:
    """Return the machine whose spindle, sensors and workpiece the robots have."""
    return read_machine(DATA / "machines/hpm.toml")


def toolings(names: Sequence[str], folder: Path) -> dict[Path, Tooling]:
    """Return toolings with cutters of two teeth, and files of theirs in a folder."""
    found = {}
    for name in names:
        path = folder / f"{name}.toml"
        path.write_text((DATA / f"machines/toolings/{name}.toml").read_text().replace("teeth = 4", f"teeth = {TEETH}"))
        found[path] = read_tooling(path)
    return found


def postures(count: int, seed: int) -> FloatArray:
    """Return postures at which a tool stands upright in `BOX`, its x any way, shape (count, 6) [rad]."""
    arm, rng, found = sheet(), np.random.default_rng(seed), []
    while len(found) < count:
        place, turned = rng.uniform(*BOX), rng.uniform(-np.pi, np.pi)
        z, x = np.array([0.0, 0.0, -1.0]), np.array([np.cos(turned), np.sin(turned), 0.0])
        try:
            ways = postures_of(arm, Frame(np.stack([x, np.cross(z, x), z], axis=1), place).then(arm.tool_point.inverse))
        except InputError:
            continue
        if len(ways):
            found.append(ways[np.argmin(np.abs(ways).max(axis=1))])
    return np.array(found)


def campaign(folder: Path, robot: VirtualRobot, at: FloatArray, tools: dict[Path, Tooling], seed: int, map: Map = map) -> None:
    """Write a campaign: every tooling's cuts at every posture."""
    own = machine()
    plan = CutPlan(tuple(from_rpm(speed) for speed in SPEEDS), 0.2e-3, 0.1e-3, Engagement(0.5 * np.pi, np.pi), duration=3.0, settling=1.5)
    sensors = replace(own.sensors, rate=12800.0, acceleration_noise=0.02)
    setup = RobotSetup(robot, at, sensors, own.workpiece, plan)
    write_robot_campaign(folder, "robot", setup, tools, simulate_robot(setup, list(tools.values()), seed, map))
