"""Normalised samples of an upload: the signals of the campaign's sensors and the sensors themselves in HDF5, whatever its format.

Signals stay undivided by their sensitivities, as float32 where that holds every one of them, else as float64: what is read from here
is to the last bit what the commands read from the upload. Chunks of a second let a part be read alone, each with a checksum.
"""

from __future__ import annotations

import errno
import json
import os
from collections.abc import Iterator, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from rcsa_ident.base.arrays import FloatArray
from rcsa_ident.base.errors import InputError
from rcsa_ident.base.remarks import Remark
from rcsa_ident.dynamics.coordinates import Dof
from rcsa_ident.io.channels import RATE, STARTED, Channel, Signals, notes_of, started_of
from rcsa_ident.io.recordings.hdf5 import LARGEST_CHUNK
from rcsa_ident.io.recordings.readers import in_si, read_signals, recorded
from rcsa_ident.setup.cut import Cut
from rcsa_ident.signals.recording import BLOCK, Quantity, Recording, Sensor
from rcsa_ident.signals.verdict import RecordCode

_SENSORS, _NOTES = "sensors", "notes"
#: Most that HDF5 writes beside samples [bytes]: for a chunk, for a dataset, and for a file with its attributes.
_OF_A_CHUNK, _OF_A_DATASET, _OF_A_FILE = 64, 8192, 1 << 17


def write_normalised(path: Path, rate: float, signals: Sequence[Channel], sensors: tuple[Sensor, ...]) -> None:
    """Write the signals of sensors, shape (n,) each, block by block, and sync them to the disk.

    Raises `OSError`: the disk is full: known before the first sample is written, since HDF5 may end the process where a write fails.
    """
    kinds = [np.dtype(np.float32 if all(_single(block) for _, block in _blocks_of(signal)) else np.float64) for signal in signals]
    chunks = [int(min(max(rate, 1.0), LARGEST_CHUNK // 8, signal.size)) for signal in signals]
    with h5py.File(path, "w") as file:
        _reserve(path, sum(_stored(signal.size, chunk, kind) for signal, chunk, kind in zip(signals, chunks, kinds, strict=True)))
        file.attrs[RATE] = float(rate)
        if (started := started_of(signals)) is not None:
            file.attrs[STARTED] = started.isoformat()
        file.attrs[_SENSORS] = json.dumps([asdict(sensor) for sensor in sensors])
        file.attrs[_NOTES] = json.dumps([(note.code, str(note)) for note in notes_of(signals)])
        for i, (signal, chunk, kind) in enumerate(zip(signals, chunks, kinds, strict=True)):
            # a channel's name may not be valid in HDF5
            dataset = file.create_dataset(f"{i}", (signal.size,), kind, chunks=(chunk,), fletcher32=True, track_times=False)
            for start, block in _blocks_of(signal):
                dataset[start : start + block.size] = block.astype(kind, copy=False)
        file.flush()
        length = file.id.get_filesize()
    with path.open("rb+") as written:
        written.truncate(length)
        os.fsync(written.fileno())


def _stored(samples: int, chunk: int, kind: np.dtype[Any]) -> int:
    """Bytes that a dataset takes at most: each of its chunks is whole, and has a checksum and a place in the index."""
    return -(-samples // chunk) * (chunk * kind.itemsize + _OF_A_CHUNK) + _OF_A_DATASET


def _reserve(path: Path, size: int) -> None:
    """Have a file's bytes allocated, where system and file system can; raises `OSError` where the disk has no room for them."""
    if hasattr(os, "posix_fallocate"):
        with path.open("rb+") as file:
            try:
                os.posix_fallocate(file.fileno(), 0, _OF_A_FILE + size)
            except OSError as error:
                if error.errno not in (errno.EOPNOTSUPP, errno.EINVAL):
                    raise


def _blocks_of(signal: Channel) -> Iterator[tuple[int, FloatArray]]:
    for start in range(0, signal.size, BLOCK):
        yield start, signal[start : start + BLOCK]


def _single(signal: FloatArray) -> bool:
    """Whether float32 holds every sample."""
    double = signal.astype(np.float64, copy=False)
    with np.errstate(all="ignore"):
        return signal.dtype == np.float32 or np.array_equal(double.astype(np.float32).astype(np.float64), double, equal_nan=True)


def read_normalised(path: str | Path, in_file: bool = False) -> Recording:
    """Return the samples of an upload in SI.

    `in_file`: leave those of a long recording in the file
    Raises `InputError`: the file is missing or damaged.
    """
    sensors, notes = _about(Path(path))
    rate, signals = read_signals(path, [f"{i}" for i in range(len(sensors))], suffix=".h5")
    return (recorded if in_file else in_si)(rate, Signals(signals, notes, started=signals.started), sensors)


def read_cut_normalised(cut: Cut) -> tuple[Recording, Recording | None]:
    """Return the recordings of a cut with normalised files; the samples of long ones stay in them."""
    return read_normalised(cut.recording, in_file=True), None if cut.air is None else read_normalised(cut.air, in_file=True)


def blocks(path: Path, samples: int) -> Iterator[tuple[int, Recording]]:
    """Yield the first index and the recording of successive parts of so many samples."""
    sensors, _ = _about(path)
    with h5py.File(path, "r", locking=False) as file:
        rate, datasets = float(file.attrs[RATE]), [file[f"{i}"] for i in range(len(sensors))]
        for start in range(0, datasets[0].size, samples):
            yield start, in_si(rate, [dataset[start : start + samples] for dataset in datasets], sensors)


def length(path: Path) -> tuple[float, int]:
    """Return rate [Hz] and number of samples."""
    with h5py.File(path, "r", locking=False) as file:
        return float(file.attrs[RATE]), int(file["0"].size)


def _about(path: Path) -> tuple[tuple[Sensor, ...], tuple[Remark, ...]]:
    """Sensors, and what the reader said of the upload; samples of an earlier release carry no notes."""
    try:
        with h5py.File(path, "r", locking=False) as file:
            notes = json.loads(file.attrs.get(_NOTES, "[]"))
            return tuple(map(_sensor, json.loads(file.attrs[_SENSORS]))), tuple(Remark(RecordCode(code), words) for code, words in notes)
    except (OSError, KeyError, ValueError):
        raise InputError("recording", "samples that are missing or damaged", "an uploaded recording") from None


def _sensor(data: dict[str, Any]) -> Sensor:
    axis = None if data["axis"] is None else Dof(data["axis"])
    return Sensor(**data | {"quantity": Quantity(data["quantity"]), "axis": axis})
