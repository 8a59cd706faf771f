"""Migrations of the store: a database of an earlier release becomes one of this release, or stays as it was.

The revisions stand in ``versions``, one file each; a released one is never edited. The next one is drafted by
``alembic -x url=sqlite:///FILE revision --autogenerate --rev-id NUMBER -m WORDS`` from what the tables have and FILE lacks.
"""

from __future__ import annotations

from pathlib import Path

from sqlalchemy import Column, Connection, MetaData, PrimaryKeyConstraint, String, Table, insert, inspect, select

from api.stores import tables
from rcsa_ident.base.errors import InputError

#: What Alembic reads.
SCRIPTS = Path(__file__).parent
#: Number of the newest revision.
SCHEMA_VERSION = 9
#: Where Alembic keeps the number, as it makes the table itself.
_kept = Table(
    "alembic_version", MetaData(), Column("version_num", String(32)), PrimaryKeyConstraint("version_num", name="alembic_version_pkc")
)


def version_of(connection: Connection) -> str:
    """Return the number of a store's newest revision; empty where there is no store yet.

    Raises `InputError`: a later release has written it, or it has no number.
    """
    there = inspect(connection)
    if there.has_table(_kept.name):
        found = list(connection.execute(select(_kept.c.version_num)).scalars())
    elif there.has_table(tables.meta.name):
        found = [str(each) for each in connection.execute(select(tables.meta.c.schema_version)).scalars()]
    else:
        return ""
    if len(found) != 1:
        raise InputError("store", "no schema version" if not found else "several schema versions", "a database of this service")
    if not found[0].isdecimal() or int(found[0]) > SCHEMA_VERSION:
        raise InputError("store", f"schema version {found[0]}", f"at most {SCHEMA_VERSION}: a later release has written it")
    return found[0]


def migrate(connection: Connection) -> None:
    """Migrate the store to the current version in the transaction of the connection; a later version is refused."""
    version = version_of(connection)
    if not version:
        tables.metadata.create_all(connection)
        connection.execute(insert(tables.meta).values(schema_version=tables.SINCE_ALEMBIC))
        _keep(connection, str(SCHEMA_VERSION))
    elif int(version) < SCHEMA_VERSION:
        if int(version) < tables.SINCE_ALEMBIC:
            # version 2 grew for a while: its revision makes what is not there
            _keep(connection, "1" if version == "2" else version)
        _upgrade(connection)


def _keep(connection: Connection, version: str) -> None:
    _kept.create(connection)
    connection.execute(insert(_kept).values(version_num=version))


def _upgrade(connection: Connection) -> None:
    # takes a third of a second, which no start but this one should wait for
    from alembic import command
    from alembic.config import Config

    config = Config(attributes={"connection": connection})
    config.set_main_option("script_location", str(SCRIPTS).replace("%", "%%"))
    command.upgrade(config, "head")
