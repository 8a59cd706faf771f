"""Postures that tell most: a published optimum, brute force where that is possible, and what plans are worth beside chance."""

from dataclasses import replace
from itertools import combinations

import numpy as np
import pytest

from rcsa_ident.base.errors import InputError
from rcsa_ident.identification.arm.design import (
    CUT_LINES,
    CUT_NOISE,
    CUT_TOOL,
    LEVELS,
    PlannedPostures,
    Reach,
    best_of,
    encoders_at_rest,
    natural_frequencies,
    payload_mass,
    plan_postures,
    stable_cuts,
    static_tests,
)
from rcsa_ident.identification.arm.static import fit_static
from rcsa_ident.identification.arm.unknowns import arm_priors
from rcsa_ident.identification.experiment_design import d_optimal
from rcsa_ident.machine.robot.compliance import static_compliance
from rcsa_ident.machine.robot.flexible import FlexibleRobot, modes_of
from rcsa_ident.machine.robot.kinematics import tool_point_at
from tests.fixtures import pushed_arm
from tests.fixtures.robots import TABLE_7, robot

#: Where the tool of the TX200 may go in a published plan [m], and that of the KR210 here.
PUBLISHED = np.array([0.5, -1.0, 0.3]), np.array([1.6, 1.0, 1.8])
CELL = np.array([0.8, -1.2, 0.5]), np.array([2.2, 1.2, 2.2])


def test_the_posture_that_tells_the_payloads_mass_best():
    """Within the joints' limits and a box of the tool: the optimum that others found, by an interior-point method."""
    arm = robot("tx200")
    experiment = payload_mass(arm)
    assert experiment.information(TABLE_7)[0, 0] == pytest.approx(180.68, abs=5e-3)
    for seed in range(3):
        found = plan_postures(experiment, Reach(arm, PUBLISHED), 1, 200, seed)
        assert found.information[0, 0, 0] == pytest.approx(291.97, abs=5e-3)
        # left and right are alike
        np.testing.assert_allclose(np.abs(tool_point_at(arm, found.postures[0]).offset), [1.6, 1.0, 1.13], atol=2e-3)
        assert arm.beyond_limits(found.postures[0]) == ()


def test_exchange_finds_what_trying_all_finds():
    rng = np.random.default_rng(3)
    for size in (2, 3):
        rows = rng.normal(size=(9, size, 4)) * rng.uniform(0.2, 3.0, (9, 1, 1))
        told, prior = np.einsum("kri,krj->kij", rows, rows), np.diag([0.1, 1.0, 1.0, 4.0])
        every = {each: np.linalg.slogdet(prior + told[list(each)].sum(axis=0))[1] for each in combinations(range(9), 4)}
        best = max(every, key=every.get)
        assert tuple(sorted(d_optimal(list(told), 4, prior))) == best


def test_the_most_telling_comes_first():
    told = [np.diag([1.0, 0.0]), np.diag([9.0, 0.0]), np.diag([0.0, 4.0])]
    assert d_optimal(told, 2, np.eye(2)) == [1, 2]
    # what is known before counts
    assert d_optimal(told, 2, np.diag([1.0, 1e6])) == [1, 0]


@pytest.mark.parametrize("name", ["tx200", "kr210"])
def test_drawn_postures_are_within_reach(name):
    arm = robot(name)
    # a tenth of the tools drawn from the joints' limits would be here
    reach = Reach(arm, (np.array([1.0, -0.3, 0.8]), np.array([1.4, 0.3, 1.2])))
    drawn = reach.draw(60, np.random.default_rng(4))
    assert drawn.shape == (60, 6)
    for posture in drawn:
        assert np.min(reach.room(posture)) >= 0.0
        assert np.all((posture >= reach.limits[:, 0]) & (posture <= reach.limits[:, 1]))
    assert np.std(drawn, axis=0).min() > 0.15
    with pytest.raises(InputError, match="box that the tool reaches"):
        Reach(arm, (np.full(3, 5.0), np.full(3, 6.0))).draw(2, np.random.default_rng(5))


