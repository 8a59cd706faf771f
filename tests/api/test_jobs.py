"""What jobs promise, on both databases: accepted once, told in order, ended once, and nobody else's meanwhile."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import threading
import time
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from dataclasses import replace
from functools import partial

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from api.jobs import desk as desks
from api.jobs.backend import Carried
from api.jobs.desk import Desk
from api.jobs.worker import LEASE, JobWorker, carry, gone, place, process
from api.security import new_id, now
from api.stores.jobs import Applied, Event, Full, Job, Outcome, Worker
from api.stores.records import Document, Machine, Taken, digest_of
from rcsa_ident.errors import InputError
from tests.api.conftest import BOTH
from tests.api.identifying import Steps, left


@pytest.fixture
def machine(store):
    return store.machines.add(Machine(new_id(), "A", "M", "", now())).id


def job(machine, **changed):
    return replace(Job(new_id(), "A", "identification", machine, "c1", "{}", "queued", now()), **changed)


def running(store, machine, **changed):
    """The id of a job that worker w has taken up."""
    id = store.jobs.add(job(machine, **changed), {}, 100).id
    assert store.jobs.begin(id, "w", now()) is not None
    return id


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


class Quiet:
    """A desk's surroundings: a job that runs, an engine, and the code with which the process would have ended."""

    def __init__(self, store, machine):
        self.store, self.id = store, running(store, machine)
        self.steps, self.codes = Steps(), []

    def desk(self, token="w"):
        return Desk(self.store.jobs, self.id, token, partial(self.steps.remember, self.id), self.codes.append)


@pytest.fixture
def quiet(store, machine, monkeypatch):
    monkeypatch.setattr(desks, "DELIVERY", 0.02)
    monkeypatch.setattr(desks, "GRACE", 0.3)
    return Quiet(store, machine)


def test_a_step_is_computed_once(quiet):
    calls = []

    def compute(value):
        calls.append(value)
        return (value, 1.5)

    for _ in range(2):
        with quiet.desk() as desk:
            assert desk.remember("a", partial(compute, 1)) == (1, 1.5)
            assert desk.map(lambda x: compute(x)[0] * 10, [2, 3], "m", "stage") == [20, 30]
    assert calls == [1, 2, 3]
    assert json.loads(quiet.store.jobs.find(quiet.id).progress) == {"stage": "stage", "done": 2, "total": 2}


def test_only_a_new_step_counts_as_coming_further(quiet):
    def worked():
        quiet.store.jobs.begin(quiet.id, "w", now())
        with quiet.desk() as desk:
            desk.remember("a", lambda: 1)
        return quiet.store.jobs.find(quiet.id).attempts

    assert worked() == 0
    # one that dies at its second step again and again comes to its first one each time
    assert [worked(), worked()] == [1, 2]


@settings(deadline=None, max_examples=50)
@given(st.lists(st.lists(st.integers(), max_size=4), max_size=4), st.integers(0, 20))
def test_wherever_it_is_interrupted_each_task_is_done_once(calls, killed_after):
    """The process ends between two steps; the next one has the same results, and computes only what was missing."""
    texts, done = {}, []

    class Killed(BaseException):
        pass

    def engine(name, compute, budget):
        if name not in texts:
            if len(texts) == budget:
                raise Killed
            texts[name] = compute()
        return texts[name]

    def work(budget):
        desk = Desk(None, "j", "w", partial(engine, budget=budget), left)

        def task(x):
            done.append(x)
            return 2 * x

        return [desk.map(task, tasks, f"{k}", "s") for k, tasks in enumerate(calls)]

    with suppress(Killed):
        work(killed_after)
    wanted = [[2 * x for x in tasks] for tasks in calls]
    assert work(10**6) == wanted
    assert done == [x for tasks in calls for x in tasks]


def test_refusals_are_remembered_as_such(quiet):
    def refuse():
        raise InputError("cuts", 3, "more", "here")

    for _ in range(2):
        with quiet.desk() as desk, pytest.raises(InputError, match="here: cuts: found 3, allowed is more"):
            desk.remember("a", refuse)
    assert quiet.steps.computed == [(quiet.id, "a")]


