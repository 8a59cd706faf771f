"""The same tooling, its tool clamped at other lengths."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from rcsa_ident.base.errors import InputError
from rcsa_ident.io.settings.setups import beam_segments, material_library, read_tooling
from rcsa_ident.io.toml_text import read_toml
from rcsa_ident.io.validated_table import Table
from rcsa_ident.setup.tooling import Tooling
from rcsa_ident.tool_holder.geometry import clamped

#: Least insertion, in diameters of the shank: below it no clamping holds.
LEAST_INSERTION = 1.0


def read_stickouts(path: str | Path, stickouts: Sequence[float]) -> list[Tooling]:
    """Return a tooling with its tool pulled out to each of some stickouts [m].

    The tool of the file keeps its length: where it is too short for the file's insertion it sits less deep in the bore.

    Raises `InputError` if a stickout leaves less than `LEAST_INSERTION` diameters in the holder.
    """
    tooling = read_tooling(path)
    top = Table(read_toml(path, "tooling"), str(path))
    pieces = beam_segments(top.table("tool"), material_library(top))
    length, shank = sum(piece.length for piece in pieces), pieces[-1].end
    base = tooling.assembly
    found = []
    for stickout in stickouts:
        insertion = min(base.insertion, length - stickout)
        if not (0.0 < stickout < length and insertion >= min(base.insertion, LEAST_INSERTION * shank) - 1e-9):
            most = length - min(base.insertion, LEAST_INSERTION * shank)
            raise InputError("stickout", f"{stickout * 1e3:g} mm", f"above 0 and at most {most * 1e3:g} mm for this tool", str(path))
        assembly = clamped(pieces, base.holder, stickout, insertion, base.contact)
        found.append(replace(tooling, name=f"{tooling.name}, {stickout * 1e3:g} mm", assembly=assembly))
    return found
