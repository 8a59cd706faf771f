"""A client in Python, typed: what the service answers, as the same nouns; everything else is a `ServiceError`.

Needs httpx2 (``pip install 'rcsa-ident[client]'``).
"""

from __future__ import annotations

import base64
import hashlib
import json
import time
import tomllib
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import ExitStack
from functools import partial
from pathlib import Path
from typing import Any, TypeVar
from urllib.parse import quote

import httpx2

from api.schemas.campaigns import CampaignAnswer, CampaignSummary, RecordingAnswer, SignalAnswer, SpectrumAnswer, UploadAnswer
from api.schemas.common import Answer, Page, ProblemDocument
from api.schemas.forces import ForceAnswer, StreamsAnswer, StreamSummary
from api.schemas.jobs import FittedLines, JobAnswer, LobeJob
from api.schemas.keys import KeyAnswer, MadeKey
from api.schemas.libraries import Example, Examples, ImportAnswer
from api.schemas.machines import Frf, Identification, IdentificationSummary, MachineAnswer, Modes
from api.schemas.queries import AdviceAnswer, LobeAnswer, TipAnswer
from api.schemas.toolings import ToolingAnswer, ToolingSummary

Model = TypeVar("Model", bound=Answer)
Json = Mapping[str, Any]
_BLOCK = 1 << 20
#: A long recording is read before the answer comes.
_READ = httpx2.Timeout(60.0, read=1200.0)


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
            raise _refused(answer)
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

    def import_toolings(self, library: bytes, **assumed: Any) -> ImportAnswer:
        """Write the toolings of a Fusion 360 or HSM tool library; `replace` writes also over what is there."""
        kind = "application/zip" if library.startswith(b"PK") else "application/json"
        query = {key: str(value).lower() if isinstance(value, bool) else value for key, value in assumed.items() if value is not None}
        return _read(ImportAnswer, self.send("POST", "/toolings/import", content=library, params=query, headers={"Content-Type": kind}))

    def examples(self) -> list[Example]:
        """Return what there is to start with."""
        return _read(Examples, self.send("GET", "/examples")).items

    def example(self, name: str, file: Path) -> None:
        """Write an example's file."""
        self._download(f"/examples/{quote(name)}", file)

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
        """Return stability lobes of one tooling or several, also where the service makes a job of them."""
        answer = self.send("POST", "/lobes", json={"machine": machine, "toolings": list(toolings), **further})
        if answer.status_code == 200:
            return _read(LobeAnswer, answer)
        id = _read(JobAnswer, answer).id
        while (found := self.lobe_job(id, wait=20)).job.finished is None:
            pass
        if found.answer is None:
            problem = found.job.problem
            told = {"detail": f"the job is {found.job.state}"} if problem is None else problem.model_dump()
            told |= {"type": "about:blank", "title": found.job.state, "status": 422, "request_id": id}
            raise ServiceError(422, ProblemDocument.model_validate(told))
        return found.answer

    def advice(self, machine: str, *toolings: str | Json, **further: Any) -> AdviceAnswer:
        """Return what removes most, and how planned cuts stand."""
        return _read(AdviceAnswer, self.send("POST", "/advice", json={"machine": machine, "toolings": list(toolings), **further}))

    def make_campaign(self, machine: str, campaign: str | Json, repeat: str | None = None) -> CampaignAnswer:
        """Make a campaign, from the text of campaign.toml or from its keys; `repeat` is an idempotency key."""
        headers = {} if repeat is None else {"Idempotency-Key": repeat}
        path = f"/machines/{machine}/campaigns"
        if isinstance(campaign, str):
            headers["Content-Type"] = "application/toml"
            return _read(CampaignAnswer, self.send("POST", path, content=campaign.encode(), headers=headers))
        return _read(CampaignAnswer, self.send("POST", path, json=campaign, headers=headers))

    def campaign(self, id: str) -> CampaignAnswer:
        """Return a campaign with the verdicts on its cuts."""
        return _read(CampaignAnswer, self.send("GET", f"/campaigns/{id}"))

    def campaign_file(self, id: str) -> str:
        """Return the text of campaign.toml."""
        return self.send("GET", f"/campaigns/{id}", headers={"Accept": "application/toml"}).text

    def campaigns(self, machine: str, limit: int = 50) -> Iterator[CampaignSummary]:
        """Yield all campaigns of a machine."""
        return self._all(f"/machines/{machine}/campaigns", Page[CampaignSummary], limit)

    def archive(self, id: str, file: Path) -> None:
        """Write the folder of a campaign, as `rcsa-ident identify` takes it, to a ZIP file."""
        self._download(f"/campaigns/{id}/archive", file)

    def forget_campaign(self, id: str) -> None:
        """Forget a campaign and its recordings."""
        self.send("DELETE", f"/campaigns/{id}")

    def recordings(self, campaign: str, limit: int = 50) -> Iterator[RecordingAnswer]:
        """Yield all recordings of a campaign."""
        return self._all(f"/campaigns/{campaign}/recordings", Page[RecordingAnswer], limit)

    def recording(self, campaign: str, name: str) -> RecordingAnswer:
        """Return what was found in a recording."""
        return _read(RecordingAnswer, self.send("GET", _recording(campaign, name)))

    def recording_file(self, campaign: str, name: str, file: Path) -> None:
        """Write a recording, as it came, to a file."""
        self._download(f"{_recording(campaign, name)}/file", file)

    def spectrum(self, campaign: str, name: str, **query: int) -> SpectrumAnswer:
        """Return amplitudes over frequency; points."""
        return _read(SpectrumAnswer, self.send("GET", f"{_recording(campaign, name)}/spectrum", params=query))

    def signal(self, campaign: str, name: str, **query: int) -> SignalAnswer:
        """Return the outline over time; points."""
        return _read(SignalAnswer, self.send("GET", f"{_recording(campaign, name)}/signal", params=query))

    def forget_recording(self, campaign: str, name: str) -> None:
        """Forget a recording, or what has come of one."""
        self.send("DELETE", _recording(campaign, name))

    def upload(self, campaign: str, file: Path, name: str | None = None, replace: bool = False) -> RecordingAnswer:
        """Upload a recording at once, and have its checksum compared; `name` where the campaign calls it otherwise."""
        with file.open("rb") as opened:
            digest = hashlib.file_digest(opened, "sha256").digest()
            opened.seek(0)
            headers = {"Content-Type": "application/octet-stream", "Content-Length": str(file.stat().st_size), **_digest(digest)}
            params = {"replace": "true"} if replace else {}
            path = _recording(campaign, name or file.name)
            return _read(
                RecordingAnswer,
                self.send("PUT", path, content=iter(partial(opened.read, _BLOCK), b""), headers=headers, params=params, timeout=_READ),
            )

    def upload_in_parts(
        self, campaign: str, file: Path, name: str | None = None, part: int = 8 << 20, replace: bool = False, attempts: int = 5
    ) -> RecordingAnswer:
        """Upload a recording in parts, each from where the service says that the one before ended, also after a lost connection.

        Parameters
        ----------
        part : int [bytes]
        attempts : int
            For a part that the connection loses.
        """
        path, size = _recording(campaign, name or file.name), file.stat().st_size
        with file.open("rb") as opened:
            digest = hashlib.file_digest(opened, "sha256").digest()
            failed, offset = 0, self._offset(path, size)
            while True:
                if offset == size and (kept := self._kept(path)) is not None:
                    if kept.sha256 == digest.hex():
                        return kept
                    offset = 0
                opened.seek(offset)
                data = opened.read(part)
                headers = {
                    "Content-Type": "application/octet-stream",
                    "Upload-Offset": str(offset),
                    "Upload-Length": str(size),
                    **_digest(digest),
                }
                try:
                    answer = self.send(
                        "PATCH", path, content=data, headers=headers, params={"replace": "true"} if replace else {}, timeout=_READ
                    )
                except (httpx2.TransportError, ServiceError) as error:
                    failed += 1
                    lost = isinstance(error, httpx2.TransportError) or error.status in (408, 503)
                    if failed >= attempts or not lost:
                        raise
                    time.sleep(min(0.2 * 2**failed, 5.0))
                    offset = self._offset(path, size)
                    continue
                if answer.status_code != 204:
                    return _read(RecordingAnswer, answer)
                failed, offset = 0, int(answer.headers["Upload-Offset"])

    def _offset(self, path: str, size: int) -> int:
        """Where an upload goes on: 0 where another file is there, the size where one of that size is whole."""
        try:
            state = self.send("HEAD", path).headers
        except ServiceError as error:
            if error.status != 404:
                raise
            return 0
        offset, length = int(state["Upload-Offset"]), int(state["Upload-Length"])
        return offset if length == size else 0

    def _kept(self, path: str) -> RecordingAnswer | None:
        try:
            return _read(RecordingAnswer, self.send("GET", path))
        except ServiceError as error:
            if error.status != 404:
                raise
            return None

    def upload_together(self, campaign: str, files: Iterable[Path], replace: bool = False) -> UploadAnswer:
        """Upload several recordings in one body; of each file stands in the answer what has become of it."""
        with ExitStack() as stack:
            parts = [("files", (file.name, stack.enter_context(file.open("rb")), "application/octet-stream")) for file in files]
            path, params = f"/campaigns/{campaign}/recordings", {"replace": "true"} if replace else {}
            return _read(UploadAnswer, self.send("POST", path, files=parts, params=params, timeout=_READ))

    def upload_folder(self, machine: str, folder: Path, told: Callable[[RecordingAnswer], object] | None = None) -> CampaignAnswer:
        """Upload the folder of a campaign: campaign.toml, its toolings and every recording that is there.

        Parameters
        ----------
        told : callable, optional
            Given each recording when it is kept.
        """
        data = tomllib.loads((folder / "campaign.toml").read_text(encoding="utf-8-sig"))
        toolings = {name: tomllib.loads((folder / path).read_text(encoding="utf-8-sig")) for name, path in data["toolings"].items()}
        campaign = self.make_campaign(machine, {**data, "toolings": toolings})
        # air cuts first: a cut is then judged once, beside its own
        paths = dict.fromkeys(cut[key] for key in ("air", "cut") for cut in data["cuts"] if key in cut)
        for path in paths:
            answer = self.upload(campaign.id, folder / path)
            if told is not None:
                told(answer)
        return self.campaign(campaign.id)

    def _download(self, path: str, file: Path) -> None:
        with self.http.stream("GET", f"/v1{path}", headers=self.headers) as answer, file.open("wb") as opened:
            if answer.status_code >= 400:
                answer.read()
                raise _refused(answer)
            for block in answer.iter_bytes():
                opened.write(block)

    def identify_campaign(self, campaign: str, repeat: str | None = None, **further: Any) -> JobAnswer:
        """Have a machine identified from a campaign; seed, method, start, apply. `repeat` is an idempotency key."""
        headers = {} if repeat is None else {"Idempotency-Key": repeat}
        return _read(JobAnswer, self.send("POST", "/identifications", json={"campaign": campaign, **further}, headers=headers))

    def job(self, id: str, wait: int = 0) -> JobAnswer:
        """Return how far an identification is; after so many seconds at the latest, where it has not ended before."""
        headers = {"Prefer": f"wait={wait}"} if wait else {}
        return _read(JobAnswer, self.send("GET", f"/identifications/{id}", headers=headers))

    def jobs(self, limit: int = 50, **query: str) -> Iterator[JobAnswer]:
        """Yield identifications, newest first; machine, campaign, state."""
        return self._all("/identifications", Page[JobAnswer], limit, query)

    def wait(self, id: str, seconds: float = 3600.0) -> JobAnswer:
        """Return an identification when it has ended, or after so many seconds as it is then."""
        end = time.monotonic() + seconds
        while True:
            left = max(end - time.monotonic(), 0.0)
            job = self.job(id, wait=int(min(left, 20.0)))
            if job.finished is not None or left == 0.0:
                return job

    def events(self, id: str, kind: str = "identifications", attempts: int = 5) -> Iterator[tuple[str, dict[str, Any]]]:
        """Yield what a job tells, as kind of event and its data, until it has ended; a lost connection is taken up where it was lost.

        Parameters
        ----------
        kind : str
            identifications or lobes.
        attempts : int
            Connections without a single event in a row.
        """
        number, failed = "", 0
        while True:
            headers = self.headers | ({"Last-Event-ID": number} if number else {})
            try:
                with self.http.stream("GET", f"/v1/{kind}/{id}/events", headers=headers) as answer:
                    if answer.status_code >= 400:
                        answer.read()
                        raise _refused(answer)
                    for fields in _events(answer.iter_lines()):
                        number, failed = fields.get("id", number), 0
                        yield fields["event"], json.loads(fields["data"])
                        if fields["event"] == "end":
                            return
            except httpx2.TransportError:
                failed += 1
                if failed >= attempts:
                    raise
                time.sleep(min(0.2 * 2**failed, 5.0))

    def cancel(self, id: str) -> JobAnswer:
        """Cancel an identification."""
        return _read(JobAnswer, self.send("DELETE", f"/identifications/{id}"))

    def found_modes(self, id: str) -> Modes:
        """Return the modes that an identification has found."""
        return _read(Modes, self.send("GET", f"/identifications/{id}/modes"))

    def fitted(self, id: str) -> FittedLines:
        """Return measured lines beside the model's."""
        return _read(FittedLines, self.send("GET", f"/identifications/{id}/frf"))

    def result(self, id: str) -> str:
        """Return the text of RESULT.json of an identification."""
        return self.send("GET", f"/identifications/{id}/result").text

    def report(self, id: str) -> str:
        """Return the report on an identification, HTML."""
        return self.send("GET", f"/identifications/{id}/report").text

    def lobes_later(self, machine: str, *toolings: str | Json, **further: Any) -> JobAnswer:
        """Have stability lobes computed as a job."""
        body = {"machine": machine, "toolings": list(toolings), **further}
        return _read(JobAnswer, self.send("POST", "/lobes", json=body, headers={"Prefer": "respond-async"}))

    def lobe_job(self, id: str, wait: int = 0) -> LobeJob:
        """Return lobes that are computed as a job; after so many seconds at the latest, where it has not ended before."""
        return _read(LobeJob, self.send("GET", f"/lobes/{id}", headers={"Prefer": f"wait={wait}"} if wait else {}))

    def forces(self, machine: str, tooling: str | Json, recording: Path, air: Path | None = None, **further: Any) -> ForceAnswer:
        """Return the forces of a recording that is a file here."""
        return _read(ForceAnswer, self._forces({"machine": machine, "tooling": tooling, **further}, recording, air))

    def forces_file(self, machine: str, tooling: str | Json, recording: Path, air: Path | None = None, **further: Any) -> str:
        """Return the text of FORCES.csv."""
        query = {"machine": machine, "tooling": tooling, **further}
        return self._forces(query, recording, air, {"Accept": "text/csv"}).text

    def forces_of_campaign(self, machine: str, campaign: str, recording: str, **further: Any) -> ForceAnswer:
        """Return the forces of an uploaded recording, with its air cut."""
        body = {"machine": machine, "campaign": campaign, "recording": recording, **further}
        return _read(ForceAnswer, self.send("POST", "/forces", json=body))

    def streams(self) -> list[StreamSummary]:
        """Return all open force streams; `api.stream_client` opens one."""
        return _read(StreamsAnswer, self.send("GET", "/forces/streams")).items

    def _forces(self, query: Json, recording: Path, air: Path | None, headers: Mapping[str, str] | None = None) -> httpx2.Response:
        with ExitStack() as opened:
            named = {"recording": recording} | ({} if air is None else {"air": air})
            files = {field: (path.name, opened.enter_context(path.open("rb"))) for field, path in named.items()}
            return self.send("POST", "/forces", data={"query": json.dumps(query)}, files=files, headers=dict(headers or {}))

    def make_key(self, *scopes: str, label: str = "") -> MadeKey:
        """Make a key."""
        return _read(MadeKey, self.send("POST", "/keys", json={"scopes": list(scopes), "label": label}))

    def keys(self, limit: int = 50) -> Iterator[KeyAnswer]:
        """Yield all keys."""
        return self._all("/keys", Page[KeyAnswer], limit)

    def withdraw_key(self, id: str) -> None:
        """Withdraw a key."""
        self.send("DELETE", f"/keys/{id}")

    def _all(self, path: str, kind: Any, limit: int, query: Mapping[str, str] | None = None) -> Iterator[Any]:
        after: str | None = ""
        while after is not None:
            part = kind.model_validate_json(self.send("GET", path, params={"after": after, "limit": limit, **(query or {})}).content)
            yield from part.items
            after = part.next


def _refused(answer: httpx2.Response) -> ServiceError:
    # the answer to HEAD has no body
    told = answer.headers.get("content-type", "").startswith("application/problem+json") and answer.content
    return ServiceError(answer.status_code, ProblemDocument.model_validate_json(answer.content) if told else None)


def _recording(campaign: str, name: str) -> str:
    return f"/campaigns/{campaign}/recordings/{quote(name, safe='')}"


def _digest(sha256: bytes) -> dict[str, str]:
    return {"Repr-Digest": f"sha-256=:{base64.b64encode(sha256).decode()}:"}


def _events(lines: Iterable[str]) -> Iterator[dict[str, str]]:
    """Fields of server-sent events; a comment and a pause that is asked for are none."""
    fields: dict[str, str] = {}
    for line in lines:
        if line:
            name, _, value = line.partition(":")
            fields[name] = value.removeprefix(" ")
        else:
            if "event" in fields:
                yield fields
            fields = {}


def _match(seen: str | None) -> dict[str, str]:
    return {} if seen is None else {"If-Match": f'"{seen}"'}


def _read(model: type[Model], answer: httpx2.Response) -> Model:
    return model.model_validate_json(answer.content)
