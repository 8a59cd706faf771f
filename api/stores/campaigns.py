"""Campaigns and their recordings: entities, and protocols of their stores."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import Protocol


@dataclass(frozen=True, slots=True)
class Campaign:
    """A declared campaign of a machine.

    `text`: the keys of campaign.toml as JSON: toolings by their texts, recordings by the last part of their paths
    `cuts`: number of declared cuts
    `created`: UTC, ISO 8601
    """

    id: str
    group: str
    machine: str
    name: str
    text: str
    cuts: int
    created: str


@dataclass(frozen=True, slots=True)
class Recording:
    """An uploaded file and what was found in it.

    `group`, `campaign`, `name`: `name` is that of the campaign's declaration
    `role`: cut, air or hammer
    `size` [bytes]
    `sha256`: of the untouched upload, hexadecimal
    `normalised`: names the samples that were read from it
    `found`: JSON: rate, duration, channels, speed, harmonics, verdict; of hammer tests their lines
    `judged_with`: `normalised` of the air cut that the verdict on a cut rests on, empty without one
    `samples`: SHA-256 of the samples' file, hexadecimal; empty where a release has stored them that did not keep it
    `digest`: of `found`, as it was stored
    """

    group: str
    campaign: str
    name: str
    role: str
    size: int
    sha256: str
    normalised: str
    found: str
    judged_with: str
    created: str
    samples: str = ""
    digest: str = field(default="", compare=False)


@dataclass(frozen=True, slots=True)
class Counts:
    """Uploads of a campaign: numbers of cuts with a recording, of those that are usable, of air cuts, and of hammer tests' files."""

    uploaded: int
    usable: int
    air: int = 0
    hammer: int = 0


#: Kind of a file (upload or samples) and its key.
FileKey = tuple[str, str]


class Campaigns(Protocol):
    """Campaigns of all groups."""

    def add(self, campaign: Campaign, repeat: tuple[str, str] | None = None) -> Campaign:
        """Store a campaign and return it; for a repeated idempotency key with the same digest, return the first one.

        Raises
        ------
        Taken
            The idempotency key was used with other content.
        KeyError
            The machine is not there.
        """

    def get(self, group: str, id: str, anyhow: bool = False) -> Campaign | None:
        """Return a campaign; raises `Damaged` where its text is not what was written, unless it is wanted `anyhow`."""

    def unsettled(self) -> list[tuple[str, str]]:
        """Return group and id of campaigns whose verdicts may be older than their recordings."""

    def list(self, group: str, machine: str, after: str, limit: int) -> list[Campaign]:
        """Return campaigns of a machine after an id, in the order of ids."""

    def counts(self, group: str, ids: Sequence[str]) -> dict[str, Counts]:
        """Return the counts of campaigns that have uploads."""

    def delete(self, group: str, id: str) -> bool:
        """Delete a campaign with its recordings, and return whether there was one."""

    def changes(self, group: str, id: str) -> int:
        """Return the number of changes of a campaign's recordings."""

    def settle(self, group: str, id: str, changes: int) -> None:
        """Record that all verdicts are up to date with the recordings after so many changes."""


class Recordings(Protocol):
    """Recordings of all groups."""

    def put(self, recording: Recording, replace: bool) -> Recording | None:
        """Store a recording unless one with other content has its name; return the previous one.

        The same content again changes nothing but where its samples are; with `replace` other content is replaced.

        Raises
        ------
        Taken
            A recording with other content exists.
        KeyError
            The campaign is not there.
        """

    def judge(self, before: Recording, after: Recording) -> bool:
        """Store a new verdict if the recording is still the same, and return whether it is."""

    def get(self, group: str, campaign: str, name: str) -> Recording | None:
        """Return a recording."""

    def of_machine(self, group: str, machine: str) -> list[FileKey]:
        """Return the files of all campaigns of a machine."""

    def list(self, group: str, campaign: str, after: str, limit: int) -> list[Recording]:
        """Return recordings after a name, in the order of names."""

    def delete(self, group: str, campaign: str, name: str) -> Recording | None:
        """Delete a recording and return it."""

    def kept(self, group: str) -> dict[FileKey, str]:
        """Return the files that recordings of a group refer to, with their SHA-256, empty where it is not known."""

    def groups(self) -> Iterator[str]:
        """Yield groups that have recordings."""
