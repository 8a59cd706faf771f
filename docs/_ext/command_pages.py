"""The commands as pages: what `--help` says, in lists that fit any width. Each group of commands is a page under reference/commands."""

from __future__ import annotations

from itertools import groupby
from pathlib import Path
from typing import Any

import typer
from _ext.pages import contents, described, plain, write
from sphinx.application import Sphinx

_INTRODUCTION = """# Command line

Every command takes `--help` and `--json`. Exit codes are 0 done, 1 failed, 2 bad input, 3 not converged: the result is still written,
and its status says so. These pages are made of what `--help` says.

"""


def in_groups() -> dict[str, dict[str, Any]]:
    """Return the commands by the heading under which the help shows them, each by its full name."""
    from api.serve import app as service
    from rcsa_ident.cli import app

    groups: dict[str, dict[str, Any]] = {}
    for prefix, command in (("rcsa-ident", app), ("rcsa-ident-serve", service)):
        root = typer.main.get_command(command)
        if prefix == "rcsa-ident-serve":
            groups["The service"] = {prefix: root}
        for name, each in root.commands.items():  # type: ignore[attr-defined]
            group = groups.setdefault(each.rich_help_panel or "The service", {})
            within = getattr(each, "commands", None)
            group |= {f"{prefix} {name}": each} if within is None else {f"{prefix} {name} {inner}": it for inner, it in within.items()}
    return groups


def section(name: str, command: Any) -> str:
    """Return what a command does, takes and writes."""
    context = typer.Context(command, info_name=name)
    pieces = command.collect_usage_pieces(context)
    lines = [f"({name.replace(' ', '-')})=", f"## {name}", "", *map(plain, (command.help or "").split("\n\n")), ""]
    lines = [*lines[:3], "\n\n".join(lines[3:-1]), "", "```text", f"{name} {' '.join(pieces)}", "```", ""]
    shown = [param for param in command.params if not getattr(param, "hidden", False)]
    for title, params in groupby(sorted(shown, key=lambda p: p.rich_help_panel or ""), key=lambda p: p.rich_help_panel):
        if title:
            lines += [f":::{{rubric}} {title}", ":::", ""]
        records = [record for param in params if (record := param.get_help_record(context))]
        lines.append(described((f"`{names}`", plain(text)) for names, text in records))
    return "\n".join(lines)


def write_pages(app: Sphinx) -> None:
    groups = in_groups()
    texts = {"index.md": _INTRODUCTION + contents(map(_file, groups))}
    for title, commands in groups.items():
        texts[f"{_file(title)}.md"] = "\n".join([f"# {title}", "", *(section(*each) for each in commands.items())])
    write(Path(app.srcdir) / "reference" / "commands", texts)


def _file(title: str) -> str:
    return title.lower().replace(" ", "_").replace("-", "_")


def setup(app: Sphinx) -> dict[str, Any]:
    app.connect("builder-inited", write_pages)
    return {"parallel_read_safe": True}
