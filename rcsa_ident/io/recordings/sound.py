"""Sound files through libsndfile: FLAC, AIFF, CAF, Wave64, Ogg, MP3 and the companded kinds of WAV; full scale 1, channels ch1, ch2, ...

Only wanted containers reach the library. What it decodes is counted against the file's size and goes to the disk in blocks, so that memory
does not grow with the length.
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path

from rcsa_ident.base.arrays import FloatArray
from rcsa_ident.base.errors import InputError
from rcsa_ident.base.remarks import Remark
from rcsa_ident.io.channels import LARGEST_STORED, RATE, Channel, Scratch, Signals, cannot_be_read, check_declared, the_only
from rcsa_ident.io.files import existing_file
from rcsa_ident.signals.verdict import RecordCode

COMPLETE = "a complete sound file: WAV, Wave64, AIFF, CAF, FLAC, Ogg or MP3"
_HEADS = (b"RIFF", b"RIFX", b"RF64", b"riff", b"FORM", b"caff", b"fLaC", b"OggS", b"ID3")
#: Beginnings of the names of encodings that leave out what ears do not miss.
_LOSSY = ("VORBIS", "OPUS", "MPEG", "IMA_ADPCM", "MS_ADPCM", "GSM", "G72", "NMS", "VOX", "DWVW")
_LARGEST_PAGE = 65536
#: Frames and values of a block.
_FRAMES, _VALUES = 1 << 14, 1 << 20
#: The library's number of frames where the file does not tell.
_UNKNOWN = 1 << 62


def read_channels(path: Path, names: Sequence[str], default_rate: float | None, cut_off: str = "refuse") -> tuple[float, list[Channel]]:
    """Return the sampling rate [Hz] and the named channels, full scale 1, shape (n,) each; long ones on the disk.

    `names`: channels that are wanted: ch1, ch2, ...
    `default_rate` [Hz]: not used: every sound file carries its rate
    `cut_off`: ``refuse`` or ``note``: what a file that ends too early is
    """
    return decoded(path, names, cut_off)


def decoded(path: Path, names: Sequence[str], cut_off: str, tracks: Sequence[str] = ()) -> tuple[float, Signals]:
    """Return rate [Hz] and channels as `read_channels`; `tracks` are further names of the channels, in their order."""
    where = str(path)
    size = existing_file(path, "recording", LARGEST_STORED).stat().st_size
    complete = _is_complete(path, size)
    try:
        import soundfile
    except OSError as error:
        # wheels bring the library for the usual systems only
        raise cannot_be_read(error, "an installation of libsndfile on this system", where) from None
    broken: tuple[type[Exception], ...] = (soundfile.LibsndfileError, RuntimeError, ValueError, OSError, MemoryError)
    try:
        with soundfile.SoundFile(where) as file:
            # from front to back only: to seek after each block costs time and fails where the length is not told
            file.seekable = lambda: False
            own = [f"ch{i + 1}" for i in range(file.channels)]
            present = [*own, *(track for track in tracks if track and track not in own)]
            places = [tracks.index(n) if n in tracks and n not in own else the_only(n, present, where) for n in names]
            if file.samplerate <= 0:
                raise InputError(RATE, file.samplerate, "a number above 0 [Hz]", where)
            known = file.frames < _UNKNOWN
            check_declared(file.frames if known else 0, len(names), size, where, LARGEST_STORED)
            scratch = [Scratch() for _ in names]
            step = max(1, min(_FRAMES, _VALUES // file.channels))
            count = 0
            while not known or count < file.frames:
                try:
                    block: FloatArray = file.read(step, dtype="float64", always_2d=True)
                except broken as error:
                    if not count:
                        raise
                    block, complete = block[:0], complete or f"a file that breaks off ({cannot_be_read(error, '', '').found})"
                if not len(block):
                    break
                count += len(block)
                check_declared(count, len(names), size, where, LARGEST_STORED)
                for column, place in zip(scratch, places, strict=True):
                    column.add(block[:, place])
            if known and count < file.frames:
                complete = complete or f"{count} samples of {file.frames}"
            rate, subtype = float(file.samplerate), file.subtype
    except InputError:
        raise
    except broken as error:
        raise cannot_be_read(error, COMPLETE, where) from None
    if count == 0:
        raise InputError("recording", "no samples", "at least one sample of each channel", where)
    notes = [Remark(RecordCode.CUT_OFF, cut(complete, count / rate, cut_off, where))] if complete else []
    if subtype.startswith(_LOSSY):
        notes.append(Remark(RecordCode.LOSSY, _lossy(subtype)))
    return rate, Signals([column.channel() for column in scratch], tuple(notes))


def cut(found: str, seconds: float, cut_off: str, where: str) -> str:
    """Return the sentence about a file that ends too early. Raises `InputError`: such files are refused."""
    if cut_off == "refuse":
        raise InputError("recording", f"{found}: the file is cut off", COMPLETE, where)
    return f"the file is cut off ({found}): its first {seconds:.4g} s are read"


def _lossy(subtype: str) -> str:
    name = subtype.replace("_", " ").title() if subtype != "OPUS" else "Opus"
    return f"lossy compression ({name}): lines stay where they are, but amplitudes and decays do not; no damping from it"


def _is_complete(path: Path, size: int) -> str:
    """Say what tells that the file is cut off; an empty text where nothing does. What is no sound file is refused."""
    with path.open("rb") as file:
        head = file.read(32)
        file.seek(-min(size, _LARGEST_PAGE), os.SEEK_END)
        tail = file.read(_LARGEST_PAGE)
    if not (head.startswith(_HEADS) or (head[:1] == b"\xff" and len(head) > 1 and head[1] & 0xE0 == 0xE0)):
        raise InputError("recording", "a file that does not begin as one", COMPLETE, str(path))
    declared = 0
    if head.startswith(b"FORM"):
        declared = 8 + int.from_bytes(head[4:8], "big")
        declared = 0 if declared > LARGEST_STORED else declared  # the placeholder of a pipe
    if head.startswith(b"riff"):
        declared = int.from_bytes(head[16:24], "little")
    if declared > size:
        return f"{size} bytes of {declared}"
    page = tail.rfind(b"OggS")
    if head.startswith(b"OggS") and (page < 0 or len(tail) < page + 6 or not tail[page + 5] & 4):
        return "a stream without its last page"
    return ""
