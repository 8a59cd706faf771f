"""Recordings that tell themselves: names, units and rate from the file's own text; what cannot be told is asked for by name."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from rcsa_ident.errors import InputError
from rcsa_ident.io.recordings import read_signals
from rcsa_ident.io.told_tables import OpenChannel, OpenRecording, told_table
from rcsa_ident.signals.recording import Quantity

#: Tables of text.
TEXT = (".csv", ".txt", ".dat", ".tsv", ".asc")
#: Formats of sound.
_SOUND = {".wav", ".flac", ".ogg", ".oga", ".opus", ".aiff", ".aif", ".caf", ".mp3", ".w64", ".rf64", ".au"}


def open_recording(path: str | Path, names: Sequence[str] = (), default_rate: float | None = None, suffix: str = "") -> OpenRecording:
    """Return a recording as its file tells it: text tables with names and units above them, and sound, without settings.

    Parameters
    ----------
    path : path
        Formats that do not list their channels here need `names`.
    names : sequence of str
        Channels that are wanted; none for all.
    default_rate : float or None [Hz]
        Rate of a file that carries none.
    suffix : str
        Format of a file whose name does not tell it.

    Raises
    ------
    InputError
        The file cannot be read, or does not tell what is needed; the message names the option that does.
    """
    path = Path(path)
    suffix = (suffix or path.suffix).lower()
    if suffix in TEXT:
        return told_table(path, default_rate)
    if suffix in _SOUND:
        return _sound(path, names, suffix)
    if not names:
        raise InputError("channel", "none", f"names of channels: those of a file '{suffix}' are not listed here", str(path))
    rate, signals = read_signals(path, names, default_rate, suffix)
    return OpenRecording(rate, tuple(OpenChannel(name, "", None, signal[:]) for name, signal in zip(names, signals, strict=True)))


def _sound(path: Path, names: Sequence[str], suffix: str) -> OpenRecording:
    """The first channel of a sound, or those that are named: those of one recorder hear nearly the same."""
    wanted = list(names) or ["ch1"]
    rate, signals = read_signals(path, wanted, suffix=suffix)
    channels = tuple(OpenChannel(name, "", Quantity.SOUND, signal[:]) for name, signal in zip(wanted, signals, strict=True))
    return OpenRecording(rate, channels, () if names else ("taken as sound, the first channel of the file",))
