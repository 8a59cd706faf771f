"""Plans of cuts: what is allowed, what is stable, what is gained, and what is said when a band is out of reach."""

from dataclasses import replace

import numpy as np
import pytest

from rcsa_ident.base.errors import InputError
from rcsa_ident.cutting.coefficients import CuttingCoefficients
from rcsa_ident.cutting.conditions import Engagement
from rcsa_ident.cutting.process import MillingProcess
from rcsa_ident.cutting.profile import Profile
from rcsa_ident.dynamics.coordinates import Coordinate, Dof
from rcsa_ident.identification.experiment_design import Volume
from rcsa_ident.identification.machine import IdentifiedMachine
from rcsa_ident.identification.modal_parameters import ModalParameters
from rcsa_ident.identification.posterior import MachineAxis, Posterior
from rcsa_ident.identification.unknowns import ModalBlock, pack
from rcsa_ident.machine.spindle import Spindle
from rcsa_ident.stability.lobes import stability_lobes
from rcsa_ident.workflows.plan import CutConstraints, line_noise, plan_cuts
from tests.fixtures.virtual_shop import open_shop

RPM = np.pi / 30.0
COEFFICIENTS = CuttingCoefficients(902e6, 0.26, tangential_spread=0.01, ratio_spread=0.01)
ALLOWED = CutConstraints(8000.0 * RPM, 20000.0 * RPM, (0.2e-3, 0.6e-3), 1e-4, Engagement.from_immersion(0.5, "down"))
BAND = (600.0, 4000.0)


def machine_of(deviation=0.05, seed=1):
    """A machine made by hand whose unknowns are known to a few percent, some better than others."""
    rng = np.random.default_rng(seed)
    machine = {}
    for axis, shift in ((Dof.X, 1.0), (Dof.Y, 0.93)):
        natural = 2.0 * np.pi * shift * np.array([150.0, 950.0, 1750.0, 3300.0])
        shapes = np.array([[0.08, 0.05], [0.14, 0.12], [0.18, -0.2], [0.15, 0.4]])
        factor = np.diag(np.sqrt(2.0 * 0.05 * natural))
        physics = ModalParameters(natural, shapes, factor, np.diag([2e-5, 3e-5]), np.zeros((4, 0)), np.zeros((0, 2)), np.zeros((0, 0)))
        theta = np.concatenate([pack(physics), np.log([3e9, 6e6, 2e3, 10.0])])
        own = deviation * np.exp(rng.uniform(-2.0, 0.0, theta.size))
        posterior = Posterior(theta, np.diag(own**2), ModalBlock(4))
        modes, joint = posterior.machine(axis)
        machine[axis] = MachineAxis(Spindle(modes), joint, posterior)
    return IdentifiedMachine(machine, (2.0 * np.pi * BAND[0], 2.0 * np.pi * BAND[1]))


def with_axes(machine, **axes):
    """The same machine with some of its axes alone, or changed."""
    return replace(machine, identified={Dof(name): part for name, part in axes.items()})


def plan(toolings, targets, count=6, allowed=ALLOWED, machine=None, noise=1e-10, **more):
    machine = machine_of() if machine is None else machine
    return plan_cuts(machine, toolings, targets, allowed, COEFFICIENTS, noise, {Dof.X: 2e-3, Dof.Y: 2e-3}, BAND, count, **more)


@pytest.fixture(scope="module")
def planned(toolings, targets):
    return plan(toolings, targets, 8)


@pytest.mark.slow
def test_every_cut_is_stable_by_the_lobes_and_some_that_are_not_were_there(planned, toolings):
    assert planned.unstable > 0
    omega = 2.0 * np.pi * np.arange(100.0, 4300.0, 1.0)
    for tooling in toolings:
        own = [c for c in (*planned.cuts, *planned.even_cuts) if c.tooling == tooling.name]
        assert own
        speeds = np.array([c.conditions.spindle_speed for c in own])
        depths = np.array([c.conditions.axial_depth for c in own])
        tip, process = machine_of().tip(tooling, omega, spread=False), MillingProcess(tooling.cutter, COEFFICIENTS, ALLOWED.engagement)
        for factor in (0.99, 1.0, 1.01):
            lobes = stability_lobes(tip, process, factor * speeds, 0.01)
            assert np.all(lobes.limit_depth >= 1.499 * depths)


@pytest.mark.slow
def test_speeds_are_allowed_whole_and_a_percent_apart(planned, toolings):
    for cuts in (planned.cuts, planned.even_cuts):
        assert len(cuts) == 8
        for tooling in toolings:
            rpm = np.sort([c.conditions.spindle_speed / RPM for c in cuts if c.tooling == tooling.name])
            np.testing.assert_allclose(rpm, np.round(rpm), atol=1e-6)
            assert np.all(rpm[1:] / rpm[:-1] >= 1.01)
            assert np.all((rpm > 7999.0) & (rpm < 20001.0))


@pytest.mark.slow
def test_bands_fall_with_every_cut(planned, targets):
    assert planned.targets == tuple(t.name for t in targets)
    assert planned.band.shape == (9, 2)
    assert np.all(np.diff(planned.band, axis=0) < 0.0)


