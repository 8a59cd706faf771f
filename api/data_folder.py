"""The data folder: its owner's alone, one service's at a time, and never begun anew over what is left of a store."""

from __future__ import annotations

import sqlite3
from collections.abc import Iterator
from contextlib import closing, contextmanager, suppress
from pathlib import Path

from api.processes import held
from rcsa_ident.base.errors import InputError

LOCK = "service.lock"
#: The embedded databases: the store, and the steps of jobs.
STORE, ENGINE = "service.db", "jobs.db"


def make(folder: Path) -> None:
    """Make a data folder where it is missing, and close it to everybody but its owner."""
    folder.mkdir(mode=0o700, parents=True, exist_ok=True)
    # somebody else's folder has the rights that he has given it
    with suppress(PermissionError):
        folder.chmod(0o700)


def check(folder: Path) -> None:
    """Refuse a folder whose databases are damaged, and one that has lost its store: a new one would forget what is left.

    Raises `InputError`.
    """
    mend = f"a whole store in {folder}: restore a backup into a new folder (rcsa-ident-serve restore)"
    lost = not (folder / STORE).is_file() or (folder / STORE).stat().st_size == 0
    if lost and ((folder / ENGINE).exists() or any(folder.glob("files/*/uploads/*"))):
        raise InputError("RCSA_IDENT_DATA", f"recordings or jobs, but {STORE} is missing or empty", mend)
    for name, further in ((STORE, ""), (ENGINE, f", or remove {ENGINE}: jobs that are open start over")):
        path = folder / name
        if not path.is_file() or path.stat().st_size == 0:
            continue
        try:
            with closing(sqlite3.connect(f"{path.absolute().as_uri()}?mode=rw", uri=True)) as database:
                ((state,),) = database.execute("PRAGMA quick_check(1)").fetchall()
        except sqlite3.OperationalError:
            # locked, or of somebody else: whoever opens it says so
            continue
        except sqlite3.DatabaseError as error:
            state = str(error)
        if state != "ok":
            raise InputError("RCSA_IDENT_DATA", f"{name}, which is damaged ({state.splitlines()[-1][:200]})", mend + further)


@contextmanager
def alone(folder: Path) -> Iterator[None]:
    """Hold a data folder as its only service; the system lets go of it however the process ends.

    Raises `InputError`: another service holds it.
    """
    make(folder)
    with held(folder / LOCK) as first:
        if not first:
            raise InputError("RCSA_IDENT_DATA", f"{folder}, which another service is using", "a folder of its own")
        yield
