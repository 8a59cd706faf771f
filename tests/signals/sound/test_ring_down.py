"""Ring-downs against closed forms: exponentials that the test writes itself, and a log decrement by another route."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.signal

from rcsa_ident.base.errors import InputError
from rcsa_ident.base.units import to_hz
from rcsa_ident.signals.sound.ring_down import ring_down

RATE = 48_000.0


def hits(modes, seed=1, count=4, noise=1e-3, echo=0.0, gain=None):
    """Hits of modes (frequency [Hz], damping ratio, amplitude), a click in front of each; frequencies are undamped ones."""
    rng = np.random.default_rng(seed)
    gap = int(0.5 * RATE)
    signal = np.zeros(int(0.3 * RATE) + count * gap)
    time = np.arange(gap) / RATE
    for k in range(count):
        ring = np.zeros(gap)
        for frequency, damping, amplitude in modes:
            omega = 2.0 * np.pi * frequency
            phase = rng.uniform(0.0, 1.0)
            ring += (
                amplitude
                * rng.uniform(0.6, 1.0)
                * np.exp(-damping * omega * time)
                * np.cos(omega * np.sqrt(1.0 - damping**2) * time + phase)
            )
        ring[:12] += 1.5 * rng.standard_normal(12)
        late = int(3e-3 * RATE)
        ring[late:] += echo * ring[:-late]
        signal[int(0.3 * RATE) + k * gap :][:gap] += ring
    signal = signal + noise * rng.standard_normal(signal.size)
    return signal if gain is None else signal * gain(signal)


def log_decrement(signal, frequency):
    """Damping ratio by the slope of a band's envelope: another route, for a mode that stands alone."""
    narrow = scipy.signal.butter(3, [0.8 * frequency, 1.2 * frequency], "bandpass", fs=RATE, output="sos")
    envelope = np.abs(scipy.signal.hilbert(scipy.signal.sosfiltfilt(narrow, signal)))
    peak = int(np.argmax(envelope[: int(0.5 * RATE)]))
    part = envelope[peak + int(2e-3 * RATE) : peak + int(8e-3 * RATE)]
    slope = np.polyfit(np.arange(part.size) / RATE, np.log(part), 1)[0]
    return -slope / (2.0 * np.pi * frequency)


def test_of_many_hits_the_loudest_are_enough():
    """A minute of taps costs no more than a dozen."""
    found = ring_down([(RATE, hits([(1855.0, 0.039, 1.0)], count=15))])
    assert found.hits == 12
    assert to_hz(found.modes[0].omega) == pytest.approx(1855.0, rel=1e-3)


@pytest.mark.parametrize(
    ("modes", "frequency_error", "damping_error"),
    [
        ([(1855.0, 0.039, 1.0)], 1e-3, 0.03),
        ([(2589.0, 0.0141, 1.0), (7887.0, 0.0049, 0.4)], 5e-4, 0.03),
        ([(5758.0, 0.0015, 1.0), (14009.0, 0.0015, 0.6)], 1e-4, 0.03),
        ([(5758.0, 0.0015, 1.0), (5790.0, 0.0015, 0.7)], 1e-4, 0.05),
    ],
)
def test_frequencies_and_damping_are_those_that_were_written(modes, frequency_error, damping_error):
    heard = ring_down([(RATE, hits(modes))])
    assert (heard.hits, heard.damping_doubt, len(heard.modes)) == (4, "", len(modes))
    for found, (frequency, damping, _) in zip(heard.modes, modes, strict=True):
        assert to_hz(found.omega) == pytest.approx(frequency, rel=frequency_error)
        assert found.damping == pytest.approx(damping, rel=damping_error)
        assert abs(to_hz(found.omega) - frequency) < 5.0 * to_hz(found.omega_std) + 1e-5 * frequency
        assert abs(found.damping - damping) < 4.0 * found.damping_std


def test_another_route_agrees():
    signal = hits([(2400.0, 0.012, 1.0)])
    (found,) = ring_down([(RATE, signal)]).modes
    assert found.damping == pytest.approx(log_decrement(signal, 2400.0), rel=0.05)


