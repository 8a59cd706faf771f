"""What a group keeps is counted, told, and limited, whatever it is."""

from __future__ import annotations

import json
from contextlib import closing

import pytest
from sqlalchemy import String, func, select, text

from api.files import NORMALISED, PARTS, UPLOADS
from api.security import make_key, new_id, now
from api.stores import database, tables
from api.stores.campaigns import Campaign, Recording
from api.stores.entities import Document, Machine, NoRoom, digest_of
from api.stores.jobs import Applied, Event, Outcome
from api.work.toolings import LARGEST
from rcsa_ident.io.toml_text import toml_of
from tests.api.identifying import job, running
from tests.api.in_process import BOTH, embedded, refused, service
from tests.api.recordings import TOOLING, content, declared
from tests.api.test_tus import begun, sent
from tests.fixtures import by_hand

TOML = {"Content-Type": "application/toml"}


def document(name: str, words: str) -> Document:
    return Document("A", name, words, "{}", digest_of(words), now())


def counted_anew(store) -> dict[str, int]:
    """Sizes from the texts themselves."""
    found = {}
    with store.reading() as connection:
        for kind, counted in tables.COUNTED.items():
            total = 0
            for table in counted:
                columns = [c for c in table.c if isinstance(c.type, String)]
                for row in connection.execute(select(*columns).where(table.c.group == "A")).all():
                    total += tables.size_of(row._asdict())
            found[kind] = total
        # of a job its request counts, and what it says and comes to
        sizes = []
        for part in (tables.job_events, tables.job_texts):
            columns = [c for c in part.c if isinstance(c.type, String)]
            sizes += [tables.size_of(row._asdict()) for row in connection.execute(select(*columns)).all()]
        requests = connection.execute(select(tables.jobs.c.request)).scalars()
        found["jobs"] = sum(sizes) + sum(tables.ROW + len(each.encode()) for each in requests)
    return found


def filled(store, machine: str) -> None:
    """Something of everything, written, changed and in part deleted."""
    key, _ = make_key("A", ("read",), "präsetting")
    store.keys.add(key)
    store.machines.add(Machine(new_id(), "A", "N", "in Halle 3 – hinten", now()), ("k", "d"))
    for words in ("x" * 1000, "ü" * 5000, "x" * 10):
        store.toolings.put(document("T1", words))
    store.toolings.put(document("T2", "gone"))
    store.toolings.delete("A", "T2")
    store.robots.put(document("R1", "z" * 2000))
    campaign = store.campaigns.add(Campaign(new_id(), "A", machine, "C", json.dumps({"toolings": "y" * 3000}), 1, now()), ("k", "d"))
    row = Recording("A", campaign.id, "c.h5", "cut", 1, "0" * 64, "1" * 64, '{"verdict": {"usable": true}}', "", now(), "2" * 64)
    store.recordings.put(row, False)
    id = running(store, machine)
    events = [Event(0, "trace", "{}"), Event(0, "fit", "[1, 2]", "fit X"), Event(0, "fit", "[1, 2, 3]", "fit X")]
    store.jobs.tell(id, "w", events, '{"stage": "x"}')
    store.jobs.finish(id, "w", Outcome("done", now(), texts={"result": "ä" * 700}, applied=Applied("z" * 800, "{}", digest_of("z" * 800))))
    store.jobs.add(job(machine), {"start": "s" * 900}, 9, ("k", "d"))
    waiting = store.jobs.add(job(machine), {}, 9)
    store.jobs.cancel("A", waiting.id, now())


@BOTH
def test_everything_is_counted_to_the_byte(store, machine):
    filled(store, machine)
    found = store.usage("A")
    assert found == counted_anew(store)
    assert all(found.values()), found
    assert store.usage("B") == dict.fromkeys(tables.COUNTED, 0)
    store.machines.delete("A", machine)
    after = store.usage("A")
    assert after == counted_anew(store)
    assert (after["campaigns"], after["jobs"], after["identifications"]) == (0, 0, 0)


def test_the_sum_is_taken_from_indexes(store):
    """However many rows there are, none of them is looked at."""
    with store.reading() as connection:
        for table in (table for each in tables.COUNTED.values() for table in each):
            query = select(func.sum(table.c.stored)).where(table.c.group == "A").compile(connection, compile_kwargs={"literal_binds": True})
            (plan,) = connection.execute(text(f"EXPLAIN QUERY PLAN {query}")).all()
            assert f"COVERING INDEX ix_{table.name}_stored" in plan[-1]


