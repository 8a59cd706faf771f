"""The audit trail in a table: an entry is written in the transaction of its change."""

from __future__ import annotations

from datetime import UTC, datetime
from typing import Any

from sqlalchemy import ColumnElement, Connection, and_, delete, exists, func, insert, or_, select, update

from api.stores import tables
from api.stores.changes import CHANGED, DELETED, IDENTIFICATION, MACHINE, MADE, RESTORED, ROBOT, TOOLING, Change, Note
from api.stores.database import Database
from api.stores.entities import whole


def _holds() -> ColumnElement[bool]:
    """Whether a version is what is there now; a text that has come to harm is another one, which the version mends."""
    c, found = tables.changes, []
    for kind, t in ((TOOLING, tables.toolings), (ROBOT, tables.robots), (IDENTIFICATION, tables.identifications)):
        same = (t.c.group == c.c.group, t.c.name == c.c.name, t.c.digest == c.c.digest, t.c.text == c.c.text)
        found.append(and_(c.c.kind == kind, exists().where(*same)))
    return or_(*found).label("holds")


_CHANGE = [_holds() if name == "holds" else tables.changes.c[name] for name in Change.__dataclass_fields__]


class SqlChanges:
    """The trail in a table."""

    def __init__(self, store: Database) -> None:
        self.store = store

    def list(self, group: str, before: int | None, limit: int, kind: str | None = None, name: str | None = None) -> list[Change]:
        t = tables.changes
        query = select(*(column for column in _CHANGE if column.name != "text")).where(t.c.group == group)
        for column, wanted in ((t.c.kind, kind), (t.c.name, name)):
            query = query if wanted is None else query.where(column == wanted)
        query = query if before is None else query.where(t.c.id < before)
        with self.store.reading() as connection:
            rows = connection.execute(query.order_by(t.c.id.desc()).limit(limit)).all()
        return [Change(**row._asdict(), text="") for row in rows]

    def get(self, group: str, kind: str, name: str, version: int) -> Change | None:
        t = tables.changes
        here = (t.c.group == group, t.c.kind == kind, t.c.name == name, t.c.version == version)
        with self.store.reading() as connection:
            row = connection.execute(select(*_CHANGE).where(*here)).first()
        if row is not None and row.text:
            whole(row.text, row.digest, f"version {version} of {row.title}", "restore another one, or a backup")
        return None if row is None else Change(**row._asdict())

    def forget(self, before: str) -> int:
        t = tables.changes
        newest = select(func.max(t.c.id)).group_by(t.c.group, t.c.kind, t.c.name)
        with self.store.writing() as connection:
            return connection.execute(delete(t).where(t.c.created < before, t.c.id.not_in(newest))).rowcount


def log_document(connection: Connection, kind: str, row: dict[str, Any], note: Note, new: bool) -> None:
    """Log a text that has been written; `row` has the columns of its document."""
    action = RESTORED if note.restores else MADE if new else CHANGED
    content = {name: row[name] for name in ("text", "summary", "digest", "summary_digest")}
    _log(connection, kind, (row["group"], row["name"]), action, row["changed"], note, content)


def log_deleted(connection: Connection, kind: str, group: str, name: str, note: Note) -> None:
    """Log a deletion, before it happens. Nothing that a machine's identifications have said is kept longer than the machine."""
    when = datetime.now(UTC).isoformat(timespec="milliseconds")
    _log(connection, kind, (group, name), DELETED, when, note, {})
    t = tables.changes
    if kind == MACHINE:
        here = (t.c.group == group, t.c.kind == IDENTIFICATION, t.c.name == name)
        freed = tables.bytes_of(connection, t.c.text) + tables.bytes_of(connection, t.c.summary)
        connection.execute(update(t).where(*here).values(text="", summary="", stored=t.c.stored - freed))


def log_machine(connection: Connection, group: str, id: str, when: str, note: Note) -> None:
    """Log a machine that has been made."""
    _log(connection, MACHINE, (group, id), MADE, when, note, {})


def _log(connection: Connection, kind: str, thing: tuple[str, str], action: str, when: str, note: Note, content: dict[str, str]) -> None:
    t, m, (group, name) = tables.changes, tables.machines, thing
    here = (t.c.group == group, t.c.kind == kind, t.c.name == name)
    last = connection.execute(select(func.coalesce(func.max(t.c.version), 0)).where(*here)).scalar_one()
    title = name
    if kind in (MACHINE, IDENTIFICATION):
        title = connection.execute(select(m.c.name).where(m.c.group == group, m.c.id == name)).scalar() or name
    row = {"group": group, "kind": kind, "name": name, "title": title, "version": last + 1, "action": action, "created": when}
    noted = {"key": note.key, "who": note.who, "why": note.why, "restores": note.restores}
    connection.execute(insert(t).values({"text": "", "summary": "", "digest": ""} | content | row | noted))
