"""What the cuts of a new tooling teach, over REST: looked at first, then written as versions, and never twice."""

from __future__ import annotations

import asyncio
import json
from concurrent.futures import ThreadPoolExecutor
from threading import Barrier

import pytest
from fastapi.testclient import TestClient

from api.client import Client
from api.main import create_app
from api.settings import Settings
from api.work.worker import QueryLimits
from tests.api.in_process import Here, embedded, refused
from tests.fixtures import by_hand, further_cuts

STIFFNESS = "translational stiffness of the contact"


@pytest.fixture(scope="module")
def known() -> str:
    return further_cuts.result_text()


def made(client: Client, result: str, **changed) -> tuple[str, str]:
    """Ids of an identified machine, and of a campaign of two cuts with T7."""
    machine = client.make_machine("HPM").id
    client.identify(machine, result)
    client.write_tooling("T7", further_cuts.drawn() | changed)
    return machine, uploaded(client, machine, further_cuts.campaign())


def uploaded(client: Client, machine: str, keys) -> str:
    campaign = client.make_campaign(machine, keys).id
    for file in further_cuts.files(keys):
        client.upload(campaign, file)
    return campaign


def number(found, what=STIFFNESS):
    (tooling,) = found.toolings
    return next(row for row in tooling.learned if row.what == what)


@pytest.mark.slow
def test_new_cuts_are_looked_at_and_taken_over(client, known):
    """The contact is drawn at 0.7 of what it is; two cuts tell, and what is written is what was seen."""
    machine, campaign = made(client, known)
    assert client.campaign(campaign).rough_toolings == ["T7"]
    assert client.machine(machine).identification.toolings == ["S1-ER32", "S2-PG25"]
    library, identification = client.tooling("T7"), client.machine(machine).identification
    found = client.learn(campaign)
    assert (found.status, found.campaign, found.machine, found.written) == ("converged", campaign, machine, [])
    row = number(found)
    true = row.drawn / further_cuts.SOFTER
    # nearer to what is true than the drawing, and surer
    assert abs(row.found - true) < min(3.0 * row.found_std, 0.5 * abs(row.drawn - true))
    assert row.found_std / row.found < 0.7 * row.drawn_std / row.drawn
    assert max(found.model_error) < 0.1
    # nothing was written
    assert (client.tooling("T7"), client.machine(machine).identification) == (library, identification)

    done = client.take_over(campaign, seen=found.etag)
    assert (done.written, done.machine_written, done.toolings) == (["T7"], False, found.toolings)
    kept = client.tooling("T7").tooling
    assert kept.contact.translational_stiffness == pytest.approx(row.found)
    assert kept.spread.contact_stiffness_percent < 40.0
    assert [(c.version, c.why) for c in client.changes(kind="tooling", name="T7")] == [(2, "learned from the campaign new tool"), (1, "")]
    assert client.machine(machine).identification == identification
    # the same again writes nothing
    assert client.take_over(campaign).written == []

    both = client.take_over(campaign, machine=True, seen=found.etag, why="first cut")
    assert (both.written, both.machine_written) == ([], True)
    taught = client.machine(machine).identification
    assert (taught.taught_by, taught.toolings) == ([f"new tool ({campaign})"], identification.toolings)
    assert [c.why for c in client.changes(kind="identification", name=machine)] == ["first cut", ""]
    assert client.tooltip(machine, "T7").axes["X"].re_std is not None
    # what is known already would count twice
    assert refused(422, client.learn, campaign).errors[0].field == "campaign"
    assert refused(412, client.take_over, campaign, seen=found.etag).status == 412


