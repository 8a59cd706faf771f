"""Long recordings to a verdict: seconds and peak memory for every format and length, beside a library that reads the whole file.

``python -m benchmarks reading --seconds 79 200 600``: four channels at 51.2 kHz, cut and judged as an upload is. Every figure comes from a
process of its own, whose kernels and imports are warm; its memory is what it needs beyond that.
"""

from __future__ import annotations

import argparse
import json
import multiprocessing
import resource
import struct
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

import h5py
import numpy as np

RATE, SPEED_RPM, TEETH = 51200.0, 8000.0, 4
NAMES = ("gap_x", "gap_y", "fixture_x", "fixture_y")
FORMATS = ("wav", "h5", "tdms", "parquet", "uff", "csv")
#: Longer tables and universal files (with times point by point) are refused as larger than 256 MB [s].
LONGEST = {"csv": 100.0, "uff": 75.0}
_BLOCK = 1 << 18


def signal(seconds: float) -> Iterator[np.ndarray]:
    """Yield blocks of the channels, shape (n, 4) [V]: run-out, tooth-passing lines and noise."""
    rng, count = np.random.default_rng(1), int(seconds * RATE)
    for start in range(0, count, _BLOCK):
        t = (start + np.arange(min(_BLOCK, count - start))) / RATE
        block = 1e-3 * rng.standard_normal((t.size, 4))
        for order, size in ((1, 0.05), (2, 0.01), (4, 0.03), (8, 0.01), (12, 0.005), (16, 0.002)):
            angle = 2.0 * np.pi * order * 1.0003 * SPEED_RPM / 60.0 * t
            block += size * np.cos(angle[:, None] + order + np.arange(4))
        yield block.astype(np.float32)


def write(path: Path, seconds: float) -> None:
    """Write the recording in the format that the suffix says, block by block where the format allows it."""
    count = int(seconds * RATE)
    if path.suffix == ".wav":
        with path.open("wb") as file:
            form = struct.pack("<HHIIHH", 3, 4, int(RATE), int(RATE) * 16, 16, 32)
            file.write(b"RIFF" + struct.pack("<I", 36 + 16 * count) + b"WAVEfmt " + struct.pack("<I", 16) + form)
            file.write(b"data" + struct.pack("<I", 16 * count))
            for block in signal(seconds):
                file.write(block.tobytes())
    elif path.suffix == ".h5":
        with h5py.File(path, "w") as file:
            file.attrs["sampling_rate_hz"] = RATE
            sets = [file.create_dataset(name, (count,), np.float32) for name in NAMES]
            for k, block in enumerate(signal(seconds)):
                for i, dataset in enumerate(sets):
                    dataset[k * _BLOCK : k * _BLOCK + len(block)] = block[:, i]
    elif path.suffix == ".tdms":
        from nptdms import ChannelObject, TdmsWriter

        with TdmsWriter(str(path)) as writer:
            for block in signal(seconds):
                writer.write_segment([ChannelObject("g", name, block[:, i], {"wf_increment": 1.0 / RATE}) for i, name in enumerate(NAMES)])
    elif path.suffix == ".parquet":
        import pyarrow
        from pyarrow.parquet import ParquetWriter

        schema = pyarrow.schema([(name, pyarrow.float32()) for name in NAMES], {"sampling_rate_hz": str(RATE)})
        with ParquetWriter(path, schema) as writer:
            for block in signal(seconds):
                writer.write_table(pyarrow.table([block[:, i] for i in range(4)], schema=schema))
    elif path.suffix == ".uff":
        from rcsa_ident.io.uff import UffAxis, UffFunction, write_uff

        whole = np.concatenate(list(signal(seconds)))
        axes = {"abscissa_axis": UffAxis(17, "s"), "ordinate": UffAxis(0, "V")}
        write_uff(path, [UffFunction(1, np.arange(count) / RATE, whole[:, i], title=n, **axes) for i, n in enumerate(NAMES)], True)
    else:
        with path.open("w", encoding="utf-8") as file:
            file.write(",".join(NAMES) + "\n")
            for block in signal(seconds):
                np.savetxt(file, block, fmt="%.7g", delimiter=",")


