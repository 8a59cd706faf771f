"""tooltip and lobes: what a result is for."""

from __future__ import annotations

import math
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from rcsa_ident.cli.common import Json, Stages, answers, emit, inclusive, say, warn, writable
from rcsa_ident.cli.conditions import process_of, speeds_of, subjects_of, warn_outside
from rcsa_ident.cli.options import Bands, CutOptions, SpeedOptions, StiffnessSpread, TipOptions, takes_groups
from rcsa_ident.cli.results import read_machine as read_machine
from rcsa_ident.cli.results import read_machine_over_speed as read_machine_over_speed
from rcsa_ident.errors import InputError

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from rcsa_ident.arrays import FloatArray
    from rcsa_ident.cli.conditions import Subject
    from rcsa_ident.dynamics.coordinates import Dof
    from rcsa_ident.identification.posterior import MachineAxis
    from rcsa_ident.report.lobes import Judged
    from rcsa_ident.stability.result import StabilityLobes
    from rcsa_ident.stability.stability_map import StabilityMap
    from rcsa_ident.stability.surface_error import SurfaceError
    from rcsa_ident.stability.tested_cuts import TestedCuts
    from rcsa_ident.workflows.lobes import LobeConditions
    from rcsa_ident.workflows.tip import TooltipResponse

ResultFile = Annotated[Path, typer.Argument(help="RESULT.json of an identification.", show_default=False)]
ToolingFile = Annotated[Path, typer.Argument(help="TOOLING.toml; it need not have been cut with.", show_default=False)]
Plot = Annotated[Path | None, typer.Option(metavar="FILE.png|svg", help="Draw a figure.", show_default=False)]


