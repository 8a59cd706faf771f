"""HDF5 recordings: one dataset a channel on the root; nothing in the file may point outside of it.

An HDF5 file can link to other files, keep its samples in any file of the machine, or declare terabytes in a few
kilobytes. All that is looked at before a sample is read.
"""

from __future__ import annotations

import math
import struct
import zlib
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from datetime import datetime
from functools import partial
from pathlib import Path

import h5py
import numpy as np
from numpy.typing import ArrayLike

from rcsa_ident.base.arrays import FloatArray
from rcsa_ident.base.errors import InputError, positive
from rcsa_ident.io.channels import LARGEST_DATA, LARGEST_RATIO, LARGEST_STORED, RATE, STARTED, Channel, Signals, StoredChannel, the_only
from rcsa_ident.io.files import MEGABYTE, Bytes, existing_file, mapped, replacing
from rcsa_ident.io.recordings.matlab_elements import wanted
from rcsa_ident.io.validated_table import listed
from rcsa_ident.signals.recording import LONGEST

#: Of the file on disk.
LARGEST_FILE = 2048 * MEGABYTE
LARGEST_CHUNK = 8 * MEGABYTE
MOST_CHUNKS = 100_000
MOST_OBJECTS = 10_000
MOST_HEAP_OBJECTS = 1_000_000
#: Levels of structs.
_DEEPEST = 16
#: Bytes of a unit's name.
_LONGEST_UNIT = 64
FILTERS = {
    h5py.h5z.FILTER_DEFLATE: "deflate",
    h5py.h5z.FILTER_SHUFFLE: "shuffle",
    h5py.h5z.FILTER_FLETCHER32: "fletcher32",
    h5py.h5z.FILTER_LZF: "lzf",
}
#: How a global heap begins, where texts of any length and descriptions of virtual datasets stand: signature, version, size. Then come its
#: objects, each with number, references and size. The three bytes behind the version may be any.
_HEAP, _HEAP_HEAD, _OBJECT = b"GCOL\x01", struct.Struct("<8sQ"), struct.Struct("<HHIQ")
#: How a file begins, perhaps behind a block of its user; bytes up to the length of addresses; and a layout's class, behind its version.
_SIGNATURE, _SUPERBLOCK, _VIRTUAL_LAYOUT = b"\x89HDF\r\n\x1a\n", 14, 3
#: What the library raises on a broken file.
_BROKEN = (OSError, RuntimeError, KeyError, ValueError, TypeError, MemoryError, zlib.error)
_LINKS = {h5py.h5l.TYPE_SOFT: "a soft link", h5py.h5l.TYPE_EXTERNAL: "a link to another file"}


def write_hdf5(path: str | Path, rate: float, channels: Mapping[str, ArrayLike], started: datetime | None = None) -> None:
    """Write channels as float32, contiguous, with the sampling rate on the root, and with the time of the first sample.

    `rate` [Hz]
    `channels`: mapping of name to array, shape (n,). In the units of the file: signal, not yet divided by a sensitivity. A lost sample is
        NaN.
    """
    positive(RATE, rate, "Hz")
    arrays = {name: np.asarray(values, dtype=np.float32) for name, values in channels.items()}
    shapes = {a.shape for a in arrays.values()}
    if len(shapes) != 1 or any(len(s) != 1 or s[0] == 0 for s in shapes):
        raise InputError("channels", ", ".join(map(str, shapes)) or "none", "one or more 1-D arrays of one length", str(path))
    for name in arrays:
        if not name or "/" in name or name == ".":
            raise InputError("channel", name, "a name without '/'", str(path))
    with replacing(path) as part, h5py.File(part, "w") as file:
        file.attrs[RATE] = float(rate)
        if started is not None:
            file.attrs[STARTED] = started.isoformat()
        for name, values in arrays.items():
            # times of writing would make equal recordings differ
            file.create_dataset(name, data=values, track_times=False)


