"""Line spectra: spindle speed from the record itself, least-squares amplitudes at its multiples, noise beside the lines."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.signal import get_window

from rcsa_ident.dynamics.arrays import ComplexArray, FloatArray
from rcsa_ident.errors import InputError
from rcsa_ident.signals._kernels import order_signal, order_sums

#: Share of the programmed speed within which the true one is looked for.
SPEED_SEARCH = 0.01


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
        Of the real and of the imaginary part each, from the noise floor beside each line.
    scatter : array, shape (m + 1, c)
        The same from the scatter between quarters of the record.
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


def refine_speed(samples: FloatArray, rate: float, nominal: float, orders: int = 16) -> float:
    """Return the spindle speed whose multiples fit the record best [rad/s].

    A zero-padded spectrum is scanned within `SPEED_SEARCH` of the nominal speed; Gauss-Newton steps on the
    least-squares fit of all lines follow.

    Parameters
    ----------
    samples : array, shape (n, c)
        Displacements, without lost samples.
    rate : float [Hz]
    nominal : float [rad/s]
    """
    n = samples.shape[0]
    nominal_hz = nominal / (2.0 * np.pi)
    highest = int(min(orders, 0.45 * rate / nominal_hz))
    if n < 4.0 * rate / nominal_hz or highest < 1:
        wanted = f"at least four revolutions, {4.0 / nominal_hz:.4g} s, sampled twice per turn"
        raise InputError("recording length", f"{n / rate:.4g} s", wanted)
    centred = samples - samples.mean(axis=0)
    length = 1 << int(np.ceil(np.log2(4 * n)))
    power = np.sum(np.abs(np.fft.rfft(centred * get_window("hann", n)[:, None], length, axis=0)) ** 2, axis=1)
    step = 0.2 * rate / n / highest
    trial = nominal_hz + np.arange(-np.ceil(SPEED_SEARCH * nominal_hz / step), np.ceil(SPEED_SEARCH * nominal_hz / step) + 1) * step
    bins = np.outer(trial, np.arange(1, highest + 1)) * length / rate
    low = np.floor(bins).astype(int)
    score = np.sum((1.0 - (bins - low)) * power[low] + (bins - low) * power[low + 1], axis=1)
    return follow_speed(centred, rate, float(2.0 * np.pi * trial[int(np.argmax(score))]), highest)


def follow_speed(samples: FloatArray, rate: float, near: float, orders: int = 16) -> float:
    """Return the spindle speed that fits best close to a good guess (within a tenth of a turn over the record) [rad/s]."""
    step = near / rate
    highest = int(min(orders, 0.9 * np.pi / step))
    for _ in range(6):
        change = _speed_correction(samples, step, highest)
        step += change
        if abs(change) * samples.shape[0] * highest < 1e-3:
            break
    return float(step * rate)


def _speed_correction(samples: FloatArray, step: float, highest: int) -> float:
    """Gauss-Newton step of the speed: the rest of the fit against the fit's own change with speed.

    The change is freed of what the amplitudes can follow themselves, so that leakage between lines leaves no bias.
    """
    n = samples.shape[0]
    amplitude, drift = _fit(samples, step, highest)
    shifted = np.arange(n) - 0.5 * (n - 1)
    no_drift = np.zeros_like(drift)
    rest = samples - _synthesis(amplitude, drift, n, step)
    change = shifted[:, None] * _synthesis(1j * np.arange(highest + 1)[:, None] * amplitude, no_drift, n, step)
    change -= _synthesis(*_fit(change, step, highest), n, step)
    size = np.sum(change**2)
    return float(np.sum(change * rest) / size) if size > 0.0 else 0.0


def line_spectrum(samples: FloatArray, rate: float, spindle_speed: float, max_frequency: float) -> LineSpectrum:
    """Return the amplitudes at all multiples of the spindle's frequency up to `max_frequency`, by least squares.

    Lines and a parabola (drift) are fitted together. The sums are closed forms or one pass over the samples, so the cost is
    n times the orders, and the small normal equations.

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
    amplitude, drift = _fit(samples, step, highest)
    rest = samples - _synthesis(amplitude, drift, n, step)
    quarter = n // 4
    parts = np.array([_fit(samples[k * quarter : (k + 1) * quarter], step, highest)[0] for k in range(4)])
    # each part counts its phase from its own middle
    middles = np.array([(k + 0.5) * quarter - 0.5 for k in range(4)])
    parts = parts * np.exp(-1j * np.outer(middles - 0.5 * (n - 1), np.arange(highest + 1)) * step)[:, :, None]
    scatter = np.sum(np.abs(parts - parts.mean(axis=0)) ** 2, axis=0) / (2.0 * 3.0 * 4.0)
    variance = _floor(rest, step, highest)
    from_start = amplitude * np.exp(-1j * np.arange(highest + 1) * step * 0.5 * (n - 1))[:, None]
    return LineSpectrum(spindle_speed, from_start, variance, scatter, rest, rate)


def _fit(samples: FloatArray, step: float, highest: int) -> tuple[ComplexArray, FloatArray]:
    """Least-squares amplitudes (phases from the middle), and the drift's coefficients on u and u^2."""
    n, channels = samples.shape
    offset = samples.mean(axis=0)
    u = 2.0 * (np.arange(n) - 0.5 * (n - 1)) / n
    data = np.column_stack([samples - offset, u, u**2])
    sums = order_sums(data, step, highest, 1)[0]
    # unknowns: complex exponentials -highest..highest, then u, u^2
    both = np.concatenate([sums[:0:-1].conj(), sums])
    exponentials, powers = both[:, :channels], both[:, channels:]
    order = np.arange(-highest, highest + 1)
    half = 0.5 * (order[None, :] - order[:, None]) * step
    gram = np.full(half.shape, float(n))
    off = np.abs(np.sin(half)) > 1e-15
    gram[off] = np.sin(n * half[off]) / np.sin(half[off])
    drift_basis = np.column_stack([u, u**2])
    matrix = np.block([[gram.astype(complex), powers], [powers.conj().T, (drift_basis.T @ drift_basis).astype(complex)]])
    right = np.vstack([exponentials, drift_basis.T @ data[:, :channels]])
    solution = np.linalg.solve(matrix, right)
    amplitude = 2.0 * solution[highest : 2 * highest + 1]
    amplitude[0] = 0.5 * amplitude[0] + offset
    return amplitude, solution[2 * highest + 1 :].real


def _synthesis(amplitude: ComplexArray, drift: FloatArray, n: int, step: float) -> FloatArray:
    u = 2.0 * (np.arange(n) - 0.5 * (n - 1)) / n
    return order_signal(amplitude, step, n) + np.column_stack([u, u**2]) @ drift


def _floor(rest: FloatArray, step: float, highest: int) -> FloatArray:
    """Variance of a line's real part from the mean power in the bins around it, half an order to each side."""
    n = rest.shape[0]
    power = np.abs(np.fft.rfft(rest, axis=0)) ** 2 / n
    cumulative = np.vstack([np.zeros(rest.shape[1]), np.cumsum(power, axis=0)])
    centre = np.arange(highest + 1) * step * n / (2.0 * np.pi)
    reach = max(0.45 * step * n / (2.0 * np.pi), 2.0)
    low = np.clip(np.floor(centre - reach), 1, power.shape[0] - 2).astype(int)
    high = np.clip(np.ceil(centre + reach) + 1, low + 1, power.shape[0]).astype(int)
    return 2.0 / n * (cumulative[high] - cumulative[low]) / (high - low)[:, None]
