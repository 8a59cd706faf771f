"""Every line that is logged while something is served carries its ids, whoever writes it and in whichever process; no key is in one."""

from __future__ import annotations

import asyncio
import io
import json
import logging
from collections.abc import Iterator
from typing import Any

import pytest

from api.jobs.worker import carry
from api.log_lines import JsonLines, ids, tell, telling
from api.metrics import Metrics
from api.processes import Child
from api.reading.reader import Limits, Reader
from api.security import make_key
from api.stores.jobs import Outcome
from api.stores.sql import open_store
from api.streams.engine import FAILED, Message
from api.streams.hub import Hub, StreamLimits
from api.streams.session import About
from api.work.pool import Pool
from api.work.worker import QueryLimits, Worker
from tests.api.identifying import Steps, job, left
from tests.api.in_process import Near, service
from tests.api.streaming import STREAM, streaming


@pytest.fixture
def lines() -> Iterator[Any]:
    """What this process has logged, as the service writes it."""
    told, root = io.StringIO(), logging.getLogger()
    handler = logging.StreamHandler(told)
    handler.setFormatter(JsonLines())
    level = root.level
    root.addHandler(handler)
    root.setLevel(logging.INFO)
    yield lambda: parsed(told.getvalue())
    root.setLevel(level)
    root.removeHandler(handler)


def parsed(text: str) -> list[dict[str, Any]]:
    return [json.loads(line) for line in text.splitlines() if line.startswith("{")]


def says(words: str) -> str:
    """As a library does that knows nothing of the service."""
    logging.getLogger("library").warning(words)
    return words


def nothing() -> None:
    """Of what a process prepares, which these calls do not need."""


def test_lines_of_a_request_carry_its_ids_and_never_the_key(store, tmp_path, lines):
    key, text = make_key("A", ("read",), "")
    store.keys.add(key)
    with service(store, tmp_path, keys=True) as http:
        logging.getLogger("sqlalchemy.engine").setLevel(logging.INFO)
        try:
            for name in ("r1", "r2"):
                assert http.get("/v1/machines", headers={"X-API-Key": text, "X-Request-ID": name}).status_code == 200
        finally:
            logging.getLogger("sqlalchemy.engine").setLevel(logging.NOTSET)
    for name in ("r1", "r2"):
        own = [line for line in lines() if line.get("request_id") == name]
        assert {"sqlalchemy.engine.Engine", "rcsa_ident.service"} <= {line["logger"] for line in own}
        (last,) = [line for line in own if line["event"] == "request"]
        assert (last["key"], last["group"], last["status"]) == (key.id, "A", 200)
        assert any("machines" in line["event"] and (line.get("key"), line.get("group")) == (key.id, "A") for line in own)
    assert text.split("_", 2)[2] not in json.dumps(lines())
    assert not ids()


def test_a_library_tells_nothing_of_its_own_beside_its_sentence():
    record = logging.makeLogRecord({"msg": "hello", "name": "uvicorn.error", "color_message": "\x1b[1mhello", "authorization": "secret"})
    with telling(request_id="r"):
        line = json.loads(JsonLines().format(record))
    assert set(line) == {"time", "level", "logger", "event", "request_id"}


@pytest.mark.slow
def test_a_process_that_answers_a_query_logs_under_its_ids(capfd, lines):
    pool = Pool(1, 4, 1)
    pool._worker = lambda: Worker(QueryLimits(), nothing, nothing)
    pool.start()

    async def ask(name: str) -> None:
        tell(request_id=name)
        await pool.run(says, f"of {name}")

    try:
        asyncio.run(both(ask))
    finally:
        pool.stop()
    assert told_of(capfd) == {"of r1": "r1", "of r2": "r2"}


@pytest.mark.slow
def test_the_reader_logs_under_the_ids_of_its_upload(capfd, lines):
    reader = Reader(Limits(), 4, nothing)
    reader.start()

    async def ask(name: str) -> None:
        tell(request_id=name)
        await reader.run(says, f"of {name}")

    try:
        asyncio.run(both(ask))
    finally:
        reader.stop()
    assert told_of(capfd) == {"of r1": "r1", "of r2": "r2"}


async def both(ask: Any) -> None:
    await asyncio.gather(*(asyncio.create_task(ask(name)) for name in ("r1", "r2")))


def told_of(capfd: pytest.CaptureFixture[str]) -> dict[str, str]:
    """The request of each line that child processes have written."""
    return {line["event"]: line.get("request_id", "") for line in parsed(capfd.readouterr().err) if line["logger"] == "library"}


def carries(url: str, id: str) -> None:
    """In a process of its own: a job whose step logs."""
    store = open_store(url)
    step = Steps()

    def carrier(_job: Any, context: Any) -> Outcome:
        context.remember("a", lambda: says("in a step"))
        return Outcome("done", "")

    carry(store.jobs, {"identification": carrier}, "w", 3, id, lambda name, compute: step.remember(id, name, compute), left)
    says("after it")


@pytest.mark.slow
def test_a_worker_process_logs_under_the_ids_of_its_job(store, machine, tmp_path, capfd):
    id = store.jobs.add(job(machine, key="k1"), {}, 10).id
    child = Child(carries, f"sqlite:///{tmp_path / 'store.db'}", id, name="worker")
    child.end(60.0)
    assert store.jobs.get("A", id).state == "done"
    step, after = [line for line in parsed(capfd.readouterr().err) if line["logger"] == "library"]
    assert (step["event"], step["job"], step["key"], step["group"]) == ("in a step", id, "k1", "A")
    assert after["event"] == "after it"
    assert "job" not in after


def test_a_stream_that_fails_is_told_under_the_ids_of_its_request(lines):
    about = About("s1", "A", "n", "m", "t", "", 1e4, ("X",), 1, 10)

    async def fail() -> None:
        hub = Hub(Near(), StreamLimits(), Metrics(lambda: 0.0))
        with telling(request_id="r1", key="k1"):
            session = hub.open(about)
        hub._deliver(Message(FAILED, session.number, content=b"why"))

    asyncio.run(fail())
    (line,) = lines()
    assert (line["event"], line["session"], line["request_id"], line["key"], line["found"]) == (
        "a stream has failed",
        "s1",
        "r1",
        "k1",
        "why",
    )


def test_a_socket_logs_under_an_id_of_its_own(tmp_path, lines):
    with streaming(tmp_path) as (http, _), http.websocket_connect(STREAM) as socket:
        socket.send_json({"watch": "0" * 24})
        told = socket.receive_json()
    (line,) = [each for each in lines() if each["event"] == "stream"]
    assert (line["request_id"], line["key"]) == (told["problem"]["request_id"], "local")
