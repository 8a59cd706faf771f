"""decouple and axial: the spindle's flange from hammer tests, across its axis with several known toolings, along it with one."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from rcsa_ident.base.errors import InputError
from rcsa_ident.base.units import from_hz, to_hz
from rcsa_ident.cli.common import NOT_CONVERGED, Json, Stages, answers, emit, say, warn, writable

if TYPE_CHECKING:
    from collections.abc import Mapping

    from rcsa_ident.coupling.flange_fit import DecoupledFlange
    from rcsa_ident.dynamics.coordinates import Dof
    from rcsa_ident.identification.posterior import MachineAxis
    from rcsa_ident.workflows.decouple import FlangeTap

#: Share of the frequencies at which a flange may be ambiguous or feed energy in without being called suspect.
_MOST_DOUBTFUL = 0.25
#: Response and force of a test along the axis.
_ALONG = ("Z", "Z")


@answers
def decouple(
    tap: Annotated[
        list[str],
        typer.Option(
            help="TOOLING.toml=FRF of a hammer test at the tip, or PLACE:TOOLING.toml=FRF with PLACE tip, cross (force at the tip, "
            "response at the spindle's flange) or spindle. At least three toolings; tests at the spindle contribute most.",
            show_default=False,
        ),
    ],
    out: Annotated[Path, typer.Option(help="FLANGE.csv to write.", show_default=False)],
    beside: Annotated[
        Path | None,
        typer.Option(
            help="RESULT.json whose joint is removed as well and written beside the flange, and whose flange is drawn for comparison.",
            show_default=False,
        ),
    ] = None,
    from_: Annotated[float, typer.Option("--from", help="Lowest frequency that is used, Hz.")] = 200.0,
    to: Annotated[float | None, typer.Option("--to", help="Highest frequency that is used, Hz; default: all.", show_default=False)] = None,
    least_damping: Annotated[float, typer.Option(help="Damping ratio below which the machine has no mode, %.")] = 2.0,
    plot: Annotated[Path | None, typer.Option(help="Figure of the first axis (png, svg, pdf).", show_default=False)] = None,
    json_: Json = False,
) -> None:
    """Take known tool-holders out of measured assemblies: what is left is the spindle's flange, rotations included."""
    import numpy as np

    from rcsa_ident.base.errors import positive
    from rcsa_ident.io.curves.flanges import write_flange_csv
    from rcsa_ident.workflows.decouple import flange_from_taps

    writable(out)
    if plot is not None:
        writable(plot, "--plot")
    share = positive("--least-damping", least_damping, "%") / 100.0
    machine: Mapping[Dof, MachineAxis] = {}
    if beside is not None:
        from rcsa_ident.cli.results import read_identified, tell

        identified = read_identified(beside)[0]
        tell(identified, beside)
        machine = identified.identified
        if identified.coupled_planes:
            warn(
                f"{beside}: X and Y feel each other, and each is decoupled by itself: the flange that is found holds what came back "
                "through the other plane with these tool-holders, to second order in the coupling; with others it is off by about as much"
            )
    taps = _taps(tap, positive("--from", from_, "Hz"), math.inf if to is None else positive("--to", to, "Hz"))
    stages = Stages(quiet=json_)
    with stages.stage("decoupling"):
        joints = {axis: machine[axis].joint for axis in taps if axis in machine}
        found = {axis: flange_from_taps(own, axis, joints.get(axis), share) for axis, own in taps.items()}
    omega = next(iter(found.values())).receptance.omega
    if any(not np.array_equal(f.receptance.omega, omega) for f in found.values()):
        raise InputError("frequencies", "different ones for X and Y", "the same for both axes")
    write_flange_csv(out, to_hz(omega), {a: f.receptance.values for a, f in found.items()}, {a: f.std for a, f in found.items()}, joints)
    if plot is not None:
        _draw(found, machine, plot)
    if json_:
        emit({"axes": {a.upper(): _summary(f) for a, f in found.items()}, "seconds": stages.seconds, "out": str(out)})
    else:
        for axis, each in found.items():
            row = _summary(each)
            known = ", ".join(f"{100 * share:.2g} %" for share in row["relative_std"])
            conditions = (
                f"median condition number {row['condition_median']:.3g}, {100 * row['regularised']:.0f} % regularised by neighbours"
            )
            say(f"{axis.upper()}: {row['frequencies']} frequencies, {conditions}; standard deviations of tF, tM, rM {known}")
            for note in each.notes:
                warn(f"{axis.upper()}: {note}")
        say(f"written: {out}" + (f", {plot}" if plot is not None else ""))
    if any(max(f.ambiguous.mean(), (f.dissipation < -1e-3).mean()) > _MOST_DOUBTFUL for f in found.values()):
        raise typer.Exit(NOT_CONVERGED)


