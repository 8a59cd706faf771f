"""What is kept for a time is there until then, and gone afterwards; without a setting everything stays."""

from __future__ import annotations

from contextlib import closing
from datetime import UTC, datetime, timedelta

import pytest

from api.retention import Lifetimes, sweep
from api.security import new_id, now
from api.settings import Settings
from api.stores.changes import TOOLING
from api.stores.entities import Document, Machine, digest_of
from api.stores.jobs import Applied, Event, Outcome
from rcsa_ident.base.errors import InputError
from tests.api.identifying import running
from tests.api.in_process import BOTH, embedded, service
from tests.fixtures.waiting import until

ALL = Lifetimes(10.0, 20.0, 30.0)


def later(days: float) -> datetime:
    return datetime.now(UTC) + timedelta(days=days)


def document(name: str, words: str) -> Document:
    return Document("A", name, words, "{}", digest_of(words), now())


@BOTH
def test_each_thing_is_kept_for_its_time(store, machine):
    store.machines.add(Machine(new_id(), "A", "N", "", now()), ("k", "d"))
    id, open_job = running(store, machine), running(store, machine)
    for each in (id, open_job):
        store.jobs.tell(each, "w", [Event(0, "trace", "{}"), Event(0, "note", "{}")])
    store.jobs.finish(id, "w", Outcome("done", now(), texts={"result": "found"}, applied=Applied("found", "{}", digest_of("found"))))
    for words in ("one", "two", "three"):
        store.toolings.put(document("T1", words))
    store.toolings.put(document("gone", "x"))
    store.toolings.delete("A", "gone")
    before = store.usage("A")

    # for ever, unless a setting says otherwise
    assert sweep(store, Lifetimes(), later(5000.0)) == {"events": 0, "results": 0, "versions": 0}
    assert store.usage("A") == before | {"repeated_calls": 0}
    assert sweep(store, ALL, later(9.9)) == {"events": 0, "results": 0, "versions": 0}

    assert sweep(store, ALL, later(10.1)) == {"events": 1, "results": 0, "versions": 0}
    assert [event.kind for event in store.jobs.events(id, 0, 9)] == ["end"]
    assert [event.kind for event in store.jobs.events(open_job, 0, 9)] == ["progress", "trace", "note"]
    assert store.jobs.text(id, "result") == "found"
    smaller = store.usage("A")["jobs"]
    assert smaller < before["jobs"]

    assert sweep(store, ALL, later(20.1)) == {"events": 0, "results": 1, "versions": 0}
    assert store.jobs.text(id, "result") is None
    assert store.jobs.find(id).state == "done"
    assert store.identifications.get("A", machine).text == "found"
    assert store.usage("A")["jobs"] < smaller

    assert sweep(store, ALL, later(30.1))["versions"] == 3
    assert [(c.name, c.version, c.action) for c in store.changes.list("A", None, 9, TOOLING)] == [
        ("gone", 2, "deleted"),
        ("T1", 3, "changed"),
    ]
    assert store.changes.get("A", TOOLING, "T1", 3).text == "three"
    assert sweep(store, ALL, later(30.1))["versions"] == 0
    # versions go on counting
    store.toolings.put(document("T1", "four"))
    assert store.changes.list("A", None, 1)[0].version == 4


def test_the_service_sweeps_when_it_starts(tmp_path, result):
    with closing(embedded(tmp_path)) as store:
        machine = store.machines.add(Machine(new_id(), "local", "M", "", now())).id
        id = running(store, machine, group="local")
        store.jobs.finish(id, "w", Outcome("done", later(-2.0).isoformat(timespec="milliseconds"), texts={"result": result}))
        with service(store, tmp_path) as http:
            assert http.get(f"/v1/identifications/{id}/result").text == result
        with service(store, tmp_path, keep_results_days=1.0) as http:
            until(lambda: http.get(f"/v1/identifications/{id}/result").status_code == 404)
            assert "results are kept for 1 days" in http.get(f"/v1/identifications/{id}/result").json()["detail"]
            assert http.get(f"/v1/identifications/{id}").json()["state"] == "done"


@pytest.mark.parametrize("name", ["keep_events_days", "keep_results_days", "keep_versions_days"])
def test_a_time_is_none_below_zero(name):
    with pytest.raises(InputError, match=f"RCSA_IDENT_{name.upper()}"):
        Settings(**{name: -1.0})
