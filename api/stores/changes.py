"""The audit trail: who wrote which tooling, robot, machine or identification, when and why, with the text of every version."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

#: Kinds of what changes.
TOOLING, ROBOT, MACHINE, IDENTIFICATION = "tooling", "robot", "machine", "identification"
KINDS = (TOOLING, ROBOT, MACHINE, IDENTIFICATION)
#: What happens to it.
MADE, CHANGED, RESTORED, DELETED = "made", "changed", "restored", "deleted"
ACTIONS = (MADE, CHANGED, RESTORED, DELETED)


@dataclass(frozen=True, slots=True)
class Note:
    """What a writer leaves with a change.

    `key`: id of the API key
    `who`: its name
    `restores`: the version that is written again; 0 where the content is new
    """

    key: str = ""
    who: str = ""
    why: str = ""
    restores: int = 0


#: Of a change that nobody asked for by a request.
UNSIGNED = Note()


@dataclass(frozen=True, slots=True)
class Change:
    """An entry of the trail.

    `id`: increases over all entries
    `kind`, `name`: one of `KINDS`; name of the tooling or the robot, or id of the machine
    `title`: as people call it, then: a machine's name stays readable when it is gone
    `version`: counts the changes of one thing from 1
    `action`: one of `ACTIONS`
    `created`: UTC, ISO 8601
    `text`, `summary`, `digest`, `summary_digest`: of the version, as in `Document`; empty where there is none
    `holds`: whether this content is what is there now
    """

    id: int
    group: str
    kind: str
    name: str
    title: str
    version: int
    action: str
    restores: int
    created: str
    key: str
    who: str
    why: str
    text: str
    summary: str
    digest: str
    summary_digest: str
    holds: bool


class Changes(Protocol):
    """The trail of all groups; it is written by the changes themselves."""

    def list(self, group: str, before: int | None, limit: int, kind: str | None = None, name: str | None = None) -> list[Change]:
        """Return entries before an id without their texts, newest first."""

    def get(self, group: str, kind: str, name: str, version: int) -> Change | None:
        """Return an entry."""

    def forget(self, before: str) -> int:
        """Remove entries of all groups from before a time, except the newest of each thing, and return how many."""
