"""Where each tooth's edge stands along a cutter: lag behind the tip, pitch to the tooth ahead, radial offset."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from rcsa_ident.base.arrays import FloatArray
from rcsa_ident.base.errors import InputError
from rcsa_ident.cutting.cutter import Cutter, HelixKind
from rcsa_ident.cutting.segments import Line

#: Below this share of the largest radius an edge of constant angle does not wind on: it would without end at the axis.
_POLE = 0.02
#: Points of the table by which a lag of constant angle is told, a segment.
_POINTS = 257
#: Share by which a depth stays above the one at which teeth meet, and heights at which that is sought.
_ROUNDING, _HEIGHTS = 1e-6, 4001


class Edges(NamedTuple):
    """The teeth's edges at n places along the outline.

    `lag` [rad], shape (teeth, n): by which each edge lags its own tip
    `pitch` [rad], shape (teeth, n): from each tooth to the one ahead of it
    `offset` [m], shape (teeth, n): radial, of each edge from the outline
    `slope` [-], shape (teeth, n): of the serration, over the height
    """

    lag: FloatArray
    pitch: FloatArray
    offset: FloatArray
    slope: FloatArray


def edges_at(cutter: Cutter, z: FloatArray, kappa: FloatArray) -> Edges:
    """Return where the teeth's edges stand at heights z [m] of the outline, whose normals have the angles kappa [rad].

    Raises `InputError` if the teeth meet below the highest place.
    """
    lag = lags(cutter, z)
    pitch = cutter.pitch[:, None] + lag - np.roll(lag, -1, axis=0)
    if np.any(pitch <= 0.0):
        tooth, place = np.argwhere(pitch <= 0.0)[0]
        found = f"teeth {tooth + 1} and {(tooth + 1) % cutter.teeth + 1} that meet {1e3 * z[place]:.4g} mm above the tip"
        raise InputError("helix", found, "angles at which teeth meet nowhere in the cut, or a smaller depth")
    turned = cutter.tooth_angle[:, None] - lag
    # a tooth that stands higher is narrower where the outline widens upwards
    with np.errstate(divide="ignore"):
        widening = np.where(np.abs(kappa - 0.5 * np.pi) < 1e-12, 0.0, 1.0 / np.tan(np.maximum(kappa, 1e-12)))
    axial = np.where(cutter.axial_runout[:, None] == 0.0, 0.0, cutter.axial_runout[:, None] * widening)
    offset = cutter.runout[:, None] + np.tan(cutter.tilt) * z * np.cos(turned) - axial
    slope = np.zeros_like(offset)
    if cutter.serration is not None:
        waves = [cutter.serration.at(z, shift) for shift in cutter.serration.shifts(cutter.teeth)]
        offset = offset + np.array([wave for wave, _ in waves])
        slope = np.array([along for _, along in waves])
    return Edges(lag, pitch, offset, slope)


class Slices(NamedTuple):
    """A cut's edges in slices across the axis, from the tip up.

    `radius`, `height` [m], shape (n,): of the outline in the middle of each slice
    `lag`, `pitch`, `offset` [rad, rad, m], shape (teeth, n): as in `Edges`
    `lean` [rad], shape (teeth, n): of the edge's outward normal from the axis pointing down, waves included: pi/2 on a wall
    `width` [m], shape (teeth, n): of edge in each slice
    """

    radius: FloatArray
    height: FloatArray
    lag: FloatArray
    pitch: FloatArray
    offset: FloatArray
    lean: FloatArray
    width: FloatArray


def slices_of(cutter: Cutter, depth: float, count: int, radii: tuple[float, ...] = (), heights: tuple[float, ...] = ()) -> Slices:
    """Return a cut's slices.

    `depth` [m]
    `count`: slices, at least: each piece of the outline has its share
    `radii`, `heights`: tuples of float [m], where something about the cut changes: no slice lies on both sides

    Examples
    --------
    A wall of 10 mm, whose teeth wind by 26 degrees on the way up:

    >>> slices = slices_of(Cutter(2, 0.01, helix=np.radians(30.0)), 0.004, 4)
    >>> np.degrees(slices.lag[0]).round(1).tolist(), slices.width[0].round(6).tolist()
    ([3.3, 9.9, 16.5, 23.2], [0.001, 0.001, 0.001, 0.001])
    """
    none, nowhere = np.zeros(0), np.zeros((cutter.teeth, 0))
    found = [Slices(none, none, *(nowhere,) * 5)]
    for segment, low, high in cutter.outline.pieces(depth, radii, heights):
        _, ends, _ = segment.at(np.array([low, high]))
        own = int(np.ceil(count * np.ptp(ends) / depth - 1e-9))
        r, z, kappa = segment.at(low + (high - low) * (np.arange(own) + 0.5) / own)
        edges = edges_at(cutter, z, kappa)
        # a wave leans the edge and lengthens it
        lean = np.arctan2(np.sin(kappa), np.cos(kappa) + edges.slope * np.sin(kappa))
        width = segment.length * (high - low) / own * np.sin(kappa) / np.sin(lean)
        found.append(Slices(r, z, edges.lag, edges.pitch, edges.offset, lean, width))
    return Slices(*(np.concatenate(parts, axis=-1) for parts in zip(*found, strict=True)))


def lags(cutter: Cutter, z: FloatArray) -> FloatArray:
    """Return by which angle each edge lags its tip at heights above it [m], shape (teeth, n) [rad].

    Notes
    -----
    Of constant lead 2 z tan(helix) / diameter; of constant angle the integral of tan(helix) / r along the outline.
    """
    wound = 2.0 * z / cutter.diameter if cutter.helix_kind is HelixKind.LEAD else _wound(cutter, z)
    return np.tan(cutter.helices)[:, None] * wound


def deepest(cutter: Cutter) -> float:
    """Return the depth up to which a cutter cuts [m]: where its edge ends, or teeth of unlike helix meet; infinite of a plain cylinder.

    Examples
    --------
    Two teeth of 12 mm at 0 and 60 degrees, half a turn apart:

    >>> round(1e3 * deepest(Cutter(2, 0.012, helix=np.radians([0.0, 60.0]))), 3)
    10.883
    """
    if cutter.is_cylinder:
        return np.inf
    height, lead = cutter.outline.height, np.tan(cutter.helices)
    closing = np.roll(lead, -1) - lead
    meets = closing > 0.0
    if not np.any(meets):
        return height
    # how far the edges have wound where the first two teeth meet, a little before that
    wound = (1.0 - _ROUNDING) * float(np.min(cutter.pitch[meets] / closing[meets]))
    if cutter.helix_kind is HelixKind.LEAD:
        return min(height, 0.5 * cutter.diameter * wound)
    z = height * (np.arange(_HEIGHTS) / (_HEIGHTS - 1)) ** 2
    return float(np.interp(wound, _wound(cutter, z), z))


def _wound(cutter: Cutter, z: FloatArray) -> FloatArray:
    """Integral of db / r from the tip to heights [-]."""
    least = _POLE * cutter.outline.largest_radius
    heights, angles = [0.0], [0.0]
    for segment in cutter.outline.segments:
        _, low, _, high = segment.ends
        if high <= low or low >= np.max(z):
            continue
        shares = np.linspace(0.0, 1.0, _POINTS)
        r, there, _ = segment.at(shares)
        rate = segment.length / np.maximum(r, least)
        if isinstance(segment, Line) and np.ptp(r) == 0.0:
            shares, there, rate = shares[[0, -1]], there[[0, -1]], rate[[0, -1]]
        steps = 0.5 * (rate[1:] + rate[:-1]) * np.diff(shares)
        angles += (angles[-1] + np.cumsum(steps)).tolist()
        heights += there[1:].tolist()
    return np.interp(z, heights, angles)
