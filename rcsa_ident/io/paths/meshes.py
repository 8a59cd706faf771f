"""Surfaces of triangles, STL, OBJ and PLY in millimetres: stock that is cut and parts that come out; read by trimesh (extra `mesh`)."""

from __future__ import annotations

import io
import re
import struct
from pathlib import Path
from typing import Any

import numpy as np

from rcsa_ident.base.arrays import FloatArray
from rcsa_ident.base.errors import InputError
from rcsa_ident.base.remarks import Remark, counted
from rcsa_ident.io.files import MEGABYTE, read_bytes, replacing
from rcsa_ident.signals.verdict import RecordCode
from rcsa_ident.toolpath.dexel import Surface, check_closed

#: Suffixes of files that are read and written.
MESHES = (".stl", ".obj", ".ply")
#: Of a file, as large as one of ten million triangles.
LARGEST = 512 * MEGABYTE
#: Between which lengths the longest side of a workpiece lies [mm]: what is outside is given in another unit.
_SHORTEST, _LONGEST = 1.0, 10_000.0
_OTHERS = {"metres": 1e3, "micrometres": 1e-3}
#: Of a binary STL: before its facets, and each of them.
_BEFORE, _FACET = 84, 50


def read_mesh(path: str | Path) -> Surface:
    """Return a closed surface whose file is in millimetres.

    Facets whose corners are not three points have no area: they are left out, which is remarked.

    Raises `InputError`, which names the file and what is wrong with it: its kind, damage, a surface that is not closed, another unit.
    """
    where, kind = str(path), Path(path).suffix.lower()
    if kind not in MESHES:
        raise InputError("mesh", f"suffix '{Path(path).suffix}'", f"a file that ends in {', '.join(MESHES)}", where)
    return mesh_of(bytes(read_bytes(path, "mesh", LARGEST)), kind, where)


def mesh_of(content: bytes, kind: str, where: str) -> Surface:
    """Return the surface of a file's content, as `read_mesh` does; `kind` is one of `MESHES`, `where` is named in the messages."""
    trimesh = _trimesh(where)
    try:
        _CHECKS[kind](content)
    except InputError as error:
        raise error.at(where) from None
    try:
        # points that stand at one place become one, so that neighbours share their edges
        found = trimesh.load(io.BytesIO(content), file_type=kind[1:], force="mesh", process=True, skip_materials=True)
        points, faces = np.array(found.vertices, dtype=float), np.array(found.faces, dtype=np.int64)
    except Exception as error:
        # a library's reader meets damage with whatever comes
        raise InputError("mesh", f"what cannot be read as {kind[1:].upper()} ({type(error).__name__})", "a complete file", where) from None
    if points.ndim != 2 or not len(points) or not len(faces):
        raise InputError("mesh", "no triangle", "a closed surface of triangles", where)
    flat = np.any(faces == np.roll(faces, 1, axis=1), axis=1)
    faces = faces[~flat]
    try:
        check_closed(1e-3 * points, faces)
    except InputError as error:
        raise error.at(where) from None
    size = np.ptp(points, axis=0)
    if not _SHORTEST <= size.max() <= _LONGEST:
        sides = " x ".join(f"{side:.4g}" for side in size)
        fitting = next((name for name, scale in _OTHERS.items() if _SHORTEST <= scale * size.max() <= _LONGEST), "another unit")
        allowed = f"a longest side of {_SHORTEST:g} to {_LONGEST:g} mm; is the file in mm? It looks like one in {fitting}"
        raise InputError("mesh", f"a body of {sides} mm", allowed, where)
    words = f"{counted(int(flat.sum()), 'facet')} without area {'is' if flat.sum() == 1 else 'are'} left out of the mesh"
    return Surface(1e-3 * points, faces, (Remark(RecordCode.ASSUMED, words),) if flat.any() else ())


def _check_stl(content: bytes) -> None:
    """Refuse an STL file whose facets are not as many as it says, or that goes on behind them."""
    count = struct.unpack_from("<I", content, _BEFORE - 4)[0] if len(content) >= _BEFORE else 0
    words = content.lower() if content.lstrip()[:5].lower() == b"solid" and len(content) != _BEFORE + _FACET * count else b""
    if b"facet" in words:
        # names of solids stand in the first and the last line
        end = words.rfind(b"endsolid")
        body, last = (words[words.find(b"\n") : end], words[end:].partition(b"\n")[2]) if end >= 0 else (words, b"no end")
        corners, ended = body.count(b"vertex"), body.count(b"endfacet")
        begun = body.count(b"facet") - ended
        if begun != ended or corners != 3 * begun or last.strip():
            found = f"{begun} facets, {ended} of them ended, with {corners} corners, and {'no endsolid' if end < 0 else 'more'} behind them"
            raise InputError(
                "mesh", found if last.strip() else found.partition(", and")[0], "three corners a facet, and endsolid as the last line"
            )
    elif len(content) != _BEFORE + _FACET * count:
        found = f"{len(content)} bytes for {count} facets"
        raise InputError("mesh", found, f"a complete STL file: {_BEFORE + _FACET * count} bytes for as many")


def _check_ply(content: bytes) -> None:
    """Refuse a PLY file in text whose lines are not as many as it says; of a binary one the library compares them."""
    head, _, body = content.partition(b"end_header")
    if b"format ascii" in head:
        told = sum(int(count) for count in re.findall(rb"^element\s+\w+\s+(\d{1,12})\s*$", head, re.MULTILINE))
        found = sum(1 for line in body.splitlines() if line.strip())
        if found != told:
            raise InputError("mesh", f"{found} lines for {told} points and faces", "a line for each that the head of the file declares")


def _check_obj(content: bytes) -> None:
    """Refuse an OBJ file with a face of fewer than three corners, as of a line that was cut short."""
    short = re.search(rb"^[ \t]*f(?:[ \t]+[^\s#]+){0,2}[ \t]*(?:#.*)?\r?$", content, re.MULTILINE)
    if short:
        raise InputError("mesh", short[0].decode("ascii", "replace").strip(), "three corners or more in a face, f a b c")


_CHECKS = {".stl": _check_stl, ".ply": _check_ply, ".obj": _check_obj}


def write_mesh(path: str | Path, points: FloatArray, faces: np.ndarray) -> None:
    """Write a surface in millimetres; the suffix says as what. `points` [m], shape (v, 3). `faces`: array of int, shape (f, 3)."""
    check_mesh_name(path)
    trimesh = _trimesh(str(path))
    body = trimesh.Trimesh(1e3 * points, faces, process=False)
    written = body.export(file_type=Path(path).suffix.lower()[1:])
    with replacing(path) as part:
        part.write_bytes(written.encode() if isinstance(written, str) else written)


def check_mesh_name(path: str | Path) -> None:
    """Refuse a file that cannot be written, or a missing library, before the work and not after it."""
    if Path(path).suffix.lower() not in MESHES:
        raise InputError("mesh", f"suffix '{Path(path).suffix}'", f"a file that ends in {', '.join(MESHES)}", str(path))
    _trimesh(str(path))


def _trimesh(where: str) -> Any:
    try:
        import trimesh
    except ImportError:
        raise InputError("mesh", "no library that reads it", "the extra `mesh`: pip install 'rcsa-ident[mesh]'", where) from None
    return trimesh