@pytest.mark.slow
def test_the_band_before_any_cut_is_that_of_the_tooltip(toolings, targets):
    machine = machine_of(1e-3)
    before = plan(toolings, targets, 1, machine=machine).band[0]
    omega = 2.0 * np.pi * np.linspace(*BAND, 400)
    for tooling, known in zip(targets, before, strict=True):
        # by finite differences of the coupled machine, on other frequencies
        tip = machine.tip(tooling, omega)
        entries = [(Coordinate("tip", axis),) * 2 for axis in (Dof.X, Dof.Y)]
        parts = [np.sum(np.square(tip.deviation()[e])) / np.sum(np.abs(tip.between(*(str(c) for c in e))) ** 2) for e in entries]
        assert known == pytest.approx(np.sqrt(np.mean(parts)), rel=0.01)


@pytest.mark.slow
def test_the_plan_beats_even_speeds(planned):
    assert np.mean(planned.band[-1] ** 2) < np.mean(planned.even**2)


@pytest.mark.slow
def test_the_same_call_gives_the_same_plan(planned, toolings, targets):
    again = plan(toolings, targets, 8)
    assert again.cuts == planned.cuts
    np.testing.assert_array_equal(again.band, planned.band)


@pytest.mark.slow
def test_fewest_says_how_many_and_whether(planned):
    widest = planned.band.max(axis=1)
    assert planned.fewest(widest[3]).cuts == 3
    assert planned.fewest(10.0 * widest[0]).cuts == 0
    short = planned.fewest(0.5 * widest[-1])
    assert (short.cuts, short.band, short.reached) == (8, widest[-1], False)
    with pytest.raises(InputError, match="wanted band"):
        planned.fewest(0.0)


@pytest.mark.slow
def test_a_wanted_band_takes_no_more_cuts_than_it_must(planned, toolings, targets):
    wanted = float(planned.band[4].max())
    found = plan(toolings, targets, 8, wanted=wanted)
    assert len(found.cuts) <= 4
    assert found.band[-1].max() <= wanted
    assert found.fewest(wanted).reached
    assert not found.warnings
    assert plan(toolings, targets, 8, wanted=1.0).cuts == ()


def test_a_band_out_of_reach_is_said_with_how_far_it_goes(toolings, targets):
    found = plan(toolings, targets, 3, wanted=1e-5)
    assert len(found.cuts) == 3
    assert "0.001 % is not reached: 3 cuts give" in found.warnings[0]


def test_fewer_cuts_than_asked_for_are_said(toolings, targets):
    found = plan(toolings[:1], targets, 9, replace(ALLOWED, highest=8200.0 * RPM, depths=(1e-4,)))
    assert 0 < len(found.cuts) <= 3
    assert f"only {len(found.cuts)} of 9 cuts" in found.warnings[0]


def test_without_a_posterior_or_a_stable_cut_there_is_no_plan(toolings, targets):
    x, y = machine_of().identified.values()
    half = with_axes(machine_of(), x=replace(x, posterior=None), y=y)
    with pytest.raises(InputError, match="posterior"):
        plan(toolings, targets, machine=half)
    with pytest.raises(InputError, match=r"none of .* stable with a margin of 1\.5 .*the deepest stable one would be"):
        plan(toolings, targets, allowed=replace(ALLOWED, depths=(0.05,)))
    with pytest.raises(InputError, match="at least one tooling"):
        plan([], targets)
    with pytest.raises(InputError, match="different names"):
        plan(toolings[:1] * 2, targets)


@pytest.mark.parametrize(
    ("change", "words"),
    [({"lowest": 0.0}, "lowest speed"), ({"highest": 1.0}, "highest speed"), ({"depths": ()}, "depths"), ({"margin": 0.5}, "margin")],
)
def test_what_may_not_be_allowed(change, words):
    with pytest.raises(InputError, match=words):
        replace(ALLOWED, **change)


@pytest.mark.slow
def test_most_information_is_another_plan(planned, toolings, targets):
    other = plan(toolings, targets, 8, goal=Volume())
    assert {(c.tooling, c.conditions.spindle_speed) for c in other.cuts} != {(c.tooling, c.conditions.spindle_speed) for c in planned.cuts}
    assert np.mean(other.band[-1] ** 2) > np.mean(planned.band[-1] ** 2)


def test_a_machine_with_one_axis_has_a_plan(toolings, targets):
    found = plan(toolings, targets, 2, machine=with_axes(machine_of(), y=machine_of().identified[Dof.Y]))
    assert len(found.cuts) == 2
    assert found.band[-1].max() < found.band[0].max()


def test_noise_is_that_of_the_lines():
    cuts, _ = open_shop(speeds=3).measurements(np.random.default_rng(1), noise=2e-10)
    # gap, and half of it for the fixture
    assert line_noise(cuts) == pytest.approx(2e-10 * np.hypot(1.0, 0.5), rel=1e-9)
    with pytest.raises(InputError, match="usable"):
        line_noise([])


def test_a_chip_thickness_sets_each_cutters_feed(toolings, targets):
    """High-feed cutters take several times the feed of a wall for the same chip; their own tooling's cuts are planned with it."""
    flat, other = toolings
    lean = replace(other.cutter, profile=Profile.face(other.cutter.diameter, np.radians(20.0), 5e-3))
    allowed = replace(ALLOWED, chip_thickness=0.05e-3)
    for cutter, times in ((flat.cutter, 1.0), (lean, 1.0 / np.sin(np.radians(20.0)))):
        assert allowed.feed_of(cutter, 0.3e-3) == pytest.approx(times * 0.05e-3, rel=5e-3)
    cuts = plan(toolings, targets, 2, allowed).cuts
    assert [each.conditions.feed_per_tooth for each in cuts] == pytest.approx([0.05e-3] * 2)
