"""tooltip and lobes: what a result is for."""

from __future__ import annotations

import math
from dataclasses import asdict
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from rcsa_ident.cli.common import Json, Stages, answers, emit, inclusive, say, warn, writable
from rcsa_ident.cli.conditions import Strategy, coefficients, engagement, feed_angle, tip_of
from rcsa_ident.errors import InputError

if TYPE_CHECKING:
    from collections.abc import Mapping

    from rcsa_ident.arrays import FloatArray
    from rcsa_ident.dynamics.coordinates import Dof
    from rcsa_ident.identification.posterior import MachineAxis
    from rcsa_ident.stability.result import StabilityLobes
    from rcsa_ident.workflows.lobes import LobeConditions
    from rcsa_ident.workflows.speeds import MachineOverSpeed
    from rcsa_ident.workflows.tip import TooltipResponse

#: Lower end of the receptances that lobes are computed from, and their step [Hz].
LOWEST, STEP = 100.0, 1.0

ResultFile = Annotated[Path, typer.Argument(help="RESULT.json of an identification.", show_default=False)]
ToolingFile = Annotated[Path, typer.Argument(help="TOOLING.toml; it need not have been cut with.", show_default=False)]
Bands = Annotated[bool, typer.Option(help="Add columns with what the records leave open.")]


StiffnessSpread = Annotated[
    float, typer.Option(help="How well the tool-holder's stiffness is known, %: part of the bands. 1 for a modulus from a handbook.")
]


class LobeMethod(StrEnum):
    """Stability methods by name."""

    zero_order = "zero-order"


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
    import numpy as np

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
        _warn_outside(machine, np.array([omega]))
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
def lobes(
    files: Annotated[
        list[Path],
        typer.Argument(metavar="[RESULT.json] TOOLING.toml", help="With --modes or --frf the tooling alone.", show_default=False),
    ],
    out: Annotated[Path, typer.Option(help="LOBES.csv to write.", show_default=False)],
    modes: Annotated[
        Path | None, typer.Option(help="MODES.toml: a modal model of the tip instead of a result.", show_default=False)
    ] = None,
    frf: Annotated[
        list[str] | None, typer.Option(metavar="[X=]FRF.csv", help="Tap-test FRF instead of a result; once an axis.", show_default=False)
    ] = None,
    immersion: Annotated[float, typer.Option(help="Radial depth over diameter, up to 1 (a slot).")] = 0.5,
    strategy: Annotated[Strategy, typer.Option(help="Up or down milling.")] = Strategy.down,
    entry_deg: Annotated[
        float | None, typer.Option(help="Entry angle from the normal direction, instead of --immersion.", show_default=False)
    ] = None,
    exit_deg: Annotated[float | None, typer.Option(help="Exit angle.", show_default=False)] = None,
    feed_direction: Annotated[str, typer.Option(help="+X -X +Y -Y, or degrees from +X.")] = "+X",
    speed_from: Annotated[float, typer.Option(help="Lowest spindle speed, rev/min.")] = 4000.0,
    speed_to: Annotated[float, typer.Option(help="Highest spindle speed, rev/min.")] = 20000.0,
    speed_step: Annotated[float, typer.Option(help="Speed step, rev/min.")] = 50.0,
    max_depth_mm: Annotated[float, typer.Option(help="Depths beyond it are not of interest, mm.")] = 10.0,
    ktc_mpa: Annotated[
        float | None, typer.Option(help="Tangential coefficient, MPa; default: the result's workpiece.", show_default=False)
    ] = None,
    krc: Annotated[float | None, typer.Option(help="Radial ratio; default: the result's workpiece.", show_default=False)] = None,
    method: Annotated[LobeMethod, typer.Option(help="How the limit is found.")] = LobeMethod.zero_order,
    bands: Bands = True,
    stiffness_spread: StiffnessSpread = 0.05,
    json_: Json = False,
) -> None:
    """Compute stability lobes of a tooling: on an identified machine, from a modal model or from tap tests."""
    import numpy as np

    from rcsa_ident.cutting.process import MillingProcess
    from rcsa_ident.io.setups import read_tooling
    from rcsa_ident.workflows.lobes import LobeConditions, best_speeds

    writable(out)
    own_tip = modes is not None or bool(frf)
    if modes is not None and frf:
        raise InputError("--modes and --frf", "both", "one of them")
    if len(files) != (1 if own_tip else 2):
        wanted = (
            "TOOLING.toml alone with --modes or --frf" if own_tip else "RESULT.json TOOLING.toml (or --modes or --frf and TOOLING.toml)"
        )
        raise InputError("files", f"{len(files)} files", wanted)
    tooling = read_tooling(files[-1])
    result = None if own_tip else read_machine_over_speed(files[0])
    conditions = LobeConditions(
        MillingProcess(
            tooling.cutter,
            coefficients(ktc_mpa, krc, None if result is None else (result[1], str(files[0]))),
            engagement(immersion, strategy, entry_deg, exit_deg),
            feed_angle(feed_direction),
        ),
        inclusive(speed_from, speed_to, speed_step, ("--speed-from", "--speed-to", "--speed-step"), "rev/min") * (np.pi / 30.0),
        max_depth_mm * 1e-3,
    )
    stages = Stages(quiet=json_)
    with stages.stage("lobes"):
        if result is None:
            found, spread, doubts = conditions.lobes(tip_of(modes, frf or [])), None, list[str]()
        else:
            found, spread, doubts = machine_lobes(*result, tooling.assembly, conditions, bands, _share(stiffness_spread))
    write_lobes(out, found, spread)
    best = best_speeds(found)
    if json_:
        emit(lobes_summary(found, best) | {"warnings": [*found.warnings, *doubts], "seconds": stages.seconds, "out": str(out)})
        return
    from rcsa_ident.cli.tables import show_lobes

    show_lobes(found, best, conditions.max_depth)
    for doubt in (*found.warnings, *doubts):
        warn(doubt)
    say(f"written: {out} ({found.spindle_speed.size} speeds, {stages.seconds['lobes']:.2f} s)")


