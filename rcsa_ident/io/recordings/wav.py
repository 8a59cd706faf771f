"""WAV recordings: integers of 8 to 32 bits and floats, full scale 1; the campaign's sensitivity calibrates them. Others by `sound`."""

from __future__ import annotations

import struct
from collections.abc import Sequence
from datetime import datetime
from functools import partial
from pathlib import Path
from xml.etree import ElementTree

import numpy as np

from rcsa_ident.base.arrays import FloatArray
from rcsa_ident.base.errors import InputError
from rcsa_ident.base.remarks import Remark
from rcsa_ident.io.channels import LARGEST_STORED, RATE, Channel, Signals, StoredChannel, check_declared, kept, moment_of, the_only
from rcsa_ident.io.files import Bytes, mapped
from rcsa_ident.io.recordings.sound import cut, decoded
from rcsa_ident.io.validated_table import listed
from rcsa_ident.signals.verdict import RecordCode

COMPLETE = "a complete WAV file"
_PCM, _FLOAT, _EXTENSIBLE = 1, 3, 0xFFFE
#: The last 14 bytes of a sub-format, behind the number of the format.
_SUBFORMAT = bytes.fromhex("000000001000800000aa00389b71")
_ENCODINGS = {(_PCM, 1): "u1", (_PCM, 2): "i2", (_PCM, 3): "i3", (_PCM, 4): "i4", (_FLOAT, 4): "f4", (_FLOAT, 8): "f8"}
#: µ-law, A-law, ADPCM of two kinds, GSM: the library decodes them.
_DECODED = (0x0006, 0x0007, 0x0002, 0x0011, 0x0031)
_UNKNOWN_LENGTH = 0xFFFFFFFF
#: From here on a length is what recorders write that do not know it yet (0x7FFFF000, 0x7FFFFF00, 0x80000000): no file so long is read.
_PLACEHOLDER = 0x7FFFF000 - 65536
_LARGEST_NAMES = 65536
_MOST_CHUNKS = 10_000


def read_channels(path: Path, names: Sequence[str], default_rate: float | None, cut_off: str = "refuse") -> tuple[float, list[Channel]]:
    """Return the sampling rate [Hz] and the named channels, full scale 1, shape (n,) each; long ones stay in the file.

    Channels are called ch1, ch2, ...; where the file names its tracks (iXML), these names count, too.

    `names`: channels that are wanted
    `default_rate` [Hz]: for a file that carries no rate
    `cut_off`: ``refuse`` or ``note``: what a file that ends before its declared samples is. One that never declared them, as a pipe writes
        it, is complete wherever it ends.
    """
    where = str(path)
    raw = mapped(path, "recording", LARGEST_STORED)
    order, chunks, missing = _chunks(raw, where)
    for name in ("fmt ", "data"):
        if name not in chunks:
            raise InputError("recording", f"no chunk '{name.strip()}'", COMPLETE, where)
    form, count, rate, width = _format(raw, *chunks["fmt "], order, where)
    tracks = _track_names(raw[slice(chunks["iXML"][0], sum(chunks["iXML"]))], count) if "iXML" in chunks else []
    start, size = chunks["data"]
    notes = []
    if missing is not None:
        size -= size % (count * width)
    if missing:
        words = f"{size} bytes of samples of {size + missing}"
        notes.append(Remark(RecordCode.CUT_OFF, cut(words, size / (count * width) / rate, cut_off, where)))
    if form in _DECODED:
        found, signals = decoded(path, names, "note" if missing else cut_off, tracks)
        signals.notes = (*notes, *(note for note in signals.notes if note.code is not RecordCode.CUT_OFF or not notes))
        return found, signals
    encoding = _ENCODINGS[form, width]
    if size == 0 or size % (count * width):
        raise InputError("recording", f"{size} bytes of samples", f"whole samples of {count} channels, {width} bytes each", where)
    channels = [f"ch{i + 1}" for i in range(count)]
    present = [*channels, *(track for track in tracks if track and track not in channels)]
    places = [the_only(name, present, where) if name not in tracks else the_only(name, tracks, where) for name in names]
    samples = size // (count * width)
    check_declared(samples, len(names), len(raw), where, LARGEST_STORED)

    def part(place: int, first: int, end: int) -> FloatArray:
        # read, not mapped: pages of a mapped file stay in memory as long as there is some
        with path.open("rb", buffering=0) as file:
            file.seek(start + first * count * width)
            block = file.read((end - first) * count * width)
        if len(block) < (end - first) * count * width:
            raise InputError("recording", "a file that became shorter while it was read", COMPLETE, where)
        return _decoded(np.frombuffer(block, np.uint8).reshape(end - first, count, width)[:, place, :], encoding, order)

    first, size = chunks.get("bext", (0, 0))
    started = _moment(raw[first : first + size])
    return float(rate), Signals([kept(StoredChannel(samples, partial(part, place))) for place in places], tuple(notes), started=started)


