"""Columns of tables that nobody has asked for: they are named, never dropped in silence."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar

from rcsa_ident.io.validated_table import listed

#: File of each table that was read, and its columns that are still unread.
_tables: ContextVar[list[tuple[str, list[str]]] | None] = ContextVar("tables", default=None)


@contextmanager
def reading_tables() -> Iterator[None]:
    """Gather what is left of the tables that are read meanwhile, for `left_aside`."""
    token = _tables.set([])
    try:
        yield
    finally:
        _tables.reset(token)


def unread_of(where: str, header: tuple[str, ...]) -> list[str]:
    """Return the columns of a table that begins to be read; its reader takes out of the list what it asks for."""
    unread = [name for name in header if name]
    if (tables := _tables.get()) is not None:
        tables.append((where, unread))
    return unread


def left_aside() -> list[str]:
    """Return a sentence on each file with columns that nobody has read since `reading_tables` began, or since this was asked."""
    tables = _tables.get() or []
    # of a file that was read twice each reader may take its own columns
    left = {where: [name for name in own if all(name in other for place, other in tables if place == where)] for where, own in tables}
    tables.clear()
    return [f"{where}: {_sentence(names)}" if where else _sentence(names) for where, names in left.items() if names]


def _sentence(names: list[str]) -> str:
    return f"the column {names[0]} is left aside" if len(names) == 1 else f"the columns {listed(names)} are left aside"
