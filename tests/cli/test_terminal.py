"""What the commands print in a narrow terminal or into a pipe: ids whole, brackets as they are; and what they leave behind."""

from __future__ import annotations

from types import SimpleNamespace

import pytest
from rich.table import Table
from typer.testing import CliRunner

from rcsa_ident.cli import app
from rcsa_ident.cli.common import BAD_INPUT, FAILED, say
from rcsa_ident.cli.tables import show, show_recordings
from tests.cli.test_cli import run

LONG = "S1-ER32-collet-chuck-with-a-long-name-[roughing]-0001"


@pytest.fixture(autouse=True)
def narrow(monkeypatch):
    monkeypatch.setenv("COLUMNS", "80")


@pytest.mark.parametrize("columns", ["80", "30"])
def test_an_id_is_never_cut(capsys, monkeypatch, columns):
    monkeypatch.setenv("COLUMNS", columns)
    row = SimpleNamespace(
        id=LONG, tooling=LONG[:-5], usable=False, notes=(), found_rpm=12345.6, programmed_rpm=12345.0,
        signal_to_noise_db={"X": 40.0, "Y": 41.0}, lines=12, reasons=(f"air cut of {LONG} missing",),
    )  # fmt: skip
    show_recordings([row])
    said = capsys.readouterr().out
    first = next(line for line in said.splitlines() if LONG in line)
    assert f"│ {LONG} │ {LONG[:-5]} │" in first
    assert f"{LONG} left out: air cut of {LONG} missing" in said
    assert "…" not in said


def test_a_table_that_fits_is_no_wider_than_the_terminal(capsys):
    table = Table("id", "what")
    table.add_row("a-1", "word " * 40)
    show(table)
    assert max(map(len, capsys.readouterr().out.splitlines())) <= 80


def test_brackets_are_printed_as_they_are(capsys):
    say("written: runs/[red]/PLAN.toml, [[cuts]] and [/]")
    assert capsys.readouterr().out == "written: runs/[red]/PLAN.toml, [[cuts]] and [/]\n"


@pytest.mark.parametrize(("command", "words"), [("plan", "[[cuts]]"), ("calibrate", "[workpiece]"), ("contact", "[contact]")])
def test_brackets_of_a_help_text_are_shown(command, words):
    assert words in CliRunner(env={"COLUMNS": "120"}).invoke(app, [command, "--help"]).stdout


@pytest.mark.parametrize("there", [False, True])
def test_a_refused_demo_leaves_its_folder_as_it_was(tmp_path, there):
    out = tmp_path / "deep" / "report"
    if there:
        out.mkdir(parents=True)
        (out / "mine.txt").write_text("mine", encoding="utf-8")
    before = sorted(tmp_path.rglob("*"))
    run("demo", "--data", tmp_path / "nothing", "--out", out, code=BAD_INPUT)
    assert sorted(tmp_path.rglob("*")) == before


def test_a_simulation_that_fails_leaves_nothing(tmp_path, monkeypatch):
    from rcsa_ident.base.errors import RcsaIdentError
    from rcsa_ident.front import samples

    def broken(*_):
        yield from ()
        raise RcsaIdentError("the time march diverged")

    monkeypatch.setattr(samples, "simulate", broken)
    run("simulate", samples.sample_data() / "hpm.toml", "--out", tmp_path / "runs", code=FAILED)
    assert list(tmp_path.iterdir()) == []
