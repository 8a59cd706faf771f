"""Connections of the service: so many at once, so many of an address, and WebSockets whose first message is small."""

from __future__ import annotations

import logging
import time
from collections import Counter
from typing import Any

from uvicorn.protocols.websockets.websockets_sansio_impl import WebSocketsSansIOProtocol
from websockets.frames import Frame

log = logging.getLogger("rcsa_ident.service")
#: Size of a first message, after which the client is known [bytes], and interval between two lines about refused connections [s].
FIRST_MESSAGE, TELL = 600_000, 60.0


class Connections:
    """Count of open connections.

    Parameters
    ----------
    most, most_per_address : int
        A further one is closed at once.
    """

    def __init__(self, most: int = 800, most_per_address: int = 400) -> None:
        self.most, self.most_per_address = most, most_per_address
        self.open: dict[Any, str] = {}
        self.of_address: Counter[str] = Counter()
        self.refused, self.told = 0, -TELL

    def admit(self, transport: Any) -> bool:
        """Count a new connection, or return that there are too many."""
        peer = transport.get_extra_info("peername")
        address = str(peer[0]) if isinstance(peer, tuple) else ""
        if len(self.open) >= self.most or self.of_address[address] >= self.most_per_address:
            self._tell(address)
            return False
        self.open[transport] = address
        self.of_address[address] += 1
        return True

    def release(self, transport: Any) -> None:
        """Forget a connection that has ended; one that was not admitted has not been counted."""
        address = self.open.pop(transport, None)
        if address is not None:
            self.of_address[address] -= 1
            if not self.of_address[address]:
                del self.of_address[address]

    def _tell(self, address: str) -> None:
        """One line in a while: refusals are many where they come at all."""
        self.refused += 1
        now = time.monotonic()
        if now - self.told >= TELL:
            fields = {"refused": self.refused, "open": len(self.open), "address": address}
            log.warning("too many connections", extra={"fields": fields})
            self.told, self.refused = now, 0


class SmallHelloProtocol(WebSocketsSansIOProtocol):
    """WebSocket whose first message is small: before it nobody knows who sends it."""

    counted = Connections()

    def __init__(self, *arguments: Any, **further: Any) -> None:
        super().__init__(*arguments, **further)
        self.conn.max_message_size, take = FIRST_MESSAGE, self.conn.recv_frame

        def first(frame: Frame) -> None:
            take(frame)
            if frame.fin and frame.opcode in (0, 1, 2):
                # the end of a message; the rest of what has come with it is already read within the wider limit
                self.conn.max_message_size = self.config.ws_max_size
                self.conn.recv_frame = take  # type: ignore[method-assign]

        self.conn.recv_frame = first  # type: ignore[method-assign]

    def connection_lost(self, exc: Exception | None) -> None:
        self.counted.release(self.transport)
        super().connection_lost(exc)
