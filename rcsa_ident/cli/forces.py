"""forces: cutting forces of a recording, and what they say of the tool's wear."""

from __future__ import annotations

from dataclasses import replace
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from rcsa_ident.base.errors import InputError, positive
from rcsa_ident.base.units import from_hz, from_rpm, to_hz, to_rpm
from rcsa_ident.cli.common import Json, Stages, answers, emit, say, warn, writable
from rcsa_ident.cli.options import Strategy

if TYPE_CHECKING:
    from rcsa_ident.machine.machine import Machine
    from rcsa_ident.observer.wear import WearIndicators
    from rcsa_ident.setup.tooling import Tooling
    from rcsa_ident.signals.recording import Sensor
    from rcsa_ident.workflows.estimate_forces import MonitoredCut


class ObserverName(StrEnum):
    """Observers by name."""

    resonators = "resonators"
    random_walk = "random-walk"


@answers
def forces(
    result: Annotated[
        Path, typer.Argument(help="RESULT.json of an identification, or FLANGE.csv of a bare flange with its joint.", show_default=False)
    ],
    tooling: Annotated[Path, typer.Argument(help="TOOLING.toml of the tool that was cutting.", show_default=False)],
    recording: Annotated[Path, typer.Argument(help="Recording of the cut; channels as in the campaign.", show_default=False)],
    out: Annotated[Path, typer.Option(help="FORCES.csv to write, N.", show_default=False)],
    air: Annotated[
        Path | None, typer.Option(help="Recording of an air cut at the same speed: its run-out is subtracted.", show_default=False)
    ] = None,
    speed_rpm: Annotated[
        float | None, typer.Option(help="Programmed spindle speed, rev/min; default: from the trigger.", show_default=False)
    ] = None,
    observer: Annotated[
        ObserverName, typer.Option(help="Force model: oscillators at the spindle's orders, or the published random walk.")
    ] = ObserverName.resonators,
    bandwidth_hz: Annotated[
        float | None,
        typer.Option(help="Bandwidth of the observer, Hz; default: upper end of the identified band.", show_default=False),
    ] = None,
    smooth: Annotated[
        bool, typer.Option(help="Estimate each sample from the whole recording, not only from the samples before it.")
    ] = False,
    plot: Annotated[
        Path | None, typer.Option(help="Figure of the forces and of the observer's frequency response.", show_default=False)
    ] = None,
    idle_percent: Annotated[
        float | None,
        typer.Option(
            help="Least share of the time in which no tooth cuts, %: the force is zero then, which gives its mean. "
            "Default: forces without their mean.",
            show_default=False,
        ),
    ] = None,
    sensors: Annotated[
        Path | None,
        typer.Option(metavar="CAMPAIGN", help="Folder of a campaign whose sensors recorded it; default: the result's.", show_default=False),
    ] = None,
    sampling_rate_hz: Annotated[
        float | None, typer.Option(help="Sampling rate of a recording that does not state it, Hz.", show_default=False)
    ] = None,
    wear: Annotated[
        Path | None,
        typer.Option(help="Cutting coefficients of each revolution; needs --axial-depth-mm and --feed-mm.", show_default=False),
    ] = None,
    axial_depth_mm: Annotated[float | None, typer.Option(help="Axial depth, mm, for --wear.", show_default=False)] = None,
    feed_mm: Annotated[float | None, typer.Option(help="Feed per tooth, mm, for --wear.", show_default=False)] = None,
    immersion: Annotated[str, typer.Option(help="Radial depth over diameter, as 0.5 or 50%, for --wear.")] = "0.5",
    strategy: Annotated[Strategy, typer.Option(help="Up or down milling, for --wear.")] = Strategy.down,
    feed_direction: Annotated[str, typer.Option(help="+X -X +Y -Y, or degrees from +X, for --wear.")] = "+X",
    json_: Json = False,
) -> None:
    """Estimate the cutting forces of a recording from the flange's vibration."""
    from rcsa_ident.cli.results import read_machine, tell
    from rcsa_ident.io.curves.forces import write_forces
    from rcsa_ident.io.recordings.readers import read_recording
    from rcsa_ident.io.settings.setups import read_tooling
    from rcsa_ident.observer.force import restore_mean_force
    from rcsa_ident.observer.tuning import PaperWalk, Resonators
    from rcsa_ident.workflows.estimate_forces import observe

    for path, option in ((out, "--out"), (plot, "--plot"), (wear, "--wear")):
        if path is not None:
            writable(path, option)
    if plot is not None and plot.suffix.lower() not in (".png", ".svg", ".pdf"):
        raise InputError("--plot", f"suffix '{plot.suffix}'", "one of .png, .svg, .pdf", str(plot))
    if wear is not None and (axial_depth_mm is None or feed_mm is None):
        raise InputError("--wear", "no depth or no feed", "--axial-depth-mm and --feed-mm beside it")
    programmed = None if speed_rpm is None else from_rpm(positive("--speed-rpm", speed_rpm, "rev/min"))
    bandwidth = None if bandwidth_hz is None else from_hz(positive("--bandwidth-hz", bandwidth_hz, "Hz"))
    rate = None if sampling_rate_hz is None else positive("--sampling-rate-hz", sampling_rate_hz, "Hz")
    machine = read_machine(result)
    tell(machine, result)
    setup, known = read_tooling(tooling), _sensors(machine, sensors, result)
    for remark in setup.remarks:
        warn(f"{tooling}: {remark}")
    stages = Stages(quiet=json_)
    with stages.stage("recordings"):
        cut = read_recording(recording, known, rate)
        still = None if air is None else read_recording(air, known, rate)
    method = Resonators() if observer is ObserverName.resonators else PaperWalk()
    with stages.stage("forces"):
        try:
            found = observe(machine, setup.assembly, setup.cutter.teeth, cut, still, programmed, method, bandwidth, smooth)
        except InputError as error:
            raise error if error.where else error.at(str(result if error.field == "machine" else recording)) from None
    level = None
    if idle_percent is not None:
        raised, level = restore_mean_force(found.estimate, idle_percent / 100.0)
        found = replace(found, estimate=raised)
    estimate = found.estimate
    write_forces(out, estimate)
    if plot is not None:
        _draw(plot, found)
    worn = None
    if wear is not None:
        worn = _wear(wear, found, setup, (axial_depth_mm or 0.0, feed_mm or 0.0), immersion, strategy, feed_direction)
    summary = _summary(found, str(observer), smooth)
    if level is not None:
        summary["mean_force"] = "from the time in which no tooth cuts"
        for axis, value in zip(estimate.axes, level.tolist(), strict=True):
            summary["axes"][axis.upper()]["mean_n"] = value
    if json_:
        emit(summary | {"wear": worn, "seconds": stages.seconds, "out": str(out)})
        return
    for axis, row in summary["axes"].items():
        lines = row["usable_at_lines_hz"]
        flat = "none" if lines[0] is None else f"{lines[0]:.0f} to {lines[1]:.0f} Hz"
        say(
            f"{axis}: rms {row['rms_n']:.1f} N, peaks {row['lowest_n']:.0f} to {row['highest_n']:.0f} N, ± {row['std_n']:.2g} N; "
            f"within 1 dB at the spindle's orders: {flat}; delay {round(1e6 * row['delay_s'])} µs"
        )
    for note in found.remarks:
        warn(note)
    low_hz, high_hz = summary["band_hz"]
    mean = "without their mean" if level is None else "with their mean"
    say(f"forces {mean}, {low_hz:.0f} to {high_hz:.0f} Hz, {summary['spindle_speed_rpm']:.2f} rev/min")
    for name, row in (worn or {}).get("coefficients", {}).items():
        trend = f"{row['trend_per_s']:+.2g} ± {row['trend_std_per_s']:.1g} a second"
        say(f"{name}: {row['mean']:.4g} ± {row['std']:.2g} {row['unit']}, {trend}")
    if worn and not worn["separable"]:
        warn("the harmonics in the band do not separate the coefficients: only their sum is meaningful")
    say(f"left out: the first {estimate.start:.3f} s, in which the observer settles")
    say(f"written: {out} ({estimate.force.shape[0]} samples, {stages.seconds['forces']:.2f} s)")


