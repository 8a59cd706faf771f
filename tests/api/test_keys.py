"""Who may do what."""

from __future__ import annotations

import asyncio
import itertools

import pytest

from api.client import Client
from api.live.jobs import events
from api.rates import MOST_BUCKETS, Rates
from api.schemas.robots import EXAMPLE as ROBOT
from api.security import SCOPES, Caller
from tests.api.identifying import job
from tests.api.in_process import refused, service
from tests.fixtures.service import example
from tests.fixtures.waiting import PATIENCE

#: Method, path, body, scope.
CALLS = [
    ("POST", "/machines", {"name": "x"}, "upload"),
    ("GET", "/machines", None, "read"),
    ("GET", "/machines/m", None, "read"),
    ("GET", "/machines/m/contents", None, "read"),
    ("DELETE", "/machines/m", None, "upload"),
    ("PUT", "/machines/m/identification", {}, "upload"),
    ("GET", "/machines/m/identification", None, "read"),
    ("GET", "/machines/m/identification/modes", None, "read"),
    ("GET", "/machines/m/identification/frf", None, "read"),
    ("PUT", "/toolings/t", example(), "upload"),
    ("GET", "/toolings", None, "read"),
    ("GET", "/toolings/t", None, "read"),
    ("GET", "/toolings/t/drawing", None, "read"),
    ("DELETE", "/toolings/t", None, "upload"),
    ("GET", "/changes", None, "read"),
    ("POST", "/toolings/t/differences", example(), "read"),
    ("GET", "/toolings/t/versions/v", None, "read"),
    ("POST", "/toolings/t/versions/v/restore", None, "upload"),
    ("GET", "/machines/m/identification/versions/v", None, "read"),
    ("POST", "/machines/m/identification/versions/v/restore", None, "upload"),
    ("PUT", "/robots/t", ROBOT, "upload"),
    ("GET", "/robots", None, "read"),
    ("GET", "/robots/t", None, "read"),
    ("DELETE", "/robots/t", None, "upload"),
    ("GET", "/robots/t/versions/v", None, "read"),
    ("POST", "/robots/t/versions/v/restore", None, "upload"),
    ("POST", "/robots/posture", {"robot": {"robot": "t", "posture_deg": [0.0]}}, "run"),
    ("POST", "/robots/path", {"robot": {"robot": "t", "posture_deg": [0.0]}, "tooling": "t", "places": [[0, 0, 0]]}, "run"),
    ("POST", "/robots/map", {"robot": {"robot": "t", "posture_deg": [0.0]}, "tooling": "t", "places": [[0, 0, 0]]}, "run"),
    ("POST", "/robots/path/preview", None, "read"),
    *(("POST", f"/paths/{name}", None, "run") for name in ("removal", "stability", "milling")),
    ("POST", "/paths/preview", None, "read"),
    *(("GET", f"/paths/j{name}", None, "read") for name in ("", "/events", "/table")),
    ("DELETE", "/paths/j", None, "run"),
    ("POST", "/toolings/drawing", example(), "read"),
    ("POST", "/toolings/import", {"data": []}, "upload"),
    ("GET", "/materials", None, "read"),
    ("GET", "/schemas/n", None, "read"),
    ("GET", "/fields", None, "read"),
    ("POST", "/campaigns/preview", {"files": []}, "read"),
    ("POST", "/tested-cuts/preview", None, "read"),
    ("GET", "/holders", None, "read"),
    ("GET", "/holders/taper/chuck", None, "read"),
    ("GET", "/usage", None, "read"),
    ("GET", "/examples", None, "read"),
    ("GET", "/examples/n", None, "read"),
    ("POST", "/examples/campaign", None, "upload"),
    ("DELETE", "/examples/campaign", None, "upload"),
    ("POST", "/forces", {"machine": "m", "tooling": "t", "campaign": "c", "recording": "n"}, "run"),
    ("GET", "/forces/streams", None, "read"),
    ("POST", "/machines/m/campaigns", {}, "upload"),
    ("GET", "/machines/m/campaigns", None, "read"),
    ("GET", "/campaigns/c", None, "read"),
    ("GET", "/campaigns/c/archive", None, "read"),
    ("DELETE", "/campaigns/c", None, "upload"),
    ("GET", "/campaigns/c/recordings", None, "read"),
    ("POST", "/campaigns/c/recordings", None, "upload"),
    ("PUT", "/campaigns/c/recordings/n", None, "upload"),
    ("PATCH", "/campaigns/c/recordings/n", None, "upload"),
    ("HEAD", "/campaigns/c/recordings/n", None, "upload"),
    ("GET", "/campaigns/c/recordings/n", None, "read"),
    ("GET", "/campaigns/c/recordings/n/file", None, "read"),
    ("GET", "/campaigns/c/recordings/n/spectrum", None, "read"),
    ("GET", "/campaigns/c/recordings/n/signal", None, "read"),
    ("DELETE", "/campaigns/c/recordings/n", None, "upload"),
    *((method, "/campaigns/c/uploads", None, "upload") for method in ("OPTIONS", "POST")),
    *((method, "/campaigns/c/uploads/n", None, "upload") for method in ("HEAD", "PATCH", "DELETE")),
    ("POST", "/tooltip", {"machine": "m", "tooling": "t"}, "run"),
    ("POST", "/listen", None, "run"),
    ("POST", "/tap", None, "run"),
    ("POST", "/ring", None, "run"),
    ("POST", "/campaigns/c/learn", None, "run"),
    ("POST", "/campaigns/c/learn/take-over", None, "upload"),
    ("POST", "/lobes", {"machine": "m", "toolings": ["t"]}, "run"),
    ("GET", "/lobes/j", None, "read"),
    ("GET", "/lobes/j/events", None, "read"),
    ("DELETE", "/lobes/j", None, "run"),
    ("POST", "/identifications", {"campaign": "c"}, "run"),
    ("GET", "/identifications", None, "read"),
    ("GET", "/identifications/j", None, "read"),
    ("DELETE", "/identifications/j", None, "run"),
    *(("GET", f"/identifications/j/{name}", None, "read") for name in ("events", "modes", "frf", "result", "report")),
    ("POST", "/advice", {"machine": "m", "toolings": ["t"], "cut": {"feed_per_tooth_mm": 0.1}}, "run"),
    ("POST", "/keys", {"scopes": ["read"]}, "admin"),
    ("GET", "/keys", None, "admin"),
    ("DELETE", "/keys/k", None, "admin"),
]


