"""Surfaces in and out, and files that are none."""

import struct

import numpy as np
import pytest

from rcsa_ident.base.errors import InputError
from rcsa_ident.cutting.cutter import Cutter
from rcsa_ident.io.paths import meshes
from rcsa_ident.io.paths.meshes import read_mesh, write_mesh
from rcsa_ident.setup.tooling import BareCutter
from rcsa_ident.toolpath.dexel import DexelField
from rcsa_ident.workflows.paths.removal import field_of
from tests.toolpath.test_surface_kernels import box

LOW, HIGH = np.array([0.001, 0.002, 0.0]), np.array([0.041, 0.022, 0.0123])


@pytest.mark.parametrize("kind", ["stl", "obj", "ply"])
def test_a_surface_comes_back_in_metres(tmp_path, kind):
    path = tmp_path / f"stock.{kind}"
    write_mesh(path, *box(LOW, HIGH))
    points, faces, _ = read_mesh(path)
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
    assert len(read_mesh(path).faces) == 12


def stl(points, faces):
    rows = [struct.pack("<12fH", 0.0, 0.0, 0.0, *points[t].ravel(), 0) for t in faces]
    return b"\0" * 80 + struct.pack("<I", len(rows)) + b"".join(rows)


@pytest.mark.parametrize(
    ("name", "content", "said"),
    [
        ("open.stl", stl(box(1e3 * LOW, 1e3 * HIGH)[0], box(LOW, HIGH)[1][1:]), "3 edges"),
        (
            "inside_out.stl",
            stl(box(1e3 * LOW, 1e3 * HIGH)[0], box(LOW, HIGH)[1][:, ::-1]),
            "-9840 mm³, .* counterclockwise",
        ),
        ("metres.stl", stl(*box(LOW, HIGH)), "is the file in mm\\? It looks like one in metres"),
        ("micrometres.stl", stl(box(1e6 * LOW, 1e6 * HIGH)[0], box(LOW, HIGH)[1]), "one in micrometres"),
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


def text_stl(points, faces):
    facets = ["facet normal 0 0 0\nouter loop\n" + "".join(f"vertex {x} {y} {z}\n" for x, y, z in points[t]) for t in faces]
    return "solid part\n" + "".join(f"{facet}endloop\nendfacet\n" for facet in facets) + "endsolid part\n"


def text_ply(points, faces):
    head = ["ply", "format ascii 1.0", f"element vertex {len(points)}", "property float x", "property float y", "property float z"]
    head += [f"element face {len(faces)}", "property list uchar int vertex_indices", "end_header"]
    return "\n".join([*head, *(" ".join(map(str, p)) for p in points), *(" ".join(map(str, [3, *t])) for t in faces)]) + "\n"


def obj(points, faces):
    return "".join("v {} {} {}\n".format(*p) for p in points) + "".join("f {} {} {}\n".format(*(t + 1)) for t in faces)


WHOLE = {"b.stl": stl, "t.stl": text_stl, "t.ply": text_ply, "t.obj": obj}
DAMAGED = [
    ("b.stl", lambda raw: raw + b"\0" * 7, "691 bytes for 12 facets, allowed is a complete STL file: 684 bytes"),
    ("b.stl", lambda raw: raw + raw[-50:], "734 bytes for 12 facets"),
    ("b.stl", lambda raw: raw[:80] + struct.pack("<I", 11) + raw[84:], "684 bytes for 11 facets"),
    ("t.stl", lambda raw: raw + b"vertex 1 2 3\n", "and more behind them"),
    ("t.stl", lambda raw: raw + b"solid second\n", "and more behind them"),
    ("t.stl", lambda raw: raw[: raw.rfind(b"facet normal")], "and no endsolid behind them"),
    ("t.stl", lambda raw: raw.replace(b"vertex 1.0 2.0 0.0\n", b"", 1), "35 corners"),
    ("t.ply", lambda raw: raw + b"3 0 1 2\n", "21 lines for 20 points and faces"),
    ("t.ply", lambda raw: raw[: raw.rfind(b"3 ")], "19 lines for 20"),
    ("t.obj", lambda raw: raw + b"f 1 2\n", "found f 1 2"),
]


@pytest.mark.parametrize("name", WHOLE)
def test_a_facet_without_area_is_left_out_and_said(tmp_path, name):
    """As meshers leave them, where two corners are one; alone it is an edge that stands open."""
    points, faces = box(1e3 * LOW, 1e3 * HIGH)
    whole, more = (WHOLE[name](points, f) for f in (faces, np.vstack([faces, [[1, 1, 5], [0, 2, 2]]])))
    for content, said in ((whole, ()), (more, ("2 facets without area are left out of the mesh",))):
        (tmp_path / name).write_bytes(content if isinstance(content, bytes) else content.encode())
        found = read_mesh(tmp_path / name)
        assert found.remarks == said
        assert DexelField.from_mesh(found.points, found.faces, 1e-3).volume == pytest.approx(np.prod(HIGH - LOW), rel=1e-6)


def test_the_remark_reaches_the_answer(tmp_path):
    points, faces = box(1e3 * LOW, 1e3 * HIGH)
    (tmp_path / "stock.stl").write_bytes(stl(points, np.vstack([faces, [[1, 1, 5]]])))
    surface = read_mesh(tmp_path / "stock.stl")
    field = field_of(BareCutter("EM6", Cutter(2, 0.006)), None, surface)
    assert field.remarks == ("1 facet without area is left out of the mesh",)


@pytest.mark.parametrize(("name", "spoil", "said"), DAMAGED)
def test_counts_and_lengths_of_a_mesh_are_compared(tmp_path, name, spoil, said):
    content = WHOLE[name](*box(1e3 * LOW, 1e3 * HIGH))
    path = tmp_path / name
    path.write_bytes(spoil(content if isinstance(content, bytes) else content.encode()))
    with pytest.raises(InputError, match=said):
        read_mesh(path)


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
