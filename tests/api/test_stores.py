"""What a store promises, on SQLite and on PostgreSQL; also through a restart."""

from __future__ import annotations

import hashlib
import json
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import pytest
from sqlalchemy import text

from api.security import make_key, new_id, now
from api.stores.campaigns import Campaign, Counts, Recording
from api.stores.entities import ABSENT, Document, Machine, Stale, Taken, Unavailable, digest_of
from api.stores.sql import open_store
from rcsa_ident.base.errors import InputError
from tests.fixtures.postgres import postgres, postgres_server  # noqa: F401


@pytest.fixture(params=["sqlite", pytest.param("postgresql", marks=pytest.mark.slow)])
def store(request, tmp_path):
    """Through the same statements."""
    url = f"sqlite:///{tmp_path / 'store.db'}" if request.param == "sqlite" else request.getfixturevalue("postgres")()
    found = open_store(url)
    yield found
    found.close()


def document(group="A", name="T1", words="x"):
    return Document(group, name, words, "{}", digest_of(words), now())


def machine(group="A", name="M"):
    return Machine(new_id(), group, name, "", now())


@pytest.mark.slow
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


@pytest.mark.slow
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


@pytest.mark.slow
def test_texts_that_belong_together_are_all_kept_or_none(store):
    m = machine()
    store.machines.add(m)
    store.toolings.put(document(), ABSENT)
    before, further = document(name=m.id, words="before"), (document(name="T2"), ABSENT)
    store.identifications.put(before, ABSENT)
    taught = document(name=m.id, words="taught")
    for toolings, expected in (
        ([(document(words="y"), digest_of("x")), further], "another"),
        ([(document(words="y"), "z")], before.digest),
    ):
        with pytest.raises(Stale):
            store.put_together(toolings, (taught, expected))
        assert store.toolings.get("A", "T1").text == "x"
        assert store.toolings.get("A", "T2") is None
        assert store.identifications.get("A", m.id).text == "before"
    store.put_together([(document(words="y"), digest_of("x")), further], (taught, before.digest))
    assert [store.toolings.get("A", name).text for name in ("T1", "T2")] == ["y", "x"]
    assert store.identifications.get("A", m.id).text == "taught"


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


def campaign(machine, group="A", name="C"):
    return Campaign(new_id(), group, machine.id, name, "{}", 1, now())


def recording(campaign, name="c.h5", content="a", role="cut", usable=True):
    found = json.dumps({"verdict": {"usable": usable}})
    sha256 = hashlib.sha256(content.encode()).hexdigest()
    normalised = hashlib.sha256(f"{content} read".encode()).hexdigest()
    return Recording(campaign.group, campaign.id, name, role, 3_000_000_000, sha256, normalised, found, "", now())


@pytest.fixture
def kept(store):
    """A campaign of a machine."""
    one = machine()
    store.machines.add(one)
    return store.campaigns.add(campaign(one))


def test_a_campaign_needs_its_machine_and_goes_with_it(store, kept):
    with pytest.raises(KeyError):
        store.campaigns.add(campaign(machine()))
    with pytest.raises(KeyError):
        store.campaigns.add(replace(campaign(machine()), machine=kept.machine, group="B"))
    store.recordings.put(recording(kept), False)
    assert store.campaigns.get("A", kept.id) == kept
    assert store.campaigns.get("B", kept.id) is None
    assert store.campaigns.list("A", kept.machine, "", 9) == [kept]
    assert store.recordings.of_machine("A", kept.machine) == [
        ("uploads", recording(kept).sha256),
        ("normalised", recording(kept).normalised),
    ]
    assert store.recordings.of_machine("B", kept.machine) == []
    assert store.machines.delete("A", kept.machine)
    assert store.campaigns.get("A", kept.id) is None
    assert store.recordings.list("A", kept.id, "", 9) == []
    assert store.recordings.kept("A") == {}


def test_a_repeated_query_makes_one_campaign(store, kept):
    again = replace(kept, id=new_id())
    made = store.campaigns.add(again, ("k", "d"))
    assert store.campaigns.add(replace(kept, id=new_id()), ("k", "d")) == made
    with pytest.raises(Taken, match="idempotency key"):
        store.campaigns.add(replace(kept, id=new_id()), ("k", "other"))
    assert store.campaigns.delete("A", made.id)
    # what is gone is made anew
    assert store.campaigns.add(replace(kept, id=new_id()), ("k", "d")).id != made.id


def test_many_campaigns_at_once_under_one_idempotency_key_are_one(store, kept):
    with ThreadPoolExecutor(8) as threads:
        made = list(threads.map(lambda _: store.campaigns.add(replace(kept, id=new_id()), ("k", "d")), range(16)))
    assert len({c.id for c in made}) == 1
    assert len(store.campaigns.list("A", kept.machine, "", 99)) == 2


