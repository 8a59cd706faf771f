"""Surfaces in and out, and files that are none."""

import struct

import numpy as np
import pytest

from rcsa_ident.errors import InputError
from rcsa_ident.io import meshes
from rcsa_ident.io.meshes import read_mesh, write_mesh
from rcsa_ident.toolpath.dexel import DexelField
from tests.toolpath.test_surface_kernels import box

LOW, HIGH = np.array([0.001, 0.002, 0.0]), np.array([0.041, 0.022, 0.0123])


@pytest.mark.parametrize("kind", ["stl", "obj", "ply"])
def test_a_surface_comes_back_in_metres(tmp_path, kind):
    path = tmp_path / f"stock.{kind}"
    write_mesh(path, *box(LOW, HIGH))
    points, faces = read_mesh(path)
    assert (len(points), len(faces)) == (8, 12)
    # STL holds single precision
    assert np.array([points.min(axis=0), points.max(axis=0)]) == pytest.approx(np.array([LOW, HIGH]), abs=2e-9)
    assert DexelField.from_mesh(points, faces, 1e-3).volume == pytest.approx(np.prod(HIGH - LOW), rel=1e-6)


def test_text_stl_is_read(tmp_path):
    points, faces = box(1e3 * LOW, 1e3 * HIGH)
    facets = [
        "facet normal 0 0 0\nouter loop\n" + "".join(f"vertex {x} {y} {z}\n" for x, y, z in points[t]) + "endloop\nendfacet\n"
        for t in faces
    ]
    path = tmp_path / "text.stl"
    path.write_text("solid part\n" + "".join(facets) + "endsolid part\n")
    assert len(read_mesh(path)[1]) == 12


def stl(points, faces):
    rows = [struct.pack("<12fH", 0.0, 0.0, 0.0, *points[t].ravel(), 0) for t in faces]
    return b"\0" * 80 + struct.pack("<I", len(rows)) + b"".join(rows)


@pytest.mark.parametrize(
    ("name", "content", "said"),
    [
        ("open.stl", stl(box(1e3 * LOW, 1e3 * HIGH)[0], box(LOW, HIGH)[1][1:]), "3 edges"),
        ("inside_out.stl", stl(box(1e3 * LOW, 1e3 * HIGH)[0], box(LOW, HIGH)[1][:, ::-1]), "counterclockwise"),
        ("metres.stl", stl(*box(LOW, HIGH)), "is the file in mm"),
        ("micrometres.stl", stl(box(1e6 * LOW, 1e6 * HIGH)[0], box(LOW, HIGH)[1]), "is the file in mm"),
        ("none.stl", stl(box(1e3 * LOW, 1e3 * HIGH)[0], box(LOW, HIGH)[1][:0]), "mesh"),
        ("nan.stl", stl(np.where(box(LOW, HIGH)[0] == 0.0, np.nan, 1e3 * box(LOW, HIGH)[0]), box(LOW, HIGH)[1]), "mesh"),
        ("cut_off.stl", stl(*box(1e3 * LOW, 1e3 * HIGH))[:200], "mesh"),
        ("noise.ply", b"\x89PNG\r\n\x1a\n not a mesh", "PLY"),
        ("words.obj", b"to whom it may concern\n", "mesh"),
        ("part.step", b"ISO-10303-21;", "suffix '.step'"),
    ],
)
def test_what_is_no_closed_surface_in_millimetres_is_refused(tmp_path, name, content, said):
    path = tmp_path / name
    path.write_bytes(content)
    with pytest.raises(InputError, match=said) as error:
        read_mesh(path)
    assert str(path) in str(error.value)


def test_a_file_that_is_too_large_is_not_read(tmp_path, monkeypatch):
    monkeypatch.setattr(meshes, "LARGEST", 100)
    path = tmp_path / "large.stl"
    path.write_bytes(stl(*box(1e3 * LOW, 1e3 * HIGH)))
    with pytest.raises(InputError, match="mesh"):
        read_mesh(path)


def test_a_missing_library_is_named(tmp_path, monkeypatch):
    monkeypatch.setitem(__import__("sys").modules, "trimesh", None)
    with pytest.raises(InputError, match="extra `mesh`"):
        write_mesh(tmp_path / "part.stl", *box(LOW, HIGH))
    with pytest.raises(InputError, match="ends in"):
        write_mesh(tmp_path / "part.step", *box(LOW, HIGH))
