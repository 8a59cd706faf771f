"""Line spectra: spindle speed from the record itself, least-squares amplitudes at its multiples, noise beside the lines."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.fft import next_fast_len

from rcsa_ident.arrays import ComplexArray, FloatArray
from rcsa_ident.errors import InputError
from rcsa_ident.signals._kernels import order_signal, order_sums
from rcsa_ident.signals.steady_part import hann

#: Share of the programmed speed within which the true one is looked for.
SPEED_SEARCH = 0.01
#: Degree of the polynomial that is fitted beside the lines.
DRIFT_DEGREE = 4


@dataclass(frozen=True, slots=True, eq=False)
class LineSpectrum:
    """Amplitudes of a record at the multiples of its spindle frequency.

    x(t) = Re sum_m amplitude[m] e^{i m Omega t} + slow drift + rest, t from the record's first sample.

    Parameters
    ----------
    spindle_speed : float [rad/s]
    amplitude : complex array, shape (m + 1, c) [channel's unit]
        Orders 0..m.
    variance : array, shape (m + 1, c)
        Variance of the real and of the imaginary part each, from the noise floor beside each line.
    scatter : array, shape (m + 1, c)
        The same variance from the scatter between quarters of the record.
    rest : array, shape (n, c)
        What is left of the record without lines and drift.
    rate : float [Hz]
    """

    spindle_speed: float
    amplitude: ComplexArray
    variance: FloatArray
    scatter: FloatArray
    rest: FloatArray
    rate: float


def refine_speed(samples: FloatArray, rate: float, nominal: float, orders: int = 16, search: float = SPEED_SEARCH) -> float:
    """Return the spindle speed whose multiples fit the record best [rad/s].

    A zero-padded spectrum is scanned near the nominal speed; `follow_speed` takes over from there.

    Parameters
    ----------
    samples : array, shape (n, c)
        Displacements, without lost samples.
    rate : float [Hz]
    nominal : float [rad/s]
    orders : int
        Highest multiple that is looked at.
    search : float
        Share of the nominal speed within which the true one is looked for.
    """
    n = samples.shape[0]
    nominal_hz = nominal / (2.0 * np.pi)
    highest = int(min(orders, 0.45 * rate / nominal_hz))
    if n < 4.0 * rate / nominal_hz or highest < 1:
        wanted = f"at least four revolutions, {4.0 / nominal_hz:.4g} s, sampled twice per turn"
        raise InputError("recording length", f"{n / rate:.4g} s", wanted)
    centred = samples - samples.mean(axis=0)
    length = next_fast_len(4 * n, real=True)
    power = np.sum(np.abs(np.fft.rfft(centred * hann(n)[:, None], length, axis=0)) ** 2, axis=1)
    step = 0.2 * rate / n / highest
    reach = np.ceil(search * nominal_hz / step)
    trial = nominal_hz + np.arange(-reach, reach + 1) * step
    bins = np.outer(trial, np.arange(1, highest + 1)) * length / rate
    low = np.minimum(np.floor(bins).astype(int), power.size - 2)
    score = np.sum((1.0 - (bins - low)) * power[low] + (bins - low) * power[low + 1], axis=1)
    return follow_speed(centred, rate, float(2.0 * np.pi * trial[int(np.argmax(score))]), highest)


def follow_speed(samples: FloatArray, rate: float, near: float, orders: int = 16) -> float:
    """Return the spindle speed that fits best close to a good guess (within a tenth of a turn over the record) [rad/s].

    In each of up to eight blocks the lines are fitted; the speed is the one at which all blocks tell the same amplitudes
    and phases. Blocks hold whole revolutions, so that orders above `orders` do not leak in.

    Parameters
    ----------
    samples : array, shape (n, c)
        Displacements, without lost samples.
    rate : float [Hz]
    near : float [rad/s]
        The guess.
    orders : int
        Highest multiple that is fitted.
    """
    step = near / rate
    highest = int(min(orders, 0.9 * np.pi / step))
    for _ in range(4):
        middles, lines = _block_lines(samples, step, highest, *_blocks(samples.shape[0], 2.0 * np.pi / step))
        change = _common_rotation(lines, middles)
        step += change
        if abs(change) * samples.shape[0] * highest < 1e-2:
            break
    return float(step * rate)


def _blocks(n: int, period: float) -> tuple[np.ndarray, int]:
    """First samples and length of blocks, two at least, that leave little of the record out.

    Blocks hold whole revolutions and lie whole revolutions apart: what is not fitted leaks into all of them alike.
    """
    turns = int(n / period)
    # k blocks tell 1 - 1 / k^2 of what the samples in them know of the speed
    information = {k: (turns // k) * k * (1.0 - 1.0 / k**2) for k in range(2, 11) if turns // k >= 2}
    blocks = max(information, key=lambda k: information[k]) if information else 2
    length = min(max(round(turns // blocks * period), 1), n // blocks)
    starts = np.round(np.arange(blocks) * max(turns // blocks, 1) * period).astype(int)
    return np.minimum(starts, n - length) + max(n - length - starts[-1], 0) // 2, length


def _block_lines(samples: FloatArray, step: float, highest: int, starts: np.ndarray, length: int) -> tuple[FloatArray, ComplexArray]:
    """Blocks' middles from the record's, and their amplitudes with phases from there, shapes (blocks,) and (blocks, m + 1, c)."""
    n, channels = samples.shape
    side_by_side = np.concatenate([samples[s : s + length] for s in starts], axis=1)
    amplitude = _fit(side_by_side, step, highest, degree=2)[0].reshape(highest + 1, starts.size, channels).transpose(1, 0, 2)
    middles = starts + 0.5 * (length - 1) - 0.5 * (n - 1)
    return middles, amplitude * np.exp(-1j * np.outer(middles, np.arange(highest + 1)) * step)[:, :, None]


def _common_rotation(lines: ComplexArray, middles: FloatArray) -> float:
    """Change of the step at which the blocks' amplitudes agree best, by Gauss-Newton steps."""
    order = np.arange(lines.shape[1])
    slope = np.outer(middles - middles.mean(), order)[:, :, None]
    change = 0.0
    for _ in range(20):
        turned = lines * np.exp(-1j * change * slope)
        mean = turned.mean(axis=0)
        size = np.sum(slope**2 * np.abs(mean) ** 2)
        if size == 0.0:
            break
        more = np.sum(slope * (mean.conj() * turned).imag) / size
        change += more
        if abs(more * slope[-1, -1, 0]) < 1e-6:
            break
    return float(change)


def line_spectrum(samples: FloatArray, rate: float, spindle_speed: float, max_frequency: float) -> LineSpectrum:
    """Return the amplitudes at all multiples of the spindle's frequency up to `max_frequency`, by least squares.

    Lines and a slow drift (a polynomial) are fitted together.

    Parameters
    ----------
    samples : array, shape (n, c)
    rate : float [Hz]
    spindle_speed : float [rad/s]
    max_frequency : float [Hz]
    """
    n = samples.shape[0]
    step = spindle_speed / rate
    highest = int(min(max_frequency, 0.45 * rate) * 2.0 * np.pi / spindle_speed)
    amplitude, drift = _fit(samples, step, highest, DRIFT_DEGREE)
    rest = samples - order_signal(amplitude, step, n) - _drift_basis(n, DRIFT_DEGREE) @ drift
    parts = _block_lines(samples, step, highest, np.arange(4) * (n // 4), n // 4)[1]
    scatter = np.sum(np.abs(parts - parts.mean(axis=0)) ** 2, axis=0) / (2.0 * 3.0 * 4.0)
    from_start = amplitude * np.exp(-1j * np.arange(highest + 1) * step * 0.5 * (n - 1))[:, None]
    return LineSpectrum(spindle_speed, from_start, _floor(rest, step, highest), scatter, rest, rate)


def segment_lines(samples: FloatArray, rate: float, omega: FloatArray, segments: int = 8) -> ComplexArray:
    """Return amplitudes at given frequencies in half-overlapping Hann segments [welch1967], phases from the record's start.

    Parameters
    ----------
    samples : array, shape (n, c)
    rate : float [Hz]
    omega : array, shape (m,) [rad/s]
    segments : int
        Number of segments.

    Returns
    -------
    complex array, shape (segments, m, c)
    """
    n = samples.shape[0]
    length = 2 * n // (segments + 1)
    window = hann(length)
    window = 2.0 * window / window.sum()
    starts = [s * (n - length) // max(segments - 1, 1) for s in range(segments)]
    parts = []
    for start in starts:
        t = (start + np.arange(length)) / rate
        part = samples[start : start + length]
        parts.append(np.exp(-1j * np.outer(omega, t)) @ ((part - part.mean(axis=0)) * window[:, None]))
    return np.array(parts)


def _fit(samples: FloatArray, step: float, highest: int, degree: int) -> tuple[ComplexArray, FloatArray]:
    """Least-squares amplitudes (phases from the middle), and the drift's coefficients on `_drift_basis`."""
    n, channels = samples.shape
    offset = samples.mean(axis=0)
    basis = _drift_basis(n, degree)
    data = np.concatenate([samples - offset, basis], axis=1)
    sums = order_sums(data, step, highest)
    # unknowns: complex exponentials -highest..highest, then the drift
    both = np.concatenate([sums[:0:-1].conj(), sums])
    half = 0.5 * np.arange(-2 * highest, 2 * highest + 1) * step
    on_line = np.abs(np.sin(half)) < 1e-15
    kernel = np.where(on_line, float(n), np.sin(n * half) / np.where(on_line, 1.0, np.sin(half)))
    order = np.arange(2 * highest + 1)
    size = order.size
    matrix = np.empty((size + degree, size + degree), dtype=complex)
    matrix[:size, :size] = kernel[order[None, :] - order[:, None] + 2 * highest]
    matrix[:size, size:] = both[:, channels:]
    matrix[size:, :size] = both[:, channels:].conj().T
    matrix[size:, size:] = basis.T @ basis
    right = np.concatenate([both[:, :channels], basis.T @ data[:, :channels]])
    solution = np.linalg.solve(matrix, right)
    amplitude = 2.0 * solution[highest:size]
    amplitude[0] = 0.5 * amplitude[0] + offset
    return amplitude, solution[size:].real


def _drift_basis(n: int, degree: int) -> FloatArray:
    """Legendre polynomials of degree 1 to `degree` over the samples, shape (n, degree)."""
    u = 2.0 * (np.arange(n) - 0.5 * (n - 1)) / n
    return np.polynomial.legendre.legvander(u, degree)[:, 1:]


def _floor(rest: FloatArray, step: float, highest: int) -> FloatArray:
    """Variance of a line's real part from the mean power in the bins around it, half an order to each side."""
    n = rest.shape[0]
    power = np.abs(np.fft.rfft(rest, axis=0)) ** 2 / n
    cumulative = np.concatenate([np.zeros((1, rest.shape[1])), np.cumsum(power, axis=0)])
    centre = np.arange(highest + 1) * step * n / (2.0 * np.pi)
    reach = max(0.45 * step * n / (2.0 * np.pi), 2.0)
    low = np.clip(np.floor(centre - reach), 1, power.shape[0] - 2).astype(int)
    high = np.clip(np.ceil(centre + reach) + 1, low + 1, power.shape[0]).astype(int)
    # the line itself took one bin's noise with it
    bins = np.maximum(high - low - 1, 1)
    return 2.0 / n * (cumulative[high] - cumulative[low]) / bins[:, None]


def envelope(signal: FloatArray, points: int) -> tuple[int, FloatArray, FloatArray]:
    """Return samples per interval, and the smallest and largest value in each of at most `points` intervals, shape (p,).

    Parameters
    ----------
    signal : array, shape (n,)
    points : int
    """
    width = max(-(-signal.size // points), 1)
    starts = np.arange(0, signal.size, width)
    return width, np.minimum.reduceat(signal, starts), np.maximum.reduceat(signal, starts)


def mean_spectrum(signal: FloatArray, rate: float, seconds: float = 2.0) -> tuple[FloatArray, FloatArray]:
    """Return frequencies [Hz] and amplitudes, shape (m,), of a record: root mean square over windows that overlap by half.

    Parameters
    ----------
    signal : array, shape (n,)
    rate : float [Hz]
    seconds : float
        Length of a window; that of the record where it is shorter.
    """
    length = int(min(seconds * rate, signal.size))
    window = hann(length)
    starts = range(0, signal.size - length + 1, max(length // 2, 1))
    power = np.mean([_power(signal[s : s + length], window) for s in starts], axis=0)
    amplitude: FloatArray = 2.0 * np.sqrt(power) / window.sum()
    return np.arange(amplitude.size) * rate / length, amplitude


def spectrogram(signal: FloatArray, rate: float, columns: int, seconds: float = 0.1) -> tuple[float, FloatArray]:
    """Return the step of frequency [Hz] and the level [dB], shape (m, c), of windows that follow each other.

    Parameters
    ----------
    signal : array, shape (n,)
    rate : float [Hz]
    columns : int
        Most of them; fewer where they would overlap by more than three quarters.
    seconds : float
        Length of a window.
    """
    length = int(min(max(seconds * rate, 64), signal.size))
    window = hann(length)
    starts = np.linspace(0, signal.size - length, min(columns, max(signal.size // max(length // 4, 1), 1))).astype(int)
    power = np.array([_power(signal[s : s + length], window) for s in starts]).T
    level: FloatArray = 10.0 * np.log10(power + 1e-300)
    return rate / length, level


def _power(part: FloatArray, window: FloatArray) -> FloatArray:
    power: FloatArray = np.abs(np.fft.rfft((part - part.mean()) * window)) ** 2
    return power
