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

from api import confinement
from api.confinement import Confinement

pytestmark = pytest.mark.skipif(sys.platform != "linux" or platform.machine() not in ("x86_64", "aarch64"), reason="the kernel's own means")

HOSTILE = textwrap.dedent(
    """
    import json, os, signal, socket, subprocess, sys
    from pathlib import Path
    from api.confinement import confine

    room, own, other, port, unix, parent = sys.argv[1:]
    held = confine([Path(own)], [Path(room)])
    def unix_socket():
        with socket.socket(socket.AF_UNIX) as line:
            line.connect(unix)
    def datagram():
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as line:
            line.sendto(b"secret", ("127.0.0.1", int(port)))
    tries = {
        "read another": lambda: open(other).read(),
        "write another": lambda: open(other, "a").write("x"),
        "remove another": lambda: os.remove(other),
        "list its folder": lambda: os.listdir(os.path.dirname(other)),
        "move it in": lambda: os.rename(other, room + "/moved"),
        "link it in": lambda: (os.symlink(other, room + "/link"), open(room + "/link").read()),
        "change its own": lambda: open(own, "a").write("x"),
        "environment of the parent": lambda: open(f"/proc/{parent}/environ").read(),
        "memory of the parent": lambda: open(f"/proc/{parent}/mem", "rb").read(1),
        "kill the parent": lambda: os.kill(int(parent), signal.SIGTERM),
        "tcp": lambda: socket.create_connection(("127.0.0.1", int(port)), 2.0).close(),
        "unix": unix_socket,
        "datagram": datagram,
        "a program": lambda: subprocess.run(["/bin/sh", "-c", "true"], check=True),
    }
    found = {}
    for name, attempt in tries.items():
        try:
            attempt()
            found[name] = "done"
        except OSError as error:
            found[name] = "refused"
    Path(room, "out").write_text(Path(own).read_text())
    Path(room, "out2").write_text(Path(room, "out").read_text())
    os.remove(room + "/out")
    import wave  # what is imported late is still found
    print(json.dumps([held.files, held.network, found]))
    """
)

#: Tries that only the closed file system refuses.
FILES = {"read another", "write another", "remove another", "list its folder", "move it in", "link it in", "change its own"}
FILES |= {"environment of the parent", "memory of the parent"}


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
    assert [p.name for p in room.iterdir() if not p.is_symlink()] == ["out2"]
    assert (room / "out2").read_text() == "mine"
    return json.loads(done.stdout)


def test_it_is_said_what_holds(answer):
    files, network, _ = answer
    # the kernel is asked for its version of Landlock
    assert files == (ctypes.CDLL(None).syscall(444, None, 0, 1) >= 1)
    assert network
    assert str(Confinement(True, True)) == "cut off from other files, the network and other processes"
    assert "only" in str(Confinement(files=True))
    assert "limits of memory and time only" in str(Confinement())


def test_nothing_else_is_reached(answer):
    files, _, found = answer
    assert len(found) == 14
    reached = {name for name, outcome in found.items() if outcome != "refused"}
    assert reached == (set() if files else reached & FILES)


def test_compiled_kernels_that_lie_elsewhere_can_be_read(tmp_path, monkeypatch):
    """As those of the container do: without them every sound was "a file that cannot be read" there."""
    assert tmp_path not in confinement._python()
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))
    assert tmp_path in confinement._python()
