"""Sources: what a docstring cites stands in docs/references.md and docs/references.bib, and nothing stands there unused."""

from __future__ import annotations

import re
from collections import Counter
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
#: Author and year, or the main source, whose author and year could not be found.
KEY = r"[a-z]+\d{4}[a-z]?|inprocess"
CITED = re.compile(rf"\[({KEY})\]")
PAGE = (ROOT / "docs" / "references.md").read_text(encoding="utf-8")


def bib() -> list[tuple[str, str]]:
    """Return key and fields of each entry, in the file's order."""
    text = (ROOT / "docs" / "references.bib").read_text(encoding="utf-8")
    return re.findall(r"^@\w+\{([^,\s]+),\n(.*?)^\}", text, flags=re.DOTALL | re.MULTILINE)


def listed() -> dict[str, str]:
    """Return the page's entries by key: each begins a line with its key in bold."""
    return dict(re.findall(rf"^- \*\*\[({KEY})\]°?\*\* (.*?)(?=^- \*\*\[|^#|\Z)", PAGE, flags=re.DOTALL | re.MULTILINE))


def cited() -> dict[str, list[str]]:
    """Return where each key is cited: modules, tests, benchmarks and data of the package, and pages other than the list itself."""
    places: dict[str, list[str]] = {}
    sources = [p for folder in ("rcsa_ident", "api", "tests", "benchmarks") for p in (ROOT / folder).rglob("*.py")]
    sources += [*(ROOT / "rcsa_ident").rglob("*.toml"), ROOT / "README.md", *(ROOT / "docs").glob("*.md")]
    for path in sources:
        if path not in (Path(__file__).resolve(), ROOT / "docs" / "references.md"):
            for key in CITED.findall(path.read_text(encoding="utf-8")):
                places.setdefault(key, []).append(str(path.relative_to(ROOT)))
    return places


def test_every_citation_is_listed():
    known = {key for key, _ in bib()}
    assert {key: places for key, places in cited().items() if key not in known or key not in listed()} == {}


def test_every_entry_is_cited_or_background():
    places, page = cited(), listed()
    assert [key for key, _ in bib() if key not in places and "*Background*" not in page[key]] == []
    assert [key for key, text in page.items() if key in places and "*Background*" in text] == []


def test_page_and_bibliography_hold_the_same_entries():
    keys = [key for key, _ in bib()]
    assert [key for key, count in Counter(keys).items() if count > 1] == []
    assert len(re.findall(rf"^- \*\*\[({KEY})\]", PAGE, flags=re.MULTILINE)) == len(listed())
    assert set(keys) == set(listed())


def test_every_entry_says_who_what_and_when():
    for key, fields in bib():
        names = set(re.findall(r"^\s*(\w+)\s*=", fields, flags=re.MULTILINE))
        assert {"author", "title", "year"} <= names, key
        year = re.search(r"year\s*=\s*\{(.*?)\}", fields)
        assert year is not None, key
        # what could not be found says so, in both files
        if not re.fullmatch(r"\d{4}", year[1]):
            assert year[1] == "not verified", key
            assert "not verified" in listed()[key], key
        elif key != "inprocess":
            assert key.rstrip("abc").endswith(year[1]), key
        doi = re.search(r"doi\s*=\s*\{(.*?)\}", fields)
        assert doi is None or f"doi:{doi[1]}" in listed()[key], key
