"""The stretch of a recording in which something happens, and no more of its band than is looked at."""

from __future__ import annotations

import numpy as np
from scipy.fft import irfft, next_fast_len, rfft

from rcsa_ident.base.arrays import FloatArray

#: Power [dB] below that of the loud windows at which a record is silent, and the length of these windows [s].
_SILENT, _WINDOW = 12.0, 0.1
#: Power [dB] below and above the stretch's median at which a cut begins, ends or hits something.
_FAINT, _HIT = 6.0, 9.0
#: Pauses that do not end a stretch, in windows.
_PAUSE = 2
#: Frequency above which a high rate is not looked at [Hz], and the rate that this band asks for.
BAND, _RATE = 5000.0, 12000.0


def loud_part(samples: FloatArray, rate: float) -> slice:
    """Return the longest stretch that is loud and even: without silence, entry and exit; all of a record that is even.

    `samples`, shape (n, c); `rate` [Hz]
    """
    n = samples.shape[0]
    length = max(round(_WINDOW * rate), 1)
    windows = n // length
    if windows < 4:
        return slice(0, n)
    parts = samples[: windows * length].reshape(windows, length, -1)
    # the slow drift of a sensor is no sound
    level = 10.0 * np.log10(np.sum(parts.var(axis=1), axis=1) + 1e-300)
    first, last = _longest(level > np.quantile(level, 0.9) - _SILENT)
    typical = np.median(level[first:last])
    within, until = _longest((level[first:last] > typical - _FAINT) & (level[first:last] < typical + _HIT))
    first, last = first + within, first + until
    return slice(first * length, n if last == windows else last * length)


def _longest(wanted: np.ndarray) -> tuple[int, int]:
    """First and last window of the longest stretch of wanted ones, short pauses included; all of them where none is wanted."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], wanted, [False]]).astype(int))).reshape(-1, 2)
    joined: list[tuple[int, int]] = []
    for first, last in edges.tolist():
        if joined and first - joined[-1][1] <= _PAUSE:
            joined[-1] = joined[-1][0], last
        else:
            joined.append((first, last))
    return max(joined, key=lambda each: each[1] - each[0], default=(0, wanted.size))


def decimated(samples: FloatArray, rate: float) -> tuple[FloatArray, float, float]:
    """Return samples at a rate that is high enough for `BAND`, that rate [Hz], and the band that is left [Hz].

    `samples`, shape (n, c); `rate` [Hz]
    """
    factor = int(rate / _RATE)
    if factor < 2:
        return samples, rate, 0.48 * rate
    n = samples.shape[0] // factor * factor
    padded = next_fast_len(n, real=True)
    while padded % factor:
        padded = next_fast_len(padded + 1, real=True)
    few = padded // factor
    out = np.empty((samples.shape[1], n // factor)).T
    bins = np.arange(few // 2 + 1) * rate / padded
    # a soft edge above the band, so that nothing rings
    edge = 0.5 * (1.0 + np.cos(np.pi * np.clip((bins - BAND) / (0.49 * rate / factor - BAND), 0.0, 1.0)))
    for c in range(samples.shape[1]):
        mean = samples[:n, c].mean()
        spectrum = rfft(samples[:n, c] - mean, padded)[: few // 2 + 1]
        out[:, c] = irfft(spectrum * edge, few)[: n // factor] / factor + mean
    return out, rate / factor, BAND
