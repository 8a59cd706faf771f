"""Tap-test FRFs: FRF.csv, universal files, text columns (`frf_text`); all become receptances in m/N.

Universal files are read by `rcsa_ident.io.uff`: a file of one's own needs no extra package.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import permutations
from pathlib import Path
from typing import NamedTuple

import numpy as np

from rcsa_ident.base.arrays import ComplexArray, FloatArray
from rcsa_ident.base.errors import InputError
from rcsa_ident.base.remarks import Remark
from rcsa_ident.dynamics.coordinates import Dof
from rcsa_ident.dynamics.passivity import Correction, judged, reciprocal
from rcsa_ident.dynamics.receptance import MeasuredCurve, Receptance
from rcsa_ident.io.curves.tips import AXES, FREQUENCY, read_frf_csv
from rcsa_ident.io.files import MEGABYTE, read_bytes
from rcsa_ident.io.uff import (
    ACCELERATION,
    DISPLACEMENT,
    EXCITATION_FORCE,
    FRF,
    KINDS,
    REACTION_FORCE,
    VELOCITY,
    UffFunction,
    read_uff,
)
from rcsa_ident.io.validated_table import listed
from rcsa_ident.machine.known_tip import measured_tip
from rcsa_ident.signals.told_units import UNITS_ALLOWED, FrfUnit, force_unit, frf_unit, hertz_in, is_untold, motion_unit, quotient
from rcsa_ident.signals.verdict import RecordCode, assumed

_KINDS = {DISPLACEMENT: 0, VELOCITY: 1, ACCELERATION: 2}
_LARGEST = 128 * MEGABYTE


class TapTest(NamedTuple):
    """A receptance from a file.

    `frequency` [Hz], shape (n,); `values` [m/N], shape (n,)
    `response`, `force`: axis X, Y or Z (empty where the file says none)
    `record`: number in the file, from 1
    `point`: what the file calls the two places, as ``1 / 1``
    `where`: file and line
    `remarks`: what the file does not state and was assumed
    `told`: whether the file or the user says which quantity it is
    """

    frequency: FloatArray
    values: ComplexArray
    response: str
    force: str
    record: int
    point: str
    where: str
    remarks: tuple[Remark, ...] = ()
    told: bool = True


class Source(NamedTuple):
    """A file to take a tip's FRFs from.

    `pair`: (str, str) or None; axes of response and force; None takes what the file names
    `record`: number in the file, from 1
    `correction`: of what the file holds
    """

    path: Path
    pair: tuple[str, str] | None = None
    record: int | None = None
    correction: Correction = Correction.AUTO


def read_tap_tests(sources: Sequence[Source], units: str | None = None, from_hz: float = 0.0) -> dict[tuple[str, str], MeasuredCurve]:
    """Return the tip's FRFs for each pair of axes (response, force); those that no tip can have are turned or remarked.

    `units`: of universal files and text columns, whatever they say themselves; None believes them, and takes m/N where a text says nothing
    `from_hz` [Hz]: lines below it are left out: an accelerometer's drift over the square of the frequency is no receptance
    Raises `InputError`, which names the file and the line or the record.
    """
    found: dict[tuple[str, str], MeasuredCurve] = {}
    for source in sources:
        for pair, test in _wanted(read_frfs(source.path, units), source).items():
            if pair in found:
                raise InputError("tap tests", f"{pair_name(pair)} twice", "each FRF once", str(source.path))
            kept = test.frequency >= from_hz
            if np.count_nonzero(kept) < 2:
                raise InputError("frf_from_hz", f"{from_hz:g}", f"a frequency below the last, {test.frequency[-1]:g} Hz", test.where)
            values, judgement = judged(test.frequency[kept], test.values[kept], source.correction, pair[0] == pair[1], test.told)
            said = (remark.of(f"FRF {pair_name(pair)}") for remark in (*test.remarks, *judgement))
            found[pair] = MeasuredCurve(test.frequency[kept], values, said)
    for pair, curve in found.items():
        other = found.get((pair[1], pair[0]))
        if pair[0] < pair[1] and other is not None and np.array_equal(curve[0], other[0]):
            differ = reciprocal(curve[0], curve[1], other[1], (pair_name(pair), pair_name((pair[1], pair[0]))))
            found[pair] = MeasuredCurve(*curve, (*curve.remarks, *differ))
    return found


def read_tapped_tip(sources: Sequence[Source], units: str | None = None, from_hz: float = 0.0) -> Receptance:
    """Return the tip's receptance of files, over X and Y, and over Z where it was hit there; see `read_tap_tests`."""
    found = read_tap_tests(sources, units, from_hz)
    curves = {(Dof(a.lower()), Dof(b.lower())): curve for (a, b), curve in found.items()}
    return measured_tip({a: c for (a, b), c in curves.items() if a is b}, {pair: c for pair, c in curves.items() if pair[0] is not pair[1]})


