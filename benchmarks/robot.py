"""Cost of a robot's equations inside compiled loops, beside Pinocchio where it is installed (``pip install pin``), and of a tip.

Pinocchio is called from Python, as it is used there; ours runs a thousand postures in one compiled loop, as a march through time does.
"""

from __future__ import annotations

import importlib
import importlib.util
from collections.abc import Callable
from functools import partial
from typing import Any

import numba
import numpy as np

from benchmarks.timing import Race, best_of, row
from rcsa_ident.front.samples import sample_robot, sample_tooling
from rcsa_ident.machine.robot import _kernels as kernels
from rcsa_ident.machine.robot.flexible import FlexibleRobot
from rcsa_ident.machine.robot.inertia import accelerations, mass_matrix, torques
from rcsa_ident.machine.robot.kinematics import posed
from rcsa_ident.machine.robot.model import Chain
from rcsa_ident.machine.robot.posed_robot import PosedRobot

#: Postures in a loop.
MANY = 1000
GRAVITY = np.array([0.0, 0.0, -9.81])
frames, mass_of, torque_of, solve = kernels.frames, kernels.mass_matrix, kernels.inverse_dynamics, kernels.solve_symmetric


@numba.njit
def _loop(*given: Any) -> float:
    turn, offset, axis, mass, centre, inertia, angles, rate, gravity, what = given
    n = angles.shape[1]
    rotation, origin, direction = np.empty((n, 3, 3)), np.empty((n, 3)), np.empty((n, 3))
    matrix, torque, still, total = np.empty((n, n)), np.empty(n), np.zeros(n), 0.0
    for k in range(angles.shape[0]):
        frames(turn, offset, axis, angles[k], rotation, origin, direction)
        if what != 1:
            mass_of(rotation, origin, direction, mass, centre, inertia, matrix)
        if what != 0:
            torque_of(rotation, origin, direction, mass, centre, inertia, rate, still, gravity, torque)
        if what == 2:
            solve(matrix, torque)
        total += torque[0] + matrix[0, 0]
    return total


def run() -> list[dict[str, Any]]:
    """Torques, mass matrix and forward dynamics of the TX200 with and without its tilting springs; a tip at a posture."""
    rows = [race.row() for race in races()] or [
        row(f"robot: {name}, {n} freedoms", best_of(ours) / MANY * 1e6, None, "us", "no peer") for name, n, ours, *_ in _equations()
    ]
    rng, flexible = np.random.default_rng(1), FlexibleRobot(sample_robot("tx200"))
    tooling, omega = sample_tooling("S3-PG25-long"), 2.0 * np.pi * np.linspace(5.0, 4500.0, 1000)

    def tip() -> None:
        PosedRobot(flexible, rng.uniform(-1.0, 1.0, 6)).tip(tooling, omega)

    return [*rows, row("robot: tip at a new posture, 1000 frequencies, 18 freedoms", best_of(tip) * 1e3, None, "ms", "six directions")]


def races() -> list[Race]:
    """Each of the equations beside Pinocchio, where it is installed."""
    if not importlib.util.find_spec("pinocchio"):
        return []
    found = []
    for name, n, ours, what, value, chain, angles, rate in _equations():
        call, other = pinocchio(chain, angles, rate)[what]
        told = f"{np.max(np.abs(other - value)) / np.max(np.abs(other)):.0e} apart; peer called from Python"
        found.append(Race(f"robot: {name}, {n} freedoms", "Pinocchio", "pin", ours, call, told, (MANY, MANY)))
    return found


def _equations() -> list[tuple[Any, ...]]:
    """Name, freedoms, our loop over postures, place among the equations, value at the first posture, and what the peer needs."""
    arm, found = sample_robot("tx200"), []
    rng = np.random.default_rng(1)
    for tilts in (False, True):
        chain = arm.chain(tilts)
        n = chain.mass.size
        angles, rate = rng.uniform(-2.0, 2.0, (MANY, n)), rng.uniform(-1.0, 1.0, n)
        bodies = chain.turn, chain.offset, chain.axis, chain.mass, chain.centre, chain.inertia
        here, still = posed(arm, angles[0], tilts), np.zeros(n)
        values = mass_matrix(here), torques(here, rate, still, GRAVITY), accelerations(here, rate, still, GRAVITY)
        for what, name in enumerate(("mass matrix", "torques", "accelerations")):
            found.append((name, n, partial(_loop, *bodies, angles, rate, GRAVITY, what), what, values[what], chain, angles, rate))
    return found


def pinocchio(chain: Chain, angles: np.ndarray, rate: np.ndarray) -> list[tuple[Callable[[], Any], np.ndarray]]:
    """Return the peer's calls over all postures, and what they give at the first: mass matrix, torques, accelerations."""
    # not asked for by the project: compared with where somebody has it
    pin = importlib.import_module("pinocchio")
    model, parent = pin.Model(), 0
    for k in range(chain.mass.size):
        joint = pin.JointModelRevoluteUnaligned(*chain.axis[k])
        parent = model.addJoint(parent, joint, pin.SE3(chain.turn[k], chain.offset[k]), f"j{k}")
        model.appendBodyToJoint(parent, pin.Inertia(float(chain.mass[k]), chain.centre[k], chain.inertia[k]), pin.SE3.Identity())
    model.gravity.linear = GRAVITY
    data, still = model.createData(), np.zeros(chain.mass.size)

    def over(call: Callable[[np.ndarray], Any]) -> Callable[[], None]:
        return lambda: [call(q) for q in angles] and None

    calls = (
        lambda q: pin.crba(model, data, q),
        lambda q: pin.rnea(model, data, q, rate, still),
        lambda q: pin.aba(model, data, q, rate, still),
    )
    upper = np.triu(np.array(calls[0](angles[0])))
    values = (upper + np.triu(upper, 1).T, np.array(calls[1](angles[0])), np.array(calls[2](angles[0])))
    return [(over(call), value) for call, value in zip(calls, values, strict=True)]