@answers
def tooltip(
    result: ResultFile,
    tooling: ToolingFile,
    out: Annotated[Path, typer.Option(help="FRF.csv to write, m/N.", show_default=False)],
    from_: Annotated[float, typer.Option("--from", help="Lowest frequency, Hz.")] = 100.0,
    to: Annotated[
        float | None, typer.Option("--to", help="Highest frequency, Hz; default: end of the identified band.", show_default=False)
    ] = None,
    step: Annotated[float, typer.Option(help="Frequency step, Hz.")] = 1.0,
    speed: Annotated[
        float | None,
        typer.Option(
            help="Spindle speed, rev/min, for a machine that changes with it; default: the middle of the campaign's.", show_default=False
        ),
    ] = None,
    bands: Bands = True,
    stiffness_spread: StiffnessSpread = 0.05,
    json_: Json = False,
) -> None:
    """Predict the tooltip FRF of any tooling on the identified machine."""

    from rcsa_ident.errors import positive
    from rcsa_ident.io.setups import read_tooling

    writable(out)
    omega = None if speed is None else positive("--speed", speed, "rev/min") * math.pi / 30.0
    share = _share(stiffness_spread)
    machine, data = read_machine_over_speed(result)
    assembly = read_tooling(tooling).assembly
    last = data["band_hz"][1] if to is None else to
    frequency = inclusive(from_, last, step, ("--from", "--to", "--step"), "Hz")
    if to is not None and to > 1.001 * data["band_hz"][1]:
        warn(f"the machine was identified up to {data['band_hz'][1]:.0f} Hz; above that the FRF is extrapolated")
    if omega is not None:
        known = machine.speed_range
        if known is not None and not known[0] * (1.0 - 1e-9) <= omega <= known[1] * (1.0 + 1e-9):
            low, high = (each * 30.0 / math.pi for each in known)
            warn(f"the machine was identified from {low:.0f} to {high:.0f} rev/min; outside it stays what it is at the nearest of them")
    stages = Stages(quiet=json_)
    with stages.stage("tooltip"):
        response = tip_response(machine.at(omega), assembly, frequency, bands, omega, share)
    write_response(out, frequency, response)
    peaks = peaks_of(frequency, response)
    if json_:
        emit(
            {
                "frequencies": len(frequency),
                "peaks": {a.upper(): asdict(p) for a, (p, _) in peaks.items()},
                "seconds": stages.seconds,
                "out": str(out),
            }
        )
        return
    from rcsa_ident.cli.tables import show_peaks

    show_peaks({a: (p.frequency_hz, p.magnitude, p.lowest_real_part, band) for a, (p, band) in peaks.items()})
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
    plot: Plot = None,
    bands: Bands = True,
    stiffness_spread: StiffnessSpread = 0.05,
    json_: Json = False,
) -> None:
    """Compute stability lobes of a tooling: on an identified machine, from a modal model or from tap tests."""
    from rcsa_ident.workflows.lobes import best_speeds

    writable(out)
    check_plot(plot)
    if map_ is not None:
        writable(map_, "--map")
    (subject,) = subjects_of(files, tip, stiffness_spread)
    process = process_of(cut, speeds, subject)
    conditions = speeds_of(speeds, process)
    if surface_depth_mm is not None and process.feed_per_tooth is None:
        raise InputError("--surface-depth-mm", surface_depth_mm, "given together with --feed-per-tooth-mm")
    warn_outside(subject, conditions.speeds)
    stages = Stages(quiet=json_)
    with stages.stage("lobes"):
        limits = subject.limits(conditions, bands)
        found, doubts = limits.lobes, subject.doubts(limits)
        tested = None if tests is None else tested_cuts(tests, subject, conditions)
        surface = None if surface_depth_mm is None else subject.surface(process, found.spindle_speed, surface_depth_mm * 1e-3)
    chart = None
    if map_ is not None:
        with stages.stage("map"):
            chart = subject.map(conditions, map_depths, map_full)
        write_map(map_, chart)
    doubts += [] if surface is None else list(surface.warnings)
    write_lobes(out, found, limits.band, surface)
    best = best_speeds(found)
    if plot is not None:
        from rcsa_ident.report.lobes import save_figure, stability_figure

        save_figure(
            stability_figure(found, conditions.max_depth, limits.band, best, tested=tested, surface=surface, chart=chart), str(plot)
        )
    if json_:
        summary = lobes_summary(found, best) | (
            {} if tested is None else {"tested": asdict(tested.tally) | {"share_right": tested.tally.share_right}}
        )
        if chart is not None:
            summary |= {"map": {"multipliers": chart.evaluations, "error": chart.error, "out": str(map_)}}
        emit(summary | {"warnings": doubts, "seconds": stages.seconds, "out": str(out)} | ({} if plot is None else {"plot": str(plot)}))
        return
    from rcsa_ident.cli.tables import show_lobes, show_tally

    show_lobes(found, best, conditions.max_depth)
    if tested is not None:
        show_tally(tested.tally)
    for doubt in doubts:
        warn(doubt)
    if plot is not None:
        say(f"drawn: {plot}")
    if chart is not None:
        points = f"{chart.growth.size} cuts, {chart.evaluations} multipliers, {stages.seconds['map']:.2f} s"
        say(f"written: {map_} ({points})")
    say(f"written: {out} ({found.spindle_speed.size} speeds, {stages.seconds['lobes']:.2f} s)")


def check_plot(path: Path | None) -> None:
    """Refuse a figure that can not be written before the work, not after it."""
    if path is None:
        return
    if path.suffix.lower() not in (".png", ".svg"):
        raise InputError("--plot", f"suffix '{path.suffix}'", "a file that ends in .png or .svg", str(path))
    writable(path, "--plot")


def tested_cuts(path: Path, subject: Subject, conditions: LobeConditions) -> Judged:
    """Return the tested cuts of a file with what the lobes say of them."""
    from rcsa_ident.io.tested_cuts import read_tested_cuts

    return judged(read_tested_cuts(path), subject, conditions)


def judged(cuts: TestedCuts, subject: Subject, conditions: LobeConditions) -> Judged:
    """Return tested cuts with what the lobes say of them, each at its own speed."""
    from rcsa_ident.report.lobes import Judged
    from rcsa_ident.workflows.limits import classify_tested_cuts

    return Judged(cuts, classify_tested_cuts(cuts, conditions, lambda own: subject.limits(own, False)))


def _share(percent: float) -> float:
    if not 0.0 <= percent <= 50.0:
        raise InputError("--stiffness-spread", percent, "a number from 0 to 50 [%]")
    return percent / 100.0