@pytest.mark.parametrize(
    ("fault", "words"),
    [
        (InputError("cuts", "none", "some"), "cuts: found none, allowed is some"),
        (RuntimeError("secret detail"), "something unexpected happened; the log has it under this job's id"),
        (MemoryError(), "something unexpected happened; the log has it under this job's id"),
    ],
)
@pytest.mark.parametrize("inside", [True, False])
def test_a_job_that_fails_says_why(store, machine, fault, words, inside, caplog):
    id = store.jobs.add(job(machine), {}, 10).id

    def carrier(_job, desk):
        def work():
            raise fault

        return desk.remember("a", work) if inside else work()

    carry(store.jobs, {"identification": carrier}, "w", 3, id, partial(Steps().remember, id), left)
    found = store.jobs.find(id)
    assert found.state == "failed"
    assert json.loads(found.problem)["detail"] == words
    assert "secret" not in found.problem
    entries = json.loads(found.problem)["errors"]
    assert entries == ([{"field": "cuts", "found": "none", "allowed": "some"}] if isinstance(fault, InputError) else [])
    assert isinstance(fault, InputError) or "Error" in caplog.text


def test_a_job_that_is_cancelled_stops_where_it_looks_up(quiet):
    with quiet.desk() as desk:
        quiet.store.jobs.cancel("A", quiet.id, now())

        def work():
            start = time.monotonic()
            while time.monotonic() - start < 10.0:
                desk.word("trace", {"cost": 1.0})
                time.sleep(0.01)

        with pytest.raises(desks.Stopped):
            work()
    assert quiet.codes == []
    assert quiet.store.jobs.find(quiet.id).state == "cancelled"


def test_long_work_without_a_word_ends_with_its_process(quiet):
    with quiet.desk():
        quiet.store.jobs.cancel("A", quiet.id, now())
        time.sleep(0.6)
    assert quiet.codes == [0]


def test_who_has_lost_a_job_says_nothing_more(quiet):
    with quiet.desk():
        quiet.store.jobs.begin(quiet.id, "another", now())
        time.sleep(0.2)
    assert quiet.codes[0] == 3


def test_an_engine_that_refuses_ends_the_process_and_not_the_job(store, machine):
    id = store.jobs.add(job(machine), {}, 10).id
    codes = []

    def engine(name, compute):
        raise RuntimeError("another owner")

    carry(store.jobs, {"identification": lambda _job, desk: desk.remember("a", dict)}, "w", 3, id, engine, codes.append)
    assert codes == [3]
    assert store.jobs.find(id).state == "running"


def test_words_in_quick_succession_are_few_and_curves_fewer(quiet):
    drawn = []
    with quiet.desk() as desk:
        end = time.monotonic() + 0.5
        while time.monotonic() < end:
            desk.word("trace", {"cost": 1.0})
            desk.curve("fit x", lambda: drawn.append(1) or {"axis": "X"})
    told = [e.kind for e in quiet.store.jobs.events(quiet.id, 0, 1000)]
    assert 1 <= told.count("trace") <= 6
    assert told.count("fit") == len(drawn) == 1


def test_a_job_whose_process_dies_again_and_again_is_given_up(store, machine):
    id = store.jobs.add(job(machine), {}, 10).id
    for _ in range(3):
        # taken up, and never heard of again
        store.jobs.begin(id, "w", now())
    carry(store.jobs, {"identification": lambda *_: pytest.fail("once more")}, "w", 3, id, None, left)
    found = store.jobs.find(id)
    assert found.state == "failed"
    assert "died 3 times" in json.loads(found.problem)["detail"]


class Fake:
    """An engine that is told what it knows."""

    def __init__(self, *carried):
        self.known = list(carried)
        self.calls = []

    def submit(self, job, priority):
        self.calls.append(("submit", job, priority))

    def carried(self):
        return self.known

    def resume(self, job):
        self.calls.append(("resume", job))

    def forget(self, jobs):
        self.calls.append(("forget", *jobs))


def worker_of(store, *carried):
    found = JobWorker(store.jobs, Fake(*carried), {}, 3)
    found.id = "me"
    store.jobs.claim(Worker("me", found.place, process(os.getpid()), found.token), None)
    return found


def test_what_was_accepted_is_handed_over_once(store, machine):
    ids = [store.jobs.add(job(machine), {}, 10).id, store.jobs.add(job(machine, kind="lobes"), {}, 10).id]
    worker = worker_of(store)
    worker.look()
    worker.look()
    assert worker.backend.calls == [("submit", ids[0], 10), ("submit", ids[1], 1)]


