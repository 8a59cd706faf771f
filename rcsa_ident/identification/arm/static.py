"""Stiffness of a robot's drives and of what tilts beside them, from how far known forces push it while its drives hold.

A test is a posture, a force at the tool and the displacement that follows:

    displacement = J_c (c tau + s side),  tau = J^T F

with the compliances c of all freedoms, and the play s of a drive: it lies on the side that the torque pushes it to, weight and force
together, and stays there until it is pushed to the other one. The displacement is counted from the side on which the weight alone holds
it. Where nothing holds it, it lies anywhere, and the zero of that posture's tests is off by as much: so, and because a zero is a reading
like any other, all tests of a posture share an offset whose size is learnt beside the noise. All is linear in c and s: what is known of
them is a normal distribution, of springs that only a sum is told of, too. What weight and force themselves stiffen is left out: two
thousandths of the displacement where a kilonewton pushes an arm of 1.2 t.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import lsq_linear, minimize
from scipy.sparse.csgraph import connected_components

from rcsa_ident.base.arrays import FloatArray
from rcsa_ident.base.errors import InputError
from rcsa_ident.machine.robot.compliance import PLAY_HELD
from rcsa_ident.machine.robot.inertia import gravity_torques
from rcsa_ident.machine.robot.kinematics import posed
from rcsa_ident.machine.robot.model import RobotModel
from rcsa_ident.machine.robot.sensitivity import compliance_slopes

#: Standard deviations of what is believed before: compliance as a share of the file's, and a play where the file has less [rad].
BELIEVED, PLAY = 1.0, 2e-5
#: Scatter of a robot's readings as measured [bauer2013], of places [m] and turns [rad], standard deviation of its logarithm, and of that
#: of the ratio of a zero's scatter to a reading's.
REPEATABILITY, TURNS, SCATTER, ZERO = 6e-5, 6e-5, 1.0, 0.7
#: How far the search for scatter goes from what is believed, in standard deviations: a micrometre to three millimetres.
_FARTHEST = (-4.0, 4.0)
#: No spring is stiffer than the file's by more.
_STIFFEST = 10.0
#: A compliance above so many standard deviations is told; others whose doubts go together are told together, if the tests tell of them.
_TOLD, _LEARNT, _TOGETHER = 2.0, 0.9, 0.5


@dataclass(frozen=True, slots=True, eq=False)
class StaticTests:
    """Forces on a robot that stands still, and how far it gives way.

    `angles` [rad], shape (t, j): in the order in which they were made; those with the same angles share the reading of the unloaded place
    `force` [N, N m], shape (t, 6): at the tool's place, in the base's axes: forces, then moments
    `displacement`: array, shape (t, 3) or (t, 6) [m, rad]; of the measured point from where it is unloaded, in the base's axes; turns where
        they are measured
    `point` [m], shape (t, 3): the measured point in the robot's flange; None is the tool's place
    Raises `InputError` if shapes differ, a number is not finite or nothing pushes.
    """

    name: str
    angles: FloatArray
    force: FloatArray
    displacement: FloatArray
    point: FloatArray | None = None

    def __post_init__(self) -> None:
        count = len(self.angles)
        given = [("angles", self.angles), ("force", self.force), ("displacement", self.displacement)]
        given += [] if self.point is None else [("point", self.point)]
        if any(len(values) != count or values.ndim != 2 for _, values in given):
            found = ", ".join(str(values.shape) for _, values in given)
            raise InputError(f"tests {self.name}", found, "as many rows of each")
        if self.force.shape[1] != 6 or self.displacement.shape[1] not in (3, 6):
            raise InputError(
                f"tests {self.name}", f"{self.force.shape}, {self.displacement.shape}", "six forces, three or six displacements"
            )
        for field, values in given:
            if not np.all(np.isfinite(values)):
                raise InputError(f"tests {self.name}", f"{field}: values that are not finite", "finite values")
        if not np.any(self.force):
            raise InputError(f"tests {self.name}", "no force", "forces that push the arm")


@dataclass(frozen=True, eq=False)
class StaticFit:
    """What static tests tell of an arm.

    `robot`: with the springs and plays that were found
    `covariance`, shape (n + j, n + j): of the compliances of all freedoms, in the order of the chain [rad/(N m)], and of the drives' plays
        [rad]
    `believed`, shape (n + j,): standard deviations before the tests
    `noise`: tuple of two floats [m, rad]; learnt scatter of the readings, of places and of turns; NaN where no turn was measured
    `zero`: scatter of a posture's zero over that of a reading
    """

    robot: RobotModel
    covariance: FloatArray
    believed: FloatArray
    noise: tuple[float, float]
    zero: float

    @property
    def deviation(self) -> FloatArray:
        """Standard deviation of each compliance and play, shape (n + j,)."""
        return np.sqrt(np.diag(self.covariance))

    @property
    def share(self) -> FloatArray:
        """Standard deviation of each compliance as a share of it, shape (n,)."""
        return self.deviation[: self.robot.freedoms()] * self.robot.chain().stiffness

    @property
    def told(self) -> np.ndarray:
        """Whether the tests tell a spring by itself from a rigid one, shape (n,)."""
        return self.share < 1.0 / _TOLD

    @property
    def together(self) -> tuple[tuple[int, ...], ...]:
        """Springs that only a sum is told of: those not told whose doubts go together, and of which the tests tell anything at all."""
        n, deviation = self.robot.freedoms(), self.deviation
        correlation = (self.covariance / np.outer(deviation, deviation))[:n, :n]
        doubtful = np.flatnonzero(~self.told & (deviation[:n] < _LEARNT * self.believed[:n]))
        _, label = connected_components(np.abs(correlation[np.ix_(doubtful, doubtful)]) > _TOGETHER, directed=False)
        groups = [tuple(doubtful[label == each].tolist()) for each in np.unique(label)]
        return tuple(group for group in groups if len(group) > 1)

    def compliance_deviation(self, angles: FloatArray) -> FloatArray:
        """Return the standard deviation of each entry of `static_compliance` at a posture, shape (6, 6)."""
        n, stiffness = self.robot.freedoms(), self.robot.chain().stiffness
        slopes = compliance_slopes(self.robot, angles) * stiffness[:, None, None] ** 2
        return np.sqrt(np.einsum("iab,ij,jab->ab", slopes, self.covariance[:n, :n], slopes))

    def explained(self, tests: StaticTests) -> float:
        """Return the share of the places' squared displacements that the fit explains in some tests."""
        there, found = tests.displacement[:, :3], _Pushed.of(self.robot, tests).slopes[:, :3] @ _parameters(self.robot)
        return 1.0 - float(np.sum((there - found) ** 2) / np.sum(there**2))


