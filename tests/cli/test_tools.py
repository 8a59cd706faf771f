"""import-tools and draw on the command line."""

from __future__ import annotations

import json
import re
from pathlib import Path
from xml.etree import ElementTree

import pytest
import typer
from typer.testing import CliRunner

from rcsa_ident.cli import app as whole
from rcsa_ident.cli import tools
from rcsa_ident.io.settings.setups import read_tooling
from rcsa_ident.tool_holder import catalogue
from rcsa_ident.tool_holder.spread import Spread
from tests.fixtures.tool_library import END_MILL, end_mill, library

TOOLING = Path(__file__).resolve().parents[2] / "data" / "machines" / "toolings" / "S1-ER32.toml"
app = typer.Typer()
app.command("import-tools")(tools.import_tools)
app.command("draw")(tools.draw)
app.command("holders")(tools.holders)


def run(*arguments, code=0):
    result = CliRunner().invoke(app, [str(a) for a in arguments])
    assert result.exit_code == code, result.output + repr(result.exception)
    return result


@pytest.fixture
def tool_library(tmp_path):
    path = tmp_path / "L.json"
    path.write_text(json.dumps(library(END_MILL, end_mill(type="drill", description="[red]drill[/] 5"), end_mill())), encoding="utf-8")
    return path


def test_every_tool_becomes_a_file(tmp_path, tool_library):
    out = tmp_path / "new" / "toolings"
    said = json.loads(run("import-tools", tool_library, "--out", out, "--contact", TOOLING, "--json").stdout)
    assert (said["entries"], said["toolings"]) == (3, 2)
    assert [row["usable"] for row in said["tools"]] == [True, False, True]
    assert said["tools"][1]["reason"] == "a drill, not a milling tool"
    files = [Path(row["file"]) for row in said["tools"] if row["usable"]]
    assert [f.name for f in files] == ["VHM-12-R0-long.toml", "VHM-12-R0-long-2.toml"]
    for file in files:
        assert read_tooling(file).assembly.contact == read_tooling(TOOLING).assembly.contact
        assert file.read_text(encoding="utf-8").startswith("# ")


def test_a_list_writes_nothing(tmp_path, tool_library, monkeypatch):
    monkeypatch.setenv("COLUMNS", "200")
    said = run("import-tools", tool_library, "--list").stdout
    assert "VHM 12 R0 long" in said
    assert "[red]drill[/] 5" in said
    assert [p.name for p in tmp_path.iterdir()] == ["L.json"]


def test_one_tool_with_its_figures(tmp_path, tool_library):
    out = tmp_path / "T"
    options = ["--stickout-mm", 55, "--insertion-mm", 36, "--flute-ratio", 0.75, "--helix-deg", 45, "--material", "steel"]
    run("import-tools", tool_library, "--out", out, "--tool", "3", *options)
    assert [p.name for p in out.iterdir()] == ["VHM-12-R0-long.toml"]
    tooling = read_tooling(out / "VHM-12-R0-long.toml")
    assembly = tooling.assembly
    assert [round(1e3 * v, 6) for v in (assembly.stickout, assembly.insertion, assembly.tool[0].diameter)] == [55.0, 36.0, 9.0]
    assert tooling.cutter.helix == pytest.approx(0.7853981633974483)


def test_files_that_are_there_stay(tmp_path, tool_library):
    out = tmp_path / "T"
    run("import-tools", tool_library, "--out", out, "--tool", "1")
    (out / "VHM-12-R0-long.toml").write_text("mine")
    said = run("import-tools", tool_library, "--out", out, code=2)
    assert "--out: found 1 of the files already (VHM-12-R0-long.toml), allowed is another folder, or --overwrite" in said.output
    assert (out / "VHM-12-R0-long.toml").read_text() == "mine"
    run("import-tools", tool_library, "--out", out, "--overwrite")
    assert read_tooling(out / "VHM-12-R0-long.toml").name == "VHM 12 R0 long"


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ([], "--out: found nothing, allowed is a folder, or --list"),
        (["--out", "T", "--list"], "--out: found given together with --list"),
        (["--list", "--tool", "9"], "--tool: found 9, allowed is the name or the number of an entry, from 1 to 3"),
        (["--list", "--flute-ratio", "3"], "flute ratio: found 3.0"),
        (["--list", "--contact", "nothing.toml"], "nothing.toml"),
        (["--list", "--holder", "Hydro"], "holder: found Hydro, 0 times"),
    ],
)
def test_options_that_cannot_be(tool_library, options, words):
    assert words in run("import-tools", tool_library, *options, code=2).output


def test_no_tooling_at_all_is_bad_input(tmp_path):
    path = tmp_path / "L.json"
    path.write_text(json.dumps(library(end_mill(type="drill"))), encoding="utf-8")
    said = run("import-tools", path, "--list", code=2)
    assert "no tool of the library could be imported" in said.output
    assert "L.json line 1: tool library: found no JSON" in run("import-tools", _with(path, "{"), "--list", code=2).output


