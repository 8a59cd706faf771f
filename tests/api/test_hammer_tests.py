"""Hammer tests over REST: their files are taken as recordings are, and an identification uses them."""

from __future__ import annotations

import io
import json
import tomllib
import zipfile

import numpy as np
import pytest

import rcsa_ident as ri
from api.client import Client
from rcsa_ident.io.settings.machines import read_machine
from rcsa_ident.io.settings.setups import read_campaign, read_tooling
from rcsa_ident.io.toml_text import toml_of
from rcsa_ident.virtual.rotor import frequency_response, rotor
from tests.api.identifying import carried
from tests.api.identifying import declared as cuts_declared
from tests.api.in_process import embedded, refused, service
from tests.fixtures.hit import OMEGA, write_hit
from tests.fixtures.paths import MACHINES

FILE = "S1-ER32-tip.csv"


@pytest.fixture(scope="module")
def hit(tmp_path_factory):
    return write_hit(tmp_path_factory.mktemp("hit"))


@pytest.fixture
def machine(client):
    return client.make_machine("m").id


def declared(hit):
    """Keys of the campaign with its toolings."""
    data = tomllib.loads((hit / "campaign.toml").read_text())
    return data | {"toolings": {name: tomllib.loads((hit / path).read_text()) for name, path in data["toolings"].items()}}


def test_files_are_kept_as_they_came_and_described(client, machine, hit):
    campaign = client.upload_folder(machine, hit)
    assert (campaign.usable, campaign.cuts, campaign.too_few, campaign.workpiece) == (0, [], None, {})
    assert [test.id for test in campaign.hammer_tests] == [f"{name} {place}" for name in ("S1-ER32", "S2-PG25") for place in ("tip", "v")]
    assert all(test.file.uploaded and 100 < test.lines <= 300 for test in campaign.hammer_tests)
    (summary,) = client.campaigns(machine)
    assert (summary.cuts, summary.hammer_tests, summary.missing) == (0, 4, 0)
    row = client.recording(campaign.id, FILE)
    assert (row.role, row.cuts, row.sampling_rate_hz, row.verdict.usable) == ("hammer", ["S1-ER32 tip"], None, True)
    assert (row.frfs[0].from_hz, row.frfs[0].to_hz) == (200.0, 3500.0)
    for part in ("spectrum", "signal"):
        problem = refused(422, client.send, "GET", f"/campaigns/{campaign.id}/recordings/{FILE}/{part}")
        assert "holds FRFs of hammer tests" in problem.errors[0].found
    # the archive is what the commands take, with the very files
    archive = zipfile.ZipFile(io.BytesIO(client.send("GET", f"/campaigns/{campaign.id}/archive").content))
    assert archive.read(f"recordings/{FILE}") == (hit / FILE).read_bytes()


def test_the_archive_is_a_campaign(client, machine, hit, tmp_path):
    campaign = client.make_campaign(machine, declared(hit))
    client.upload(campaign.id, hit / FILE)
    client.archive(campaign.id, tmp_path / "c.zip")
    zipfile.ZipFile(tmp_path / "c.zip").extractall(tmp_path / "folder")
    found, there = read_campaign(tmp_path / "folder"), read_campaign(hit)
    assert (found.cuts, found.sensors) == ((), ())
    # only what has a file
    assert [test.id for test in found.tests] == ["S1-ER32 tip"]
    assert (found.tests[0].response, found.tests[0].force) == (there.tests[0].response, there.tests[0].force)


@pytest.mark.parametrize(
    ("change", "field", "words"),
    [
        ({"axis": "Z"}, "frfs[0].axis", "Z"),
        ({"response": "flange", "force": "flange"}, "frfs[0].force", "flange"),
        ({"file": "a/b/.hidden"}, "frfs[0].file", ".hidden"),
        ({"tooling": "S9"}, "toolings", "S9"),
        ({"from_hz": 500.0, "to_hz": 400.0}, "frfs[0].to_hz", "400"),
    ],
)
def test_what_cannot_be_is_named(client, machine, hit, change, field, words):
    data = declared(hit)
    data["frfs"][0] |= change
    if "tooling" in change:
        del data["toolings"]
    problem = refused(422, client.make_campaign, machine, toml_of(data))
    assert problem.errors[0].field.startswith(field), problem
    assert words in f"{problem.errors[0].found} {problem.errors[0].field}"


