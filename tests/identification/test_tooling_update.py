"""One cut or one tap of a new tool, on the virtual machine: no model that is fitted has made its lines."""

from dataclasses import replace
from functools import partial

import numpy as np
import pytest
import scipy.linalg

from rcsa_ident.identification.evidence import EvidenceSelection
from rcsa_ident.identification.hammer_data import with_tests
from rcsa_ident.identification.hammer_lines import HammerLines, noise_of, thinned
from rcsa_ident.identification.machine_prior import KnownMachine
from rcsa_ident.identification.misfit import Misfit
from rcsa_ident.identification.priors import Priors
from rcsa_ident.identification.rough_data import with_rough_toolings
from rcsa_ident.identification.search import SearchSettings
from rcsa_ident.identification.tooling_update import fit_further
from rcsa_ident.identification.unknowns import Layout, ModalBlock
from rcsa_ident.stability.tip_modes import TIP
from rcsa_ident.tool_holder.alteration import Alteration, altered
from rcsa_ident.tool_holder.drawings import Drawing, rough_toolings
from rcsa_ident.tool_holder.model import receptance_at_points
from rcsa_ident.tool_holder.rough import rough_tool_holder
from rcsa_ident.tool_holder.spread import Spread
from rcsa_ident.virtual.rotor import frequency_response, rotor
from rcsa_ident.workflows.learn_toolings import SURPRISING, UNEXPLAINED, _contradiction, _learnt, _taught
from tests.fixtures.virtual_shop import AXES, HIGHEST, TIP_OMEGA
from tests.identification.models import vector_of

#: Of the noise; fixed before these tests were first run.
SEED = 7
QUICK = EvidenceSelection(search=SearchSettings(modes=8, population=4, generations=2, steps=6), candidates=2)
#: What nobody has drawn: contact, fluted part and modulus off by what an honest drawing leaves open.
UNDRAWN = Alteration(
    fluted_diameter=0.03, youngs_modulus=-0.02, translational_stiffness=-0.45, rotational_stiffness=-0.35, rotational_damping=0.4
)


@pytest.fixture(scope="module")
def machine(shop):
    cuts, _ = shop.measurements(np.random.default_rng(SEED), fixture=False)
    return QUICK.run(shop.prepare(cuts), 1).machine


@pytest.fixture(scope="module")
def clamped(shop):
    """The tooling that never cut, as it truly is."""
    return replace(shop.held_out, assembly=altered(shop.held_out.assembly, UNDRAWN))


def of_one_cut(shop, clamped, speed=8000.0 * np.pi / 30.0):
    """Data of one cut of the altered tooling, seen through its drawing."""
    order = clamped.cutter.teeth * np.arange(1, int(2.0 * np.pi * HIGHEST / speed / clamped.cutter.teeth) + 1)
    model = rotor(shop.machine.spindle, clamped.assembly)
    values = frequency_response(model, order * speed, speed, outputs=("flange.x", "flange.y", "fixture.x", "fixture.y"))
    both = np.stack([values[:, :2] - values[:, 2:], values[:, 2:]], axis=1)
    name, drawn = clamped.name, shop.held_out
    own = replace(shop, toolings={name: drawn}, truth={name: [(order, order * speed, np.einsum("noii->nio", both))]})
    cuts, _ = own.measurements(np.random.default_rng(SEED + 1), fixture=False)
    rough = rough_toolings({name: Drawing(drawn.assembly, Spread())})
    return with_rough_toolings(own.prepare(cuts), rough, [rough_tool_holder(drawn.assembly, HIGHEST)])


def error(machine, assembly, shop, clamped):
    """Of the tip, the worse of X and Y."""
    true = np.einsum("nii->ni", shop.tips(clamped.assembly, 8000.0 * np.pi / 30.0))
    tip = machine.tip(assembly, TIP_OMEGA, spread=False)
    return max(np.linalg.norm(tip.between(f"tip.{a}", f"tip.{a}") - true[:, i]) / np.linalg.norm(true[:, i]) for i, a in enumerate(AXES))


@pytest.mark.slow
def test_one_cut_of_a_new_tool_teaches_its_tip(shop, machine, clamped):
    data = of_one_cut(shop, clamped)
    fit = fit_further(data, KnownMachine(machine.posteriors(), machine.toolings), 0.0)
    found = altered(shop.held_out.assembly, fit.data.rough.alteration(0, fit.values))
    before, after = error(machine, shop.held_out.assembly, shop, clamped), error(machine, found, shop, clamped)
    assert before > 0.15
    assert after < 0.05
    assert fit.solution.converged
    # what was learned holds what is true, and no more is left open than before
    centre, covariance = fit.before
    deviation, prior = np.sqrt(np.diag(fit.covariance)), np.sqrt(np.diag(covariance))
    assert np.all(deviation <= prior * (1.0 + 1e-9))
    names = [unknown.field for unknown in fit.data.rough.unknowns]
    true = np.array([getattr(UNDRAWN, name) for name in names]) / fit.data.rough.spread
    assert np.all(np.abs(fit.values - true) < 3.0 * deviation)
    # contact and diameter are hardly told apart, but one combination of them is known well, and none less than before
    ratios = np.sqrt(scipy.linalg.eigvalsh(fit.covariance, covariance))
    assert ratios[0] < 0.2
    assert ratios[-1] < 1.0 + 1e-9
    # and nothing of it was known before
    np.testing.assert_array_equal(centre, 0.0)


