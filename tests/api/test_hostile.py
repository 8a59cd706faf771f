"""Bodies that mean no good: each is answered, with a problem document, and none costs memory or time."""

from __future__ import annotations

import itertools
import json

import pytest

from api.log_lines import JsonLines
from api.problems import MEDIA_TYPE
from api.stores.entities import Unavailable
from api.work.pool import Busy
from tests.api.in_process import Here, embedded, service
from tests.fixtures.service import example

JSON = {"Content-Type": "application/json"}
LOBES = '{"machine": "m", "toolings": ["t"], "max_depth_mm": %s}'
NONE = [b"", b"{", b"[]", b"null", b"\xff\xfe", b"[" * 100_000, b'{"a":' * 50_000]
PATHS = ["../../etc/passwd", "..%2f..%2fetc%2fpasswd", "%00", "a%00b", "%ff", "a%0d%0aX:y", "~root", "C:%5Cx", "e" * 5000]
TYPES = ["", "text/plain", "application/x-www-form-urlencoded", "multipart/form-data; boundary=x", "application/x-python-pickle"]
NUMBERS = itertools.count()
POSTS = ("/machines", "/keys", "/tooltip", "/lobes", "/advice")


@pytest.fixture(scope="module")
def http(tmp_path_factory):
    """One service for all of them: none does it harm."""
    folder = tmp_path_factory.mktemp("hostile")
    with service(embedded(folder), folder) as found:
        yield found


def problem(answer, *statuses):
    assert answer.status_code in statuses, (answer.status_code, answer.text[:300])
    assert answer.headers["content-type"] == MEDIA_TYPE
    # no NaN in it either
    told = json.loads(answer.content, parse_constant=pytest.fail)
    assert told["status"] == answer.status_code
    assert told["request_id"] == answer.headers["x-request-id"]
    assert len(answer.content) < 8000
    return told


@pytest.mark.parametrize("number", ["NaN", "Infinity", "-Infinity", "1e999", "1" * 400, "-1e999", '"1"', "true", "[1]"])
def test_numbers_out_of_reach(http, number):
    told = problem(http.post("/v1/lobes", content=LOBES % number, headers=JSON), 422)
    assert told["errors"][0]["field"] == "max_depth_mm"
    body = json.dumps(example(tool={"stickout_mm": 0, "segments": example()["tool"]["segments"]})).replace(
        '"stickout_mm": 0', f'"stickout_mm": {number}'
    )
    problem(http.put("/v1/toolings/t", content=body, headers=JSON), 422)


@pytest.mark.parametrize("path", ["/machines", "/tooltip", "/lobes", "/advice", "/forces", "/identifications", "/toolings/drawing"])
def test_a_large_body_is_refused_before_it_is_parsed(http, path):
    """A million empty lists take sixty times their text."""
    told = problem(http.post(f"/v1{path}", content=b"[" + b"[]," * 400_000 + b"[]]", headers=JSON), 413)
    assert "too large" in told["detail"] or "at most" in told["detail"]


@pytest.mark.parametrize(
    ("path", "body", "words"),
    [
        ("/machines/{id}/campaigns", '{"cuts": [' + "[]," * 300_000 + "[]]}", "at most 5000 items are allowed, found 300001 in cuts"),
        ("/machines/{id}/campaigns", '{"sensors": {' + '"a%d": 0,' * 30_000 % (*range(30_000),) + '"b": 0}}', "found 30001 in sensors"),
        ("/lobes", "{" + '"a%d": 0,' * 60_000 % (*range(60_000),) + '"b": 0}', "at most 100 keys are allowed, found 60001"),
        ("/lobes", '{"toolings": [{' + '"a%d": 0,' * 300 % (*range(300),) + '"b": 0}]}', "at most 100 keys are allowed, found 301"),
    ],
)
def test_faults_without_number_are_one_fault(http, path, body, words):
    machine = http.post("/v1/machines", json={"name": f"m{next(NUMBERS)}"}).json()["id"]
    told = problem(http.post(f"/v1{path.replace('{id}', machine)}", content=body, headers=JSON), 422)
    assert any(words in error["allowed"] for error in told["errors"])
    assert len(told["errors"]) < 10


def test_a_number_of_very_many_digits(http):
    problem(http.post("/v1/lobes", content=LOBES % ("1" * 100_000), headers=JSON), 400, 422)
    problem(http.put("/v1/toolings/t", content='{"cutter": {"teeth": %s}}' % ("1" * 100_000), headers=JSON), 413, 422)


@pytest.mark.parametrize("number", ["nan", "inf", "1e999", "x", ""])
def test_numbers_in_a_query(client, result, number):
    id = client.make_machine(f"m{next(NUMBERS)}").id
    client.identify(id, result)
    problem(client.http.get(f"/v1/machines/{id}/identification/frf?from_hz={number}"), 422)


@pytest.mark.parametrize("path", POSTS)
@pytest.mark.parametrize("body", [*NONE, b"7", b"\x00" * 100, b'{"machine": "\\ud800"}'])
def test_bodies_that_are_none(http, path, body):
    problem(http.post(f"/v1{path}", content=body, headers=JSON), 400, 422)


@pytest.mark.parametrize("body", [*NONE, b'{"status": NaN}', b'{"a": 1, "a": 2}'])
def test_results_and_toolings_that_are_none(client, body):
    id = client.make_machine(f"m{next(NUMBERS)}").id
    problem(client.http.put(f"/v1/machines/{id}/identification", content=body, headers=JSON), 422)
    problem(client.http.put("/v1/toolings/t", content=body, headers=JSON), 413, 422)
    problem(client.http.put("/v1/toolings/t", content=body, headers={"Content-Type": "application/toml"}), 413, 422)


