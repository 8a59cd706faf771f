"""Calls that come again: an idempotency key is answered as the first time, for a day."""

from __future__ import annotations

from datetime import UTC, datetime, timedelta
from typing import Any

from sqlalchemy import Connection, Table, delete, select

from api.stores.entities import Taken

#: How long a key is remembered.
REMEMBERED = timedelta(days=1)


def earlier(connection: Connection, table: Table, group: str, repeat: tuple[str, str]) -> Any | None:
    """Return the row of the first call with this key, or None.

    Parameters
    ----------
    repeat : (str, str)
        The key, and the digest of the call.

    Raises
    ------
    Taken
        That call was another.
    """
    row = connection.execute(select(table).where(table.c.group == group, table.c.key == repeat[0])).first()
    if row is not None and row.digest != repeat[1]:
        raise Taken("idempotency key")
    return row


def forget_old(connection: Connection, table: Table) -> None:
    """Remove the keys that are no longer remembered."""
    connection.execute(delete(table).where(table.c.created < (datetime.now(UTC) - REMEMBERED).isoformat()))
