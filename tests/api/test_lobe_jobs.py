"""Lobes that take long become a job, with the answer that they would have had at once."""

from __future__ import annotations

import json
import threading
import time
from functools import partial

import pytest

from api.client import Client, ServiceError
from api.codec import decode
from api.jobs import job_context, lobes
from api.jobs.worker import carry
from api.schemas.jobs import PartialLobes
from api.schemas.robots import EXAMPLE as ROBOT
from api.stores.jobs import PARTIAL, Job
from tests.api.identifying import Steps, carried
from tests.api.in_process import refused, service
from tests.fixtures.service import example

SPEEDS = {"from_rpm": 6000, "to_rpm": 12000, "step_rpm": 500}


def later(client, id, *toolings, **further):
    return client.lobes_later(id, *toolings, speeds=SPEEDS, **further).id


@pytest.mark.slow
def test_as_a_job_they_are_the_same(shop, store, tmp_path):
    """Its warnings included, whatever they are about."""
    client, id = shop
    cut = {"feed_per_tooth_mm": 2.5}
    tested = [{"spindle_speed_rpm": 7777.0, "axial_depth_mm": 0.1, "verdict": "stable"}]
    at_once = client.lobes(id, "T1", example(), speeds=SPEEDS, tested=tested, cut=cut)
    assert at_once.toolings[0].tested.stable_stable == 1
    assert any("feed per tooth is 2.5 mm" in words for words in at_once.toolings[0].warnings)
    job = later(client, id, "T1", example(), tested=tested, cut=cut)
    waiting = client.lobe_job(job)
    assert (waiting.job.kind, waiting.job.state, waiting.answer) == ("lobes", "queued", None)
    # what it was asked of is what was there then
    client.forget_tooling("T1")
    engine = carried(store, tmp_path)
    found = client.lobe_job(job)
    assert found.job.state == "done"
    assert found.answer == at_once
    assert [name for _, name in engine.computed] == ["lobes.0", "lobes.1"]
    assert [kind for kind, _ in client.events(job, "lobes")][-1] == "end"


@pytest.mark.slow
def test_of_a_robot_as_a_job_they_are_the_same(client, store, tmp_path):
    client.write_robot("arm", ROBOT)
    arm, cut = {"robot": "arm", "posture_deg": [10.0, 40.0]}, {"ktc_mpa": 660.0, "krc": 0.38}
    at_once = client.lobes(arm, example(), speeds=SPEEDS, cut=cut)
    job = later(client, arm, example(), cut=cut)
    # what it was asked of is what was there then
    client.forget_robot("arm")
    carried(store, tmp_path)
    found = client.lobe_job(job)
    assert (found.job.state, found.job.machine) == ("done", "")
    assert found.answer == at_once
    assert found.answer.machine == "arm"


@pytest.mark.slow
def test_where_it_went_on_after_a_kill_they_are_the_same(shop, store, tmp_path):
    client, id = shop
    first, second = (later(client, id, "T1", example()) for _ in range(2))
    engine = carried(store, tmp_path)
    third = later(client, id, "T1", example())
    resumed = Steps()
    resumed.texts = {(third, "lobes.0"): engine.texts[first, "lobes.0"]}
    carried(store, tmp_path, resumed)
    assert client.lobe_job(third).answer == client.lobe_job(second).answer == client.lobe_job(first).answer
    assert [name for _, name in resumed.computed] == ["lobes.1"]


def test_what_takes_long_becomes_a_job(shop, store):
    client, id = shop
    wide = {"from_rpm": 500, "to_rpm": 20000, "step_rpm": 10}
    body = {"machine": id, "toolings": ["T1"], "method": "semi-discretisation", "speeds": wide}
    answer = client.http.post("/v1/lobes", json=body, headers={"Idempotency-Key": "k"})
    assert answer.status_code == 202
    job = answer.json()["id"]
    assert answer.headers["Location"] == f"/v1/lobes/{job}"
    assert answer.headers["Retry-After"]
    assert client.http.post("/v1/lobes", json=body, headers={"Idempotency-Key": "k"}).json()["id"] == job
    _, (tooling,), question = decode(store.jobs.text(job, "question"))
    assert tooling.name == "T1"
    assert question.work_seconds == pytest.approx(4.0 * 3600.0)
    other = client.http.post("/v1/lobes", json=body | {"method": "multi-frequency"}, headers={"Idempotency-Key": "k"})
    assert other.status_code == 409


def test_there_is_an_end_to_that_too(shop, store, tmp_path):
    _, id = shop
    wide = {"from_rpm": 500, "to_rpm": 20000, "step_rpm": 10}
    with service(store, tmp_path, job_work_seconds=50.0) as http:
        other = Client(http=http)
        problem = refused(422, other.lobes, id, "T1", method="semi-discretisation", speeds=wide)
        assert problem.errors[0].field == "speeds"
        # asked for as a job in any case, the job says so
        job = other.lobes_later(id, "T1", method="semi-discretisation", speeds=wide).id
        carried(store, tmp_path)
        found = other.lobe_job(job)
        assert (found.job.state, found.answer) == ("failed", None)
        assert found.job.problem.errors[0].field == "speeds"


