"""The process that reads uploads: what costs more than its limits is refused in words, and the next one is read."""

from __future__ import annotations

import asyncio
import errno
import importlib
import io
import json
import os
import shutil
import signal
import subprocess
import sys
import tempfile
import threading
import time
from contextlib import suppress
from pathlib import Path

import numpy as np
import psutil
import pytest

from api.confined import Confined
from api.files import Full
from api.reading.reader import Limits, Reader, _answer
from api.reading.room import Room
from api.reading.samples import write_normalised
from api.work.pool import Busy
from rcsa_ident.base.errors import InputError
from tests.fixtures.waiting import PATIENCE, ended, until

LIMITS = Limits(memory=512, seconds=1.0, wall_seconds=60.0, calls=50)
COSTLY = "costs more than 512 MiB or 1 s to read"


def nothing():
    """Of what reading needs, which these calls do not."""


def much(megabytes):
    return len(bytearray(megabytes << 20))


def much_by_numpy(megabytes):
    return float(np.ones(megabytes << 17).sum())


def long():
    end = time.process_time() + 60.0
    while time.process_time() < end:
        pass


def refuse():
    raise InputError("channel x", "nothing", "something", "cut.h5")


def bug():
    raise ZeroDivisionError("a secret detail")


def nan():
    return float("nan")


def no_json():
    return object()


def end(by):
    os.kill(os.getpid(), by)


def write(size):
    with tempfile.TemporaryFile() as file:
        return file.truncate(size)


def no_space():
    raise OSError(errno.ENOSPC, "no space left on the device")


@pytest.mark.slow
@pytest.mark.parametrize(("call", "arguments"), [(refuse, ()), (bug, ()), (end, (signal.SIGSEGV,))], ids=["refused", "failed", "ended"])
def test_no_file_is_blamed_while_the_disk_is_full(reader, monkeypatch, call, arguments):
    """Libraries fail in many ways where they cannot write."""
    with monkeypatch.context() as short:
        short.setattr("shutil.disk_usage", lambda _: shutil._ntuple_diskusage(10**10, 10**10, 0))
        with pytest.raises(Full):
            ask(reader, call, *arguments)
        assert ask(reader, pow, 2, 5) == 32
    with pytest.raises(InputError):
        ask(reader, call, *arguments)


@pytest.mark.slow
def test_a_reader_that_cannot_begin_begins_when_there_is_room(tmp_path, monkeypatch):
    found = Reader(LIMITS, 1, nothing, tmp_path)
    with monkeypatch.context() as short:
        short.setattr("tempfile.mkdtemp", lambda **_: no_space())
        found.start()
        with pytest.raises(OSError, match="no space left"):
            ask(found, pow, 2, 5)
    try:
        assert ask(found, pow, 2, 5) == 32
    finally:
        found.stop()


def test_what_was_deleted_meanwhile_is_missed_by_its_reader(reader, tmp_path):
    (tmp_path / "there").write_text("1")
    assert ask(reader, are_there, tmp_path / "gone", tmp_path / "there", tmp_path / "gone too") == [False, True, False]


def are_there(*paths):
    return [path.exists() for path in paths]


def lines_of(text, path, other):
    return [text, path.read_text(), other and other.read_text()]


@pytest.fixture(scope="module")
def reader():
    found = Reader(LIMITS, 1, nothing)
    with pytest.MonkeyPatch.context() as secret:
        secret.setenv("RCSA_IDENT_DATABASE", "postgresql://service:password@host/store")
        secret.setenv("PGPASSWORD", "password")
        found.start()
        assert ask(found, pow, 2, 5) == 32
    yield found
    found.stop()


def ask(reader, call, *arguments):
    return asyncio.run(reader.run(call, *arguments))


@pytest.mark.slow
def test_answers_and_refusals_come_back(reader):
    assert ask(reader, os.getpid) != os.getpid()
    with pytest.raises(InputError) as refused:
        ask(reader, refuse)
    assert (refused.value.field, refused.value.found, refused.value.allowed, refused.value.where) == (
        "channel x",
        "nothing",
        "something",
        "cut.h5",
    )
    assert reader.waiting == 0


