"""Connections to a database: SQLite in WAL mode, or PostgreSQL."""

from __future__ import annotations

from typing import Any

from sqlalchemy import URL, Connection, Engine, create_engine, event

_BUSY_MS = 5000


def engine_of(url: str | URL) -> Engine:
    """Return the engine of a database as it is; raises what SQLAlchemy raises where the URL names none."""
    engine = create_engine(url, pool_pre_ping=not str(url).startswith("sqlite"))
    if engine.dialect.name == "sqlite":
        event.listen(engine, "connect", _sqlite)
        event.listen(engine, "begin", _begin)
    return engine


def _sqlite(connection: Any, _record: Any) -> None:
    """Set WAL mode (readers do not wait for a writer) and full synchronisation (commits survive a loss of power)."""
    # transactions begin where SQLAlchemy begins them, not at the first write: what changes tables is part of them
    connection.isolation_level = None
    for pragma in ("journal_mode=WAL", "synchronous=FULL", f"busy_timeout={_BUSY_MS}", "foreign_keys=ON"):
        connection.execute(f"PRAGMA {pragma}")


def _begin(connection: Connection) -> None:
    wanted = "IMMEDIATE" if connection.get_execution_options().get("writes", True) else "DEFERRED"
    connection.exec_driver_sql(f"BEGIN {wanted}")
