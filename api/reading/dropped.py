"""What files that somebody dropped mean, before anything is stored: by the readers that take them in."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any

from api.reading.campaign_text import MOST_TOOLINGS, TOOLING_NAME, Library, declare, recording_name
from api.work.toolings import LARGEST, differences, parsed, tooling_of
from rcsa_ident.base.errors import InputError
from rcsa_ident.io.toml_text import keys_of_toml


@dataclass(frozen=True, slots=True)
class DroppedTooling:
    """A tooling among dropped files.

    `key`: its name in the library and in the campaign
    `listed`: whether the campaign names it
    `there`: the text of the library's tooling of that name
    `differences`: list of (str, object, object); field, the library's value and the dropped one
    """

    file: str
    text: str
    key: str
    listed: bool
    there: str | None
    differences: list[tuple[str, Any, Any]]


@dataclass(slots=True)
class Dropped:
    """What dropped files hold.

    `campaign`, `name`: the campaign's file and name
    `keys`: of the campaign
    `from_library`, `missing`: toolings of the campaign that are not among the files: the library's, and those that it lacks
    `recordings`: names of the recordings and hammer tests' files that the campaign wants
    `others`: files that are neither campaign nor tooling
    """

    campaign: str | None = None
    name: str = ""
    keys: dict[str, Any] = field(default_factory=dict)
    toolings: list[DroppedTooling] = field(default_factory=list)
    from_library: list[str] = field(default_factory=list)
    missing: list[str] = field(default_factory=list)
    recordings: list[str] = field(default_factory=list)
    others: list[str] = field(default_factory=list)


def look_at(files: Sequence[tuple[str, str]], library: Library) -> Dropped:
    """Return what TOML files, each a name and a text, hold: by their keys and not by their names.

    `files`: sequence of (str, str)
    Raises `InputError`, which names file and key; a campaign whose toolings are all there is checked as it will be when it is made.
    """

    def known(name: str) -> str | None:
        return library(name) if TOOLING_NAME.fullmatch(name) else None

    found, toolings = Dropped(), list[tuple[str, str]]()
    for name, text in files:
        with _naming(name):
            keys = keys_of_toml(text, "file")
        if {"cuts", "campaign", "frfs"} & keys.keys():
            if found.campaign is not None:
                raise InputError(name, "a second campaign", f"one campaign at a time, as {found.campaign}")
            found.campaign, found.keys = name, keys
        elif "cutter" in keys:
            with _naming(name):
                if len(text) > LARGEST:
                    raise InputError("tooling", f"{len(text)} characters", f"at most {LARGEST // 1000} kB")
                tooling_of(text)
            toolings.append((name, text))
        else:
            found.others.append(name)
    wanted = _wanted(found.keys)
    if len(wanted) > MOST_TOOLINGS:
        raise InputError(f"{found.campaign}: toolings", f"{len(wanted)} of them", f"at most {MOST_TOOLINGS}")
    by_file = {recording_name(what): key for key, what in wanted.items() if what.endswith(".toml")}
    for name, text in toolings:
        file = recording_name(name)
        key = by_file.get(file, file.removesuffix(".toml"))
        there = known(key)
        compared = [] if there is None else differences(parsed(there), parsed(text))
        found.toolings.append(DroppedTooling(name, text, key, key in _names(wanted), there, compared))
    if found.campaign is not None:
        texts = {tooling.key: tooling.text for tooling in found.toolings}
        rest = [name for name in _names(wanted) if name not in texts]
        found.missing = [name for name in rest if known(name) is None]
        found.from_library = [name for name in rest if name not in found.missing]
        with _naming(found.campaign):
            if not found.missing:
                found.name, _, _ = declare(found.keys, lambda name: texts.get(name) or known(name))
        found.recordings = _recordings(found.keys)
    return found


def _wanted(keys: Mapping[str, Any]) -> dict[str, str]:
    """Keys of [toolings] with what each names; without the table the names that cuts and hammer tests use."""
    given = keys.get("toolings")
    if isinstance(given, Mapping):
        return {key: what for key, what in given.items() if isinstance(what, str) and "\n" not in what}
    return {name: name for each in (*_tables(keys, "cuts"), *_tables(keys, "frfs")) if isinstance(name := each.get("tooling"), str)}


def _names(wanted: Mapping[str, str]) -> list[str]:
    """What the library is asked for: a path stands for the key, as when the campaign is made."""
    return list(dict.fromkeys(key if what.endswith(".toml") else what for key, what in wanted.items()))


def _tables(keys: Mapping[str, Any], name: str) -> list[Mapping[str, Any]]:
    tables = keys.get(name)
    return [each for each in tables if isinstance(each, Mapping)] if isinstance(tables, list) else []


def _recordings(keys: Mapping[str, Any]) -> list[str]:
    paths = [cut.get(key) for cut in _tables(keys, "cuts") for key in ("cut", "air")]
    paths += [test.get("file") for test in _tables(keys, "frfs")]
    return list(dict.fromkeys(recording_name(path) for path in paths if isinstance(path, str)))


@contextmanager
def _naming(file: str) -> Iterator[None]:
    try:
        yield
    except InputError as error:
        raise InputError(f"{file}: {error.field}", error.found, error.allowed, error.where) from None
