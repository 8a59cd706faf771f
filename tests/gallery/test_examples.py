"""The worked examples of docs/examples: each runs by itself, draws one figure with units on its axes, and ends in a check."""

from __future__ import annotations

import ast
import runpy
import sys
from pathlib import Path

import matplotlib.pyplot as plt
import pytest
from matplotlib.figure import Figure

from tests.fixtures.paths import ROOT

FOLDER = ROOT / "docs" / "examples"
EXAMPLES = {path.stem: path for path in sorted(FOLDER.glob("*/*.py"))}
#: Of files that are not part of the project.
REAL = [name for name, path in EXAMPLES.items() if path.parent.name == "real_files"]
#: Those that are not done at once.
SLOW = {
    "holder_to_tip", "labelled_cuts", "force_monitoring", "never_cut_tool", "du2023", "any_cutter", "hurco", "huynh2018", "ring_a_tool",
    "path_margins", "slow_spindle", "noise_is_no_mode", "all_methods", "tap_tests",
}  # fmt: skip
#: Lines, text included.
LONGEST = 90


@pytest.fixture
def run(monkeypatch):
    """Run an example in its folder, as a reader and the gallery do, and return its figure; it leaves nothing there."""
    plt.switch_backend("Agg")
    monkeypatch.setattr(sys, "dont_write_bytecode", True)

    def run_one(path: Path) -> Figure:
        monkeypatch.chdir(path.parent)
        monkeypatch.syspath_prepend(path.parent)
        there = set(path.parent.iterdir())
        runpy.run_path(str(path))
        assert set(path.parent.iterdir()) == there
        (number,) = plt.get_fignums()
        return plt.figure(number)

    yield run_one
    plt.close("all")
    sys.modules.pop("kept", None)


@pytest.mark.parametrize("name", [pytest.param(n, marks=[pytest.mark.slow] if n in SLOW else []) for n in EXAMPLES])
def test_an_example_runs_and_its_check_holds(name, run):
    figure = run(EXAMPLES[name])
    for axes in figure.axes:
        if axes.axison:
            labels = [label for label in (axes.get_xlabel(), axes.get_ylabel()) if label]
            assert [label for label in labels if "[" not in label] == []
            assert labels or axes.get_shared_x_axes().get_siblings(axes)[1:]


@pytest.mark.parametrize("name", EXAMPLES)
def test_an_example_is_short_and_ends_in_a_check(name):
    text = EXAMPLES[name].read_text(encoding="utf-8")
    assert len(text.splitlines()) <= LONGEST
    tree = ast.parse(text)
    title, line = (ast.get_docstring(tree) or "").splitlines()[:2]
    assert line == "=" * len(title)
    last = tree.body[-1]
    if name in REAL:
        assert isinstance(last, ast.If)
        assert last.orelse == []
        last = last.body[-1]
    assert isinstance(last, ast.Assert)


@pytest.mark.parametrize("name", REAL)
def test_where_files_are_missing_it_says_so_and_shows_the_figure(name, run, monkeypatch, tmp_path, capsys):
    monkeypatch.syspath_prepend(EXAMPLES[name].parent)
    monkeypatch.setattr("kept.FOLDER", tmp_path)
    (axes,) = run(EXAMPLES[name]).axes
    assert len(axes.images) == 1
    assert "They can be downloaded from https://github.com/" in capsys.readouterr().out


def test_every_section_has_a_header():
    assert {path.parent for path in EXAMPLES.values()} == {path.parent for path in FOLDER.glob("*/README.rst")}
