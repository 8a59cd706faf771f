"""TOML as it comes from anybody, parsed in time and memory that grow with its length alone, and TOML as it is written."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import rtoml
import tomli_w

from rcsa_ident.base.errors import InputError
from rcsa_ident.io.files import MEGABYTE, read_bytes

LARGEST_SETUP = 4 * MEGABYTE
_PLACE = re.compile(r" at (line \d+) (column \d+)$")
#: What the parser says of too many keys in keys, and of too many lists or inline tables in each other.
_TOO_DEEP = ("recursion limit", "cannot recurse further")


def read_toml(path: str | Path, field: str) -> dict[str, Any]:
    """Return the content of a TOML file; a syntax error names its line and column."""
    raw = read_bytes(path, field, LARGEST_SETUP)
    try:
        text = raw.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = raw.count(b"\n", 0, error.start) + 1
        raise InputError(field, "a character that is not UTF-8", "text in UTF-8", f"{path} line {line}") from None
    return keys_of_toml(text, field, str(path))


def keys_of_toml(text: str, field: str, where: str = "") -> dict[str, Any]:
    """Return the keys of a TOML text.

    `field`: what the text is, for the message
    `where`: its file, for the message
    Raises `InputError`, which names line and column.
    """
    place, allowed = "", "TOML"
    try:
        found: dict[str, Any] = rtoml.loads(text)
        return found
    except UnicodeEncodeError as error:
        # JSON may hold half of a surrogate pair
        fault, place = "a character that is not Unicode", f"line {text.count(chr(10), 0, error.start) + 1}"
    except rtoml.TomlParsingError as error:
        words = str(error)
        if at := _PLACE.search(words):
            words, place = words[: at.start()], f"{at[1]}, {at[2]}"
        fault = f"a TOML error ({words})"
        if words.startswith(_TOO_DEEP):
            fault, allowed = "keys or lists nested too deeply", "TOML of at most 80 levels"
    # where the text is no file, the place has nothing to follow
    raise InputError(field, f"{fault} in {place}" if place and not where else fault, allowed, f"{where} {place}".strip() if where else "")


def toml_of(keys: Mapping[str, Any], remarks: Sequence[str] = (), digits: int | None = None) -> str:
    """Return keys as TOML that reads back the same.

    `keys`: texts, numbers, lists and mappings
    `remarks`: comments in front, a line each
    `digits`: significant digits of floats; all of them where none is given

    Examples
    --------
    >>> print(toml_of({"name": "S1", "cutter": {"teeth": 4, "diameter_mm": 1e3 * 0.0096}}, ["measured"], digits=12), end="")
    # measured
    name = "S1"
    <BLANKLINE>
    [cutter]
    teeth = 4
    diameter_mm = 9.6
    """
    comments = "".join(f"# {one_line(remark)}\n" for remark in remarks)
    return comments + tomli_w.dumps(keys if digits is None else _rounded(keys, digits))


def one_line(text: str) -> str:
    """Return a remark as a comment may hold it: blanks for line ends and control characters."""
    return " ".join("".join(c if c.isprintable() else " " for c in text).split())


def _rounded(value: Any, digits: int) -> Any:
    if isinstance(value, Mapping):
        return {key: _rounded(inner, digits) for key, inner in value.items()}
    if isinstance(value, list | tuple):
        return [_rounded(inner, digits) for inner in value]
    return float(f"{value:.{digits}g}") if isinstance(value, float) else value
