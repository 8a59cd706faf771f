"""What jobs promise, on both databases: accepted once, told in order, ended once, and nobody else's meanwhile."""

from __future__ import annotations

import json
from concurrent.futures import ThreadPoolExecutor
from functools import partial

import pytest

from api.security import new_id, now
from api.stores.entities import Document, Machine, Taken, digest_of
from api.stores.jobs import PARTIAL, Applied, Event, Full, Outcome, Worker
from tests.api.identifying import job, running
from tests.api.in_process import BOTH


@BOTH
def test_a_job_is_accepted_once(store, machine):
    first = job(machine)
    assert store.jobs.add(first, {"start": "x" * 100_000, "question": ""}, 10, ("k", "d")) == first
    assert store.jobs.add(job(machine), {}, 10, ("k", "d")) == first
    with pytest.raises(Taken):
        store.jobs.add(job(machine), {}, 10, ("k", "other"))
    assert [each.id for each in store.jobs.open()] == [first.id]
    assert store.jobs.text(first.id, "start") == "x" * 100_000
    assert store.jobs.text(first.id, "question") == ""
    assert store.jobs.text(first.id, "result") is None
    assert store.jobs.get("B", first.id) is None
    with pytest.raises(KeyError):
        store.jobs.add(job("nobody"), {}, 10)
    with pytest.raises(KeyError):
        store.jobs.add(job(machine, group="B"), {}, 10)


@BOTH
def test_the_same_key_from_many_at_once_makes_one_job(store, machine):
    with ThreadPoolExecutor(8) as pool:
        made = list(pool.map(lambda _: store.jobs.add(job(machine), {"a": "b"}, 10, ("k", "d")).id, range(8)))
    assert len(set(made)) == 1
    assert len(store.jobs.open()) == 1


@BOTH
def test_so_many_of_a_group_wait_and_no_more(store, machine):
    other = store.machines.add(Machine(new_id(), "B", "M", "", now())).id
    kept = [store.jobs.add(job(machine), {}, 2).id for _ in range(2)]
    with pytest.raises(Full):
        store.jobs.add(job(machine), {}, 2)
    store.jobs.add(job(other, group="B"), {}, 2)
    store.jobs.cancel("A", kept[0], now())
    store.jobs.add(job(machine), {}, 2)


@BOTH
def test_lists_begin_with_the_newest(store, machine):
    ids = [store.jobs.add(job(machine, id=f"{k:03d}", campaign=f"c{k % 2}"), {}, 10).id for k in range(5)]
    store.jobs.cancel("A", ids[3], now())

    def listed(before="", limit=10, **wanted):
        return [each.id for each in store.jobs.list("A", wanted, before, limit)]

    assert listed() == ids[::-1]
    assert listed(limit=2) == ids[:2:-1]
    assert listed(before=ids[3], limit=2) == [ids[2], ids[1]]
    assert listed(state="queued", campaign="c1") == [ids[1]]
    assert listed(kind="lobes") == []
    assert store.jobs.list("B", {}, "", 10) == []


@BOTH
def test_what_a_job_tells_comes_in_order_and_of_a_topic_the_last(store, machine):
    id = running(store, machine)
    tell = partial(store.jobs.tell, id, "w")
    assert tell([Event(0, "trace", "1"), Event(0, "fit", "a", "x"), Event(0, "fit", "b", "x"), Event(0, "fit", "c", "y")])
    assert tell([Event(0, "trace", "2"), Event(0, "fit", "d", "x")], '{"done": 1}')
    assert tell([], '{"done": 2}')
    told = store.jobs.events(id, 0, 100)
    assert [(e.kind, e.data) for e in told] == [
        ("progress", ""), ("trace", "1"), ("fit", "c"), ("trace", "2"), ("fit", "d"), ("progress", ""),
    ]  # fmt: skip
    numbers = [e.number for e in told]
    assert numbers == sorted(set(numbers))
    assert store.jobs.numbers([id, "nobody"]) == {id: numbers[-1]}
    assert [e.data for e in store.jobs.events(id, numbers[2], 100)] == ["2", "d", ""]
    assert len(store.jobs.events(id, 0, 2)) == 2
    assert json.loads(store.jobs.find(id).progress) == {"done": 2}


@BOTH
def test_who_waits_has_a_place_among_its_kind(store, machine):
    """Counted over all groups, since they share the workers; a job that runs or has ended stands in nobody's way."""
    other = store.machines.add(Machine(new_id(), "B", "M", "", now())).id

    def waiting(**changed):
        return store.jobs.add(job(machine, **changed), {}, 10).id

    first, second = waiting(id="1"), store.jobs.add(job(other, id="2", group="B"), {}, 10).id
    lobes = waiting(id="3", kind="lobes")
    third = waiting(id="4")
    assert store.jobs.places([first, third, lobes, "nobody"]) == {first: (1, 3), third: (3, 3), lobes: (1, 1)}
    store.jobs.begin(first, "w", now())
    assert store.jobs.places([first, second, third]) == {second: (1, 2), third: (2, 2)}
    store.jobs.cancel("B", second, now())
    assert store.jobs.places([third]) == {third: (1, 1)}


