"""path remove: its files, its JSON, and what it says to bad input."""

import csv
import json

import numpy as np
import pytest
from typer.testing import CliRunner

from rcsa_ident.cli import app
from rcsa_ident.io.paths.meshes import read_mesh, write_mesh
from tests.fixtures.paths import TOOLINGS
from tests.toolpath.test_surface_kernels import box

TOOL = sorted(TOOLINGS.glob("*.toml"))[0]
BLOCK = "0 0 0 40 30 12"


def run(*arguments):
    return CliRunner().invoke(app, ["path", "remove", *(str(each) for each in arguments)])


@pytest.fixture
def slot(tmp_path):
    path = tmp_path / "PATH.csv"
    path.write_text("x_mm,y_mm,z_mm\n-8,15.1,10.3\n48,15.1,10.3\n")
    return path


def test_a_slot_is_told_and_written(slot, tmp_path):
    out, part, plot = (tmp_path / name for name in ("ENGAGEMENT.csv", "PART.stl", "PART.png"))
    found = run(TOOL, slot, "--stock", BLOCK, "--out", out, "--part", part, "--plot", plot, "--step-mm", 1, "--json")
    assert found.exit_code == 0, found.output
    told = json.loads(found.stdout)
    assert set(told) == {
        "removed_volume_mm3", "positions", "seconds", "dexel_updates", "cell_mm", "memory_bytes", "warnings", "out",
    }  # fmt: skip
    rows = list(csv.DictReader(out.read_text().splitlines()))
    assert list(rows[0]) == ["x_mm", "y_mm", "z_mm", "slice_mm", "entry_angle_deg", "exit_angle_deg", "removed_volume_mm3"]
    diameter = told["removed_volume_mm3"] / (40.0 * 1.7)
    assert told["positions"] == 57
    assert told["warnings"] == []
    assert sum(float(row["removed_volume_mm3"]) for row in rows) == pytest.approx(told["removed_volume_mm3"], rel=1e-4)
    middle = [row for row in rows if float(row["x_mm"]) == 20.0]
    assert {(row["entry_angle_deg"], row["exit_angle_deg"]) for row in middle} == {("0", "180")}
    assert diameter == pytest.approx(round(diameter, 1), rel=1e-3)
    points = read_mesh(part).points
    assert 1e3 * np.ptp(points, axis=0) == pytest.approx([40.0, 30.0, 12.0], abs=0.01)
    assert plot.read_bytes().startswith(b"\x89PNG")


def test_stock_may_be_a_file_and_words_are_plain(slot, tmp_path):
    stock = tmp_path / "STOCK.stl"
    write_mesh(stock, *box([0.0, 0.0, 0.0], [0.04, 0.03, 0.012]))
    found = run(TOOL, slot, "--stock", stock, "--out", tmp_path / "E.csv", "--cell-mm", 0.5)
    assert found.exit_code == 0, found.output
    assert "mm³ are taken out of 14400 mm³" in found.output
    assert "warning: the distance between lines" in found.output


@pytest.mark.parametrize(
    ("stock", "more", "said"),
    [
        ("0 0 0 40 30", (), "six numbers"),
        ("40 0 0 0 30 12", (), "X0 < X1"),
        ("stock.step", (), "suffix '.step'"),
        ("none.stl", (), "none.stl"),
        (BLOCK, ("--cell-mm", 0), "--cell-mm"),
        (BLOCK, ("--cell-mm", 1e-200), "--cell-mm: found 1e-200 mm"),
        (BLOCK, ("--step-mm", -1), "--step-mm"),
        (BLOCK, ("--part", "part.step"), "suffix '.step'"),
        (BLOCK, ("--plot", "part.gif"), "--plot"),
        ("9000 0 0 9040 30 12", (), "millimetres"),
    ],
)
def test_bad_input_is_one_sentence(slot, tmp_path, stock, more, said):
    out = tmp_path / "E.csv"
    found = run(TOOL, slot, "--stock", stock, "--out", out, *more)
    assert found.exit_code == 2, found.output
    assert said in found.output
    assert not out.exists()
