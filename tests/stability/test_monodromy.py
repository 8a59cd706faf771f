"""The largest multiplier against published ones, orders of convergence, slow twins, laws that hold for all cuts."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rcsa_ident.base.errors import InputError
from rcsa_ident.cutting.coefficients import CuttingCoefficients
from rcsa_ident.cutting.conditions import Engagement, EngagementMap
from rcsa_ident.cutting.cutter import Cutter
from rcsa_ident.cutting.process import MillingProcess, ProcessDamping, SpeedVariation
from rcsa_ident.stability._kernels import cut as kernels
from rcsa_ident.stability.discretisation import FullDiscretisation
from rcsa_ident.stability.lobes import stability_lobes
from rcsa_ident.stability.monodromy import MonodromyOperator, common_period, lobatto
from rcsa_ident.stability.tip_modes import TipModes
from tests.oracles import naive
from tests.oracles.literature import MULTIPLIER_DEPTH_MM, MULTIPLIER_RPM, MULTIPLIERS
from tests.stability.mills import COEFFICIENTS, HALF, ONE, RPM, SKEWED, TWO, Table, mill, tip
from tests.stability.test_monodromy_kernels import SMALL, dense

#: The mill of the published multipliers: polynomials' degree, constant coefficients, steps per tooth period. What is good to 1e-5 takes
#: very many steps of a low order.
WAYS = {"degree 6": (6, False, 12), "published degree 1": (1, False, 3600), "semi-discretisation": (3, True, 3600)}


def radius(cut: MonodromyOperator, rpm: float, depth: float, intervals: float, residual: float = 1e-10) -> float:
    speed = rpm * RPM
    step = 2.0 * np.pi / (cut.process.cutter.teeth * speed) / intervals
    return abs(cut.multiplier(speed, depth, step, residual=residual).value)


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize(("name", "immersion", "strategy"), MULTIPLIERS)
def test_published(name, immersion, strategy, way):
    degree, frozen, intervals = WAYS[way]
    cut = MonodromyOperator(tip(ONE if name == "one" else TWO), mill(2, immersion, strategy), degree, frozen)
    found = [radius(cut, MULTIPLIER_RPM, depth * 1e-3, intervals, 1e-7) for depth in MULTIPLIER_DEPTH_MM]
    np.testing.assert_allclose(found, MULTIPLIERS[name, immersion, strategy], rtol=1e-5)


#: Where teeth enter and leave within the period, the order holds all the same.
INTERRUPTED = {
    "half": mill(2, 0.5),
    "low immersion": mill(3, 0.07, "up"),
    "helix": mill(2, 0.2, helix=0.5),
    "rubbing": mill(2, 0.2, helix=0.5, damping=ProcessDamping(3e13, 6e-5)),
    "unequal pitch": mill(3, 0.2, pitch=np.radians([100.0, 121.0, 139.0])),
    "a varying speed": mill(2, 0.2, speed_variation=SpeedVariation(0.2, 0.5)),
}


@pytest.mark.parametrize("process", INTERRUPTED)
@pytest.mark.parametrize(("degree", "frozen", "steps"), [(1, False, 60), (2, False, 40), (3, False, 24), (3, True, 80)])
def test_order(process, degree, frozen, steps):
    """The error falls with the power of the step that the map names; with degree + 1 where the past is not looked at in nodes."""
    cut = MonodromyOperator(tip(SKEWED), INTERRUPTED[process], degree, frozen)
    exact = radius(MonodromyOperator(tip(SKEWED), INTERRUPTED[process], 8), 7000.0, 1e-3, 30)
    coarse, fine = (abs(radius(cut, 7000.0, 1e-3, n) - exact) for n in (steps, 4 * steps))
    order = min(cut.order, degree + 1) if process in ("unequal pitch", "a varying speed") else cut.order
    assert coarse < 0.2 * exact
    assert fine < max(coarse / 4.0 ** (order - 0.6), 5e-9)


def test_order_is_not_higher_than_said():
    """In a slot the errors do not end in rounding: the slope is the order."""
    for degree, frozen, steps in ((1, False, 60), (2, False, 16), (3, False, 8), (3, True, 60)):
        cut = MonodromyOperator(tip(ONE), mill(2, 1.0), degree, frozen)
        exact = radius(MonodromyOperator(tip(ONE), mill(2, 1.0), 8), 5000.0, 0.7e-3, 40)
        error = [abs(radius(cut, 5000.0, 0.7e-3, n) - exact) for n in (steps, 2 * steps, 4 * steps)]
        slope = np.log2(error[1] / error[2])
        assert slope == pytest.approx(cut.order, abs=0.35), (degree, frozen, error)


# What a slow march with dense matrices finds, too. It averages within steps, and its past is straight lines: two resolutions, extrapolated.
UNEQUAL: dict[str, tuple[Table, MillingProcess, float]] = {
    "pitch": (SKEWED[:2], mill(3, 0.5, feed_angle=0.4, pitch=np.radians([100.0, 121.0, 139.0])), 1.1e-3),
    "pitch of two teeth": (SKEWED, mill(2, 0.4, "up", pitch=np.radians([150.0, 210.0])), 1.6e-3),
    "speed": (ONE, mill(2, 0.5, speed_variation=SpeedVariation(0.2, 0.5)), 1.5e-3),
    "fast swings": (SKEWED[:2], mill(2, 0.3, feed_angle=0.4, speed_variation=SpeedVariation(0.1, 2.0)), 1.2e-3),
    "helix": (SKEWED, mill(2, 0.3, helix=0.5, feed_angle=0.4), 1.2e-3),
    "speed and rubbing": (ONE, mill(2, 0.5, speed_variation=SpeedVariation(0.2, 1.0)), 0.8e-3),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", UNEQUAL)
def test_slow_twin(name):
    modes, process, depth = UNEQUAL[name]
    speed, cutter, v = 14000.0 * RPM, process.cutter, process.speed_variation
    cut = MonodromyOperator(tip(modes), process, 6)
    found = cut.multiplier(speed, depth, 2e-4, residual=1e-9).value
    plan = cut._plan(speed, 2e-4, np.zeros(0))

    def clock(angle):
        return np.array([kernels.time_at(a, plan) for a in angle])

    windows = [
        (cutter.tooth_angle[j], process.engagement.entry, process.engagement.exit, cutter.pitch[j])
        for j in range(cutter.teeth if cut.spacing > 6.0 or v is not None or cutter.helix > 0.0 else 1)
    ]
    lag = 2.0 * depth * np.tan(cutter.helix) / cutter.diameter
    k = depth * process.coefficients.tangential * np.array([1.0, process.coefficients.radial_ratio])
    period = cut.period if v is None else max(cut.period, 2.0 * np.pi)
    # enough steps per wave, a number that no entry or exit falls into
    base = 300 if period < 6.5 else 400
    slow = []
    for n in (base, 2 * base):
        edges = np.unique(np.round(np.concatenate([np.linspace(0.0, period, n + 1), _ends(windows, lag, period)]), 10))
        slow.append(naive.milling_multiplier(modes, windows, tuple(k), edges, clock, process.feed_angle, lag, 60 if lag else 1))
    turns = round(period / cut.period)
    sizes = np.log(np.abs(slow)) / turns
    assert sizes[1] + (sizes[1] - sizes[0]) / 3.0 == pytest.approx(np.log(abs(found)), abs=4e-4)
    assert abs(np.exp(sizes[1]) - abs(found)) < 5e-3


def _ends(windows, lag, period):
    """Angles at which a tooth enters or leaves, at the tip or at the top."""
    places = [phi + shift - w[0] + 2.0 * np.pi * k for w in windows for phi in w[1:3] for shift in (0.0, lag) for k in range(-2, 8)]
    return [p for p in places if 1e-6 < p < period - 1e-6]


def test_many_lightly_damped_modes_do_not_hide_the_largest():
    """At speeds at which no mode dies within a tooth period, a search that stops early settles on the second largest."""
    rng = np.random.default_rng(5)
    rows = [(axis, f, z, m) for axis in (0, 1) for f, z, m in zip(*_random_modes(rng, 12), strict=True)]
    for speed in np.array([40_000.0, 90_000.0]) * RPM:
        cut = MonodromyOperator(tip(tuple(rows)), mill(4, 0.4, helix=0.5, feed_angle=1.2), 6)
        start = None
        for depth in np.geomspace(0.1e-3, 6e-3, 10):
            found = cut.multiplier(speed, depth, 5e-5, start, residual=1e-4)
            start = found.vector
            exact = np.abs(np.linalg.eigvals(dense(cut, speed, depth, 5e-5))).max()
            assert np.log(abs(found.value)) == pytest.approx(np.log(exact), abs=2e-4)


def _random_modes(rng, count):
    return rng.uniform(500.0, 5000.0, count), rng.uniform(0.002, 0.01, count), rng.uniform(0.05, 2.0, count)


def test_tooth_numbers_do_not_matter():
    pitch, runout = np.radians([100.0, 121.0, 139.0]), np.array([0.0, 12e-6, -8e-6])
    found = []
    for k in range(3):
        process = mill(3, 0.5, helix=0.4, pitch=np.roll(pitch, k), runout=np.roll(runout, k), feed_per_tooth=6e-5)
        found.append(radius(MonodromyOperator(tip(SKEWED), process, 6), 9000.0, 1e-3, 20))
    np.testing.assert_allclose(found, found[0], rtol=1e-6)


def test_small_deviations_change_little():
    """Pitch, run-out and speed that hardly vary: per revolution the equal mill's multiplier to the power of its teeth."""
    modes, small = tip(SKEWED), 1e-6
    equal = radius(MonodromyOperator(modes, mill(2, 0.5, feed_angle=0.4), 6), 9000.0, 1e-3, 12)
    for process, teeth in (
        (mill(2, 0.5, feed_angle=0.4, pitch=np.pi + np.array([-small, small])), 2),
        (mill(2, 0.5, feed_angle=0.4, runout=[0.0, 1e-12], feed_per_tooth=1e-4), 2),
        (mill(2, 0.5, feed_angle=0.4, speed_variation=SpeedVariation(small, 0.5)), 4),
        (mill(2, 0.5, feed_angle=0.4, damping=ProcessDamping(1e9, 1e-8)), 1),
    ):
        assert radius(MonodromyOperator(modes, process, 6), 9000.0, 1e-3, 12) == pytest.approx(equal**teeth, rel=1e-5)


