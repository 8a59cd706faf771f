"""What the teeth do in a period, against plain sums over slices; these tests run again without the compiler."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import scipy.integrate

from rcsa_ident.cutting.coefficients import CuttingCoefficients
from rcsa_ident.cutting.process import ProcessDamping, SpeedVariation
from rcsa_ident.cutting.serration import Serration
from rcsa_ident.stability._kernels import cut as kernels
from rcsa_ident.stability.monodromy import MonodromyOperator, lobatto
from tests.oracles import naive
from tests.stability.mills import RPM, SKEWED, mill, tip

SPEED, DEPTH = 9000.0 * RPM, 3e-3
CASES = {
    "straight": mill(2, 0.3),
    "slot, helix": mill(3, 1.0, helix=0.6),
    "helix of more than a turn": mill(2, 0.4, "up", 1.4),
    "unequal pitch": mill(3, 0.4, helix=0.5, pitch=np.radians([100.0, 121.0, 139.0])),
    "run-out, a tooth that misses": mill(2, 0.5, runout=[0.0, 60e-6], feed_per_tooth=5e-5),
    "run-out, late teeth": mill(3, 0.5, helix=0.4, runout=[0.0, 30e-6, -12e-6], feed_per_tooth=4e-5),
    "rubbing, a varying speed": mill(2, 0.4, helix=0.5, damping=ProcessDamping(5e13, 6e-5, 0.4), speed_variation=SpeedVariation(0.3, 0.5)),
}


@pytest.fixture(params=CASES)
def laid_out(request):
    """Plan, windows, what they push and rub with, elements with their number of points, and the table of a cut."""
    cut = MonodromyOperator(tip(SKEWED), CASES[request.param], 4)
    rows, forms, rubbing, delays = cut._windows(SPEED, DEPTH)
    plan = cut._plan(SPEED, 2e-4, delays)
    return plan, rows, forms, rubbing, *kernels.elements(rows, plan, 4), lobatto(4)


def edge_sum(theta, row, plan, form, slices=4000):
    """What a window pushes with by a sum over slices of the edge."""
    offset, start, end, near, far = row[:5]
    phi = theta + offset - near - (far - near) * (np.arange(slices) + 0.5) / slices
    phi = start + np.mod(phi - start, plan.spacing)
    total = np.zeros(form.shape[1:])
    for k in range(int(2.0 * np.pi / plan.spacing) + 1):
        # copies of the window that follow within a turn
        each = phi + k * plan.spacing
        basis = np.array([np.ones_like(each), np.cos(each), np.sin(each), np.cos(2.0 * each), np.sin(2.0 * each)])
        total += np.tensordot(np.sum(basis * (each < end), axis=1), form, 1)
    return total / slices


@pytest.mark.parametrize("process", CASES.values(), ids=CASES)
def test_a_depth_that_is_laid_out_as_a_share_of_another(process):
    """Windows of a cylinder are sought once: lags and forces of all depths are in proportion."""
    cut = MonodromyOperator(tip(SKEWED), process, 4)
    rows, forms, rubbing, delays = cut._windows(SPEED, DEPTH)
    cut._lay_out(SPEED, 0.4 * DEPTH, 2e-4)
    plain = kernels.lay_out(rows, forms, rubbing, cut._plan(SPEED, 2e-4, delays), cut.table)
    for shared, each in zip(cut._lay_out(SPEED, DEPTH, 2e-4), plain, strict=True):
        np.testing.assert_allclose(shared, each, rtol=1e-12, atol=1e-12 * np.abs(each).max(initial=0.0))


def test_clock():
    plan = MonodromyOperator(tip(SKEWED), CASES["straight"], 4)._plan(700.0, 2e-4, np.zeros(0))._replace(swing=0.8, swings=0.4)
    for t in (0.0, 1e-3, 0.03, 0.4):
        angle, _ = scipy.integrate.quad(lambda u: 700.0 * (1.0 + 0.8 * np.sin(0.4 * 700.0 * u)), 0.0, t, epsabs=1e-12, limit=400)
        assert kernels.angle_at(t, plan) == pytest.approx(angle, abs=1e-9)
        assert kernels.time_at(angle, plan) == pytest.approx(t, abs=1e-12)
    assert kernels.time_at(7.0, plan._replace(swing=0.0)) == pytest.approx(0.01)


def test_sums_of_a_window(laid_out):
    plan, rows, _, _, places, _, _ = laid_out
    units = np.eye(5)[:, :, None]
    for e, (_, _, _, first, angle) in enumerate(places):
        end = plan.period if e + 1 == len(places) else places[e + 1, 4]
        for part in (0.11, 0.83):
            theta, total = angle + part * (end - angle), np.zeros(5)
            cuts = [kernels.add_window(theta, 0.5 * (angle + end), row, plan.spacing, total) for row in rows]
            assert any(cuts) == (first >= 0)
            expected = sum(edge_sum(theta, row, plan, units)[:, 0] for row in rows)
            np.testing.assert_allclose(total, expected, rtol=0, atol=2e-3 * len(rows))


@pytest.mark.parametrize("radial_ratio", [0.0, 0.4])
def test_what_a_straight_edge_pushes_with(radial_ratio):
    """The forms are those of the textbook's directional coefficients."""
    process = replace(mill(2, 0.5), coefficients=CuttingCoefficients(7e8, radial_ratio))
    rows, forms, _, _ = MonodromyOperator(tip(SKEWED), process, 4)._windows(SPEED, DEPTH)
    for phi in (1.7, 2.4, 3.0):
        basis = np.array([1.0, np.cos(phi), np.sin(phi), np.cos(2.0 * phi), np.sin(2.0 * phi)])
        expected = DEPTH * naive.directional_integral(np.array([phi]), 7e8, 7e8 * radial_ratio)[0]
        turn = process.machine_from_feed
        np.testing.assert_allclose(np.tensordot(basis, forms[0], 1), turn @ expected @ turn.T, rtol=1e-12, atol=1e-6)
    assert len(rows) == 1


