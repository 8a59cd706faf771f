"""Records whose speed, teeth and chatter are known by construction, without a model of a machine; real ones in `test_real_recordings`."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks.listening_records import speeds_to_tell
from rcsa_ident.base.errors import InputError
from rcsa_ident.base.units import from_rpm, to_rpm
from rcsa_ident.signals.listening import Heard, listen
from rcsa_ident.signals.recording import Quantity

#: Amplitudes of the orders of a cut with four teeth and some run-out.
CUT = {1: 0.2, 2: 0.05, 3: 0.08, 4: 1.0, 5: 0.1, 7: 0.04, 8: 0.5, 12: 0.3, 16: 0.1, 20: 0.05}


def wandering(rng, n, rate, share, seconds=0.3):
    """Relative deviations of a speed with a correlation time."""
    if not share:
        return np.zeros(n)
    kernel = np.hanning(int(seconds * rate))
    return share * np.convolve(rng.standard_normal(n), kernel / np.linalg.norm(kernel), "same")


def speeds(rate, seconds, rpm, wander=0.0, last=None, seed=1):
    """Spindle frequency at each sample [Hz]."""
    n = int(rate * seconds)
    return np.linspace(rpm, rpm if last is None else last, n) / 60.0 * (1.0 + wandering(np.random.default_rng(seed), n, rate, wander))


def record(rate, seconds, rpm, orders=CUT, noise=0.3, wander=0.0, last=None, channels=1):
    """Samples, shape (n, c), and the mean speed in rev/min; orders above half the rate fold."""
    rng, speed = np.random.default_rng(2), speeds(rate, seconds, rpm, wander, last)
    n = speed.size
    angle = 2.0 * np.pi * np.concatenate([[0.0], np.cumsum(speed[:-1])]) / rate
    phases = rng.uniform(0.0, 2.0 * np.pi, (channels, 100))
    signal = np.array([[a * np.cos(m * angle + phases[c, m]) for m, a in orders.items()] for c in range(channels)]).sum(axis=1)
    return signal.T + noise * rng.standard_normal((n, channels)), 60.0 * float(speed.mean())


@pytest.mark.parametrize("rpm", [612.4, 2999.0, 7218.6, 24000.0])
def test_a_constant_speed_is_found_without_being_told(rpm):
    samples, true = record(8192.0, 6.0, rpm)
    answer = listen(samples, 8192.0)
    assert answer.verdict is Heard.STABLE
    assert to_rpm(answer.spindle_speed) == pytest.approx(true, rel=2e-5)
    assert answer.teeth == 4
    assert answer.ramp is None
    assert answer.wander < 1e-4


def test_tooth_passages_are_not_taken_for_the_spindle():
    samples, true = record(22050.0, 4.0, 6000.0, {1: 0.1, 4: 0.5, 8: 0.3, 12: 0.1}, noise=0.05)
    answer = listen(samples, 22050.0)
    assert to_rpm(answer.spindle_speed) == pytest.approx(true, rel=2e-5)
    assert answer.teeth == 4


def test_wander_is_followed_and_explained():
    steady, _ = record(8192.0, 6.0, 6000.0)
    samples, true = record(8192.0, 6.0, 6000.0, wander=0.0015)
    answer = listen(samples, 8192.0)
    assert to_rpm(answer.spindle_speed) == pytest.approx(true, rel=2e-4)
    quarters = speeds(8192.0, 6.0, 6000.0, 0.0015).reshape(24, -1).mean(axis=1)
    assert answer.wander == pytest.approx(quarters.std() / quarters.mean(), rel=0.1)
    assert answer.explained_share > listen(steady, 8192.0).explained_share - 0.01


def test_noise_alone_has_no_speed():
    for seed in range(5):
        white = np.random.default_rng(seed).standard_normal((40000, 2))
        for samples in (white, np.cumsum(white, axis=0)):
            answer = listen(samples, 8000.0)
            assert answer.verdict is Heard.NO_CUT
            assert answer.spindle_speed is None


@pytest.mark.parametrize(("first", "last"), [(8000.0, 8400.0), (8000.0, 9000.0), (9000.0, 8200.0)])
def test_a_ramp_is_told_as_one(first, last):
    samples, _ = record(12800.0, 4.0, first, last=last)
    answer = listen(samples, 12800.0)
    assert answer.ramp is not None
    np.testing.assert_allclose(to_rpm(np.array(answer.ramp)), [first, last], rtol=5e-3)
    assert answer.explained_share > 0.75


def chattering(rate, rpm, frequency, teeth=4, seconds=6.0):
    """A cut with chatter at a frequency and its sidebands at the tooth-passing frequency."""
    samples, _ = record(rate, seconds, rpm, noise=0.2)
    time, passing = np.arange(samples.shape[0]) / rate, teeth * rpm / 60.0
    sides = {0: 3.0, -1: 0.8, 1: 0.9, -2: 0.3, 2: 0.4}
    return samples + sum(a * np.cos(2.0 * np.pi * (frequency + k * passing) * time + k) for k, a in sides.items())[:, None]


def test_chatter_is_named_by_the_structures_frequency_and_speeds_fit_it():
    samples = chattering(16000.0, 5000.0, 903.0)
    answer = listen(samples, 16000.0, Quantity.SOUND, between=(from_rpm(3000.0), from_rpm(16000.0)))
    assert answer.verdict is Heard.CHATTER
    assert answer.chatter[0] == pytest.approx(903.0, abs=0.5)
    assert answer.aliases == answer.chatter
    assert answer.teeth == 4
    expected = [60.0 * answer.chatter[0] / (4 * waves) for waves in (1, 2, 3, 4)]
    np.testing.assert_allclose(to_rpm(np.array(answer.suggested_speeds)), expected)


def test_of_accelerations_the_largest_motion_is_the_structures():
    # the sideband above is stronger as an acceleration, by less than its frequency squared
    samples, _ = record(16000.0, 6.0, 5000.0, noise=0.2)
    time = np.arange(samples.shape[0]) / 16000.0
    for frequency, size in ((530.0, 2.0), (530.0 + 4.0 * 5000.0 / 60.0, 2.6)):
        samples = samples + size * np.cos(2.0 * np.pi * frequency * time)[:, None]
    assert listen(samples, 16000.0, Quantity.ACCELERATION).chatter[0] == pytest.approx(530.0, abs=0.5)
    assert listen(samples, 16000.0, Quantity.SOUND).chatter[0] == pytest.approx(863.3, abs=0.5)


def test_no_speed_is_suggested_while_the_alias_is_open():
    rate, true = 1650.0, 1931.0
    answer = listen(chattering(rate, 5117.0, true), rate, teeth=4, spindle_speed=from_rpm(5100.0))
    assert answer.verdict is Heard.CHATTER
    assert any(alias == pytest.approx(true, abs=1.0) for alias in answer.aliases)
    assert len(answer.aliases) > 2
    assert answer.suggested_speeds == ()


def test_orders_that_fold_are_found_and_explained():
    orders = CUT | dict.fromkeys((24, 28), 0.4)
    samples, true = record(1651.0, 10.0, 6893.0, orders, noise=0.1)
    answer = listen(samples, 1651.0)
    assert answer.folded
    assert to_rpm(answer.spindle_speed) == pytest.approx(true, rel=2e-5)
    assert answer.explained_share > 0.97
    filtered = {order: size for order, size in orders.items() if order * 6893.0 / 60.0 < 800.0}
    assert not listen(record(1651.0, 10.0, 6893.0, filtered, noise=0.1)[0], 1651.0).folded


def test_a_spindle_that_idles_is_told_by_its_lines_not_by_its_loudness():
    # twenty times as loud as a cut, hardly a line of its orders, and lines of bearings
    rng = np.random.default_rng(3)
    samples, true = record(8000.0, 6.0, 6000.0, dict.fromkeys(range(1, 25), 0.25), noise=3.0)
    time = np.arange(samples.shape[0]) / 8000.0
    for _ in range(6):
        samples = samples + 0.3 * np.cos(2.0 * np.pi * rng.uniform(500.0, 3500.0) * time)[:, None]
    answer = listen(20.0 * samples, 8000.0)
    assert answer.verdict is Heard.IDLE
    assert to_rpm(answer.spindle_speed) == pytest.approx(true, rel=1e-4)


def test_entry_and_exit_are_left_out():
    samples, _ = record(8000.0, 6.0, 6000.0, noise=0.1)
    samples[:8000] *= 0.02
    samples[40000:] *= 0.02
    answer = listen(samples, 8000.0)
    assert [event.kind for event in answer.events] == ["entry", "exit"]
    assert answer.part == (pytest.approx(1.0, abs=0.2), pytest.approx(5.0, abs=0.2))


def test_a_told_speed_and_told_teeth_are_taken():
    samples, true = record(8192.0, 6.0, 7218.0)
    answer = listen(samples, 8192.0, teeth=3, spindle_speed=from_rpm(7150.0))
    assert to_rpm(answer.spindle_speed) == pytest.approx(true, rel=2e-5)
    assert answer.teeth == 3


def test_a_high_rate_is_looked_at_below_five_kilohertz():
    samples, true = record(51200.0, 3.0, 9000.0, channels=3)
    answer = listen(samples, 51200.0)
    assert answer.band == 5000.0
    assert to_rpm(answer.spindle_speed) == pytest.approx(true, rel=2e-5)


def test_whatever_is_recorded_is_answered():
    """Short, slow, silent, spiky or clipped: an answer, or a sentence, and never anything else."""
    rng, seen = np.random.default_rng(7), set()
    for case in range(60):
        rate = float(np.exp(rng.uniform(np.log(50.0), np.log(60e3))))
        n, channels = int(rng.integers(64, 6000)), int(rng.integers(1, 4))
        time = np.arange(n)[:, None] / rate
        samples = [
            rng.standard_normal((n, channels)),
            np.cos(2.0 * np.pi * rng.uniform(1.0, 0.6 * rate) * time) + np.zeros((n, channels)),
            np.clip(3.0 * np.cos(2.0 * np.pi * rng.uniform(5.0, 100.0) * time), -1.0, 1.0) + np.zeros((n, channels)),
            np.where(rng.uniform(size=(n, channels)) < 1e-3, 1e6, 1e-6 * rng.standard_normal((n, channels))),
            1e-12 * np.cumsum(rng.standard_normal((n, channels)), axis=0) + 1e3,
        ][case % 5]
        told = {"spindle_speed": from_rpm(rng.uniform(10.0, 90e3))} if rng.uniform() < 0.3 else {}
        try:
            seen.add(listen(samples, rate, rng.choice(list(Quantity)), **told).verdict)
        except InputError as error:
            seen.add(error.field)
    assert {Heard.NO_CUT, Heard.UNSTEADY, "recording"} <= seen


@pytest.mark.parametrize(
    ("samples", "rate", "options", "field"),
    [
        (np.zeros((5000, 1)), 1000.0, {}, "recording"),
        (np.ones((10, 1)), 1000.0, {}, "recording"),
        (np.random.default_rng(1).standard_normal((5000, 1)), 0.0, {}, "sampling_rate_hz"),
        (np.random.default_rng(1).standard_normal((5000, 1)), 1000.0, {"teeth": 0}, "teeth"),
        (np.random.default_rng(1).standard_normal((5000, 1)), 1000.0, {"between": (300.0, 200.0)}, "speeds"),
        (np.random.default_rng(1).standard_normal((5000, 1)), 1000.0, {"spindle_speed": -1.0}, "spindle_speed"),
    ],
)
def test_what_cannot_be_listened_to_is_named(samples, rate, options, field):
    with pytest.raises(InputError) as found:
        listen(samples, rate, **options)
    assert found.value.field == field


def test_chatter_in_broad_noise_is_judged_by_what_lies_around_it():
    """A line stronger than the tooth's, with a sideband, in a record that is mostly noise: few hundredths of everything."""
    orders = {1: 0.1, 2: 0.15, 4: 0.5, 8: 0.2}
    samples, _ = record(8192.0, 6.0, 6900.0, orders, noise=1.6)
    time = np.arange(samples.shape[0]) / 8192.0
    sides = ((307.0, 0.6), (307.0 + 460.0, 0.25))
    samples = samples + sum(a * np.cos(2.0 * np.pi * f * time) for f, a in sides)[:, None]
    answer = listen(samples, 8192.0, teeth=4, spindle_speed=from_rpm(6900.0))
    assert answer.verdict is Heard.CHATTER
    assert answer.chatter[0] == pytest.approx(307.0, abs=0.5)
    assert answer.chatter_probability > 0.8


