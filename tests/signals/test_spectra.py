import numpy as np
import pytest
from scipy.signal import lfilter

from rcsa_ident.base.errors import InputError
from rcsa_ident.signals.spectra import follow_speed, line_spectrum, refine_speed, segment_lines
from tests.fixtures.synthetic import RATE, RPM, drift, profile, wave


def bound(amplitude, noise, n):
    """Cramér-Rao bound of the speed for lines of unknown amplitude in white noise [rad/s]."""
    order = np.arange(amplitude.shape[0])[:, None]
    return np.sqrt(2.0 * noise**2 * 12.0 * RATE**2 / (n * (n**2 - 1.0)) / np.sum(order**2 * np.abs(amplitude) ** 2))


def lines(rng, highest, teeth=4, only_teeth=False):
    amplitude = np.zeros((highest + 1, 2), dtype=complex)
    if not only_teeth:
        amplitude[:9] = profile(rng)[: highest + 1]
    amplitude[teeth::teeth] += 5e-7 * np.exp(2j * np.pi * rng.random(amplitude[teeth::teeth].shape))
    return amplitude


@pytest.mark.slow
@pytest.mark.parametrize(
    ("rpm", "noise", "only_teeth", "n"),
    [
        (8000.0, 2e-9, False, 7168),
        (8000.0, 2e-9, True, 7168),
        (12345.0, 1e-7, False, 7168),
        (20000.0, 2e-9, True, 7168),
        (13000.0, 1e-8, False, 2100),
    ],
)
def test_speed_is_as_good_as_it_can_be(rpm, noise, only_teeth, n):
    rng = np.random.default_rng(11)
    ratio = []
    for _ in range(60):
        speed = rpm * RPM * (1.0 + 1e-3 * rng.normal())
        amplitude = lines(rng, 16, only_teeth=only_teeth)
        x = wave(amplitude, speed, n) + noise * rng.normal(size=(n, 2)) + drift(rng, n)[:, None]
        found = refine_speed(x, RATE, speed * (1.0 + rng.uniform(-0.009, 0.009)))
        ratio.append((found - speed) / bound(amplitude, noise, n))
    # 60 draws of an efficient estimate: 1 +- 0.09, and what the blocks give away
    assert np.sqrt(np.mean(np.square(ratio))) < 1.4
    assert abs(np.mean(ratio)) < 0.5


@pytest.mark.parametrize("order", [2, 4, 8, 15])
def test_speed_from_multiples_alone(order):
    # no line at the spindle's own frequency
    rng = np.random.default_rng(order)
    amplitude = np.zeros((order + 1, 1), dtype=complex)
    amplitude[order] = 1e-6
    speed = 9000.0 * RPM
    x = wave(amplitude, speed, 7168) + 1e-8 * rng.normal(size=(7168, 1))
    for off in (-0.009, 0.0, 0.009):
        assert refine_speed(x, RATE, speed * (1.0 + off)) == pytest.approx(speed, rel=2e-5)


def test_lines_above_those_that_are_looked_at_do_no_harm():
    rng = np.random.default_rng(4)
    amplitude = lines(rng, 33, only_teeth=True)
    speed = 8000.0 * RPM * 1.0007
    for n, error in ((1600, 2e-6), (7000, 2e-8)):
        assert refine_speed(wave(amplitude, speed, n), RATE, 8000.0 * RPM) == pytest.approx(speed, rel=error)


def test_follow_speed_from_nearby():
    amplitude = lines(np.random.default_rng(5), 20)
    speed = 15000.0 * RPM
    near = speed * (1.0 + 0.1 / (speed / 2.0 / np.pi * 0.28 * 16.0))
    assert follow_speed(wave(amplitude, speed, 7168), RATE, near) == pytest.approx(speed, rel=1e-8)


def test_a_record_of_three_turns_is_refused():
    with pytest.raises(InputError, match="at least four revolutions"):
        refine_speed(np.zeros((500, 1)), RATE, 9000.0 * RPM)


def coloured(rng, n, colour):
    white = rng.normal(size=(n, 1))
    return white if colour == 0.0 else lfilter([1.0], [1.0, -colour], white, axis=0)