@BOTH
@pytest.mark.parametrize("end", ["finish", "cancel"])
def test_parts_of_an_answer_go_when_the_job_ends(store, machine, end):
    id = running(store, machine)
    assert store.jobs.tell(id, "w", [Event(0, PARTIAL, "a", "partial 0"), Event(0, PARTIAL, "b", "partial 1"), Event(0, "note", "c")])
    assert store.jobs.tell(id, "w", [Event(0, PARTIAL, "d", "partial 0")])
    assert [(e.kind, e.data) for e in store.jobs.events(id, 0, 100)[1:]] == [(PARTIAL, "b"), ("note", "c"), (PARTIAL, "d")]
    if end == "finish":
        store.jobs.finish(id, "w", Outcome("done", now()))
    else:
        store.jobs.cancel("A", id, now())
    assert [e.kind for e in store.jobs.events(id, 0, 100)] == ["progress", "note", "end"]


@BOTH
def test_only_its_worker_speaks_for_a_job(store, machine):
    id = running(store, machine)
    assert store.jobs.begin(id, "v", now()).attempts == 2
    assert not store.jobs.tell(id, "w", [Event(0, "trace", "1")])
    assert not store.jobs.finish(id, "w", Outcome("done", now()))
    assert store.jobs.tell(id, "v", [], None, True)
    assert store.jobs.find(id).attempts == 0
    assert store.jobs.finish(id, "v", Outcome("done", now(), 2.5, "converged", None, {"result": "r"}))
    found = store.jobs.find(id)
    assert (found.state, found.status, found.seconds, store.jobs.text(id, "result")) == ("done", "converged", 2.5, "r")
    assert store.jobs.events(id, 0, 100)[-1].kind == "end"
    # what has ended has ended
    assert store.jobs.begin(id, "v", now()) is None
    assert not store.jobs.finish(id, "v", Outcome("failed", now()))
    assert not store.jobs.finish(id, None, Outcome("failed", now()))
    assert not store.jobs.tell(id, "v", [])
    assert store.jobs.cancel("A", id, now()) == (found, False)
    assert store.jobs.counts() == [("identification", "done", 1, 2.5)]


@BOTH
def test_a_job_ends_once_whoever_is_first(store, machine):
    """Cancelled and finished in the same moment: one of both, and the machine knows of it only where it was finished."""
    for _ in range(10):
        id = running(store, machine)
        store.identifications.delete("A", machine)
        outcome = Outcome("done", now(), 1.0, "converged", None, {"result": id}, Applied(id, "{}", digest_of(id)))
        with ThreadPoolExecutor(2) as pool:
            finished = pool.submit(store.jobs.finish, id, "w", outcome)
            cancelled = pool.submit(store.jobs.cancel, "A", id, now())
        assert finished.result() != cancelled.result()[1]
        applied = store.identifications.get("A", machine)
        assert (applied is not None) == finished.result() == (store.jobs.text(id, "result") is not None)
        assert [e.kind for e in store.jobs.events(id, 0, 100)].count("end") == 1


@BOTH
def test_what_was_found_becomes_the_machines_identification(store, machine):
    store.identifications.put(Document("A", machine, "old", "{}", digest_of("old"), now()))
    id = running(store, machine)
    assert store.jobs.finish(id, "w", Outcome("done", "2026", applied=Applied("new", '{"a": 1}', digest_of("new"))))
    found = store.identifications.get("A", machine)
    assert (found.text, found.summary, found.digest, found.changed) == ("new", '{"a": 1}', digest_of("new"), "2026")


@BOTH
def test_a_machine_that_is_forgotten_takes_its_jobs_along(store, machine):
    id = running(store, machine)
    store.jobs.tell(id, "w", [Event(0, "trace", "1")])
    assert store.machines.delete("A", machine)
    assert store.jobs.find(id) is None
    assert store.jobs.events(id, 0, 10) == []
    assert not store.jobs.tell(id, "w", [])
    assert not store.jobs.finish(id, "w", Outcome("done", "", applied=Applied("x", "{}", "d")))
    assert store.jobs.cancel("A", id, now()) is None
    assert store.identifications.get("A", machine) is None


@BOTH
def test_a_name_has_one_bearer(store):
    jobs = store.jobs
    assert jobs.claim(Worker("n-1", "here", "1:2", "t1"), None)
    assert not jobs.claim(Worker("n-1", "here", "1:3", "t2"), None)
    assert not jobs.claim(Worker("n-1", "here", "1:3", "t2"), "t0")
    assert jobs.beat("n-1", "t1")
    with ThreadPoolExecutor(4) as pool:
        won = list(pool.map(lambda k: jobs.claim(Worker("n-1", "here", "1:3", f"u{k}"), "t1"), range(4)))
    assert won.count(True) == 1
    assert not jobs.beat("n-1", "t1")
    jobs.leave("n-1", "t1")
    (row,) = jobs.workers()
    assert row.token.startswith("u")
    jobs.leave("n-1", row.token)
    assert jobs.workers() == []


@BOTH
def test_one_takes_over(store, machine):
    id = running(store, machine)
    with ThreadPoolExecutor(4) as pool:
        won = list(pool.map(lambda k: store.jobs.take(id, "w", f"u{k}"), range(4)))
    assert won.count(True) == 1
    fresh = store.jobs.add(job(machine), {}, 10).id
    assert store.jobs.take(fresh, None, "u")
    assert not store.jobs.take(fresh, None, "v")
