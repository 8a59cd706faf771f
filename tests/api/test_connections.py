"""Clients that do not come to an end with what they send."""

from __future__ import annotations

import select
import socket
import threading
import time
from contextlib import contextmanager, suppress

import pytest
import uvicorn

from api import access
from api.access import TimedHeadProtocol
from api.connections import FIRST_MESSAGE, MOST_FRAGMENTS, Connections, SmallHelloProtocol, listeners, network_of
from api.main import create_app
from api.settings import Settings
from tests.api.in_process import Here, Near
from tests.fixtures.waiting import PATIENCE, until


class Hasty(TimedHeadProtocol):
    seconds, most, unread_seconds = 0.6, 20_000, 0.3


@contextmanager
def listening(app, http=Hasty, counted=None, certificate=None):
    """A server on a free port."""
    sockets = listeners("127.0.0.1", 0, counted or Connections())
    config = uvicorn.Config(app, http=http, ws=SmallHelloProtocol, log_config=None, lifespan="on")
    config.load()
    config.ssl = certificate and certificate.context
    server = uvicorn.Server(config)
    thread = threading.Thread(target=server.run, args=(sockets,))
    thread.start()
    try:
        until(lambda: server.started)
        yield sockets[0].getsockname()[1]
    finally:
        server.should_exit = True
        thread.join()


@pytest.fixture
def port(store, tmp_path, monkeypatch):
    monkeypatch.setattr(access, "BODY_SECONDS", 0.5)
    with listening(create_app(Settings(data=tmp_path), store, Here(), Here(), Near())) as found:
        yield found


def told(port, *parts, pause=0.0, seconds=PATIENCE):
    """What comes back until the connection is closed."""
    with socket.create_connection(("127.0.0.1", port), timeout=seconds) as link:
        answer = b""
        try:
            for part in parts:
                # an answer before the end is the end
                if pause and select.select([link], [], [], pause)[0]:
                    break
                link.sendall(part)
            while data := link.recv(65536):
                answer += data
        except (ConnectionResetError, BrokenPipeError):
            pass
    return answer


HEAD = b"POST /v1/machines HTTP/1.1\r\nHost: localhost\r\nContent-Type: application/json\r\n"
GET = b"GET /v1/machines HTTP/1.1\r\nHost: localhost\r\n"


@pytest.mark.slow
@pytest.mark.parametrize("body", [b"Content-Length: 12\r\n\r\n{", b"Transfer-Encoding: chunked\r\n\r\nFFFF\r\n{"])
def test_a_body_that_stops(port, body):
    answer = told(port, HEAD + body)
    assert answer.startswith(b"HTTP/1.1 408")
    assert b"application/problem+json" in answer
    assert b"the body arrives too slowly" in answer


@pytest.mark.slow
def test_a_body_that_trickles(port):
    answer = told(port, HEAD + b"Content-Length: 1000\r\n\r\n", *[b" "] * 40, pause=0.05)
    assert answer.startswith(b"HTTP/1.1 408")


@pytest.mark.parametrize("head", [b"", b"GET /v1/mach", GET, GET + b"X-A: "])
def test_a_head_that_stops(port, head):
    start = time.monotonic()
    assert told(port, head) == b""
    assert time.monotonic() - start < 0.1 * PATIENCE


@pytest.mark.slow
def test_a_second_head_that_stops(port):
    answer = told(port, GET + b"\r\n" + GET)
    assert answer.count(b"HTTP/1.1 200") == 1


def test_a_head_without_an_end(port):
    assert b"200" not in told(port, GET, *[b"X-A: " + b"a" * 5000 + b"\r\n"] * 200)


