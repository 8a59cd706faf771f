"""The service as a process of its own: settings, keys, a restart, and what is not imported."""

from __future__ import annotations

import json
import os
import re
import socket
import stat
import subprocess
import sys
import threading
from pathlib import Path

import httpx2
import pytest

from api.client import Client
from api.data_folder import alone
from api.main import create_app
from api.settings import Settings, from_environment
from rcsa_ident.base.errors import InputError
from tests.api.in_process import Here, Near, refused
from tests.fixtures import by_hand
from tests.fixtures.service import command, free_port, serving
from tests.fixtures.waiting import PATIENCE, until

ROOT = Path(__file__).resolve().parents[2]


def test_settings_from_the_environment():
    found = from_environment(
        {"RCSA_IDENT_DATA": "/x", "RCSA_IDENT_PORT": "9000", "RCSA_IDENT_KEYS": "on", "RCSA_IDENT_WORKERS": " ", "PORT": "1"}
    )
    assert (str(found.data), found.port, found.asks_for_keys) == ("/x", 9000, True)
    assert found.database_url == "sqlite:////x/service.db"
    assert from_environment({"RCSA_IDENT_DATABASE": "postgresql://x"}).database_url == "postgresql://x"
    assert from_environment({}).host == "127.0.0.1"
    assert found.workers == Settings().workers


@pytest.mark.parametrize(
    ("name", "value"), [("PORT", "x"), ("PORT", "70000"), ("WORKERS", "0"), ("KEYS", "maybe"), ("WORK_SECONDS", "nan"), ("QUEUE", "1.5")]
)
def test_a_setting_that_is_none_is_named(name, value):
    with pytest.raises(InputError, match=f"RCSA_IDENT_{name}"):
        from_environment({f"RCSA_IDENT_{name}": value})


@pytest.mark.parametrize(
    ("name", "near"),
    [("WORKER", "WORKERS"), ("JOB_WORKER", "JOB_WORKERS"), ("MAX_BODY_BYTE", "MAX_BODY_BYTES"), ("TLS_CERT", "TLS_CERTIFICATE")],
)
def test_a_mistyped_setting_is_refused_with_its_nearest_name(name, near):
    with pytest.raises(InputError, match=f"^RCSA_IDENT_{name}: found an unknown setting, .*; did you mean RCSA_IDENT_{near}\\?$"):
        from_environment({f"RCSA_IDENT_{name}": "1"})


def test_what_the_whole_run_hands_on_is_no_unknown_setting():
    """A variable of `.ci/run` itself ended every service that a test started."""
    text = (ROOT / ".ci" / "run").read_text(encoding="utf-8")
    names = set(re.findall(r"RCSA_IDENT_[A-Z_]+", text)) - set(re.findall(r"unset (RCSA_IDENT_[A-Z_]+)", text))
    assert names
    from_environment(dict.fromkeys(names, "1"))


def test_the_database_may_be_told_by_a_file(tmp_path):
    file = tmp_path / "database"
    file.write_text("postgresql+psycopg://shop:secret@db/shop\n")
    found = from_environment({"RCSA_IDENT_DATABASE_FILE": str(file)})
    assert found.database_url == found.engine_url == "postgresql+psycopg://shop:secret@db/shop"
    for text, also, words in (
        (None, "", "cannot be read"),
        ("", "", "with 0 words"),
        ("secret\nsecret", "", "with 2 words"),
        ("secret://a", "b", "beside RCSA_IDENT_DATABASE"),
    ):
        file.unlink(missing_ok=True)
        if text is not None:
            file.write_text(text)
        with pytest.raises(InputError, match=f"RCSA_IDENT_DATABASE_FILE: found .*{words}") as error:
            from_environment({"RCSA_IDENT_DATABASE_FILE": str(file), "RCSA_IDENT_DATABASE": also})
        assert "secret" not in str(error.value)


