"""``python -m benchmarks page_outputs [--write] [PAGE …]``: what the pages' commands and scripts print, beside what the pages say.

A fenced ``text`` block below a ``sh`` or ``python`` block is its output. Lines of a page that are ``…`` stand for any number of lines, a
``…`` within a line for any characters. Words have to be equal, and numbers to one of their last digit; or within N % where
``<!-- within N %, columns A, B free -->`` stands above, as of an identification, whose valley the last bits of a processor decide: there,
neither what follows ± nor the columns named are compared. Times, and how many modes a search has kept, never are. ``--write`` puts what
was printed into the pages, and makes their figures anew.

Commands of all pages run in one folder that holds the project's data, each once.
"""

from __future__ import annotations

import argparse
import os
import re
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from tests.fixtures.pictures import lighten

ROOT = Path(__file__).resolve().parent.parent
#: In this order: later ones use files of the ones before.
PAGES = (
    "README.md",
    "docs/tutorial/ten_minutes.md",
    "docs/tutorial/machine.md",
    "docs/tutorial/never_cut.md",
    "docs/tutorial/forces.md",
    "docs/howto/tap_tests.md",
    "docs/howto/robots.md",
)
#: Blocks that install something, start a service or ask for the reader's own files.
NOT_RUN = ("pip install", "rcsa-ident-serve", "robot import", "TOOL.toml --posture", "RECORD", "TESTS.csv", "CAMPAIGN", '"…"')
#: Figures that the commands of a page write, by the page's names for them.
FIGURES = {
    "docs/tutorial/ten_minutes.md": {"own_lobes.png": "LOBES.png", "own_tool.svg": "TOOL.svg"},
    "docs/tutorial/never_cut.md": {"lobes.png": "LOBES.png", "tool.svg": "S3.svg"},
    "docs/howto/tap_tests.md": {"tap.png": "tap.png"},
}
_NUMBER = re.compile(r"(?<![\w.-])[-+]?\d+(?:\.\d+)?(?:e[-+]?\d+)?(?![\w-])")
#: Seconds, numbers of modes.
_FREE = re.compile(r"\b\d+(?:\.\d+)? s\b|\b\d+ modes?\b")
_GUARD = re.compile(r"<!-- within (\d+) %(?:, columns? ([\d, ]+) free)? -->")


@dataclass
class Block:
    """A fenced block: its language, its text, the line below its fence, by how much its numbers may differ, and its free columns."""

    kind: str
    text: str
    line: int
    within: float = 0.0
    free: tuple[int, ...] = ()

    def asked(self, line: str) -> str:
        """Return what is compared of a line."""
        line = _FREE.sub("%", line)
        if self.within > 0.0:
            cells = re.sub(r"± ?[\d.e+-]*\d", "±", line).split("│")
            line = "│".join("" if k in self.free else cell for k, cell in enumerate(cells))
        return line


@dataclass
class Difference:
    """A line of a page that is not what was printed."""

    page: str
    line: int
    told: str
    printed: str | None

    def __str__(self) -> str:
        return f"{self.page}:{self.line}: the page says\n  {self.told}\nprinted is\n  {self.printed or 'no such line'}"


@dataclass
class Run:
    """A folder in which the pages are followed, and what each script has printed there."""

    folder: Path
    printed: dict[str, str] = field(default_factory=dict)

    def __post_init__(self) -> None:
        for name in ("data", "docs", "tests"):
            (self.folder / name).symlink_to(ROOT / name, target_is_directory=True)
        shutil.copy(ROOT / "docs" / "howto" / "files" / "make_hits.py", self.folder)

    def shell(self, text: str) -> str:
        """Return what a block of commands prints."""
        lines = [re.sub(r"^.*&& \.venv/bin/(rcsa-ident .*)$", r"\1", line) for line in text.splitlines()]
        text = "\n".join(line for line in lines if " -m pytest" not in line)
        if text not in self.printed:
            path = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
            environment = os.environ | {"PATH": path, "COLUMNS": "82", "NO_COLOR": "1"}
            self.printed[text] = _run(["bash", "-c", f"set -euo pipefail\n{text}"], self.folder, environment)
        return self.printed[text]

    def script(self, text: str, before: str) -> str:
        """Return what a script prints, behind those that stand above it."""
        printed = _run([sys.executable, "-c", f"{before}\nprint('\\f')\n{text}"], self.folder, dict(os.environ))
        return printed.rpartition("\f\n")[2]


