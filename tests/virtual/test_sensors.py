import dataclasses

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rcsa_ident.base.errors import InputError
from rcsa_ident.virtual.milling import CutHistory
from rcsa_ident.virtual.sensors import (
    UNDISTURBED,
    SensorSuite,
    accelerometer_places,
    clamp,
    decimator,
    out_of_round,
    padding,
    record,
    sample,
)

RATE, FACTOR = 25600.0, 8
FINE = 1.0 / (RATE * FACTOR)
QUIET = SensorSuite(gap_noise=0.0, gap_drift=0.0, acceleration_noise=0.0, roundness=0.0)


def turned(suite, speed, start, count):
    return start + speed * np.arange(count) / suite.rate


def fine_time(count):
    return np.arange(-padding(FACTOR) * FACTOR, (count - 1 + padding(FACTOR)) * FACTOR + 1) * FINE


@settings(max_examples=25, deadline=None)
@given(st.floats(20.0, 9500.0), st.floats(0.0, 1e-4), st.one_of(st.none(), st.floats(2000.0, 50000.0)), st.floats(0.0, 6.0))
def test_sampling_is_the_sensor_and_nothing_else(frequency, delay, bandwidth, phase):
    count = 400
    omega = 2.0 * np.pi * frequency
    seen = sample(np.cos(omega * fine_time(count) + phase), FACTOR, FINE, delay, bandwidth)
    response = np.exp(-1j * omega * delay) / (1.0 if bandwidth is None else 1.0 + 1j * frequency / bandwidth)
    expected = (response * np.exp(1j * (omega * np.arange(count) / RATE + phase))).real
    assert seen.size == count
    # the low-pass of first order starts from rest at the first fine sample, and settles in a few of its time constants
    settled = 60 if bandwidth is not None else 0
    # the decimator's ripple at 90 dB, and the taps that a delay moves beyond its end
    taps = decimator(FACTOR)
    response_error = 4e-5 + np.abs(taps[taps.size - int(np.ceil(delay / FINE)) :]).sum()
    # linear interpolation between fine samples: (omega step)^2 / 12
    assert np.abs(seen - expected)[settled:].max() < response_error + (omega * FINE) ** 2 / 10.0 * (bandwidth is not None)


def test_what_would_fold_into_the_band_is_removed():
    count = 300
    for frequency in np.linspace(0.6, 3.9, 40) * RATE:
        assert np.abs(sample(np.cos(2.0 * np.pi * frequency * fine_time(count)), FACTOR, FINE, 0.0, None)).max() < 1e-4
    assert decimator(FACTOR).sum() == pytest.approx(1.0, abs=1e-6)


def test_sensors_a_quarter_apart_see_the_same_surface():
    # the cutter turns from +Y to +X: what Y sees, X sees a quarter of a turn later
    rng = np.random.default_rng(3)
    clamping = clamp(QUIET_ROUND, np.zeros(1), rng)
    angle = np.linspace(0.0, 2.0 * np.pi, 721)[:-1]
    seen = out_of_round(QUIET_ROUND, clamping, angle, 900.0, FACTOR)
    assert np.allclose(np.roll(seen[:, 1], 180), seen[:, 0], atol=1e-15)
    assert 1e-6 < np.abs(seen).max() <= 4e-6 * (1.0 + 1e-3)
    lines = np.abs(np.fft.rfft(seen[:, 0]))
    assert np.all(lines[1:9] > 1e-3 * lines.max())
    assert lines[9:].max() < 1e-9 * lines.max()


QUIET_ROUND = dataclasses.replace(QUIET, roundness=4e-6)


def test_roundness_goes_through_the_sensor():
    slow = dataclasses.replace(QUIET_ROUND, gap_delay=1e-4, gap_bandwidth=3000.0)
    clamping = clamp(slow, np.zeros(1), np.random.default_rng(5))
    speed = 1500.0
    angle = speed * np.arange(200) / RATE
    plain = out_of_round(QUIET_ROUND, clamping, angle + speed * np.arange(1)[0], speed, FACTOR)
    lagged = out_of_round(slow, clamping, angle, speed, FACTOR)
    order = np.arange(1, 9)
    basis = np.exp(1j * np.outer(angle, order))
    columns = np.hstack([basis.real, -basis.imag])
    a, b = (np.linalg.lstsq(columns, s[:, 0], rcond=None)[0] for s in (plain, lagged))
    ratio = (b[:8] + 1j * b[8:]) / (a[:8] + 1j * a[8:])
    assert ratio == pytest.approx(np.exp(-1j * order * speed * 1e-4) / (1.0 + 1j * order * speed / (2.0 * np.pi * 3000.0)), abs=1e-3)


def quiet_history(count):
    time = fine_time(count)
    move = 1e-6 * np.stack([np.cos(4000.0 * time), np.sin(4000.0 * time)], axis=-1)
    zero = np.zeros_like(move)
    return CutHistory(FINE, time, zero, zero, 3.0 * move, move, -(4000.0**2) * move)


