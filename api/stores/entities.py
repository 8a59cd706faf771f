"""Entities of the store and the protocols of its parts; nothing else of it is visible to routes.

Whatever adds to what a group keeps raises `NoRoom` where that is more than it may keep.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Sequence
from dataclasses import dataclass, field
from datetime import datetime
from typing import Any, Protocol

from api.stores.campaigns import Campaigns, Recordings
from api.stores.changes import UNSIGNED, Changes, Note
from api.stores.jobs import Jobs

#: Expected digest of a document that must not exist yet.
ABSENT = "*absent"


class Stale(Exception):
    """The stored document is not the one that the writer expected."""


class Taken(Exception):
    """The name, or the idempotency key with other content, is already in use."""


class Unavailable(Exception):
    """The database does not answer."""


class Destroyed(Unavailable):
    """The database is there, but its file or its pages are damaged."""


class NoRoom(Exception):
    """A group's rows would take more of the database than they may: bytes that they take, and that they may take."""

    def __init__(self, used: int, allowed: int) -> None:
        super().__init__(used, allowed)
        self.used, self.allowed = used, allowed


class Damaged(Exception):
    """What is read is not what was written; its text is a sentence that says how to mend it."""


@dataclass(frozen=True, slots=True)
class Key:
    """An API key; only the hash of its secret is stored.

    `created`: UTC, ISO 8601
    `expires`: from when on it opens nothing
    `used`: when it was last used, to the minute
    """

    id: str
    group: str
    label: str
    scopes: tuple[str, ...]
    secret_hash: str
    created: str
    expires: str | None = None
    used: str | None = None


@dataclass(frozen=True, slots=True)
class Machine:
    """A machine of a group."""

    id: str
    group: str
    name: str
    description: str
    created: str


@dataclass(frozen=True, slots=True)
class Document:
    """A named text: a tooling, a robot, or the identification of a machine.

    `name`: of the tooling or the robot, or id of the machine
    `summary`: content of list entries, JSON
    `digest`: of the text: its entity tag
    `summary_digest`: as it was stored; of a new document that of its summary
    """

    group: str
    name: str
    text: str
    summary: str
    digest: str
    changed: str
    summary_digest: str = field(default="", compare=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "summary_digest", self.summary_digest or digest_of(self.summary))


def digest_of(text: str) -> str:
    """Return the digest of a text."""
    return hashlib.sha256(text.encode("utf-8")).hexdigest()[:32]


def whole(text: str, digest: str, what: str, mend: str) -> str:
    """Return a text that has its digest.

    `what`, `mend`: what the text is, and what makes it whole again, for people
    Raises `Damaged`: it has another one.
    """
    if digest_of(text) != digest:
        raise Damaged(f"the stored {what} is damaged: its content is not what was stored; {mend}")
    return text


def summary_of(document: Document) -> dict[str, Any]:
    """Return the summary of a tooling, a robot or an identification; raises `Damaged` where it is not what was stored."""
    what = f"summary of {document.name}"
    return dict(json.loads(whole(document.summary, document.summary_digest, what, "write the same tooling, robot or identification again")))


class Keys(Protocol):
    """Keys of all groups."""

    def add(self, key: Key) -> None:
        """Store a key."""

    def get(self, id: str) -> Key | None:
        """Return a key of any group."""

    def use(self, id: str, when: str) -> None:
        """Write down when a key was last used."""

    def list(self, group: str, after: str, limit: int) -> list[Key]:
        """Return keys of a group after an id, in the order of ids."""

    def delete(self, group: str, id: str) -> bool:
        """Delete a key and return whether there was one."""


class Machines(Protocol):
    """Machines of all groups."""

    def add(self, machine: Machine, repeat: tuple[str, str] | None = None, note: Note = UNSIGNED) -> Machine:
        """Store a machine and return it; for a repeated idempotency key with the same digest, return the first one.

        Raises
        ------
        Taken
            The group has a machine of that name, or the idempotency key was used with other content.
        """

    def get(self, group: str, id: str) -> Machine | None:
        """Return a machine."""

    def list(self, group: str, after: str, limit: int) -> list[Machine]:
        """Return machines of a group after an id, in the order of ids."""

    def delete(self, group: str, id: str, note: Note = UNSIGNED) -> bool:
        """Delete a machine with its identification, campaigns and jobs, and return whether there was one."""


class Documents(Protocol):
    """Named texts of all groups; every other content is a version of its own in `Changes`."""

    def put(self, document: Document, expected: str | None = None, note: Note = UNSIGNED) -> bool:
        """Store a text, replacing an existing one, and return whether it is new.

        Raises
        ------
        Stale
            The stored text does not have the expected digest; `ABSENT` expects none.
        """

    def get(self, group: str, name: str) -> Document | None:
        """Return a text; raises `Damaged` where it is not what was written."""

    def brief(self, group: str, name: str) -> Document | None:
        """Return a document without its text."""

    def list(self, group: str, after: str, limit: int) -> list[Document]:
        """Return the documents after a name without their texts, in the order of names."""

    def delete(self, group: str, name: str, expected: str | None = None, note: Note = UNSIGNED) -> bool:
        """Delete a text and return whether there was one; raises `Stale` as `put` does."""


#: A text to store, and the digest of the one that is expected to be there, as in `Documents.put`.
Expected = tuple[Document, str | None]


class Store(Protocol):
    """The store as a whole."""

    keys: Keys
    machines: Machines
    identifications: Documents
    toolings: Documents
    robots: Documents
    changes: Changes
    campaigns: Campaigns
    recordings: Recordings
    jobs: Jobs
    group_bytes: int

    def put_together(self, toolings: Sequence[Expected], identification: Expected | None, note: Note = UNSIGNED) -> None:
        """Store toolings and the identification of a machine, all of them or nothing.

        Raises
        ------
        Stale
            As `Documents.put`, of any of them.
        """

    def usage(self, group: str) -> dict[str, int]:
        """Return what the rows of a group take, by kind [bytes]."""

    def forget_repeats(self, now: datetime) -> None:
        """Forget idempotency keys that are older than a day."""

    def check(self) -> None:
        """Raise `Unavailable` unless the database answers."""

    def close(self) -> None:
        """Close the connections."""