@pytest.mark.parametrize("mains", [50.0, 60.0])
def test_hum_is_no_chatter(mains):
    samples, _ = record(8192.0, 6.0, 6870.0)
    time = np.arange(samples.shape[0]) / 8192.0
    samples = samples + 0.8 * sum(np.cos(2.0 * np.pi * k * mains * time) / k for k in (1, 2, 3, 5))[:, None]
    answer = listen(samples, 8192.0, Quantity.SOUND, teeth=4, spindle_speed=from_rpm(6870.0))
    assert answer.verdict is Heard.STABLE
    assert f"multiples of the mains, {mains:.0f} Hz, are heard" in answer.reasons[1]


def test_chatter_in_one_channel_of_several_is_found():
    samples, _ = record(8192.0, 6.0, 6870.0, channels=3)
    time = np.arange(samples.shape[0]) / 8192.0
    samples *= [10.0, 10.0, 0.3]
    samples[:, 2] += 0.8 * np.cos(2.0 * np.pi * 933.0 * time) + 0.3 * np.cos(2.0 * np.pi * (933.0 - 458.0) * time)
    assert listen(samples, 8192.0, teeth=4).verdict is Heard.CHATTER


@pytest.mark.parametrize("case", range(0, 24, 3))
def test_the_told_number_of_teeth_finds_the_speed(case):
    made = speeds_to_tell(case + 1)[case]
    answer = listen(made.samples, made.rate, made.quantity, made.teeth)
    assert answer.spindle_speed / (2.0 * np.pi) == pytest.approx(made.spindle, rel=1e-4)
    assert answer.speed_probabilities[0] > 0.5
    assert len(answer.speed_probabilities) == 1 + len(answer.other_speeds)


def test_speeds_that_cannot_be_told_apart_are_said_with_their_probabilities():
    """No line of the run-out: lines at multiples of 300 Hz are those of three teeth at 6000 rev/min, likely, or of a faster spindle."""
    samples, _ = record(12800.0, 3.0, 18000.0, {1: 1.0, 2: 0.9, 3: 1.2, 4: 0.5}, noise=1.5)
    answer = listen(samples, 12800.0, Quantity.SOUND, teeth=3)
    assert 0.0 < sum(answer.speed_probabilities) <= 1.0 + 1e-9
    assert {round(to_rpm(each), -2) for each in (answer.spindle_speed, *answer.other_speeds)} >= {6000.0, 18000.0}
