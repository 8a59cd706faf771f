"""Springs of an arm that is pushed while it stands, against one whose rest was found by virtual work and finite turns."""

from dataclasses import replace

import numpy as np
import pytest

from rcsa_ident.base.errors import InputError
from rcsa_ident.identification.arm.static import StaticTests, _parameters, fit_static
from rcsa_ident.machine.robot.compliance import static_compliance
from rcsa_ident.machine.robot.model import Body, Frame, Joint, RobotModel
from tests.fixtures import pushed_arm
from tests.fixtures.robots import robot

LEVELS = (500.0, 1000.0, 1500.0, -500.0, -1000.0, -1500.0)
#: Scatter of a laser tracker [m].
NOISE = 3e-5
TRUTH = robot("kr210")


@pytest.fixture(scope="module")
def exact():
    """Nine postures, forces up to 1500 N both ways along each axis, measured 50 mm beside the tool; no scatter yet."""
    point = np.array([0.27, 0.000455, 0.120735])
    return pushed_arm.pushed("A", TRUTH, pushed_arm.POSTURES, LEVELS, 0.0, 3, point)


def scattered(tests, noise, rng):
    """The tests with a scatter of the readings, and of each posture's zero."""
    _, group = np.unique(tests.angles, axis=0, return_inverse=True)
    zero = rng.normal(0.0, noise, (group.max() + 1, 3))[group.ravel()]
    return replace(tests, displacement=tests.displacement + rng.normal(0.0, noise, zero.shape) - zero)


def believed(rng):
    """The arm as its file has it: springs up to a factor of two off."""
    return TRUTH.with_springs(TRUTH.chain().stiffness * 2.0 ** rng.uniform(-1.0, 1.0, TRUTH.freedoms()))


@pytest.mark.slow
def test_springs_and_compliances_at_other_postures_within_their_bands(exact):
    rng, springs, compliances, errors = np.random.default_rng(8), [], [], []
    true = _parameters(TRUTH)
    for _ in range(6):
        tests = scattered(exact, NOISE, rng)
        found = fit_static(believed(rng), [tests])
        assert found.noise[0] == pytest.approx(NOISE, rel=0.15)
        assert np.isnan(found.noise[1])
        assert found.explained(tests) > 0.99
        springs.append((_parameters(found.robot) - true) / found.deviation)
        # what carries most is told by itself
        assert np.all(found.told[[0, 1, 2, 3, 6, 7]])
        for posture in rng.uniform(*np.radians([[-90, -30, -60, -180, -100, -180], [90, 60, 70, 180, 100, 180]]), (20, 6)):
            ours, theirs = (static_compliance(arm, posture)[:3, :3] for arm in (found.robot, TRUTH))
            compliances.append(((ours - theirs) / found.compliance_deviation(posture)[:3, :3])[np.triu_indices(3)])
            errors.append(np.linalg.norm(ours - theirs) / np.linalg.norm(theirs))
    springs, compliances = np.array(springs), np.array(compliances)
    for each in (springs, compliances):
        assert np.mean(np.abs(each) < 1.0) > 0.62
        assert np.mean(np.abs(each) < 2.0) > 0.93
    # bands are no wider than they must be
    assert np.sqrt(np.mean(compliances**2)) > 0.5
    assert np.median(errors) < 0.01
    assert np.max(errors) < 0.05


@pytest.mark.parametrize("noise", [2e-5, 6e-5, 2e-4])
def test_scatter_of_readings_and_zeros_is_learnt(exact, noise):
    """Below, at and above what is believed; a zero scatters as a reading does, and by the play that nothing holds.

    What weight and force stiffen, some 8 µm here, is taken for scatter.
    """
    found = fit_static(TRUTH, [scattered(exact, noise, np.random.default_rng(4))])
    assert found.noise[0] == pytest.approx(noise, rel=0.15)
    assert 0.5 < found.zero * noise / np.hypot(noise, 4e-5) < 2.0


def test_what_weight_and_force_stiffen_is_small():
    """A kilonewton on an arm of 1.2 t that has no play: what is left out leaves compliances within two thousandths."""
    tight = replace(TRUTH, joints=tuple(replace(j, backlash=0.0) for j in TRUTH.joints))
    tests = pushed_arm.pushed("A", tight, pushed_arm.POSTURES, (1000.0, -1000.0), 0.0, 5)
    found = fit_static(tight, [tests])
    assert found.explained(tests) > 1.0 - 1e-5
    for posture in pushed_arm.POSTURES:
        ours, theirs = (static_compliance(arm, posture)[:3, :3] for arm in (found.robot, tight))
        assert np.linalg.norm(ours - theirs) < 2e-3 * np.linalg.norm(theirs)


