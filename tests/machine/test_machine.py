"""A machine takes a tooling: planes that stand apart or feel each other, by other roads; flanges as modes, structures and measurements."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rcsa_ident.base.errors import InputError
from rcsa_ident.coupling.assembly import assemble
from rcsa_ident.coupling.joint import LumpedJoint
from rcsa_ident.coupling.rcsa import couple
from rcsa_ident.dynamics.coordinates import Coordinate, Dof, plane
from rcsa_ident.dynamics.modal import normal_modes
from rcsa_ident.dynamics.receptance import Receptance
from rcsa_ident.dynamics.structure import Structure
from rcsa_ident.machine.flange_machine import FlangeMachine
from rcsa_ident.machine.machine import LOWEST
from rcsa_ident.machine.measured import FlangeCode, MeasuredFlange
from rcsa_ident.tool_holder.model import tool_holder_receptance, tool_holder_structure
from tests.coupling.test_rcsa import TOOL, spindle_structure
from tests.machine.planes import (
    BAND,
    FLANGES,
    JOINT,
    TIP,
    beside,
    coupled_in_both_planes,
    oblique,
    rotation,
    tip_in_both_planes,
    turned,
)

OMEGA = 2.0 * np.pi * np.linspace(300.0, 3000.0, 61)


def structure() -> Structure:
    """Masses and inertias on springs that tie all directions of the flange to each other."""
    return spindle_structure(np.random.default_rng(7), tuple(c.dof for c in FLANGES))


def sampled(step_hz: float) -> MeasuredFlange:
    grid = 2.0 * np.pi * np.arange(250.0, 3100.0, step_hz)
    return MeasuredFlange(oblique().receptance(grid))


def one_plane(axis: Dof, shift: float = 1.0):
    natural = 2.0 * np.pi * shift * np.array([700.0, 1300.0, 2500.0])
    shapes = np.array([[0.3, 3.0], [-0.25, 2.0], [0.2, -4.0]])
    return normal_modes(natural, np.array([0.05, 0.04, 0.06]), shapes, plane("flange", axis), np.diag([2e-10, 3e-8]))


@pytest.mark.parametrize("flange", [oblique(), structure(), sampled(2.0)], ids=["modes", "structure", "measured"])
def test_planes_that_feel_each_other_are_coupled_as_one(flange):
    machine = FlangeMachine((flange,), BAND, JOINT)
    tip = machine.tip(TOOL, OMEGA)
    expected = tip_in_both_planes(TOOL, flange, OMEGA)
    assert tip.rows == tip.cols == TIP
    assert machine.axes == (Dof.X, Dof.Y)
    assert beside(tip.values, expected) < 1e-9
    assert beside(np.swapaxes(tip.values, 1, 2), tip.values) < 1e-9
    # the cross terms are no rounding
    assert np.max(np.abs(tip.values[:, 0, 1]) / np.sqrt(np.abs(tip.values[:, 0, 0] * tip.values[:, 1, 1]))) > 1e-2
    whole = coupled_in_both_planes(TOOL, flange, OMEGA)
    found = machine.coupled(TOOL, OMEGA).block(whole.rows)
    assert beside(found.values, whole.values) < 1e-9
    np.testing.assert_array_equal(machine.receptance(OMEGA).values, flange.receptance(OMEGA).values)


def test_the_tip_is_that_of_one_assembled_structure():
    """Tool-holder, joint and spindle in one system of equations, solved exactly."""
    one = tool_holder_structure(TOOL, 3000.0)
    d, zero = one.mass.shape[0], np.zeros_like(one.mass)
    matrices = [np.block([[m, zero], [zero, m]]) for m in (one.mass, one.damping, one.stiffness, one.structural_damping)]
    ends = (*plane("tip"), *plane("tip", Dof.Y), *FLANGES)
    holder = Structure(*matrices, ends, np.concatenate([one.index[:2], d + one.index[:2], one.index[2:], d + one.index[2:]]))
    expected = assemble(holder, structure(), JOINT).receptance(OMEGA)
    machine = FlangeMachine((structure(),), BAND, JOINT)
    assert beside(machine.tip(TOOL, OMEGA).values, expected.block(TIP).values) < 1e-6
    assert beside(machine.coupled(TOOL, OMEGA).block(expected.rows).values, expected.values) < 1e-6


@pytest.mark.slow
@settings(max_examples=25, deadline=None)
@given(st.floats(-4.0, 4.0))
def test_a_machine_that_is_turned_turns_its_tip(angle):
    """The tool-holder is the same in all directions: R H R^T, and the slopes turn along."""
    here, there = (FlangeMachine((oblique(turn=by),), BAND, JOINT) for by in (0.0, angle))
    turn = rotation(angle)
    assert beside(there.tip(TOOL, OMEGA).values, turn @ here.tip(TOOL, OMEGA).values @ turn.T) < 1e-9
    both = turned(angle)
    whole = np.kron(np.eye(2), both)
    rows = (*plane("tip"), *plane("tip", Dof.Y), *plane("spindle"), *plane("spindle", Dof.Y))
    one, other = (each.coupled(TOOL, OMEGA).block(rows).values for each in (here, there))
    assert beside(other, whole @ one @ whole.T) < 1e-8
    flange = there.receptance(OMEGA)
    assert beside(flange.values, both @ here.receptance(OMEGA).values @ both.T) < 1e-9


def test_a_quarter_turn_swaps_the_axes():
    here, there = (FlangeMachine((oblique(turn=by),), BAND, JOINT).tip(TOOL, OMEGA).values for by in (0.0, 0.5 * np.pi))
    expected = np.array([[here[:, 1, 1], -here[:, 1, 0]], [-here[:, 0, 1], here[:, 0, 0]]]).transpose(2, 0, 1)
    assert beside(there, expected) < 1e-9


@pytest.mark.parametrize("angle", [0.3, 0.5 * np.pi, 2.0])
def test_planes_apart_by_one_kernel_feel_each_other_once_turned_by_the_other(angle):
    """The closed form of a plane by itself against the 4 x 4 solution."""
    x, y = one_plane(Dof.X), one_plane(Dof.Y, 0.93)
    apart = FlangeMachine((x, y), BAND, JOINT)
    block = Receptance.block_diagonal([x.receptance(OMEGA), y.receptance(OMEGA)])
    turn, both = rotation(angle), turned(angle)

    class Turned:
        coordinates = FLANGES

        def receptance(self, omega):
            straight = Receptance.block_diagonal([x.receptance(omega), y.receptance(omega)])
            return Receptance(omega, both @ straight.values @ both.T, FLANGES, FLANGES)

    assert block.rows == FLANGES
    oblique_one = FlangeMachine((Turned(),), BAND, JOINT)
    assert len(apart.parts) == 2
    expected = turn @ apart.tip(TOOL, OMEGA).values @ turn.T
    assert beside(oblique_one.tip(TOOL, OMEGA).values, expected) < 1e-9
    np.testing.assert_array_equal(apart.tip(TOOL, OMEGA).values[:, 0, 1], 0.0)


@pytest.mark.parametrize("joint", [JOINT, None])
def test_planes_apart_are_coupled_one_by_one(joint):
    """To the last digits of the solver that they replaced; the order of the flanges is that of the tip."""
    x, y = one_plane(Dof.X), one_plane(Dof.Y, 0.93)
    machine = FlangeMachine((y, x), BAND, joint)
    tip = machine.tip(TOOL, OMEGA)
    assert tip.rows == (TIP[1], TIP[0])
    for flange, axis in ((x, Dof.X), (y, Dof.Y)):
        alone = couple(tool_holder_receptance(TOOL, OMEGA, axis), flange.receptance(OMEGA), joint)
        np.testing.assert_allclose(tip.between(f"tip.{axis}", f"tip.{axis}"), alone.between(f"tip.{axis}", f"tip.{axis}"), rtol=1e-9)
        own = machine.coupled(TOOL, OMEGA, (axis,))
        assert own.rows == alone.rows
        np.testing.assert_array_equal(own.values, alone.values)
        np.testing.assert_array_equal(machine.receptance(OMEGA, (axis,)).values, flange.receptance(OMEGA).values)
    assert machine.coupled(TOOL, OMEGA).rows == (
        *plane("tip", Dof.Y), *plane("spindle", Dof.Y), *plane("tip", Dof.X), *plane("spindle", Dof.X),
    )  # fmt: skip


def test_one_substructure_whose_planes_stand_apart_is_taken_apart():
    x, y = one_plane(Dof.X), one_plane(Dof.Y, 0.93)
    grid = 2.0 * np.pi * np.arange(250.0, 3100.0, 5.0)
    whole = MeasuredFlange(Receptance.block_diagonal([x.receptance(grid), y.receptance(grid)]))
    together, apart = FlangeMachine((whole,), BAND, JOINT), FlangeMachine((x, y), BAND, JOINT)
    assert [part.coordinates for part in together.parts] == [plane("flange", Dof.X), plane("flange", Dof.Y)]
    tips = [machine.tip(TOOL, grid[10:-50]).values for machine in (together, apart)]
    np.testing.assert_allclose(tips[0], tips[1], rtol=1e-9)


@pytest.mark.parametrize("order", [[2, 3, 0, 1], [0, 2, 1, 3], [1, 0, 3, 2], [3, 1, 2, 0]])
def test_the_order_of_a_flanges_directions_does_not_matter(order):
    rows = tuple(FLANGES[i] for i in order)

    class Shuffled:
        coordinates = rows

        def receptance(self, omega):
            return oblique().receptance(omega).block(rows)

    straight, shuffled = (FlangeMachine((flange,), BAND, JOINT) for flange in (oblique(), Shuffled()))
    expected = straight.tip(TOOL, OMEGA)
    assert beside(shuffled.tip(TOOL, OMEGA).block(TIP).values, expected.values) < 1e-12
    whole = straight.coupled(TOOL, OMEGA)
    assert beside(shuffled.coupled(TOOL, OMEGA).block(whole.rows).values, whole.values) < 1e-9


def test_a_plane_whose_slope_comes_first():
    rows = tuple(reversed(plane("flange")))

    class Reversed:
        coordinates = rows

        def receptance(self, omega):
            return one_plane(Dof.X).receptance(omega).block(rows)

    found, expected = (FlangeMachine((f,), BAND, JOINT).tip(TOOL, OMEGA).values for f in (Reversed(), one_plane(Dof.X)))
    np.testing.assert_allclose(found, expected, rtol=1e-12)


@pytest.mark.parametrize(
    "rows",
    [
        (FLANGES[0],),
        (FLANGES[0], FLANGES[2]),
        (FLANGES[0], FLANGES[1], FLANGES[2]),
        (*FLANGES, Coordinate("flange", Dof.Z)),
        (FLANGES[0], FLANGES[1], Coordinate("fixture", Dof.X)),
    ],
    ids=lambda rows: " ".join(str(c) for c in rows),
)
def test_a_flange_that_is_not_known_in_whole_planes_is_refused(rows):
    shapes = np.random.default_rng(1).normal(size=(3, len(rows)))
    flange = normal_modes(2.0 * np.pi * np.array([700.0, 1300.0, 2500.0]), np.full(3, 0.05), shapes, rows)
    with pytest.raises(InputError, match="flange"):
        FlangeMachine((flange,), BAND, JOINT).tip(TOOL, OMEGA)


def test_a_flange_is_one_or_more_in_a_band():
    for flanges, band in (((), BAND), ((one_plane(Dof.X),), (5.0, 5.0)), ((one_plane(Dof.X),), (-1.0, 5.0))):
        with pytest.raises(InputError, match="one or more, in a band"):
            FlangeMachine(flanges, band)


def test_a_bending_plane_of_two_flanges_is_refused():
    x, y = one_plane(Dof.X), one_plane(Dof.Y)
    for flanges, words in (((x, x), "flange.x, flange.x'"), ((y, oblique()), "flange.y, flange.y'")):
        with pytest.raises(InputError, match=f"found {words} of several flanges"):
            FlangeMachine(flanges, BAND, JOINT)


def test_a_joint_of_each_bending_plane():
    x, y = one_plane(Dof.X), one_plane(Dof.Y, 0.93)
    other = LumpedJoint(1e9, 3e6)
    machine = FlangeMachine((x, y), BAND, {Dof.X: JOINT, Dof.Y: other})
    assert [part.believed.joint for part in machine.parts] == [JOINT, other]
    machine.check_behind_joint()
    half = FlangeMachine((x, y), BAND, {Dof.X: JOINT})
    half.check_behind_joint((Dof.X,))
    with pytest.raises(InputError, match=r"holds the compliance of its joint.*\(Y\)"):
        half.check_behind_joint()
    assert FlangeMachine((oblique(),), BAND, {Dof.X: JOINT, Dof.Y: JOINT}).parts[0].believed.joint == JOINT
    with pytest.raises(InputError, match="one joint for bending planes that feel each other"):
        FlangeMachine((oblique(),), BAND, {Dof.X: JOINT, Dof.Y: other})


def test_a_coarse_measurement_speaks_against_the_machine():
    """Between the lowest and the highest frequency that both know; modes and a fine measurement say nothing."""
    (remark,) = FlangeMachine((sampled(60.0),), BAND, JOINT).remarks
    assert remark.code is FlangeCode.COARSE
    assert remark.startswith("X, Y: flange measured too coarsely")
    for flange in (sampled(2.0), oblique()):
        assert FlangeMachine((flange,), BAND, JOINT).remarks == ()


def test_a_measured_flange_gives_what_its_modes_give():
    """Tip, and the spindle's motion over a force at the tip (C31), from which forces are told; off its own frequencies."""
    modes = FlangeMachine((oblique(),), BAND, JOINT)
    omega = OMEGA + 3.0
    errors = []
    for step in (4.0, 2.0):
        measured = FlangeMachine((sampled(step),), BAND, JOINT)
        one, other = (machine.coupled(TOOL, omega) for machine in (measured, modes))
        errors.append(beside(one.block(TIP).values, other.block(TIP).values))
        assert beside(measured.tip(TOOL, omega).values, one.block(TIP).values) < 1e-9
        for row, col in (("spindle.x", "tip.x"), ("spindle.y", "tip.y"), ("spindle.x", "tip.y")):
            c31 = [each.between(row, col) for each in (one, other)]
            assert np.linalg.norm(c31[0] - c31[1]) < 1e-4 * np.linalg.norm(c31[1])
    assert errors[1] < 1e-5
    # a local cubic: an order of four
    assert errors[1] < errors[0] / 8.0


