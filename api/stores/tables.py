"""Tables of the store."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from sqlalchemy import (
    BigInteger,
    Column,
    ColumnElement,
    Connection,
    Float,
    Index,
    Integer,
    LargeBinary,
    MetaData,
    String,
    Table,
    Text,
    UniqueConstraint,
    cast,
    func,
    literal,
    select,
)

#: What a row counts for beside its texts [bytes].
ROW = 100
metadata = MetaData()
# names compare by their bytes: the order of lists must not depend on the database's locale
_Name = String(128).with_variant(String(128, collation="C"), "postgresql")


def size_of(row: Mapping[str, Any]) -> int:
    """Return what a row counts for in its group's quota [bytes]."""
    return ROW + sum(len(value.encode("utf-8", "replace")) for value in row.values() if isinstance(value, str))


def _stored() -> Column[int]:
    """Size of a row, counted where the row is inserted; who changes its texts counts again."""
    return Column(
        "stored", BigInteger, nullable=False, server_default="0", default=lambda context: size_of(context.get_current_parameters())
    )


#: What releases before Alembic find where they kept the version, and refuse: it is above theirs.
SINCE_ALEMBIC = 6
meta = Table("meta", metadata, Column("schema_version", Integer, nullable=False))
keys = Table(
    "keys",
    metadata,
    Column("id", _Name, primary_key=True),
    Column("group", _Name, nullable=False, index=True),
    Column("label", String(200), nullable=False),
    Column("scopes", String(200), nullable=False),
    Column("secret_hash", String(64), nullable=False),
    Column("created", String(40), nullable=False),
    Column("expires", String(40)),
    Column("used", String(40)),
    _stored(),
    Index("ix_keys_stored", "group", "stored"),
)
machines = Table(
    "machines",
    metadata,
    Column("id", _Name, primary_key=True),
    Column("group", _Name, nullable=False),
    Column("name", _Name, nullable=False),
    Column("description", Text, nullable=False),
    Column("created", String(40), nullable=False),
    _stored(),
    UniqueConstraint("group", "name"),
    Index("ix_machines_stored", "group", "stored"),
)


def _repeats(name: str, *further: Column[Any]) -> Table:
    """Idempotency keys of one kind of call, with the id that the first call made."""
    return Table(
        name,
        metadata,
        Column("group", _Name, primary_key=True),
        Column("key", String(200), primary_key=True),
        Column("digest", String(64), nullable=False),
        Column("id", _Name, nullable=False),
        *further,
        Column("created", String(40), nullable=False, index=True),
        _stored(),
        Index(f"ix_{name}_stored", "group", "stored"),
    )


repeats = _repeats("idempotency_keys", Column("name", _Name, nullable=False), Column("description", Text, nullable=False))


def _documents(name: str) -> Table:
    return Table(
        name,
        metadata,
        Column("group", _Name, primary_key=True),
        Column("name", _Name, primary_key=True),
        Column("text", Text, nullable=False),
        Column("summary", Text, nullable=False),
        Column("digest", String(64), nullable=False),
        Column("changed", String(40), nullable=False),
        Column("summary_digest", String(64), nullable=False, server_default=""),
        _stored(),
        Index(f"ix_{name}_stored", "group", "stored"),
    )


identifications = _documents("identifications")
toolings = _documents("toolings")
robots = _documents("robots")
changes = Table(
    "changes",
    metadata,
    Column("id", Integer, primary_key=True, autoincrement=True),
    Column("group", _Name, nullable=False),
    Column("kind", String(16), nullable=False),
    Column("name", _Name, nullable=False),
    Column("title", _Name, nullable=False),
    Column("version", Integer, nullable=False),
    Column("action", String(16), nullable=False),
    Column("restores", Integer, nullable=False),
    Column("created", String(40), nullable=False),
    Column("key", _Name, nullable=False),
    Column("who", String(200), nullable=False),
    Column("why", String(400), nullable=False),
    Column("text", Text, nullable=False),
    Column("summary", Text, nullable=False),
    Column("digest", String(64), nullable=False),
    Column("summary_digest", String(64), nullable=False, server_default=""),
    UniqueConstraint("group", "kind", "name", "version"),
    _stored(),
    Index("ix_changes_group", "group", "id"),
    Index("ix_changes_stored", "group", "stored"),
)
_FileName = String(200).with_variant(String(200, collation="C"), "postgresql")
campaigns = Table(
    "campaigns",
    metadata,
    Column("id", _Name, primary_key=True),
    Column("group", _Name, nullable=False),
    Column("machine", _Name, nullable=False),
    Column("name", String(200), nullable=False),
    Column("text", Text, nullable=False),
    Column("digest", String(64), nullable=False, server_default=""),
    Column("cuts", Integer, nullable=False),
    Column("created", String(40), nullable=False),
    Column("changes", Integer, nullable=False),
    Column("settled", Integer, nullable=False),
    _stored(),
    Index("ix_campaigns_machine", "group", "machine"),
    Index("ix_campaigns_stored", "group", "stored"),
)
campaign_repeats = _repeats("campaign_idempotency_keys")
recordings = Table(
    "recordings",
    metadata,
    Column("campaign", _Name, primary_key=True),
    Column("name", _FileName, primary_key=True),
    Column("group", _Name, nullable=False, index=True),
    Column("role", String(8), nullable=False),
    Column("size", BigInteger, nullable=False),
    Column("sha256", String(64), nullable=False),
    Column("normalised", String(64), nullable=False),
    Column("found", Text, nullable=False),
    Column("usable", Integer, nullable=False),
    Column("judged_with", String(64), nullable=False),
    Column("created", String(40), nullable=False),
    Column("samples", String(64), nullable=False, server_default=""),
    Column("digest", String(64), nullable=False, server_default=""),
    _stored(),
    Index("ix_recordings_stored", "group", "stored"),
)

