"""Hammer tests beside cuts and in their place: what the model says of them, and what an identification makes of them."""

from dataclasses import replace
from functools import partial

import numpy as np
import pytest

from rcsa_ident.base.errors import InputError
from rcsa_ident.base.remarks import says
from rcsa_ident.coupling.rcsa import couple
from rcsa_ident.dynamics.coordinates import Coordinate, Dof
from rcsa_ident.identification.evidence import EvidenceSelection
from rcsa_ident.identification.genetic_algorithm import PaperGeneticAlgorithm
from rcsa_ident.identification.hammer_data import GAIN_SPREAD, with_tests
from rcsa_ident.identification.hammer_lines import HammerLines, noise_of, thinned
from rcsa_ident.identification.misfit import Misfit
from rcsa_ident.identification.modal_parameters import flange_modes
from rcsa_ident.identification.priors import Priors
from rcsa_ident.identification.result import IdentificationCode
from rcsa_ident.identification.search import SearchSettings
from rcsa_ident.identification.sweep_correction import unswept
from rcsa_ident.identification.unknowns import Layout, ModalBlock, joint_of, unpack
from rcsa_ident.tool_holder.model import point_name, receptance_at_points, tool_holder_receptance
from rcsa_ident.virtual.rotor import frequency_response, rotor
from tests.fixtures.virtual_shop import AXES, TIP_OMEGA
from tests.identification.models import vector_of

OMEGA = 2.0 * np.pi * np.arange(150.0, 4001.0, 2.0)
#: Of noise and gains; not changed since these tests were first run.
SEED = 7
SMALL = EvidenceSelection(search=SearchSettings(modes=8, population=4, generations=2, steps=6), candidates=2)


def at_points(shop):
    return {name: partial(receptance_at_points, tooling.assembly) for name, tooling in shop.toolings.items()}


def v_flange(assembly):
    """Distance of the step in front of the holder's flange from the tip."""
    return assembly.stickout + sum(s.length for s in assembly.holder[:-1])


def stiffer(spindle, share):
    """The spindle with all that holds it stiffer by a share, shaft included."""

    def springs(part, *names):
        return replace(part, **{name: tuple((1.0 + share) * value for value in getattr(part, name)) for name in names})

    steel = spindle.shaft[0].material
    hard = replace(steel, youngs_modulus=(1.0 + share) * steel.youngs_modulus)
    return replace(
        spindle,
        shaft=tuple(replace(each, material=hard) for each in spindle.shaft),
        bearings=tuple(springs(each, "stiffness") for each in spindle.bearings),
        housing=springs(spindle.housing, "stiffness", "tilting_stiffness"),
    )


def hit(shop, name, rng, axes=AXES, points=("tip", "v"), noise=5e-10, higher=0.0):
    """Tests of a tooling with noise and gains of a percent, and the gains; by the share `higher` are the machine's frequencies."""
    assembly = shop.toolings[name].assembly
    place = {"tip": 0.0, "v": v_flange(assembly), "flange": None}
    model = rotor(stiffer(shop.machine.spindle, (1.0 + higher) ** 2 - 1.0), assembly, points={"v": place["v"]})
    tests, gains = [], []
    for axis in axes:
        true = frequency_response(model, OMEGA, 0.0, (f"tip.{axis}",), tuple(f"{point}.{axis}" for point in points))[:, :, 0]
        for point, value in zip(points, true.T, strict=True):
            gains.append(1.0 + 0.01 * rng.standard_normal())
            value = gains[-1] * value + noise * (rng.standard_normal(OMEGA.size) + 1j * rng.standard_normal(OMEGA.size))
            variance = noise_of(value)
            kept = thinned(OMEGA, value, variance)
            known = variance[kept] + 0.5 * (0.005 * np.abs(value[kept])) ** 2
            own = HammerLines(f"{name} {point} {axis}", name, axis, OMEGA[kept], value[kept], known, 0.0, place[point])
            tests.append(own)
    return tests, np.array(gains)


def model_of(data, theta, layout):
    return Misfit(data, Priors(), (0.0,) * len(data.axes)).models(theta, layout)


@pytest.fixture(scope="module")
def first(shop):
    return next(iter(shop.toolings))


