"""Stiffness of a robot's joints from encoders on both sides of the gears and the motors' torques while it moves.

What the two encoders differ by is the spring's twist, and three things that look like it: both are read at different times, which is a
twist that grows with the speed; the gear loses motion where it turns; and an encoder that sits off its centre errs with the angle. The
motor's torque is what bends the spring, and the friction in front of it. So neither is regressed on the other plainly: the torque is first
projected on what a motion can ask of the joint at all, torques of masses somewhere on the links, where friction and noise have no part
(two-stage least squares).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.signal import savgol_filter

from rcsa_ident.base.arrays import FloatArray
from rcsa_ident.base.errors import InputError
from rcsa_ident.machine.robot._kernels import point_torques
from rcsa_ident.machine.robot.kinematics import posed
from rcsa_ident.machine.robot.model import RobotModel

#: Window and order of the polynomial that gives speed and acceleration [s], and the speed at which friction has turned [rad/s].
_WINDOW, _ORDER, _TURNED = 0.1, 3, 3e-3
#: Residuals farther apart than this are independent [s].
_BLOCK = 0.5
#: Standard deviations of what is believed before: compliance as a share of the file's, lost motion and encoder errors [rad], and how far
#: the delays of two joints may differ [s].
_COMPLIANCE, _LOST, _ECCENTRIC, _DELAYS = 1.0, 5e-5, 1e-4, 3e-5
#: Motor and joint that differ by more [rad] are not on both sides of one gear: drives of a wrist turn several joints.
_COUPLED = 0.02
#: A compliance below so many standard deviations is not told apart from a rigid joint.
_TOLD = 2.0
#: A point of the tool beside the flange, along its z [m]: its mass turns where the flange's own does not.
_BEYOND = 0.3


@dataclass(frozen=True, slots=True, eq=False)
class JointRecord:
    """A motion.

    `step` [s]
    `motor` [rad], shape (j, n): motors' angles over the gear ratios
    `joint` [rad], shape (j, n): angles of the links
    `torque` [N m], shape (j, n): motors' torques times the gear ratios
    `motor_inertia` [kg m^2], shape (j,): times the squares of the gear ratios
    """

    name: str
    step: float
    motor: FloatArray
    joint: FloatArray
    torque: FloatArray
    motor_inertia: FloatArray

    def __post_init__(self) -> None:
        shape = self.motor.shape
        if self.joint.shape != shape or self.torque.shape != shape or len(shape) != 2:
            raise InputError(f"record {self.name}", f"{shape}, {self.joint.shape}, {self.torque.shape}", "angles and torques of one shape")
        if not self.step > 0.0 or shape[1] * self.step < 4.0 * _BLOCK:
            raise InputError(f"record {self.name}", f"{shape[1]} samples {self.step:g} s apart", f"at least {4.0 * _BLOCK:g} s")
        for field, values in (("motor", self.motor), ("joint", self.joint), ("torque", self.torque)):
            if not np.all(np.isfinite(values)):
                raise InputError(f"record {self.name}", f"{field}: values that are not finite", "finite values")


@dataclass(frozen=True, slots=True, eq=False)
class JointFit:
    """What is known of the joints afterwards; NaN where a joint could not be fitted.

    `stiffness` [N m/rad], shape (j,)
    `stiffness_share` [-], shape (j,): standard deviation as a share
    `told`: array of bool, shape (j,); whether the records tell the compliance from none
    `lost_motion` [rad], shape (j,): half of what a link stays behind its motor when the speed turns
    `coulomb`, `viscous` [N m, N m s/rad], shape (j,): friction in front of the spring
    `delay`, `delay_spread` [s]: how much later the joints' encoders are read
    `weights`, shape (j, 6): twist over torque, turn of the speed, speed, one, sine and cosine of the angle: what `explained` predicts with
    """

    stiffness: FloatArray
    stiffness_share: FloatArray
    told: np.ndarray
    lost_motion: FloatArray
    coulomb: FloatArray
    viscous: FloatArray
    delay: float
    delay_spread: float
    weights: FloatArray

    def explained(self, record: JointRecord) -> FloatArray:
        """Return the share of the variance of the motor-minus-joint angle that the fit explains in a record, shape (j,)."""
        found = np.full(len(self.weights), np.nan)
        motion = _Motion.of(record)
        for i in np.flatnonzero(np.isfinite(self.weights[:, 0])).tolist():
            twist = motion.twist[i]
            rest = twist - motion.columns(i) @ self.weights[i]
            found[i] = 1.0 - np.var(rest) / np.var(twist)
        return found


def fit_joints(robot: RobotModel, records: Sequence[JointRecord]) -> JointFit:
    """Return the joints' stiffnesses from motions.

    `robot`: its stiffnesses are believed to their own size; of its links the lengths count, not the masses
    Raises `InputError` if a record has another number of joints, or no joint can be fitted.
    """
    count = len(robot.joints)
    for record in records:
        if len(record.motor) != count:
            raise InputError(f"record {record.name}", f"{len(record.motor)} joints", f"{count}, as the robot has")
    motions = [_Motion.of(record) for record in records]
    asked = [_asked(robot, motion) for motion in motions]
    usable = [i for i in range(count) if max(np.std(m.twist[i]) for m in motions) < _COUPLED]
    stages = {i: stage for i in usable if (stage := _two_stages(motions, asked, i)) is not None}
    if not stages:
        raise InputError("records", "no joint whose motor and link stand on both sides of one gear", "motions of joints with two encoders")
    return _posterior(robot, stages)


@dataclass(frozen=True, slots=True, eq=False)
class _Motion:
    """A record with its speeds; the motors' own inertia is taken out of their torques."""

    record: JointRecord
    twist: FloatArray
    rate: FloatArray
    acceleration: FloatArray
    torque: FloatArray

    @classmethod
    def of(cls, record: JointRecord) -> _Motion:
        window = max(2 * int(0.5 * _WINDOW / record.step) + 1, _ORDER + 2)
        window += 1 - window % 2
        rate, acceleration = (savgol_filter(record.motor, window, _ORDER, deriv, record.step, axis=1) for deriv in (1, 2))
        torque = record.torque - record.motor_inertia[:, None] * acceleration
        return cls(record, record.motor - record.joint, rate, acceleration, torque)

    def columns(self, i: int) -> FloatArray:
        """What the twist of a joint may follow, shape (n, 6): torque, turn, speed, one, sine and cosine of the angle."""
        rate, angle = self.rate[i], self.record.motor[i]
        return np.stack([self.torque[i], np.tanh(rate / _TURNED), rate, np.ones_like(rate), np.sin(angle), np.cos(angle)], axis=1)


