"""Recordings that tell themselves: names, units and rate from the file's own text; what cannot be told is asked for by name."""

from __future__ import annotations

from collections.abc import Sequence
from importlib import import_module
from pathlib import Path

from rcsa_ident.base.errors import InputError
from rcsa_ident.base.remarks import Remark
from rcsa_ident.io.channels import RATE, notes_of
from rcsa_ident.io.recordings.readers import READERS, SOUND, read_signals
from rcsa_ident.io.recordings.self_describing_tables import OpenChannel, OpenRecording, told_table
from rcsa_ident.io.text_header import name_and_unit
from rcsa_ident.signals.recording import Quantity
from rcsa_ident.signals.told_units import quantity_in
from rcsa_ident.signals.verdict import RecordCode

#: Tables of text.
TEXT = (".csv", ".txt", ".dat", ".tsv", ".asc", ".lvm")
#: Formats whose readers list a file's channels.
_LISTING = {
    ".h5": "hdf5",
    ".hdf5": "hdf5",
    ".tdms": "tdms",
    ".mat": "matlab",
    ".parquet": "parquet",
    ".uff": "uff_records",
    ".unv": "uff_records",
}


def open_recording(path: str | Path, names: Sequence[str] = (), default_rate: float | None = None, suffix: str = "") -> OpenRecording:
    """Return a recording as its file tells it, without settings: channels, their units and the rate.

    `path`: text tables with names and units above them, sound, and the formats whose channels have names and may have units
    `names`: channels that are wanted; none for all
    `default_rate` [Hz]: rate of a file that carries none
    `suffix`: format of a file whose name does not tell it
    Raises `InputError`: the file cannot be read, or does not tell what is needed; the message names the option that does.
    """
    path = Path(path)
    suffix = (suffix or path.suffix).lower()
    if suffix in TEXT:
        return told_table(path, default_rate)
    if suffix in SOUND:
        return _sound(path, names, suffix)
    if suffix not in _LISTING:
        raise InputError("recording", f"suffix '{suffix}'", f"one of {', '.join(dict.fromkeys([*TEXT, *READERS]))}", str(path))
    told: dict[str, str] = dict(import_module(f"rcsa_ident.io.recordings.{_LISTING[suffix]}").told_channels(path))
    units = {name: name_and_unit(name)[1] or unit for name, unit in told.items()}
    # beside channels of known units there may be others of another length or rate
    wanted = list(names) or [name for name, unit in units.items() if quantity_in(unit)[1] is not None] or list(units)
    if not wanted:
        raise InputError("channel", "none", "names of channels: the file has no vectors of numbers at its top", str(path))
    try:
        rate, signals = read_signals(path, wanted, default_rate, suffix)
    except InputError as error:
        if (error.field, error.found) == (RATE, "nothing"):
            raise InputError(RATE, "nothing in the file", "the rate [Hz], told", str(path)) from None
        raise
    channels = []
    for name, signal, stored in zip(wanted, signals, signals.stored, strict=True):
        unit = units.get(name) or stored
        factor, quantity = quantity_in(unit)
        channels.append(OpenChannel(name, unit, quantity, factor * signal[:]))
    return OpenRecording(rate, tuple(channels))


def _sound(path: Path, names: Sequence[str], suffix: str) -> OpenRecording:
    """The first channel of a sound, or those that are named: those of one recorder hear nearly the same."""
    wanted = list(names) or ["ch1"]
    rate, signals = read_signals(path, wanted, suffix=suffix)
    channels = tuple(OpenChannel(name, "", Quantity.SOUND, signal[:]) for name, signal in zip(wanted, signals, strict=True))
    lossy = any(note.code is RecordCode.LOSSY for note in notes_of(signals))
    first = Remark(RecordCode.ASSUMED, "taken as sound, the first channel of the file")
    return OpenRecording(rate, channels, () if names else (first,), lossy)
