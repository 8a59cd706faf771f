"""What all tests share: rings, order, kernels, chance."""

from __future__ import annotations

import json
import os
from collections import Counter
from pathlib import Path

import pytest
from hypothesis import settings
from xdist.scheduler import LoadScopeScheduling

from tests.fixtures.kept_kernels import PACKAGE, keep, ready
from tests.fixtures.reach import changed_since, reached

# chance has a seed: what is drawn is the same at every run, until a test changes
settings.register_profile("seeded", derandomize=True)
settings.load_profile("seeded")

# one thread per test process: small matrices gain nothing from more, and lose much where processes share the cores
for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(_name, "1")

#: Fixtures behind which a browser, a service, a database or a cluster runs: whoever asks for one is slow.
_PROCESSES = {"browser", "served", "postgres_server"}
#: Rooms whose files share what takes long to make.
_SHARED = ("tests/web/", "tests/front/")
#: Seconds of each function by its file, as the last whole run has found them.
_DURATIONS = Path(__file__).with_name("durations.json")
_seconds: Counter[str] = Counter()


def pytest_addoption(parser: pytest.Parser) -> None:
    rings = parser.getgroup("rings")
    told = "gate: quick tests and witnesses (default); rest: the slow ones beside them; whole: all (default where tests are named)"
    rings.addoption("--ring", choices=["gate", "rest", "whole"], help=told)
    rings.addoption("--since", metavar="COMMIT", help="of the rest, what a change since this commit can reach")
    rings.addoption(
        "--keep-durations", action="store_true", help=f"write what tests took into {_DURATIONS.name}, by which the next run is ordered"
    )


def pytest_configure(config: pytest.Config) -> None:
    """Settle the ring before workers are told of it."""
    if config.option.ring is None:
        named = config.args_source is pytest.Config.ArgsSource.ARGS or config.option.markexpr or config.option.keyword
        config.option.ring = "rest" if config.option.since else "whole" if named else "gate"


def pytest_sessionstart(session: pytest.Session) -> None:
    if _several(session.config):
        ready()


def pytest_sessionfinish(session: pytest.Session) -> None:
    if _several(session.config):
        keep(PACKAGE)
    if session.config.option.keep_durations and not hasattr(session.config, "workerinput"):
        found: dict[str, dict[str, float]] = {}
        for name, seconds in sorted(_seconds.items()):
            if seconds > 0.5:
                file, _, function = name.partition("::")
                found.setdefault(file, {})[function] = round(seconds, 1)
        _DURATIONS.write_text(json.dumps(found, indent=1) + "\n")


def pytest_runtest_logreport(report: pytest.TestReport) -> None:
    _seconds[report.nodeid.partition("[")[0]] += report.duration


def _several(config: pytest.Config) -> bool:
    """Whether this process leads several workers."""
    return (config.getoption("numprocesses", None) or 0) > 1 and not config.option.collectonly


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Mark what is slow by its fixtures, leave the ring, and let workers begin with what takes longest, so that it is not the tail."""
    for item in items:
        if _PROCESSES & set(getattr(item, "fixturenames", ())) and item.get_closest_marker("slow") is None:
            item.add_marker("slow")
    ring, since = config.option.ring, config.option.since
    if ring != "whole":
        gate = {item for item in items if item.get_closest_marker("slow") is None or item.get_closest_marker("witness") is not None}
        changed = changed_since(since) if since else []
        paths = {path for path in {item.path for item in items} if not since or reached(changed, path)} if ring == "rest" else set()
        kept = gate if ring == "gate" else {item for item in items if item not in gate and item.path in paths}
        config.hook.pytest_deselected(items=[item for item in items if item not in kept])
        items[:] = [item for item in items if item in kept]
    if hasattr(config, "workerinput"):
        lasted = json.loads(_DURATIONS.read_text()) if _DURATIONS.is_file() else {}
        weight: Counter[str] = Counter()
        # in one order in all workers, who must agree to the last bit
        for name in dict.fromkeys(item.nodeid.partition("[")[0] for item in items):
            file, _, function = name.partition("::")
            weight[_room(name)] += lasted.get(file, {}).get(function, 0.01)
        items.sort(key=lambda item: -weight[_room(item.nodeid)])


def _room(name: str) -> str:
    """What stays with one worker: a file, whose fixtures are paid once, or all files that share a service, a browser, a machine."""
    return next((room for room in _SHARED if name.startswith(room)), name.partition("::")[0])


class _Rooms(LoadScopeScheduling):
    def _split_scope(self, nodeid: str) -> str:
        return _room(nodeid)


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config: pytest.Config, log: object) -> LoadScopeScheduling:
    return _Rooms(config, log)


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(item, call):
    """Where everything is installed that tests may want, a skip hides something: it fails."""
    report = yield
    if report.skipped and not hasattr(report, "wasxfail") and os.environ.get("RCSA_IDENT_NO_SKIPS"):
        report.outcome = "failed"
        report.longrepr = f"skipped, though RCSA_IDENT_NO_SKIPS is set: {report.longrepr}"
    return report
