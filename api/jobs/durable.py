"""The durable engine: DBOS, on a file of its own or in the service's database."""

from __future__ import annotations

import json
import logging
import sqlite3
from collections.abc import Callable, Iterator, Sequence
from contextlib import closing, contextmanager
from typing import Any

from dbos import DBOS, DBOSClient, DBOSConfig
from dbos import Serializer as _Serializer

from api.jobs.backend import VERSION, Carried, Carry
from api.stores.database import answering

#: Interval between two polls for a job [s].
POLL = 0.5
_NAME = "rcsa-ident"
_STATES = {"ENQUEUED": "waiting", "DELAYED": "waiting", "PENDING": "running"}


class Json(_Serializer):
    """Serialiser of plain values only: reading them runs no code."""

    def serialize(self, data: Any) -> str:
        return json.dumps(data, default=lambda other: f"a {type(other).__name__}")

    def deserialize(self, serialized_data: str) -> Any:
        return json.loads(serialized_data)

    def name(self) -> str:
        return "rcsa_ident_json"


class Durable:
    """DBOS in this process, which can have one only. `url`: of the engine's tables."""

    def __init__(self, url: str) -> None:
        self.url = url
        self.client: DBOSClient | None = None

    def start(self, executor: str, carry: Carry, kinds: Sequence[str]) -> None:
        if self.url.startswith("sqlite:///"):
            # stays with the file: readers and writers do not block each other
            with closing(sqlite3.connect(self.url.removeprefix("sqlite:///"))) as connection:
                connection.execute("PRAGMA journal_mode=WAL")
        config: DBOSConfig = {
            "name": _NAME,
            "system_database_url": self.url,
            "executor_id": executor,
            "application_version": VERSION,
            "serializer": Json(),
            "log_level": "WARNING",
            "use_listen_notify": False,
            "sys_db_pool_size": 5,
        }
        DBOS(config=config)
        # its records go to the handlers of the service
        log = logging.getLogger("dbos")
        log.handlers.clear()
        log.propagate = True

        @DBOS.workflow(name="carry", max_recovery_attempts=None)
        def workflow(job: str) -> None:
            carry(job, _remember)

        queues = [_queue(kind) for kind in kinds]
        DBOS.listen_queues(queues)
        DBOS.launch()
        for queue in queues:
            DBOS.register_queue(queue, worker_concurrency=1, polling_interval_sec=POLL)
        # which would wait for its database by itself, without a limit: the worker's heartbeats would stop with it
        how: Any = {"application_name": _NAME, "system_database_pool_size": 2, "retry_connection_errors": False}
        self.client = DBOSClient(system_database_url=self.url, serializer=Json(), **how)

    def submit(self, job: str, kind: str) -> None:
        options: Any = {"workflow_name": "carry", "queue_name": _queue(kind), "workflow_id": job, "app_version": VERSION}
        with self._asking() as client:
            client.enqueue(options, job)

    def carried(self) -> Sequence[Carried]:
        with self._asking() as client:
            rows = client.list_workflows(name="carry", load_input=False, load_output=False)
        return [Carried(row.workflow_id, _STATES.get(row.status, "over"), row.executor_id, row.app_version == VERSION) for row in rows]

    def resume(self, job: str, kind: str) -> None:
        with self._asking() as client:
            client.resume_workflow(job, queue_name=_queue(kind))

    def forget(self, jobs: Sequence[str]) -> None:
        with self._asking() as client:
            client.delete_workflows(list(jobs))

    @contextmanager
    def _asking(self) -> Iterator[DBOSClient]:
        assert self.client is not None
        with answering():
            yield self.client


def _queue(kind: str) -> str:
    return f"jobs of kind {kind}"


def _remember(name: str, compute: Callable[[], str]) -> str:
    return DBOS.run_step({"name": name}, compute)