def test_a_recording_is_kept_once_and_replaced_on_purpose_only(store, kept):
    first, other = recording(kept), recording(kept, content="b")
    assert store.recordings.put(first, False) is None
    assert store.recordings.put(replace(first, created="later"), False) == first
    with pytest.raises(Taken):
        store.recordings.put(other, False)
    assert store.recordings.get("A", kept.id, "c.h5") == first
    assert store.recordings.put(other, True) == first
    assert store.recordings.get("A", kept.id, "c.h5") == other
    assert store.recordings.get("B", kept.id, "c.h5") is None
    assert store.recordings.delete("B", kept.id, "c.h5") is None
    assert store.recordings.delete("A", kept.id, "c.h5") == other
    assert store.recordings.delete("A", kept.id, "c.h5") is None
    with pytest.raises(KeyError):
        store.recordings.put(replace(first, campaign="none"), False)
    with pytest.raises(KeyError):
        store.recordings.put(replace(first, group="B"), False)


def test_what_is_counted_of_a_campaign(store, kept):
    assert store.campaigns.counts("A", [kept.id]) == {}
    for name, role, usable in (("a", "cut", True), ("b", "cut", False), ("c", "air", True)):
        store.recordings.put(recording(kept, name, role=role, usable=usable), False)
    assert store.campaigns.counts("A", [kept.id, "none"]) == {kept.id: Counts(2, 1, 1)}
    assert store.campaigns.counts("B", [kept.id]) == {}
    assert [row.name for row in store.recordings.list("A", kept.id, "a", 9)] == ["b", "c"]
    assert [row.name for row in store.recordings.list("A", kept.id, "", 1)] == ["a"]
    assert list(store.recordings.groups()) == ["A"]
    assert len(store.recordings.kept("A")) == 2


def test_names_come_in_the_order_of_their_bytes(store, kept):
    for name in ("b.h5", "B.h5", "ä.h5", "a.h5"):
        store.recordings.put(recording(kept, name), False)
    assert [row.name for row in store.recordings.list("A", kept.id, "", 9)] == ["B.h5", "a.h5", "b.h5", "ä.h5"]
    assert [row.name for row in store.recordings.list("A", kept.id, "b.h5", 9)] == ["ä.h5"]


def test_a_verdict_is_written_on_what_was_judged_only(store, kept):
    first = recording(kept)
    store.recordings.put(first, False)
    better = replace(first, judged_with="air", found='{"verdict": {"usable": false}}')
    assert store.recordings.judge(first, better)
    assert store.recordings.get("A", kept.id, "c.h5") == better
    # somebody else has judged, or replaced, it meanwhile
    assert not store.recordings.judge(first, replace(first, judged_with="another"))
    store.recordings.put(recording(kept, content="b"), True)
    assert not store.recordings.judge(better, first)
    assert store.recordings.get("A", kept.id, "c.h5").sha256 == recording(kept, content="b").sha256


def test_verdicts_are_owed_until_somebody_says_they_stand(store, kept):
    assert store.campaigns.unsettled() == []
    store.recordings.put(recording(kept), False)
    seen = store.campaigns.changes("A", kept.id)
    assert store.campaigns.unsettled() == [("A", kept.id)]
    store.recordings.put(recording(kept, "d.h5"), False)
    # somebody settles what was there before
    store.campaigns.settle("A", kept.id, seen)
    assert store.campaigns.unsettled() == [("A", kept.id)]
    store.campaigns.settle("A", kept.id, store.campaigns.changes("A", kept.id))
    assert store.campaigns.unsettled() == []
    store.recordings.delete("A", kept.id, "d.h5")
    assert store.campaigns.unsettled() == [("A", kept.id)]


def test_one_of_many_contents_at_once_is_kept(store, kept):
    def put(k):
        try:
            return store.recordings.put(recording(kept, content=str(k % 4)), False)
        except Taken:
            return "taken"

    with ThreadPoolExecutor(8) as threads:
        found = list(threads.map(put, range(24)))
    (there,) = store.recordings.list("A", kept.id, "", 9)
    assert found.count(None) == 1
    assert sum(each == there for each in found) == 5
    assert found.count("taken") == 18


def test_recordings_and_their_campaign_go_together_whoever_is_first(store, kept):
    def put(k):
        try:
            store.recordings.put(recording(kept, f"{k}.h5"), False)
        except KeyError:
            return False
        return True

    with ThreadPoolExecutor(8) as threads:
        putting = [threads.submit(put, k) for k in range(16)]
        deleting = threads.submit(store.campaigns.delete, "A", kept.id)
    assert deleting.result()
    assert {each.result() for each in putting} <= {True, False}
    assert store.recordings.kept("A") == {}


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


@pytest.mark.parametrize("url", ["nonsense", "sqlite:////no/such/folder/s.db", "mysterious://a:secret@b/c"])
def test_a_store_that_can_not_be_opened_says_so(url):
    with pytest.raises(InputError) as refused:
        open_store(url)
    assert refused.value.field == "RCSA_IDENT_DATABASE"
    assert "secret" not in str(refused.value)


def test_a_store_that_is_locked_is_unavailable(tmp_path, monkeypatch):
    monkeypatch.setattr("api.stores.engines._BUSY_MS", 50)
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
