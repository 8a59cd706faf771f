"""Campaigns and the recordings that were uploaded for them: what is kept, and how a store is asked for it."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Protocol


@dataclass(frozen=True, slots=True)
class Campaign:
    """A campaign of a machine, as it was declared; what was uploaded for it are its recordings.

    Parameters
    ----------
    id, group, machine, name : str
    text : str
        The keys of campaign.toml as JSON: toolings by their texts, recordings by the last part of their paths.
    cuts : int
        So many are declared.
    created : str
        UTC, ISO 8601.
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

    Parameters
    ----------
    group, campaign, name : str
        The name as the campaign tells it.
    role : str
        cut or air.
    size : int [bytes]
    sha256 : str
        Of the untouched upload, hexadecimal.
    normalised : str
        Names the samples that were read from it.
    found : str
        JSON: rate, duration, channels, speed, harmonics, verdict.
    judged_with : str
        `normalised` of the air cut that the verdict on a cut rests on, empty without one.
    created : str
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


@dataclass(frozen=True, slots=True)
class Counts:
    """How far the uploads of a campaign are: cuts whose recording is there, and those among them that are usable."""

    uploaded: int
    usable: int


#: What names a file: whether it is the upload itself or the samples read from it, and its key.
FileKey = tuple[str, str]


class Campaigns(Protocol):
    """Campaigns of all groups."""

    def add(self, campaign: Campaign, repeat: tuple[str, str] | None = None) -> Campaign:
        """Keep a campaign and return it; the same again for an idempotency key that was there, with the same digest.

        Raises
        ------
        Taken
            The idempotency key came with another content.
        KeyError
            The machine is not there.
        """

    def get(self, group: str, id: str) -> Campaign | None:
        """Return a campaign."""

    def unsettled(self) -> list[tuple[str, str]]:
        """Return group and id of campaigns whose verdicts may be older than their recordings."""

    def list(self, group: str, machine: str, after: str, limit: int) -> list[Campaign]:
        """Return campaigns of a machine behind an id, in the order of ids."""

    def counts(self, group: str, ids: Sequence[str]) -> dict[str, Counts]:
        """Return how far the uploads of campaigns are; one without any is left out."""

    def delete(self, group: str, id: str) -> bool:
        """Return whether there was one; its recordings go with it."""

    def changes(self, group: str, id: str) -> int:
        """Return how often recordings of a campaign have come or gone."""

    def settle(self, group: str, id: str, changes: int) -> None:
        """Note that every verdict stands with what was there after so many changes."""


class Recordings(Protocol):
    """Recordings of all groups."""

    def put(self, recording: Recording, replace: bool) -> Recording | None:
        """Keep a recording unless another content is there under its name; return what was there before.

        The same content again changes nothing. With `replace` it takes the place of another.

        Raises
        ------
        Taken
            Another content is there.
        KeyError
            The campaign is not there.
        """

    def judge(self, before: Recording, after: Recording) -> bool:
        """Keep another verdict if the recording is still the same, and return whether it is."""

    def get(self, group: str, campaign: str, name: str) -> Recording | None:
        """Return a recording."""

    def of_machine(self, group: str, machine: str) -> list[FileKey]:
        """Return the files of all campaigns of a machine."""

    def list(self, group: str, campaign: str, after: str, limit: int) -> list[Recording]:
        """Return recordings behind a name, in the order of names."""

    def delete(self, group: str, campaign: str, name: str) -> Recording | None:
        """Return what was there."""

    def kept(self, group: str) -> set[FileKey]:
        """Return the files that recordings of a group refer to."""

    def groups(self) -> Iterator[str]:
        """Yield groups that have recordings."""
