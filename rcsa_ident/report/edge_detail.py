"""What of a cutter's outline is worth a view of its own: where the edge bends, and where to cut it off."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from rcsa_ident.base.arrays import FloatArray
from rcsa_ident.cutting.profile import Profile
from rcsa_ident.cutting.segments import Line

#: So many times the height at which the outline has come to a straight line, and so many times the radius at least; an edge that ends
#: within so many times the radius is shown as a whole.
_BEYOND, _LEAST, _SHORT = 1.35, 0.12, 0.7
#: Scales that drawings have.
_SCALES = np.array([0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0])


class EdgeDetail(NamedTuple):
    """A part of an outline.

    Parameters
    ----------
    points : array, shape (n, 2) [mm]
        r and z, from the tip up.
    inside : float [mm]
        Radius at which the view is cut off towards the axis; 0 is the axis.
    scale : float
        How many times it is drawn larger.
    """

    points: FloatArray
    inside: float
    scale: float


def edge_detail(profile: Profile, room: float) -> EdgeDetail:
    """Return the part of an outline that is to be shown, so large that it fills about a square of `room` [mm].

    Parameters
    ----------
    profile : Profile
    room : float [mm]
    """
    high = profile.height
    last = profile.segments[-1]
    if isinstance(last, Line) and last.z0 > 0.0 and high > _SHORT * profile.largest_radius:
        high = min(high, max(_BEYOND * last.z0, _LEAST * profile.largest_radius))
    points = 1e3 * profile.outline(high)
    widest = float(points[:, 0].max())
    # a floor needs no more room than the edge beside it
    start = float(points[points[:, 1] > 0.0, 0].min())
    floors = points[points[:, 1] <= 0.0, 0]
    corner = float(floors.max()) if floors.size else 0.0
    inside = max(0.0, min(start, corner) - 0.8e3 * high)
    points = np.concatenate([[[inside, 0.0]], points[(points[:, 0] >= inside) | (points[:, 1] > 0.0)]]) if inside else points
    size = max(widest - inside, 1e3 * high)
    fits = _SCALES[room / size >= _SCALES]
    return EdgeDetail(points, inside, float(fits[-1]) if fits.size else float(_SCALES[0]))
