"""demo: the whole chain, from recordings to a report."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from rcsa_ident.base.units import from_rpm, to_hz, to_rpm
from rcsa_ident.cli.common import Json, Seed, Stages, answers, emit, say, warn
from rcsa_ident.cli.identify import Method, exit_by_status, read_and_judge, read_tests, result_of, search, warn_left_out
from rcsa_ident.cli.processes import Processes
from rcsa_ident.front.processes import Workers, workers

if TYPE_CHECKING:
    from collections.abc import Mapping

    from rcsa_ident.base.arrays import FloatArray
    from rcsa_ident.dynamics.coordinates import Dof
    from rcsa_ident.identification.machine import IdentifiedMachine
    from rcsa_ident.identification.result import Identification
    from rcsa_ident.report.html import ToolingPage
    from rcsa_ident.setup.campaign import Campaign
    from rcsa_ident.setup.tooling import Tooling

#: Where predicted and true tooltip FRFs are compared [Hz].
COMPARED = (600.0, 4000.0, 5.0)
SPEEDS = (4000.0, 20000.0, 50.0)
MAX_DEPTH = 0.01
#: Of a checkout.
SAMPLES = Path("data/sample_runs")


@answers
def demo(
    data: Annotated[
        Path | None,
        typer.Option(
            help="Campaign folder; default: data/sample_runs, or where that is missing OUT/sample_runs, recorded on the virtual machine.",
            show_default=False,
        ),
    ] = None,
    out: Annotated[Path, typer.Option(help="Folder for the results; created if it is missing.")] = Path("report"),
    tooling: Annotated[
        list[Path] | None, typer.Option(help="Further TOOLING.toml; default: those in DATA/../machines/toolings.", show_default=False)
    ] = None,
    seed: Seed = 1,
    processes: Processes = None,
    json_: Json = False,
) -> None:
    """Run the whole chain on a campaign: verdicts, identification, tooltip FRFs, lobes, report.

    Where the virtual machine has left its truth beside the campaign (DATA.truth), predictions are compared with it
    afterwards; the identification never reads it.
    """
    from rcsa_ident.io.files import filling, write_text
    from rcsa_ident.io.results.parts import write_result
    from rcsa_ident.report.html import report_html
    from rcsa_ident.workflows.identify import mode_deviations

    stages = Stages(quiet=json_)
    with workers(processes) as pool, filling(out, "--out") as part:
        data, others = _data(data, out, pool, stages)
        campaign, readings = read_and_judge(data, pool, stages)
        extra = _further_toolings(campaign, tooling or others)
        found = search(campaign, readings, Method.default, seed, pool, stages, tests=read_tests(campaign))
        deviations = mode_deviations(found)
        result = result_of(found, campaign, readings, deviations)
        write_result(part / "RESULT.json", result)
        pages: list[ToolingPage] = []
        if found.axes:
            recorded = frozenset(cut.tooling for cut in campaign.cuts)
            task = partial(_page, found.machine, recorded, _truth_of(data), part)
            wanted = [*campaign.toolings.items(), *extra.items()]
            with stages.stage("tooltips and lobes") as progress:
                for page in pool.map(task, wanted):
                    pages.append(page)
                    progress(len(pages), len(wanted))
        with stages.stage("report"):
            text = report_html(found, campaign, readings, pages, stages.seconds, deviations)
            write_text(part / "report.html", text)
    if json_:
        emit(_summary(found, pages, stages, out))
    else:
        _show(pages, found, deviations)
        warn_left_out(result)
        say(
            ", ".join(f"{name} {seconds:.1f} s" for name, seconds in stages.seconds.items())
            + f"; together {sum(stages.seconds.values()):.1f} s"
        )
        say(f"written: {out / 'report.html'}, RESULT.json, {len(pages)} FRFs, {len(pages)} lobes")
    exit_by_status(found)


def _data(given: Path | None, out: Path, pool: Workers, stages: Stages) -> tuple[Path, list[Path]]:
    """The campaign's folder, and the files of toolings that belong to its machine."""
    if given is not None or SAMPLES.is_dir():
        folder = SAMPLES if given is None else given
        return folder, sorted((folder.resolve().parent / "machines" / "toolings").glob("*.toml"))
    from rcsa_ident.front.samples import make_sample_campaign, sample_toolings

    with stages.stage("sample campaign") as progress:
        folder = make_sample_campaign(out / "sample_runs", progress=progress, mapper=pool.map)
    if not stages.quiet:
        say(f"sample campaign of the virtual machine: {folder}")
    return folder, list(sample_toolings().values())


