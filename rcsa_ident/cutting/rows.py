"""Rows: what of which tooth cuts between which angles, the one noun from which forces and all stability methods are summed.

A row is a piece of one tooth's edge that cuts along one arc and follows one surface. At a point of a curved edge it is a node of a
quadrature; along a wall, where all but the lag is constant, it is the whole edge, and what it does is integrated in closed form.
"""

from __future__ import annotations

from dataclasses import dataclass, fields
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from rcsa_ident.base.arrays import FloatArray
from rcsa_ident.base.errors import InputError
from rcsa_ident.cutting._kernels import chip_pieces
from rcsa_ident.cutting.conditions import AnyEngagement, Engagement, EngagementMap
from rcsa_ident.cutting.cutter import Cutter, HelixKind
from rcsa_ident.cutting.segments import Line, Segment
from rcsa_ident.cutting.teeth import Edges, edges_at, lags

#: Nodes of a piece of the outline, and one more for each of these angles that its edge lags [rad]; nodes of a wave of a serrated edge.
NODES, _LAG, WAVE = 8, 0.08, 256
#: What of a wall is a wall [rad].
_UPRIGHT = 1e-12


@dataclass(frozen=True, slots=True, eq=False)
class Rows:
    """Pieces of edge in the cut, arrays of shape (n,).

    `angle` [rad]: of the tooth ahead of tooth 1, at its tip
    `near`, `far` [rad]: between which lags behind its tip the piece stands; the same where it is a point
    `start`, `end` [rad]: immersion angles between which it cuts
    `delay` [rad]: rotation since the surface that it cuts was made
    `feed`, `step` [m]: the chip, measured radially, is feed sin(phi) + step
    `z`, `r` [m]: height above the tip, and radius
    `kappa` [rad]: angle of the edge's outward normal, from the axis pointing down
    `width` [m]: along the edge, in the plane of axis and radius
    `spacing` [rad]: rotation after which the next tooth stands as these do: a pitch where all teeth are alike and only one has rows, else a
        turn
    """

    angle: FloatArray
    near: FloatArray
    far: FloatArray
    start: FloatArray
    end: FloatArray
    delay: FloatArray
    feed: FloatArray
    step: FloatArray
    z: FloatArray
    r: FloatArray
    kappa: FloatArray
    width: FloatArray
    spacing: float

    @property
    def count(self) -> int:
        """How many there are."""
        return int(self.angle.size)


#: Names of the arrays of rows, in their order.
COLUMNS = tuple(each.name for each in fields(Rows))[:-1]


def rows_of(
    cutter: Cutter,
    engagement: AnyEngagement,
    depth: float,
    feed_per_tooth: float | None = None,
    along: bool = False,
    nodes: int = NODES,
) -> Rows:
    """Return what of which tooth cuts, down to a depth; no rows where none of them reaches the material.

    `depth` [m]
    `feed_per_tooth` [m]: decides where teeth are offset from each other; else it scales the chip only, and None counts as 1
    `along`: whether where a piece stands along the edge matters, as it does to the tip's slopes: walls are nodes then, too
    `nodes`: of a curved piece of the outline, at least
    Raises `InputError` if the depth is beyond the edge, teeth meet, or teeth are offset and no feed is told.
    """
    rise = engagement.feed_rise if isinstance(engagement, EngagementMap) else 0.0
    if cutter.offset and feed_per_tooth is None:
        raise InputError("feed_per_tooth", "nothing", "the feed per tooth [m]: with run-out it decides which teeth cut")
    feed = 1.0 if feed_per_tooth is None else feed_per_tooth
    # along a wall constant lead and constant angle are the same
    if cutter.is_cylinder and isinstance(engagement, Engagement) and not along:
        return _of_cylinder(cutter, engagement, depth, feed)
    pieces = places_of(cutter, engagement, depth, along, nodes)
    # a map may hold angles at which the tooth has no chip, as behind a tool that leans
    sought = cutter.offset or isinstance(engagement, EngagementMap)
    found = [table for piece in pieces for table in _of_piece(cutter, piece, feed, rise, sought)]
    values = np.concatenate(found, axis=1) if found else np.zeros((len(COLUMNS), 0))
    spacing = float(cutter.pitch[0]) if cutter.equally_spaced else 2.0 * np.pi
    return Rows(**dict(zip(COLUMNS, values, strict=True)), spacing=spacing)