@pytest.mark.slow
@pytest.mark.parametrize(
    ("call", "arguments"),
    [(much, (600,)), (much_by_numpy, (600,)), (long, ()), (end, (signal.SIGSEGV,)), (end, (signal.SIGABRT,))],
    ids=["memory", "memory by a library", "core", "fault", "abort"],
)  # fmt: skip
def test_what_costs_too_much_is_refused_and_the_next_is_read(reader, call, arguments):
    with pytest.raises(InputError, match=COSTLY):
        ask(reader, call, *arguments)
    assert ask(reader, much, 100) == 100 << 20


def full():
    """As HDF5 tells it."""
    write_normalised(Path("/dev/full"), 1000.0, [np.ones(1000)], ())


@pytest.mark.slow
@pytest.mark.skipif(not Path("/dev/full").exists(), reason="a device that is always full")
def test_a_full_disk_is_no_fault_of_the_file(reader):
    assert json.loads(_answer(full, (), {})) == ["full", ""]
    with pytest.raises(Full):
        ask(reader, no_space)


@pytest.mark.slow
def test_what_sleeps_is_ended_by_the_clock():
    found = Reader(Limits(wall_seconds=3.0), 1, nothing)
    found.start()
    with pytest.raises(InputError, match="costs more than 2048 MiB or 60 s"):
        ask(found, time.sleep, 600)
    assert ask(found, pow, 2, 5) == 32
    found.stop()


@pytest.mark.slow
def test_what_is_allowed_is_counted_for_each_alone(reader):
    """Not together: the process lives on."""
    first = reader.child.process.pid
    for _ in range(4):
        ask(reader, much, 300)
        ask(reader, _burn, 0.4)
    assert reader.child.process.pid == first


def _burn(seconds):
    end = time.process_time() + seconds
    while time.process_time() < end:
        pass


@pytest.mark.parametrize("call", [bug, nan, no_json])
def test_a_bug_costs_one_answer_and_tells_no_details(reader, call):
    with pytest.raises(InputError, match="cannot be read") as refused:
        ask(reader, call)
    assert "secret" not in str(refused.value)


def test_no_file_grows_without_end(reader):
    assert ask(reader, write, 10**6) == 10**6
    with pytest.raises(InputError):
        ask(reader, write, 10**10)


def test_a_call_sees_its_files_alone(reader, tmp_path):
    """Under other names; what it has been given is as it was, and nothing is left for the next."""
    paths = [tmp_path / name for name in ("one.csv", "two.csv")]
    for path in paths:
        path.write_text(path.stem)
    assert ask(reader, lines_of, "x", *paths) == ["x", "one", "two"]
    assert ask(reader, lines_of, "x", paths[0], None) == ["x", "one", None]
    with pytest.raises(InputError, match="cannot be read"):
        ask(reader, _read, str(paths[0]))
    assert [path.read_text() for path in paths] == ["one", "two"]
    room = reader.child.room
    assert not list(room.given.iterdir())
    assert not list(room.made.iterdir())


@pytest.mark.skipif(sys.platform != "linux", reason="sessions and limits of POSIX, and the kernel's own means")
def test_a_process_is_told_nothing_and_alone_in_its_session(reader):
    environment, threads, files = ask(reader, about_itself)
    assert {"RCSA_IDENT_DATABASE", "PGPASSWORD"}.isdisjoint(environment)
    assert "password" not in json.dumps(environment)
    assert environment["OMP_NUM_THREADS"] == "1"
    assert os.getsid(reader.child.process.pid) == reader.child.process.pid
    assert threads == [0, 0]
    # the log twice, and where its answer goes
    assert len(files) == 3


def about_itself():
    def is_open(number):
        try:
            return bool(os.fstat(number))
        except OSError:
            return False

    limits = importlib.import_module("resource")
    return [dict(os.environ), limits.getrlimit(limits.RLIMIT_NPROC), [each for each in range(256) if is_open(each)]]


@pytest.mark.skipif(sys.platform != "linux", reason="a copy of the process answers each call")
def test_no_call_sees_what_another_has_left(reader):
    """A file that has taken the process over has taken over its own call, and cannot answer the next one."""
    ask(reader, leave_something)
    assert not ask(reader, is_left)
    with pytest.raises(InputError, match=COSTLY):
        ask(reader, answer_twice)
    assert ask(reader, pow, 2, 5) == 32
    assert len({ask(reader, os.getpid) for _ in range(3)}) == 3
    assert reader.child.held.whole


def leave_something():
    os.left = True


def is_left():
    return hasattr(os, "left")


def answer_twice():
    """On every line that is open."""
    for number in range(3, 64):
        with suppress(OSError):
            os.write(number, b'["answer", 1]\n["answer", 2]\n')


