"""The zero-order limit against published figures, slow twins, the Nyquist criterion and laws of invariance."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rcsa_ident.base.errors import InputError
from rcsa_ident.cutting.coefficients import CuttingCoefficients
from rcsa_ident.cutting.conditions import Engagement
from rcsa_ident.cutting.cutter import Cutter
from rcsa_ident.cutting.process import MillingProcess, SpeedVariation
from rcsa_ident.dynamics.coordinates import Coordinate
from rcsa_ident.dynamics.receptance import Receptance
from rcsa_ident.stability.lobes import stability_lobes, uncoupled_planes
from rcsa_ident.stability.zero_order import ZeroOrder
from tests.oracles import literature, naive

RPM = 2.0 * np.pi / 60.0
TIP = (Coordinate.parse("tip.x"), Coordinate.parse("tip.y"))
FLANGE = (Coordinate.parse("flange.x"),)
SLOT = Engagement(0.0, np.pi)
COEFFICIENTS = CuttingCoefficients(6e8, 1.0 / 3.0)
BAND = 2.0 * np.pi * np.arange(400.0, 2001.0, 1.0)


def resonance(w, frequency, zeta, mass):
    wn = 2.0 * np.pi * frequency
    return 1.0 / (mass * (wn**2 - w**2 + 2j * zeta * wn * w))


def symmetric(w):
    case = literature.INSPERGER_STEPAN
    g = resonance(w, case["natural_frequency_hz"], case["damping_ratio"], case["modal_mass"])
    return np.eye(2) * np.asarray(g)[..., None, None]


def skewed(w):
    """Two directions with different modes, and a third mode between the axes: cross terms that matter."""
    x, y, d = resonance(w, 780.0, 0.03, 0.05), resonance(w, 930.0, 0.02, 0.04), resonance(w, 1150.0, 0.025, 0.06)
    h = np.asarray(d)[..., None, None] * np.outer([1.0, 0.6], [1.0, 0.6])
    h = h + np.asarray(x)[..., None, None] * np.diag([1.0, 0.0])
    return h + np.asarray(y)[..., None, None] * np.diag([0.0, 1.0])


def tip(model, band=BAND):
    return Receptance(band, model(band), TIP, TIP)


@pytest.mark.parametrize("name", ["slot", "half"])
def test_published_minimum(name):
    depth, frequency = literature.ZERO_ORDER_MINIMUM[name]
    engagement = SLOT if name == "slot" else Engagement.from_immersion(0.5, "up")
    speeds = np.linspace(4000.0, 25000.0, 2000) * RPM
    lobes = stability_lobes(tip(symmetric), MillingProcess(Cutter(2, 0.012), COEFFICIENTS, engagement), speeds, 1.0)
    assert lobes.absolute_limit == pytest.approx(depth, rel=2e-4)
    assert lobes.absolute_frequency == pytest.approx(2.0 * np.pi * frequency, rel=2e-5)
    assert lobes.limit_depth.min() == pytest.approx(depth, rel=1e-3)
    assert lobes.limit_depth.min() >= lobes.absolute_limit * (1.0 - 1e-9)
    assert [w.split(":")[0] for w in lobes.warnings] == ([] if name == "slot" else ["interrupted cut"])


def test_published_slot_table():
    lobes = stability_lobes(tip(symmetric), MillingProcess(Cutter(2, 0.012), COEFFICIENTS, SLOT), literature.ZERO_ORDER_SLOT_RPM * RPM, 1.0)
    np.testing.assert_allclose(lobes.limit_depth * 1e3, literature.ZERO_ORDER_SLOT_LIMIT_MM, rtol=3e-3)


@pytest.mark.parametrize("model", [symmetric, skewed])
@pytest.mark.parametrize("engagement", [SLOT, Engagement.from_immersion(0.4, "up"), Engagement.from_immersion(0.5, "down")])
@pytest.mark.parametrize("pitch", [np.full(3, 2.0 * np.pi / 3.0), np.radians([110.0, 130.0, 120.0])])
def test_slow_twin(model, engagement, pitch):
    cutter = Cutter(3, 0.012, pitch=pitch)
    alpha = naive.mean_directional_matrix(3, engagement.entry, engagement.exit, COEFFICIENTS.radial_ratio, 0.4, samples=4000)
    speeds = np.array([5300.0, 9000.0, 15700.0, 24000.0]) * RPM
    lobes = stability_lobes(tip(model), MillingProcess(cutter, COEFFICIENTS, engagement, 0.4), speeds, 1.0)
    for i, speed in enumerate(speeds):
        depth, frequency = naive.zero_order_limit(model, alpha, COEFFICIENTS.tangential, pitch, speed, BAND[::4])
        assert lobes.limit_depth[i] == pytest.approx(depth, rel=1e-3)
        assert lobes.chatter_frequency[i] == pytest.approx(frequency, rel=1e-4)


def winding(model, alpha, depth, speed, teeth):
    """Turns of det(I - a K (1 - e^{-i w tau}) alpha G) around zero along the frequency axis: minus its unstable poles."""
    w = 2.0 * np.pi * np.arange(0.05, 4000.0, 0.05)
    delay = 2.0 * np.pi / (teeth * speed)
    loop = (depth * COEFFICIENTS.tangential * (1.0 - np.exp(-1j * w * delay)))[:, None, None] * (alpha @ model(w))
    turns = np.sum(np.angle(np.divide(*np.linalg.det(np.eye(2) - loop)[np.array([np.arange(1, w.size), np.arange(w.size - 1)])])))
    return round(2.0 * turns / (2.0 * np.pi))


@pytest.mark.parametrize("model", [symmetric, skewed])
def test_nyquist(model):
    engagement = Engagement.from_immersion(0.6, "down")
    speeds = np.array([6000.0, 11000.0, 16000.0]) * RPM
    alpha = naive.mean_directional_matrix(3, engagement.entry, engagement.exit, COEFFICIENTS.radial_ratio, 0.0, samples=4000)
    lobes = stability_lobes(tip(model), MillingProcess(Cutter(3, 0.012), COEFFICIENTS, engagement), speeds, 1.0)
    for speed, limit in zip(speeds, lobes.limit_depth, strict=True):
        assert winding(model, alpha, 0.998 * limit, speed, 3) == 0
        assert winding(model, alpha, 1.002 * limit, speed, 3) <= -2


@settings(max_examples=15, deadline=None)
@given(feed_angle=st.floats(-4.0, 4.0), immersion=st.floats(0.2, 1.0), strategy=st.sampled_from(["up", "down"]), ratio=st.floats(0.0, 0.8))
def test_feed_direction_does_not_matter_to_a_symmetric_structure(feed_angle, immersion, strategy, ratio):
    coefficients = CuttingCoefficients(6e8, ratio)
    engagement = Engagement.from_immersion(immersion, strategy)
    speeds = np.linspace(6000.0, 20000.0, 7) * RPM
    one, two = (
        stability_lobes(tip(symmetric), MillingProcess(Cutter(2, 0.012), coefficients, engagement, a), speeds, 5.0)
        for a in (0.0, feed_angle)
    )
    np.testing.assert_allclose(one.limit_depth, two.limit_depth, rtol=1e-8)
    assert one.absolute_limit == pytest.approx(two.absolute_limit, rel=1e-8)


@settings(max_examples=15, deadline=None)
@given(feed_angle=st.floats(-4.0, 4.0), turn=st.floats(-4.0, 4.0), immersion=st.floats(0.2, 1.0))
def test_machine_and_feed_turned_together(feed_angle, turn, immersion):
    c, s = np.cos(turn), np.sin(turn)
    rotation = np.array([[c, -s], [s, c]])
    engagement = Engagement.from_immersion(immersion, "down")
    speeds = np.linspace(6000.0, 20000.0, 7) * RPM
    one = stability_lobes(tip(skewed), MillingProcess(Cutter(3, 0.012), COEFFICIENTS, engagement, feed_angle), speeds, 5.0)
    turned = tip(lambda w: rotation @ skewed(w) @ rotation.T)
    two = stability_lobes(turned, MillingProcess(Cutter(3, 0.012), COEFFICIENTS, engagement, feed_angle + turn), speeds, 5.0)
    np.testing.assert_allclose(one.limit_depth, two.limit_depth, rtol=1e-7)


@pytest.mark.parametrize("immersion", [0.3, 0.5, 0.9])
def test_mirror_of_up_and_down(immersion):
    """Down-milling on a symmetric structure has the limits of up-milling: alpha's trace and determinant are the same."""
    speeds = np.linspace(6000.0, 20000.0, 30) * RPM
    up, down = (
        stability_lobes(
            tip(symmetric), MillingProcess(Cutter(2, 0.012), COEFFICIENTS, Engagement.from_immersion(immersion, s)), speeds, 5.0
        )
        for s in ("up", "down")
    )
    np.testing.assert_allclose(up.limit_depth, down.limit_depth, rtol=1e-9)


