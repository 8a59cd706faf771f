"""The system calls that a process for strangers' files needs, and a filter for the kernel: what is not listed is not there.

The start was the baseline policy of Chromium's sandbox, the mask of clone's flags is Docker's. What is refused is answered with ENOSYS, as
by a kernel without it: the C library then takes the older call, as clone for clone3, whose flags a filter cannot see. Numbers are those of
linux/asm/unistd_64.h and asm-generic/unistd.h, structures those of linux/seccomp.h and linux/filter.h.
"""

from __future__ import annotations

import ctypes
import errno
import os
import platform
import struct

#: Number on x86-64 and on AArch64, where it has the call.
_Numbers = tuple[int, int | None]
_ALLOWED: dict[str, _Numbers] = {
    # files that are open
    "read": (0, 63), "write": (1, 64), "readv": (19, 65), "writev": (20, 66), "pread64": (17, 67), "pwrite64": (18, 68), "lseek": (8, 62),
    "close": (3, 57), "dup": (32, 23), "dup2": (33, None), "dup3": (292, 24), "pipe2": (293, 59), "poll": (7, None), "ppoll": (271, 73),
    "select": (23, None), "pselect6": (270, 72), "fsync": (74, 82), "fdatasync": (75, 83), "ftruncate": (77, 46), "fallocate": (285, 47),
    "fadvise64": (221, 223), "fstat": (5, 80), "fstatfs": (138, 44), "getdents64": (217, 61),
    # names of files, which Landlock judges; nothing that changes owner, mode, times or attributes, and no link
    "open": (2, None), "openat": (257, 56), "stat": (4, None), "lstat": (6, None), "newfstatat": (262, 79), "statx": (332, 291),
    "statfs": (137, 43), "access": (21, None), "faccessat": (269, 48), "faccessat2": (439, 439), "readlink": (89, None),
    "readlinkat": (267, 78), "getcwd": (79, 17), "rename": (82, None), "renameat": (264, 38), "renameat2": (316, 276), "unlink": (87, None),
    "unlinkat": (263, 35), "mkdir": (83, None), "mkdirat": (258, 34), "rmdir": (84, None),
    # memory
    "mmap": (9, 222), "munmap": (11, 215), "mprotect": (10, 226), "mremap": (25, 216), "madvise": (28, 233), "msync": (26, 227),
    "brk": (12, 214),
    # threads, the process itself and its signals
    "futex": (202, 98), "set_robust_list": (273, 99), "rseq": (334, 293), "sched_yield": (24, 124), "sched_getaffinity": (204, 123),
    "restart_syscall": (219, 128), "exit": (60, 93), "exit_group": (231, 94), "gettid": (186, 178), "getpid": (39, 172),
    "getppid": (110, 173), "getuid": (102, 174), "geteuid": (107, 175), "getgid": (104, 176), "getegid": (108, 177),
    "getrusage": (98, 165), "rt_sigaction": (13, 134), "rt_sigprocmask": (14, 135), "rt_sigreturn": (15, 139), "sigaltstack": (131, 132),
    # the clock, chance and the machine's size
    "clock_gettime": (228, 113), "clock_getres": (229, 114), "clock_nanosleep": (230, 115), "nanosleep": (35, 101),
    "gettimeofday": (96, 169), "time": (201, None), "times": (100, 153), "getrandom": (318, 278), "sysinfo": (99, 179), "uname": (63, 160),
    "getcpu": (309, 168),
}  # fmt: skip
#: Tests of arguments that a call must pass, each of (place, mask, value); of several groups of tests one.
_Tests = tuple[tuple[int, int, int], ...]
_ALL, _WORD = (1 << 64) - 1, (1 << 32) - 1
_THREAD, _NAMESPACES = 0x10000, 0x7E020080
_PLACES = {"x86_64": 0, "aarch64": 1}
_ARCHITECTURES = {"x86_64": (0xC000003E, 317), "aarch64": (0xC00000B7, 277)}
_LOAD, _AND, _EQUAL, _END = 0x20, 0x54, 0x15, 0x06
_ALLOW, _REFUSE = 0x7FFF0000, 0x00050000 | errno.ENOSYS
#: A row of the filter: code, jump if true, jump if false, number.
_Row = tuple[int, int, int, int]


def _with_arguments() -> dict[str, tuple[_Numbers, tuple[_Tests, ...]]]:
    """Calls that are allowed with some arguments, in the process that asks."""
    own: tuple[int, int, int] = (0, _WORD, os.getpid())
    duplicate, flags, duplicate_on_exec = 0, (1, 2, 3, 4), 1030
    return {
        # a thread of its own, no process and no namespace
        "clone": ((56, 220), (((0, _THREAD | _NAMESPACES, _THREAD),),)),
        "kill": ((62, 129), ((own,),)),
        "tgkill": ((234, 131), ((own,),)),
        # its own limits can be read
        "prlimit64": ((302, 261), (((0, _WORD, 0), (2, _ALL, 0)),)),
        # no locks, no leases, no owner who gets signals
        "fcntl": ((72, 25), tuple(((1, _WORD, each),) for each in (duplicate, *flags, duplicate_on_exec))),
        # whether it is a terminal, and close on exec
        "ioctl": ((16, 29), tuple(((1, _WORD, each),) for each in (0x5401, 0x5450, 0x5451))),
    }


def filter_calls(libc: ctypes.CDLL) -> bool:
    """Have the kernel refuse all other calls to every thread of this process and to what it starts; return whether it does."""
    if platform.machine() not in _PLACES:
        return False
    place = _PLACES[platform.machine()]
    architecture, install = _ARCHITECTURES[platform.machine()]
    # calls of another architecture, the 32-bit ones among them, have other numbers
    rows: list[_Row] = [(_LOAD, 0, 0, 4), (_EQUAL, 1, 0, architecture), (_END, 0, 0, _REFUSE), (_LOAD, 0, 0, 0)]
    for numbers in _ALLOWED.values():
        rows += _if_equal(numbers[place], [(_END, 0, 0, _ALLOW)])
    for numbers, groups in _with_arguments().values():
        rows += _if_equal(numbers[place], [*(row for tests in groups for row in _if_passed(tests)), (_END, 0, 0, _REFUSE)])
    rows.append((_END, 0, 0, _REFUSE))
    code = ctypes.create_string_buffer(b"".join(struct.pack("=HBBI", *row) for row in rows))
    program = struct.pack("@HP", len(rows), ctypes.addressof(code))
    every_thread = 1
    return libc.syscall(install, 1, every_thread, program) == 0


def _if_equal(number: int | None, rows: list[_Row]) -> list[_Row]:
    """Rows for the call of a number; they end the filter."""
    return [] if number is None else [(_EQUAL, 0, len(rows), number), *rows]


def _if_passed(tests: _Tests) -> list[_Row]:
    """Rows that allow a call whose arguments pass all tests; a filter sees each argument in two halves, the lower one first."""
    halves = [(16 + 8 * place + 4 * k, mask >> 32 * k & _WORD, value >> 32 * k & _WORD) for place, mask, value in tests for k in (0, 1)]
    halves = [each for each in halves if each[1]]
    rows: list[_Row] = []
    for left, (offset, mask, value) in enumerate(reversed(halves)):
        rows = [(_LOAD, 0, 0, offset), (_AND, 0, 0, mask), (_EQUAL, 0, 3 * left + 1, value), *rows]
    return [*rows, (_END, 0, 0, _ALLOW)]
