"""What a first-time reader does in ten minutes, by the clock: the tutorial's own commands, from ``pip install`` to the lobes of a tool.

``python -m benchmarks first_reader [--without-warm] [--python PYTHON]`` takes commands and files out of docs/tutorial/ten_minutes.md as its
command line tells them, runs them one after the other in a clone of this repository that nobody has used, with a virtual environment of its
own, and prints when each section ended. Packages come from pip's cache or the registry, as they do for anybody.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).resolve().parent.parent
TUTORIAL = ROOT / "docs" / "tutorial" / "ten_minutes.md"
#: The tab that is followed, and the file that the tutorial's TOML is written to.
_TAB, _TOOLING = "Command line", "TOOL.toml"
_WARM = "rcsa-ident warm"


class Step(NamedTuple):
    """A block of the tutorial: shell commands, or a file that its reader writes."""

    section: str
    kind: str
    text: str


def main(arguments: list[str]) -> None:
    """Follow the tutorial, and print how long each section takes."""
    parser = argparse.ArgumentParser(
        prog="benchmarks first_reader", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--without-warm", action="store_true", help="leave the compilation of all kernels out")
    parser.add_argument("--python", default=sys.executable)
    given = parser.parse_args(arguments)
    with tempfile.TemporaryDirectory() as folder:
        subprocess.run(["git", "clone", "-q", "--depth", "1", f"file://{ROOT}", f"{folder}/project"], check=True)
        start = time.perf_counter()
        print("| section | ended after | took |\n|---|---|---|")
        before = 0.0
        for section, script in scripts(steps(TUTORIAL.read_text("utf-8")), given.python, given.without_warm):
            _run(script, Path(folder, "project"))
            now = time.perf_counter() - start
            print(f"| {section} | {_clock(now)} | {_clock(now - before)} |", flush=True)
            before = now


def steps(page: str) -> Iterator[Step]:
    """Yield the blocks that a reader of the command line follows."""
    section, tab, kind, lines = "", _TAB, None, list[str]()
    for line in page.splitlines():
        if kind is not None:
            if line == "```":
                if tab == _TAB and kind in ("sh", "toml"):
                    yield Step(section, kind, "\n".join(lines))
                kind, lines = None, []
            else:
                lines.append(line)
        elif line.startswith("```"):
            kind = line[3:]
        elif line.startswith("## "):
            section = line[3:]
        elif line.startswith(":::{tab-item} "):
            tab = line.removeprefix(":::{tab-item} ")
        elif line == "::::":
            tab = _TAB


def scripts(found: Iterator[Step], python: str, without_warm: bool) -> Iterator[tuple[str, str]]:
    """Yield a section's title and its shell script, one section after the other."""
    script: dict[str, list[str]] = {}
    for step in found:
        if step.kind == "toml":
            text = f"cat > {_TOOLING} <<'END'\n{step.text}\nEND"
        else:
            lines = [line for line in step.text.splitlines() if not (without_warm and line == _WARM)]
            text = "\n".join(lines).replace("python3 -m venv", f"{python} -m venv")
        script.setdefault(step.section, []).append(text)
    for i, (section, texts) in enumerate(script.items()):
        yield section, "\n".join(["set -euo pipefail", *([] if i == 0 else [". .venv/bin/activate"]), *texts])


def _run(script: str, folder: Path) -> None:
    """Run a script as a person would who has set nothing up."""
    kept = {key: value for key, value in os.environ.items() if key in ("PATH", "HOME", "LANG") or key.startswith("PIP_")}
    done = subprocess.run(["bash", "-c", script], cwd=folder, env=kept, capture_output=True, text=True)
    if done.returncode != 0:
        raise SystemExit(f"{script}\n{done.stdout}{done.stderr}")


def _clock(seconds: float) -> str:
    return f"{int(seconds) // 60}:{int(seconds) % 60:02d}"
