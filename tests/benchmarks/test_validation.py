"""The page of validated figures: written from its rows, which stand within what is allowed, and quick ones are measured again."""

from __future__ import annotations

import json
import re

import numpy as np
import pytest

from benchmarks import validation
from benchmarks.page import DOCS, read_rows
from benchmarks.validation import cases, distance, holds, main, measured, there
from benchmarks.validation_case import Case, Measure
from benchmarks.validation_page import page
from tests.fixtures.paths import ROOT

PAGE = DOCS / "validation.md"
ROWS = {row["name"]: row for row in read_rows(PAGE.with_suffix(".jsonl"))}
ALL = {case.name: (group, case) for group, case in cases()}


def test_the_page_is_what_its_rows_give():
    assert PAGE.read_text(encoding="utf-8") == page(list(ROWS.values()))


def test_every_case_has_its_row():
    assert [case.name for _, case in cases()] == list(ALL)  # no name stands twice
    assert list(ROWS) == list(ALL)
    for name, row in ROWS.items():
        group, case = ALL[name]
        told = (group, case.source, case.unit, str(case.measure), case.tolerance, case.test)
        assert (row["group"], row["source"], row["unit"], row["measure"], row["tolerance"], row["test"]) == told, name
        assert re.fullmatch(r"[0-9a-f]{7,}\+?", row["commit"]), name


def test_every_row_stands_within_what_is_allowed():
    assert [name for name, row in ROWS.items() if not holds(row["error"], ALL[name][1]) or not row["holds"]] == []


def test_the_tests_that_are_named_exist():
    for name, (_, case) in ALL.items():
        if case.tolerance is None or case.test.startswith("python"):
            continue
        path, _, function = case.test.partition("::")
        text = (ROOT / path).read_text(encoding="utf-8")
        assert not function or f"def {function}(" in text, name


@pytest.mark.slow
def test_quick_cases_come_out_again():
    """All but those whose peer is nobody's requirement here."""
    quick = {
        name: each
        for name, each in ALL.items()
        if not each[1].slow and each[1].tolerance is not None and (not isinstance(each[1].needs, str) or there(each[1]))
    }
    assert len(quick) > 100
    for name, (group, case) in quick.items():
        row = measured(group, case, "here")
        assert row["holds"], row
        assert row["values"] == ROWS[name]["values"], name
        if row["values"] == len(row["ours"]):
            size = np.max(np.abs(row["expected"])) or 1.0
            relative = case.tolerance if case.measure in (Measure.EACH, Measure.LARGEST) else case.tolerance / size
            limits = {"rtol": 2.0 * relative + 2e-6, "atol": 2.0 * relative * size}
            np.testing.assert_allclose(row["ours"], ROWS[name]["ours"], **limits, err_msg=name)


@pytest.mark.parametrize(
    ("measure", "error"),
    [(Measure.EACH, 0.5), (Measure.LARGEST, 0.25), (Measure.ABSOLUTE, 1.0), (Measure.AT_MOST, 1.0), (Measure.AT_LEAST, 0.5)],
)
def test_distances(measure, error):
    assert distance([2.0, 4.0], [3.0, 3.5], measure)[0] == pytest.approx(error)
    with pytest.raises(ValueError, match="2 values were expected, 1 found"):
        distance([2.0, 4.0], [3.0], measure)


def test_only_what_is_asked_for_is_measured(monkeypatch, tmp_path):
    """Others keep their rows; with --reuse only what is missing is measured."""
    calls = []

    def case(name):
        return Case(name, "closed form", 1.0, lambda: calls.append(name) or 1.01, "m", 0.1, "tests/benchmarks/test_validation.py")

    monkeypatch.setattr(validation, "cases", lambda: [("Closed forms: structures", case(name)) for name in ("one", "two")])
    out = tmp_path / "page.md"
    main(["--out", str(out)])
    assert calls == ["one", "two"]
    main(["--out", str(out), "--only", "TWO"])
    assert calls == ["one", "two", "two"]
    rows = out.with_suffix(".jsonl")
    assert [json.loads(line)["name"] for line in rows.read_text(encoding="utf-8").splitlines()] == ["one", "two"]
    main(["--out", str(out), "--reuse", str(rows)])
    assert calls == ["one", "two", "two"]
    assert "| one | closed form | 1 | 1.01 | m | 1 % | 10 % |" in out.read_text(encoding="utf-8")
