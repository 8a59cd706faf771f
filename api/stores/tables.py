"""Tables, and migrations of earlier versions."""

from __future__ import annotations

from collections.abc import Callable, Mapping
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
    insert,
    inspect,
    literal,
    select,
    text,
    update,
)
from sqlalchemy.schema import CreateColumn

from api.stores.entities import digest_of
from rcsa_ident.errors import InputError

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


def _repeats(name: str, *further: Column) -> Table:
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
        _stored(),
        Index(f"ix_{name}_stored", "group", "stored"),
    )


identifications = _documents("identifications")
toolings = _documents("toolings")
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


def _missing_tables(connection: Connection) -> None:
    metadata.create_all(connection)


def _kept_versions(connection: Connection) -> None:
    """Versions with who, when and why; keys that expire; jobs that know who asked for them."""
    metadata.create_all(connection)
    _add_columns(connection, keys, jobs)
    _first_versions(connection)


def _add_columns(connection: Connection, *changed: Table) -> None:
    """Add the columns that tables do not have yet."""
    for table in changed:
        there = {column["name"] for column in inspect(connection).get_columns(table.name)}
        for column in (each for each in table.c if each.name not in there):
            words = CreateColumn(column).compile(dialect=connection.dialect)
            connection.execute(text(f"ALTER TABLE {table.name} ADD COLUMN {words}"))


def _first_versions(connection: Connection) -> None:
    """What is there is version 1, whoever wrote it."""
    m, i, d = machines, identifications, toolings
    nothing, unknown = (literal(""),) * 3, (literal(1), literal("made"), literal(0))
    name_of = select(m.c.name).where(m.c.group == i.c.group, m.c.id == i.c.name).scalar_subquery()
    for kind, table, name, title, when, content in (
        ("machine", m, m.c.id, m.c.name, m.c.created, nothing),
        ("identification", i, i.c.name, func.coalesce(name_of, i.c.name), i.c.changed, (i.c.text, i.c.summary, i.c.digest)),
        ("tooling", d, d.c.name, d.c.name, d.c.changed, (d.c.text, d.c.summary, d.c.digest)),
    ):
        who = (literal(""), literal(""), literal("it was there before versions were kept"))
        query = select(table.c.group, literal(kind), name, title, *unknown, when, *who, *content).order_by(name)
        names = [column.name for column in changes.c if column.name not in ("id", "stored")]
        connection.execute(insert(changes).from_select(names, query, include_defaults=False))


def _digests(connection: Connection) -> None:
    """A digest beside every text and every file; what is there counts as whole."""
    _add_columns(connection, campaigns, recordings, job_texts)
    for table in (campaigns, job_texts):
        own = list(table.primary_key)
        # one text after the other: together they may be larger than the memory
        for row in connection.execute(select(*own)).all():
            here = [column == value for column, value in zip(own, row, strict=True)]
            content = connection.execute(select(table.c.text).where(*here)).scalar_one()
            connection.execute(update(table).where(*here).values(digest=digest_of(content)))


#: What the groups' quotas count, by the names that people read; what jobs say and come to counts with them.
COUNTED = {
    "machines": (machines,),
    "toolings": (toolings,),
    "identifications": (identifications,),
    "versions": (changes,),
    "campaigns": (campaigns,),
    "recordings": (recordings,),
    "jobs": (jobs,),
    "keys": (keys,),
    "repeated_calls": (repeats, campaign_repeats, job_repeats),
}


def _sizes(connection: Connection) -> None:
    """A size of every row, and an index that sums them for each group."""
    counted = [table for each in COUNTED.values() for table in each]
    _add_columns(connection, *counted, job_events, job_texts)
    for table in (*counted, job_events, job_texts):
        for index in table.indexes:
            index.create(connection, checkfirst=True)
        texts = [column for column in table.c if isinstance(column.type, String)]
        connection.execute(update(table).values(stored=sum((func.coalesce(bytes_of(connection, c), 0) for c in texts), literal(ROW))))
    connection.execute(update(jobs).values(stored=size_of_job(connection)))


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


#: Migrations from version k + 1 to k + 2, in order; a released one is never edited.
MIGRATIONS: tuple[Callable[[Connection], None], ...] = (_missing_tables, _kept_versions, _digests, _sizes)
SCHEMA_VERSION = 1 + len(MIGRATIONS)


def migrate(connection: Connection) -> None:
    """Migrate the store to the current version in one transaction; a later version is refused."""
    if not inspect(connection).has_table("meta"):
        metadata.create_all(connection)
        connection.execute(insert(meta).values(schema_version=SCHEMA_VERSION))
        return
    version = connection.execute(select(meta.c.schema_version)).scalar_one()
    if version > SCHEMA_VERSION:
        raise InputError("store", f"schema version {version}", f"at most {SCHEMA_VERSION}: a later release has written it")
    for step in MIGRATIONS[version - 1 :]:
        step(connection)
    connection.execute(update(meta).values(schema_version=SCHEMA_VERSION))
