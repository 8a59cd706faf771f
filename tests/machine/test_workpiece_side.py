"""The workpiece's side beside a tool's tip: closed forms, its spread, and what limits are asked of."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from rcsa_ident.base.errors import InputError
from rcsa_ident.dynamics.coordinates import Dof
from rcsa_ident.dynamics.uncertain import Doubted
from rcsa_ident.machine.speed_dependence import tips_over_speed
from rcsa_ident.machine.workpiece_side import WorkpieceAxis, WorkpieceSide, gives_way
from rcsa_ident.signals.recording import Role
from rcsa_ident.stability.tip_modes import known_modes
from rcsa_ident.virtual.workpiece_side import SideMode, VirtualWorkpieceSide
from tests.fixtures import by_hand, coupled_by_hand

HZ = 2.0 * np.pi
OMEGA = HZ * np.arange(100.0, 3000.0, 5.0)
NATURAL, ZETA, STIFFNESS = HZ * np.array([420.0, 1300.0]), np.array([0.05, 0.02]), np.array([12e6, 40e6])


def covariance(size=6, seed=2):
    root = np.random.default_rng(seed).normal(size=(size, size)) * np.repeat([1e-3, 2e-2, 1e-2], size // 3)[:, None]
    return root @ root.T


def along(name="table_x", modes=2):
    m = slice(modes)
    return WorkpieceAxis(name, Role.TABLE, NATURAL[m], ZETA[m], STIFFNESS[m], covariance(3 * modes), 80, 1.1, 0.002)


SIDE = WorkpieceSide({Dof.X: along(), Dof.Y: along("table_y", 0)})


def test_it_is_what_springs_masses_and_dampers_give_way():
    true = VirtualWorkpieceSide(tuple(map(SideMode, NATURAL.tolist(), ZETA.tolist(), STIFFNESS.tolist())), ())
    np.testing.assert_allclose(along().receptance(OMEGA), true.receptance(OMEGA)[:, 0, 0], rtol=1e-12)
    np.testing.assert_allclose(along().modes(Dof.X).receptance(OMEGA).values[:, 0, 0], along().receptance(OMEGA), rtol=1e-10)


def test_its_slopes_are_those_of_differences():
    logs, step = along().logs, 1e-6
    slope = gives_way(logs, OMEGA)[1]
    for place in np.ndindex(logs.shape):
        moved = np.zeros_like(logs)
        moved[place] = step
        numeric = (gives_way(logs + moved, OMEGA)[0] - gives_way(logs - moved, OMEGA)[0]) / (2.0 * step)
        assert np.linalg.norm(slope[place] - numeric) < 1e-7 * np.linalg.norm(numeric)


def test_its_changes_have_the_covariance_of_drawn_modes():
    axis = along()
    rng = np.random.default_rng(1)
    drawn = rng.multivariate_normal(axis.logs.ravel(), 1e-4 * axis.covariance, size=20_000).reshape(-1, 3, 2)
    places = OMEGA[[20, 64, 70, 240]]
    values = np.array([gives_way(logs, places)[0] for logs in drawn])
    change = axis.changes(places)
    assert np.std(values.real, axis=0) == pytest.approx(1e-2 * np.sqrt(np.sum(change.real**2, axis=0)), rel=0.03)
    assert np.std(values.imag, axis=0) == pytest.approx(1e-2 * np.sqrt(np.sum(change.imag**2, axis=0)), rel=0.03)
    deviations = np.array(axis.deviations) / np.array([axis.omega_n, axis.zeta, axis.stiffness])
    assert deviations.ravel() == pytest.approx(np.sqrt(np.diag(axis.covariance)))


def test_limits_are_asked_of_tool_and_workpiece_together():
    """The relative receptance is the sum, its variances add up; the tool's own is what it was."""
    rigid, tooling = by_hand.machine(), by_hand.tooling()
    machine = replace(rigid, workpiece_side=SIDE)
    own, relative = machine.tip(tooling, OMEGA), machine.relative_tip(tooling, OMEGA)
    before = rigid.tip(tooling, OMEGA)
    np.testing.assert_array_equal(own.values, before.values)
    np.testing.assert_array_equal(rigid.relative_tip(tooling, OMEGA).values, before.values)
    np.testing.assert_allclose(relative.values[:, 0, 0] - own.values[:, 0, 0], along().receptance(OMEGA), rtol=1e-9)
    np.testing.assert_array_equal(relative.values[:, 1, 1], own.values[:, 1, 1])
    added = np.sum(along().changes(OMEGA).real ** 2, axis=0)
    (x, x_own), (y, y_own) = ([each.deviation()[c, c][0] for each in (relative, own)] for c in own.rows)
    np.testing.assert_allclose(x**2, x_own**2 + added, rtol=1e-9)
    np.testing.assert_array_equal(y, y_own)
    assert relative.complete
    assert machine.relative_tip(tooling, OMEGA, spread=False).variation is None
    ((_, tip),) = tips_over_speed(machine, tooling, OMEGA, np.array([800.0]))
    np.testing.assert_array_equal(tip.values, relative.values)
    assert len(machine.remarks) == 1
    assert "420 Hz (12 N/µm), 1300 Hz (40 N/µm)" in machine.remarks[0]
    assert "table_x (on the table) is taken to move as the workpiece does" in machine.remarks[0]