@pytest.mark.parametrize("kind", TYPES)
def test_the_wrong_type(http, kind):
    headers = {"Content-Type": kind} if kind else {}
    for path in POSTS:
        problem(http.post(f"/v1{path}", content=b"{}", headers=headers), 415)
    problem(http.put("/v1/toolings/t", content=b"{}", headers=headers), 415)


@pytest.mark.parametrize("method", ["POST", "PUT"])
def test_too_large_told_before_or_not(store, tmp_path, method):
    path = {"POST": "/v1/machines", "PUT": "/v1/toolings/t"}[method]
    with service(store, tmp_path, max_body_bytes=20_000) as http:
        told = http.request(method, path, content=b" " * 20_001, headers=JSON)
        problem(told, 413)
        problem(http.request(method, path, content=(b" " * 1000 for _ in range(21)), headers=JSON), 413)
        problem(http.request(method, path, content=b"", headers=JSON | {"Content-Length": "9" * 30}), 413)
        # 20 000 themselves are read, and found to be no JSON
        problem(http.request(method, path, content=b" " * 20_000, headers=JSON), 400, 422)


def test_a_large_tooling(http):
    problem(http.put("/v1/toolings/t", content=b"#" * 300_000, headers={"Content-Type": "application/toml"}), 413)


@pytest.mark.parametrize("name", PATHS)
def test_names_that_are_paths(http, name):
    for call in (http.get, http.delete):
        problem(call(f"/v1/toolings/{name}"), 404, 405, 422)
        problem(call(f"/v1/machines/{name}"), 404, 405, 422)
        problem(call(f"/v1/machines/{name}/identification"), 404, 405, 422)


@pytest.mark.parametrize("value", ["x\x00y", "line\nbreak", "a" * 201])
def test_words_that_no_store_takes(http, value):
    problem(http.post("/v1/machines", json={"name": "m", "description": value}), 422)
    problem(http.post("/v1/machines", json={"name": value}), 422)
    problem(http.post("/v1/keys", json={"scopes": ["read"], "label": value}), 422)


def test_an_idempotency_key_is_a_plain_one(http):
    for key in ("", "a b", "k" * 129):
        problem(http.post("/v1/machines", json={"name": "m"}, headers={"Idempotency-Key": key}), 422)


def test_a_request_id_is_taken_if_it_is_plain(http):
    assert http.get("/health", headers={"X-Request-ID": "a-1.b_2"}).headers["x-request-id"] == "a-1.b_2"
    for id in ("a b", "x" * 65, '{"a":1}'):
        assert http.get("/health", headers={"X-Request-ID": id}).headers["x-request-id"] != id


def test_methods_and_paths_that_are_not_there(http):
    assert "GET" in http.patch("/v1/machines").headers["allow"]
    problem(http.patch("/v1/machines"), 405)
    problem(http.get("/v1/nothing"), 404)
    problem(http.get("/v2/machines"), 404)


class Failing(Here):
    """Work that ends in an exception."""

    def __init__(self, error: Exception) -> None:
        self.error = error

    async def run(self, call, *arguments):
        raise self.error


ERRORS = [(RuntimeError("secret detail"), 500), (Busy(), 503), (Unavailable(), 503), (MemoryError(), 500)]


@pytest.mark.parametrize(("error", "status"), ERRORS)
def test_nothing_unexpected_leaves_the_service(store, tmp_path, error, status, caplog):
    caplog.handler.setFormatter(JsonLines())
    with service(store, tmp_path) as http:
        id = http.post("/v1/machines", json={"name": "m"}).json()["id"]
        http.app.state.components.work.__class__ = Failing
        http.app.state.components.work.error = error
        answer = http.put(f"/v1/machines/{id}/identification", content=b"{}", headers=JSON)
    told = problem(answer, status)
    assert "secret" not in answer.text
    assert ("retry-after" in answer.headers) == (status == 503)
    if status == 500:
        # the log has it, under the same id
        (line,) = [line for line in map(json.loads, caplog.text.splitlines()) if line["event"] == "unexpected"]
        assert "secret detail" in line["exception"] or error.args == ()
        assert line["request_id"] == told["request_id"]


def test_one_line_of_log_for_each_request(http, caplog):
    caplog.set_level("INFO", "rcsa_ident.service")
    caplog.handler.setFormatter(JsonLines())
    http.get("/v1/machines", headers={"X-Request-ID": "r1"})
    (line,) = [line for line in map(json.loads, caplog.text.splitlines()) if line["event"] == "request"]
    assert (line["request_id"], line["method"], line["status"], line["group"]) == ("r1", "GET", 200, "local")


def test_no_answer_is_kept_by_who_passes_it_on(http, client):
    id = client.make_machine("m").id
    for path in ("/v1/machines", f"/v1/machines/{id}", "/v1/toolings/unknown", "/v1/nothing", "/metrics", "/ready"):
        assert http.get(path).headers.get_list("cache-control") == ["no-store"], path
    # what belongs to nobody may be kept
    assert http.get("/").headers.get_list("cache-control") == ["no-cache"]


def test_counters(http):
    http.get("/v1/machines")
    http.get("/v1/machines/unknown")
    text = http.get("/metrics").text
    assert 'rcsa_ident_requests_total{method="GET",route="/machines/{id}",status="404"} 1.0' in text
    assert "unknown" not in text.replace('route="unknown"', "")
    assert "rcsa_ident_work_waiting 0.0" in text
