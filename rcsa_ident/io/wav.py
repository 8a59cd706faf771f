"""WAV recordings: integers of 8 to 32 bits and floats, full scale 1; the campaign's sensitivity calibrates them."""

from __future__ import annotations

import struct
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from xml.etree import ElementTree

import numpy as np

from rcsa_ident.arrays import FloatArray
from rcsa_ident.errors import InputError
from rcsa_ident.io.channels import LARGEST_STORED, RATE, Channel, StoredChannel, check_declared, kept, the_only
from rcsa_ident.io.files import Bytes, mapped
from rcsa_ident.io.validated_table import listed

COMPLETE = "a complete WAV file"
_PCM, _FLOAT, _EXTENSIBLE = 1, 3, 0xFFFE
#: The last 14 bytes of a sub-format, behind the number of the format.
_SUBFORMAT = bytes.fromhex("000000001000800000aa00389b71")
_ENCODINGS = {(_PCM, 1): "u1", (_PCM, 2): "i2", (_PCM, 3): "i3", (_PCM, 4): "i4", (_FLOAT, 4): "f4", (_FLOAT, 8): "f8"}
_UNKNOWN_LENGTH = 0xFFFFFFFF
_LARGEST_NAMES = 65536
_MOST_CHUNKS = 10_000


def read_channels(path: Path, names: Sequence[str], default_rate: float | None) -> tuple[float, list[Channel]]:
    """Return the sampling rate [Hz] and the named channels, full scale 1, shape (n,) each; long ones stay in the file.

    Channels are called ch1, ch2, ...; where the file names its tracks (iXML), these names count, too.

    Parameters
    ----------
    path : path
    names : sequence of str
        Channels that are wanted.
    default_rate : float or None [Hz]
        For a file that carries no rate.
    """
    where = str(path)
    raw = mapped(path, "recording", LARGEST_STORED)
    order, chunks = _chunks(raw, where)
    for name in ("fmt ", "data"):
        if name not in chunks:
            raise InputError("recording", f"no chunk '{name.strip()}'", COMPLETE, where)
    count, rate, width, encoding = _format(raw, *chunks["fmt "], order, where)
    start, size = chunks["data"]
    if size == 0 or size % (count * width):
        raise InputError("recording", f"{size} bytes of samples", f"whole samples of {count} channels, {width} bytes each", where)
    channels = [f"ch{i + 1}" for i in range(count)]
    tracks = _track_names(raw[slice(chunks["iXML"][0], sum(chunks["iXML"]))], count) if "iXML" in chunks else channels
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

    return float(rate), [kept(StoredChannel(samples, partial(part, place))) for place in places]


def _chunks(raw: Bytes, where: str) -> tuple[str, dict[str, tuple[int, int]]]:
    """Byte order, and place and size of each chunk, the first of its name."""
    if raw[:4] not in (b"RIFF", b"RIFX", b"RF64", b"BW64") or raw[8:12] != b"WAVE":
        raise InputError("recording", "a file that does not begin with RIFF and WAVE", COMPLETE, where)
    order = ">" if raw[:4] == b"RIFX" else "<"
    chunks: dict[str, tuple[int, int]] = {}
    long = 0
    place = 12
    while place + 8 <= len(raw):
        name, size = raw[place : place + 4].decode("latin-1"), struct.unpack_from(f"{order}I", raw, place + 4)[0]
        if name == "ds64" and 24 <= size <= len(raw) - place - 8:
            long = struct.unpack_from("<Q", raw, place + 16)[0]
        if size == _UNKNOWN_LENGTH and name == "data" and long:
            size = long
        if place + 8 + size > len(raw):
            raise InputError("recording", f"a chunk {listed([name.strip()])} that is cut off", COMPLETE, where)
        chunks.setdefault(name, (place + 8, size))
        if len(chunks) > _MOST_CHUNKS:
            raise InputError("recording", f"more than {_MOST_CHUNKS} chunks", f"at most {_MOST_CHUNKS}", where)
        place += 8 + size + size % 2
    return order, chunks


def _format(raw: Bytes, start: int, size: int, order: str, where: str) -> tuple[int, int, int, str]:
    """Channels, rate, bytes of a sample and its encoding."""
    if size < 16:
        raise InputError("recording", f"a chunk 'fmt' of {size} bytes", "16 bytes at least", where)
    form, count, rate, _, block, bits = struct.unpack_from(f"{order}HHIIHH", raw, start)
    if form == _EXTENSIBLE and size >= 40 and raw[start + 26 : start + 40] == _SUBFORMAT:
        form = struct.unpack_from(f"{order}H", raw, start + 24)[0]
    if not count or block % count or (form, block // max(count, 1)) not in _ENCODINGS or not 0 < bits <= 8 * (block // count):
        found = f"format {form}, {count} channels, {bits} bits in {block} bytes"
        raise InputError("recording", found, "PCM of 8, 16, 24 or 32 bits or floats of 32 or 64 bits", where)
    if rate == 0:
        raise InputError(RATE, rate, "a number above 0 [Hz]", where)
    return count, rate, block // count, _ENCODINGS[form, block // count]


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