@pytest.mark.parametrize("kind", [b"Content-Length: 900000\r\n\r\n", b"Transfer-Encoding: chunked\r\n\r\ndbba0\r\n"])
def test_who_is_refused_early_is_told_and_not_cut_off(port, kind):
    """The answer comes before the body, which may be sent to its end."""
    with socket.create_connection(("127.0.0.1", port), timeout=PATIENCE) as link:
        link.sendall(b"POST /v1/machines HTTP/1.1\r\nHost: localhost\r\nContent-Type: text/plain\r\n" + kind)
        answer = link.recv(65536)
        assert answer.startswith(b"HTTP/1.1 415")
        for _ in range(90):
            link.sendall(b"x" * 10_000)
        if b"chunked" in kind:
            link.sendall(b"\r\n0\r\n\r\n")
        while data := link.recv(65536):
            answer += data
    assert b"allowed is application/json" in answer
    assert b"connection: close" in answer.lower()


def test_a_body_that_nobody_reads_is_not_read_for_ever(port):
    """Neither one without an end nor one that does not come."""
    head = b"POST /v1/machines HTTP/1.1\r\nHost: localhost\r\nContent-Type: text/plain\r\nContent-Length: 100000000000\r\n\r\n"
    assert told(port, head).startswith(b"HTTP/1.1 415")
    with socket.create_connection(("127.0.0.1", port), timeout=PATIENCE) as link:
        link.sendall(head)
        with pytest.raises(OSError, match=r"reset|pipe"):
            link.sendall(b"x" * 100_000_000)


@pytest.fixture
def few(store, tmp_path):
    """A server that takes three connections."""
    counted = Connections(3, 3)
    with listening(create_app(Settings(data=tmp_path), store, Here(), Here(), Near()), TimedHeadProtocol, counted) as found:
        yield found, counted


def test_connections_beyond_the_limit_are_closed_and_hardly_told(few, caplog):
    port, counted = few
    links = [socket.create_connection(("127.0.0.1", port), timeout=PATIENCE) for _ in range(3)]
    until(lambda: counted.open.total() == 3)
    for _ in range(20):
        assert told(port, GET + b"\r\n") == b""
    assert sum("too many connections" in each.message for each in caplog.records) == 1
    links.pop().close()
    until(lambda: counted.open.total() == 2)
    assert told(port, GET + b"Connection: close\r\n\r\n").startswith(b"HTTP/1.1 200")
    for each in links:
        each.close()
    until(lambda: not counted.open)


def test_an_address_has_a_share_of_all_connections():
    counted = Connections(5, 2)
    assert [counted.admit(each) for each in "aaabbbccc"] == [True, True, False, True, True, False, True, False, False]


def test_a_client_has_a_whole_network_of_ipv6():
    same = ("2001:db8::1", "2001:db8::2:3", "2001:db8:0:0:ffff::1%eth0")
    assert {network_of(each) for each in same} == {"2001:db8::/64"}
    assert network_of("2001:db8:0:1::1") != network_of("2001:db8::1")
    assert [network_of(each) for each in ("10.0.0.1", "::ffff:10.0.0.1", "nobody")] == ["10.0.0.1", "10.0.0.1", "nobody"]


def test_a_websocket_without_a_small_first_message_is_closed(few):
    """By its announced length, before it has come."""
    from websockets.exceptions import ConnectionClosedError
    from websockets.sync.client import connect

    port, counted = few
    with connect(f"ws://127.0.0.1:{port}/v1/forces/stream", compression=None) as link:
        with suppress(ConnectionClosedError):
            link.send("x" * (FIRST_MESSAGE + 1))
        with pytest.raises(ConnectionClosedError) as error:
            link.recv(PATIENCE)
    assert error.value.rcvd.code == 1009
    until(lambda: not counted.open)


def test_a_websocket_with_very_many_fragments_is_closed(few):
    """By their number: hardly a byte is in them."""
    from websockets.exceptions import ConnectionClosedError
    from websockets.sync.client import connect

    port, counted = few
    address = f"ws://127.0.0.1:{port}/v1/forces/stream"
    with connect(address, compression=None) as link:
        link.send(["{", *[""] * (MOST_FRAGMENTS - 10), "}"])
        assert "problem" in link.recv(PATIENCE)
    with connect(address, compression=None) as link:
        with suppress(ConnectionClosedError):
            link.send([" "] * (MOST_FRAGMENTS + 10))
        with pytest.raises(ConnectionClosedError, match=f"more than {MOST_FRAGMENTS} fragments"):
            link.recv(PATIENCE)
    until(lambda: not counted.open)


