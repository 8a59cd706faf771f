"""Recordings in and out: one door for all formats, samples in SI behind it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from importlib import import_module
from pathlib import Path
from typing import cast

import numpy as np

from rcsa_ident.base.arrays import FloatArray
from rcsa_ident.base.errors import InputError
from rcsa_ident.io.channels import LARGEST_DATA, Channel, Signals, StoredChannel, notes_of, started_of
from rcsa_ident.io.files import MEGABYTE
from rcsa_ident.setup.cut import Cut
from rcsa_ident.signals.recording import Quantity, Recording, Sensor
from rcsa_ident.signals.told_units import is_untold, quantity_in, volts_in

Reader = Callable[..., tuple[float, Sequence[Channel]]]


def _of(module: str) -> Reader:
    """A format's reader, imported with its library when the first file of that format is read."""

    def read(path: Path, names: Sequence[str], rate: float | None, **options: str) -> tuple[float, Sequence[Channel]]:
        reader = import_module(f"rcsa_ident.io.recordings.{module}")
        found: tuple[float, Sequence[Channel]] = reader.read_channels(path, names, rate, **options)
        return found

    return read


#: A format is a suffix and a function of path, channel names and the campaign's rate, which returns rate and channels.
READERS: dict[str, Reader] = {
    ".h5": _of("hdf5"),
    ".hdf5": _of("hdf5"),
    ".csv": _of("self_describing_tables"),
    ".tdms": _of("tdms"),
    ".uff": _of("uff_records"),
    ".unv": _of("uff_records"),
    ".wav": _of("wav"),
    ".rf64": _of("wav"),
    ".bwf": _of("wav"),
    ".w64": _of("sound"),
    ".aif": _of("sound"),
    ".aiff": _of("sound"),
    ".caf": _of("sound"),
    ".flac": _of("sound"),
    ".ogg": _of("sound"),
    ".opus": _of("sound"),
    ".mp3": _of("sound"),
    ".mat": _of("matlab"),
    ".parquet": _of("parquet"),
}
#: Formats that devices write while they measure: what is left of one that broke off can be read.
SOUND = (".wav", ".rf64", ".bwf", ".w64", ".aif", ".aiff", ".caf", ".flac", ".ogg", ".opus", ".mp3")


def read_recording(
    path: str | Path,
    sensors: tuple[Sensor, ...],
    default_rate: float | None = None,
    cut_off: str = "refuse",
    time: str | None = None,
) -> Recording:
    """Return the sensors' channels of a recording in SI; other channels of the file are left alone.

    Parameters
    ----------
    path : path
        The suffix says the format: one of `READERS`.
    sensors : tuple of Sensor
        Signals are divided by the sensor's sensitivity; a trigger stays as it is.
    default_rate : float or None [Hz]
        Rate of a file that carries none.
    cut_off : str
        What a sound file that ends too early is: ``refuse``, an error, or ``note``, a note on the recording.
    time : str or None
        Name of the vector of times in a MATLAB file, where several stand in it.

    Raises
    ------
    InputError
        The file is broken, hostile or lacks a channel; nothing is half read.

    Examples
    --------
    >>> import rcsa_ident as ri
    >>> sensors = ri.read_campaign("data/sample_runs").sensors
    >>> print(ri.read_recording("data/sample_runs/recordings/S1-ER32-00_cut.h5", sensors))
    0.28 s at 25600 Hz: flange_x, flange_y, fixture_x, fixture_y
    """
    if not sensors:
        raise InputError("sensors", "none", "at least one sensor", str(path))
    rate, signals = read_signals(path, [sensor.name for sensor in sensors], default_rate, cut_off=cut_off, time=time)
    return in_si(rate, signals, sensors)


def read_signals(
    path: str | Path,
    names: Sequence[str],
    default_rate: float | None = None,
    suffix: str | None = None,
    cut_off: str = "refuse",
    time: str | None = None,
) -> tuple[float, Signals]:
    """Return the sampling rate [Hz] and the named channels as they stand in a file, shape (n,) each; long ones may stay in it.

    Where a format has no place for units, names may tell them, as ``acc (mV)``.

    `names`: channels that are wanted
    `default_rate` [Hz]: for a file that carries no rate
    `suffix`: taken in place of the path's own
    `cut_off`, `time`: as with `read_recording`
    Raises `InputError` as with `read_recording`.
    """
    path = Path(path)
    suffix = path.suffix if suffix is None else suffix
    if cut_off not in ("refuse", "note"):
        raise InputError("cut_off", cut_off, "refuse or note")
    reader = READERS.get(suffix.lower())
    if reader is None:
        raise InputError("recording", f"suffix '{suffix}'", "one of " + ", ".join(READERS), str(path))
    options = {"cut_off": cut_off} if suffix.lower() in SOUND else {}
    if time is not None:
        if suffix.lower() != ".mat":
            raise InputError("time", time, "nothing: only of MATLAB files the vector of times is chosen", str(path))
        options = {"time": time}
    # what overflows or is no number is a lost sample, see below
    with np.errstate(all="ignore"):
        try:
            found, signals = reader(path, names, default_rate, **options)
        except InputError as error:
            raise (error if error.where else error.at(str(path))) from None
    signals = signals if isinstance(signals, Signals) else Signals(signals)
    if not signals.units:
        # the grammar of preambles is no business of those who only name this function
        from rcsa_ident.io.text_header import name_and_unit

        stored = signals.stored or ("",) * len(names)
        signals.stored = tuple(unit or name_and_unit(name)[1] for unit, name in zip(stored, names, strict=True))
    return found, signals


