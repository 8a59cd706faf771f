"""From measurements to flat arrays: nothing is lost, nothing is mixed up."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rcsa_ident.base.errors import InputError
from rcsa_ident.cutting.force import ForceCoefficient, ForceTerm
from rcsa_ident.dynamics.coordinates import Dof, plane
from rcsa_ident.dynamics.receptance import Receptance
from rcsa_ident.identification.cut_data import RUNOUT_SPREAD, prepare
from rcsa_ident.identification.data import LEVER
from rcsa_ident.signals.frf import AxisLines
from rcsa_ident.signals.measurement import CutMeasurement

TEETH = {"a": 2, "b": 3}


def holder(scale):
    """A receptance whose every entry tells where and when it was taken."""

    def receptance(omega):
        points = (*plane("tip"), *plane("flange"))
        entries = np.arange(1.0, 17.0).reshape(4, 4)
        return Receptance(omega, scale * omega[:, None, None] * (entries + 1j), points, points)

    return receptance


def measurement(name, tooling, rng, axes=(Dof.X, Dof.Y), outputs=2, count=4, **given):
    speed = rng.uniform(900.0, 1500.0)
    lines = {}
    for axis in axes:
        order = TEETH[tooling] * np.sort(rng.choice(np.arange(1, 9), count, replace=False))

        def draws(*shape):
            return rng.standard_normal(shape) + 1j * rng.standard_normal(shape)

        variance = rng.uniform(1.0, 2.0, (count, outputs))
        lines[axis] = AxisLines(
            order, order * speed, draws(count, outputs), draws(count, outputs), variance, np.ones(count), draws(count), draws(count, 5)
        )
    return CutMeasurement(name, tooling, speed, lines, 0.01, **given)


def prepared(measurements, spread=()):
    return prepare(measurements, {"a": holder(1.0), "b": holder(-2.0)}, TEETH, spread)


@st.composite
def campaigns(draw):
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    kinds = draw(st.lists(st.tuples(st.sampled_from("ab"), st.integers(1, 2), st.sampled_from(["x", "y", "xy"])), min_size=1, max_size=6))
    return [
        measurement(f"{k}", tooling, rng, tuple(Dof(a) for a in axes), outputs, int(rng.integers(1, 6)))
        for k, (tooling, outputs, axes) in enumerate(kinds)
    ]


@pytest.mark.slow
@settings(max_examples=60, deadline=None)
@given(campaigns())
def test_every_line_is_there_once_with_its_own_holder(cuts):
    data = prepared(cuts)
    assert data.cut_ids == tuple(c.cut_id for c in cuts)
    assert {a.axis for a in data.axes} == {axis for c in cuts for axis in c.axes}
    for axis in data.axes:
        given_outputs = {c.axes[axis.axis].outputs for c in cuts if axis.axis in c.axes}
        assert axis.outputs == (2 if given_outputs == {2} else 1)
        assert np.all(np.diff(axis.cut) >= 0)
        assert axis.omega.size == sum(c.axes[axis.axis].omega.size for c in cuts if axis.axis in c.axes)
        for k, cut in enumerate(cuts):
            mine = axis.of(axis.cut == k)
            if axis.axis not in cut.axes:
                assert mine.omega.size == 0
                continue
            lines = cut.axes[axis.axis]
            np.testing.assert_array_equal(mine.omega, lines.omega)
            np.testing.assert_array_equal(mine.order, lines.order)
            # whether or not the axis falls back to the sum, the flange's motion is the same
            np.testing.assert_allclose(mine.measured, lines.receptance, rtol=1e-12)
            np.testing.assert_allclose(mine.noise, lines.variance.sum(axis=1), rtol=1e-12)
            if axis.outputs == lines.outputs:
                np.testing.assert_array_equal(mine.lines[:, :, 0], lines.cut)
                np.testing.assert_array_equal(mine.lines[:, :, 1], lines.air)
                np.testing.assert_array_equal(mine.variance, lines.variance)
            scale = {"a": 1.0, "b": -2.0}[cut.tooling] * lines.omega
            for column, (entry, lever) in enumerate(((11.0, 1.0), (12.0, LEVER), (16.0, LEVER**2))):
                np.testing.assert_allclose(mine.flange[:, column], scale * lever * (entry + 1j), rtol=1e-12)
            for column, (entry, lever) in enumerate(((9.0, 1.0), (13.0, LEVER))):
                np.testing.assert_allclose(mine.tip[:, column], scale * lever * (entry + 1j), rtol=1e-12)


@settings(max_examples=40, deadline=None)
@given(campaigns())
def test_summed_adds_up(cuts):
    data = prepared(cuts)
    summed = data.summed()
    for one, axis in zip(summed.axes, data.axes, strict=True):
        assert one.outputs == 1
        np.testing.assert_allclose(one.measured, axis.measured, rtol=1e-12)
        np.testing.assert_allclose(one.noise, axis.noise, rtol=1e-12)
        for part in (0, 1):
            np.testing.assert_allclose(one.lines[:, 0, part], axis.lines[:, :, part].sum(axis=1), rtol=1e-12)
        assert one.summed() is one
    assert np.all(summed.clamping == -1)


def test_an_axis_where_one_cut_lacks_the_fixture_falls_back_to_the_sum():
    rng = np.random.default_rng(1)
    cuts = [measurement("1", "a", rng), measurement("2", "b", rng)]
    assert [a.outputs for a in prepared(cuts).axes] == [2, 2]
    lacking = replace(cuts[1], axes={Dof.X: cuts[1].axes[Dof.X], Dof.Y: cuts[1].axes[Dof.Y].summed()})
    mixed = prepared([cuts[0], lacking])
    assert [a.outputs for a in mixed.axes] == [2, 1]
    np.testing.assert_allclose(mixed.axes[1].measured, prepared(cuts).axes[1].measured, rtol=1e-12)


def test_what_is_uncertain_about_the_forces():
    rng = np.random.default_rng(2)
    cuts = [measurement("1", "a", rng), measurement("2", "b", rng), measurement("3", "a", rng)]
    assert prepared(cuts).coefficients == ()
    assert all(a.force_slope.shape[1] == 0 for a in prepared(cuts).axes)
    # the edge forces are known: they have no column
    data = prepared(cuts, (0.05, 0.1, 0.0, 0.0))
    assert tuple(map(str, data.coefficients)) == ("tangential coefficient", "radial ratio", "run-out of a", "run-out of b")
    assert data.coefficient_spread == (0.05, 0.1, RUNOUT_SPREAD, RUNOUT_SPREAD)
    for axis in data.axes:
        for k, cut in enumerate(cuts):
            mine, lines = axis.force_slope[axis.cut == k], cut.axes[axis.axis]
            np.testing.assert_array_equal(mine[:, :2], lines.force_slope[:, :2])
            own, other = (2, 3) if cut.tooling == "a" else (3, 2)
            np.testing.assert_array_equal(mine[:, own], lines.force_slope[:, 4])
            np.testing.assert_array_equal(mine[:, other], 0.0)
    assert [c.tooling for c in data.coefficients] == ["", "", "a", "b"]
    edges = prepared(cuts, (0.0, 0.0, 0.2, 0.2)).coefficients[:2]
    assert edges == (ForceCoefficient(ForceTerm.TANGENTIAL_EDGE), ForceCoefficient(ForceTerm.RADIAL_EDGE))


def test_smooth_errors_belong_to_one_axis_and_one_tooling():
    rng = np.random.default_rng(3)
    cuts = [measurement("1", "a", rng), measurement("2", "b", rng), measurement("3", "a", rng)]
    data = prepared(cuts, (0.05, 0.0, 0.0, 0.0))
    share, terms = 3e-3, 4
    wide = data.with_smooth_errors(share, terms)
    known = len(data.coefficient_spread)
    # axis, tooling, real and imaginary, polynomial
    assert wide.coefficient_spread == (*data.coefficient_spread, *(share,) * (2 * 2 * 2 * terms))
    assert wide.coefficients == data.coefficients
    highest = max(a.omega.max() for a in data.axes)
    seen = np.zeros(2 * 2 * 2 * terms, dtype=int)
    for axis, before in zip(wide.axes, data.axes, strict=True):
        np.testing.assert_array_equal(axis.force_slope[:, :known], before.force_slope)
        columns = axis.force_slope[:, known:]
        assert columns.shape[1] == 2 * 2 * 2 * terms
        for t in range(2):
            mine = data.cut_tooling[axis.cut] == t
            active = np.any(columns[mine] != 0.0, axis=0)
            # those of a tooling vanish on all other lines: any two of different kind are orthogonal
            assert active.sum() == 2 * terms
            assert not np.any(columns[~mine][:, active])
            seen += active
            x = 2.0 * axis.omega[mine] / highest - 1.0
            basis = np.cos(np.arange(terms) * np.arccos(np.clip(x, -1.0, 1.0))[:, None])
            np.testing.assert_allclose(columns[mine][:, active], np.hstack([basis, 1j * basis]), atol=1e-9)
    # no column serves two of them
    np.testing.assert_array_equal(seen, 1)


def test_smooth_errors_are_a_share_of_each_line():
    """Draws of the coefficients move the lines by that share at each order's root mean square, in amplitude and in phase."""
    rng = np.random.default_rng(4)
    data = prepared([measurement(f"{k}", "a", rng, (Dof.X,), count=6) for k in range(5)])
    terms = 4
    slope = data.with_smooth_errors(2e-3, terms).axes[0].force_slope
    moved = slope @ (2e-3 * rng.standard_normal((slope.shape[1], 20000)))
    expected = 2e-3 * np.sqrt(np.sum(np.abs(slope[:, :terms]) ** 2, axis=1))
    np.testing.assert_allclose(np.std(moved.real, axis=1), expected, rtol=0.03)
    np.testing.assert_allclose(np.std(moved.imag, axis=1), expected, rtol=0.03)
    assert np.all(expected <= 2e-3 * np.sqrt(terms) * (1.0 + 1e-9))


