"""Campaigns and recordings of the client."""

from __future__ import annotations

import base64
import hashlib
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import ExitStack
from functools import partial
from pathlib import Path
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
            headers = {"Content-Type": "application/octet-stream", "Content-Length": str(file.stat().st_size), **_digest(digest)}
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

        Parameters
        ----------
        part : int [bytes]
        attempts : int
            For each part.
        """
        path, size = _recording(campaign, name or file.name), file.stat().st_size
        with file.open("rb") as opened:
            digest = hashlib.file_digest(opened, "sha256").digest()
            failed, offset = 0, -1
            while True:
                try:
                    if offset < 0:
                        offset = self._offset(path, size)
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
                    answer = self.send(
                        "PATCH", path, content=data, headers=headers, params={"replace": "true"} if replace else {}, **self.long_timeout
                    )
                except (httpx2.TransportError, ServiceError) as error:
                    failed += 1
                    lost = isinstance(error, httpx2.TransportError) or error.status in (408, 503)
                    if failed >= attempts or not lost:
                        raise
                    time.sleep(min(0.2 * 2**failed, 5.0))
                    offset = -1
                    continue
                if answer.status_code != 204:
                    return read(RecordingAnswer, answer)
                failed, offset = 0, int(answer.headers["Upload-Offset"])

    def _offset(self, path: str, size: int) -> int:
        """Offset at which an upload continues: 0 where another file is stored, the size where the file is complete."""
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
            return read(RecordingAnswer, self.send("GET", path))
        except ServiceError as error:
            if error.status != 404:
                raise
            return None

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


def _digest(sha256: bytes) -> dict[str, str]:
    return {"Repr-Digest": f"sha-256=:{base64.b64encode(sha256).decode()}:"}
