"""Postures at which measurements tell most of an arm: D-optimal designs.

What the readings at a posture q tell of the unknowns is F(q) = S^T Sigma^-1 S, S their slopes with the unknowns. Wanted are postures within
the joints' limits, the tool within a box, that make det(prior + sum of F(q)) largest: candidates are drawn, chosen and exchanged
(`experiment_design.d_optimal`), then each posture in turn is moved uphill while the others stay.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.optimize import minimize

from rcsa_ident.base.arrays import FloatArray
from rcsa_ident.base.errors import InputError, positive
from rcsa_ident.base.units import from_hz
from rcsa_ident.identification.arm.data import body_masses
from rcsa_ident.identification.arm.static import REPEATABILITY, StaticTests, expected_information
from rcsa_ident.identification.arm.unknowns import arm_priors
from rcsa_ident.identification.experiment_design import d_optimal
from rcsa_ident.machine.robot.compliance import twist_per_payload
from rcsa_ident.machine.robot.flexible import FlexibleRobot, modes_of
from rcsa_ident.machine.robot.inertia import gravity_torques
from rcsa_ident.machine.robot.kinematics import posed, tool_point_at
from rcsa_ident.machine.robot.model import RobotModel
from rcsa_ident.machine.robot.sensitivity import frequency_slopes, receptance_slopes

#: Scatter of a joint's encoder [rad], and of a natural frequency as a share; so many of these are heard.
ENCODER, FREQUENCY, MODES = 1e-6, 5e-3, 8
#: Lines of slow cuts [Hz], the share of each that nothing explains, their force in X and Y (its size does not matter), and how far in front
#: of the flange it acts [m].
CUT_LINES, CUT_NOISE, CUT_FORCE, CUT_TOOL = np.geomspace(15.0, 120.0, 20), 5e-3, np.array([0.5, 1.0j]), 0.17
#: Shares of the largest force with which each axis is pushed, one after the other: levels tell play and spring apart.
LEVELS = (0.5, 1.0, -0.5, -1.0)
#: Steps that bring a drawn posture's tool into the box, their damping [m], postures drawn for each that is wanted, and before giving up.
_STEPS, _DAMPING, _DRAWS, _FIRST = 40, 0.1, 20, 100
#: Candidates from which postures are moved uphill beside their own, shared among all, rounds, and the gain below which they end [nat].
_STARTS, _ROUNDS, _GAIN = 12, 4, 1e-3
#: How far a box may be left by rounding, of angles in a file, too [m].
_ROUNDED = 1e-5


@dataclass(frozen=True, slots=True, eq=False)
class Experiment:
    """What is measured at a posture, and about what.

    `prior`, shape (p, p): what is known before
    `information`: from a posture (j,) [rad] to what its readings tell, shape (p, p)
    """

    unknowns: tuple[str, ...]
    prior: FloatArray
    information: Callable[[FloatArray], FloatArray]


def static_tests(robot: RobotModel, force: float, noise: float = REPEATABILITY) -> Experiment:
    """Return static tests: forces along the base's axes, both ways and at two levels, and the displacement of the tool.

    Unknowns are the compliances of all freedoms and the plays of the drives, in units of what is believed of them.

    `force` [N]: the largest
    `noise` [m]: scatter of a reading
    """
    positive("force", force, "N")
    positive("noise", noise, "m")
    forces = np.array([[*(level * force * axis), 0.0, 0.0, 0.0] for axis in np.eye(3) for level in LEVELS])
    still = np.zeros((len(forces), 3))

    def information(posture: FloatArray) -> FloatArray:
        return expected_information(robot, StaticTests("planned", np.tile(posture, (len(forces), 1)), forces, still), noise)

    names = (*robot.spring_names(), *(f"play of {joint.name}" for joint in robot.joints))
    return Experiment(names, np.eye(len(names)), information)


def encoders_at_rest(robot: RobotModel, noise: float = ENCODER) -> Experiment:
    """Return readings of encoders on both sides of the gears while the arm's weight, payload and all, twists the drives.

    Unknowns are the drives' compliances, in units of the file's, to which they are believed.

    `noise` [rad]
    Raises `InputError` if no masses are known.
    """
    positive("encoder noise", noise, "rad")
    if not robot.weighed:
        raise InputError("link masses", "nothing", "mass, centre and inertia of the links: without them nothing twists the drives")
    stiffness = robot.chain(tilts=False).stiffness

    def information(posture: FloatArray) -> FloatArray:
        return np.diag((gravity_torques(robot, posture) / stiffness / noise) ** 2)

    return Experiment(robot.spring_names(tilts=False), np.eye(len(robot.joints)), information)


def natural_frequencies(robot: RobotModel, noise: float = FREQUENCY) -> Experiment:
    """Return taps on the standing arm that tell its lowest natural frequencies.

    Unknowns are the compliances of all freedoms, in units of the file's, to which they are believed.

    `noise`: scatter of a natural frequency as a share of it
    Raises `InputError` if no masses are known.
    """
    positive("frequency noise", noise, "share")
    arm, stiffness = FlexibleRobot(robot), robot.chain().stiffness

    def information(posture: FloatArray) -> FloatArray:
        omega, (stiffer, _) = modes_of(arm.at(posture))[0], frequency_slopes(arm, posture)
        slopes = (stiffer * stiffness / omega[:, None])[:MODES] / noise
        return slopes.T @ slopes

    # an arm without masses is refused here, and not only at the first posture
    information(np.zeros(len(robot.joints)))
    return Experiment(robot.spring_names(), np.eye(stiffness.size), information)


def stable_cuts(robot: RobotModel, noise: float = CUT_NOISE) -> Experiment:
    """Return slow stable cuts, as `identify_robot` takes them: the flange's motion along X and Y at lines of the arm's own band.

    Unknowns are compliances, logarithms of dampers and of the masses of links and payload, in units of what is believed of them
    (`arm_priors`). Forces are those of half an immersion, fed along the tool's x; faster cuts tell the spindle, wherever they are made.

    `noise`: share of each line that nothing explains
    Raises `InputError` if no masses are known.
    """
    positive("cut noise", noise, "share")
    priors, chain, arm = arm_priors(robot), robot.chain(), FlexibleRobot(robot)
    damping = np.exp(priors.centre[chain.stiffness.size : 2 * chain.stiffness.size])
    damped = FlexibleRobot(robot.with_springs(chain.stiffness, damping))
    size = np.concatenate([-chain.stiffness, damping, body_masses(robot)]) * priors.spread
    omega = from_hz(CUT_LINES)
    # a force at the tip is one at the flange and a moment about it
    pushed = np.kron(CUT_FORCE, [1.0, -CUT_TOOL, 0.0])[[0, 1, 3, 4, 2, 5]]

    def information(posture: FloatArray) -> FloatArray:
        moved = damped.at(posture).receptance(omega).values @ pushed
        slopes = receptance_slopes(damped, posture, omega)
        change = np.concatenate([slopes.stiffness, slopes.damping, slopes.mass]) @ pushed
        rows = (change[:, :, [0, 2]] * size[:, None, None] / (noise * np.abs(moved[:, [0, 2]]))).reshape(size.size, -1)
        return rows.real @ rows.real.T + rows.imag @ rows.imag.T

    # an arm without masses is refused here, and not only at the first posture
    arm.at(np.zeros(len(robot.joints)))
    bodies = (*(joint.name for joint in robot.joints), "payload")[: size.size - 2 * damping.size]
    names = robot.spring_names()
    unknowns = (
        *names,
        *(f"damper of {name}" for name in names),
        *(f"mass behind {name}" if name != "payload" else name for name in bodies),
    )
    return Experiment(unknowns, np.eye(size.size), information)


def payload_mass(robot: RobotModel, noise: float = ENCODER) -> Experiment:
    """Return readings of the same encoders that tell how much the payload weighs [kg], believed to its own size.

    `noise` [rad]
    Raises `InputError` if the robot carries none.
    """
    positive("encoder noise", noise, "rad")
    if robot.payload is None or robot.payload.mass <= 0.0:
        raise InputError("payload", "none", "a robot that carries one")

    def information(posture: FloatArray) -> FloatArray:
        return np.array([[np.sum((twist_per_payload(robot, posture) / noise) ** 2)]])

    return Experiment(("payload mass",), np.array([[robot.payload.mass**-2.0]]), information)


@dataclass(frozen=True, slots=True, eq=False)
class Reach:
    """Where an arm may be sent.

    `robot`: within its joints' limits; half a turn either way where a joint has none
    `box`: pair of arrays, shape (3,) [m], or None; lowest and highest place of the tool in the base's axes; None leaves it to the joints
    """

    robot: RobotModel
    box: tuple[FloatArray, FloatArray] | None = None

    def __post_init__(self) -> None:
        if self.box is not None and not np.all(np.asarray(self.box[0]) < np.asarray(self.box[1])):
            found = ", ".join(f"{1e3 * v:g}" for v in (*self.box[0], *self.box[1]))
            raise InputError("box", found, "a lowest corner, then a highest one [mm]")

    @property
    def limits(self) -> FloatArray:
        """Lowest and highest angle of each joint, shape (j, 2) [rad]."""
        limits = np.array([joint.limits for joint in self.robot.joints])
        return np.where(np.isfinite(limits), limits, np.pi * np.array([-1.0, 1.0]))

    def room(self, posture: FloatArray) -> FloatArray:
        """Return how far the tool is within each face of the box, shape (6,) [m], negative outside; empty without a box."""
        if self.box is None:
            return np.zeros(0)
        place = tool_point_at(self.robot, posture).offset
        return np.concatenate([place - self.box[0], self.box[1] - place])

    def holds(self, posture: FloatArray) -> bool:
        """Return whether the tool is in the box."""
        return bool(np.min(self.room(posture), initial=0.0) >= -_ROUNDED)

    def draw(self, count: int, rng: np.random.Generator) -> FloatArray:
        """Return postures all over the joints' limits whose tool is in the box, shape (count, j) [rad].

        Each is drawn, and stepped to a drawn place of the box by the joints that reach it with least turning.

        Raises `InputError` if the tool hardly ever gets there.
        """
        low, high = self.limits.T
        found: list[FloatArray] = []
        for drawn in range(_DRAWS * count):
            if len(found) == count:
                return np.array(found)
            if drawn == _FIRST and not found:
                break
            posture = rng.uniform(low, high)
            if self.box is not None:
                posture = self._stepped(posture, rng.uniform(*self.box), low, high)
            if np.min(self.room(posture), initial=0.0) >= 0.0:
                found.append(posture)
        raise InputError("box", f"{len(found)} of {drawn} drawn postures", "a box that the tool reaches within the joints' limits")

    def _stepped(self, posture: FloatArray, wanted: FloatArray, low: FloatArray, high: FloatArray) -> FloatArray:
        for _ in range(_STEPS):
            chain = posed(self.robot, posture)
            place = chain.flange.point(self.robot.tool_point.offset)
            motion, miss = chain.jacobian(place)[:3], wanted - place
            if np.linalg.norm(miss) < 1e-3:
                break
            step = motion.T @ np.linalg.solve(motion @ motion.T + _DAMPING**2 * np.eye(3), miss)
            posture = np.clip(posture + step, low, high)
        return posture


@dataclass(frozen=True, slots=True, eq=False)
class PlannedPostures:
    """Postures, the most telling first.

    `postures` [rad], shape (m, j)
    `information`, shape (m, p, p): what each tells
    `prior`, shape (p, p)
    """

    postures: FloatArray
    information: FloatArray
    prior: FloatArray

    @property
    def deviations(self) -> tuple[FloatArray, FloatArray]:
        """Standard deviations of the unknowns before and after, shape (p,) each."""
        both = (self.prior, self.prior + np.sum(self.information, axis=0))
        before, after = (np.sqrt(np.diag(np.linalg.inv(each))) for each in both)
        return before, after

    @property
    def gain(self) -> float:
        """How much is learnt of all unknowns together: by how much the logarithm of the posterior's volume falls [nat]."""
        return 0.5 * (_log_det(self.prior + np.sum(self.information, axis=0)) - _log_det(self.prior))


