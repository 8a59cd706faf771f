"""The service and its command line from every kind of shell: a bare environment, an awkward folder, no room, a clock that jumps."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import textwrap
from collections.abc import Callable
from datetime import UTC, datetime
from pathlib import Path

import pytest

from api.client import Client
from tests.fixtures import by_hand
from tests.fixtures.paths import ROOT, TOOLINGS
from tests.fixtures.service import command, serving
from tests.fixtures.waiting import PATIENCE

pytestmark = [pytest.mark.slow, pytest.mark.skipif(os.name == "nt", reason="shells as POSIX has them")]

TOOLING = TOOLINGS / "S3-PG25-long.toml"
#: What a service manager or a script may leave of an environment: no HOME, no locale.
BARE = {"PATH": os.environ.get("PATH", ""), "PYTHONPATH": str(ROOT), "LANG": "C", "LC_ALL": "C"}


def nohup() -> None:
    """What a script's background job begins with, and a careful user's mask."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGHUP, signal.SIG_IGN)
    os.umask(0o077)


def small_files() -> None:
    """A disk on which no file grows past a kilobyte."""
    import resource

    signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    resource.setrlimit(resource.RLIMIT_FSIZE, (1024, 1024))


def run(folder: Path, *arguments: str, before: Callable[[], None] = nohup, **further: str) -> subprocess.CompletedProcess[str]:
    words = [sys.executable, "-m", "rcsa_ident.cli", *arguments]
    return subprocess.run(
        words, cwd=folder, env=BARE | further, preexec_fn=before, capture_output=True, encoding="utf-8", check=False, timeout=PATIENCE
    )


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A path with spaces and letters that ASCII lacks."""
    made = tmp_path / "Meßfahrt Ü 1"
    made.mkdir()
    return made


def test_commands_in_a_bare_shell_and_an_awkward_folder(folder):
    (folder / "Fräser.toml").write_bytes(TOOLING.read_bytes())
    drawn = run(folder, "draw", "Fräser.toml", "--out", "Fräser 1.svg")
    assert (drawn.returncode, drawn.stderr) == (0, "")
    assert "<svg" in (folder / "Fräser 1.svg").read_text(encoding="utf-8")
    listed = run(folder, "materials", "--json")
    assert listed.returncode == 0
    assert json.loads(listed.stdout)
    missing = run(folder, "draw", "Bohrer ä.toml", "--out", "x.svg")
    assert missing.returncode == 2
    assert "Traceback" not in missing.stderr


def test_a_disk_without_room_is_told_in_words(folder):
    found = run(folder, "draw", str(TOOLING), "--out", "x.svg", before=small_files)
    assert found.returncode == 2
    assert "found File too large, allowed is a place that can be written to" in found.stderr
    assert "Traceback" not in found.stderr
    # nothing half made stays
    assert not list(folder.iterdir())


def test_a_temporary_folder_that_takes_nothing_hinders_no_command(folder):
    found = run(folder, "draw", str(TOOLING), "--out", "x.svg", TMPDIR="/proc")
    assert (found.returncode, found.stderr) == (0, "")


def test_the_service_in_a_bare_shell_and_an_awkward_folder(folder, monkeypatch, result):
    """Started, used, and ended by the signal that a service manager sends."""
    for name in set(os.environ) - set(BARE):
        monkeypatch.delenv(name)
    for name, value in BARE.items():
        monkeypatch.setenv(name, value)
    with serving(folder / "Daten") as served:
        with Client(served.url) as client:
            id = client.make_machine("m", description="Fräse Ü").id
            client.identify(id, result)
            client.write_tooling("T1", by_hand.TOOLING)
            assert client.lobes(id, "T1", recommend=False)
            assert client.machine(id).description == "Fräse Ü"
        served.process.terminate()
        assert served.process.wait(PATIENCE) in (0, -signal.SIGTERM)
    assert "Traceback" not in served.log.read_text(encoding="utf-8")


def test_a_data_folder_that_takes_nothing_is_told_in_words():
    words, environment = command(Path("/proc/data"))
    found = subprocess.run(words, env=environment, capture_output=True, text=True, check=False, timeout=PATIENCE)
    assert found.returncode == 2
    assert "RCSA_IDENT_DATA" in found.stderr
    assert "Traceback" not in found.stderr


#: A clock that stands an hour before and a day after the right one, in turns of two seconds.
JUMPING = """
import time, datetime
_time, _monotonic = time.time, time.monotonic
def off():
    return 86400.0 if int(_monotonic() / 2.0) % 2 else -3600.0
time.time = lambda: _time() + off()
class Jumping(datetime.datetime):
    @classmethod
    def now(cls, tz=None):
        return cls.fromtimestamp(time.time(), tz)
datetime.datetime = Jumping
"""


def test_the_service_stands_a_clock_that_jumps(folder, result):
    """It starts, answers, computes and ends; no job is a part of this."""
    (folder / "sitecustomize.py").write_text(textwrap.dedent(JUMPING), encoding="utf-8")
    served_with = {"PYTHONPATH": os.pathsep.join((str(folder), str(ROOT)))}
    with serving(folder / "data", **served_with) as served, Client(served.url) as client:
        id = client.make_machine("m").id
        client.identify(id, result)
        client.write_tooling("T1", by_hand.TOOLING)
        for _ in range(3):
            assert client.lobes(id, "T1", recommend=False)
        # the clock did jump: no time that the service tells is near the right one
        told = datetime.fromisoformat(client.machine(id).created)
        assert abs((datetime.now(UTC) - told).total_seconds()) > 1800.0
        served.process.terminate()
        assert served.process.wait(PATIENCE) in (0, -signal.SIGTERM)
    assert "Traceback" not in served.log.read_text(encoding="utf-8")
