"""What a line in each bin of a spectrum is worth: how far it stands above the noise beside it."""

from __future__ import annotations

import numpy as np
from scipy.fft import rfft

from rcsa_ident.base.arrays import FloatArray
from rcsa_ident.signals.steady_part import hann

#: Length of the windows in which the speed is followed [s].
WINDOW = 0.5
#: Bins of a window's spectrum for each of its samples' own: it is padded with zeros.
PADDED = 4
#: The noise is the median over bands of this width [Hz].
_SPACING = 40.0
#: Lines below this share of the strongest one's power do not count: belts and bearings turn at other speeds.
_RANGE = 1e-4
#: Power over that of the noise beside it at which a line is worth nothing, and the most that one is worth: logarithms, so that a
#: strong line does not outweigh many.
_VISIBLE, _MOST_GAIN = 6.0, 4.0


class LineGains:
    """What lines are worth in the windows of a record, computed once for each length of the windows.

    `samples`, shape (n, c); `rate` [Hz]
    """

    def __init__(self, samples: FloatArray, rate: float) -> None:
        self.samples, self.rate = samples, rate
        self._found: dict[int, tuple[FloatArray, FloatArray]] = {}

    def of(self, length: int) -> tuple[FloatArray, FloatArray]:
        """Return what a line in each bin is worth in the channel where it stands out most, and the power in it of all channels.

        `length`: samples of a window, at most n; windows overlap by half, and their spectra are padded to `PADDED` times as many samples
        Returns `gain`, array, shape (w, b): logarithms, of bins from 0 to half the rate.
        Returns `power`, array, shape (b,): sum over windows and channels.
        """
        if length not in self._found:
            window, rows, total = hann(length), [], np.zeros(PADDED * length // 2 + 1)
            for start in self._starts(length):
                part = self.samples[start : start + length].T
                spectrum = rfft((part - part.mean(axis=1, keepdims=True)) * window, PADDED * length)
                power = spectrum.real**2 + spectrum.imag**2
                total += power.sum(axis=0)
                rows.append(self._worth(power))
            self._found[length] = np.array(rows), total
        return self._found[length]

    def middles(self, length: int) -> FloatArray:
        """Return the samples from the first one to the middles of the windows of a length, shape (w,)."""
        return self._starts(length) + 0.5 * (length - 1)

    def _starts(self, length: int) -> np.ndarray:
        return np.arange(0, self.samples.shape[0] - length + 1, max(length // 2, 1))

    def _worth(self, power: FloatArray) -> FloatArray:
        """What a line in each bin is worth, of the power in it, shape (c, b) -> (b,)."""
        channels, bins = power.shape
        width = min(max(round(_SPACING * 2 * (bins - 1) / self.rate), 16), bins)
        bands = power[:, : width * (bins // width)].reshape(channels, -1, width)
        noise, at = np.median(bands, axis=2) / np.log(2.0), np.arange(bins)
        middles = (np.arange(bands.shape[1]) + 0.5) * width
        ratio = np.full(bins, 1e-300)
        for own, floor in zip(power, noise, strict=True):
            ratio = np.maximum(ratio, own / (np.interp(at, middles, floor) + _RANGE * own.max() + 1e-300))
        return np.clip(np.log(ratio / _VISIBLE), -1.0, _MOST_GAIN)