def _with(path, text):
    path.write_text(text)
    return path


def test_a_drawing_is_written(tmp_path):
    out = tmp_path / "T.svg"
    said = json.loads(run("draw", TOOLING, "--out", out, "--json").stdout)
    assert said == {"name": "S1-ER32", "out": str(out), "stickout_mm": 70.5, "insertion_mm": 40.0, "holder_mm": 98.0}
    assert ElementTree.parse(out).getroot().tag == "{http://www.w3.org/2000/svg}svg"
    assert "written" in run("draw", TOOLING, "--out", out).stdout
    assert "no folder" in run("draw", TOOLING, "--out", tmp_path / "none" / "T.svg", code=2).output


def test_a_holder_of_the_catalogue_is_printed_as_a_tooling_takes_it(tmp_path):
    assert "HSK-A63" in run("holders").output
    # brackets are no markup of the terminal's
    assert "[holder], [contact] and [spread]" in CliRunner().invoke(whole, ["holders", "--help"]).output
    text = run("holders", "HSK-A63", "ER32", "--bore-mm", 12).output
    assert text.startswith("# HSK-A63 ER32, bore 12 mm, 100 mm, 1.54 kg")
    assert "[holder]" in text
    head = TOOLING.read_text(encoding="utf-8").split("[holder]")[0]
    (tmp_path / "made.toml").write_text(head + text, encoding="utf-8")
    drawn = read_tooling(tmp_path / "made.toml")
    made = drawn.assembly
    spread = drawn.spread
    assert (spread.contact_stiffness, spread.contact_damping, spread.stickout) == pytest.approx((0.7, 1.0, Spread().stickout))
    assert "contact_stiffness_percent = 70.0" in text
    assert made.holder_length == pytest.approx(0.1)
    assert made.contact.rotational_damping == 40.0
    assert "# contact, collet: chosen for this project's virtual machines, not measured" in text
    nobody_knows = run("holders", "HSK-A63", "hydraulic", "--bore-mm", 12).output
    assert "[contact]" not in nobody_knows
    assert "[spread]" in nobody_knows
    answer = json.loads(run("holders", "HSK-A63", "ER32", "--bore-mm", 12, "--json").stdout)
    said = answer["contact"]
    assert answer["spread"] == {"contact_stiffness_percent": 70.0, "contact_damping_percent": 100.0}
    assert said["keys"]["translational_stiffness"] == made.contact.translational_stiffness
    assert (said["kind"], said["stiffness_spread_percent"], said["damping_spread_percent"]) == ("collet", 70.0, 100.0)
    assert json.loads(run("holders", "HSK-A63", "power", "--bore-mm", 20, "--json").stdout)["contact"] is None
    assert "rcsa-ident contact" in nobody_knows
    assert "--bore-mm: found 25 mm" in run("holders", "HSK-A63", "ER32", "--bore-mm", 25, code=2).output
    assert "--bore-mm" in run("holders", "HSK-A63", "ER32", code=2).output


def test_the_tutorial_shows_what_holders_prints_and_keeps_how_uncertain_it_is(tmp_path):
    text = (TOOLING.parents[3] / "docs" / "tutorial" / "ten_minutes.md").read_text(encoding="utf-8")
    blocks = re.findall(r"^```(?:\w*)\n(.*?)^```", text, re.MULTILINE | re.DOTALL)
    (asked,) = [k for k, block in enumerate(blocks) if block.startswith("rcsa-ident holders ")]
    shown, printed = blocks[asked + 1].splitlines(), run(*blocks[asked].split()[1:]).output.splitlines()
    assert len(shown) == len(printed)
    assert all(
        line.startswith(told.removesuffix(" …")) if told.endswith("…") else line == told for told, line in zip(shown, printed, strict=True)
    )
    (tmp_path / "TOOL.toml").write_text(blocks[asked + 2], encoding="utf-8")
    tooling = read_tooling(tmp_path / "TOOL.toml")
    assert (tooling.spread, tooling.remarks) == (catalogue.holder("HSK-A63", "ER32", 0.010).spread, ())


def test_a_cutter_alone_is_written_and_listed(tmp_path, monkeypatch):
    monkeypatch.setenv("COLUMNS", "200")
    (tmp_path / "L.json").write_text(json.dumps(library(end_mill(holder=None))), encoding="utf-8")
    said = run("import-tools", tmp_path / "L.json", "--out", tmp_path / "T").stdout
    assert "cutter alone" in said
    read = read_tooling(tmp_path / "T" / "VHM-12-R0-long.toml", tip_known=True)
    assert (read.cutter.teeth, read.cutter.diameter) == (4, 0.012)