def _further_toolings(campaign: Campaign, paths: list[Path]) -> dict[str, Tooling]:
    """Toolings that the campaign has not cut with."""
    from rcsa_ident.io.settings.setups import read_tooling

    read = [read_tooling(path) for path in paths]
    return {each.name: each for each in read if each.name not in campaign.toolings}


def _truth_of(data: Path) -> Path:
    """Where the virtual machine leaves the truth of a campaign."""
    return data.with_name(data.resolve().name + ".truth")


def _page(machine: IdentifiedMachine, recorded: frozenset[str], truth: Path, out: Path, named: tuple[str, Tooling]) -> ToolingPage:
    """Compute, write and collect what there is to say of one tooling."""
    import numpy as np

    from rcsa_ident.dynamics.coordinates import Dof
    from rcsa_ident.io.curves.lobes import write_lobes
    from rcsa_ident.io.curves.tips import write_tip_csv
    from rcsa_ident.machine.known_tip import measured_tip
    from rcsa_ident.report.html import ToolingPage
    from rcsa_ident.report.summaries import entries_of
    from rcsa_ident.setup.cut import CutSpec
    from rcsa_ident.stability.lobes import stability_lobes
    from rcsa_ident.workflows.advise import advise
    from rcsa_ident.workflows.tool_change import ToolChange, tooltip

    name, tooling = named
    asked = tooltip(machine, tooling)
    response = asked.tip
    frequency = to_hz(response.omega)
    speeds = from_rpm(np.arange(SPEEDS[0], SPEEDS[1] + 0.5 * SPEEDS[2], SPEEDS[2]))
    change = ToolChange(machine, tooling, CutSpec(), speeds, MAX_DEPTH)
    advice = advise(change)
    safe = "".join(c if c.isalnum() or c in "-_." else "_" for c in name)
    write_tip_csv(out / f"FRF_{safe}.csv", response)
    write_lobes(out / f"LOBES_{safe}.csv", advice.lobes, recommended=advice.usable.stable, preview=advice.preview)
    entries, known = entries_of(response), response.deviation()
    tip = {axis: response.between(str(row), str(col)) for axis, (row, col) in entries.items()}
    deviation = {axis: known[pair] for axis, pair in entries.items() if pair in known}
    true, error, coverage = _truth(truth / "tip" / f"{name}.csv", frequency, tip, deviation)
    limit = None
    if true is not None and all(axis in true for axis in tip):
        curves = {(Dof(axis[0].lower()), Dof(axis[-1].lower())): (frequency, value) for axis, value in true.items()}
        direct = {row: curve for (row, col), curve in curves.items() if row is col}
        true_tip = measured_tip(direct, {pair: curve for pair, curve in curves.items() if pair[0] is not pair[1]})
        limit = stability_lobes(true_tip, change.process, speeds, MAX_DEPTH).limit_depth
    # a page needs no more than what an eye resolves
    shown = slice(None, None, 4)
    workpiece = "" if machine.workpiece is None else f"{machine.workpiece.name}, "
    return ToolingPage(
        name,
        name in recorded,
        frequency[shown],
        {axis: value[shown] for axis, value in tip.items()},
        {axis: (real[shown], imaginary[shown]) for axis, (real, imaginary) in deviation.items()},
        None if true is None else {axis: value[shown] for axis, value in true.items()},
        error,
        coverage,
        advice,
        limit,
        None if machine.band is None else (to_hz(machine.band[0]), to_hz(machine.band[1])),
        f"half-immersion down-milling, feed +X, {tooling.cutter.teeth} teeth, {workpiece}{advice.lobes.method} method",
        advice.remarks,
        None if asked.speed is None else to_rpm(asked.speed),
    )


