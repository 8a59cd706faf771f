"""Roughness of the wall that a march has left: Ra, Rq and Rt behind a Gaussian profile filter."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import scipy.ndimage

from rcsa_ident.base.arrays import FloatArray
from rcsa_ident.base.errors import InputError, positive

#: Gaussian profile filters of ISO 16610-21: half of a wave of the cut-off's length passes.
_ALPHA = np.sqrt(np.log(2.0) / np.pi)
#: Share of the cut-off's length that is left out at both ends, where the filter has no profile on one side.
_END = 0.5


class Roughness(NamedTuple):
    """Parameters of ISO 21920-2 over an evaluation length, behind the filter of ISO 16610-21.

    `mean` [m]: Ra, arithmetic mean height
    `rms` [m]: Rq, root mean square height
    `total` [m]: Rt, from the deepest place to the highest one
    `cutoff` [m]: of the filter between roughness and waviness, lambda_c (nesting index N_ic)
    `length` [m]: that was evaluated
    """

    mean: float
    rms: float
    total: float
    cutoff: float
    length: float


def roughness(profile: FloatArray, spacing: float, cutoff: float = 0.8e-3) -> Roughness:
    """Return the roughness of a profile.

    A straight line is taken off first, then what the Gaussian filter lets pass of longer waves; half a cut-off is left out at both ends.

    `profile` [m], shape (n,): heights at places that are evenly apart
    `spacing` [m]
    `cutoff` [m]: 0.8 mm goes with Ra from 0.1 to 2 um
    Raises `InputError` if the profile is shorter than two cut-offs.

    Examples
    --------
    Waves of 0.1 mm and 1 um are all roughness: Ra = 2 a / pi.

    >>> x = np.arange(0.0, 5e-3, 1e-6)
    >>> found = roughness(1e-6 * np.sin(2.0 * np.pi * x / 1e-4), 1e-6)
    >>> round(1e6 * found.mean, 2), round(1e6 * found.rms, 2), round(1e6 * found.total, 1)
    (0.64, 0.71, 2.0)
    """
    heights = np.asarray(profile, dtype=float)
    length = (heights.size - 1) * positive("spacing", spacing, "m")
    if heights.ndim != 1 or length < 2.0 * positive("cutoff", cutoff, "m"):
        raise InputError("profile", f"{1e3 * length:.3g} mm", f"two cut-offs or more, {2e3 * cutoff:g} mm")
    x = np.arange(heights.size)
    heights = heights - np.polynomial.Polynomial.fit(x, heights, 1)(x)
    width = _ALPHA * cutoff / np.sqrt(2.0 * np.pi) / spacing
    rough = heights - scipy.ndimage.gaussian_filter1d(heights, width, mode="nearest", truncate=6.0)
    end = round(_END * cutoff / spacing)
    kept = rough[end : rough.size - end]
    kept = kept - kept.mean()
    return Roughness(float(np.mean(np.abs(kept))), float(np.sqrt(np.mean(kept**2))), float(np.ptp(kept)), cutoff, (kept.size - 1) * spacing)
