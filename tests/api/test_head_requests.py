"""HEAD wherever GET is: the same status and headers, and no body."""

from __future__ import annotations

import json

import pytest

from api.security import new_id, now
from api.stores.jobs import Job
from tests.api.recordings import content, declared

#: What differs from one answer to the next.
OWN = ("x-request-id", "last-modified")


def alike(http, path, **headers):
    """The status of GET, which HEAD has, too, with the same headers."""
    got, asked = http.get(path, headers=headers), http.head(path, headers=headers)
    assert asked.status_code == got.status_code
    assert asked.content == b""
    assert {k: v for k, v in asked.headers.items() if k not in OWN} == {k: v for k, v in got.headers.items() if k not in OWN}
    return got.status_code


@pytest.mark.parametrize(
    "path",
    ["/", "/docs", "/openapi.json", "/health", "/ready", "/v1/machines", "/v1/toolings", "/v1/toolings/T1", "/v1/toolings/T1/drawing",
     "/v1/changes", "/v1/examples", "/v1/examples/small-campaign.zip", "/v1/materials", "/v1/keys"],
)  # fmt: skip
def test_head_is_get_without_its_body(shop, path):
    assert alike(shop[0].http, path) == 200


def test_head_knows_what_get_knows(shop, guarded_http):
    client, machine = shop
    assert alike(client.http, f"/v1/machines/{machine}/identification") == 200
    tag = client.http.head("/v1/toolings/T1").headers["etag"]
    assert alike(client.http, "/v1/toolings/T1", **{"If-None-Match": tag}) == 304
    assert alike(client.http, "/v1/toolings/none") == 404
    assert alike(client.http, "/nothing") == 404
    guarded, keys = guarded_http
    assert alike(guarded, "/v1/toolings") == 401
    assert alike(guarded, "/v1/keys", **{"X-API-Key": keys["read"]}) == 403


def test_head_of_a_path_without_get_is_refused_as_before(client):
    answer = client.http.head("/v1/lobes")
    assert (answer.status_code, answer.headers["allow"]) == (405, "POST")
    assert client.http.post("/v1/toolings/T1").headers["allow"] == "DELETE, GET, HEAD, PUT"


def test_the_state_of_an_upload_stays_what_head_tells_of_a_recording(client, tmp_path):
    campaign = client.make_campaign(client.make_machine("M").id, declared()).id
    (tmp_path / "c0_cut.h5").write_bytes(content(tmp_path))
    client.upload(campaign, tmp_path / "c0_cut.h5")
    answer = client.http.head(f"/v1/campaigns/{campaign}/recordings/c0_cut.h5")
    assert (answer.status_code, answer.headers["upload-offset"]) == (204, answer.headers["upload-length"])
    assert alike(client.http, f"/v1/campaigns/{campaign}/recordings/c0_cut.h5/file") == 200


def test_an_event_stream_ends_with_its_head(store, client):
    machine = client.make_machine("M").id
    id = store.jobs.add(Job(new_id(), "local", "identification", machine, None, json.dumps({}), "queued", now()), {}, 9).id
    answer = client.http.head(f"/v1/identifications/{id}/events")
    assert (answer.status_code, answer.content) == (200, b"")
    assert answer.headers["content-type"].startswith("text/event-stream")
    metrics = client.http.get("/metrics").text
    assert 'method="HEAD",route="/identifications/{id}/events",status="200"' in metrics
