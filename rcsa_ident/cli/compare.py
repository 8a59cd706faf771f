"""compare: a hammer test beside the identified machine."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from rcsa_ident.base.units import from_hz, from_rpm, to_hz, to_rpm
from rcsa_ident.cli.common import Json, Stages, answers, emit, say, warn, writable
from rcsa_ident.cli.lobes import ResultFile, ToolingFile

if TYPE_CHECKING:
    from collections.abc import Sequence

    from rcsa_ident.workflows.compare import ResponseComparison

_TITLES = {
    "tip": "C11, tool tip",
    "cross": "C31, tip to flange",
    "spindle": "C33, spindle flange with tooling",
    "flange": "B33, spindle flange alone",
}


@answers
def compare(
    result: ResultFile,
    tooling: ToolingFile,
    hammer: Annotated[
        list[str],
        typer.Option(
            help="FRF file of a hammer test (CSV, UFF 58, text columns), or PLACE=FILE with PLACE tip (default), cross (force at the tip, "
            "response at the spindle's flange), spindle (at the flange, tooling clamped) or flange (no tooling). May be repeated.",
            show_default=False,
        ),
    ],
    out: Annotated[Path | None, typer.Option(help="Figure to write (png, svg, pdf).", show_default=False)] = None,
    speed: Annotated[
        float | None, typer.Option(help="Spindle speed, rev/min; default: the middle of the campaign's.", show_default=False)
    ] = None,
    real_imaginary: Annotated[
        bool, typer.Option("--real-imaginary", help="Real and imaginary part in place of magnitude and phase.")
    ] = False,
    json_: Json = False,
) -> None:
    """Show a hammer test of the idle machine beside the dynamics identified in process."""
    import numpy as np

    from rcsa_ident.base.errors import InputError, positive
    from rcsa_ident.cli.results import read_machine, tell
    from rcsa_ident.dynamics.coordinates import Dof
    from rcsa_ident.io.curves.hammer import labelled, read_hammer
    from rcsa_ident.io.settings.setups import read_tooling
    from rcsa_ident.workflows.compare import Place
    from rcsa_ident.workflows.compare import compare as run

    if out is not None:
        writable(out)
    tests: dict[tuple[Place, Dof], Any] = {}
    assumed: dict[str, None] = {}
    for text in hammer:
        place, path = labelled(text, Place.TIP, [str(p) for p in Place])
        for axis, curve in read_hammer(path, place).values.items():
            frequency, values = curve
            assumed |= dict.fromkeys(curve.remarks)
            key = (Place(place), Dof(axis.lower()))
            if key in tests:
                raise InputError("--hammer", f"two tests {place} {axis}", "one for each place and axis", str(path))
            tests[key] = (from_hz(np.asarray(frequency)), values)
    machine = read_machine(result)
    tell(machine, result)
    omega = None if speed is None else from_rpm(positive("--speed", speed, "rev/min"))
    stages = Stages(quiet=json_)
    with stages.stage("comparison"):
        found = run(machine, tests, read_tooling(tooling).assembly, omega)
    if out is not None:
        assert machine.band is not None
        _draw(found, out, (to_hz(machine.band[0]), to_hz(machine.band[1])), real_imaginary)
    there = machine.speed_answered(omega)
    if json_:
        rpm = None if there is None else to_rpm(there)
        rows = [_row(each) for each in found]
        told = {"responses": rows, "spindle_speed_rpm": rpm, "warnings": list(assumed), "seconds": stages.seconds}
        emit(told | {"out": None if out is None else str(out)})
        return
    for remark in assumed:
        warn(remark)
    _show(found)
    if there is not None:
        say(f"identified at {to_rpm(there):.0f} rev/min{'' if omega is not None else ', the middle of the speeds that were cut'}")
    if machine.coupled_planes:
        say("X and Y of the machine feel each other: what comes back through the other plane is in the identified responses")
    for each in found:
        if not each.modes:
            warn(f"{_TITLES[each.place]}, {each.axis.upper()}: no mode in the identified band")
    if out is not None:
        say(f"written: {out}")


def _draw(found: Sequence[ResponseComparison], out: Path, band: tuple[float, float], real_imaginary: bool) -> None:
    from rcsa_ident.report.comparison import FrfPair, frf_comparison, save

    pairs = [
        FrfPair(
            f"{_TITLES[each.place]}, {each.axis.upper()}",
            each.axis.upper(),
            to_hz(each.omega),
            each.identified,
            to_hz(each.omega),
            each.hammer,
            each.deviation,
            [(to_hz(h.frequency), None if i is None else to_hz(i.frequency)) for h, i in each.modes],
            (to_hz(each.band_frac[0]), each.band_frac[1]),
        )
        for each in found
    ]
    save(frf_comparison(pairs, band_hz=band, real_and_imaginary=real_imaginary), out)


def _row(each: ResponseComparison) -> dict[str, Any]:
    modes = []
    for h, i in each.modes:
        row = {"hammer_hz": to_hz(h.frequency), "hammer_damping": h.damping, "hammer_peak_m_per_n": h.compliance}
        if i is not None:
            row |= {"identified_hz": to_hz(i.frequency), "identified_damping": i.damping, "identified_peak_m_per_n": i.compliance}
        modes.append(row)
    return {"place": str(each.place), "axis": each.axis.upper(), "frac": each.frac, "relative_difference": each.error, "modes": modes}


def _show(found: Sequence[ResponseComparison]) -> None:
    from rich.table import Table

    from rcsa_ident.cli.tables import console, show

    heads = ("response", "hammer\nHz", "change\n%", "damping\n%", "in process\n%", "|H|\nµm/N", "stiffness\n%")
    table = Table(*heads, title="modes of the idle machine (hammer), and how they differ in process (identified)", title_justify="left")
    for column in table.columns[1:]:
        column.justify = "right"
    for each in found:
        for h, i in each.modes:
            left = (f"{each.place} {each.axis.upper()}", f"{to_hz(h.frequency):.1f}")
            damping, size = f"{100 * h.damping:.2f}", f"{1e6 * h.compliance:.3g}"
            if i is None:
                table.add_row(*left, "not found", damping, "", size, "")
                continue
            change = f"{100 * (i.frequency / h.frequency - 1):+.2f}"
            stiffness = f"{100 * (h.compliance / i.compliance - 1):+.1f}"
            table.add_row(*left, change, damping, f"{100 * i.damping:.2f}", size, stiffness)
    out = console()
    show(table)
    for each in found:
        out.print(f"{each.place} {each.axis.upper()}: FRAC {each.frac:.3f}, difference {100 * each.error:.1f} % of the hammer's")
