"""learn: what a cut or a tap of a new tool tells of it."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import typer

from rcsa_ident.base.errors import InputError
from rcsa_ident.cli.common import NOT_CONVERGED, Stages, emit, say, warn, writable
from rcsa_ident.cli.conditions import frf_source
from rcsa_ident.cli.identify import read_and_judge, read_tests
from rcsa_ident.front.processes import workers

#: Numbers from which on an exponent is easier to read.
LARGE = 1e4

if TYPE_CHECKING:
    from rcsa_ident.identification.hammer_lines import HammerLines
    from rcsa_ident.identification.machine import IdentifiedMachine
    from rcsa_ident.setup.campaign import Campaign
    from rcsa_ident.signals.measurement import Reading
    from rcsa_ident.workflows.learn_toolings import LearntToolings


@dataclass(frozen=True, slots=True)
class New:
    """Where what is learned is written, and how it is told. `toolings`: folder. `machine`: RESULT.json of the machine as it was taught."""

    toolings: Path
    machine: Path | None
    overwrite: bool
    json: bool


def learn_from_campaign(result: Path, campaign_dir: Path, new: New, processes: int | None) -> None:
    """Learn toolings that are new to a machine from a campaign's cuts and hammer tests of the tip."""
    from rcsa_ident.io.settings.setups import tooling_file_names

    stages, known = Stages(quiet=new.json), _known(result, new)
    with workers(processes) as pool:
        campaign, readings = read_and_judge(campaign_dir, pool, stages)
    files = {path for cut in campaign.cuts for path in (cut.recording, cut.air) if path is not None}
    files |= {test.file for test in campaign.tests}
    _learn(known, campaign, readings, read_tests(campaign), files, tooling_file_names(campaign_dir), new, stages)


def learn_from_taps(result: Path, tooling_file: Path, taps: Sequence[str], units: str | None, sensor_mass: float, new: New) -> None:
    """Learn a tooling that is new to a machine from hammer tests of its tip, each written as with --frf; the sensor's mass in kg."""
    from rcsa_ident.io.curves.frf_files import read_tap_tests
    from rcsa_ident.io.settings.setups import read_tooling
    from rcsa_ident.workflows.identify import hammer_lines
    from rcsa_ident.workflows.learn_toolings import campaign_of_taps

    known, tooling = _known(result, new), read_tooling(tooling_file)
    sources = [frf_source(text) for text in taps]
    try:
        curves = read_tap_tests(sources, units)
    except InputError as error:
        # asked for as with --frf, under another name
        raise InputError("taps" if error.field == "frf" else error.field, error.found, error.allowed, error.where) from None
    campaign = campaign_of_taps(tooling, list(curves), sensor_mass)
    tests = hammer_lines(campaign, lambda test: curves[test.axis.upper(), test.axis.upper()])
    files = {source.path for source in sources}
    _learn(known, campaign, [], tests, files, {tooling.name: tooling_file.name}, new, Stages(quiet=new.json))


class _Known(NamedTuple):
    """The machine as it is known, its file's content, and the file."""

    machine: IdentifiedMachine
    data: dict[str, Any]
    path: Path


def _known(result: Path, new: New) -> _Known:
    """The machine as it is known, once all that is to be written may be."""
    from rcsa_ident.cli.results import read_identified

    if new.machine is not None:
        writable(new.machine, "--machine")
        _free(new.machine, new.overwrite, "--machine")
    return _Known(*read_identified(result), result)


def _learn(
    known: _Known,
    campaign: Campaign,
    readings: Sequence[Reading],
    tests: Sequence[HammerLines],
    files: Iterable[Path],
    names: Mapping[str, str],
    new: New,
    stages: Stages,
) -> None:
    """Learn, write and tell: each tooling under its own file name; exit code 3 where something contradicts."""
    from rcsa_ident.cli.results import tell
    from rcsa_ident.io.results.parts import write_result
    from rcsa_ident.io.results.updated_results import recordings_of, refuse_taught, taught_result
    from rcsa_ident.io.settings.toolings import write_tooling
    from rcsa_ident.workflows.identify import left_out
    from rcsa_ident.workflows.learn_toolings import learn_toolings

    recordings = recordings_of(files)
    refuse_taught(known.data, recordings)
    used = {each.tooling for each in readings if each.verdict.usable} | {test.tooling for test in tests}
    paths = {key: new.toolings / names[key] for key in campaign.toolings if key in used}
    for path in paths.values():
        _free(path, new.overwrite, "--toolings")
    with stages.stage("learning"):
        found = learn_toolings(known.machine, campaign, readings, tests)
    try:
        new.toolings.mkdir(parents=True, exist_ok=True)
    except OSError:
        raise InputError("--toolings", "a folder that cannot be made", "a folder, or the name of a new one", str(new.toolings)) from None
    written = {each.drawn.name: paths[key] for key, each in zip(found.keys, found.toolings, strict=True) if not each.contradiction}
    for each in found.toolings:
        if each.drawn.name in written:
            write_tooling(written[each.drawn.name], each.tooling)
    taught = new.machine if found.good else None
    if taught is not None:
        write_result(taught, taught_result(known.data, found.machine, campaign.name, recordings))
    if new.json:
        emit(_told(found, {name: str(path) for name, path in written.items()}) | {"seconds": stages.seconds})
    else:
        _show(found, {name: str(path) for name, path in written.items()})
        for cut, reason in left_out(readings):
            warn(f"{cut} left out: {reason}")
        tell(known.machine, known.path)
        if taught is not None:
            say(f"written: {taught}; its tips are those of the toolings in {new.toolings}")
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
