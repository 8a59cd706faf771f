"""Identifications over REST: from uploads to modes, lines and a report, and everything that may come between."""

from __future__ import annotations

import asyncio
import json
import re
import threading
import time
import zipfile
from dataclasses import replace
from functools import partial

import h5py
import numpy as np
import pytest
from typer.testing import CliRunner

from api.client import Client
from api.jobs import identification as work
from api.jobs.event_feed import Crowded, EventFeeds
from api.jobs.identification import NO_REPORT
from api.jobs.job_context import STARTS_OVER, JobContext
from api.security import new_id, now
from api.shares import Shares
from api.stores.entities import Machine
from api.stores.jobs import Event, Job, Outcome
from rcsa_ident.base.errors import InputError
from rcsa_ident.cli import app
from rcsa_ident.identification.task import Phase
from rcsa_ident.io.recordings.readers import read_cut
from rcsa_ident.io.settings.setups import read_campaign
from tests.api import identifying
from tests.api.identifying import Steps, carried, declared, uploaded
from tests.api.in_process import URL, embedded, refused, service
from tests.fixtures.waiting import PATIENCE, until

KINDS = {"progress", "trace", "fit", "end"}


@pytest.fixture(scope="module")
def done(tmp_path_factory):
    """A service whose machine was identified: client, id of the machine, of the campaign, of the job, and the engine."""
    folder = tmp_path_factory.mktemp("done")
    store = embedded(folder)
    with service(store, folder) as http:
        client = Client(http=http)
        machine = client.make_machine("M").id
        campaign = uploaded(client, machine)
        job = client.identify_campaign(campaign, seed=3, repeat="k")
        assert (job.state, job.started, job.progress) == ("queued", None, None)
        engine = carried(store, folder)
        yield client, machine, campaign, job.id, engine, store, folder
    store.close()


@pytest.mark.slow
def test_an_identification_from_end_to_end(done):
    client, machine, campaign, id, *_ = done
    job = client.job(id)
    assert (job.kind, job.machine, job.campaign, job.state, job.problem) == ("identification", machine, campaign, "done", None)
    assert job.status == "suspect"
    assert job.created <= job.started <= job.finished
    assert job.progress.stage == "result"
    result = json.loads(client.result(id))
    assert (result["seed"], result["method"], result["campaign"]["cuts_used"]) == (3, "default", 4)
    modes = client.found_modes(id)
    assert modes.status == "suspect"
    assert len(modes.axes["X"].modes) == len(result["axes"]["X"]["modes"])
    lines = client.fitted(id).axes["X"]
    assert lines.frequency_hz == sorted(lines.frequency_hz)
    assert {len(getattr(lines, name)) for name in type(lines).model_fields} == {len(lines.frequency_hz)}
    assert set(lines.tooling) == set(declared()["toolings"])
    # the fit is one: the model's lines lie beside the measured ones
    measured, model = (
        np.array(re) + 1j * np.array(im) for re, im in ((lines.measured_re, lines.measured_im), (lines.model_re, lines.model_im))
    )
    assert np.linalg.norm(model - measured) < 0.2 * np.linalg.norm(measured)
    report = client.report(id)
    assert report.startswith("<!doctype html>")
    assert "<script" not in report
    # it is what the machine's lobes are computed from now
    assert client.machine(machine).identification.status == "suspect"
    assert client.send("GET", f"/machines/{machine}/identification").text == client.result(id)


@pytest.mark.slow
def test_it_is_what_the_commands_find(done, tmp_path):
    """Same recordings and seed, same file, byte for byte."""
    client, _, _, id, *_ = done
    folder = tmp_path / "campaign"
    folder.mkdir()
    client.archive(client.job(id).campaign, tmp_path / "campaign.zip")
    with zipfile.ZipFile(tmp_path / "campaign.zip") as archive:
        archive.extractall(folder)
    (inside,) = [path.parent for path in folder.rglob("campaign.toml")]
    words = ["identify", str(inside), "--out", str(tmp_path / "RESULT.json"), "--seed", "3", "--processes", "1", "--json"]
    found = CliRunner().invoke(app, words)
    assert found.exit_code == 3, found.output  # few cuts: suspect
    assert (tmp_path / "RESULT.json").read_text(encoding="utf-8") == client.result(id)


