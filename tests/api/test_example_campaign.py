"""The example: made by the virtual machine, complete by itself, gone as a whole."""

from __future__ import annotations

import pytest

from api.client import Client
from api.reading.example_campaign import LARGEST, MACHINE
from rcsa_ident.samples import SAMPLE_CUTS, sample_machine, sample_toolings
from tests.api.in_process import refused, service
from tests.fixtures.waiting import until


def complete(client: Client, campaign: str) -> bool:
    found = client.campaign(campaign)
    return all(cut.verdict is not None and cut.air is not None and cut.air.uploaded for cut in found.cuts)


@pytest.mark.slow(20)
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


@pytest.mark.slow(10)
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