def test_interpolation_holds_a_tenth_of_a_percent():
    """Lines 2 Hz apart, with a half-power bandwidth of 20 Hz, give what lines 0.1 Hz apart give."""
    speeds = np.linspace(6000.0, 20000.0, 40) * RPM
    limits = []
    for step in (0.1, 2.0):
        band = 2.0 * np.pi * np.arange(600.3, 1400.0, step)
        lobes = stability_lobes(tip(symmetric, band), MillingProcess(Cutter(2, 0.012), COEFFICIENTS, SLOT), speeds, 1.0)
        limits.append(np.append(lobes.limit_depth, lobes.absolute_limit))
    np.testing.assert_allclose(limits[1], limits[0], rtol=1e-3)


def test_speeds_in_any_order_and_beyond_the_depth():
    speeds = np.array([15000.0, 5000.0, 12500.0, 25000.0, 7500.0]) * RPM
    mixed = stability_lobes(tip(symmetric), MillingProcess(Cutter(2, 0.012), COEFFICIENTS, SLOT), speeds, 0.13e-3)
    ordered = stability_lobes(tip(symmetric), MillingProcess(Cutter(2, 0.012), COEFFICIENTS, SLOT), np.sort(speeds), 1.0)
    place = np.argsort(np.argsort(speeds))
    expected = np.where(ordered.limit_depth > 0.13e-3, np.inf, ordered.limit_depth)[place]
    np.testing.assert_array_equal(mixed.limit_depth, expected)
    np.testing.assert_array_equal(mixed.stable, [False, False, True, True, False])
    np.testing.assert_array_equal(mixed.lobe[mixed.stable], -1)
    assert np.all(np.isnan(mixed.chatter_frequency[mixed.stable]))
    assert mixed.absolute_limit == ordered.absolute_limit