def test_settings_from_files_of_secrets(tmp_path):
    (tmp_path / "RCSA_IDENT_DATABASE").write_text("postgresql+psycopg://shop:secret@db/shop\n")
    (tmp_path / "RCSA_IDENT_PORT").write_text("9000")
    (tmp_path / "password_of_another_service").write_text("x")
    given = {"RCSA_IDENT_SECRETS": str(tmp_path)}
    found = from_environment(given)
    assert (found.database_url, found.port) == ("postgresql+psycopg://shop:secret@db/shop", 9000)
    assert from_environment(given | {"RCSA_IDENT_PORT": "9001"}).port == 9001


@pytest.mark.parametrize(
    ("name", "content", "words"),
    [
        ("PORT", b"secret", "RCSA_IDENT_PORT: found something else in its file, allowed is a whole number from 0 to 65535"),
        ("DATABAS", b"secret", "RCSA_IDENT_DATABAS: found an unknown setting, .* did you mean RCSA_IDENT_DATABASE"),
        ("DATABASE", b"secret\xff", "RCSA_IDENT_SECRETS: found .* with a file that cannot be read"),
        ("DATABASE", None, "RCSA_IDENT_SECRETS: found .* with a file that cannot be read"),
    ],
)
def test_secrets_that_do_not_fit_are_named_and_not_repeated(tmp_path, name, content, words):
    file = tmp_path / f"RCSA_IDENT_{name}"
    file.mkdir() if content is None else file.write_bytes(content)
    with pytest.raises(InputError, match=words) as error:
        from_environment({"RCSA_IDENT_SECRETS": str(tmp_path)})
    assert "secret" not in str(error.value).replace(str(tmp_path), "")
    with pytest.raises(InputError, match=r"RCSA_IDENT_SECRETS: found .* which is no folder"):
        from_environment({"RCSA_IDENT_SECRETS": str(tmp_path / "elsewhere")})


def test_only_one_place_reads_the_environment(monkeypatch):
    monkeypatch.setenv("RCSA_IDENT_PORT", "9")
    assert Settings().port == 8000
    assert from_environment(os.environ).port == 9


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"TLS_CERTIFICATE": "c.pem"}, "RCSA_IDENT_TLS_KEY: found nothing"),
        ({"TLS_KEY": "k.pem"}, "RCSA_IDENT_TLS_CERTIFICATE: found nothing"),
        ({"PROXIES": "10.0.0.1,*"}, r"RCSA_IDENT_PROXIES: found \*, allowed is addresses"),
    ],
)
def test_settings_of_the_network_that_do_not_fit(given, words):
    with pytest.raises(InputError, match=words):
        from_environment({f"RCSA_IDENT_{name}": value for name, value in given.items()})


@pytest.mark.parametrize("host", ["0.0.0.0", "192.168.0.7", "::", "example.org"])
def test_keys_are_off_on_loopback_only(host):
    assert from_environment({"RCSA_IDENT_HOST": host}).asks_for_keys
    with pytest.raises(InputError, match="RCSA_IDENT_KEYS"):
        from_environment({"RCSA_IDENT_HOST": host, "RCSA_IDENT_KEYS": "off"})


@pytest.mark.parametrize("host", ["127.0.0.1", "127.0.0.2", "::1", "localhost"])
def test_loopback_needs_none(host):
    assert not Settings(host=host).asks_for_keys
    assert Settings(host=host, keys=True).asks_for_keys


@pytest.mark.slow
def test_importing_does_nothing_and_the_service_stays_light():
    """What is slow to import, or draws, stays out of the process that answers."""
    heavy = ("control", "scipy.signal", "matplotlib", "pymoo", "filterpy", "h5py", "typer")
    code = f"import sys, api.main, api.client; print([m for m in {heavy!r} if m in sys.modules])"
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    found = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, env=environment)
    assert found.stdout.strip() == "[]"
    code = "import sys, api.serve; print([m for m in ('fastapi', 'numpy', 'sqlalchemy') if m in sys.modules])"
    found = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, env=environment)
    assert found.stdout.strip() == "[]"


