"""A tooling to scale: the holder in section, the tool in its bore, dimensioned; SVG whose unit is the millimetre."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from html import escape
from itertools import groupby
from textwrap import wrap
from typing import NamedTuple

import numpy as np

from rcsa_ident.base.arrays import FloatArray
from rcsa_ident.cutting.outlines import ANGLES, in_files
from rcsa_ident.cutting.profile import Profile
from rcsa_ident.cutting.segments import Line
from rcsa_ident.cutting.shape import CutterShape
from rcsa_ident.setup.tooling import Tooling
from rcsa_ident.tool_holder.geometry import BeamSegment

#: So many times the height at which the outline has come to a straight line, and so many times the radius at least; an edge that ends
#: within so many times the radius is shown as a whole.
_BEYOND, _LEAST, _SHORT = 1.35, 0.12, 0.7
#: Scales that drawings have.
_SCALES = np.array([0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0])
#: Drawn on a paper of its own, so that it reads on a light page and on a dark one.
_STYLE = """
.rt{--paper:#fff;--ink:#1b2430;--soft:#7a8694;--tool:#c9d3de;--steel:#dfe4ea;--hatch:#9aa7b5;--contact:#d1495b}
@media (prefers-color-scheme:dark){.rt{--paper:#161c22;--ink:#e6ebf0;--soft:#93a0ad;--tool:#46566a;--steel:#2b343f;--hatch:#66788a;
--contact:#ff7b8a}}
.rt .paper{fill:var(--paper)}.rt .tool{fill:var(--tool);stroke:var(--ink)}.rt .holder{fill:url(#rt-hatch);stroke:var(--ink)}
.rt .edge{fill:none;stroke:var(--ink)}.rt .hidden{fill:none;stroke:var(--ink)}.rt .axis,.rt .line{fill:none;stroke:var(--soft)}
.rt .swept{fill:none;stroke:var(--contact)}.rt .cut{stroke:none}
.rt .arrow{fill:var(--soft)}.rt .contact{fill:none;stroke:var(--contact)}
.rt text{fill:var(--ink);font-family:system-ui,sans-serif;paint-order:stroke;
stroke:var(--paper);stroke-linejoin:round}
.rt .small{fill:var(--soft)}.rt .joint{fill:var(--contact)}
"""
#: Width of a character over the size of the letters, a little more than most fonts need.
_CHARACTER = 0.58
#: Characters of a line of words.
_LINE = 84


@dataclass(slots=True)
class _Sheet:
    """Elements in millimetres, axis at height 0, and how far they reach.

    `letters` [mm]: size of the letters; lines are a fraction of it
    """

    letters: float
    parts: list[str] = field(default_factory=list)
    texts: list[str] = field(default_factory=list)
    top: float = 0.0
    bottom: float = 0.0
    left: float = 0.0
    right: float = 0.0

    def reach(self, x: float, y: float) -> None:
        self.left, self.right = min(self.left, x), max(self.right, x)
        self.top, self.bottom = min(self.top, y), max(self.bottom, y)

    def polygon(self, kind: str, points: Sequence[tuple[float, float]], more: str = "") -> None:
        for x, y in points:
            self.reach(x, y)
        shown = " ".join(f"{_mm(x)},{_mm(y)}" for x, y in points)
        self.parts.append(f'<polygon class="{kind}" points="{shown}" stroke-width="{_mm(0.08 * self.letters)}"{more}/>')

    def polyline(self, kind: str, points: Sequence[tuple[float, float]]) -> None:
        for x, y in points:
            self.reach(x, y)
        shown = " ".join(f"{_mm(x)},{_mm(y)}" for x, y in points)
        self.parts.append(f'<polyline class="{kind}" points="{shown}" stroke-width="{_mm(0.16 * self.letters)}"/>')

    def line(self, kind: str, x1: float, y1: float, x2: float, y2: float, width: float = 0.05, dashes: Sequence[float] = ()) -> None:
        self.reach(x1, y1)
        self.reach(x2, y2)
        dashed = f' stroke-dasharray="{" ".join(_mm(d * self.letters) for d in dashes)}"' if dashes else ""
        place = f'x1="{_mm(x1)}" y1="{_mm(y1)}" x2="{_mm(x2)}" y2="{_mm(y2)}"'
        self.parts.append(f'<line class="{kind}" {place} stroke-width="{_mm(width * self.letters)}"{dashed}/>')

    def width_of(self, text: str, size: float = 1.0) -> float:
        return _CHARACTER * self.letters * size * len(text)

    def text(self, text: str, x: float, y: float, kind: str = "", anchor: str = "middle", size: float = 1.0) -> None:
        half = self.width_of(text, size) * {"middle": 0.5, "start": 1.0, "end": 1.0}[anchor]
        self.reach(x - half * (anchor != "start"), y - size * self.letters)
        self.reach(x + half * (anchor != "end"), y + 0.3 * self.letters)
        named = f' class="{kind}"' if kind else ""
        place = f'x="{_mm(x)}" y="{_mm(y)}" font-size="{_mm(size * self.letters)}" text-anchor="{anchor}"'
        # above all lines, with a rim of paper
        self.texts.append(f'<text{named} {place} stroke-width="{_mm(0.25 * self.letters)}">{_safe(text)}</text>')

    def dimensions(self, lengths: Sequence[tuple[str, float, float]], y: float) -> None:
        """A chain of lengths between two places each, with arrows; texts that do not fit stand below, in rows that keep them apart."""
        rows: list[float] = []
        for name, x1, x2 in lengths:
            self._arrows(x1, x2, y)
            text, middle = f"{name} {_figure(x2 - x1)}".strip(), 0.5 * (x1 + x2)
            if self.width_of(text) < x2 - x1:
                self.text(text, middle, y - 0.25 * self.letters)
            else:
                self.text(text, middle, y + 1.2 * (1 + _free_row(rows, middle, 0.5 * self.width_of(text))) * self.letters)

    def _arrows(self, x1: float, x2: float, y: float) -> None:
        self.line("line", x1, y, x2, y)
        head = min(0.7 * self.letters, 0.4 * (x2 - x1))
        for x, inward in ((x1, head), (x2, -head)):
            self.line("line", x, y - 0.5 * self.letters, x, y + 0.5 * self.letters)
            points = f"{_mm(x)},{_mm(y)} {_mm(x + inward)},{_mm(y - 0.18 * self.letters)} {_mm(x + inward)},{_mm(y + 0.18 * self.letters)}"
            self.parts.append(f'<polygon class="arrow" points="{points}"/>')


def tooling_svg(tooling: Tooling, brief: bool = False) -> str:
    """Return the drawing of a tooling as SVG text.

    Parameters
    ----------
    tooling : Tooling
    brief : bool
        With the stickout as its only words, in letters that read where the drawing is as small as a stamp.

    Notes
    -----
    The tip is on the left, the flange's face on the right. One unit is one millimetre, and printed at its own size the drawing is 1:1. The
    holder is cut open along the axis, the tool is not; where both touch the contact is coloured. Diameters stand above (outer)
    and below (bores), lengths below these.
    """
    assembly = tooling.assembly
    nose, tail = 1e3 * assembly.stickout, 1e3 * assembly.tool_length
    flange = nose + 1e3 * assembly.holder_length
    widest = max(1e3 * max(s.diameter, s.end) for s in (*assembly.tool, *assembly.holder))
    sheet = _Sheet(letters=max(flange, tail, 2.0 * widest) / (14.0 if brief else 52.0))
    tool, holder = list(_places(assembly.tool, 0.0)), list(_places(assembly.holder, nose))
    for x, segment in holder:
        _draw_holder(sheet, x, segment)
    for x, segment in holder:
        # what one sees of the bore's steps behind the tool
        end, bore = x + 1e3 * segment.length, 500.0 * segment.inner_diameter
        if bore > 0.0 and end > tail + 1e-6:
            sheet.line("edge", end, -bore, end, bore, 0.05)
    for x, segment in tool:
        _draw_tool(sheet, x, segment)
    first, cutter = assembly.tool[0], tooling.cutter
    if cutter.profile is not None:
        _draw_outline(sheet, cutter.profile, min(first.length, assembly.stickout))
    elif cutter.diameter > max(first.diameter, first.end):
        radius, end = 500.0 * cutter.diameter, min(1e3 * first.length, nose)
        outline = [(0.0, -radius), (end, -radius), (end, radius), (0.0, radius)]
        sheet.polygon("hidden", outline, _dashes(sheet, 0.5, 0.4))
    if assembly.contact is not None and assembly.insertion > 0.0:
        _draw_contact(sheet, tool, nose, tail)
    over = (0.4 if brief else 1.5) * sheet.letters
    sheet.line("axis", -over, 0.0, max(flange, tail) + over, 0.0, dashes=(2.0, 0.4, 0.3, 0.4))
    if brief:
        sheet.dimensions([("stickout", 0.0, nose)], sheet.bottom + sheet.letters)
        return _page(sheet, tooling, nose, flange, brief)
    _diameters(sheet, tooling, tool, holder, nose)
    _lengths(sheet, tool, holder, nose, tail, flange)
    if cutter.profile is not None:
        _detail(sheet, cutter.profile)
    return _page(sheet, tooling, nose, flange, brief)


def _places(segments: Sequence[BeamSegment], start: float) -> Iterator[tuple[float, BeamSegment]]:
    """Where each segment begins [mm]."""
    for segment in segments:
        yield start, segment
        start += 1e3 * segment.length


def _draw_holder(sheet: _Sheet, x: float, segment: BeamSegment) -> None:
    """The walls above and below the bore; without one the whole."""
    end, first, last = x + 1e3 * segment.length, 500.0 * segment.diameter, 500.0 * segment.end
    bore = 500.0 * segment.inner_diameter
    if bore == 0.0:
        sheet.polygon("holder", [(x, -first), (end, -last), (end, last), (x, first)])
        return
    for side in (-1.0, 1.0):
        sheet.polygon("holder", [(x, side * first), (end, side * last), (end, side * bore), (x, side * bore)])


def _draw_tool(sheet: _Sheet, x: float, segment: BeamSegment) -> None:
    end, first, last = x + 1e3 * segment.length, 500.0 * segment.diameter, 500.0 * segment.end
    sheet.polygon("tool", [(x, -first), (end, -last), (end, last), (x, first)])
    if segment.inner_diameter > 0.0:
        for side in (-500.0, 500.0):
            sheet.line("hidden", x, side * segment.inner_diameter, end, side * segment.inner_diameter, 0.08, (0.5, 0.4))


def _draw_outline(sheet: _Sheet, profile: Profile, most: float) -> None:
    """What the edges sweep over, as far as the fluted part goes [m]."""
    points = 1e3 * profile.outline(most)
    sheet.polygon("swept", [*((z, -r) for r, z in points.tolist()), *((z, r) for r, z in points[::-1].tolist())])


def _detail(sheet: _Sheet, profile: Profile) -> None:
    """The edge by itself, below everything else, enlarged; the axis runs to the right as it does above."""
    detail = edge_detail(profile, 16.0 * sheet.letters)
    places = detail.scale * (detail.points - np.array([detail.inside, 0.0]))
    base = sheet.bottom + 3.5 * sheet.letters + float(places[:, 0].max())
    end, low = float(places[-1, 1]), base + 0.6 * sheet.letters * (detail.inside > 0.0)
    edge = [(z, base - r) for r, z in places.tolist()]
    sheet.polygon("tool cut", [(0.0, low), *edge, (end, low)], ' stroke="none"')
    sheet.polyline("swept", edge)
    if detail.inside == 0.0:
        over = sheet.letters
        sheet.line("axis", -over, base, end + over, base, dashes=(2.0, 0.4, 0.3, 0.4))
    words = f"edge {_figure(detail.scale)}:1" if detail.scale >= 1.0 else f"edge 1:{_figure(1.0 / detail.scale)}"
    sheet.text(words, end + 2.0 * sheet.letters, base - 0.5 * float(places[:, 0].max()), "small", "start")


def _draw_contact(sheet: _Sheet, tool: Sequence[tuple[float, BeamSegment]], nose: float, tail: float) -> None:
    """The tool's surface inside of the holder."""
    for x, segment in tool:
        start, end = max(x, nose), x + 1e3 * segment.length
        if end <= start:
            continue
        slope = 500.0 * (segment.end - segment.diameter) / (end - x)
        radii = [500.0 * segment.diameter + slope * (place - x) for place in (start, min(end, tail))]
        for side in (-1.0, 1.0):
            sheet.line("contact", start, side * radii[0], min(end, tail), side * radii[1], 0.3)


def _diameters(
    sheet: _Sheet, tooling: Tooling, tool: Sequence[tuple[float, BeamSegment]], holder: Sequence[tuple[float, BeamSegment]], nose: float
) -> None:
    """Outer diameters above with leaders to their segments, bores below."""
    outer, bores = [], []
    for x, segment in tool:
        middle = 0.5 * (x + min(x + 1e3 * segment.length, nose))
        if x < nose:
            outer.append((middle, 250.0 * (segment.diameter + segment.end), _diameter(segment)))
        if segment.inner_diameter > 0.0 and x < nose:
            bores.append((middle, 500.0 * segment.inner_diameter, f"Ø{_figure(1e3 * segment.inner_diameter)}"))
    for x, segment in holder:
        outer.append((x + 500.0 * segment.length, 250.0 * (segment.diameter + segment.end), _diameter(segment)))
    for bore, run in groupby(holder, key=lambda each: each[1].inner_diameter):
        # one bore through several segments has one label
        steps = list(run)
        if bore > 0.0:
            middle = 0.5 * (steps[0][0] + steps[-1][0] + 1e3 * steps[-1][1].length)
            bores.append((middle, 500.0 * bore, f"Ø{_figure(1e3 * bore)}"))
    if 1e3 * tooling.cutter.diameter > 1e3 * max(tooling.assembly.tool[0].diameter, tooling.assembly.tool[0].end):
        outer.insert(0, (0.0, 500.0 * tooling.cutter.diameter, f"cutting Ø{_figure(1e3 * tooling.cutter.diameter)}"))
    _labels(sheet, outer, sheet.top - sheet.letters, -1.0)
    _labels(sheet, bores, sheet.bottom + 1.6 * sheet.letters, 1.0)


def _labels(sheet: _Sheet, labels: Sequence[tuple[float, float, str]], level: float, side: float) -> None:
    """Texts in as few rows as keep them apart, each with a leader to its surface at (x, radius)."""
    rows: list[float] = []
    for x, radius, text in sorted(labels):
        y = level + side * 1.5 * _free_row(rows, x, 0.5 * sheet.width_of(text) + 0.4 * sheet.letters) * sheet.letters
        sheet.line("line", x, side * radius, x, y + (0.3 if side < 0 else -1.0) * sheet.letters)
        sheet.text(text, x, y)


def _lengths(
    sheet: _Sheet,
    tool: Sequence[tuple[float, BeamSegment]],
    holder: Sequence[tuple[float, BeamSegment]],
    nose: float,
    tail: float,
    flange: float,
) -> None:
    y = sheet.bottom + 2.0 * sheet.letters
    chains = [
        [("", x, x + 1e3 * s.length) for x, s in tool] if len(tool) > 1 else [],
        [("", x, x + 1e3 * s.length) for x, s in holder] if len(holder) > 1 else [],
        [("stickout", 0.0, nose), ("insertion", nose, tail)] if tail > nose else [("stickout", 0.0, nose)],
        [("holder", nose, flange)],
        [("tip to flange", 0.0, flange)],
    ]
    for chain in chains:
        if not chain:
            continue
        sheet.dimensions(chain, y)
        y = max(y + 1.9 * sheet.letters, sheet.bottom + 1.5 * sheet.letters)


def _page(sheet: _Sheet, tooling: Tooling, nose: float, flange: float, brief: bool) -> str:
    cutter, assembly = tooling.cutter, tooling.assembly
    teeth = f"{cutter.teeth} teeth" if cutter.teeth > 1 else "1 tooth"
    helix = "/".join(_figure(angle) for angle in np.degrees(np.atleast_1d(cutter.helix)).tolist())
    words = f"{teeth}, Ø{_figure(1e3 * cutter.diameter)}, helix {helix}°"
    words += "" if cutter.shape is CutterShape.FLAT else f", shape {cutter.shape}"
    words += f", corner radius {_figure(1e3 * cutter.corner_radius)}" if cutter.corner_radius else ""
    told = ((name.replace("_", " "), in_files(name, value), "°" * (name in ANGLES)) for name, value in cutter.dimensions.told.items())
    words += "".join(f", {name} {_figure(value)}{unit}" for name, value, unit in told)
    words += "" if cutter.serration is None else f", {cutter.serration}"
    scale = "millimetres, 1:1"
    contact = assembly.contact
    joined = "tool and holder joined rigidly"
    if contact is not None:
        stiffness = f"{1e-9 * contact.translational_stiffness:.3g} GN/m, {1e-6 * contact.rotational_stiffness:.3g} MN m/rad"
        joined = f"contact {stiffness} per m of insertion"
    if not brief:
        lines = wrap(f"{words}; {scale}", _LINE)
        left, y = sheet.left, sheet.top - (4.0 + 1.6 * len(lines)) * sheet.letters
        sheet.text(tooling.name, left, y, anchor="start", size=1.5)
        for k, line in enumerate(lines):
            sheet.text(line, left, y + (1.9 + 1.6 * k) * sheet.letters, "small", "start")
        below = (1.9 + 1.6 * len(lines)) * sheet.letters
        sheet.text(joined, left, y + below, "small" if contact is None else "joint", "start")
    margin = (0.4 if brief else 1.5) * sheet.letters
    x, top = sheet.left - margin, sheet.top - margin
    width, height = sheet.right - sheet.left + 2.0 * margin, sheet.bottom - sheet.top + 2.0 * margin
    box = f"{_mm(x)} {_mm(top)} {_mm(width)} {_mm(height)}"
    stick, bored = _figure(nose), _figure(1e3 * assembly.insertion)
    described = f"{words}, stickout {stick} mm, insertion {bored} mm, {_figure(flange)} mm from tip to flange, {joined}"
    step = _mm(0.8 * sheet.letters)
    hatch = (
        f'<pattern id="rt-hatch" width="{step}" height="{step}" patternUnits="userSpaceOnUse" patternTransform="rotate(45)">'
        f'<rect width="{step}" height="{step}" style="fill:var(--steel)"/>'
        f'<line x1="0" y1="0" x2="0" y2="{step}" style="stroke:var(--hatch)" stroke-width="{_mm(0.1 * sheet.letters)}"/></pattern>'
    )
    parts = [
        f'<svg xmlns="http://www.w3.org/2000/svg" class="rt" role="img" width="{_mm(width)}mm" height="{_mm(height)}mm" viewBox="{box}">',
        f"<title>{_safe(tooling.name)}</title>",
        f"<desc>{_safe(described)}</desc>",
        f"<style>{_STYLE.strip()}</style>",
        f"<defs>{hatch}</defs>",
        f'<rect class="paper" x="{_mm(x)}" y="{_mm(top)}" width="{_mm(width)}" height="{_mm(height)}"/>',
        *sheet.parts,
        *sheet.texts,
        "</svg>",
    ]
    return "\n".join(parts) + "\n"


def _free_row(rows: list[float], x: float, half: float) -> int:
    """The first row where a text around `x` meets no other; `rows` holds where each row ends, the texts come from left to right."""
    row = next((i for i, end in enumerate(rows) if end <= x - half), len(rows))
    rows[row : row + 1] = [x + half]
    return row


def _diameter(segment: BeamSegment) -> str:
    first, last = _figure(1e3 * segment.diameter), _figure(1e3 * segment.end)
    return f"Ø{first}" if first == last else f"Ø{first}–{last}"


def _figure(value: float) -> str:
    """Millimetres as a drawing has them: no more than hundredths."""
    return f"{value:.2f}".rstrip("0").rstrip(".")


def _mm(value: float) -> str:
    text = f"{value:.4f}".rstrip("0").rstrip(".")
    return "0" if text == "-0" else text


def _dashes(sheet: _Sheet, *dashes: float) -> str:
    return f' stroke-dasharray="{" ".join(_mm(d * sheet.letters) for d in dashes)}"'


def _safe(text: str) -> str:
    """Text that XML takes: marks as entities, signs that it has no place for as blanks."""
    return escape("".join(sign if sign.isprintable() else " " for sign in text))


class EdgeDetail(NamedTuple):
    """A part of an outline.

    `points` [mm], shape (n, 2): r and z, from the tip up
    `inside` [mm]: radius at which the view is cut off towards the axis; 0 is the axis
    `scale`: how many times it is drawn larger
    """

    points: FloatArray
    inside: float
    scale: float


def edge_detail(profile: Profile, room: float) -> EdgeDetail:
    """Return the part of an outline that is to be shown, so large that it fills about a square of `room` [mm]."""
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
