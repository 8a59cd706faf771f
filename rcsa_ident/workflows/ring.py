"""Sounds of a tooling that hangs on a string, and of its tool alone, to what its drawing does not tell."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Protocol

from rcsa_ident.base.arrays import FloatArray
from rcsa_ident.base.errors import InputError
from rcsa_ident.base.remarks import Remark
from rcsa_ident.identification.ring.ringing import RungTooling, learned
from rcsa_ident.setup.tooling import Tooling
from rcsa_ident.signals.sound.ring_down import RingDown, ring_down
from rcsa_ident.signals.verdict import RecordCode


class Channel(Protocol):
    """A channel as a file tells it."""

    @property
    def name(self) -> str: ...
    @property
    def samples(self) -> FloatArray: ...


class Opened(Protocol):
    """A recording as a file tells it: rate [Hz], channels, what was assumed, and whether it was compressed with loss."""

    @property
    def rate(self) -> float: ...
    @property
    def channels(self) -> Sequence[Channel]: ...
    @property
    def remarks(self) -> Sequence[Remark]: ...
    @property
    def lossy(self) -> bool: ...


def ring_tooling(tooling: Tooling, sounds: Sequence[Opened], bare_tool: Sequence[Opened] = (), mass: float | None = None) -> RungTooling:
    """Return what sounds of a tooling, of its tool alone and the tool's mass tell together.

    `tooling`: as drawn
    `sounds`: of the tool in its holder, hanging free; the first channel of each is listened to
    `bare_tool`: of the tool alone
    `mass` [kg]: of the tool alone
    Raises `InputError`: nothing is given, nothing rings, or it is another tool that rings.
    """
    if not sounds and not bare_tool and mass is None:
        raise InputError("recording", "none", "the sound of a hit, of the tooling or of the tool alone, or the tool's mass")
    found = learned(tooling, _heard(sounds), _heard(bare_tool), mass)
    assumed = [remark for sound in (*sounds, *bare_tool) for remark in (*sound.remarks, *_of_several(sound.channels))]
    return replace(found, remarks=(*found.remarks, *dict.fromkeys(assumed)))


def _of_several(channels: Sequence[Channel]) -> list[Remark]:
    """A remark where a file has further channels beside the one that is listened to."""
    words = f"{channels[0].name} was taken as the sound, the first of {len(channels)} channels"
    return [Remark(RecordCode.ASSUMED, words)] if len(channels) > 1 else []


def _heard(sounds: Sequence[Opened]) -> RingDown | None:
    if not sounds:
        return None
    return ring_down([(sound.rate, sound.channels[0].samples) for sound in sounds], any(sound.lossy for sound in sounds))