def test_run_out_as_large_as_the_feed_leaves_one_tooth():
    """A mill whose second tooth never cuts is a mill of one tooth."""
    modes = tip(SKEWED)
    two = MonodromyOperator(modes, mill(2, 0.5, runout=[0.0, -3e-4], feed_per_tooth=1e-4), 6)
    one = MonodromyOperator(modes, mill(1, 0.5), 6)
    assert set(two._windows(9000.0, 1e-3)[0][:, 0]) == {0.0}
    assert radius(two, 9000.0, 1e-3, 12) == pytest.approx(radius(one, 9000.0, 1e-3, 24), rel=1e-7)


@settings(max_examples=12, deadline=None)
@given(
    factor=st.floats(0.2, 5.0),
    immersion=st.floats(0.05, 1.0),
    helix=st.floats(0.0, 0.8),
    turn=st.floats(-3.0, 3.0),
    strategy=st.sampled_from(["up", "down"]),
)
def test_laws(factor, immersion, helix, turn, strategy):
    """Stiffer material at less depth (without a helix), a machine turned with its feed, time that runs faster."""
    process = mill(2, immersion, strategy, helix, feed_angle=0.3)
    base = radius(MonodromyOperator(tip(SKEWED), process, 4), 9000.0, 0.7e-3, 14)
    turned = mill(2, immersion, strategy, helix, feed_angle=0.3 + turn)
    assert radius(MonodromyOperator(tip(SKEWED, turn=turn), turned, 4), 9000.0, 0.7e-3, 14) == pytest.approx(base, rel=1e-6)
    # frequencies and speed times a factor, masses over its square: the same stiffness
    fast = tuple((axis, factor * f, zeta, m / factor**2) for axis, f, zeta, m in SKEWED)
    assert radius(MonodromyOperator(tip(fast), process, 4), factor * 9000.0, 0.7e-3, 14) == pytest.approx(base, rel=1e-6)
    straight = mill(2, immersion, strategy, feed_angle=0.3)
    hard = mill(2, immersion, strategy, feed_angle=0.3, coefficients=CuttingCoefficients(factor * 6e8, COEFFICIENTS.radial_ratio))
    one, two = (MonodromyOperator(tip(SKEWED), p, 4) for p in (straight, hard))
    assert radius(one, 9000.0, 0.7e-3, 14) == pytest.approx(radius(two, 9000.0, 0.7e-3 / factor, 14), rel=1e-6)