@pytest.mark.skipif(sys.platform != "linux", reason="the kernel's own means")
def test_a_stored_file_stays_as_it_is(reader, tmp_path):
    """Its process is given a second name of it, not a copy, which takes time and room; where no filter holds it is a copy."""
    path = tmp_path / "stored.csv"
    path.write_text("stored")
    before = path.stat()
    for call in (_spoil_mode, os.utime, _spoil_owner):
        with pytest.raises(InputError, match="cannot be read"):
            ask(reader, call, path)
    after = path.stat()
    assert (after.st_mode, after.st_mtime_ns, after.st_uid) == (before.st_mode, before.st_mtime_ns, before.st_uid)
    assert ask(reader, names_of, path) == 2
    room = Room(tmp_path / "room")
    (seen,) = room.take_in((path,))
    assert (seen.read_text(), names_of(seen)) == ("stored", 1)


def _spoil_mode(path):
    path.chmod(0)


def _spoil_owner(path):
    os.chown(path, os.getuid(), os.getgid())


def names_of(path):
    return path.stat().st_nlink


def test_what_is_no_answer_ends_its_process(reader, monkeypatch):
    """As of a process that a file has taken over."""
    for said in ("[", "1", '["answer"]', '["refused", 1]', '["refused", ["too", "few"]]', "[" * 100_000):
        with monkeypatch.context() as taken_over:
            taken_over.setattr(reader.child.process.process, "stdout", io.BytesIO(said.encode() + b"\n"))
            assert reader.child.ask(pow, (2, 5)) == ("costly", None)
        assert reader.child.ended
    reader._replace()
    assert ask(reader, pow, 2, 5) == 32


@pytest.mark.skipif(not hasattr(os, "killpg"), reason="a system without groups of processes")
def test_a_process_ends_with_all_that_it_has_started():
    found = Confined(_starts_another)
    other = found.receive(PATIENCE)
    assert not ended(other)
    found.end()
    until(lambda: ended(other))


def _starts_another(line):
    with subprocess.Popen(["sleep", "1000"]) as other:
        line.tell(json.dumps(other.pid))


def test_rooms_of_a_killed_service_are_removed(tmp_path):
    left = tmp_path / "reading" / "reading-0" / "given"
    left.mkdir(parents=True)
    (left / "0.h5").write_bytes(b"deleted since")
    found = Reader(LIMITS, 1, nothing, tmp_path / "reading")
    found.start()
    try:
        assert not left.exists()
        assert ask(found, pow, 2, 5) == 32
    finally:
        found.stop()
    assert list((tmp_path / "reading").iterdir()) == []


def _read(path):
    return Path(path).read_text(encoding="utf-8")


@pytest.mark.slow
def test_who_is_killed_is_asked_again(reader):
    """Somebody else's doing says nothing about the upload."""
    assert ask(reader, pow, 2, 4) == 16
    child = reader.child
    before = child.calls

    def kill():
        until(lambda: child.calls > before)
        child.process.kill()

    killer = threading.Thread(target=kill)
    killer.start()
    assert ask(reader, time.sleep, 1.0) is None
    killer.join()
    assert reader.child is not child
    assert not child.room.folder.exists()
    with pytest.raises(Busy):
        ask(reader, end, signal.SIGKILL)
    assert ask(reader, pow, 2, 5) == 32


def test_too_many_are_refused_at_once(reader):
    async def four():
        return await asyncio.gather(*(reader.run(time.sleep, 0.2) for _ in range(4)), return_exceptions=True)

    # one at work, one waits
    assert [type(each) for each in asyncio.run(four())] == [type(None), type(None), Busy, Busy]


def test_one_at_a_time(reader):
    async def two():
        return await asyncio.gather(reader.run(_stamped), reader.run(_stamped))

    (first, last), (begin, _) = sorted(asyncio.run(two()))
    assert first < last <= begin


def _stamped():
    start = time.monotonic()
    time.sleep(0.1)
    return [start, time.monotonic()]


@pytest.mark.slow
def test_after_so_many_calls_comes_a_new_process():
    found = Reader(Limits(calls=2), 0, nothing)
    with pytest.raises(Busy):
        ask(found, os.getpid)
    found.start()
    pids = [(found.child.process.pid, ask(found, pow, 2, 5))[0] for _ in range(5)]
    found.stop()
    assert pids[0] == pids[1] != pids[2] == pids[3] != pids[4]
    with pytest.raises(Busy):
        ask(found, os.getpid)


