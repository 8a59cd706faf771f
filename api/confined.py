"""Processes for strangers' data, each in a session of its own, without the service's environment; their answers are JSON, never unpickled.

The service pickles calls into their standard input and reads a line of JSON from their standard output for each that it awaits. They end
with the service, however it ends: with it ends their input.
"""

from __future__ import annotations

import contextlib
import ctypes
import json
import logging
import os
import pickle
import queue
import select
import signal
import subprocess
import sys
import threading
from collections.abc import Callable
from typing import Any, BinaryIO

from api import log_lines

#: All that a process is told of the service's environment: language, places of programs, and what libraries that compute are told, which
#: changes last bits: a question has one answer in all processes. No password is.
_VARIABLES = (
    "PATH", "LD_LIBRARY_PATH", "LD_PRELOAD", "HOME", "USERPROFILE", "LOCALAPPDATA", "SYSTEMROOT", "TMPDIR", "TEMP", "TMP", "XDG_CACHE_HOME",
    "LANG", "LC_ALL", "LC_CTYPE", "TZ", "PYTHONHOME", "PYTHONDONTWRITEBYTECODE", "PYTHONUTF8",
)  # fmt: skip
_LIBRARIES = ("OMP_", "OPENBLAS_", "MKL_", "NUMBA_", "NPY_")
_THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS")
#: Of `prctl`.
_SIGNAL_AT_PARENTS_END = 1
#: Longest answer [bytes]; a longer one is the end of its process.
_LONGEST = 1 << 28


class Ended(Exception):
    """The process has ended."""


class Confined:
    """A process that is started at once.

    `serve`: what it does, with its `Line` and the arguments; importable by name
    `*arguments`: that can be pickled
    """

    def __init__(self, serve: Callable[..., None], *arguments: Any) -> None:
        self.process = subprocess.Popen(
            [sys.executable, "-P", "-c", "from api.confined import main; main()"],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            env=_environment(),
            start_new_session=True,
        )
        with contextlib.suppress(Ended):
            # who asks it something finds out
            self.send(serve, arguments)

    @property
    def pid(self) -> int:
        """Its number."""
        return self.process.pid

    @property
    def alive(self) -> bool:
        """Whether it runs."""
        return self.process.poll() is None

    def send(self, *what: Any) -> None:
        """Hand something over; raises `Ended` where nobody takes it."""
        assert self.process.stdin is not None
        try:
            self.process.stdin.write(pickle.dumps(what))
            self.process.stdin.flush()
        except (OSError, ValueError):
            raise Ended from None

    def receive(self, seconds: float) -> Any:
        """Return what it says next.

        Raises `TimeoutError`: it has said nothing in time, and is killed.
        Raises `ValueError`: what it has said is no JSON, or too long.
        Raises `Ended`.
        """
        late = threading.Event()

        def end() -> None:
            late.set()
            self.kill()

        assert self.process.stdout is not None
        timer = threading.Timer(seconds, end)
        timer.start()
        try:
            line = self.process.stdout.readline(_LONGEST)
        except (OSError, ValueError):
            # closed meanwhile
            line = b""
        finally:
            timer.cancel()
        if late.is_set():
            raise TimeoutError
        if not line.endswith(b"\n") and len(line) < _LONGEST:
            raise Ended
        try:
            return json.loads(line)
        except RecursionError:
            raise ValueError("lists in lists without end") from None

    def was_killed(self) -> bool:
        """Wait for its end, and return whether it was ended by force; not by itself, nor by a limit of processor time."""
        # Windows says 1 of a process that another has ended
        return self.process.wait() == -getattr(signal, "SIGKILL", -1)

    def kill(self) -> None:
        """End it at once, with all that it may have started."""
        if not self.alive:
            return
        if hasattr(os, "killpg"):
            with contextlib.suppress(ProcessLookupError):
                os.killpg(self.pid, signal.SIGKILL)
        else:
            self.process.kill()

    def end(self) -> None:
        """End it, and wait for that."""
        self.kill()
        self.process.wait()
        for pipe in (self.process.stdin, self.process.stdout):
            assert pipe is not None
            with contextlib.suppress(OSError):
                pipe.close()


