"""TLS: spoken by the service itself, renewed while it runs, and counted before the handshake."""

from __future__ import annotations

import shutil
import socket
import ssl

import httpx2
import pytest

from api.access import TimedHeadProtocol
from api.connections import Connections
from api.main import create_app
from api.settings import Settings
from api.tls import Certificate
from rcsa_ident.base.errors import InputError
from tests.api.in_process import Here, Near
from tests.api.test_connections import listening
from tests.fixtures.certificates import self_made
from tests.fixtures.service import serving
from tests.fixtures.waiting import PATIENCE, until


@pytest.fixture(scope="module")
def pairs(tmp_path_factory):
    """Two certificates with their keys."""
    folder = tmp_path_factory.mktemp("certificates")
    return [self_made(folder / name) for name in ("first", "second")]


@pytest.fixture
def pair(pairs, tmp_path):
    """A certificate and its key, to be renewed."""
    return tuple(shutil.copy(each, tmp_path) and tmp_path / each.name for each in pairs[0])


def shown(port):
    """The certificate that a client is shown."""
    return ssl.get_server_certificate(("127.0.0.1", port), timeout=PATIENCE)


def app(store, folder):
    return create_app(Settings(data=folder), store, Here(), Here(), Near())


def test_answers_over_tls_ask_for_it_from_then_on(store, tmp_path, pair):
    trusted = ssl.create_default_context(cafile=str(pair[0]))
    with listening(app(store, tmp_path), TimedHeadProtocol, certificate=Certificate(*pair)) as port:
        with httpx2.Client(base_url=f"https://127.0.0.1:{port}", verify=trusted) as http:
            answer = http.get("/v1/machines")
            assert answer.status_code == 200
            assert answer.headers["strict-transport-security"] == "max-age=31536000"
            assert http.get("/").headers["permissions-policy"] == "camera=(), microphone=(self), geolocation=()"
        with pytest.raises(httpx2.RemoteProtocolError):
            httpx2.get(f"http://127.0.0.1:{port}/health")
        old = ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT)
        old.check_hostname, old.verify_mode = False, ssl.CERT_NONE
        with pytest.warns(DeprecationWarning, match="TLSv1_1"):
            old.maximum_version = ssl.TLSVersion.TLSv1_1
        with socket.create_connection(("127.0.0.1", port), timeout=PATIENCE) as link, pytest.raises(OSError):
            old.wrap_socket(link)


def test_plain_answers_do_not(http):
    assert "strict-transport-security" not in http.get("/v1/machines").headers


def test_a_renewed_certificate_is_shown_without_a_restart(store, tmp_path, pair, pairs, caplog):
    found = Certificate(*pair, look=0.0)
    with listening(app(store, tmp_path), TimedHeadProtocol, certificate=found) as port:
        before = shown(port)
        assert before == pairs[0][0].read_text()
        shutil.copy(pairs[1][0], pair[0])
        # the key of the other one still
        assert shown(port) == before
        assert sum("cannot be used" in each.message for each in caplog.records) == 1
        shutil.copy(pairs[1][1], pair[1])
        assert shown(port) == pairs[1][0].read_text()
        for path in pair:
            path.unlink()
        assert shown(port) == pairs[1][0].read_text()


def test_files_that_are_no_pair_are_named(pairs, tmp_path):
    (certificate, key), (_, other) = pairs
    absent, empty = tmp_path / "none.pem", tmp_path / "empty.pem"
    empty.write_text("")
    for files, words in (
        ((absent, key), "RCSA_IDENT_TLS_CERTIFICATE: found .*none.pem, which is not there"),
        ((certificate, absent), "RCSA_IDENT_TLS_KEY: found .*none.pem, which is not there"),
        ((certificate, other), "RCSA_IDENT_TLS_CERTIFICATE, RCSA_IDENT_TLS_KEY: found"),
        ((empty, key), "RCSA_IDENT_TLS_CERTIFICATE, RCSA_IDENT_TLS_KEY: found"),
    ):
        with pytest.raises(InputError, match=words):
            Certificate(*files)


def test_connections_without_a_handshake_are_counted(store, tmp_path, pair):
    counted = Connections(3, 3)
    with listening(app(store, tmp_path), TimedHeadProtocol, counted, certificate=Certificate(*pair)) as port:
        links = [socket.create_connection(("127.0.0.1", port), timeout=PATIENCE) for _ in range(3)]
        until(lambda: counted.open.total() == 3)
        with socket.create_connection(("127.0.0.1", port), timeout=PATIENCE) as link:
            assert link.recv(1) == b""
        for each in links:
            each.close()
        until(lambda: not counted.open)
        assert shown(port)


@pytest.mark.slow
def test_the_command_speaks_tls_and_believes_its_proxy_alone(tmp_path, pair):
    certificate, key = map(str, pair)
    settings = {"RCSA_IDENT_TLS_CERTIFICATE": certificate, "RCSA_IDENT_TLS_KEY": key}
    with serving(tmp_path / "data", **settings) as served:
        assert served.url.startswith("https://")
        assert "strict-transport-security" in served.get("/ready").headers
    assert f"https://127.0.0.1:{served.port}" in served.log.read_text()
    for believed in ("", "127.0.0.1"):
        with serving(tmp_path / f"data{believed}", RCSA_IDENT_PROXIES=believed) as served:
            answer = served.get("/health", headers={"X-Forwarded-Proto": "https"})
            assert ("strict-transport-security" in answer.headers) == bool(believed)
