"""What comes behind an identification whose planes feel each other: none of it takes the planes apart, or the speed for another."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from rcsa_ident.cutting.conditions import Engagement
from rcsa_ident.dynamics.coordinates import Dof
from rcsa_ident.machine.flange_machine import FlangeMachine
from rcsa_ident.machine.machine import TipSource
from rcsa_ident.setup.cut import CutSpec
from rcsa_ident.stability.discretisation import FullDiscretisation, SemiDiscretisation
from rcsa_ident.stability.multi_frequency import MultiFrequency
from rcsa_ident.stability.time_domain import TimeDomain
from rcsa_ident.stability.zero_order import ZeroOrder
from rcsa_ident.workflows.advise import advise
from rcsa_ident.workflows.compare import Place, compare
from rcsa_ident.workflows.contact import Support, TapTest, tap_model
from rcsa_ident.workflows.tool_change import ToolChange, map_of, spread_seconds, surface_of, tooltip
from tests.fixtures import by_hand, coupled_by_hand

RPM = np.pi / 30.0
#: Across the lobes of the machine made by hand, within its speeds.
SPEEDS = np.linspace(620.0, 1380.0, 7)
OMEGA = 2.0 * np.pi * np.linspace(300.0, 3000.0, 200)
CUT = CutSpec(
    Engagement(0.5 * np.pi, np.pi),
    feed_per_tooth=1e-4,
    coefficients={"tangential": 9e8, "radial_ratio": 0.3},
)


class Diagonal(TipSource):
    """A machine without what it feels across its planes: what an answer must not be."""

    def __init__(self, machine):
        self.machine = machine

    @property
    def band(self):
        return self.machine.band

    @property
    def speed_range(self):
        return self.machine.speed_range

    def at(self, speed):
        return Diagonal(self.machine.at(speed))

    def lines(self, beyond=1.0):
        return self.machine.lines(beyond)

    def tip(self, *arguments, **options):
        tip = self.machine.tip(*arguments, **options)
        return replace(tip, values=tip.values * np.eye(2), variation=None, poles=None)

    def __str__(self):
        return "diagonal"


def change(machine, method=None, speeds=SPEEDS):
    return ToolChange(machine, by_hand.tooling(), CUT, speeds, 20e-3, method or ZeroOrder(), 0)


@pytest.mark.parametrize("turning", [0, 1], ids=["oblique", "gyroscopic"])
@pytest.mark.parametrize("method", [ZeroOrder(), MultiFrequency(), SemiDiscretisation(), FullDiscretisation()], ids=lambda m: m.name)
def test_every_method_takes_the_cross_terms(turning, method):
    machine = coupled_by_hand.machine(turning)
    found = change(machine, method).limits().nominal
    diagonal = change(Diagonal(machine), method).limits().nominal
    assert np.max(np.abs(found / diagonal - 1.0)) > 0.02


@pytest.mark.slow
def test_time_domain_takes_the_cross_terms():
    machine, speeds = coupled_by_hand.machine(1), SPEEDS[[1, 5]]
    found = change(machine, TimeDomain(), speeds).limits().nominal
    np.testing.assert_allclose(found, change(machine, FullDiscretisation(), speeds).limits().nominal, rtol=0.03)
    diagonal = change(Diagonal(machine), FullDiscretisation(), speeds).limits().nominal
    assert np.max(np.abs(found / diagonal - 1.0)) > 0.03


def test_each_speed_has_its_own_cross_terms():
    """Gyroscopic moments grow with the speed: limits of a machine that stays at its middle speed are others."""
    machine = coupled_by_hand.machine(1)
    found = change(machine).limits().nominal
    one_by_one = np.concatenate([change(machine.at(speed), speeds=np.array([speed])).limits().nominal for speed in SPEEDS])
    np.testing.assert_allclose(found, one_by_one, rtol=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize("turning", [0, 1], ids=["oblique", "gyroscopic"])
def test_maps_surfaces_and_advice_take_them_too(turning):
    machine = coupled_by_hand.machine(turning)
    one, other = (map_of(change(each, speeds=SPEEDS[::3]), 20) for each in (machine, Diagonal(machine)))
    assert np.max(np.abs(one.growth - other.growth)) > 0.01
    one, other = (surface_of(change(each), 2e-4) for each in (machine, Diagonal(machine)))
    assert np.max(np.abs(one.error - other.error)) > 0.02 * np.max(np.abs(one.error))
    one, other = (advise(change(each), planned=[(1000.0, 1e-4)]) for each in (machine, Diagonal(machine)))
    assert np.max(np.abs(one.usable.stable / other.usable.stable - 1.0)) > 0.02
    assert one.planned[0].limit != pytest.approx(other.planned[0].limit, rel=1e-3)


def test_bands_of_limits_know_what_is_not_known_across():
    machine = coupled_by_hand.machine(1)
    asked = replace(change(machine, speeds=SPEEDS[::2]), draws=200)
    low, high = asked.limits().band
    certain = change(machine, speeds=SPEEDS[::2]).limits().nominal
    assert np.all(low < certain)
    assert np.all(certain < high)


def test_a_tooltip_says_its_speed():
    machine = coupled_by_hand.machine(1)
    found = tooltip(machine, by_hand.tooling(), OMEGA)
    assert found.speed == by_hand.SPEEDS[0]
    assert tooltip(machine, by_hand.tooling(), OMEGA, 700.0).speed == 700.0
    assert tooltip(coupled_by_hand.machine(), by_hand.tooling(), OMEGA).speed is None
    assert np.max(np.abs(found.tip.values[:, 0, 1] - found.tip.values[:, 1, 0])) > 0.1 * np.max(np.abs(found.tip.values[:, 0, 1]))


def test_spread_over_both_planes_is_dearer():
    one, both = by_hand.machine(), coupled_by_hand.machine()
    assert spread_seconds(both, OMEGA) / both.unknowns > 5.0 * spread_seconds(one, OMEGA) / one.unknowns


def test_a_tap_test_clamped_in_it_feels_both_planes():
    machine, tooling = coupled_by_hand.machine(1), by_hand.tooling()
    # idle: a spindle that does not turn, in a machine whose modes are those of `standing`
    idle = FlangeMachine((machine.standing,), by_hand.BAND, machine.whole.best.joint)
    truth = idle.tip(tooling, OMEGA)
    for axis in coupled_by_hand.AXES:
        support = Support(machine.standing, machine.whole.best.joint, axis)
        tap = TapTest(str(axis), tooling.assembly, OMEGA, truth.between(f"tip.{axis}", f"tip.{axis}"), support)
        np.testing.assert_allclose(tap_model(tap, tooling.assembly.contact), tap.values, rtol=1e-5)
        part = machine.identified[axis]
        alone = replace(tap, support=Support(part.spindle, part.joint))
        assert np.max(np.abs(tap_model(alone, tooling.assembly.contact) / tap.values - 1.0)) > 0.01


def test_a_hammer_test_is_compared_with_both_planes():
    machine, tooling = coupled_by_hand.machine(1), by_hand.tooling()
    for speed in (None, 700.0):
        truth = machine.at(speed).tip(tooling, OMEGA, spread=False)
        tests = {(Place.TIP, axis): (OMEGA, truth.between(f"tip.{axis}", f"tip.{axis}")) for axis in coupled_by_hand.AXES}
        for each in compare(machine, tests, tooling.assembly, speed):
            assert each.error < 1e-6
            assert each.deviation is not None
    (each,) = compare(coupled_by_hand.uncoupled(machine), {(Place.TIP, Dof.X): (OMEGA, truth.between("tip.x", "tip.x"))}, tooling.assembly)
    assert each.error > 0.01
