"""Fuzzing of every reader: bytes that a machine makes up, guided by which lines they reach, until one costs more than a sentence.

``python -m benchmarks fuzz --only csv,toml --seconds 600`` gives each reader named 600 seconds of a core, one after the other; without
``--only`` all have their turn. With ``--rounds`` the turns come again, and the corpus in ``--folder`` grows from turn to turn. With the
package atheris bytes are chosen by the branches they reach; ``--blind`` changes the seeds by chance alone, and needs nothing.

A find is an exception other than the package's own refusals, a call of more than 5 s of processor time, one that takes more than 1 GB of
memory, or the death of the process. Each is kept in ``FOLDER/finds`` as its bytes and, beside them, what happened; finds whose exception
comes from the same line count once. ``--replay NAME FILE`` feeds a file to a reader and tells what it costs. At the end, and with
``--table`` alone, a table in Markdown tells processor time, calls and finds of every reader over all turns in the folder.
"""

from __future__ import annotations

import argparse
import json
import os
import random
import resource
import subprocess
import sys
import time
import traceback
from hashlib import sha256
from importlib.util import find_spec
from pathlib import Path
from typing import Any, NoReturn

from benchmarks.fuzz_changes import CHANGES, bytes_changed
from benchmarks.fuzz_readers import TARGETS, Target, refusals
from tests.fixtures.kept_kernels import kernel_files

#: Processor time and memory of a call that is a find, and what a call is given at most.
MOST_SECONDS, MOST_MEGABYTES, LONGEST = 5.0, 1000.0, 100_000
#: A call that takes longer is ended with its process [s]: other processes share the core.
_HANGS = 120
#: Packages whose branches the fuzzer sees: this one's, and libraries written in Python that parse for it.
_WATCHED = ("rcsa_ident", "api", "nptdms", "multipart", "gcodeparser", "trimesh")
_ROOT = Path(__file__).resolve().parent.parent


