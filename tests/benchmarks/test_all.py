"""Races: both sides in turn, one number each round; and the page that they are written into."""

from __future__ import annotations

import importlib
import re

import pytest

from benchmarks import all as every
from benchmarks.page import DOCS
from benchmarks.timing import Race

PAGE = (DOCS / "benchmarks.md").read_text(encoding="utf-8")


def busy(count):
    return lambda: sum(range(count))


def test_a_race_tells_how_much_longer_the_peer_takes():
    race = Race("a sum", "a longer one", "numpy", busy(2_000), busy(40_000), "both whole numbers")
    assert len(race.ratios(3, 0.02)) == 3
    assert all(6.0 < ratio < 60.0 for ratio in race.ratios(3, 0.02))
    twice = race._replace(parts=(1, 10))
    assert all(0.6 < ratio < 6.0 for ratio in twice.ratios(3, 0.02))
    row = race.row()
    assert row["ratio"] == pytest.approx(row["peer"] / row["ours"])
    assert (row["claim"], row["accuracy"], row["unit"]) == ("a sum", "both whole numbers", "us")


def test_a_row_has_the_median_the_least_and_the_most():
    race = Race("a sum", "a longer one", "numpy", busy(1), busy(1), "exact")
    text = every.line(race, [3.0, 250.0, 12.34])
    assert re.fullmatch(r"\| a sum \| a longer one \(numpy [\d.]+\) \| exact \| \*\*12\*\* \| 3 \| 250 \|", text)


def test_every_module_has_races():
    for name in every.MODULES:
        assert callable(importlib.import_module(f"benchmarks.{name}").races), name


def test_the_page_holds_what_the_command_writes():
    """Rows change from machine to machine; their form, and what stands around them, does not."""
    rows = [line for line in PAGE.splitlines() if line.startswith("| ") and not line.startswith("| task")]
    assert len(rows) >= 25
    for row in rows:
        cells = row.strip("| ").split(" | ")
        assert len(cells) == 6, row
        median, least, most = (float(cell.strip("*")) for cell in cells[3:])
        assert least <= median <= most
    for line in [*every.HEAD.split("{machine}")[0].format(rounds=every.ROUNDS).splitlines(), *every.TAIL.splitlines()]:
        assert line in PAGE


def test_the_page_is_written(monkeypatch, tmp_path):
    race = Race("a sum", "a longer one", "numpy", busy(100), busy(100), "exact")
    monkeypatch.setattr(every, "races", lambda modules: [race])
    out = tmp_path / "page.md"
    every.main(["--out", str(out), "--rounds", "1"])
    text = out.read_text(encoding="utf-8")
    assert "| a sum | a longer one (numpy" in text
    assert f"Python {every.platform.python_version()}" in text