@pytest.mark.parametrize("immersion", [0.05, 0.5, 0.8])
def test_up_is_down_for_a_symmetric_machine(immersion):
    up, down = (MonodromyOperator(tip(TWO), mill(3, immersion, s, helix=0.3), 6) for s in ("up", "down"))
    assert radius(up, 7000.0, 0.3e-3, 12) == pytest.approx(radius(down, 7000.0, 0.3e-3, 12), rel=1e-7)


def test_without_a_cut_the_structure_is_left():
    cut = MonodromyOperator(tip(SKEWED), mill(2, 0.3), 6)
    expected = np.exp(np.max(cut.arrays.pole.real) * cut.duration(9000.0 * RPM))
    assert radius(cut, 9000.0, 1e-12, 12) == pytest.approx(expected, rel=1e-6)


def test_a_direction_that_does_not_move_is_left_out():
    """A second direction as stiff as can be is none."""
    stiff = (*ONE, (1, 20_000.0, 0.01, 1e6))
    one, two = (MonodromyOperator(tip(modes), mill(2, 0.5, feed_angle=0.2), 6) for modes in (ONE, stiff))
    assert one.arrays.outputs.shape[0] == 1
    assert two.arrays.outputs.shape[0] == 2
    assert radius(one, 9000.0, 1e-3, 20) == pytest.approx(radius(two, 9000.0, 1e-3, 60), rel=1e-6)