@pytest.mark.slow
def test_every_call_is_in_the_list(http):
    operations = [
        (method.upper(), path.removeprefix("/v1"))
        for path, item in http.get("/openapi.json").json()["paths"].items()
        for method in item
        if path.startswith("/v1")
    ]
    patterns = {"m": "{id}", "k": "{id}", "c": "{id}", "j": "{id}", "t": "{name}", "n": "{name}", "v": "{version}"}
    patterns |= {"taper": "{taper}", "chuck": "{chuck}"}
    listed = [(m, "/".join(patterns.get(part, part) for part in p.split("/"))) for m, p, _, _ in CALLS]
    assert sorted(operations) == sorted(listed)


@pytest.mark.slow
@pytest.mark.parametrize(("method", "path", "body", "scope"), CALLS, ids=lambda v: str(v)[:30])
def test_a_call_needs_a_key_with_its_scope(guarded_http, method, path, body, scope):
    http, keys = guarded_http

    def status(key):
        headers = {} if key is None else {"X-API-Key": key}
        answer = http.request(method, f"/v1{path}", json=body, headers=headers)
        assert answer.status_code != 500
        if answer.status_code >= 400:
            assert answer.headers["content-type"] == "application/problem+json"
        return answer.status_code

    read = keys["read"]
    wrong = [None, "", "x", "ri__", read[:-1], read + "x", read.replace("ri_", "rj_"), "ri_" + "0" * 24 + "_" + "x" * 43, "é" * 9]
    for key in wrong[:-1]:
        assert status(key) == 401, key
    for name in SCOPES:
        allowed = name in (scope, "admin")
        assert (status(keys[name]) not in (401, 403)) == allowed, name
        assert (status(keys[name]) == 403) == (not allowed)


def test_who_has_no_key_is_told_before_the_body_is_read(guarded_http):
    http, _ = guarded_http
    answer = http.post("/v1/machines", content=b"{" * 1000, headers={"Content-Type": "text/plain"})
    assert answer.status_code == 401
    assert answer.headers["www-authenticate"]


def test_keys_are_made_listed_withdrawn_in_their_group(guarded_http):
    http, keys = guarded_http
    admin = Client(key=keys["admin"], http=http)
    made = admin.make_key("read", "run", label="presetting")
    assert (made.group, made.scopes, made.label) == ("A", ["read", "run"], "presetting")
    fresh = Client(key=made.key, http=http)
    assert list(fresh.machines()) == []
    assert made.id in [k.id for k in admin.keys(limit=2)]
    secret = made.key.split("_", 2)[2]
    assert secret not in http.get("/v1/keys", headers=admin.headers).text
    other = Client(key=keys["other"], http=http)
    assert [k.label for k in other.keys(limit=9)] == ["other"]
    refused(404, other.withdraw_key, made.id)
    admin.withdraw_key(made.id)
    refused(401, fresh.machines().__next__)
    refused(404, admin.withdraw_key, made.id)
    refused(422, admin.make_key)
    refused(422, admin.make_key, "root")


