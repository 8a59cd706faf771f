"""One cut of a new tool, on the virtual machine: no model that is fitted has made its lines."""

from dataclasses import replace

import numpy as np
import pytest
import scipy.linalg

from rcsa_ident.identification.evidence import EvidenceSelection
from rcsa_ident.identification.further_fit import fit_further
from rcsa_ident.identification.known_machine import KnownMachine
from rcsa_ident.identification.rough_data import with_rough_toolings
from rcsa_ident.identification.search import SearchSettings
from rcsa_ident.tool_holder.alteration import Alteration, altered
from rcsa_ident.tool_holder.drawings import Drawing, rough_toolings
from rcsa_ident.tool_holder.rough import rough_tool_holder
from rcsa_ident.tool_holder.spread import Spread
from rcsa_ident.virtual.rotor import frequency_response, rotor
from tests.fixtures.virtual_shop import AXES, HIGHEST, TIP_OMEGA, open_shop

#: Of the noise; fixed before these tests were first run.
SEED = 7
QUICK = EvidenceSelection(search=SearchSettings(modes=8, population=4, generations=2, steps=6), candidates=2)
#: What nobody has drawn: contact, fluted part and modulus off by what an honest drawing leaves open.
UNDRAWN = Alteration(
    fluted_diameter=0.03, youngs_modulus=-0.02, translational_stiffness=-0.45, rotational_stiffness=-0.35, rotational_damping=0.4
)


@pytest.fixture(scope="module")
def shop():
    return open_shop()


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


@pytest.mark.slow(40)
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
