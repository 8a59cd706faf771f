"""Declared campaigns: the keys of campaign.toml, with toolings by their texts and recordings by the last part of their paths."""

from __future__ import annotations

import json
import re
import unicodedata
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path, PurePosixPath
from typing import Any

from api.work.toolings import parsed, weigh
from rcsa_ident.base.errors import InputError
from rcsa_ident.io.recordings.readers import READERS
from rcsa_ident.io.settings.setups import campaign_of
from rcsa_ident.io.settings.setups import tooling_of as tooling_of_keys
from rcsa_ident.io.toml_text import toml_of
from rcsa_ident.io.validated_table import Table
from rcsa_ident.setup.campaign import Campaign
from rcsa_ident.setup.tooling import Tooling

#: Role of a file that holds FRFs of hammer tests.
HAMMER = "hammer"
#: Suffixes of recordings in lower case.
FORMATS = tuple(READERS)
#: Largest text of a campaign, and of its toolings together [characters].
LARGEST, LARGEST_TOOLINGS = 1_000_000, 4_000_000
MOST_CUTS, MOST_TESTS, MOST_SENSORS, MOST_TOOLINGS = 2000, 200, 64, 200
#: Frequency up to which the cost of toolings is estimated [Hz].
HIGHEST_HZ = 5000.0
TOOLING_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9 ._+()-]{0,63}")
_FORBIDDEN = frozenset('/\\:*?"<>|')
_LONGEST_NAME = 128

#: Returns the text of a tooling of the library by its name, or None.
Library = Callable[[str], str | None]


@dataclass(frozen=True, slots=True)
class File:
    """A file that a campaign names. `role`: cut, air or hammer. `cuts`: ids of the cuts, or of the hammer tests, that it serves."""

    role: str
    cuts: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class Upload:
    """An uploaded file and its interpretation.

    `path`: of the file; its name has no meaning
    `name`: given by the client; its suffix is the format
    `target`: to write the samples to; does not exist yet
    """

    path: Path
    name: str
    target: Path


def recording_name(text: str) -> str:
    """Return the last part of a path in Unicode normal form C."""
    return unicodedata.normalize("NFC", re.split(r"[/\\]", text)[-1])


def declare(data: Mapping[str, Any], library: Library) -> tuple[str, str, int]:
    """Return name, text and number of cuts of a campaign that has passed the checks of `rcsa-ident check`, recordings aside.

    `data`: the keys of campaign.toml; a tooling may also be a name of the library, the text of a tooling file, or a table of its own
    Raises `InputError`, which names the key, what was found and what is allowed.
    """
    for key, most in (("sensors", MOST_SENSORS), ("cuts", MOST_CUTS), ("frfs", MOST_TESTS), ("toolings", MOST_TOOLINGS)):
        if isinstance(data.get(key), Mapping | list) and len(data[key]) > most:
            raise InputError(key, f"{len(data[key])} of them", f"at most {most}")
    top = Table(data, "")
    cuts, tests = _cuts(top), _tests(top)
    plain = {"sensors": {}, **data, "toolings": _toolings(top, [*cuts, *tests], library), "cuts": cuts}
    if tests:
        plain["frfs"] = tests
    campaign = _campaign(plain, lambda name: Path(name))
    for tooling in campaign.toolings.values():
        weigh(tooling.assembly, HIGHEST_HZ)
    _check_files(cuts, tests)
    lines = {"campaign.name": campaign.name} | {f"cuts[{i}].id": cut.id for i, cut in enumerate(campaign.cuts)}
    lines |= {f"frfs[{i}].id": test.id for i, test in enumerate(campaign.tests)}
    for field, text in lines.items():
        if len(text) > 200 or not text.isprintable():
            raise InputError(field, repr(text[:80]), "a line of at most 200 characters")
    return campaign.name, json.dumps(plain, ensure_ascii=False, allow_nan=False), len(campaign.cuts)


def _cuts(top: Table) -> list[dict[str, Any]]:
    """Cuts with the last parts of their recordings' paths."""
    cuts = [dict(table.data) for table in top.tables("cuts")] if "cuts" in top else []
    paths: dict[str, str] = {}
    for i, cut in enumerate(cuts):
        for key in ("cut", "air"):
            text = cut.get(key)
            if not isinstance(text, str):
                continue
            cut[key] = _last_part(f"cuts[{i}].{key}", text, paths)
            if PurePosixPath(cut[key]).suffix.lower() not in FORMATS:
                raise InputError(f"cuts[{i}].{key}", repr(text[-80:]), f"a file name that ends in one of {', '.join(FORMATS)}")
    return cuts


def _tests(top: Table) -> list[dict[str, Any]]:
    """Hammer tests with the last parts of their files' paths; a file's content says what it is, not its suffix."""
    tests = [dict(table.data) for table in top.tables("frfs")] if "frfs" in top else []
    paths: dict[str, str] = {}
    for i, test in enumerate(tests):
        if isinstance(text := test.get("file"), str):
            test["file"] = _last_part(f"frfs[{i}].file", text, paths)
    return tests


def _last_part(field: str, text: str, paths: dict[str, str]) -> str:
    """The name of a file; `paths` are those seen so far by their names."""
    name = _checked_name(field, text)
    if paths.setdefault(name, text) != text:
        raise InputError(field, f'"{text}" beside "{paths[name]}"', "file names (last parts of the paths) that differ")
    return name