@pytest.mark.slow
def test_a_service_with_keys_killed_and_started_again(tmp_path, result):
    words, environment = command(tmp_path / "data", "create-key", "--group", "hall 3", "--label", "first")
    made = subprocess.run(words, env=environment, capture_output=True, text=True, check=True)
    key = made.stdout.strip()
    with serving(tmp_path / "data", RCSA_IDENT_KEYS="on") as served, Client(served.url, key) as client:
        id = client.make_machine("m", repeat="k").id
        client.identify(id, result)
        client.write_tooling("T1", by_hand.TOOLING)
        first = client.lobes(id, "T1", recommend=False)
        with Client(served.url) as nobody:
            refused(401, nobody.machine, id)
        # no farewell
        served.process.kill()
    assert key not in served.log.read_text()
    with serving(tmp_path / "data", RCSA_IDENT_KEYS="on") as served, Client(served.url, key) as client:
        assert client.make_machine("m", repeat="k").id == id
        assert client.tooling_file("T1") == by_hand.TOOLING
        # the same numbers to the last digit
        assert client.lobes(id, "T1", recommend=False) == first
        served.process.terminate()
        assert served.process.wait(PATIENCE) in (0, -15)
    lines = [json.loads(line) for line in served.log.read_text().splitlines()]
    (line,) = [line for line in lines if line.get("route", "").endswith("/lobes")]
    assert line["status"] == 200
    assert line["group"] == "hall 3"
    assert key.split("_", 2)[2].encode() not in (tmp_path / "data" / "service.db").read_bytes()


def test_a_data_folder_is_its_owners_alone(tmp_path):
    there = tmp_path / "there"
    there.mkdir(mode=0o755)
    for folder in (there, tmp_path / "new"):
        create_app(Settings(data=folder), None, Here(), Here(), Near()).state.components.store.close()
        assert stat.S_IMODE(folder.stat().st_mode) == 0o700


def test_a_data_folder_has_one_service(tmp_path):
    with alone(tmp_path / "data"):
        with pytest.raises(InputError, match=r"RCSA_IDENT_DATA: found .*which another service is using"), alone(tmp_path / "data"):
            pass
        # another folder is another service's
        with alone(tmp_path / "other"):
            pass
    # the one that has ended holds nothing
    with alone(tmp_path / "data"):
        pass


@pytest.mark.slow
def test_a_second_service_on_a_folder_says_so_and_ends(tmp_path):
    with serving(tmp_path / "data") as first:
        words, environment = command(tmp_path / "data", "--port", str(free_port()))
        second = subprocess.run(words, env=environment, capture_output=True, text=True, check=False, timeout=PATIENCE)
        assert second.returncode == 2
        assert "which another service is using" in second.stderr
        assert "Traceback" not in second.stderr
        assert first.ready()
        # even without a farewell the folder is free
        first.process.kill()
        first.process.wait(PATIENCE)
    with serving(tmp_path / "data") as third:
        assert third.ready()


@pytest.mark.slow
def test_a_port_that_is_taken_is_told_in_words(tmp_path):
    with socket.socket() as other:
        other.bind(("127.0.0.1", 0))
        other.listen()
        words, environment = command(tmp_path / "data", "--port", str(other.getsockname()[1]))
        found = subprocess.run(words, env=environment, capture_output=True, text=True, check=False, timeout=PATIENCE)
    assert found.returncode == 2
    assert "RCSA_IDENT_PORT: found 127.0.0.1:" in found.stderr
    assert "Traceback" not in found.stderr


