"""A small real campaign, and an engine without a disk that carries jobs out where a test runs."""

from __future__ import annotations

import tomllib
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

from api.client import Client
from api.files import Files
from api.jobs import identification, lobes, paths
from api.jobs.worker import Carrier, carry
from api.reading.campaigns import load_campaign
from api.security import new_id, now
from api.stores.entities import Store
from api.stores.jobs import Job
from tests.fixtures.paths import SAMPLES

#: Cuts of one tooling, along one axis: enough for a search with all its steps, and soon done.
CUTS = 4


def declared(cuts: int = CUTS) -> dict[str, Any]:
    """Keys of a campaign with the first cuts of the samples and the sensor of the flange along X."""
    data = tomllib.loads((SAMPLES / "campaign.toml").read_text(encoding="utf-8"))
    chosen = data["cuts"][:cuts]
    (tooling,) = {cut["tooling"] for cut in chosen}
    keys = tomllib.loads((SAMPLES / data["toolings"][tooling]).read_text(encoding="utf-8"))
    return data | {"sensors": {"flange_x": data["sensors"]["flange_x"]}, "toolings": {tooling: keys}, "cuts": chosen}


def files(cuts: int = CUTS) -> list[Path]:
    """The recordings of that campaign."""
    return [SAMPLES / cut[kind] for cut in declared(cuts)["cuts"] for kind in ("air", "cut")]


def uploaded(client: Client, machine: str, cuts: int = CUTS) -> str:
    """The id of that campaign, with all its recordings."""
    campaign = client.make_campaign(machine, declared(cuts)).id
    for file in files(cuts):
        client.upload(campaign, file)
    return campaign


class Steps:
    """An engine for one process: steps in a table, and how often each was computed."""

    def __init__(self) -> None:
        self.texts: dict[tuple[str, str], str] = {}
        self.computed: list[tuple[str, str]] = []

    def remember(self, job: str, name: str, compute: Callable[[], str]) -> str:
        if (job, name) not in self.texts:
            self.texts[job, name] = compute()
            self.computed.append((job, name))
        return self.texts[job, name]


def left(code: int) -> None:
    """In the place of the process' end."""
    raise AssertionError(f"the process would have ended with {code}")


def job(machine: str, **changed: Any) -> Job:
    return replace(Job(new_id(), "A", "identification", machine, "c1", "{}", "queued", now()), **changed)


def running(store: Store, machine: str, **changed: Any) -> str:
    """The id of a job that worker w has taken up."""
    id = store.jobs.add(job(machine, **changed), {}, 100).id
    assert store.jobs.begin(id, "w", now()) is not None
    return id


def carriers(store: Store, folder: Path) -> dict[str, Carrier]:
    load = partial(load_campaign, store, Files(folder / "files", 10**12, 0))
    return {"identification": partial(identification.carry, load), "lobes": lobes.carry, "path": partial(paths.carry, most=600.0)}


def carried(store: Store, folder: Path, steps: Steps | None = None) -> Steps:
    """Carry out all jobs that wait."""
    engine = Steps() if steps is None else steps
    for job in store.jobs.open():
        carry(store.jobs, carriers(store, folder), "here", 3, job.id, partial(engine.remember, job.id), left)
    return engine
