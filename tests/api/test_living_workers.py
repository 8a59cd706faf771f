"""Which workers count as alive: by their heartbeats, by the processor that they use, and by their processes."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time

import psutil
import pytest

from api.jobs.worker import LEASE, JobWorker, gone, place, process, spent
from api.stores.jobs import Worker
from tests.fixtures.waiting import until


def test_a_dead_process_of_this_place_is_known_at_once():
    me = process(os.getpid())
    assert me == process(os.getpid())
    assert not gone(me)
    assert place() == place()
    with subprocess.Popen([sys.executable, "-c", "input()"], stdin=subprocess.PIPE) as child:
        other = process(child.pid)
        assert other != me
        assert not gone(other)
        child.kill()
        child.wait()
    if not other.endswith(":"):
        assert gone(other)
        # the same number, started at another time
        assert gone(me.split(":")[0] + ":1")


@pytest.mark.slow
@pytest.mark.skipif(os.name != "posix", reason="a process is suspended by a signal")
@pytest.mark.parametrize("suspended", [False, True])
def test_who_computes_is_alive_though_no_heartbeat_comes(store, monkeypatch, suspended):
    """A step that leaves its own process no time, and a process that is suspended, beside each other."""
    moment = [time.monotonic()]
    monkeypatch.setattr("api.jobs.worker.time.monotonic", lambda: moment[0])
    looker = JobWorker(store.jobs, None, {}, 3)
    with subprocess.Popen([sys.executable, "-c", "while True: pass"]) as child:
        try:
            store.jobs.claim(Worker("other", place(), process(child.pid), "w"), None)
            if suspended:
                child.send_signal(signal.SIGSTOP)
                until(lambda: psutil.Process(child.pid).status() == psutil.STATUS_STOPPED)
            assert [row.id for row in looker._living()] == ["other"]
            before = spent(process(child.pid))
            if not suspended:
                until(lambda: spent(process(child.pid)) > before + 0.05)
            moment[0] += 1.1 * LEASE
            assert [row.id for row in looker._living()] == ([] if suspended else ["other"])
        finally:
            child.kill()