def _of_cylinder(cutter: Cutter, engagement: Engagement, depth: float, feed: float) -> Rows:
    """Rows of a wall that is engaged between the same angles at all heights: one for each tooth and each surface that it meets.

    The same as the general way makes of it, in a fifth of the time; nothing may cut, and nobody asks where the wall ends.
    """
    alike, offset = cutter.equally_spaced, cutter.offset
    teeth = 1 if alike else cutter.teeth
    tooth = np.arange(teeth)
    moved = feed * cutter.teeth / (2.0 * np.pi)
    if offset:
        order = (tooth + np.arange(cutter.teeth)[:, None]) % cutter.teeth
        delays = np.cumsum(cutter.pitch[order], axis=0)
        steps = cutter.runout - cutter.runout[(order + 1) % cutter.teeth]
        arcs = np.full(teeth, engagement.entry), np.full(teeth, engagement.exit)
        tooth, which, start, end = chip_pieces(moved * delays, steps, *arcs, np.ones(teeth, dtype=bool))
        delay, step = delays[which, tooth], steps[which, tooth]
    else:
        start, end = np.full(teeth, engagement.entry), np.full(teeth, engagement.exit)
        delay, step = cutter.pitch[:teeth], np.zeros(teeth)
    lag = 2.0 * depth * np.tan(cutter.helix) / cutter.diameter
    same = np.array([0.0, lag, 0.5 * depth, 0.5 * cutter.diameter, 0.5 * np.pi, depth])
    near, far, z, r, kappa, width = np.repeat(same[:, None], tooth.size, axis=1)
    angle = cutter.tooth_angle[tooth]
    spacing = float(cutter.pitch[0]) if alike else 2.0 * np.pi
    return Rows(angle, near, far, start, end, delay, moved * delay, step, z, r, kappa, width, spacing)


class Places(NamedTuple):
    """Places along a piece of a cutter's outline that stands in the cut, arrays of shape (n,), and where the teeth's edges are there.

    `z`, `r`, `kappa`, `width`: as of `Rows`
    `span` [rad], shape (teeth, n): half of the lag between the ends of what a place stands for; 0 where it is a point
    `arcs` [rad], shape (k, n, 2): between which angles it cuts
    """

    z: FloatArray
    r: FloatArray
    kappa: FloatArray
    width: FloatArray
    edges: Edges
    span: FloatArray
    arcs: FloatArray


def places_of(
    cutter: Cutter, engagement: AnyEngagement, depth: float, along: bool = False, nodes: int = NODES, wave: int = WAVE
) -> list[Places]:
    """Return places along the outline down to a depth, piece by piece; see `rows_of`. `wave`: nodes of a wave of a serrated edge."""
    outline = cutter.outline
    if depth > outline.height * (1.0 + 1e-9):
        raise InputError("depth", f"{1e3 * depth:g} mm", f"at most {1e3 * outline.height:g} mm, where the cutter's edge ends")
    found = []
    for segment, low, high in outline.pieces(depth, engagement.radii, engagement.heights):
        if not along and _is_wall(cutter, segment):
            share, width = np.array([0.5 * (low + high)]), np.array([(high - low) * segment.length])
        else:
            share, width = _nodes(cutter, segment, low, high, nodes, wave, bool(engagement.radii))
        r, z, kappa = segment.at(share)
        # a wall as a whole, and cells of a wave, lag between their ends
        spans = share.size == 1 or cutter.serration is not None
        span = float(spans) * width * np.sin(kappa) * np.tan(cutter.helices)[:, None] / cutter.diameter
        found.append(Places(z, r, kappa, width, edges_at(cutter, z, kappa), span, engagement.arcs(r, z)))
    return found


