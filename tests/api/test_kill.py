"""kill -9 of a worker, of the service, of everything, in the middle of jobs: nothing accepted is lost, and results stay the same."""

from __future__ import annotations

import os
import random
import signal
import subprocess
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

import pytest
from sqlalchemy import create_engine, text

from api.client import Client
from api.jobs import lobes
from api.jobs.job_context import STARTS_OVER
from api.jobs.worker import gone, process
from api.security import new_id, now
from api.stores.entities import Machine, Store, digest_of
from api.stores.jobs import Job
from api.stores.sql import open_store
from api.work.requests import LobeRequest, MachineText, ToolingSource
from rcsa_ident.cutting.conditions import Engagement
from rcsa_ident.setup.cut import CutSpec
from tests.api.identifying import carried, uploaded
from tests.api.in_process import POSTGRESQL, SQLITE, database, embedded
from tests.api.in_process import service as in_this_process
from tests.fixtures import by_hand
from tests.fixtures.service import command, example, serving
from tests.fixtures.waiting import PATIENCE, until

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(os.name != "posix" or not Path("/proc/self/stat").exists(), reason="processes are looked up in /proc"),
]


def descendants(pid: int) -> list[int]:
    """Processes that a process has started, and theirs."""
    found = []
    for each in Path("/proc").iterdir():
        with suppress(OSError, ValueError):
            if int((each / "stat").read_text().rpartition(")")[2].split()[1]) == pid:
                found += [int(each.name), *descendants(int(each.name))]
    return found


def kill(pids: list[int]) -> None:
    """End processes without a farewell, and wait until they are gone."""
    told = [process(pid) for pid in pids]
    for pid in pids:
        with suppress(ProcessLookupError):
            os.kill(pid, signal.SIGKILL)
    until(lambda: all(each.endswith(":") or gone(each) for each in told))


def workers(store: Store) -> list[int]:
    """Processes of living job workers."""
    return [int(row.process.split(":")[0]) for row in store.jobs.workers() if not gone(row.process)]


def after(client: Client, id: str, count: int) -> None:
    """Return when a job has told so many further things."""
    told = 0
    for kind, _ in client.events(id):
        told += kind in ("trace", "progress")
        assert kind != "end", "the job was over before anything was killed"
        if told > count:
            return


@contextmanager
def started(folder: Path, url: str, count: int = 1, lobes: int = 0) -> Iterator[tuple[Client, subprocess.Popen]]:
    settings = {"RCSA_IDENT_JOB_WORKERS": str(count), "RCSA_IDENT_LOBE_WORKERS": str(lobes), "RCSA_IDENT_JOB_NICE": "0"}
    settings |= {} if url.startswith("sqlite") else {"RCSA_IDENT_DATABASE": url}
    with serving(folder, **settings) as served, Client(served.url) as client:
        yield client, served.process
        kill([*descendants(served.process.pid), served.process.pid])


@pytest.fixture(scope="module")
def expected(tmp_path_factory) -> str:
    """What an identification of the small campaign comes to in this process, where nothing disturbs it."""
    folder = tmp_path_factory.mktemp("undisturbed")
    store = embedded(folder)
    with in_this_process(store, folder) as http:
        client = Client(http=http)
        job = client.identify_campaign(uploaded(client, client.make_machine("M").id), seed=7).id
        carried(store, folder)
        return client.result(job)


@pytest.mark.parametrize("kind", [SQLITE, POSTGRESQL])
def test_an_identification_survives_everything(request, tmp_path, kind, expected):
    """One job meets the end of its worker, of the service, and of everything at once; each time at some moment of its search."""
    rng = random.Random(20261121)
    folder = tmp_path / "data"
    url = f"sqlite:///{folder / 'service.db'}" if kind == SQLITE else database(request, POSTGRESQL, tmp_path)
    with started(folder, url) as (client, service):
        machine = client.make_machine("M").id
        job = client.identify_campaign(uploaded(client, machine), seed=7).id
        store = open_store(url)
        after(client, job, rng.randrange(1, 12))
        (worker,) = workers(store)
        kill([worker])
        # the service starts another, which goes on
        after(client, job, rng.randrange(1, 4))
        assert workers(store) != [worker]
        kill([service.pid])
    with started(folder, url) as (client, service):
        assert client.job(job).state == "running"
        after(client, job, rng.randrange(1, 4))
        kill([*workers(store), service.pid])
    with started(folder, url) as (client, _):
        found = client.wait(job, PATIENCE)
        assert (found.state, found.problem) == ("done", None)
        assert client.result(job) == expected
        assert [kind for kind, _ in client.events(job)].count("end") == 1
        assert client.send("GET", f"/machines/{machine}/identification").text == expected
    # what is done stays: everything was killed once more
    assert store.jobs.text(job, "result") == expected
    store.close()


#: What the version before may have left of a job that was running.
LEFT = (
    # its steps, which have other names and come in another order
    "UPDATE workflow_status SET application_version = '1' WHERE workflow_uuid = :job",
    # the same steps, in words of that version
    """UPDATE operation_outputs SET output = '"{\\"~table\\":[[\\"value\\",{\\"~Linearisation\\":{}}]]}"' WHERE workflow_uuid = :job""",
)


