"""What the teeth do in a period, against plain sums over slices; these tests run again without the compiler."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.integrate

from rcsa_ident.cutting.process import ProcessDamping, SpeedVariation
from rcsa_ident.stability import _cut_kernels as kernels
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
    """Plan, windows, how they push, elements with their number of points, and the table of a cut."""
    cut = MonodromyOperator(tip(SKEWED), CASES[request.param], 4)
    plan = cut._plan(SPEED, DEPTH, 2e-4)
    rows, shapes = cut._rows(SPEED, DEPTH)
    return plan, rows, shapes, *kernels.elements(rows, plan, 4), lobatto(4)


def edge_sum(theta, row, plan, weights, slices=4000):
    """The window's matrix by a sum over slices of the edge."""
    offset, start, end, upper, lower = row[:5]
    z = (upper + (lower - upper) * (np.arange(slices) + 0.5) / slices) * plan.depth
    phi = theta + offset - plan.lag * z
    phi = start + np.mod(phi - start, plan.spacing)
    total = np.zeros((2, 2))
    for k in range(int(2.0 * np.pi / plan.spacing) + 1):
        # copies of the window that follow within a turn
        each = phi + k * plan.spacing
        total += np.sum(naive.directional_integral(each, *weights) * (each < end)[:, None, None], axis=0)
    return (lower - upper) / slices * total


def test_clock():
    plan = MonodromyOperator(tip(SKEWED), CASES["straight"], 4)._plan(700.0, DEPTH, 2e-4)._replace(swing=0.8, swings=0.4)
    for t in (0.0, 1e-3, 0.03, 0.4):
        angle, _ = scipy.integrate.quad(lambda u: 700.0 * (1.0 + 0.8 * np.sin(0.4 * 700.0 * u)), 0.0, t, epsabs=1e-12, limit=400)
        assert kernels.angle_at(t, plan) == pytest.approx(angle, abs=1e-9)
        assert kernels.time_at(angle, plan) == pytest.approx(t, abs=1e-12)
    assert kernels.time_at(7.0, plan._replace(swing=0.0)) == pytest.approx(0.01)


def test_matrices_of_a_window(laid_out):
    plan, rows, _, places, _, _ = laid_out
    weights = np.array([2.0, 0.7, 0.3, 1.1])
    for e, (_, _, _, first, angle) in enumerate(places):
        end = plan.period if e + 1 == len(places) else places[e + 1, 4]
        for part in (0.11, 0.83):
            theta, total = angle + part * (end - angle), np.zeros((2, 2, 2))
            for row in rows:
                kernels.add_window(theta, 0.5 * (angle + end), row, plan, weights, total)
            if first < 0:
                np.testing.assert_array_equal(total, 0.0)
            expected = [sum(edge_sum(theta, row, plan, w) for row in rows) for w in (weights[:2], weights[2:])]
            np.testing.assert_allclose(total, expected, rtol=0, atol=2e-3 * len(rows))


def test_elements_cover_the_period_and_end_where_teeth_do(laid_out):
    plan, rows, _, places, points, _ = laid_out
    period = plan.period
    ends = np.append(places[1:, 0], kernels.time_at(period, plan))
    np.testing.assert_allclose(places[:, 0] + places[:, 1] * places[:, 2], ends, rtol=1e-12)
    assert np.all(places[places[:, 3] >= 0, 1] <= plan.step * (1.0 + 1e-9))
    cutting = places[places[:, 3] >= 0]
    np.testing.assert_array_equal(cutting[:, 3], np.cumsum(np.concatenate([[0], 4 * cutting[:, 2] + 1]))[:-1])
    assert points == np.sum(4 * cutting[:, 2] + 1)
    angles = np.append(places[:, 4], period)
    lag = plan.lag * plan.depth
    for row in rows:
        for phi in (row[1], row[2]):
            for place in (phi - row[0], phi + lag - row[0]):
                apart = np.abs(np.mod(angles - place + 0.5 * plan.spacing, plan.spacing) - 0.5 * plan.spacing)
                assert apart.min() < 1e-9