def read_channels(path: Path, names: Sequence[str], default_rate: float | None) -> tuple[float, list[Channel]]:
    """Return the sampling rate [Hz] and the named channels as they stand in the file, shape (n,) each; long ones stay in it.

    `names`: channels that are wanted
    `default_rate` [Hz]: for a file that carries no rate
    """
    where = str(path)
    size = existing_file(path, "recording", LARGEST_FILE).stat().st_size
    try:
        with _opened(path) as file:
            present = _hard_links(file, where)
            datasets = [_dataset(file, name, present, where) for name in names]
            _check_size(datasets, names, size, where)
            rate = _rate(file, datasets, names, default_rate, where)
            channels = [
                StoredChannel(dataset.size, partial(_part, path, name)) if dataset.size > LONGEST else dataset[()]
                for name, dataset in zip(names, datasets, strict=True)
            ]
            return rate, Signals(channels, stored=tuple(_unit(dataset) for dataset in datasets), started=_started(file))
    except InputError:
        raise
    except _BROKEN as error:
        raise InputError("recording", _cause(error), "a complete HDF5 file", where) from None


def told_channels(path: Path) -> list[tuple[str, str]]:
    """Return the vectors of numbers on the root, each with the text of its attribute ``unit`` or ``units``, empty without one."""
    where = str(path)
    existing_file(path, "recording", LARGEST_FILE)
    try:
        with _opened(path) as file:
            vectors = [name for name in _hard_links(file, where) if file.get(name, getclass=True) is h5py.Dataset]
            return [
                (name, _unit(file[name]))
                for name in vectors
                if len(file[name].shape or ()) == 1 and file[name].size > 1 and file[name].dtype.kind in "iuf"
            ]
    except InputError:
        raise
    except _BROKEN as error:
        raise InputError("recording", _cause(error), "a complete HDF5 file", where) from None


def _opened(path: Path) -> h5py.File:
    """Open a file in which the library meets nothing that ends the process, or keeps it for ever.

    It would look for the next object behind one of no size in a global heap for ever, and writes beyond its own memory where the
    description of a virtual dataset claims more than its 32 dimensions.
    """
    raw = mapped(path, "recording", LARGEST_FILE)
    heaps = _heaps(raw, str(path))
    if heaps and _virtual(raw, heaps):
        raise InputError("recording", "a virtual dataset", "samples in the file itself", str(path))
    return h5py.File(path, "r", locking=False)