@pytest.mark.slow
def test_the_end_waits_for_nobody():
    found = Reader(LIMITS, 3, nothing)
    found.start()

    async def ended():
        await found.run(os.getpid)
        asked = asyncio.create_task(found.run(time.sleep, 1000.0))
        await asyncio.to_thread(until, lambda: found.waiting)
        await asyncio.to_thread(found.stop)
        return await asyncio.gather(asked, return_exceptions=True)

    start = time.monotonic()
    (answer,) = asyncio.run(ended())
    assert isinstance(answer, Busy | InputError)
    assert time.monotonic() - start < PATIENCE
    assert found.child is None


CODE = """
import asyncio, time
from api.reading.reader import Limits, Reader
from tests.api.test_reading import nothing
if __name__ == "__main__":
    reader = Reader(Limits(), 1, nothing)
    reader.start()
    assert asyncio.run(reader.run(pow, 2, 5)) == 32
    print(reader.child.process.pid, flush=True)
    asyncio.run(reader.run(time.sleep, 1000.0))
"""


@pytest.mark.slow
def test_the_process_ends_with_the_service_however_it_ends(tmp_path):
    script = tmp_path / "service.py"
    script.write_text(CODE, encoding="utf-8")
    environment = {**os.environ, "PYTHONPATH": str(Path(__file__).resolve().parents[2])}
    with subprocess.Popen([sys.executable, str(script)], stdout=subprocess.PIPE, text=True, env=environment) as service:
        child = psutil.Process(int(service.stdout.readline()))
        # on Linux a copy of it answers
        copies = until(child.children) if sys.platform == "linux" else []
        service.kill()
    until(lambda: all(ended(each.pid) for each in (child, *copies)))


KNOWN_KERNELS = """
import sys
import numpy as np
from numba.core.registry import CPUDispatcher
from api.reading import examine
from rcsa_ident.cutting.coefficients import CuttingCoefficients
from rcsa_ident.cutting.conditions import CuttingConditions, Engagement
from rcsa_ident.cutting.cutter import Cutter
from rcsa_ident.cutting.force import force_and_slope
from rcsa_ident.cutting.profile import Profile
from rcsa_ident.dynamics.coordinates import Dof
from rcsa_ident.signals.measurement import measure_cut
from rcsa_ident.signals.recording import Quantity, Recording, Sensor

def kernels():
    rooms = [vars(module) for name, module in list(sys.modules.items()) if name.startswith("rcsa_ident.")]
    found = [(name, each) for room in rooms for name, each in room.items() if isinstance(each, CPUDispatcher)]
    return {(each.__module__, name): list(each.signatures) for name, each in found}

examine.warm()
known, rng = kernels(), np.random.default_rng(1)
both = (Sensor("x", Quantity.DISPLACEMENT, Dof.X), Sensor("y", Quantity.DISPLACEMENT, Dof.Y))
conditions = CuttingConditions(200.0 * np.pi, 1e-4, 1e-4, Engagement.from_immersion(0.5, "down"))
angle = 200.0 * np.pi * np.arange(60000) / 20000.0
for wander in (0.0, 0.02):
    wave = np.cos(np.outer(angle * (1.0 + wander * np.arange(60000) / 60000), np.arange(1, 9))).sum(axis=1, keepdims=True)
    found = Recording(20000.0, 1e-6 * wave + 1e-6 * rng.standard_normal((60000, 2)), both)
    measure_cut("c", "t", found, found, Cutter(2, 0.012), conditions, CuttingCoefficients(9e8, 0.3))
cutters = [Cutter(4, 0.012, 0.5, np.radians([84.0, 96.0, 84.0, 96.0])), Cutter(3, 0.012, 0.5, profile=Profile.bull_nose(0.012, 0.0005))]
for cutter in cutters:
    force_and_slope(cutter, conditions, CuttingCoefficients(9e8, 0.3, 0.1), np.arange(1, 9))
assert len(known) > 5
late = {key: each for key, each in kernels().items() if each != known.get(key, [])}
assert not late, late
"""


@pytest.mark.slow
def test_no_kernel_is_compiled_within_the_limits_of_a_call():
    """A compiler needs more memory than a call has: on a new installation no record that wanders could be read."""
    subprocess.run([sys.executable, "-c", KNOWN_KERNELS], check=True, timeout=PATIENCE)
