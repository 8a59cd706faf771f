"""``python -m benchmarks frozen FOLDER [--beside OTHER] [--only WORD,…]``: what a redesign must leave as it is.

Runs one command of every kind on the sample runs, on the examples of the formats, and on campaigns that are simulated with fixed seeds
(coupled planes, rough drawings, passes, hammer tests, a robot), and writes into FOLDER what each printed and every file that it made,
with their hashes in SHA256SUMS. ``--beside`` compares with the folder of another commit: files are equal, or their numbers differ by so
much at most, relative to the largest of their table. ``--only`` runs the commands whose lines hold one of these words.

Same machine, same processor: the last bits of an identification are those of the libraries.
"""

from __future__ import annotations

import argparse
import contextlib
import hashlib
import itertools
import json
import re
import shlex
import shutil
import sys
import traceback
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from typer.main import get_command
from typer.testing import CliRunner

from benchmarks.machines import turned_sample
from benchmarks.rough_machines import rough_campaign
from rcsa_ident.cli import app
from rcsa_ident.front.samples import simulate_campaign
from rcsa_ident.io.settings.machines import read_machine
from rcsa_ident.io.settings.robots import robot_keys
from rcsa_ident.io.toml_text import toml_of
from tests.fixtures.hit import write_hit
from tests.fixtures.rung_tooling import rung_tooling
from tests.identification.arm.robots import sheet
from tests.identification.arm.robots import write_campaign as robot_campaign

ROOT = Path(__file__).resolve().parent.parent
#: What commands read; it is not compared.
_INPUTS = "in"
_TOOL = "in/data/machines/toolings/S3-PG25-long.toml"
_PROCESS = "--ktc-mpa 660 --krc 0.38"
#: Words that commands share.
_WORDS = {
    "tool": _TOOL,
    "posture": '"-11.71 20.78 110 82.76 60.80 -166.96"',
    "process": _PROCESS,
    "pocket": 'in/examples/TOOLING.toml in/fixtures/programs/pocket.nc --stock "-5 -5 -8 65 45 0"',
}
#: One a line; inputs stand in the folder `in`, and some commands read what earlier ones have written.
_COMMANDS = """
check in/data/sample_runs --json
identify in/data/sample_runs --seed 1 --out sample-1.json --json
identify in/data/sample_runs --seed 2 --out sample-2.json
identify in/data/sample_runs --seed 3 --out sample-3.json
identify in/coupled --out coupled.json --json
identify in/rough-501/campaign --out rough.json --json
identify in/passes --out passes.json --json
identify in/hit --out hit.json --json
robot identify in/ROBOT.toml in/campaign --out robot.json --json
tooltip sample-1.json {tool} --out TIP.csv --json
tooltip coupled.json {tool} --out TIP-coupled.csv --json
robot tip robot.json {tool} --posture {posture} --out TIP-robot.csv --json
robot check in/data/robots/tx200.toml --posture {posture} --json
robot lobes in/data/robots/tx200.toml {tool} --posture {posture} {process} --out LOBES-robot.csv --json
robot plan in/data/robots/tx200.toml --tests payload --count 1 --box "500 -1000 300 1600 1000 1800" --out POSTURES.csv --json
advise sample-1.json {tool} --feed-per-tooth-mm 0.1 --depth-mm 1 --card CARD.html --json
advise coupled.json {tool} --feed-per-tooth-mm 0.1 --json
forces sample-1.json in/data/sample_runs/toolings/S2-PG25.toml in/data/sample_runs/recordings/S2-PG25-10_cut.h5 \
 --air in/data/sample_runs/recordings/S2-PG25-10_air.h5 --speed-rpm 11077 --out FORCES.csv --json
plan sample-1.json --toolings in/data/machines/toolings/S1-ER32.toml --target {tool} --out PLAN.toml --json
export sample-1.json --to uff --tooling {tool} --out TIP.uff --json
export sample-1.json --what modes --to json --out MODES.json --json
learn in/examples/MODES.toml in/examples/TOOLING.toml --tests in/examples/CUTS.csv {process} --method zero-order --out LEARNT.json --json
cases in/examples/FLANGE.csv in/examples/CASES.toml {process} --json
path remove {pocket} --out ENGAGEMENT.csv --json
path stability --modes in/examples/MODES.toml {pocket} {process} --out STABILITY.csv --json
path mill --modes in/examples/MODES.toml {pocket} {process} --out MILLED.csv --surface SURFACE.csv --json
ring in/DRAWN.toml in/whole.wav --bare-tool in/tool.wav --mass-g {mass} --out RUNG.toml --json
tap in/examples/hits.csv --out TAPPED.csv --json
listen in/examples/sound.wav in/examples/sound.flac --json
import-tools in/examples/LIBRARY.json --out toolings --json
holders HSK-A63 ER32 --bore-mm 10 --json
draw in/examples/TOOLING.toml --out TOOL.svg --json
materials --json
"""
METHODS = ("zero-order", "multi-frequency", "semi-discretisation", "full-discretisation", "time-domain")
TIPS = {
    "sample": f"sample-1.json {_TOOL}",
    "coupled": f"coupled.json {_TOOL}",
    "modes": f"--modes in/examples/MODES.toml in/examples/TOOLING.toml {_PROCESS}",
    "flange": f"in/examples/FLANGE.csv in/examples/TOOLING.toml {_PROCESS}",
}
_SPEEDS = "--speed-from 6000 --speed-to 12000 --speed-step"
_NUMBER = re.compile(r"(?<![\w.])[-+]?\d+(?:\.\d+)?(?:[eE][-+]?\d+)?(?![\w])")
_TIME = re.compile(r"\b\d+(?:\.\d+)? s\b")


