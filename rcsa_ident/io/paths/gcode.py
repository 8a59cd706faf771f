"""G-code of milling machines: the places that a program leads to, arcs as chords; what is not understood is refused by its line."""

from __future__ import annotations

import io
import math
import re
from array import array
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from rcsa_ident.base.arrays import FloatArray
from rcsa_ident.base.errors import InputError, positive
from rcsa_ident.base.remarks import Remark
from rcsa_ident.base.units import from_rpm, to_rpm
from rcsa_ident.io.files import MEGABYTE, read_bytes, write_text
from rcsa_ident.io.paths.gcode_blocks import CORNERS, FURTHER, KINDS, ROTARY, block_of, check_further, words_of
from rcsa_ident.io.paths.gcode_cycles import MOST_REPEATS, Corner, Cycle
from rcsa_ident.io.text_columns import decoded
from rcsa_ident.signals.verdict import RecordCode, assumed
from rcsa_ident.toolpath.arcs import centre_of, chord_count, chords, turned
from rcsa_ident.toolpath.path import RAPID, ToolPath

LARGEST_PROGRAM = 100 * MEGABYTE
#: Places that a program may lead to, chords of arcs counted; and lines that it may have.
MOST_PLACES = 2_000_000
_INCH = 25.4
#: Heights that differ by less are one [mm]: corrections lift places.
_LEVEL = 1.0
#: M words that end a program, and those that act behind the move of their line.
_ENDS, _BEHIND = (2, 30), (0, 1, 5, 9, 60)

_PLANES = {17: (0, 1, 2), 18: (2, 0, 1), 19: (1, 2, 0)}
_AXES, _OFFSETS = "XYZ", "IJK"
_HEIDENHAIN = re.compile(r"^\s*\d*\s*BEGIN PGM", re.MULTILINE | re.IGNORECASE)
_PECKED = "G83 comes back to the depth that it has drilled: the control's own clearance is taken for 0"
_LEFT = "the program ends in line {}: line {} and those behind it are not read"


def read_gcode(path: str | Path, tolerance: float = 1e-6) -> ToolPath:
    """Return the path of a program's tool tip.

    G0 to G3 (arcs by I, J, K or R, full circles, helices of several turns) in the planes of G17 to G19, millimetres or inches, absolute or
    incremental, with F, S, T, M3 to M6, canned cycles and rounded corners. M2, M30 and ``%`` end it; what stands behind is remarked. The
    first place is where all axes are told, whatever moved before; a program begins at its zero where its first feed move needs a place that
    nobody told. G28, G30 and G53 lead where nobody knows: Z stands from there on at the highest that the program tells anywhere, X and Y
    where they were, until they are told next; a rapid move that tells Z again goes across first, then down.

    `tolerance` [m]: between arcs and their chords
    Raises `InputError`, which names file and line, for all that would change the path and is not understood: radius correction, macros,
        subprograms, further axes that move, a change of the work coordinates.
    """
    return gcode_of(decoded(read_bytes(path, "program", LARGEST_PROGRAM), "program", str(path)), str(path), tolerance)


def gcode_of(text: str, where: str, tolerance: float = 1e-6) -> ToolPath:
    """Return the path of a program's text, as `read_gcode` does of a file; `where` is named in the messages.

    Examples
    --------
    >>> path = gcode_of("G21 G90 G0 X0 Y0 Z0\\nG1 X90 F3000\\nG91 Y30", "PATH.nc")
    >>> path.length, path.line.tolist()
    (0.12, [1, 2, 3])
    """
    if _HEIDENHAIN.search(text[:1000]):
        raise InputError("program", "a program in Heidenhain's plain text", "G-code: the CAM system writes it for DIN/ISO", where)
    program = _Program(positive("tolerance", tolerance, "m"))
    ended = 0
    for number, block in _blocks(text, where):
        try:
            if block == "%" or program.run(block, number):
                ended = number
                break
        except InputError as error:
            raise error.at(f"{where} line {number}") from None
    if ended:
        behind = next((i for i, line in enumerate(io.StringIO(text), start=1) if i > ended and line.strip(" \t\r\n%")), 0)
        if behind:
            program.remarks.append(Remark(RecordCode.ASSUMED, _LEFT.format(ended, behind)))
    return program.path(where)


def _blocks(text: str, where: str) -> Iterator[tuple[int, str]]:
    """Number and words of each line that says something, and the ``%`` that ends the tape."""
    begun = False
    for number, line in enumerate(io.StringIO(text), start=1):
        try:
            if number > MOST_PLACES:
                raise InputError("lines", f"more than {MOST_PLACES}", f"at most {MOST_PLACES}")
            block = block_of(line)
        except InputError as error:
            raise error.at(f"{where} line {number}") from None
        if block and (begun or block != "%"):
            begun = True
            yield number, block
            if block == "%":
                return


