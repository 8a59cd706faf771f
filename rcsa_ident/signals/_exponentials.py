"""Sums of decaying exponentials: ESPRIT on a short part and on narrow bands of a long one, refined by least squares on all samples."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.linalg
import scipy.signal

from rcsa_ident.arrays import ComplexArray, FloatArray

#: Samples that a subspace is taken from, and its dimension.
_SAMPLES, _ORDER = 576, 24
#: Singular values below this share of the largest are noise, whatever the order.
_RANK = 1e-4
#: Bandwidth around a spectral peak that a long ring is looked at in [Hz], and most peaks.
_BAND, _PEAKS = 500.0, 12
#: Most exponentials that are refined, and steps of the refinement.
_MOST, _STEPS = 10, 8
#: Share of the signal's energy below which an exponential is left out before the refinement.
_ENERGY = 1e-6
#: Exponentials closer than this are one, as a share of their frequency.
_SAME = 1e-3


@dataclass(frozen=True, slots=True, eq=False)
class Fit:
    """Exponentials of one ring.

    Parameters
    ----------
    pole : complex array, shape (m,) [1/s]
        Above the real axis.
    std : array, shape (m,) [1/s]
        Standard deviation of real and imaginary part each; the larger one.
    amplitude : array, shape (m,)
        At the first sample.
    """

    pole: ComplexArray
    std: FloatArray
    amplitude: FloatArray

    def chosen(self, kept: np.ndarray) -> Fit:
        """Return some of them."""
        return Fit(self.pole[kept], self.std[kept], self.amplitude[kept])


def esprit(samples: FloatArray, rate: float, lowest: float, highest: float) -> ComplexArray:
    """Return poles that a ring may be made of, shape (m,) [1/s]; more than there are.

    Parameters
    ----------
    samples : array, shape (n,)
    rate : float [Hz]
    lowest, highest : float [Hz]
        Frequencies between which they lie.
    """
    found = [_rotation(samples[:_SAMPLES], rate)]
    if samples.size > 2 * _SAMPLES:
        found += [_zoomed(samples, rate, f) for f in _peaks(samples, rate, lowest, highest)]
    poles = np.concatenate(found)
    inside = (poles.imag > 2.0 * np.pi * lowest) & (poles.imag < 2.0 * np.pi * highest) & (poles.real < 0.05 * poles.imag)
    return poles[inside & (poles.real > -0.4 * poles.imag)]


def _rotation(signal: FloatArray | ComplexArray, rate: float) -> ComplexArray:
    """Poles of a signal by the rotation of its subspace, total least squares being no better here than least squares."""
    rows = signal.size // 3
    if rows < 8 or not signal.any():
        return np.zeros(0, dtype=complex)
    square = scipy.linalg.hankel(signal[:rows], signal[rows - 1 :])
    square = square @ square.conj().T
    size, left = scipy.linalg.eigh(square, subset_by_index=(max(rows - _ORDER, 2), rows - 1), check_finite=False)
    space = left[:, size > _RANK**2 * size[-1]]
    turn = np.linalg.eigvals(np.linalg.lstsq(space[:-1], space[1:], rcond=None)[0])
    turn = turn[np.abs(turn) > 1e-6]
    return np.asarray(np.log(turn) * rate)


def _peaks(samples: FloatArray, rate: float, lowest: float, highest: float) -> list[float]:
    """Frequencies of a long ring's spectral peaks [Hz], the strongest ones, not two in one band."""
    size = np.abs(np.fft.rfft(samples))
    frequency = np.fft.rfftfreq(samples.size, 1.0 / rate)
    size[(frequency < lowest) | (frequency > highest)] = 0.0
    found: list[float] = []
    strongest = size.max()
    for place in np.argsort(size)[::-1][:2000]:
        if size[place] < 3e-3 * strongest or len(found) == _PEAKS:
            break
        if all(abs(frequency[place] - f) > 0.5 * _BAND for f in found):
            found.append(float(frequency[place]))
    return found


def _zoomed(samples: FloatArray, rate: float, centre: float) -> ComplexArray:
    """Poles in a band around a frequency, at a rate of its own."""
    step = max(int(rate / (2.0 * _BAND)), 1)
    taps = scipy.signal.firwin(8 * step + 1, 0.5 * _BAND, fs=rate)
    moved = samples * np.exp(-2j * np.pi * centre / rate * np.arange(samples.size))
    slow = scipy.signal.oaconvolve(moved, taps, mode="valid")[::step]
    if slow.size < 12:
        return np.zeros(0, dtype=complex)
    poles = _rotation(slow[:_SAMPLES], rate / step) + 2j * np.pi * centre
    return poles[np.abs(poles.imag - 2.0 * np.pi * centre) < np.pi * _BAND]