def test_what_the_engine_has_lost_is_handed_over_again(store, machine):
    id = store.jobs.add(job(machine), {}, 10).id
    worker = worker_of(store)
    worker.look()
    worker.round()
    worker.look()
    assert worker.backend.calls == [("submit", id, 10)] * 2


@pytest.mark.parametrize(
    ("state", "executor", "current", "expected"),
    [
        ("running", "dead", True, "resume"),
        ("running", "me", True, None),
        ("waiting", None, True, None),
        ("waiting", None, False, "forget"),
        ("running", "me", False, None),
        ("over", "me", True, "forget"),
    ],
)
def test_a_round_of_an_open_job(store, machine, state, executor, current, expected):
    id = running(store, machine)
    worker = worker_of(store, Carried(id, state, executor, current))
    worker.round()
    assert worker.backend.calls == ([] if expected is None else [(expected, id)])


def test_a_round_of_what_has_ended(store, machine):
    id = running(store, machine)
    store.jobs.cancel("A", id, now())
    worker = worker_of(store, Carried(id, "waiting"), Carried("gone", "over"))
    worker.round()
    assert worker.backend.calls == [("forget", "gone", id)] or worker.backend.calls == [("forget", *sorted([id, "gone"]))]


def test_a_job_of_one_that_lives_elsewhere_is_left_to_it(store, machine, monkeypatch):
    id = running(store, machine)
    store.jobs.claim(Worker("other", "elsewhere", "1:1", "w"), None)
    worker = worker_of(store, Carried(id, "running", "other"))
    moment = [time.monotonic()]
    monkeypatch.setattr("api.jobs.worker.time.monotonic", lambda: moment[0])
    worker.round()
    moment[0] += 0.9 * LEASE
    store.jobs.beat("other", "w")
    worker.round()
    moment[0] += 0.9 * LEASE
    worker.round()
    assert worker.backend.calls == []
    # not a sign of it for too long
    moment[0] += 0.2 * LEASE
    worker.round()
    assert worker.backend.calls == [("resume", id)]


def test_a_job_that_another_has_just_taken_over_is_left_to_it(store, machine):
    id = running(store, machine)
    store.jobs.claim(Worker("third", "elsewhere", "1:1", "t3"), None)
    store.jobs.take(id, "w", "t3")
    worker = worker_of(store, Carried(id, "running", "dead"))
    worker.round()
    assert worker.backend.calls == []


def test_a_dead_process_of_this_place_is_known_at_once():
    me = process(os.getpid())
    assert me == process(os.getpid())
    assert not gone(me)
    assert place() == place()
    with subprocess.Popen([sys.executable, "-c", "input()"], stdin=subprocess.PIPE) as child:
        other = process(child.pid)
        assert other != me
        assert not gone(other)
        child.kill()
        child.wait()
    if not other.endswith(":"):
        assert gone(other)
        # the same number, started at another time
        assert gone(me.split(":")[0] + ":1")


def test_workers_take_the_first_free_name(store):
    first, second = (JobWorker(store.jobs, Fake(), {}, 3) for _ in range(2))
    assert first._claim()
    assert second._claim()
    assert (first.id, second.id) == (f"{first.place}-1", f"{first.place}-2")
    store.jobs.leave(first.id, first.token)
    third = JobWorker(store.jobs, Fake(), {}, 3)
    assert third._claim()
    assert third.id == first.id
    # one that was killed: its process is gone
    store.jobs.leave(second.id, second.token)
    store.jobs.claim(Worker(second.id, second.place, "999999999:1", "killed"), None)
    fourth = JobWorker(store.jobs, Fake(), {}, 3)
    assert fourth._claim()
    assert fourth.id == second.id


def test_a_worker_that_is_told_to_stop_leaves_nothing_behind(store, machine):
    id = running(store, machine)
    stop = threading.Event()

    class Once(Fake):
        def start(self, executor, carry):
            stop.set()

    worker = JobWorker(store.jobs, Once(), {}, 3)
    store.jobs.begin(id, worker.token, now())
    worker.run(lambda: None, stop)
    assert store.jobs.workers() == []
    # an end that was asked for is no attempt
    assert store.jobs.find(id).attempts == 0