@pytest.mark.parametrize("colour", [0.0, 0.9, -0.8])
def test_lines_are_unbiased_and_their_variance_right(colour):
    rng = np.random.default_rng(6)
    n, speed, noise = 3000, 11000.0 * RPM, 1e-8
    amplitude = lines(rng, 23)[:, :1]
    clean = wave(amplitude, speed, n)
    error, variance, scatter = [], [], []
    for _ in range(150):
        found = line_spectrum(clean + drift(rng, n)[:, None] + noise * coloured(rng, n, colour), RATE, speed, 4300.0)
        error.append(found.amplitude - amplitude)
        variance.append(found.variance)
        scatter.append(found.scatter)
    error, variance, scatter = (np.array(v)[:, 1:, 0] for v in (error, variance, scatter))
    parts = np.stack([error.real, error.imag])
    z = parts / np.sqrt(variance)
    # the first orders stand beside the drift
    assert np.mean(z[:, :, 2:] ** 2) == pytest.approx(1.0, abs=0.15)
    assert np.mean(parts[:, :, 2:] ** 2 / np.mean(scatter[:, 2:], axis=0)) == pytest.approx(1.0, abs=0.15)
    per_order = np.mean(z**2, axis=(0, 1))
    assert per_order.max() < 1.6
    assert per_order.min() > 0.6
    assert np.abs(np.mean(parts, axis=1) / np.std(parts, axis=1) * np.sqrt(150)).max() < 4.5
    expected = noise**2 * 2.0 / n / np.abs(1.0 - colour * np.exp(-1j * np.arange(1, 24) * speed / RATE)) ** 2
    np.testing.assert_allclose(np.mean(variance, axis=0)[2:], expected[2:], rtol=0.25)


def test_without_noise_the_lines_are_exact():
    rng = np.random.default_rng(7)
    amplitude = lines(rng, 25)
    n, speed = 5003, 9876.5 * RPM
    u = np.linspace(-1.0, 1.0, n)[:, None]
    x = 3e-6 + 1e-6 * u - 2e-6 * u**2 + 1e-6 * u**3 + wave(amplitude, speed, n)
    found = line_spectrum(x, RATE, speed, 4150.0)
    np.testing.assert_allclose(found.amplitude[1:], amplitude[1:], atol=1e-16)
    assert np.abs(found.rest).max() < 1e-15
    assert found.amplitude.shape[0] == 26