class Kept(NamedTuple):
    """Words of a program's line that move nothing. `after`: whether they act behind the line's move."""

    line: int
    after: bool
    text: str


def kept_words(path: str | Path) -> tuple[list[Kept], list[int]]:
    """Return what a program says beside its moves, and the lines that lead where nobody knows (G28, G30, G53).

    Work coordinates, corrections of the tool's length, smoothing, dwells, tools, speeds, coolant, stops and further M words; with them
    `write_gcode` writes a program of another path.

    `path`: of a program that `read_gcode` reads
    """
    kept, led, unit, cycle = [], [], 1.0, False
    for number, block in _blocks(decoded(read_bytes(path, "program", LARGEST_PROGRAM), "program", str(path)), str(path)):
        if block == "%":
            break
        codes, told, words = words_of(block)
        cycle = told["cycle"] != 80 if "cycle" in told else cycle and "motion" not in told
        unit = {20.0: _INCH, 21.0: 1.0}.get(told.get("unit", 0.0), unit)
        if told.get("single") in (28, 30, 53):
            led.append(number)
        said = [f"G{code:g}" for code in codes["G"] if KINDS[code] in ("told", "system") or code in (4, 80)]
        # tolerances are lengths, further numbers are none
        size = unit if 64 in codes["G"] or 61 in codes["G"] else 1.0
        # P and Q belong to what is said, or to moves: to cycles and turns of arcs
        spoken = not cycle and bool(codes["M"] or set(said) - {"G80"})
        letters = "XPSF" if told.get("single") == 4 else "XYZRPQ" if 5.1 in codes["G"] else "HDPQEST" if spoken else "HDST"
        numbers = [f"{letter}{_told(words[letter] * (size if letter in 'PQ' else 1.0))}" for letter in letters if letter in words]
        machine = [code for code in codes["M"] if code not in _ENDS]
        before, after = ([f"M{code:g}" for code in machine if (code in _BEHIND) == late] for late in (False, True))
        if said or before or numbers:
            kept.append(Kept(number, False, " ".join([*said, *before, *numbers])))
        if after:
            kept.append(Kept(number, True, " ".join(after)))
        if set(_ENDS) & set(codes["M"]):
            break
    return kept, led