def test_a_residual_compliance_is_a_mode_far_above():
    """A constant beside the modes against a mode of the same static compliance at 40 kHz, in a cut with rubbing and helix."""
    value, wn = 1e-7, 2.0 * np.pi * 40e3
    high = (0, 40e3, 0.05, 1.0 / (value * wn**2))
    for process in (mill(2, 0.4), mill(3, 0.4, helix=0.5, damping=ProcessDamping(3e12, 6e-5))):
        with_constant = MonodromyOperator(tip(SKEWED, residual=(value, 0.0)), process, 6)
        with_mode = MonodromyOperator(tip((*SKEWED, high)), process, 6)
        bare = MonodromyOperator(tip(SKEWED), process, 6)
        a, b, c = (np.log(radius(each, 9000.0, 1.5e-3, n)) for each, n in ((with_constant, 20), (with_mode, 150), (bare, 20)))
        assert abs(a - c) > 5e-3
        assert a == pytest.approx(b, abs=0.04 * abs(a - c))


def test_modes_with_a_shape_that_is_one_everywhere():
    modes = tip(SKEWED)
    flat = TipModes(modes.pole, modes.outputs, modes.inputs, modes.constant, np.array([0.0, 0.01]), np.ones((2, 3)))
    for process in (mill(2, 0.4, helix=0.6, feed_angle=0.4), mill(3, 0.3, "up", damping=ProcessDamping(3e13, 6e-5))):
        one, two = (radius(MonodromyOperator(m, process, 4), 9000.0, 1.2e-3, 14) for m in (modes, flat))
        assert two == pytest.approx(one, rel=1e-6)


def test_modes_that_move_the_edge_less_away_from_the_tip():
    """Half the motion everywhere is a quarter of the depth for a straight edge."""
    modes = tip(ONE)
    half = TipModes(modes.pole, modes.outputs, modes.inputs, modes.constant, np.array([0.0]), np.array([[0.5]]))
    one, two = (
        radius(MonodromyOperator(modes, mill(), 6), 9000.0, 0.3e-3, 14),
        radius(MonodromyOperator(half, mill(), 6), 9000.0, 1.2e-3, 14),
    )
    assert two == pytest.approx(one, rel=1e-7)


@pytest.mark.parametrize("name", SMALL)
def test_growth_is_that_of_the_map_written_down(name):
    """Noise along the period before; the largest peak of a period over that of the first, and no more periods than it takes."""
    modes, process, frozen = SMALL[name]
    cut, speed, depth, step = MonodromyOperator(tip(modes), process, 3, frozen), 9000.0 * RPM, 4e-3, 2e-4
    layout, duration, m = cut._lay_out(speed, depth, step), cut.duration(speed), cut.arrays.pole.size
    # eight samples of each direction in a wave of the highest mode
    samples = int(8.0 * duration * np.abs(cut.arrays.pole).max() / (2.0 * np.pi)) + 2
    noise = np.random.default_rng(5).standard_normal((cut.arrays.outputs.shape[0], samples))
    motion = np.stack([np.interp(layout.time, np.linspace(0.0, duration, samples), each) for each in noise], axis=1)
    vector, peaks = np.concatenate([np.zeros(2 * m), motion.ravel()]), []
    for _ in range(6):
        vector = dense(cut, speed, depth, step) @ vector
        peaks.append(np.abs(vector[2 * m :]).max())
    assert cut.growth(speed, depth, step, 5, 1e300, 5) == pytest.approx(max(peaks) / peaks[0], rel=1e-9)
    assert cut.growth(speed, depth, step, 0, 1e300, 5) == 1.0
    assert cut.growth(speed, depth, step, 5, 0.5, 5) == 1.0
    assert cut.growth(speed, depth, step, 5, 1e300, 6) != pytest.approx(max(peaks) / peaks[0], rel=1e-6)


