"""The edges of any cutter as levels: short pieces with a lag, a radius and a lean, each cutting where its height meets the stock.

This machine's own way of taking a cutter apart: it shares no code with the sums over rows that identification and stability use.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rcsa_ident.base.arrays import FloatArray
from rcsa_ident.base.errors import InputError
from rcsa_ident.cutting.conditions import AnyEngagement, Block, CuttingConditions, Engagement, Stepover
from rcsa_ident.cutting.cutter import Cutter, HelixKind

#: Levels of a wave, at least.
_OF_A_WAVE = 24
#: Points by which the lag of an edge of constant angle is integrated.
_STEPS = 4000
#: Below this share of the diameter an edge of constant angle does not wind on.
_INNERMOST = 0.01


@dataclass(frozen=True, slots=True, eq=False)
class Levels:
    """Pieces of edge, arrays of shape (teeth, levels).

    `lag` [rad]: of the piece's middle behind the tooth's tip
    `offset` [m]: radial, from the outline
    `sine`, `cosine` [-]: of the angle between the piece's outward normal and the axis pointing down
    `width` [m]: in the plane of axis and radius
    `entry`, `leave` [rad]: immersion angles between which it is in the material
    `spread` [rad]: from its lower to its upper end, along the helix
    """

    lag: FloatArray
    offset: FloatArray
    sine: FloatArray
    cosine: FloatArray
    width: FloatArray
    entry: FloatArray
    leave: FloatArray
    spread: FloatArray

    @property
    def columns(self) -> FloatArray:
        """All side by side, as the kernel takes them, shape (teeth, levels, 8)."""
        parts = (self.lag, self.offset, self.sine, self.cosine, self.width, self.entry, self.leave, self.spread)
        return np.ascontiguousarray(np.stack(parts, axis=2))


def levels_of(cutter: Cutter, conditions: CuttingConditions, count: int) -> Levels:
    """Return the levels of a cut, up to its depth.

    `count`: levels, at least; of a shape those near the tip are lower, since it is widest open there
    Raises `InputError` for a table of arcs, or a depth beyond the edge.
    """
    depth = conditions.axial_depth
    if cutter.serration is not None:
        count = max(count, int(np.ceil(_OF_A_WAVE * depth / cutter.serration.wavelength)))
    share = np.arange(count + 1) / count
    ends = depth * (share if cutter.profile is None else share**2)
    middle = 0.5 * (ends[1:] + ends[:-1])
    reach = _radii(cutter, ends)
    rising = np.diff(ends)
    # each edge's own outline: a wave moves it in and out
    edge = reach + _waves(cutter, ends)
    run = np.diff(edge, axis=1)
    width = np.hypot(run, rising)
    radius, wave = _radii(cutter, middle), _waves(cutter, middle)
    lag_at_ends = _lags(cutter, ends)
    lag = _lags(cutter, middle)
    turned = cutter.tooth_angle[:, None] - lag
    slope = np.diff(reach) / rising
    offset = wave + cutter.runout[:, None] + np.tan(cutter.tilt) * middle * np.cos(turned) - cutter.axial_runout[:, None] * slope
    entry, leave = _arcs(conditions.engagement, radius)
    same = np.ones((cutter.teeth, 1))
    return Levels(lag, offset, rising / width, run / width, width, same * entry, same * leave, np.abs(np.diff(lag_at_ends, axis=1)))


def _radii(cutter: Cutter, z: FloatArray) -> FloatArray:
    """Radius of the outline at heights [m]."""
    if cutter.profile is None:
        return np.full(z.size, 0.5 * cutter.diameter)
    return np.array([cutter.profile.radius_at(float(height)) for height in z])


def _waves(cutter: Cutter, z: FloatArray) -> FloatArray:
    """By which each edge's wave stands out at heights, shape (teeth, n) [m]."""
    if cutter.serration is None:
        return np.zeros((cutter.teeth, z.size))
    return np.array([cutter.serration.at(z, shift)[0] for shift in cutter.serration.shifts(cutter.teeth)])


def _lags(cutter: Cutter, z: FloatArray) -> FloatArray:
    """Lag of each edge at heights, shape (teeth, n) [rad]."""
    lead = np.tan(cutter.helices)[:, None]
    if cutter.helix_kind is HelixKind.LEAD:
        return lead * 2.0 * z / cutter.diameter
    # at a constant angle the edge turns by its way over the radius; finely near the tip, where a ball is flat
    height = float(z.max()) * (np.arange(_STEPS + 1) / _STEPS) ** 2
    radius = _radii(cutter, height)
    way = np.hypot(np.diff(height), np.diff(radius)) / np.maximum(0.5 * (radius[1:] + radius[:-1]), _INNERMOST * cutter.diameter)
    return lead * np.interp(z, height, np.concatenate([[0.0], np.cumsum(way)]))


def _arcs(engagement: AnyEngagement, radius: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Where a point at each radius enters and leaves: it stands at y = r cos(phi) and moves ahead while sin(phi) is above zero."""
    if isinstance(engagement, Engagement):
        low, high = engagement.angles
        return np.full(radius.size, low), np.full(radius.size, high)
    if isinstance(engagement, Block):
        upper, lower = np.full(radius.size, engagement.y_to), np.full(radius.size, engagement.y_from)
    elif isinstance(engagement, Stepover):
        down = engagement.strategy == "down"
        upper = engagement.width - radius if down else radius
        lower = -radius if down else radius - engagement.width
    else:
        raise InputError("engagement", str(engagement), "a block, a stepover or fixed angles: the virtual machine takes no table")
    enter, exit_ = (np.arccos(np.clip(y / np.maximum(radius, 1e-12), -1.0, 1.0)) for y in (upper, lower))
    return enter, exit_
