"""The service's interface as pages, made of its OpenAPI document: a page for each group of calls, and one of all objects."""

from __future__ import annotations

import json
import tempfile
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from _ext.pages import contents, described, write
from sphinx.application import Sphinx

_INTRODUCTION = """# REST interface

The service describes itself at `/docs` and `/openapi.json`; these pages are made of the same document. Lengths are millimetres, speeds
rev/min, coefficients MPa, receptances m/N. A call under `/v1` carries an API key in the header `X-API-Key` wherever the service asks for
keys, and each call names the scope that the key needs: `read`, `upload`, `run` or `admin`. Live forces come over a WebSocket:
[](../../streaming.md). A typed client comes with the package: {py:func}`rcsa_ident.connect`.

"""
_PROBLEMS = """(rest-problems)=
## Problems

Each error is a problem document (RFC 9457), [ProblemDocument](#rest-ProblemDocument). What the codes mean where a call says nothing else:

"""
Json = dict[str, Any]


def openapi() -> Json:
    """Return the document of the service as it is put together here; nothing is started."""
    from api.main import create_app
    from api.settings import Settings

    with tempfile.TemporaryDirectory() as folder:
        app = create_app(Settings(data=Path(folder)))
        document: Json = app.openapi()
        app.state.components.store.close()
    return document


def calls(document: Json) -> Iterator[tuple[str, str, Json]]:
    for path, item in document["paths"].items():
        for method, call in item.items():
            yield method.upper(), path, call


def kind(schema: Json) -> str:
    """Return what a value is, in a few words; objects are links."""
    if "$ref" in schema:
        name = schema["$ref"].rpartition("/")[2]
        return f"[{name}](#rest-{name})"
    if "enum" in schema:
        return " | ".join(f"`{json.dumps(value)}`" for value in schema["enum"])
    if "const" in schema:
        return f"`{json.dumps(schema['const'])}`"
    several = schema.get("anyOf") or schema.get("oneOf") or schema.get("allOf")
    if several:
        return " or ".join(dict.fromkeys(kind(each) for each in several))
    if schema.get("type") == "array":
        inner = schema["prefixItems"] if "prefixItems" in schema else [schema.get("items", {})]
        return "list of " + ", ".join(kind(each) for each in inner)
    if schema.get("type") == "object" and isinstance(schema.get("additionalProperties"), dict):
        return f"object of {kind(schema['additionalProperties'])}"
    return "file" if schema.get("format") == "binary" else str(schema.get("type", "anything"))


def limits(schema: Json) -> list[str]:
    """Return a value's limits and default."""
    found = []
    for each in (schema, *schema.get("anyOf", ())):
        signs = {"minimum": "≥", "exclusiveMinimum": ">", "maximum": "≤", "exclusiveMaximum": "<"}
        found += [f"{sign} {each[key]:g}" for key, sign in signs.items() if key in each]
        if "maxLength" in each and "pattern" not in each:
            found.append(f"at most {each['maxLength']} characters")
        if "minItems" in each or "maxItems" in each:
            found.append(f"{each.get('minItems', 0)} to {each.get('maxItems', 'any number of')} items")
        if "pattern" in each:
            found.append(f"as `{each['pattern']}`")
    if schema.get("default") not in (None, "", [], {}):
        found.append(f"default `{json.dumps(schema['default'])}`")
    return found


def field(name: str, schema: Json, required: bool, place: str = "") -> tuple[str, str]:
    facts = [*([place] if place else []), kind(schema), *(["required"] if required else []), *limits(schema)]
    return f"`{name}`", ", ".join(facts) + (f". {schema['description']}" if schema.get("description") else "")


def fields(schema: Json) -> str:
    if "properties" not in schema:
        return kind(schema) + "\n"
    needed = schema.get("required", ())
    return described(field(name, each, name in needed) for name, each in schema["properties"].items())


def examples(document: Json, schema: Json) -> str:
    """Return what a body may look like, where the document shows one."""
    if "$ref" in schema:
        schema = document["components"]["schemas"][schema["$ref"].rpartition("/")[2]]
    shown = schema.get("examples", ())[:1]
    blocks = [f"````{{dropdown}} Example\n```json\n{json.dumps(each, indent=2, ensure_ascii=False)}\n```\n````\n" for each in shown]
    return "\n".join(blocks)