async def lasting(receive, send):
    """The lifespan of an application that has nothing to do in it."""
    for kind in ("startup", "shutdown"):
        await receive()
        await send({"type": f"lifespan.{kind}.complete"})


def answering(answer):
    """A WebSocket application that answers each text."""

    async def app(scope, receive, send):
        if scope["type"] == "lifespan":
            await lasting(receive, send)
            return
        await receive()
        await send({"type": "websocket.accept"})
        while (message := await receive())["type"] == "websocket.receive":
            await send({"type": "websocket.send", "text": answer(message["text"])})

    return app


@pytest.mark.slow
def test_a_later_message_may_be_large():
    from websockets.sync.client import connect

    count = answering(lambda text: str(len(text)))
    with listening(count) as port, connect(f"ws://127.0.0.1:{port}/", compression=None) as link:
        for size in (10, 5 * FIRST_MESSAGE):
            link.send("x" * size)
        assert [link.recv(PATIENCE), link.recv(PATIENCE)] == ["10", str(5 * FIRST_MESSAGE)]


def test_requests_behind_each_other_are_all_answered(port):
    """Also where the first part of the next comes with the last of the one before."""
    text = GET + b"\r\n"
    stream = text * 60 + GET + b"Connection: close\r\n\r\n"
    parts = [stream[i : i + 700] for i in range(0, len(stream), 700)]
    assert told(port, *parts).count(b"HTTP/1.1 200") == 61


@pytest.mark.slow
def test_an_answer_may_take_longer_than_a_head():
    async def slow(scope, receive, send):
        import asyncio

        if scope["type"] == "lifespan":
            await lasting(receive, send)
            return
        await asyncio.sleep(1.2)
        await send({"type": "http.response.start", "status": 200, "headers": [(b"content-length", b"2")]})
        await send({"type": "http.response.body", "body": b"ok"})

    with listening(slow) as port:
        assert told(port, GET + b"Connection: close\r\n\r\n").endswith(b"ok")


@pytest.mark.slow
def test_a_websocket_stays_open():
    from websockets.sync.client import connect

    with listening(answering(str)) as port, connect(f"ws://127.0.0.1:{port}/") as link:
        for word in ("a", "b"):
            time.sleep(1.0)
            link.send(word)
            assert link.recv() == word


def large(parts):
    """An application that answers 20 MB in so many parts."""

    async def app(scope, receive, send):
        if scope["type"] == "lifespan":
            await lasting(receive, send)
            return
        await send({"type": "http.response.start", "status": 200, "headers": [(b"content-length", b"20000000")]})
        for k in range(parts):
            await send({"type": "http.response.body", "body": bytes(20_000_000 // parts), "more_body": k < parts - 1})

    return app


@pytest.mark.parametrize("parts", [1, 40], ids=["whole", "in parts"])
def test_an_answer_that_is_read_byte_by_byte_is_given_up(parts, monkeypatch):
    """And its memory with it."""
    monkeypatch.setattr(access, "BYTE_SECONDS", 1e-9)
    counted = Connections()
    with listening(large(parts), counted=counted) as port, socket.socket() as link:
        # else the kernel takes what nobody has read
        link.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
        link.connect(("127.0.0.1", port))
        link.sendall(GET + b"\r\n")
        until(lambda: counted.open.total())
        with suppress(ConnectionResetError):
            until(lambda: link.recv(1) and not counted.open.total())
        until(lambda: not counted.open.total())


def test_an_answer_that_was_read_is_not_given_up_later():
    made = []

    class Kept(TimedHeadProtocol):
        def connection_made(self, transport):
            super().connection_made(transport)
            made.append(self)

    with listening(large(1), Kept) as port, socket.create_connection(("127.0.0.1", port)) as link:
        link.sendall(GET + b"Connection: close\r\n\r\n")
        until(lambda: made and made[0].unread)
        assert sum(iter(lambda: len(link.recv(1_000_000)), 0)) > 20_000_000
    assert made[0].unread.cancelled()
