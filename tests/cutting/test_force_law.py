"""What stands behind wrong forces, against forces of the time domain and of other conditions."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import rcsa_ident as ri
from rcsa_ident.cutting.coefficients import REFERENCE_CHIP, ForceLaw
from rcsa_ident.cutting.conditions import CuttingConditions, Engagement
from rcsa_ident.cutting.force import force_lines
from rcsa_ident.cutting.force_law import KnownFactors, fit_law, law_changes
from rcsa_ident.cutting.profile import Profile
from rcsa_ident.virtual.changes import ChipLaw
from rcsa_ident.virtual.milling import rigid_force_lines

CUTTER = ri.Cutter(3, 0.012, helix=np.radians(30.0))
KNOWN = ri.CuttingCoefficients(700e6, 0.3, axial_ratio=0.1, tangential_edge=12e3, radial_edge=10e3)
DOWN = ri.Engagement.from_immersion(0.3, "down")
CUT = CuttingConditions(ri.rpm(12_000.0), 1e-3, 0.1e-3, DOWN, feed_angle=0.4)
ORDERS = np.arange(3, 28, 3)


def learned(other: np.ndarray, kind: int = 0, deviation: float = 2e-3) -> KnownFactors:
    """The factors on the simulated lines that another force has, X before Y."""
    log = np.log(other / force_lines(CUTTER, CUT, KNOWN, ORDERS))
    change = law_changes(CUTTER, CUT, KNOWN, ORDERS)
    return KnownFactors(kind, log.T.ravel(), np.full(log.size, deviation), change.swapaxes(0, 1).reshape(log.size, -1))


@pytest.mark.parametrize("shape", [CUTTER, ri.Cutter(2, 0.010, profile=Profile.bull_nose(0.010, 2e-3, None))], ids=["wall", "bull nose"])
def test_lines_of_a_curved_law(shape):
    """Slope by a quadrature along each arc against the force of the time domain by the curve itself."""

    def forces(exponent: float) -> np.ndarray:
        law = ChipLaw(exponent, REFERENCE_CHIP)
        return rigid_force_lines(shape, CUT, KNOWN, slices=64, samples=8192, law=law)[orders, :2]

    orders = np.arange(shape.teeth, 20, shape.teeth)
    # second order from one side: the law of the virtual machine has no exponent above 0
    slope = (4.0 * forces(-1e-3) - 3.0 * forces(0.0) - forces(-2e-3)) / 2e-3
    found = law_changes(shape, CUT, KNOWN, orders)[..., 2]
    np.testing.assert_allclose(found, -slope / forces(0.0), atol=3e-3 * np.abs(found).max())


@pytest.mark.parametrize(
    ("column", "unit", "moved", "cut"),
    [
        (0, 1e-3, replace(KNOWN, tangential=700e6 * np.exp(1e-3)), CUT),
        (1, 1e-3, replace(KNOWN, radial_ratio=0.3 * np.exp(1e-3)), CUT),
        (3, 1e-8, replace(KNOWN, tangential_edge=12e3 + 7.0), CUT),
        (4, 1e-8, replace(KNOWN, radial_edge=10e3 + 7.0), CUT),
        (5, 1e-5, KNOWN, replace(CUT, engagement=Engagement(DOWN.entry + 1e-5, DOWN.exit))),
    ],
    ids=["K_tc", "k_rc", "K_te", "K_re", "entry"],
)
def test_slopes_are_those_of_other_forces(column, unit, moved, cut):
    before = force_lines(CUTTER, CUT, KNOWN, ORDERS)
    slope = (force_lines(CUTTER, cut, moved, ORDERS) / before - 1.0) / unit
    np.testing.assert_allclose(law_changes(CUTTER, CUT, KNOWN, ORDERS)[..., column], slope, atol=2e-3 * np.abs(slope).max())


def test_edges_and_a_late_entry_are_told_apart():
    other = replace(KNOWN, tangential_edge=15e3, radial_edge=9e3)
    late = replace(CUT, engagement=Engagement(DOWN.entry + np.radians(0.5), DOWN.exit))
    found = fit_law([learned(force_lines(CUTTER, late, other, ORDERS), kind=2)], KNOWN, CUT.feed_per_tooth)
    assert found.tangential_edge[0] == pytest.approx(3e3, rel=0.1)
    assert found.radial_edge[0] == pytest.approx(-1e3, rel=0.15)
    assert np.degrees(found.entry[2][0]) == pytest.approx(0.5, rel=0.1)
    assert abs(found.exponent[0]) < 2.0 * found.exponent[1]
    assert found.explained > 0.99
    assert "teeth enter by 0.49" in found.words
    assert "exponent" not in found.words


def test_a_curved_law_is_named():
    bent = rigid_force_lines(CUTTER, CUT, KNOWN, slices=64, samples=8192, law=ChipLaw(-0.05, REFERENCE_CHIP))[ORDERS, :2]
    found = fit_law([learned(bent)], KNOWN, CUT.feed_per_tooth)
    assert found.exponent[0] == pytest.approx(-0.05, rel=0.15)
    assert abs(found.entry[0][0]) < np.radians(0.05)
    assert found.words.startswith("the cutting coefficients follow the chip thickness with the exponent -0.0")


def test_what_no_law_explains_widens_its_deviations():
    rng = np.random.default_rng(4)
    scatter = force_lines(CUTTER, CUT, KNOWN, ORDERS) * np.exp(0.05 * rng.standard_normal((ORDERS.size, 2)))
    near, far = (fit_law([learned(scatter, deviation=each)], KNOWN, CUT.feed_per_tooth) for each in (0.05, 1e-3))
    assert far.explained < 0.8
    assert far.exponent[1] > 0.5 * near.exponent[1]


@pytest.mark.parametrize("feed", [0.04e-3, 0.25e-3])
def test_the_line_at_another_feed_has_the_slope_of_the_curve(feed):
    """Least squares lines of K h (h / h_0)^e, each from a tenth of its feed to the feed: the one of the cuts is told."""

    def slope(fed: float) -> float:
        chip = np.linspace(0.1 * fed, fed, 200)
        return float(np.polyfit(chip, chip * (chip / REFERENCE_CHIP) ** -0.2, 1)[0])

    law = ForceLaw((-0.2, 0.02), (-2e3, 1e2), (0.0, 1.0), {}, 0.9, 0.1e-3)
    told = replace(KNOWN, tangential=slope(0.1e-3) * 700e6, tangential_spread=0.03)
    found = law.line(told, feed)
    assert found.tangential == pytest.approx(slope(feed) * 700e6, rel=1e-9)
    assert found.tangential_spread == pytest.approx(np.hypot(0.03, 0.02 * np.log(feed / 0.1e-3)))
    assert found.tangential_edge == KNOWN.tangential_edge
    assert law.line(told, 0.1e-3) == told
    assert law.line(told, None) == told


def test_edges_without_an_exponent_are_added():
    law = ForceLaw((-0.01, 0.02), (3e3, 1e3), (-20e3, 1e3), {}, 0.9, 0.1e-3)
    assert law.line(KNOWN, 0.2e-3) == replace(KNOWN, tangential_edge=15e3, radial_edge=0.0)
    nothing = replace(law, tangential_edge=(3e3, 2e3), radial_edge=(0.0, 1.0))
    assert nothing.line(KNOWN, 0.2e-3) == KNOWN


def test_teeth_that_enter_at_0_have_no_entry():
    up = replace(CUT, engagement=ri.Engagement.from_immersion(0.3, "up"))
    assert not np.any(law_changes(CUTTER, up, KNOWN, ORDERS)[..., 5])


def test_nothing_beyond_its_deviation_is_told():
    assert ForceLaw((0.1, 0.1), (1e3, 1e3), (0.0, 1.0), {0: (0.01, 0.01)}, 0.5, 0.1e-3).words == ""
