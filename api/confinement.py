"""A process that reads strangers' files cuts itself off first: from files, network, other processes and programs, where the kernel can.

Linux's Landlock closes the file system, TCP and signals, a seccomp filter all calls that are not needed (`api.system_calls`). Neither needs
rights, neither can be taken back. The numbers and structures are those of the kernel's header linux/landlock.h.
"""

from __future__ import annotations

import contextlib
import ctypes
import os
import struct
import sys
import sysconfig
from collections.abc import Iterable
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path

from api.system_calls import filter_calls

_NO_NEW_PRIVILEGES = 38
_CREATE_RULESET, _ADD_RULE, _RESTRICT_SELF = 444, 445, 446
_VERSION_FLAG, _PATH_BENEATH = 1, 1
#: Rights over files by the version of Landlock that knows them: all of the first, then moves, truncation, device control.
_FILE_RIGHTS = {1: (1 << 13) - 1, 2: 1 << 13, 3: 1 << 14, 5: 1 << 15}
_READ_FILE, _READ_FOLDER, _WRITE_FILE, _REMOVE_FILE, _MAKE_FILE, _TRUNCATE = 1 << 2, 1 << 3, 1 << 1, 1 << 5, 1 << 8, 1 << 14
_FOR_A_FILE = _READ_FILE | _WRITE_FILE | _TRUNCATE
_TCP, _OUTSIDE = (1 << 2) - 1, (1 << 2) - 1


@dataclass(frozen=True, slots=True)
class Confinement:
    """What holds in a process that has cut itself off.

    `files`: it opens nothing but what it was told. From version 6 of Landlock it sends no signals either.
    `calls`: it makes no system call but those of `api.system_calls`: no socket, process, program, signal to others, change of a file's mode
    """

    files: bool = False
    calls: bool = False

    @property
    def whole(self) -> bool:
        """Whether all of it holds."""
        return self.files and self.calls

    def __str__(self) -> str:
        if self.whole:
            return "cut off from other files, the network and other processes"
        if self.files or self.calls:
            return f"cut off from {'other files' if self.files else 'the network and other processes'} only: this system cannot do more"
        return "held by limits of memory and time only: this system cannot cut it off from files and network"


def confine(readable: Iterable[Path] | None, writable: Iterable[Path] = ()) -> Confinement:
    """Cut this process off; to be called by its only thread, for those that run already are not reached.

    `readable`: files, and folders with all below them, that may still be read. Python's own are, too. None closes no file.
    `writable`: folders in which files may be read, made, written and removed
    """
    if sys.platform != "linux":
        return Confinement()
    libc = ctypes.CDLL(None, use_errno=True)
    if libc.prctl(_NO_NEW_PRIVILEGES, 1, 0, 0, 0) != 0:
        return Confinement()
    alone = len(os.listdir("/proc/self/task")) == 1
    files = readable is not None and _close_files(libc, [*readable, *_python()], writable) and alone
    return Confinement(files, filter_calls(libc))


def _python() -> list[Path]:
    """Where modules and their libraries are; what is imported late is still found."""
    # of a checkout that the service is started in, the packages alone: its data may stand beside them
    own = [Path(spec.origin).parent for spec in map(find_spec, ("api", "rcsa_ident")) if spec is not None and spec.origin is not None]
    places = [*sys.path, sys.prefix, sys.base_prefix, *sysconfig.get_paths().values(), "/usr/lib", "/lib", "/lib64", "/usr/share/zoneinfo"]
    # compiled kernels may lie elsewhere, as in a container
    places.append(os.environ.get("NUMBA_CACHE_DIR", ""))
    return [*own, *(Path(place) for place in dict.fromkeys(places) if place and Path(place) != Path.cwd() and Path(place).exists())]


def _close_files(libc: ctypes.CDLL, readable: Iterable[Path], writable: Iterable[Path]) -> bool:
    version = libc.syscall(_CREATE_RULESET, None, 0, _VERSION_FLAG)
    if version < 1:
        return False
    rights = sum(right for since, right in _FILE_RIGHTS.items() if since <= version)
    numbers = [rights, *([_TCP] if version >= 4 else []), *([_OUTSIDE] if version >= 6 else [])]
    attributes = struct.pack(f"={len(numbers)}Q", *numbers)
    rules = libc.syscall(_CREATE_RULESET, attributes, len(attributes), 0)
    if rules < 0:
        return False
    try:
        # nothing outside is executed: the libraries that are loaded need no right for it
        _allow(libc, rules, readable, (_READ_FILE | _READ_FOLDER) & rights)
        _allow(libc, rules, writable, (_FOR_A_FILE | _READ_FOLDER | _REMOVE_FILE | _MAKE_FILE) & rights)
        return libc.syscall(_RESTRICT_SELF, rules, 0) == 0
    except OSError:
        # better open, and said to be, than without what it needs
        return False
    finally:
        os.close(rules)


def _allow(libc: ctypes.CDLL, rules: int, paths: Iterable[Path], rights: int) -> None:
    for path in paths:
        with contextlib.suppress(FileNotFoundError):
            place = os.open(path, os.O_PATH | os.O_CLOEXEC)
            try:
                beneath = struct.pack("=Qi", rights if path.is_dir() else rights & _FOR_A_FILE, place)
                if libc.syscall(_ADD_RULE, rules, _PATH_BENEATH, beneath, 0) != 0:
                    raise OSError(ctypes.get_errno(), "Landlock refuses a rule", str(path))
            finally:
                os.close(place)