@answers
def axial(
    result: Annotated[Path, typer.Argument(metavar="RESULT.json|FLANGE.csv", help="The machine, across its axis.", show_default=False)],
    tooling: Annotated[Path, typer.Argument(help="TOOLING.toml that was clamped, any one.", show_default=False)],
    frf: Annotated[
        str,
        typer.Argument(
            metavar="FILE[#RECORD]", help="Hammer test at its tip along the axis: FRF.csv, UFF 58, text columns.", show_default=False
        ),
    ],
    out: Annotated[
        Path, typer.Option(help="RESULT.json or FLANGE.csv to write: the machine with what the tap tells of Z.", show_default=False)
    ],
    frf_units: Annotated[
        str | None, typer.Option(help="Unit of the FRF, as um/N, g/N, (m/s^2)/N; default: as the file states.", show_default=False)
    ] = None,
    from_: Annotated[float, typer.Option("--from", help="Lowest frequency that is used, Hz.")] = 100.0,
    to: Annotated[float | None, typer.Option("--to", help="Highest frequency that is used, Hz; default: all.", show_default=False)] = None,
    json_: Json = False,
) -> None:
    """Learn how the spindle gives way along its axis, from one hammer test of any tooling: cutters whose edges are no wall ask for it."""
    from dataclasses import replace

    import numpy as np

    from rcsa_ident.base.errors import positive
    from rcsa_ident.cli.conditions import frf_source
    from rcsa_ident.cli.results import read_identified
    from rcsa_ident.io.curves.flanges import read_flange_machine, write_flange_machine
    from rcsa_ident.io.curves.frf_files import read_tap_tests
    from rcsa_ident.io.results.axial_flanges import axial_to_json
    from rcsa_ident.io.results.parts import write_result
    from rcsa_ident.io.settings.setups import read_tooling
    from rcsa_ident.workflows.decouple import axial_flange_from_tap

    measured = result.suffix.lower() == ".csv"
    if (writable(out).suffix.lower() == ".csv") != measured:
        raise InputError("--out", str(out), f"a {'FLANGE.csv' if measured else 'RESULT.json'}, as the machine is one")
    tapped = read_tooling(tooling)
    source = frf_source(frf)
    if source.pair not in (None, _ALONG):
        raise InputError("FRF", "".join(source.pair), "a test along Z, force and response", str(source.path))
    curve = read_tap_tests([source._replace(pair=_ALONG)], frf_units)[_ALONG]
    frequency, values = curve
    kept = (frequency >= positive("--from", from_, "Hz")) & (frequency <= (math.inf if to is None else positive("--to", to, "Hz")))
    learnt = axial_flange_from_tap(tapped, from_hz(frequency[kept]), values[kept])
    if measured:
        machine = read_flange_machine(result)
        band = machine.band
        write_flange_machine(out, replace(machine, axial=learnt))
    else:
        identified, told = read_identified(result)
        band = identified.band
        write_result(out, told | {"axial": axial_to_json(learnt)})
    remarks = (*curve.remarks, *learnt.remarks(band))
    tip = learnt.receptance(from_hz(frequency[kept])).values[:, 0, 0]
    stiffness = float(1.0 / np.abs(tip[0]))
    if json_:
        emit({"axial": axial_to_json(learnt), "stiffness_n_per_m": stiffness, "warnings": list(remarks), "out": str(out)})
        return
    say(f"{learnt}; {1e-6 * stiffness:.3g} N/µm at {frequency[kept][0]:.0f} Hz")
    for remark in remarks:
        warn(remark)
    say(f"written: {out}")


def _taps(texts: list[str], low: float, high: float) -> dict[Dof, list[FlangeTap]]:
    """The tests of each axis; an axis that a file lacks is left out."""
    import numpy as np

    from rcsa_ident.dynamics.coordinates import Dof
    from rcsa_ident.io.curves.hammer import read_hammer
    from rcsa_ident.io.settings.setups import read_tooling
    from rcsa_ident.workflows.compare import Place
    from rcsa_ident.workflows.decouple import FlangeTap

    assemblies: dict[str, Any] = {}
    found: dict[Dof, list[FlangeTap]] = {}
    for text in texts:
        left, sign, path = text.partition("=")
        place, colon, tooling = left.partition(":")
        if not colon or place not in list(Place):
            place, tooling = Place.TIP, left
        if not sign:
            raise InputError("--tap", text, "TOOLING.toml=FRF or PLACE:TOOLING.toml=FRF")
        if tooling not in assemblies:
            assemblies[tooling] = read_tooling(tooling).assembly
        for axis, curve in read_hammer(path).values.items():
            frequency, values = curve
            kept = (np.asarray(frequency) >= low) & (np.asarray(frequency) <= high)
            own = FlangeTap(Path(path).name, assemblies[tooling], Place(place), from_hz(frequency[kept]), values[kept], curve.remarks)
            found.setdefault(Dof(axis.lower()), []).append(own)
    complete = {axis: own for axis, own in found.items() if len(own) == len(texts)}
    if not complete:
        raise InputError("--tap", "no axis that all files hold", "the same axis in every file")
    return complete


def _summary(found: DecoupledFlange) -> dict[str, Any]:
    import numpy as np

    values = np.abs(found.receptance.values)
    relative = [float(np.median(found.std[:, i, j] / values[:, i, j])) for i, j in ((0, 0), (0, 1), (1, 1))]
    return {
        "frequencies": int(found.condition.size),
        "condition_median": float(np.median(found.condition)),
        "relative_std": relative,
        "regularised": float(found.regularised.mean()),
        "ambiguous": float(found.ambiguous.mean()),
        "not_passive": float((found.dissipation < -1e-3).mean()),
        "notes": list(found.notes),
    }


def _draw(found: dict[Dof, DecoupledFlange], machine: Mapping[Dof, MachineAxis], path: Path) -> None:
    from rcsa_ident.report.comparison import FlangePair, flange_comparison, save

    axis, first = next(iter(found.items()))
    curves = {"decoupled from hammer tests": first.receptance.values}
    if axis in machine:
        curves["identified in process"] = machine[axis].spindle.receptance(first.receptance.omega).values
    title = f"spindle flange, {axis.upper()}"
    save(flange_comparison(FlangePair(title, to_hz(first.receptance.omega), curves)), path)