def test_a_recording_is_no_frf_and_a_file_serves_one_purpose(client, machine, hit):
    data = cuts_declared(1)
    frf = {"id": "hit", "tooling": data["cuts"][0]["tooling"], "axis": "X", "response": "tip", "force": "tip"}
    problem = refused(422, client.make_campaign, machine, data | {"frfs": [frf | {"file": data["cuts"][0]["cut"]}]})
    assert (problem.errors[0].field, problem.errors[0].allowed) == ("frfs[0].file", "the file of an FRF")
    campaign = client.make_campaign(machine, declared(hit))
    time = np.arange(4000) / 51200.0
    raw = "\n".join(f"{t:.8f},{np.sin(500.0 * t):.6f},{np.cos(500.0 * t):.6f}" for t in time)
    headers = {"Content-Type": "application/octet-stream"}
    answer = client.http.put(f"/v1/campaigns/{campaign.id}/recordings/{FILE}", content=raw.encode(), headers=headers)
    assert answer.status_code == 422
    assert "hits of a hammer are read by tap" in answer.text
    assert not client.campaign(campaign.id).hammer_tests[0].file.uploaded


def test_beside_cuts_both_are_there(client, machine, hit):
    data = cuts_declared(1)
    name = data["cuts"][0]["tooling"]
    frf = {"id": "hit", "tooling": name, "axis": "X", "response": "tip", "force": "tip", "file": f"frfs/{FILE}"}
    campaign = client.make_campaign(machine, data | {"frfs": [frf]})
    client.upload(campaign.id, hit / FILE)
    found = client.campaign(campaign.id)
    assert [cut.cut.uploaded for cut in found.cuts] == [False]
    assert [test.file.uploaded for test in found.hammer_tests] == [True]
    told = tomllib.loads(client.campaign_file(campaign.id))
    assert told["frfs"][0]["file"] == f"recordings/{FILE}"


def test_dropped_files_name_what_the_campaign_wants(client, hit):
    names = ["campaign.toml", "S1-ER32.toml", "S2-PG25.toml"]
    found = client.preview({name: (hit / name).read_text() for name in names})
    assert (found.campaign, found.name, found.missing) == ("campaign.toml", "hit", [])
    assert found.recordings == [f"{name}-{place}.csv" for name in ("S1-ER32", "S2-PG25") for place in ("tip", "v")]


@pytest.mark.slow
def test_an_identification_uses_them(hit, tmp_path):
    """The answer is what the command finds, and tells a tool that was never hit; a damaged file ends the job in words."""
    store = embedded(tmp_path)
    with service(store, tmp_path) as http:
        client = Client(http=http)
        machine = client.make_machine("M").id
        campaign = client.make_campaign(machine, declared(hit)).id
        assert "no recording" in refused(422, client.identify_campaign, campaign).errors[0].found
        client.upload_folder(machine, hit)
        whole = next(each.id for each in client.campaigns(machine) if each.missing == 0)
        assert "hammer tests" in refused(422, client.identify_campaign, whole, method="paper").errors[0].found
        job = client.identify_campaign(whole, seed=1)
        carried(store, tmp_path)
        assert client.job(job.id).problem is None
        result = json.loads(client.result(job.id))
        assert result["campaign"]["hammer_tests"] == list(result["axes"]["X"]["hammer_tests"])
        assert "Hammer tests in X" in client.report(job.id)
        truth = read_machine(MACHINES / "hpm.toml")
        other = read_tooling(truth.truth_toolings[1])
        true = frequency_response(rotor(truth.spindle, other.assembly), OMEGA, 0.0, ("tip.x",), ("tip.x",))[:, 0, 0]
        out = tmp_path / "RESULT.json"
        out.write_text(client.result(job.id))
        tip = ri.read_result(out).machine.tip(other, OMEGA).between("tip.x", "tip.x")
        assert np.linalg.norm(tip - true) < 0.01 * np.linalg.norm(true)
        # samples that are not what was read are not identified from
        for path in (tmp_path / "files").rglob("*"):
            if path.is_file() and "normalised" in str(path):
                path.write_bytes(b"damaged")
        again = client.identify_campaign(whole, seed=1)
        carried(store, tmp_path)
        ended = client.job(again.id)
        assert ended.state == "failed"
        assert "damaged" in ended.problem.detail
    store.close()