def _run(command: Sequence[str], folder: Path, environment: dict[str, str]) -> str:
    done = subprocess.run(command, cwd=folder, env=environment, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
    if done.returncode != 0:
        raise SystemExit(f"{command[-1]}\n{done.stdout}\nends with exit code {done.returncode}")
    return done.stdout


def blocks(page: str) -> Iterator[Block]:
    """Yield the fenced blocks of a page."""
    kind, lines, begin, guard = None, list[str](), 0, tuple[float, tuple[int, ...]]((0.0, ()))
    for number, line in enumerate(page.splitlines(), start=1):
        if kind is not None:
            if line == "```":
                yield Block(kind, "\n".join(lines), begin, *guard)
                kind, lines, guard = None, [], (0.0, ())
            else:
                lines.append(line)
        elif told := _GUARD.fullmatch(line):
            guard = float(told[1]) / 100.0, tuple(int(each) for each in (told[2] or "").split(",") if each)
        elif re.fullmatch(r"```[a-z]+", line):
            kind, begin = line[3:], number + 1


def follow(name: str, run: Run) -> Iterator[tuple[Block, str]]:
    """Do what a page says, and yield each block of output with what was printed for it."""
    made, scripts, before = run.folder, list[str](), ""
    for block in blocks((ROOT / name).read_text("utf-8")):
        asked = not any(word in block.text for word in NOT_RUN) or "rcsa-ident demo" in block.text
        if block.kind == "toml" and block.text.startswith("name = "):
            (made / "TOOL.toml").write_text(block.text + "\n", "utf-8")
        elif block.kind == "sh" and asked:
            before, printed = "sh", run.shell(block.text)
        elif block.kind == "python" and asked:
            before, printed = "python", run.script(block.text, "\n".join(scripts))
            scripts.append(block.text)
        elif block.kind == "text" and before:
            yield block, printed
            before = ""
        else:
            before = ""


def words(line: str) -> str:
    """Return a line without its numbers, and without what only aligns them."""
    return re.sub(r"[━─ ]+", " ", _NUMBER.sub("#", line)).strip()


def close(told: str, printed: str, within: float) -> bool:
    """Whether the numbers of two lines agree, to the digits that are told."""
    pairs = zip(*(_NUMBER.findall(line) for line in (told, printed)), strict=True)
    return all(abs(float(a) - float(b)) <= within * abs(float(a)) + 1.001 * 10.0 ** -len(a.partition(".")[2]) for a, b in pairs)


def fitting(told: str, printed: str) -> bool:
    """Whether a line has the words that a page tells, which may leave some out."""
    if "…" not in told:
        return words(told) == words(printed)
    return re.fullmatch(".*".join(re.escape(words(part)) for part in told.split("…")), words(printed)) is not None


def compared(block: Block, printed: str) -> Iterator[tuple[int, str, str | None]]:
    """Yield the place and the text of each line that the page tells, and the line that was printed in its place, if there is one."""
    lines, place, skipping = [line.rstrip() for line in printed.splitlines()], 0, False
    for number, told in enumerate(block.text.splitlines()):
        if told == "…":
            skipping = True
            continue
        asked, given = block.asked(told), [block.asked(line) for line in lines]
        there = [k for k in range(place, len(lines) if skipping else place + 1) if k < len(lines) and fitting(asked, given[k])]
        if not there:
            yield number, told, None
            continue
        chosen = next((k for k in there if "…" in told or close(asked, given[k], block.within)), there[0])
        yield number, told, lines[chosen]
        place, skipping = chosen + 1, False


def agrees(block: Block, told: str, found: str | None) -> bool:
    """Whether a line was printed as the page tells it; where it leaves characters out, numbers beside them have to be equal."""
    if found is None:
        return False
    told, found = block.asked(told), block.asked(found)
    if "…" in told:
        return re.fullmatch(".*".join(re.escape(part) for part in told.split("…")), found) is not None
    return close(told, found, block.within)


def differences(name: str, run: Run) -> Iterator[Difference]:
    """Yield what a page says and its commands do not."""
    for block, printed in follow(name, run):
        for number, told, found in compared(block, printed):
            if not agrees(block, told, found):
                yield Difference(name, block.line + number, told, found)


def write(name: str, run: Run) -> Iterator[Difference]:
    """Put what was printed into a page, copy its figures, and yield the lines that have to be looked at."""
    lines = (ROOT / name).read_text("utf-8").splitlines()
    for block, printed in follow(name, run):
        for number, told, found in compared(block, printed):
            if found is None:
                yield Difference(name, block.line + number, told, None)
            elif "…" not in told:
                lines[block.line - 1 + number] = found
    (ROOT / name).write_text("\n".join(lines) + "\n", "utf-8")
    for figure, made in FIGURES.get(name, {}).items():
        shutil.copy(run.folder / made, (ROOT / name).parent / figure)
        lighten((ROOT / name).parent / figure)
    if name == "README.md":
        picture(run.folder / "report" / "report.html", ROOT / "docs" / "never_cut.png")


def picture(report: Path, out: Path, tooling: str = "S4-shrink") -> None:
    """Draw what the report says of one tool: its FRF and its lobes."""
    from playwright.sync_api import sync_playwright

    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=shutil.which("chromium"), args=["--no-sandbox"])
        page = browser.new_page(viewport={"width": 860, "height": 1000}, color_scheme="light")
        page.goto(report.as_uri())
        head = page.locator("h3", has_text=tooling).first
        first, second = (page.locator("figure", has_text=words).last for words in (f"Tooltip FRF of {tooling}", "Stability lobes"))
        boxes = [each.bounding_box() for each in (head, first, second)]
        left, top = min(box["x"] for box in boxes if box), boxes[0]["y"] if boxes[0] else 0.0
        right, bottom = max(box["x"] + box["width"] for box in boxes if box), max(box["y"] + box["height"] for box in boxes if box)
        page.screenshot(path=out, full_page=True, clip={"x": left, "y": top, "width": right - left, "height": bottom - top})
        browser.close()
    lighten(out)


def main(arguments: Sequence[str]) -> None:
    """Follow the pages, and print or write what differs."""
    parser = argparse.ArgumentParser(
        prog="benchmarks page_outputs", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--write", action="store_true", help="put what was printed into the pages")
    parser.add_argument("pages", nargs="*", metavar="PAGE", help=f"some of {', '.join(PAGES)}")
    given = parser.parse_args(arguments)
    with tempfile.TemporaryDirectory() as folder:
        run = Run(Path(folder))
        found = [each for name in given.pages or PAGES for each in (write if given.write else differences)(name, run)]
    for each in found:
        print(each)
    if found:
        raise SystemExit(1)
