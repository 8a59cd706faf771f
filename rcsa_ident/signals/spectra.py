"""Line spectra: spindle speed from the record itself, least-squares amplitudes at its multiples, noise beside the lines."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from scipy.fft import next_fast_len

from rcsa_ident.base.arrays import ComplexArray, FloatArray
from rcsa_ident.base.errors import InputError
from rcsa_ident.signals._kernels import angle_signal, angle_sums, order_signal, order_sums, turned
from rcsa_ident.signals.active_segment import BAND, decimated
from rcsa_ident.signals.recording import BLOCK, LONGEST
from rcsa_ident.signals.steady_part import hann

#: Share of the programmed speed within which the true one is looked for.
SPEED_SEARCH = 0.01
#: Degree of the polynomial that is fitted beside the lines.
DRIFT_DEGREE = 4
#: Lines beside the orders: how far one stands above the median amplitude of so many bins around it, and how many are looked for.
_FAR_ABOVE, _FLOOR_BINS, _MOST_BESIDE = 8.0, 64, 8
#: Power over the median of half a turn in which something knocked, the largest share of them that knocks are, and how often they are
#: filled: each time with an error smaller by that share.
_KNOCK, _MOST_KNOCKED, _FILLINGS = 12.0, 0.25, 4


@dataclass(frozen=True, slots=True, eq=False)
class LineSpectrum:
    """Amplitudes of a record at the multiples of its spindle frequency.

    x(t) = Re sum_m amplitude[m] e^{i m (Omega t + deviation)} + slow drift + lines beside the orders + rest, t from the record's first
    sample.

    `spindle_speed` [rad/s]
    `amplitude` [channel's unit], shape (m + 1, c): orders 0..m
    `variance`, shape (m + 1, c): variance of the real and of the imaginary part each, from the noise floor beside each line
    `scatter`, shape (m + 1, c): the same variance from the scatter between quarters of the record
    `rest`, shape (n, c): what is left of the record without lines and drift
    `rate` [Hz]
    `beside` [rad/s], shape (s,): frequencies of lines that stand beside the orders: the mains' hum, chatter
    `beside_signal`, shape (n, c): what they are in the record, where there are some
    """

    spindle_speed: float
    amplitude: ComplexArray
    variance: FloatArray
    scatter: FloatArray
    rest: FloatArray
    rate: float
    beside: FloatArray
    beside_signal: FloatArray | None

    @property
    def off_orders(self) -> FloatArray:
        """What the record holds beside the orders and the drift, shape (n, c)."""
        return self.rest if self.beside_signal is None else self.rest + self.beside_signal

    def up_to(self, max_frequency: float) -> LineSpectrum:
        """Return the same with the lines up to a frequency [Hz]."""
        kept = int(max_frequency * 2.0 * np.pi / self.spindle_speed) + 1
        return replace(self, amplitude=self.amplitude[:kept], variance=self.variance[:kept], scatter=self.scatter[:kept])


class Comb(NamedTuple):
    """The orders' phase over the samples: step from one to the next, and what it deviates from that, shape (n,), None where it does not."""

    step: float
    deviation: FloatArray | None = None

    def angle(self, n: int) -> FloatArray:
        """From the middle of the samples, shape (n,)."""
        even = self.step * (np.arange(n) - 0.5 * (n - 1))
        return even if self.deviation is None else even + self.deviation

    def sums(self, data: FloatArray, highest: int) -> ComplexArray:
        """Sums over the samples times e^{-i m angle}, m from 0, shape (highest + 1, c)."""
        if self.deviation is None:
            return order_sums(data, self.step, highest)
        n = data.shape[0]
        return angle_sums(data, turned(self.angle(n)), np.zeros(1, dtype=int), np.ones(n), highest)[0]

    def products(self, n: int, highest: int) -> ComplexArray:
        """Sums over n samples of e^{i m angle}, m from -2 highest to 2 highest."""
        if self.deviation is None:
            half = 0.5 * np.arange(-2 * highest, 2 * highest + 1) * self.step
            on_line = np.abs(np.sin(half)) < 1e-15
            return np.where(on_line, float(n), np.sin(n * half) / np.where(on_line, 1.0, np.sin(half))).astype(complex)
        sums = self.sums(np.ones((n, 1)), 2 * highest)[:, 0]
        return np.concatenate([sums[::-1], sums[1:].conj()])

    def signal(self, amplitude: ComplexArray, n: int) -> FloatArray:
        """Re sum_m amplitude[m] e^{i m angle}, shape (n, c)."""
        if self.deviation is None:
            return order_signal(amplitude, self.step, n)
        return angle_signal(amplitude[None], turned(self.angle(n)), n)

    def part(self, start: int, length: int) -> Comb:
        """Of samples in a row."""
        return Comb(self.step, None if self.deviation is None else self.deviation[start : start + length])


def refine_speed(samples: FloatArray, rate: float, nominal: float, orders: int = 16, search: float = SPEED_SEARCH) -> float:
    """Return the spindle speed whose multiples fit the record best [rad/s].

    A zero-padded spectrum is scanned near the nominal speed; `follow_speed` takes over from there.

    `samples`, shape (n, c): displacements, without lost samples
    `rate` [Hz]; `nominal` [rad/s]
    `orders`: highest multiple that is looked at
    `search`: share of the nominal speed within which the true one is looked for
    """
    n = samples.shape[0]
    nominal_hz = nominal / (2.0 * np.pi)
    highest = int(min(orders, 0.45 * rate / nominal_hz))
    if n < 4.0 * rate / nominal_hz or highest < 1:
        wanted = f"at least four revolutions, {4.0 / nominal_hz:.4g} s, sampled twice per turn"
        raise InputError("recording length", f"{n / rate:.4g} s", wanted)
    centred = samples - samples.mean(axis=0)
    windowed, slower = centred * hann(n)[:, None], rate
    if highest * (1.0 + search) * nominal_hz < BAND:
        windowed, slower, _ = decimated(windowed, rate)
    length = next_fast_len(4 * windowed.shape[0], real=True)
    power = np.sum(np.abs(np.fft.rfft(windowed, length, axis=0)) ** 2, axis=1)
    step = 0.2 * rate / n / highest
    reach = np.ceil(search * nominal_hz / step)
    trial = nominal_hz + np.arange(-reach, reach + 1) * step
    bins = np.outer(trial, np.arange(1, highest + 1)) * length / slower
    low = np.minimum(np.floor(bins).astype(int), power.size - 2)
    score = np.sum((1.0 - (bins - low)) * power[low] + (bins - low) * power[low + 1], axis=1)
    return follow_speed(centred, rate, float(2.0 * np.pi * trial[int(np.argmax(score))]), highest)


def follow_speed(samples: FloatArray, rate: float, near: float, orders: int = 16, deviation: FloatArray | None = None) -> float:
    """Return the spindle speed that fits best close to a good guess (within a tenth of a turn over the record) [rad/s].

    In each of up to eight blocks the lines are fitted; the speed is the one at which all blocks tell the same amplitudes
    and phases. Blocks hold whole revolutions, so that orders above `orders` do not leak in.

    `samples`, shape (n, c): displacements, without lost samples
    `rate` [Hz]
    `near` [rad/s]: the guess
    `orders`: highest multiple that is fitted
    `deviation` [rad], shape (n,): of the spindle's angle from that at a constant speed
    """
    step = near / rate
    highest = int(min(orders, 0.9 * np.pi / step))
    for _ in range(4):
        middles, lines = _block_lines(samples, Comb(step, deviation), highest, *_blocks(samples.shape[0], 2.0 * np.pi / step))
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


def _block_lines(samples: FloatArray, comb: Comb, highest: int, starts: np.ndarray, length: int) -> tuple[FloatArray, ComplexArray]:
    """Blocks' middles from the record's, and their amplitudes with phases from there, shapes (blocks,) and (blocks, m + 1, c)."""
    n, channels = samples.shape
    basis = _drift_basis(length, 2)
    if comb.deviation is None:
        side_by_side = np.concatenate([samples[s : s + length] for s in starts], axis=1)
        amplitude = _fit(side_by_side, comb, highest, basis)[0].reshape(highest + 1, starts.size, channels).transpose(1, 0, 2)
    else:
        amplitude = np.stack([_fit(samples[s : s + length], comb.part(s, length), highest, basis)[0] for s in starts])
    middles = starts + 0.5 * (length - 1) - 0.5 * (n - 1)
    return middles, amplitude * np.exp(-1j * np.outer(middles, np.arange(highest + 1)) * comb.step)[:, :, None]


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


def line_spectrum(
    samples: FloatArray, rate: float, spindle_speed: float, max_frequency: float, deviation: FloatArray | None = None
) -> LineSpectrum:
    """Return the amplitudes at all multiples of the spindle's frequency up to `max_frequency`, by least squares.

    Lines and a slow drift (a polynomial) are fitted together, and with them lines beside the orders that stand far above the noise
    (mains' hum): else these would leak into all orders. Short stretches in which something knocked are left out.

    `samples`, shape (n, c); `rate` [Hz]; `spindle_speed` [rad/s]; `max_frequency` [Hz]
    `deviation` [rad], shape (n,): of the spindle's angle from that at this speed, where it does not turn evenly
    """
    n = samples.shape[0]
    comb = Comb(spindle_speed / rate, deviation)
    highest = int(min(max_frequency, 0.45 * rate) * 2.0 * np.pi / spindle_speed)
    basis = _drift_basis(n, DRIFT_DEGREE)

    def fitted(values: FloatArray, beside: FloatArray) -> tuple[ComplexArray, FloatArray, FloatArray | None]:
        """Amplitudes, what they, the drift and the lines beside them leave of the record, and what the latter are."""
        every = np.concatenate([basis, _swinging(beside, n)], axis=1) if beside.size else basis
        amplitude, other = _fit(values, comb, highest, every)
        left = samples - comb.signal(amplitude, n) - basis @ other[:DRIFT_DEGREE]
        swinging = every[:, DRIFT_DEGREE:] @ other[DRIFT_DEGREE:] if beside.size else None
        return amplitude, left if swinging is None else left - swinging, swinging

    amplitude, rest, swinging = fitted(samples, np.zeros(0))
    beside = _lines_beside(rest, comb.step)
    if beside.size:
        amplitude, rest, swinging = fitted(samples, beside)
    hit, values = _knocked(rest, comb.step), samples
    for again in range(_FILLINGS if hit.any() else 0):
        # what a knock hides is what the rest of the record says of it
        values = np.where(hit[:, None], samples - rest, samples)
        heard = values - samples + rest
        beside = beside if again else _lines_beside(heard if swinging is None else heard + swinging, comb.step)
        amplitude, rest, swinging = fitted(values, beside)
    parts = _block_lines(values if swinging is None else values - swinging, comb, highest, np.arange(4) * (n // 4), n // 4)[1]
    scatter = np.sum(np.abs(parts - parts.mean(axis=0)) ** 2, axis=0) / (2.0 * 3.0 * 4.0)
    from_start = amplitude * np.exp(-1j * np.arange(highest + 1) * comb.step * 0.5 * (n - 1))[:, None]
    # where a knock was, nothing was told
    share = 1.0 - float(np.mean(hit))
    variance = _floor(np.where(hit[:, None], 0.0, rest) if hit.any() else rest, comb.step, highest) / share**2
    return LineSpectrum(spindle_speed, from_start, variance, scatter / share**2, rest, rate, beside * rate, swinging)


def _knocked(rest: FloatArray, step: float) -> np.ndarray:
    """Samples in which something knocked, shape (n,): short stretches far louder than the record mostly is."""
    n, length = rest.shape[0], max(round(np.pi / step), 8)
    blocks, hit = n // length, np.zeros(rest.shape[0], dtype=bool)
    if blocks < 8 or n > LONGEST:
        return hit
    energy = np.mean(rest[: blocks * length].reshape(blocks, length, -1) ** 2, axis=1)
    loud = np.any(energy > _KNOCK * np.median(energy, axis=0), axis=1)
    if loud.mean() > _MOST_KNOCKED:
        # what lasts is no knock
        return hit
    # it begins and ends within blocks
    wide = loud.copy()
    wide[1:] |= loud[:-1]
    wide[:-1] |= loud[1:]
    hit[: blocks * length] = np.repeat(wide, length)
    hit[blocks * length :] = wide[-1]
    turn = round(2.0 * np.pi / step)
    for start, stop in np.flatnonzero(np.diff(np.concatenate([[False], hit, [False]]))).reshape(-1, 2):
        first, later = rest[start : max(stop - turn, start)], rest[min(start + turn, stop) : stop]
        # what comes again every turn is a force that changes
        if len(first) > turn and np.sum(first * later) > 0.5 * np.sqrt(np.sum(first**2) * np.sum(later**2)):
            hit[start:stop] = False
    return hit


def _lines_beside(rest: FloatArray, step: float) -> FloatArray:
    """Frequencies [rad per sample] of lines that stand far above the noise around them, clear of the orders; strongest first, few."""
    n = rest.shape[0]
    if not 16 * _FLOOR_BINS <= n <= BLOCK:
        # a long record tells lines apart by itself
        return np.zeros(0)
    window, length = hann(n)[:, None], n // 2 // _FLOOR_BINS * _FLOOR_BINS
    found: list[float] = []
    omega = 2.0 * np.pi * np.arange(length) / n
    orders = omega / step
    clear = np.abs(orders - np.round(orders)) * step > 3.5 * 2.0 * np.pi / n
    # what a drift leaves lies lowest
    clear[:6], clear[-1] = False, False
    left = rest
    while len(found) < _MOST_BESIDE:
        power = np.abs(np.fft.rfft(left * window, axis=0)[:length]) ** 2
        floor = np.median(power.reshape(-1, _FLOOR_BINS, power.shape[1]), axis=1).repeat(_FLOOR_BINS, axis=0) + 1e-300
        ratio = np.where(clear, np.max(power / floor, axis=1), 0.0)
        peak = int(np.argmax(ratio))
        if ratio[peak] < _FAR_ABOVE**2:
            break
        # a parabola through the logarithms, of all channels together
        low, top, high = np.log(np.sum(power[peak - 1 : peak + 2] / floor[peak], axis=1))
        if top < max(low, high):
            # the side of what belongs to an order
            clear[peak] = False
            continue
        bend = low - 2.0 * top + high
        found.append(float(2.0 * np.pi / n * (peak + (0.5 * (low - high) / bend if bend < 0.0 else 0.0))))
        columns = _swinging(np.array(found), n)
        left = rest - columns @ np.linalg.solve(columns.T @ columns, columns.T @ rest)
        clear &= np.abs(omega - found[-1]) > 2.5 * 2.0 * np.pi / n
    return np.array(found)


def _swinging(omega: FloatArray, n: int) -> FloatArray:
    """Cosine and sine of frequencies [rad per sample], and both growing along the record: so little is told of them; shape (n, 4 s)."""
    place = np.arange(n) - 0.5 * (n - 1)
    phase = place[:, None] * omega
    both = np.concatenate([np.cos(phase), np.sin(phase)], axis=1)
    return np.concatenate([both, 2.0 / n * place[:, None] * both], axis=1)


def segment_lines(
    samples: FloatArray,
    rate: float,
    spindle_speed: float,
    order: np.ndarray,
    segments: int = 8,
    deviation: FloatArray | None = None,
) -> ComplexArray:
    """Return amplitudes at multiples of the spindle's angle in half-overlapping Hann segments [welch1967], phases from the record's start.

    `samples`, shape (n, c); `rate` [Hz]; `spindle_speed` [rad/s]
    `order`: array of int, shape (m,)
    `segments`: number of segments
    `deviation` [rad], shape (n,): as in `line_spectrum`
    Returns a complex array of shape (segments, m, c).
    """
    n = samples.shape[0]
    length = 2 * n // (segments + 1)
    window = hann(length)
    window = 2.0 * window / window.sum()
    angle = spindle_speed / rate * np.arange(n) + (0.0 if deviation is None else deviation)
    parts = []
    for s in range(segments):
        part = slice(s * (n - length) // max(segments - 1, 1), s * (n - length) // max(segments - 1, 1) + length)
        inside = samples[part]
        parts.append(np.exp(-1j * np.outer(order, angle[part])) @ ((inside - inside.mean(axis=0)) * window[:, None]))
    return np.array(parts)


def _fit(samples: FloatArray, comb: Comb, highest: int, basis: FloatArray) -> tuple[ComplexArray, FloatArray]:
    """Least-squares amplitudes (phases from the middle), and the coefficients of other columns, shape (n, k), that are fitted, too."""
    n, channels = samples.shape
    offset = samples.mean(axis=0)
    data = np.empty((n, channels + basis.shape[1]))
    np.subtract(samples, offset, out=data[:, :channels])
    data[:, channels:] = basis
    sums = comb.sums(data, highest)
    # unknowns: complex exponentials -highest..highest, then the other columns
    both = np.concatenate([sums[:0:-1].conj(), sums])
    order = np.arange(2 * highest + 1)
    size, others = order.size, basis.shape[1]
    matrix = np.empty((size + others, size + others), dtype=complex)
    matrix[:size, :size] = comb.products(n, highest)[order[None, :] - order[:, None] + 2 * highest]
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

    `signal`, shape (n,)
    """
    width = max(-(-signal.size // points), 1)
    starts = np.arange(0, signal.size, width)
    return width, np.minimum.reduceat(signal, starts), np.maximum.reduceat(signal, starts)


def mean_spectrum(signal: FloatArray, rate: float, seconds: float = 2.0) -> tuple[FloatArray, FloatArray]:
    """Return frequencies [Hz] and amplitudes, shape (m,), of a record: root mean square over windows that overlap by half.

    `signal`, shape (n,); `rate` [Hz]
    `seconds`: length of a window; that of the record where it is shorter
    """
    length = int(min(seconds * rate, signal.size))
    window = hann(length)
    starts = range(0, signal.size - length + 1, max(length // 2, 1))
    power = np.mean([_power(signal[s : s + length], window) for s in starts], axis=0)
    amplitude: FloatArray = 2.0 * np.sqrt(power) / window.sum()
    return np.arange(amplitude.size) * rate / length, amplitude


def spectrogram(signal: FloatArray, rate: float, columns: int, seconds: float = 0.1) -> tuple[float, FloatArray]:
    """Return the step of frequency [Hz] and the level [dB], shape (m, c), of windows that follow each other.

    `signal`, shape (n,); `rate` [Hz]
    `columns`: most of them; fewer where they would overlap by more than three quarters
    `seconds`: length of a window
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
