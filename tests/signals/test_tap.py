"""Hits of a hammer on structures whose receptance is known in closed form; a real one in `test_real_recordings`."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import fftconvolve

from rcsa_ident.base.errors import InputError
from rcsa_ident.signals.tap import HitEstimator, tap

RATE = 51200.0
#: Natural frequency [rad/s], damping ratio, mass [kg].
MODES = ((2.0 * np.pi * 800.0, 0.02, 1.5), (2.0 * np.pi * 1900.0, 0.015, 0.8))


def receptance(omega):
    return sum(1.0 / (m * (w**2 - omega**2 + 2j * z * w * omega)) for w, z, m in MODES)


def pulse(time, at, force=200.0, length=3e-4):
    return np.where((time > at) & (time < at + length), force * np.sin(np.pi * (time - at) / length), 0.0)


def moved(force, derivative=2):
    """Response to a force, through the receptance over frequency: the record is long enough that nothing comes round."""
    n = 4 * force.size
    omega = 2.0 * np.pi * np.fft.rfftfreq(n, 1.0 / RATE)
    return np.fft.irfft(np.fft.rfft(force, n) * receptance(omega) * (1j * omega) ** derivative, n)[: force.size]


def hits(count=1, seconds=0.5, noise=0.0, derivative=2, seed=1):
    """Force and response of hits that follow each other."""
    rng = np.random.default_rng(seed)
    time = np.arange(int(count * seconds * RATE)) / RATE
    force = sum(pulse(time, 0.01 + k * seconds, 150.0 + 20.0 * k) for k in range(count))
    response = moved(force, derivative)
    return force, response + noise * np.std(response) * rng.standard_normal(time.size)


def error(found, low=300.0, high=3000.0):
    inside = (found.omega > 2.0 * np.pi * low) & (found.omega < 2.0 * np.pi * high)
    true = receptance(found.omega[inside])
    return np.linalg.norm(found.receptance[inside] - true) / np.linalg.norm(true)


@pytest.mark.parametrize("derivative", [0, 1, 2])
def test_one_hit_gives_the_receptance(derivative):
    found = tap(RATE, [hits(derivative=derivative)], derivative)
    assert found.used == 1
    assert found.coherence is None
    assert error(found) < 2e-3


@pytest.mark.parametrize("estimator", HitEstimator)
def test_several_hits_average(estimator):
    found = tap(RATE, [hits(count=8, noise=0.02)], estimator=estimator)
    assert found.used == 8
    assert found.coherence is not None
    single = tap(RATE, [hits(noise=0.02)])
    assert error(found) < 0.6 * error(single)
    # the error is what the variance says
    inside = (found.omega > 2.0 * np.pi * 600.0) & (found.omega < 2.0 * np.pi * 2200.0)
    deviation = np.abs(found.receptance - receptance(found.omega))[inside] ** 2 / (2.0 * found.variance[inside])
    assert 0.3 < np.mean(deviation) < 3.0


def test_bounces_overloads_and_strangers_are_left_out():
    force, response = hits(count=7)
    time = np.arange(force.size) / RATE
    bounced = force + pulse(time, 1.02, 60.0)
    response = moved(bounced)
    second = (time > 2.0) & (time < 2.5)
    response[second] = np.clip(response[second], -0.4 * np.abs(response[second]).max(), 0.4 * np.abs(response[second]).max())
    other = (time > 3.0) & (time < 3.5)
    response[other] = np.roll(response[other], 40)
    found = tap(RATE, [(bounced, response)])
    reasons = [hit.reason for hit in found.hits]
    assert "double hit" in reasons[2]
    assert "overloaded" in reasons[4]
    assert "differs" in reasons[6]
    assert [reasons[k] for k in (0, 1, 3, 5)] == [""] * 4
    assert error(found) < 5e-3


def test_responses_that_do_not_end_are_windowed_and_it_is_said():
    force, response = hits(seconds=0.03)
    found = tap(RATE, [(force, response)])
    assert found.window_decay > 10.0
    # every pole is moved by the window's decay, by which it is known
    shifted = 1j * found.omega + found.window_decay
    inside = (found.omega > 2.0 * np.pi * 300.0) & (found.omega < 2.0 * np.pi * 2500.0)
    true = sum(1.0 / (m * (shifted**2 + 2.0 * z * w * shifted + w**2)) for w, z, m in MODES)[inside]
    assert np.linalg.norm(found.receptance[inside] - true) < 0.05 * np.linalg.norm(true)


def test_the_mass_of_the_sensor_is_taken_away():
    omega = 2.0 * np.pi * np.fft.rfftfreq(4 * int(0.5 * RATE), 1.0 / RATE)
    loaded = receptance(omega) / (1.0 - omega**2 * 0.05 * receptance(omega))
    time = np.arange(int(0.5 * RATE)) / RATE
    force = pulse(time, 0.01)
    response = np.fft.irfft(np.fft.rfft(force, 4 * force.size) * loaded * -(omega**2), 4 * force.size)[: force.size]
    assert error(tap(RATE, [(force, response)])) > 0.3
    assert error(tap(RATE, [(force, response)], sensor_mass=0.05)) < 5e-3


@pytest.mark.parametrize(
    ("records", "words"),
    [
        ([(np.zeros(1000), np.ones(1000))], "a channel in which a hammer hits"),
        ([(np.ones(1000), np.ones(900))], "one length"),
        ([(np.full(1000, np.nan), np.ones(1000))], "lost samples"),
    ],
)
def test_what_is_no_hit_is_said(records, words):
    with pytest.raises(InputError, match=words):
        tap(RATE, records)


def test_convolution_is_what_the_response_is():
    """The closed form of the tests themselves: a response in the time domain by the modes' impulse responses."""
    force, response = hits(derivative=0)
    time = np.arange(force.size) / RATE
    impulse = sum(np.exp(-z * w * time) * np.sin(w * np.sqrt(1 - z**2) * time) / (m * w * np.sqrt(1 - z**2)) for w, z, m in MODES)
    np.testing.assert_allclose(fftconvolve(force, impulse)[: force.size] / RATE, response, atol=2e-3 * np.abs(response).max())


def test_a_rate_at_which_no_hit_has_a_shape_is_refused():
    with pytest.raises(InputError, match="sampling_rate_hz: found 1 Hz, allowed is at least 200 Hz"):
        tap(1.0, [(np.array([0.02, -1e300]), np.array([0.0, -2.0]))])
