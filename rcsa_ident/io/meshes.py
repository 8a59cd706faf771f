"""Surfaces of triangles, STL, OBJ and PLY in millimetres: stock that is cut and parts that come out; read by trimesh (extra `mesh`)."""

from __future__ import annotations

import io
from pathlib import Path
from typing import Any

import numpy as np

from rcsa_ident.arrays import FloatArray
from rcsa_ident.errors import InputError
from rcsa_ident.io.files import MEGABYTE, read_bytes, replacing
from rcsa_ident.toolpath.dexel import check_closed

#: Suffixes of files that are read and written.
MESHES = (".stl", ".obj", ".ply")
#: Of a file, as large as one of ten million triangles.
LARGEST = 512 * MEGABYTE
#: Between which lengths the longest side of a workpiece lies [mm]: what is outside is given in another unit.
_SHORTEST, _LONGEST = 1.0, 10_000.0


def read_mesh(path: str | Path) -> tuple[FloatArray, np.ndarray]:
    """Return the points, shape (v, 3) [m], and triangles, shape (f, 3), of a closed surface whose file is in millimetres.

    Raises
    ------
    InputError
        Names the file and what is wrong with it: its kind, damage, a surface that is not closed, another unit.
    """
    where, kind = str(path), Path(path).suffix.lower()
    if kind not in MESHES:
        raise InputError("mesh", f"suffix '{Path(path).suffix}'", f"a file that ends in {', '.join(MESHES)}", where)
    return mesh_of(bytes(read_bytes(path, "mesh", LARGEST)), kind, where)


def mesh_of(content: bytes, kind: str, where: str) -> tuple[FloatArray, np.ndarray]:
    """Return the surface of a file's content, as `read_mesh` does; `kind` is one of `MESHES`, `where` is named in the messages."""
    trimesh = _trimesh(where)
    try:
        # points that stand at one place become one, so that neighbours share their edges
        found = trimesh.load(io.BytesIO(content), file_type=kind[1:], force="mesh", process=True, skip_materials=True)
        points, faces = np.array(found.vertices, dtype=float), np.array(found.faces, dtype=np.int64)
    except Exception as error:
        # a library's reader meets damage with whatever comes
        raise InputError("mesh", f"what cannot be read as {kind[1:].upper()} ({type(error).__name__})", "a complete file", where) from None
    if points.ndim != 2 or not len(points) or not len(faces):
        raise InputError("mesh", "no triangle", "a closed surface of triangles", where)
    try:
        check_closed(points, faces)
    except InputError as error:
        raise error.at(where) from None
    size = np.ptp(points, axis=0)
    if not _SHORTEST <= size.max() <= _LONGEST:
        sides = " x ".join(f"{side:.4g}" for side in size)
        raise InputError("mesh", f"a body of {sides} mm", f"a longest side of {_SHORTEST:g} to {_LONGEST:g} mm; is the file in mm?", where)
    return 1e-3 * points, faces


def write_mesh(path: str | Path, points: FloatArray, faces: np.ndarray) -> None:
    """Write a surface in millimetres; the suffix says as what.

    Parameters
    ----------
    path : path
    points : array, shape (v, 3) [m]
    faces : array of int, shape (f, 3)
    """
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
