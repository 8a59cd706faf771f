"""Connections of the service: so many at once, so many of an address, and WebSockets whose first message is small."""

from __future__ import annotations

import ipaddress
import logging
import socket
import time
from collections import Counter
from contextlib import ExitStack
from typing import Any

from uvicorn.protocols.websockets.websockets_sansio_impl import WebSocketsSansIOProtocol
from websockets.exceptions import ProtocolError
from websockets.frames import Frame

log = logging.getLogger("rcsa_ident.service")
#: Size of a first message, after which the client is known [bytes], and interval between two lines about refused connections [s].
FIRST_MESSAGE, TELL = 600_000, 60.0
#: Fragments of a message: browsers send one of 16 MB in a few hundred.
MOST_FRAGMENTS = 1000


def network_of(address: str) -> str:
    """Return what one client has of addresses: of IPv6 a whole network of 64 bits, of IPv4 the address."""
    try:
        found = ipaddress.ip_address(address.partition("%")[0])
    except ValueError:
        return address
    if found.version == 4:
        return address
    return str(found.ipv4_mapped or ipaddress.ip_network((found, 64), strict=False))


class Connections:
    """Count of open connections. `most`, `most_per_address`: a further one is closed at once."""

    def __init__(self, most: int = 800, most_per_address: int = 400) -> None:
        self.most, self.most_per_address = most, most_per_address
        self.open: Counter[str] = Counter()
        self.refused, self.told = 0, -TELL

    def admit(self, address: str) -> bool:
        """Count a new connection, or return that there are too many."""
        if self.open.total() >= self.most or self.open[address] >= self.most_per_address:
            self._tell(address)
            return False
        self.open[address] += 1
        return True

    def release(self, address: str) -> None:
        """Forget a connection that has ended."""
        self.open[address] -= 1
        if not self.open[address]:
            del self.open[address]

    def _tell(self, address: str) -> None:
        """One line in a while: refusals are many where they come at all."""
        self.refused += 1
        now = time.monotonic()
        if now - self.told >= TELL:
            fields = {"refused": self.refused, "open": self.open.total(), "address": address}
            log.warning("too many connections", extra={"fields": fields})
            self.told, self.refused = now, 0


class Listener(socket.socket):
    """Listening socket whose connections are counted from their first moment on, before a TLS handshake or a byte of a request."""

    counted: Connections

    def accept(self) -> tuple[socket.socket, Any]:
        link, peer = super().accept()
        address = network_of(str(peer[0]))
        if not self.counted.admit(address):
            link.close()
            # for the server as if the client had left between
            raise ConnectionAbortedError
        found = _Link(link.family, link.type, link.proto, link.detach())
        found.counted, found.address = self.counted, address
        return found, peer


class _Link(socket.socket):
    """A connection that is counted until it is closed."""

    counted: Connections | None = None
    address = ""

    def close(self) -> None:
        counted, self.counted = self.counted, None
        if counted is not None:
            counted.release(self.address)
        super().close()


def listeners(host: str, port: int, counted: Connections) -> list[socket.socket]:
    """Return bound sockets of all addresses of a host; raises OSError where one is taken or not of this machine."""
    with ExitStack() as stack:
        found: list[socket.socket] = []
        for family, kind, protocol, _, address in socket.getaddrinfo(host, port, type=socket.SOCK_STREAM, flags=socket.AI_PASSIVE):
            each = stack.enter_context(Listener(family, kind, protocol))
            each.counted = counted
            each.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            if family == socket.AF_INET6:
                each.setsockopt(socket.IPPROTO_IPV6, socket.IPV6_V6ONLY, 1)
            each.bind(address)
            found.append(each)
        stack.pop_all()
        return found


class SmallHelloProtocol(WebSocketsSansIOProtocol):
    """WebSocket whose first message is small: before it nobody knows who sends it. No message comes in very many fragments."""

    def __init__(self, *arguments: Any, **further: Any) -> None:
        super().__init__(*arguments, **further)
        self.conn.max_message_size, take = FIRST_MESSAGE, self.conn.recv_frame
        fragments = 0

        def counted(frame: Frame) -> None:
            nonlocal fragments
            take(frame)
            if frame.opcode not in (0, 1, 2):
                return
            fragments = 0 if frame.fin else fragments + 1
            if fragments > MOST_FRAGMENTS:
                # each takes memory of its own, however few bytes it brings
                raise ProtocolError(f"a message of more than {MOST_FRAGMENTS} fragments")
            if frame.fin:
                # the end of a message; the rest of what has come with it is already read within the wider limit
                self.conn.max_message_size = self.config.ws_max_size

        self.conn.recv_frame = counted  # type: ignore[method-assign]