def _checked_name(field: str, text: str) -> str:
    name = recording_name(text)
    allowed = f'a file name of at most {_LONGEST_NAME} characters without control characters and : * ? " < > |'
    odd = not name.isprintable() or _FORBIDDEN & set(name) or name.startswith(".") or name != name.strip()
    if odd or not 1 <= len(name) <= _LONGEST_NAME:
        raise InputError(field, repr(text[:80]), allowed)
    return name


def _check_files(cuts: list[dict[str, Any]], tests: list[dict[str, Any]]) -> None:
    """Refuse a file that serves two cuts, a cut and an air cut, or a hammer test and a cut."""
    owner: dict[str, int] = {}
    for i, cut in enumerate(cuts):
        if cut["cut"] in owner:
            raise InputError(f"cuts[{i}].cut", f'"{cut["cut"]}", which is the file of cuts[{owner[cut["cut"]]}]', "a file of its own")
        owner[cut["cut"]] = i
    for i, cut in enumerate(cuts):
        if cut.get("air") in owner:
            raise InputError(f"cuts[{i}].air", f'"{cut["air"]}", which is the file of a cut', "a recording without cutting")
    recordings = {*owner, *(cut["air"] for cut in cuts if "air" in cut)}
    for i, test in enumerate(tests):
        if test["file"] in recordings:
            raise InputError(f"frfs[{i}].file", f'"{test["file"]}", which is a recording of [[cuts]]', "the file of an FRF")


def _toolings(top: Table, users: list[dict[str, Any]], library: Library) -> dict[str, str]:
    """Texts of all toolings by name; without the table of those that cuts and hammer tests use."""
    if "toolings" in top:
        given = dict(top.table("toolings").data)
    else:
        names = dict.fromkeys(name for user in users if isinstance(name := user.get("tooling"), str))
        given = {name: name for name in names}
    texts: dict[str, str] = {}
    for key, what in given.items():
        field = f"toolings.{key[:80]}"
        if not TOOLING_NAME.fullmatch(key):
            raise InputError("toolings", repr(key[:80]), "names of letters, digits, blanks and . _ + - ( ), at most 64")
        if isinstance(what, Mapping):
            tooling_of_keys(what, "", key)
            texts[key] = toml_of(what)
            continue
        if not isinstance(what, str):
            allowed = "a name of the library, the path of a tooling file, its text, or a table of the tooling's keys"
            raise InputError(field, what, allowed)
        if "\n" in what:
            tooling_of_keys(parsed(what), "", key)
            texts[key] = what
            continue
        # a path stands for the library's tooling that is named by the key
        name = key if what.endswith(".toml") else what
        text = library(name) if TOOLING_NAME.fullmatch(name) else None
        if text is None:
            raise InputError(
                field, f'"{name[:80]}", which is not in the library', "a tooling of the library (PUT /v1/toolings/NAME writes one)"
            )
        texts[key] = text
    if sum(map(len, texts.values())) > LARGEST_TOOLINGS:
        raise InputError("toolings", "texts that are too long", f"at most {LARGEST_TOOLINGS // 1000} kB together")
    return texts


def _campaign(plain: Mapping[str, Any], locate: Callable[[str], Path]) -> Campaign:
    def tooling(table: Table, key: str) -> Tooling:
        return tooling_of_keys(parsed(table.data[key]), "", key)

    def file(table: Table, key: str) -> Path:
        if key == "engagement":
            # no path of a client is opened, and a map is small
            table.refuse(key, "the name of a file", "the rows of the map themselves, each z_mm, entry_angle_deg and exit_angle_deg")
        return locate(table.text(key, allowed="the name of a recording"))

    # hammer tests alone have no table [[cuts]]
    return campaign_of({key: what for key, what in plain.items() if key != "cuts" or what}, "", "campaign", tooling, file)


def campaign_of_text(text: str, locate: Callable[[str], Path] = Path) -> Campaign:
    """Return a declared campaign; `locate` turns a recording's name into its file."""
    return _campaign(json.loads(text), locate)


def files_of(text: str) -> dict[str, File]:
    """Return the files that a campaign names, in its order: recordings, then those of hammer tests."""
    found: dict[str, File] = {}
    data = json.loads(text)
    for cut in data["cuts"]:
        found[cut["cut"]] = File("cut", (cut["id"],))
        if "air" in cut:
            served = found[cut["air"]].cuts if cut["air"] in found else ()
            found[cut["air"]] = File("air", (*served, cut["id"]))
    for test in data.get("frfs", ()):
        served = found[test["file"]].cuts if test["file"] in found else ()
        found[test["file"]] = File(HAMMER, (*served, test["id"]))
    return found


def toml_text(text: str, there: Callable[[str], bool] = lambda _: True) -> str:
    """Return campaign.toml of a folder with ``toolings/`` and ``recordings/``.

    `there`: whether the folder holds a file; cuts and hammer tests without theirs are omitted
    """
    data = json.loads(text)
    for cut in (cuts := [cut for cut in data["cuts"] if there(cut["cut"])]):
        if "air" in cut and not there(cut["air"]):
            del cut["air"]
        for key in {"cut", "air"} & cut.keys():
            cut[key] = f"recordings/{cut[key]}"
    tests = [test | {"file": f"recordings/{test['file']}"} for test in data.get("frfs", ()) if there(test["file"])]
    told = data | {"toolings": {name: f"toolings/{name}.toml" for name in data["toolings"]}, "cuts": cuts, "frfs": tests}
    # of hammer tests alone nothing is said of cuts and sensors
    return toml_of({key: what for key, what in told.items() if what or key not in ("cuts", "frfs", "sensors")})