def tip_response(
    machine: Mapping[Dof, MachineAxis],
    assembly: Any,
    frequency: FloatArray,
    bands: bool,
    speed: float | None = None,
    stiffness_spread: float | None = None,
) -> TooltipResponse:
    """Return the tip's response at frequencies in Hz and a spindle speed in rad/s."""
    import numpy as np

    from rcsa_ident.workflows.tip import STIFFNESS_SPREAD
    from rcsa_ident.workflows.tip import tooltip as run

    return run(machine, assembly, 2.0 * np.pi * frequency, bands, speed, STIFFNESS_SPREAD if stiffness_spread is None else stiffness_spread)


def write_response(path: Path, frequency: FloatArray, response: TooltipResponse) -> None:
    """Write FRF.csv with standard deviations in further columns."""
    from rcsa_ident.io.curves import write_frf_csv

    columns: dict[str, FloatArray] = {}
    for axis, (real, imaginary) in response.deviation.items():
        columns |= {f"{axis.upper()}_re_std": real, f"{axis.upper()}_im_std": imaginary}
    write_frf_csv(path, frequency, {axis.upper(): response.tip(axis) for axis in response.coupled}, columns)


def peaks_of(frequency: FloatArray, response: TooltipResponse) -> dict[Dof, Any]:
    """Return, per axis, the peak and two standard deviations of the magnitude there (NaN without bands)."""
    import numpy as np

    from rcsa_ident.report.summaries import peak_row

    peaks = {}
    for axis in response.coupled:
        values = response.tip(axis)
        k = int(np.argmax(np.abs(values)))
        band = math.nan
        if axis in response.deviation:
            real, imaginary = (part[k] for part in response.deviation[axis])
            unit = values[k] / abs(values[k])
            band = 2.0 * math.hypot(real * unit.real, imaginary * unit.imag)
        peaks[axis] = (peak_row(frequency, values), band)
    return peaks


def write_map(path: Path, chart: StabilityMap) -> None:
    """Write MAP.csv."""
    import numpy as np

    from rcsa_ident.io.curves import write_map_csv

    write_map_csv(path, np.round(chart.spindle_speed * (30.0 / np.pi), 9), np.round(chart.depth * 1e3, 9), chart.growth)


def write_lobes(
    path: Path, found: StabilityLobes, spread: tuple[FloatArray, FloatArray] | None, surface: SurfaceError | None = None
) -> None:
    """Write LOBES.csv; the band's columns are empty where even its edge is beyond the largest depth."""
    import numpy as np

    from rcsa_ident.io.curves import write_lobes_csv

    extra = {} if spread is None else {"limit_depth_low_mm": spread[0] * 1e3, "limit_depth_high_mm": spread[1] * 1e3}
    assert found.flip is not None
    extra["flip"] = np.where(found.stable, np.nan, found.flip.astype(float))
    if surface is not None:
        extra |= {"surface_error_um": surface.largest * 1e6, "surface_error_mean_um": surface.mean * 1e6}
    lobe = np.where(found.lobe < 0, np.nan, found.lobe.astype(float))
    chatter = found.chatter_frequency / (2.0 * np.pi)
    # rad/s and back leaves a last digit that nobody asked for
    speed = np.round(found.spindle_speed * (30.0 / np.pi), 9)
    write_lobes_csv(path, speed, found.limit_depth * 1e3, chatter, lobe, extra, whole=("flip",))


def lobes_summary(found: StabilityLobes, best: Sequence[tuple[float, float]]) -> dict[str, Any]:
    """Return what a machine wants to know of lobes without reading the curve."""
    rpm = 30.0 / math.pi
    return {
        "method": found.method,
        "absolute_limit_mm": found.absolute_limit * 1e3,
        "absolute_frequency_hz": found.absolute_frequency / (2.0 * math.pi),
        "best_speeds": [{"spindle_speed_rpm": s * rpm, "limit_depth_mm": d * 1e3} for s, d in best],
        "flip_speeds": 0 if found.flip is None else int(found.flip.sum()),
    }
