"""What pages show as output is printed by the commands and scripts above it; README can be followed from its first block to its last."""

from __future__ import annotations

import re

import pytest

from benchmarks.page_outputs import FIGURES, NOT_RUN, PAGES, Block, Run, agrees, blocks, compared, differences
from tests.fixtures.paths import ROOT


@pytest.mark.slow
def test_pages_show_what_is_printed(tmp_path):
    """Each in its order, in one folder; a script without a guard gives the command's result, byte for byte."""
    run = Run(tmp_path)
    found = [str(each) for name in PAGES for each in differences(name, run)]
    assert found == [], "python -m benchmarks page_outputs --write"
    assert (tmp_path / "RESULT.json").read_bytes() == (tmp_path / "report" / "RESULT.json").read_bytes()
    assert [made for figures in FIGURES.values() for made in figures.values() if not (tmp_path / made).is_file()] == []


def test_every_block_of_the_readme_is_run():
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    found = list(blocks(text))
    assert len(found) == text.count("```") / 2
    assert {block.kind for block in found} == {"sh", "python", "toml", "text"}
    commands = [block.text for block in found if block.kind in ("sh", "python")]
    # .ci/run follows the first block to the letter
    assert [line.split(" && ")[-1].split()[0] for line in commands[0].splitlines()] == [".venv/bin/rcsa-ident", ".venv/bin/python"]
    assert [text for text in commands[1:] if any(word in text for word in NOT_RUN)] == []
    kinds = "".join(block.kind[0] for block in found if block.kind != "toml")
    assert re.fullmatch("([sp]t)+", kinds)


@pytest.mark.parametrize(
    ("told", "printed", "agree"),
    [
        ("limit 2.93 mm", "limit 2.93 mm", True),
        ("limit 2.54 mm", "limit 2.51 mm", False),
        ("limit 2.93 mm", "depth 2.93 mm", False),
        ("limit 2.93 mm", "so\nlimit 2.93 mm", False),
        ("…\nlimit 2.93 mm", "so\nlimit 2.93 mm", True),
        ("written (321 speeds, …)", "written (321 speeds, 0.4 s)", True),
        ("written (321 speeds, …)", "written (320 speeds, 0.4 s)", False),
        ("X 7 modes, 1.5 s", "X 8 modes, 92.1 s", True),
        ("┏━━┳━┓\n│ 9 │", "┏━━━━┳━━┓\n│   9 │", True),
    ],
)
def test_lines_are_compared(told, printed, agree):
    block = Block("text", told, 1)
    assert all(agrees(block, line, found) for _, line, found in compared(block, printed)) is agree


def test_a_page_says_how_near_its_numbers_are():
    one, two, other = blocks(
        "<!-- within 2 %, columns 1, 3 free -->\n```text\n│ 2.3 │ 100 │ 0.1 │\n```\n"
        "<!-- within 2 % -->\n```text\n100 ± 3\n```\n```text\n100 ± 3\n```\n"
    )
    assert [agrees(one, one.text, f"│ 1.1 │ {depth} │ 0.4 │") for depth in (101, 104)] == [True, False]
    assert [agrees(two, two.text, f"{depth} ± 5") for depth in (101, 104)] == [True, False]
    assert [agrees(other, other.text, line) for line in ("100 ± 3", "100 ± 5", "102 ± 3")] == [True, False, False]


#: What README and the tutorial say of accuracy, and how the page puts it that has the command beside it.
REPEATED = [
    ("README.md", "0.28 % in a similar holder and 0.43 % in another one; 27 of 30", "study.md", "0.0028 and 0.0043 after; 27 of 30 good"),
    ("README.md", "0.28 % in a similar holder and 0.43 % in another one; 27 of 30", "limits.md", "median 0.0028 / 0.0043, 27 of 30 good"),
    ("README.md", "median 14 % and 29 %; then 3.2 % and 4.7 %", "limits.md", "median 0.033 / 0.136 / 0.288"),
    ("README.md", "median 14 % and 29 %; then 3.2 % and 4.7 %", "limits.md", "median 0.032 / 0.047"),
    ("README.md", "| median relative error 0.4 %, largest 3.6 %", "limits.md", "144 speeds | 0.4 % in the median, 3.6 % at worst"),
    ("README.md", "161 of 162; 179 of 192", "limits.md", "| 161 of 162 hold"),
    ("README.md", "161 of 162; 179 of 192", "limits.md", "| 179 of 192 hold"),
    ("README.md", "1058 Hz and 0.642 µm/N; measured 1056 Hz and 0.678", "limits.md", "1058 Hz, 0.642 µm/N for 1056 Hz, 0.678"),
    ("docs/tutorial/never_cut.md", "is 0.28 % in a holder like one that cut, and 0.43 % in", "study.md", "0.0028 and 0.0043 after"),
    ("docs/limits.md", "before any label, 89 % after forty", "labelled_cuts.md", "| after the 40 training cuts | 105 (89.0 %)"),
    ("docs/physics/recommendation.md", "89.0 % told right after 40", "labelled_cuts.md", "| after the 40 training cuts | 105 (89.0 %)"),
    ("docs/validation.md", "| 83.1 | 88.983 |", "labelled_cuts.md", "| after the 40 training cuts | 105 (89.0 %)"),
]


@pytest.mark.parametrize(("page", "told", "source", "measured"), REPEATED)
def test_figures_are_those_of_the_page_that_measures_them(page, told, source, measured):
    assert told in (ROOT / page).read_text(encoding="utf-8")
    assert measured in (ROOT / "docs" / source).read_text(encoding="utf-8")
