"""A client in Python, typed: what the service answers, as the same nouns; everything else is a `ServiceError`.

Needs httpx2 (``pip install 'rcsa-ident[client]'``).
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any, TypeVar

import httpx2

from api.schemas.common import Answer, Page, ProblemDocument
from api.schemas.keys import KeyAnswer, MadeKey
from api.schemas.machines import Frf, Identification, IdentificationSummary, MachineAnswer, Modes
from api.schemas.queries import AdviceAnswer, LobeAnswer, TipAnswer
from api.schemas.toolings import ToolingAnswer, ToolingSummary

Model = TypeVar("Model", bound=Answer)
Json = Mapping[str, Any]


class ServiceError(Exception):
    """The service has answered otherwise.

    Parameters
    ----------
    status : int
    problem : ProblemDocument or None
        None where something else than the service has answered.
    """

    def __init__(self, status: int, problem: ProblemDocument | None) -> None:
        super().__init__(f"{status}: {problem.detail if problem else 'no problem document'}")
        self.status, self.problem = status, problem


class Client:
    """A service.

    Parameters
    ----------
    url : str
    key : str or None
    http : httpx2.Client or None
        In place of one of its own.
    """

    def __init__(self, url: str = "http://127.0.0.1:8000", key: str | None = None, http: httpx2.Client | None = None) -> None:
        self.http = httpx2.Client(base_url=url, timeout=60.0) if http is None else http
        self.headers = {} if key is None else {"X-API-Key": key}

    def __enter__(self) -> Client:
        return self

    def __exit__(self, *_: object) -> None:
        self.http.close()

    def send(self, method: str, path: str, **further: Any) -> httpx2.Response:
        """Return an answer below 400."""
        headers = {**self.headers, **further.pop("headers", {})}
        answer = self.http.request(method, f"/v1{path}", headers=headers, **further)
        if answer.status_code >= 400:
            told = answer.headers.get("content-type", "").startswith("application/problem+json")
            raise ServiceError(answer.status_code, ProblemDocument.model_validate_json(answer.content) if told else None)
        return answer

    def make_machine(self, name: str, description: str = "", repeat: str | None = None) -> MachineAnswer:
        """Make a machine; `repeat` is an idempotency key."""
        headers = {} if repeat is None else {"Idempotency-Key": repeat}
        return _read(MachineAnswer, self.send("POST", "/machines", json={"name": name, "description": description}, headers=headers))

    def machine(self, id: str) -> MachineAnswer:
        """Return a machine."""
        return _read(MachineAnswer, self.send("GET", f"/machines/{id}"))

    def machines(self, limit: int = 50) -> Iterator[MachineAnswer]:
        """Yield all machines."""
        return self._all("/machines", Page[MachineAnswer], limit)

    def forget_machine(self, id: str) -> None:
        """Forget a machine and its identification."""
        self.send("DELETE", f"/machines/{id}")

    def identify(self, id: str, result: str | bytes, seen: str | None = None) -> IdentificationSummary:
        """Give a machine the content of RESULT.json; `seen` is the etag of the one that it replaces."""
        headers = {"Content-Type": "application/json", **_match(seen)}
        return _read(IdentificationSummary, self.send("PUT", f"/machines/{id}/identification", content=result, headers=headers))

    def identification(self, id: str) -> Identification:
        """Return the content of RESULT.json."""
        return _read(Identification, self.send("GET", f"/machines/{id}/identification"))

    def modes(self, id: str) -> Modes:
        """Return modes with their uncertainties."""
        return _read(Modes, self.send("GET", f"/machines/{id}/identification/modes"))

    def frf(self, id: str, **query: float) -> Frf:
        """Return the spindle's receptance; from_hz, to_hz, step_hz."""
        return _read(Frf, self.send("GET", f"/machines/{id}/identification/frf", params=query))

    def write_tooling(self, name: str, tooling: str | Json, seen: str | None = None) -> ToolingAnswer:
        """Write a tooling, from the text of a tooling file or from its keys."""
        if isinstance(tooling, str):
            headers = {"Content-Type": "application/toml", **_match(seen)}
            return _read(ToolingAnswer, self.send("PUT", f"/toolings/{name}", content=tooling.encode(), headers=headers))
        return _read(ToolingAnswer, self.send("PUT", f"/toolings/{name}", json=tooling, headers=_match(seen)))

    def tooling(self, name: str) -> ToolingAnswer:
        """Return a tooling."""
        return _read(ToolingAnswer, self.send("GET", f"/toolings/{name}"))

    def tooling_file(self, name: str) -> str:
        """Return the text of the tooling file."""
        return self.send("GET", f"/toolings/{name}", headers={"Accept": "application/toml"}).text

    def drawing(self, name: str) -> str:
        """Return a tooling to scale, SVG."""
        return self.send("GET", f"/toolings/{name}/drawing").text

    def toolings(self, limit: int = 50) -> Iterator[ToolingSummary]:
        """Yield all toolings."""
        return self._all("/toolings", Page[ToolingSummary], limit)

    def forget_tooling(self, name: str, seen: str | None = None) -> None:
        """Forget a tooling."""
        self.send("DELETE", f"/toolings/{name}", headers=_match(seen))

    def tooltip(self, machine: str, tooling: str | Json, **further: Any) -> TipAnswer:
        """Return a tooltip FRF."""
        return _read(TipAnswer, self.send("POST", "/tooltip", json={"machine": machine, "tooling": tooling, **further}))

    def tooltip_file(self, machine: str, tooling: str | Json, **further: Any) -> str:
        """Return the text of FRF.csv."""
        body = {"machine": machine, "tooling": tooling, **further}
        return self.send("POST", "/tooltip", json=body, headers={"Accept": "text/csv"}).text

    def lobes(self, machine: str, *toolings: str | Json, **further: Any) -> LobeAnswer:
        """Return stability lobes of one tooling or several."""
        return _read(LobeAnswer, self.send("POST", "/lobes", json={"machine": machine, "toolings": list(toolings), **further}))

    def advice(self, machine: str, *toolings: str | Json, **further: Any) -> AdviceAnswer:
        """Return what removes most, and how planned cuts stand."""
        return _read(AdviceAnswer, self.send("POST", "/advice", json={"machine": machine, "toolings": list(toolings), **further}))

    def make_key(self, *scopes: str, label: str = "") -> MadeKey:
        """Make a key."""
        return _read(MadeKey, self.send("POST", "/keys", json={"scopes": list(scopes), "label": label}))

    def keys(self, limit: int = 50) -> Iterator[KeyAnswer]:
        """Yield all keys."""
        return self._all("/keys", Page[KeyAnswer], limit)

    def withdraw_key(self, id: str) -> None:
        """Withdraw a key."""
        self.send("DELETE", f"/keys/{id}")

    def _all(self, path: str, kind: Any, limit: int) -> Iterator[Any]:
        after: str | None = ""
        while after is not None:
            part = kind.model_validate_json(self.send("GET", path, params={"after": after, "limit": limit}).content)
            yield from part.items
            after = part.next


def _match(seen: str | None) -> dict[str, str]:
    return {} if seen is None else {"If-Match": f'"{seen}"'}


def _read(model: type[Model], answer: httpx2.Response) -> Model:
    return model.model_validate_json(answer.content)
