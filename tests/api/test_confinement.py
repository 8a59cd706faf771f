"""A parser that was taken over: what it tries outside its room fails, and what it needs inside works."""

from __future__ import annotations

import ctypes
import json
import os
import platform
import socket
import subprocess
import sys
import textwrap

import pytest

from api import confined, confinement
from api.confinement import Confinement

pytestmark = pytest.mark.skipif(sys.platform != "linux" or platform.machine() not in ("x86_64", "aarch64"), reason="the kernel's own means")

#: Where nothing is refused, nothing is harmed either but its own files.
HOSTILE = textwrap.dedent(
    """
    import ctypes, errno, fcntl, json, os, resource, signal, socket, stat, subprocess, sys, termios, threading
    from pathlib import Path
    from api.confinement import confine

    room, own, other, port, unix, parent = sys.argv[1:]
    port, parent = int(port), int(parent)
    libc, at_hand = ctypes.CDLL(None, use_errno=True), open(own)
    held = confine([Path(own)], [Path(room)])
    def call(name, *arguments):
        # by its number where the C library has no function for it
        if (libc.syscall if isinstance(name, int) else getattr(libc, name))(*([name] if isinstance(name, int) else []), *arguments) < 0:
            raise OSError(ctypes.get_errno(), name)
    def unix_socket():
        with socket.socket(socket.AF_UNIX) as line:
            line.connect(unix)
    def datagram():
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as line:
            line.sendto(b"secret", ("127.0.0.1", port))
    def forked():
        if os.fork() == 0:
            os._exit(0)
    io_uring_setup, pidfd_send_signal, pidfd_getfd, clone3 = 425, 424, 438, 435
    closed_files = {
        "read another": lambda: open(other).read(),
        "write another": lambda: open(other, "a").write("x"),
        "remove another": lambda: os.remove(other),
        "list its folder": lambda: os.listdir(os.path.dirname(other)),
        "move it in": lambda: os.rename(other, room + "/moved"),
        "change its own": lambda: open(own, "a").write("x"),
        "environment of the parent": lambda: open(f"/proc/{parent}/environ").read(),
        "memory of the parent": lambda: open(f"/proc/{parent}/mem", "rb").read(1),
    }
    closed_calls = {
        "link it in": lambda: os.symlink(other, room + "/link"),
        "a second name": lambda: os.link(own, room + "/link"),
        "mode": lambda: os.chmod(own, 0),
        "mode of another": lambda: os.chmod(other, 0),
        "mode of what is open": lambda: os.fchmod(at_hand.fileno(), 0),
        "owner": lambda: os.chown(own, os.getuid(), os.getgid()),
        "times": lambda: os.utime(other, (1, 1)),
        "attribute": lambda: os.setxattr(own, "user.x", b"x"),
        "attributes of the disk": lambda: fcntl.ioctl(at_hand, 0x40086602, b"\\0" * 8),
        "length by name": lambda: os.truncate(other, 0),
        "lock": lambda: fcntl.flock(at_hand, fcntl.LOCK_EX),
        "lease": lambda: fcntl.fcntl(at_hand, fcntl.F_SETLEASE, fcntl.F_RDLCK),
        "signals for another": lambda: fcntl.fcntl(at_hand, fcntl.F_SETOWN, parent),
        "pipe as a file": lambda: os.mkfifo(room + "/pipe"),
        "keys of the terminal": lambda: fcntl.ioctl(at_hand, termios.TIOCSTI, b"x"),
        "limit of the parent": lambda: resource.prlimit(parent, resource.RLIMIT_CPU),
        "its processor time": lambda: resource.setrlimit(resource.RLIMIT_CPU, (1000, -1)),
        "limit of its memory": lambda: resource.setrlimit(resource.RLIMIT_AS, resource.getrlimit(resource.RLIMIT_AS)),
        "priority of the parent": lambda: os.setpriority(os.PRIO_PROCESS, parent, 0),
        "cores of the parent": lambda: os.sched_setaffinity(parent, range(os.cpu_count())),
        "kill the parent": lambda: os.kill(parent, 0),
        "kill a thread of it": lambda: call("tgkill", parent, parent, 0),
        "kill all": lambda: os.kill(0, 0),
        "descriptor of the parent": lambda: os.pidfd_open(parent),
        "signal by it": lambda: call(pidfd_send_signal, 0, 0, None, 0),
        "files by it": lambda: call(pidfd_getfd, 0, 0, 0),
        "trace": lambda: call("ptrace", 16, parent, None, None),
        "read memory": lambda: call("process_vm_readv", parent, None, 0, None, 0, 0),
        "fork": forked,
        "fork anew": lambda: call(clone3, None, 0),
        "a program": lambda: subprocess.run(["/bin/sh", "-c", "true"], check=True),
        "this program": lambda: os.execv("/bin/sh", ["sh", "-c", "true"]),
        "a session": lambda: os.setsid(),
        "namespace": lambda: call("unshare", 0x10000000),
        "memory of System V": lambda: call("shmget", 0, 4096, 0o1666),
        "messages of System V": lambda: call("msgget", 0, 0o1666),
        "memory as a file": lambda: os.memfd_create("x"),
        "ring": lambda: call(io_uring_setup, 1, None),
        "watch": lambda: call("inotify_init1", 0),
        "name of the machine": lambda: call("sethostname", b"x", 1),
        "tcp": lambda: socket.create_connection(("127.0.0.1", port), 2.0).close(),
        "unix": unix_socket,
        "datagram": datagram,
        "a pair": lambda: socket.socketpair(),
    }
    needed = {
        "read its own": lambda: Path(own).read_text(),
        "write": lambda: Path(room, "out").write_text("x" * 100),
        "shorten what is open": lambda: open(room + "/out", "r+").truncate(10),
        "move": lambda: os.replace(room + "/out", room + "/out2"),
        "make and remove": lambda: (Path(room, "gone").write_text("x"), os.remove(room + "/gone")),
        "list": lambda: os.listdir(room),
        "thread": lambda: threading.Thread(target=int).start(),
        "signal to itself": lambda: os.kill(os.getpid(), 0),
        "limits": lambda: resource.getrlimit(resource.RLIMIT_AS),
        "terminal or not": lambda: at_hand.isatty(),
        "import": lambda: __import__("wave"),
        "chance": lambda: os.urandom(8),
    }
    def outcome(attempt):
        try:
            attempt()
            return "done"
        except OSError as error:
            return errno.errorcode[error.errno]
    tried = [{name: outcome(attempt) for name, attempt in each.items()} for each in (closed_files, closed_calls, needed)]
    print(json.dumps([held.files, held.calls, *tried]))
    """
)


