"""export: FRFs and modes of a result in the formats of other programs."""

from __future__ import annotations

import math
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from rcsa_ident.base import units
from rcsa_ident.base.errors import InputError
from rcsa_ident.cli.common import Json, answers, emit, say, warn, writable
from rcsa_ident.cli.lobes import ResultFile
from rcsa_ident.cli.results import read_identified, tell

if TYPE_CHECKING:
    from rcsa_ident.dynamics.modal import ModalModel
    from rcsa_ident.identification.machine import IdentifiedMachine


class Format(StrEnum):
    """What is written."""

    uff = "uff"
    uff_binary = "uff-binary"
    csv = "csv"
    json = "json"
    hdf5 = "hdf5"


class Part(StrEnum):
    """What it is about."""

    tip = "tip"
    flange = "flange"
    modes = "modes"


@answers
def export(
    result: ResultFile,
    out: Annotated[Path, typer.Option(help="File to write.", show_default=False)],
    to: Annotated[Format, typer.Option(help="Format: UFF 58 or 58b, FRF.csv, JSON, HDF5.")] = Format.uff,
    what: Annotated[
        Part | None,
        typer.Option(
            help="Tip FRFs of a tooling, FRFs of the machine's flange, or its modes; default: tip with --tooling, else flange.",
            show_default=False,
        ),
    ] = None,
    tooling: Annotated[Path | None, typer.Option(help="TOOLING.toml, for the tip.", show_default=False)] = None,
    from_hz: Annotated[
        float | None, typer.Option(help="Lowest frequency, Hz; default: beginning of the identified band.", show_default=False)
    ] = None,
    to_hz: Annotated[
        float | None, typer.Option(help="Highest frequency, Hz; default: end of the identified band.", show_default=False)
    ] = None,
    step_hz: Annotated[float, typer.Option(help="Frequency step, Hz.")] = 1.0,
    speed: Annotated[
        float | None, typer.Option(help="Spindle speed, rev/min, for a machine that changes with it.", show_default=False)
    ] = None,
    json_: Json = False,
) -> None:
    """Write tip FRFs, flange FRFs or modes for other programs."""
    from rcsa_ident.base.errors import positive
    from rcsa_ident.io.curves import exports
    from rcsa_ident.io.settings.setups import read_tooling

    writable(out)
    what = (Part.flange if tooling is None else Part.tip) if what is None else what
    if (what is Part.tip) != (tooling is not None):
        raise InputError("--tooling", "nothing" if tooling is None else str(tooling), "a TOOLING.toml with --what tip, and only then")
    if what is Part.modes and to not in (Format.csv, Format.json):
        raise InputError("--to", str(to), "csv or json for modes")
    omega = None if speed is None else units.from_rpm(positive("--speed", speed, "rev/min"))
    machine, data = read_identified(result)
    tell(machine, result)
    here, speed_there = machine.at(omega), machine.speed_answered(omega)
    at_speed = "" if speed_there is None else f" at {units.to_rpm(speed_there):.0f} rev/min"
    if what is Part.modes:
        modes, written = _modes(here)
        exports.write_modes(out, modes, to is Format.json)
    else:
        band = data["band_hz"]
        low, high = math.ceil(band[0]) if from_hz is None else from_hz, band[1] if to_hz is None else to_hz
        frequency = units.inclusive(low, high, step_hz, ("--from-hz", "--to-hz", "--step-hz"), "Hz")
        if frequency[-1] > 1.001 * band[1] or frequency[0] < 0.999 * band[0]:
            warn(f"the machine was identified from {band[0]:.0f} to {band[1]:.0f} Hz; outside the FRF is extrapolated")
        grid = units.from_hz(frequency)
        if tooling is not None:
            setup = read_tooling(tooling)
            title = f"{data['campaign']['name']}, {setup.name}{at_speed}"
            tip = here.tip(setup, grid, spread=False)
            found = {"XY": tip} if here.coupled_planes else {c.dof.upper(): tip.block((c,)) for c in tip.rows}
        else:
            title = f"{data['campaign']['name']}, flange{at_speed}"
            each = {axis.upper(): (axis,) for axis in here.axes}
            found = {name: here.receptance(grid, own) for name, own in ({"XY": None} if here.coupled_planes else each).items()}
        if to is Format.csv:
            exports.write_receptances_csv(out, found)
        elif to is Format.json:
            exports.write_receptances_json(out, found, title)
        elif to is Format.hdf5:
            exports.write_receptances_hdf5(out, found, title)
        else:
            exports.write_receptances_uff(out, found, title, to is Format.uff_binary)
        written = f"{what} FRFs{at_speed} at {frequency.size} frequencies"
    if json_:
        rpm = None if speed_there is None else units.to_rpm(speed_there)
        emit({"what": str(what), "format": str(to), "spindle_speed_rpm": rpm, "out": str(out)})
        return
    say(f"written: {out} ({written})")


def _modes(machine: IdentifiedMachine) -> tuple[dict[str, ModalModel], str]:
    """The modes of each axis, or of both planes where they feel each other, and which ones they are."""
    if not machine.coupled_planes:
        axes = machine.identified
        return {axis.upper(): part.at(axis, machine.speed)[0] for axis, part in axes.items()}, f"modes of {len(axes)} axes"
    if machine.turning is not None:
        warn("modes of the spindle at standstill: the gyroscopic moments of one that turns have no place in a list of modes")
    return {"XY": machine.standing}, "modes of both planes together"
