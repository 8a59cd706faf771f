"""Hammer tests as the commands and campaigns name them, and toolings that carry a calibrated contact."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from itertools import takewhile
from pathlib import Path
from typing import NamedTuple

import tomlkit
from tomlkit.items import InlineTable, Table

from rcsa_ident.base.errors import InputError
from rcsa_ident.base.plausibility import CONTACT
from rcsa_ident.dynamics.passivity import judged
from rcsa_ident.dynamics.receptance import MeasuredCurve
from rcsa_ident.io.curves.frf_files import read_frfs
from rcsa_ident.io.files import read_bytes, write_text
from rcsa_ident.io.settings.setups import read_tooling
from rcsa_ident.io.settings.toolings import CONTACT_SPREADS
from rcsa_ident.io.toml_text import LARGEST_SETUP, one_line
from rcsa_ident.io.validated_table import listed
from rcsa_ident.setup.campaign import HammerTest
from rcsa_ident.setup.fields import SPREAD, keys_of
from rcsa_ident.tool_holder.geometry import Contact
from rcsa_ident.tool_holder.spread import LARGEST_SHARE

#: Direction by direction of a file that names none.
_AXES = ("X", "Y")


class HammerFile(NamedTuple):
    """The direct receptances of one file.

    `label`: what stood in front of the file's name, or the default
    `values`: dict of axis to MeasuredCurve
    """

    label: str
    path: Path
    values: dict[str, MeasuredCurve]


def labelled(text: str, default: str, known: Collection[str] = ()) -> tuple[str, Path]:
    """Return label and path of ``LABEL=FILE`` or ``FILE``.

    `default`: label of a text without one
    `known`: labels that are allowed; empty allows any
    """
    before, sign, after = text.partition("=")
    # a name with = in it is a file if such a file is there
    if not sign or Path(text).is_file():
        return default, Path(text)
    if known and before not in known:
        raise InputError("label", before, f"one of {', '.join(known)}, then = and the file", text)
    return before, Path(after)


def read_hammer(path: str | Path, label: str = "tip") -> HammerFile:
    """Return the receptances of a hammer test whose response and force have the same direction.

    A file of one function without directions (text columns) holds for both axes only if its name ends in x or y; such a file
    has that axis.

    Raises `InputError`: the file holds no such function, or several of one axis.
    """
    path = Path(path)
    found: dict[str, MeasuredCurve] = {}
    tests = read_frfs(path)
    for test in tests:
        axis = test.response or (path.stem[-1:].upper() if len(tests) == 1 else "")
        if test.response != test.force or axis not in _AXES:
            continue
        if axis in found:
            raise InputError("FRF", f"two FRFs with response and force in {axis}", "one for each axis", str(path))
        values, judgement = judged(test.frequency, test.values, unit_told=test.told)
        found[axis] = MeasuredCurve(test.frequency, values, (remark.of(path.name) for remark in (*test.remarks, *judgement)))
    if not found:
        names = listed([f"{t.response or '?'}/{t.force or '?'}" for t in tests])
        raise InputError("FRF", names, "response/force X/X or Y/Y, or a single FRF in a file whose name ends in x or y", str(path))
    return HammerFile(label, path, found)


def write_calibrated_tooling(
    source: str | Path, target: str | Path, contact: Contact, log_std: Sequence[float], remarks: Sequence[str] = ()
) -> None:
    """Write a tooling file again with another contact and how well that is known; all else stays as it was written, comments included.

    `source`, `target`: tooling file that is read, and the one that is written
    `contact`: the new one
    `log_std`: sequence of float, length 4. Standard deviations of its logarithms, stiffnesses first; `spread` of a file has one number for
        translation and rotation, and the larger one is honest. A file that states nothing of the rest goes on to count as exact there.
    `remarks`: written above it as comments
    """
    table = tomlkit.table()
    for remark in remarks:
        table.add(tomlkit.comment(one_line(remark)))
    for key, kind in CONTACT.items():
        table.add(key, tomlkit.item(float(f"{getattr(contact, key):.8g}")).comment(kind.unit))
    read_tooling(source)  # what is no tooling is refused before it is touched
    document = tomlkit.parse(read_bytes(source, "tooling", LARGEST_SETUP).decode("utf-8-sig"))
    before = document.get("contact")
    if isinstance(before, Table) and before.display_name is not None:
        # what stands between its last key and the next table belongs to that one
        left = list(takewhile(lambda entry: entry[0] is None, reversed(before.value.body)))
        for _, item in reversed(left):
            table.value.append(None, item)
        document["contact"] = table
    else:
        document.pop("contact", None)
        document.append("contact", table)
    if "spread" not in document:
        document.append("spread", tomlkit.item(dict.fromkeys(keys_of(SPREAD), 0)))
    spread = document["spread"]
    assert isinstance(spread, Table | InlineTable)
    for key, size in zip(CONTACT_SPREADS, (max(log_std[:2]), max(log_std[2:])), strict=True):
        spread[key] = float(f"{100.0 * min(size, LARGEST_SHARE):.3g}")
    write_text(target, tomlkit.dumps(document))


def read_hammer_test(test: HammerTest) -> MeasuredCurve:
    """Return the frequencies [Hz] and the receptance [m/N] of a test's file, shape (n,) both, with what was assumed.

    Raises `InputError`, which names the file, and its records where the test names none of several.
    """
    found = read_frfs(test.file, test.units)
    if test.record is not None:
        found = [each for each in found if each.record == test.record]
    elif len(found) > 1:
        axis = test.axis.upper()
        found = [each for each in found if (each.response, each.force) == (axis, axis)] or found
    if len(found) != 1:
        told = "no such record" if not found else f"{len(found)} FRFs"
        raise InputError("record", told, "the number of one FRF of the file", str(test.file))
    (frf,) = found
    values, judgement = judged(frf.frequency, frf.values, test.correction, test.response == test.force, frf.told, test.band)
    return MeasuredCurve(frf.frequency, values, (remark.of(test.id) for remark in (*frf.remarks, *judgement)))
