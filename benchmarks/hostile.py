"""What the worst request of every route costs the service: seconds of a core, and memory at its peak.

Every route of the interface is sent what parsers fear: JSON of a million brackets, digits, keys or empty lists, TOML of dotted keys and
deep headers, forms of many parts and endless headers, ZIP archives that grow, long query strings, entity tags and header values. The
one that costs the service's own process most is told of each route, with what its other processes have worked, and the most memory of any.
``--legitimate`` sends what is allowed in their place, at the limits that the service tells, and prints the table of docs/service.md.
``--most-seconds`` and ``--most-megabytes`` end with exit code 1 beyond them.
"""

from __future__ import annotations

import argparse
import io
import tempfile
import zipfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from api.schemas.campaigns import EXAMPLE
from api.schemas.toolings import EXAMPLE as TOOLING
from benchmarks.request_cost import Cost, cost_of
from benchmarks.service import ask, machine_text, serving

#: Just below the limit of a body.
LARGEST = 15_900_000
_FORM = "multipart/form-data"


def main(arguments: list[str]) -> None:
    """Print the worst request of every route."""
    parser = argparse.ArgumentParser(prog="benchmarks hostile", description=__doc__)
    parser.add_argument("--only", default="", help="routes whose path holds this")
    parser.add_argument("--most-seconds", type=float, default=float("inf"))
    parser.add_argument("--most-megabytes", type=float, default=float("inf"))
    parser.add_argument("--legitimate", action="store_true")
    given = parser.parse_args(arguments)
    if given.legitimate:
        from benchmarks.legitimate import table

        return table(given.only)
    worst: list[tuple[str, Cost]] = []
    with tempfile.TemporaryDirectory() as folder, serving(Path(folder)) as (port, process):
        interface = ask(port, "GET", "/openapi.json", None)
        machine = ask(port, "POST", "/v1/machines", {"name": "m"})["id"]
        ask(port, "PUT", f"/v1/machines/{machine}/identification", machine_text())
        declared = {**EXAMPLE, "toolings": dict.fromkeys({cut["tooling"] for cut in EXAMPLE["cuts"]}, TOOLING)}
        campaign = ask(port, "POST", f"/v1/machines/{machine}/campaigns", declared)["id"]
        for path, item in interface["paths"].items():
            if given.only not in path:
                continue
            for method, operation in item.items():
                costs = [cost_of(port, process, *request) for request in _requests(method.upper(), path, operation, machine, campaign)]
                worst.append((f"{method.upper()} {path}", max(costs)._replace(megabytes=max(cost.megabytes for cost in costs))))
                print(_line(*worst[-1]), flush=True)
    beyond = [cost for _, cost in worst if cost.seconds > given.most_seconds or cost.megabytes > given.most_megabytes]
    print(f"{len(worst)} routes; worst {max(c.seconds for _, c in worst):.2f} s, {max(c.megabytes for _, c in worst):.0f} MB")
    raise SystemExit(1 if beyond else 0)


def _line(route: str, cost: Cost) -> str:
    return (
        f"{route:<58} {cost.seconds:6.2f} s {cost.megabytes:6.0f} MB, other processes {cost.elsewhere:6.2f} s: {cost.status} {cost.words}"
    )


def _requests(
    method: str, path: str, operation: dict[str, Any], machine: str, campaign: str
) -> Iterator[tuple[str, str, str, dict[str, str], bytes]]:
    """Words, method, path, headers and body of everything that a route is sent."""
    # what is deleted is not there
    id = "nobody" if method == "DELETE" else machine if "/machines/" in path else campaign if "/campaigns/" in path else "nobody"
    place = path.replace("{id}", id).replace("{name}", "T1").replace("{version}", "1").replace("{taper}", "t").replace("{chuck}", "c")
    tags = ",".join(f'"{k:05d}"' for k in range(7000))
    yield "a query of 60 kB", method, f"{place}?after={'a' * 30_000}&{'&'.join('a' * 5000)}", {}, b""
    yield "entity tags of 56 kB", method, place, {"If-None-Match": tags, "If-Match": tags}, b""
    yield "a header of 60 kB", method, place, {"X-Request-Id": "a" * 30_000, "Prefer": "wait=" + "9" * 30_000}, b""
    kinds = operation.get("requestBody", {}).get("content", {})
    for kind, content in kinds.items():
        boundary = "; boundary=b" if kind == _FORM else ""
        for words, body in _bodies(kind, content.get("schema", {})):
            yield words, method, place, {"Content-Type": kind + boundary}, body


def _bodies(kind: str, schema: dict[str, Any]) -> Iterator[tuple[str, bytes]]:
    if kind == "application/json":
        yield from _json()
    elif kind == "application/toml":
        yield from _toml()
    elif kind == _FORM:
        yield from _forms()
    elif kind == "application/zip":
        yield "an archive that grows to 2 GB", _archive()
    else:
        yield f"{kind} of 16 MB", (b"1," * LARGEST)[:LARGEST]


def _json() -> Iterator[tuple[str, bytes]]:
    lists = b"[" + b"[]," * (LARGEST // 3 - 100) + b"[]]"
    yield "JSON of 5 million lists", lists
    yield "JSON of 16 MB of brackets", b"[" * LARGEST
    yield "a JSON number of a million digits", b'{"name": ' + b"9" * 1_000_000 + b"}"
    yield "JSON of a million keys", ("{" + ",".join(f'"k{k}":0' for k in range(1_200_000)) + "}").encode()
    for name in ("toolings", "cuts", "scopes", "data", "tested", "speeds"):
        for size in (LARGEST, 990_000, 250_000):
            yield (
                f"JSON of {size // 3000} thousand lists as {name}",
                f'{{"{name}": '.encode() + lists[: size // 3 * 3 - 60].rstrip(b",") + b"]}",
            )


def _toml() -> Iterator[tuple[str, bytes]]:
    for size in (250_000, 990_000):
        yield f"TOML, one dotted key of {size // 1000} kB", b"a" + b".a" * (size // 2 - 10) + b" = 1"
        yield f"TOML, deep headers, {size // 1000} kB", "".join(f"[k{k}{'.a' * 70}]\n" for k in range(size // 150)).encode()
        yield (
            f"TOML, deep keys under a deep header, {size // 1000} kB",
            (f"[{'a.' * 70}a]\n" + "".join(f"{'b.' * 70}k{k} = 1\n" for k in range(size // 155))).encode(),
        )
        yield f"TOML of {size // 1000} kB of brackets", b"a = " + b"[" * (size - 10)
        yield f"TOML, a number of {size // 1000} kB", b"a = " + b"9" * (size - 10)
        yield f"TOML, many tables, {size // 1000} kB", b"[[a]]\n" * (size // 6)


def _forms() -> Iterator[tuple[str, bytes]]:
    head = b'--b\r\nContent-Disposition: form-data; name="files"; filename="x.h5"\r\n'
    yield "a form of 100 000 parts", (head + b"\r\n\r\n") * 100_000
    yield "a part with a million headers", head + b"A: b\r\n" * 1_000_000
    yield "a part with a header of 16 MB", head + b"A: " + b"b" * (LARGEST - 200)
    yield "a form of boundaries that are none", head + b"\r\n" + b"\r\n--" * (LARGEST // 4 - 100)


def _archive() -> bytes:
    sink = io.BytesIO()
    with zipfile.ZipFile(sink, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("tools.json", b" " * 2_000_000_000)
    return sink.getvalue()
