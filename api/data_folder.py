"""The data folder: its owner's alone, and one service's at a time."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from api.processes import held
from rcsa_ident.errors import InputError

LOCK = "service.lock"


def make(folder: Path) -> None:
    """Make a data folder where it is missing, and close it to everybody but its owner."""
    folder.mkdir(mode=0o700, parents=True, exist_ok=True)
    # somebody else's folder has the rights that he has given it
    with suppress(PermissionError):
        folder.chmod(0o700)


@contextmanager
def alone(folder: Path) -> Iterator[None]:
    """Hold a data folder as its only service; the system lets go of it however the process ends.

    Raises
    ------
    InputError
        Another service holds it.
    """
    make(folder)
    with held(folder / LOCK) as first:
        if not first:
            raise InputError("RCSA_IDENT_DATA", f"{folder}, which another service is using", "a folder of its own")
        yield
