"""A PostgreSQL server for tests: made in a folder of its own, under a user that is not root, gone afterwards."""

from __future__ import annotations

import itertools
import os
import pwd
import shutil
import socket
import subprocess
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import psycopg
import pytest

_numbers = itertools.count()


def programs() -> Path | None:
    """The folder of initdb and postgres, those of the latest version where there are several."""
    installed = sorted(Path("/usr/lib/postgresql").glob("*/bin/initdb"), key=lambda p: float(p.parts[-3])) if os.name == "posix" else []
    found = str(installed[-1]) if installed else shutil.which("initdb")
    return None if found is None else Path(found).resolve().parent


def _user() -> str | None:
    """As whom a server may run: it refuses to be root's."""
    if os.geteuid() != 0:
        return None
    names = {entry.pw_name for entry in pwd.getpwall()}
    return next((name for name in ("postgres", "nobody") if name in names), None)


@contextmanager
def server(safe: bool = False) -> Iterator[str]:
    """Run a server and yield its URL without a database; `safe` writes through to the disk as a real one does."""
    folder = programs()
    assert folder is not None
    user = _user()
    data = Path(tempfile.mkdtemp(prefix="rcsa-pg-"))
    further: dict[str, Any] = {"stdin": subprocess.DEVNULL, "stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL, "cwd": data}
    if user is not None:
        entry = pwd.getpwnam(user)
        os.chown(data, entry.pw_uid, entry.pw_gid)
        further |= {"user": entry.pw_uid, "group": entry.pw_gid, "extra_groups": []}
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = int(free.getsockname()[1])
    try:
        initdb = [str(folder / "initdb"), "-D", str(data / "db"), "-U", "service", "-A", "trust", "-E", "UTF8", "--no-locale", "--no-sync"]
        subprocess.run(initdb, check=True, timeout=120, **further)
        words = [str(folder / "postgres"), "-D", str(data / "db"), "-p", str(port), "-k", str(data), "-h", "127.0.0.1"]
        if not safe:
            words += ["-c", "fsync=off", "-c", "full_page_writes=off"]
        with subprocess.Popen(words, **further) as process:
            try:
                url = f"postgresql+psycopg://service@127.0.0.1:{port}/"
                _answers(port, process)
                yield url
            finally:
                process.terminate()
                try:
                    process.wait(20)
                except subprocess.TimeoutExpired:
                    process.kill()
    finally:
        shutil.rmtree(data, ignore_errors=True)


def _answers(port: int, process: subprocess.Popen[bytes]) -> None:
    for _ in range(300):
        assert process.poll() is None, "the server has ended"
        try:
            psycopg.connect(f"host=127.0.0.1 port={port} user=service dbname=postgres").close()
            return
        except psycopg.OperationalError:
            time.sleep(0.1)
    raise AssertionError("the server does not answer")


def new_database(url: str) -> str:
    """Return the URL of a database that nobody has used."""
    name = f"rcsa_{os.getpid()}_{next(_numbers)}"
    with psycopg.connect(url.replace("+psycopg", "") + "postgres", autocommit=True) as connection:
        connection.execute(f'CREATE DATABASE "{name}"')
    return url + name


@pytest.fixture(scope="session")
def postgres_server() -> Iterator[str]:
    if programs() is None:
        pytest.skip("PostgreSQL's server programs are not installed")
    if os.geteuid() == 0 and _user() is None:
        pytest.skip("there is no user but root to run a PostgreSQL server")
    with server() as url:
        yield url


@pytest.fixture
def postgres(postgres_server: str) -> Callable[[], str]:
    """Makes a new database and returns its URL."""
    return lambda: new_database(postgres_server)