def judge(path: Path) -> str:
    """Return the verdict on the recording, and whatever else was said."""
    from rcsa_ident.base.units import rpm
    from rcsa_ident.cutting.coefficients import CuttingCoefficients
    from rcsa_ident.cutting.conditions import CuttingConditions, Engagement
    from rcsa_ident.cutting.cutter import Cutter
    from rcsa_ident.dynamics.coordinates import Dof
    from rcsa_ident.io.recordings.readers import read_cut
    from rcsa_ident.setup.cut import Cut
    from rcsa_ident.signals.measurement import measure_cut
    from rcsa_ident.signals.recording import Quantity, Sensor

    names = [f"ch{i + 1}" for i in range(4)] if path.suffix == ".wav" else NAMES
    kinds = [(Quantity.DISPLACEMENT, 1e4)] * 2 + [(Quantity.ACCELERATION, 1e-3)] * 2
    sensors = tuple(Sensor(n, q, a, s) for n, (q, s), a in zip(names, kinds, (Dof.X, Dof.Y) * 2, strict=True))
    conditions = CuttingConditions(rpm(SPEED_RPM), 1e-3, 1e-4, Engagement.from_immersion(0.5, "down"))
    recording, _ = read_cut(sensors, RATE, Cut("cut", "tool", conditions, path))
    return str(measure_cut("cut", "tool", recording, None, Cutter(TEETH, 0.012), conditions, CuttingCoefficients(9e8, 0.3)))


def peer(path: Path) -> str:
    """Read the whole file as the usual library does."""
    if path.suffix == ".wav":
        from scipy.io import wavfile

        return f"scipy {wavfile.read(path)[1].shape}"
    if path.suffix == ".h5":
        with h5py.File(path) as file:
            return f"h5py {sum(file[name][()].size for name in NAMES)}"
    if path.suffix == ".tdms":
        from nptdms import TdmsFile

        return f"npTDMS {sum(channel[:].size for channel in TdmsFile.read(path)['g'].channels())}"
    if path.suffix == ".parquet":
        from pyarrow.parquet import read_table

        return f"pyarrow {read_table(path).num_rows}"
    if path.suffix == ".uff":
        return f"bytes {len(path.read_bytes())}"
    import pandas

    return f"pandas {pandas.read_csv(path).shape}"


def _measured(path: Path, what: str) -> tuple[float, float, float, str]:
    """Seconds by the clock and of processor time, peak memory [MB] of a fresh process, and what it says."""
    done = subprocess.run(
        [sys.executable, "-m", "benchmarks.reading", "--one", what, str(path)], stdout=subprocess.PIPE, text=True, check=True
    )
    clock, cpu, memory, words = json.loads(done.stdout.splitlines()[-1])
    return clock, cpu, memory, words


def _one(what: str, path: Path) -> None:
    from api.reading.examine import warm

    warm()
    call = {"ours": judge, "peer": peer}[what]
    with tempfile.TemporaryDirectory() as folder:
        short = Path(folder) / f"short{path.suffix}"
        write(short, 0.5)
        call(short)
    before, clock, cpu = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss, time.perf_counter(), time.process_time()
    words = call(path)
    spent = time.perf_counter() - clock, time.process_time() - cpu
    print(json.dumps([*spent, (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before) / 1e3, words]))


def main(arguments: list[str]) -> None:
    """Print a line for every format and length."""
    parser = argparse.ArgumentParser(prog="benchmarks reading", description=__doc__)
    parser.add_argument("--seconds", nargs="+", type=float, default=[79.0, 200.0, 600.0])
    parser.add_argument("--formats", nargs="+", choices=FORMATS, default=FORMATS)
    parser.add_argument("--one", nargs=2, help=argparse.SUPPRESS)
    chosen = parser.parse_args(arguments)
    if chosen.one:
        _one(chosen.one[0], Path(chosen.one[1]))
        return
    figures = f"{'of CPU':>9}{'memory':>9}"
    print(f"{'format':<9}{'length':>7}{'file':>9}{'verdict':>10}{figures}{'peer':>10}{figures}{'ratio':>7}  says")
    for seconds in chosen.seconds:
        for form in chosen.formats:
            if seconds > LONGEST.get(form, seconds):
                continue
            with tempfile.TemporaryDirectory() as folder:
                path = Path(folder) / f"long.{form}"
                # a child begins with the largest memory that its parent ever had
                maker = multiprocessing.get_context("spawn").Process(target=write, args=(path, seconds))
                maker.start()
                maker.join()
                size = path.stat().st_size / 1e6
                ours, theirs = _measured(path, "ours"), _measured(path, "peer")
                shown = [f"{clock:>8.2f} s{cpu:>7.2f} s{memory:>6.0f} MB" for clock, cpu, memory, _ in (ours, theirs)]
                says = f"{ours[1] / theirs[1]:>7.1f}  {ours[3]}; {theirs[3]}"
                print(f"{form:<9}{seconds:>5.0f} s{size:>6.0f} MB{shown[0]}{shown[1]}{says}", flush=True)


if __name__ == "__main__":
    main(sys.argv[1:])
