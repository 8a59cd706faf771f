"""Keys as the text of a TOML file."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import tomli_w


def toml_of(keys: Mapping[str, Any], remarks: Sequence[str] = (), digits: int | None = None) -> str:
    """Return keys as TOML that reads back the same.

    Parameters
    ----------
    keys : mapping
        Texts, numbers, lists and mappings.
    remarks : sequence of str
        Comments in front, a line each.
    digits : int, optional
        Significant digits of floats; all of them where none is given.

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