def test_without_a_cut_nothing_grows():
    """Material that begins above the edges that are asked for."""
    above = EngagementMap(np.array([2e-3, 3e-3]), np.ones(2), np.full(2, 2.0))
    cut = MonodromyOperator(tip(ONE), MillingProcess(Cutter(2, 0.012), COEFFICIENTS, above), 3)
    assert cut.growth(9000.0 * RPM, 1e-3, 1e-4, 5, 1e300) == 1.0
    assert cut.multiplier(9000.0 * RPM, 1e-3, 1e-4).value == pytest.approx(np.exp(cut.arrays.pole[0] * cut.duration(9000.0 * RPM)))


def test_waves():
    """What vibrates: the response to a force at those frequencies is that motion, and they are a period's multiple apart."""
    cut = MonodromyOperator(tip(SKEWED), mill(2, 0.4, helix=0.3, feed_angle=0.4), 6)
    found = cut.multiplier(9000.0 * RPM, 1.2e-3, 2e-4, waves=True)
    passing, base = 2.0 * 9000.0 * RPM, float(np.angle(found.value)) / found.period
    # of either sign; what is a rounding below a multiple is not a period above it
    left = np.mod([found.omega - base, -found.omega - base], passing)
    np.testing.assert_allclose(np.minimum(left, passing - left).min(axis=0), 0.0, atol=1e-6 * passing)
    strongest = found.omega[np.argmax(found.motion)] / (2.0 * np.pi)
    assert np.min(np.abs(strongest / np.array([780.0, 930.0, 1350.0]) - 1.0)) < 0.1


def test_amplitudes_are_those_of_the_motion():
    """In a slot the vector holds the motion of the whole period: its lines are the tip's, also far from the modes."""
    cut, speed = MonodromyOperator(tip(SKEWED), mill(2, 1.0), 6), 9000.0 * RPM
    # at the limit, where nothing grows
    depth = float(stability_lobes(tip(SKEWED), mill(2, 1.0), [speed], 20e-3, FullDiscretisation(tolerance=1e-7)).limit_depth[0])
    found = cut.multiplier(speed, depth, 1e-4, waves=True, residual=1e-9)
    ((_, h, steps, _, _),), *_, time = cut._laid_out(speed, depth, 1e-4)
    motion = found.vector[2 * cut.arrays.pole.size :].reshape(-1, 2)
    rate = np.log(found.value) / found.period
    # frequencies of either sign: a line below zero is told by its size only
    lines = {}
    for k in range(-12, 12):
        omega = rate.imag + 2.0 * np.pi * k / found.period
        wave = np.exp(-(rate.real + 1j * omega) * time)[:, None] * motion
        total = sum(h * cut.table[1] @ wave[6 * i : 6 * i + 7] for i in range(int(steps)))
        lines[abs(omega)] = np.linalg.norm(total)
    expected = np.array([min(lines.items(), key=lambda each: abs(each[0] - w))[1] for w in found.omega])
    assert np.all([min(abs(w - each) for each in lines) < 1.0 for w in found.omega])
    np.testing.assert_allclose(found.motion / found.motion.max(), expected / expected.max(), rtol=0, atol=2e-6)


