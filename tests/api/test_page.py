"""The page's files: whose they are, how long they may be kept, and what they may load."""

from __future__ import annotations

import gzip
import hashlib
import json
import re

import pytest

from api.routes.static_files import FOLDER
from tests.api.in_process import refused
from tests.fixtures.service import example

VENDOR = FOLDER / "vendor"


def addresses(text: str) -> list[str]:
    return re.findall(r'(?:src|href)="([^"#]+)"', text)


def test_the_vendored_files_are_the_published_ones():
    rows = json.loads((VENDOR / "vendor.json").read_text())
    listed = {row["file"] for row in rows}
    assert listed == {p.relative_to(VENDOR).as_posix() for p in VENDOR.rglob("*") if p.is_file() and p.name != "vendor.json"}
    for row in rows:
        assert hashlib.sha256((VENDOR / row["file"]).read_bytes()).hexdigest() == row["sha256"], row["file"]
        assert row["licence"] in ("MIT", "BSD-3-Clause", "Apache-2.0")
        assert f"{row['file'].split('/')[0]}/LICENSE" in listed


@pytest.mark.parametrize("path", ["/", "/docs"])
def test_a_page_loads_its_own_files_only(http, path):
    answer = http.get(path)
    assert answer.status_code == 200
    policy = answer.headers["content-security-policy"]
    assert "default-src 'none'" in policy
    assert "unsafe" not in policy
    assert answer.headers["x-content-type-options"] == "nosniff"
    assert answer.headers["cache-control"] == "no-cache"
    assert "<script>" not in answer.text
    assert " style=" not in answer.text
    found = addresses(answer.text)
    assert len(found) >= 3
    for address in found:
        assert not re.match(r"\w+:|//", address), address
        assert http.get("/" + address.lstrip("/")).status_code == 200, address


def test_files_are_kept_for_ever_under_the_name_of_their_state(http):
    script = next(a for a in addresses(http.get("/").text) if a.endswith("main.js"))
    answer = http.get("/" + script)
    assert "immutable" in answer.headers["cache-control"]
    assert answer.headers["content-type"].startswith("text/javascript")
    again = http.get("/" + script, headers={"If-None-Match": answer.headers["etag"]})
    assert (again.status_code, again.content) == (304, b"")
    # another state's address is not kept
    old = http.get("/" + re.sub(r"static/\w+/", "static/0000/", script))
    assert (old.status_code, old.headers["cache-control"]) == (200, "no-cache")


def test_what_is_packed_is_the_same_file(http):
    script = next(a for a in addresses(http.get("/").text) if a.endswith("main.js"))
    plain = http.get("/" + script, headers={"Accept-Encoding": "identity"})
    assert "content-encoding" not in plain.headers
    with http.stream("GET", "/" + script, headers={"Accept-Encoding": "gzip"}) as answer:
        packed = b"".join(answer.iter_raw())
    assert answer.headers["content-encoding"] == "gzip"
    assert gzip.decompress(packed) == plain.content
    assert answer.headers["etag"] != plain.headers["etag"]
    assert int(answer.headers["content-length"]) == len(packed) < len(plain.content)


@pytest.mark.parametrize(
    "name",
    [
        "",
        "index.html",
        "docs.html",
        "../routes/page.py",
        "..%2froutes%2fpage.py",
        "%2e%2e/settings.py",
        "/etc/passwd",
        "vendor/uplot/LICENSE",
        "js",
    ],
)
def test_nothing_else_is_a_file(http, name):
    answer = http.get(f"/static/x/{name}")
    assert answer.status_code == 404
    assert answer.headers["content-type"] == "application/problem+json"


@pytest.mark.slow
def test_a_page_takes_no_other_method(http):
    answer = http.post("/")
    assert answer.status_code == 405
    assert set(answer.headers["allow"].replace(" ", "").split(",")) == {"GET", "HEAD"}
    head = http.head("/")
    assert (head.status_code, head.content) == (200, b"")


def test_a_drawing_of_keys_that_are_in_no_library(client):
    drawn = client.send("POST", "/toolings/drawing", json=example())
    client.write_tooling("S1", example())
    assert drawn.text == client.drawing("S1")
    assert "default-src 'none'" in drawn.headers["content-security-policy"]
    problem = refused(422, client.send, "POST", "/toolings/drawing", json=example(cutter={"teeth": 0, "diameter_mm": 12.0}))
    assert problem.errors[0].field == "cutter.teeth"


SCRIPTS = sorted((FOLDER / "js").rglob("*.js"))


def test_modules_take_from_each_other_what_there_is():
    """No compiler reads them before a browser does."""
    texts = {path: path.read_text() for path in SCRIPTS}
    assert [path.name for path, text in texts.items() if len(text.splitlines()) > 300] == []
    for path, text in texts.items():
        for statement, names, target in re.findall(r'^(import \{([^}]*)\} from "([^"]+)";)', text, flags=re.MULTILINE):
            source = texts.get((path.parent / target).resolve())
            assert source is not None, f"{path.name}: {target}"
            for name in (each.strip().partition(" as ")[0] for each in names.split(",") if each.strip()):
                offered = re.search(rf"^export (async )?(function\*?|const|class) {name}\b", source, flags=re.MULTILINE)
                assert offered, f"{path.name}: {name} of {target}"
                assert re.search(rf"\b{name}\b", text.replace(statement, "")), f"{path.name}: {name} is not used"


def test_no_text_becomes_markup():
    """Names come from other people: elements are made one by one, and nothing is evaluated."""
    markup = r"innerHTML|outerHTML|insertAdjacentHTML|document\.write|\beval\b|new Function|setAttribute\(\"(?:style|on)"
    found = {path.name: re.findall(markup, path.read_text()) for path in SCRIPTS}
    assert {name: each for name, each in found.items() if each} == {}
