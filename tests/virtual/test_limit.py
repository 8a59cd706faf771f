"""The truth about stability: published figures, order of convergence, the cut itself, and the frequency domain's own answer."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from rcsa_ident.base.errors import InputError
from rcsa_ident.cutting.coefficients import CuttingCoefficients
from rcsa_ident.cutting.conditions import CuttingConditions, Engagement
from rcsa_ident.cutting.cutter import Cutter
from rcsa_ident.cutting.directional import mean_directional_matrix
from rcsa_ident.cutting.process import MillingProcess
from rcsa_ident.cutting.profile import Profile
from rcsa_ident.dynamics.coordinates import Coordinate
from rcsa_ident.dynamics.receptance import Receptance
from rcsa_ident.stability.lobes import stability_lobes
from rcsa_ident.stability.multi_frequency import MultiFrequency
from rcsa_ident.virtual.limit import directional_matrices, multiplier, true_limit
from rcsa_ident.virtual.milling import mill_cut
from rcsa_ident.virtual.reduction import Poles
from tests.oracles import literature, naive

ALUMINIUM = CuttingCoefficients(902e6, 0.26)
SLOT = Engagement(0.0, np.pi)
UP, DOWN = (Engagement.from_immersion(0.5, strategy) for strategy in ("up", "down"))
CASE = literature.INSPERGER_STEPAN
STEEL = CuttingCoefficients(CASE["tangential"], CASE["normal"] / CASE["tangential"])
MILL = Cutter(CASE["teeth"], 0.012)

# Spectral radius per tooth period at 5000 rev/min and 0.2, 0.5, 0.7, 1.0 mm, and first loss of stability [mm] in the slot, of
# The two-tooth mill of [insperger2004] with one and with two degrees of freedom; Chebyshev spectral elements split at tooth entry and exit.
DEPTH_MM = np.array([0.2, 0.5, 0.7, 1.0])
MULTIPLIER = {
    (1, "slot"): (SLOT, [0.81974278, 1.07397559, 1.22155614, 1.40647353]),
    (1, "half up"): (UP, [0.91573718, 1.30585907, 1.51711354, 1.75804777]),
    (1, "half down"): (DOWN, [0.69372477, 0.81238294, 0.91815106, 1.08620819]),
    (2, "slot"): (SLOT, [2.13659148, 5.09774535, 7.42386502, 10.90390056]),
    (2, "half up"): (UP, [1.18540555, 2.01141608, 2.62527043, 3.62871024]),
    (2, "half down"): (DOWN, [1.18540555, 2.01141608, 2.62527043, 3.62871024]),
}
SLOT_RPM = np.array([5000.0, 10000.0, 12500.0, 17500.0, 20000.0])
SLOT_LIMIT_MM = {1: [0.40863, 0.32238, 2.70702, 0.50761, 1.41751], 2: [0.04751, 0.07141, 0.14835, 0.04805, 0.06322]}


def modal(modes):
    """A system of given modes (axis, natural frequency, damping ratio, mass), the tip at both ends of everything."""
    names = [Coordinate.parse(f"{point}.{axis}") for point in ("tip", "flange", "fixture") for axis in "xy"]
    pole = np.array([2 * np.pi * f * (-z + 1j * np.sqrt(1 - z**2)) for _, f, z, _ in modes])
    inputs, outputs = np.zeros((len(modes), 2), dtype=complex), np.zeros((6, len(modes)), dtype=complex)
    for k, (axis, _, _, mass) in enumerate(modes):
        inputs[k, axis] = 1.0 / (2j * pole[k].imag * mass)
        outputs[axis::2, k] = 1.0
    return Poles(pole, inputs, outputs, tuple(names))


def published(freedoms):
    mode = (CASE["natural_frequency_hz"], CASE["damping_ratio"], CASE["modal_mass"])
    return modal([(axis, *mode) for axis in range(freedoms)])


def cut(rpm, engagement=SLOT, depth=1e-3, feed_angle=0.0):
    return CuttingConditions(rpm * np.pi / 30.0, depth, 1e-4, engagement, feed_angle)


@pytest.mark.parametrize(("freedoms", "name"), list(MULTIPLIER))
def test_published_multipliers_and_second_order(freedoms, name):
    engagement, exact = MULTIPLIER[freedoms, name]
    errors = []
    for step in (2e-5, 1e-5):
        found = [abs(multiplier(published(freedoms), MILL, cut(5000.0, engagement, d * 1e-3), STEEL, step)) for d in DEPTH_MM]
        errors.append(np.array(found) / exact - 1.0)
    assert np.all(np.abs(errors[1]) < 4e-4)
    np.testing.assert_allclose(errors[0] / errors[1], 4.0, rtol=0.05)


@pytest.mark.slow
@pytest.mark.parametrize("freedoms", [1, 2])
def test_published_limits(freedoms):
    for rpm, exact in zip(SLOT_RPM, SLOT_LIMIT_MM[freedoms], strict=True):
        found = true_limit(published(freedoms), MILL, cut(rpm), STEEL, (0.35e-3 * exact, 2.6e-3 * exact), 1e-4)
        assert found.depth * 1e3 == pytest.approx(exact, rel=4e-4)
        assert abs(found.multiplier) == pytest.approx(1.0, abs=1e-3)
        if freedoms == 1 and rpm in (12500.0, 20000.0):
            assert found.multiplier == pytest.approx(-1.0, abs=1e-3)


@pytest.mark.parametrize("cutter", [Cutter(3, 0.012), Cutter(2, 0.012, 0.6), Cutter(4, 0.012, 1.2)])
@pytest.mark.parametrize("engagement", [SLOT, DOWN, Engagement(0.4, 0.9)])
def test_directional_matrices(cutter, engagement):
    """Their mean is the closed form; each is the mean of [alpha] over its step and over the helix."""
    conditions = cut(9000.0, engagement, 4e-3, 0.3)
    found = directional_matrices(cutter, conditions, ALUMINIUM, 40)
    np.testing.assert_allclose(found.mean(axis=0), mean_directional_matrix(cutter.teeth, engagement, ALUMINIUM, 0.3), atol=1e-12)
    c, s = np.cos(0.3), np.sin(0.3)
    turn = np.array([[c, -s], [s, c]])
    pitch, part = 2.0 * np.pi / cutter.teeth, (np.arange(60) + 0.5) / 60.0
    for i in (0, 13, 31):
        total = np.zeros((2, 2))
        for angle in pitch / 40.0 * (i - 0.5 + part):
            for lag in 2.0 * part * 4e-3 * np.tan(cutter.helix) / cutter.diameter:
                for phi in np.mod(angle - lag + pitch * np.arange(cutter.teeth), 2.0 * np.pi):
                    if engagement.entry <= phi < engagement.exit:
                        total += turn @ naive.directional_matrix(phi, ALUMINIUM.radial_ratio) @ turn.T
        np.testing.assert_allclose(found[i], total / 3600.0, atol=0.012)


def test_helix_that_vanishes():
    straight = directional_matrices(Cutter(3, 0.012), cut(9000.0, DOWN), ALUMINIUM, 50)
    for helix in (1e-7, 1e-3):
        bent = directional_matrices(Cutter(3, 0.012, helix), cut(9000.0, DOWN), ALUMINIUM, 50)
        np.testing.assert_allclose(bent, straight, atol=0.02 * helix / 1e-3 + 1e-9)


@pytest.mark.slow
@pytest.mark.parametrize("helix", [0.0, np.radians(30.0)])
@pytest.mark.parametrize("share", [0.9, 0.97])
def test_a_cut_comes_to_rest_as_fast_as_the_multiplier_says(helix, share):
    """The cut itself, with contact loss, its own start, slices and delays: its last transient dies by the same factor."""
    system = modal([(0, 700.0, 0.03, 0.8), (1, 900.0, 0.03, 0.6), (1, 1500.0, 0.03, 0.7)])
    cutter, conditions = Cutter(3, 0.012, helix), cut(9000.0, Engagement(0.6, 2.0))
    limit = true_limit(system, cutter, conditions, ALUMINIUM, (1e-4, 2e-2)).depth
    conditions = replace(conditions, axial_depth=share * limit)
    history = mill_cut(system, cutter, conditions, ALUMINIUM, 60.0 / 9000.0 / 3 / 200, 200 * 400, slices=16)
    tooth = np.abs(np.diff(history.tip.reshape(400, -1), axis=0)).max(axis=1)
    # two tooth periods differ by much less than a chip, and by more than rounding
    k = np.flatnonzero((tooth < 0.02 * conditions.feed_per_tooth) & (tooth > 1e-11))
    assert k.size > 200
    slope = np.polyfit(k, np.log(tooth[k]), 1)[0]
    # a change of the depth by 0.04 % changes it by more
    assert slope == pytest.approx(np.log(abs(multiplier(system, cutter, conditions, ALUMINIUM))), abs=1.2e-4)


@pytest.mark.parametrize(
    ("rpm", "engagement", "feed_angle"), [(5200.0, DOWN, 0.0), (11000.0, UP, 0.7), (17000.0, Engagement(2.4, np.pi), -1.0)]
)
def test_frequency_domain_agrees_on_the_full_machine(dynamics, tooling, rpm, engagement, feed_angle):
    """Two routes that share no line of code: marching poles in time, and Hill's determinant of their receptances."""
    conditions = cut(rpm, engagement, feed_angle=feed_angle)
    band = 2.0 * np.pi * np.arange(2.0, 9000.0, 2.0)
    tip = (Coordinate.parse("tip.x"), Coordinate.parse("tip.y"))
    rows = [[str(c) for c in dynamics.coordinates].index(str(c)) for c in tip]
    receptance = Receptance(band, dynamics.response(band)[:, rows], tip, tip)
    speed = np.array([conditions.spindle_speed])
    found = stability_lobes(receptance, MillingProcess(tooling.cutter, ALUMINIUM, engagement, feed_angle), speed, 0.05, MultiFrequency())
    limit = found.limit_depth[0]
    true = true_limit(dynamics, tooling.cutter, conditions, ALUMINIUM, (0.4 * limit, 2.0 * limit), 2e-4)
    assert limit == pytest.approx(true.depth, rel=1.5e-3)
    turn = np.angle(true.multiplier) / (2.0 * np.pi)
    ratio = found.chatter_frequency[0] / (tooling.cutter.teeth * speed[0]) % 1.0
    assert min(ratio, 1.0 - ratio) == pytest.approx(turn, abs=2e-3)