def test_what_tests_tell_is_what_a_fit_is_sure_of():
    """The fit's covariance is the plan's, where the scatter is the one that was planned with."""
    arm, noise = robot("kr210"), 3e-5
    postures = pushed_arm.POSTURES[:5]
    tests = pushed_arm.pushed("A", arm, postures, [1200.0 * level for level in LEVELS], noise, 6)
    experiment = static_tests(arm, 1200.0, noise)
    planned = best_of(experiment, postures, 5).deviations[1]
    found = fit_static(arm, [replace(tests, point=None)])
    np.testing.assert_allclose(found.deviation / found.believed, planned, rtol=0.35)


@pytest.mark.slow
def test_moving_on_gains_beside_the_best_of_those_drawn():
    arm = robot("kr210")
    experiment, reach = static_tests(arm, 1000.0), Reach(arm, CELL)
    moved = plan_postures(experiment, reach, 2, 60, 7)
    chosen = best_of(experiment, reach.draw(60, np.random.default_rng(7)), 2)
    assert moved.gain > chosen.gain + 0.2
    for posture in moved.postures:
        assert reach.holds(posture)
    before, after = moved.deviations
    np.testing.assert_array_equal(before, 1.0)
    assert np.all(after <= 1.0 + 1e-12)
    assert after[0] < 0.3
    same = plan_postures(experiment, reach, 2, 60, 7)
    np.testing.assert_array_equal(same.postures, moved.postures)


@pytest.mark.slow
def test_planned_postures_beside_drawn_ones():
    """Four postures of each, seed by seed: less is left open, and the compliance at other places is nearer the truth."""
    arm, noise, forces = robot("kr210"), 6e-5, [1000.0 * level for level in LEVELS]
    experiment, reach = static_tests(arm, 1000.0, noise), Reach(arm, CELL)
    ratios = []
    for seed in range(4):
        rng = np.random.default_rng(seed)
        drawn, others, errors = reach.draw(120, rng), reach.draw(20, rng), []
        plans = best_of(experiment, drawn, 4), best_of(experiment, drawn[:4], 4)
        assert plans[0].gain > plans[1].gain + 2.0
        exact = [pushed_arm.pushed("A", arm, plan.postures, forces, 0.0, seed) for plan in plans]
        for _ in range(8):
            start = arm.with_springs(arm.chain().stiffness * 2.0 ** rng.uniform(-1.0, 1.0, arm.freedoms()))
            scatter = rng.normal(0.0, noise, exact[0].displacement.shape)
            zero = np.repeat(rng.normal(0.0, noise, (4, 3)), 3 * len(LEVELS), axis=0)
            found = [fit_static(start, [replace(each, displacement=each.displacement + scatter - zero)]).robot for each in exact]
            off = [[relative(static_compliance(one, q), static_compliance(arm, q)) for q in others] for one in found]
            errors.append(np.mean(np.square(off), axis=1))
        planned, by_chance = np.sqrt(np.mean(errors, axis=0))
        ratios.append(planned / by_chance)
    assert max(ratios) < 1.0
    assert np.median(ratios) < 0.95


def relative(ours, theirs):
    """How far translations' compliances are apart, as a share."""
    return np.linalg.norm((ours - theirs)[:3, :3]) / np.linalg.norm(theirs[:3, :3])


def test_encoders_under_weight_tell_nothing_of_an_upright_axis():
    arm = robot("tx200")
    found = plan_postures(encoders_at_rest(arm), Reach(arm, PUBLISHED), 2, 40, 8)
    _, after = found.deviations
    assert after[0] == pytest.approx(1.0)
    assert np.all(after[1:] < 0.05)