def best_of(experiment: Experiment, candidates: FloatArray, count: int) -> PlannedPostures:
    """Return the postures out of some, shape (k, j) [rad], that tell most together.

    Raises `InputError` if there are fewer than are wanted.
    """
    if not 1 <= count <= len(candidates):
        raise InputError("count", count, f"1 to {len(candidates)}, as many postures as there are to choose from")
    return _ordered(experiment, candidates, np.array([experiment.information(each) for each in candidates]), count)


def plan_postures(experiment: Experiment, reach: Reach, count: int, candidates: int, seed: int) -> PlannedPostures:
    """Return postures that tell most together, of all within reach: chosen among drawn ones, then each moved uphill in turn.

    `candidates`: postures that are drawn
    """
    if not 1 <= count <= candidates:
        raise InputError("count", count, f"1 to {candidates}, as many postures as are drawn")
    drawn = reach.draw(candidates, np.random.default_rng(seed))
    told = np.array([experiment.information(each) for each in drawn])
    chosen = d_optimal(list(told), count, experiment.prior)
    postures, information = drawn[chosen], told[chosen]
    for turn in range(_ROUNDS):
        gained = 0.0
        for k in range(count):
            base = experiment.prior + np.sum(information, axis=0) - information[k]
            before = _log_det(base + information[k])
            starts = [postures[k]]
            if turn == 0:
                # far hills, too: the best candidates beside what the others tell
                starts += list(drawn[np.argsort(-np.linalg.slogdet(base + told)[1])[: _STARTS // count]])
            best = max((_uphill(experiment, reach, base, start) for start in starts), key=lambda each: each[0])
            if best[0] > before:
                gained += best[0] - before
                postures[k], information[k] = best[1], experiment.information(best[1])
        if gained < _GAIN:
            break
    return _ordered(experiment, postures, information, count)


def _uphill(experiment: Experiment, reach: Reach, base: FloatArray, start: FloatArray) -> tuple[float, FloatArray]:
    """The posture to which one climbs, and its logarithm of the determinant; minus infinity where that is out of reach."""

    def falling(posture: FloatArray) -> float:
        return -_log_det(base + experiment.information(posture))

    inside = () if reach.box is None else ({"type": "ineq", "fun": reach.room},)
    low, high = reach.limits.T
    found = minimize(falling, start, method="SLSQP", bounds=reach.limits, constraints=inside, options={"maxiter": 200, "ftol": 1e-9})
    posture = np.clip(found.x, low, high)
    return (-falling(posture) if reach.holds(posture) else -np.inf), posture


def _ordered(experiment: Experiment, postures: FloatArray, information: FloatArray, count: int) -> PlannedPostures:
    order = d_optimal(list(information), count, experiment.prior)
    return PlannedPostures(postures[order], information[order], experiment.prior)


def _log_det(matrix: FloatArray) -> float:
    return float(np.linalg.slogdet(matrix)[1])
