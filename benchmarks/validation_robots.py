"""Published arms: equations of motion, places, postures, modes, compliance, limits, compensation, the most telling posture."""

from __future__ import annotations

from dataclasses import replace
from functools import cache, partial

import numpy as np

from benchmarks.compensation import POSTURE, tight
from benchmarks.robot import GRAVITY, pinocchio
from benchmarks.validation_case import Case, Measure
from rcsa_ident.base.units import to_hz
from rcsa_ident.front.samples import sample_robot
from rcsa_ident.identification.arm.design import Reach, payload_mass, plan_postures
from rcsa_ident.machine.robot.compliance import sag, static_compliance
from rcsa_ident.machine.robot.flexible import FlexibleRobot, modes_of
from rcsa_ident.machine.robot.inertia import gravity_torques, mass_matrix, torques
from rcsa_ident.machine.robot.kinematics import flange_at, posed, postures_of, tool_point_at
from rcsa_ident.workflows.paths.robot_compensation import ahead_of_forces, mirrored_postures, reached
from tests.fixtures.robots import BENT, KR600, STRETCHED, TABLE_7
from tests.machine.robot import test_kinematics, test_posed_robot
from tests.oracles import multibody

#: What is told of others' arms: a program of its own, on the published data.
ANOTHER = "another program, arm of [huynh2018]"
#: Forces of a slot and across it [N].
SLOT, ACROSS = (np.array([[*f, 0.0, 0.0, 0.0]]) for f in ((-58.0, -130.0, 35.0), (0.0, 100.0, 0.0)))


@cache
def modes(name: str, posture: tuple[float, ...], tilts: bool, bare: bool = False) -> tuple[np.ndarray, np.ndarray]:
    """Natural frequencies [Hz] and damping ratios [%] of an arm at a posture."""
    arm = FlexibleRobot(sample_robot(name), tilts)
    at = np.array(posture)
    omega, ratio = modes_of(arm.bare(at) if bare else arm.at(at))
    return to_hz(omega), 100.0 * ratio


def frequencies(name: str, posture: np.ndarray, tilts: bool, count: int, bare: bool = False) -> np.ndarray:
    """The lowest natural frequencies [Hz]."""
    return modes(name, tuple(posture), tilts, bare)[0][:count]


def damping(tilts: bool, count: int) -> np.ndarray:
    """Damping ratios of the TX200 [%]."""
    return modes("tx200", tuple(TABLE_7), tilts)[1][:count]


def compliance(name: str, posture: np.ndarray, tilts: bool = True) -> np.ndarray:
    """Static compliance of the tool point along x, y, z [um/N]."""
    return 1e6 * static_compliance(sample_robot(name), posture, tilts)[:3, :3].diagonal()


def rows_and_table() -> np.ndarray:
    """How far the flange's place and axes of 1000 postures are from the printed rows of Denavit and Hartenberg."""
    arm, rng = sample_robot("tx200"), np.random.default_rng(1)
    worst = []
    for angles in rng.uniform(-np.pi, np.pi, (1000, 6)):
        ours = flange_at(arm, angles)
        theirs = test_kinematics.by_rows(angles + np.radians([0.0, -90.0, 90.0, 0.0, 0.0, 0.0]))
        worst.append(max(np.max(np.abs(ours.offset - theirs.offset)), np.max(np.abs(ours.turn - theirs.turn))))
    return np.array(worst)


def eight_postures() -> np.ndarray:
    """All postures of the printed pose, nearest first to the printed ones [deg]."""
    arm = sample_robot("tx200")
    found = np.degrees(postures_of(arm, flange_at(arm, TABLE_7), within_limits=False))
    return np.array([found[np.argmin(np.abs(found - each).max(axis=1))] for each in PRINTED])