@pytest.mark.slow
def test_what_others_have_written_is_not_overwritten(client, known):
    machine, campaign = made(client, known)
    found = client.learn(campaign)
    other = client.write_tooling("T7", further_cuts.drawn() | {"cutter": {"teeth": 3, "diameter_mm": 12.0}})
    problem = refused(409, client.take_over, campaign, machine=True, seen=found.etag)
    assert (problem.errors[0].found, "T7 of the library is not the one" in problem.detail) == ("T7", True)
    assert client.tooling("T7").etag == other.etag
    assert client.machine(machine).identification.taught_by == []
    # without one in the library it is a new one
    client.forget_tooling("T7")
    assert client.take_over(campaign, seen=found.etag).written == ["T7"]
    # another recording, another answer
    keys = further_cuts.campaign()
    client.forget_recording(campaign, further_cuts.files(keys)[-1].name)
    refused(412, client.take_over, campaign, seen=found.etag)


@pytest.mark.slow
def test_cuts_that_contradict_are_named_and_nothing_is_written(client, result):
    """They are another machine's."""
    machine, campaign = made(client, result)
    found = client.learn(campaign)
    (tooling,) = found.toolings
    assert (found.status, tooling.tooling) == ("suspect", None)
    assert "no tooling near its drawing explains its cuts" in tooling.contradiction
    done = client.take_over(campaign, machine=True, seen=found.etag)
    assert (done.written, done.machine_written) == ([], False)
    assert client.machine(machine).identification.taught_by == []
    assert len(list(client.changes(kind="tooling", name="T7"))) == 1


@pytest.mark.slow
def test_taps_teach_as_cuts_do(client, known, tmp_path):
    """A campaign of hammer tests of the tip alone; the drawn contact is 0.7 of what it is."""
    machine = client.make_machine("HPM").id
    client.identify(machine, known)
    client.write_tooling("T7", further_cuts.drawn())
    file = further_cuts.write_tap(tmp_path / "tip.csv")
    campaign = client.make_campaign(machine, further_cuts.tapped(file.name)).id
    client.upload(campaign, file)
    found = client.learn(campaign)
    row = number(found, "rotational stiffness of the contact")
    assert found.status == "converged"
    # how far a tap teaches hangs on how well the machine is known, and that on the valley of a search as small as this one
    assert abs(row.found - row.drawn / further_cuts.SOFTER) < 0.8 * abs(row.drawn - row.drawn / further_cuts.SOFTER)
    assert row.found_std / row.found < row.drawn_std / row.drawn
    done = client.take_over(campaign, machine=True, seen=found.etag)
    assert (done.written, done.machine_written) == (["T7"], True)
    assert client.machine(machine).identification.taught_by == [f"new tool tapped ({campaign})"]
    assert refused(422, client.learn, campaign).errors[0].field == "campaign"
    # hits in front of the flange tell of the machine, and are an identification's
    keys = further_cuts.tapped("nut.csv", 1)
    keys["frfs"][0]["force"] = 60.0
    keys["toolings"] = {"T8": further_cuts.drawn() | {"name": "T8"}}
    keys["frfs"][0]["tooling"] = "T8"
    other = client.make_campaign(machine, keys).id
    client.upload(other, file.rename(tmp_path / "nut.csv"))
    assert refused(422, client.learn, other).errors[0].field == "frfs.force"


@pytest.mark.slow
def test_toolings_and_machine_are_taken_over_together_or_not_at_all(client, known, monkeypatch):
    """Another has written the machine between what was read of it and what is written."""
    machine, campaign = made(client, known)
    found, before = client.learn(campaign), client.tooling("T7").etag
    store = client.http.app.state.components.store
    written = store.put_together

    def late(toolings, identification, note):
        client.identify(machine, json.dumps(json.loads(known) | {"notes": ["identified again"]}))
        return written(toolings, identification, note)

    monkeypatch.setattr(store, "put_together", late)
    refused(412, client.take_over, campaign, machine=True, seen=found.etag)
    assert client.tooling("T7").etag == before
    assert client.machine(machine).identification.taught_by == []


