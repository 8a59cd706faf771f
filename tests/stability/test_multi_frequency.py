"""The multi-frequency limit against published figures, a slow semi-discretisation, the zero-order limit and laws of invariance."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.linalg
from hypothesis import given, settings
from hypothesis import strategies as st

from rcsa_ident.base.errors import InputError
from rcsa_ident.cutting.coefficients import CuttingCoefficients
from rcsa_ident.cutting.conditions import Engagement
from rcsa_ident.cutting.cutter import Cutter
from rcsa_ident.cutting.directional import mean_directional_matrix
from rcsa_ident.cutting.process import MillingProcess, ProcessDamping, SpeedVariation
from rcsa_ident.dynamics.coordinates import Coordinate, Dof
from rcsa_ident.dynamics.modal import normal_modes
from rcsa_ident.dynamics.receptance import Receptance
from rcsa_ident.stability.discretisation import FullDiscretisation
from rcsa_ident.stability.hill import fewer_delays
from rcsa_ident.stability.lobes import stability_lobes
from rcsa_ident.stability.multi_frequency import MultiFrequency
from rcsa_ident.stability.tip_modes import TipModes
from tests.oracles import naive

RPM = 2.0 * np.pi / 60.0
TIP = (Coordinate.parse("tip.x"), Coordinate.parse("tip.y"))
FLANGE = (Coordinate.parse("flange.x"),)
SLOT = Engagement(0.0, np.pi)
HALF_DOWN = Engagement.from_immersion(0.5, "down")
COEFFICIENTS = CuttingCoefficients(6e8, 1.0 / 3.0)
MULTI = MultiFrequency()
#: Modes as axis (0 or 1), natural frequency [Hz], damping ratio, mass [kg].
ONE = ((0, 922.0, 0.011, 0.03993),)
TWO = (*ONE, (1, 922.0, 0.011, 0.03993))
SKEWED = ((0, 780.0, 0.03, 0.05), (1, 930.0, 0.02, 0.04), (1, 1350.0, 0.03, 0.08))
# The mill of [gradisek2005]: three modes in x, one in y
FOUR = ((0, 441.64, 0.028722, 11.125), (0, 563.6, 0.055801, 1.4986), (0, 778.56, 0.058996, 13.063), (1, 516.2, 0.025004, 1.199))

# First loss of stability [mm] of the two-tooth mill of [insperger2004] in a slot, and of the four modes in half-immersion down-milling, by
# Chebyshev spectral elements split at tooth entry and exit, all digits good.
SLOT_RPM = np.array([5000.0, 7500.0, 10000.0, 12500.0, 15000.0, 17500.0, 20000.0, 25000.0])
SLOT_LIMIT_MM = {
    ONE: [0.40863, 0.32057, 0.32238, 2.70702, 0.38659, 0.50761, 1.41751, 3.93993],
    TWO: [0.04751, 0.05480, 0.07141, 0.14835, 0.11445, 0.04805, 0.06322, 0.53013],
}
FOUR_RPM, FOUR_LIMIT_MM = np.array([2000.0, 5000.0, 7000.0, 10000.0]), [2.78505, 1.49104, 6.36278, 1.64411]


def response(modes, w):
    h = np.zeros((*np.shape(w), 2, 2), dtype=complex)
    for axis, frequency, zeta, mass in modes:
        wn = 2.0 * np.pi * frequency
        h[..., axis, axis] += 1.0 / (mass * (wn**2 - np.square(w) + 2j * zeta * wn * np.asarray(w)))
    return h


def tip(modes, top=6000.0, step=2.0, turn=0.0):
    band = 2.0 * np.pi * np.arange(step, top, step)
    c, s = np.cos(turn), np.sin(turn)
    rotation = np.array([[c, -s], [s, c]])
    return Receptance(band, rotation @ response(modes, band) @ rotation.T, TIP, TIP)


def lobes(modes, cutter, engagement, rpm, coefficients=COEFFICIENTS, feed_angle=0.0, method=MULTI, max_depth=30e-3, **band):
    return stability_lobes(
        tip(modes, **band), MillingProcess(cutter, coefficients, engagement, feed_angle), np.asarray(rpm) * RPM, max_depth, method
    )


def multiplier(modes, cutter, engagement, rpm, depth, coefficients=COEFFICIENTS, intervals=200, slices=20):
    """The largest Floquet multiplier by semi-discretisation: matrix exponentials of the equation with frozen coefficients."""
    period = 60.0 / rpm / cutter.teeth
    h, m = period / intervals, len(modes)
    free, out, into = np.zeros((2 * m, 2 * m)), np.zeros((2, 2 * m)), np.zeros((2 * m, 2))
    for k, (axis, frequency, zeta, mass) in enumerate(modes):
        wn = 2.0 * np.pi * frequency
        free[k, m + k], free[m + k, k], free[m + k, m + k] = 1.0, -(wn**2), -2.0 * zeta * wn
        out[axis, k], into[m + k, axis] = 1.0, 1.0 / mass
    total = 2 * m + 2 * intervals
    state = np.eye(total)[: 2 * m]
    # tips one period ago up to now
    past = [np.eye(total)[2 * m + 2 * i : 2 * m + 2 * i + 2] for i in range(intervals)]
    past.append(out @ state)
    height = (np.arange(slices) + 0.5) / slices * depth * (cutter.helix > 0.0)
    lag = 2.0 * height * np.tan(cutter.helix) / cutter.diameter
    part = (np.arange(40) + 0.5) / 40.0
    for i in range(intervals):
        place = (i + part[:, None, None]) / intervals + np.arange(cutter.teeth)[None, :, None]
        phi = np.mod(2.0 * np.pi / cutter.teeth * place - lag, 2.0 * np.pi)
        sine, cosine = (f(phi) * ((engagement.entry <= phi) & (phi < engagement.exit)) for f in (np.sin, np.cos))
        one, two = cosine + coefficients.radial_ratio * sine, sine - coefficients.radial_ratio * cosine
        terms = [[-sine * one, -cosine * one], [sine * two, cosine * two]]
        alpha = np.array([[np.sum(t) for t in row] for row in terms]) / (part.size * slices)
        stiffness = depth * coefficients.tangential * into @ alpha
        block = np.zeros((2 * m + 2, 2 * m + 2))
        block[: 2 * m, : 2 * m], block[: 2 * m, 2 * m :] = free + stiffness @ out, -stiffness
        step = scipy.linalg.expm(block * h)
        state = step[: 2 * m, : 2 * m] @ state + step[: 2 * m, 2 * m :] @ (0.5 * (past[i] + past[i + 1]))
        past.append(out @ state)
    values = np.linalg.eigvals(np.concatenate([state, *past[intervals : 2 * intervals]]))
    return values[np.argmax(np.abs(values))]


@pytest.mark.slow
@pytest.mark.parametrize("modes", [ONE, TWO])
def test_published_slot(modes):
    found = lobes(modes, Cutter(2, 0.012), SLOT, SLOT_RPM)
    np.testing.assert_allclose(found.limit_depth * 1e3, SLOT_LIMIT_MM[modes], rtol=1.5e-4)
    assert found.absolute_limit is None


def test_published_case_of_four_modes():
    coefficients = CuttingCoefficients(6.97e8, 2.558e8 / 6.97e8)
    found = lobes(FOUR, Cutter(4, 0.012), HALF_DOWN, FOUR_RPM, coefficients)
    np.testing.assert_allclose(found.limit_depth * 1e3, FOUR_LIMIT_MM, rtol=3e-4)


def test_flips_are_where_the_published_case_has_them():
    """At 12 500 and 20 000 rev/min the slot of the one mode loses stability by period doubling."""
    found = lobes(ONE, Cutter(2, 0.012), SLOT, SLOT_RPM)
    ratio = found.chatter_frequency / (2.0 * SLOT_RPM * RPM)
    flips = np.isin(SLOT_RPM, (12500.0, 20000.0))
    np.testing.assert_allclose(ratio[flips] % 1.0, 0.5, atol=1e-9)
    assert np.all(np.abs(ratio[~flips] % 1.0 - 0.5) > 1e-3)
    np.testing.assert_array_equal(found.lobe, np.floor(ratio))
    np.testing.assert_array_equal(found.flip, flips)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("modes", "cutter", "engagement", "rpm"),
    [
        (ONE, Cutter(2, 0.012), Engagement.from_immersion(0.05, "down"), 18000.0),
        (ONE, Cutter(2, 0.012), Engagement.from_immersion(0.1, "up"), 19000.0),
        (SKEWED, Cutter(3, 0.012), Engagement.from_immersion(0.2, "down"), 9000.0),
        (SKEWED, Cutter(2, 0.012, np.radians(40.0)), Engagement.from_immersion(0.1, "up"), 21000.0),
        (SKEWED, Cutter(4, 0.012, np.radians(40.0)), HALF_DOWN, 6500.0),
    ],
)
def test_slow_twin(modes, cutter, engagement, rpm):
    found = lobes(modes, cutter, engagement, [rpm])
    limit = found.limit_depth[0]
    at, below, above = (multiplier(modes, cutter, engagement, rpm, share * limit) for share in (1.0, 0.97, 1.03))
    slope = (np.log(np.abs(above)) - np.log(np.abs(below))) / 0.06
    # the twin's own limit lies this share of it away
    assert abs(np.log(np.abs(at)) / slope) < 3e-3
    assert abs(below) < 1.0 < abs(above)
    angle = np.abs(np.angle(at)) / (2.0 * np.pi)
    ratio = found.chatter_frequency[0] / (cutter.teeth * rpm * RPM)
    assert min(ratio % 1.0, 1.0 - ratio % 1.0) == pytest.approx(angle, abs=2e-3)


def test_low_immersion_has_flip_lobes_that_zero_order_does_not_see():
    engagement, cutter = Engagement.from_immersion(0.05, "down"), Cutter(2, 0.012)
    found = lobes(ONE, cutter, engagement, [18000.0])
    zero = stability_lobes(tip(ONE), MillingProcess(cutter, COEFFICIENTS, engagement), np.array([18000.0]) * RPM, 30e-3)
    assert found.limit_depth[0] < 0.3 * zero.limit_depth[0]
    assert found.chatter_frequency[0] == pytest.approx(1.5 * 2.0 * 18000.0 * RPM)
    assert any("interrupted cut" in w for w in zero.warnings)
    assert found.warnings == ()


@pytest.mark.parametrize("helix", [0.0, np.radians(30.0)])
@pytest.mark.parametrize("engagement", [SLOT, HALF_DOWN])
def test_no_harmonics_is_zero_order(engagement, helix):
    rpm = np.linspace(4000.0, 20000.0, 12)
    cutter = Cutter(3, 0.012, helix)
    one = lobes(SKEWED, cutter, engagement, rpm, feed_angle=0.7, method=MultiFrequency(harmonics=0), turn=0.4)
    two = stability_lobes(tip(SKEWED, turn=0.4), MillingProcess(cutter, COEFFICIENTS, engagement, 0.7), rpm * RPM, 30e-3)
    np.testing.assert_allclose(one.limit_depth, two.limit_depth, rtol=1e-6)
    np.testing.assert_allclose(one.chatter_frequency, two.chatter_frequency, rtol=1e-6)
    np.testing.assert_array_equal(one.lobe, two.lobe)


@pytest.mark.slow
def test_more_harmonics_come_closer():
    cutter, engagement, rpm = Cutter(2, 0.012), Engagement.from_immersion(0.3, "down"), np.array([7000.0, 11000.0, 17000.0])
    exact = lobes(SKEWED, cutter, engagement, rpm).limit_depth
    error = [
        np.abs(lobes(SKEWED, cutter, engagement, rpm, method=MultiFrequency(h)).limit_depth / exact - 1.0).max() for h in (0, 2, 6, 18)
    ]
    assert error[0] > error[1] > error[2] > error[3]
    assert error[0] > 0.02
    assert error[3] < 1e-3


def test_teeth_whose_coefficients_add_up_to_a_constant_need_no_harmonics():
    """Three or more equal teeth in a slot: the directional matrix does not vary, zero-order is exact."""
    rpm = np.linspace(5000.0, 20000.0, 9)
    one = lobes(SKEWED, Cutter(4, 0.012), SLOT, rpm, turn=0.3)
    two = stability_lobes(tip(SKEWED, turn=0.3), MillingProcess(Cutter(4, 0.012), COEFFICIENTS, SLOT), rpm * RPM, 30e-3)
    np.testing.assert_allclose(one.limit_depth, two.limit_depth, rtol=1e-6)


def test_a_helix_of_a_whole_pitch_leaves_the_mean():
    """Where the depth spreads each edge over a tooth pitch all harmonics of [alpha] vanish: zero-order is exact there."""
    rpm, engagement = np.array([15000.0]), Engagement.from_immersion(0.4, "down")
    depth = stability_lobes(tip(TWO), MillingProcess(Cutter(2, 0.012), COEFFICIENTS, engagement), rpm * RPM, 30e-3).limit_depth[0]
    helix = float(np.arctan(np.pi * 0.012 / (2.0 * depth)))
    assert lobes(TWO, Cutter(2, 0.012), engagement, rpm).limit_depth[0] != pytest.approx(depth, rel=5e-3)
    assert lobes(TWO, Cutter(2, 0.012, min(helix, 1.41)), engagement, rpm).limit_depth[0] == pytest.approx(depth, rel=2e-2)


@pytest.mark.parametrize("engagement", [HALF_DOWN, Engagement(0.3, 1.1), SLOT])
def test_lines_of_the_directional_matrix(engagement):
    """Their sum is the matrix itself; the mean is the closed form; along the helix they are the mean of lagged ones."""
    from rcsa_ident.stability.hill import PeriodicTeeth

    angle, depth = 0.4, 2e-3

    def lines(cutter, count):
        found = PeriodicTeeth(MillingProcess(cutter, COEFFICIENTS, engagement, angle), None, 2).harmonics(count, depth)
        assert found.delay == pytest.approx([2.0 * np.pi / 3.0])
        return found.stiffness[0] / COEFFICIENTS.tangential

    straight = lines(Cutter(3, 0.012), 400)
    np.testing.assert_allclose(straight[400], mean_directional_matrix(3, engagement, COEFFICIENTS, angle), atol=1e-14)
    c, s = np.cos(angle), np.sin(angle)
    turn = np.array([[c, -s], [s, c]])
    for phi in (0.5 * (engagement.entry + engagement.exit), 0.2):
        teeth = np.mod(phi + 2.0 * np.pi / 3.0 * np.arange(3), 2.0 * np.pi)
        inside = [p for p in teeth if engagement.entry < p < engagement.exit]
        exact = sum((turn @ naive.directional_matrix(p, COEFFICIENTS.radial_ratio) @ turn.T for p in inside), np.zeros((2, 2)))
        series = np.einsum("rij,r->ij", straight, np.exp(3j * phi * np.arange(-400, 401)))
        np.testing.assert_allclose(series, exact, atol=0.01)
    helical = lines(Cutter(3, 0.012, 0.6), 20)
    lag = (np.arange(4000) + 0.5) / 4000 * 2.0 * depth * np.tan(0.6) / 0.012
    mean = np.exp(-3j * np.outer(np.arange(-20, 21), lag)).mean(axis=1)
    np.testing.assert_allclose(helical, straight[380:421] * mean[:, None, None], atol=1e-8)


@pytest.mark.slow
@settings(max_examples=10, deadline=None)
@given(feed_angle=st.floats(-4.0, 4.0), turn=st.floats(-4.0, 4.0), immersion=st.floats(0.1, 1.0))
def test_machine_and_feed_turned_together(feed_angle, turn, immersion):
    engagement, rpm = Engagement.from_immersion(immersion, "down"), [8000.0, 15000.0]
    one = lobes(SKEWED, Cutter(2, 0.012, 0.5), engagement, rpm, feed_angle=feed_angle)
    two = lobes(SKEWED, Cutter(2, 0.012, 0.5), engagement, rpm, feed_angle=feed_angle + turn, turn=turn)
    np.testing.assert_allclose(one.limit_depth, two.limit_depth, rtol=1e-6)


@pytest.mark.slow
@settings(max_examples=10, deadline=None)
@given(feed_angle=st.floats(-4.0, 4.0), immersion=st.floats(0.1, 1.0), factor=st.floats(0.3, 3.0))
def test_symmetric_structure_and_scale(feed_angle, immersion, factor):
    """Neither the feed's direction nor up or down matters to a machine equal in x and y; a harder material has a lower limit."""
    rpm = [8000.0, 15000.0]
    up, down = (Engagement.from_immersion(immersion, s) for s in ("up", "down"))
    one = lobes(TWO, Cutter(2, 0.012), down, rpm)
    two = lobes(TWO, Cutter(2, 0.012), up, rpm, feed_angle=feed_angle)
    hard = lobes(TWO, Cutter(2, 0.012), down, rpm, CuttingCoefficients(factor * 6e8, 1.0 / 3.0))
    np.testing.assert_allclose(one.limit_depth, two.limit_depth, rtol=1e-6)
    np.testing.assert_allclose(one.limit_depth, factor * hard.limit_depth, rtol=1e-6)