def pair_name(pair: tuple[str, str]) -> str:
    """Return what a user calls an FRF: X of a direct one, XY where the force acts in Y."""
    return pair[0] if pair[0] == pair[1] else "".join(pair)


def read_frfs(path: str | Path, units: str | None = None) -> list[TapTest]:
    """Return all FRFs of a file as receptances, whichever of the formats it has; its content decides, not its suffix."""
    unit = None if units is None else parse_units(units, "frf_units")
    raw = read_bytes(path, "FRF", _LARGEST)
    head = raw[:20000]
    first = next((line.strip() for line in head.splitlines() if line.strip()), b"")
    if first == b"-1":
        return _from_uff(path, unit)
    if any(f"{axis}_{part}".encode() in head for axis in AXES for part in ("re", "im")) and FREQUENCY.encode() in head:
        if unit not in (None, FrfUnit(1.0, 0)):
            raise InputError("frf_units", units, "m/N, or no unit, for an FRF.csv", str(path))
        return _from_csv(path)
    # most tips come without a text, and its grammar takes as long to compile as to read one
    from rcsa_ident.io.curves.frf_text import read_frf_text

    found = []
    for record, (frequency, values, own, axis, told, said) in enumerate(read_frf_text(raw, unit, str(path)), start=1):
        frequency, values = _receptance(frequency, values, own, str(path))
        found.append(TapTest(frequency, values, axis[:1], axis[-1:], record, "", str(path), said, told))
    return found


def parse_units(text: str, field: str = "unit", where: str = "") -> FrfUnit:
    """Return the unit of an FRF, such as ``(m/s^2)/N``, ``mm/N`` or ``N/m``.

    `field`, `where`: what the text is and where it stands, for the message
    """
    unit = frf_unit(text)
    if unit is None:
        raise InputError(field, text, UNITS_ALLOWED, where)
    return unit


def _receptance(frequency: FloatArray, values: ComplexArray, unit: FrfUnit, where: str) -> tuple[FloatArray, ComplexArray]:
    """Receptance of whatever an FRF is; at 0 Hz a mobility or an accelerance says nothing of it, so the line goes."""
    if np.any(np.diff(frequency) <= 0.0) or frequency[0] < 0.0:
        raise InputError("frequencies", "frequencies that do not increase", "increasing frequencies of 0 or more [Hz]", where)
    values = values * unit.factor
    if unit.inverse:
        if not np.all(values):
            raise InputError("FRF", f"0 at {frequency[values == 0.0][0]:g} Hz, a force over a motion", "numbers other than 0", where)
        values = 1.0 / values
    if not unit.order:
        return frequency, values
    kept = frequency > 0.0
    return frequency[kept], values[kept] / (2j * np.pi * frequency[kept]) ** unit.order


def _wanted(tests: list[TapTest], source: Source) -> dict[tuple[str, str], TapTest]:
    path = str(source.path)
    if source.record is not None:
        tests = [test for test in tests if test.record == source.record]
        if not tests:
            raise InputError("frf", f"record {source.record}", "the number of an FRF in the file, counted from 1", path)
    named = [test for test in tests if test.response in AXES and test.force in AXES]
    if source.pair is None:
        if not named:
            raise InputError("frf", "a file that names no axis", "a file given with the axes of its response and force", path)
        pairs = {(test.response, test.force) for test in named}
        # what a triaxial sensor felt of Z says nothing where nobody pushed there
        kept = pairs if ("Z", "Z") in pairs else {pair for pair in pairs if "Z" not in pair}
        return {pair: _only([t for t in named if (t.response, t.force) == pair], pair, path) for pair in kept}
    own = [test for test in named if (test.response, test.force) == source.pair]
    # a file that names no axes holds the one that was asked for
    silent = [test for test in tests if not test.response and not test.force]
    if not own and not silent:
        known = listed([f"{t.record}: {t.response}{t.force}" for t in tests])
        raise InputError("frf", f"no FRF of axis {pair_name(source.pair)}", f"an axis that the file holds: {known}", path)
    return {source.pair: _only(own or silent, source.pair, path)}


def _only(tests: list[TapTest], pair: tuple[str, str], path: str) -> TapTest:
    if len(tests) == 1:
        return tests[0]
    # a tip is hit where it is measured
    driving = [test for test in tests if len(set(test.point.split(" / "))) == 1]
    if len(driving) == 1:
        return driving[0]
    records = listed([f"{t.record} ({t.point})" for t in driving or tests])
    name = pair_name(pair)
    raise InputError("frf", f"{len(tests)} FRFs of axis {name}", f"one of them, chosen by its record: {records}", path)


