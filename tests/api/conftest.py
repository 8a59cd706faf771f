"""Services for tests: in this process with a store of their own, and computing where the test runs."""

from __future__ import annotations

import asyncio
import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from fastapi.testclient import TestClient

from api.client import Client
from api.main import create_app
from api.schemas.toolings import EXAMPLE
from api.security import make_key, new_id, now
from api.settings import Settings
from api.stores.entities import Machine, Store
from api.stores.sql import open_store
from api.streams.engine import HEADER, Engine, Message
from api.work.pool import guarded
from rcsa_ident.io.identifications import identification_to_json
from rcsa_ident.io.results import layout, plain
from tests.api.postgres import postgres, postgres_server  # noqa: F401  (fixtures)
from tests.cli import by_hand

URL = "http://localhost"


class Here:
    """Work in this very process."""

    waiting, ready = 0, True

    async def run(self, call: Any, *arguments: Any) -> Any:
        return guarded(call, *arguments)

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


def result_text(folder: Path, softening: bool = False, **changed: Any) -> str:
    """RESULT.json of a machine made by hand."""
    data = identification_to_json(by_hand.identification(softening), by_hand.campaign(folder), by_hand.LEFT_OUT)
    return layout(plain(data | changed)) + "\n"


@pytest.fixture(scope="session")
def result(tmp_path_factory: pytest.TempPathFactory) -> str:
    return result_text(tmp_path_factory.mktemp("result"))


SQLITE, POSTGRESQL = "sqlite", "postgresql"
#: For tests of what both databases promise.
BOTH = pytest.mark.parametrize("store", [SQLITE, POSTGRESQL], indirect=True)


def database(request: pytest.FixtureRequest, kind: str, folder: Path) -> str:
    """The URL of a new database."""
    url: str = request.getfixturevalue("postgres")() if kind == POSTGRESQL else f"sqlite:///{folder / 'store.db'}"
    return url


def embedded(folder: Path) -> Store:
    """A store in a folder."""
    return open_store(f"sqlite:///{folder / 'store.db'}")


@pytest.fixture
def store(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[Store]:
    """An embedded one, or one on PostgreSQL where a test's parameters say so."""
    found = open_store(database(request, getattr(request, "param", SQLITE), tmp_path))
    yield found
    found.close()


@pytest.fixture
def machine(store: Store) -> str:
    """The id of a machine of group A."""
    return store.machines.add(Machine(new_id(), "A", "M", "", now())).id


def service(store: Store, tmp_path: Path, **settings: Any) -> TestClient:
    return TestClient(
        create_app(Settings(data=tmp_path, **settings), store, Here(), Here(), Near()), base_url=URL, raise_server_exceptions=False
    )


@pytest.fixture
def http(store: Store, tmp_path: Path) -> Iterator[TestClient]:
    """A service on loopback that asks for no keys."""
    with service(store, tmp_path) as found:
        yield found


@pytest.fixture
def client(http: TestClient) -> Client:
    return Client(http=http)


@pytest.fixture
def shop(client: Client, result: str) -> tuple[Client, str]:
    """A machine with an identification, and a tooling T1."""
    id = client.make_machine("HPM 800U").id
    client.identify(id, result)
    client.write_tooling("T1", by_hand.TOOLING)
    return client, id


@pytest.fixture
def guarded_http(store: Store, tmp_path: Path) -> Iterator[tuple[TestClient, dict[str, str]]]:
    """A service that asks for keys, and keys: every scope of group A, admin of group B."""
    keys = {}
    for name, group, scopes in (*((s, "A", (s,)) for s in ("read", "upload", "run", "admin")), ("other", "B", ("admin",))):
        key, keys[name] = make_key(group, scopes, name)
        store.keys.add(key)
    with service(store, tmp_path, keys=True) as found:
        yield found, keys


def example(**changed: Any) -> dict[str, Any]:
    """A tooling as JSON."""
    return json.loads(json.dumps(EXAMPLE)) | changed