class StoredSamples:
    """Samples of a long recording in SI, read where they are asked for: of an array, shape (n, c), it has the shape and slices.

    `rate` [Hz]
    """

    def __init__(self, rate: float, signals: Sequence[Channel], sensors: tuple[Sensor, ...]) -> None:
        self.rate, self.signals, self.sensors = rate, signals, sensors
        self.ndim, self.shape = 2, (signals[0].size, len(sensors))

    def __getitem__(self, part: slice) -> FloatArray:
        return in_si(self.rate, [signal[part] for signal in self.signals], self.sensors).samples


def recorded(rate: float, signals: Sequence[Channel], sensors: tuple[Sensor, ...]) -> Recording:
    """Return signals in SI as `in_si`, but leave those of a long recording where they are."""
    if any(isinstance(signal, StoredChannel) for signal in signals):
        _check_units(signals, sensors)
        return Recording(rate, cast(FloatArray, StoredSamples(rate, signals, sensors)), sensors, notes_of(signals), started_of(signals))
    return in_si(rate, signals, sensors)


def in_si(rate: float, signals: Sequence[Channel], sensors: tuple[Sensor, ...]) -> Recording:
    """Return signals, shape (n,) each, divided by their sensors' sensitivities; a trigger stays as it is.

    `rate` [Hz]
    `signals`: sequence of array, shape (n,) each; as they stand in the file
    """
    _check_units(signals, sensors)
    size = 8 * signals[0].size * len(sensors)
    if size > LARGEST_DATA:
        found = f"{size / MEGABYTE:.3g} MB of samples"
        raise InputError("recording", found, f"at most {LARGEST_DATA / MEGABYTE:.0f} MB where all of them are needed at once")
    samples = np.empty((signals[0].size, len(sensors)))
    with np.errstate(all="ignore"):
        for i, (sensor, values) in enumerate(zip(sensors, signals, strict=True)):
            sensitivity = 1.0 if sensor.quantity is Quantity.TRIGGER else sensor.sensitivity
            np.divide(values[:], sensitivity, out=samples[:, i], dtype=float)
    # an overflow in the acquisition is a lost sample like any other
    samples[np.isinf(samples)] = np.nan
    samples.setflags(write=False)
    return Recording(rate, samples, sensors, notes_of(signals), started_of(signals))


def _check_units(signals: Sequence[Channel], sensors: Sequence[Sensor]) -> None:
    """Refuse sensors that contradict the units which their file says itself, and units that no sensitivity turns into SI."""
    if not isinstance(signals, Signals):
        return
    told = [(unit, quantity, 1.0) for unit, quantity in signals.units]
    told += [(unit, quantity, factor) for unit in signals.stored for factor, quantity in (quantity_in(unit),)]
    for sensor, (unit, quantity, factor) in zip(sensors, told, strict=False):
        if sensor.quantity is Quantity.TRIGGER or is_untold(unit):
            continue
        field = f"sensors.{sensor.name}.sensitivity"
        if quantity not in (None, sensor.quantity):
            raise InputError(f"sensors.{sensor.name}.quantity", str(sensor.quantity), f"{quantity}: the file's unit is {unit}")
        if signals.units and quantity is not None and sensor.sensitivity != 1.0:
            raise InputError(field, sensor.sensitivity, f"1.0: the file says {unit}, and its samples are turned into SI")
        if quantity is None and sensor.sensitivity == 1.0:
            signal = "V" if signals.units and volts_in(unit) is not None else unit
            raise InputError(field, sensor.sensitivity, f"the sensor's sensitivity [{signal} per SI unit]: the file is in {unit}")
        if factor != 1.0 and sensor.sensitivity == 1.0:
            raise InputError(field, sensor.sensitivity, f"{1.0 / factor:.6g} [{unit} per SI unit]: the file is in {unit}")


def read_cut(sensors: tuple[Sensor, ...], default_rate: float | None, cut: Cut) -> tuple[Recording, Recording | None]:
    """Return the recordings of a cut: the cut itself, and its air cut where there is one; the samples of long ones stay in their files.

    `default_rate` [Hz]: for files that carry no rate
    """

    def read(path: Path) -> Recording:
        if not sensors:
            raise InputError("sensors", "none", "at least one sensor", str(path))
        return recorded(*read_signals(path, [sensor.name for sensor in sensors], default_rate), sensors)

    return read(cut.recording), None if cut.air is None else read(cut.air)


def write_recording(path: str | Path, recording: Recording) -> None:
    """Write a recording's channels as its sensors gave them; `read_recording` with the same sensors reads it back."""
    from rcsa_ident.io.recordings.hdf5 import write_hdf5

    gains = [1.0 if s.quantity is Quantity.TRIGGER else s.sensitivity for s in recording.sensors]
    channels = zip(recording.sensors, recording.samples.T, gains, strict=True)
    write_hdf5(path, recording.rate, {sensor.name: samples * gain for sensor, samples, gain in channels}, recording.started)
