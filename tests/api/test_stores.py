"""What a store promises; the one on the disk keeps it through a restart."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import pytest
from sqlalchemy import text

from api.security import make_key, new_id, now
from api.stores import tables
from api.stores.records import ABSENT, Document, Machine, Stale, Taken, Unavailable, digest_of
from api.stores.sql import open_store
from rcsa_ident.errors import InputError


def document(group="A", name="T1", words="x"):
    return Document(group, name, words, "{}", digest_of(words), now())


def machine(group="A", name="M"):
    return Machine(new_id(), group, name, "", now())


def test_documents_are_kept_replaced_and_told_in_order(store):
    kept = store.toolings
    assert kept.put(document(name="b"))
    assert kept.put(document(name="B"))
    assert kept.put(document(name="a"))
    assert not kept.put(document(name="a", words="y"))
    assert kept.get("A", "a").text == "y"
    assert kept.brief("A", "a") == replace(kept.get("A", "a"), text="")
    assert kept.brief("A", "c") is None
    # by bytes, whatever the language of the machine
    assert [row.name for row in kept.list("A", "", 10)] == ["B", "a", "b"]
    assert [row.name for row in kept.list("A", "B", 1)] == ["a"]
    assert all(row.text == "" for row in kept.list("A", "", 10))
    assert kept.delete("A", "a")
    assert not kept.delete("A", "a")


def test_a_writer_may_say_what_it_has_seen(store):
    kept = store.toolings
    kept.put(document(), ABSENT)
    for expected in (ABSENT, digest_of("something else")):
        with pytest.raises(Stale):
            kept.put(document(words="y"), expected)
        with pytest.raises(Stale):
            kept.delete("A", "T1", expected)
    assert kept.get("A", "T1").text == "x"
    assert not kept.put(document(words="y"), digest_of("x"))
    with pytest.raises(Stale):
        kept.put(document(name="T2"), digest_of("x"))
    assert kept.delete("A", "T1", digest_of("y"))


def test_groups_see_nothing_of_each_other(store):
    mine, theirs = machine("A"), machine("B")
    store.machines.add(mine)
    store.machines.add(theirs)
    store.toolings.put(document("A", words="a"))
    store.toolings.put(document("B", words="b"))
    assert [m.id for m in store.machines.list("A", "", 9)] == [mine.id]
    assert store.machines.get("A", theirs.id) is None
    assert not store.machines.delete("A", theirs.id)
    assert store.toolings.get("A", "T1").text == "a"
    assert store.toolings.delete("A", "T1")
    assert store.toolings.get("B", "T1").text == "b"
    key, _ = make_key("B", ("read",), "")
    store.keys.add(key)
    assert store.keys.get(key.id) == key
    assert store.keys.list("A", "", 9) == []
    assert not store.keys.delete("A", key.id)
    assert store.keys.delete("B", key.id)


def test_a_name_is_there_once_and_a_repeated_query_too(store):
    first = machine()
    assert store.machines.add(first, ("k", "digest")) == first
    assert store.machines.add(machine(), ("k", "digest")) == first
    with pytest.raises(Taken, match="idempotency key"):
        store.machines.add(machine(name="N"), ("k", "other"))
    with pytest.raises(Taken, match="name"):
        store.machines.add(machine(), ("l", "digest"))
    # the refused one has left nothing behind
    assert store.machines.add(machine(name="N"), ("l", "digest")).name == "N"
    assert store.machines.add(machine("B"), ("k", "digest")).group == "B"
    assert len(store.machines.list("A", "", 9)) == 2


def test_an_identification_goes_with_its_machine(store):
    one = machine()
    store.machines.add(one)
    store.identifications.put(document(name=one.id))
    assert store.machines.delete("A", one.id)
    assert store.identifications.get("A", one.id) is None


def test_many_at_once_make_one(store):
    with ThreadPoolExecutor(8) as threads:
        made = list(threads.map(lambda _: store.machines.add(machine(), ("k", "d")), range(24)))
        put = list(threads.map(lambda i: store.toolings.put(document(words=str(i))), range(24)))
    assert len({m.id for m in made}) == 1
    assert sum(put) == 1


def test_a_restart_keeps_everything(tmp_path):
    url = f"sqlite:///{tmp_path / 's.db'}"
    store = open_store(url)
    one = machine()
    store.machines.add(one, ("k", "d"))
    store.toolings.put(document())
    store.close()
    again = open_store(url)
    assert again.machines.get("A", one.id) == one
    assert again.machines.add(machine(), ("k", "d")) == one
    assert again.toolings.get("A", "T1").text == "x"
    with again.reading() as connection:
        assert connection.execute(text("PRAGMA journal_mode")).scalar() == "wal"
        # full: a commit is on the disk
        assert connection.execute(text("PRAGMA synchronous")).scalar() == 2
    again.close()


def test_an_idempotency_key_is_forgotten_after_a_day(tmp_path):
    store = open_store(f"sqlite:///{tmp_path / 's.db'}")
    old = replace(machine(), created="2020-01-01T00:00:00+00:00")
    store.machines.add(old, ("k", "d"))
    assert store.machines.add(machine(name="N"), ("k", "other")).name == "N"
    store.close()


def test_an_earlier_store_is_brought_up_and_a_later_one_refused(tmp_path, monkeypatch):
    url = f"sqlite:///{tmp_path / 's.db'}"
    store = open_store(url)
    store.toolings.put(document())
    store.close()

    def step(connection):
        connection.execute(text("ALTER TABLE toolings ADD COLUMN note TEXT NOT NULL DEFAULT 'none'"))

    later_version = tables.SCHEMA_VERSION + 1
    monkeypatch.setattr(tables, "MIGRATIONS", (*tables.MIGRATIONS, step))
    monkeypatch.setattr(tables, "SCHEMA_VERSION", later_version)
    for _ in range(2):
        later = open_store(url)
        with later.reading() as connection:
            assert connection.execute(text("SELECT note FROM toolings")).scalar() == "none"
        later.close()
    monkeypatch.undo()
    with pytest.raises(InputError, match=f"schema version {later_version}"):
        open_store(url)


@pytest.mark.parametrize("url", ["nonsense", "sqlite:////no/such/folder/s.db", "mysterious://a:secret@b/c"])
def test_a_store_that_can_not_be_opened_says_so(url):
    with pytest.raises(InputError) as refused:
        open_store(url)
    assert refused.value.field == "RCSA_IDENT_DATABASE"
    assert "secret" not in str(refused.value)


def test_a_store_that_is_locked_is_unavailable(tmp_path, monkeypatch):
    monkeypatch.setattr("api.stores.database._BUSY_MS", 50)
    url = f"sqlite:///{tmp_path / 's.db'}"
    one, other = open_store(url), open_store(url)
    with one.writing() as connection:
        connection.execute(text("SELECT 1"))
        # who only reads is not held up
        assert other.toolings.list("A", "", 9) == []
        with pytest.raises(Unavailable):
            other.toolings.put(document())
    assert other.toolings.put(document())
    one.close()
    other.close()