def test_coefficients_at_the_points(laid_out):
    plan, rows, shapes, places, points, table = laid_out
    stiffness, damping, angle, time = kernels.coefficients(rows, shapes, plan, places, points, table)
    k = plan.depth * np.array([plan.k_tangential, plan.k_radial])
    swing = plan.swings * plan.speed
    # inside elements, not on the jumps at their ends
    inside = np.setdiff1d(np.arange(points), [p for _, _, n, f, _ in places for p in (f, f + 4 * n)])
    for p in inside[:: max(1, inside.size // 9)]:
        assert kernels.angle_at(time[p], plan) == pytest.approx(angle[p], abs=1e-10)
        speed = plan.speed * (1.0 + plan.swing * np.sin(swing * time[p])) * plan.radius
        c = plan.depth / speed * np.array([plan.c_tangential, plan.c_radial])
        expected, rubbing = np.zeros(stiffness.shape[1:]), np.zeros((2, 2))
        for row, shape in zip(rows, shapes, strict=True):
            expected[int(row[5])] += shape.T @ edge_sum(angle[p], row, plan, k) @ shape
            rubbing += shape.T @ edge_sum(angle[p], row, plan, c) @ shape
        np.testing.assert_allclose(stiffness[p], expected, rtol=0, atol=2e-3 * len(rows) * k[0])
        np.testing.assert_allclose(damping[p], rubbing, rtol=0, atol=2e-3 * len(rows) * max(c[1], 1e-30))


def test_means_of_steps():
    """Semi-discretisation: what stands at a step's nodes is its mean, here against a fine sum."""
    cut = MonodromyOperator(tip(SKEWED), mill(2, 0.3, helix=0.5, damping=ProcessDamping(5e13, 6e-5)), 3, frozen=True)
    plan, (rows, shapes) = cut._plan(SPEED, DEPTH, 1.5e-4), cut._rows(SPEED, DEPTH)
    places, points = kernels.elements(rows, plan, 3)
    stiffness, damping, *_ = kernels.coefficients(rows, shapes, plan, places, points, lobatto(3))
    one = next(row for row in places if row[3] >= 0 and row[2] >= 2)
    theta = one[4] + plan.speed * one[1] * (np.arange(200) + 0.5) / 200.0
    weights = plan.depth * np.array([plan.k_tangential, plan.k_radial])
    mean = np.mean([shapes[0].T @ edge_sum(t, rows[0], plan, weights) @ shapes[0] for t in theta], axis=0)
    for j in range(3):
        np.testing.assert_allclose(stiffness[int(one[3]) + j, 0], mean, rtol=0, atol=1e-3 * weights[0])
        np.testing.assert_array_equal(damping[int(one[3]) + j], damping[int(one[3])])


def test_lookups_find_what_was_there_a_delay_ago(laid_out):
    """Polynomials of time of the table's degree are found exactly."""
    plan, rows, shapes, places, points, table = laid_out
    stiffness, _, angle, time = kernels.coefficients(rows, shapes, plan, places, points, table)
    where, weight = kernels.lookups(plan, places, points, angle, time, table)
    period = kernels.time_at(plan.period, plan)

    def path(t):
        return 1.0 + t / period - 2.0 * (t / period) ** 3 + 0.3 * (t / period) ** 4

    known = path(np.concatenate([time - period, time]))
    pushes = np.abs(stiffness).sum(axis=(2, 3)) > 1e-6 * np.abs(stiffness).max()
    assert pushes.any()
    for p, d in zip(*np.nonzero(pushes), strict=True):
        back = angle[p] - plan.delays[d]
        wrap = back < (-1e-9 if np.any(places[:, 3] == p) else 1e-9)
        then = kernels.time_at(back + plan.period, plan) - period if wrap else kernels.time_at(back, plan)
        found = weight[p, d] @ known[where[p, d] : where[p, d] + 5]
        assert found == pytest.approx(path(then), abs=1e-9)
