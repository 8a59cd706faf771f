"""OpenAPI is complete and true."""

from __future__ import annotations

import json

import pytest

from api.schemas.campaigns import NewCampaign
from api.schemas.forces import ForceQuery, ForceUpload
from api.schemas.jobs import NewIdentification
from api.schemas.queries import AdviceQuery, LobeQuery, TipQuery
from api.schemas.ringing import RingQuery
from api.schemas.toolings import ToolingKeys
from tests.api.made_up import answers


def operations(schema):
    return [(path, method, o) for path, item in schema["paths"].items() for method, o in item.items()]


@pytest.mark.slow
def test_every_answer_has_a_schema_and_every_problem_is_a_problem_document(http):
    schema = http.get("/openapi.json").json()
    for path, method, operation in operations(schema):
        for status, answer in operation["responses"].items():
            if status in ("204", "304"):
                assert "content" not in answer
                continue
            for kind, content in answer["content"].items():
                assert content["schema"], (path, method, status)
                if int(status) >= 400:
                    assert kind == "application/problem+json"
                    assert content["schema"] == {"$ref": "#/components/schemas/ProblemDocument"}
        if path.startswith("/v1"):
            assert {"401", "403", "429", "503"} <= set(operation["responses"])
            assert operation["security"] == [{"key": []}]
            assert operation["x-scope"] in ("read", "upload", "run", "admin")
            if "requestBody" in operation:
                assert {"413", "415", "422"} <= set(operation["responses"])
            assert operation["summary"]


@pytest.mark.slow
def test_references_lead_somewhere(http):
    schema = http.get("/openapi.json").json()

    def walk(value):
        if isinstance(value, dict):
            if isinstance(value.get("$ref"), str):
                name = value["$ref"].removeprefix("#/components/schemas/")
                assert name in schema["components"]["schemas"], name
            for inner in value.values():
                walk(inner)
        elif isinstance(value, list):
            for inner in value:
                walk(inner)

    walk(schema)


@pytest.mark.parametrize(
    "model", [ToolingKeys, NewCampaign, NewIdentification, TipQuery, LobeQuery, AdviceQuery, ForceUpload, ForceQuery, RingQuery]
)
def test_examples_are_what_they_show(model):
    for shown in model.model_json_schema()["examples"]:
        model.model_validate_json(json.dumps(shown))


#: Calls that take nothing, so that nothing about them can be wrong.
NOTHING_TO_SAY = (
    "/health", "/ready", "/metrics", "/v1/keys", "/v1/usage", "/v1/forces/streams", "/v1/examples", "/v1/materials", "/v1/holders",
    "/v1/fields",
)  # fmt: skip

#: Calls that take a table, which chance does not write: all that it sends is refused.
TABLES = ("POST /v1/tested-cuts/preview", "POST /v1/robots/path/preview", "POST /v1/paths/preview")
#: Calls that take an arm or a recording, which chance writes no more than a table.
ARMS, RECORDINGS = ("PUT /v1/robots/{name}",), ("POST /v1/listen", "POST /v1/tap", "POST /v1/ring")


@pytest.mark.slow
def test_the_api_keeps_to_its_description(tmp_path, result):
    """Whatever is sent: no 5xx, no undocumented status, type or body. With a fixed seed, and so many cases for each operation."""
    for operation, statuses in answers(tmp_path, result, 20261121, 20):
        assert statuses, operation.label
        assert len(statuses) > 1 or operation.path in NOTHING_TO_SAY or operation.label in (*TABLES, *ARMS, *RECORDINGS), (
            operation.label,
            statuses,
        )