def test_identifications_survive_an_upgrade(tmp_path, expected):
    """What the version before has left of a job that was running is of no use to this one: it starts over, and says so."""
    folder = tmp_path / "data"
    url = f"sqlite:///{folder / 'service.db'}"
    with started(folder, url, len(LEFT)) as (client, service):
        campaign = uploaded(client, client.make_machine("M").id)
        store = open_store(url)
        until(lambda: len(workers(store)) == len(LEFT))
        ids = [client.identify_campaign(campaign, seed=7, apply=False).id for _ in LEFT]
        until(lambda: all((store.jobs.find(id).progress or "").startswith('{"stage": "search"') for id in ids))
        kill([*workers(store), service.pid])
    tables = create_engine(f"sqlite:///{folder / 'jobs.db'}")
    with tables.begin() as connection:
        for id, left in zip(ids, LEFT, strict=True):
            assert connection.execute(text(left), {"job": id}).rowcount > 0
    tables.dispose()
    with started(folder, url, len(LEFT)) as (client, _):
        for id in ids:
            found = client.wait(id, PATIENCE)
            assert (found.state, found.problem) == ("done", None)
            assert [data["text"] for kind, data in client.events(id) if kind == "note"] == [STARTS_OVER]
            assert client.result(id) == expected
    store.close()


def lobe_job(store: Store, machine: str, result: str, speeds: int, method: str) -> str:
    """A job that keeps a worker at work for a while."""
    cut = CutSpec(Engagement(1.57, 3.14))
    question = LobeRequest(cut, tuple(800.0 + k for k in range(speeds)), 0.005, method, False, 0.0, 1e6)
    text = lobes.asked(MachineText(digest_of(result), result), [ToolingSource(f"T{k}", by_hand.TOOLING) for k in range(3)], question)
    return store.jobs.add(Job(new_id(), "A", "lobes", machine, None, "{}", "queued", now()), {"question": text}, 1000).id


@contextmanager
def working(folder: Path, url: str, name: str) -> Iterator[subprocess.Popen]:
    words, environment = command(
        folder, "worker", "--count", "0", "--lobes", "1", "--paths", "0", RCSA_IDENT_DATABASE=url, RCSA_IDENT_JOB_NICE="0"
    )
    with (folder.parent / name).open("w") as log, subprocess.Popen(words, env=environment, stderr=log) as running:
        try:
            yield running
        finally:
            kill([*descendants(running.pid), running.pid])


@pytest.mark.witness
def test_several_workers_share_jobs_and_take_over(request, tmp_path, result):
    """Two commands on one PostgreSQL: every job is carried out once; those of the one that is killed are ended by the other."""
    url = database(request, POSTGRESQL, tmp_path)
    store = open_store(url)
    machine = store.machines.add(Machine(new_id(), "A", "M", "", now())).id
    folder = tmp_path / "data"
    folder.mkdir()
    with working(folder, url, "first") as first, working(folder, url, "second"):
        until(lambda: len(workers(store)) == 2)
        ids = [lobe_job(store, machine, result, 6, "multi-frequency") for _ in range(5)]

        def tokens(state):
            return {job.worker for job in map(store.jobs.find, ids) if job.state == state}

        # both at work, and one of them is the first's
        until(lambda: len(tokens("running")) == 2)
        mine = descendants(first.pid)
        (doomed,) = {row.token for row in store.jobs.workers() if int(row.process.split(":")[0]) in mine}
        (orphan,) = [id for id in ids if store.jobs.find(id).worker == doomed and store.jobs.find(id).state == "running"]
        kill([first.pid, *mine])
        until(lambda: not store.jobs.open())
        assert {store.jobs.find(id).state for id in ids} == {"done"}
        assert store.jobs.find(orphan).worker != doomed
        for id in ids:
            assert [event.kind for event in store.jobs.events(id, 0, 1000)].count("end") == 1
        assert len({store.jobs.text(id, "answer") for id in ids}) == 1
    store.close()


def test_a_worker_that_is_not_free_or_not_there(tmp_path, result):
    """A job without a place to look up is cancelled within moments; where workers die at once, the service goes on and says so."""
    folder = tmp_path / "data"
    url = f"sqlite:///{folder / 'service.db'}"
    with started(folder, url, 0, 1) as (client, _):
        machine = client.make_machine("M").id
        client.identify(machine, result)
        slow = {"method": "time-domain", "speeds": {"from_rpm": 3000, "to_rpm": 20000, "step_rpm": 50}, "bands": False}
        job = client.lobes_later(machine, example(), **slow).id
        until(lambda: client.lobe_job(job).job.state == "running")
        start = time.monotonic()
        client.send("DELETE", f"/lobes/{job}")
        following = client.lobes_later(machine, example(), speeds={"step_rpm": 2000}).id
        until(lambda: client.lobe_job(following).job.state == "done")
        # the search through all those speeds takes an hour
        assert time.monotonic() - start < PATIENCE
        assert client.lobe_job(job).job.state == "cancelled"
        # the engine's tables are no database any more
        store = open_store(url)
        for name in ("jobs.db", "jobs.db-wal", "jobs.db-shm"):
            with suppress(FileNotFoundError):
                (folder / name).unlink()
        (folder / "jobs.db").write_bytes(b"no database" * 1000)
        kill(workers(store))
        until(lambda: client.http.get("/ready").status_code == 503)
        assert "worker" in client.http.get("/ready").json()["detail"]
        assert client.http.get("/health").status_code == 200
        last = client.lobes_later(machine, example(), speeds={"step_rpm": 2000}).id
        (folder / "jobs.db").unlink()
        until(lambda: client.lobe_job(last).job.state == "done")
        assert client.http.get("/ready").status_code == 200
        store.close()
