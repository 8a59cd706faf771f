"""Mills with a shape: limits that two other roads have found, by every method."""

from dataclasses import replace

import numpy as np
import pytest

from rcsa_ident.base.errors import InputError
from rcsa_ident.cutting.conditions import Block, widest
from rcsa_ident.cutting.cutter import Cutter
from rcsa_ident.cutting.process import ProcessDamping
from rcsa_ident.cutting.profile import Profile
from rcsa_ident.cutting.serration import Serration
from rcsa_ident.dynamics.uncertain import UncertainReceptance
from rcsa_ident.stability.discretisation import FullDiscretisation, SemiDiscretisation
from rcsa_ident.stability.lobes import stability_lobes
from rcsa_ident.stability.multi_frequency import MultiFrequency
from rcsa_ident.stability.multiplier_limits import longest_step
from rcsa_ident.stability.regeneration import regeneration
from rcsa_ident.stability.time_domain import TimeDomain
from rcsa_ident.stability.zero_order import ZeroOrder
from tests.stability import shaped_mills as mills
from tests.stability.test_lobes import Written
from tests.stability.tilted_ball import tilted_ball

FULL = FullDiscretisation(tolerance=2e-4)


def limits(process, tip, rpm, method):
    """Limits [mm]."""
    found = stability_lobes(tip, process, np.array(rpm) * mills.RPM, mills.deepest(process), method)
    return 1e3 * found.limit_depth, found


@pytest.mark.parametrize("name", mills.LIMITS)
def test_full_discretisation(name):
    process, tip, rpm, wanted = mills.LIMITS[name]
    found, lobes = limits(process, tip, rpm, FULL)
    assert found == pytest.approx(wanted, rel=4e-4)
    assert not [words for words in lobes.warnings if "converged" in words]


@pytest.mark.slow
@pytest.mark.parametrize("name", [name for name in mills.LIMITS if name not in ("E A", "E B")])
def test_multi_frequency(name):
    process, tip, rpm, wanted = mills.LIMITS[name]
    assert limits(process, tip, rpm, MultiFrequency())[0] == pytest.approx(wanted, rel=4e-4)


@pytest.mark.slow
@pytest.mark.parametrize(("name", "place"), [("E A", 3), ("E B", 0), ("E B", 3)])
def test_multi_frequency_with_a_helix_of_each_tooth(name, place):
    """At some of the speeds: a turn of the slow one holds a hundred harmonics, and costs seconds."""
    process, tip, rpm, wanted = mills.LIMITS[name]
    assert limits(process, tip, rpm[place : place + 1], MultiFrequency())[0] == pytest.approx(wanted[place], rel=4e-4)


@pytest.mark.parametrize("place", range(len(mills.MULTIPLIERS)))
def test_multipliers(place):
    process, tip, rpm, depth, wanted = mills.MULTIPLIERS[place]
    cut = FULL.monodromy(tip, process)
    found = cut.multiplier(rpm * mills.RPM, 1e-3 * depth, 0.5 * longest_step(cut), residual=1e-8)
    assert abs(found.value) == pytest.approx(wanted, rel=2e-5)


@pytest.mark.slow
@pytest.mark.parametrize("feed", mills.ROUGHER)
def test_a_serrated_edge(feed):
    found, _ = limits(mills.rougher(1e-3 * feed), mills.tip(mills.M1[:2]), mills.ROUGHER_SPEEDS, FullDiscretisation(tolerance=1e-3))
    # the limits themselves are told to 0.4 %
    assert found == pytest.approx(mills.ROUGHER[feed], rel=6e-3)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "place", "near"),
    [("A", 0, 3e-3), ("A, slope -7", 0, 3e-3), ("C", 0, 3e-3), ("D", 1, 3e-3), ("E A", 2, 7e-3), ("E B", 1, 8e-3)],
)
def test_time_domain_without_loss_of_contact(name, place, near):
    process, tip, rpm, wanted = mills.LIMITS[name]
    fed = replace(process, feed_per_tooth=1e-4)
    found, _ = limits(fed, tip, rpm[place : place + 1], TimeDomain(contact_loss=False))
    assert found == pytest.approx(wanted[place], rel=near)