@pytest.mark.parametrize(("response", "force"), [(0.0, 0.0), (0.0, 0.09), (0.09, 0.0), (0.05, 0.1), (None, 0.0), (0.0, None), (0.03, None)])
def test_the_model_is_that_of_coupled_receptances(shop, first, response, force):
    """By another road: the machine as complex modes, all in SI; between tip and flange also by the room of couplings."""
    omega = OMEGA[::40]
    test = HammerLines("1", first, Dof.X, omega, np.ones(omega.size), np.ones(omega.size), response, force)
    data = with_tests(None, [test], at_points(shop))
    layout = Layout((ModalBlock(3),), len(data.coefficient_spread))
    theta = vector_of(layout, ((600.0, 1400.0, 2500.0),))
    theta[layout.force] = 0.03
    (found,) = model_of(data, theta, layout)
    points = [z for z in (response, force) if z is not None]
    free = receptance_at_points(shop.toolings[first].assembly, omega, list(dict.fromkeys(points)))
    spindle = flange_modes(unpack(theta[layout.axis(0)], layout.axes[0]), Dof.X).receptance(omega)
    joint = joint_of(theta[layout.joint])
    damped = np.array(
        [[joint.translational_stiffness, joint.translational_damping], [joint.rotational_stiffness, joint.rotational_damping]]
    )
    gap = 1.0 / (damped[:, 0] + 1j * omega[:, None] * damped[:, 1])
    inside = np.linalg.inv(free["flange", "flange"] + spindle["flange", "flange"] + gap[:, :, None] * np.eye(2))
    if response is None or force is None:
        (other,) = points
        expected = (spindle["flange", "flange"] @ inside @ free["flange", point_name(other)])[:, 0, 0]
    else:
        p, q = point_name(response), point_name(force)
        expected = (free[p, q] - free[p, "flange"] @ inside @ free["flange", q])[:, 0, 0]
    np.testing.assert_allclose(found[:, 0], np.exp(0.03) * expected, rtol=1e-6, atol=1e-9 * np.abs(expected).max())
    if points in ([0.0], [0.0, 0.0]):
        joined = couple(tool_holder_receptance(shop.toolings[first].assembly, omega), spindle, joint)
        known = joined.between("spindle.x" if None in (response, force) else "tip.x", "tip.x")
        np.testing.assert_allclose(expected, known, rtol=1e-5, atol=1e-6 * np.abs(known).max())


def test_tests_stand_behind_the_cuts_and_change_nothing_about_them(shop, rich, first):
    tests, _ = hit(shop, first, np.random.default_rng(SEED), axes=(Dof.X,))
    both = with_tests(rich, tests, at_points(shop))
    assert both.cuts == len(rich.cut_ids)
    assert both.cut_ids[both.cuts :] == tuple(test.id for test in tests)
    assert both.coefficients == rich.coefficients
    added = both.coefficient_spread[len(rich.coefficient_spread) :]
    assert added == (GAIN_SPREAD,) * 2
    assert both.speed_range == rich.speed_range
    np.testing.assert_allclose(both.relative_speed[: both.cuts], rich.relative_speed)
    assert np.all(both.relative_speed[both.cuts :] == -1.0)
    x, y = both.axes
    # the axis that was hit has one output, the other one both as before
    assert (x.outputs, y.outputs) == (1, 2)
    np.testing.assert_array_equal(y.lines, rich.axes[1].lines)
    np.testing.assert_array_equal(x.lines[x.cut < both.cuts], rich.axes[0].summed().lines)
    assert not x.force_slope[x.cut < both.cuts, len(rich.coefficient_spread) :].any()


def test_beside_passes_cuts_sweep_and_hits_do_not(shop, first):
    cuts, _ = shop.measurements(np.random.default_rng(1), fixture=False, names=(first,))
    passes = shop.prepare([replace(cut, acceleration=200.0, length=0.28) for cut in cuts])
    tests, _ = hit(shop, first, np.random.default_rng(SEED), axes=(Dof.X,))
    both = with_tests(passes, tests, at_points(shop))
    layout = Layout((ModalBlock(3), ModalBlock(3)), len(both.coefficient_spread))
    theta = vector_of(layout, ((600.0, 1400.0, 2500.0),) * 2)
    freed, beside = (unswept(each, Priors(), theta, layout) for each in (passes, both))
    for alone, measured, found in zip(freed.axes, both.axes, beside.axes, strict=True):
        own = found.cut < both.cuts
        np.testing.assert_allclose(found.lines[own], alone.lines, rtol=1e-9)
        np.testing.assert_array_equal(found.lines[~own], measured.lines[~own])
    x = beside.axes[0]
    assert np.any(x.lines[x.cut < both.cuts] != passes.axes[0].lines)


def test_without_tests_there_is_nothing_to_stand_behind(shop, few):
    with pytest.raises(InputError, match="at least one hammer test"):
        with_tests(few, [], at_points(shop))


def test_the_published_method_refuses_them(shop, first):
    tests, _ = hit(shop, first, np.random.default_rng(SEED), axes=(Dof.X,))
    with pytest.raises(InputError, match="method: found paper, with hammer tests"):
        PaperGeneticAlgorithm().run(with_tests(None, tests, at_points(shop)), seed=1)