def content(document: Json, described_as: Json) -> str:
    """Return the types of a body, with the fields of forms and examples."""
    lines = []
    by_kind: dict[str, list[str]] = {}
    for media, each in described_as.get("content", {}).items():
        by_kind.setdefault(json.dumps(each.get("schema", {})), []).append(f"`{media}`")
    for text, medias in by_kind.items():
        schema = json.loads(text)
        form = "properties" in schema
        lines.append(", ".join(medias) + (":" if form else f": {kind(schema)}" if schema else "") + "\n")
        if form:
            lines.append(fields(schema))
            lines += [examples(document, each) for each in schema["properties"].values()]
        else:
            lines.append(examples(document, schema))
    return "\n".join(lines)


def section(document: Json, usual: dict[str, str], method: str, path: str, call: Json) -> str:
    """Return one call: what it does, who may, what it takes, what it answers."""
    lines = [f"## `{method} {path}`", "", call.get("summary", "") + ".", "", call.get("description", ""), ""]
    lines += ["Deprecated: the header `Sunset` says until when it stays.", ""] if call.get("deprecated") else []
    lines += [f"Scope: `{call['x-scope']}`" if "x-scope" in call else "No key is asked for.", ""]
    if call.get("parameters"):
        told = [
            field(p["name"], {"description": p.get("description", ""), **p["schema"]}, p.get("required", False), p["in"])
            for p in call["parameters"]
        ]
        lines += [":::{rubric} Parameters", ":::", "", described(told)]
    if "requestBody" in call:
        lines += [":::{rubric} Body", ":::", "", content(document, call["requestBody"])]
    lines += [":::{rubric} Answers", ":::", ""]
    problems = []
    for status, answer in call["responses"].items():
        if int(status) >= 400:
            problems.append((status, answer["description"]))
            continue
        text = answer["description"].replace("Successful Response", "Done.")
        lines += [f"`{status}`", ": " + text + "\n", *("  " + line for line in content(document, answer).splitlines()), ""]
    lines += ["Problems: " + ", ".join(f"[{status}](#rest-problems)" for status, _ in problems), ""] if problems else []
    own = [(f"`{status}`", text) for status, text in problems if text != usual[status]]
    return "\n".join([*lines, described(own)])


def write_pages(app: Sphinx) -> None:
    document = openapi()
    seen = Counter((status, a["description"]) for _, _, c in calls(document) for status, a in c["responses"].items() if int(status) >= 400)
    usual: dict[str, str] = {}
    for (status, text), _ in seen.most_common():
        usual.setdefault(status, text)
    by_tag: dict[str, list[str]] = {}
    overview: list[str] = []
    for method, path, call in calls(document):
        tag = call.get("tags", ["service"])[0]
        by_tag.setdefault(tag, [f"# {tag.capitalize()}\n"]).append(section(document, usual, method, path, call))
    for tag in by_tag:
        rows = [
            f"| `{m} {p}` | {c.get('summary', '')} | {c.get('x-scope', '')} |" for m, p, c in calls(document) if tag in c.get("tags", ())
        ]
        overview += [f"## [{tag.capitalize()}]({_file(tag)}.md)\n", "| call | what | scope |", "|---|---|---|", *rows, ""]
    objects = ["# Objects\n"]
    for name, schema in sorted(document["components"]["schemas"].items()):
        objects.append(f"(rest-{name})=\n## {name}\n\n{schema.get('description', '')}\n\n{fields(schema)}\n{examples(document, schema)}")
    told = _PROBLEMS + "\n".join(["| code | |", "|---|---|", *(f"| `{status}` | {usual[status]} |" for status in sorted(usual))])
    index = "\n".join([_INTRODUCTION, *overview, told, "", contents([*map(_file, by_tag), "objects"], hidden=True)])
    texts = {"index.md": index, "objects.md": "\n".join(objects)} | {f"{_file(tag)}.md": "\n".join(parts) for tag, parts in by_tag.items()}
    write(Path(app.srcdir) / "reference" / "rest", texts)


def _file(tag: str) -> str:
    return tag.replace(" ", "_")


def setup(app: Sphinx) -> dict[str, Any]:
    app.connect("builder-inited", write_pages)
    return {"parallel_read_safe": True}
