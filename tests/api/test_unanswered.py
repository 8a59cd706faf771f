"""A database that does not answer for a while: jobs wait for it, and their process gives up after a minute."""

from __future__ import annotations

import json
from functools import partial
from types import SimpleNamespace

import pytest

from api.client import Client
from api.jobs import job_context
from api.jobs.worker import carry
from api.security import LOCAL_GROUP
from api.stores.entities import Unavailable, digest_of
from api.stores.jobs import Outcome
from tests.api.identifying import Steps, carriers, declared, job, left
from tests.api.in_process import service


class Flaky:
    """A part of the store whose database answers none of its questions the first time."""

    def __init__(self, part, asked):
        self.part, self.asked = part, asked

    def __getattr__(self, name):
        def call(*arguments):
            self.asked.append(name)
            if self.asked.count(name) == 1:
                raise Unavailable
            return getattr(self.part, name)(*arguments)

        return call


def flaky(store):
    asked = []
    return asked, SimpleNamespace(**{name: Flaky(getattr(store, name), asked) for name in ("jobs", "campaigns", "recordings")})


def test_a_database_that_starts_anew_ends_neither_a_job_nor_its_process(store, machine, tmp_path, monkeypatch):
    """Whatever the worker asks of it, of an identification up to its campaign and of a job from its input to its end."""
    monkeypatch.setattr(job_context, "ASKING", 0.01)
    with service(store, tmp_path) as http:
        client = Client(http=http)
        here = client.make_machine("M").id
        campaign = client.make_campaign(here, declared()).id
    request = '{"method": "evidence", "seed": 1, "apply": false}'
    told = {"group": LOCAL_GROUP, "campaign": campaign, "request": request, "request_digest": digest_of(request)}
    id = store.jobs.add(job(here, **told), {}, 10).id
    asked, broken = flaky(store)
    carry(broken.jobs, carriers(broken, tmp_path), "w", 3, id, partial(Steps().remember, id), left)
    assert (
        json.loads(store.jobs.find(id).problem)["detail"] == "campaign: found no recording of a cut, allowed is a campaign with recordings"
    )
    assert {name: asked.count(name) for name in ("begin", "text", "get", "list", "finish")} == {
        "begin": 2,
        "text": 3,
        "get": 3,
        "list": 2,
        "finish": 2,
    }
    id = store.jobs.add(job(machine), {"question": "1"}, 10).id
    _, broken = flaky(store)

    def carrier(_job, desk):
        desk.progress("a", 0, 1)
        return Outcome("done", "", texts={"answer": desk.text("question")})

    carry(broken.jobs, {"identification": carrier}, "w", 3, id, None, left)
    assert (store.jobs.find(id).state, store.jobs.text(id, "answer")) == ("done", "1")
    assert store.jobs.find(id).progress is not None


def test_a_database_that_stays_away_ends_the_process_and_not_the_job(store, machine, monkeypatch):
    monkeypatch.setattr(job_context, "PATIENCE", 0.0)
    monkeypatch.setattr(job_context, "ASKING", 0.01)
    id = store.jobs.add(job(machine), {}, 10).id
    codes = []

    def begin(*_):
        raise Unavailable

    monkeypatch.setattr(store.jobs, "begin", begin)
    carry(store.jobs, {"identification": lambda *_: pytest.fail("without a job")}, "w", 3, id, None, codes.append)
    assert codes == [1]
    assert store.jobs.find(id).state == "queued"
