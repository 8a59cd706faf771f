"""Noise of a measured receptance, from its own lines: what differences over frequency leave of a curve that is smooth but for it."""

from __future__ import annotations

import numpy as np
from scipy.ndimage import median_filter

from rcsa_ident.base.arrays import ComplexArray, FloatArray

#: Lines whose median counts: more than a resonance has at its top, fewer than those over which noise changes.
_WINDOW = 41
#: Distances of the lines that are compared. At twice the distance white noise leaves the same, a smooth curve eight times as much; from
#: so many times as much on it is the curve.
_STRIDES, _CURVE = (1, 2, 4), 4.0


def differences_noise(values: ComplexArray, stride: int = 1) -> FloatArray:
    """Return the standard deviation of the real and of the imaginary part each by third differences, shape (n, ...).

    A third difference of white noise has 20 times its variance, and the median of |z|^2 is ln 2 of its mean. The median is that of a
    window of lines, so that a resonance does not count as noise.

    `values`, shape (n, ...): along neighbouring lines, more than three times the stride
    `stride`: lines from one value of a difference to the next
    """
    n, reach = len(values), 3 * stride
    third = values[reach:] - 3.0 * values[2 * stride : n - stride] + 3.0 * values[stride : n - 2 * stride] - values[: n - reach]
    power = np.abs(third) ** 2 / (40.0 * np.log(2.0))
    window = (min(_WINDOW, n - reach), *[1] * (values.ndim - 1))
    middle = np.pad(median_filter(power, window, mode="nearest"), [(reach // 2, reach - reach // 2), *[(0, 0)] * (values.ndim - 1)], "edge")
    return np.sqrt(middle)


def line_noise(values: ComplexArray) -> FloatArray:
    """Return the standard deviation of the real and of the imaginary part each, shape (n, ...); 0 in entries that show no noise.

    Lines that a window has smeared into each other differ less than their noise: where further ones differ more, these count. Where
    differences grow as a curve's do, as at a sharp resonance, the noise is that of the lines beside it.

    `values`, shape (n, ...): along neighbouring lines; fewer than four windows of them show no noise

    Examples
    --------
    >>> from rcsa_ident.dynamics.line_noise import line_noise
    >>> omega, rng = np.linspace(1.0, 2.0, 2000), np.random.default_rng(1)
    >>> mode = 1.0 / (1.5**2 - omega**2 + 0.06j * omega)
    >>> noise = 0.1 * (rng.standard_normal(2000) + 1j * rng.standard_normal(2000))
    >>> round(float(np.median(line_noise(mode + noise))), 2)
    0.11
    >>> float(line_noise(mode).max())
    0.0
    """
    if len(values) < 4 * _WINDOW:
        return np.zeros(values.shape)
    near, far, farthest = (differences_noise(values, stride) for stride in _STRIDES)
    noise = far <= _CURVE * near
    found = np.maximum(near, far)
    found = np.where(farthest <= _CURVE * far, np.maximum(found, farthest), found)
    line = np.arange(len(values))
    for entry in np.ndindex(values.shape[1:]):
        seen = noise[:, *entry]
        # a curve that bends quickly at its resonances alone still shows its noise
        found[:, *entry] = np.interp(line, line[seen], found[seen, *entry]) if np.mean(seen) > 0.5 else 0.0
    return found
