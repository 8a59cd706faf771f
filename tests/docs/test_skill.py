"""What the skill teaches is so: its Python runs, its commands and files are there."""

from __future__ import annotations

import json
import re

import pytest
from typer.testing import CliRunner

from rcsa_ident.cli import app
from tests.fixtures.paths import ROOT

SKILL = ROOT / "docs" / "skill"
PAGES = {path.name: path.read_text() for path in sorted(SKILL.glob("*.md"))}


def blocks(language: str) -> list[tuple[str, str]]:
    return [
        (name, block) for name, text in PAGES.items() for block in re.findall(rf"^```{language}\n(.*?)^```", text, re.DOTALL | re.MULTILINE)
    ]


@pytest.mark.parametrize(("name", "code"), blocks("python"), ids=lambda text: text[:20])
def test_its_python_runs(name, code, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    exec(compile(code, name, "exec"), {"__name__": "__main__"})


def asked() -> dict[str, set[str]]:
    """Return the options that are used with each command, there and on the page of all commands."""
    found: dict[str, set[str]] = {}
    glance = (ROOT / "docs" / "howto" / "commands.md").read_text(encoding="utf-8")
    for block in [block for _, block in blocks("sh")] + re.findall(r"^```sh\n(.*?)^```", glance, re.DOTALL | re.MULTILINE):
        for line in block.splitlines():
            words = line.split("#")[0].split()
            if words and words[0] == "rcsa-ident":
                command = [word for word in words[1:3] if re.fullmatch(r"[a-z-]+", word) and not word.startswith("-")]
                if command[0] not in ("robot", "path"):
                    command = command[:1]
                found.setdefault(" ".join(command), set()).update(word for word in words if word.startswith("--"))
    return found


@pytest.mark.parametrize(("command", "options"), asked().items())
def test_its_commands_take_their_options(command, options):
    told = CliRunner().invoke(app, [*command.split(), "--help"], env={"COLUMNS": "300", "NO_COLOR": "1"})
    assert told.exit_code == 0, told.output
    assert [option for option in options if option not in told.output] == []


def test_every_topic_is_led_to():
    assert set(re.findall(r"\]\((\w+\.md)\)", PAGES["SKILL.md"])) == set(PAGES) - {"SKILL.md"}
    head = re.match(r"---\nname: ([a-z-]+)\ndescription: (.+)\n---\n", PAGES["SKILL.md"])
    assert head is not None
    assert len(json.dumps(head[2])) < 1024
