import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.signal import csd

from rcsa_ident.signals import frf
from rcsa_ident.signals.frf import AirCorrectedSpectra, LineEstimator
from tests.fixtures.synthetic import pair

H = np.array([2e-8 - 1e-8j, -3e-9 + 5e-9j, 1e-7j])


def spectra(seed, segments=400, output=0.0, input_=0.0):
    """Force of random phase and displacement H F, each with noise in proportion."""
    rng = np.random.default_rng(seed)

    def normal():
        return (rng.normal(size=(segments, 3)) + 1j * rng.normal(size=(segments, 3))) / np.sqrt(2.0)

    force = 40.0 * normal()
    return H * force + output * 40.0 * np.abs(H) * normal(), force + input_ * 40.0 * normal()


@pytest.mark.parametrize("estimator", [frf.h1, frf.h2, frf.hv])
def test_without_noise_all_agree(estimator):
    displacement, force = spectra(0)
    np.testing.assert_allclose(estimator(displacement, force), H, rtol=1e-12)
    np.testing.assert_allclose(frf.coherence(displacement, force), 1.0, rtol=1e-12)


def test_the_papers_estimator_without_noise():
    displacement, force = spectra(0)
    np.testing.assert_allclose(frf.air_corrected(displacement, force, np.zeros_like(force)), H, rtol=1e-12)


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 10**6), st.floats(0.0, 2.0), st.floats(0.0, 2.0))
def test_order_of_magnitudes(seed, output, input_):
    displacement, force = spectra(seed, 20, output, input_)
    one, v, two = (np.abs(f(displacement, force)) for f in (frf.h1, frf.hv, frf.h2))
    assert np.all(one <= v * (1.0 + 1e-12))
    assert np.all(v <= two * (1.0 + 1e-12))
    coherence = frf.coherence(displacement, force)
    np.testing.assert_allclose(coherence, one / two, rtol=1e-9)
    assert np.all((coherence >= 0.0) & (coherence <= 1.0 + 1e-12))


def test_noise_of_the_output_biases_h2_only():
    displacement, force = spectra(1, 40000, output=0.5)
    np.testing.assert_allclose(frf.h1(displacement, force), H, rtol=0.02)
    np.testing.assert_allclose(frf.h2(displacement, force), 1.25 * H, rtol=0.02)
    np.testing.assert_allclose(frf.hv(displacement, force), np.sqrt(1.25) * H, rtol=0.02)
    np.testing.assert_allclose(frf.coherence(displacement, force), 0.8, rtol=0.02)


def test_noise_of_the_input_biases_h1_only():
    displacement, force = spectra(2, 40000, input_=0.5)
    np.testing.assert_allclose(frf.h1(displacement, force), H / 1.25, rtol=0.02)
    np.testing.assert_allclose(frf.h2(displacement, force), H, rtol=0.02)


def test_air_cut_that_is_uncorrelated_goes_in_the_mean():
    displacement, force = spectra(3, 40000)
    rng = np.random.default_rng(4)

    def still():
        return 40.0 * np.abs(H) * np.exp(2j * np.pi * rng.random(force.shape))

    seen = displacement + still()
    np.testing.assert_allclose(frf.air_corrected(seen, force, still()), H, rtol=0.03)
    assert np.all(np.abs(frf.h2(seen, force)) > 1.9 * np.abs(H))


def far(found, made):
    """Greatest error over the largest response, by axis."""
    return max(
        np.abs((lines.receptance - made.expected(lines, axis)) * lines.force).max() / np.abs(lines.receptance * lines.force).max()
        for axis, lines in found.measurement.axes.items()
    )


def test_both_estimators_on_a_cut():
    # no roundness where the teeth are: both forms of subtraction say the same
    made = pair(seed=1, rpm=14000.0, roundness=0.0, noise=1e-10)
    assert far(made.measure(estimator=LineEstimator()), made) < 1e-3
    assert far(made.measure(estimator=AirCorrectedSpectra()), made) < 1e-2


def test_roundness_biases_spectra_but_not_lines():
    made = pair(seed=1, rpm=14000.0, roundness=4e-6, noise=1e-10)
    assert far(made.measure(estimator=LineEstimator()), made) < 5e-3
    assert far(made.measure(estimator=AirCorrectedSpectra()), made) > 0.1