def _sensors(machine: Machine, campaign: Path | None, result: Path) -> tuple[Sensor, ...]:
    """The sensors of the recording: those of a campaign, else those that the machine was identified with."""
    from rcsa_ident.identification.machine import IdentifiedMachine
    from rcsa_ident.io.settings.setups import read_campaign

    if campaign is not None:
        return read_campaign(campaign).sensors
    if isinstance(machine, IdentifiedMachine) and machine.sensors:
        return machine.sensors
    raise InputError("sensors", "none", "--sensors CAMPAIGN, or a result that says which sensors it was identified with", str(result))


def _summary(found: MonitoredCut, observer: str, smooth: bool) -> dict[str, Any]:
    """What a machine wants to know of the forces without reading the curve."""
    import numpy as np

    estimate, axes = found.estimate, {}
    for i, axis in enumerate(estimate.axes):
        force, response = estimate.force[:, i], found.response[axis]
        hz = [to_hz(float(w)) if w == w else None for w in response.usable(float(response.line[0]), at_lines=True)]
        anywhere = [to_hz(float(w)) if w == w else None for w in response.usable(1.3 * found.band[0])]
        axes[axis.upper()] = {
            "rms_n": float(np.std(force)),
            "lowest_n": float(force.min()),
            "highest_n": float(force.max()),
            "std_n": float(np.median(estimate.standard_deviation[:, i])),
            "model_std_n": found.model_error[axis],
            "innovation_over_expected": None if estimate.consistency is None else float(estimate.consistency[i]),
            "usable_at_lines_hz": hz,
            "usable_hz": anywhere,
            "delay_s": response.delay_at_lines,
            "order": found.observer.axes[i].transfer.order,
            "sensor_noise_m": found.noise[axis],
        }
    return {
        "observer": observer,
        "smoothed": smooth,
        "mean_force": "removed: the sensors do not show it",
        "spindle_speed_rpm": to_rpm(found.spindle_speed),
        "band_hz": [to_hz(w) for w in found.band],
        "samples": int(estimate.force.shape[0]),
        "left_out_s": estimate.start,
        "axes": axes,
        "warnings": list(found.remarks),
    }


