"""What an answer says of itself: a sentence for people, with a code for programs."""

from __future__ import annotations

from collections.abc import Iterable
from enum import StrEnum
from typing import Any, NoReturn


class RemarkCode(StrEnum):
    """What a remark is about: the base of the enumerations of those that speak, as `RecordCode` and `IdentificationCode`."""


class Remark(str):
    """A sentence that also says what it is about: code decides by the code, never by the words.

    It is its sentence wherever a text is wanted: in files, on the console, in a report.
    """

    __slots__ = ("code",)
    code: RemarkCode

    def __new__(cls, code: RemarkCode, sentence: str) -> Remark:
        """Return the sentence with its code."""
        remark = super().__new__(cls, sentence)
        object.__setattr__(remark, "code", code)
        return remark

    def __setattr__(self, name: str, value: Any) -> NoReturn:
        """Refuse: a remark is frozen."""
        raise AttributeError(f"a remark is frozen: {name}")

    def __reduce__(self) -> tuple[type[Remark], tuple[RemarkCode, str]]:
        """Pickle and copy with the code."""
        return type(self), (self.code, str(self))

    def of(self, whom: str) -> Remark:
        """Return the same remark about something of its own, as ``air cut: no signal: ...``."""
        return type(self)(self.code, f"{whom}: {self}")


def says(remarks: Iterable[Remark], code: RemarkCode) -> bool:
    """Return whether one of the remarks has this code."""
    return any(remark.code is code for remark in remarks)


def counted(number: int, noun: str) -> str:
    """Return how many of something there are.

    >>> counted(1, "file"), counted(2, "file")
    ('1 file', '2 files')
    """
    return f"{number} {noun}" + ("" if number == 1 else "s")