@pytest.mark.slow
def test_step_of_the_march_is_fine_enough_for_the_full_machine(dynamics, tooling):
    conditions = cut(9500.0, DOWN)
    coarse, fine = (true_limit(dynamics, tooling.cutter, conditions, ALUMINIUM, (2e-4, 4e-3), 1e-4, step).depth for step in (5e-6, 2.5e-6))
    assert coarse == pytest.approx(fine, rel=6e-4)


def test_an_island_between_the_depths_looked_at():
    """Period doubling from 2.93 to 3.46 mm, a growth of 0.5 % a tooth at most: two depths of the search may enclose it."""
    cutter, conditions = Cutter(2, 0.012, np.radians(50.0)), cut(19360.0, Engagement.from_immersion(0.05, "up"))

    def grows(depth):
        return abs(multiplier(published(1), cutter, replace(conditions, axial_depth=depth), STEEL)) > 1.0

    assert [grows(depth * 1e-3) for depth in (2.8, 3.2, 3.6)] == [False, True, False]
    for start in (2.0e-3, 2.3e-3, 2.6e-3):
        found = true_limit(published(1), cutter, conditions, STEEL, (start, 2e-2), 1e-4)
        assert found.depth == pytest.approx(2.9343e-3, rel=1e-3)
        assert found.multiplier == pytest.approx(-1.0, abs=1e-4)
    band = 2.0 * np.pi * np.arange(2.0, 6000.0, 2.0)
    tip = (Coordinate.parse("tip.x"), Coordinate.parse("tip.y"))
    receptance = Receptance(band, published(1).response(band)[:, :2], tip, tip)
    lobes = stability_lobes(
        receptance, MillingProcess(cutter, STEEL, conditions.engagement), [conditions.spindle_speed], 0.05, MultiFrequency()
    )
    assert lobes.limit_depth[0] == pytest.approx(2.9343e-3, rel=1e-3)


def test_nothing_is_unstable_in_the_bracket():
    found = true_limit(published(1), MILL, cut(25000.0), STEEL, (0.5e-3, 3.5e-3))
    assert found.depth == float("inf")
    assert np.isnan(found.multiplier)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"bracket": (1e-3, 2e-3)}, "stable"),
        ({"bracket": (2e-3, 1e-3)}, "smaller and a larger"),
        ({"bracket": (0.0, 1e-3)}, "bracket"),
        ({"cutter": Cutter(2, 0.012, pitch=np.radians([170.0, 190.0]))}, "equal teeth"),
        ({"cutter": Cutter(2, 0.012, profile=Profile.ball(0.012))}, "a cylinder"),
        ({"cutter": Cutter(2, 0.012, runout=np.array([0.0, 1e-6]))}, "equal teeth"),
        ({"step": 0.0}, "step"),
    ],
)
def test_bad_input(change, words):
    arguments = {"cutter": MILL, "bracket": (1e-4, 1e-3), **change}
    with pytest.raises(InputError, match=words):
        true_limit(published(1), conditions=cut(5000.0), coefficients=STEEL, **arguments)