def _from_csv(path: str | Path) -> list[TapTest]:
    curves = read_frf_csv(path)
    cross = {f"{response}{force}_{part}" for response, force in permutations(AXES, 2) for part in ("re", "im")}
    unread = [name for name in curves.bands if name not in cross]
    said = (Remark(RecordCode.ASSUMED, f"not read: {listed(unread)}"),) if unread else ()
    found = [
        TapTest(curves.frequency, values, axis, axis, i, "tip / tip", str(path), said)
        for i, (axis, values) in enumerate(curves.values.items(), 1)
    ]
    for response, force in permutations(AXES, 2):
        parts = [curves.bands.get(f"{response}{force}_{part}") for part in ("re", "im")]
        if parts[0] is not None and parts[1] is not None:
            values = parts[0] + 1j * parts[1]
            if not np.all(np.isfinite(values)):
                raise InputError(f"column {response}{force}_re", "no finite number", "finite numbers", str(path))
            found.append(TapTest(curves.frequency, values, response, force, len(found) + 1, "tip / tip", str(path)))
    return found


def _from_uff(path: str | Path, unit: FrfUnit | None) -> list[TapTest]:
    functions = read_uff(path)
    found = []
    for i, function in enumerate(functions, start=1):
        if function.kind != FRF:
            continue
        if not np.iscomplexobj(function.values):
            raise InputError("dataset 58", "an FRF of real numbers", "complex numbers (data type 5 or 6)", function.where)
        sign = 1.0 if function.response[1] * function.reference[1] >= 0 else -1.0
        own = unit if unit is not None else _unit_of(function)
        said = _assumed_of(function, unit is not None)
        frequency, values = _receptance(_frequency_of(function), sign * function.values, own, function.where)
        place = f"{function.response[0]} / {function.reference[0]}"
        found.append(TapTest(frequency, values, _axis(function.response), _axis(function.reference), i, place, function.where, said))
    if not found:
        kinds = listed(list(dict.fromkeys(KINDS.get(f.kind, f"type {f.kind}") for f in functions)))
        raise InputError("universal file", f"functions of another kind ({kinds})", "frequency response functions (type 4)", str(path))
    return found


def _assumed_of(function: UffFunction, units_known: bool) -> tuple[Remark, ...]:
    """What a function's header does not state."""
    said = []
    if not (units_known or function.system or function.ordinate.unit or function.denominator.unit):
        said.append(assumed("the function", "", "SI (no labels, no dataset 164)"))
    if not (function.response[1] and function.reference[1]):
        words = "the function states no direction of response or force: both are assumed to point the same way"
        said.append(Remark(RecordCode.ASSUMED, words))
    return tuple(said)


def _axis(place: tuple[int, int]) -> str:
    direction = abs(place[1])
    return "" if direction == 0 else "XYZ"[direction - 1] if direction <= 3 else "rotation"


def _unit_of(function: UffFunction) -> FrfUnit:
    """Unit of an FRF as its header says: by the labels, else by the data types in the file's system of units."""
    numerator, denominator = ("" if is_untold(axis.unit) else axis.unit for axis in (function.ordinate, function.denominator))
    # some write the whole unit beside the numerator
    found = frf_unit(quotient(numerator, denominator) if numerator and denominator else numerator)
    if found is None and numerator and denominator:
        found = frf_unit(numerator)
    if found is not None:
        return found
    length, force = function.factors
    order = _KINDS.get(function.ordinate.kind)
    motion = motion_unit(numerator) if numerator else (1.0 / length, order) if order is not None else None
    newton = force_unit(denominator) if denominator else None
    if not denominator and function.denominator.kind in (EXCITATION_FORCE, REACTION_FORCE):
        newton = 1.0 / force
    if motion is None or newton is None:
        labels = " and ".join(label for label in (numerator, denominator) if label)
        types = f"data types {function.ordinate.kind} and {function.denominator.kind}, labels {labels or 'none'}"
        raise InputError("frf_units", types, UNITS_ALLOWED, function.where)
    return FrfUnit(motion[0] / newton, motion[1])


def _frequency_of(function: UffFunction) -> FloatArray:
    """Frequencies [Hz], in the unit of the abscissa's label."""
    label = function.abscissa_axis.unit
    if is_untold(label):
        return function.abscissa
    factor = hertz_in(label)
    if factor is None:
        raise InputError("unit of the abscissa", label, "Hz, kHz, rad/s or rpm", function.where)
    return function.abscissa * factor
