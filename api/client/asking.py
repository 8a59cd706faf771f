"""Requests to the service: answers below status 400, or a `ServiceError`."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, Self, TypeVar

import httpx2

from api.schemas.common import Answer, ProblemDocument

Model = TypeVar("Model", bound=Answer)
Json = Mapping[str, Any]


class ServiceError(Exception):
    """The service has answered with an error.

    Parameters
    ----------
    status : int
    problem : ProblemDocument or None
        None where the answer did not come from the service.
    """

    def __init__(self, status: int, problem: ProblemDocument | None) -> None:
        super().__init__(f"{status}: {problem.detail if problem else 'no problem document'}")
        self.status, self.problem = status, problem


class Asking:
    """Connection to a service.

    Parameters
    ----------
    url : str
    key : str or None
    http : httpx2.Client or None
        To be used instead of a client of its own.
    """

    def __init__(self, url: str = "http://127.0.0.1:8000", key: str | None = None, http: httpx2.Client | None = None) -> None:
        self.http = httpx2.Client(base_url=url, timeout=60.0) if http is None else http
        #: Timeout of requests that wait for a long recording to be read; a given client keeps its own.
        self.long_timeout: dict[str, Any] = {"timeout": httpx2.Timeout(60.0, read=1200.0)} if http is None else {}
        self.headers = {} if key is None else {"X-API-Key": key}

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.http.close()

    def send(self, method: str, path: str, **further: Any) -> httpx2.Response:
        """Return an answer below 400."""
        headers = {**self.headers, **further.pop("headers", {})}
        answer = self.http.request(method, f"/v1{path}", headers=headers, **further)
        if answer.status_code >= 400:
            raise refused(answer)
        return answer

    def download(self, path: str, file: Path) -> None:
        """Write an answer to a file."""
        with self.http.stream("GET", f"/v1{path}", headers=self.headers) as answer, file.open("wb") as opened:
            if answer.status_code >= 400:
                answer.read()
                raise refused(answer)
            for block in answer.iter_bytes():
                opened.write(block)

    def all(self, path: str, kind: Any, limit: int, query: Mapping[str, str] | None = None) -> Iterator[Any]:
        """Yield the items of all pages of a list."""
        after: str | None = ""
        while after is not None:
            part = kind.model_validate_json(self.send("GET", path, params={"after": after, "limit": limit, **(query or {})}).content)
            yield from part.items
            after = part.next


def refused(answer: httpx2.Response) -> ServiceError:
    """Return the error of an answer from status 400 on."""
    # the answer to HEAD has no body
    is_problem = answer.headers.get("content-type", "").startswith("application/problem+json") and answer.content
    return ServiceError(answer.status_code, ProblemDocument.model_validate_json(answer.content) if is_problem else None)


def match(seen: str | None) -> dict[str, str]:
    """Return the header of a write that expects an entity tag."""
    return {} if seen is None else {"If-Match": f'"{seen}"'}


def read(model: type[Model], answer: httpx2.Response) -> Model:
    """Return an answer as a model."""
    return model.model_validate_json(answer.content)


def standing_on(machine: str | Json) -> dict[str, Any]:
    """Return the key of a query that says what a tooling stands on: a machine by its id, a robot at a posture, or FRFs of its tip."""
    return {"machine": machine} if isinstance(machine, str) else {"tip" if "frf" in machine else "robot": machine}
