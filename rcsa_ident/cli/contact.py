"""contact: the tool-holder contact from tap tests."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from rcsa_ident.base.errors import InputError
from rcsa_ident.base.units import from_hz, to_hz
from rcsa_ident.cli.common import NOT_CONVERGED, Json, Stages, answers, emit, say, warn, writable

if TYPE_CHECKING:
    from rcsa_ident.dynamics.coordinates import Dof
    from rcsa_ident.workflows.contact import ContactCalibration, Support, TapTest

_UNITS = ("N/m per m", "N m/rad per m", "N s/m per m", "N m s/rad per m")


@answers
def contact(
    tooling: Annotated[Path, typer.Argument(help="TOOLING.toml of the assembly that was tapped.", show_default=False)],
    tap: Annotated[
        list[str],
        typer.Option(
            help="FRF file of a tap test at the tip (CSV, UFF 58, text columns), or OTHER.toml=FILE for another stickout of the same "
            "holder. May be repeated: several stickouts determine the contact better.",
            show_default=False,
        ),
    ],
    out: Annotated[Path, typer.Option(help="Tooling file to write, with the calibrated [contact].", show_default=False)],
    on: Annotated[
        Path | None,
        typer.Option(help="RESULT.json or FLANGE.csv of the machine that it was clamped in; default: free in space.", show_default=False),
    ] = None,
    from_: Annotated[float, typer.Option("--from", help="Lowest frequency that is used, Hz.")] = 200.0,
    to: Annotated[
        float | None,
        typer.Option("--to", help="Highest frequency that is used, Hz; default: all, or the identified band.", show_default=False),
    ] = None,
    modulus_spread: Annotated[
        float, typer.Option(help="Standard deviation of the moduli of tool and holder, %; one factor for all.")
    ] = 1.0,
    gain_spread: Annotated[float, typer.Option(help="Standard deviation of the calibration of hammer and sensor, %.")] = 2.0,
    plot: Annotated[Path | None, typer.Option(help="Figure of taps and model (png, svg, pdf).", show_default=False)] = None,
    json_: Json = False,
) -> None:
    """Calibrate the distributed contact between tool and holder from tap tests of the assembly."""
    from rcsa_ident.base.errors import positive
    from rcsa_ident.io.curves.hammer import write_calibrated_tooling
    from rcsa_ident.io.settings.setups import read_tooling
    from rcsa_ident.workflows.contact import calibrate_contact

    writable(out)
    if plot is not None:
        writable(plot, "--plot")
    for name, value in (("--modulus-spread", modulus_spread), ("--gain-spread", gain_spread)):
        if not 0.0 <= value <= 50.0:
            raise InputError(name, value, "a number from 0 to 50 [%]")
    taps = _taps(tooling, tap, on, positive("--from", from_, "Hz"), to)
    prior = read_tooling(tooling).assembly.contact
    stages = Stages(quiet=json_)
    with stages.stage("contact") as line:
        found = calibrate_contact(
            taps, prior, modulus_spread=modulus_spread / 100.0, gain_spread=max(gain_spread / 100.0, 1e-6), progress=line
        )
    write_calibrated_tooling(tooling, out, found.contact, found.log_std.tolist(), _remarks(found, taps))
    if plot is not None:
        _draw(found, taps, plot)
    if json_:
        emit(_summary(found) | {"seconds": stages.seconds, "out": str(out)})
    else:
        _show(found)
        for note in found.notes:
            warn(note)
        say(f"written: {out}" + (f", {plot}" if plot is not None else ""))
    if not all(found.told):
        raise typer.Exit(NOT_CONVERGED)


def _taps(tooling: Path, texts: list[str], on: Path | None, low: float, high: float | None) -> list[TapTest]:
    import numpy as np

    from rcsa_ident.dynamics.coordinates import Dof
    from rcsa_ident.io.curves.hammer import labelled, read_hammer
    from rcsa_ident.io.settings.setups import read_tooling
    from rcsa_ident.workflows.contact import TapTest

    last = np.inf if high is None else high
    supports: dict[Dof, Support] = {}
    if on is not None:
        supports, band = _supports(on)
        low, last = max(low, band[0]), min(last, band[1])
    taps = []
    for text in texts:
        label, path = labelled(text, str(tooling))
        assembly = read_tooling(label).assembly
        values = read_hammer(path).values
        for axis, curve in values.items():
            frequency, receptance = curve
            if on is not None and Dof(axis.lower()) not in supports:
                raise InputError("--tap", f"axis {axis}", f"an axis of {on}", str(path))
            support = supports.get(Dof(axis.lower()))
            kept = np.asarray(frequency) > 0.0
            name = path.name if len(values) == 1 else f"{path.name} {axis}"
            band = (from_hz(low), from_hz(last))
            taps.append(TapTest(name, assembly, from_hz(frequency[kept]), receptance[kept], support, band=band, remarks=curve.remarks))
    return taps


def _supports(path: Path) -> tuple[dict[Dof, Support], tuple[float, float]]:
    """What an assembly was clamped in, per axis, and the band where it is known [Hz]."""
    from rcsa_ident.cli.results import read_identified, tell
    from rcsa_ident.coupling.joint import LumpedJoint
    from rcsa_ident.workflows.contact import Support

    if path.suffix.lower() == ".csv":
        from rcsa_ident.io.curves.flanges import read_flange_machine

        known = read_flange_machine(path)
        tell(known, path)
        # a flange without a joint of its own holds the joint's compliance already
        rigid = LumpedJoint(1e18, 1e18)
        sides = {c.dof: part.believed for part in known.parts for c in part.coordinates if not c.dof.is_slope}
        low, high = known.band
        return {axis: Support(side.flange, side.joint or rigid, axis) for axis, side in sides.items()}, (to_hz(low), to_hz(high))
    machine, data = read_identified(path)
    tell(machine, path)
    # planes that feel each other do so in a tap test, too, whose spindle does not turn
    both = machine.standing if machine.coupled_planes else None
    supports = {axis: Support(part.spindle if both is None else both, part.joint, axis) for axis, part in machine.identified.items()}
    return supports, (data["band_hz"][0], data["band_hz"][1])


def _remarks(found: ContactCalibration, taps: list[TapTest]) -> list[str]:
    stickouts = ", ".join(f"{1e3 * s:g}" for s in sorted({t.assembly.stickout for t in taps}))
    factors = ", ".join(f"{100.0 * s:.2g} %" if s < 0.5 else f"a factor of {math.exp(s):.2g}" for s in found.log_std)
    return [f"from {len(taps)} tap tests, stickouts {stickouts} mm; standard deviations {factors}", *found.notes]


def _summary(found: ContactCalibration) -> dict[str, Any]:
    from rcsa_ident.workflows.contact import NAMES

    rows = {
        name: {"value": getattr(found.contact, name), "log_std": float(std), "unit": unit, "told": told}
        for name, std, unit, told in zip(NAMES, found.log_std, _UNITS, found.told, strict=True)
    }
    return {
        "contact": rows,
        "correlation": found.correlation.tolist(),
        "modulus": {"factor": found.modulus, "std": found.modulus_std},
        "gain": found.gain,
        "misfit": found.misfit,
        "model_error": found.model_error,
        "notes": list(found.notes),
    }


def _show(found: ContactCalibration) -> None:
    from rich.table import Table

    from rcsa_ident.cli.tables import console, show
    from rcsa_ident.workflows.contact import NAMES

    table = Table("per metre of insertion", "value", "± 1 σ", "unit", title="tool-holder contact", title_justify="left")
    for column in table.columns[1:3]:
        column.justify = "right"
    for name, std, unit in zip(NAMES, found.log_std, _UNITS, strict=True):
        width = f"{100.0 * std:.2g} %" if std < 0.5 else f"factor {math.exp(std):.2g}"
        table.add_row(name.replace("_", " "), f"{getattr(found.contact, name):.4g}", width, unit)
    out = console()
    show(table)
    for name, value in found.misfit.items():
        out.print(f"{name}: rms difference {100.0 * value:.2g} %, scale {100.0 * (found.gain[name] - 1.0):+.1f} %", markup=False)
    if found.modulus_std > 0.0:
        out.print(f"moduli {100.0 * (found.modulus - 1.0):+.2f} ± {100.0 * found.modulus_std:.2g} %")


def _draw(found: ContactCalibration, taps: list[TapTest], path: Path) -> None:
    from rcsa_ident.report.comparison import FrfPair, frf_comparison, save
    from rcsa_ident.workflows.contact import tap_model

    pairs = []
    for tap in taps:
        hertz = to_hz(tap.omega)
        model = tap_model(tap, found.contact, found.modulus)
        pairs.append(FrfPair(f"{tap.name}, stickout {1e3 * tap.assembly.stickout:g} mm", "X", hertz, model, hertz, tap.values))
    save(frf_comparison(pairs, names=("tap test", "calibrated contact")), path)
