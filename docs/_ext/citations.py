"""Sources in square brackets, as docstrings and pages write them, become links to the site's bibliography."""

from __future__ import annotations

import re
from typing import Any

from pybtex.plugin import register_plugin
from pybtex.style.formatting.unsrt import Style
from pybtex.style.labels import BaseLabelStyle
from sphinx.application import Sphinx

#: As tests/architecture/test_references.py asks for it: author and year, or the main source.
CITED = re.compile(r"(?<![\w*`\]])\[([a-z]+\d{4}[a-z]?|inprocess)\](?![(\[:])")


class KeyLabels(BaseLabelStyle):
    """A source is called by its key."""

    def format_labels(self, sorted_entries: list[Any]) -> Any:
        return (entry.key for entry in sorted_entries)


class Keys(Style):
    """Plain entries, in the order of their keys, each called by its key."""

    default_sorting_style = "author_year_title"
    default_label_style = KeyLabels


def in_docstring(_app: Sphinx, _what: str, _name: str, _thing: object, _options: object, lines: list[str]) -> None:
    lines[:] = [CITED.sub(r":cite:`\1`", line) for line in lines]


def in_page(_app: Sphinx, docname: str, source: list[str]) -> None:
    """Leave code as it is, what stands between backticks and fenced blocks, and the gallery, which is no Markdown and cites by itself."""
    if docname == "references" or docname.startswith("gallery/") or "[" not in source[0]:
        return
    parts = re.split(r"(^```.*?^```|^:::.*?^:::|`[^`\n]*`)", source[0], flags=re.DOTALL | re.MULTILINE)
    source[0] = "".join(part if i % 2 else CITED.sub(r"{cite}`\1`", part) for i, part in enumerate(parts))


def setup(app: Sphinx) -> dict[str, Any]:
    register_plugin("pybtex.style.formatting", "keys", Keys)
    app.connect("autodoc-process-docstring", in_docstring, priority=100)
    app.connect("source-read", in_page)
    return {"parallel_read_safe": True}