@BOTH
def test_what_does_not_fit_is_refused_and_what_frees_room_is_not(store, machine):
    store.toolings.put(document("T1", "x"))
    campaign = store.campaigns.add(Campaign(new_id(), "A", machine, "C", "{}", 1, now()))
    waiting = running(store, machine)
    store.group_bytes = sum(store.usage("A").values()) + 100
    key, _ = make_key("A", ("read",), "k")
    row = Recording("A", campaign.id, "c.h5", "cut", 1, "0" * 64, "1" * 64, '{"verdict": {"usable": true}}', "", now())
    for adds in (
        lambda: store.toolings.put(document("T2", "x" * 200)),
        lambda: store.toolings.put(document("T1", "y" * 200)),
        lambda: store.machines.add(Machine(new_id(), "A", "N", "d" * 300, now())),
        lambda: store.campaigns.add(Campaign(new_id(), "A", machine, "C", "{}" * 200, 1, now())),
        lambda: store.jobs.add(job(machine), {"start": "s" * 300}, 9),
        lambda: store.keys.add(key),
        lambda: store.recordings.put(row, False),
    ):
        before = store.usage("A")
        with pytest.raises(NoRoom):
            adds()
        assert store.usage("A") == before
    # the same again adds nothing, and another group has its own
    store.toolings.put(document("T1", "x"))
    store.machines.add(Machine(new_id(), "B", "N", "d" * 300, now()))
    # an accepted job may say what it has come to
    assert store.jobs.finish(waiting, "w", Outcome("done", now(), texts={"result": "r" * 5000}))
    assert store.toolings.delete("A", "T1")
    assert store.campaigns.delete("A", campaign.id)
    assert store.machines.delete("A", machine)
    store.keys.add(key)


def test_rows_are_not_counted_again_for_every_call(store, machine, monkeypatch):
    """A count is added to, but nobody is refused by one that is not fresh."""
    counts, usage = [], database._usage
    monkeypatch.setattr(database, "_usage", lambda *each: (counts.append(each), usage(*each))[1])
    monkeypatch.setattr(database, "COUNTED", 1e9)
    store.counted.clear()
    for k in range(9):
        store.toolings.put(document(f"T{k}", "x" * 1000))
    assert len(counts) == 1
    store.group_bytes = sum(store.usage("A").values()) + 2500
    counts.clear()
    store.toolings.put(document("T9", "x" * 1000))
    with pytest.raises(NoRoom):
        store.toolings.put(document("T10", "x" * 1000))
    assert len(counts) == 1
    # room that somebody else has made is found
    store.machines.delete("A", machine)
    store.group_bytes += 2500
    store.toolings.put(document("T10", "x" * 1000))


@BOTH
def test_the_inputs_of_a_job_do_not_outlive_it(store, machine):
    """A question holds the text of its machine, however small the request was that asked it."""
    texts = {"question": "q" * 100_000}
    ended, cancelled = (store.jobs.add(job(machine), texts, 9).id for _ in range(2))
    assert store.usage("A")["jobs"] > 200_000
    store.jobs.begin(ended, "w", now())
    store.jobs.finish(ended, "w", Outcome("done", now(), texts={"answer": "found"}))
    store.jobs.cancel("A", cancelled, now())
    assert [store.jobs.text(ended, name) for name in ("question", "answer")] == [None, "found"]
    assert store.jobs.text(cancelled, "question") is None
    assert store.usage("A")["jobs"] < 3000


def test_small_requests_that_store_much_are_counted(tmp_path):
    """Each of these declares a campaign in a kilobyte, and copies four megabytes of toolings into it."""
    with closing(embedded(tmp_path)) as store, service(store, tmp_path) as http:
        store.group_bytes = 20_000_000
        tooling = toml_of(TOOLING)
        padded = tooling + "# " + "x" * (LARGEST - len(tooling) - 100)
        assert http.put("/v1/toolings/T0", content=padded.encode(), headers=TOML).status_code == 201
        machine = http.post("/v1/machines", json={"name": "M"}).json()["id"]
        statuses, body = [], declared(toolings={f"T{k}": "T0" for k in range(15)})
        body["cuts"][0]["tooling"] = "T0"
        assert len(json.dumps(body)) < 1100
        for _ in range(16):
            statuses.append(http.post(f"/v1/machines/{machine}/campaigns", json=body).status_code)
        assert statuses == [201] * 5 + [413] * 11
        told = http.get("/v1/usage").json()["database"]
        assert (told["allowed"], told["used"]) == (20_000_000, sum(told["kinds"].values()))
        assert told["used"] <= told["allowed"]
        assert (tmp_path / "store.db").stat().st_size < 25e6


def test_the_problem_says_what_is_kept_and_where_to_look(client, store, result):
    machine = client.make_machine("M").id
    client.identify(machine, result)
    client.identify(machine, result.replace('"name"', '"name" ', 1))
    store.group_bytes = sum(store.usage("local").values()) + 1000
    problem = refused(413, client.restore_identification, machine, 1)
    assert "the group keeps" in problem.detail
    assert "GET /v1/usage" in problem.detail
    assert problem.errors[0].allowed == f"{store.group_bytes} bytes"
    assert refused(413, client.write_tooling, "T1", by_hand.TOOLING).errors[0].field == "group"


def test_files_are_told_by_kind(client, tmp_path):
    campaign = client.make_campaign(client.make_machine("M").id, declared()).id
    raw = content(tmp_path)
    (tmp_path / "c0_cut.h5").write_bytes(raw)
    client.upload(campaign, tmp_path / "c0_cut.h5")
    sent(client.http, begun(client.http, f"/v1/campaigns/{campaign}/uploads", 5000, filename="c0_air.h5"), bytes(1000), 0)
    told = client.usage().files
    assert told.kinds[UPLOADS] == len(raw)
    assert told.kinds[NORMALISED] > 1000
    assert told.kinds[PARTS] >= 1000
    assert told.used == sum(told.kinds.values())
