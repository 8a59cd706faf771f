"""Shapes of milling cutters by name, and how far what is computed of a cylinder stands from what they do."""

from __future__ import annotations

from collections.abc import Sequence
from enum import StrEnum

from rcsa_ident.base.remarks import Remark, RemarkCode


class CutterShape(StrEnum):
    """What a cutter's edges sweep over; `profile` is an outline of its own."""

    FLAT = "flat"
    BULL_NOSE = "bull-nose"
    BALL = "ball"
    TAPERED = "tapered"
    FACE = "face"
    HIGH_FEED = "high-feed"
    RADIUS = "radius"
    BARREL = "barrel"
    LENS = "lens"
    OVAL = "oval"
    TAPER_BARREL = "taper-barrel"
    LOLLIPOP = "lollipop"
    CHAMFER = "chamfer"
    DOVETAIL = "dovetail"
    PROFILE = "profile"

    def has_room(self, corner_radius: float, diameter: float) -> bool:
        """Return whether a corner radius is at most half of the diameter; a hollow arc, and those of an outline, may be wider."""
        # libraries round figures in inches
        return self in (CutterShape.RADIUS, CutterShape.PROFILE) or corner_radius <= 0.5005 * diameter


class CutterCode(RemarkCode):
    """What may be said of a cutter."""

    AS_CYLINDER = "computed-as-a-cylinder"


#: A corner radius up to this share of the depth moves force lines by no more than cutting coefficients are usually uncertain, 5 %.
IGNORED_CORNER = 0.1
#: Limits of the cylinder over the true ones, of cutters and machines made up for the comparison.
_OF_LIMITS = {
    CutterShape.BULL_NOSE: "0.95 to 1.17 times the true ones with a corner radius of 3 mm on Ø16 mm, and up to 1.72 times on a soft Z axis",
    CutterShape.BALL: "0.80 to 1.07 times the true ones in a slot, 0.81 to 0.89 times at a shoulder, and up to 1.30 times on a soft Z axis",
    CutterShape.FACE: (
        "0.93 to 0.98 times the true ones at a cutting edge angle of 45°, and 0.72 times (Ø63 mm) or 0.39 times (Ø160 mm) where the "
        "tip tilts by 7 rad per metre of its motion"
    ),
    CutterShape.HIGH_FEED: (
        "0.61 to 1.45 times the true ones into a block, 0.77 to 1.85 times with a stepover, and 0.92 to 4.0 times on a soft Z axis"
    ),
}


def cylinder_remark(shape: CutterShape, forces: bool = False, missing: Sequence[str] = ()) -> Remark:
    """Return what to make of an answer that took a cutter of this shape for a cylinder of its diameter.

    `shape`: the range is that of this shape; a cylinder with a noticeable corner radius has that of a bull nose
    `forces`: whether the answer was found from cutting forces
    `missing`: keys of the cutter that nobody told, without which its shape cannot be drawn
    """
    known = _OF_LIMITS.get(CutterShape.BULL_NOSE if shape is CutterShape.FLAT else shape)
    what = "the corner radius is more than a tenth of the depth" if shape is CutterShape.FLAT else f"the cutter's shape is {shape}"
    what += f"; {' and '.join(missing)} {'is' if len(missing) == 1 else 'are'} not told" if missing else ""
    limits = (
        "how far its stability limits are off is not known, they may be too high"
        if known is None
        else f"its stability limits were {known} (above 1 is unsafe)"
    )
    told = f"computed as a cylinder: {what}; {limits}"
    if forces:
        told += "; forces of shallow cuts are 6 to 50 % off unless the coefficients come from the same cutter at the same depth"
    return Remark(CutterCode.AS_CYLINDER, told)