def _heaps(raw: Bytes, where: str) -> list[int]:
    """Return where global heaps begin, all of which have an end."""
    heaps, seen = [], 0
    heap = raw.find(_HEAP)
    while 0 <= heap <= len(raw) - _HEAP_HEAD.size:
        heaps.append(heap)
        end = min(heap + _HEAP_HEAD.unpack_from(raw, heap)[1], len(raw))
        place = heap + _HEAP_HEAD.size
        while place + _OBJECT.size <= end:
            number, _, _, size = _OBJECT.unpack_from(raw, place)
            seen += 1
            # number 0 is what is left of the heap, its own head included; the others stand at multiples of eight
            if (number == 0 and size < _OBJECT.size) or seen > MOST_HEAP_OBJECTS:
                found = "a heap with an object of no size" if seen <= MOST_HEAP_OBJECTS else f"over {MOST_HEAP_OBJECTS} objects in heaps"
                raise InputError("recording", f"one that cannot be read ({found})", "a complete HDF5 file", where)
            place += size if number == 0 else _OBJECT.size + -(-size // 8) * 8
        heap = raw.find(_HEAP, heap + 1)
    return heaps


def _virtual(raw: Bytes, heaps: Sequence[int]) -> bool:
    """Say whether the layout of a dataset is virtual: it names the heap in which its sources stand, counted from the superblock."""
    base = next((at for at in (0, *(512 << n for n in range(22))) if raw[at : at + len(_SIGNATURE)] == _SIGNATURE), None)
    if base is None or base + _SUPERBLOCK > len(raw):
        # what the library does not open
        return False
    # a file of at most 2 GB has no more in the other bytes of an address
    width = min(raw[base + (13 if raw[base + 8] < 2 else 9)], 4)
    starts = np.array(heaps) - base
    for first in range(0, len(raw), MEGABYTE):
        block = np.frombuffer(raw[first : first + MEGABYTE + 2 + width], np.uint8)
        places = np.flatnonzero(((block[:-1] == 4) | (block[:-1] == 5)) & (block[1:] == _VIRTUAL_LAYOUT))
        places = places[places + 2 + width <= len(block)]
        addresses = sum(block[places + 2 + i].astype(np.int64) << 8 * i for i in range(width))
        if np.isin(addresses, starts).any():
            return True
    return False


def _unit(dataset: h5py.Dataset) -> str:
    return next((text for text in (_text(dataset, name) for name in ("unit", "units")) if text is not None), "")


def _started(file: h5py.File) -> datetime | None:
    """When the first sample was taken; an attribute of that name that is no date and time is somebody else's."""
    text = _text(file, STARTED) or ""
    try:
        return datetime.fromisoformat(text) if "T" in text else None
    except ValueError:
        return None


def _text(item: h5py.File | h5py.Dataset, name: str) -> str | None:
    """A short text that is an attribute, None where there is none."""
    if not h5py.h5a.exists(item.id, name.encode()):
        return None
    described = h5py.h5a.open(item.id, name.encode())
    if described.dtype.kind not in "SO" or math.prod(described.shape) != 1 or described.dtype.itemsize > _LONGEST_UNIT:
        return None
    text = np.ravel(item.attrs[name])[0]
    return (text.decode("utf-8", "replace") if isinstance(text, bytes) else str(text))[:_LONGEST_UNIT]


def _part(path: Path, name: str, first: int, end: int) -> FloatArray:
    """Samples of a dataset that was checked before."""
    try:
        with h5py.File(path, "r", locking=False) as file:
            found: FloatArray = file[name][first:end]
            return found
    except _BROKEN as error:
        raise InputError("recording", _cause(error), "a complete HDF5 file", str(path)) from None


class _MatlabTables:
    """Tables of numbers of an open file of version 7.3: those on the root, and those in structs, which are groups."""

    def __init__(self, file: h5py.File, size: int, kinds: Sequence[str], where: str) -> None:
        self.file, self.size, self.kinds, self.where = file, size, kinds, where
        self.present: list[str] = []
        self._walk(file, "", 0)

    def _walk(self, group: h5py.Group, prefix: str, depth: int) -> None:
        for name in _hard_links(group, self.where):
            self.present.append(prefix + name)
            if depth > _DEEPEST or len(self.present) > MOST_OBJECTS:
                raise InputError("recording", "structs in structs without end", f"{_DEEPEST} levels, {MOST_OBJECTS} variables", self.where)
            # what cells refer to stands in groups of their own
            if not name.startswith("#") and group.get(name, getclass=True) is h5py.Group:
                self._walk(group[name], f"{prefix}{name}.", depth + 1)

    def names(self, beside: str) -> list[str]:
        return self.present

    def _dataset(self, name: str) -> h5py.Dataset:
        the_only(name, self.present, self.where)
        dataset = _dataset(self.file, name.replace(".", "/"), [name.replace(".", "/")], self.where, vectors=True)
        _check_kind(dataset, self.kinds, f"channel {name}", self.where)
        return dataset

    def shape(self, name: str) -> tuple[int, ...]:
        shape: tuple[int, ...] = self._dataset(name).shape[::-1]
        return shape if len(shape) == 2 else (1, *shape)

    def table(self, name: str) -> FloatArray:
        dataset = self._dataset(name)
        _check_size([dataset], [name], self.size, self.where, LARGEST_DATA)
        values: FloatArray = np.atleast_2d(dataset[()].T)
        return values


@contextmanager
def matlab_tables(path: Path, kinds: Sequence[str]) -> Iterator[_MatlabTables]:
    """Open a file of version 7.3, whose rows are MATLAB's columns.

    `kinds`: allowed values of the attribute ``MATLAB_class``; without it the type of the samples decides
    """
    where = str(path)
    size = existing_file(path, "recording", LARGEST_FILE).stat().st_size
    try:
        with _opened(path) as file:
            yield _MatlabTables(file, size, kinds, where)
    except InputError:
        raise
    except _BROKEN as error:
        raise InputError("recording", _cause(error), "a complete HDF5 file", where) from None


def _check_kind(dataset: h5py.Dataset, kinds: Sequence[str], field: str, where: str) -> None:
    """Texts and truths look like whole numbers, but for this attribute."""
    if not h5py.h5a.exists(dataset.id, b"MATLAB_class"):
        return
    described = h5py.h5a.open(dataset.id, b"MATLAB_class")
    fixed = described.dtype.kind == "S" and described.dtype.itemsize <= 64 and math.prod(described.shape) == 1
    kind = bytes(np.ravel(dataset.attrs["MATLAB_class"])[0]).decode("ascii", "replace") if fixed else "no name"
    if kind not in kinds:
        raise InputError(field, f"values of class {kind}", wanted(kind), where)


def _cause(error: Exception) -> str:
    """The library's own reason stands in parentheses behind what it was about to do."""
    text = str(error.args[0]) if error.args else type(error).__name__
    inner = text[text.find("(") + 1 : text.rfind(")")] if "(" in text and ")" in text else text
    return f"one that cannot be read ({' '.join(inner.split())[:90]})"


def _hard_links(file: h5py.Group, where: str) -> list[str]:
    """Names on the root; a link that is not to an object of this very file is refused, read or not."""
    links = file.id.links
    if len(file.id) > MOST_OBJECTS:
        raise InputError("recording", f"{len(file.id)} objects", f"at most {MOST_OBJECTS} objects in the root group", where)
    names = []
    for raw in file.id:
        kind = links.get_info(raw).type
        name = listed([raw.decode("utf-8", "replace")])
        if kind != h5py.h5l.TYPE_HARD:
            raise InputError(f"channel {name}", _LINKS.get(kind, "a user-defined link"), "a dataset in the file itself", where)
        names.append(name)
    return names


def _dataset(file: h5py.File, name: str, present: list[str], where: str, vectors: bool = False) -> h5py.Dataset:
    """The dataset of one channel, of which nothing but the description has been read."""
    field = f"channel {name}"
    if name not in present:
        raise InputError(field, "no such channel", f"a channel of the file: {listed(present) or 'it has none'}", where)
    dataset = file[name]
    if not isinstance(dataset, h5py.Dataset):
        raise InputError(field, f"a {type(dataset).__name__.lower()}", "a dataset", where)
    plist = dataset.id.get_create_plist()
    if plist.get_external_count() > 0:
        raise InputError(field, "samples in an external file", "samples in the file itself", where)
    shape = dataset.shape
    if shape is None or len(shape) not in ((1, 2) if vectors else (1,)) or 0 in shape:
        raise InputError(field, f"shape {shape}", f"a {'vector' if vectors else '1-D dataset'} with at least one sample", where)
    if dataset.dtype.kind not in "biuf":
        raise InputError(field, f"values of type {dataset.dtype}", "real numbers", where)
    filters = [plist.get_filter(i)[0] for i in range(plist.get_nfilters())]
    unknown = [f for f in filters if f not in FILTERS]
    if unknown or len(set(filters)) < len(filters):
        found = f"filter number {unknown[0]}" if unknown else "a filter applied twice"
        raise InputError(field, found, "none, or at most one each of: " + ", ".join(FILTERS.values()), where)
    if dataset.chunks is not None and (size := math.prod(dataset.chunks) * dataset.dtype.itemsize) > LARGEST_CHUNK:
        raise InputError(field, f"chunks of {size / MEGABYTE:.0f} MB", f"chunks of at most {LARGEST_CHUNK / MEGABYTE:.0f} MB", where)
    return dataset


def _check_size(datasets: list[h5py.Dataset], names: Sequence[str], size: int, where: str, largest: int = LARGEST_STORED) -> None:
    """Lengths agree, and what is declared is plausible for a file of `size` bytes and was really written."""
    lengths = {d.size for d in datasets}
    declared = sum(d.size * max(d.dtype.itemsize, 8) for d in datasets)
    if declared > largest:
        raise InputError("recording", f"{declared / MEGABYTE:.3g} MB of declared samples", f"at most {largest / MEGABYTE:.0f} MB", where)
    if declared > LARGEST_RATIO * size:
        found = f"{declared} bytes declared in a file of {size} bytes"
        raise InputError("recording", found, f"at most {LARGEST_RATIO} times the file's size", where)
    if len(lengths) > 1:
        found = ", ".join(f"{n}: {d.size}" for n, d in zip(names, datasets, strict=True))
        raise InputError("channels", f"different lengths ({found})", "channels of one length", where)
    for name, dataset in zip(names, datasets, strict=True):
        if dataset.chunks is None:
            written = dataset.id.get_storage_size() > 0
        else:
            chunks = math.prod(-(-n // c) for n, c in zip(dataset.shape, dataset.chunks, strict=True))
            if chunks > MOST_CHUNKS:
                raise InputError(f"channel {name}", f"{chunks} chunks", f"at most {MOST_CHUNKS} chunks", where)
            written = dataset.id.get_num_chunks() >= chunks
        if not written:
            raise InputError(f"channel {name}", "samples that were never written", "a complete channel", where)
        _check_chunks(dataset, f"channel {name}", where)


def _check_chunks(dataset: h5py.Dataset, field: str, where: str) -> None:
    """No chunk holds more than it declares: the library would inflate whatever is there."""
    if dataset.chunks is None:
        return
    plist = dataset.id.get_create_plist()
    filters = [plist.get_filter(i)[0] for i in range(plist.get_nfilters())]
    declared = math.prod(dataset.chunks) * dataset.dtype.itemsize
    # filters may add a little of their own to what cannot be compressed
    largest = declared + declared // 4 + 1024
    stored: list[tuple[tuple[int, ...], int]] = []
    dataset.id.chunk_iter(lambda info: stored.append((info.chunk_offset, info.size)))
    if any(size > largest for _, size in stored):
        raise InputError(field, "a chunk larger than declared", f"chunks of {declared} bytes", where)
    if h5py.h5z.FILTER_DEFLATE not in filters:
        return
    place = filters.index(h5py.h5z.FILTER_DEFLATE)
    if any(f != h5py.h5z.FILTER_FLETCHER32 for f in filters[place + 1 :]):
        raise InputError(field, "a filter after deflate", "deflate as the last, or with fletcher32 after it", where)
    for offset, _ in stored:
        mask, raw = dataset.id.read_direct_chunk(offset)
        if not mask >> place & 1 and len(zlib.decompressobj().decompress(raw, largest + 1)) > largest:
            raise InputError(field, "a chunk that inflates to more than declared", f"chunks of {declared} bytes", where)


def _rate(file: h5py.File, datasets: list[h5py.Dataset], names: Sequence[str], default: float | None, where: str) -> float:
    """A dataset's own attribute, else the root's, else the campaign's; all channels agree."""
    root = _attribute(file, "the file", where)
    rates = {}
    for name, dataset in zip(names, datasets, strict=True):
        own = _attribute(dataset, f"channel {name}", where)
        rate = own if own is not None else root if root is not None else default
        if rate is None:
            raise InputError(RATE, "nothing", "an attribute of the file, or the campaign's rate [Hz]", where)
        rates[name] = rate
    if len(set(rates.values())) > 1:
        found = ", ".join(f"{n}: {r:g}" for n, r in rates.items())
        raise InputError(RATE, f"different rates ({found})", "one rate for all channels [Hz]", where)
    return positive(RATE, next(iter(rates.values())), "Hz")


def _attribute(item: h5py.File | h5py.Dataset, of: str, where: str) -> float | None:
    # a missing attribute is the usual case for datasets, and asking costs less than an exception
    if not h5py.h5a.exists(item.id, RATE.encode()):
        return None
    described = h5py.h5a.open(item.id, RATE.encode())
    if described.dtype.kind not in "iuf" or math.prod(described.shape) != 1:
        found = "a text" if described.dtype.kind in "OSU" else f"{described.dtype} of shape {described.shape}"
        raise InputError(f"{RATE} of {of}", found, "one number [Hz]", where)
    value = float(np.ravel(item.attrs[RATE])[0])
    try:
        return positive(f"{RATE} of {of}", value, "Hz")
    except InputError as error:
        raise error.at(where) from None
