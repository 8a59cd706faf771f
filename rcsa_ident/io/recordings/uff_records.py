"""Recordings in universal files: time responses, dataset 58 or 58b, each function a channel."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from rcsa_ident.base.errors import InputError
from rcsa_ident.io.channels import RATE, Channel, Signals, check_lengths, snapped
from rcsa_ident.io.files import MEGABYTE, existing_file
from rcsa_ident.io.time_base import JITTER, Irregular, uniform
from rcsa_ident.io.uff import KINDS, UffFunction, read_uff
from rcsa_ident.io.validated_table import listed

LARGEST_FILE = 256 * MEGABYTE
#: Time response, and general, which some write for it.
_TIME_KINDS = (1, 0)
_TIME_AXIS = (17, 0)
#: Six digits of the header's step, and of times in text.
_DIGITS = 6
_SPREAD = 0.5001 * 10.0 ** (1 - _DIGITS)


def read_channels(path: Path, names: Sequence[str], default_rate: float | None) -> tuple[float, list[Channel]]:
    """Return the sampling rate [Hz] and the named channels in the file's own units, shape (n,) each.

    A channel is called by its response entity, the label of its ordinate, its title or its place (``3:-X``). The header keeps six
    digits of the step: the rate is the campaign's where that is one of those that it may stand for, else the roundest of these.

    `names`: channels that are wanted
    `default_rate` [Hz]: for a file that carries no rate
    """
    where = str(path)
    records = _records(path)
    found = [_the_only(name, records, where) for name in names]
    check_lengths(names, [f.values.size for f in found], where)
    rates = [_rate(f, name, default_rate) for name, f in zip(names, found, strict=True)]
    if len(set(rates)) > 1:
        shown = ", ".join(f"{n}: {r:g}" for n, r in zip(names, rates, strict=True))
        raise InputError(RATE, f"different rates ({shown})", "one rate for all channels [Hz]", where)
    for name, each in zip(names, found, strict=True):
        apart = float(each.abscissa[0] - found[0].abscissa[0])
        # a start of six digits may be rounded by more than a sample
        if abs(apart) * rates[0] > 0.5 + _SPREAD * abs(each.abscissa[0]) * rates[0] * 2.0:
            raise InputError(f"start of channel {name}", f"{apart:.3g} s later", f"channels that start together as {names[0]}", each.where)
    return rates[0], Signals([f.values for f in found], stored=tuple(f.ordinate.unit for f in found), started=found[0].moment)


def told_channels(path: Path) -> list[tuple[str, str]]:
    """Return what the file calls its time responses, each by a name of its own, with the label of its unit, empty where it has none."""
    records = _records(path)
    every = Counter(name for function in records for name in function.names)
    named = [(next((name for name in function.names if every[name] == 1), None), function.ordinate.unit) for function in records]
    return [(name, unit) for name, unit in named if name is not None]


def _records(path: Path) -> list[UffFunction]:
    existing_file(path, "recording", LARGEST_FILE)
    records = [f for f in read_uff(path) if f.kind in _TIME_KINDS and f.abscissa_axis.kind in _TIME_AXIS and not np.iscomplexobj(f.values)]
    if not records:
        raise InputError("recording", "no time response", f"a function of type 1 ({KINDS[1]}) with real numbers", str(path))
    return records


def _the_only(name: str, records: Sequence[UffFunction], where: str) -> UffFunction:
    found = [f for f in records if name in f.names]
    if len(found) != 1:
        known = listed([f.names[0] if f.names else f"without a name ({f.where})" for f in records])
        allowed = f"the entity, label, title or place of one time response of the file: {known}"
        raise InputError(f"channel {name}", f"{len(found)} of that name" if found else "no such channel", allowed, where)
    return found[0]


def _rate(function: UffFunction, name: str, expected: float | None) -> float:
    if function.values.size < 2:
        raise InputError(f"channel {name}", "1 sample", "at least two samples", function.where)
    if function.step:
        if not (function.step > 0.0 and math.isfinite(1.0 / function.step)):
            raise InputError(f"step of channel {name}", function.step, "a finite number above 0 [s]", function.where)
        return snapped(1.0 / function.step, _spread(function.step), expected)
    time = function.abscissa
    # times in text keep six digits too, so that the later ones are coarse: a straight line through all of them is enough
    places = np.arange(time.size, dtype=float)
    centred = places - places.mean()
    step = float(centred @ (time - time.mean()) / (centred @ centred))
    start = float(time.mean() - step * places.mean())
    off = np.abs(start + step * places - time)
    if step > 0.0 and np.all(off <= JITTER * step + 1.2 * _SPREAD * np.abs(time)):
        # rounding by at most `off` turns the line by at most 3 off / (n step) of its slope
        return snapped(1.0 / step, 3.3 * float(off.max()) / (time.size * step) + 1e-9, expected)
    try:
        rate, index = uniform(time, expected)
    except Irregular as error:
        raise InputError(f"time {error.row + 1} of channel {name}", error.found, error.allowed, function.where) from None
    if index[-1] + 1 != index.size:
        raise InputError(f"channel {name}", f"{index[-1] + 1 - index.size:.0f} lost samples", "a record without gaps", function.where)
    return rate


def _spread(step: float) -> float:
    """Half a unit of the sixth digit, relative."""
    return 0.5001 * 10.0 ** (math.floor(math.log10(step)) + 1 - _DIGITS) / step
