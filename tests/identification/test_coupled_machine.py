"""An identified machine whose planes feel each other: nothing that it answers leaves the cross terms or the speed out."""

from __future__ import annotations

import pickle
from dataclasses import replace

import numpy as np
import pytest

from rcsa_ident.base.errors import InputError
from rcsa_ident.dynamics.coordinates import Dof
from rcsa_ident.dynamics.modal import directions
from rcsa_ident.identification.learned_changes import LearnedWarming
from rcsa_ident.identification.machine import MOST_KEPT_OF_BOTH
from rcsa_ident.identification.modal_parameters import flange_modes
from rcsa_ident.identification.unknowns import JOINT, ModalBlock, unpack
from rcsa_ident.workflows.identify import mode_deviations
from tests.fixtures import by_hand, coupled_by_hand

OMEGA = 2.0 * np.pi * np.linspace(300.0, 3000.0, 100)


def test_speed_bands_keep_their_planes_together():
    slow, fast = (replace(coupled_by_hand.machine(), whole=coupled_by_hand.posterior(shift=shift)) for shift in (0.9, 1.1))
    banded = by_hand.over_speed([((600.0, 1000.0), slow), ((1000.0, 1400.0), fast)])
    for speed, model in ((700.0, slow), (1300.0, fast)):
        found, expected = (each.tip(by_hand.tooling(), OMEGA) for each in (banded.at(speed), model))
        np.testing.assert_array_equal(found.values, expected.values)
        assert np.max(np.abs(found.values[:, 0, 1])) > 0.05 * np.max(np.abs(found.values[:, 0, 0]))
        np.testing.assert_array_equal(found.spread, expected.spread)
    assert banded.unknowns == slow.unknowns
    # a band whose cuts say nothing of it has none
    mixed = by_hand.over_speed([((600.0, 1000.0), slow), ((1000.0, 1400.0), by_hand.machine())])
    assert mixed.at(700.0).coupled_planes
    assert not mixed.at(1300.0).coupled_planes


def test_bands_that_turn_answer_at_their_speed():
    turning = coupled_by_hand.machine(1)
    banded = by_hand.over_speed([((600.0, 1000.0), turning), ((1000.0, 1400.0), turning)])
    for speed in (650.0, 900.0, 1350.0):
        assert banded.at(speed).turning == speed
        np.testing.assert_array_equal(
            banded.at(speed).tip(by_hand.tooling(), OMEGA, spread=False).values,
            turning.at(speed).tip(by_hand.tooling(), OMEGA, spread=False).values,
        )


def test_what_is_known_belongs_to_both_planes():
    with pytest.raises(InputError, match="both_planes: found X and Y that feel each other"):
        coupled_by_hand.machine().posteriors()
    with pytest.raises(InputError, match="both_planes: found planes that do not feel each other"):
        _ = by_hand.machine().standing


@pytest.mark.parametrize("turning", [0, 1])
def test_each_plane_starts_from_the_modes_that_move_it(turning):
    whole = coupled_by_hand.posterior(turning)
    machine = replace(coupled_by_hand.machine(turning), whole=whole)
    standing = whole.best.standing()
    for axis, first in ((Dof.X, 0), (Dof.Y, 2)):
        start = machine.starts()[axis]
        assert start.layout == ModalBlock(2)
        own = flange_modes(unpack(start.theta[:-JOINT], start.layout), axis)
        near = np.abs(np.cos(directions(standing) - (0.0 if axis is Dof.X else 0.5 * np.pi))) > 0.9
        np.testing.assert_allclose(own.omega_n, standing.omega_n[near], rtol=1e-3)
        np.testing.assert_allclose(np.abs(own.phi), np.abs(standing.phi[near, first : first + 2]), rtol=1e-2)
        np.testing.assert_allclose(own.residual, standing.residual[first : first + 2, first : first + 2], rtol=1e-9)
        np.testing.assert_array_equal(start.theta[-JOINT:], by_hand.JOINT_LOGS)


def test_a_mode_halfway_starts_both_planes():
    best = coupled_by_hand.unknowns(angles=np.radians([45.0, 90.0, 0.0, -45.0]))
    assert [best.seen_along(axis).layout.modes for axis in (Dof.X, Dof.Y)] == [3, 3]
    # where no mode moves a plane, the one that does most
    assert best.seen_along(Dof.Y).layout.modes == 3
    alone = coupled_by_hand.unknowns(angles=np.zeros(4)).seen_along(Dof.Y)
    assert alone.layout.modes == 1


def test_deviations_of_the_modes_are_those_of_draws():
    found = coupled_by_hand.identification()
    frequency, damping = mode_deviations(found)[Dof.Y]
    whole, rng = found.whole, np.random.default_rng(2)
    drawn = rng.multivariate_normal(whole.best.theta, whole.covariance, 2000)
    modes = [replace(whole.best, theta=theta).standing() for theta in drawn]
    np.testing.assert_allclose(frequency, np.std([m.omega_n for m in modes], axis=0), rtol=0.1)
    np.testing.assert_allclose(damping, np.std([m.zeta for m in modes], axis=0), rtol=0.1)
    assert set(mode_deviations(found)) == set(found.axes)


def test_the_speed_of_an_answer_is_known():
    middle = by_hand.SPEEDS[0]
    turning = coupled_by_hand.machine(1)
    assert coupled_by_hand.machine().speed_answered() is None
    assert turning.speed_answered() == turning.at(None).turning == middle
    assert turning.speed_answered(700.0) == turning.at(700.0).speed_answered() == turning.at(700.0).turning == 700.0
    # by default the tip is that of the middle speed
    one, other = (each.tip(by_hand.tooling(), OMEGA, spread=False).values for each in (turning, turning.at(middle)))
    np.testing.assert_array_equal(one, other)


def test_softened_modes_are_those_of_their_speed():
    machine = coupled_by_hand.machine(softening=True)
    slow, fast = (machine.at(speed).standing.omega_n for speed in (600.0, 1400.0))
    assert np.all(slow > fast)
    np.testing.assert_allclose(machine.at(1000.0).standing.omega_n, coupled_by_hand.machine().standing.omega_n, rtol=1e-9)


def test_kept_sides_stay_small():
    machine = coupled_by_hand.machine()
    assert machine.unknowns * machine.lines().size <= MOST_KEPT_OF_BOTH
    kept = machine.kept()
    assert kept.prepared
    expected, found = (each.tip(by_hand.tooling()) for each in (machine, kept))
    np.testing.assert_allclose(found.spread, expected.spread, rtol=1e-9, atol=1e-20)
    wider = replace(machine, identified_band=(by_hand.BAND[0], 2.0 * by_hand.BAND[1]))
    assert wider.unknowns * wider.lines().size > MOST_KEPT_OF_BOTH
    assert wider.kept() is wider


def test_it_travels_and_says_what_it_is():
    machine = coupled_by_hand.machine(1)
    again = pickle.loads(pickle.dumps(machine))
    np.testing.assert_array_equal(again.tip(by_hand.tooling(), OMEGA).values, machine.tip(by_hand.tooling(), OMEGA).values)
    assert "X and Y together 4 modes" in str(machine)
    assert "changes with speed" in str(machine)


def test_planes_that_feel_each_other_are_known_warm_alone():
    machine = replace(coupled_by_hand.machine(), warming=LearnedWarming(-0.02, 0.001, coldest=22.0, warmest=38.0))
    assert machine.thermometer is None
    assert machine.state() == "warm machine"
    assert machine.at_temperature(None) is machine
    with pytest.raises(InputError, match="it depends on no temperature"):
        machine.at_temperature(30.0)