def refined(samples: FloatArray, rate: float, poles: ComplexArray, noise: float) -> Fit:
    """Return the poles that fit all samples best, with what the residual says of their standard deviations.

    Levenberg-Marquardt over poles and amplitudes together.

    Parameters
    ----------
    samples : array, shape (n,)
    rate : float [Hz]
    poles : complex array, shape (m,) [1/s]
        To begin with.
    noise : float
        Root mean square of the samples without a ring: the residual is taken as no smaller.
    """
    time = np.arange(samples.size) / rate
    poles = _selected(samples, time, poles)
    m = poles.size
    wave, weights, best = _amplitudes(samples, time, poles)
    damp = 1e-3
    for _ in range(_STEPS):
        normal, scale, slope = _normal(samples, time, wave, weights)
        normal[np.diag_indices_from(normal)] *= 1.0 + damp
        step = scipy.linalg.solve(normal, slope, assume_a="sym", check_finite=False) / scale
        moved = poles + step[2 * m : 3 * m] + 1j * step[3 * m :]
        # none grows over the record
        moved = np.minimum(moved.real, 1.0 / time[-1]) + 1j * np.abs(moved.imag)
        tried = _amplitudes(samples, time, moved)
        if tried[2] < best:
            gain, poles, (wave, weights, best), damp = best - tried[2], moved, tried, 0.3 * damp
            if gain < 1e-6 * best:
                break
        else:
            damp *= 10.0
    normal, scale, _ = _normal(samples, time, wave, weights)
    variance = max(best / max(samples.size - 4 * m, 1), noise**2)
    spread = np.sqrt(variance * np.maximum(np.diag(np.linalg.pinv(normal, rcond=1e-13, hermitian=True)), 0.0)) / scale
    std = np.maximum(spread[2 * m : 3 * m], spread[3 * m :])
    return Fit(poles, std, np.hypot(weights[:m], weights[m:]))


def _selected(samples: FloatArray, time: FloatArray, poles: ComplexArray) -> ComplexArray:
    """The strongest of the poles, not two that are one."""
    wave, weights, _ = _amplitudes(samples, time, poles)
    energy = np.sum(wave**2, axis=0) * weights**2
    energy = energy[: poles.size] + energy[poles.size :]
    kept: list[int] = []
    for i in np.argsort(energy)[::-1]:
        apart = all(abs(poles[i] - poles[k]) > _SAME * abs(poles[k]) for k in kept)
        if apart and energy[i] > _ENERGY * energy.max() and len(kept) < _MOST:
            kept.append(int(i))
    return poles[kept]


def _amplitudes(samples: FloatArray, time: FloatArray, poles: ComplexArray) -> tuple[FloatArray, FloatArray, float]:
    """Real and imaginary parts of the exponentials, shape (n, 2 m), with the weights that fit best, and the residual's square."""
    wave = np.exp(time[:, None] * poles)
    wave = np.hstack([wave.real, -wave.imag])
    scale = np.linalg.norm(wave, axis=0)
    scaled = wave / scale
    gram = scaled.T @ scaled
    gram[np.diag_indices_from(gram)] += 1e-11
    weights = scipy.linalg.solve(gram, scaled.T @ samples, assume_a="pos", check_finite=False) / scale
    rest = samples - wave @ weights
    return wave, weights, float(rest @ rest)


def _normal(samples: FloatArray, time: FloatArray, wave: FloatArray, weights: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Normal equations of amplitudes and poles, columns of length one; their lengths; the gradient in them."""
    m = weights.size // 2
    a, b, cosine, sine = weights[:m], weights[m:], wave[:, :m], -wave[:, m:]
    # x = Re((a + i b) exp(s t)) = a C - b S with S = exp sin: wave holds C and -S
    whole = np.hstack([wave, time[:, None] * (a * cosine - b * sine), time[:, None] * (-a * sine - b * cosine)])
    scale = np.linalg.norm(whole, axis=0) + 1e-300
    whole /= scale
    return whole.T @ whole, scale, whole.T @ (samples - wave @ weights)