@pytest.mark.slow
def test_order_of_the_speeds_and_the_depth_that_is_asked_for():
    rpm = [14000.0, 6000.0, 9000.0]
    one, two = (lobes(SKEWED, Cutter(2, 0.012, 0.5), HALF_DOWN, r).limit_depth for r in (rpm, rpm[::-1]))
    np.testing.assert_array_equal(one, two[::-1])
    found = lobes(SKEWED, Cutter(2, 0.012, 0.5), HALF_DOWN, rpm, max_depth=float(np.median(one)) * 1.0001)
    np.testing.assert_array_equal(found.stable, one > np.median(one))
    np.testing.assert_array_equal(found.limit_depth[~found.stable], one[~found.stable])
    assert np.all(np.isnan(found.chatter_frequency[found.stable]))
    assert np.all(found.lobe[found.stable] == -1)


def test_doubts_are_said():
    def said(word, **change):
        arguments = {"modes": TWO, "cutter": Cutter(2, 0.012), "engagement": SLOT, "rpm": [9000.0], **change}
        return any(word in w for w in lobes(**arguments).warnings)

    assert said("ends at 960 Hz", top=962.0)
    assert said("coarse", step=25.0)
    assert not said("")


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"process": MillingProcess(Cutter(2, 0.012, runout=np.array([0.0, 1e-5])), COEFFICIENTS, SLOT)}, "which teeth cut"),
        ({"process": MillingProcess(Cutter(2, 0.012), COEFFICIENTS, SLOT, speed_variation=SpeedVariation(0.1, 0.1))}, "constant speed"),
        ({"tip": Receptance(tip(TWO).omega[::-1], tip(TWO).values, TIP, TIP)}, "ascending"),
        ({"tip": Receptance(tip(TWO).omega, tip(TWO).values * np.nan, TIP, TIP)}, "finite"),
        ({"tip": Receptance(tip(TWO).omega, tip(TWO).values * 0.0, TIP, TIP)}, "flexible"),
        ({"tip": Receptance(tip(TWO).omega, tip(TWO).values[:, :1, :1], FLANGE, FLANGE)}, "tip.y"),
    ],
)
def test_bad_input(change, words):
    arguments = {"tip": tip(TWO), "process": MillingProcess(Cutter(2, 0.012), COEFFICIENTS, SLOT)}
    with pytest.raises(InputError, match=words):
        stability_lobes(**{**arguments, **change}, speeds=[900.0], max_depth=1.0, method=MULTI)


