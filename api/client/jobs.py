"""The client's jobs: identifications, and lobes that take long."""

from __future__ import annotations

import json
import math
import time
from collections.abc import Iterable, Iterator
from typing import Any

import httpx2

from api.client.asking import Asking, Json, ServiceError, read, refused
from api.schemas.common import Page, ProblemDocument
from api.schemas.jobs import FittedLines, JobAnswer, LobeJob
from api.schemas.machines import Modes
from api.schemas.queries import LobeAnswer


class Jobs(Asking):
    """Jobs."""

    def identify_campaign(self, campaign: str, repeat: str | None = None, **further: Any) -> JobAnswer:
        """Have a machine identified from a campaign; seed, method, start, apply. `repeat` is an idempotency key."""
        headers = {} if repeat is None else {"Idempotency-Key": repeat}
        return read(JobAnswer, self.send("POST", "/identifications", json={"campaign": campaign, **further}, headers=headers))

    def job(self, id: str, wait: int = 0) -> JobAnswer:
        """Return how far an identification is; after so many seconds at the latest, where it has not ended before."""
        headers = {"Prefer": f"wait={wait}"} if wait else {}
        return read(JobAnswer, self.send("GET", f"/identifications/{id}", headers=headers))

    def jobs(self, limit: int = 50, **query: str) -> Iterator[JobAnswer]:
        """Yield identifications, newest first; machine, campaign, state."""
        return self.all("/identifications", Page[JobAnswer], limit, query)

    def wait(self, id: str, seconds: float = 3600.0) -> JobAnswer:
        """Return an identification when it has ended, or after so many seconds as it is then."""
        end = time.monotonic() + seconds
        while True:
            left = max(end - time.monotonic(), 0.0)
            job = self.job(id, wait=min(math.ceil(left), 20))
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
                        raise refused(answer)
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
        return read(JobAnswer, self.send("DELETE", f"/identifications/{id}"))

    def found_modes(self, id: str) -> Modes:
        """Return the modes that an identification has found."""
        return read(Modes, self.send("GET", f"/identifications/{id}/modes"))

    def fitted(self, id: str) -> FittedLines:
        """Return measured lines beside the model's."""
        return read(FittedLines, self.send("GET", f"/identifications/{id}/frf"))

    def result(self, id: str) -> str:
        """Return the text of RESULT.json of an identification."""
        return self.send("GET", f"/identifications/{id}/result").text

    def report(self, id: str) -> str:
        """Return the report on an identification, HTML."""
        return self.send("GET", f"/identifications/{id}/report").text

    def lobes(self, machine: str, *toolings: str | Json, **further: Any) -> LobeAnswer:
        """Return stability lobes of one tooling or several, also where the service makes a job of them."""
        answer = self.send("POST", "/lobes", json={"machine": machine, "toolings": list(toolings), **further})
        if answer.status_code == 200:
            return read(LobeAnswer, answer)
        id = read(JobAnswer, answer).id
        while (found := self.lobe_job(id, wait=20)).job.finished is None:
            pass
        if found.answer is None:
            problem = found.job.problem
            document = {"detail": f"the job is {found.job.state}"} if problem is None else problem.model_dump()
            document |= {"type": "about:blank", "title": found.job.state, "status": 422, "request_id": id}
            raise ServiceError(422, ProblemDocument.model_validate(document))
        return found.answer

    def lobes_later(self, machine: str, *toolings: str | Json, **further: Any) -> JobAnswer:
        """Have stability lobes computed as a job."""
        body = {"machine": machine, "toolings": list(toolings), **further}
        return read(JobAnswer, self.send("POST", "/lobes", json=body, headers={"Prefer": "respond-async"}))

    def lobe_job(self, id: str, wait: int = 0) -> LobeJob:
        """Return lobes that are computed as a job; after so many seconds at the latest, where it has not ended before."""
        return read(LobeJob, self.send("GET", f"/lobes/{id}", headers={"Prefer": f"wait={wait}"} if wait else {}))


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