def test_lines_of_modes_go_beyond_their_band_and_those_of_a_measurement_do_not():
    flange = one_plane(Dof.X)
    modes, measured = (FlangeMachine((flange,), BAND, ends=ends) for ends in (False, True))
    hertz = modes.lines() / (2.0 * np.pi)
    np.testing.assert_allclose(hertz, np.arange(LOWEST, 3000.5))
    assert modes.lines(1.5)[-1] == pytest.approx(2.0 * np.pi * 4500.0)
    low = FlangeMachine((flange,), (2.0 * np.pi * 40.0, BAND[1]))
    assert low.lines()[0] == pytest.approx(2.0 * np.pi * 40.0)
    for beyond in (1.0, 1.5):
        np.testing.assert_allclose(measured.lines(beyond) / (2.0 * np.pi), np.arange(300.0, 3000.5))
    crooked = FlangeMachine((flange,), (2.0 * np.pi * 300.4, 2.0 * np.pi * 2999.7), ends=True).lines()
    assert (crooked[0], crooked[-1]) == (2.0 * np.pi * 300.4, 2.0 * np.pi * 2999.7)
    assert np.all(np.diff(crooked) > 0.0)
    assert np.diff(crooked).max() < 2.0 * np.pi * 1.001


def test_a_machine_that_is_taken_for_exact_has_no_spread():
    machine = FlangeMachine((oblique(),), BAND, JOINT)
    tip = machine.tip(TOOL, OMEGA, stiffness_spread=0.01)
    assert tip.variation is None
    assert not tip.complete
    assert tip.deviation() == {}
    assert tip.spread.shape == (0, OMEGA.size, 2, 2)
    assert machine.coupled(TOOL, OMEGA).deviation() == {}
    assert machine.receptance(OMEGA).variation is None
    assert (machine.unknowns, machine.prepared, machine.speed_range, machine.remarks) == (0, True, None, ())
    assert machine.at(1000.0) is machine
    assert machine.kept() is machine