def _is_wall(cutter: Cutter, segment: Segment) -> bool:
    """Whether all but the lag is constant along it."""
    upright = isinstance(segment, Line) and abs(segment.kappa - 0.5 * np.pi) < _UPRIGHT
    return (
        upright and cutter.serration is None and cutter.tilt == 0.0 and np.ndim(cutter.helix) == 0 and cutter.helix_kind is HelixKind.LEAD
    )


@lru_cache(maxsize=64)
def _gauss(count: int) -> tuple[FloatArray, FloatArray]:
    """Gauss-Legendre nodes and weights on 0 to 1."""
    node, weight = np.polynomial.legendre.leggauss(count)
    return 0.5 * (node + 1.0), 0.5 * weight


def _nodes(
    cutter: Cutter, segment: Segment, low: float, high: float, least: int, wave: int, corners: bool
) -> tuple[FloatArray, FloatArray]:
    """Shares of the way along a segment, and the widths for which they stand."""
    _, z, _ = segment.at(np.array([low, high]))
    rise = float(z[1] - z[0])
    if cutter.serration is not None:
        # waves repeat themselves: equal steps, which stay where they are when the depth grows
        step = cutter.serration.wavelength / (wave * rise)
        ends = np.append(np.arange(0.0, 1.0 - 1e-9, step), 1.0)
        share, weight = 0.5 * (ends[1:] + ends[:-1]), np.diff(ends)
    else:
        lag = float(np.max(np.ptp(lags(cutter, z), axis=1)))
        share, weight = _gauss(least + int(np.ceil(lag / _LAG)))
        if corners:
            # arcs begin and end like square roots where the stock's corner meets the outline
            share, weight = share**2 * (3.0 - 2.0 * share), weight * 6.0 * share * (1.0 - share)
    return low + (high - low) * share, weight * (high - low) * segment.length


def _of_piece(cutter: Cutter, piece: Places, feed: float, rise: float, sought: bool) -> list[FloatArray]:
    """Rows of the places of one piece, tables whose rows are the fields of `Rows`; whether chips are sought that are above zero."""
    found = []
    z, r, kappa, width, edges, span, arcs = piece
    per_turn = feed * cutter.teeth / (2.0 * np.pi)
    # a feed towards the spindle takes the edge out of the material, the more the flatter it lies
    climb = np.sin(rise) / np.tan(kappa) if rise else np.zeros_like(z)
    for j in range(1 if cutter.equally_spaced else cutter.teeth):
        lag, half = edges.lag[j], span[j]
        # a wave leans the edge and lengthens it; its height stays
        own = np.arctan2(np.sin(kappa), np.cos(kappa) + edges.slope[j] * np.sin(kappa))
        wide = width * np.sin(kappa) / np.sin(own)
        tooth = np.full_like(z, cutter.tooth_angle[j])
        order = (j + np.arange(cutter.teeth if cutter.offset else 1)) % cutter.teeth
        delay = np.cumsum(edges.pitch[order], axis=0)
        moved = np.cos(rise) * per_turn * delay
        step = edges.offset[j] - edges.offset[(order + 1) % cutter.teeth] - climb * per_turn * delay
        for start, end in np.moveaxis(arcs, 2, 1):
            keep = end > start + 1e-12
            if sought:
                node, which, start, end = chip_pieces(moved, step, start.copy(), end.copy(), keep)
            else:
                node, which = np.flatnonzero(keep), 0
                start, end = start[keep], end[keep]
            if node.size:
                chip = delay[which, node], moved[which, node], step[which, node]
                own_place = z[node], r[node], own[node], wide[node]
                found.append(np.stack([tooth[node], (lag - half)[node], (lag + half)[node], start, end, *chip, *own_place]))
    return found