@pytest.mark.parametrize("pitch", [np.full(3, 2.0 * np.pi / 3.0), np.radians([110.0, 130.0, 120.0])])
def test_many_tips_at_once_have_the_limits_of_each(pitch):
    """Speeds in any order, frequencies from rest, limits up to a depth; with cross receptances, too."""
    band = 2.0 * np.pi * np.arange(0.0, 1600.0, 4.0)
    speeds = np.array([15000.0, 5000.0, 12500.0, 25000.0]) * RPM
    process = MillingProcess(Cutter(3, 0.012, pitch=pitch), COEFFICIENTS, Engagement.from_immersion(0.5, "down"), 0.7)
    tips = np.zeros((3, band.size, 2, 2), dtype=complex)
    tips[:, :, 0, 0] = [resonance(band, f, 0.03, 0.04) for f in (780.0, 800.0, 830.0)]
    tips[:, :, 1, 1] = [resonance(band, f, 0.02, 0.05) for f in (930.0, 700.0, 900.0)]
    turn = np.array([[np.cos(0.4), -np.sin(0.4)], [np.sin(0.4), np.cos(0.4)]])
    for each in (tips, turn @ tips @ turn.T):
        found = ZeroOrder().depths(band, each, process, speeds, 0.4e-3)
        for limits, values in zip(found, each, strict=True):
            alone = stability_lobes(Receptance(band, values, TIP, TIP), process, speeds, 0.4e-3).limit_depth
            np.testing.assert_allclose(limits, alone, rtol=1e-9)
        assert 0 < np.isfinite(found).sum() < found.size
    tips[1, 7, 1, 1] = np.inf
    with np.errstate(all="ignore"), pytest.raises(InputError, match="finite"):
        ZeroOrder().depths(band, tips, process, speeds, 0.4e-3)


def test_lobe_numbers_count_waves():
    speeds = np.linspace(4000.0, 25000.0, 300) * RPM
    lobes = stability_lobes(tip(symmetric), MillingProcess(Cutter(2, 0.012), COEFFICIENTS, SLOT), speeds, 1.0)
    waves = lobes.chatter_frequency / (2.0 * speeds)
    assert np.all((lobes.lobe <= waves) & (waves < lobes.lobe + 1))


def test_one_flexible_direction():
    w = BAND
    x = Receptance(w, resonance(w, 922.0, 0.011, 0.03993)[:, None, None], TIP[:1], TIP[:1])
    lobes = stability_lobes(uncoupled_planes(x, None), MillingProcess(Cutter(2, 0.012), COEFFICIENTS, SLOT), np.array([900.0]), 1.0)
    # one real equation: a = 1 / (2 K alpha_xx Re G), at the most negative real part since alpha_xx < 0 here
    alpha_xx = naive.mean_directional_matrix(2, 0.0, np.pi, 1.0 / 3.0, 0.0, samples=2000)[0, 0]
    fine = resonance(2.0 * np.pi * np.arange(900.0, 960.0, 0.001), 922.0, 0.011, 0.03993).real
    assert lobes.absolute_limit == pytest.approx(1.0 / (2.0 * 6e8 * np.max(alpha_xx * fine)), rel=1e-4)
    assert stability_lobes(
        uncoupled_planes(None, uncoupled_planes(x, None)), MillingProcess(Cutter(2, 0.012), COEFFICIENTS, SLOT), [900.0], 1.0
    ).stable[0]


