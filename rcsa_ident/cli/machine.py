"""simulate and warm."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from rcsa_ident.cli.common import Json, Seed, Stages, answers, emit, say
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