@dataclass(frozen=True, slots=True, eq=False)
class _Stage:
    """Two-stage least squares of a joint: weights of `_Motion.columns`, their covariance, and the friction in the torque."""

    weights: FloatArray
    covariance: FloatArray
    coulomb: float
    viscous: float


def _asked(robot: RobotModel, motion: _Motion) -> FloatArray:
    """Torques that a unit mass at each link's end, at the flange and beyond it asks for along a motion, shape (p, j, n)."""
    chain = posed(robot, np.zeros(len(robot.joints))).chain
    count = len(robot.joints)
    link = np.array([*range(count), count - 1])
    ends = [*(joint.frame.offset for joint in robot.joints[1:]), robot.flange.offset]
    place = np.array([*ends, robot.flange.offset + _BEYOND * robot.flange.turn[:, 2]])
    out = np.empty((link.size, count, motion.rate.shape[1]))
    angle, rate, acceleration = (np.ascontiguousarray(each.T) for each in (motion.record.motor, motion.rate, motion.acceleration))
    point_torques(chain.turn, chain.offset, chain.axis, angle, rate, acceleration, robot.gravity, link, place, out)
    return out


def _two_stages(motions: Sequence[_Motion], asked: Sequence[FloatArray], i: int) -> _Stage | None:
    columns, twist = np.concatenate([m.columns(i) for m in motions]), np.concatenate([m.twist[i] for m in motions])
    instruments = np.concatenate([each[:, i].T for each in asked])
    if np.ptp(columns[:, 2]) < _TURNED:
        return None
    outside = columns[:, 1:]
    both = np.hstack([outside, instruments])
    size = np.sqrt(np.mean(both**2, axis=0))
    both = both / np.where(size > 0.0, size, 1.0)
    left, values, right = np.linalg.svd(both, full_matrices=False)
    kept = values > 1e-3 * values[0]
    left, values, right = left[:, kept], values[kept], right[kept]
    # the torque's friction part, in the units of the columns
    first = right.T @ ((left.T @ columns[:, 0]) / values) / np.where(size > 0.0, size, 1.0)
    projected = left @ (left.T @ columns)
    scale = np.sqrt(np.mean(projected**2, axis=0))
    normal = (projected / scale).T @ (projected / scale)
    # the encoder's error is shrunk as if every sample erred by what the whole twist varies, and the covariance holds what is believed of
    # it: weighed by the rest alone it takes up what the friction model lacks, and bands came out several times too narrow on virtual arms
    believed = np.zeros(6)
    believed[4:] = 1.0
    spread = np.std(twist) ** 2 / (_ECCENTRIC * scale) ** 2
    inverse = np.linalg.inv(normal + np.diag(believed * spread))
    weights = inverse @ ((projected / scale).T @ twist) / scale
    rest = twist - columns @ weights
    blocks, first_row = [], 0
    for motion in motions:
        width = max(int(_BLOCK / motion.record.step), 1)
        last = first_row + motion.twist.shape[1]
        blocks += [slice(k, min(k + width, last)) for k in range(first_row, last, width)]
        first_row = last
    sums = np.array([(projected[each] / scale).T @ rest[each] for each in blocks])
    covariance = inverse @ (sums.T @ sums + np.diag(believed * spread**2 * (_ECCENTRIC * scale) ** 2)) @ inverse / np.outer(scale, scale)
    return _Stage(weights, covariance, float(first[0]), float(first[1]))


