"""What a line in each bin of a spectrum is worth: how far it stands above the noise beside it."""

from __future__ import annotations

import numpy as np

from rcsa_ident.arrays import FloatArray
from rcsa_ident.signals.steady_part import hann

#: Length of the windows in which the speed is followed [s].
WINDOW = 0.5
#: The noise is the median over bands of this width [Hz].
_SPACING = 40.0
#: Lines below this share of the strongest one's power do not count: belts and bearings turn at other speeds.
_RANGE = 1e-4
#: Power over that of the noise beside it at which a line is worth nothing, and the most that one is worth: logarithms, so that a
#: strong line does not outweigh many.
_VISIBLE, _MOST_GAIN = 6.0, 4.0


def line_gain(samples: FloatArray, rate: float, length: int) -> tuple[FloatArray, FloatArray]:
    """Return what a line in each bin is worth in the channel where it stands out most, in windows that overlap by half.

    Parameters
    ----------
    samples : array, shape (n, c)
    rate : float [Hz]
    length : int
        Samples of a window, at most n; the spectra are padded to four times as many.

    Returns
    -------
    gain : array, shape (w, b)
        Logarithms, of bins from 0 to half the rate.
    middles : array, shape (w,)
        Samples from the first one to the windows' middles.
    """
    starts = np.arange(0, samples.shape[0] - length + 1, max(length // 2, 1))
    padded = 4 * length
    gain = np.zeros((starts.size, padded // 2 + 1))
    bins = np.arange(gain.shape[1])
    window, width = hann(length)[:, None], min(max(round(_SPACING * padded / rate), 16), bins.size)
    for w, start in enumerate(starts):
        part = samples[start : start + length]
        power = np.abs(np.fft.rfft((part - part.mean(axis=0)) * window, padded, axis=0)) ** 2
        noise = np.median(power[: width * (bins.size // width)].reshape(-1, width, power.shape[1]), axis=1) / np.log(2.0)
        middles = (np.arange(noise.shape[0]) + 0.5) * width
        ratio = np.full(bins.size, 1e-300)
        for c in range(power.shape[1]):
            ratio = np.maximum(ratio, power[:, c] / (np.interp(bins, middles, noise[:, c]) + _RANGE * power[:, c].max() + 1e-300))
        gain[w] = np.clip(np.log(ratio / _VISIBLE), -1.0, _MOST_GAIN)
    return gain, starts + 0.5 * (length - 1)
