"""How straight three walks through the house are: rooms, climbs and returns of the project's own calls.

``python -m benchmarks walks [--whole] [--rooms]`` runs a tooling in a REST body → lobes, recordings → identification, and a cut → forces,
each in a process of its own, and listens to every call. What is counted, so that neither the number of cuts nor that of iterations
matters:

- A walk is the project's functions in the order in which each is called for the first time. What an import calls is none of it, and
  neither are rooms under ``dynamics``, which hold what all others share.
- A room is a folder of modules, as `rcsa_ident.identification.coupled`; kernels belong to the room that keeps them, and a module that
  stands in no folder is a room. With ``--whole`` a room within a room is part of that: so folders that were divided in between compare.
- A stop is a stretch of the walk in one room. A climb leads from a stop to one on a higher floor: floors are the layers of the import
  contracts, those of the service above the library's. A return leads to a room that the walk has been in before.
- An upward call is a function whose first caller stands on a lower floor: what was handed down is called from there.

Compiled kernels are called unheard. ``--rooms`` prints the stops themselves. The file also runs by itself in another checkout that has
these commands: ``PYTHONPATH=. python WHERE/walks.py`` in its root.
"""

from __future__ import annotations

import argparse
import multiprocessing
import sys
import tempfile
import threading
import tomllib
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager
from functools import cache
from inspect import CO_OPTIMIZED
from itertools import groupby, pairwise
from pathlib import Path
from types import CodeType, FrameType
from typing import NamedTuple

import rcsa_ident

ROOT = Path(rcsa_ident.__file__).resolve().parent.parent
#: One in so many of the sample runs is identified.
STEP = 4


class Walk(NamedTuple):
    """What was counted. `upward`: calls. `stops`: rooms in their order."""

    name: str
    functions: int
    upward: int
    stops: tuple[str, ...]

    @property
    def rooms(self) -> int:
        """How many different ones."""
        return len(set(self.stops))

    @property
    def climbs(self) -> int:
        """Stops on a higher floor than the one before."""
        return sum(floor_of(there) > floor_of(here) for here, there in pairwise(self.stops))

    @property
    def returns(self) -> int:
        """Stops in a room that the walk has been in before."""
        return len(self.stops) - self.rooms


@cache
def _floors() -> dict[str, int]:
    """Rooms and loose modules of the import contracts to their floors; those under ``dynamics`` are below zero."""
    with (ROOT / "pyproject.toml").open("rb") as file:
        contracts = tomllib.load(file)["tool"]["importlinter"]["contracts"]
    found: dict[str, int] = {}
    for package in ("rcsa_ident", "api"):
        floors = next(each["layers"] for each in contracts if each.get("containers") == [package])[::-1]
        first = 1 + max(found.values(), default=0)
        if package == "rcsa_ident":
            first = -next(k for k, floor in enumerate(floors) if "dynamics" in floor.split(" | "))
        found |= {f"{package}.{name}": first + k for k, floor in enumerate(floors) for name in floor.split(" | ")}
    return found


def floor_of(room: str) -> int:
    """Return the floor of a room; rooms within a room are on its floor."""
    return _floors().get(".".join(room.split(".")[:2]), -1)


@cache
def room_of(file: str) -> str:
    """Return the room of a module's file; empty for what is not the project's, and for what all rooms share."""
    path = Path(file)
    if not path.is_relative_to(ROOT) or path.relative_to(ROOT).parts[0] not in ("rcsa_ident", "api"):
        return ""
    *folders, _ = path.relative_to(ROOT).parts
    folders = [folder for folder in folders if folder != "_kernels"]
    room = ".".join(folders if len(folders) > 1 else [*folders, path.stem])
    return room if floor_of(room) >= 0 else ""


class Call(NamedTuple):
    """Rooms of a function and of who called it first, empty where that is nobody of the project."""

    room: str
    caller: str


