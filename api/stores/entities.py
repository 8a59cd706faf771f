"""What is kept, and how a store is asked for it; routes see nothing else of it."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from typing import Protocol

from api.stores.campaigns import Campaigns, Recordings
from api.stores.jobs import Jobs

#: A digest that stands for "nothing must be there yet".
ABSENT = "*absent"


class Stale(Exception):
    """What is there is not what the writer had seen."""


class Taken(Exception):
    """The name, or the idempotency key with another content, is in use."""


class Unavailable(Exception):
    """The store does not answer now."""


@dataclass(frozen=True, slots=True)
class Key:
    """A key to the service; of its secret only the hash is kept.

    Parameters
    ----------
    id, group, label : str
    scopes : tuple of str
    secret_hash : str
    created : str
        UTC, ISO 8601.
    """

    id: str
    group: str
    label: str
    scopes: tuple[str, ...]
    secret_hash: str
    created: str


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
    """A text that somebody wrote under a name: a tooling, or the identification of a machine.

    Parameters
    ----------
    name : str
        Of the tooling; of the machine where it is an identification.
    text : str
    summary : str
        What lists tell of it, JSON.
    digest : str
        Of the text: its entity tag.
    changed : str
    """

    group: str
    name: str
    text: str
    summary: str
    digest: str
    changed: str


def digest_of(text: str) -> str:
    """Return what tells one text from another."""
    return hashlib.sha256(text.encode("utf-8")).hexdigest()[:32]


class Keys(Protocol):
    """Keys of all groups."""

    def add(self, key: Key) -> None:
        """Keep a key."""

    def get(self, id: str) -> Key | None:
        """Return a key whatever its group is: with it the group becomes known."""

    def list(self, group: str, after: str, limit: int) -> list[Key]:
        """Return keys of a group behind an id, in the order of ids."""

    def delete(self, group: str, id: str) -> bool:
        """Return whether there was one."""


class Machines(Protocol):
    """Machines of all groups."""

    def add(self, machine: Machine, repeat: tuple[str, str] | None = None) -> Machine:
        """Keep a machine and return it; the same again for an idempotency key that was there, with the same digest.

        Raises
        ------
        Taken
            The group has one of that name, or the idempotency key came with another content.
        """

    def get(self, group: str, id: str) -> Machine | None:
        """Return a machine."""

    def list(self, group: str, after: str, limit: int) -> list[Machine]:
        """Return machines of a group behind an id, in the order of ids."""

    def delete(self, group: str, id: str) -> bool:
        """Return whether there was one; its identification, campaigns and jobs go with it."""


class Documents(Protocol):
    """Named texts of all groups."""

    def put(self, document: Document, expected: str | None = None) -> bool:
        """Keep a text in the place of what is there, and return whether nothing was.

        Raises
        ------
        Stale
            What is there has not the expected digest; `ABSENT` expects nothing.
        """

    def get(self, group: str, name: str) -> Document | None:
        """Return a text."""

    def brief(self, group: str, name: str) -> Document | None:
        """Return everything but the text."""

    def list(self, group: str, after: str, limit: int) -> list[Document]:
        """Return everything but the texts behind a name, in the order of names."""

    def delete(self, group: str, name: str, expected: str | None = None) -> bool:
        """Return whether there was one; raises `Stale` as `put` does."""


class Store(Protocol):
    """Everything that is kept."""

    keys: Keys
    machines: Machines
    identifications: Documents
    toolings: Documents
    campaigns: Campaigns
    recordings: Recordings
    jobs: Jobs

    def check(self) -> None:
        """Raise `Unavailable` unless the store answers."""

    def close(self) -> None:
        """Let go of it."""
