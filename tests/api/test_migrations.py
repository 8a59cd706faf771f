"""Stores of earlier releases become stores of this one, and lose nothing."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import closing, contextmanager
from pathlib import Path
from threading import Barrier
from typing import Any

import psutil
import pytest
from alembic.autogenerate import compare_metadata
from alembic.migration import MigrationContext
from sqlalchemy import Connection, Engine, MetaData, Table, create_engine, insert, inspect, select, text

from api.reading.stored import found_of
from api.stores import migrations, tables
from api.stores.campaigns import Campaign, Recording
from api.stores.entities import Document, Key, Machine, digest_of
from api.stores.sql import open_store
from rcsa_ident.base.errors import InputError
from tests.api.in_process import POSTGRESQL, SQLITE, database

EARLIER = Path(__file__).parents[1] / "fixtures" / "earlier_stores"
KINDS = pytest.mark.parametrize("kind", [SQLITE, pytest.param(POSTGRESQL, marks=pytest.mark.slow)])
VERSIONS = [int(path.stem.removeprefix("version_")) for path in sorted(EARLIER.glob("version_*.sql"))]


@pytest.fixture
def url(request: pytest.FixtureRequest, kind: str, tmp_path: Path) -> str:
    return database(request, kind, tmp_path)


@contextmanager
def engine(url: str) -> Iterator[Engine]:
    found = create_engine(url)
    try:
        yield found
    finally:
        found.dispose()


@contextmanager
def changing(url: str) -> Iterator[Connection]:
    with engine(url) as found, found.begin() as connection:
        yield connection


def earlier(url: str, version: int) -> None:
    """A store as the release with this version made it."""
    words = (EARLIER / f"version_{version}.sql").read_text(encoding="utf-8")
    if url.startswith("sqlite"):
        words = words.replace(' COLLATE "C"', "").replace("SERIAL", "INTEGER")
    with changing(url) as connection:
        for statement in words.split(";\n"):
            if statement.strip():
                connection.execute(text(statement))


def rows_of(url: str) -> dict[str, list[dict[str, Any]]]:
    with engine(url) as found, found.connect() as connection:
        there = MetaData()
        there.reflect(connection)
        return {t.name: [dict(row._mapping) for row in connection.execute(select(t).order_by(*t.primary_key))] for t in there.sorted_tables}


def value(table: str, column: Any, k: int) -> Any:
    """One that no other column and no other row has."""
    if column.type.python_type is not str:
        return 1 + k
    return f"Ä {k} {table} {column.name}"[: getattr(column.type, "length", None) or 99]


def filled(url: str) -> None:
    """Two rows in every table, with something in every column."""
    with changing(url) as connection:
        there = MetaData()
        there.reflect(connection)
        for table in (t for t in there.sorted_tables if t.name != "meta"):
            for k in range(2):
                connection.execute(insert(table).values({column.name: value(table.name, column, k) for column in table.c}))


def shape(url: str) -> dict[str, Any]:
    """Columns, keys and indexes of all tables; their order within a table is not part of it."""
    found: dict[str, Any] = {}
    with engine(url) as made:
        look = inspect(made)
        for name in look.get_table_names():
            columns = {c["name"]: (str(c["type"]), c["nullable"], c["default"] or None) for c in look.get_columns(name)}
            unique = sorted(tuple(each["column_names"]) for each in look.get_unique_constraints(name))
            indexes = {each["name"]: (tuple(each["column_names"]), bool(each["unique"])) for each in look.get_indexes(name)}
            found[name] = (columns, look.get_pk_constraint(name)["constrained_columns"], unique, indexes)
    return found


@KINDS
@pytest.mark.parametrize("version", VERSIONS)
def test_an_earlier_store_keeps_every_row(url, version):
    earlier(url, version)
    filled(url)
    before = rows_of(url)
    for _ in range(2):
        open_store(url).close()
        after = rows_of(url)
        for name, rows in before.items():
            if name == "meta":
                continue
            assert len(rows) == 2
            # a row that gets digests becomes larger
            own = [column for column in rows[0] if column != "stored"]
            assert [[row[column] for column in own] for row in after[name]] == [[row[column] for column in own] for row in rows], name
        assert after["alembic_version"] == [{"version_num": str(migrations.SCHEMA_VERSION)}]
        # whoever knows this number only refuses it
        assert after["meta"] == [{"schema_version": tables.SINCE_ALEMBIC}]


@KINDS
def test_migrated_tables_are_those_of_a_new_store(request, url, kind, tmp_path):
    (tmp_path / "new").mkdir()
    new = database(request, kind, tmp_path / "new")
    open_store(new).close()
    for version in VERSIONS:
        old = database(request, kind, folder(tmp_path, version))
        earlier(old, version)
        open_store(old).close()
        assert shape(old) == shape(new)
        with engine(old) as made, made.connect() as connection:
            assert compare_metadata(MigrationContext.configure(connection), tables.metadata) == []


def folder(tmp_path: Path, version: int) -> Path:
    made = tmp_path / str(version)
    made.mkdir()
    return made


@KINDS
def test_a_store_of_the_first_release(url):
    """What its users had is there, and is version 1 of the trail, which goes on."""
    earlier(url, 1)
    found, tool = '{"modes": "Ω"}', 'name = "T1"\n'
    with changing(url) as connection:
        for name, row in (
            ("machines", {"id": "m1", "group": "A", "name": "HPM", "description": "Halle 3", "created": "2026-01-01"}),
            ("machines", {"id": "m2", "group": "B", "name": "HPM", "description": "", "created": "2026-01-02"}),
            ("identifications", {"name": "m1", "text": found, "digest": digest_of(found)}),
            ("identifications", {"name": "gone", "text": found, "digest": digest_of(found)}),
            ("toolings", {"name": "T1", "text": tool, "digest": digest_of(tool)}),
            ("keys", {"id": "k1", "label": "shop", "scopes": "read run", "secret_hash": "5" * 64, "created": "2026-01-01"}),
        ):
            document = {"group": "A", "summary": "{}", "changed": "2026-01-01"} if "text" in row else {"group": "A"}
            there = Table(name, MetaData(), autoload_with=connection)
            connection.execute(insert(there).values(document | row))
    with closing(open_store(url)) as store:
        assert store.machines.get("A", "m1") == Machine("m1", "A", "HPM", "Halle 3", "2026-01-01")
        assert store.machines.get("B", "m2").name == "HPM"
        assert store.identifications.get("A", "m1").text == found
        assert store.toolings.get("A", "T1") == Document("A", "T1", tool, "{}", digest_of(tool), "2026-01-01")
        assert store.keys.get("k1") == Key("k1", "A", "shop", ("read", "run"), "5" * 64, "2026-01-01")
        assert [(c.kind, c.title, c.version, c.action, c.who) for c in reversed(store.changes.list("A", None, 9))] == [
            ("machine", "HPM", 1, "made", ""), ("identification", "gone", 1, "made", ""), ("identification", "HPM", 1, "made", ""),
            ("tooling", "T1", 1, "made", ""),
        ]  # fmt: skip
        assert store.changes.get("A", "tooling", "T1", 1).text == tool
        texts = ("A", "T1", tool, "{}", digest_of(tool), digest_of("{}"), "2026-01-01")
        assert store.usage("A")["toolings"] == 100 + sum(map(len, texts))
        store.toolings.put(Document("A", "T1", "new", "{}", digest_of("new"), "2026-02-01"))
        assert store.changes.list("A", None, 1)[0].version == 2
        campaign = Campaign("c1", "A", "m1", "C", "{}", 1, "2026-02-01")
        assert store.campaigns.add(campaign) == campaign


@KINDS
def test_digests_and_sizes_of_what_had_none(url):
    """What is there counts as whole; of samples whose hash nobody knows it is enough that they are there."""
    earlier(url, 3)
    row = {"campaign": "c1", "name": "a.h5", "group": "A", "role": "cut", "size": 1, "sha256": "0" * 64, "normalised": "1" * 64,
           "found": '{"verdict": {"usable": true}}', "usable": 1, "judged_with": "", "created": "2026-01-01"}  # fmt: skip
    job = {"id": "j1", "group": "A", "kind": "lobes", "machine": "m1", "request": "{}", "state": "done", "created": "2026-01-01",
           "seconds": 1.0, "attempts": 1, "events": 0}  # fmt: skip
    campaign = {"id": "c1", "group": "A", "machine": "m1", "name": "Ç", "text": '{"ü": "\\\\"}', "cuts": 1, "created": "2026-01-01",
                "changes": 1, "settled": 1}  # fmt: skip
    with changing(url) as connection:
        for name, values in (
            ("recordings", row), ("jobs", job), ("job_texts", {"job": "j1", "name": "answer", "text": "found"}), ("campaigns", campaign),
        ):  # fmt: skip
            connection.execute(insert(Table(name, MetaData(), autoload_with=connection)).values(values))
    with closing(open_store(url)) as store:
        assert store.campaigns.get("A", "c1").text == campaign["text"]
        assert store.jobs.text("j1", "answer") == "found"
        kept = store.recordings.get("A", "c1", "a.h5")
        assert found_of(kept) == {"verdict": {"usable": True}}
        assert kept == Recording(**{name: row[name] for name in row if name != "usable"})
        used = store.usage("A")
        assert used["recordings"] == 100 + sum(len(v) for v in row.values() if isinstance(v, str)) + 32
        # a hundred a row, and the bytes of its texts; a job with its texts and events
        assert used["campaigns"] == 100 + sum(len(str(v).encode()) for v in campaign.values() if isinstance(v, str)) + 32
        assert used["jobs"] == 100 + len("{}") + 100 + len("j1answerfound") + 32


def opened_elsewhere(url: str) -> int:
    """Exit code of a process that opens a store, 1 where it is not opened."""
    child = os.fork()
    if child == 0:
        try:
            open_store(url)
            os._exit(0)
        except Exception as error:
            os._exit(1 if re.search("nowhere|no answer", str(error)) else 2)
    return os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])


# the child opens a store and nothing else
@pytest.mark.filterwarnings("ignore:.*fork:DeprecationWarning")
@KINDS
@pytest.mark.parametrize(
    ("last", "code"), [('op.execute("SELECT nonsense FROM nowhere")', 1), ("os.kill(os.getpid(), 9)", -9)], ids=["fails", "is killed"]
)
def test_a_migration_that_ends_half_way_leaves_everything_as_it_was(url, tmp_path, monkeypatch, last, code):
    shutil.copytree(migrations.SCRIPTS, tmp_path / "scripts", ignore=shutil.ignore_patterns("__pycache__"))
    whole = (
        "import os\n\nfrom alembic import op\nimport sqlalchemy as sa\n\n"
        f'revision, down_revision = "99", "{migrations.SCHEMA_VERSION}"\n\n\ndef upgrade():\n'
        '    op.create_table("further", sa.Column("id", sa.Integer))\n'
        '    with op.batch_alter_table("toolings", recreate="always") as batch:\n'
        '        batch.add_column(sa.Column("note", sa.String(9), server_default="none"))\n'
        "    op.execute(\"UPDATE toolings SET text = 'changed'\")\n"
    )
    further = tmp_path / "scripts" / "versions" / "v99_further.py"
    further.write_text(f"{whole}    {last}\n", encoding="utf-8")
    earlier(url, 2)
    filled(url)
    before, tables_before = rows_of(url), shape(url)
    monkeypatch.setattr(migrations, "SCRIPTS", tmp_path / "scripts")
    monkeypatch.setattr(migrations, "SCHEMA_VERSION", 99)
    assert opened_elsewhere(url) == code
    assert (rows_of(url), shape(url)) == (before, tables_before)
    # mended, it goes through; the release before refuses what it has made
    further.write_text(whole, encoding="utf-8")
    for _ in range(2):
        open_store(url).close()
    assert {row["note"] for row in rows_of(url)["toolings"]} == {"none"}
    monkeypatch.undo()
    with pytest.raises(InputError, match=f"schema version 99, allowed is at most {migrations.SCHEMA_VERSION}: a later release"):
        open_store(url)


@KINDS
def test_those_who_start_at_the_same_moment_migrate_once(url):
    """As the service and its workers do."""
    earlier(url, 2)
    filled(url)
    together = Barrier(4)

    def opened(_):
        together.wait()
        with closing(open_store(url)) as store:
            return len(store.changes.list("Ä 0 toolings group", None, 9))

    with ThreadPoolExecutor(4) as threads:
        assert list(threads.map(opened, range(4))) == [1, 1, 1, 1]


def test_a_store_that_is_refused_is_not_left_open(tmp_path):
    url = f"sqlite:///{tmp_path / 'store.db'}"
    open_store(url).close()
    with changing(url) as connection:
        connection.execute(text("UPDATE alembic_version SET version_num = '99'"))
    # the error holds what was open when it was raised
    with pytest.raises(InputError) as refused:
        open_store(url)
    assert [file.path for file in psutil.Process().open_files() if Path(file.path).parent == tmp_path] == []
    assert refused.value.field == "store"


@KINDS
@pytest.mark.parametrize("harm", ["DELETE FROM alembic_version", "UPDATE alembic_version SET version_num = 'ae1027a6acf'"])
def test_a_number_that_says_nothing(url, harm):
    open_store(url).close()
    with changing(url) as connection:
        connection.execute(text(harm))
    with pytest.raises(InputError, match="schema version"):
        open_store(url)


def test_a_start_that_migrates_nothing_does_not_wait_for_alembic(tmp_path):
    code = "import sys; from api.stores.sql import open_store; open_store(sys.argv[1]).close(); print('alembic' in sys.modules)"
    for _ in ("new", "there"):
        command = [sys.executable, "-c", code, f"sqlite:///{tmp_path / 's.db'}"]
        assert subprocess.run(command, capture_output=True, text=True, check=True).stdout.strip() == "False"