def test_play_is_told_apart_from_the_spring_by_levels_of_force(exact):
    tests = scattered(exact, NOISE, np.random.default_rng(9))
    every = fit_static(TRUTH, [tests])
    strongest = np.abs(tests.force).max(axis=1) > 1400.0
    one = fit_static(TRUTH, [replace(tests, **{n: getattr(tests, n)[strongest] for n in ("angles", "force", "displacement", "point")})])
    n, play = TRUTH.freedoms(), np.array([j.backlash for j in TRUTH.joints])
    doubts = every.deviation[n:], one.deviation[n:]
    assert np.all(np.abs(np.array([j.backlash for j in every.robot.joints]) - play) < 3.0 * doubts[0])
    # with one level the spring takes the play's place: the doubt about the first drive's stays what was believed, or grows with it
    assert doubts[0][0] < 0.2 * play[0]
    assert doubts[1][0] > 2.0 * doubts[0][0]
    assert one.share[0] > every.share[0]


def test_turns_and_moments_are_read_as_compliance_has_them():
    """An arm without weight or play: six displacements are the compliance times three forces and three moments."""
    light = replace(TRUTH, joints=tuple(replace(j, backlash=0.0, body=Body(0.0)) for j in TRUTH.joints))
    rng = np.random.default_rng(10)
    angles, force = np.repeat(pushed_arm.POSTURES, 6, axis=0), np.tile(1000.0 * np.diag([1.0, 1.0, 1.0, 0.5, 0.5, 0.5]), (9, 1))
    moved = np.array([static_compliance(light, q) @ f for q, f in zip(angles, force, strict=True)])
    scatter = np.repeat([2e-6, 5e-6], 3)
    found = fit_static(believed(rng), [StaticTests("six", angles, force, moved + rng.normal(0.0, scatter, moved.shape))])
    np.testing.assert_allclose(found.noise, [2e-6, 5e-6], rtol=0.3)
    carried = found.share < 0.05
    assert np.sum(carried) > 7
    np.testing.assert_allclose(found.robot.chain().stiffness[carried], light.chain().stiffness[carried], rtol=0.1)


def test_springs_of_which_only_a_sum_is_told_are_named_together():
    """Two joints about one axis, and a third that no force loads."""
    z, x = np.array([0.0, 0.0, 1.0]), np.array([1.0, 0.0, 0.0])
    joints = tuple(Joint(name, Frame(), axis, Body(0.0), stiffness=1e6) for name, axis in (("A", z), ("B", z), ("C", x)))
    arm = RobotModel("three", joints, flange=Frame(offset=np.array([1.0, 0.0, 0.0])))
    force, moved = np.zeros((6, 6)), np.zeros((6, 3))
    force[:, 1] = [100.0, 200.0, 300.0, -100.0, -200.0, -300.0]
    moved[:, 1] = 2e-6 * force[:, 1]
    found = fit_static(arm, [StaticTests("A", np.zeros((6, 3)), force, moved)])
    assert found.together == ((0, 1),)
    np.testing.assert_array_equal(found.told, False)
    compliance = 1.0 / found.robot.chain().stiffness
    assert compliance[0] + compliance[1] == pytest.approx(2e-6, rel=0.05)
    assert compliance[2] == pytest.approx(1e-6)
    assert found.share[2] == pytest.approx(1.0)


def test_bad_tests_are_named():
    angles, force, moved = np.zeros((2, 6)), np.ones((2, 6)), np.zeros((2, 3))
    with pytest.raises(InputError, match="tests A: found 5 joints, allowed is 6"):
        fit_static(TRUTH, [StaticTests("A", angles[:, :5], force, moved)])
    with pytest.raises(InputError, match="as many rows"):
        StaticTests("A", angles, force[:1], moved)
    with pytest.raises(InputError, match="six forces, three or six displacements"):
        StaticTests("A", angles, force, moved[:, :2])
    with pytest.raises(InputError, match="displacement: values that are not finite"):
        StaticTests("A", angles, force, moved * np.nan)
    with pytest.raises(InputError, match="forces that push the arm"):
        StaticTests("A", angles, 0.0 * force, moved)
