"""TLS: certificate and key from files, read again when they are renewed."""

from __future__ import annotations

import logging
import ssl
import time
from pathlib import Path

from rcsa_ident.base.errors import InputError

log = logging.getLogger("rcsa_ident.service")
#: Interval between two looks at the files [s].
LOOK = 10.0


class Certificate:
    """Certificate of the service; connections that begin after its files have changed get the new one.

    `certificate`, `key`: PEM files: the chain, the service's own first, and its private key without a passphrase
    `look` [s]: interval between two looks at the files
    Raises `InputError`: the files are no certificate and its key.
    """

    def __init__(self, certificate: Path, key: Path, look: float = LOOK) -> None:
        self.files, self.look = (certificate, key), look
        self.seen, self.looked = self._state(), time.monotonic()
        self.current = self._read()
        #: For the server: every handshake of it takes the current one.
        self.context = self.current
        self.context.sni_callback = self._choose

    def _choose(self, link: ssl.SSLSocket | ssl.SSLObject, _name: str | None, _context: ssl.SSLContext) -> None:
        self._renew()
        link.context = self.current

    def _renew(self) -> None:
        """Read the files again where they have changed; what cannot be read leaves the certificate before in use."""
        if time.monotonic() - self.looked < self.look:
            return
        self.looked = time.monotonic()
        state = self._state()
        if state == self.seen:
            return
        self.seen = state
        try:
            self.current = self._read()
        except InputError as error:
            # perhaps only one of the files is there already: the next look sees the other
            log.warning("the renewed certificate cannot be used", extra={"fields": {"error": str(error)}})
        else:
            log.info("certificate renewed", extra={"fields": {"file": str(self.files[0])}})

    def _state(self) -> tuple[tuple[int, int], ...]:
        found = []
        for path in self.files:
            try:
                there = path.stat()
                found.append((there.st_mtime_ns, there.st_ino))
            except OSError:
                found.append((0, 0))
        return tuple(found)

    def _read(self) -> ssl.SSLContext:
        context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
        context.minimum_version = ssl.TLSVersion.TLSv1_2
        certificate, key = self.files

        def passphrase() -> str:
            raise InputError("RCSA_IDENT_TLS_KEY", f"{key}, which asks for a passphrase", "a private key without one")

        try:
            context.load_cert_chain(certificate, key, passphrase)
        except FileNotFoundError:
            missing, name = (certificate, "CERTIFICATE") if not certificate.exists() else (key, "KEY")
            raise InputError(f"RCSA_IDENT_TLS_{name}", f"{missing}, which is not there", "a PEM file") from None
        except OSError as error:
            found = f"{certificate} and {key} ({error.strerror or error})"
            raise InputError("RCSA_IDENT_TLS_CERTIFICATE, RCSA_IDENT_TLS_KEY", found, "a certificate and its private key, PEM") from None
        return context