class _Program:
    """What a controller remembers from line to line, and the places so far, in millimetres. `tolerance` [m]."""

    def __init__(self, tolerance: float) -> None:
        self.tolerance = tolerance
        self.at = [math.nan] * 3
        # which axes G28 or G53 brought where nobody knows, and in which line; Z is no number there until the highest one is known
        self.lost: dict[int, int] = {}
        self.highest = -math.inf
        self.motion: float | None = None
        self.cycle: Cycle | None = None
        self.to_initial = True
        self.corner: Corner | None = None
        self.remarks: list[Remark] = []
        self.plane, self.unit, self.unit_told = 17.0, 1.0, False
        self.absolute, self.absolute_centres = True, False
        self.system = ""
        self.feed, self.speed, self.turning = math.nan, math.nan, True
        self.selected, self.mounted, self.changes = 0, 0, False
        self.places, self.feeds, self.speeds = array("d"), array("d"), array("d")
        self.tools, self.lines = array("q"), array("q")

    def run(self, block: str, number: int) -> bool:
        """Run a line; true where the program ends with it."""
        codes, told, words = words_of(block)
        self._set(told, codes, words)
        single = told.get("single")
        axes = {i: words[letter] * self.unit for i, letter in enumerate(_AXES) if letter in words}
        offsets = {i: words[letter] * self.unit for i, letter in enumerate(_OFFSETS) if letter in words}
        if not words.keys().isdisjoint(FURTHER):
            check_further(codes, words, single, self.motion, self.cycle is not None)
        if self.corner and (single in (28, 30, 53) or self.cycle or set(_ENDS) & set(codes["M"])):
            raise self.corner.refused("no move behind it", "two moves")
        if single in (28, 30):
            # of a rotary axis alone it moves no other
            if axes or not words.keys() & set(ROTARY):
                self._home(axes, number)
        elif single == 53:
            if self.motion != 0:
                raise InputError("block", "G53 at a feed", "G53 G0: where it leads nobody told")
            self._leave(axes, number)
        elif 5.1 in codes["G"]:  # its axes are those that are smoothed
            pass
        elif self.cycle and (axes or "R" in words):
            self._drill(self.cycle, axes, words, number)
        elif single != 4 and (axes or offsets or "R" in words):
            self._move(axes, offsets, words, number)
        if 5 in codes["M"]:
            self.turning = False
        return bool(set(_ENDS) & set(codes["M"]))

    def _set(self, told: Mapping[str, float], codes: Mapping[str, list[float]], words: Mapping[str, float]) -> None:
        if "unit" in told:
            self.unit, self.unit_told = (_INCH if told["unit"] == 20 else 1.0), True
        self.plane = told.get("plane", self.plane)
        self.absolute = told.get("distance", 90 if self.absolute else 91) == 90
        self.absolute_centres = told.get("centre", 90.1 if self.absolute_centres else 91.1) == 90.1
        if told.get("cycle", 80) != 80:
            if "motion" in told:
                raise InputError("block", f"G{told['motion']:g} and G{told['cycle']:g}", "one of them in a line")
            self.cycle = Cycle(int(told["cycle"]), self.cycle.initial if self.cycle else self.at[2])
        elif "cycle" in told or "motion" in told:
            self.cycle = None
        if "motion" in told or "cycle" in told:
            self.motion = told.get("motion")
        if 98 in codes["G"] or 99 in codes["G"]:
            self.to_initial = 98 in codes["G"]
        if "system" in told:
            system = f"G{told['system']:g}{' P' + format(words['P'], 'g') if 'P' in words else ''}"
            if self.system not in ("", system):
                raise InputError(
                    "block", f"{system} after {self.system}", "one system of work coordinates: nobody told how far they are apart"
                )
            self.system = system
        if told.get("single") == 4:  # its words are a time
            return
        if "F" in words:
            self.feed = positive("F", words["F"]) * self.unit
        if "S" in words:
            if words["S"] < 0.0:
                raise InputError("S", words["S"], "0 or more [rev/min]")
            self.speed = words["S"]
        if "T" in words:
            if words["T"] < 0.0 or words["T"] != int(words["T"]):
                raise InputError("T", words["T"], "the number of a tool")
            self.selected = int(words["T"])
        if 6 in codes["M"]:
            self.mounted, self.changes = self.selected, True
        if 3 in codes["M"] or 4 in codes["M"]:
            self.turning = True

    def _drill(self, cycle: Cycle, axes: dict[int, float], words: Mapping[str, float], number: int) -> None:
        """Holes of a canned cycle: one a line, or as many as K or L says."""
        if self.plane != 17 or {"I", "J"} & words.keys():
            raise InputError("cycle", f"G{cycle.code} in another plane, or with I or J", "cycles along Z, G17")
        repeats = words.get("K", words.get("L", 1.0))
        if not (0 <= repeats <= MOST_REPEATS and repeats == int(repeats)):
            raise InputError("K or L", repeats, f"how many holes, a whole number up to {MOST_REPEATS}")
        if self.lost or not self.lines:
            raise InputError("cycle", f"G{cycle.code} from a place that nobody told", "X, Y and Z told by G0 before it")
        if cycle.code == 83 and all(note != _PECKED for note in self.remarks):
            self.remarks.append(Remark(RecordCode.ASSUMED, _PECKED))
        z, r, q = (words[letter] * self.unit if letter in words else None for letter in "ZRQ")
        cycle.told(z, r, q, self.absolute)
        across = {i: value for i, value in axes.items() if i != 2}
        self.highest = max(self.highest, cycle.clearance)
        for _ in range(int(repeats)):
            x, y, _ = self._target(across)
            for place, rapid in cycle.hole(self.at, x, y, self.to_initial):
                if place != self.at:
                    self._add(place, RAPID if rapid else self.feed, number)
                    self.at = place

    def _move(self, axes: dict[int, float], offsets: dict[int, float], words: Mapping[str, float], number: int) -> None:
        radius = words.get("R")
        if self.motion is None:
            raise InputError("block", "axes without a motion", "one of G0 to G3 before them")
        arc = self.motion in (2, 3)
        if self.corner and self.motion != 1:
            raise self.corner.refused(f"G{self.motion:g} behind it", "two moves")
        if not arc and (offsets or radius is not None):
            raise InputError("block", f"I, J, K or R in G{self.motion:g}", "them in arcs, G2 and G3")
        if self.motion != 0:
            self._begin(axes, arc, number)
        target = self._target(axes)
        if self.motion == 0:
            if self.lines and 2 in self.lost and 2 in axes:
                self._add([*target[:2], math.nan], RAPID, number)
            # before all axes are told there is no place
            if self.lines or not any(map(math.isnan, target)):
                self._add(target, RAPID, number)
        elif arc:
            self._arc(target, offsets, words, number)
        elif self.corner or not words.keys().isdisjoint(CORNERS):
            self._straight(target, words, number)
        else:
            self._add(target, self.feed, number)
        self.at = target
        for i in axes:
            self.lost.pop(i, None)

    def _straight(self, target: list[float], words: Mapping[str, float], number: int) -> None:
        """A feed move on a straight line, by the corner that waits for it; its own corner waits for the next one."""
        start = self.at
        if self.corner:
            for place in self.corner.places(target, _PLANES[int(self.plane)], self.tolerance):
                self._add(place, self.corner.feed, self.corner.number)
                start = place
            self.corner = None
        for kind in "RC":
            if f",{kind}" in words:
                self.corner = Corner(kind, positive(f",{kind}", words[f",{kind}"] * self.unit, "mm"), start, target, self.feed, number)
                return
        self._add(target, self.feed, number)

    def _begin(self, axes: dict[int, float], arc: bool, number: int) -> None:
        """See to it that a feed move begins somewhere."""
        for i, since in self.lost.items():
            raise InputError(f"{_AXES[i]}", f"no place since line {since} led where nobody knows", f"G0 {_AXES[i]} before the tool feeds")
        if self.lines:
            return
        leaves = any(not math.isnan(v) and v != axes.get(i) for i, v in enumerate(self.at))
        if arc or leaves or len(axes) < 3 or not self.absolute:
            self.at = [0.0 if math.isnan(v) else v for v in self.at]
            self._add(self.at, RAPID, number)

    def _target(self, axes: dict[int, float]) -> list[float]:
        target = list(self.at)
        for i, value in axes.items():
            if self.absolute:
                target[i] = value
            elif i in self.lost:
                raise InputError(_AXES[i], f"a step from where line {self.lost[i]} led to", "a place, by G90")
            else:
                target[i] = value + (0.0 if math.isnan(target[i]) else target[i])
        if 2 in axes:
            self.highest = max(self.highest, target[2])
        return target

    def _arc(self, target: list[float], offsets: dict[int, float], words: Mapping[str, float], number: int) -> None:
        radius, turns = words.get("R"), words.get("P", 1.0)
        if not (1 <= turns <= MOST_PLACES and turns == int(turns)):
            raise InputError("P", turns, "how many turns an arc takes, a whole number from 1 on")
        u, v, w = plane = _PLANES[int(self.plane)]
        start, end = (1e-3 * np.array(place) for place in (self.at, target))
        first, last = (start[u], start[v]), (end[u], end[v])
        clockwise = self.motion == 2
        if offsets.get(w):
            raise InputError(_OFFSETS[w], offsets[w], f"{_OFFSETS[u]} and {_OFFSETS[v]} in the plane of G{self.plane:g}")
        if (radius is None) == (u not in offsets and v not in offsets):
            found = "neither centre nor radius" if radius is None else "both centre and radius"
            raise InputError("arc", found, f"{_OFFSETS[u]} and {_OFFSETS[v]}, or R")
        if radius is not None:
            centre = centre_of(first, last, 1e-3 * radius * self.unit, clockwise)
        elif self.absolute_centres:
            if u not in offsets or v not in offsets:
                raise InputError("arc", "half a centre", f"{_OFFSETS[u]} and {_OFFSETS[v]} by G90.1")
            centre = 1e-3 * offsets[u], 1e-3 * offsets[v]
        else:
            centre = first[0] + 1e-3 * offsets.get(u, 0.0), first[1] + 1e-3 * offsets.get(v, 0.0)
        angle = turned(first, last, centre, clockwise)
        angle += math.copysign(2.0 * math.pi * (turns - 1.0), angle)
        reach = max(math.hypot(p[0] - centre[0], p[1] - centre[1]) for p in (first, last))
        count = chord_count(reach, angle, self.tolerance)
        self._check(count)
        for place in 1e3 * chords(start, end, centre, plane, angle, count)[:-1]:
            self._add(place, self.feed, number)
        self._add(target, self.feed, number)

    def _home(self, axes: dict[int, float], number: int) -> None:
        """G28 and G30: by way of a place to the reference point of the axes that are told, of all where none is."""
        if axes and self.lines:
            way = self._target(axes)
            if way != self.at and not any(map(math.isnan, way)):
                self._add(way, RAPID, number)
                self.at = way
        self._leave(axes or dict.fromkeys(range(3), 0.0), number)

    def _leave(self, axes: dict[int, float], number: int) -> None:
        """Go where nobody knows by the axes that are told: Z up, X and Y stay for want of a place."""
        for i in axes:
            if i == 2 or not self.lines:
                self.at[i] = math.nan
            self.lost[i] = number
        if self.lines and 2 in axes:
            self._add(self.at, RAPID, number)

    def _check(self, count: int) -> None:
        if len(self.lines) + count > MOST_PLACES:
            raise InputError(
                "places", f"more than {MOST_PLACES}", f"at most {MOST_PLACES}, chords of arcs counted: cut it up or allow more"
            )

    def _add(self, place: list[float] | FloatArray, feed: float, number: int) -> None:
        self._check(1)
        self.places.extend(place)
        self.feeds.append(feed)
        self.speeds.append(self.speed if self.turning else 0.0)
        self.tools.append(self.mounted)
        self.lines.append(number)

    def path(self, where: str) -> ToolPath:
        """Return the places; where Z was led where nobody knows it stands at the highest that is told."""
        if self.corner:
            raise self.corner.refused("no move behind it", "two moves").at(where)
        if not self.lines:
            raise InputError("program", "no move to a place", "one or more, with X, Y and Z", where)
        places = np.array(self.places).reshape(-1, 3)
        led = np.isnan(places[:, 2])
        places[led, 2] = max(self.highest, np.nanmax(places[:, 2]))
        kept = ~led
        kept[1:] |= np.any(np.diff(places, axis=0) != 0.0, axis=1)
        tools = np.array(self.tools) if self.changes else np.full(len(self.lines), self.selected)
        return ToolPath(
            1e-3 * places[kept],
            feed=np.array(self.feeds)[kept] / 6e4,
            speed=from_rpm(np.array(self.speeds)[kept]),
            tool=tools[kept],
            line=np.array(self.lines)[kept],
            remarks=(*(() if self.unit_told else (assumed("the program", "", "millimetres (G21)"),)), *self.remarks),
        )