#: Postures of the pose of table 7 [deg].
PRINTED = np.array(
    [
        (-11.71, 20.78, 147.86, 82.76, 60.80, -166.96),
        (-11.71, 20.78, 147.86, -97.24, -60.80, 13.04),
        (-11.71, 135.499, -147.86, 97.793, 119.069, 14.176),
        (-11.71, 135.499, -147.86, -82.207, -119.069, -165.824),
        (168.29, -132.395, 110.908, -101.246, 118.004, -24.508),
        (168.29, -132.395, 110.908, 78.754, -118.004, 155.492),
        (168.29, -35.681, -110.908, -108.224, 65.741, -142.848),
        (168.29, -35.681, -110.908, 71.776, -65.741, 37.152),
    ]
)


def limits(tilts: bool, name: str, times: int) -> list[float]:
    """Limits of the arm alone in three directions of the feed [mm]."""
    return [test_posed_robot.limit_of_the_tx200(tilts, name, times, feed) for feed in test_posed_robot.FEEDS]


@cache
def deviation(how: str, force: str) -> np.ndarray:
    """Where the KR210's tool stands beside its place under a force, as commanded or compensated [m]."""
    arm = FlexibleRobot(tight(sample_robot("kr210")))
    push, posture = {"slot": SLOT, "across": ACROSS}[force], POSTURE[None]
    commanded = {"as commanded": lambda: posture, "ahead": lambda: ahead_of_forces(arm, posture, push)}.get(
        how, lambda: mirrored_postures(arm, posture, push)
    )()
    return reached(arm, commanded, push)[0] - tool_point_at(arm.model, POSTURE).offset


def left(how: str) -> list[float]:
    """The largest component that compensation leaves of the slot's deviation [um]."""
    return [1e6 * float(np.max(np.abs(deviation(how, "slot"))))]


@cache
def told_of_the_payload() -> tuple[float, np.ndarray]:
    """What the best posture tells of the payload's mass, and where its tool is [m]."""
    arm = sample_robot("tx200")
    box = np.array([0.5, -1.0, 0.3]), np.array([1.6, 1.0, 1.8])
    found = plan_postures(payload_mass(arm), Reach(arm, box), 1, 200, 0)
    return float(found.information[0, 0, 0]), np.abs(tool_point_at(arm, found.postures[0]).offset)


def sinking(tilts: bool) -> np.ndarray:
    """How the tool sinks under the arm's weight where no drive makes up for it [um]."""
    arm = sample_robot("tx200")
    free = replace(arm, joints=tuple(replace(j, gravity_compensated=False) for j in arm.joints))
    return 1e6 * sag(free, TABLE_7, tilts=tilts)[:3]


@cache
def beside_pinocchio(what: int, ours: bool) -> np.ndarray:
    """Mass matrix or torques of 18 freedoms over their largest."""
    arm, rng = sample_robot("tx200"), np.random.default_rng(1)
    angles, rate = rng.uniform(-2.0, 2.0, (1, 18)), rng.uniform(-1.0, 1.0, 18)
    here, still = posed(arm, angles[0], True), np.zeros(18)
    value = pinocchio(arm.chain(True), angles, rate)[what][1]
    own = mass_matrix(here) if what == 0 else torques(here, rate, still, GRAVITY)
    return (own if ours else value) / np.max(np.abs(value))


def all_postures() -> np.ndarray:
    """How far the flange stands from where each of its postures brings it, 100 places of three arms [m]."""
    rng, worst = np.random.default_rng(2), []
    for name in ("tx200", "kr210", "kr500"):
        arm = sample_robot(name)
        for angles in rng.uniform(-np.pi, np.pi, (100, 6)):
            flange = flange_at(arm, angles)
            found = postures_of(arm, flange, within_limits=False)
            worst.append(max(np.max(np.abs(flange_at(arm, each).offset - flange.offset)) for each in found))
    return np.array(worst)