def test_elements_cover_the_period_and_end_where_teeth_do(laid_out):
    plan, rows, _, _, places, points, _ = laid_out
    period = plan.period
    ends = np.append(places[1:, 0], kernels.time_at(period, plan))
    np.testing.assert_allclose(places[:, 0] + places[:, 1] * places[:, 2], ends, rtol=1e-12)
    cutting = places[places[:, 3] >= 0]
    np.testing.assert_array_equal(cutting[:, 2], np.maximum(np.ceil(cutting[:, 1] * cutting[:, 2] / plan.step - 1e-9), 1.0))
    np.testing.assert_array_equal(cutting[:, 3], np.cumsum(np.concatenate([[0], 4 * cutting[:, 2] + 1]))[:-1])
    assert points == np.sum(4 * cutting[:, 2] + 1)
    np.testing.assert_array_equal(places[places[:, 3] < 0, 3], -1.0)
    angles = np.append(places[:, 4], period)
    for row in rows:
        for phi in (row[1], row[2]):
            for place in (phi + row[3] - row[0], phi + row[4] - row[0]):
                apart = np.abs(np.mod(angles - place + 0.5 * plan.spacing, plan.spacing) - 0.5 * plan.spacing)
                assert apart.min() < 1e-9


def test_as_few_steps_as_the_longest_allows(laid_out):
    plan, rows, *_ = laid_out
    places, _ = kernels.elements(rows, plan._replace(step=1.0), 4)
    np.testing.assert_array_equal(places[:, 2], 1.0)


