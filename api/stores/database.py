"""The database and its transactions, the same statements on SQLite and on PostgreSQL."""

from __future__ import annotations

import sqlite3
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from sqlalchemy import URL, Connection, Engine, create_engine, func, select, text
from sqlalchemy.engine import make_url
from sqlalchemy.exc import ArgumentError, DBAPIError, IntegrityError, NoSuchModuleError, OperationalError, TimeoutError

from api.stores import tables
from api.stores.engines import engine_of
from api.stores.entities import Destroyed, NoRoom, Unavailable
from api.stores.migrations import migrate, version_of
from rcsa_ident.base.errors import InputError

#: Time [s] for which a count of a group's rows is added to instead of taken again: among very many rows it takes a while.
COUNTED = 5.0
#: Codes by which SQLite and PostgreSQL say that a file is no database, or that pages of it are damaged.
_DESTROYED = {11, 26, "XX001", "XX002"}


def open_engine(url: str) -> Engine:
    """Return the engine of a database whose tables have been made or migrated."""
    try:
        parsed = make_url(url)
        engine = engine_of(parsed)
    except (ArgumentError, NoSuchModuleError, ModuleNotFoundError) as error:
        # the URL may hold a password: the message names the error only
        allowed = "a URL as sqlite:///FILE or postgresql+psycopg://USER@HOST/NAME, with its driver installed"
        raise InputError("RCSA_IDENT_DATABASE", type(error).__name__, allowed) from None
    try:
        with engine.begin() as connection:
            if engine.dialect.name == "postgresql":
                # service and workers may find a new database at the same moment
                connection.execute(text("SELECT pg_advisory_xact_lock(7243451)"))
            migrate(connection)
    except InputError:
        engine.dispose()
        raise
    except (DBAPIError, sqlite3.DatabaseError) as error:
        engine.dispose()
        if _destroyed(error):
            found = f"a database that is damaged ({getattr(error, 'orig', error)})"
            raise InputError("RCSA_IDENT_DATABASE", found, f"a whole one in {parsed.render_as_string()}: restore a backup") from None
        if not isinstance(error, OperationalError):
            raise
        raise InputError("RCSA_IDENT_DATABASE", "no answer", f"a database that can be opened ({parsed.render_as_string()})") from None
    return engine


def version_in(file: Path) -> str:
    """Return the schema version of an embedded database, which is left as it is; empty where it holds no store.

    Raises `InputError`: a later release has written it.
    Raises `ValueError`: it holds something else.
    """
    engine = create_engine(URL.create("sqlite", database=str(file)))
    try:
        with engine.connect() as connection:
            return version_of(connection)
    except DBAPIError as error:
        raise ValueError(str(error.orig)) from None
    finally:
        engine.dispose()


def _destroyed(error: Exception) -> bool:
    """Whether an error says that the database is damaged."""
    cause = getattr(error, "orig", None) or error
    codes = {getattr(cause, "sqlite_errorcode", None) or 0, getattr(cause, "sqlstate", None)}
    return not _DESTROYED.isdisjoint({code & 0xFF if isinstance(code, int) else code for code in codes})


@contextmanager
def answering() -> Iterator[None]:
    """Raise `Unavailable` where a database does not answer whoever keeps tables of its own in one."""
    try:
        yield
    except (OperationalError, TimeoutError) as error:
        raise Unavailable from error


class Database:
    """Transactions on one database. `group_bytes`: that the rows of a group may take."""

    def __init__(self, engine: Engine, group_bytes: int = 1 << 62) -> None:
        self.engine, self.group_bytes, self.destroyed = engine, group_bytes, False
        #: When a group's rows were last counted, and what they have come to since; who is refused is counted again first.
        self.counted: dict[str, tuple[float, int]] = {}

    @contextmanager
    def writing(self) -> Iterator[Connection]:
        """Writing transaction; on SQLite one at a time. Nothing more is written to a database that is damaged."""
        if self.destroyed:
            raise Destroyed
        with self._answering(), self.engine.begin() as connection:
            yield connection

    @contextmanager
    def reading(self) -> Iterator[Connection]:
        """Reading transaction."""
        with self._answering(), self.engine.connect() as connection:
            yield connection.execution_options(writes=False)

    @contextmanager
    def _answering(self) -> Iterator[None]:
        try:
            yield
        except IntegrityError:
            raise
        except (DBAPIError, TimeoutError, sqlite3.DatabaseError) as error:
            if _destroyed(error):
                self.destroyed = True
                raise Destroyed from error
            if isinstance(error, OperationalError | TimeoutError | sqlite3.DatabaseError) or error.connection_invalidated:
                raise Unavailable from error
            raise

    def usage(self, group: str) -> dict[str, int]:
        with self.reading() as connection:
            return _usage(connection, group)

    def check_room(self, connection: Connection, group: str, more: int) -> None:
        """Raise `NoRoom` where so many more bytes of a group do not fit; what frees room is never refused."""
        counted, used = self.counted.get(group, (-COUNTED, 0))
        if time.monotonic() - counted >= COUNTED or used + more > self.group_bytes:
            counted, used = time.monotonic(), sum(_usage(connection, group).values())
        fits = used + more <= self.group_bytes
        self.counted[group] = (counted, used + more if fits else used)
        if not fits:
            raise NoRoom(used, self.group_bytes)

    def check(self) -> None:
        if self.destroyed:
            raise Destroyed
        with self.reading() as connection:
            connection.execute(text("SELECT 1"))

    def close(self) -> None:
        self.engine.dispose()


def _usage(connection: Connection, group: str) -> dict[str, int]:
    """Size of a group's rows by kind: sums over indexes, without a look at the rows."""
    found = {}
    for kind, counted in tables.COUNTED.items():
        sums = [select(func.coalesce(func.sum(t.c.stored), 0)).where(t.c.group == group).scalar_subquery() for t in counted]
        found[kind] = select(sum(sums[1:], sums[0])).scalar_subquery()
    row = connection.execute(select(*(each.label(kind) for kind, each in found.items()))).one()
    return {kind: int(size) for kind, size in row._mapping.items()}
