"""Versions of toolings and identifications, their restoration, and the audit trail."""

from __future__ import annotations

import json

import pytest
from sqlalchemy import text

from api.client import Client
from api.schemas.campaigns import EXAMPLE as CAMPAIGN
from api.security import new_id, now
from api.stores.entities import Machine, digest_of
from api.stores.jobs import Applied, Outcome
from tests.api.identifying import job as queued
from tests.api.in_process import BOTH, refused
from tests.fixtures import by_hand
from tests.fixtures.service import example

THREE = {"teeth": 3, "diameter_mm": 12.0}


@pytest.fixture
def presetting(guarded_http) -> Client:
    """A client of group A whose key is called presetting."""
    http, keys = guarded_http
    return Client(key=Client(key=keys["admin"], http=http).make_key("upload", "read", label="presetting").key, http=http)


def told(client, **wanted):
    return [(c.version, c.action, c.who, c.why) for c in client.changes(limit=2, **wanted)]


def test_every_version_is_kept_with_who_when_and_why(presetting):
    first = presetting.write_tooling("T1", example())
    presetting.write_tooling("T1", example(cutter=THREE), why="reground, a tooth lost")
    # the same again is no version
    presetting.write_tooling("T1", example(cutter=THREE))
    presetting.forget_tooling("T1")
    assert told(presetting, kind="tooling", name="T1") == [
        (3, "deleted", "presetting", ""),
        (2, "changed", "presetting", "reground, a tooth lost"),
        (1, "made", "presetting", ""),
    ]
    oldest = list(presetting.changes())[-1]
    assert (oldest.etag, oldest.title) == (first.etag, "T1")
    assert oldest.key == presetting.headers["X-API-Key"].split("_")[1]
    assert first.changed[:10] == oldest.created[:10]
    assert told(presetting, name="T2") == []


def test_a_version_is_restored_also_after_a_deletion(presetting):
    first = presetting.write_tooling("T1", example())
    second = presetting.write_tooling("T1", example(cutter=THREE))
    version = presetting.tooling_version("T1", 1)
    assert [(d.field, d.old, d.new) for d in version.differences] == [("cutter.teeth", 3, 4)]
    assert version.tooling.cutter.teeth == 4
    refused(412, presetting.restore_tooling, "T1", 1, seen=first.etag)
    assert presetting.restore_tooling("T1", 1, seen=second.etag, why="it was the wrong one").etag == first.etag
    assert presetting.tooling("T1").tooling.cutter.teeth == 4
    presetting.forget_tooling("T1")
    assert presetting.send("POST", "/toolings/T1/versions/2/restore").status_code == 201
    assert presetting.tooling("T1").etag == second.etag
    assert [(c.version, c.action, c.restores) for c in presetting.changes()] == [
        (5, "restored", 2), (4, "deleted", None), (3, "restored", 1), (2, "changed", None), (1, "made", None),
    ]  # fmt: skip
    # what a deletion has written down has no content
    for version in (4, 9):
        refused(404, presetting.tooling_version, "T1", version)
        refused(404, presetting.restore_tooling, "T1", version)


def test_what_is_there_is_not_restored(client):
    """Not offered, and refused in words; what has come to harm is."""
    first = client.write_tooling("T1", example())
    second = client.write_tooling("T1", example(cutter=THREE))
    client.restore_tooling("T1", 1)
    assert [(c.version, c.holds) for c in client.changes()] == [(3, True), (2, False), (1, True)]
    assert client.tooling_version("T1", 1).change.holds
    for version in (1, 3):
        for seen in (None, first.etag):
            found = refused(409, client.restore_tooling, "T1", version, seen=seen)
            assert found.detail == f"there is nothing to restore: version {version} is what is there now"
    refused(412, client.restore_tooling, "T1", 1, seen=second.etag)
    client.forget_tooling("T1")
    assert [(c.version, c.holds) for c in client.changes()] == [(4, False), (3, False), (2, False), (1, False)]
    assert client.restore_tooling("T1", 3).etag == first.etag


def test_an_identification_that_is_there_is_not_restored(client, result):
    machine = client.make_machine("HPM").id
    client.identify(machine, result)
    refused(409, client.restore_identification, machine, 1)
    assert [(c.kind, c.holds) for c in client.changes()] == [("identification", True), ("machine", False)]