def test_waves_of_a_slow_revolution_do_not_cost_its_square(monkeypatch):
    """Unequal teeth repeat less often: a longer period holds as many more lines as points: they share their exponentials."""
    cutter = Cutter(4, 0.012, np.radians(30.0), np.radians([80.0, 100.0, 80.0, 100.0]))
    cut, speed = MonodromyOperator(tip(TWO), MillingProcess(cutter, COEFFICIENTS, HALF), 6), 1000.0 * RPM
    # the kernels are compiled before
    cut.multiplier(speed, 1e-3, 2e-4)
    asked, exp = [], np.exp
    monkeypatch.setattr(np, "exp", lambda x, *more: (asked.append(np.size(x)), exp(x, *more))[1])
    found = cut.multiplier(speed, 1e-3, 2e-4, waves=True)
    points = cut._laid_out(speed, 1e-3, 2e-4).time.size
    assert found.omega.size > 100
    assert sum(asked) < 0.5 * found.omega.size * points


def test_common_period():
    swing = mill(3, 0.5, speed_variation=SpeedVariation(0.1, 0.5))
    assert common_period(mill(3, 0.5), 2.0) == 2.0
    assert common_period(swing, 2.0 * np.pi / 3.0) == pytest.approx(4.0 * np.pi)
    assert common_period(mill(3, 0.5, speed_variation=SpeedVariation(0.1, 1.5)), 2.0 * np.pi / 3.0) == pytest.approx(4.0 * np.pi / 3.0)
    assert common_period(mill(3, 0.5, speed_variation=SpeedVariation(0.1, 1.5)), 2.0 * np.pi) == pytest.approx(4.0 * np.pi)


def test_lobatto():
    for degree in range(1, 9):
        table = lobatto(degree)
        node, weight, powers = table[0], table[1], table[2:]
        # exact up to twice the degree less one
        for k in range(2 * degree):
            assert weight @ node**k == pytest.approx(1.0 / (k + 1), abs=1e-11)
        np.testing.assert_allclose(powers @ node ** np.arange(degree + 1)[:, None], np.eye(degree + 1), atol=1e-9)


def _elliptic():
    modes = tip(TWO)
    out = modes.outputs * np.array([[1.0, 1.0], [1.0j, 1.0]]) + 0.4j * modes.outputs[::-1]
    return TipModes(modes.pole, out, out.T, modes.constant, np.array([0.0]), np.ones((1, 2)))


ROUGH_TEETH = mill(2, 0.5, runout=[0.0, 1e-5], feed_per_tooth=1e-4, engagement_profile=lambda speed, depth: np.zeros((1, 4)))


@pytest.mark.parametrize(
    ("make", "field", "words"),
    [
        (lambda: MonodromyOperator(tip(ONE), mill(2, 0.5, runout=[0.0, 1e-5]), 6), "feed_per_tooth", "which teeth cut"),
        (lambda: MonodromyOperator(tip(ONE), ROUGH_TEETH, 6), "runout", "equal teeth beside"),
        (lambda: MonodromyOperator(tip(ONE), mill(2, 0.5, speed_variation=SpeedVariation(0.1, np.pi / 7)), 6), "ratio", "whole number"),
        (lambda: MonodromyOperator(_elliptic(), mill(), 6), "tip modes", "one direction each"),
    ],
)
def test_bad_input(make, field, words):
    with pytest.raises(InputError, match=words) as error:
        make()
    assert error.value.field == field


@pytest.mark.parametrize(
    "process",
    [
        mill(1, 0.5),
        mill(12, 0.9, helix=0.5),
        mill(12, 0.01),
        MillingProcess(Cutter(2, 0.012), COEFFICIENTS, Engagement(np.radians(100.0), np.radians(101.0))),
        MillingProcess(Cutter(4, 0.004, np.radians(60.0)), CuttingCoefficients(3e7, 0.3), HALF),
        mill(2, 0.5, helix=1.3, pitch=np.radians([60.0, 300.0])),
        mill(3, 0.6, damping=ProcessDamping(1e15, 2e-4)),
        mill(2, 0.5, speed_variation=SpeedVariation(0.8, 0.1)),
    ],
)
def test_strange_cuts_against_all_eigenvalues(process):
    for rpm, depth in ((9000.0, 2e-4), (9000.0, 30e-3), (120_000.0, 3e-3)):
        cut, step = MonodromyOperator(tip(SKEWED[:2]), process, 3), 2.5e-4
        found = cut.multiplier(rpm * RPM, depth, step)
        exact = np.abs(np.linalg.eigvals(dense(cut, rpm * RPM, depth, step))).max()
        assert np.isfinite(abs(found.value))
        assert np.log(abs(found.value)) == pytest.approx(np.log(exact), abs=1e-4)