def test_natural_frequencies_beside_frequencies_of_changed_arms():
    """What they tell is their change with each spring, in scatters of half a percent."""
    arm = robot("tx200")
    told = natural_frequencies(arm).information(TABLE_7)
    springs, slopes = arm.chain().stiffness, []
    for i in range(springs.size):
        omega = []
        for share in (1e-3, -1e-3):
            changed = springs.copy()
            changed[i] *= 1.0 + share
            omega.append(modes_of(FlexibleRobot(arm.with_springs(changed)).at(TABLE_7))[0][:8])
        slopes.append(np.log(omega[0] / omega[1]) / 2e-3 / 5e-3)
    np.testing.assert_allclose(told, np.array(slopes) @ np.array(slopes).T, atol=1e-4 * told.max())
    planned = plan_postures(natural_frequencies(arm), Reach(arm, PUBLISHED), 2, 40, 9)
    drawn = best_of(natural_frequencies(arm), Reach(arm, PUBLISHED).draw(2, np.random.default_rng(9)), 2)
    assert planned.gain > drawn.gain + 1.0


def test_slow_cuts_beside_lines_of_changed_arms():
    """What they tell is the lines' change with each spring, damper and mass, in shares of what is believed of it and of the line."""
    arm = robot("tx200")
    experiment, priors = stable_cuts(arm), arm_priors(arm)
    told = experiment.information(TABLE_7)
    assert len(experiment.unknowns) == told.shape[0] == 2 * 18 + 7
    assert np.all(np.linalg.eigvalsh(told) > -1e-9 * told.max())
    omega, pushed = 2.0 * np.pi * CUT_LINES, np.array([0.5, -0.5 * CUT_TOOL, 1.0j, -1.0j * CUT_TOOL, 0.0, 0.0])
    chain = arm.chain()

    def lines(unknown):
        stiffness, damping = chain.stiffness / (1.0 + unknown[:18]), chain.damping * np.exp(unknown[18:36])
        changed = arm.with_springs(stiffness, damping).heavier(np.exp(unknown[36:]))
        return (FlexibleRobot(changed).at(TABLE_7).receptance(omega).values @ pushed)[:, [0, 2]]

    size, rows = np.abs(lines(np.zeros(43))), []
    for i in range(0, 43, 4):
        step = np.zeros(43)
        step[i] = 1e-4
        change = (lines(step) - lines(-step)) / 2e-4 * priors.spread[i] / (CUT_NOISE * size)
        rows.append(np.concatenate([change.real.ravel(), change.imag.ravel()]))
    own = np.arange(0, 43, 4)
    np.testing.assert_allclose(told[np.ix_(own, own)], np.array(rows) @ np.array(rows).T, atol=1e-5 * told.max())
    # J5's tilt about the wrist's axis stands behind J6: which of the two gives way no single posture tells
    left = np.sqrt(np.diag(np.linalg.inv(experiment.prior + told)))
    assert left[experiment.unknowns.index("J5 about z")] > 0.3
    assert left[experiment.unknowns.index("J2")] < 0.1


def test_bad_plans_are_named():
    arm = robot("kr500")
    with pytest.raises(InputError, match="link masses"):
        stable_cuts(arm)
    with pytest.raises(InputError, match="link masses"):
        natural_frequencies(arm)
    with pytest.raises(InputError, match="link masses"):
        encoders_at_rest(arm)
    with pytest.raises(InputError, match="payload"):
        payload_mass(robot("kr210"))
    with pytest.raises(InputError, match="a lowest corner, then a highest one"):
        Reach(arm, (np.ones(3), np.zeros(3)))
    with pytest.raises(InputError, match="count: found 3, allowed is 1 to 2"):
        best_of(static_tests(arm, 1000.0), np.zeros((2, 6)), 3)
    with pytest.raises(InputError, match="count: found 3, allowed is 1 to 2"):
        plan_postures(static_tests(arm, 1000.0), Reach(arm), 3, 2, 0)
    with pytest.raises(InputError, match="force"):
        static_tests(arm, 0.0)
    told = np.stack([np.eye(2)])
    assert PlannedPostures(np.zeros((1, 6)), told, np.eye(2)).gain == pytest.approx(np.log(2.0))