def test_a_secret_is_nowhere_kept(store, tmp_path):
    from api.security import make_key

    key, text = make_key("A", ("admin",), "")
    assert text.split("_", 2)[2] not in repr(key)
    assert key.id == text.split("_")[1]


def test_without_keys_only_localhost_is_answered(http):
    for host in ("localhost:8000", "127.0.0.1", "127.0.0.1:80", "[::1]:8000", "[::1]"):
        assert http.get("/v1/machines", headers={"Host": host}).status_code == 200, host
    for host in ("evil.example", "localhost.evil.example", "10.0.0.1:8000", "evil]"):
        assert http.get("/v1/machines", headers={"Host": host}).status_code == 403, host


def test_without_keys_no_foreign_page_and_no_proxy_is_answered(http):
    """A browser sends a form to any host without asking; a proxy brings everybody in."""
    form = {"files": ("c.h5", b"x", "application/octet-stream")}

    def sent(**headers):
        return http.post("/v1/campaigns/c/recordings", files=form, headers=headers)

    for origin in ("http://evil.example", "null", "http://localhost:9999", "file://localhost"):
        answer = sent(Origin=origin)
        assert answer.status_code == 403, origin
        assert "another origin" in answer.json()["detail"]
    assert sent(Origin="http://localhost").status_code == 404
    assert sent(**{"Sec-Fetch-Site": "cross-site"}).status_code == 403
    assert sent(**{"Sec-Fetch-Site": "same-origin"}).status_code == 404
    names = (
        "Forwarded", "X-Forwarded", "X-Forwarded-For", "X-Forwarded-Host", "x-forwarded-proto", "X-Original-Forwarded-For", "X-Real-IP",
        "X-Client-IP", "X-Cluster-Client-IP", "True-Client-IP", "CF-Connecting-IP", "CF-Connecting-IPv6", "Fastly-Client-IP",
        "X-Envoy-External-Address", "X-Remote-Addr", "Via",
    )  # fmt: skip
    for name in names:
        answer = http.get("/v1/machines", headers={name: "for=10.0.0.1"})
        assert answer.status_code == 403, name
        assert name.lower() in answer.json()["detail"]
    for name in ("Accept-Language", "User-Agent", "X-Request-ID", "If-Match", "Idempotency-Key", "DNT", "Upgrade-Insecure-Requests"):
        assert http.get("/v1/machines", headers={name: "1"}).status_code == 200, name


def test_metrics_are_for_this_machine_where_no_keys_are_asked_for(http, guarded_http):
    for headers in ({"Host": "evil.example"}, {"Origin": "http://evil.example"}, {"X-Forwarded-For": "10.0.0.1"}):
        assert http.get("/metrics", headers=headers).status_code == 403
    assert http.get("/metrics", headers={"Host": "127.0.0.1:8000"}).status_code == 200
    # else a scraper calls the service as everybody does
    assert guarded_http[0].get("/metrics", headers={"Host": "rcsa.example"}).status_code == 200


def test_with_keys_a_proxy_may_stand_in_front(guarded_http):
    http, keys = guarded_http
    assert http.get("/v1/machines", headers={"X-API-Key": keys["read"], "X-Forwarded-For": "10.0.0.1"}).status_code == 200


def test_a_key_expires_and_tells_when_it_was_last_used(guarded_http, store, monkeypatch):
    http, keys = guarded_http
    admin = Client(key=keys["admin"], http=http)
    lasting, made = admin.make_key("read"), admin.make_key("read", label="a week", days=7.0)
    assert lasting.expires is None
    assert made.used is None
    assert made.created < made.expires
    week = Client(key=made.key, http=http)
    assert list(week.machines()) == []
    told = {key.id: key for key in admin.keys(limit=9)}
    assert told[lasting.id].used is None
    assert told[made.id].used >= made.created
    # known to the minute: not every request writes
    assert list(week.machines()) == []
    assert {key.id: key.used for key in admin.keys(limit=9)}[made.id] == told[made.id].used
    monkeypatch.setattr("api.security.USED", 0.0)
    assert list(week.machines()) == []
    assert store.keys.get(made.id).used > told[made.id].used
    monkeypatch.setattr("api.security.now", lambda: made.expires)
    assert "expired" in refused(401, week.machines().__next__).detail
    for days in (0.0, -1.0, 3651.0):
        assert refused(422, admin.make_key, "read", days=days).errors[0].field == "expires_in_days"