@cache
def arm_at(ours: bool) -> tuple[np.ndarray, np.ndarray]:
    """Mass matrix of all 18 freedoms and torques of the TX200, each over its largest."""
    arm, rng = sample_robot("tx200"), np.random.default_rng(3)
    every, plain = rng.uniform(-2.0, 2.0, 18), rng.uniform(-2.0, 2.0, (3, 6))
    gravity, still, tilting = np.array([0.3, -0.2, -9.7]), posed(arm, plain[0]), posed(arm, every, True)
    mass = multibody.kinetic_matrix(tilting.chain, every)
    torque = multibody.lagrange_torques(still.chain, *plain, gravity)
    if ours:
        return mass_matrix(tilting) / np.abs(mass).max(), torques(still, plain[1], plain[2], gravity) / np.abs(torque).max()
    return mass / np.abs(mass).max(), torque / np.abs(torque).max()


_FLEXIBLE, _KINEMATICS = "tests/machine/robot/test_flexible.py", "tests/machine/robot/test_kinematics.py"
_SPRINGS = {False: "drives alone", True: "with the springs across the axes"}
CASES = (
    Case(
        "inverse kinematics of three arms: the flange of every posture of 300 places",
        "the place that was asked for",
        np.zeros(300),
        all_postures,
        "m",
        1e-9,
        "tests/machine/robot/test_kinematics.py::test_all_postures_bring_the_flange_back",
        Measure.ABSOLUTE,
        slow=True,
    ),
    Case(
        "mass matrix of an arm with 18 freedoms",
        "kinetic energy of its bodies by differences (tests/oracles/multibody.py)",
        lambda: arm_at(False)[0],
        lambda: arm_at(True)[0],
        "of the largest",
        1e-8,
        "tests/machine/robot/test_kernels.py::test_mass_matrix_is_the_sum_over_bodies",
        Measure.ABSOLUTE,
    ),
    Case(
        "torques of an arm on the move",
        "[featherstone2008]; Lagrange's equations by differences (tests/oracles/multibody.py)",
        lambda: arm_at(False)[1],
        lambda: arm_at(True)[1],
        "of the largest",
        2e-5,
        "tests/machine/robot/test_kernels.py::test_torques_are_those_of_lagrange",
        Measure.ABSOLUTE,
    ),
    Case(
        "TX200: place and axes of the flange at 1000 postures, both printed tables of its dimensions",
        "[huynh2018], tables 1 and 2",
        np.zeros(1000),
        rows_and_table,
        "m, –",
        1e-12,
        f"{_KINEMATICS}::test_both_printed_tables_of_the_tx200_say_the_same",
        Measure.ABSOLUTE,
    ),
    Case(
        "TX200 at the posture of table 7: tool point",
        ANOTHER,
        [0.79399, 0.18472, 0.31632],
        lambda: tool_point_at(sample_robot("tx200"), TABLE_7).offset,
        "m",
        5e-6,
        f"{_KINEMATICS}::test_the_printed_posture_holds_the_tool_upright",
        Measure.ABSOLUTE,
    ),
    Case(
        "TX200: all eight postures of that pose",
        ANOTHER,
        PRINTED,
        eight_postures,
        "deg",
        1e-3,
        f"{_KINEMATICS}::test_eight_postures_of_the_printed_pose",
        Measure.ABSOLUTE,
    ),
    Case(
        "KR500 stretched out: flange",
        "KUKA, data sheet of the KR 500 R2830",
        [3.115, 0.0, 0.990],
        lambda: flange_at(sample_robot("kr500"), np.zeros(6)).offset,
        "m",
        1e-12,
        f"{_KINEMATICS}::test_the_kr500_stretches_as_its_data_sheet_says",
        Measure.ABSOLUTE,
    ),
    *(
        Case(
            f"TX200 at table 7: natural frequencies, {_SPRINGS[tilts]}",
            ANOTHER,
            values,
            partial(frequencies, "tx200", TABLE_7, tilts, len(values)),
            "Hz",
            1e-4,
            f"{_FLEXIBLE}::test_natural_frequencies_of_the_tx200",
        )
        for tilts, values in (
            (False, [15.768, 25.056, 27.720, 33.561, 92.587, 138.708]),
            (True, [11.754, 13.651, 22.228, 23.584, 34.867, 55.334, 71.470, 85.669, 94.367, 134.740, 152.284, 210.36]),
        )
    ),
    *(
        Case(
            f"TX200 at table 7: damping ratios, {_SPRINGS[tilts]}",
            ANOTHER,
            values,
            partial(damping, tilts, len(values)),
            "%",
            allowed,
            f"{_FLEXIBLE}::test_natural_frequencies_of_the_tx200",
        )
        for tilts, values, allowed in (
            (False, [0.97, 1.74, 1.78, 5.14, 11.6, 42.6], 5e-3),
            (True, [0.72, 0.80, 1.68, 1.99, 4.48, 4.21, 4.81, 7.72], 1e-2),
        )
    ),
    *(
        Case(
            f"TX200 without its spindle: natural frequencies, {_SPRINGS[tilts]}",
            ANOTHER,
            values,
            partial(frequencies, "tx200", TABLE_7, tilts, 6, True),
            "Hz",
            1e-4,
            f"{_FLEXIBLE}::test_natural_frequencies_without_the_spindle",
        )
        for tilts, values in (
            (False, [17.194, 29.135, 48.604, 175.85, 216.71, 1332.1]),
            (True, [12.170, 14.139, 31.041, 43.450, 65.389, 73.616]),
        )
    ),
    *(
        Case(
            f"TX200 at table 7: compliance along x, y, z, {_SPRINGS[tilts]}",
            ANOTHER,
            values,
            partial(compliance, "tx200", TABLE_7, tilts),
            "µm/N",
            6e-4,
            f"{_FLEXIBLE}::test_static_compliance",
            Measure.ABSOLUTE,
        )
        for tilts, values in ((False, [1.602, 1.216, 0.567]), (True, [1.908, 1.821, 0.737]))
    ),
    Case(
        "TX200: dampers over roots of the springs",
        "[huynh2018], table of the joints: the same for all six",
        [0.2690] * 6,
        lambda: [j.damping / np.sqrt(j.stiffness) for j in sample_robot("tx200").joints],
        "N m s/rad per √(N m/rad)",
        2e-4,
        f"{_FLEXIBLE}::test_damping_of_the_tx200_goes_with_the_root_of_the_stiffness",
        Measure.ABSOLUTE,
    ),
    Case(
        "TX200 at table 7: torques that hold its weight, axes 2 to 5",
        ANOTHER,
        [-1112.42, -80.73, 28.14, 138.99],
        lambda: gravity_torques(sample_robot("tx200"), TABLE_7)[1:5],
        "N m",
        6e-3,
        f"{_FLEXIBLE}::test_sag_and_gravity",
        Measure.ABSOLUTE,
    ),
    *(
        Case(
            f"TX200 at table 7: how its tool sinks, {_SPRINGS[tilts]}",
            ANOTHER,
            values,
            partial(sinking, tilts),
            "µm",
            0.6,
            f"{_FLEXIBLE}::test_sag_and_gravity",
            Measure.ABSOLUTE,
        )
        for tilts, values in ((False, [-110.0, -252.0, -312.0]), (True, [-137.0, -209.0, -809.0]))
    ),
    *(
        Case(
            f"TX200 alone, {name}{', joints damped ten times' if times == 10 else ''}, {_SPRINGS[tilts]}: limits of three feeds",
            ANOTHER + ", 40 steps a tooth",
            list(values.values()),
            partial(limits, tilts, name, times),
            "mm",
            3e-2,
            "tests/machine/robot/test_posed_robot.py::test_limits_of_the_tx200",
            slow=True,
        )
        for (tilts, name, times), values in test_posed_robot.LIMITS.items()
    ),
    Case(
        "TX200: what the best posture in a box tells of its payload's mass",
        f"{ANOTHER}, by an interior-point method",
        291.97,
        lambda: told_of_the_payload()[0],
        "(10⁶ rad/kg)²",
        2e-5,
        "tests/identification/arm/test_design.py::test_the_posture_that_tells_the_payloads_mass_best",
        slow=True,
    ),
    Case(
        "TX200: where its tool is there, left and right alike",
        f"{ANOTHER}, by an interior-point method",
        [1.6, 1.0, 1.13],
        lambda: told_of_the_payload()[1],
        "m",
        2e-3,
        "tests/identification/arm/test_design.py::test_the_posture_that_tells_the_payloads_mass_best",
        Measure.ABSOLUTE,
        slow=True,
    ),
    *(
        Case(
            f"TX200 with 18 freedoms: {what}",
            "Pinocchio 4.1.0",
            partial(beside_pinocchio, k, False),
            partial(beside_pinocchio, k, True),
            "of the largest",
            1e-11,
            "python -m benchmarks robot",
            Measure.ABSOLUTE,
            needs="pinocchio",
        )
        for k, what in enumerate(("mass matrix", "torques on the move"))
    ),
    Case(
        "KR210, bent: eight natural frequencies",
        "another program, arm of [bauer2013]",
        [9.31, 10.99, 17.59, 18.77, 34.9, 45.7, 55.6, 56.3],
        partial(frequencies, "kr210", BENT, True, 8),
        "Hz",
        1.5e-3,
        f"{_FLEXIBLE}::test_natural_frequencies_of_the_kr210",
    ),
    Case(
        "KR210, bent: first four natural frequencies beside measured ones, whose posture is not published",
        "[bauer2013], table 11.1, measured",
        [8.4, 11.1, 16.9, 20.6],
        partial(frequencies, "kr210", BENT, True, 4),
        "Hz",
        0.12,
        f"{_FLEXIBLE}::test_natural_frequencies_of_the_kr210",
    ),
    Case(
        "KR210 stretched out: compliance along x, y, z",
        "another program, arm of [bauer2013]",
        [0.83, 2.73, 0.75],
        partial(compliance, "kr210", STRETCHED),
        "µm/N",
        6e-3,
        f"{_FLEXIBLE}::test_static_compliance",
        Measure.ABSOLUTE,
    ),
    Case(
        "KR210 stretched out: what 100 N across move, the posture is not published",
        "[bauer2013], the text: 0.25 mm, measured",
        0.25,
        lambda: 0.1 * compliance("kr210", STRETCHED)[1],
        "mm",
        0.12,
        f"{_FLEXIBLE}::test_static_compliance",
    ),
    Case(
        "KR210 under the forces of a slot: deviation",
        "another program, arm and forces of [bauer2013]",
        [-0.025, -0.387, 0.009],
        lambda: 1e3 * deviation("as commanded", "slot"),
        "mm",
        6e-4,
        "tests/toolpath/test_compensation.py::test_deviation_of_the_kr210_and_what_compensation_leaves_of_it",
        Measure.ABSOLUTE,
    ),
    *(
        Case(
            f"KR210 under these forces: what compensation leaves, {what}",
            "another program, arm and method of [bauer2013]",
            value,
            partial(left, how),
            "µm",
            0.0,
            "tests/toolpath/test_compensation.py::test_deviation_of_the_kr210_and_what_compensation_leaves_of_it",
            Measure.AT_MOST,
        )
        for how, what, value in (("ahead", "ahead of the force", 0.011), ("mirrored", "mirrored once", 0.05))
    ),
    Case(
        "KR210: deviation under 100 N across",
        "another program, arm of [bauer2013]",
        0.298,
        lambda: 1e3 * float(np.linalg.norm(deviation("as commanded", "across"))),
        "mm",
        6e-4,
        "tests/toolpath/test_compensation.py::test_deviation_of_the_kr210_and_what_compensation_leaves_of_it",
        Measure.ABSOLUTE,
    ),
    Case(
        "KR600 at a milling posture: compliance along x, y, z at its flange",
        "another program, stiffness of [du2023]",
        [0.634, 0.196, 0.613],
        partial(compliance, "kr500", KR600),
        "µm/N",
        6e-4,
        f"{_FLEXIBLE}::test_static_compliance",
        Measure.ABSOLUTE,
    ),
)