def _truth(
    path: Path, frequency: FloatArray, tip: dict[str, Any], deviation: dict[str, tuple[FloatArray, FloatArray]]
) -> tuple[dict[str, Any] | None, dict[str, float], dict[str, float]]:
    """The true FRF at the same frequencies, the relative difference and the band's coverage, where the truth is known."""
    import numpy as np

    from rcsa_ident.io.curves.tips import read_frf_csv

    if not path.is_file():
        return None, {}, {}
    curves = read_frf_csv(path)
    compared = np.arange(COMPARED[0], COMPARED[1] + 0.5 * COMPARED[2], COMPARED[2])
    true, error, coverage = {}, {}, {}
    known = dict(curves.values)
    for cross in ("XY", "YX"):
        if f"{cross}_re" in curves.bands and f"{cross}_im" in curves.bands:
            known[cross] = curves.bands[f"{cross}_re"] + 1j * curves.bands[f"{cross}_im"]
    for axis, value in tip.items():
        # what is across is measured by the direct motion under the same force
        if axis not in known or axis[-1] not in known:
            continue
        true[axis] = np.interp(frequency, curves.frequency, known[axis])
        there, direct = (np.interp(compared, curves.frequency, known[each]) for each in (axis, axis[-1]))
        difference = np.interp(compared, frequency, value) - there
        error[axis] = float(np.linalg.norm(difference) / np.linalg.norm(direct))
        if axis in deviation:
            real, imaginary = (np.interp(compared, frequency, std) for std in deviation[axis])
            inside = np.concatenate([np.abs(difference.real) <= 2.0 * real, np.abs(difference.imag) <= 2.0 * imaginary])
            coverage[axis] = float(inside.mean())
    return true, error, coverage


def _show(pages: list[ToolingPage], found: Identification, deviations: Mapping[Dof, tuple[FloatArray, FloatArray]]) -> None:
    from rich.markup import escape
    from rich.table import Table

    from rcsa_ident.cli.tables import limit_text, recommended_text, show, show_identification

    show_identification(found, deviations)
    known = any(page.error for page in pages)
    headers = [
        "tooling",
        "recorded",
        *(["error X\n%", "error Y\n%"] if known else []),
        "stable\nanywhere\nmm",
        "recommended cuts\nrev/min: mm (limit mm)",
    ]
    table = Table(*headers, title="tooltip and stability, half-immersion down-milling", title_justify="left")
    for page in pages:
        errors = [f"{100 * page.error[axis]:.1f}" if axis in page.error else "" for axis in ("X", "Y")] if known else []
        assert page.advice is not None
        lobes = page.advice.lobes
        best = "\n".join(
            f"{to_rpm(p.spindle_speed):.0f}: {recommended_text(p)} ({limit_text(p.limit, lobes.max_depth)})"
            for p in page.advice.recommended
        )
        anywhere = "" if lobes.absolute_limit is None else f"{1e3 * lobes.absolute_limit:.2f}"
        table.add_row(escape(page.name), "yes" if page.recorded else "no", *errors, anywhere, best)
    show(table)
    for page in pages:
        for doubt in page.warnings:
            warn(f"{page.name}: {doubt}")


def _summary(found: Identification, pages: list[ToolingPage], stages: Stages, out: Path) -> dict[str, Any]:
    from rcsa_ident.report.summaries import lobes_summary

    toolings = {
        page.name: {"recorded": page.recorded, "error": dict(page.error), "coverage": dict(page.coverage), "warnings": list(page.warnings)}
        | ({} if page.advice is None else lobes_summary(page.advice))
        for page in pages
    }
    return {
        "status": str(found.status),
        "reasons": list(found.reasons),
        "notes": list(found.notes),
        "seed": found.seed,
        "cuts_used": len(found.cut_ids),
        "toolings": toolings,
        "seconds": stages.seconds,
        "out": str(out),
    }