def write_gcode(path: str | Path, tool_path: ToolPath, decimals: int = 4, kept: Sequence[Kept] = ()) -> None:
    """Write a path as a program in millimetres, absolute, feeds per minute; `read_gcode` gives it back, line numbers aside.

    Nobody knows where the tool stands before: it goes to the first place by Z, then across, where the path is nowhere higher; otherwise
    across as high as it stands, then by Z.

    `tool_path`: with the tool upright
    `decimals`: of the places in millimetres
    `kept`: what else the program says whose lines the path has: tools and speeds are its own then
    Raises `InputError` if the tool leans, or a feed or speed is not told behind one that is: a program would keep the last one.
    """
    where = str(path)
    if np.any(tool_path.axes[:, 2] < 1.0 - 1e-12):
        raise InputError("axes", "a tool that leans", "an upright one; a table, .csv, has columns i, j, k", where)
    feeds, speeds = 6e4 * tool_path.feed, to_rpm(tool_path.speed, 9)
    for name, values in (("feed", feeds[1:]), ("speed", speeds)):
        values = values[np.isfinite(values) | np.isnan(values)]
        if np.any(np.isnan(values[1:]) & ~np.isnan(values[:-1])):
            raise InputError(name, "one that ends on the way", "one for all moves behind the first that has it", where)
    places = np.round(1e3 * tool_path.places, decimals) + 0.0
    lines = ["%", "G21 G90 G94 G17"]
    speed, feed, tool, further = math.nan, math.nan, 0, list(kept)
    table = zip(places.tolist(), feeds.tolist(), speeds.tolist(), tool_path.tool.tolist(), tool_path.line.tolist(), strict=True)
    for k, (place, f, s, t, line) in enumerate(table):
        while further and (further[0].line, further[0].after) < (line, True):
            lines.append(further.pop(0).text)
        if t != tool and not kept:
            lines.append(f"T{t} M6")
            tool = t
        if s != speed and not math.isnan(s) and not kept:
            lines.append(f"S{_told(s)} M3" if s else "M5")
            speed = s
        word = ""
        if f not in (feed, math.inf) and not math.isnan(f):
            word, feed = f" F{_told(f)}", f
        x, y, z = (f"{value:.{decimals}f}" for value in place)
        if not k:
            lines.append(f"G0 Z{z}" if place[2] > places[:, 2].max() - _LEVEL else f"G0 X{x} Y{y}")
        lines.append(f"{'G0' if f == math.inf else 'G1'} X{x} Y{y} Z{z}{word}")
    write_text(path, "\n".join([*lines, *(each.text for each in further), "M30", "%"]) + "\n")


def _told(value: float) -> str:
    """A number without an exponent, to the last digit that counts."""
    return np.format_float_positional(round(value, 9), trim="-")
