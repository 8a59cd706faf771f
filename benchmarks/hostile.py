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
import os
import tempfile
import zipfile
from collections.abc import Iterator
from http.client import HTTPConnection, HTTPException
from pathlib import Path
from typing import Any, NamedTuple

from api.schemas.campaigns import EXAMPLE
from api.schemas.toolings import EXAMPLE as TOOLING
from benchmarks.service import ask, machine_text, others, serving, use

#: Just below the limit of a body.
LARGEST = 15_900_000
_FORM = "multipart/form-data"


class Cost(NamedTuple):
    """What a request has cost.

    Core time of the service's own process and of its others [s], memory that the first took more at its peak and all that one of the others
    had at most [MB], and the answer.
    """

    seconds: float
    elsewhere: float
    megabytes: float
    largest: float
    words: str
    status: int


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


def cost_of(port: int, process: int, words: str, method: str, path: str, headers: dict[str, str], body: bytes) -> Cost:
    """Return what a request costs until its answer is read."""
    own, before = _seconds(process), use(process)
    resting = _peak(process, anew=True)
    for id in others(process):
        _peak(id, anew=True)
    connection = HTTPConnection("127.0.0.1", port, timeout=300)
    status = 0
    try:
        connection.request(method, path, body or None, headers)
        answer = connection.getresponse()
        status = answer.status
        answer.read()
    except (OSError, HTTPException):
        # closed before the whole request was sent
        pass
    finally:
        connection.close()
    spent, total = _seconds(process) - own, use(process)[0] - before[0]
    largest = max((_peak(id) for id in others(process)), default=0.0)
    return Cost(spent, max(total - spent, 0.0), _peak(process) - resting, largest, words, status)


def _seconds(process: int) -> float:
    fields = Path(f"/proc/{process}/stat").read_text(encoding="utf-8").rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def _peak(process: int, anew: bool = False) -> float:
    """Most memory that the process has had since the peak was set to what it has now [MB]."""
    try:
        if anew:
            Path(f"/proc/{process}/clear_refs").write_text("5", encoding="utf-8")
        lines = Path(f"/proc/{process}/status").read_text(encoding="utf-8").splitlines()
    except OSError:
        # it has ended
        return 0.0
    return next((int(line.split()[1]) for line in lines if line.startswith("VmHWM:")), 0) / 1e3