@pytest.fixture(scope="module")
def answer(tmp_path_factory):
    folder = tmp_path_factory.mktemp("cut off")
    room, own, other = folder / "room", folder / "uploads" / "own.csv", folder / "uploads" / "other.csv"
    room.mkdir()
    own.parent.mkdir()
    own.write_text("mine")
    other.write_text("a stranger's")
    with socket.create_server(("127.0.0.1", 0)) as server, socket.socket(socket.AF_UNIX) as unix:
        path = folder / "database"
        unix.bind(str(path))
        unix.listen()
        arguments = [str(each) for each in (room, own, other, server.getsockname()[1], path, os.getpid())]
        command = [sys.executable, "-c", HOSTILE, *arguments]
        done = subprocess.run(command, capture_output=True, text=True, timeout=60.0, check=False)
    assert done.returncode == 0, done.stderr
    assert (own.read_text(), other.read_text()) == ("mine", "a stranger's")
    assert [p.name for p in room.iterdir()] == ["out2"]
    assert (room / "out2").read_text() == "x" * 10
    return json.loads(done.stdout)


def test_it_is_said_what_holds(answer):
    files, calls, *_ = answer
    # the kernel is asked for its version of Landlock
    assert files == (ctypes.CDLL(None).syscall(444, None, 0, 1) >= 1)
    assert calls
    assert str(Confinement(True, True)) == "cut off from other files, the network and other processes"
    assert "only" in str(Confinement(files=True))
    assert "limits of memory and time only" in str(Confinement())


def test_system_calls_are_those_that_are_needed(answer):
    """The filter refuses in its own way: nothing else has kept an attempt from its end."""
    files, _, closed_files, closed_calls, needed = answer
    assert set(closed_files.values()) == {"EACCES"} or not files
    assert closed_calls == dict.fromkeys(closed_calls, "ENOSYS")
    assert needed == dict.fromkeys(needed, "done")
    assert (len(closed_files), len(closed_calls), len(needed)) == (8, 44, 12)


def test_compiled_kernels_that_lie_elsewhere_can_be_read(tmp_path, monkeypatch):
    """As those of the container do: without them every sound was "a file that cannot be read" there."""
    assert tmp_path not in confinement._python()
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))
    assert tmp_path in confinement._python()


def test_it_computes_as_the_processes_of_jobs_do(monkeypatch):
    """What libraries are told of the processor changes last bits, and with them a limit by 5e-9."""
    monkeypatch.setenv("OPENBLAS_CORETYPE", "HASWELL")
    assert confined._environment()["OPENBLAS_CORETYPE"] == "HASWELL"
