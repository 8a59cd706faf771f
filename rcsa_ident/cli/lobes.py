"""tooltip and lobes: what a result is for."""

from __future__ import annotations

import math
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, cast

import typer

from rcsa_ident.base.errors import InputError
from rcsa_ident.base.units import from_hz, from_rpm, inclusive, to_hz, to_rpm
from rcsa_ident.cli.common import Json, Stages, answers, emit, say, warn, writable
from rcsa_ident.cli.conditions import change_of, cut_of, share_of, subjects_of
from rcsa_ident.cli.options import Bands, CutOptions, SpeedOptions, StiffnessSpread, TemperatureC, TipOptions, takes_groups
from rcsa_ident.cli.results import at_temperature, read_machine

if TYPE_CHECKING:
    from collections.abc import Mapping

    from rcsa_ident.base.arrays import FloatArray
    from rcsa_ident.dynamics.coordinates import Coordinate
    from rcsa_ident.dynamics.uncertain import UncertainReceptance
    from rcsa_ident.machine.machine import Machine
    from rcsa_ident.workflows.tool_change import ToolChange

    Deviation = Mapping[tuple[Coordinate, Coordinate], tuple[FloatArray, FloatArray]]

ResultFile = Annotated[
    Path, typer.Argument(help="RESULT.json of an identification, or FLANGE.csv of a measured flange.", show_default=False)
]
ToolingFile = Annotated[Path, typer.Argument(help="TOOLING.toml of any tool, also of one that has never cut.", show_default=False)]
Plot = Annotated[Path | None, typer.Option(metavar="FILE.png|svg", help="Draw a figure.", show_default=False)]


@answers
def tooltip(
    result: ResultFile,
    tooling: ToolingFile,
    out: Annotated[Path, typer.Option(help="FRF.csv to write, m/N.", show_default=False)],
    from_: Annotated[
        float | None,
        typer.Option("--from", help="Lowest frequency, Hz; default: 100, or where a measured flange begins.", show_default=False),
    ] = None,
    to: Annotated[
        float | None, typer.Option("--to", help="Highest frequency, Hz; default: end of the identified band.", show_default=False)
    ] = None,
    step: Annotated[float, typer.Option(help="Frequency step, Hz.")] = 1.0,
    speed: Annotated[
        float | None,
        typer.Option(
            "--speed",
            "--speed-rpm",
            help="Spindle speed, rev/min, for a machine that changes with it; default: the middle of the campaign's.",
            show_default=False,
        ),
    ] = None,
    temperature_c: TemperatureC = None,
    relative: Annotated[
        bool, typer.Option("--relative", help="Relative to the workpiece, where that gives way, too: what lobes are computed from.")
    ] = False,
    plot: Plot = None,
    bands: Bands = True,
    stiffness_spread: StiffnessSpread = 0.05,
    json_: Json = False,
) -> None:
    """Predict the tooltip FRF of any tooling on the identified machine: the tool's own, whatever gives way on the workpiece's side."""
    from rcsa_ident.base.errors import positive

    writable(out)
    check_plot(plot)
    spindle_speed = None if speed is None else from_rpm(positive("--speed", speed, "rev/min"))
    share = share_of(stiffness_spread, "--stiffness-spread", 50.0)
    machine = cast("Machine", at_temperature(read_machine(result), temperature_c))
    last = to_hz(machine.band[1]) if to is None else to  # type: ignore[index]
    first = to_hz(machine.lowest) if from_ is None else from_
    frequency = inclusive(first, last, step, ("--from", "--to", "--step"), "Hz")
    tell_tooltip(machine, tooling, out, frequency, spindle_speed, bands, share, relative, plot, json_)