@pytest.mark.slow
def test_a_leaning_ball():
    """Its arcs are those of the depth of cut: the limit is where the cut of that depth neither grows nor dies away."""
    tip, leaning = mills.tip(mills.M1), Cutter(2, 0.010, helix=30 * mills.DEG, profile=Profile.ball(0.010))

    def growth(depth, rpm):
        arcs, _ = tilted_ball(0.005, depth, 0.001, 20 * mills.DEG, 10 * mills.DEG, heights=280, angles=7200)
        process = mills.cut(leaning, arcs, 1800e6, 0.36, 0.17)
        cut = FULL.monodromy(tip, process)
        return abs(cut.multiplier(rpm * mills.RPM, float(arcs.z[-1]), longest_step(cut), residual=1e-6).value)

    assert growth(1.809e-3 - 0.010e-3, 17000) < 1.0 < growth(1.809e-3 + 0.010e-3, 17000)
    assert growth(3.5e-3, 13000) < 1.0


@pytest.mark.parametrize("name", ["A", "A, Z rigid", "B, stepover", "C, Z rigid", "C, deep", "D", "A Ø63 cylinder"])
def test_zero_order_is_on_the_contour_of_its_mean_matrix(name):
    """At the limit and the frequency that are told an eigenvalue of the loop is one, by NumPy's eigenvalues."""
    process, tip, rpm, _ = mills.LIMITS[name] if name in mills.LIMITS else mills.LIMITS["A"]
    if name not in mills.LIMITS:
        process, tip = replace(process, cutter=Cutter(5, 0.063, profile=Profile.flat(0.063, 0.03))), mills.tip(mills.M2[:2])
    speeds = np.array(rpm) * mills.RPM
    found = stability_lobes(tip, process, speeds, mills.deepest(process), ZeroOrder())
    for speed, depth, chatter in zip(speeds, found.limit_depth, found.chatter_frequency, strict=True):
        values = []
        for a in depth * np.array([0.995, 1.0, 1.005]):
            mean = regeneration(process, float(a), tip.directions).mean
            delay = process.cutter.pitch[0] / speed
            loop = np.linalg.eigvals(mean @ tip.response(np.array([chatter]))[0]) * (1.0 - np.exp(-1j * chatter * delay))
            values.append(loop[np.argmin(np.abs(loop - 1.0))])
        assert abs(values[1] - 1.0) < 0.02
        # half a percent of the depth is more than what is left
        assert values[0].real < 1.0 < values[2].real


def test_zero_order_of_a_cylinder_drawn_as_a_shape_is_the_closed_form():
    process = mills.FACE
    rpm = np.linspace(600.0, 1500.0, 19)
    plain, shaped = (replace(process, cutter=Cutter(5, 0.063, profile=outline)) for outline in (None, Profile.flat(0.063, 0.03)))
    plain = replace(plain, engagement=widest(process.engagement, Profile.flat(0.063), 0.01))
    one, two = (stability_lobes(mills.tip(mills.M2[:2]), each, rpm * mills.RPM, 0.01) for each in (plain, shaped))
    np.testing.assert_allclose(two.limit_depth, one.limit_depth, rtol=3e-3)
    assert two.absolute_limit == pytest.approx(one.absolute_limit, rel=2e-3)


def test_a_rigid_axis_is_said_where_it_matters():
    """With the axial mode of the words the limits are those of the words' range."""
    process, tip, rpm, _ = mills.LIMITS["B, Z rigid"]
    found = stability_lobes(tip, process, np.array(rpm) * mills.RPM, 0.0059)
    said = [words for words in found.warnings if "taken as rigid" in words]
    assert len(said) == 1
    low, high = (float(words) for words in said[0].split("limits would be ")[1].split(" times")[0].split(" to "))
    chatter = found.chatter_frequency[np.argmin(found.limit_depth)] / (2.0 * np.pi)
    ratios = []
    for place in (0.9, 1.1):
        soft = mills.tip((*mills.M3[:2], (2, place * chatter, 0.03, 5e7)))
        ratios += (stability_lobes(soft, process, np.array(rpm) * mills.RPM, 0.0059).limit_depth / found.limit_depth).tolist()
    assert (low, high) == pytest.approx((min(ratios), max(ratios)), abs=0.02)
    # with Z there is nothing to say, nor of a wall
    assert not [words for words in stability_lobes(soft, process, [rpm[0] * mills.RPM], 0.0059).warnings if "rigid" in words]
    wall = stability_lobes(tip, replace(mills.HELIX, coefficients=process.coefficients), [4200 * mills.RPM], 0.014)
    assert not [words for words in wall.warnings if "rigid" in words]


def test_zero_order_says_that_unlike_teeth_are_not_its_business():
    for process in (mills.HELIX, mills.HELIX_PITCH, mills.rougher(0.08e-3)):
        found = stability_lobes(mills.tip(mills.M1[:2]), process, [4200 * mills.RPM], 0.014)
        assert found.withheld
        assert "full-discretisation" in found.withheld