def test_coefficients_at_the_points(laid_out):
    plan, rows, forms, rubbing, places, points, table = laid_out
    stiffness, damping, angle, time = kernels.coefficients(rows, forms, rubbing, plan, places, points, table)
    swing = plan.swings * plan.speed
    # elements begin and end where their neighbours do, to the last bit
    ends = [(places[e, 4], places[e + 1, 4] if e + 1 < len(places) else plan.period) for e in np.flatnonzero(places[:, 3] >= 0)]
    outer = [(angle[int(f)], angle[int(f + 4 * n)]) for _, _, n, f, _ in places if f >= 0]
    np.testing.assert_array_equal(outer, ends)
    # inside elements, not on the jumps at their ends
    inside = np.setdiff1d(np.arange(points), [p for _, _, n, f, _ in places for p in (f, f + 4 * n)])
    for p in inside[:: max(1, inside.size // 9)]:
        assert kernels.angle_at(time[p], plan) == pytest.approx(angle[p], abs=1e-10)
        speed = plan.speed * (1.0 + plan.swing * np.sin(swing * time[p]))
        expected, rubs = np.zeros(stiffness.shape[1:]), np.zeros(damping.shape[1:])
        for w, row in enumerate(rows):
            expected[int(row[5])] += edge_sum(angle[p], row, plan, forms[w])
            if len(rubbing):
                rubs += edge_sum(angle[p], row, plan, rubbing[w]) / speed
        np.testing.assert_allclose(stiffness[p], expected, rtol=0, atol=4e-3 * len(rows) * np.abs(forms).max())
        np.testing.assert_allclose(damping[p], rubs, rtol=0, atol=4e-3 * len(rows) * max(np.abs(rubbing).max(initial=0.0) / speed, 1e-30))


def test_a_serrated_edges_windows_split_nothing_and_add_up():
    """Its many windows open and close one after the other: a period is one element, and the points see those that are open there."""
    wavy = replace(mill(3, 0.5, helix=0.5, feed_per_tooth=5e-5).cutter, serration=Serration(0.2e-3, 1.5e-3))
    cut = MonodromyOperator(tip(SKEWED), replace(mill(3, 0.5, feed_per_tooth=5e-5), cutter=wavy), 4)
    rows, forms, rubbing, delays = cut._windows(SPEED, DEPTH)
    plan = cut._plan(SPEED, 1e-4, delays)
    places, points = kernels.elements(rows, plan, 4)
    assert len(places) == 1
    stiffness, _, angle, _ = kernels.coefficients(rows, forms, rubbing, plan, places, points, lobatto(4))
    for p in (5, 17, points // 2):
        expected = np.zeros(stiffness.shape[1:])
        for w, row in enumerate(rows):
            expected[int(row[5])] += edge_sum(angle[p], row, plan, forms[w], 50)
        np.testing.assert_allclose(stiffness[p], expected, rtol=0, atol=0.02 * np.abs(expected).max())


def test_means_of_steps():
    """Semi-discretisation: what stands at a step's nodes is its mean, here against a fine sum."""
    cut = MonodromyOperator(tip(SKEWED), mill(2, 0.3, helix=0.5, damping=ProcessDamping(5e13, 6e-5)), 3, frozen=True)
    rows, forms, rubbing, delays = cut._windows(SPEED, DEPTH)
    plan = cut._plan(SPEED, 1.5e-4, delays)
    places, points = kernels.elements(rows, plan, 3)
    table = lobatto(3)
    stiffness, damping, *_ = kernels.coefficients(rows, forms, rubbing, plan, places, points, table)
    one = next(row for row in places if row[3] >= 0 and row[2] >= 2)
    theta = one[4] + plan.speed * one[1] * (np.arange(200) + 0.5) / 200.0
    mean = np.mean([edge_sum(t, rows[0], plan, forms[0]) for t in theta], axis=0)
    np.testing.assert_allclose(stiffness[int(one[3]), 0], mean, rtol=0, atol=2e-3 * np.abs(forms).max())
    # of every step, by the nodes' weights
    within = kernels.coefficients(rows, forms, rubbing, plan._replace(frozen=False), places, points, table)
    assert places[0, 3] >= 0 > places[1, 3]
    starts = [int(f) + 3 * n for _, _, steps, f, _ in places if f >= 0 for n in range(int(steps))]
    for found, each in zip((stiffness, damping), within[:2], strict=True):
        for start in starts:
            mean = np.tensordot(table[1], each[start : start + 4], 1)
            np.testing.assert_allclose(found[start : start + 3], np.stack([mean] * 3), rtol=1e-9, atol=1e-9 * np.abs(each).max())


def test_lookups_find_what_was_there_a_delay_ago(laid_out):
    """Polynomials of time of the table's degree are found exactly."""
    plan, rows, forms, rubbing, places, points, table = laid_out
    stiffness, _, angle, time = kernels.coefficients(rows, forms, rubbing, plan, places, points, table)
    where, weight = kernels.lookups(plan, places, points, angle, time, table, stiffness)
    period = kernels.time_at(plan.period, plan)

    def path(t):
        return 1.0 + t / period - 2.0 * (t / period) ** 3 + 0.3 * (t / period) ** 4

    known = path(np.concatenate([time - period, time]))
    pushes = np.abs(stiffness).sum(axis=(2, 3)) > 1e-6 * np.abs(stiffness).max()
    assert pushes.any()
    stands, begins = np.concatenate([time - period, time]), np.isin(np.arange(points), places[:, 3])
    for p, d in zip(*np.nonzero(pushes), strict=True):
        back = angle[p] - plan.delays[d]
        wrap = back < (-1e-9 if begins[p] else 1e-9)
        then = kernels.time_at(back + plan.period, plan) - period if wrap else kernels.time_at(back, plan)
        found = weight[p, d] @ known[where[p, d] : where[p, d] + 5]
        assert found == pytest.approx(path(then), abs=1e-9)
        # a point that stands there already is taken alone
        alone = np.abs(stands - then).min() < 1e-12 * period
        assert np.array_equal(weight[p, d], [1.0, 0.0, 0.0, 0.0, 0.0]) == alone


def test_lookups_keep_to_one_side_of_a_jump(laid_out):
    """Where a delay leads to two elements that touch, an element's first point sees the one that starts, its last the one that ends."""
    plan, rows, forms, rubbing, places, points, table = laid_out
    stiffness, _, angle, time = kernels.coefficients(rows, forms, rubbing, plan, places, points, table)
    where, weight = kernels.lookups(plan, places, points, angle, time, table, stiffness)
    cutting = places[places[:, 3] >= 0]
    first, last = cutting[:, 3].astype(int), (cutting[:, 3] + 4 * cutting[:, 2]).astype(int)
    owner = np.tile(np.repeat(np.arange(len(cutting)), last - first + 1), 2)
    for begin, end in zip(first, last, strict=True):
        for p, edge in ((begin, angle[first]), (end, angle[last])):
            for d in np.flatnonzero(where[p] >= 0):
                # the period's end is its start
                apart = np.abs((edge - angle[p] + plan.delays[d] + 0.5 * plan.period) % plan.period - 0.5 * plan.period)
                if apart.min() < 1e-10:
                    assert weight[p, d] @ owner[where[p, d] : where[p, d] + 5] == apart.argmin()


def test_nothing_is_looked_up_where_a_step_pushes_nothing_with_that_delay(laid_out):
    plan, rows, forms, rubbing, places, points, table = laid_out
    stiffness, _, angle, time = kernels.coefficients(rows, forms, rubbing, plan, places, points, table)
    pushes, starts = np.zeros_like(stiffness), [int(f) + 4 * n for _, _, steps, f, _ in places if f >= 0 for n in range(int(steps))]
    looked_up = np.zeros((points, plan.delays.size), dtype=bool)
    for n, start in enumerate(starts[::3]):
        # a single entry at a single node, but for the ends that steps share
        pushes[start + 1 + n % 3, n % plan.delays.size, n % 2, n // 2 % 2] = -1.0
        looked_up[start : start + 5, n % plan.delays.size] = True
    where, _ = kernels.lookups(plan, places, points, angle, time, table, pushes)
    np.testing.assert_array_equal(where >= 0, looked_up)
