"""What all formats of recordings have in common: how much may be declared, what is missing, which rate is meant."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from rcsa_ident.arrays import FloatArray
from rcsa_ident.errors import InputError
from rcsa_ident.io.files import MEGABYTE
from rcsa_ident.io.time_base import uniform
from rcsa_ident.io.validated_table import listed

RATE = "sampling_rate_hz"
TIME_COLUMNS = ("time", "time_s")
#: Of a file that is read as a whole, and of its channels as float64.
LARGEST_FILE = 512 * MEGABYTE
LARGEST_DATA = 512 * MEGABYTE
#: Declared bytes per byte on disk: measured signals hardly shrink at all.
LARGEST_RATIO = 200


def check_declared(samples: int, channels: int, size: int, where: str) -> None:
    """Refuse what no file of `size` bytes holds, before memory is asked for it.

    Parameters
    ----------
    samples, channels : int
        Declared number of samples of each channel, and of channels.
    size : int
        Bytes of the file.
    where : str
        The file, for the messages.
    """
    declared = 8 * samples * channels
    if declared > LARGEST_DATA:
        found = f"{declared / MEGABYTE:.3g} MB of declared samples"
        raise InputError("recording", found, f"at most {LARGEST_DATA / MEGABYTE:.0f} MB", where)
    if declared > LARGEST_RATIO * size:
        found = f"{declared} bytes declared in a file of {size} bytes"
        raise InputError("recording", found, f"at most {LARGEST_RATIO} times the file's size", where)


def the_only(name: str, present: Sequence[str], where: str) -> int:
    """Return the place of a channel; one that is missing or stands there twice is refused.

    Parameters
    ----------
    name : str
    present : sequence of str
        Names of all channels, in the file's order.
    where : str
        The file, for the messages.
    """
    places = [i for i, each in enumerate(present) if each == name]
    if len(places) != 1:
        found = "two of that name" if places else "no such channel"
        raise InputError(f"channel {name}", found, f"one channel of the file: {listed(list(present)) or 'it has none'}", where)
    return places[0]


def check_lengths(names: Sequence[str], lengths: Sequence[int], where: str) -> None:
    """Refuse channels of several lengths and channels without a sample.

    Parameters
    ----------
    names : sequence of str
    lengths : sequence of int
        Number of samples of each.
    where : str
        The file, for the messages.
    """
    for name, length in zip(names, lengths, strict=True):
        if length == 0:
            raise InputError(f"channel {name}", "no samples", "at least one sample", where)
    if len(set(lengths)) > 1:
        found = ", ".join(f"{n}: {length}" for n, length in zip(names, lengths, strict=True))
        raise InputError("channels", f"different lengths ({found})", "channels of one length", where)


def snapped(rate: float, spread: float, expected: float | None = None) -> float:
    """Return the rate that was meant: the campaign's or the roundest number of hertz within `spread`, relative, else the rate itself.

    Parameters
    ----------
    rate : float [Hz]
    spread : float [-]
        Relative error that the file's digits leave.
    expected : float or None [Hz]
        The campaign's rate.
    """
    for candidate in (expected, *(round(rate / unit) * unit for unit in (100.0, 10.0, 1.0))):
        if candidate and abs(candidate / rate - 1.0) <= spread:
            return float(candidate)
    return rate


def placed(time: FloatArray, channels: Sequence[FloatArray], expected: float | None) -> tuple[float, list[FloatArray]]:
    """Return the rate [Hz] that times tell and the channels at their places; samples that the times skip are NaN.

    Parameters
    ----------
    time : array, shape (n,) [s]
    channels : sequence of array, shape (n,) each
    expected : float or None [Hz]
        The campaign's rate.

    Raises
    ------
    Irregular
        The times are no multiples of one step.
    """
    rate, index = uniform(time, expected)
    if index[-1] + 1 == index.size:
        return rate, list(channels)
    padded = []
    for values in channels:
        full = np.full(index[-1] + 1, np.nan)
        full[index] = values
        padded.append(full)
    return rate, padded


def lacks(what: str, package: str, extra: str, where: str) -> InputError:
    """Return the error of a format whose package is not installed.

    Parameters
    ----------
    what : str
        The file, in words.
    package, extra : str
        Package that reads it, and the extra of this one that brings it.
    where : str
        The file, for the messages.
    """
    return InputError(
        "recording", f"{what}, and {package} is not installed", f'an installation with pip install "rcsa-ident[{extra}]"', where
    )


def cannot_be_read(error: Exception, allowed: str, where: str) -> InputError:
    """Return one sentence for whatever a library raised on a broken file.

    Parameters
    ----------
    error : Exception
    allowed : str
        What would have been read, in words.
    where : str
        The file, for the messages.
    """
    reason = " ".join((str(error) or type(error).__name__).split())
    return InputError("recording", f"one that cannot be read ({listed([reason[:90]])})", allowed, where)
