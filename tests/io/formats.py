"""The same channels in every format that recordings come in."""

from __future__ import annotations

import struct
from collections.abc import Callable, Mapping
from pathlib import Path

import h5py
import numpy as np
import pytest
import scipy.io

from rcsa_ident.io.recordings import write_hdf5
from rcsa_ident.io.uff import UffAxis, UffFunction, write_uff

Channels = Mapping[str, np.ndarray]


def wav(path: Path, rate: float, channels: Channels, bits: int = 24, real: bool = False) -> None:
    """Integers of full scale 1 or floats, with the channels' names as recorders write them."""
    table = np.stack(list(channels.values()), axis=1)
    if real:
        data = table.astype(f"<f{bits // 8}").tobytes()
    elif bits == 8:
        data = (np.rint(table * 128.0) + 128).astype("u1").tobytes()
    else:
        whole = np.rint(table * 2.0 ** (bits - 1)).astype("<i4")
        data = np.ascontiguousarray(whole.view("u1").reshape(*table.shape, 4)[..., : bits // 8]).tobytes()
    width, count = bits // 8, len(channels)
    tracks = "".join(
        f"<TRACK><INTERLEAVE_INDEX>{i}</INTERLEAVE_INDEX><NAME>{name}</NAME></TRACK>" for i, name in enumerate(channels, start=1)
    )
    names = f"<BWFXML><TRACK_LIST>{tracks}</TRACK_LIST></BWFXML>".encode()
    form = struct.pack("<HHIIHH", 3 if real else 1, count, int(rate), int(rate) * count * width, count * width, bits)
    chunks = [(b"fmt ", form), (b"iXML", names), (b"data", data)]
    body = b"WAVE" + b"".join(name + struct.pack("<I", len(part)) + part + b"\0" * (len(part) % 2) for name, part in chunks)
    path.write_bytes(b"RIFF" + struct.pack("<I", len(body)) + body)


def mat5(path: Path, rate: float, channels: Channels, packed: bool = True) -> None:
    scipy.io.savemat(path, {**{k: np.asarray(v) for k, v in channels.items()}, "Fs": rate, "note": "rig 4"}, do_compression=packed)


def mat73(path: Path, rate: float, channels: Channels) -> None:
    """A column of MATLAB is one row of HDF5."""
    with h5py.File(path, "w", userblock_size=512) as file:
        for name, values in {**channels, "sampling_rate_hz": np.array([rate])}.items():
            data = np.atleast_2d(values)
            chunks = (1, min(data.shape[1], 8192))
            dataset = file.create_dataset(name, data=data, chunks=chunks, compression="gzip", compression_opts=3)
            dataset.attrs["MATLAB_class"] = np.bytes_({"f": "double"}.get(data.dtype.kind, "int32"))
        file.create_group("#refs#")
    with path.open("rb+") as raw:
        raw.write(f"{'MATLAB 7.3 MAT-file, Platform: GLNXA64':<124s}".encode() + b"\x00\x02IM")


def uff(path: Path, rate: float, channels: Channels, binary: bool = False) -> None:
    axes = {"abscissa_axis": UffAxis(17, "s"), "ordinate": UffAxis(0, "V")}
    write_uff(path, [UffFunction(1, np.arange(v.size) / rate, v, title=k, **axes) for k, v in channels.items()], binary)


def parquet(path: Path, rate: float, channels: Channels, **options: object) -> None:
    pyarrow = pytest.importorskip("pyarrow", reason="pyarrow is not installed")
    from pyarrow.parquet import write_table

    table = pyarrow.table({name: np.asarray(values) for name, values in channels.items()})
    write_table(table.replace_schema_metadata({"sampling_rate_hz": repr(rate)}), path, **options)


def tdms(path: Path, rate: float, channels: Channels, group: str = "cut", **properties: object) -> None:
    nptdms = pytest.importorskip("nptdms", reason="npTDMS is not installed")
    stamps = {"wf_increment": 1.0 / rate, "wf_start_offset": 0.0, **properties}
    with nptdms.TdmsWriter(str(path)) as writer:
        # as a program does that writes while it measures
        for part in range(0, next(iter(channels.values())).size, 20_000):
            writer.write_segment([nptdms.ChannelObject(group, k, np.asarray(v)[part : part + 20_000], stamps) for k, v in channels.items()])


def csv(path: Path, rate: float, channels: Channels) -> None:
    table = np.stack([np.arange(next(iter(channels.values())).size) / rate, *channels.values()], axis=1)
    np.savetxt(path, table, ["%.10f", *["%.9g"] * len(channels)], ",", header=",".join(["time", *channels]), comments="")


def _with(write: Callable[..., None], **options: object) -> Callable[[Path, float, Channels], None]:
    return lambda path, rate, channels: write(path, rate, channels, **options)


#: Suffix, writer and resolution: relative to a sample, and absolute.
FORMATS: dict[str, tuple[str, Callable[[Path, float, Channels], None], float, float]] = {
    "hdf5": (".h5", write_hdf5, 0.0, 0.0),
    "csv": (".csv", csv, 1e-8, 0.0),
    "tdms": (".tdms", tdms, 0.0, 0.0),
    "uff": (".uff", uff, 1e-12, 0.0),
    "uff-binary": (".unv", _with(uff, binary=True), 0.0, 0.0),
    "wav-16": (".wav", _with(wav, bits=16), 0.0, 2.0**-16),
    "wav-24": (".wav", wav, 0.0, 2.0**-24),
    "wav-float": (".wav", _with(wav, bits=32, real=True), 0.0, 0.0),
    "mat-5": (".mat", mat5, 0.0, 0.0),
    "mat-5-plain": (".mat", _with(mat5, packed=False), 0.0, 0.0),
    "mat-7.3": (".mat", mat73, 0.0, 0.0),
    "parquet": (".parquet", parquet, 0.0, 0.0),
}
