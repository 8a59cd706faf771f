"""Jobs of views end when nobody follows them any more, and no others do."""

from __future__ import annotations

import asyncio
import time
from datetime import UTC, datetime, timedelta

import pytest

from api.jobs import leases
from api.jobs.leases import Leases
from api.live import jobs as followed
from api.settings import Settings
from api.stores.entities import Unavailable
from rcsa_ident.base.errors import InputError
from tests.api.identifying import job, running
from tests.api.in_process import BOTH, service
from tests.api.test_lobe_jobs import SPEEDS

LONG_AGO = "2026-01-01T00:00:00.000+00:00"
HERE = {"Prefer": "respond-async, while-watched"}


def now(later: float = 0.0) -> str:
    return (datetime.now(UTC) + timedelta(seconds=later)).isoformat(timespec="milliseconds")


def asked(client, machine: str, **headers: str) -> str:
    body = {"machine": machine, "toolings": ["T1"], "speeds": SPEEDS}
    answer = client.http.post("/v1/lobes", json=body, headers=headers)
    assert answer.status_code == 202
    return answer.json()["id"]


@BOTH
def test_only_what_is_to_be_watched_and_is_not_ends(store, machine):
    waiting = store.jobs.add(job(machine, kind="lobes", watched=LONG_AGO), {"question": "{}"}, 99).id
    working = running(store, machine, kind="lobes", watched=LONG_AGO)
    seen = running(store, machine, kind="lobes", watched=LONG_AGO)
    own, identification = running(store, machine, kind="lobes"), running(store, machine)
    swept = Leases(store.jobs, 120.0).sweep
    assert swept(0.0) == swept(119.0) == []
    for each in (seen, own, identification):
        store.jobs.watch(each, now())
    assert sorted(swept(121.0)) == sorted([waiting, working])
    for id in (waiting, working):
        ended = store.jobs.find(id)
        assert (ended.state, ended.finished is not None) == ("cancelled", True)
        assert "has not followed it for 120 s; ask again" in ended.problem
        assert [event.kind for event in store.jobs.events(id, 0, 9)][-1] == "end"
        assert store.jobs.text(id, "question") is None
    assert {store.jobs.find(id).state for id in (seen, own, identification)} == {"running"}
    assert swept(240.0) == []
    # it was watched once, and is no more
    assert swept(242.0) == [seen]
    assert {store.jobs.find(id).state for id in (own, identification)} == {"running"}


@pytest.mark.parametrize("jump", [-3600.0, 600.0, 1e8])
def test_a_clock_that_jumps_neither_ends_nor_keeps_a_job(store, machine, jump):
    id = running(store, machine, kind="lobes", watched=now())
    swept = Leases(store.jobs, 120.0).sweep
    assert swept(0.0) == []
    # all that the service writes is of the other clock from now on, and half a lease later somebody asks
    store.jobs.watch(id, now(jump))
    assert swept(60.0) == swept(170.0) == []
    assert swept(181.0) == [id]


def test_whoever_comes_back_meanwhile_keeps_it(store, machine, monkeypatch):
    """Between the look at all jobs and the end of one of them."""
    id = running(store, machine, kind="lobes", watched=LONG_AGO)
    writing = store.writing

    def late():
        monkeypatch.setattr(store, "writing", writing)
        store.jobs.watch(id, now())
        return writing()

    swept = Leases(store.jobs, 120.0).sweep
    swept(0.0)
    monkeypatch.setattr(store, "writing", late)
    assert swept(121.0) == []
    assert store.writing == writing
    assert store.jobs.find(id).state == "running"


def test_asking_for_it_and_opening_its_events_are_watching(shop, store, monkeypatch):
    client, machine = shop
    id = asked(client, machine, **HERE)
    assert store.jobs.find(id).watched is not None
    monkeypatch.setattr(followed, "longest", lambda _components, _job: 0.0)
    for path in (f"/v1/lobes/{id}", f"/v1/lobes/{id}/events"):
        store.jobs.watch(id, LONG_AGO)
        assert client.http.get(path).status_code == 200
        assert store.jobs.find(id).watched > LONG_AGO, path
    store.jobs.watch(id, LONG_AGO)
    # a look at something else is none
    swept = Leases(store.jobs, 120.0).sweep
    swept(0.0)
    client.http.get("/v1/machines")
    assert swept(121.0) == [id]
    found = client.lobe_job(id)
    assert (found.job.state, found.answer) == ("cancelled", None)
    assert found.job.problem.detail == "cancelled: the page that asked for it has not followed it for 120 s; ask again"


@pytest.mark.parametrize("prefer", ["respond-async", "respond-async; while-watchedx", "respond-async, wait=5"])
def test_what_is_asked_for_without_goes_on(shop, store, prefer):
    client, machine = shop
    id = asked(client, machine, Prefer=prefer)
    client.lobe_job(id)
    assert store.jobs.find(id).watched is None
    swept = Leases(store.jobs, 60.0).sweep
    assert swept(0.0) == swept(1e6) == []


def test_a_stream_of_it_ends_in_time_for_the_next(shop, store, tmp_path):
    """A network that is lost looks like a client that listens."""
    client, machine = shop
    own, ours = asked(client, machine, Prefer="respond-async"), asked(client, machine, **HERE)
    with service(store, tmp_path, watch_seconds=3600.0, unwatched_seconds=100.0) as http:
        components = http.app.state.components
        assert followed.longest(components, store.jobs.find(ours)) == 50.0
        assert followed.longest(components, store.jobs.find(own)) == 3600.0
    with service(store, tmp_path, watch_seconds=0.2) as http:
        assert followed.longest(http.app.state.components, store.jobs.find(ours)) == 0.2


def test_the_service_sweeps_again_and_again(store, machine, tmp_path, monkeypatch):
    """Whatever the database does meanwhile, and not before everybody had time to come back."""
    id = running(store, machine, kind="lobes", watched=LONG_AGO)
    swept, abandon = [], store.jobs.abandon

    def first_not(*arguments):
        swept.append(arguments)
        if len(swept) == 1:
            raise Unavailable
        return abandon(*arguments)

    async def until_cancelled():
        task = asyncio.create_task(leases.maintain(store.jobs, 0.2))
        while store.jobs.find(id).state == "running":
            await asyncio.sleep(0.01)
        task.cancel()

    monkeypatch.setattr(store.jobs, "abandon", first_not)
    began = time.monotonic()
    asyncio.run(until_cancelled())
    assert time.monotonic() - began >= 0.2
    assert len(swept) == 2


def test_the_service_begins_with_its_setting(store, tmp_path, monkeypatch):
    begun = []

    async def maintain(jobs, seconds):
        begun.append((jobs, seconds))

    monkeypatch.setattr(leases, "maintain", maintain)
    with service(store, tmp_path, unwatched_seconds=77.0) as http:
        http.get("/health")
    assert begun == [(store.jobs, 77.0)]


def test_a_time_that_no_page_could_keep_to_is_refused():
    """A request may wait for 30 s."""
    with pytest.raises(InputError, match="RCSA_IDENT_UNWATCHED_SECONDS: found 59"):
        Settings(unwatched_seconds=59.0)