def _posterior(robot: RobotModel, stages: dict[int, _Stage]) -> JointFit:
    """Believed compliances and lost motions, and one delay for all joints, with what each joint's motion tells."""
    joints, count = list(stages), len(robot.joints)
    n = 6 * len(joints) + 1
    information, right = np.zeros((n, n)), np.zeros(n)
    for k, i in enumerate(joints):
        stage, own = stages[i], slice(6 * k, 6 * k + 6)
        precise = np.linalg.inv(stage.covariance)
        information[own, own] += precise
        right[own] += precise @ stage.weights
        compliance = 1.0 / robot.joints[i].stiffness
        # the column of the torque holds friction, too: what speed and its turn do beside the spring is theirs less its part
        rows = np.zeros((3, n))
        rows[0, 6 * k] = 1.0
        rows[1, [6 * k + 1, 6 * k]] = 1.0, stage.coulomb
        rows[2, [6 * k + 2, 6 * k, n - 1]] = 1.0, stage.viscous, -1.0
        told = np.array([compliance, 0.0, 0.0])
        spread = np.array([_COMPLIANCE * compliance, _LOST, _DELAYS])
        information += (rows.T / spread**2) @ rows
        right += rows.T @ (told / spread**2)
    covariance = np.linalg.inv(information)
    found, deviation = covariance @ right, np.sqrt(np.diag(covariance))
    answer = {name: np.full(count, np.nan) for name in ("stiffness", "share", "lost", "coulomb", "viscous")}
    weights, told_joints = np.full((count, 6), np.nan), np.zeros(count, dtype=bool)
    for k, i in enumerate(joints):
        values, stage = found[6 * k : 6 * k + 6], stages[i]
        weights[i], told_joints[i] = values, values[0] > _TOLD * deviation[6 * k]
        if told_joints[i]:
            answer["stiffness"][i], answer["share"][i] = 1.0 / values[0], deviation[6 * k] / values[0]
        answer["lost"][i] = max(values[1] + stage.coulomb * values[0], 0.0)
        answer["coulomb"][i], answer["viscous"][i] = stage.coulomb, stage.viscous
    return JointFit(
        answer["stiffness"],
        answer["share"],
        told_joints,
        answer["lost"],
        answer["coulomb"],
        answer["viscous"],
        float(found[-1]),
        float(deviation[-1]),
        weights,
    )
