"""What a cut's rows push with where the tip moves: the one door through which all stability methods see cutter and engagement."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import cast

import numpy as np

from rcsa_ident.base.arrays import FloatArray
from rcsa_ident.base.errors import InputError
from rcsa_ident.cutting.forms import Directions, force_form, mean_over_turn, normal_form, product_form
from rcsa_ident.cutting.process import MillingProcess
from rcsa_ident.cutting.rows import Rows, rows_of

#: Share of the radius below which the speed of a rubbing edge counts as that at this share: towards the axis it falls to nothing.
SLOWEST = 0.1


@dataclass(frozen=True, slots=True, eq=False)
class Regeneration:
    """F = sum over rows of stiffness (q(t) - q(t - delay)) + rubbing / speed q'(t), in r directions of the machine.

    `stiffness` [N/m, with slopes N and N m], shape (rows, 5, r, r): of 1, cos, sin, cos 2 and sin 2 of the immersion
    `rubbing` [N/m], shape (rows, 5, r, r): process damping times the spindle's speed
    """

    rows: Rows
    stiffness: FloatArray
    rubbing: FloatArray | None

    @property
    def mean(self) -> FloatArray:
        """Mean stiffness over a turn, shape (r, r) [N/m]."""
        return mean_over_turn(self.rows, self.stiffness / self.rows.width[:, None, None, None])

    @property
    def strongest(self) -> float:
        """What the stiffness of all teeth that may stand in the cut at once is at most, as a norm [N/m]."""
        if not self.rows.count:
            return 0.0
        start, end, spacing = self.rows.start.min(), self.rows.end.max(), self.rows.spacing
        each = np.sum(np.linalg.norm(self.stiffness, axis=(2, 3)).sum(axis=1))
        # where all teeth have rows they stand in the sum already
        copies = np.ceil((end - start + np.max(self.rows.far) - np.min(self.rows.near)) / spacing) if spacing < 6.0 else 1.0
        return float(max(copies, 1.0) * each)


def regeneration(process: MillingProcess, depth: float, directions: Directions = 2) -> Regeneration:
    """Return what a cut of a depth pushes with.

    `process`: its engagement; one that changes by a profile of its own is left aside
    `depth` [m]
    `directions`: 2, 3 or 5; x and y of the machine, with z, with the slopes x' and y'
    """
    rows = rows_of(process.cutter, process.engagement, depth, process.feed_per_tooth, along=directions == 5)
    return regeneration_of(process, rows, directions)


def regeneration_of(process: MillingProcess, rows: Rows, directions: Directions) -> Regeneration:
    """Return what rows of a cut push with, see `regeneration`."""
    known, damping = process.coefficients, process.damping
    turn = turned(process, directions)
    normal = normal_form(rows, directions)

    def form(tangential: float, radial: float, axial: float, scale: FloatArray) -> FloatArray:
        product = product_form(force_form(rows, tangential, radial, axial, directions), normal)
        found: FloatArray = turn @ (scale[:, None, None, None] * product) @ turn.T
        return found

    stiffness = form(1.0, known.radial_ratio, known.axial_ratio, known.tangential * rows.width)
    rubbing = None
    if damping is not None:
        radius = np.maximum(rows.r, SLOWEST * process.cutter.outline.largest_radius)
        rubbing = form(damping.friction, 1.0, 0.0, damping.strength * rows.width / radius)
    return Regeneration(rows, stiffness, rubbing)


def turned(process: MillingProcess, directions: Directions) -> FloatArray:
    """Return the rotation from feed and normal to the machine's axes, shape (r, r)."""
    turn = np.eye(directions)
    turn[:2, :2] = process.machine_from_feed
    if directions == 5:
        turn[3:, 3:] = process.machine_from_feed
    return turn


def sliced(rows: Rows, parts: FloatArray) -> Rows:
    """Return rows of a plain cut's edge cut into parts: from the tip up, by shares of the depth, each with angles of its own.

    `rows`: each the whole edge of a tooth
    `parts`: array, shape (k, 2) or (k, 4); shares of the depth between which a part lies, and the angles between which it cuts; without
        these those of the row
    """
    whole = np.repeat(np.arange(rows.count), len(parts))
    each = np.tile(parts, (rows.count, 1))
    upper, lower = each[:, 0], each[:, 1]
    lag = (rows.far - rows.near)[whole]
    angles = {} if parts.shape[1] == 2 else {"start": each[:, 2], "end": each[:, 3]}
    values = {name: getattr(rows, name)[whole] for name in ("angle", "start", "end", "delay", "feed", "step", "r", "kappa")}
    moved = {
        "near": rows.near[whole] + upper * lag,
        "far": rows.near[whole] + lower * lag,
        # the middle of a whole edge stands at half of the depth
        "z": rows.z[whole] * (upper + lower),
        "width": rows.width[whole] * (lower - upper),
    }
    return replace(rows, **{**values, **moved, **angles})


def check_constant(process: MillingProcess) -> None:
    """Raise `InputError` where the speed varies, or the engagement changes by a profile of its own."""
    if process.speed_variation is not None:
        raise InputError("speed_variation", "a varying speed", "a constant speed: full-discretisation takes a varying one")
    if process.engagement_profile is not None:
        allowed = "one engagement for the whole edge: full-discretisation takes one that changes"
        raise InputError("engagement_profile", "an engagement that changes along the edge", allowed)


def directions_of(count: int) -> Directions:
    """Return how many directions of the tip count, of those that a receptance or modes have."""
    if count not in (2, 3, 5):
        raise InputError("tip directions", count, "2 (x, y), 3 (with z) or 5 (with the slopes x' and y')")
    return cast(Directions, count)
