"""The site is built without a warning, whole, and from its own files alone."""

from __future__ import annotations

import hashlib
import html
import json
import re
import subprocess
import sys
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urlsplit

import pytest

from tests.fixtures.paths import ROOT
from tests.web.conftest import CHROMIUM, QUIET

VENDOR = ROOT / "docs" / "_static" / "vendor"


class Page(HTMLParser):
    """What a page links to, what it loads, and the places within it that a link may name."""

    def __init__(self, path: Path) -> None:
        super().__init__()
        self.links: list[str] = []
        self.loaded: list[str] = []
        self.places: set[str] = set()
        self.feed(path.read_text(encoding="utf-8"))

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        given = {name: value or "" for name, value in attrs}
        self.places |= {given[name] for name in ("id", "name") if name in given}
        if tag == "a" and "href" in given:
            self.links.append(given["href"])
        elif tag == "link" and given.get("rel") in ("stylesheet", "icon", "preload"):
            self.loaded.append(given["href"])
        elif "src" in given:
            self.loaded.append(given["src"])


@pytest.fixture(scope="module")
def site(tmp_path_factory) -> Path:
    """As `python -m sphinx -W --keep-going docs public` builds it, but for the examples of the gallery, which have tests of their own."""
    folder: Path = tmp_path_factory.mktemp("site")
    command = [
        sys.executable,
        "-m",
        "sphinx",
        "-W",
        "--keep-going",
        "-q",
        "-t",
        "quick",
        "-d",
        folder / "doctrees",
        "docs",
        folder / "public",
    ]
    done = subprocess.run([str(part) for part in command], cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr[-4000:]
    return folder / "public"


@pytest.fixture(scope="module")
def pages(site) -> dict[Path, Page]:
    return {path: Page(path) for path in site.rglob("*.html") if "_static" not in path.parts}


def missing(target: str, page: Path, pages: dict[Path, Page]) -> bool:
    """Whether a link within the site leads nowhere."""
    parts = urlsplit(target)
    path = (page.parent / unquote(parts.path)).resolve() if parts.path else page
    path = path / "index.html" if path.is_dir() else path
    if path not in pages:
        return not path.exists()
    return bool(parts.fragment) and unquote(parts.fragment) not in pages[path].places


def words(page: str) -> str:
    """Return the text of a page without its tags."""
    return html.unescape(re.sub(r"<[^>]+>", "", page))


@pytest.mark.slow
def test_no_link_is_dead(pages):
    assert len(pages) > 150
    within = [(page, link) for page, content in pages.items() for link in content.links if not urlsplit(link).scheme]
    assert len(within) > 10_000
    assert sorted({f"{page.name}: {link}" for page, link in within if missing(link, page, pages)}) == []


@pytest.mark.slow
def test_nothing_is_loaded_from_elsewhere(site, pages):
    loaded = [(page, each) for page, content in pages.items() for each in content.loaded]
    assert [f"{page.name}: {each}" for page, each in loaded if urlsplit(each).scheme not in ("", "data") or each.startswith("//")] == []
    assert [f"{page.name}: {each}" for page, each in loaded if not urlsplit(each).scheme and missing(each, page, pages)] == []
    styles = "".join(path.read_text(encoding="utf-8") for path in site.rglob("*.css"))
    assert not re.search(r"(?:@import|url\()\s*[\"']?(?:https?:)?//", styles)


@pytest.mark.slow
def test_what_the_readme_links_to_is_there(site, pages):
    """Pages under docs/ by their names, with the places within them."""
    links = re.findall(r"\]\((docs/[^)]+\.md)(#[^)]+)?\)", (ROOT / "README.md").read_text(encoding="utf-8"))
    assert len(links) > 10
    targets = {path.removeprefix("docs/").removesuffix(".md") + ".html" + place for path, place in links}
    assert [target for target in sorted(targets) if missing(target, site / "index.html", pages)] == []


@pytest.mark.slow
def test_the_references_are_made_of_what_they_describe(site):
    """Calls, commands and schemas: one of each is where it belongs."""
    reference = site / "reference"
    calls = (reference / "rest" / "tool_change.html").read_text(encoding="utf-8")
    assert "POST /v1/lobes" in words(calls)
    assert 'href="objects.html#rest-lobequery"' in calls
    commands = words((reference / "commands" / "tool_change.html").read_text(encoding="utf-8"))
    assert "--surface-depth-mm <float>" in commands
    assert "--frf [X=]FILE[#RECORD]" in commands
    (schema,) = (site / "_downloads").rglob("tooling.json")
    assert json.loads(schema.read_text(encoding="utf-8"))["title"]


@pytest.mark.slow
@pytest.mark.skipif(CHROMIUM is None, reason="there is no Chromium: apt-get install chromium")
def test_every_equation_is_set(pages):
    """In a browser: what MathJax does not understand stands in red on the page."""
    from playwright.sync_api import sync_playwright

    equations = [path for path in pages if 'class="math' in path.read_text(encoding="utf-8")]
    assert len(equations) > 15
    wrong = []
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=CHROMIUM, headless=True, args=list(QUIET))
        shown = browser.new_page()
        for path in equations:
            shown.goto(path.as_uri())
            shown.wait_for_function("window.MathJax?.startup?.promise")
            shown.evaluate("MathJax.startup.promise")
            wrong += [
                f"{path.name}: {text}"
                for text in shown.locator("[data-mjx-error]").evaluate_all("found => found.map(e => e.dataset.mjxError)")
            ]
            wrong += [f"{path.name}: not set"] * shown.evaluate(
                "[...document.querySelectorAll('.math')].filter(e => !e.querySelector('mjx-container')).length"
            )
        browser.close()
    assert wrong == []


def test_the_vendored_files_are_the_published_ones():
    rows = json.loads((VENDOR / "vendor.json").read_text(encoding="utf-8"))
    assert {row["file"] for row in rows} == {
        p.relative_to(VENDOR).as_posix() for p in VENDOR.rglob("*") if p.name != "vendor.json" and p.is_file()
    }
    for row in rows:
        assert hashlib.sha256((VENDOR / row["file"]).read_bytes()).hexdigest() == row["sha256"], row["file"]
        assert row["licence"] == "Apache-2.0"


def test_the_tests_that_guarantees_name_are_there():
    named = re.findall(r"`(tests/[\w/]+\.py)(?:::(\w+))?`", (ROOT / "docs" / "guarantees.md").read_text(encoding="utf-8"))
    assert len(named) > 30
    assert [(file, name) for file, name in named if (f"def {name}(" if name else "") not in (ROOT / file).read_text(encoding="utf-8")] == []