@pytest.mark.slow
def test_what_is_told_on_the_way(done):
    client, _, _, id, *_ = done
    events = list(client.events(id))
    assert {kind for kind, _ in events} == KINDS
    assert events[-1][0] == "end"
    assert events[-1][1]["state"] == "done"
    traces = [data for kind, data in events if kind == "trace"]
    assert {*traces[0]} == {"axis", "stage", "cost", "seconds"}
    assert [t["seconds"] for t in traces] == sorted(t["seconds"] for t in traces)
    assert {t["axis"] for t in traces} <= {"X", "both"}
    (fit,) = [data for kind, data in events if kind == "fit"]
    assert fit["axis"] == "X"
    assert len(fit["frequency_hz"]) == len(fit["measured_abs"]) == len(fit["model_abs"])
    assert all(value > 0.0 for value in fit["model_abs"])


@pytest.mark.slow
def test_a_lost_connection_goes_on_where_it_was_lost(done):
    client, _, _, id, *_ = done
    text = client.http.get(f"/v1/identifications/{id}/events").text
    numbers = [int(line.removeprefix("id: ")) for line in text.splitlines() if line.startswith("id: ")]
    assert numbers == sorted(set(numbers))
    for seen in (numbers[0], numbers[len(numbers) // 2], numbers[-1]):
        rest = client.http.get(f"/v1/identifications/{id}/events", headers={"Last-Event-ID": str(seen)})
        assert rest.headers["content-type"].startswith("text/event-stream")
        found = [int(line.removeprefix("id: ")) for line in rest.text.splitlines() if line.startswith("id: ")]
        assert found == [number for number in numbers if number > seen]
        assert "event: end" in rest.text.rstrip().split("\n\n")[-1].splitlines()


@pytest.mark.slow
def test_the_same_key_is_the_same_job(done):
    client, _, campaign, id, *_ = done
    assert client.identify_campaign(campaign, seed=3, repeat="k").id == id
    refused(409, client.identify_campaign, campaign, seed=4, repeat="k")


@pytest.mark.slow
@pytest.mark.parametrize("killed_after", [1, 4])
def test_a_killed_job_goes_on_and_finds_the_same(done, killed_after):
    """The process is gone after so many steps: what was remembered is not done again, and the answer is the same to the last bit."""
    client, _, campaign, id, engine, store, folder = done
    names = [name for job, name in engine.computed if job == id]
    assert len(names) >= 5
    second = client.identify_campaign(campaign, seed=3, apply=False).id
    steps = Steps()
    steps.texts = {(second, name): engine.texts[id, name] for name in names[:killed_after]}
    carried(store, folder, steps)
    assert client.result(second) == client.result(id)
    assert [name for _, name in steps.computed] == names[killed_after:]
    # every text that a step left is the same: nothing rests on what a process has kept
    assert all(steps.texts[second, name] == engine.texts[id, name] for name in names)


@pytest.mark.slow
def test_a_report_that_cannot_be_written_costs_no_result(done, monkeypatch):
    client, _, campaign, id, engine, store, folder = done

    def broken(*_args, **_further):
        raise RuntimeError("secret detail")

    monkeypatch.setattr("rcsa_ident.report.html.report_html", broken)
    second = client.identify_campaign(campaign, seed=3, apply=False).id
    steps = Steps()
    steps.texts = {(second, name): engine.texts[id, name] for job, name in engine.computed if job == id}
    carried(store, folder, steps)
    assert client.job(second).state == "done"
    assert client.job(second).problem.detail == NO_REPORT
    assert client.result(second) == client.result(id)
    refused(404, client.report, second)


@pytest.mark.slow
def test_a_job_that_an_earlier_version_began_starts_over(done):
    """Its steps are in a form that nobody reads any more: the same bytes come out as if it had never begun, and it says so."""
    client, _, campaign, id, engine, store, folder = done
    second = client.identify_campaign(campaign, seed=3, apply=False).id
    store.jobs.begin(second, "earlier", now())
    store.jobs.tell(second, "earlier", [], json.dumps({"stage": "search", "done": 0, "total": 1}))
    steps = Steps()
    old = {"plan": [[cut.id, "x.h5", ""] for cut in client.campaign(campaign).cuts], "1_search_axis.0": {"~AxisSearch": {"solutions": []}}}
    steps.texts = {(second, name): json.dumps({"~table": [["value", value]]}) for name, value in old.items()}
    carried(store, folder, steps)
    # the engine has seen it end, and forgets it
    assert client.job(second).state == "running"
    assert steps.computed == []
    fresh = carried(store, folder)
    assert client.job(second).state == "done"
    assert client.result(second) == client.result(id)
    assert [name for _, name in fresh.computed] == [name for job, name in engine.computed if job == id]
    notes = [data["text"] for kind, data in client.events(second) if kind == "note"]
    assert notes == [STARTS_OVER]
    assert "starts over from its recordings" in notes[0]


@pytest.mark.slow
def test_what_a_job_keeps_is_documented(done):
    """Nouns that methods promise to answer with, and none of the equations behind them."""
    *_, id, engine, _, _ = done
    kept = {noun for (job, _), text in engine.texts.items() if job == id for noun in re.findall(r'"~([A-Z]\w+)"', text)}
    assert kept <= {
        "Reading",
        "Verdict",
        "Remark",
        "CutMeasurement",
        "AxisLines",
        "AxisSearch",
        "Candidate",
        "Layout",
        "AxisLayout",
        "Step",
    }
    names = [name for job, name in engine.computed if job == id]
    assert {name.split(".")[1] for name in names if name[0].isdigit()} == {phase.name.lower() for phase in (Phase.SEARCH, Phase.BOTH_AXES)}


@pytest.mark.slow
def test_going_on_from_an_earlier_answer(done):
    client, machine, campaign, _, _, store, folder = done
    before = client.send("GET", f"/machines/{machine}/identification").text
    job = client.identify_campaign(campaign, start=True, apply=False).id
    engine = carried(store, folder)
    result = json.loads(client.result(job))
    etag = client.machine(machine).identification.etag
    assert result["started_from"] == etag
    assert client.send("GET", f"/machines/{machine}/identification").text == before
    # nothing is explored
    assert not any(data["stage"] == "search" for kind, data in client.events(job) if kind == "trace")
    assert len(engine.computed) >= 4


@pytest.mark.slow
def test_lists(done):
    client, machine, campaign, id, *_ = done
    found = list(client.jobs(limit=1, machine=machine, campaign=campaign))
    assert id in [job.id for job in found]
    assert [job.id for job in found] == sorted((job.id for job in found), reverse=True)
    assert list(client.jobs(state="cancelled")) == []
    assert list(client.jobs(machine="nobody")) == []
    refused(422, lambda: list(client.jobs(state="lost")))


def test_what_can_not_be_identified(client, store, tmp_path, result):
    machine = client.make_machine("M").id
    empty = client.make_campaign(machine, declared(1)).id
    problem = refused(422, client.identify_campaign, empty)
    assert problem.errors[0].field == "campaign"
    refused(404, client.identify_campaign, "nobody")
    client.upload(empty, identifying.files(1)[1])
    assert "without an identification" in refused(422, client.identify_campaign, empty, start=True).detail
    client.identify(machine, result)
    refused(422, client.identify_campaign, empty, start=True, method="paper")
    for wrong in ({"seed": -1}, {"seed": 1.5}, {"seed": 2**63}, {"method": "magic"}, {"start": "yes"}, {"more": 1}):
        refused(422, client.identify_campaign, empty, **wrong)
    bare = json.loads(result)
    for axis in bare["axes"].values():
        del axis["covariance"]
    client.identify(machine, json.dumps(bare))
    assert "no covariance" in refused(422, client.identify_campaign, empty, start=True).detail
    assert list(client.jobs()) == []


def test_a_campaign_that_goes_while_the_job_waits(client, store, tmp_path):
    machine = client.make_machine("M").id
    campaign = uploaded(client, machine, 1)
    id = client.identify_campaign(campaign).id
    client.forget_campaign(campaign)
    carried(store, tmp_path)
    job = client.job(id)
    assert job.state == "failed"
    assert job.problem.errors[0].field == "campaign"
    assert str(tmp_path) not in job.problem.detail


def test_no_usable_cut_is_a_reason(client, store, tmp_path):
    """A sensor that was not plugged in: the job fails and says what was wrong."""
    machine = client.make_machine("M").id
    campaign = client.make_campaign(machine, declared(1)).id
    silent = tmp_path / identifying.files(1)[1].name
    with h5py.File(silent, "w") as file:
        file.attrs["sampling_rate_hz"] = 25600.0
        file["flange_x"] = np.zeros(30_000, "f4")
    client.upload(campaign, silent)
    id = client.identify_campaign(campaign).id
    carried(store, tmp_path)
    job = client.job(id)
    assert job.state == "failed"
    assert "none of 1 usable" in job.problem.detail
    assert "no signal" in job.problem.errors[0].found
    refused(409, client.result, id)
    refused(409, client.report, id)
    assert client.machine(machine).identification is None


def test_files_that_are_lost_tell_no_path(store, tmp_path, client):
    machine = client.make_machine("M").id
    campaign = uploaded(client, machine, 1)
    id = client.identify_campaign(campaign).id
    for file in (tmp_path / "files").rglob("*"):
        if file.is_file():
            file.write_bytes(b"no longer what it was")
    carried(store, tmp_path)
    job = client.job(id)
    assert job.state == "failed"
    assert "unreadable" in job.problem.detail
    assert str(tmp_path) not in job.model_dump_json()


def test_cancelled_while_it_waits(client, store, tmp_path):
    campaign = uploaded(client, client.make_machine("M").id, 1)
    id = client.identify_campaign(campaign).id
    answer = client.send("DELETE", f"/identifications/{id}")
    assert answer.status_code == 202
    assert answer.json()["state"] == "cancelled"
    refused(409, client.cancel, id)
    assert carried(store, tmp_path).computed == []
    assert client.job(id).state == "cancelled"
    assert [kind for kind, _ in client.events(id)] == ["progress", "end"]
    refused(409, client.found_modes, id)


@pytest.mark.slow
def test_cancelled_while_it_runs(client, store, tmp_path):
    """It stops within moments, has no result, and the machine stays as it was."""
    machine = client.make_machine("M").id
    id = client.identify_campaign(uploaded(client, machine)).id
    engine = Steps()
    thread = threading.Thread(target=carried, args=(store, tmp_path, engine))
    thread.start()
    for kind, _ in client.events(id):
        if kind == "trace":
            break
    assert client.cancel(id).state == "cancelled"
    thread.join(PATIENCE)
    assert not thread.is_alive()
    assert client.job(id).state == "cancelled"
    refused(409, client.result, id)
    assert client.machine(machine).identification is None
    assert not any(Phase.BOTH_AXES.name.lower() in name for _, name in engine.computed)


@pytest.mark.slow
def test_a_query_that_waits_for_the_end(client, store):
    machine = store.machines.add(Machine(new_id(), "local", "M", "", now())).id
    id = store.jobs.add(Job(new_id(), "local", "identification", machine, "c", "{}", "queued", now()), {}, 9).id
    store.jobs.begin(id, "w", now())
    assert client.job(id, wait=1).state == "running"
    timer = threading.Timer(0.5, store.jobs.finish, (id, "w", Outcome("done", now(), status="suspect")))
    timer.start()
    start = time.monotonic()
    assert client.job(id, wait=30).state == "done"
    assert time.monotonic() - start < 25.0
    for strange in ("wait=", "wait=x", "respond-async, wait=0", "wait=99999999999999", "", ";;"):
        assert client.http.get(f"/v1/identifications/{id}", headers={"Prefer": strange}).status_code == 200


def test_retry_after_until_it_has_ended(client, store):
    machine = store.machines.add(Machine(new_id(), "local", "M", "", now())).id
    id = store.jobs.add(Job(new_id(), "local", "identification", machine, "c", "{}", "queued", now()), {}, 9).id
    assert client.http.get(f"/v1/identifications/{id}").headers["Retry-After"]
    store.jobs.cancel("local", id, now())
    assert "Retry-After" not in client.http.get(f"/v1/identifications/{id}").headers


def test_another_group_sees_nothing(guarded_http, store):
    http, keys = guarded_http
    machine = store.machines.add(Machine(new_id(), "A", "M", "", now())).id
    id = store.jobs.add(Job(new_id(), "A", "identification", machine, "c", "{}", "queued", now()), {}, 9).id
    for path in ("", "/events", "/modes", "/frf", "/result", "/report"):
        assert http.get(f"/v1/identifications/{id}{path}", headers={"X-API-Key": keys["other"]}).status_code == 404
    assert http.delete(f"/v1/identifications/{id}", headers={"X-API-Key": keys["other"]}).status_code == 404
    assert http.get("/v1/identifications", headers={"X-API-Key": keys["other"]}).json()["items"] == []
    assert http.get(f"/v1/identifications/{id}", headers={"X-API-Key": keys["read"]}).status_code == 200
    assert http.delete(f"/v1/identifications/{id}", headers={"X-API-Key": keys["read"]}).status_code == 403
    # a job of one kind is none of the other
    assert http.get(f"/v1/lobes/{id}", headers={"X-API-Key": keys["read"]}).status_code == 404
    assert http.delete(f"/v1/identifications/{id}", headers={"X-API-Key": keys["run"]}).status_code == 202


def test_as_many_jobs_wait_as_are_allowed(store, tmp_path):
    with service(store, tmp_path, job_queue=2) as http:
        client = Client(http=http)
        campaign = uploaded(client, client.make_machine("M").id, 1)
        for _ in range(2):
            client.identify_campaign(campaign)
        answer = http.post("/v1/identifications", json={"campaign": campaign})
        assert answer.status_code == 503
        assert answer.headers["Retry-After"]


def test_counts_for_prometheus(client, store):
    machine = store.machines.add(Machine(new_id(), "local", "M", "", now())).id
    for k in range(3):
        id = store.jobs.add(Job(new_id(), "local", "lobes", machine, None, "{}", "queued", now()), {}, 9).id
        if k:
            store.jobs.begin(id, "w", now())
            store.jobs.finish(id, "w", Outcome("done", now(), 2.0))
    text = client.http.get("/metrics").text
    assert 'rcsa_ident_jobs{kind="lobes",state="queued"} 1.0' in text
    assert 'rcsa_ident_jobs{kind="lobes",state="done"} 2.0' in text
    assert 'rcsa_ident_job_seconds_sum{kind="lobes",state="done"} 4.0' in text


@pytest.mark.slow
def test_many_watch_at_the_cost_of_one(store):
    """A hundred streams of one job: the store is asked as often as for one."""
    machine = store.machines.add(Machine(new_id(), "local", "M", "", now())).id
    id = store.jobs.add(Job(new_id(), "local", "identification", machine, "c", "{}", "queued", now()), {}, 9).id
    store.jobs.begin(id, "w", now())
    asked = []

    class Counted:
        def numbers(self, ids):
            asked.append("numbers")
            return store.jobs.numbers(ids)

        def events(self, *arguments):
            asked.append("events")
            return store.jobs.events(*arguments)

    async def watch(feeds, seen):
        after = 0
        while not seen or seen[-1].kind != "end":
            found = await feeds.events(id, after)
            seen += found
            after = seen[-1].number if seen else 0
            if not found:
                await feeds.wait(id, after, 5.0)
        return [event.data for event in seen if event.kind == "trace"]

    async def main():
        feeds = EventFeeds(Counted(), Shares(3))
        seen = [[] for _ in range(100)]
        watching = [asyncio.create_task(watch(feeds, each)) for each in seen]
        for k in range(4):
            store.jobs.tell(id, "w", [Event(0, "trace", f"{k}")])
            await asyncio.to_thread(until, lambda k=k: all(each and each[-1].data == f"{k}" for each in seen))
        store.jobs.finish(id, "w", Outcome("done", now()))
        return await asyncio.gather(*watching)

    found = asyncio.run(main())
    assert all(seen == ["0", "1", "2", "3"] for seen in found)
    assert asked.count("events") < 100
    assert asked.count("numbers") < 100


def test_too_many_watchers_are_told_so(store):
    feeds = EventFeeds(store.jobs, Shares(1))
    with feeds.stream("A"), pytest.raises(Crowded), feeds.stream("B"):
        pass
    with feeds.stream("A"):
        assert feeds.places.total == 1


@pytest.mark.slow
def test_a_stream_ends_after_its_time_and_goes_on(store, tmp_path):
    machine = store.machines.add(Machine(new_id(), "local", "M", "", now())).id
    id = store.jobs.add(Job(new_id(), "local", "identification", machine, "c", "{}", "queued", now()), {}, 9).id
    with service(store, tmp_path, watch_seconds=0.5, watchers=1) as http:
        first = http.get(f"/v1/identifications/{id}/events").text
        assert "event: end" not in first
        # the one stream that is allowed is free again
        assert http.get(f"/v1/identifications/{id}/events").status_code == 200
        store.jobs.cancel("local", id, now())
        assert "event: end" in http.get(f"/v1/identifications/{id}/events").text


def test_a_job_reads_what_was_there_when_it_began(tmp_path, store):
    """A recording that comes, or goes, between two processes of one job."""
    campaign = read_campaign(identifying.SAMPLES)
    cuts = campaign.cuts[:3]
    sensors = tuple(s for s in campaign.sensors if s.name == "flange_x")
    there = [replace(campaign, cuts=cuts[:2], sensors=sensors), replace(campaign, cuts=cuts, sensors=sensors)]
    machine = store.machines.add(Machine(new_id(), "local", "M", "", now())).id
    job = Job(new_id(), "local", "identification", machine, "c", "{}", "queued", now())
    steps = Steps()

    def judged(found):
        desk = JobContext(store.jobs, job.id, "w", partial(steps.remember, job.id))
        plan = desk.remember("plan", lambda: [work._files(cut) for cut in found.cuts])
        planned = work._planned(found, plan)
        read = partial(read_cut, sensors, campaign.sampling_rate)
        return [each.cut_id for each in work._readings(planned, read, desk)]

    assert judged(there[0]) == judged(there[1]) == [cut.id for cut in cuts[:2]]
    with pytest.raises(InputError, match="since the job began"):
        judged(replace(campaign, cuts=cuts[1:], sensors=sensors))


def test_a_stream_over_a_real_connection_needs_the_key(guarded_http, store):
    http, keys = guarded_http
    machine = store.machines.add(Machine(new_id(), "A", "M", "", now())).id
    id = store.jobs.add(Job(new_id(), "A", "identification", machine, "c", "{}", "queued", now()), {}, 9).id
    assert http.get(f"{URL}/v1/identifications/{id}/events").status_code == 401
    assert http.get(f"/v1/identifications/{id}/events", headers={"X-API-Key": keys["read"], "Last-Event-ID": "x"}).status_code == 422