class Line:
    """The end of a process: calls come in, answers go out."""

    def __init__(self, calls: BinaryIO, answers: BinaryIO) -> None:
        self.calls, self.answers = calls, answers
        self.come: queue.SimpleQueue[Any] = queue.SimpleQueue()

    def follow(self) -> None:
        """Take calls from now on, and end with the service."""
        threading.Thread(target=self._follow, daemon=True).start()

    def apart(self, say: Callable[[], str]) -> int:
        """Have a copy of this process say something and end: nothing of what it does stays here.

        `say`: called in the copy; returns JSON
        Returns int: 0, or the signal that has ended the copy before it had said anything; SIGABRT where what it has said is not one line.
        """
        ours, theirs = os.pipe()
        copy = os.fork()
        if copy == 0:
            try:
                # the kernel ends it with this process, which ends with the service
                ctypes.CDLL(None).prctl(_SIGNAL_AT_PARENTS_END, signal.SIGKILL)
                for each in (self.calls.fileno(), self.answers.fileno(), ours):
                    os.close(each)
                with open(theirs, "wb") as line:
                    line.write(say().encode() + b"\n")
            finally:
                os._exit(0)
        os.close(theirs)
        said = self._heard(ours)
        # it may have closed its line and go on
        os.kill(copy, signal.SIGKILL)
        _, status = os.waitpid(copy, 0)
        if said.endswith(b"\n") and said.count(b"\n") == 1:
            self.answers.write(said)
            self.answers.flush()
            return 0
        return os.WTERMSIG(status) if os.WIFSIGNALED(status) and not said else signal.SIGABRT

    def _heard(self, line: int) -> bytes:
        """All that a copy says, while the service is there."""
        waits, said = select.poll(), bytearray()
        waits.register(line, select.POLLIN)
        waits.register(self.calls, 0)
        with open(line, "rb", buffering=0) as copy:
            while len(said) < _LONGEST:
                ready = dict(waits.poll())
                if self.calls.fileno() in ready:
                    os._exit(1)
                part = copy.read(1 << 20)
                if not part:
                    break
                said += part
        return bytes(said)

    def asked(self) -> Any:
        """Return the next call while no thread takes them; where the service has gone, the process ends here."""
        try:
            return pickle.load(self.calls)
        except EOFError:
            os._exit(0)

    def _follow(self) -> None:
        try:
            while True:
                self.come.put(pickle.load(self.calls))
        except EOFError:
            os._exit(0)
        except BaseException:
            logging.getLogger("rcsa_ident.service").exception("a call that cannot be taken")
            os._exit(1)

    @property
    def idle(self) -> bool:
        """Whether no call waits."""
        return self.come.empty()

    def take(self) -> Any:
        """Return the next call; where the service closes the line, the process ends here."""
        return self.come.get()

    def tell(self, answer: str) -> None:
        """Say JSON, which has no line end."""
        self.answers.write(answer.encode() + b"\n")
        self.answers.flush()


def _environment() -> dict[str, str]:
    known = {name: value for name, value in os.environ.items() if name in _VARIABLES or name.startswith(_LIBRARIES)}
    known |= {name: os.environ.get(name, "1") for name in _THREADS}
    # its files are its own: nothing locks them, and nothing else may be locked
    known["HDF5_USE_FILE_LOCKING"] = "FALSE"
    return known | {"PYTHONPATH": os.pathsep.join(os.path.abspath(each) for each in sys.path)}


def main() -> None:
    """In the process: do what the service has started it for."""
    # Ctrl-C may reach it where it has no session of its own
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    log_lines.start()
    answers = os.fdopen(os.dup(1), "wb")
    # what a library prints is no answer
    os.dup2(2, 1)
    serve, arguments = pickle.load(sys.stdin.buffer)
    serve(Line(sys.stdin.buffer, answers), *arguments)
