"""Services for tests: in this process with a store of their own, and computing where the test runs."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest
from fastapi.testclient import TestClient

from api.client import Client
from api.security import make_key, new_id, now
from api.stores.entities import Machine, Store
from api.stores.sql import open_store
from tests.api.in_process import SQLITE, database, service
from tests.fixtures import by_hand
from tests.fixtures.postgres import postgres, postgres_server  # noqa: F401  (fixtures)


@pytest.fixture(scope="session")
def result(tmp_path_factory: pytest.TempPathFactory) -> str:
    return by_hand.result_text(tmp_path_factory.mktemp("result"))


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
