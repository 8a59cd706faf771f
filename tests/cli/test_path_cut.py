"""path stability, path mill: their files, their JSON, a machine's chain and a robot's, and what they say to bad input."""

import csv
import json

import pytest
from typer.testing import CliRunner

from rcsa_ident.cli import app
from rcsa_ident.io.settings.setups import read_tooling
from tests.fixtures.paths import TOOLINGS
from tests.fixtures.robots import ROBOTS

TOOL = TOOLINGS / "S2-PG25.toml"
PROGRAM = """\
G21 G90 G94
S12000 M3
G0 X-8 Y10 Z5
G0 Z-2
G1 X14 F1800
G3 X24 Y20 I0 J10
G0 Z5
M30
"""
MODES = """\
[[x]]
natural_frequency_hz = 922.0
damping_ratio = 0.03
modal_mass_kg = 0.5
[[y]]
natural_frequency_hz = 1300.0
damping_ratio = 0.03
modal_mass_kg = 0.4
"""
STOCK = ("--stock", "0 0 -8 40 30 0")
CUT = ("--ktc-mpa", 800, "--krc", 0.3)
POSTURE = ("--posture", "-11.71 20.78 147.86 82.76 60.80 -166.96")


def run(command, *arguments):
    return CliRunner().invoke(app, ["path", command, *(str(each) for each in arguments)])


@pytest.fixture
def files(tmp_path):
    (tmp_path / "PATH.nc").write_text(PROGRAM)
    (tmp_path / "MODES.toml").write_text(MODES)
    return (TOOL, tmp_path / "PATH.nc", "--modes", tmp_path / "MODES.toml")


def rows(path):
    return list(csv.DictReader(path.read_text().splitlines()))


@pytest.mark.slow
def test_stability_along_a_program(files, tmp_path):
    out, plot, other = (tmp_path / name for name in ("STABILITY.csv", "MARGIN.png", "ERROR.svg"))
    found = run("stability", *files, *STOCK, *CUT, "--out", out, "--plot", plot, "--plot-error", other, "--step-mm", 1, "--json")
    assert found.exit_code == 0, found.output
    told = json.loads(found.stdout)
    written = rows(out)
    assert list(written[0]) == [
        "x_mm", "y_mm", "z_mm", "line", "depth_mm", "spindle_speed_rpm", "feed_per_tooth_mm", "margin", "margin_low", "limit_depth_mm",
        "chatter_frequency_hz", "force_x_n", "force_y_n", "force_z_n", "peak_force_n", "deflection_um", "form_error_um",
    ]  # fmt: skip
    assert told["cutting_moves"] == len(written)
    assert told["different_cuts"] < len(written)
    assert told["least_margin"] == pytest.approx(min(float(row["margin"]) for row in written), rel=1e-6)
    assert {row["line"] for row in written} == {"5", "6"}
    assert {float(row["depth_mm"]) for row in written} == {2.0}
    # a slot along X pushes the tool along Y, a slot along Y along X, turned with the way
    straight, around = ([row for row in written if row["line"] == line][-2] for line in ("5", "6"))
    assert float(straight["force_y_n"]) > 3.0 * abs(float(straight["force_x_n"]))
    assert abs(float(around["force_x_n"])) > abs(float(around["force_y_n"]))
    assert plot.read_bytes().startswith(b"\x89PNG")
    assert "form error of the wall" in other.read_text()
    words = run("stability", *files, *STOCK, *CUT, "--out", out, "--step-mm", 2)
    assert words.exit_code == 0, words.output
    assert "no move chatters" in words.output
    assert "walls are off by" in words.output