@pytest.mark.slow
def test_refusals_are_the_commands(client, result, tmp_path):
    machine, campaign = made(client, result)
    exact = {key: value for key, value in further_cuts.drawn().items() if key != "spread"}
    client.write_tooling("T7", exact)
    problem = refused(422, client.learn, uploaded(client, machine, further_cuts.campaign(1)))
    assert (problem.errors[0].field, "[spread]" in problem.errors[0].allowed) == ("spread", True)
    empty = client.make_campaign(machine, further_cuts.campaign() | {"campaign": {"name": "empty", "sampling_rate_hz": 25600.0}}).id
    assert "no recording" in refused(422, client.learn, empty).errors[0].found
    client.identify(machine, by_hand.flange_file(tmp_path / "FLANGE.csv").read_text(encoding="utf-8"))
    assert refused(422, client.learn, campaign).errors[0].found == "a measured flange"
    bare = client.make_machine("bare").id
    refused(404, client.learn, client.make_campaign(bare, further_cuts.campaign()).id)
    refused(404, client.learn, "nothing")


@pytest.mark.slow
def test_keys_and_groups(guarded_http, result):
    http, keys = guarded_http
    _, campaign = made(Client(key=keys["admin"], http=http), result)
    for path, allowed in ((f"/v1/campaigns/{campaign}/learn", "run"), (f"/v1/campaigns/{campaign}/learn/take-over", "upload")):
        assert http.post(path).status_code == 401
        for name in ("read", "upload", "run"):
            assert http.post(path, headers={"X-API-Key": keys[name]}).status_code == (200 if name == allowed else 403)
        assert http.post(path, headers={"X-API-Key": keys["other"]}).status_code == 404


@pytest.mark.slow
def test_too_many_cuts_are_refused_in_words(tmp_path, result):
    class Slow(Here):
        async def run(self, call, *arguments):
            if call.__name__ == "learn":
                raise QueryLimits(seconds=7.0).too_long
            return await super().run(call, *arguments)

    with TestClient(create_app(Settings(data=tmp_path), embedded(tmp_path), Slow(), Here()), base_url="http://localhost") as http:
        _, campaign = made(Client(http=http), result)
        (fault,) = refused(422, Client(http=http).learn, campaign).errors
    assert fault.found == "2 cuts, which take more than 7 s"
    assert "one of the new toolings alone" in fault.allowed


def test_a_result_says_by_whom_it_was_taught(client, result):
    data = json.loads(result)
    machine = client.make_machine("M").id
    client.identify(machine, json.dumps(data | {"taught_by": ["new tool (c1)"]}))
    assert client.machine(machine).identification.taught_by == ["new tool (c1)"]
    for wrong in ("c1", [1], ["c"] * 201):
        assert refused(422, client.identify, machine, json.dumps(data | {"taught_by": wrong})).errors[0].field.startswith("taught_by")


def test_two_who_take_over_at_once_teach_the_machine_once(client, result, monkeypatch):
    """Both have computed the same from the same before either writes."""
    machine = client.make_machine("HPM").id
    client.identify(machine, result)
    client.write_tooling("T7", further_cuts.drawn())
    campaign = client.make_campaign(machine, further_cuts.campaign()).id
    together = Barrier(2)
    taught = {"text": json.dumps(json.loads(result) | {"taught_by": [f"new tool ({campaign})"]}), "summary": {}}
    stiffer = further_cuts.drawn() | {"contact": {key: 2.0 * value for key, value in further_cuts.drawn()["contact"].items()}}
    found = {
        "status": "converged", "model_error": [], "notes": [], "left_out": [], "warnings": [], "taught": taught,
        "toolings": [{"name": "T7", "contradiction": "", "learned": [], "tooling": stiffer}],
    }  # fmt: skip

    async def learned(*arguments):
        await asyncio.to_thread(together.wait)
        return found

    monkeypatch.setattr("api.routes.learning._learned", learned)
    with ThreadPoolExecutor(2) as threads:
        path = f"/v1/campaigns/{campaign}/learn/take-over?machine=true"
        answers = list(threads.map(lambda _: client.http.post(path), range(2)))
    assert sorted(answer.status_code for answer in answers) == [200, 412]
    assert [change.action for change in client.changes(kind="tooling", name="T7")] == ["changed", "made"]
    assert [change.action for change in client.changes(kind="identification")] == ["changed", "made"]