jobs = Table(
    "jobs",
    metadata,
    Column("id", _Name, primary_key=True),
    Column("group", _Name, nullable=False),
    Column("kind", String(32), nullable=False),
    Column("machine", _Name, nullable=False),
    Column("campaign", _Name),
    Column("request", Text, nullable=False),
    Column("state", String(16), nullable=False, index=True),
    Column("created", String(40), nullable=False),
    Column("progress", Text),
    Column("status", String(16)),
    Column("problem", Text),
    Column("started", String(40)),
    Column("finished", String(40)),
    Column("seconds", Float, nullable=False),
    Column("attempts", Integer, nullable=False),
    Column("worker", String(64)),
    Column("events", Integer, nullable=False),
    Column("key", _Name, nullable=False, server_default=""),
    Column("who", String(200), nullable=False, server_default=""),
    Column("watched", String(40)),
    Column("request_digest", String(64), nullable=False, server_default=""),
    _stored(),
    Index("ix_jobs_group", "group", "kind", "id"),
    Index("ix_jobs_stored", "group", "stored"),
)
job_repeats = _repeats("job_idempotency_keys")
job_events = Table(
    "job_events",
    metadata,
    Column("job", _Name, primary_key=True),
    Column("number", Integer, primary_key=True),
    Column("kind", String(16), nullable=False),
    Column("data", Text, nullable=False),
    Column("topic", String(32), nullable=False),
    _stored(),
)
job_texts = Table(
    "job_texts",
    metadata,
    Column("job", _Name, primary_key=True),
    Column("name", String(32), primary_key=True),
    Column("text", Text, nullable=False),
    Column("digest", String(64), nullable=False, server_default=""),
    _stored(),
)
job_workers = Table(
    "job_workers",
    metadata,
    Column("id", _Name, primary_key=True),
    Column("place", String(64), nullable=False),
    Column("process", String(64), nullable=False),
    Column("token", String(64), nullable=False),
    Column("beats", BigInteger, nullable=False),
)


#: What the groups' quotas count, by the names that people read; what jobs say and come to counts with them.
COUNTED = {
    "machines": (machines,),
    "toolings": (toolings,),
    "robots": (robots,),
    "identifications": (identifications,),
    "versions": (changes,),
    "campaigns": (campaigns,),
    "recordings": (recordings,),
    "jobs": (jobs,),
    "keys": (keys,),
    "repeated_calls": (repeats, campaign_repeats, job_repeats),
}


def bytes_of(connection: Connection, column: ColumnElement[str]) -> ColumnElement[int]:
    """Return the length of a text in UTF-8."""
    if connection.dialect.name == "sqlite":
        # its own function for this is younger than the libraries of some systems
        return func.length(cast(column, LargeBinary))
    return func.octet_length(column)


def size_of_job(connection: Connection) -> ColumnElement[int]:
    """Return the size of a job with its events, inputs and results."""
    parts = (select(func.coalesce(func.sum(t.c.stored), 0)).where(t.c.job == jobs.c.id).scalar_subquery() for t in (job_events, job_texts))
    return sum(parts, literal(ROW) + bytes_of(connection, jobs.c.request))


def columns_of(table: Table, entity: Any) -> list[Column[Any]]:
    """Return the columns that an entity is made of."""
    return [table.c[name] for name in entity.__dataclass_fields__]
