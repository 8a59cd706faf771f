"""Campaigns and recordings of the client."""

from __future__ import annotations

import base64
import hashlib
import time
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import ExitStack, suppress
from functools import partial
from pathlib import Path
from typing import Any
from urllib.parse import quote

import httpx2

from api.client.asking import Asking, Json, ServiceError, read
from api.schemas.campaigns import CampaignAnswer, CampaignSummary, RecordingAnswer, SignalAnswer, SpectrumAnswer, UploadAnswer
from api.schemas.common import Page
from rcsa_ident.io.toml_text import read_toml

_BLOCK = 1 << 20


class Uploads(Asking):
    """Requests about campaigns and recordings."""

    def make_campaign(self, machine: str, campaign: str | Json, repeat: str | None = None) -> CampaignAnswer:
        """Make a campaign, from the text of campaign.toml or from its keys; `repeat` is an idempotency key."""
        headers = {} if repeat is None else {"Idempotency-Key": repeat}
        path = f"/machines/{machine}/campaigns"
        if isinstance(campaign, str):
            headers["Content-Type"] = "application/toml"
            return read(CampaignAnswer, self.send("POST", path, content=campaign.encode(), headers=headers))
        return read(CampaignAnswer, self.send("POST", path, json=campaign, headers=headers))

    def campaign(self, id: str) -> CampaignAnswer:
        """Return a campaign with the verdicts on its cuts."""
        return read(CampaignAnswer, self.send("GET", f"/campaigns/{id}"))

    def campaign_file(self, id: str) -> str:
        """Return the text of campaign.toml."""
        return self.send("GET", f"/campaigns/{id}", headers={"Accept": "application/toml"}).text

    def campaigns(self, machine: str, limit: int = 50) -> Iterator[CampaignSummary]:
        """Yield all campaigns of a machine."""
        return self.all(f"/machines/{machine}/campaigns", Page[CampaignSummary], limit)

    def archive(self, id: str, file: Path) -> None:
        """Write the folder of a campaign, as `rcsa-ident identify` takes it, to a ZIP file."""
        self.download(f"/campaigns/{id}/archive", file)

    def forget_campaign(self, id: str) -> None:
        """Delete a campaign and its recordings."""
        self.send("DELETE", f"/campaigns/{id}")

    def recordings(self, campaign: str, limit: int = 50) -> Iterator[RecordingAnswer]:
        """Yield all recordings of a campaign."""
        return self.all(f"/campaigns/{campaign}/recordings", Page[RecordingAnswer], limit)

    def recording(self, campaign: str, name: str) -> RecordingAnswer:
        """Return the description of a recording."""
        return read(RecordingAnswer, self.send("GET", _recording(campaign, name)))

    def recording_file(self, campaign: str, name: str, file: Path) -> None:
        """Download the original file of a recording."""
        self.download(f"{_recording(campaign, name)}/file", file)

    def spectrum(self, campaign: str, name: str, **query: int) -> SpectrumAnswer:
        """Return the amplitude spectrum; option points."""
        return read(SpectrumAnswer, self.send("GET", f"{_recording(campaign, name)}/spectrum", params=query))

    def signal(self, campaign: str, name: str, **query: int) -> SignalAnswer:
        """Return the envelope over time; option points."""
        return read(SignalAnswer, self.send("GET", f"{_recording(campaign, name)}/signal", params=query))

    def forget_recording(self, campaign: str, name: str) -> None:
        """Delete a recording or its unfinished upload."""
        self.send("DELETE", _recording(campaign, name))

    def upload(self, campaign: str, file: Path, name: str | None = None, replace: bool = False) -> RecordingAnswer:
        """Upload a recording in one request, with a checksum; `name` where the campaign names it differently."""
        with file.open("rb") as opened:
            digest = hashlib.file_digest(opened, "sha256").digest()
            opened.seek(0)
            headers = {
                "Content-Type": "application/octet-stream",
                "Content-Length": str(file.stat().st_size),
                "Repr-Digest": f"sha-256=:{base64.b64encode(digest).decode()}:",
            }
            params = {"replace": "true"} if replace else {}
            path = _recording(campaign, name or file.name)
            return read(
                RecordingAnswer,
                self.send(
                    "PUT", path, content=iter(partial(opened.read, _BLOCK), b""), headers=headers, params=params, **self.long_timeout
                ),
            )

    def upload_in_parts(
        self, campaign: str, file: Path, name: str | None = None, part: int = 8 << 20, replace: bool = False, attempts: int = 5
    ) -> RecordingAnswer:
        """Upload a recording in parts; after a lost connection it continues where the service has received the last byte.

        The key needs the scope `read`, too: tus answers without the description.

        Parameters
        ----------
        part : int [bytes]
        attempts : int
            For each part.
        """
        name, size = name or file.name, file.stat().st_size
        where = f"/campaigns/{campaign}/uploads/{quote(name, safe='')}"
        with file.open("rb") as opened:
            sha256 = hashlib.file_digest(opened, "sha256").hexdigest()
            told = {"filename": name, "sha256": sha256} | ({"replace": "true"} if replace else {})
            metadata = ",".join(f"{key} {base64.b64encode(text.encode()).decode()}" for key, text in told.items())
            failed, offset = 0, -1
            while True:
                try:
                    if offset < 0:
                        if self._is_complete(where) and (kept := self.recording(campaign, name)).sha256 == sha256:
                            return kept
                        offset = self._begin(where, {"Upload-Length": str(size), "Upload-Metadata": metadata})
                    opened.seek(offset)
                    headers = {"Content-Type": "application/offset+octet-stream", "Upload-Offset": str(offset)}
                    answer = self._tus("PATCH", where, headers, content=opened.read(part), **self.long_timeout)
                    failed, offset = 0, int(answer.headers["Upload-Offset"])
                    if offset == size:
                        return self.recording(campaign, name)
                except (httpx2.TransportError, ServiceError) as error:
                    failed += 1
                    lost = isinstance(error, httpx2.TransportError) or error.status in (408, 503)
                    if failed >= attempts or not lost:
                        raise
                    time.sleep(min(0.2 * 2**failed, 5.0))
                    offset = -1

    def _tus(self, method: str, path: str, headers: Mapping[str, str] | None = None, **further: Any) -> httpx2.Response:
        return self.send(method, path, headers={"Tus-Resumable": "1.0.0", **(headers or {})}, **further)

    def _is_complete(self, where: str) -> bool:
        """Whether the service lacks no byte of an upload; that of a stored recording is complete."""
        try:
            state = self._tus("HEAD", where).headers
        except ServiceError as error:
            if error.status != 404:
                raise
            return False
        return bool(state["Upload-Offset"] == state["Upload-Length"])

    def _begin(self, where: str, told: Mapping[str, str]) -> int:
        """Offset at which an upload goes on; one of other content, which has been left unfinished, is given up for it."""
        begin = partial(self._tus, "POST", where.rpartition("/")[0], told)
        try:
            answer = begin()
        except ServiceError as error:
            if error.status != 409:
                raise
            with suppress(ServiceError):
                self._tus("DELETE", where)
            answer = begin()
        return int(answer.headers["Upload-Offset"])

    def upload_together(self, campaign: str, files: Iterable[Path], replace: bool = False) -> UploadAnswer:
        """Upload several recordings in one request; the answer has the outcome of each."""
        with ExitStack() as stack:
            parts = [("files", (file.name, stack.enter_context(file.open("rb")), "application/octet-stream")) for file in files]
            path, params = f"/campaigns/{campaign}/recordings", {"replace": "true"} if replace else {}
            return read(UploadAnswer, self.send("POST", path, files=parts, params=params, **self.long_timeout))

    def upload_folder(self, machine: str, folder: Path, report: Callable[[RecordingAnswer], object] | None = None) -> CampaignAnswer:
        """Upload the folder of a campaign: campaign.toml, its toolings, all recordings and the files of its hammer tests.

        Parameters
        ----------
        report : callable, optional
            Called with each stored recording.
        """
        data = read_toml(folder / "campaign.toml", "campaign")
        toolings = {name: read_toml(folder / path, "tooling") for name, path in data["toolings"].items()}
        campaign = self.make_campaign(machine, {**data, "toolings": toolings})
        # air cuts first: each cut is then judged once
        paths = dict.fromkeys(cut[key] for key in ("air", "cut") for cut in data.get("cuts", ()) if key in cut)
        for path in paths | dict.fromkeys(test["file"] for test in data.get("frfs", ())):
            answer = self.upload(campaign.id, folder / path)
            if report is not None:
                report(answer)
        return self.campaign(campaign.id)


def _recording(campaign: str, name: str) -> str:
    return f"/campaigns/{campaign}/recordings/{quote(name, safe='')}"