def tell_tooltip(
    machine: Machine,
    tooling: Path,
    out: Path,
    frequency: FloatArray,
    spindle_speed: float | None = None,
    bands: bool = True,
    stiffness_spread: float = 0.0,
    relative: bool = False,
    plot: Path | None = None,
    json_: bool = False,
) -> None:
    """Write the tooltip FRF of a tooling on a machine at frequencies [Hz], draw it, and print its peaks."""
    from rcsa_ident.io.curves.tips import write_tip_csv
    from rcsa_ident.io.settings.setups import read_tooling
    from rcsa_ident.workflows.tool_change import tooltip as ask

    tool = read_tooling(tooling)
    stages = Stages(quiet=json_)
    with stages.stage("tooltip"):
        found = ask(machine, tool, from_hz(frequency), spindle_speed, bands, stiffness_spread, relative)
        deviation = found.tip.deviation()
    write_tip_csv(out, found.tip)
    if plot is not None:
        from rcsa_ident.report.curves import tip_figure
        from rcsa_ident.report.lobes import save_figure

        save_figure(tip_figure(found.tip, machine.band), str(plot))
    peaks = peaks_of(frequency, found.tip, deviation)
    if json_:
        summary = {"frequencies": len(frequency), "peaks": {name: asdict(p) for name, (p, _) in peaks.items()}}
        summary |= {"spindle_speed_rpm": None if found.speed is None else to_rpm(found.speed), "state": found.state or None}
        emit(summary | {"warnings": list(found.remarks), "seconds": stages.seconds, "out": str(out)})
        return
    from rcsa_ident.cli.tables import show_peaks

    show_peaks({name: (p.frequency_hz, p.magnitude, p.lowest_real_part, band) for name, (p, band) in peaks.items()})
    if found.state:
        middle = "" if spindle_speed is not None or found.speed is None else ", the middle of the speeds that were cut"
        say(f"{found.state}{middle}")
    if "XY" in peaks:
        say("XY: motion in X under a force in Y; YX the other way")
    for remark in found.remarks:
        warn(remark)
    say(f"written: {out} ({len(frequency)} frequencies, {stages.seconds['tooltip']:.2f} s)")


@answers
@takes_groups
def lobes(
    files: Annotated[
        list[Path],
        typer.Argument(metavar="[RESULT.json] TOOLING.toml", help="With --modes or --frf the tooling alone.", show_default=False),
    ],
    out: Annotated[Path, typer.Option(help="LOBES.csv to write.", show_default=False)],
    tip: TipOptions,
    cut: CutOptions,
    speeds: SpeedOptions,
    tests: Annotated[
        Path | None,
        typer.Option(
            help="CUTS.csv: tested cuts (spindle_speed_rpm, axial_depth_mm, verdict stable|chatter|marginal).", show_default=False
        ),
    ] = None,
    tests_out: Annotated[
        Path | None,
        typer.Option(help="TESTS.csv to write: each tested cut with the probability that it is stable; with --tests.", show_default=False),
    ] = None,
    surface_depth_mm: Annotated[
        float | None,
        typer.Option(
            help="Also the surface location error of stable cuts at this depth, mm; with --feed-per-tooth-mm.", show_default=False
        ),
    ] = None,
    map_: Annotated[
        Path | None,
        typer.Option(
            "--map", help="MAP.csv to write: which depths are stable above the first limit, and --plot draws them.", show_default=False
        ),
    ] = None,
    map_depths: Annotated[int, typer.Option(min=2, max=2000, help="Steps of the depth in the map.")] = 100,
    map_full: Annotated[bool, typer.Option(help="Compute every point of the map instead of following the boundary.")] = False,
    temperature_c: TemperatureC = None,
    plot: Plot = None,
    bands: Bands = True,
    stiffness_spread: StiffnessSpread = 0.05,
    json_: Json = False,
) -> None:
    """Compute stability lobes of a tooling: on an identified machine, from a modal model or from tap tests."""
    writable(out)
    check_plot(plot)
    if tests_out is not None:
        writable(tests_out, "--tests-out")
        if tests is None:
            raise InputError("--tests-out", str(tests_out), "given together with --tests")
    if map_ is not None:
        writable(map_, "--map")
    machine, (tooling,) = subjects_of(files, tip)
    machine = at_temperature(machine, temperature_c)
    change = change_of(machine, tooling, cut_of(cut, speeds.speed_variation), speeds, bands, stiffness_spread)
    if surface_depth_mm is not None and change.cut.feed_per_tooth is None:
        raise InputError("--surface-depth-mm", surface_depth_mm, "given together with --feed-per-tooth-mm")
    surface_depth = None if surface_depth_mm is None else surface_depth_mm * 1e-3
    tell_lobes(change, out, tests, tests_out, surface_depth, map_, map_depths, map_full, plot, json_)


