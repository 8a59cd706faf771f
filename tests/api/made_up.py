"""Requests that chance makes up, allowed ones and others, sent to every operation of a service of their own."""

from __future__ import annotations

import json
import warnings
from collections.abc import Callable, Iterator
from pathlib import Path
from types import ModuleType
from typing import Any

import httpx2
from fastapi.testclient import TestClient
from hypothesis import HealthCheck, Phase, given, seed, settings
from hypothesis import strategies as st
from hypothesis.errors import Unsatisfiable

from api.schemas.campaigns import EXAMPLE as CAMPAIGN
from api.schemas.robots import EXAMPLE as ROBOT
from api.security import new_id, now
from api.stores.jobs import Event, Job, Outcome
from tests.api.identifying import carried
from tests.api.in_process import embedded, service
from tests.api.recordings import recording
from tests.fixtures.service import example

_HOLDER = {"taper": "HSK-A63", "chuck": "ER40"}


def bounded(examples: int) -> settings:
    """So many cases of each operation, whatever they cost."""
    return settings(max_examples=examples, deadline=None, database=None, phases=[Phase.generate], suppress_health_check=list(HealthCheck))


def library() -> tuple[ModuleType, list[Callable[..., Any]]]:
    """The library that makes up requests, which takes its time to be imported, and what every answer must hold."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        import schemathesis
        from schemathesis.checks import not_a_server_error
        from schemathesis.specs.openapi import checks
    # bytes like any others
    schemathesis.serializer.alias("application/offset+octet-stream", "application/octet-stream")
    return schemathesis, [
        not_a_server_error,
        checks.status_code_conformance,
        checks.content_type_conformance,
        checks.response_headers_conformance,
        checks.response_schema_conformance,
    ]


class Fuzzed:
    """Cases of one operation, with ids and names that are there in the place of some."""

    def __init__(self, operation, http: TestClient, machine: str, known: dict[str, dict[str, str]], checks: list[Any]) -> None:
        self.operation, self.http, self.machine, self.checks = operation, http, machine, checks
        #: What paths that begin so take for what is there.
        self.known = next((values for begin, values in known.items() if operation.path.startswith(begin)), {"id": machine, "name": "T1"})
        self.statuses: set[int] = set()

    def send(self, case, known: bool) -> None:
        if known:
            case.path_parameters.update({key: value for key, value in self.known.items() if key in (case.path_parameters or {})})
        if known and isinstance(case.body, dict):
            case.body.update({key: value for key, value in {"machine": self.machine, **self.known}.items() if key in case.body})
        sent = case.as_transport_kwargs(base_url="http://localhost")
        headers = {k: v for k, v in sent.get("headers", {}).items() if k.lower() not in ("host", "user-agent", "x-api-key")}
        body = {"json": sent["json"]} if sent.get("json") is not None else {"content": sent.get("data") or b""}
        if known and sent.get("files"):
            # a form with its parts, as a browser sends it; without them it is of another type
            body = {"files": sent["files"]}
        elif isinstance(body.get("content"), dict):
            body = {"data": body["content"]}
        try:
            answer = self.http.request(sent["method"], sent["url"], params=sent.get("params"), headers=headers, **body)
            # a form is written part by part, and the checks want it as a whole
            answer.request.read()
        except (UnicodeEncodeError, httpx2.InvalidURL, httpx2.LocalProtocolError, ValueError, TypeError, AttributeError):
            # the client refuses to send it
            return
        self.statuses.add(answer.status_code)
        case.validate_response(answer, checks=self.checks)


def jobs(http, store, folder, machine, campaign, result) -> dict[str, dict[str, str]]:
    """Jobs that are done, one of each kind."""
    id = store.jobs.add(Job(new_id(), "local", "identification", machine, campaign, "{}", "queued", now()), {}, 10).id
    store.jobs.begin(id, "w", now())
    trace = {"axis": "X", "stage": "search", "cost": 1.0, "seconds": 0.1}
    store.jobs.tell(id, "w", [Event(0, "trace", json.dumps(trace))], '{"stage": "x", "done": 1, "total": 2}')
    names = ("frequency_hz", "measured_re", "measured_im", "model_re", "model_im", "coherence")
    lines = {name: [1.0] for name in names} | {"tooling": ["T1"]}
    texts = {"result": result, "frf": json.dumps({"axes": {"X": lines}}), "report": "<!doctype html>"}
    store.jobs.finish(id, "w", Outcome("done", now(), 1.0, "suspect", None, texts))
    query = {"machine": machine, "toolings": [example()], "speeds": {"step_rpm": 2000}}
    lobes = http.post("/v1/lobes", json=query, headers={"Prefer": "respond-async"}).json()["id"]
    asked = {"tooling": example(), "block_mm": [0.0, 0.0, -5.0, 20.0, 20.0, 0.0], "cell_mm": 1.0, "step_mm": 5.0}
    files = {"query": (None, json.dumps(asked)), "path": ("PATH.nc", b"G21 G90 G0 X-8 Y10 Z-1\nG1 X28 F900")}
    path = http.post("/v1/paths/removal", files=files).json()["id"]
    carried(store, folder)
    named = {"/v1/identifications": {"id": id, "campaign": campaign}, "/v1/lobes/": {"id": lobes}, "/v1/paths/{id}": {"id": path}}
    return named | {"/v1/holders/": _HOLDER}


def answers(tmp_path: Path, result: str, first: int, examples: int) -> Iterator[tuple[Any, set[int]]]:
    """Send so many cases of each operation, allowed ones and others, to a service of its own; yield the operation and its statuses."""
    schemathesis, checks = library()
    store = embedded(tmp_path)
    limits = {"requests_per_minute": 10**8, "burst": 10**8, "job_queue": 10**6, "work_seconds": 0.2, "watch_seconds": 0.1}
    with service(store, tmp_path, **limits) as http:
        id = http.post("/v1/machines", json={"name": "m"}).json()["id"]
        http.put(f"/v1/machines/{id}/identification", content=result, headers={"Content-Type": "application/json"})
        campaign = http.post(f"/v1/machines/{id}/campaigns", json=CAMPAIGN).json()["id"]
        name = CAMPAIGN["cuts"][0]["cut"]
        upload = {"content": recording(CAMPAIGN, tmp_path), "headers": {"Content-Type": "application/octet-stream"}}
        assert http.put(f"/v1/campaigns/{campaign}/recordings/{name}", **upload).status_code == 201
        # what becomes of robots that chance writes is its own affair
        http.put("/v1/robots/R1", json=ROBOT)
        known = {"/v1/robots/": {"name": "R1", "robot": {"robot": "R1", "posture_deg": [0.0, 45.0]}}}
        known |= {"/v1/campaigns/": {"id": campaign, "name": name}} | jobs(http, store, tmp_path, id, campaign, result)
        schema = schemathesis.openapi.from_dict(http.get("/openapi.json").json())
        found = [each.ok() for each in schema.get_all_operations()]
        # what deletes comes last
        found.sort(key=lambda operation: operation.method.upper() == "DELETE")
        for operation in found:
            http.put("/v1/toolings/T1", json=example())
            fuzzed = Fuzzed(operation, http, id, known, checks)
            for mode in (schemathesis.GenerationMode.POSITIVE, schemathesis.GenerationMode.NEGATIVE):
                strategy = operation.as_strategy(generation_mode=mode)

                try:
                    seed(first)(bounded(examples)(given(case=strategy, known=st.booleans())(fuzzed.send)))()
                except Unsatisfiable:
                    # nothing about it can be wrong
                    assert mode is schemathesis.GenerationMode.NEGATIVE
            yield operation, fuzzed.statuses