@pytest.mark.slow
def test_milling_a_program(files, tmp_path):
    out, surface = tmp_path / "FORCES.csv", tmp_path / "SURFACE.csv"
    found = run("mill", *files, *STOCK, *CUT, "--out", out, "--surface", surface, "--steps", 180, "--json")
    assert found.exit_code == 0, found.output
    told = json.loads(found.stdout)
    assert told["status"] == "stable"
    assert told["chattering_lines"] == []
    written = rows(out)
    assert told["turns"] == len(written)
    assert list(written[0])[:8] == ["time_s", "x_mm", "y_mm", "z_mm", "force_x_n", "force_y_n", "force_z_n", "peak_force_n"]
    assert told["largest_force_n"] == pytest.approx(max(float(row["peak_force_n"]) for row in written), rel=1e-6)
    times = [float(row["time_s"]) for row in written]
    assert times == sorted(times)
    wall = rows(surface)
    assert max(abs(float(row["error_um"])) for row in wall) < 50.0
    # along the straight slot a wall on each side
    assert {round(float(row["y_mm"])) for row in wall if float(row["x_mm"]) < 8.0} == {4, 16}
    words = run("mill", *files, *STOCK, *CUT, "--out", out, "--steps", 180)
    assert "no move chatters" in words.output


def test_a_robot_mills_and_is_judged_along_a_table(tmp_path):
    path = tmp_path / "PATH.csv"
    path.write_text("x_mm,y_mm,z_mm,feed_mm_per_min,spindle_speed_rpm\n770,184.7,155.4,inf,18000\n795,184.7,155.4,3000,18000\n")
    files = (ROBOTS / "tx200.toml", TOOL, path, *POSTURE, "--stock", "780 150 140 820 182 156", "--cell-mm", 0.5)
    found = run("mill", *files, *CUT, "--out", tmp_path / "F.csv", "--json")
    assert found.exit_code == 0, found.output
    assert json.loads(found.stdout)["largest_deflection_um"] > 20.0
    judged = run("stability", *files, *CUT, "--out", tmp_path / "S.csv", "--step-mm", 5, "--method", "zero-order", "--json")
    assert judged.exit_code == 0, judged.output
    assert json.loads(judged.stdout)["cutting_moves"] > 2


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (("--stock", "0 0 0 10 10"), "--stock"),
        ((*STOCK, "--cell-mm", "-1"), "--cell-mm"),
        ((*STOCK, *POSTURE), "--posture"),
        ((*STOCK, "--speed-rpm", "0"), "--speed-rpm"),
    ],
)
def test_bad_input_is_named(files, tmp_path, change, said):
    for command in ("stability", "mill"):
        found = run(command, *files, *change, *CUT, "--out", tmp_path / "OUT.csv")
        assert found.exit_code == 2
        assert said in found.output
        assert not (tmp_path / "OUT.csv").exists()


@pytest.mark.parametrize("option", ["--plot", "--plot-error"])
def test_a_picture_of_another_kind_is_refused_before_the_work(files, tmp_path, option):
    found = run("stability", *files, *STOCK, *CUT, "--out", tmp_path / "OUT.csv", option, tmp_path / "PART.xyz")
    assert found.exit_code == 2
    assert f"{option}: found suffix '.xyz'" in " ".join(found.output.split())
    assert not (tmp_path / "OUT.csv").exists()


@pytest.mark.slow
def test_what_is_odd_about_a_tooling_is_said(files, tmp_path):
    """A holder with a very thin wall."""
    odd = tmp_path / "ODD.toml"
    odd.write_text(TOOL.read_text().replace("inner_diameter_mm = 20.0", "inner_diameter_mm = 58.0"))
    (remark,) = read_tooling(odd).remarks
    asked = ("mill", odd, *files[1:], *STOCK, *CUT, "--out", tmp_path / "F.csv", "--steps", 60)
    assert f"warning: {remark}" in " ".join(run(*asked).output.split())
    assert remark in json.loads(run(*asked, "--json").stdout)["warnings"]


def test_what_is_lacking_is_named(files, tmp_path):
    out = ("--out", tmp_path / "OUT.csv")
    assert "radial ratio" in run("mill", *files, *STOCK, *out, "--ktc-mpa", 800).output.replace("--krc", "radial ratio")
    assert "a machine, a tooling and a path" in run("mill", TOOL, *STOCK, *CUT, *out).output.replace("\n", " ")
    lacking = run("mill", ROBOTS / "tx200.toml", *files[:2], *STOCK, *CUT, *out)
    assert "--posture" in lacking.output
    silent = tmp_path / "SILENT.nc"
    silent.write_text(PROGRAM.replace("S12000 M3\n", ""))
    found = run("stability", TOOL, silent, *files[2:], *STOCK, *CUT, *out)
    assert found.exit_code == 2
    assert "spindle speed" in found.output
