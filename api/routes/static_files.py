"""Static files: the page and the description of the API, with nothing loaded from elsewhere."""

from __future__ import annotations

import gzip
import hashlib
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

from fastapi import APIRouter, Request, Response

from api.conventions import tagged, unchanged
from api.problems import Problem

router = APIRouter(include_in_schema=False)
FOLDER = Path(__file__).resolve().parents[1] / "web"
_KINDS = {
    ".html": "text/html; charset=utf-8",
    ".css": "text/css; charset=utf-8",
    ".js": "text/javascript; charset=utf-8",
    ".json": "application/json",
    ".svg": "image/svg+xml",
}
#: Hash of an empty style element: Plotly makes one and fills it by script.
_EMPTY = "'sha256-47DEQpj8HBSa+/TImW+5JCeuQeRkm5NMpJWZG3hSuFU='"
#: A page of the service may load its own files, and images that it makes itself.
_POLICY = (
    f"default-src 'none'; script-src 'self'; style-src 'self' {_EMPTY}; img-src 'self' data: blob:; connect-src 'self'; font-src 'self'; "
    "base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
)
_GUARDS = {
    "Content-Security-Policy": _POLICY,
    "Referrer-Policy": "no-referrer",
    "Cross-Origin-Opener-Policy": "same-origin",
    "Permissions-Policy": "camera=(), microphone=(self), geolocation=()",
}
_MONTHS = "public, max-age=31536000, immutable"


@dataclass(frozen=True, slots=True)
class _File:
    """A file to send. `plain`, `packed`: content without and with gzip."""

    kind: str
    plain: bytes
    packed: bytes
    digest: str


@lru_cache(maxsize=1)
def _names() -> dict[str, Path]:
    """All files by their URL paths; no other file can be requested."""
    return {path.relative_to(FOLDER).as_posix(): path for path in sorted(FOLDER.rglob("*")) if path.suffix in _KINDS}


@lru_cache(maxsize=1)
def _tag() -> str:
    """Hash of all files: part of their URLs, so that browsers may cache them for ever."""
    sums = (f"{name} {hashlib.sha256(path.read_bytes()).hexdigest()}" for name, path in _names().items())
    return hashlib.sha256("\n".join(sums).encode()).hexdigest()[:16]


@lru_cache(maxsize=256)
def _file(name: str) -> _File:
    path = _names()[name]
    plain = path.read_bytes()
    if path.suffix == ".html":
        plain = plain.replace(b"{{tag}}", _tag().encode())
    return _File(_KINDS[path.suffix], plain, gzip.compress(plain, 6, mtime=0), hashlib.sha256(plain).hexdigest()[:32])


def _sent(request: Request, name: str, headers: dict[str, str]) -> Response:
    file = _file(name)
    packs = any(part.split(";")[0].strip().lower() == "gzip" for part in request.headers.get("accept-encoding", "").split(","))
    small = packs and len(file.packed) < len(file.plain)
    # each encoding of a file has its own entity tag
    digest = file.digest + ("-gzip" if small else "")
    all_headers = tagged(digest) | {"Vary": "Accept-Encoding"} | headers
    if unchanged(request, digest):
        return Response(status_code=304, headers=all_headers)
    return Response(
        file.packed if small else file.plain, media_type=file.kind, headers=all_headers | ({"Content-Encoding": "gzip"} if small else {})
    )


@router.get("/")
def index(request: Request) -> Response:
    return _sent(request, "index.html", {"Cache-Control": "no-cache", **_GUARDS})


@router.get("/docs")
def docs(request: Request) -> Response:
    return _sent(request, "docs.html", {"Cache-Control": "no-cache", **_GUARDS})


@router.get("/static/{tag}/{name:path}")
def static(tag: str, name: str, request: Request) -> Response:
    if name not in _names() or name.endswith(".html"):
        raise Problem(404, "there is no such file")
    # a page from before an update asks for old files: it gets the current ones, not to be cached
    return _sent(request, name, {"Cache-Control": _MONTHS if tag == _tag() else "no-cache", **_GUARDS})
