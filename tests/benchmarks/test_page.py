import json

import pytest

from benchmarks.page import append_row, draw_searches, draw_study, read_rows, write_block

MARKED = "# A page\n\n<!-- one: written by python -m benchmarks -->\n\nold\n\n<!-- end of one -->\n\nprose\n"


def test_a_block_is_replaced_and_the_prose_stays(tmp_path):
    page = tmp_path / "page.md"
    page.write_text(MARKED)
    write_block("one", r"| new \1 |" + "\n", page)
    assert page.read_text() == MARKED.replace("old", r"| new \1 |")
    write_block("one", "old", page)
    assert page.read_text() == MARKED


def test_a_block_that_is_not_there_is_an_error(tmp_path):
    page = tmp_path / "page.md"
    page.write_text(MARKED)
    with pytest.raises(ValueError, match="no single block"):
        write_block("two", "text", page)
    assert page.read_text() == MARKED


def test_rows_survive_a_line_that_was_cut_short(tmp_path):
    path = tmp_path / "rows.jsonl"
    assert read_rows(path) == []
    append_row(path, {"a": 1})
    with path.open("a") as file:
        file.write(json.dumps({"b": 2})[:5])
    append_row(path, {"c": 3})
    assert read_rows(path) == [{"a": 1}, {"c": 3}]


@pytest.mark.slow
def test_pictures_stay_small(tmp_path):
    errors = {"similar": {"errors": [0.003, 0.2]}, "different": {"errors": [0.01, 0.02]}}
    study = [
        {"machine": str(m), "condition": condition, "method": "default", "status": status, **errors}
        for m in range(11)
        for condition, status in (("trigger", "converged"), ("no-trigger", "suspect"), ("noise-x3", "converged"))
    ]
    draw_study(study, tmp_path / "study.png")
    points = [[0.1 * 1.2**k, 1.0, 1e4 / (k + 1.0), 0.5, 0.7 / (k + 1.0)] for k in range(40)]
    searches = [
        {"machine": m, "method": name, "seed": seed, "points": points}
        for m in ("1", "2", "3")
        for name in ("default", "differential evolution", "CMA-ES", "paper, literal", "paper, noise weights")
        for seed in (1, 2)
    ]
    draw_searches(searches, tmp_path / "search_trace.png")
    for name in ("study.png", "search_trace.png"):
        assert 1000 < (tmp_path / name).stat().st_size < 150_000