def test_what_changes_within_the_record_shows_in_the_scatter():
    rng = np.random.default_rng(8)
    n, speed = 7168, 9000.0 * RPM
    amplitude = lines(rng, 20, only_teeth=True)
    x = wave(amplitude, speed, n) * np.repeat([1.0, 1.05, 0.96, 1.0], n // 4)[:, None] + 1e-9 * rng.normal(size=(n, 2))
    found = line_spectrum(x, RATE, speed, 3000.0)
    expected = np.var([1.0, 1.05, 0.96, 1.0], ddof=1) * np.abs(amplitude[4]) ** 2 / 4.0 / 2.0
    np.testing.assert_allclose(found.scatter[4], expected, rtol=0.1)
    assert np.all(found.scatter[4] > 10.0 * found.scatter[6])


def test_segments_have_the_phase_of_the_record():
    n, speed = 7168, 9000.0 * RPM
    amplitude = lines(np.random.default_rng(9), 12)
    found = segment_lines(wave(amplitude, speed, n), RATE, speed, np.arange(1, 13), segments=6)
    assert found.shape == (6, 12, 2)
    np.testing.assert_allclose(found[:, 3], np.broadcast_to(amplitude[4], (6, 2)), rtol=1e-2)


def knock(n, start, hertz=400.0, size=1e-7, damping=0.04):
    since = np.maximum(np.arange(n) - start, 0) / RATE
    return size * (np.exp(-damping * 2.0 * np.pi * hertz * since) * np.sin(2.0 * np.pi * hertz * since))[:, None] * np.array([1.0, -0.7])


def test_knocks_are_left_out():
    rng = np.random.default_rng(12)
    n, speed = 7168, 9000.0 * RPM
    amplitude, noise = lines(rng, 20), 2e-9
    clean = wave(amplitude, speed, n) + noise * rng.normal(size=(n, 2))
    quiet, knocked = (line_spectrum(x, RATE, speed, 3000.0) for x in (clean, clean + knock(n, 2000) + knock(n, 5000, 700.0)))
    error, before = (np.abs(found.amplitude[1:20] - amplitude[1:20]) for found in (knocked, quiet))
    # a tenth of the record is gone, and what the knocks would have added is not there
    assert np.sqrt(np.mean(error**2)) < 1.5 * np.sqrt(np.mean(before**2))
    assert np.sqrt(np.mean(error**2 / (2.0 * knocked.variance[1:20]))) == pytest.approx(1.0, abs=0.35)
    # and it is still in what the record holds beside its lines
    assert np.abs(knocked.off_orders).max() > 5e-8
    # a record that gets louder by and by is no knock
    growing = line_spectrum(clean * np.linspace(0.5, 1.5, n)[:, None], RATE, speed, 3000.0)
    assert np.median(growing.scatter[4]) > 10.0 * np.median(quiet.scatter[4])


@pytest.mark.parametrize("hertz", [(50.0, 100.0), (60.0,), (333.0, 1271.0)])
def test_lines_beside_the_orders_do_not_leak_into_them(hertz):
    rng = np.random.default_rng(13)
    n, speed = 7168, 9000.0 * RPM
    amplitude, noise = lines(rng, 20), 2e-9
    t = np.arange(n) / RATE
    clean = wave(amplitude, speed, n) + noise * rng.normal(size=(n, 2))
    hum = sum(2e-7 * np.cos(2.0 * np.pi * f * t[:, None] + rng.random(2)) for f in hertz)
    found = line_spectrum(clean + hum, RATE, speed, 3000.0)
    np.testing.assert_allclose(np.sort(found.beside) / (2.0 * np.pi), hertz, atol=0.2)
    np.testing.assert_allclose(found.beside_signal, hum, atol=1.5e-9)
    assert line_spectrum(clean, RATE, speed, 3000.0).beside_signal is None
    error = np.abs(found.amplitude[1:20] - amplitude[1:20])
    assert np.sqrt(np.mean(error**2)) < 1.5 * noise * np.sqrt(2.0 / n) * np.sqrt(2.0)
    # a tenth of what they would be without
    assert np.sqrt(np.mean(found.variance)) < 1.3 * noise * np.sqrt(2.0 / n)


def test_an_uneven_angle_is_followed_by_its_lines():
    rng = np.random.default_rng(14)
    n, speed, noise = 7168, 9000.0 * RPM, 2e-9
    amplitude = lines(rng, 20)
    u = np.linspace(-1.0, 1.0, n)
    deviation = 0.08 * np.cos(2.5 * np.pi * u) + 0.05 * u**2
    angle = speed * np.arange(n) / RATE + deviation
    x = np.real(np.exp(1j * np.outer(angle, np.arange(amplitude.shape[0]))) @ amplitude) + noise * rng.normal(size=(n, 2))
    told, untold = line_spectrum(x, RATE, speed, 3000.0, deviation), line_spectrum(x, RATE, speed, 3000.0)
    error = np.abs(told.amplitude[1:20] - amplitude[1:20]) / np.sqrt(2.0 * told.variance[1:20])
    assert np.sqrt(np.mean(error**2)) == pytest.approx(1.0, abs=0.3)
    assert told.rest.std() < 1.05 * noise
    assert untold.rest.std() > 20.0 * noise
    segments = segment_lines(x, RATE, speed, np.arange(1, 13), 6, deviation)
    np.testing.assert_allclose(segments.mean(axis=0), amplitude[1:13], atol=5e-10)
    assert follow_speed(x, RATE, speed, deviation=deviation) == pytest.approx(speed, rel=2e-8)


def test_what_rings_near_an_order_is_no_line_beside_it():
    # a transient at 1067 Hz, whose sides reach beyond what belongs to order 8 at 1064 Hz
    rng = np.random.default_rng(15)
    n, speed = 7168, 7980.0 * RPM
    amplitude = lines(rng, 20)
    x = wave(amplitude, speed, n) + knock(n, 0, 1067.0, 6e-8, 0.01) + 2e-9 * rng.normal(size=(n, 2))
    found = line_spectrum(x, RATE, speed, 3000.0)
    order = found.beside / speed
    assert np.all(np.abs(order - np.round(order)) * speed > 3.0 * 2.0 * np.pi * RATE / n)
    error = np.abs(found.amplitude[1:20] - amplitude[1:20]) / np.sqrt(2.0 * found.variance[1:20])
    assert np.sqrt(np.mean(error**2)) < 1.6