@pytest.mark.parametrize("harmonics", [-1, 201])
def test_number_of_harmonics(harmonics):
    with pytest.raises(InputError, match="harmonics"):
        MultiFrequency(harmonics)


@pytest.mark.parametrize("rpm", [2500.0, 4100.0, 8200.0])
def test_process_damping_agrees_with_a_march_through_time(rpm):
    """Harmonics of the velocity's force on one side, a damping matrix over time on the other."""
    process = MillingProcess(Cutter(4, 0.012, np.radians(30.0)), COEFFICIENTS, HALF_DOWN, 0.3, damping=ProcessDamping(1.5e14, 40e-6, 0.3))
    shape = {axis: np.array([[m**-0.5] for a, _, _, m in SKEWED if a == axis]) for axis in (0, 1)}
    models = {
        dof: normal_modes(
            [2.0 * np.pi * f for a, f, _, _ in SKEWED if a == axis], [z for a, _, z, _ in SKEWED if a == axis], shape[axis], (TIP[axis],)
        )
        for axis, dof in enumerate((Dof.X, Dof.Y))
    }
    marched = stability_lobes(TipModes.of(models), process, [rpm * RPM], 30e-3, FullDiscretisation(tolerance=1e-5))
    found = stability_lobes(tip(SKEWED), process, [rpm * RPM], 30e-3, MULTI)
    np.testing.assert_allclose(found.limit_depth, marched.limit_depth, rtol=2e-4)
    np.testing.assert_allclose(found.chatter_frequency, marched.chatter_frequency, rtol=2e-5)
    undamped = stability_lobes(tip(SKEWED), MillingProcess(process.cutter, COEFFICIENTS, HALF_DOWN, 0.3), [rpm * RPM], 30e-3, MULTI)
    assert found.limit_depth[0] > undamped.limit_depth[0]


@pytest.mark.parametrize(
    ("delays", "most"), [(np.linspace(1.5, 1.6, 80), 30), (np.r_[np.linspace(1.4, 1.5, 50), np.linspace(1.7, 1.8, 50)], 60)]
)
def test_fewer_delays_act_as_many(delays, most):
    """Teeth with a helix of their own have as many delays as nodes: phases of all frequencies up to the highest stay what they are."""
    rng = np.random.default_rng(1)
    acting = rng.standard_normal((delays.size, 3, 2, 2)) + 1j * rng.standard_normal((delays.size, 3, 2, 2))
    fewer, grouped = fewer_delays(delays, acting, 120.0)
    assert fewer.size < most
    for order in (0.0, 33.3, -120.0):
        wanted = np.tensordot(np.exp(-1j * order * delays), acting, axes=1)
        np.testing.assert_allclose(np.tensordot(np.exp(-1j * order * fewer), grouped, axes=1), wanted, atol=1e-10 * np.abs(acting).sum())


def test_few_delays_stay_what_they_are():
    delays, acting = np.array([1.4, 1.7]), np.ones((2, 1))
    assert fewer_delays(delays, acting, 50.0)[0].tolist() == delays.tolist()