def test_a_reflection_of_a_short_ring_is_left_out():
    """Three milliseconds behind, as loud as a fifth of the direct sound: the ring has fallen to a quarter by then."""
    (found, *_) = sorted(ring_down([(RATE, hits([(1855.0, 0.039, 1.0)], echo=0.2))]).modes, key=lambda mode: -mode.level)
    assert to_hz(found.omega) == pytest.approx(1855.0, rel=3e-3)
    assert found.damping == pytest.approx(0.039, rel=0.08)


def test_a_tone_that_goes_on_is_no_mode():
    signal = hits([(2589.0, 0.0141, 1.0)])
    signal += 0.02 * np.sin(2.0 * np.pi * 3150.0 * np.arange(signal.size) / RATE)
    heard = ring_down([(RATE, signal)])
    assert [round(to_hz(mode.omega) / 10.0) for mode in heard.modes] == [259]
    # as fine as the quiet in front of a hit is long
    assert [to_hz(tone) for tone in heard.steady] == [pytest.approx(3150.0, abs=25.0)]


def test_several_recordings_are_one_answer():
    parts = [(RATE, hits([(2589.0, 0.0141, 1.0)], seed=seed, count=1)) for seed in (1, 2, 3)]
    heard = ring_down(parts)
    (found,) = heard.modes
    assert (heard.hits, found.hits) == (3, 3)
    assert to_hz(found.omega) == pytest.approx(2589.0, rel=5e-4)


def test_gain_that_falls_is_noticed():
    def gain(signal):
        """Down at each hit, slowly up again."""
        found, level = np.empty(signal.size), 0.0
        for i, value in enumerate(np.abs(signal)):
            level = value + (0.99 if value > level else 0.99995) * (level - value)
            found[i] = 1.0 / (1.0 + 4.0 * level)
        return found

    assert "gain" in ring_down([(RATE, hits([(2589.0, 0.0141, 1.0)], noise=2e-3, gain=gain))]).damping_doubt
    assert ring_down([(RATE, hits([(2589.0, 0.0141, 1.0)], noise=2e-3))]).damping_doubt == ""


def test_lossy_compression_tells_no_damping():
    assert "lossy" in ring_down([(RATE, hits([(2589.0, 0.0141, 1.0)]))], lossy=True).damping_doubt


def speech():
    """Two seconds of voiced syllables: pulses of 120 Hz through formants, swelling and fading."""
    rng = np.random.default_rng(3)
    time = np.arange(int(2.0 * RATE)) / RATE
    pulses = np.zeros(time.size)
    pulses[:: int(RATE / 120.0)] = 1.0
    voice = np.zeros(time.size)
    for formant, width in ((600.0, 80.0), (1200.0, 90.0), (2500.0, 120.0)):
        b, a = scipy.signal.iirpeak(formant, formant / width, fs=RATE)
        voice += scipy.signal.lfilter(b, a, pulses)
    swell = np.clip(np.sin(2.0 * np.pi * 2.5 * time), 0.0, None) ** 2
    return swell * voice / np.max(np.abs(voice)) + 1e-4 * rng.standard_normal(time.size)


@pytest.mark.parametrize(
    ("signal", "words"),
    [
        (np.zeros(48000), "silence"),
        (1e-3 * np.random.default_rng(1).standard_normal(96000), "no hit"),
        (speech(), "no hit|nothing rings"),
        (np.zeros(100), "at least 0.05 s"),
    ],
    ids=["silence", "noise", "speech", "short"],
)
def test_what_is_no_ring_is_refused(signal, words):
    with pytest.raises(InputError, match=words):
        ring_down([(RATE, signal)])


def test_a_click_without_a_ring_is_refused():
    signal = 1e-4 * np.random.default_rng(1).standard_normal(96000)
    signal[30000:30020] += np.random.default_rng(2).standard_normal(20)
    with pytest.raises(InputError, match=r"no hit|nothing rings"):
        ring_down([(RATE, signal)])


def test_a_rate_too_low_is_refused():
    with pytest.raises(InputError, match="sampling_rate_hz: found 1000, allowed is at least 2000"):
        ring_down([(1000.0, np.ones(4000))])
