"""An identified machine: which model answers at a speed, what is kept of it, what it tells of itself."""

from __future__ import annotations

import pickle
from dataclasses import replace

import numpy as np
import pytest

from rcsa_ident.base.errors import InputError
from rcsa_ident.dynamics.coordinates import Dof
from rcsa_ident.identification import machine as module
from rcsa_ident.identification.result import workpiece_after
from rcsa_ident.identification.status import Status
from rcsa_ident.machine.machine import LOWEST
from tests.fixtures import by_hand

OMEGA = 2.0 * np.pi * np.linspace(300.0, 3000.0, 100)
LOW, HIGH = 600.0, 1400.0


def banded():
    """Slow and fast speeds with models of their own."""
    slow, fast = by_hand.machine(0.9), by_hand.machine(1.1)
    return by_hand.over_speed([((LOW, 1000.0), slow), ((1000.0, HIGH), fast)]), slow, fast


def test_a_speed_band_answers_with_its_own_machine():
    machine, slow, fast = banded()
    assert machine.at(None) is machine
    # beyond both ends the nearest one
    for speed, model in ((700.0, slow), (1001.0, fast), (10.0, slow), (9000.0, fast)):
        assert machine.at(speed).identified is model.identified
        assert machine.at(speed).speed_models == ()
    assert machine.speed_range == (LOW, HIGH)
    assert machine.at(700.0).speed_range is None
    models = machine.models(np.array([1200.0, 700.0, 10.0, 1399.0]))
    assert [(model.identified is fast.identified, places.tolist()) for model, places in models] == [(True, [0, 3]), (False, [1, 2])]
    assert models[1][0].identified is slow.identified
    # all of its band and what speaks against it belong to each of them
    doubtful = replace(machine, status=Status.SUSPECT, reasons=("few cuts",))
    assert doubtful.at(700.0).remarks == doubtful.remarks
    assert doubtful.at(700.0).band == machine.band


def test_without_bands_one_model_answers():
    machine = by_hand.machine()
    assert machine.at(700.0) is machine
    ((model, places),) = machine.models(np.array([1200.0, 700.0]))
    assert model is machine
    np.testing.assert_array_equal(places, [0, 1])


def test_a_machine_without_a_posterior_stays():
    assert by_hand.machine(known=False, softening=True).speed_range is None
    assert by_hand.machine().speed_range is None
    assert by_hand.machine(softening=True).speed_range == (LOW, HIGH)
    assert by_hand.machine(known=False, softening=True).at(700.0).tip(by_hand.tooling(), OMEGA).variation is None


def test_one_model_that_changes_stands_at_a_speed():
    machine = by_hand.machine(softening=True)
    for speed in (None, 650.0, 1000.0, 5000.0):
        here = machine.at(speed)
        for axis, part in zip((Dof.X, Dof.Y), here.parts, strict=True):
            modes, joint = machine.identified[axis].posterior.machine(axis, speed=speed)
            np.testing.assert_array_equal(part.believed.flange.phi, modes.phi)
            np.testing.assert_array_equal(part.believed.flange.omega_n, modes.omega_n)
            assert part.believed.joint == joint
    assert machine.at(700.0).at(1300.0).speed == 1300.0
    inside = by_hand.over_speed([((100.0, 500.0), by_hand.machine()), ((500.0, 900.0), machine)])
    assert inside.at(200.0).speed is None
    assert inside.at(800.0).speed == 800.0
    # of its own change and its bands', the lowest and the highest
    assert replace(inside, identified=machine.identified).speed_range == (100.0, HIGH)