def test_triggers():
    rng = np.random.default_rng(5)
    given = [
        ("a", {"delay": 1e-3, "delay_std": 1e-6}),
        ("a", {}),
        ("b", {"delay": 2e-3, "delay_std": 2e-6, "tooth_angle_known": False}),
        ("a", {"delay": 3e-3, "delay_std": 1e-6, "tooth_angle_known": False}),
        ("b", {"delay": 4e-3, "delay_std": 4e-6, "tooth_angle_known": False}),
    ]
    cuts = [measurement(f"{k}", tooling, rng, **options) for k, (tooling, options) in enumerate(given)]
    data = prepared(cuts)
    period = [2.0 * np.pi / c.spindle_speed / TEETH[c.tooling] for c in cuts]
    np.testing.assert_allclose(data.cut_prior.tooth_period, period)
    np.testing.assert_allclose(data.cut_prior.angle_weight, 1e4)
    # a known tooth angle is a prior of the delay; an unknown one makes a clamping, one for each tooling
    np.testing.assert_allclose(data.cut_prior.delay, [1e-3, 0.0, 0.0, 0.0, 0.0])
    np.testing.assert_allclose(data.cut_prior.delay_weight, [1e12, 0.0, 0.0, 0.0, 0.0])
    assert data.clamping[0] == data.clamping[1] == -1
    assert data.clamping[2] == data.clamping[4] != data.clamping[3]
    assert data.clampings == 2
    np.testing.assert_allclose(data.edge[2:], [[2e-3, 2.5e11], [3e-3, 1e12], [4e-3, 6.25e10]])
    assert data.summed().clampings == 0
    assert data.summed().cut_prior is data.cut_prior
    rows = data.cut_prior.rows
    np.testing.assert_array_equal(rows[:, 1:3], data.cut_prior.weights)
    np.testing.assert_array_equal(rows[:, [0, 3]].T, [data.cut_prior.delay, data.cut_prior.tooth_period])


def test_relative_speed_is_that_of_the_campaign():
    rng = np.random.default_rng(6)
    data = prepared([measurement(f"{k}", "a", rng) for k in range(5)])
    assert data.relative_speed.min() == pytest.approx(-1.0)
    assert data.relative_speed.max() == pytest.approx(1.0)
    middle, half = data.speed_range
    np.testing.assert_allclose(middle + half * data.relative_speed, data.spindle_speed)
    single = prepared([measurement("1", "a", rng)])
    assert single.speed_range[1] == 0.0
    np.testing.assert_array_equal(single.relative_speed, 0.0)


def test_no_measurements_are_refused():
    with pytest.raises(InputError, match="none usable"):
        prepared([])