@contextmanager
def heard() -> Iterator[dict[CodeType, Call]]:
    """Listen in this thread and in those that begin within: functions in the order of their first calls."""
    found: dict[CodeType, Call] = {}
    imports = threading.local()

    def hear(frame: FrameType, event: str, _: object) -> None:
        code = frame.f_code
        if code.co_name == "<module>" and event in ("call", "return"):
            imports.depth = getattr(imports, "depth", 0) + (1 if event == "call" else -1)
        elif event == "call" and code not in found and code.co_flags & CO_OPTIMIZED and code.co_name[0] != "<":
            room = room_of(code.co_filename)
            if room and not getattr(imports, "depth", 0):
                below = frame.f_back
                while below is not None and not room_of(below.f_code.co_filename):
                    below = below.f_back
                found[code] = Call(room, "" if below is None else room_of(below.f_code.co_filename))

    threading.setprofile(hear)
    sys.setprofile(hear)
    try:
        yield found
    finally:
        sys.setprofile(None)
        threading.setprofile(None)


def lobes(folder: Path) -> list[Call]:
    """A tooling in a REST body → lobes."""
    from api.schemas.toolings import EXAMPLE
    from tests.api.in_process import embedded, service
    from tests.fixtures import by_hand

    with heard() as found, service(embedded(folder), folder) as http:
        id = http.post("/v1/machines", json={"name": "M"}).json()["id"]
        http.put(f"/v1/machines/{id}/identification", content=by_hand.result_text(folder), headers={"content-type": "application/json"})
        found.clear()
        answer = http.post("/v1/lobes", json={"machine": id, "toolings": [EXAMPLE], "speeds": {"step_rpm": 2000}})
        assert answer.status_code == 200, answer.text
        return list(found.values())


def identification(folder: Path) -> list[Call]:
    """Recordings → identification."""
    from tests.fixtures.campaign import part_of_the_sample_runs

    (folder / "campaign").mkdir()
    campaign = part_of_the_sample_runs(folder / "campaign", STEP)
    return _of_command("identify", str(campaign), "--seed", "1", "--processes", "1", "--out", str(folder / "RESULT.json"))


def forces(folder: Path) -> list[Call]:
    """A cut → forces."""
    samples, cut = ROOT / "data" / "sample_runs", "S2-PG25-10"
    tooling, record, air = samples / "toolings" / "S2-PG25.toml", *(samples / "recordings" / f"{cut}_{kind}.h5" for kind in ("cut", "air"))
    words = (str(folder / "RESULT.json"), str(tooling), str(record), "--air", str(air), "--speed-rpm", "11077")
    return _of_command("forces", *words, "--out", str(folder / "FORCES.csv"))


WALKS = (lobes, identification, forces)


def _of_command(*words: str) -> list[Call]:
    from typer.testing import CliRunner

    from rcsa_ident.cli import app

    with heard() as found:
        answer = CliRunner().invoke(app, words)
    assert answer.exit_code in (0, 3), answer.output
    return list(found.values())


def walked(walk: Callable[[Path], list[Call]], folder: Path, whole: bool) -> Walk:
    """Return what is counted of a walk. `whole`: a room within a room is part of that."""
    calls = walk(folder)
    if whole:
        calls = [each._replace(room=".".join(each.room.split(".")[:2])) for each in calls]
    upward = sum(bool(each.caller) and floor_of(each.room) > floor_of(each.caller) for each in calls)
    return Walk(str(walk.__doc__).rstrip("."), len(calls), upward, tuple(room for room, _ in groupby(each.room for each in calls)))


def main(arguments: Sequence[str]) -> None:
    """Walk, and print a row each."""
    parser = argparse.ArgumentParser(prog="benchmarks walks", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--whole", action="store_true", help="a room within a room is part of that")
    parser.add_argument("--rooms", action="store_true", help="print the stops, too")
    asked = parser.parse_args(arguments)
    print("| walk | functions | stops | rooms | climbs | returns | upward calls |\n|---|---|---|---|---|---|---|")
    context = multiprocessing.get_context("spawn")
    with tempfile.TemporaryDirectory() as kept, ProcessPoolExecutor(1, context, max_tasks_per_child=1) as pool:
        for walk in WALKS:
            found = pool.submit(walked, walk, Path(kept), asked.whole).result()
            counts = (found.functions, len(found.stops), found.rooms, found.climbs, found.returns, found.upward)
            print("|", " | ".join([found.name, *map(str, counts)]), "|", flush=True)
            if asked.rooms:
                print(*(f"{floor_of(room):>4} {room}" for room in found.stops), sep="\n")


if __name__ == "__main__":
    main(sys.argv[1:])