def test_gap_is_relative_to_the_fixture_and_signals_have_their_sensitivity():
    suite = dataclasses.replace(QUIET, gap_sensitivity=1e4, acceleration_sensitivity=-1e-3)
    clamping = clamp(suite, np.zeros(1), np.random.default_rng(0))
    channels = record(suite, clamping, turned(suite, 900.0, 0.2, 256), 0.0, FACTOR, quiet_history(256), np.random.default_rng(1))
    time = np.arange(256) / RATE
    assert set(channels) == {"flange_x", "flange_y", "fixture_x", "fixture_y"}
    assert channels["flange_y"] == pytest.approx(1e4 * 2e-6 * np.sin(4000.0 * time), abs=1e4 * 2e-10)
    assert channels["fixture_x"] == pytest.approx(1e-3 * 16.0 * np.cos(4000.0 * time), abs=1e-3 * 2e-3)


def test_pairs_on_the_housing_have_channels_of_their_own():
    suite = dataclasses.replace(QUIET, acceleration_noise=0.05, acceleration_sensitivity=2.0)
    clamping = clamp(suite, np.zeros(1), np.random.default_rng(0))
    plain = quiet_history(256)
    felt = np.hstack([plain.acceleration, -3.0 * plain.acceleration, 0.0 * plain.acceleration])
    angle = turned(suite, 900.0, 0.2, 256)

    def channels(history, housing):
        return record(suite, clamping, angle, 0.0, FACTOR, history, np.random.default_rng(1), UNDISTURBED, accelerometer_places(housing))

    few, many = channels(plain, 0), channels(dataclasses.replace(plain, acceleration=felt), 2)
    assert set(many) - set(few) == {"housing_x", "housing_y", "housing2_x", "housing2_y"}
    for name, values in few.items():
        # what is drawn for them does not change the others
        np.testing.assert_array_equal(many[name], values)
    assert np.std(many["housing_x"] + 3.0 * few["fixture_x"]) == pytest.approx(2.0 * 0.05 * np.sqrt(10.0), rel=0.15)
    assert np.std(many["housing2_y"]) == pytest.approx(2.0 * 0.05, rel=0.15)


def test_noise_has_its_size_and_air_cuts_nothing_else():
    suite = dataclasses.replace(QUIET, gap_noise=2e-9, acceleration_noise=0.05)
    clamping = clamp(suite, np.zeros(1), np.random.default_rng(0))
    channels = record(suite, clamping, turned(suite, 900.0, 0.0, 8000), 0.0, FACTOR, None, np.random.default_rng(1))
    assert np.std(channels["flange_x"]) == pytest.approx(2e-9, rel=0.05)
    assert np.std(channels["fixture_y"]) == pytest.approx(0.05, rel=0.05)
    assert abs(np.corrcoef(channels["flange_x"], channels["flange_y"])[0, 1]) < 0.05


def test_trigger_rises_where_tooth_one_stands_at_its_angle():
    suite = dataclasses.replace(QUIET, trigger=True, tooth_angle=0.6)
    clamping = clamp(suite, np.zeros(1), np.random.default_rng(0))
    speed, start = 1234.0, 2.0
    channels = record(suite, clamping, turned(suite, speed, start, 4000), 0.0, FACTOR, None, np.random.default_rng(1))
    edges = np.flatnonzero(np.diff(channels["trigger"]) > 0.5)
    late = (start + speed * (edges + 1) / RATE - 0.6) % (2.0 * np.pi)
    assert edges.size == int(4000 / RATE * speed / (2.0 * np.pi))
    assert np.all(late < speed / RATE)


def test_eccentric_cutter_has_run_out_without_mean():
    teeth = 2.0 * np.pi * np.arange(4) / 4
    clamping = clamp(SensorSuite(), teeth, np.random.default_rng(2))
    assert clamping.runout.sum() == pytest.approx(0.0, abs=1e-18)
    assert np.hypot(clamping.runout[0], clamping.runout[1]) == pytest.approx(2e-6)
    assert np.abs(clamping.roundness).sum() == pytest.approx(4e-6)


def test_history_of_another_length_is_refused():
    clamping = clamp(QUIET, np.zeros(1), np.random.default_rng(0))
    with pytest.raises(InputError, match="instants"):
        record(QUIET, clamping, turned(QUIET, 900.0, 0.0, 100), 0.0, FACTOR, quiet_history(256), np.random.default_rng(1))


@pytest.mark.parametrize(("name", "value"), [("rate", 0.0), ("speed_error", 0.2), ("gap_sensitivity", 0.0), ("roundness_orders", 100)])
def test_impossible_sensors_are_refused(name, value):
    with pytest.raises(InputError, match=r"sensors\."):
        SensorSuite(**{name: value})