def test_the_version_of_a_tooling_that_is_damaged_mends_it(store, client):
    client.write_tooling("T1", example())
    with store.writing() as connection:
        connection.execute(text("UPDATE toolings SET text = 'nonsense'"))
    assert [c.holds for c in client.changes()] == [False]
    refused(500, client.tooling, "T1")
    client.restore_tooling("T1", 1)
    assert client.tooling("T1").tooling.cutter.teeth == 4


def test_differences_are_told_before_anything_is_written(client):
    there = client.write_tooling("T1", example())
    changed = example(cutter=THREE | {"pitch_deg": [100.0, 120.0, 140.0]})
    changed["tool"]["segments"].append({"length_mm": 5.0, "outer_diameter_mm": 12.0, "material": "steel"})
    found = client.differences("T1", changed)
    assert found.etag == there.etag
    assert {d.field: (d.old, d.new) for d in found.differences} == {
        "cutter.teeth": (4, 3),
        "cutter.pitch_deg": (None, [100.0, 120.0, 140.0]),
        "tool.segments.1.length_mm": (None, 5.0),
        "tool.segments.1.outer_diameter_mm": (None, 12.0),
        "tool.segments.1.material": (None, "steel"),
    }
    # blanks and remarks are no difference
    assert client.differences("T1", f"# the same\n{client.tooling_file('T1')}\n").differences == []
    assert client.tooling("T1").etag == there.etag
    refused(404, client.differences, "T2", example())
    assert refused(422, client.differences, "T1", example(cutter={"teeth": 0, "diameter_mm": 12.0})).errors[0].field == "cutter.teeth"


def test_an_identification_goes_back_to_an_earlier_one(client, result, tmp_path):
    machine = client.make_machine("HPM 800U").id
    client.identify(machine, result)
    client.identify(machine, by_hand.result_text(tmp_path, seed=8))
    assert client.identification_version(machine, 1) == result
    back = client.restore_identification(machine, 1, why="the newer one had no air cuts")
    assert client.send("GET", f"/machines/{machine}/identification").text == result
    assert client.machine(machine).identification == back
    newest = next(client.changes())
    assert (newest.kind, newest.title, newest.action, newest.restores) == ("identification", "HPM 800U", "restored", 1)
    client.forget_machine(machine)
    assert next((c.kind, c.action, c.title) for c in client.changes()) == ("machine", "deleted", "HPM 800U")
    refused(404, client.identification_version, machine, 1)
    refused(404, client.restore_identification, machine, 1)


def test_a_campaign_may_bring_its_toolings_as_texts_and_leaves_the_library_alone(client, store):
    there = client.write_tooling("S1-ER32", example())
    machine = client.make_machine("m").id
    own = by_hand.TOOLING.replace("teeth = 4", "teeth = 3")
    made = client.make_campaign(machine, {**CAMPAIGN, "toolings": {"S1-ER32": own}})
    assert client.tooling("S1-ER32").etag == there.etag
    kept = json.loads(store.campaigns.get("local", made.id).text)["toolings"]
    assert kept == {"S1-ER32": own}
    wrong = {**CAMPAIGN, "toolings": {"S1-ER32": own.replace("teeth = 3", "teeth = 0")}}
    assert refused(422, client.make_campaign, machine, wrong).errors[0].field == "cutter.teeth"


def test_nobody_sees_the_trail_of_another_group(guarded_http):
    http, keys = guarded_http
    mine, other = Client(key=keys["admin"], http=http), Client(key=keys["other"], http=http)
    mine.write_tooling("T1", example())
    assert list(other.changes()) == []
    refused(404, other.tooling_version, "T1", 1)
    refused(404, other.restore_tooling, "T1", 1)


@BOTH
def test_an_identification_that_a_job_writes_names_who_asked_for_it(store):
    machine = store.machines.add(Machine(new_id(), "A", "M", "", now())).id
    job = queued(machine, key="k1", who="night shift")
    store.jobs.add(job, {}, 9)
    store.jobs.begin(job.id, "w", now())
    assert store.jobs.finish(job.id, "w", Outcome("done", now(), applied=Applied("{}", "{}", digest_of("{}"))))
    newest = store.changes.list("A", None, 9)[0]
    assert (newest.kind, newest.name, newest.who, newest.key, newest.why) == ("identification", machine, "night shift", "k1", "identified")
