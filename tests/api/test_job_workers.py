"""What a job works with and who carries it out: steps done once, words in time, and an end whatever dies."""

from __future__ import annotations

import itertools
import json
import os
import threading
import time
from contextlib import suppress
from functools import partial

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from api.codec import encode
from api.jobs import job_context as desks
from api.jobs.backend import VERSION, Carried
from api.jobs.job_context import JobContext
from api.jobs.worker import LEASE, JobWorker, carry, process
from api.security import new_id, now
from api.serve import job_worker
from api.settings import Settings
from api.stores.entities import Machine
from api.stores.jobs import Outcome, Worker
from rcsa_ident.base.errors import InputError
from tests.api.identifying import Steps, job, left, running
from tests.fixtures.waiting import until


class Quiet:
    """A desk's surroundings: a job that runs, an engine, and the code with which the process would have ended."""

    def __init__(self, store, machine):
        self.store, self.id = store, running(store, machine)
        self.steps, self.codes = Steps(), []

    def desk(self, token="w"):
        return JobContext(self.store.jobs, self.id, token, partial(self.steps.remember, self.id), self.codes.append)


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
            assert list(desk.map(lambda x: compute(x)[0] * 10, [2, 3], "m", "stage")) == [20, 30]
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
        desk = JobContext(None, "j", "w", partial(engine, budget=budget), left)

        def task(x):
            done.append(x)
            return 2 * x

        return [list(desk.map(task, tasks, f"{k}", "s")) for k, tasks in enumerate(calls)]

    with suppress(Killed):
        work(killed_after)
    wanted = [[2 * x for x in tasks] for tasks in calls]
    assert work(10**6) == wanted
    assert done == [x for tasks in calls for x in tasks]


def written_before(value):
    """A step's text as the first version wrote it, which did not say so."""
    return json.dumps({"~table": [["value", value]]})


@pytest.mark.parametrize(
    "text",
    [
        written_before([["c0", "c0.h5", ""]]),
        written_before({"~Solution": {"theta": 1}}),
        encode({"version": "1", "value": 1}),
        encode({"version": VERSION, "value": 1}).replace('"value"', '"~Unheard": 1, "value"'),
        "no text at all",
    ],
)
def test_a_step_of_another_version_is_not_read(quiet, text):
    quiet.steps.texts[quiet.id, "a"] = text
    with quiet.desk() as desk, pytest.raises(desks.Outdated):
        desk.remember("a", lambda: pytest.fail("computed beside what is remembered"))
    assert quiet.codes == []


def test_a_job_of_another_version_starts_over_and_says_so(store, machine):
    """The engine sees it end and forgets it, since the job's row is open still; then it is carried out from its first step on."""
    id = store.jobs.add(job(machine), {}, 10).id
    steps, done = Steps(), []

    def carrier(_job, desk):
        for name in ("plan", "search"):
            done.append(desk.remember(name, lambda name=name: name))
            desk.progress(name, 1, 1)
        return Outcome("done", "")

    def carried():
        carry(store.jobs, {"identification": carrier}, "w", 3, id, partial(steps.remember, id), left)
        notes = [json.loads(event.data)["text"] for event in store.jobs.events(id, 0, 100) if event.kind == "note"]
        return store.jobs.find(id).state, notes

    # an earlier version had come to its second step
    store.jobs.begin(id, "old", now())
    store.jobs.tell(id, "old", [], json.dumps({"stage": "plan", "done": 1, "total": 1}))
    steps.texts = {(id, name): written_before(name) for name in ("plan", "search")}
    assert carried() == ("running", [])
    assert steps.computed == []
    worker = worker_of(store, Carried(id, "over"))
    worker.submitted = {id}
    worker.reconcile()
    worker.submit_accepted()
    assert worker.backend.calls == [("forget", id), ("submit", id, "identification")]
    steps.texts.clear()
    state, notes = carried()
    assert state == "done"
    assert notes == [desks.STARTS_OVER]
    assert done == ["plan", "search"]


def test_a_job_that_goes_on_says_nothing_of_starting_over(store, machine):
    id = store.jobs.add(job(machine), {}, 10).id
    steps = Steps()

    class Killed(BaseException):
        pass

    def carrier(found, desk):
        desk.remember("plan", lambda: 1)
        desk.progress("plan", 1, 1)
        if found.progress is None:
            desk._deliver()
            raise Killed
        desk.remember("search", lambda: 2)
        return Outcome("done", "")

    def carried():
        carry(store.jobs, {"identification": carrier}, "w", 3, id, partial(steps.remember, id), left)

    with pytest.raises(Killed):
        carried()
    carried()
    assert store.jobs.find(id).state == "done"
    assert "note" not in [event.kind for event in store.jobs.events(id, 0, 100)]