def main(arguments: list[str]) -> None:
    """Fuzz the readers named, in turn."""
    parser = argparse.ArgumentParser(prog="benchmarks fuzz", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--only", default=",".join(TARGETS), help=f"readers, divided by commas: {', '.join(TARGETS)}")
    parser.add_argument("--seconds", type=float, default=60.0, help="of a core, each reader and turn")
    parser.add_argument("--rounds", type=int, default=1)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--folder", type=Path, default=Path("fuzzed"), help="of corpus, finds and accounts")
    parser.add_argument("--blind", action="store_true")
    parser.add_argument("--table", action="store_true")
    parser.add_argument("--replay", nargs=2, metavar=("NAME", "FILE"))
    parser.add_argument("--turn", help=argparse.SUPPRESS)
    given = parser.parse_args(arguments)
    if given.replay:
        _replay(TARGETS[given.replay[0]], Path(given.replay[1]).read_bytes())
    elif given.turn:
        _Turn(given.turn, given.folder, given.seconds, given.seed).fuzz(given.blind)
    elif given.table:
        print(table(given.folder))
    else:
        names = given.only.split(",")
        if unknown := set(names) - set(TARGETS):
            parser.error(f"no such readers: {', '.join(sorted(unknown))}")
        if not given.blind and find_spec("atheris") is None:
            parser.error("atheris is not installed: pip install 'atheris>=3,<4', or --blind")
        for round_ in range(given.rounds):
            for name in names:
                _in_process(name, given, given.seed + round_)
        print(table(given.folder))


def _in_process(name: str, given: argparse.Namespace, seed: int) -> None:
    """A turn in a process of its own; its death is a find of what it was given last."""
    command = [sys.executable, "-m", "benchmarks", "fuzz", "--turn", name, "--folder", str(given.folder), "--seconds", str(given.seconds)]
    _sow(given.folder, name)
    log, last = given.folder / f"{name}.log", given.folder / f"{name}.last"
    with log.open("w", encoding="utf-8") as sink:
        code = subprocess.call([*command, "--seed", str(seed), *(["--blind"] if given.blind else [])], stdout=sink, stderr=sink)
    if code and last.is_file():
        ends = log.read_text(encoding="utf-8", errors="replace")[-3000:]
        _keep(given.folder, name, last.read_bytes(), f"exit {code}", f"the process ended with {code}\n{ends}")
    print(f"{time.strftime('%H:%M:%S')} {name}: {_account(given.folder, name)}", flush=True)


def _sow(folder: Path, name: str) -> None:
    """Make the folders, and the seeds, where they are not there yet."""
    seeds, corpus = folder / "seeds" / name, folder / "corpus" / name
    (folder / "finds").mkdir(parents=True, exist_ok=True)
    if not any(seeds.glob("*")):
        for place in (seeds, corpus):
            place.mkdir(parents=True, exist_ok=True)
        for raw in TARGETS[name].sown(seeds.parent):
            for place in (seeds, corpus):
                (place / sha256(raw).hexdigest()[:16]).write_bytes(raw)


class _Turn:
    """A turn of one reader: calls it until its time is over. `seconds`: of a core."""

    def __init__(self, name: str, folder: Path, seconds: float, seed: int) -> None:
        self.name, self.folder, self.seconds, self.seed = name, folder, seconds, seed
        self.target = TARGETS[name]
        self.scratch = Path("/dev/shm" if os.path.isdir("/dev/shm") else folder) / f"fuzz-{os.getpid()}"
        self.scratch.mkdir(parents=True, exist_ok=True)
        self.calls = self.finds = 0
        self.begun = 0.0
        self.seeds = [path.read_bytes() for path in sorted((folder / "seeds" / name).iterdir())]
        self.last = (folder / f"{name}.last").open("wb")

    def fuzz(self, blind: bool) -> None:
        """Feed the reader, guided or blind."""
        corpus = self.folder / "corpus" / self.name
        if blind:
            self._warm()
            self._blind()
        import atheris

        # the compiler of the kernels knows no other instructions than Python's
        names = [".".join(path.relative_to(_ROOT).with_suffix("").parts) for path in kernel_files(_ROOT / "rcsa_ident")]
        with atheris.instrument_imports(include=list(_WATCHED), exclude=names):
            self._warm()
        change = CHANGES[self.target.kind]

        def changed(data: bytes, most: int, seed: int) -> bytes:
            rng = random.Random(seed)
            if self.target.kind == "bytes" or rng.random() < 0.3:
                return bytes(atheris.Mutate(data, most))
            return change(data, rng)[:most]

        options = [
            f"-max_len={LONGEST}",
            f"-seed={self.seed}",
            f"-timeout={_HANGS}",
            "-rss_limit_mb=6000",
            "-handle_segv=0",
            "-len_control=0",
        ]
        atheris.Setup(
            ["fuzz", str(corpus), *options, f"-artifact_prefix={self.folder}/finds/{self.name}-"], self.call, custom_mutator=changed
        )
        atheris.Fuzz()

    def _warm(self) -> None:
        """Read the seeds once, so that what is imported and compiled is not counted."""
        for seed in self.seeds:
            try:
                self.target.read(seed, self.scratch)
            except refusals():
                continue
        self.begun = _processor()

    def _blind(self) -> NoReturn:
        rng = random.Random(self.seed)
        while True:
            raw = rng.choice(self.seeds)
            for _ in range(rng.choice((1, 1, 2, 3))):
                raw = (bytes_changed if rng.random() < 0.3 else CHANGES[self.target.kind])(raw, rng)
            self.call(raw)

    def call(self, raw: bytes) -> None:
        """Feed the reader once, and keep what costs more than a sentence."""
        self.last.seek(0)
        self.last.write(raw)
        self.last.truncate()
        self.last.flush()
        before, peak, resting = _processor(), _peak(), _resident()
        told = where = ""
        try:
            self.target.read(raw, self.scratch)
        except refusals():
            pass
        except Exception as error:
            told, where = traceback.format_exc(), place(error)
        # what earlier calls left behind is not this one's
        spent, more = _processor() - before, _peak() - resting if _peak() > peak else 0.0
        if spent > MOST_SECONDS:
            told, where = told + f"{spent:.1f} s of a core for {len(raw)} bytes\n", where or "too long"
        if more > MOST_MEGABYTES:
            told, where = told + f"{more:.0f} MB for {len(raw)} bytes\n", where or "too much memory"
        self.calls += 1
        if where:
            self.finds += _keep(self.folder, self.name, raw, where, told)
        if before - self.begun > self.seconds:
            self._end()

    def _end(self) -> NoReturn:
        """Add to the account, and leave without what the fuzzer's library says at its end."""
        import shutil

        shutil.rmtree(self.scratch, ignore_errors=True)
        account = _account(self.folder, self.name)
        account["seconds"] += _processor() - self.begun
        account["calls"] += self.calls
        (self.folder / f"{self.name}.json").write_text(json.dumps(account), encoding="utf-8")
        (self.folder / f"{self.name}.last").unlink()
        os._exit(0)


def place(error: BaseException) -> str:
    """Return what an exception is and the line of this project that it came from, or the last line of a library."""
    frames = traceback.extract_tb(error.__traceback__)
    own = [
        frame
        for frame in frames
        if "/rcsa_ident/" in frame.filename or ("/api/" in frame.filename and "/site-packages/" not in frame.filename)
    ]
    last = own[-1] if own else frames[-1]
    return f"{type(error).__name__} {Path(last.filename).name}:{last.lineno}"


def _keep(folder: Path, name: str, raw: bytes, where: str, told: str) -> int:
    """Keep a find, the smallest of its place; return whether it is the first."""
    key = sha256(where.encode()).hexdigest()[:8]
    path = folder / "finds" / f"{name}-{key}.bin"
    first = not path.exists()
    if first or len(raw) < path.stat().st_size:
        path.write_bytes(raw)
        path.with_suffix(".txt").write_text(f"{where}\n{told}", encoding="utf-8")
    return int(first)


def _account(folder: Path, name: str) -> dict[str, Any]:
    path = folder / f"{name}.json"
    return json.loads(path.read_text(encoding="utf-8")) if path.is_file() else {"seconds": 0.0, "calls": 0}


def table(folder: Path) -> str:
    """Return processor time, calls, corpus and finds of every reader, over all turns, as Markdown."""
    lines = ["| reader | min of a core | calls | corpus | finds |", "|---|---|---|---|---|"]
    total = [0.0, 0, 0, 0]
    for name in TARGETS:
        account = _account(folder, name)
        if not account["calls"]:
            continue
        corpus, finds = len(list((folder / "corpus" / name).glob("*"))), len(list((folder / "finds").glob(f"{name}-????????.bin")))
        row = (account["seconds"] / 60.0, account["calls"], corpus, finds)
        total = [a + b for a, b in zip(total, row, strict=True)]
        lines.append(f"| {name} | {row[0]:.1f} | {row[1]} | {corpus} | {finds} |")
    return "\n".join([*lines, f"| all | {total[0]:.1f} | {total[1]} | {total[2]} | {total[3]} |"])


def _replay(target: Target, raw: bytes) -> None:
    """Feed one file to a reader, and print what became of it."""
    folder = Path("/dev/shm" if os.path.isdir("/dev/shm") else ".") / f"fuzz-{os.getpid()}"
    folder.mkdir()
    for seed in target.sown(folder):
        try:
            target.read(seed, folder)
        except refusals():
            continue
    before, resting = _processor(), _peak()
    try:
        target.read(raw, folder)
        print("taken")
    except refusals() as error:
        print(f"refused: {error}")
    except Exception:
        traceback.print_exc()
    print(f"{_processor() - before:.2f} s, {_peak() - resting:.0f} MB more, {len(raw)} bytes")


def _processor() -> float:
    """Processor time of this process [s]."""
    return time.process_time()


def _resident() -> float:
    with Path("/proc/self/statm").open(encoding="ascii") as file:
        return int(file.read().split()[1]) * resource.getpagesize() / 1e6


def _peak() -> float:
    """Most memory so far [MB]."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e3