@pytest.mark.slow
def test_the_client_waits_for_them(shop, store, tmp_path):
    """With a limit of work at which nothing is quick any more."""
    client, id = shop
    at_once = client.lobes(id, "T1", speeds=SPEEDS)
    with service(store, tmp_path, work_seconds=0.1) as http:
        other = Client(http=http)
        stop = threading.Event()

        def work():
            while not stop.wait(0.1):
                carried(store, tmp_path)

        thread = threading.Thread(target=work)
        thread.start()
        try:
            speeds = {"from_rpm": 8000, "to_rpm": 8100, "step_rpm": 50}
            assert other.lobes(id, "T1", method="multi-frequency", bands=False, speeds=speeds).toolings[0].method == "multi-frequency"
            assert other.lobes(id, "T1", speeds=SPEEDS) == at_once
            with pytest.raises(ServiceError, match="422"):
                # the machine is identified along both axes, its lobes need a cutter that cuts
                other.lobes(id, example(cutter={"teeth": 0, "diameter_mm": 12.0}), speeds=SPEEDS)
        finally:
            stop.set()
            thread.join()


@pytest.mark.slow
def test_cancelled_lobes_have_no_answer(shop, store):
    """The computation has no place to look up: its process ends, and nothing of it is kept."""
    client, id = shop
    job = later(client, id, "T1")
    codes = []

    def slow(_job, desk):
        client.send("DELETE", f"/lobes/{job}")
        desk.remember("lobes.0", partial(time.sleep, 4.0))
        return lobes.Outcome("done", "", texts={"answer": json.dumps({})})

    carry(store.jobs, {"lobes": slow}, "w", 3, job, partial(Steps().remember, job), codes.append)
    assert codes == [0]
    found = client.lobe_job(job)
    assert (found.job.state, found.answer) == ("cancelled", None)
    refused(409, client.send, "DELETE", f"/lobes/{job}")
    refused(404, client.job, job)


@pytest.mark.slow
def test_limits_come_before_the_answer(shop, store, tmp_path, monkeypatch):
    """Speed by speed of one tooling after the other, all of them the answer's own; a part of it is not there any more at its end."""
    monkeypatch.setattr(job_context, "CURVE", 0.0)
    monkeypatch.setattr(job_context, "DELIVERY", 0.01)
    client, id = shop
    job = later(client, id, "T1", example(), method="multi-frequency", bands=False)
    told, tell = [], store.jobs.tell

    def kept(id, worker, events, progress=None, further=False):
        told.extend((event.kind, event.data) for event in events)
        told.extend([] if progress is None else [("progress", progress)])
        return tell(id, worker, events, progress, further)

    monkeypatch.setattr(store.jobs, "tell", kept)
    carried(store, tmp_path)
    found = client.lobe_job(job)
    assert found.answer == client.lobes(id, "T1", example(), method="multi-frequency", bands=False, speeds=SPEEDS)
    parts = [PartialLobes.model_validate_json(data) for kind, data in told if kind == PARTIAL]
    assert {part.index for part in parts} == {0, 1}
    for part in parts:
        whole = found.answer.toolings[part.index]
        assert part.tooling == whole.tooling
        limits = dict(zip(whole.spindle_speed_rpm, zip(whole.limit_depth_mm, whole.chatter_frequency_hz, strict=True), strict=True))
        own = zip(part.spindle_speed_rpm, part.limit_depth_mm, part.chatter_frequency_hz, strict=True)
        # beside those that were asked for there are speeds that a recommendation needs
        assert all(limits.get(speed, (limit, chatter)) == (limit, chatter) for speed, limit, chatter in own)
    assert set(parts[-1].spindle_speed_rpm) >= set(found.answer.toolings[1].spindle_speed_rpm)
    # the first part spans the speeds
    first, *_, last = next(part.spindle_speed_rpm for part in parts if len(part.spindle_speed_rpm) > 1)
    assert first <= 6000.0
    assert last >= 12000.0
    progress = [json.loads(data) for kind, data in told if kind == "progress"]
    assert progress[-1] == {"stage": "speeds", "done": 26, "total": 26}
    assert PARTIAL not in [event.kind for event in store.jobs.events(job, 0, 1000)]


@pytest.mark.slow
def test_who_waits_is_told_its_place_and_for_how_long(shop, store):
    """Also when it moves up, in which nothing of its own happens."""
    client, id = shop
    first, second = (later(client, id, "T1") for _ in range(2))
    waiting = client.lobe_job(second).job
    assert (waiting.queue.place, waiting.queue.waiting) == (2, 2)
    assert waiting.waited_s >= 0.0
    assert waiting.running_s == 0.0
    told = []
    for kind, data in client.events(second, "lobes"):
        told.append((kind, data["queue"]))
        if len(told) == 1:
            client.send("DELETE", f"/lobes/{first}")
        elif len(told) == 2:
            client.send("DELETE", f"/lobes/{second}")
    assert told == [("progress", {"place": 2, "waiting": 2}), ("progress", {"place": 1, "waiting": 1}), ("end", None)]
    ended = client.lobe_job(second).job
    assert ended.queue is None
    assert ended.waited_s >= waiting.waited_s


def test_a_question_of_an_earlier_release_names_its_robot():
    """Jobs wait through an upgrade: their words have the keys of the release that took them."""
    job = Job("j", "A", "lobes", "", None, json.dumps({"machine": None, "robot": {"robot": "tx200"}}), "queued", "2026-01-01T00:00:00Z")
    assert lobes._called(job) == "tx200"
