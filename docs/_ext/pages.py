"""What the extensions share that write pages: Markdown, and files that change only where their text does."""

from __future__ import annotations

import re
from collections.abc import Iterable
from pathlib import Path

_SPECIAL = re.compile(r"([\\`*_\[\]<>${}|#])")
_OPTION = re.compile(r"(?<![\w-])(--[a-z][a-z0-9-]*)")


def plain(text: str) -> str:
    """Return text whose characters mean nothing to Markdown, options of commands as code."""
    parts = _OPTION.split(" ".join(text.split()))
    return "".join(f"`{part}`" if i % 2 else _SPECIAL.sub(r"\\\1", part) for i, part in enumerate(parts))


def described(items: Iterable[tuple[str, str]]) -> str:
    """Return terms with what they mean, as a definition list."""
    return "\n".join(f"{term}\n: {meaning or '–'}\n" for term, meaning in items)


def write(folder: Path, texts: dict[str, str]) -> None:
    """Make the folder hold these files and no others; what stays as it was is not built anew."""
    folder.mkdir(parents=True, exist_ok=True)
    for path in folder.iterdir():
        if path.name not in texts:
            path.unlink()
    for name, text in texts.items():
        path = folder / name
        if not path.exists() or path.read_text(encoding="utf-8") != text:
            path.write_text(text, encoding="utf-8")


def contents(pages: Iterable[str], hidden: bool = False) -> str:
    return "\n".join(["```{toctree}", ":hidden:" if hidden else ":maxdepth: 2", "", *pages, "```", ""])