def fit_static(robot: RobotModel, tests: Sequence[StaticTests]) -> StaticFit:
    """Return the stiffnesses of all freedoms, drives and tilts, and the drives' plays, from static tests.

    The file's compliances are believed to their own size. The scatter of the readings and of the zeros is the one under which the tests
    are most likely, whatever the springs are (the evidence).

    `robot`: its lengths and what weighs on its drives count; where it has no masses, play is taken as if no weight loaded it
    Raises `InputError` if tests have another number of joints.

    Examples
    --------
    A rod of 1 m that turns about the base's z, pushed across by up to 100 N:

    >>> import rcsa_ident.machine.robot.model as m
    >>> joint = m.Joint("J1", m.Frame(), np.array([0.0, 0.0, 1.0]), m.Body(0.0), stiffness=1e6)
    >>> arm = m.RobotModel("one", (joint,), flange=m.Frame(offset=np.array([1.0, 0.0, 0.0])))
    >>> force = np.zeros((8, 6))
    >>> force[:, 1] = 2500.0 * np.array([-4, -3, -2, -1, 1, 2, 3, 4])
    >>> moved = np.zeros((8, 3))
    >>> moved[:, 1] = force[:, 1] / 2e6
    >>> found = fit_static(arm, [StaticTests("A", np.zeros((8, 1)), force, moved)])
    >>> f"{found.robot.joints[0].stiffness:.2g}"
    '2e+06'
    """
    for each in tests:
        if each.angles.shape[1] != len(robot.joints):
            raise InputError(f"tests {each.name}", f"{each.angles.shape[1]} joints", f"{len(robot.joints)}, as the robot has")
    pushed = [_Pushed.of(robot, each) for each in tests]
    before, n = _parameters(robot), robot.freedoms()
    spread = _beliefs(before, n)
    # springs stay springs, and play is none where noise would have it less
    lowest = np.concatenate([before[:n] / _STIFFEST, np.zeros(before.size - n)])
    turns = any(each.displacement.shape[1] == 6 for each in tests)
    # a first step of half of what is believed: the method's own, a quarter of a thousandth, ends where it begins
    simplex = np.vstack([np.zeros(3 if turns else 2), 0.5 * np.eye(3 if turns else 2)])
    search = {"initial_simplex": simplex, "xatol": 0.01, "fatol": 0.01}
    scatter = minimize(
        _surprise, simplex[0], (pushed, before, spread), "Nelder-Mead", bounds=[_FARTHEST] * len(simplex[0]), options=search
    ).x
    _, normal, right = _normal(scatter, pushed, before, spread)
    factor = np.linalg.cholesky(normal)
    z = lsq_linear(factor.T, np.linalg.solve(factor, right), ((lowest - before) / spread, np.inf), method="bvls").x
    theta = before + spread * z
    arm = robot.with_springs(1.0 / theta[:n])
    joints = tuple(replace(j, backlash=float(s)) for j, s in zip(arm.joints, theta[n:], strict=True))
    noise, ratio = _scatter(scatter)
    covariance = np.linalg.inv(normal) * np.outer(spread, spread)
    told = float(noise[0]), float(noise[1]) if turns else np.nan
    return StaticFit(replace(arm, joints=joints), covariance, spread, told, ratio)


