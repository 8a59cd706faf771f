"""Files of paths: one reader for programs and tables."""

from __future__ import annotations

import numpy as np
import pytest

from rcsa_ident.base.errors import InputError
from rcsa_ident.base.units import to_rpm
from rcsa_ident.io.paths.tool_paths import read_tool_path, tool_path_of, write_tool_path
from rcsa_ident.toolpath.path import RAPID, ToolPath


def test_a_table_of_places():
    path = tool_path_of(
        "x_mm;y_mm;z_mm;i;j;k;feed_mm_per_min;spindle_speed_rpm;remark\n1,5;2;3;0;0;2;;;a\n2;2;3;0;1;0;600;18700;b\n3;2;3;0;0;1;inf;0;\n",
        "P",
    )
    assert path.places[0].tolist() == [0.0015, 0.002, 0.003]
    assert path.axes.tolist() == [[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]
    assert np.isnan(path.feed[0])
    assert path.feed[1:].tolist() == [0.01, RAPID]
    assert to_rpm(path.speed, 6)[1:].tolist() == [18700.0, 0.0]
    assert path.line.tolist() == [2, 3, 4]
    assert np.isnan(tool_path_of("x_mm,y_mm,z_mm\n1,2,3\n", "P").feed).all()


@pytest.mark.parametrize(
    ("header", "row", "field", "words"),
    [
        ("", "1,2,", "column z_mm", "empty"),
        ("", "1,2,inf", "column z_mm", "inf"),
        (",i,j,k", "1,2,3,0,0,0", "i, j, k", "direction"),
        (",i", "1,2,3,0", "column j", "columns"),
        (",feed_mm_per_min", "1,2,3,0", "column feed_mm_per_min", "above 0"),
        (",feed_mm_per_min", "1,2,3,-5", "column feed_mm_per_min", "-5"),
        (",spindle_speed_rpm", "1,2,3,-5", "column spindle_speed_rpm", "0 or more"),
        (",spindle_speed_rpm", "1,2,3,inf", "column spindle_speed_rpm", "0 or more"),
        ("", "1,2,90000", "path", "millimetres"),
    ],
)
def test_a_wrong_table_is_refused_by_its_line(header, row, field, words):
    with pytest.raises(InputError, match=words) as caught:
        tool_path_of(f"x_mm,y_mm,z_mm{header}\n{row}\n", "P.csv")
    assert caught.value.field == field
    assert "P.csv" in caught.value.where


def test_the_name_says_the_form(tmp_path):
    lean = ToolPath(
        np.array([[0.0, 0.0, 0.0], [0.1234567, 0.0, 0.0]]), axes=np.array([[0.0, 0.0, 1.0], [0.0, 0.6, 0.8]]), feed=[np.nan, 0.05]
    )
    upright = ToolPath(lean.places, feed=[RAPID, 0.05], speed=[100.0, 100.0])
    for path, name, finest in ((lean, "P.csv", 1e-12), (upright, "P.csv", 1e-12), (upright, "P.nc", 1e-7), (upright, "P.GCODE", 1e-7)):
        write_tool_path(tmp_path / name, path)
        found = read_tool_path(tmp_path / name)
        np.testing.assert_allclose(found.places, path.places, atol=finest)
        np.testing.assert_allclose(found.axes, path.axes, atol=1e-12)
        np.testing.assert_allclose(found.feed, path.feed)
        np.testing.assert_allclose(found.speed, path.speed)
    for action in (lambda: read_tool_path(tmp_path / "P.dxf"), lambda: write_tool_path(tmp_path / "P.dxf", upright)):
        with pytest.raises(InputError, match=r"\.nc"):
            action()
    (tmp_path / "far.nc").write_text("G0 X0 Y0 Z0\nX90000\n")
    with pytest.raises(InputError, match="line 2"):
        read_tool_path(tmp_path / "far.nc")
