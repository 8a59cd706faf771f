"""What all tests share."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest
from hypothesis import settings

# chance has a seed: what is drawn is the same at every run, until a test changes
settings.register_profile("seeded", derandomize=True)
settings.load_profile("seeded")

# one thread per test process: small matrices gain nothing from more, and lose much where processes share the cores
for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(_name, "1")

#: Fixtures behind which a browser, a service, a database or a cluster runs: whoever asks for one is slow.
_PROCESSES = {"browser", "served", "postgres_server"}
_KERNELS = Path(__file__).resolve().parents[1] / "rcsa_ident"
#: Half of what there is to compile each.
_HALVES = ("[name for name in STEPS if name == 'lobes in time']", "[name for name in STEPS if name != 'lobes in time']")


def pytest_sessionstart(session: pytest.Session) -> None:
    """Compile kernels once before several workers need them, who would all compile the same ones."""
    if (session.config.getoption("numprocesses", None) or 0) < 2 or session.config.option.collectonly or _compiled():
        return
    code = "from rcsa_ident.workflows.compile_kernels import STEPS\nfor name in {}: STEPS[name]()"
    halves = [subprocess.Popen([sys.executable, "-c", code.format(half)], cwd=_KERNELS.parent) for half in _HALVES]
    assert [half.wait() for half in halves] == [0, 0]


def _compiled() -> bool:
    """Whether every kernel module has a cache that is younger than itself; one for another processor is none."""
    if os.environ.get("NUMBA_CPU_NAME"):
        return False
    for module in _KERNELS.rglob("_*kernels.py"):
        caches = list((module.parent / "__pycache__").glob(f"{module.stem}.*.nbi"))
        if not caches or max(cache.stat().st_mtime for cache in caches) < module.stat().st_mtime:
            return False
    return True


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Mark what is slow by its fixtures; workers begin with the files that take longest, so that none of them is the tail."""
    for item in items:
        if _PROCESSES & set(getattr(item, "fixturenames", ())) and item.get_closest_marker("slow") is None:
            item.add_marker("slow")
    if hasattr(config, "workerinput"):
        seconds: dict[Path, float] = {}
        for item in items:
            seconds[item.path] = seconds.get(item.path, 0.0) + _seconds(item)
        items.sort(key=lambda item: -seconds[item.path])


def _seconds(item: pytest.Item) -> float:
    """About what a test takes, as its marker says."""
    slow = item.get_closest_marker("slow")
    return 0.0 if slow is None else float(slow.args[0]) if slow.args else 2.0


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(item, call):
    """Where everything is installed that tests may want, a skip hides something: it fails."""
    report = yield
    if report.skipped and not hasattr(report, "wasxfail") and os.environ.get("RCSA_IDENT_NO_SKIPS"):
        report.outcome = "failed"
        report.longrepr = f"skipped, though RCSA_IDENT_NO_SKIPS is set: {report.longrepr}"
    return report
