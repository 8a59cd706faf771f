"""Nouns that show themselves: a line of text by themselves, table, figure and file through a door that opens when it is asked.

Physics draws and writes nothing: a noun says by its base that it can be drawn or saved, and the top floor knows how.
"""

from __future__ import annotations

from importlib import import_module
from pathlib import Path
from typing import Any

# by name and late: whoever computes needs neither figures nor files; an import, even a late one, would have every module reach every other
_DOOR = "rcsa_ident.front.notebook"


class Shown:
    """A noun that says what it is: its `str` is a line or two, a notebook shows a table or a figure."""

    __slots__ = ()

    def __repr__(self) -> str:
        return f"<{type(self).__name__} {self}>"

    def _repr_html_(self) -> str:
        text: str = import_module(_DOOR).html(self)
        return text


class Saved(Shown):
    """A noun with a file format of its own."""

    __slots__ = ()

    def save(self, path: str | Path) -> Path:
        """Write it in the format that the path's suffix says, one that the command line reads and writes, and return the path."""
        written: Path = import_module(_DOOR).save(self, Path(path))
        return written


class Drawn(Saved):
    """A noun with a figure, which can be saved as a picture."""

    __slots__ = ()

    def plot(self, **options: Any) -> Any:
        """Draw it, and return the figure's matplotlib axes, an array where there are several; `axes.figure` is the figure.

        Parameters
        ----------
        **options
            Of the figure's function: see `rcsa_ident.front.notebook.figure_of`.
        """
        return import_module(_DOOR).plot(self, **options)