@pytest.mark.slow
def test_a_service_without_keys_says_so_and_cuts_off_a_body_without_an_end(tmp_path):
    """In chunks, whose sum nobody tells before; the connection ends when the limit is passed."""
    with serving(tmp_path / "data", RCSA_IDENT_MAX_BODY_BYTES="100000") as served:
        with socket.create_connection(("127.0.0.1", served.port), timeout=PATIENCE) as link:
            head = "POST /v1/machines HTTP/1.1\r\nHost: localhost\r\nContent-Type: application/json\r\nTransfer-Encoding: chunked\r\n\r\n"
            link.sendall(head.encode())
            sent = 0
            try:
                while sent < 50_000_000:
                    link.sendall(b"2710\r\n" + b" " * 10_000 + b"\r\n")
                    sent += 10_000
            except OSError:
                pass
            assert sent < 50_000_000
        # it goes on for others
        with Client(served.url) as client:
            assert list(client.machines()) == []
    assert any("no keys are asked for" in json.loads(line)["event"] for line in served.log.read_text().splitlines())


@pytest.mark.slow
def test_a_long_question_ends_with_its_client_and_with_the_service(tmp_path, result):
    """Both would compute for minutes."""
    with (
        serving(tmp_path / "data", RCSA_IDENT_WORK_SECONDS="3600", RCSA_IDENT_QUERY_SECONDS="7200") as served,
        Client(served.url) as client,
    ):
        id = client.make_machine("m").id
        client.identify(id, result)
        client.write_tooling("T1", by_hand.TOOLING)
        speeds = {"from_rpm": 4000.0, "to_rpm": 8000.0, "step_rpm": 10.0}
        question = {"machine": id, "toolings": ["T1"], "speeds": speeds, "method": "time-domain", "bands": False}
        answers = []

        def told(status):
            lines = (json.loads(line) for line in served.log.read_text().splitlines())
            return any(line.get("route", "").endswith("/lobes") and line["status"] == status for line in lines)

        with pytest.raises(httpx2.TimeoutException):
            httpx2.post(f"{served.url}/v1/lobes", json=question, timeout=1.0)
        until(lambda: told(400))
        # its process is free for the next
        assert client.lobes(id, "T1", recommend=False)
        asked = threading.Thread(target=lambda: answers.append(httpx2.post(f"{served.url}/v1/lobes", json=question, timeout=PATIENCE)))
        asked.start()
        until(lambda: "rcsa_ident_work_waiting 1.0" in httpx2.get(f"{served.url}/metrics").text)
        served.process.terminate()
        assert served.process.wait(PATIENCE) in (0, -15)
        asked.join()
        assert answers[0].status_code == 503
        assert answers[0].json()["detail"] == "the service is shutting down"


@pytest.mark.slow
@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["create-key", "--scopes", "root"], "--scopes"),
        (["create-key", "--group", "../x"], "--group"),
        (["create-key", "--days", "0"], "--days"),
        (["--port", "99999"], "RCSA_IDENT_PORT"),
        (["--host", "0.0.0.0"], "RCSA_IDENT_KEYS"),
    ],
)
def test_what_the_command_refuses(tmp_path, arguments, words):
    further = {"RCSA_IDENT_KEYS": "off"} if "--host" in arguments else {}
    line, environment = command(tmp_path / "data", *arguments, **further)
    found = subprocess.run(line, env=environment, capture_output=True, text=True, check=False)
    assert found.returncode == 2
    assert words in found.stderr
    assert "Traceback" not in found.stderr


#: A system on which numba finds no folder that can be written.
NOWHERE = "import numba.core.caching as c; c.CacheImpl._locator_classes = []; from api.serve import main; main()"


@pytest.mark.slow
@pytest.mark.parametrize("arguments", [(), ("worker",)])
def test_kernels_that_can_be_kept_nowhere_are_told_in_words(tmp_path, arguments):
    _, environment = command(tmp_path / "data", NUMBA_CACHE_DIR="/no/such")
    done = subprocess.run(
        [sys.executable, "-c", NOWHERE, *arguments], env=environment, capture_output=True, text=True, timeout=PATIENCE, check=False
    )
    assert done.returncode == 2
    assert (
        done.stderr == "error: NUMBA_CACHE_DIR: found /no/such, allowed is a folder that can be written, where compiled kernels are kept\n"
    )