@pytest.mark.slow
def test_a_step_that_cannot_be_stored_loses_no_work(quiet, caplog):
    """Its value is in hand: the job goes on. A process that dies has it start over, and not for ever."""
    value = object()

    def died_once_more():
        quiet.store.jobs.begin(quiet.id, "w", now())
        with quiet.desk() as desk:
            assert desk.remember("a", lambda: value) is value
        return quiet.store.jobs.find(quiet.id).attempts

    assert died_once_more() == 2
    assert "a step cannot be stored" in caplog.text
    with quiet.desk() as desk, pytest.raises(desks.Outdated):
        desk.remember("a", lambda: pytest.fail("computed beside what is remembered"))
    quiet.steps.texts.clear()
    assert died_once_more() == 3


def test_memory_of_jobs_is_limited(monkeypatch, tmp_path):
    found = []
    monkeypatch.setattr("api.processes.limit_memory", found.append)
    monkeypatch.setattr("api.jobs.worker.JobWorker.run", lambda *_: None)
    job_worker("path", Settings(data=tmp_path, job_memory=2345), None, None)
    assert found == [2345]


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
        (RuntimeError("secret detail"), "an internal error occurred; it is logged under this job's id"),
        (
            MemoryError(),
            "job: found one that needs more memory than the service allows, allowed is a smaller one, or a larger RCSA_IDENT_JOB_MEMORY",
        ),
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
    entries = [list(each.values()) for each in json.loads(found.problem)["errors"]]
    refused = {InputError: fault, MemoryError: desks.TOO_LARGE}.get(type(fault))
    assert entries == ([] if refused is None else [[refused.field, refused.found, refused.allowed]])
    assert refused or "Error" in caplog.text


def test_a_job_that_is_cancelled_stops_where_it_looks_up(quiet):
    with quiet.desk() as desk:
        quiet.store.jobs.cancel("A", quiet.id, now())

        with pytest.raises(desks.Stopped):
            until(lambda: desk.event("trace", {"cost": 1.0}))
    assert quiet.codes == []
    assert quiet.store.jobs.find(quiet.id).state == "cancelled"


def test_long_work_without_a_word_ends_with_its_process(quiet):
    with quiet.desk():
        quiet.store.jobs.cancel("A", quiet.id, now())
        until(lambda: quiet.codes)
    assert quiet.codes == [0]


def test_who_has_lost_a_job_says_nothing_more(quiet):
    with quiet.desk():
        quiet.store.jobs.begin(quiet.id, "another", now())
        until(lambda: quiet.codes)
    assert quiet.codes[0] == 3


def test_an_engine_that_refuses_ends_the_process_and_not_the_job(store, machine):
    id = store.jobs.add(job(machine), {}, 10).id
    codes = []

    def engine(name, compute):
        raise RuntimeError("another owner")

    carry(store.jobs, {"identification": lambda _job, desk: desk.remember("a", dict)}, "w", 3, id, engine, codes.append)
    assert codes == [3]
    assert store.jobs.find(id).state == "running"


@pytest.mark.slow
def test_words_in_quick_succession_are_few_and_curves_fewer(quiet):
    drawn = []
    with quiet.desk() as desk:
        end = time.monotonic() + 0.5
        while time.monotonic() < end:
            desk.event("trace", {"cost": 1.0})
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

    def submit(self, job, kind):
        self.calls.append(("submit", job, kind))

    def carried(self):
        return self.known

    def resume(self, job, kind):
        self.calls.append(("resume", job, kind))

    def forget(self, jobs):
        self.calls.append(("forget", *jobs))


def worker_of(store, *carried):
    found = JobWorker(store.jobs, Fake(*carried), dict.fromkeys(("identification", "lobes")), 3)
    found.id = "me"
    store.jobs.claim(Worker("me", found.place, process(os.getpid()), found.token), None)
    return found


def test_what_was_accepted_is_handed_over_once(store, machine):
    ids = [store.jobs.add(job(machine), {}, 10).id, store.jobs.add(job(machine, kind="lobes"), {}, 10).id]
    worker = worker_of(store)
    worker.submit_accepted()
    worker.submit_accepted()
    assert worker.backend.calls == [("submit", ids[0], "identification"), ("submit", ids[1], "lobes")]