def test_a_cylinder_through_all_methods_is_what_it_was():
    """Drawn as an outline, where nothing but the way is new: the same numbers as of the plain cutter."""
    plain = mills.cut(Cutter(3, 0.016, helix=30 * mills.DEG), mills.HALF_DOWN, 1600e6, 0.36, 0.17)
    drawn = replace(plain, cutter=Cutter(3, 0.016, helix=30 * mills.DEG, profile=Profile.flat(0.016, 0.03)))
    tip, speeds = mills.tip(mills.M1[:2]), np.array([3500.0, 5000.0, 8500.0]) * mills.RPM
    for method in (FULL, SemiDiscretisation(), MultiFrequency()):
        one, two = (method.lobes(tip, process, speeds, 0.02).limit_depth for process in (plain, drawn))
        np.testing.assert_allclose(two, one, rtol=1e-6)


def test_rubbing_where_the_edge_is_slow_lifts_limits():
    tip, rpm, rubs = mills.tip(mills.M1), [3000.0], replace(mills.BALL, damping=ProcessDamping(4e13, 6e-5))
    found, free = (limits(process, tip, rpm, FullDiscretisation())[0] for process in (rubs, mills.BALL))
    assert found[0] > 1.03 * free[0]
    again, _ = limits(rubs, tip, rpm, MultiFrequency())
    assert again == pytest.approx(found, rel=2e-3)


@pytest.mark.parametrize("method", [ZeroOrder(), MultiFrequency(), FullDiscretisation()])
@pytest.mark.parametrize(("process", "ends"), [(mills.HIGH_FEED, 6.0), (mills.end_mill([0.0, 60.0, 0.0, 60.0]), 7.255)])
def test_nothing_deeper_than_the_cutter_cuts_is_looked_at(process, ends, method):
    """Where the edge ends, and where teeth meet: a stiff tip has no limit up to there, and the answer says where that is."""
    stiff = mills.tip([(axis, frequency, zeta, 1e3 * k) for axis, frequency, zeta, k in mills.M1[:2]])
    found = stability_lobes(stiff, process, [4200 * mills.RPM], 0.02, method)
    assert found.limit_depth[0] == np.inf
    assert 1e3 * found.max_depth == pytest.approx(ends, rel=1e-3)
    assert [words for words in found.warnings if f"at {ends:.4g} mm" in words]


def test_bands_of_a_face_mill_end_where_its_edge_does():
    """Drawn machines are asked deeper than the limits that are wanted, and no deeper than the cutter cuts."""
    tip = mills.tip(mills.M2[:2]).receptance()
    uncertain = UncertainReceptance(tip.omega, tip.values, tip.rows, tip.cols, Written((0, 1), 0.05 * tip.values[None]))
    shallow = replace(mills.FACE, cutter=Cutter(5, 0.063, profile=Profile.face(0.063, 45 * mills.DEG, 0.0016)))
    for method in (ZeroOrder(), FullDiscretisation()):
        found = stability_lobes(uncertain, shallow, np.array([700.0, 1100.0]) * mills.RPM, 0.0016, method, draws=12)
        assert found.drawn is not None
        assert np.all(np.ptp(found.drawn, axis=0) > 0.0)


@pytest.mark.witness
@pytest.mark.slow
def test_a_straight_serrated_edge():
    """Its waves do not open gradually: what full discretisation makes of it is what the march through time does."""
    straight = replace(mills.rougher(0.08e-3), cutter=Cutter(3, 0.016, serration=Serration(0.25e-3, 1.5e-3)))
    tip, rpm = mills.tip(mills.M1[:2]), [5000.0]
    found, _ = limits(straight, tip, rpm, FullDiscretisation(tolerance=1e-3))
    marched, _ = limits(straight, tip, rpm, TimeDomain(contact_loss=False))
    assert marched == pytest.approx(found, rel=0.03)


@pytest.mark.parametrize(
    ("process", "depth", "field"),
    [
        (replace(mills.BALL_BLOCK, engagement=Block(0.007, 0.009)), 0.004, "engagement"),
        (mills.rougher(None), 0.01, "feed_per_tooth"),
    ],
)
def test_cuts_that_a_cutter_cannot_make_are_refused_by_name(process, depth, field):
    with pytest.raises(InputError) as error:
        stability_lobes(mills.tip(mills.M1[:2]), process, [4200 * mills.RPM], depth, FULL)
    assert error.value.field == field