@pytest.mark.parametrize(("zeta", "below"), [(0.005, 120.0), (0.02, 500.0), (0.1, 2400.0)])
def test_what_passes_within_a_turn_is_left_out_and_told(zeta, below):
    """Where the structure has forgotten a vibration before the next tooth: 8 over damping and natural frequency, near the critical one."""
    lines = 2.0 * np.pi * np.arange(300.0, 2001.0, 1.0)
    values = np.zeros((lines.size, 2, 2), dtype=complex)
    values[:, 1, 1] = resonance(lines, 900.0, zeta, 0.04)
    process, speeds = MillingProcess(Cutter(2, 0.012), COEFFICIENTS, SLOT), below * np.array([0.5, 0.8, 1.3, 3.0]) * RPM
    told = [w for w in stability_lobes(Receptance(lines, values, TIP, TIP), process, speeds, 1.0).warnings if "forgotten" in w]
    assert told
    assert told[0].startswith("at 2 of 4 speeds")
    assert not [w for w in stability_lobes(Receptance(lines, values, TIP, TIP), process, speeds[2:], 1.0).warnings if "forgotten" in w]


def test_doubts_are_told():
    thin = Engagement.from_immersion(0.1, "down")
    lobes = stability_lobes(tip(symmetric), MillingProcess(Cutter(2, 0.012), COEFFICIENTS, thin), [900.0], 1.0)
    assert any("interrupted cut" in w and "flip" in w for w in lobes.warnings)
    edge = tip(symmetric, BAND[: np.searchsorted(BAND, 2.0 * np.pi * 910.0)])
    assert any("edge" in w for w in stability_lobes(edge, MillingProcess(Cutter(2, 0.012), COEFFICIENTS, SLOT), [900.0], 1.0).warnings)
    coarse = tip(symmetric, 2.0 * np.pi * np.arange(400.0, 2000.0, 20.0))
    assert any("coarse" in w for w in stability_lobes(coarse, MillingProcess(Cutter(2, 0.012), COEFFICIENTS, SLOT), [900.0], 1.0).warnings)
    run_out = Cutter(2, 0.012, runout=np.array([0.0, 1e-5]))
    assert any("run-out" in w for w in stability_lobes(tip(symmetric), MillingProcess(run_out, COEFFICIENTS, SLOT), [900.0], 1.0).warnings)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"speeds": [0.0]}, "speeds"),
        ({"speeds": []}, "one or more"),
        ({"max_depth": 0.0}, "max_depth"),
        ({"process": MillingProcess(Cutter(2, 0.012), COEFFICIENTS, SLOT, speed_variation=SpeedVariation(0.1, 0.1))}, "constant speed"),
        ({"tip": Receptance(BAND, symmetric(BAND)[:, :1, :1], FLANGE, FLANGE)}, "tip.y"),
        ({"tip": Receptance(BAND[::-1], symmetric(BAND), TIP, TIP)}, "ascending"),
        ({"tip": Receptance(BAND, symmetric(BAND) * np.nan, TIP, TIP)}, "finite"),
    ],
)
def test_bad_input(change, words):
    arguments = {
        "tip": tip(symmetric),
        "process": MillingProcess(Cutter(2, 0.012), COEFFICIENTS, SLOT),
        "speeds": [900.0],
        "max_depth": 1.0,
    }
    with pytest.raises(InputError, match=words):
        stability_lobes(**{**arguments, **change})


def test_a_real_face_mill():
    """Measured tooltip FRFs of a two-flute face mill, K_t 1319.4 and K_r 788.8 MPa: 1.015 mm at 1441 Hz."""
    folder = Path(__file__).resolve().parents[2].parent / "shared" / "data"
    if not (folder / "facemill_x.frf").exists():
        pytest.skip("the measured face-mill FRFs are not part of the repository")
    planes = []
    for axis, coordinate in zip("xy", TIP, strict=True):
        table = np.loadtxt(folder / f"facemill_{axis}.frf", usecols=(0, 1, 2))[1:]
        values = (table[:, 1] + 1j * table[:, 2])[:, None, None]
        planes.append(Receptance(2.0 * np.pi * table[:, 0], values, (coordinate,), (coordinate,)))
    half = Engagement.from_immersion(0.5, "down")
    speeds = np.linspace(5000.0, 20000.0, 2000) * RPM
    coefficients = CuttingCoefficients(1319.4e6, 788.8 / 1319.4)
    lobes = stability_lobes(uncoupled_planes(*planes), MillingProcess(Cutter(2, 0.03175), coefficients, half), speeds, 1.0)
    assert lobes.absolute_limit == pytest.approx(1.015e-3, rel=1e-3)
    assert lobes.absolute_frequency / (2.0 * np.pi) == pytest.approx(1441.0, abs=1.0)
    assert lobes.limit_depth.min() == pytest.approx(1.015e-3, rel=2e-3)
