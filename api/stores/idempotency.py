"""Idempotency keys: a repeated call gets the first answer, for a day."""

from __future__ import annotations

from datetime import UTC, datetime, timedelta
from typing import Any

from sqlalchemy import Connection, Table, delete, select

from api.stores.entities import Taken

#: Lifetime of an idempotency key.
REMEMBERED = timedelta(days=1)


def earlier(connection: Connection, table: Table, group: str, repeat: tuple[str, str]) -> Any | None:
    """Return the row of the first call with this key, or None.

    `repeat`: (str, str); key, and digest of the call
    Raises `Taken`: the first call had other content.
    """
    row = connection.execute(select(table).where(table.c.group == group, table.c.key == repeat[0])).first()
    if row is not None and row.digest != repeat[1]:
        raise Taken("idempotency key")
    return row


def forget_old(connection: Connection, table: Table, now: datetime | None = None) -> None:
    """Remove expired keys."""
    connection.execute(delete(table).where(table.c.created < ((now or datetime.now(UTC)) - REMEMBERED).isoformat()))