def expected_information(robot: RobotModel, tests: StaticTests, noise: float = REPEATABILITY, turns: float = TURNS) -> FloatArray:
    """Return what tests would tell of the compliances and plays, in units of what is believed of them, shape (n + j, n + j).

    `tests`: what their displacements are does not matter
    `noise`, `turns` [m, rad]: scatter of a reading of a place and of a turn; a zero's is the same
    """
    spread = _beliefs(_parameters(robot), robot.freedoms())
    _, slopes, _ = _Pushed.of(robot, tests).whitened(np.zeros_like(spread), np.array([noise, turns]), 1.0)
    slopes = slopes * spread
    return slopes.T @ slopes


def _beliefs(before: FloatArray, n: int) -> FloatArray:
    """Standard deviations before the tests, shape (n + j,)."""
    return np.concatenate([BELIEVED * before[:n], np.maximum(before[n:], PLAY)])


def _parameters(robot: RobotModel) -> FloatArray:
    """Compliances of all freedoms, then the drives' plays, shape (n + j,)."""
    return np.concatenate([1.0 / robot.chain().stiffness, [j.backlash for j in robot.joints]])


def _scatter(x: FloatArray) -> tuple[FloatArray, float]:
    """Standard deviations of a place's and a turn's reading [m, rad], and of a zero's over a reading's; from what is normal before."""
    return np.array([REPEATABILITY * np.exp(SCATTER * x[0]), TURNS * np.exp(SCATTER * x[-1])]), float(np.exp(ZERO * x[1]))


def _normal(x: FloatArray, pushed: Sequence[_Pushed], before: FloatArray, spread: FloatArray) -> tuple[float, FloatArray, FloatArray]:
    """Squares of the rests with half the logarithms of their variances, and normal equations, for unknowns in units of their beliefs."""
    noise, ratio = _scatter(x)
    value, normal, right = 0.5 * float(x @ x), np.eye(before.size), np.zeros(before.size)
    for each in pushed:
        rest, slopes, volume = each.whitened(before, noise, ratio)
        slopes = slopes * spread
        value += 0.5 * float(rest @ rest) + volume
        normal, right = normal + slopes.T @ slopes, right + slopes.T @ rest
    return value, normal, right


def _surprise(x: FloatArray, pushed: Sequence[_Pushed], before: FloatArray, spread: FloatArray) -> float:
    """Minus the logarithm of the evidence of a scatter."""
    value, normal, right = _normal(x, pushed, before, spread)
    return value - 0.5 * float(right @ np.linalg.solve(normal, right)) + 0.5 * float(np.linalg.slogdet(normal)[1])


@dataclass(frozen=True, slots=True, eq=False)
class _Pushed:
    """Displacements (t, w) of t tests, their slopes (t, w, n + j) with compliances and plays, and which tests share a posture's zero."""

    displacement: FloatArray
    slopes: FloatArray
    group: np.ndarray
    size: np.ndarray

    @classmethod
    def of(cls, robot: RobotModel, tests: StaticTests) -> _Pushed:
        postures, group, size = np.unique(tests.angles.round(9), axis=0, return_inverse=True, return_counts=True)
        group = group.ravel()
        n, driven, width = robot.freedoms(), robot.chain().driven, tests.displacement.shape[1]
        slopes = np.empty((len(group), width, n + driven.size))
        for g, posture in enumerate(postures):
            chain, weight = posed(robot, posture, True), gravity_torques(robot, posture, True)
            tool = chain.jacobian(chain.flange.point(robot.tool_point.offset))
            unloaded = lying = _side(-weight[driven], np.zeros(driven.size))
            for k in np.flatnonzero(group == g):
                seen = tool if tests.point is None else chain.jacobian(chain.flange.point(tests.point[k]))
                torque = tool.T @ tests.force[k]
                lying = _side((torque - weight)[driven], lying)
                slopes[k] = np.hstack([seen * torque, seen[:, driven] * (lying - unloaded)])[:width]
        return cls(tests.displacement, slopes, group, size)

    def whitened(self, theta: FloatArray, noise: FloatArray, ratio: float) -> tuple[FloatArray, FloatArray, float]:
        """Return rests (m,) and slopes (m, p) in standard deviations, and half the logarithm of their covariance's determinant.

        Of the covariance noise^2 (1 + ratio^2 1 1^T) of a posture's tests in one direction.
        """
        t, width = self.displacement.shape
        scale, common = np.repeat(noise, 3)[:width, None], 1.0 + self.size * ratio**2
        kept = (1.0 - 1.0 / np.sqrt(common))[self.group, None, None]
        rest = (self.displacement - self.slopes @ theta)[:, :, None]
        rest, slopes = ((each - kept * self._mean(each)) / scale for each in (rest, self.slopes))
        volume = t * float(np.sum(np.log(scale))) + 0.5 * width * float(np.sum(np.log(common)))
        return rest.ravel(), slopes.reshape(t * width, -1), volume

    def _mean(self, values: FloatArray) -> FloatArray:
        """The mean over a posture's tests, for each test."""
        total = np.zeros((self.size.size, *values.shape[1:]))
        np.add.at(total, self.group, values)
        return (total / self.size[:, None, None])[self.group]


def _side(torque: FloatArray, before: FloatArray) -> FloatArray:
    """Where plays lie: on the side where the torque holds them, else where they lay before."""
    return np.where(np.abs(torque) > PLAY_HELD, np.sign(torque), before)
