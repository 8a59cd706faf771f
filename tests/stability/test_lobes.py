"""One verb for all methods: receptances, modes and tips that are not known exactly, with cross terms and without."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import pytest
import scipy.stats

from rcsa_ident.base.errors import InputError
from rcsa_ident.cutting.coefficients import CuttingCoefficients
from rcsa_ident.cutting.conditions import Engagement
from rcsa_ident.cutting.cutter import Cutter
from rcsa_ident.cutting.process import MillingProcess
from rcsa_ident.dynamics.coordinates import Coordinate, Dof
from rcsa_ident.dynamics.modal import normal_modes
from rcsa_ident.dynamics.receptance import Receptance
from rcsa_ident.dynamics.uncertain import UncertainReceptance, Variation
from rcsa_ident.stability.discretisation import FullDiscretisation
from rcsa_ident.stability.lobes import both_directions, drawn_limits, stability_lobes
from rcsa_ident.stability.multi_frequency import MultiFrequency
from rcsa_ident.stability.tip_modes import TIP, TipModes
from rcsa_ident.stability.zero_order import ZeroOrder
from tests.machine.planes import rotation
from tests.stability.test_tip_modes import models, receptance

OMEGA = 2.0 * np.pi * np.arange(100.0, 3000.0, 2.0)
SPEEDS = np.array([600.0, 800.0, 1100.0])
EXACT = CuttingCoefficients(9e8, 0.3, tangential_spread=0.0, ratio_spread=0.0)
PROCESS = MillingProcess(Cutter(2, 0.012), EXACT, Engagement.from_immersion(0.5, "down"), 0.3)
DEEPEST = 0.1


@dataclass
class Written:
    """A spread that is written down: changes of the receptance between some of the rows, shape (p, n, b, b)."""

    members: tuple
    change: np.ndarray

    @property
    def covers(self):
        return frozenset(self.members)

    def at(self, places):
        return (Variation(self.members, self.change[:, places]),)

    def guides(self):
        return np.zeros((0, self.change.shape[1]), dtype=complex)


def known_but_for_its_scale(deviation):
    """A tip whose receptance is known but for one factor: the limit is then known but for its inverse."""
    tip = (Coordinate("tip", Dof.X),)
    mode = normal_modes(np.array([2.0 * np.pi * 900.0]), np.array([0.03]), np.array([[4.0]]), tip)
    values = mode.receptance(OMEGA).values
    return UncertainReceptance(OMEGA, values, tip, tip, Written((0,), deviation * values[None]))


def asked(tip, method=None, draws=60, seed=1, speeds=SPEEDS, process=PROCESS):
    return stability_lobes(tip, process, speeds, DEEPEST, method or ZeroOrder(), draws, seed)


def probability(found, depths):
    """Of a depth at each speed, shapes (d, n)."""
    return np.array([[found.probability(place, depth) for place, depth in enumerate(row)] for row in depths])


@pytest.mark.slow
@pytest.mark.parametrize(("method", "draws"), [(ZeroOrder(), 400), (MultiFrequency(), 40)])
def test_probability_of_stability_of_a_scale(method, draws):
    """With G (1 + 0.1 z) the limit is a / (1 + 0.1 z): a cut of depth d is stable where z < 10 (a / d - 1)."""
    found = asked(known_but_for_its_scale(0.1), method, draws, 3)
    ratio = np.array([0.8, 0.95, 1.0, 1.05, 1.3])
    share = probability(found, ratio[:, None] * found.limit_depth)
    # the very draws that were made
    z = np.random.default_rng(3).standard_normal(draws)
    expected = np.mean(z < 10.0 * (1.0 / ratio[:, None] - 1.0), axis=1)
    np.testing.assert_allclose(share, np.repeat(expected[:, None], 3, axis=1), atol=1.0 / draws)
    exact = scipy.stats.norm.cdf(10.0 * (1.0 / ratio - 1.0))
    np.testing.assert_allclose(share, np.repeat(exact[:, None], 3, axis=1), atol=3.0 * 0.5 / np.sqrt(draws))


@pytest.mark.parametrize("spreads", [(0.1, 0.0), (0.0, 0.1), (0.08, 0.05)])
def test_drawn_limits_are_those_of_drawn_coefficients(spreads):
    known = replace(EXACT, tangential_spread=spreads[0], ratio_spread=spreads[1])
    found = asked(known_but_for_its_scale(0.0), process=replace(PROCESS, coefficients=known))
    weights = np.random.default_rng([1, 1]).standard_normal((60, 2)) * spreads
    for row, (tangential, ratio) in zip(found.drawn, np.exp(weights), strict=True):
        drawn = replace(known, tangential=9e8 * tangential, radial_ratio=0.3 * ratio)
        limit = asked(known_but_for_its_scale(0.0), process=replace(PROCESS, coefficients=drawn), draws=0).limit_depth
        np.testing.assert_allclose(row, limit, rtol=1e-5)
    assert np.std(np.log(found.drawn[:, 0])) > 0.8 * spreads[0]


def test_a_machine_is_drawn_alike_whatever_is_known_of_the_coefficients():
    tip, known = known_but_for_its_scale(0.1), replace(EXACT, tangential_spread=0.1)
    ratio = asked(tip, process=replace(PROCESS, coefficients=known)).drawn / asked(tip).drawn
    np.testing.assert_allclose(np.log(ratio), -0.1 * np.random.default_rng([1, 1]).standard_normal((60, 2))[:, :1] * np.ones(3), atol=1e-12)


def test_probability_and_bands_tell_the_same():
    found = asked(known_but_for_its_scale(0.1), draws=200)
    low, high = found.band
    inside = probability(found, np.stack([low * 0.999, high * 1.001]))
    np.testing.assert_allclose(inside[0], 0.975, atol=0.011)
    np.testing.assert_allclose(inside[1], 0.025, atol=0.011)
    even = probability(found, np.linspace(0.5, 1.5, 9)[:, None] * np.full(3, low.min()))
    assert np.all(np.diff(even, axis=0) <= 0.0)


def test_without_a_spread_nothing_is_probable():
    tip = known_but_for_its_scale(0.1)
    for bare in (replace(tip, variation=None), Receptance(tip.omega, tip.values, tip.rows, tip.cols)):
        found = asked(bare)
        assert found.drawn is None
        assert found.band is None
        assert found.probability(0, 1e-3) is None
    for few in (0, 1):
        assert asked(tip, draws=few).drawn is None
    # one of both directions is known exactly: what the draws would say is not the whole of it
    both = UncertainReceptance(OMEGA, np.eye(2) * tip.values, TIP, TIP, tip.variation)
    assert asked(both).drawn is None
    np.testing.assert_array_equal(probability(asked(known_but_for_its_scale(0.0)), [[1e-6] * 3, [DEEPEST] * 3]), [[1.0] * 3, [0.0] * 3])


def test_the_same_seed_draws_the_same_machines_whatever_the_speeds_are():
    tip = known_but_for_its_scale(0.1)
    whole, part, other = asked(tip), asked(tip, speeds=SPEEDS[[2, 0]]), asked(tip, seed=2)
    np.testing.assert_array_equal(part.drawn, whole.drawn[:, [2, 0]])
    assert not np.array_equal(other.drawn, whole.drawn)
    # more draws begin with the same ones
    np.testing.assert_array_equal(asked(tip, draws=80).drawn[:60], whole.drawn)


@pytest.mark.slow
def test_a_band_of_another_method_is_its_own():
    # of a tip that is known but for its scale the limits of all methods are in the same proportion
    tip = known_but_for_its_scale(0.1)
    quick, fine = asked(tip, draws=20), asked(tip, MultiFrequency(), draws=20)
    np.testing.assert_allclose(fine.drawn / fine.limit_depth, quick.drawn / quick.limit_depth, rtol=3e-3)
    # of one whose frequency moves they are not: each drawn receptance has limits of its own
    tip, speeds = oblique_tip(), np.linspace(500.0, 1600.0, 23)
    found = asked(tip, MultiFrequency(), draws=4, seed=4, speeds=speeds)
    nodes = tip.thinned()
    for limits, values in zip(found.drawn, nodes.drawn(4, np.random.default_rng(4)), strict=True):
        drawn = Receptance(nodes.omega, values, TIP, TIP)
        alone = stability_lobes(drawn, PROCESS, speeds, DEEPEST, MultiFrequency())
        np.testing.assert_allclose(np.minimum(limits, DEEPEST), alone.nominal, rtol=1e-2)
    quick = asked(tip, draws=4, seed=4, speeds=speeds)
    assert np.max(np.abs(found.drawn / found.nominal / (quick.drawn / quick.nominal) - 1.0)) > 0.03


# cross terms


def oblique(vector, omega=OMEGA):
    """Two planes turned by an angle; unknowns are the angle and the logarithms of a frequency and a stiffness."""
    angle, frequency, stiffness = np.array([0.5, 0.0, 0.0]) + vector
    values = np.zeros((omega.size, 2, 2), dtype=complex)
    for i, (hertz, k) in enumerate(((900.0 * np.exp(frequency), 8e6 * np.exp(stiffness)), (1150.0, 5e6))):
        w = 2.0 * np.pi * hertz
        values[:, i, i] = w**2 / k / (w**2 - omega**2 + 0.06j * w * omega)
    return rotation(angle) @ values @ rotation(angle).T


def oblique_tip():
    changes = [
        deviation * (oblique(1e-4 * direction) - oblique(-1e-4 * direction)) / 2e-4
        for direction, deviation in zip(np.eye(3), (0.05, 0.004, 0.03), strict=True)
    ]
    return UncertainReceptance(OMEGA, oblique(np.zeros(3)), TIP, TIP, Written((0, 1), np.array(changes)))


CUTTERS = {"equal": PROCESS.cutter, "unequal": Cutter(2, 0.012, pitch=np.array([0.9, 1.1]) * np.pi)}


@pytest.mark.parametrize("pitch", CUTTERS)
def test_draws_with_cross_terms_have_the_lobes_of_each_drawn_tip(pitch):
    process = replace(PROCESS, cutter=CUTTERS[pitch])
    tip, speeds = oblique_tip(), np.linspace(1600.0, 500.0, 23)
    drawn = drawn_limits(tip, process, speeds, DEEPEST, 12, 4)
    nodes = tip.thinned()
    assert nodes.omega.size < 0.7 * OMEGA.size
    for limits, values in zip(drawn, nodes.drawn(12, np.random.default_rng(4)), strict=True):
        alone = ZeroOrder().lobes(Receptance(nodes.omega, values, TIP, TIP), process, speeds, DEEPEST)
        np.testing.assert_array_equal(limits, alone.limit_depth)
    # and those that all frequencies give
    for limits, values in zip(drawn, tip.drawn(12, np.random.default_rng(4)), strict=True):
        alone = ZeroOrder().lobes(Receptance(OMEGA, values, TIP, TIP), process, speeds, DEEPEST)
        np.testing.assert_allclose(limits, alone.limit_depth, rtol=1e-4)
    found = asked(tip, draws=12, seed=4, speeds=speeds, process=process)
    np.testing.assert_array_equal(found.drawn, drawn)
    np.testing.assert_array_equal(found.limit_depth, ZeroOrder().lobes(tip, process, speeds, DEEPEST).limit_depth)


@pytest.mark.parametrize("angle", [0.4, -1.3, 0.5 * np.pi])
def test_a_machine_that_is_turned_with_its_feed_has_the_same_limits_and_draws(angle):
    tip = oblique_tip()
    turn = rotation(angle)
    turned = UncertainReceptance(OMEGA, turn @ tip.values @ turn.T, TIP, TIP, Written((0, 1), turn @ tip.variation.change @ turn.T))
    here, there = asked(tip), asked(turned, process=replace(PROCESS, feed_angle=PROCESS.feed_angle + angle))
    np.testing.assert_allclose(there.limit_depth, here.limit_depth, rtol=1e-9)
    # told from other frequencies
    np.testing.assert_allclose(there.drawn, here.drawn, rtol=2e-4)


def test_cross_terms_count():
    """Without them the same tip has other limits."""
    tip = oblique_tip()
    apart = Receptance(OMEGA, tip.values * np.eye(2), TIP, TIP)
    assert np.max(np.abs(asked(apart).limit_depth / asked(tip).limit_depth - 1.0)) > 0.05


# directions and modes


def test_directions_that_are_missing_are_rigid_and_further_ones_left_aside():
    tip = oblique_tip()
    y = both_directions(tip.block(TIP[1:]))
    np.testing.assert_array_equal(y.values[:, 1, 1], tip.values[:, 1, 1])
    assert not np.any(y.values[:, 0])
    assert both_directions(tip) is tip
    rows = (TIP[1], Coordinate("spindle", Dof.X), TIP[0])
    values = np.zeros((OMEGA.size, 3, 3), dtype=complex)
    values[:, [[2], [0]], [2, 0]] = tip.values
    values[:, 1, 1] = 1.0
    np.testing.assert_array_equal(both_directions(Receptance(OMEGA, values, rows, rows)).values, tip.values)
    with pytest.raises(InputError, match="at least one flexible direction"):
        both_directions(Receptance(OMEGA, values[:, 1:2, 1:2], rows[1:2], rows[1:2]))


@pytest.mark.slow
def test_lobes_of_the_fit_are_those_of_the_receptance():
    """The march on fitted modes against the frequency domain on the receptance itself."""
    process = MillingProcess(Cutter(2, 12e-3), CuttingCoefficients(700e6, 0.3), Engagement.from_immersion(0.5, "down"))
    speeds = np.linspace(500.0, 1600.0, 12)
    marched = stability_lobes(receptance(), process, speeds, 0.02, FullDiscretisation())
    exact = stability_lobes(receptance(), process, speeds, 0.02, MultiFrequency())
    np.testing.assert_allclose(marched.limit_depth, exact.limit_depth, rtol=0.02)
    assert any("replaced by a fit with" in warning and "relative error" in warning for warning in marched.warnings)
    # modes that were given are taken as they are
    given = stability_lobes(TipModes.of(models()), process, speeds[:2], 0.02, FullDiscretisation())
    assert not any("fit" in warning for warning in given.warnings)
