"""Services in this process, that compute where the test runs, and databases for them."""

from __future__ import annotations

import asyncio
import json
from pathlib import Path
from typing import Any

import pytest
from fastapi.testclient import TestClient

from api.client import ServiceError
from api.main import create_app
from api.settings import Settings
from api.stores.entities import Store
from api.stores.sql import open_store
from api.streams.engine import HEADER, Engine, Message
from api.work.pool import guarded

URL = "http://localhost"


class Here:
    """Work in this very process, whose answers are JSON."""

    waiting, ready = 0, True

    async def run(self, call: Any, *arguments: Any) -> Any:
        # as it comes from another process
        return json.loads(json.dumps(guarded(call, *arguments)))

    def start(self) -> None:
        pass

    def stop(self) -> None:
        pass


class Near:
    """The engine of the streams in this very process; what it is sent waits while it is `slow`."""

    def __init__(self) -> None:
        self.engine, self.ready, self.slow = Engine(), True, False
        self.waiting: list[Message] = []

    async def start(self, deliver: Any, anew: Any) -> None:
        self.deliver, self.anew = deliver, anew

    async def stop(self) -> None:
        pass

    def post(self, message: Message) -> None:
        self.waiting.append(message)
        if not self.slow:
            asyncio.get_running_loop().call_soon(self.work)

    def work(self) -> None:
        """Answer what waits, as its bytes tell it."""
        while self.waiting:
            raw = self.waiting.pop(0).packed()
            *fields, length = HEADER.unpack_from(raw)
            answer = self.engine.answer(Message(*fields, raw[HEADER.size : HEADER.size + length]))
            if answer is not None:
                self.deliver(answer)


SQLITE, POSTGRESQL = "sqlite", "postgresql"
#: For tests of what both databases promise.
BOTH = pytest.mark.parametrize("store", [SQLITE, pytest.param(POSTGRESQL, marks=pytest.mark.slow)], indirect=True)


def database(request: pytest.FixtureRequest, kind: str, folder: Path) -> str:
    """The URL of a new database."""
    url: str = request.getfixturevalue("postgres")() if kind == POSTGRESQL else f"sqlite:///{folder / 'store.db'}"
    return url


def embedded(folder: Path) -> Store:
    """A store in a folder."""
    return open_store(f"sqlite:///{folder / 'store.db'}")


def service(store: Store, tmp_path: Path, **settings: Any) -> TestClient:
    return TestClient(
        create_app(Settings(data=tmp_path, **settings), store, Here(), Here(), Near()), base_url=URL, raise_server_exceptions=False
    )


def refused(status, call, *arguments, **further):
    with pytest.raises(ServiceError) as error:
        call(*arguments, **further)
    assert error.value.status == status, error.value
    return error.value.problem
