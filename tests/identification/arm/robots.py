"""A small campaign of a virtual robot."""

from __future__ import annotations

import json
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
from typer.testing import CliRunner

from rcsa_ident.base.units import from_rpm
from rcsa_ident.cli import app
from rcsa_ident.cutting.conditions import Engagement
from rcsa_ident.io.settings.machines import RobotSetup, read_machine
from rcsa_ident.io.settings.setups import read_tooling
from rcsa_ident.io.settings.simulations import write_robot_campaign
from rcsa_ident.machine.robot.model import Body
from rcsa_ident.virtual.machine import CutPlan
from rcsa_ident.virtual.robot import VirtualRobot
from rcsa_ident.workflows.simulate import simulate_robot
from tests.fixtures.paths import MACHINES, TOOLINGS
from tests.fixtures.robots import robot

#: Six postures with the tool upright [deg], within the limits.
POSTURES = np.radians(
    [
        [-5.4, -12.3, 142.8, 124.4, 16.6, -133.6],
        [24.5, 29.5, 141.3, -24.7, -51.6, 4.4],
        [0.8, 38.1, 107.9, 98.0, -58.5, -39.7],
        [-28.7, 54.3, 53.2, 46.7, 111.3, -126.7],
    ]
)
#: One that nobody cuts at.
ELSEWHERE = np.radians([20.4, 5.8, 139.3, -56.3, -34.3, 33.3])
SPEEDS_RPM = (500.0, 1100.0, 2400.0, 5300.0, 11600.0)


@cache
def truth() -> VirtualRobot:
    """An arm whose springs are off its data sheet's by a third, its links by three per cent, damped three times as much."""
    rng, arm = np.random.default_rng(5), robot("tx200")

    def factor(spread: float) -> float:
        return float(np.exp(spread * rng.standard_normal()))

    chain = arm.chain()
    n = chain.stiffness.size
    springs = arm.with_springs(
        chain.stiffness * np.exp(0.3 * rng.standard_normal(n)), 3.0 * chain.damping * np.exp(0.3 * rng.standard_normal(n))
    )
    housing = Body(32.0, np.array([0.0, 0.0, -0.19]), np.diag([0.7, 0.7, 0.2])).seen_from(arm.tool_point)
    links = springs.heavier(np.array([*(factor(0.03) for _ in arm.joints), 1.0]))
    return VirtualRobot(replace(links, payload=housing), replace(read_machine(MACHINES / "hpm.toml").spindle, gyroscopic=False))


def sheet():
    """What is known of it before it cuts."""
    return replace(robot("tx200"), payload=truth().drawn().payload)


def write_campaign(folder: Path, speeds_rpm=SPEEDS_RPM, postures=POSTURES, duration=1.5) -> Path:
    machine = read_machine(MACHINES / "hpm.toml")
    plan = CutPlan(tuple(from_rpm(s) for s in speeds_rpm), 0.15e-3, 0.1e-3, Engagement(0.5 * np.pi, np.pi), duration=duration, settling=2.0)
    sensors = replace(machine.sensors, rate=12800.0, acceleration_noise=0.02)
    files = {}
    for name in ("S1-ER32", "S2-PG25"):
        path = folder / f"{name}.toml"
        path.write_text((TOOLINGS / f"{name}.toml").read_text().replace("teeth = 4", "teeth = 2"))
        files[path] = read_tooling(path)
    setup = RobotSetup(truth(), postures, sensors, machine.workpiece, plan)
    write_robot_campaign(folder / "campaign", "a robot", setup, files, simulate_robot(setup, list(files.values()), 3))
    return folder / "campaign"


def run(*arguments, code: int | None = None):
    """What a command prints: its JSON if asked for, else its words; its exit code is the one told, else that of the answer's status."""
    answer = CliRunner().invoke(app, [str(each) for each in arguments])
    printed = json.loads(answer.stdout) if "--json" in arguments else answer.output
    wanted = (3 if "--json" in arguments and printed.get("reasons") else 0) if code is None else code
    assert answer.exit_code == wanted, answer.output
    return printed
