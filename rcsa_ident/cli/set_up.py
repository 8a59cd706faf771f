"""simulate, schema and warm: the virtual machine and set-up."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from rcsa_ident.base.errors import InputError
from rcsa_ident.cli.common import Json, Seed, Stages, answers, emit, say, writable
from rcsa_ident.cli.processes import Processes
from rcsa_ident.front.processes import workers


@answers
def simulate(
    machine: Annotated[Path, typer.Argument(help="MACHINE.toml.", show_default=False)],
    out: Annotated[Path, typer.Option(help="Campaign folder to write; the truth goes beside it, into OUT.truth.", show_default=False)],
    seed: Seed = 1,
    processes: Processes = None,
    json_: Json = False,
) -> None:
    """Record a campaign on the virtual machine."""
    from rcsa_ident.front.samples import simulate_campaign as run

    stages = Stages(quiet=json_)
    with stages.stage("cuts") as progress, workers(processes, ("rcsa_ident.workflows.simulate",)) as pool:
        done = run(machine, out, seed, progress, pool.map)
    seconds = stages.seconds["cuts"]
    if json_:
        emit({"folder": str(done.folder), "truth": str(done.truth), "cuts": done.cuts, "seconds": seconds})
    else:
        say(f"{done.cuts} cuts in {seconds:.1f} s: {done.folder}, truth in {done.truth}")


@answers
def schema(
    name: Annotated[
        str, typer.Argument(metavar="tooling|campaign|machine|modes|cases|robot", help="The kind of file.", show_default=False)
    ],
    out: Annotated[Path | None, typer.Option(help="SCHEMA.json to write instead of printing it.", show_default=False)] = None,
    json_: Json = False,
) -> None:
    """Print the JSON Schema of a TOML file: an editor then completes its keys and marks wrong values.

    Name it in the first line of the file: #:schema SCHEMA.json
    """
    from rcsa_ident.io.files import write_text
    from rcsa_ident.io.settings.schemas import SCHEMAS, schema_of, schema_text

    if name not in SCHEMAS:
        raise InputError("name", name, f"one of {', '.join(SCHEMAS)}")
    if out is None:
        say(schema_text(name).rstrip())
        return
    write_text(writable(out), schema_text(name))
    if json_:
        emit({"out": str(out), "title": schema_of(name)["title"]})
    else:
        say(f"written: {out}; first line of a file that it belongs to: #:schema {out.name}")


@answers
def warm(processes: Processes = None, json_: Json = False) -> None:
    """Compile the numerical kernels once and cache them; the first command is then as fast as any other."""
    from rcsa_ident.front.compile_kernels import FIRST, STEPS, TOGETHER, compile_steps

    stages = Stages(quiet=json_)
    with stages.stage("kernels") as progress, workers(processes, ("rcsa_ident.front.compile_kernels",)) as pool:
        seconds = compile_steps(FIRST)
        for taken in pool.map(compile_steps, TOGETHER):
            seconds |= taken
            progress(len(seconds), len(STEPS))
    if json_:
        emit({"seconds": {name: seconds[name] for name in STEPS}, "together": stages.seconds["kernels"]})
    else:
        for name in STEPS:
            say(f"{name:<16} {seconds[name]:6.1f} s")
        say(f"{'together':<16} {stages.seconds['kernels']:6.1f} s")