def test_groups_take_turns(store, machine):
    """One worker: of a group that waits with many jobs one is carried out, then one of each of the others."""
    machines = {"A": machine} | {group: store.machines.add(Machine(new_id(), group, "M", "", now())).id for group in "BC"}
    ids = {f"{group}{k}": f"{group}{k}" for group in "ABC" for k in range(3)}
    for id in ids:
        store.jobs.add(job(machines[id[0]], id=id, group=id[0]), {}, 10)
    worker, moments = worker_of(store), itertools.count(10)
    while store.jobs.open():
        worker.submit_accepted()
        worker.submit_accepted()
        _, id, _ = worker.backend.calls[-1]
        store.jobs.begin(id, worker.token, f"2026-01-01T00:00:{next(moments)}")
        worker.submit_accepted()
        store.jobs.finish(id, worker.token, Outcome("done", now()))
    assert [id for _, id, _ in worker.backend.calls] == ["A0", "B0", "C0", "A1", "B1", "C1", "A2", "B2", "C2"]


def test_several_workers_carry_out_jobs_of_one_group_beside_each_other(store, machine):
    first, second = worker_of(store), worker_of(store)
    ids = [store.jobs.add(job(machine), {}, 10).id for _ in range(3)]
    first.submit_accepted()
    store.jobs.begin(ids[0], first.token, now())
    for each in (first, second):
        each.submit_accepted()
    # what runs elsewhere is handed over as well: the engine may have lost it
    assert first.backend.calls == [("submit", ids[0], "identification")]
    assert second.backend.calls == [("submit", ids[0], "identification"), ("submit", ids[1], "identification")]


def test_what_the_engine_has_lost_is_handed_over_again(store, machine):
    id = store.jobs.add(job(machine), {}, 10).id
    worker = worker_of(store)
    worker.submit_accepted()
    worker.reconcile()
    worker.submit_accepted()
    assert worker.backend.calls == [("submit", id, "identification")] * 2


@pytest.mark.parametrize(
    ("state", "executor", "current", "expected"),
    [
        ("running", "dead", True, "resume"),
        ("running", "me", True, None),
        ("waiting", None, True, None),
        ("waiting", None, False, "forget"),
        # an earlier version has had this one's name
        ("running", "me", False, "forget"),
        ("over", "me", True, "forget"),
    ],
)
def test_a_round_of_an_open_job(store, machine, state, executor, current, expected):
    id = running(store, machine)
    worker = worker_of(store, Carried(id, state, executor, current))
    worker.reconcile()
    assert [call[:2] for call in worker.backend.calls] == ([] if expected is None else [(expected, id)])


def test_a_round_of_what_has_ended(store, machine):
    id = running(store, machine)
    store.jobs.cancel("A", id, now())
    worker = worker_of(store, Carried(id, "waiting"), Carried("gone", "over"))
    worker.reconcile()
    assert worker.backend.calls == [("forget", "gone", id)] or worker.backend.calls == [("forget", *sorted([id, "gone"]))]


@pytest.mark.parametrize("current", [True, False], ids=["of this version", "of another version"])
def test_a_job_of_one_that_lives_elsewhere_is_left_to_it(store, machine, monkeypatch, current):
    id = running(store, machine)
    store.jobs.claim(Worker("other", "elsewhere", "1:1", "w"), None)
    worker = worker_of(store, Carried(id, "running", "other", current))
    moment = [time.monotonic()]
    monkeypatch.setattr("api.jobs.worker.time.monotonic", lambda: moment[0])
    worker.reconcile()
    # whatever the clock shows meanwhile
    monkeypatch.setattr("api.jobs.worker.time.time", lambda: 1e10)
    moment[0] += 0.9 * LEASE
    store.jobs.beat("other", "w")
    worker.reconcile()
    moment[0] += 0.9 * LEASE
    worker.reconcile()
    assert worker.backend.calls == []
    # not a sign of it for too long
    moment[0] += 0.2 * LEASE
    worker.reconcile()
    # what another version has remembered helps nobody: the engine forgets it, and the job starts over
    assert worker.backend.calls == [("resume", id, "identification")] + ([] if current else [("forget", id)])


def test_a_job_that_another_has_just_taken_over_is_left_to_it(store, machine):
    id = running(store, machine)
    store.jobs.claim(Worker("third", "elsewhere", "1:1", "t3"), None)
    store.jobs.take(id, "w", "t3")
    worker = worker_of(store, Carried(id, "running", "dead"))
    worker.reconcile()
    assert worker.backend.calls == []


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
        def start(self, executor, carry, kinds):
            stop.set()

    worker = JobWorker(store.jobs, Once(), {}, 3)
    store.jobs.begin(id, worker.token, now())
    worker.run(lambda: None, stop)
    assert store.jobs.workers() == []
    # an end that was asked for is no attempt
    assert store.jobs.find(id).attempts == 0