def commands(mass: float) -> Iterator[str]:
    """Yield all command lines: the table, lobes by each method on each tip, help of every command, schemas.

    `mass` [g]: of the tool that rings
    """
    yield from _COMMANDS.format(**_WORDS, mass=f"{mass:.6f}").strip().splitlines()
    for (name, tip), method in itertools.product(TIPS.items(), METHODS):
        # a march in time takes a hundred times as long as a map
        step = 3000 if method == "time-domain" else 500
        yield f"lobes {tip} --method {method} {_SPEEDS} {step} --out LOBES-{name}-{method}.csv --json"
    yield from _help(get_command(app), "")
    for noun in ("tooling", "campaign", "machine", "robot", "modes", "cases"):
        yield f"schema {noun} --out {noun}.schema.json"


def _help(command: Any, words: str) -> Iterator[str]:
    yield f"{words}--help"
    for name, inner in getattr(command, "commands", {}).items():
        yield from _help(inner, f"{words}{name} ")


def make_inputs(folder: Path) -> float:
    """Simulate the campaigns into a folder, and return the mass of the tool that rings [g]."""
    folder.mkdir()
    for name, place in {"data": "data", "examples": "docs/formats/examples", "fixtures": "tests/fixtures"}.items():
        (folder / name).symlink_to(ROOT / place, target_is_directory=True)
    machine = read_machine(ROOT / "data" / "machines" / "hpm.toml")
    simulate_campaign(turned_sample(ROOT / "data" / "machines" / "hpm.toml", "turned"), folder / "coupled", 1)
    rough_campaign(folder, 501)
    ends = np.linspace(8000.0, 20000.0, 5) * np.pi / 30.0
    plan = replace(machine.plan, spindle_speeds=(14000.0 * np.pi / 30.0,), passes=tuple(itertools.pairwise(ends)), pass_duration=2.2)
    simulate_campaign(replace(machine, plan=plan), folder / "passes", 5)
    (folder / "hit").mkdir()
    write_hit(folder / "hit")
    robot_campaign(folder)
    (folder / "ROBOT.toml").write_text(toml_of(robot_keys(sheet())), encoding="utf-8")
    mass, _ = rung_tooling(folder)
    return mass


