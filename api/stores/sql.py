"""The store in a SQL database: one table per entity."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from datetime import datetime
from typing import Any

from sqlalchemy import Connection, Engine, Select, Table, delete, insert, select, update
from sqlalchemy.exc import IntegrityError

from api.stores import tables
from api.stores.campaigns import Campaigns, Recordings
from api.stores.changes import IDENTIFICATION, MACHINE, ROBOT, TOOLING, UNSIGNED, Changes, Note
from api.stores.database import Database, open_engine
from api.stores.entities import ABSENT, Document, Documents, Expected, Key, Keys, Machine, Machines, Stale, Taken, whole
from api.stores.idempotency import earlier, forget_old
from api.stores.jobs import Jobs
from api.stores.sql_campaigns import SqlCampaigns, SqlRecordings, delete_campaigns
from api.stores.sql_changes import SqlChanges, log_deleted, log_document, log_machine
from api.stores.sql_jobs import SqlJobs, forget_jobs

_KEY, _MACHINE = tables.columns_of(tables.keys, Key), tables.columns_of(tables.machines, Machine)


def open_store(url: str, group_bytes: int = 1 << 62) -> SqlStore:
    """Return the store of a database, made or migrated where needed; each group may keep so many bytes in it."""
    return SqlStore(open_engine(url), group_bytes)


class SqlStore(Database):
    """The store in one database."""

    def __init__(self, engine: Engine, group_bytes: int = 1 << 62) -> None:
        super().__init__(engine, group_bytes)
        self.keys: Keys = SqlKeys(self)
        self.machines: Machines = SqlMachines(self)
        self._identifications = SqlDocuments(self, tables.identifications, IDENTIFICATION)
        self._toolings = SqlDocuments(self, tables.toolings, TOOLING)
        self.identifications: Documents = self._identifications
        self.toolings: Documents = self._toolings
        self.robots: Documents = SqlDocuments(self, tables.robots, ROBOT)
        self.changes: Changes = SqlChanges(self)
        self.campaigns: Campaigns = SqlCampaigns(self)
        self.recordings: Recordings = SqlRecordings(self)
        self.jobs: Jobs = SqlJobs(self)

    def put_together(self, toolings: Sequence[Expected], identification: Expected | None, note: Note = UNSIGNED) -> None:
        # in the order of names: two writers of the same never wait for each other
        writes = [(self._toolings, *each) for each in sorted(toolings, key=lambda each: each[0].name)]
        writes += [] if identification is None else [(self._identifications, *identification)]
        try:
            with self.writing() as connection:
                for documents, document, expected in writes:
                    documents.put_in(connection, document, expected, note)
        except IntegrityError:
            self.put_together(toolings, identification, note)

    def forget_repeats(self, now: datetime) -> None:
        with self.writing() as connection:
            for table in tables.COUNTED["repeated_calls"]:
                forget_old(connection, table, now)


class SqlKeys:
    """Keys in a table."""

    def __init__(self, store: SqlStore) -> None:
        self.store = store

    def add(self, key: Key) -> None:
        with self.store.writing() as connection:
            row = asdict(key) | {"scopes": " ".join(key.scopes)}
            self.store.check_room(connection, key.group, tables.size_of(row))
            connection.execute(insert(tables.keys).values(row))

    def get(self, id: str) -> Key | None:
        with self.store.reading() as connection:
            row = connection.execute(select(*_KEY).where(tables.keys.c.id == id)).first()
        return None if row is None else _key(row)

    def use(self, id: str, when: str) -> None:
        with self.store.writing() as connection:
            connection.execute(update(tables.keys).where(tables.keys.c.id == id).values(used=when))

    def list(self, group: str, after: str, limit: int) -> list[Key]:
        t = tables.keys
        with self.store.reading() as connection:
            rows = connection.execute(select(*_KEY).where(t.c.group == group, t.c.id > after).order_by(t.c.id).limit(limit)).all()
        return [_key(row) for row in rows]

    def delete(self, group: str, id: str) -> bool:
        with self.store.writing() as connection:
            found = connection.execute(delete(tables.keys).where(tables.keys.c.group == group, tables.keys.c.id == id))
            return found.rowcount > 0


def _key(row: Any) -> Key:
    data = row._asdict()
    return Key(**data | {"scopes": tuple(data["scopes"].split())})


def _first(row: Any) -> Machine:
    return Machine(row.id, row.group, row.name, row.description, row.created)


class SqlMachines:
    """Machines in a table."""

    def __init__(self, store: SqlStore) -> None:
        self.store = store

    def add(self, machine: Machine, repeat: tuple[str, str] | None = None, note: Note = UNSIGNED) -> Machine:
        r = tables.repeats
        try:
            with self.store.writing() as connection:
                if repeat is not None:
                    forget_old(connection, r)
                    first = earlier(connection, r, machine.group, repeat)
                    if first is not None:
                        return _first(first)
                    connection.execute(insert(r).values(asdict(machine) | {"key": repeat[0], "digest": repeat[1]}))
                self.store.check_room(connection, machine.group, tables.size_of(asdict(machine)))
                connection.execute(insert(tables.machines).values(asdict(machine)))
                log_machine(connection, machine.group, machine.id, machine.created, note)
                return machine
        except IntegrityError:
            # another writer was first, or has the name
            with self.store.reading() as connection:
                first = None if repeat is None else earlier(connection, r, machine.group, repeat)
            if first is None:
                raise Taken("name") from None
            return _first(first)

    def get(self, group: str, id: str) -> Machine | None:
        t = tables.machines
        with self.store.reading() as connection:
            row = connection.execute(select(*_MACHINE).where(t.c.group == group, t.c.id == id)).first()
        return None if row is None else Machine(**row._asdict())

    def list(self, group: str, after: str, limit: int) -> list[Machine]:
        t = tables.machines
        with self.store.reading() as connection:
            rows = connection.execute(select(*_MACHINE).where(t.c.group == group, t.c.id > after).order_by(t.c.id).limit(limit)).all()
        return [Machine(**row._asdict()) for row in rows]

    def delete(self, group: str, id: str, note: Note = UNSIGNED) -> bool:
        t, i, c = tables.machines, tables.identifications, tables.campaigns
        here = (t.c.group == group, t.c.id == id)
        with self.store.writing() as connection:
            if connection.execute(select(t.c.id).where(*here).with_for_update()).first() is not None:
                log_deleted(connection, MACHINE, group, id, note)
            # the machine first: nothing can be added to it from now on
            there = connection.execute(delete(t).where(*here)).rowcount > 0
            connection.execute(delete(i).where(i.c.group == group, i.c.name == id))
            delete_campaigns(connection, select(c.c.id).where(c.c.group == group, c.c.machine == id))
            forget_jobs(connection, group, id)
            return there


class SqlDocuments:
    """Texts in a table."""

    def __init__(self, store: SqlStore, table: Table, kind: str) -> None:
        self.store, self.table, self.kind = store, table, kind
        self.columns = tables.columns_of(table, Document)

    def put(self, document: Document, expected: str | None = None, note: Note = UNSIGNED) -> bool:
        try:
            with self.store.writing() as connection:
                return self.put_in(connection, document, expected, note)
        except IntegrityError:
            # another writer stored the first text of that name at the same moment
            return self.put(document, expected, note)

    def put_in(self, connection: Connection, document: Document, expected: str | None, note: Note) -> bool:
        """Store a text within a transaction, as `put` does."""
        t, data = self.table, asdict(document)
        size = tables.size_of(data)
        here = (t.c.group == document.group, t.c.name == document.name)
        there = connection.execute(select(t.c.digest).where(*here).with_for_update()).scalar()
        if expected is not None and (there or ABSENT) != expected:
            raise Stale
        if there != document.digest:
            # the version that it leaves is as large
            self.store.check_room(connection, document.group, 2 * size)
        if there is None:
            connection.execute(insert(t).values(data))
        else:
            connection.execute(update(t).where(*here).values(data | {"stored": size}))
        if there != document.digest:
            log_document(connection, self.kind, data, note, there is None)
        return there is None

    def get(self, group: str, name: str) -> Document | None:
        t = self.table
        with self.store.reading() as connection:
            row = connection.execute(select(*self.columns).where(t.c.group == group, t.c.name == name)).first()
        if row is None:
            return None
        what = "identification of the machine" if self.kind == IDENTIFICATION else f"{self.kind} {name}"
        whole(row.text, row.digest, what, "write it again, or restore one of its versions")
        return Document(**row._asdict())

    def brief(self, group: str, name: str) -> Document | None:
        t = self.table
        with self.store.reading() as connection:
            row = connection.execute(self._brief().where(t.c.group == group, t.c.name == name)).first()
        return None if row is None else Document(**row._asdict(), text="")

    def _brief(self) -> Select[Any]:
        return select(*(column for column in self.columns if column.name != "text"))

    def list(self, group: str, after: str, limit: int) -> list[Document]:
        t = self.table
        with self.store.reading() as connection:
            rows = connection.execute(self._brief().where(t.c.group == group, t.c.name > after).order_by(t.c.name).limit(limit)).all()
        return [Document(**row._asdict(), text="") for row in rows]

    def delete(self, group: str, name: str, expected: str | None = None, note: Note = UNSIGNED) -> bool:
        t = self.table
        here = (t.c.group == group, t.c.name == name)
        with self.store.writing() as connection:
            there = connection.execute(select(t.c.digest).where(*here).with_for_update()).scalar()
            if expected is not None and (there or ABSENT) != expected:
                raise Stale
            if there is not None:
                log_deleted(connection, self.kind, group, name, note)
            return connection.execute(delete(t).where(*here)).rowcount > 0
