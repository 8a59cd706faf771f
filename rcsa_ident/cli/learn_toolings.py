"""learn: what a cut of a new tool tells of it."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

from rcsa_ident.cli.common import NOT_CONVERGED, Stages, emit, say, warn, writable
from rcsa_ident.cli.identify import read_and_judge
from rcsa_ident.errors import InputError
from rcsa_ident.processes import workers

#: Numbers from which on an exponent is easier to read.
LARGE = 1e4

if TYPE_CHECKING:
    from rcsa_ident.workflows.learn_toolings import LearntToolings


def learn_from_campaign(
    result: Path, campaign_dir: Path, toolings: Path, machine: Path | None, overwrite: bool, processes: int | None, json_: bool
) -> None:
    """Learn toolings that are new to a machine from their cuts; one that its cuts contradict is named and not written, exit code 3."""
    from rcsa_ident.cli.results import read_identified, tell
    from rcsa_ident.io.results import write_result
    from rcsa_ident.io.setups import tooling_file_names
    from rcsa_ident.io.taught_results import taught_result
    from rcsa_ident.io.toolings import write_tooling
    from rcsa_ident.workflows.identify import left_out
    from rcsa_ident.workflows.learn_toolings import learn_toolings

    if machine is not None:
        writable(machine, "--machine")
        _free(machine, overwrite, "--machine")
    known, data = read_identified(result)
    stages = Stages(quiet=json_)
    with workers(processes) as pool:
        campaign, readings = read_and_judge(campaign_dir, pool, stages)
    names = tooling_file_names(campaign_dir)
    used = {each.tooling for each in readings if each.verdict.usable}
    paths = {key: toolings / names[key] for key in campaign.toolings if key in used}
    for path in paths.values():
        _free(path, overwrite, "--toolings")
    with stages.stage("learning"):
        found = learn_toolings(known, campaign, readings)
    try:
        toolings.mkdir(parents=True, exist_ok=True)
    except OSError:
        raise InputError("--toolings", "a folder that cannot be made", "a folder, or the name of a new one", str(toolings)) from None
    written = {each.drawn.name: paths[key] for key, each in zip(found.keys, found.toolings, strict=True) if not each.contradiction}
    for each in found.toolings:
        if each.drawn.name in written:
            write_tooling(written[each.drawn.name], each.tooling)
    if machine is not None and found.good:
        write_result(machine, taught_result(data, found.machine, campaign.name))
    if json_:
        emit(_told(found, {name: str(path) for name, path in written.items()}) | {"seconds": stages.seconds})
    else:
        _show(found, {name: str(path) for name, path in written.items()})
        for cut, reason in left_out(readings):
            warn(f"{cut} left out: {reason}")
        tell(known, result)
        if machine is not None and found.good:
            say(f"written: {machine}; its tips are those of the toolings in {toolings}")
    if not found.good:
        raise typer.Exit(NOT_CONVERGED)


def _free(path: Path, overwrite: bool, option: str) -> None:
    """Refuse to write over a file unless that is asked for."""
    if path.exists() and not overwrite:
        raise InputError(option, "a file that is there", "a name that is free, or --overwrite", str(path))


def _told(found: LearntToolings, written: dict[str, str]) -> dict[str, Any]:
    """What is printed for machines."""
    from rcsa_ident.workflows.learn_toolings import learnt_row

    row = learnt_row(found)
    return row | {"toolings": [each | {"file": written.get(each["name"])} for each in row["toolings"]]}


def _show(found: LearntToolings, written: dict[str, str]) -> None:
    from rcsa_ident.workflows.learn_toolings import told

    for each in found.toolings:
        say(f"{each.drawn.name}:")
        for row in told(each):
            before = _with_deviation(row.drawn, row.drawn_std)
            say(f"  {row.what} {before} → {_with_deviation(row.found, row.found_std)} {row.unit}")
        if each.contradiction:
            warn(f"{each.drawn.name} is not written: {each.contradiction}")
        else:
            say(f"  written: {written[each.drawn.name]}; what is known of its models is in it, and it belongs to none any more")
    for note in found.notes:
        say(f"note: {note}")
    if not found.converged:
        warn("the fit still gained when its steps ran out")


def _with_deviation(value: float, std: float) -> str:
    """A number with its standard deviation, with an exponent where it is large."""
    from rcsa_ident.report.summaries import two_digits

    return f"{value:.3g} ± {std:.2g}" if value >= LARGE else f"{two_digits(std, value)} ± {two_digits(std)}"
