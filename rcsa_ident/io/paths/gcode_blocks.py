"""Lines of G-code: cleaned and checked to be words and nothing else, then their codes by what they set, and further words."""

from __future__ import annotations

import re
from collections.abc import Mapping

from gcodeparser import parse_parameters

from rcsa_ident.base.errors import InputError
from rcsa_ident.io.paths.gcode_cycles import CYCLES

#: Characters that a line may have.
_LONGEST_LINE = 1000
#: Numbers beyond it are no lengths in a machine [mm].
_LARGEST_NUMBER = 1e7

_NUMBER = r"[+-]?(?:\d+(?:\.\d*)?|\.\d+)"
_WORDS = re.compile(rf"(?:[A-Z]{_NUMBER})*")
_CORNER = re.compile(rf",([CR])({_NUMBER})")
#: Words of Sinumerik: the radius of an arc, and its further turns.
_RADIUS, _TURNS = re.compile(rf"CR=({_NUMBER})"), re.compile(r"TURN=(\d{1,6})")
_CODES = re.compile(rf"([GM])({_NUMBER})")
_COMMENT = re.compile(r"\([^()]*\)")
#: A point that no digit follows: the tokeniser takes it for a whole number and fails.
_BARE_POINT = re.compile(r"\.(?!\d)")
_MACRO = re.compile(r"[#\[\]=]")
_LABEL = re.compile(r"[O:]\d+")
_NUMBERED = re.compile(r"N\d+\.?")

#: Codes by what they set; of one kind a line has one.
_OF_A_KIND: dict[str, tuple[float, ...]] = {
    "motion": (0, 1, 2, 3),
    # a group of their own: G80 stands beside G0 in the first line of very many programs
    "cycle": (80, *CYCLES),
    "plane": (17, 18, 19),
    "unit": (20, 21),
    "distance": (90, 91),
    "centre": (90.1, 91.1),
    "single": (4, 28, 30, 53),
    "system": (54, 54.1, 55, 56, 57, 58, 59, 59.1, 59.2, 59.3, 154),
    # none of these moves a place: cancelled corrections, a tool's length, look-ahead, exact stops and smoothing, feed per minute, speed in
    # rev/min, how high a cycle comes back
    "told": (5, 5.1, 8, 9, 15, 40, 43, 44, 49, 50, 61, 61.1, 62, 64, 69, 94, 97, 98, 99, 187),
}
KINDS = {code: kind for kind, codes in _OF_A_KIND.items() for code in codes}
#: Why codes are refused that would change the path.
_REFUSED: dict[float, str] = {
    41: "a path of the tool's centre, written without radius correction",
    42: "a path of the tool's centre, written without radius correction",
    93: "feeds per minute, G94",
    95: "feeds per minute, G94",
    96: "speeds in rev/min, G97",
    87: "a cycle that bores from above: the control alone knows where the tool steps aside",
}
_SUBPROGRAMS = (96, 97, 98, 99)
_LETTERS = "XYZIJKRFSTHDPQL"
#: Axes that a program may name as long as they stand at 0.
ROTARY = "ABC"
#: Words of corners, and those that have to belong to something in their line.
CORNERS = (",R", ",C")
FURTHER = ("P", "Q", "L", *CORNERS)


def block_of(line: str) -> str:
    """Return a line without comments, blanks and its number; empty where it says nothing, ``%`` where it is the tape's end.

    What stands behind a ``%`` is a program's name or a remark.
    """
    if len(line) > _LONGEST_LINE:
        raise InputError("line", f"{len(line)} characters", f"at most {_LONGEST_LINE}")
    text = "".join(_COMMENT.sub(" ", line).partition(";")[0].upper().split())
    if text.startswith("%"):
        return "%" if text == "%" else ""
    slashed = text.startswith("/")
    text = _NUMBERED.sub("", text.lstrip("/"), count=1) if text[:1] in "/N" else text
    if _LABEL.fullmatch(text):
        return ""
    if "=" in text:
        text = _TURNS.sub(lambda turns: f"P{int(turns[1]) + 1}", _RADIUS.sub(r"R\1", text))
    words = _CORNER.sub(r"\1\2", text) if "," in text else text
    known = _WORDS.match(words)
    if known is None or known.end() != len(words):
        if _MACRO.search(text):
            raise InputError("block", text, "numbers: macros are not run")
        rest = words[known.end() if known else 0 :]
        allowed = "words of a letter and a number with a decimal point, comments in ( ) or behind ;"
        raise InputError("block", rest, allowed)
    if slashed and re.search(r"[GXYZIJKRF]", text):
        raise InputError("block", f"/{text}", "moves that no switch of the control leaves out: take the / or the line away")
    return "" if slashed else text