def test_a_sensors_mass_belongs_to_the_test_and_not_to_the_machine(shop, first):
    omega = OMEGA[::40]
    light, heavy = (HammerLines("1", first, Dof.X, omega, np.ones(omega.size), np.ones(omega.size), 0.0, 0.0, mass) for mass in (0.0, 0.02))
    layout = Layout((ModalBlock(3),), 1)
    theta = vector_of(layout, ((600.0, 1400.0, 2500.0),))
    theta[layout.force] = 0.0
    plain, loaded = (model_of(with_tests(None, [test], at_points(shop)), theta, layout)[0][:, 0] for test in (light, heavy))
    np.testing.assert_allclose(loaded / (1.0 + omega**2 * 0.02 * loaded), plain, rtol=1e-6)


@pytest.mark.slow
def test_tests_alone_tell_tools_that_were_never_hit(shop):
    rng = np.random.default_rng(SEED)
    made = [hit(shop, name, rng) for name in shop.toolings]
    tests, gains = [test for own, _ in made for test in own], np.concatenate([gains for _, gains in made])
    found = SMALL.run(with_tests(None, tests, at_points(shop)), seed=1)
    assert found.cut_ids == ()
    assert all(part.standstill is None for part in found.axes.values())
    assert found.coefficients == {}
    met = {test.lines.id: test for part in found.axes.values() for test in part.tests}
    for test, gain in zip(tests, gains, strict=True):
        assert met[test.id].error < 0.03
        assert abs(met[test.id].gain - gain) < 4.0 * met[test.id].gain_std
    assert says(found.notes, IdentificationCode.PLANES_NOT_ASKED)
    assert not says(found.reasons, IdentificationCode.FEW_CUTS)
    tip, true = found.machine.tip(shop.held_out, TIP_OMEGA), shop.tip(0.0)
    deviation = tip.deviation()
    for i, axis in enumerate(AXES):
        own = Coordinate("tip", axis)
        error, told = (np.linalg.norm(each) for each in (tip.between(str(own), str(own)) - true[:, i], np.hypot(*deviation[own, own])))
        assert told < 0.008 * np.linalg.norm(true[:, i])
        assert error < 2.5 * told


@pytest.mark.slow
def test_beside_cuts_they_help_and_what_standing_still_changes_is_found(shop, first):
    """Ten cuts of one tooling and a hammer on it: all frequencies stand 0.8 % higher while nothing turns."""
    cuts, _ = shop.measurements(np.random.default_rng(1), fixture=False, names=(first,))
    data = shop.prepare(cuts[::2])
    tests, _ = hit(shop, first, np.random.default_rng(SEED), higher=0.008)
    alone, both = (SMALL.run(each, seed=1) for each in (data, with_tests(data, tests, at_points(shop))))
    for part in both.axes.values():
        assert part.standstill is not None
        assert abs(part.standstill.frequency - 0.008) < 0.002
        assert abs(part.standstill.damping) < 0.05
    assert len(both.cut_ids) == both.delay.size == len(alone.cut_ids)
    assert all(part.measured["cut"].max() < len(both.cut_ids) for part in both.axes.values())
    true = shop.tip(14000.0 * np.pi / 30.0)
    errors = []
    for found in (alone, both):
        tip = found.machine.tip(shop.held_out, TIP_OMEGA, spread=False)
        own = [tip.between(f"tip.{axis}", f"tip.{axis}") - true[:, i] for i, axis in enumerate(AXES)]
        errors.append(np.linalg.norm(own) / np.linalg.norm(true))
    assert errors[1] < 0.5 * errors[0], errors


def test_the_virtual_hammer_hits_where_it_says(shop, first):
    """On either side of the joint, which are one where it is rigid."""
    assembly = shop.toolings[first].assembly
    plain, more = rotor(shop.machine.spindle, assembly), rotor(shop.machine.spindle, assembly, points={"v": v_flange(assembly)})
    assert more.coordinates[: len(plain.coordinates) - 2] == plain.coordinates[:-2]
    end = rotor(shop.machine.spindle, assembly, points={"end": assembly.stickout + assembly.holder_length})
    rigid = replace(shop.machine.spindle.joint, translational_stiffness=1e15, rotational_stiffness=1e12)
    stiff = rotor(replace(shop.machine.spindle, joint=rigid), assembly, points={"end": assembly.stickout + assembly.holder_length})
    omega = OMEGA[::200]
    for model, same in ((end, False), (stiff, True)):
        values = frequency_response(model, omega, 0.0, ("tip.x",), ("end.x", "flange.x"))[:, :, 0]
        assert np.allclose(values[:, 0], values[:, 1], rtol=1e-4, atol=0.0) is same