def test_an_event_stream_ends_with_its_key(guarded_http, store, machine, monkeypatch):
    """Of a job that waits, so that nothing else ends it or wakes it."""
    monkeypatch.setattr("api.live.jobs.LOOK", 0.05)
    http, keys = guarded_http
    id = store.jobs.add(job(machine), {}, 9).id
    caller = Caller(keys["read"].split("_")[1], "A", ("read",), "read")

    async def followed():
        stream = (await events(http.app.state.components, caller, id, "identification", None)).body_iterator
        first = await anext(stream)
        with pytest.raises(TimeoutError):
            await asyncio.wait_for(anext(stream), 0.5)
        return first

    async def withdrawn():
        stream = (await events(http.app.state.components, caller, id, "identification", None)).body_iterator
        await anext(stream)
        store.keys.delete("A", caller.id)
        return [part async for part in stream]

    assert b"progress" in asyncio.run(followed())
    assert asyncio.run(asyncio.wait_for(withdrawn(), PATIENCE)) == []
    assert http.app.state.components.feeds.places.total == 0


def test_wrong_keys_of_an_address_are_slowed_and_the_right_one_is_not(store, tmp_path, monkeypatch):
    from api.security import make_key

    monkeypatch.setattr("api.main.WRONG_KEYS", (1, 3))
    key, text = make_key("A", ("read",), "")
    store.keys.add(key)
    slept = []

    async def sleep(seconds):
        slept.append(seconds)

    monkeypatch.setattr("api.security.sleep", sleep)
    with service(store, tmp_path, keys=True) as http:

        def status(key):
            return http.get("/v1/machines", headers={} if key is None else {"X-API-Key": key})

        assert [status(text + "x").status_code for _ in range(3)] == [401] * 3
        assert slept == []
        told = [status(f"ri_{k:024d}_x") for k in range(2)]
        assert [each.status_code for each in told] == [429, 429]
        assert told[0].headers["retry-after"] == "60"
        assert "wrong API keys" in told[0].json()["detail"]
        assert len(slept) == 2
        assert all(0.0 < each <= 60.0 for each in slept)
        # who has a key, or sends none, is answered at once
        assert status(text).status_code == 200
        assert status(None).status_code == 401
        with http.websocket_connect("/v1/forces/stream") as link:
            link.send_text('{"watch": "s", "key": "ri_0_x"}')
            assert link.receive_json()["problem"]["status"] == 429
        assert len(slept) == 3


def test_a_table_of_buckets_is_bounded_whoever_asks():
    now = itertools.count(0.0, 1e-6)
    rates = Rates(60, 3, lambda: next(now))
    for k in range(MOST_BUCKETS + 500):
        rates.wait(f"address {k}")
    assert len(rates.buckets) == MOST_BUCKETS
    # those that were used last stay
    assert f"address {MOST_BUCKETS + 499}" in rates.buckets
    # one that is full again needs no entry
    now = itertools.count(10.0, 1.0)
    rates.wait("b")
    assert list(rates.buckets) == ["b"]


def test_a_bucket_of_tokens():
    now = itertools.count(0.0, 0.5)
    rates = Rates(60, 3, lambda: next(now))
    waits = [rates.wait("a") for _ in range(8)]
    # three at once and one a second; two queries a second
    assert waits == [0.0, 0.0, 0.0, 0.0, 0.0, 0.5, 0.0, 0.5]
    assert rates.wait("b") == 0.0


@pytest.mark.slow
def test_too_many_with_one_key_leave_another_alone(store, tmp_path):
    from api.security import make_key

    texts = []
    for name in "ab":
        key, text = make_key("A", ("read",), name)
        store.keys.add(key)
        texts.append({"X-API-Key": text})
    with service(store, tmp_path, keys=True, requests_per_minute=1, burst=2) as http:
        answers = [http.get("/v1/machines", headers=texts[0]) for _ in range(3)]
        assert [a.status_code for a in answers] == [200, 200, 429]
        assert 1 <= int(answers[2].headers["retry-after"]) <= 60
        assert http.get("/v1/machines", headers=texts[1]).status_code == 200
        # who watches the service is not counted
        assert http.get("/health").status_code == 200