@pytest.mark.parametrize("rivals", [0, 1])
def test_what_is_kept_answers_alike(rivals):
    machine = by_hand.machine(rivals=rivals)
    kept = machine.kept()
    assert kept.prepared
    assert not machine.prepared
    assert kept.kept() is kept
    omega = machine.lines()
    assert omega[0] == pytest.approx(2.0 * np.pi * LOWEST)
    one, other = (each.tip(by_hand.tooling(), stiffness_spread=0.01) for each in (machine, kept))
    np.testing.assert_array_equal(one.values, other.values)
    np.testing.assert_array_equal(one.spread, other.spread)
    # other frequencies are worked out anew
    one, other = (each.tip(by_hand.tooling(), OMEGA) for each in (machine, kept))
    np.testing.assert_array_equal(one.values, other.values)
    np.testing.assert_array_equal(one.spread, other.spread)


def test_a_spread_is_kept_only_where_it_is_asked_for():
    half = by_hand.machine().kept(spread=False)
    assert half.kept_sides
    assert not half.prepared
    assert half.kept(spread=False) is half
    assert half.kept().prepared
    assert by_hand.machine(known=False).kept(spread=False).prepared


def test_what_changes_with_speed_or_is_too_large_is_not_kept(monkeypatch):
    for machine in (by_hand.machine(softening=True), banded()[0]):
        assert machine.kept() is machine
    monkeypatch.setattr(module, "MOST_KEPT", 1000)
    machine = by_hand.machine()
    assert machine.kept() is machine
    assert machine.unknowns == 2 * machine.identified[Dof.X].posterior.theta.size
    assert by_hand.machine(known=False).unknowns == 0


def test_another_process_is_sent_nothing_that_is_kept():
    """What it gets answers to the last digit."""
    machine = by_hand.machine()
    plain = len(pickle.dumps(machine))
    kept = machine.kept()
    before = kept.tip(by_hand.tooling(), OMEGA)
    text = pickle.dumps(kept)
    assert len(text) < 1.01 * plain + 100
    again = pickle.loads(text)
    assert again.kept_sides == ()
    assert not again.prepared
    after = again.tip(by_hand.tooling(), OMEGA)
    np.testing.assert_array_equal(after.values, before.values)
    np.testing.assert_array_equal(after.spread, before.spread)
    part = pickle.loads(pickle.dumps(kept.parts[0]))
    assert len(part.doubt().steps) == len(kept.parts[0].doubt().steps)
    banded_again = pickle.loads(pickle.dumps(banded()[0]))
    assert banded_again.speed_range == (LOW, HIGH)
    assert banded_again.at(700.0).tip(by_hand.tooling(), OMEGA).values.shape == (100, 2, 2)


def test_what_speaks_against_it_is_said():
    assert by_hand.machine().remarks == ()
    found = by_hand.identification().machine
    assert found.remarks == ("the identification is suspect: few cuts: 2 with T1, at least 8 are wanted",)


def test_an_identification_hands_over_what_it_knows(tmp_path):
    campaign = by_hand.campaign(tmp_path)
    found = replace(by_hand.identification(), campaign="by hand", workpiece=campaign.workpiece, sensors=campaign.sensors)
    machine = found.machine
    assert machine.band == found.band
    assert (machine.name, machine.sensors) == ("by hand", campaign.sensors)
    # as well known as the cuts have left it
    known = {coefficient.term: value for coefficient, value in found.coefficients.items() if not coefficient.tooling}
    assert machine.workpiece == workpiece_after(campaign.workpiece, known)
    assert machine.status is found.status
    for axis, part in found.axes.items():
        assert machine.identified[axis].spindle.modes is part.modes
        assert machine.identified[axis].posterior is part.posterior
    with pytest.raises(InputError, match="failed: no usable cut"):
        _ = replace(found, axes={}, status=Status.FAILED, reasons=("no usable cut",)).machine


def test_where_a_further_identification_may_start():
    machine = by_hand.machine()
    assert machine.posteriors() == {axis: part.posterior for axis, part in machine.identified.items()}
    parts = {**machine.identified, Dof.Y: replace(machine.identified[Dof.Y], posterior=None)}
    with pytest.raises(InputError, match=r"axes\.Y"):
        replace(machine, identified=parts).posteriors()
