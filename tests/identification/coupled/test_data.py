from dataclasses import replace

import numpy as np
import pytest

from rcsa_ident.dynamics.coordinates import Dof
from rcsa_ident.identification.coupled.data import couplable, coupled_data
from rcsa_ident.identification.data import LEVER
from rcsa_ident.tool_holder.turning import turning_receptance

SCALE = np.array([1.0, LEVER, 1.0, LEVER])


def where(data, points):
    """Cut and order of each point, from the lines that stand there."""
    cut, order = np.full(points.omega.size, -1), np.zeros(points.omega.size)
    for i, axis in enumerate(data.axes):
        there = points.place[:, i] >= 0
        for found, own in ((cut, axis.cut), (order, axis.order)):
            own = own[points.place[there, i]]
            # where both axes have a line they are lines of one cut and one harmonic
            known = there & (cut >= 0) if found is cut else there & (order > 0)
            np.testing.assert_array_equal(found[known], own[known[there]])
            found[there] = own
    return cut, order


def test_every_line_stands_at_one_point(data, points):
    for i, axis in enumerate(data.axes):
        there = points.place[:, i] >= 0
        np.testing.assert_array_equal(np.sort(points.place[there, i]), np.arange(axis.omega.size))
        np.testing.assert_array_equal(points.omega[there], axis.omega[points.place[there, i]])
    assert np.all(points.place.max(axis=1) >= 0)
    cut, order = where(data, points)
    assert len(set(zip(cut.tolist(), order.tolist(), strict=True))) == points.omega.size
    np.testing.assert_array_equal(points.speed, data.spindle_speed[cut])
    np.testing.assert_array_equal(points.relative_speed, data.relative_speed[cut])


def test_lines_of_one_axis_only_are_there(points):
    alone = points.place < 0
    # what `some_missing` has taken: one line of X; two of Y, and all of another cut
    assert np.sum(alone[:, 0]) == 1
    assert np.sum(alone[:, 1]) > 4
    assert np.sum(~alone.any(axis=1)) > 10


def test_both_forces_are_those_of_the_cut(turned_shop, data, points):
    """Also where one axis has no line, and its force had to come from the other one's."""
    cut, order = where(data, points)
    for k, name in enumerate(data.cut_tooling):
        own = np.flatnonzero(cut == k)
        force, slope = turned_shop.force(data.toolings[name], order[own].astype(int), data.spindle_speed[k])
        np.testing.assert_allclose(points.force[own], force, rtol=1e-12)
        if not data.coefficients:
            assert points.slope.shape[2] == 0
            continue
        # tangential and radial, then the run-out of the cut's own tooling
        np.testing.assert_allclose(points.slope[own, :, :2], slope[:, :, :2], rtol=1e-12)
        np.testing.assert_allclose(points.slope[own, :, 2 + name], slope[:, :, -1], rtol=1e-12)
        assert not points.slope[own, :, 3 - name].any()


def test_tool_holders_turn_with_each_cut(turned_shop, data, points):
    """From the spindle's speed, not from the harmonic's number; standing, in the cutter's sense, and in the other one."""
    assert points.turns
    cut, _ = where(data, points)
    for k in range(0, len(data.cut_ids), 2):
        own = np.flatnonzero(cut == k)
        own = own[np.argsort(points.omega[own])]
        assembly = turned_shop.toolings[data.toolings[data.cut_tooling[k]]].assembly
        for index, speed in ((0, 0.0), (1, data.spindle_speed[k]), (-1, -data.spindle_speed[k])):
            holder = turning_receptance(assembly, points.omega[own], speed)
            a22, a21 = holder["flange", "flange"], holder["flange", "tip"][:, :, [0, 2]]
            expected = a22 * np.outer(SCALE, SCALE), a21 * SCALE[:, None]
            for found, true in zip((points.flange[index, own], points.tip[index, own]), expected, strict=True):
                size = np.abs(true).max(axis=(1, 2), keepdims=True)
                assert np.max(np.abs(found - true) / size) < 1e-5
                across = np.abs(true[:, :2, -1]).max()
                assert (across > 0.0) == (index != 0)


