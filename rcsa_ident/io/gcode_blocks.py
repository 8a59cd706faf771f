"""Lines of G-code: cleaned and checked to be words and nothing else, then their codes by what they set, and further words."""

from __future__ import annotations

import re

from gcodeparser import parse_parameters

from rcsa_ident.errors import InputError

#: Characters that a line may have.
_LONGEST_LINE = 1000
#: Numbers beyond it are no lengths in a machine [mm].
_LARGEST_NUMBER = 1e7

_NUMBER = r"[+-]?(?:\d+(?:\.\d*)?|\.\d+)"
_WORDS = re.compile(rf"(?:[A-Z]{_NUMBER})*")
_CODES = re.compile(rf"([GM])({_NUMBER})")
_COMMENT = re.compile(r"\([^()]*\)")
#: A point that no digit follows: the tokeniser takes it for a whole number and fails.
_BARE_POINT = re.compile(r"\.(?!\d)")
_LABEL = re.compile(r"[O:]\d+")
_NUMBERED = re.compile(r"N\d+\.?")

#: Codes by what they set; of one kind a line has one.
_OF_A_KIND: dict[str, tuple[float, ...]] = {
    "motion": (0, 1, 2, 3, 80),
    "plane": (17, 18, 19),
    "unit": (20, 21),
    "distance": (90, 91),
    "centre": (90.1, 91.1),
    "single": (4, 28, 30, 53),
    "system": (54, 55, 56, 57, 58, 59),
    # none of these moves a place: cancelled corrections, a tool's length, exact stops and smoothing, feed per minute, speed in rev/min
    "told": (5.1, 9, 15, 40, 43, 49, 50, 61, 61.1, 62, 64, 69, 94, 97, 98, 99),
}
KINDS = {code: kind for kind, codes in _OF_A_KIND.items() for code in codes}
#: Why codes are refused that would change the path.
_REFUSED: dict[float, str] = {
    41: "a path of the tool's centre, written without radius correction",
    42: "a path of the tool's centre, written without radius correction",
    93: "feeds per minute, G94",
    95: "feeds per minute, G94",
    96: "speeds in rev/min, G97",
    **dict.fromkeys((73, 74, 76, *range(81, 90)), "moves by G0 to G3 instead of canned cycles"),
}
_SUBPROGRAMS = (96, 97, 98, 99)
_LETTERS = "XYZIJKRFSTHDPQ"


def block_of(line: str) -> str:
    """Return a line without comments, blanks and its number; empty where it says nothing, ``%`` where it is the tape's end."""
    if len(line) > _LONGEST_LINE:
        raise InputError("line", f"{len(line)} characters", f"at most {_LONGEST_LINE}")
    text = "".join(_COMMENT.sub(" ", line).partition(";")[0].upper().split())
    if text.startswith("%"):
        return "%"
    slashed = text.startswith("/")
    text = _NUMBERED.sub("", text.lstrip("/"), count=1) if text[:1] in "/N" else text
    if _LABEL.fullmatch(text):
        return ""
    if any(sign in text for sign in "#[]="):
        raise InputError("block", text, "numbers: macros are not run")
    known = _WORDS.match(text)
    if known is None or known.end() != len(text):
        rest = text[known.end() if known else 0 :]
        allowed = "words of a letter and a number with a decimal point, comments in ( ) or behind ;"
        raise InputError("block", rest, allowed)
    if slashed and re.search(r"[GXYZIJKRF]", text):
        raise InputError("block", f"/{text}", "moves that no switch of the control leaves out: take the / or the line away")
    return "" if slashed else text


def words_of(block: str) -> tuple[dict[str, list[float]], dict[str, float], dict[str, float]]:
    """Return G and M codes of a line, the G codes by what they set, and its further words."""
    codes: dict[str, list[float]] = {"G": [], "M": []}
    for letter, value in _CODES.findall(block):
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
    rest = _CODES.sub("", block)
    found = parse_parameters(_BARE_POINT.sub("", rest))
    if len(found) != sum(map(str.isalpha, rest)):
        raise InputError("block", block, "each word once in a line")
    for letter, value in found.items():
        if letter not in _LETTERS:
            raise InputError("block", f"{letter}{value}", f"words {', '.join(_LETTERS)}, G and M: other axes are not followed")
        if not abs(float(value)) <= _LARGEST_NUMBER:
            raise InputError(letter, value, f"at most {_LARGEST_NUMBER:g}")
    if ("P" in found or "Q" in found) and not (codes["M"] or any(KINDS[code] == "told" or code == 4 for code in codes["G"])):
        raise InputError("block", block, "P and Q beside G4, G64 or an M word: turns of helices and cycles are not run")
    return codes, told, {letter: float(value) for letter, value in found.items()}
