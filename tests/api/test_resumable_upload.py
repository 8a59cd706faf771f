"""The service's own resumable uploads: they work, and say that they go. What resumable uploads promise is tested by tus."""

from __future__ import annotations

import hashlib

import pytest

from tests.api.recordings import content, declared
from tests.api.test_recordings import digest
from tests.api.test_tus import NAME, begun, sent


@pytest.fixture
def place(http, client, tmp_path):
    """A service in this process, the path of a campaign, and two recordings of one length."""
    return (
        http,
        f"/v1/campaigns/{client.make_campaign(client.make_machine('m').id, declared()).id}",
        content(tmp_path),
        content(tmp_path, 1),
    )


def patched(client, campaign, part, offset, length=None, replace=False, **headers):
    headers |= {"Content-Type": "application/octet-stream", "Upload-Offset": str(offset)}
    headers |= {} if length is None else {"Upload-Length": str(length)}
    return client.patch(f"{campaign}/recordings/{NAME}", content=part, headers=headers, params={"replace": replace})


def test_parts_follow_each_other_and_every_answer_says_that_they_go(place):
    client, campaign, raw, _ = place
    url, told = f"{campaign}/recordings/{NAME}", digest(raw[1000:2000])["Repr-Digest"]
    answers = [
        client.head(url),
        patched(client, campaign, raw[:1000], 0),
        patched(client, campaign, raw[:1000], 0, len(raw)),
        patched(client, campaign, raw[:10], 999),
        patched(client, campaign, raw[1000:1999] + b"?", 1000, **{"Content-Digest": told}),
        patched(client, campaign, raw[1000:2000], 1000, **{"Content-Digest": told}),
        client.head(url),
        patched(client, campaign, raw[2000:], 2000, **digest(raw)),
        client.head(url),
    ]
    assert [answer.status_code for answer in answers] == [404, 422, 204, 409, 422, 204, 204, 201, 204]
    offsets = [answer.headers.get("upload-offset") for answer in answers]
    assert offsets == [None, None, "1000", "1000", None, "2000", "2000", None, str(len(raw))]
    assert answers[-2].json()["sha256"] == hashlib.sha256(raw).hexdigest()
    for answer in answers:
        assert (answer.headers["deprecation"], answer.headers["sunset"]) == ("@1795824000", "Mon, 31 May 2027 00:00:00 GMT")
    assert "deprecation" not in client.get(url).headers
    paths = client.get("/openapi.json").json()["paths"]
    marked = [(path, method) for path, calls in paths.items() for method, call in calls.items() if call.get("deprecated")]
    assert sorted(marked) == [("/v1/campaigns/{id}/recordings/{name}", method) for method in ("head", "patch")]


def test_a_first_part_of_another_length_begins_anew(place):
    client, campaign, raw, _ = place
    assert patched(client, campaign, b"abc", 0, 10).status_code == 204
    assert patched(client, campaign, raw, 0, len(raw), **digest(b"else")).json()["errors"][0]["field"] == "Repr-Digest"
    assert patched(client, campaign, raw, 0, len(raw), **digest(raw)).status_code == 201
    for length, status in (("-1", 422), ("x", 422), ("1e3", 422), (10**16, 422), (10**13, 413)):
        assert patched(client, campaign, b"", 0, length).status_code == status


def test_tus_and_these_parts_are_one_upload(place):
    client, campaign, raw, other = place
    where = begun(client, f"{campaign}/uploads", len(raw))
    assert sent(client, where, raw[:1000], 0).status_code == 204
    assert patched(client, campaign, raw[1000:], 1000).status_code == 201
    assert patched(client, campaign, other, 0, len(other)).status_code == 409
    # nothing has to be sent twice
    assert patched(client, campaign, b"", len(other), replace=True).json()["sha256"] == hashlib.sha256(other).hexdigest()