def _share(percent: float) -> float:
    if not 0.0 <= percent <= 50.0:
        raise InputError("--stiffness-spread", percent, "a number from 0 to 50 [%]")
    return percent / 100.0


def _warn_outside(machine: MachineOverSpeed, speeds: FloatArray) -> None:
    """Say where a machine that changes with speed is asked for speeds that it was not cut at."""
    known = machine.speed_range
    # the last digit of a speed that was written in rev/min is nobody's wish
    if known is not None and (speeds.min() < known[0] * (1.0 - 1e-9) or speeds.max() > known[1] * (1.0 + 1e-9)):
        low, high = (speed * 30.0 / math.pi for speed in known)
        warn(f"the machine was identified from {low:.0f} to {high:.0f} rev/min; outside it stays what it is at the nearest of them")


def read_machine(path: Path) -> tuple[dict[Dof, MachineAxis], dict[str, Any]]:
    """Return the machine of a result file beside the file's content."""
    from rcsa_ident.io.identifications import machine_from_json
    from rcsa_ident.io.results import read_result

    data = read_result(path)
    machine = machine_from_json(data, str(path))
    if data["status"] != "converged":
        warn(f"{path} is {data['status']}: {'; '.join(data['reasons'])}")
    return machine, data


def read_machine_over_speed(path: Path) -> tuple[MachineOverSpeed, dict[str, Any]]:
    """Return the machine of a result file, with the models of single speed bands, beside the file's content."""
    from rcsa_ident.io.identifications import speed_bands_from_json
    from rcsa_ident.workflows.speeds import MachineOverSpeed

    machine, data = read_machine(path)
    return MachineOverSpeed(machine, speed_bands_from_json(data, str(path))), data


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

    from rcsa_ident.report.rows import peak_row

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


def machine_lobes(
    machine: MachineOverSpeed, data: dict[str, Any], assembly: Any, conditions: LobeConditions, bands: bool, stiffness_spread: float
) -> tuple[StabilityLobes, tuple[FloatArray, FloatArray] | None, list[str]]:
    """Return the lobes on an identified machine, their band and what speaks against them."""
    import numpy as np

    from rcsa_ident.workflows.lobes import band_warning
    from rcsa_ident.workflows.speeds import lobes_over_speed

    low, high = data["band_hz"]
    _warn_outside(machine, conditions.speeds)
    omega = 2.0 * np.pi * np.arange(min(LOWEST, low), high + 0.5 * STEP, STEP)
    found, spread = lobes_over_speed(machine, assembly, omega, conditions, bands, stiffness_spread)
    doubt = band_warning(found, (low, high))
    return found, spread, [doubt] if doubt else []


def write_lobes(path: Path, found: StabilityLobes, spread: tuple[FloatArray, FloatArray] | None) -> None:
    """Write LOBES.csv; the band's columns are empty where even its edge is beyond the largest depth."""
    import numpy as np

    from rcsa_ident.io.curves import write_lobes_csv

    extra = {} if spread is None else {"limit_depth_low_mm": spread[0] * 1e3, "limit_depth_high_mm": spread[1] * 1e3}
    lobe = np.where(found.lobe < 0, np.nan, found.lobe.astype(float))
    chatter = found.chatter_frequency / (2.0 * np.pi)
    # rad/s and back leaves a last digit that nobody asked for
    speed = np.round(found.spindle_speed * (30.0 / np.pi), 9)
    write_lobes_csv(path, speed, found.limit_depth * 1e3, chatter, lobe, extra)


def lobes_summary(found: StabilityLobes, best: list[tuple[float, float]]) -> dict[str, Any]:
    """Return what a machine wants to know of lobes without reading the curve."""
    rpm = 30.0 / math.pi
    return {
        "method": found.method,
        "absolute_limit_mm": found.absolute_limit * 1e3,
        "absolute_frequency_hz": found.absolute_frequency / (2.0 * math.pi),
        "best_speeds": [{"spindle_speed_rpm": s * rpm, "limit_depth_mm": d * 1e3} for s, d in best],
    }