def _draw(path: Path, found: MonitoredCut) -> None:
    """Both figures, one file: forces, and beside it (its name with -observer) the responses."""
    from rcsa_ident.report.forces import force_history, observer_frf

    force_history(found.estimate, found.spindle_speed).savefig(path, dpi=150)
    observer_frf(found.response, found.band).savefig(path.with_stem(path.stem + "-observer"), dpi=150)


def _wear(
    path: Path, found: MonitoredCut, setup: Tooling, cut_mm: tuple[float, float], immersion: str, strategy: Strategy, feed_direction: str
) -> dict[str, Any]:
    """Write the coefficients of each revolution and return their summary."""
    import numpy as np

    from rcsa_ident.cli.conditions import engagement, feed_angle
    from rcsa_ident.cutting.conditions import CuttingConditions
    from rcsa_ident.dynamics.coordinates import Dof
    from rcsa_ident.io.files import write_text
    from rcsa_ident.workflows.estimate_forces import wear_of

    if set(found.estimate.axes) != {Dof.X, Dof.Y}:
        raise InputError("--wear", f"axis {', '.join(found.estimate.axes)}", "forces of both axes, X and Y")
    depth, feed = (positive(name, value, "mm") for name, value in zip(("--axial-depth-mm", "--feed-mm"), cut_mm, strict=True))
    angles = engagement(immersion, strategy, None, None)
    conditions = CuttingConditions(found.spindle_speed, depth * 1e-3, feed * 1e-3, angles, feed_angle(feed_direction))
    worn = wear_of(found, setup.cutter, conditions)
    write_text(path, _wear_table(worn))
    slope, slope_std = worn.trend()
    units = [("MPa", 1e-6) if name.endswith("c") else ("N/mm", 1e-3) for name in worn.names]
    rows = {}
    for c, (name, (unit, factor)) in enumerate(zip(worn.names, units, strict=True)):
        rows[name] = {
            "mean": float(np.mean(worn.coefficient[:, c])) * factor,
            "std": float(np.median(worn.standard_deviation[:, c])) * factor,
            "trend_per_s": float(slope[c]) * factor,
            "trend_std_per_s": float(slope_std[c]) * factor,
            "unit": unit,
        }
    return {"coefficients": rows, "separable": worn.separable, "misfit": worn.misfit, "out": str(path)}


def _wear_table(worn: WearIndicators) -> str:
    """Columns: time, then of each coefficient its value, standard deviation, and both as a slow walk."""
    header, columns = ["time_s"], [worn.time]
    for c, name in enumerate(worn.names):
        unit, factor = ("mpa", 1e-6) if name.endswith("c") else ("n_per_mm", 1e-3)
        parts = (worn.coefficient, worn.standard_deviation, worn.tracked, worn.tracked_deviation)
        header += [f"{name}{kind}_{unit}" for kind in ("", "_std", "_tracked", "_tracked_std")]
        columns += [part[:, c] * factor for part in parts]
    rows = [",".join(map(str, row)) for row in zip(*(column.tolist() for column in columns), strict=True)]
    return "\n".join([",".join(header), *rows]) + "\n"