def test_directions_say_what_they_belong_to():
    machine = replace(by_hand.machine(), workpiece_side=SIDE)
    own, relative = (tip(by_hand.tooling(), OMEGA, True, 0.01) for tip in (machine.tip, machine.relative_tip))
    moves, spread = relative.unknowns(), relative.spread
    assert all(each.shape[1] == len(spread) for each in (*moves.values(), *relative.parameters().values()))
    assert len(spread) == len(own.spread) + 6
    np.testing.assert_allclose(np.abs(np.tensordot(moves[Doubted.WORKPIECE], spread, axes=1)[:, :, 0, 0]), np.abs(along().changes(OMEGA)))
    stiffer = [np.tensordot(each.unknowns()[Doubted.STIFFNESS], each.spread, axes=1) for each in (own, relative)]
    np.testing.assert_array_equal(*stiffer)


def test_draws_of_the_sum_have_its_variance():
    machine = replace(by_hand.machine(), workpiece_side=SIDE)
    relative = machine.relative_tip(by_hand.tooling(), OMEGA).thinned()
    drawn = relative.drawn(4000, np.random.default_rng(5))
    real, imaginary = relative.deviation()[relative.rows[0], relative.rows[0]]
    assert np.std(drawn[:, :, 0, 0].real, axis=0) == pytest.approx(real, rel=0.08)
    assert np.std(drawn[:, :, 0, 0].imag, axis=0) == pytest.approx(imaginary, rel=0.08)


def test_a_tool_that_nobody_knows_how_well_gets_no_band():
    machine = replace(by_hand.machine(known=False), workpiece_side=SIDE)
    assert machine.relative_tip(by_hand.tooling(), OMEGA).variation is None


def test_a_machine_that_changes_with_speed_keeps_it():
    machine = replace(by_hand.machine(softening=True), workpiece_side=SIDE)
    for speed in (700.0, 1200.0):
        both = [tip(by_hand.tooling(), OMEGA).values for tip in (machine.at(speed).tip, machine.at(speed).relative_tip)]
        np.testing.assert_allclose((both[1] - both[0])[:, 0, 0], along().receptance(OMEGA), rtol=1e-9)
    for _, tip in tips_over_speed(machine, by_hand.tooling(), OMEGA, np.array([700.0, 1200.0])):
        assert tip.complete


def test_modes_that_are_known_without_a_fit_stay_so():
    """Planes that feel each other know their poles: those of the table stand beside them."""
    machine = replace(coupled_by_hand.machine(), workpiece_side=SIDE)
    relative = machine.at(1000.0).relative_tip(by_hand.tooling(), OMEGA, spread=False)
    modes, _ = known_modes(relative)
    own, _ = known_modes(machine.at(1000.0).tip(by_hand.tooling(), OMEGA, spread=False))
    assert modes.pole.size == own.pole.size + 2
    np.testing.assert_allclose(
        (modes.response(OMEGA) - own.response(OMEGA))[:, 0, 0], along().receptance(OMEGA), rtol=1e-6, atol=1e-6 * 4e-8
    )


def test_nothing_that_gives_way_says_nothing():
    nothing = WorkpieceSide({Dof.X: along(modes=0)})
    assert (nothing.words, nothing.yielding, str(nothing)) == ("", {}, "X nothing above the noise")
    machine = replace(by_hand.machine(), workpiece_side=nothing)
    assert machine.remarks == ()
    tip = machine.tip(by_hand.tooling(), OMEGA)
    assert nothing.beside(tip) is tip


@pytest.mark.parametrize(("name", "values"), [("zeta", [0.05, 1.0]), ("stiffness", [12e6, -1.0]), ("stiffness", [12e6])])
def test_what_is_not_passive_is_refused(name, values):
    with pytest.raises(InputError, match=r"workpiece_side|shape"):
        replace(along(), **{name: np.array(values)})
