"""The example: made by the virtual machine, complete by itself, gone as a whole."""

from __future__ import annotations

from base64 import b64encode
from dataclasses import replace

import pytest

from api.client import Client
from api.reading.example_campaign import LARGEST, MACHINE
from rcsa_ident.front.samples import SAMPLE_CUTS, sample_machine, sample_toolings
from tests.api.identifying import declared, files, uploaded
from tests.api.in_process import refused, service
from tests.fixtures.waiting import until


def complete(client: Client, campaign: str) -> bool:
    found = client.campaign(campaign)
    return all(cut.verdict is not None and cut.air is not None and cut.air.uploaded for cut in found.cuts)


@pytest.mark.slow
def test_an_example_is_made_and_goes_as_a_whole(http, client):
    made = client.make_example()
    machine = client.machine(made.machine)
    assert (machine.name, machine.example) == (MACHINE, True)
    assert {t.name for t in client.toolings()} == {f"Example {name}" for name in sample_toolings()}
    until(lambda: complete(client, made.campaign))
    found = client.campaign(made.campaign)
    assert found.usable == len(found.cuts) == SAMPLE_CUTS
    assert found.name.startswith("Example")
    # the files count as every upload does
    stored = sum(each.size_bytes for each in client.recordings(made.campaign))
    files = http.app.state.components.files
    assert stored < sum(files.usage("local").values()) < LARGEST
    # asked again, it is the same one
    assert client.make_example() == made
    client.write_tooling("Example S4-shrink", client.tooling_file("Example S4-shrink") + "# ours\n")
    client.forget_example()
    assert list(client.machines()) == []
    # what somebody has changed stays
    assert [t.name for t in client.toolings()] == ["Example S4-shrink"]
    assert sum(files.usage("local").values()) == 0
    assert refused(404, client.forget_example)
    # and again from the beginning
    assert client.make_example() == made


@pytest.mark.slow
def test_what_is_missing_is_made_when_it_is_asked_again(client):
    made = client.make_example()
    until(lambda: complete(client, made.campaign))
    before = {each.name: each.sha256 for each in client.recordings(made.campaign)}
    gone = sorted(before)[:3]
    for name in gone:
        client.forget_recording(made.campaign, name)
    client.make_example()
    until(lambda: complete(client, made.campaign))
    after = {each.name: each.sha256 for each in client.recordings(made.campaign)}
    # the same virtual machine and the same chance, and none of the rest is made again
    assert after == before


def test_the_example_takes_nothing_of_ones_own(http, client, monkeypatch):
    """By no door: it would be deleted with the example."""
    monkeypatch.setattr(http.app.state.components.examples, "fill", lambda campaign: None)
    made = client.make_example()
    name = client.campaign(made.campaign).cuts[0].cut.name
    path = f"/v1/campaigns/{made.campaign}"
    tus = {"Tus-Resumable": "1.0.0", "Upload-Length": "3", "Upload-Metadata": f"filename {b64encode(name.encode()).decode()}"}
    part = {"Upload-Offset": "0", "Upload-Length": "3", "Content-Type": "application/octet-stream"}
    answers = [
        client.http.post(f"/v1/machines/{made.machine}/campaigns", json=declared(1)),
        client.http.put(f"{path}/recordings/{name}?replace=true", content=b"own", headers={"Content-Type": "application/octet-stream"}),
        client.http.patch(f"{path}/recordings/{name}", content=b"own", headers=part),
        client.http.post(f"{path}/recordings", files={"files": (name, b"own")}),
        client.http.post(f"{path}/uploads", headers=tus),
    ]
    assert [(answer.status_code, answer.json()["errors"][0]["found"]) for answer in answers] == [(409, "the example")] * 5
    assert [campaign.id for campaign in client.campaigns(made.machine)] == [made.campaign]


@pytest.mark.slow
def test_what_is_deleted_is_named_before(http, client, monkeypatch):
    """Machine, campaigns and recordings; what came since then is not deleted with them."""
    monkeypatch.setattr(http.app.state.components.examples, "fill", lambda campaign: None)
    made = client.make_example()
    mine = client.make_machine("Mine").id
    campaign = uploaded(client, mine, 1)
    seen = client.machine_contents(mine)
    assert (seen.name, seen.example, seen.identification, seen.toolings) == ("Mine", False, None, [])
    (held,) = seen.campaigns
    assert (held.id, held.example, held.recordings) == (campaign, False, sorted(file.name for file in files(1)))
    assert held.size_bytes == sum(file.stat().st_size for file in files(1))
    client.make_campaign(mine, declared(1))
    refused(412, client.forget_machine, mine, seen.etag)
    again = client.machine_contents(mine)
    assert len(again.campaigns) == 2
    client.forget_machine(mine, again.etag)
    refused(404, client.machine_contents, mine)
    # an earlier release took campaigns of one's own on the example: they go where that was said
    store = http.app.state.components.store
    theirs = store.campaigns.get("local", made.campaign)
    store.campaigns.add(replace(theirs, id="mine", name="HPM 800U"))
    there = client.machine_contents(made.machine)
    assert [(each.name, each.example) for each in there.campaigns if not each.example] == [("HPM 800U", False)]
    assert there.toolings == sorted(f"Example {name}" for name in sample_toolings())
    assert "HPM 800U (0 recordings)" in refused(409, client.forget_example).detail
    assert client.machine(made.machine).example
    client.forget_example(own=True)
    assert list(client.machines()) == []


def test_the_example_keeps_to_the_quota(store, tmp_path):
    with service(store, tmp_path, group_bytes=LARGEST - 1) as http:
        client = Client(http=http)
        assert "may keep" in refused(413, client.make_example).detail
        assert list(client.machines()) == []


def test_a_machine_of_that_name_stays(client):
    mine = client.make_machine(MACHINE)
    assert not mine.example
    assert refused(409, client.make_example).errors[0].field == "name"


def test_the_plan_of_the_example_is_that_of_the_sample_machine():
    machine = sample_machine()
    assert len(machine.toolings) * len(machine.plan.spindle_speeds) == SAMPLE_CUTS
    assert machine.plan.spindle_speeds[0] < machine.plan.spindle_speeds[-1]