def test_who_does_not_ask_for_turning_gets_what_stands(turned_shop, plain):
    points = coupled_data(replace(plain, turning={}))
    assert not points.turns
    assert points.flange.shape[0] == points.tip.shape[0] == 1
    np.testing.assert_array_equal(points.flange[0], coupled_data(plain).flange[0])
    assert coupled_data(plain).summed().turns


def test_a_share_of_the_other_axis_counts_as_model_error(data, points):
    """3 % of how the other axis moves, over this axis' force: in absolute motion both axes' lines are alike."""
    at = {i: points.place[:, i] for i in range(2)}
    for i, axis in enumerate(points.base.axes):
        other = data.axes[1 - i]
        for p in range(points.omega.size):
            if at[i][p] < 0:
                continue
            own = np.abs(data.axes[i].lines[at[i][p]] @ [1.0, -1.0]) ** 2
            beside = 0.0
            if at[1 - i][p] >= 0:
                motion = np.abs(other.lines[at[1 - i][p]] @ [1.0, -1.0]) * np.abs(points.force[p, 1 - i])
                beside = (0.03 * motion / np.abs(points.force[p, i])) ** 2
            np.testing.assert_allclose(axis.power[at[i][p]], own + beside, rtol=1e-10)
        # and nothing of it stands in the planes' own data
        assert not data.axes[i].beside.size
        assert axis.beside.shape == axis.variance.shape


def test_summed_lines_keep_their_neighbours(rich):
    one = coupled_data(rich).summed()
    assert {axis.outputs for axis in one.base.axes} == {1}
    assert one.base.clampings == 0
    for axis, both in zip(one.base.axes, coupled_data(rich).base.axes, strict=True):
        np.testing.assert_allclose(axis.beside[:, 0], both.beside.sum(axis=1))
        np.testing.assert_allclose(axis.power, np.abs(axis.measured[:, None]) ** 2 + axis.beside)


def test_axes_of_different_outputs_stay_apart(rich):
    x, y = rich.axes
    assert couplable(rich)
    assert not couplable(replace(rich, axes=(x, y.summed())))
    assert couplable(rich.summed())


def test_some_lines_of_an_axis_keep_what_belongs_to_them(points):
    axis = points.base.axes[0]
    some = axis.of(np.array([3, 0]))
    np.testing.assert_array_equal(some.beside, axis.beside[[3, 0]])
    np.testing.assert_array_equal(some.across, axis.across[[3, 0]])


def test_what_can_be_fitted_together(turned_shop, plain):
    assert couplable(plain)
    # one axis, or one force of each line
    assert not couplable(plain.only(Dof.X))
    assert not couplable(plain.only(Dof.Y))
    alone, _ = turned_shop.measurements(np.random.default_rng(1), fixture=False)
    assert not couplable(turned_shop.prepare(alone))
    both, _ = turned_shop.measurements(np.random.default_rng(1), fixture=False, both_forces=True)
    assert couplable(turned_shop.prepare(both))
    # a single cut that does not tell its other force: nothing can be said of all of them
    assert not couplable(turned_shop.prepare([*both[:4], alone[4], *both[5:]]))


@pytest.mark.parametrize("axis", [Dof.X, Dof.Y])
def test_one_axis_is_as_it_was(turned_shop, axis):
    """Both forces in the lines change nothing of what the fit of one plane sees."""
    told, _ = turned_shop.measurements(np.random.default_rng(1), axes=(axis,), both_forces=True)
    data = turned_shop.prepare(told)
    untold = turned_shop.prepare([replace(c, axes={axis: replace(c.axes[axis], across=None, across_slope=None)}) for c in told])
    for name in ("omega", "order", "variance", "lines", "cut", "flange", "tip", "force_slope", "power"):
        np.testing.assert_array_equal(getattr(data.axes[0], name), getattr(untold.axes[0], name))
