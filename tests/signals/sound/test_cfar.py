"""Lines that stand out of noise: the stated probability of a false alarm is the measured one, whatever the noise's level and colour."""

from __future__ import annotations

import numpy as np
import pytest

from rcsa_ident.signals.sound.cfar import averages, false_alarm, scale_of, stands_out
from rcsa_ident.signals.steady_part import hann

LENGTH = 4096


def mean_power(windows, coloured, seed):
    """Of Hann windows that overlap by half, shape (bins, 16)."""
    samples = np.random.default_rng(seed).standard_normal((LENGTH // 2 * (windows + 1), 16))
    if coloured:
        f = np.fft.rfftfreq(samples.shape[0])
        shape = (1.0 / np.sqrt(f + 0.003) * (1.0 + 2.0 * np.exp(-(((f - 0.2) / 0.1) ** 2))))[:, None]
        samples = np.fft.irfft(np.fft.rfft(samples, axis=0) * shape, samples.shape[0], axis=0)
    starts = range(0, samples.shape[0] - LENGTH + 1, LENGTH // 2)
    spectra = [np.fft.rfft(samples[s : s + LENGTH] * hann(LENGTH)[:, None], axis=0) for s in starts]
    return np.mean(np.abs(spectra) ** 2, axis=0)[20:-4]


def test_single_windows_have_a_product_in_closed_form():
    for scale in (3.0, 30.0, 300.0):
        product = np.prod([(32 - i) / (32 - i + scale) for i in range(16)])
        assert false_alarm(scale, 1.0, 32) == pytest.approx(product, rel=1e-3)
    for probability in (1e-2, 1e-5, 1e-9):
        assert false_alarm(scale_of(probability, 12.0), 12.0) == pytest.approx(probability, rel=1e-6)


@pytest.mark.parametrize("coloured", [False, True])
@pytest.mark.parametrize("windows", [1, 7])
def test_noise_raises_as_many_alarms_as_stated(windows, coloured):
    power = mean_power(windows, coloured, 3)
    for probability in (1e-2, 3e-3):
        line, _ = stands_out(power, averages(windows), probability)
        # neighbours share their power: about half as many cells are independent
        deviation = np.sqrt(2.0 * probability * line.size) / line.size
        assert line.mean() == pytest.approx(probability, abs=4.0 * deviation)


def test_the_level_of_the_noise_does_not_matter_and_a_line_is_found():
    power = mean_power(7, coloured=False, seed=4)
    power[500, 2] += 6.0 * power[:, 2].mean()
    line, noise = stands_out(power, averages(7), 1e-6)
    again, _ = stands_out(1e9 * power, averages(7), 1e-6)
    np.testing.assert_array_equal(line, again)
    assert list(zip(*np.nonzero(line), strict=True)) == [(500, 2)]
    assert noise.mean() == pytest.approx(power.mean(), rel=0.05)


def test_a_ridge_that_wanders_is_found_by_the_sum_of_its_bins():
    power = mean_power(7, coloured=False, seed=5)
    power[700:712, 0] += 1.3 * power[:, 0].mean()
    assert not stands_out(power, averages(7), 1e-7)[0][690:720, 0].any()
    assert stands_out(power, averages(7), 1e-7, 12)[0][690:720, 0].any()