#: Frequencies of a tap, its noise [m/N], the standard deviation of a gain, and the share that each line is said to be off by.
TAP, TAP_NOISE, TAP_GAIN, TAP_SHARE = 2.0 * np.pi * np.arange(600.0, 4200.0, 2.0), 1e-9, 0.01, 0.02


def of_one_tap(shop, clamped, drawn=None, cuts=None):
    """Data of a tap of an altered tooling's tip along X and Y at standstill, seen through a drawing, behind cuts or alone."""
    drawn = drawn or shop.held_out
    rng = np.random.default_rng(SEED + 2)
    model, tests = rotor(shop.machine.spindle, clamped.assembly), []
    for axis in AXES:
        value = frequency_response(model, TAP, 0.0, (f"tip.{axis}",), (f"tip.{axis}",))[:, 0, 0]
        value = value * (1.0 + TAP_GAIN * rng.standard_normal())
        value = value + TAP_NOISE * (rng.standard_normal(TAP.size) + 1j * rng.standard_normal(TAP.size))
        variance = noise_of(value)
        kept = thinned(TAP, value, variance)
        variance = variance[kept] + 0.5 * (TAP_SHARE * np.abs(value[kept])) ** 2
        tests.append(HammerLines(f"tap {axis}", drawn.name, axis, TAP[kept], value[kept], variance, 0.0, 0.0))
    known = {} if cuts is None else {name: shop.toolings[name] for name in cuts.toolings}
    told = {**known, drawn.name: drawn}
    rough = rough_toolings({name: Drawing(each.assembly, Spread()) for name, each in told.items()})
    data = with_tests(cuts, tests, {drawn.name: partial(receptance_at_points, drawn.assembly)})
    return with_rough_toolings(data, rough, [rough_tool_holder(each.assembly, HIGHEST) for each in told.values()])


@pytest.mark.slow
def test_slopes_of_a_tap_are_those_of_its_residuals(shop, few):
    """By what the drawings do not tell: differences of two steps, whose error of second order is taken out."""
    data = of_one_tap(shop, shop.held_out, cuts=few)
    layout = Layout(
        (ModalBlock(3, softening=True, standstill=True), ModalBlock(2, softening=True, standstill=True)), len(data.coefficient_spread)
    )
    misfit = Misfit(data, Priors(), (0.02, 0.05))
    theta = vector_of(layout, ((600.0, 1400.0, 2500.0), (900.0, 2100.0)))
    first, count = layout.force.start + data.rough_place.start, len(data.rough.unknowns)
    theta[first : first + count] = np.random.default_rng(4).uniform(-1.0, 1.0, count)
    # a gain of a test is among the factors of its lines
    theta[layout.force.start] = 0.3
    here = misfit.evaluate(theta, layout, np.zeros((len(data.cut_ids), 2)), normal=True)

    def differences(k, size):
        step = size * np.eye(theta.size)[k]
        ahead, behind = (misfit.residual_at(theta + s, layout, here.nuisance).lines for s in (step, -step))
        return [(a - b) / (2.0 * size) for a, b in zip(ahead, behind, strict=True)]

    hit = [np.tile(axis.on_holder, 2) for axis in data.axes]
    for k in range(first, first + count):
        pairs = zip(differences(k, 2e-3), differences(k, 1e-3), strict=True)
        for i, (coarse, fine) in enumerate(pairs):
            expected, found = (4.0 * fine - coarse) / 3.0, here.linear.jacobians[i][k - layout.size]
            for rows in (hit[i], ~hit[i]):
                size = np.abs(expected[rows]).max()
                np.testing.assert_allclose(found[rows], expected[rows], rtol=0.0, atol=1e-6 * size + 1e-9)


@pytest.mark.slow
def test_one_tap_of_a_new_tool_teaches_its_tip(shop, machine, clamped):
    known = KnownMachine(machine.posteriors(), machine.toolings)
    fit = fit_further(of_one_tap(shop, clamped), known, 0.0)
    found = altered(shop.held_out.assembly, fit.data.rough.alteration(0, fit.values))
    taught = _taught(machine, fit.machine(known, [clamped.name]))
    before, after = error(machine, shop.held_out.assembly, shop, clamped), error(taught, found, shop, clamped)
    assert before > 0.15
    assert after < 0.05
    assert fit.solution.converged
    assert fit.surprise(0) < SURPRISING
    assert max(fit.misfit.model_error) < UNEXPLAINED
    # the spindle turns where the tip is asked for, and stood where it was hit: neighbouring lines are right or wrong together
    tooling = _learnt(replace(shop.held_out, spread=Spread()), fit, 0).tooling
    true = np.einsum("nii->ni", shop.tips(clamped.assembly, 8000.0 * np.pi / 30.0))
    tip = taught.tip(tooling, TIP_OMEGA)
    deviation = tip.deviation()
    away = [tip.between(f"tip.{a}", f"tip.{a}") - true[:, i] for i, a in enumerate(AXES)]
    size = [np.concatenate(deviation[row, row]) for row in TIP]
    inside = [np.abs(np.concatenate([z.real, z.imag])) <= 1.645 * s for z, s in zip(away, size, strict=True)]
    assert np.mean(inside) > 0.8


@pytest.mark.slow
def test_a_tap_of_another_tool_is_told(shop, machine):
    other = next(iter(shop.toolings.values()))
    fit = fit_further(of_one_tap(shop, other), KnownMachine(machine.posteriors(), machine.toolings), 0.0)
    assert _contradiction(fit, 0)
    assert "its taps" in _contradiction(fit, 0)