def _chunks(raw: Bytes, where: str) -> tuple[str, dict[str, tuple[int, int]], int | None]:
    """Byte order, place and size of each chunk, the first of its name, and missing bytes of samples: None where the file ends as declared.

    The samples are cut to what is there; 0 bytes miss where their number was never declared.
    """
    if raw[:4] not in (b"RIFF", b"RIFX", b"RF64", b"BW64") or raw[8:12] != b"WAVE":
        raise InputError("recording", "a file that does not begin with RIFF and WAVE", COMPLETE, where)
    order = ">" if raw[:4] == b"RIFX" else "<"
    chunks: dict[str, tuple[int, int]] = {}
    long, missing = 0, None
    place = 12
    while place + 8 <= len(raw):
        name, size = raw[place : place + 4].decode("latin-1"), struct.unpack_from(f"{order}I", raw, place + 4)[0]
        if name == "ds64" and 24 <= size <= len(raw) - place - 8:
            long = struct.unpack_from("<Q", raw, place + 16)[0]
        if size == _UNKNOWN_LENGTH and name == "data" and long:
            size = long
        if place + 8 + size > len(raw) and name == "data" and "fmt " in chunks:
            there = len(raw) - place - 8
            missing = 0 if not long and size >= _PLACEHOLDER else size - there
            size = there
        if place + 8 + size > len(raw):
            raise InputError("recording", f"a chunk {listed([name.strip()])} that is cut off", COMPLETE, where)
        chunks.setdefault(name, (place + 8, size))
        if len(chunks) > _MOST_CHUNKS:
            raise InputError("recording", f"more than {_MOST_CHUNKS} chunks", f"at most {_MOST_CHUNKS}", where)
        place += 8 + size + size % 2
    return order, chunks, missing


def _format(raw: Bytes, start: int, size: int, order: str, where: str) -> tuple[int, int, int, int]:
    """Format, channels, rate and bytes of a sample, of a block where the library decodes it."""
    if size < 16:
        raise InputError("recording", f"a chunk 'fmt' of {size} bytes", "16 bytes at least", where)
    form, count, rate, _, block, bits = struct.unpack_from(f"{order}HHIIHH", raw, start)
    if form == _EXTENSIBLE and size >= 40 and raw[start + 26 : start + 40] == _SUBFORMAT:
        form = struct.unpack_from(f"{order}H", raw, start + 24)[0]
    if form in _DECODED and count and block and rate:
        return form, count, rate, max(block // count, 1)
    if not count or block % count or (form, block // max(count, 1)) not in _ENCODINGS or not 0 < bits <= 8 * (block // count):
        found = f"format {form}, {count} channels, {bits} bits in {block} bytes"
        raise InputError("recording", found, "PCM of 8, 16, 24 or 32 bits, floats of 32 or 64 bits, µ-law or A-law", where)
    if rate == 0:
        raise InputError(RATE, rate, "a number above 0 [Hz]", where)
    return form, count, rate, block // count


def _decoded(samples: np.ndarray, encoding: str, order: str) -> FloatArray:
    """Floats of full scale 1 from bytes, shape (n, width); integers stand left in their bytes."""
    if encoding == "u1":
        return (samples[:, 0].astype(float) - 128.0) / 128.0
    if encoding == "i3":
        wide = np.zeros((samples.shape[0], 4), dtype=np.uint8)
        wide[:, slice(0, 3) if order == ">" else slice(1, 4)] = samples
        samples, encoding = wide, "i4"
    values = np.ascontiguousarray(samples).view(order + encoding)[:, 0].astype(float)
    return values if encoding[0] == "f" else values / 2.0 ** (8 * int(encoding[1]) - 1)


def _track_names(raw: bytes, count: int) -> list[str]:
    """Names of the channels as recorders write them, empty where there is none."""
    names = [""] * count
    # a document that declares anything is not one of a recorder
    if len(raw) > _LARGEST_NAMES or b"<!" in raw:
        return names
    try:
        root = ElementTree.fromstring(raw.rstrip(b"\0 "))
    except (ElementTree.ParseError, ValueError, LookupError):
        return names
    for track in root.iter("TRACK"):
        place = track.findtext("INTERLEAVE_INDEX", track.findtext("CHANNEL_INDEX", ""))
        if place.isascii() and place.isdigit() and 1 <= int(place[:9]) <= count:
            names[int(place[:9]) - 1] = (track.findtext("NAME") or "").strip()
    return names


def _moment(broadcast: bytes) -> datetime | None:
    """Date and time of a broadcast wave's extension, where it has them: behind its description and its two names of the originator."""
    text = broadcast[320:338].decode("latin-1")
    # separators are the recorder's own
    return moment_of("".join(c if c.isdigit() else " " for c in f"{text[:10]} {text[10:]}"), "%Y %m %d %H %M %S")