def words_of(block: str) -> tuple[dict[str, list[float]], dict[str, float], dict[str, float]]:
    """Return G and M codes of a line, the G codes by what they set, and its further words."""
    codes: dict[str, list[float]] = {"G": [], "M": []}
    # most lines are moves without a code
    coded = "G" in block or "M" in block
    for letter, value in _CODES.findall(block) if coded else ():
        codes[letter].append(float(value))
    told: dict[str, float] = {}
    for code in codes["G"]:
        kind = KINDS.get(code)
        if kind is None:
            known = ", ".join(f"G{each:g}" for each in sorted(KINDS))
            raise InputError("block", f"G{code:g}", _REFUSED.get(code, f"one of {known}"))
        if kind != "told" and told.setdefault(kind, code) != code:
            raise InputError("block", f"G{told[kind]:g} and G{code:g}", "one of them in a line")
    for code in codes["M"]:
        if code in _SUBPROGRAMS:
            raise InputError("block", f"M{code:g}", "a program without subprograms and jumps")
    corners = _CORNER.findall(block) if "," in block else []
    if len(corners) > 1:
        raise InputError("block", block, "one corner in a line, ,R or ,C")
    rest = _CORNER.sub("", block) if corners else block
    rest = _CODES.sub("", rest) if coded else rest
    found = parse_parameters(_BARE_POINT.sub("", rest))
    if len(found) != sum(map(str.isalpha, rest)):
        raise InputError("block", block, "each word once in a line")
    words = {letter: float(value) for letter, value in found.items()}
    for letter, number in words.items():
        if letter not in _LETTERS and not (letter in ROTARY and number == 0.0) and not (letter == "E" and 187 in codes["G"]):
            raise InputError(
                "block", f"{letter}{found[letter]}", f"words {', '.join(_LETTERS)}, G and M: other axes are followed at 0 alone"
            )
        if not abs(number) <= _LARGEST_NUMBER:
            raise InputError(letter, found[letter], f"at most {_LARGEST_NUMBER:g}")
    if 5 in codes["G"] and words.keys() & set("XYZIJK"):
        raise InputError("block", block, "G5 with P alone: splines are not followed")
    return codes, told, words | {f",{letter}": float(value) for letter, value in corners}


def check_further(
    codes: Mapping[str, list[float]], words: Mapping[str, float], single: float | None, motion: float | None, cycle: bool
) -> None:
    """Refuse words of `FURTHER` that nothing in their line reads.

    `codes`, `words`: of the line, as `words_of` returns them
    `single`, `motion`: code of the line that acts in it alone, and the motion that stands
    `cycle`: whether a canned cycle stands
    """
    said = codes["M"] or single == 4 or any(KINDS[code] in ("told", "system") for code in codes["G"])
    if not (said or cycle) and ("Q" in words or ("P" in words and motion not in (2, 3))):
        found = f"{'Q' if 'Q' in words else 'P'} that nothing reads"
        raise InputError("block", found, "P and Q beside G4, G64, cycles or an M word, P in arcs")
    if "L" in words and not cycle:
        raise InputError("block", "L", "it in cycles, where it repeats holes")
    if not words.keys().isdisjoint(CORNERS) and (motion != 1 or cycle or words.keys().isdisjoint("XYZ")):
        raise InputError("block", "a corner without a straight move", ",R and ,C in moves by G1")
