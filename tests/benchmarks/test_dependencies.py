"""The page of dependencies tells of those that pyproject.toml names, and of no others."""

from __future__ import annotations

import re

import pytest

from benchmarks.dependencies import needed, required, table
from tests.fixtures.paths import ROOT


def names(text):
    """First cells of the table's rows."""
    return re.findall(r"^\| ([a-z0-9-]+) \| [0-9]", text, re.MULTILINE)


def test_the_page_names_what_is_required_and_nothing_else():
    assert names((ROOT / "docs" / "dependencies.md").read_text(encoding="utf-8")) == required()


@pytest.mark.slow
def test_the_table_is_made_from_what_is_installed():
    made = table({"numpy": "9.9, 2030-01"})
    assert names(made) == required()
    row = next(line for line in made.splitlines() if line.startswith("| numpy |"))
    assert row.endswith("| 9.9, 2030-01 |")
    assert "BSD" in row
    assert {"numpy", "scipy", "llvmlite", "starlette"} <= set(needed(required()))


def test_the_tests_that_show_a_probe_are_there():
    shown = re.findall(r"`(tests/[a-z_/]+\.py)::(test_\w+)`", (ROOT / "docs" / "libraries.md").read_text(encoding="utf-8"))
    assert len(shown) > 10
    assert not [name for file, name in shown if f"def {name}(" not in (ROOT / file).read_text(encoding="utf-8")]
