"""An arm on the move under forces on its tool: where its tip is while its drives are held along a path."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rcsa_ident.base.arrays import FloatArray
from rcsa_ident.base.errors import InputError, positive
from rcsa_ident.machine.robot import _kernels
from rcsa_ident.machine.robot.flexible import FlexibleRobot
from rcsa_ident.machine.robot.inertia import torques
from rcsa_ident.machine.robot.kinematics import PosedChain, posed

#: Steps to rest, and how far the last one may turn [rad].
_STEPS, _RESTING = 200, 1e-13
#: Torque that carries a drive's play from its middle to one side [N m]: nothing sticks.
_CARRYING = 1.0


@dataclass(frozen=True, slots=True, eq=False)
class ArmUnderForce:
    """An arm with a tool, whose drives are held along a motion while forces act on the tool's tip.

    Drives that compensate gravity add the torque that the arm's weight asks of them where they are held.

    `reach` [m]: from the tool point to the tool's tip, along the tool
    `weight`: whether the arm has its weight; it holds the play of the joints that it loads on one side
    """

    robot: FlexibleRobot
    reach: float
    weight: bool = True

    @property
    def gravity(self) -> FloatArray:
        """Acceleration of free fall that acts [m/s^2]."""
        return self.robot.model.gravity if self.weight else np.zeros(3)

    @property
    def point(self) -> FloatArray:
        """The tip in the last link's axes, shape (3,) [m]."""
        model = self.robot.model
        return model.flange.then(model.tool_point).point(np.array([0.0, 0.0, self.reach]))

    @property
    def play(self) -> FloatArray:
        """Half of each freedom's, shape (n,) [rad]."""
        chain = self.robot.model.chain(self.robot.tilts)
        found = np.zeros(chain.mass.size)
        found[chain.driven] = [joint.backlash for joint in self.robot.model.joints]
        return found

    def posed(self, angles: FloatArray) -> PosedChain:
        """Return the chain at angles of the drives, nothing tilting, or of all freedoms."""
        return posed(self.robot.model, angles, self.robot.tilts)

    def tip(self, angles: FloatArray) -> FloatArray:
        """Return where the tip is at angles of the drives, or of all freedoms, shape (3,) [m]."""
        chain = self.posed(angles)
        return chain.origin[-1] + chain.rotation[-1] @ self.point

    def motion(self, angles: FloatArray) -> FloatArray:
        """Return how the tip moves with each angle, shape (3, n) [m/rad]."""
        chain = self.posed(angles)
        return chain.jacobian(chain.origin[-1] + chain.rotation[-1] @ self.point)[:3]

    def twist(self, torque: FloatArray) -> FloatArray:
        """Return how far springs are turned that give torques, shape (n,) [rad]: tau/k, and the play to the torque's side."""
        return torque / self.robot.model.chain(self.robot.tilts).stiffness + self.play * np.clip(torque / _CARRYING, -1.0, 1.0)

    def fed(self, posture: FloatArray) -> FloatArray:
        """Return the torques that the control adds against the weight, shape (n,) [N m]."""
        chain, still = self.posed(posture), np.zeros(self.play.size)
        found = np.zeros(still.size)
        driven = chain.chain.driven[[joint.gravity_compensated for joint in self.robot.model.joints]]
        if driven.size:
            found[driven] = torques(chain, still, still, self.gravity)[driven]
        return found

    def asked(self, angles: FloatArray, rate: FloatArray, acceleration: FloatArray, force: FloatArray) -> FloatArray:
        """Return the torques that springs must give on a motion of all freedoms, shape (n,) [N m].

        Those of inertia and weight, less the control's and those of the force (3,) [N] on the tip: all freedoms, those included that no
        drive moves [bauer2013].
        """
        chain = self.posed(angles)
        tip = chain.origin[-1] + chain.rotation[-1] @ self.point
        held = angles[chain.chain.driven]
        return (
            torques(chain, rate, acceleration, self.gravity) - self.fed(held) - chain.jacobian(tip)[:3].T @ np.asarray(force, dtype=float)
        )

    def at_rest(self, posture: FloatArray, force: FloatArray) -> FloatArray:
        """Return all angles, shape (n,) [rad], at which springs hold the weight and a force on the tip, the drives held at a posture.

        Raises `InputError` if nothing holds it.
        """
        model, tilts = self.robot.model, self.robot.tilts
        held, still = model.chain(tilts).angles(model.posture(posture)), np.zeros(self.play.size)
        there = held
        for _ in range(_STEPS):
            asked = self.asked(there, still, still, force) + self.fed(there[model.chain(tilts).driven]) - self.fed(posture)
            before, there = there, held - self.twist(asked)
            if np.max(np.abs(there - before)) < _RESTING:
                return there
        raise InputError("force", np.asarray(force).tolist(), "one that the springs hold [N]")

    def along(self, held: FloatArray, force: FloatArray, step: float) -> FloatArray:
        """Return all angles while the drives are held along a motion that begins at rest, shape (t, n) [rad].

        The average acceleration [newmark1959] on the arm's whole equations, play and all.

        `held` [rad], shape (t, j): of the drives
        `force` [N], shape (t, 3): on the tip, in the base's axes
        `step` [s]
        Raises `InputError` if no masses are known, or an instant has no solution: a motion or a force that the springs do not follow.
        """
        positive("step", step, "s")
        if not self.robot.model.weighed:
            raise InputError("link masses", "nothing", "mass, centre and inertia of the links: without them nothing moves")
        chain = self.robot.model.chain(self.robot.tilts)
        held, force = np.asarray(held, dtype=float), np.ascontiguousarray(force, dtype=float)
        if held.ndim != 2 or held.shape[1] != chain.driven.size or force.shape != (len(held), 3):
            raise InputError("motion", f"{held.shape} and {force.shape}", f"(t, {chain.driven.size}) angles and (t, 3) forces")
        full = np.zeros((len(held), chain.mass.size))
        full[:, chain.driven] = held
        rate = np.gradient(full, step, axis=0) if len(held) > 1 else np.zeros_like(full)
        compensated = any(joint.gravity_compensated for joint in self.robot.model.joints)
        fed = np.array([self.fed(each) for each in held]) if compensated and self.weight else np.zeros_like(full)
        out = np.empty_like(full)
        out[0] = self.at_rest(held[0], force[0])
        done = _kernels.march(chain, self.play, self.gravity, self.point, fed, force, full, rate, step, out)
        if done < len(held):
            raise InputError("motion", f"no solution at {done * step:.4g} s", "one that the springs follow")
        return out