@pytest.mark.slow
def test_the_jackknife_is_calibrated():
    z = []
    for seed in range(30):
        made = pair(seed=seed, rpm=14000.0, roundness=0.0, noise=2e-8, accelerometers=False, duration=0.2)
        for axis, lines in made.measure(estimator=AirCorrectedSpectra()).measurement.axes.items():
            error = (lines.receptance - made.expected(lines, axis)) / np.sqrt(lines.variance[:, 0])
            strong = np.abs(lines.receptance) > 10.0 * np.sqrt(lines.variance[:, 0])
            z += [*error[strong].real, *error[strong].imag]
    assert len(z) > 100
    # a variance from eight segments is itself known to a third: z has Student's tails
    assert np.sqrt(np.mean(np.square(z))) == pytest.approx(1.15, abs=0.25)


def test_coherence_of_the_spectra():
    clear = pair(seed=2, roundness=0.0, noise=1e-9).measure(estimator=AirCorrectedSpectra()).measurement
    noisy = pair(seed=2, roundness=0.0, noise=3e-7).measure(estimator=AirCorrectedSpectra()).measurement
    for axis in clear.axes:
        assert np.median(clear.axes[axis].coherence) > 0.99
        assert np.median(noisy.axes[axis].coherence) < np.median(clear.axes[axis].coherence)


def test_without_an_air_cut_spectra_are_h2():
    made = pair(seed=3, roundness=0.0, noise=1e-9)
    assert far(made.measure(estimator=AirCorrectedSpectra(), air=None), made) < 2e-2


def test_the_papers_spectra_have_one_output():
    """They are of the flange's absolute motion, whatever was recorded; nothing is left to subtract."""
    for axis, lines in pair(seed=1, rpm=14000.0).measure(estimator=AirCorrectedSpectra()).measurement.axes.items():
        assert lines.outputs == 1, axis
        assert np.all(lines.air == 0.0)
        assert np.all(lines.variance > 0.0)


def test_turning_lines_by_an_angle():
    rng = np.random.default_rng(5)
    lines, noise = rng.normal(size=(6, 2, 2)) + 1j * rng.normal(size=(6, 2, 2)), rng.uniform(1.0, 2.0, (6, 2, 2))
    # longer than the record: no line there, and no better known than its last one
    turned, variance = frf.turned(lines, noise, 0.3, 7)
    assert turned.shape == variance.shape == (8, 2, 2)
    for order in range(6):
        np.testing.assert_allclose(turned[order], lines[order] * np.exp(0.3j * order), rtol=1e-12)
    np.testing.assert_array_equal(turned[6:], 0.0)
    np.testing.assert_array_equal(variance, noise[[0, 1, 2, 3, 4, 5, 5, 5]])
    assert frf.turned(lines, noise, 0.3, 3)[0].shape[0] == 4


@pytest.mark.parametrize("name", ["h1", "h2", "coherence"])
def test_the_same_as_averaged_spectra_of_a_signal_library(name):
    """Noisy hits and their answers, end to end in one record of 12 segments."""
    rng = np.random.default_rng(7)
    hit = rng.standard_normal((12, 1024))
    answer = np.array([np.convolve(each, [0.3, 0.2, -0.1])[:1024] for each in hit]) + 0.2 * rng.standard_normal(hit.shape)
    measured = hit + 0.1 * rng.standard_normal(hit.shape)
    f, d = measured.ravel(), answer.ravel()

    def spectrum(x, y):
        return csd(x, y, window="boxcar", nperseg=1024, noverlap=0, detrend=False)[1]

    found = {
        "h1": spectrum(f, d) / spectrum(f, f),
        "h2": spectrum(d, d) / spectrum(d, f),
        "coherence": np.abs(spectrum(f, d)) ** 2 / (spectrum(f, f) * spectrum(d, d)).real,
    }[name]
    own = getattr(frf, name)(np.fft.rfft(answer), np.fft.rfft(measured))
    np.testing.assert_allclose(own, found, rtol=1e-10, atol=1e-12)
