"""Jobs of the client: identifications, lobes that take long, tools along paths."""

from __future__ import annotations

import json
import math
import time
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any, Literal

import httpx2

from api.client.asking import Asking, Json, ServiceError, read, refused, standing_on
from api.schemas.common import Page, ProblemDocument
from api.schemas.jobs import FittedLines, JobAnswer, LobeJob
from api.schemas.machines import Modes
from api.schemas.paths import PathJob, PathTold
from api.schemas.queries import LobeAnswer


class Jobs(Asking):
    """Requests about jobs."""

    def identify_campaign(self, campaign: str, repeat: str | None = None, **further: Any) -> JobAnswer:
        """Submit the identification of a campaign; options seed, method, start, apply, robot. `repeat` is an idempotency key."""
        headers = {} if repeat is None else {"Idempotency-Key": repeat}
        return read(JobAnswer, self.send("POST", "/identifications", json={"campaign": campaign, **further}, headers=headers))

    def job(self, id: str, wait: int = 0) -> JobAnswer:
        """Return an identification, once it has ended or after so many seconds."""
        headers = {"Prefer": f"wait={wait}"} if wait else {}
        return read(JobAnswer, self.send("GET", f"/identifications/{id}", headers=headers))

    def jobs(self, limit: int = 50, **query: str) -> Iterator[JobAnswer]:
        """Yield identifications, newest first; machine, campaign, state."""
        return self.all("/identifications", Page[JobAnswer], limit, query)

    def wait(self, id: str, seconds: float = 3600.0) -> JobAnswer:
        """Return an identification, once it has ended or after so many seconds."""
        end = time.monotonic() + seconds
        while True:
            left = max(end - time.monotonic(), 0.0)
            job = self.job(id, wait=min(math.ceil(left), 20))
            if job.finished is not None or left == 0.0:
                return job

    def events(self, id: str, kind: str = "identifications", attempts: int = 5) -> Iterator[tuple[str, dict[str, Any]]]:
        """Yield kind and data of a job's events until it has ended; a lost connection continues where it broke.

        Parameters
        ----------
        kind : str
            identifications, lobes or paths.
        attempts : int
            Successive connections without an event.
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
        """Return the modes of an identification."""
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

    def lobes(self, machine: str | Json, *toolings: str | Json, **further: Any) -> LobeAnswer:
        """Return stability lobes of one or more toolings, also where the service turns the query into a job."""
        answer = self.send("POST", "/lobes", json={**standing_on(machine), "toolings": list(toolings), **further})
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

    def lobes_later(self, machine: str | Json, *toolings: str | Json, **further: Any) -> JobAnswer:
        """Submit stability lobes as a job."""
        body = {**standing_on(machine), "toolings": list(toolings), **further}
        return read(JobAnswer, self.send("POST", "/lobes", json=body, headers={"Prefer": "respond-async"}))

    def lobe_job(self, id: str, wait: int = 0) -> LobeJob:
        """Return a job of lobes, once it has ended or after so many seconds."""
        return read(LobeJob, self.send("GET", f"/lobes/{id}", headers={"Prefer": f"wait={wait}"} if wait else {}))

    def path_told(self, path: Path) -> PathTold:
        """Return what PATH.nc or PATH.csv is; nothing is stored."""
        kind = "text/csv" if path.suffix.lower() == ".csv" else "text/x-gcode"
        return read(PathTold, self.send("POST", "/paths/preview", content=path.read_bytes(), headers={"Content-Type": kind}))

    def cut_path(
        self,
        kind: Literal["removal", "stability", "milling"],
        path: Path,
        tooling: str | Json,
        machine: str | Json | None = None,
        stock: Path | None = None,
        **further: Any,
    ) -> JobAnswer:
        """Submit a tool along a path through stock: ``block_mm``, or the file of its surface; a removal needs no machine."""
        query = {"tooling": tooling, **({} if machine is None else standing_on(machine)), **further}
        files = {"query": (None, json.dumps(query), "application/json"), "path": (path.name, path.read_bytes())}
        files |= {} if stock is None else {"stock": (stock.name, stock.read_bytes())}
        return read(JobAnswer, self.send("POST", f"/paths/{kind}", files=files))

    def path_job(self, id: str, wait: int = 0) -> PathJob:
        """Return a job of a path, once it has ended or after so many seconds."""
        return read(PathJob, self.send("GET", f"/paths/{id}", headers={"Prefer": f"wait={wait}"} if wait else {}))

    def path_table(self, id: str) -> str:
        """Return the table of a job of a path, as the command writes it."""
        return self.send("GET", f"/paths/{id}/table").text

    def cancel_path(self, id: str) -> JobAnswer:
        """Cancel a job of a path."""
        return read(JobAnswer, self.send("DELETE", f"/paths/{id}"))


def _events(lines: Iterable[str]) -> Iterator[dict[str, str]]:
    """Fields of server-sent events, without comments and `retry`."""
    fields: dict[str, str] = {}
    for line in lines:
        if line:
            name, _, value = line.partition(":")
            fields[name] = value.removeprefix(" ")
        else:
            if "event" in fields:
                yield fields
            fields = {}
