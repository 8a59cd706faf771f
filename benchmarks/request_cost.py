"""What one request costs a service that runs on this machine: seconds of a core, and memory at its peak."""

from __future__ import annotations

import os
from http.client import HTTPConnection, HTTPException
from pathlib import Path
from typing import NamedTuple

from benchmarks.service import others, use


class Cost(NamedTuple):
    """What a request has cost.

    Core time of the service's own process and of its others [s], memory that the first took more at its peak and all that one of the others
    had at most [MB], and the answer.
    """

    seconds: float
    elsewhere: float
    megabytes: float
    largest: float
    words: str
    status: int


def cost_of(port: int, process: int, words: str, method: str, path: str, headers: dict[str, str], body: bytes) -> Cost:
    """Return what a request costs until its answer is read."""
    own, before = _seconds(process), use(process)
    resting = _peak(process, anew=True)
    for id in others(process):
        _peak(id, anew=True)
    connection = HTTPConnection("127.0.0.1", port, timeout=300)
    status = 0
    try:
        connection.request(method, path, body or None, headers)
        answer = connection.getresponse()
        status = answer.status
        answer.read()
    except (OSError, HTTPException):
        # closed before the whole request was sent
        pass
    finally:
        connection.close()
    spent, total = _seconds(process) - own, use(process)[0] - before[0]
    largest = max((_peak(id) for id in others(process)), default=0.0)
    return Cost(spent, max(total - spent, 0.0), _peak(process) - resting, largest, words, status)


def _seconds(process: int) -> float:
    fields = Path(f"/proc/{process}/stat").read_text(encoding="utf-8").rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def _peak(process: int, anew: bool = False) -> float:
    """Most memory that the process has had since the peak was set to what it has now [MB]."""
    try:
        if anew:
            Path(f"/proc/{process}/clear_refs").write_text("5", encoding="utf-8")
        lines = Path(f"/proc/{process}/status").read_text(encoding="utf-8").splitlines()
    except OSError:
        # it has ended
        return 0.0
    return next((int(line.split()[1]) for line in lines if line.startswith("VmHWM:")), 0) / 1e3
