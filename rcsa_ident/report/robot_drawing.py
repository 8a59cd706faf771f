"""An arm at a posture to scale, seen at an angle and from the side; SVG whose unit is the millimetre of the arm."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from html import escape
from textwrap import wrap

import numpy as np

from rcsa_ident.base.arrays import FloatArray
from rcsa_ident.machine.robot.kinematics import posed, tool_point_at
from rcsa_ident.machine.robot.model import RobotModel
from rcsa_ident.report.robot_view import Part, PartKind, View, arm_parts, placed, reach_of
from rcsa_ident.tool_holder.geometry import ToolAssembly

#: Drawn on a paper of its own, so that it reads on a light page and on a dark one.
_STYLE = """
.ra{--paper:#fff;--ink:#1b2430;--soft:#6b7783;--grid:#dfe4ea;--ground:#f4f6f8;--plate:#aeb9c4;--limb:#dd7a2c;--lit:#f3a864;--joint:#49545f;
--cap:#73808d;--spindle:#8f9cab;--shine:#c2ccd6;--tool:#c9d3de;--path:#0b5c86;--x:#c23b3b;--y:#2c8a4b;--z:#2f62b8;--bad:#b3261e}
@media (prefers-color-scheme:dark){.ra{--paper:#161c22;--ink:#e6ebf0;--soft:#93a0ad;--grid:#2b343f;--ground:#1b232b;--plate:#4d5a68;
--limb:#c96f2a;--lit:#e59a5a;--joint:#7a8896;--cap:#9aa7b4;--spindle:#66788a;--shine:#8fa0b0;--tool:#9aa9b8;--path:#5fb8e6;--x:#ff7b72;
--y:#5ec27f;--z:#79a8ff;--bad:#ff8a80}}
.ra .paper{fill:var(--paper)}.ra .ground{fill:var(--ground);stroke:var(--soft)}.ra .grid{stroke:var(--grid);fill:none}
.ra .shadow{opacity:.1}.ra .dark{fill:none;stroke:var(--ink)}.ra .plate{fill:var(--plate);stroke:var(--ink)}
.ra .rim{fill:none;stroke:var(--ink)}.ra .limb{fill:none;stroke:var(--limb)}.ra .lit{fill:none;stroke:var(--lit)}
.ra .spindle{fill:none;stroke:var(--spindle)}.ra .shine{fill:none;stroke:var(--shine)}
.ra .joint{fill:var(--joint);stroke:var(--ink)}.ra .cap{fill:var(--cap);stroke:var(--ink)}
.ra .tool{fill:var(--tool);stroke:var(--ink)}.ra .face{fill:var(--shine);stroke:var(--ink)}
.ra .axis{fill:none;stroke:var(--ink)}.ra .head{fill:var(--ink);stroke:none}.ra .path{fill:none;stroke:var(--path)}
.ra .end{fill:var(--path);stroke:var(--paper)}.ra .ghost{opacity:.22}.ra .bar{stroke:var(--ink);fill:none}
.ra .x{stroke:var(--x)}.ra .y{stroke:var(--y)}.ra .z{stroke:var(--z)}.ra .fx{fill:var(--x)}.ra .fy{fill:var(--y)}.ra .fz{fill:var(--z)}
.ra text{fill:var(--ink);font-family:system-ui,sans-serif;paint-order:stroke;stroke:var(--paper);stroke-linejoin:round}
.ra .small{fill:var(--soft)}.ra .bad{fill:var(--bad)}.ra .pathname{fill:var(--path)}
.ra text.fx{fill:var(--x)}.ra text.fy{fill:var(--y)}.ra text.fz{fill:var(--z)}
"""
#: Where one stands who looks at an arm from an angle: azimuth from the base's x, and elevation [deg].
AT_AN_ANGLE = (-58.0, 22.0)
#: Half of the base plate's side and its thickness, and how far the ground goes on behind the arm, over the reach.
_PLATE, _PLATE_HEIGHT, _AROUND = 0.12, 0.018, 0.12
#: Of the paper [mm].
_WIDTH = 297.0
#: Width of a character over the size of the letters, and characters of a line of words.
_CHARACTER, _LINE = 0.56, 96
#: Points that a path is drawn with at most.
_MOST_POINTS = 2000


@dataclass(slots=True)
class _Sheet:
    """Elements of one view, in millimetres with y downwards, and how far they reach."""

    view: View
    letters: float
    parts: list[str] = field(default_factory=list)
    texts: list[str] = field(default_factory=list)
    low: FloatArray = field(default_factory=lambda: np.full(2, np.inf))
    high: FloatArray = field(default_factory=lambda: np.full(2, -np.inf))

    def flat(self, points: FloatArray) -> FloatArray:
        """Points (..., 3) [m] on the paper."""
        return self.view.seen(points)[..., :2] * np.array([1e3, -1e3])

    def reach(self, points: FloatArray, around: float = 0.0) -> None:
        self.low = np.minimum(self.low, np.min(points, axis=0) - around)
        self.high = np.maximum(self.high, np.max(points, axis=0) + around)

    def shape(self, name: str, kind: str, points: FloatArray, width: float, more: str = "") -> None:
        """A polygon or polyline through points on the paper."""
        self.reach(points, 0.5 * width)
        shown = " ".join(f"{_figure(x)},{_figure(y)}" for x, y in points)
        self.parts.append(f'<{name} class="{kind}" points="{shown}" stroke-width="{_figure(width)}"{more}/>')

    def text(self, text: str, x: float, y: float, kind: str = "", anchor: str = "start", size: float = 1.0) -> None:
        wide = _CHARACTER * self.letters * size * len(text)
        left = x - wide * {"start": 0.0, "middle": 0.5, "end": 1.0}[anchor]
        self.reach(np.array([[left, y - size * self.letters], [left + wide, y + 0.3 * self.letters]]))
        named = f' class="{kind}"' if kind else ""
        place = f'x="{_figure(x)}" y="{_figure(y)}" font-size="{_figure(size * self.letters)}" text-anchor="{anchor}"'
        self.texts.append(f'<text{named} {place} stroke-width="{_figure(0.22 * self.letters)}">{_safe(text)}</text>')


def arm_svg(
    robot: RobotModel,
    angles: FloatArray,
    assembly: ToolAssembly | None = None,
    path: FloatArray | None = None,
    ghosts: Sequence[FloatArray] = (),
    at_an_angle: tuple[float, float] = AT_AN_ANGLE,
) -> str:
    """Return the picture of an arm at a posture as SVG text: at an angle, and from the side that shows more of it.

    Parameters
    ----------
    robot : RobotModel
    angles : array, shape (j,) [rad]
    assembly : ToolAssembly or None
        Tool-holder and tool at the tool point.
    path : array, shape (k, 3) [m], optional
        Where a tip goes.
    ghosts : sequence of arrays, shape (j,) [rad]
        Further postures, drawn lightly.
    at_an_angle : (float, float) [deg]
        Azimuth from the base's x, and elevation of who looks.

    Notes
    -----
    One unit is a millimetre of the arm, the paper is as wide as a sheet of A4. Limbs and joints are as thick as the arm's reach lets
    expect: drawings of the links are not known.
    """
    angles = robot.posture(angles)
    shapes = arm_parts(robot, assembly)
    arms = [placed(robot, shapes, robot.posture(each)) for each in (*ghosts, angles)]
    path = None if path is None or not len(path) else path[:: max(len(path) // _MOST_POINTS, 1)]
    every = np.concatenate([p.points for arm in arms for p in arm] + ([] if path is None else [path]))
    wide = np.ptp(every, axis=0)
    side, words = (-90.0, "x to the right, z up") if wide[0] >= wide[1] else (0.0, "y to the right, z up")
    reach = reach_of(robot)
    letters = 1e3 * reach / 44.0
    sheets = [_Sheet(View.from_angles(*at_an_angle), letters), _Sheet(View.from_angles(side, 0.0), letters)]
    for sheet in sheets:
        low, high = _ground(sheet, every, reach)
        _shadow(sheet, arms[-1], float(low[2]))
        for arm in arms[:-1]:
            sheet.parts.append('<g class="ghost">')
            _arm(sheet, arm)
            sheet.parts.append("</g>")
        if path is not None:
            _path(sheet, path)
        _arm(sheet, arms[-1])
        _axes_of_joints(sheet, robot, angles, arms[-1])
        _world(sheet, np.array([high[0] if sheet.view.axes[0, 0] < 0.0 else low[0], low[1], low[2]]), reach)
        _gravity(sheet, robot, reach)
    _scale(sheets[0], reach)
    sheets[1].text(words, float(sheets[1].low[0]), float(sheets[1].high[1]) + 1.4 * letters, "small", size=0.85)
    return _page(sheets, robot, angles)


def _ground(sheet: _Sheet, every: FloatArray, reach: float) -> tuple[FloatArray, FloatArray]:
    """The plane that the base stands on with a grid, and the base plate; two corners of the plane."""
    around = _AROUND * reach
    low = np.minimum(np.min(every, axis=0)[:2], -_PLATE * reach) - around
    high = np.maximum(np.max(every, axis=0)[:2], _PLATE * reach) + around
    floor = -_PLATE_HEIGHT * reach
    corners = np.array([[x, y, floor] for x, y in ((low[0], low[1]), (high[0], low[1]), (high[0], high[1]), (low[0], high[1]))])
    thin = 0.05 * sheet.letters
    sheet.shape("polygon", "ground", sheet.flat(corners), thin)
    step = _round_length(0.25 * reach)
    for k in (0, 1):
        for value in np.arange(np.ceil(low[k] / step), np.floor(high[k] / step) + 1.0) * step:
            ends = np.full((2, 3), floor)
            ends[:, k], ends[:, 1 - k] = value, [low[1 - k], high[1 - k]]
            sheet.shape("polyline", "grid", sheet.flat(ends), thin)
    half = _PLATE * reach
    square = np.array([[-half, -half], [half, -half], [half, half], [-half, half]])
    block = np.array([[x, y, z] for x, y in square for z in (floor, 0.0)])
    sheet.shape("polygon", "plate", _hull(sheet.flat(block)), 1.4 * thin)
    sheet.shape("polygon", "plate", sheet.flat(np.column_stack([square, np.zeros(4)])), 1.4 * thin)
    return np.array([*low, floor]), np.array([*high, floor])


def _shadow(sheet: _Sheet, arm: Sequence[Part], floor: float) -> None:
    """Of the arm, straight below it, where the ground is seen from above."""
    if sheet.view.axes[2, 2] < 0.05:
        return
    sheet.parts.append('<g class="shadow">')
    for part in arm:
        down = np.column_stack([part.points[:, :2], np.full(len(part.points), floor)])
        sheet.shape("polyline", "dark", sheet.flat(down), 1.7e3 * part.radius, ' stroke-linecap="round" stroke-linejoin="round"')
    sheet.parts.append("</g>")


def _arm(sheet: _Sheet, arm: Sequence[Part]) -> None:
    """All parts, from the farthest to the nearest one."""
    near = {id(part): float(np.mean(sheet.view.seen(part.points)[:, 2])) for part in arm}
    for part in arm:
        axis = part.points[-1] - part.points[0]
        if part.kind is PartKind.JOINT and abs(axis @ sheet.view.axes[2]) < 0.5 * np.linalg.norm(axis):
            # seen from its side a joint hides the ends of both of its links
            beside = [near[id(p)] for p in arm if p.kind is PartKind.LIMB and part.carrier - p.carrier in (0, 1)]
            near[id(part)] = max(near[id(part)], *beside) + 1e-9
    for part in sorted(arm, key=lambda each: near[id(each)]):
        if part.kind in (PartKind.LIMB, PartKind.SPINDLE):
            _limb(sheet, part)
        else:
            _cylinder(sheet, part)


def _limb(sheet: _Sheet, part: Part) -> None:
    points, width, rim = sheet.flat(part.points), 2e3 * part.radius, 0.16 * sheet.letters
    body, light = ("limb", "lit") if part.kind is PartKind.LIMB else ("spindle", "shine")
    ends = ' stroke-linecap="round" stroke-linejoin="round"'
    sheet.shape("polyline", "rim", points, width + rim, ends)
    sheet.shape("polyline", body, points, width - rim, ends)
    sheet.shape("polyline", light, points - 0.17 * width, 0.22 * width, ends)


def _cylinder(sheet: _Sheet, part: Part) -> None:
    """A cylinder with flat ends, the nearer one in front."""
    first, last = part.points[0], part.points[-1]
    axis = (last - first) / np.linalg.norm(last - first)
    across = np.cross(axis, sheet.view.axes[2])
    across = sheet.view.axes[0] if np.linalg.norm(across) < 1e-9 else across / np.linalg.norm(across)
    turn = np.linspace(0.0, 2.0 * np.pi, 33)[:-1]
    circle = part.radius * (np.outer(np.cos(turn), across) + np.outer(np.sin(turn), np.cross(axis, across)))
    body, cap = {PartKind.JOINT: ("joint", "cap"), PartKind.BASE: ("plate", "face")}.get(part.kind, ("tool", "face"))
    rim = 0.07 * sheet.letters
    rings = [sheet.flat(end + circle) for end in (first, last)]
    sheet.shape("polygon", body, _hull(np.concatenate(rings)), rim)
    near = rings[int(axis @ sheet.view.axes[2] > 0.0)]
    if abs(axis @ sheet.view.axes[2]) > 0.02:
        sheet.shape("polygon", cap, near, rim)


def _axes_of_joints(sheet: _Sheet, robot: RobotModel, angles: FloatArray, arm: Sequence[Part]) -> None:
    """Each joint's axis with a head where it points, and its name beside it."""
    chain = posed(robot, angles)
    joints = [part for part in arm if part.kind is PartKind.JOINT]
    thin, taken = 0.09 * sheet.letters, np.empty((0, 2))
    middle = np.mean(sheet.flat(chain.origin), axis=0)
    for joint, origin, axis, part in zip(robot.joints, chain.origin, chain.direction, joints, strict=True):
        half = 2.1 * part.radius
        ends = sheet.flat(origin + np.outer([-half, half], axis))
        sheet.shape("polyline", "axis", ends, thin, f' stroke-dasharray="{_dashes(sheet, 1.1, 0.3, 0.2, 0.3)}"')
        _head(sheet, "head", ends[0], ends[1], 0.55 * sheet.letters)
        # the name stands where none stands yet, outwards from the arm
        centre, best, most = sheet.flat(origin), ends[1], -np.inf
        away = centre - middle
        for turn in np.linspace(0.0, 2.0 * np.pi, 17)[:-1]:
            step = np.array([np.cos(turn), np.sin(turn)])
            place = centre + (1e3 * part.radius + 1.1 * sheet.letters) * 1.25 * step
            free = min(float(np.min(np.linalg.norm(taken - place, axis=1), initial=np.inf)), 3.0 * sheet.letters)
            worth = free + 0.6 * sheet.letters * float(step @ away) / (float(np.linalg.norm(away)) + 1e-9)
            clear = min(float(np.min(np.linalg.norm(ends - place, axis=1))), 1.5 * sheet.letters)
            if worth + clear > most:
                best, most = place, worth + clear
        taken = np.vstack([taken, best])
        sheet.text(joint.name, best[0], best[1] + 0.35 * sheet.letters, anchor="middle", size=0.95)


def _path(sheet: _Sheet, path: FloatArray) -> None:
    points = sheet.flat(path)
    sheet.shape("polyline", "path", points, 0.3 * sheet.letters, ' stroke-linejoin="round" stroke-linecap="round"')
    for name, place in (("begin", points[0]), ("end", points[-1])):
        x, y = place
        radius = _figure(0.32 * sheet.letters)
        sheet.parts.append(
            f'<circle class="end" cx="{_figure(x)}" cy="{_figure(y)}" r="{radius}" stroke-width="{_figure(0.08 * sheet.letters)}"/>'
        )
        sheet.text(name, x + 0.6 * sheet.letters, y + (1.3 if name == "begin" else -0.6) * sheet.letters, "pathname", size=0.85)


def _world(sheet: _Sheet, corner: FloatArray, reach: float) -> None:
    """The base's axes, at a corner of the ground that the arm leaves free."""
    length = 0.13 * reach
    for name, axis in zip("xyz", np.eye(3), strict=True):
        ends = sheet.flat(corner + np.outer([0.0, length], axis))
        if np.linalg.norm(ends[1] - ends[0]) < 50.0 * length:
            continue
        sheet.shape("polyline", name, ends, 0.16 * sheet.letters, ' fill="none"')
        _head(sheet, f"f{name}", ends[0], ends[1], 0.6 * sheet.letters)
        onward = ends[1] + (ends[1] - ends[0]) / np.linalg.norm(ends[1] - ends[0]) * 0.9 * sheet.letters
        sheet.text(name, onward[0], onward[1] + 0.35 * sheet.letters, f"f{name}", "middle")


def _gravity(sheet: _Sheet, robot: RobotModel, reach: float) -> None:
    """Which way weight pulls, where it is not straight down in the base's axes."""
    size = float(np.linalg.norm(robot.gravity))
    if size == 0.0 or robot.gravity[2] < -(1.0 - 1e-9) * size:
        return
    start = np.array([-0.3, -0.3, 0.5]) * reach
    ends = sheet.flat(np.stack([start, start + 0.2 * reach * robot.gravity / size]))
    sheet.shape("polyline", "axis", ends, 0.16 * sheet.letters)
    _head(sheet, "head", ends[0], ends[1], 0.6 * sheet.letters)
    sheet.text("weight", ends[1][0], ends[1][1] + 1.2 * sheet.letters, "small", "middle", 0.85)


def _head(sheet: _Sheet, kind: str, start: FloatArray, end: FloatArray, size: float) -> None:
    """An arrow's head where a line ends."""
    step = end - start
    length = float(np.linalg.norm(step))
    if length < 1.5 * size:
        return
    along = step / length
    across = np.array([-along[1], along[0]])
    sheet.shape(
        "polygon",
        kind,
        np.array(
            [end + 0.5 * size * along, end - 0.5 * size * along + 0.33 * size * across, end - 0.5 * size * along - 0.33 * size * across]
        ),
        0.0,
    )


def _scale(sheet: _Sheet, reach: float) -> None:
    length, (x, y) = 1e3 * _round_length(0.25 * reach), (float(sheet.low[0]), float(sheet.high[1]) + 1.6 * sheet.letters)
    tick = 0.4 * sheet.letters
    line = np.array([[x, y - tick], [x, y], [x + length, y], [x + length, y - tick]])
    sheet.shape("polyline", "bar", line, 0.14 * sheet.letters)
    sheet.text(f"{length:g} mm, as the grid's squares", x + length + 0.7 * sheet.letters, y, "small", size=0.85)


def _page(sheets: Sequence[_Sheet], robot: RobotModel, angles: FloatArray) -> str:
    letters, gap = sheets[0].letters, 2.0 * sheets[0].letters
    place = tool_point_at(robot, angles)
    told = ", ".join(f"{joint.name} {_degrees(angle)}" for joint, angle in zip(robot.joints, np.degrees(angles), strict=True))
    where = ", ".join(f"{1e3 * v + 0.0:.1f}" for v in place.offset)
    wrong = robot.beyond_limits(angles)
    lines = [(line, "small") for line in wrap(f"posture {told}", _LINE)]
    lines += [(f"tool point at {where} mm, base's axes", "small"), *((text, "bad") for text in wrong)]
    high = max(float(s.high[1]) for s in sheets)
    top = min(float(s.low[1]) for s in sheets) - (2.6 + 1.5 * len(lines)) * letters
    left = [0.0, float(sheets[0].high[0] - sheets[0].low[0]) + gap]
    head = _Sheet(sheets[0].view, letters)
    head.text(robot.name, 0.0, top + 1.3 * letters, size=1.6)
    for k, (line, kind) in enumerate(lines):
        head.text(line, 0.0, top + (3.1 + 1.5 * k) * letters, kind)
    width = max(left[1] + float(sheets[1].high[0] - sheets[1].low[0]), float(head.high[0]))
    margin = 1.5 * letters
    box = (-margin, top - margin, width + 2.0 * margin, high - top + 2.0 * margin)
    shown = " ".join(_figure(v) for v in box)
    size = f'width="{_WIDTH:g}mm" height="{_figure(_WIDTH * box[3] / box[2])}mm"'
    parts = [
        f'<svg xmlns="http://www.w3.org/2000/svg" class="ra" role="img" {size} viewBox="{shown}">',
        f"<title>{_safe(robot.name)}</title>",
        f"<desc>{_safe(f'{told}; tool point at {where} mm of the base')}</desc>",
        f"<style>{_STYLE.strip()}</style>",
        '<rect class="paper" x="{}" y="{}" width="{}" height="{}"/>'.format(*map(_figure, box)),
        *head.texts,
    ]
    for sheet, start in zip(sheets, left, strict=True):
        # both views have the base's height in common
        parts += [f'<g transform="translate({_figure(start - float(sheet.low[0]))} 0)">', *sheet.parts, *sheet.texts, "</g>"]
    return "\n".join([*parts, "</svg>"]) + "\n"


def _hull(points: FloatArray) -> FloatArray:
    """The convex outline of points on the paper, shape (k, 2)."""
    order = sorted(map(tuple, points.tolist()))

    def chain(row: Sequence[tuple[float, float]]) -> list[tuple[float, float]]:
        kept: list[tuple[float, float]] = []
        for p in row:
            while len(kept) > 1 and (kept[-1][0] - kept[-2][0]) * (p[1] - kept[-2][1]) <= (kept[-1][1] - kept[-2][1]) * (
                p[0] - kept[-2][0]
            ):
                kept.pop()
            kept.append(p)
        return kept[:-1]

    return np.array([*chain(order), *chain(order[::-1])])


def _round_length(about: float) -> float:
    """The length of 1, 2 or 5 times a power of ten nearest below one."""
    power = 10.0 ** np.floor(np.log10(about))
    return float(power * max(step for step in (1.0, 2.0, 5.0) if step * power <= about * (1.0 + 1e-9)))


def _degrees(angle: float) -> str:
    return f"{angle + 0.0:.2f}".rstrip("0").rstrip(".").replace("-", "\u2212") + "°"


def _dashes(sheet: _Sheet, *dashes: float) -> str:
    return " ".join(_figure(d * sheet.letters) for d in dashes)


def _figure(value: float) -> str:
    text = f"{value:.2f}".rstrip("0").rstrip(".")
    return "0" if text == "-0" else text


def _safe(text: str) -> str:
    """Text that XML takes: marks as entities, signs that it has no place for as blanks."""
    return escape("".join(sign if sign.isprintable() else " " for sign in text))
