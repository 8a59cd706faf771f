"""A tool-holder as a smooth function of what its drawing does not tell, beside the finite elements of the altered drawing."""

from dataclasses import replace

import numpy as np
import pytest

from rcsa_ident.io.settings.setups import read_tooling
from rcsa_ident.tool_holder.alteration import ALTERATIONS, Alteration, altered
from rcsa_ident.tool_holder.geometry import MATERIALS, BeamSegment, ToolAssembly
from rcsa_ident.tool_holder.model import tool_holder_receptance
from rcsa_ident.tool_holder.rough import rough_tool_holder
from tests.fixtures.paths import MACHINES

LEVER = 0.1
OMEGA = 2.0 * np.pi * np.linspace(250.0, 4300.0, 41)
#: Honest spreads, and how far each may be altered here: twice that.
FAR = {
    "stickout": 1e-4, "fluted_length": 1e-4, "fluted_diameter": 0.06, "youngs_modulus": 0.04, "translational_stiffness": 0.8,
    "rotational_stiffness": 0.8, "translational_damping": 1.5, "rotational_damping": 1.5, "holder_diameter": 0.01,
}  # fmt: skip


@pytest.fixture(scope="module", params=["S1-ER32", "S4-shrink"])
def case(request):
    assembly = read_tooling(MACHINES / "toolings" / f"{request.param}.toml").assembly
    return assembly, rough_tool_holder(assembly, 4300.0)


def of_finite_elements(assembly):
    """Flange tt, tr, rr, flange over tip t, r, tip over tip, scaled by the lever, from a mesh of the assembly's own."""
    response = tool_holder_receptance(assembly, OMEGA)
    a22, a21, a11 = response["flange", "flange"], response["flange", "tip"], response["tip", "tip"]
    columns = [a22[:, 0, 0], LEVER * a22[:, 0, 1], LEVER**2 * a22[:, 1, 1], a21[:, 0, 0], LEVER * a21[:, 1, 0], a11[:, 0, 0]]
    return np.stack(columns, axis=1)


def error(found, expected):
    return float(np.max(np.linalg.norm(found - expected, axis=0) / np.linalg.norm(expected, axis=0)))


def test_the_drawing_itself(case):
    assembly, rough = case
    found, slopes = rough.receptances(Alteration(), OMEGA, LEVER, tip=True)
    assert error(found, of_finite_elements(assembly)) < 2e-5
    assert slopes.shape == (0, 6, 0)
    # who asks for the flange alone is told the same of it
    np.testing.assert_array_equal(rough.receptances(Alteration(), OMEGA, LEVER)[0], found[:, :5])


@pytest.mark.parametrize("name", ALTERATIONS)
def test_one_thing_altered(case, name):
    assembly, rough = case
    for sign in (-1.0, 1.0):
        by = Alteration(**{name: sign * FAR[name]})
        found, _ = rough.receptances(by, OMEGA, LEVER, tip=True)
        expected = of_finite_elements(altered(assembly, by))
        drawn = of_finite_elements(assembly)
        # far better than leaving it out, and good in itself
        assert error(found, expected) < 1e-3
        assert error(found, expected) < 0.05 * error(drawn, expected)


def test_everything_altered_at_once(case):
    assembly, rough = case
    rng = np.random.default_rng(5)
    for _ in range(4):
        by = Alteration(**{name: float(rng.uniform(-1.0, 1.0)) * far for name, far in FAR.items()})
        expected = of_finite_elements(altered(assembly, by))
        assert error(rough.receptances(by, OMEGA, LEVER, tip=True)[0], expected) < 3e-3


def test_slopes_are_those_of_the_values(case):
    _, rough = case
    by = Alteration(stickout=5e-5, fluted_length=-5e-5, fluted_diameter=0.03, youngs_modulus=-0.02, translational_stiffness=0.4,
                    rotational_stiffness=-0.3, translational_damping=0.5, rotational_damping=-0.5, holder_diameter=0.004)  # fmt: skip
    _, slopes = rough.receptances(by, OMEGA, LEVER, ALTERATIONS, tip=True)

    def differences(name, step):
        ends = (replace(by, **{name: getattr(by, name) + sign * step}) for sign in (1.0, -1.0))
        ahead, behind = (rough.receptances(end, OMEGA, LEVER, tip=True)[0] for end in ends)
        return (ahead - behind) / (2.0 * step)

    for k, name in enumerate(ALTERATIONS):
        # Richardson: differences of two steps, their error of second order taken out
        coarse, fine = (differences(name, step * FAR[name]) for step in (2e-3, 1e-3))
        expected = (4.0 * fine - coarse) / 3.0
        for column in range(6):
            np.testing.assert_allclose(
                slopes[:, column, k], expected[:, column], rtol=0.0, atol=1e-6 * np.abs(expected[:, column]).max(), err_msg=name
            )
    chosen = rough.receptances(by, OMEGA, LEVER, ("youngs_modulus",), tip=True)[1]
    np.testing.assert_allclose(chosen[:, :, 0], slopes[:, :, ALTERATIONS.index("youngs_modulus")], rtol=1e-11)


def test_it_dissipates_whatever_is_altered(case):
    """The imaginary part of the flange's receptance is nowhere positive: with e^{i w t} that would be a source of energy."""
    _, rough = case
    rng = np.random.default_rng(6)
    for _ in range(5):
        by = Alteration(**{name: float(rng.uniform(-1.5, 1.5)) * far for name, far in FAR.items()})
        tt, tr, rr, _, _ = rough.receptances(by, OMEGA, LEVER)[0].imag.T
        blocks = np.moveaxis(np.array([[tt, tr], [tr, rr]]), -1, 0)
        values = np.linalg.eigvalsh(blocks)
        assert np.all(values <= 1e-9 * np.abs(values).max())


def test_a_rigid_connection_and_a_plain_tool():
    carbide, steel = MATERIALS["carbide"], MATERIALS["steel"]
    assembly = ToolAssembly((BeamSegment(0.1, 0.012, carbide),), (BeamSegment(0.06, 0.05, steel, 0.012),), insertion=0.04)
    rough = rough_tool_holder(assembly, 4300.0)
    assert error(rough.receptances(Alteration(), OMEGA, LEVER, tip=True)[0], of_finite_elements(assembly)) < 2e-5
    # what is not there changes nothing
    none = Alteration(translational_stiffness=0.5, rotational_damping=1.0, fluted_diameter=0.05)
    np.testing.assert_allclose(rough.receptances(none, OMEGA, LEVER)[0], rough.receptances(Alteration(), OMEGA, LEVER)[0], rtol=1e-9)
    softer = Alteration(youngs_modulus=-0.04)
    assert error(rough.receptances(softer, OMEGA, LEVER, tip=True)[0], of_finite_elements(altered(assembly, softer))) < 1e-3