def timeless(text: str) -> str:
    """Return what a command printed without what its computation took."""
    try:
        data = json.loads(text)
    except ValueError:
        return _TIME.sub("… s", text)
    if isinstance(data, dict):
        data.pop("seconds", None)
    return json.dumps(data, indent=1, ensure_ascii=False)


def run(folder: Path, only: Sequence[str]) -> None:
    """Run the commands in a folder, and write what each prints beside the files that it makes."""
    for line in commands(make_inputs(folder / _INPUTS)):
        if only and not any(word in line for word in only):
            continue
        with contextlib.chdir(folder):
            answer = CliRunner().invoke(app, shlex.split(line), env={"COLUMNS": "100", "NO_COLOR": "1"})
        name = re.sub(r"[^\w.+-]+", "_", re.sub(rf"{_INPUTS}/\S*/", "", line))[:80]
        print(f"{answer.exit_code}  {line}", flush=True)
        if answer.exit_code not in (0, 3):
            error = answer.exception
            print(answer.output, *(traceback.format_exception(error) if error else ()), sep="\n", file=sys.stderr)
        (folder / f"{name}.txt").write_text(timeless(answer.stdout), encoding="utf-8")


def openapi(folder: Path) -> None:
    """Write the description of the service."""
    from api.main import create_app
    from api.settings import Settings

    (folder / "openapi.json").write_text(json.dumps(create_app(Settings(data=folder / _INPUTS)).openapi(), indent=1), encoding="utf-8")


def made(folder: Path) -> dict[str, Path]:
    """Return the files of a folder by their names there, without inputs and hashes."""
    paths = (path for path in sorted(folder.rglob("*")) if path.is_file() and path.relative_to(folder).parts[0] != _INPUTS)
    return {path.relative_to(folder).as_posix(): path for path in paths if path.name != "SHA256SUMS"}


def apart(one: bytes, other: bytes) -> float | None:
    """Return the largest difference of the numbers of two texts, relative to the number or to a thousandth of the largest; None: words."""
    try:
        texts = one.decode("utf-8"), other.decode("utf-8")
    except UnicodeDecodeError:
        return None
    if _NUMBER.sub("#", texts[0]) != _NUMBER.sub("#", texts[1]):
        return None
    first, second = (np.array([float(each) for each in _NUMBER.findall(text)]) for text in texts)
    scale = np.maximum(np.abs(first), 1e-3 * np.abs(first).max(initial=1e-300))
    return float(np.max(np.abs(first - second) / scale, initial=0.0))


def compare(ours: Path, other: Path, all_of_them: bool) -> int:
    """Print which files differ, and return how many; unless all commands have run, of those that are here."""
    one, two = made(ours), made(other)
    two = two if all_of_them else {name: path for name, path in two.items() if name in one}
    differ = 0
    for name in sorted({*one, *two}):
        if name not in one or name not in two:
            found = "only here" if name in one else "only there"
        else:
            a, b = one[name].read_bytes(), two[name].read_bytes()
            if a == b:
                continue
            difference = apart(a, b)
            found = "other words" if difference is None else f"{difference:.1e}"
        differ += 1
        print(f"{found:<12} {name}")
    print(f"{len(one)} files, {differ} differ")
    return differ


def main(arguments: Sequence[str]) -> None:
    parser = argparse.ArgumentParser(prog="benchmarks frozen", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path, help="to write; what a former run left there goes")
    parser.add_argument("--beside", type=Path, help="folder of another commit")
    parser.add_argument("--only", default="", metavar="WORD,…")
    asked = parser.parse_args(arguments)
    folder = asked.folder.resolve()
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    run(folder, [word for word in asked.only.split(",") if word])
    openapi(folder)
    lines = [f"{hashlib.sha256(path.read_bytes()).hexdigest()}  {name}\n" for name, path in made(folder).items()]
    (folder / "SHA256SUMS").write_text("".join(lines), encoding="utf-8")
    if asked.beside is not None:
        sys.exit(compare(folder, asked.beside.resolve(), not asked.only) > 0)