def tell_lobes(
    change: ToolChange,
    out: Path,
    tests: Path | None = None,
    tests_out: Path | None = None,
    surface_depth: float | None = None,
    map_: Path | None = None,
    map_depths: int = 100,
    map_full: bool = False,
    plot: Path | None = None,
    json_: bool = False,
) -> None:
    """Write and print the stability lobes of what is asked about, and what is recommended; options as of `lobes`, lengths in metres."""
    from rcsa_ident.io.curves.lobes import write_lobes, write_map
    from rcsa_ident.io.settings.tested_cuts import read_tested_cuts, write_tests
    from rcsa_ident.machine.learnt_tip import LearntTip
    from rcsa_ident.stability.labels.coverage import uncovered
    from rcsa_ident.workflows.advise import advise
    from rcsa_ident.workflows.tool_change import map_of, surface_of, tested_answers

    stages = Stages(quiet=json_)
    with stages.stage("lobes"):
        cuts = None if tests is None else read_tested_cuts(tests)
        advice = advise(change, tested=cuts)
        surface = None if surface_depth is None else surface_of(change, surface_depth)
    found, remarks = advice.lobes, [*advice.remarks, *([] if surface is None else surface.warnings)]
    chart = None
    if map_ is not None:
        with stages.stage("map"):
            chart = map_of(change, map_depths, map_full)
        write_map(map_, chart)
    write_lobes(out, found, surface, advice.usable.stable, advice.preview)
    if tests_out is not None and cuts is not None:
        with stages.stage("tests"):
            answers = tested_answers(change, cuts)
            write_tests(tests_out, cuts, answers)
        if isinstance(change.machine, LearntTip):
            remarks += uncovered(change.machine.posterior.points, cuts, change.process, answers.covered)
    if plot is not None:
        from rcsa_ident.report.lobes import Judged, save_figure, stability_figure

        tested = None if cuts is None or advice.tested is None else Judged(cuts, advice.tested)
        save_figure(
            stability_figure(found, advice.recommended, None, tested, surface, chart, advice.usable, advice.drawn_around), str(plot)
        )
    if json_:
        from rcsa_ident.report.summaries import lobes_summary

        summary = lobes_summary(advice)
        if chart is not None:
            summary |= {"map": {"multipliers": chart.evaluations, "error": chart.error, "out": str(map_)}}
        files_ = {name: str(path) for name, path in (("plot", plot), ("tests_out", tests_out)) if path is not None}
        emit(summary | {"warnings": remarks, "seconds": stages.seconds, "out": str(out)} | files_)
        return
    from rcsa_ident.cli.tables import show_lobes, show_tally

    show_lobes(advice)
    if advice.state:
        say(advice.state)
    if advice.tested is not None:
        show_tally(advice.tested)
    for remark in remarks:
        warn(remark)
    if plot is not None:
        say(f"drawn: {plot}")
    if chart is not None:
        points = f"{chart.growth.size} cuts, {chart.evaluations} multipliers, {stages.seconds['map']:.2f} s"
        say(f"written: {map_} ({points})")
    if tests_out is not None:
        say(f"written: {tests_out}")
    say(f"written: {out} ({found.spindle_speed.size} speeds, {stages.seconds['lobes']:.2f} s)")


def check_plot(path: Path | None, option: str = "--plot") -> None:
    """Refuse a figure that cannot be written before the work, not after it."""
    if path is None:
        return
    if path.suffix.lower() not in (".png", ".svg"):
        raise InputError(option, f"suffix '{path.suffix}'", "a file that ends in .png or .svg", str(path))
    writable(path, option)


def peaks_of(frequency: FloatArray, tip: UncertainReceptance, deviation: Deviation) -> dict[str, Any]:
    """Return the peak of each axis, and of each cross term that is there, with two standard deviations of its magnitude (NaN without)."""
    import numpy as np

    from rcsa_ident.report.summaries import entries_of, peak_row

    peaks = {}
    for name, (row, col) in entries_of(tip).items():
        values = tip.between(str(row), str(col))
        k = int(np.argmax(np.abs(values)))
        band = math.nan
        if (row, col) in deviation:
            real, imaginary = (part[k] for part in deviation[row, col])
            unit = values[k] / abs(values[k])
            band = 2.0 * math.hypot(real * unit.real, imaginary * unit.imag)
        peaks[name] = (peak_row(frequency, values), band)
    return peaks
