"""calibrate and materials: cutting coefficients from a dynamometer, or from the library."""

from __future__ import annotations

import math
from collections.abc import Sequence
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from rcsa_ident.base.errors import InputError
from rcsa_ident.cli.common import NOT_CONVERGED, Json, Stages, answers, emit, say, warn, writable

if TYPE_CHECKING:
    from rcsa_ident.report.comparison import MeanForces
    from rcsa_ident.setup.campaign import Campaign
    from rcsa_ident.workflows.calibrate import Calibrated

#: Factor from SI to the file's units.
_SHOWN = dict.fromkeys(("K_tc", "K_rc", "K_ac"), (1e-6, "MPa")) | dict.fromkeys(("K_te", "K_re", "K_ae"), (1e-3, "N/mm"))


class CalibrationMethod(StrEnum):
    """Ways to coefficients."""

    mean = "mean"
    signal = "signal"


class Axes(StrEnum):
    """Whether the sensors' axes are believed."""

    told = "told"
    auto = "auto"


class SensorModel(StrEnum):
    """What a dynamometer does to the force, to be found with the coefficients."""

    auto = "auto"
    none = "none"
    first = "first-order"
    second = "second-order"


@answers
def calibrate(
    campaign: Annotated[Path, typer.Argument(help='Folder with campaign.toml; sensors with quantity = "force".', show_default=False)],
    out: Annotated[Path, typer.Option(help="WORKPIECE.toml to write: the [workpiece] table of a campaign.", show_default=False)],
    method: Annotated[
        CalibrationMethod, typer.Option(help="Mean forces over the feed, or the whole force over time.")
    ] = CalibrationMethod.mean,
    axes: Annotated[
        Axes, typer.Option(help="Axes and signs of the sensors as the campaign tells them, or found by trying all on the cuts.")
    ] = Axes.told,
    plot: Annotated[Path | None, typer.Option(help="Figure of the mean forces (png, svg, pdf).", show_default=False)] = None,
    max_frequency: Annotated[float, typer.Option(help="Highest line that method signal fits, Hz.")] = 2000.0,
    dynamometer: Annotated[SensorModel, typer.Option(help="Model of the dynamometer that method signal fits.")] = SensorModel.auto,
    resonance: Annotated[float, typer.Option(help="First guess of the dynamometer's bandwidth or resonance, Hz.")] = 3000.0,
    free_helix: Annotated[bool, typer.Option(help="Fit the helix angle as well (method signal).")] = False,
    json_: Json = False,
) -> None:
    """Find cutting and edge coefficients from dynamometer records of cuts at several feeds."""
    from functools import partial

    from rcsa_ident.base.errors import positive
    from rcsa_ident.cutting.signal_fit import Dynamometer
    from rcsa_ident.io.recordings.readers import read_cut
    from rcsa_ident.io.settings.dynamometer import write_workpiece
    from rcsa_ident.io.settings.setups import read_campaign
    from rcsa_ident.setup.cut import Workpiece
    from rcsa_ident.workflows.calibrate import calibrate as run

    writable(out)
    if plot is not None:
        writable(plot, "--plot")
    positive("--max-frequency", max_frequency, "Hz")
    setup = read_campaign(campaign)
    resonance = positive("--resonance", resonance, "Hz")
    sensor = None if dynamometer is SensorModel.auto else Dynamometer(list(SensorModel).index(dynamometer) - 1, resonance)
    stages = Stages(quiet=json_)
    read = partial(read_cut, setup.sensors, setup.sampling_rate)
    with stages.stage("calibration") as line:
        found = run(setup, read, method is CalibrationMethod.signal, max_frequency, sensor, free_helix, axes is Axes.auto, line)
    if found.forces.of("K_tc")[0] <= 0.0:
        why = "; ".join([*found.forces.reasons, *([] if axes is Axes.auto else ["try --axes auto"])])
        raise InputError("K_tc", f"{found.forces.of('K_tc')[0] * 1e-6:.4g} MPa", f"a number above zero ({why})", str(campaign))
    workpiece = Workpiece("" if setup.workpiece is None else setup.workpiece.name, found.forces.coefficients)
    write_workpiece(out, workpiece, _remarks(setup, found))
    if plot is not None:
        from rcsa_ident.report.comparison import mean_forces, save

        save(mean_forces(_groups(found)), plot)
    doubts = [*found.forces.reasons]
    if not found.choices and any("axes of the sensors" in doubt for doubt in doubts):
        doubts.append("try --axes auto")
    if json_:
        emit(_summary(found) | {"seconds": stages.seconds, "out": str(out)})
    else:
        _show(found)
        for cut, reason in found.left_out:
            warn(f"{cut} left out: {reason}")
        for note in (*found.notes, *found.forces.notes):
            say(f"note: {note}")
        say(f"written: {out}" + (f", {plot}" if plot is not None else ""))
        for doubt in doubts:
            warn(doubt)
    if doubts:
        raise typer.Exit(NOT_CONVERGED)


def _remarks(setup: Campaign, found: Calibrated) -> list[str]:
    forces, rows = found.forces, []
    for name, value, width in zip(forces.names, forces.value, forces.half_width, strict=True):
        factor, unit = _SHOWN[name]
        rows.append(f"{name} = {value * factor:.5g} +- {width * factor:.2g} {unit}")
    head = (
        f"Calibrated from {len(found.used)} cuts of {setup.name}, method {forces.method}; +- is 95 %, spreads are one standard deviation."
    )
    return [head, "; ".join(rows), *forces.reasons, *found.notes]


def _summary(found: Calibrated) -> dict[str, Any]:
    forces = found.forces
    rows = {
        name: {"value": value * _SHOWN[name][0], "half_width_95": width * _SHOWN[name][0], "unit": _SHOWN[name][1]}
        for name, value, width in zip(forces.names, forces.value.tolist(), forces.half_width.tolist(), strict=True)
    }
    data: dict[str, Any] = {
        "method": forces.method,
        "coefficients": rows,
        "misfit": forces.misfit,
        "cuts_used": [m.cut_id for m in found.used],
        "cuts_left_out": [{"id": cut, "reason": reason} for cut, reason in found.left_out],
        "once_per_revolution_n": {m.cut_id: m.once_per_revolution.tolist() for m in found.used},
        "axes": [{"shows": list(c.shown()), "unexplained": c.unexplained} for c in found.choices],
        "reasons": list(forces.reasons),
        "notes": [*found.notes, *forces.notes],
    }
    if found.signal is not None:
        signal = found.signal
        data["signal"] = {
            "runout_um": {name: (1e6 * offsets).tolist() for name, offsets in signal.runout.items()},
            "helix_deg": None if signal.helix is None else math.degrees(signal.helix),
            "dynamometer": signal.sensor.tolist(),
        }
    return data


def _show(found: Calibrated) -> None:
    from rich.table import Table

    from rcsa_ident.cli.tables import console, show

    forces = found.forces
    table = Table("coefficient", "value", "± 95 %", "unit", title=f"{len(found.used)} cuts, method {forces.method}", title_justify="left")
    for column in table.columns[1:3]:
        column.justify = "right"
    for name, value, width in zip(forces.names, forces.value, forces.half_width, strict=True):
        factor, unit = _SHOWN[name]
        table.add_row(name, f"{value * factor:.5g}", f"{width * factor:.2g}", unit)
    out = console()
    show(table)
    out.print(f"unexplained: {100.0 * forces.misfit:.2g} % of the force")
    if once := [float(m.once_per_revolution[:2].max()) for m in found.used if m.record.cutter.teeth > 1]:
        out.print(f"once per revolution: up to {max(once):.3g} N, the cutter's run-out")
    if found.signal is not None:
        for name, offsets in found.signal.runout.items():
            out.print(f"run-out of {name}: {', '.join(f'{1e6 * o:+.2f}' for o in offsets)} µm", markup=False)
        for axis, row in zip("XY", found.signal.sensor, strict=True):
            if row.size:
                out.print(f"dynamometer {axis}: {row[0]:.0f} Hz" + (f", damping {100.0 * row[1]:.1f} %" if row.size > 1 else ""))


def _groups(found: Calibrated) -> Sequence[MeanForces]:
    """Cuts that differ in feed only, with the line that the coefficients give them."""
    from dataclasses import replace

    import numpy as np

    from rcsa_ident.report.comparison import MeanForces

    groups: dict[tuple[Any, ...], list[Any]] = {}
    for m in found.used:
        c = m.record.conditions
        key = (m.record.clamping, round(c.axial_depth, 9), str(c.engagement), round(c.feed_angle, 6))
        groups.setdefault(key, []).append(m)
    rows = []
    for (clamping, depth, engaged, _), members in groups.items():
        feed = np.array([m.record.conditions.feed_per_tooth for m in members])
        ends = np.array([0.0, 1.05 * feed.max()])
        first = members[0]
        conditions = [replace(first.record.conditions, feed_per_tooth=float(f)) for f in ends]
        line = [found.mean_force_model(replace(first, record=replace(first.record, conditions=c))) for c in conditions]
        count = min(m.mean.size for m in members)
        title = f"{clamping}, {1e3 * depth:g} mm, {engaged}"
        rows.append(MeanForces(title, feed, np.array([m.mean[:count] for m in members]), ends, np.array(line)[:, :count]))
    return rows


@answers
def materials(
    name: Annotated[str | None, typer.Argument(help="One material; by default all are listed.", show_default=False)] = None,
    json_: Json = False,
) -> None:
    """List cutting coefficients from published sources, with what another cutter may be off."""
    from rcsa_ident.cutting.materials import material
    from rcsa_ident.cutting.materials import materials as library
    from rcsa_ident.io.settings.workpieces import workpiece_keys
    from rcsa_ident.setup.cut import Workpiece

    chosen = library() if name is None else (material(name),)
    if json_:
        rows = [workpiece_keys(Workpiece(m.name, m.coefficients), all_spreads=True) for m in chosen]
        emit([row | {"condition": m.condition, "source": m.source, "notes": m.notes} for row, m in zip(rows, chosen, strict=True)])
        return
    from rich.markup import escape
    from rich.table import Table

    from rcsa_ident.cli.tables import show

    table = Table("material", "K_tc\nMPa", "± %", "k_rc", "± %", "K_te\nN/mm", "K_re\nN/mm", "source")
    for column in table.columns[1:7]:
        column.justify = "right"
    sources = list(dict.fromkeys(m.source for m in chosen))
    for m in chosen:
        c = m.coefficients
        edges = [f"{1e-3 * e:.3g}" if e > 0.0 else "" for e in (c.tangential_edge, c.radial_edge)]
        spreads = [f"{100.0 * s:.0f}" for s in (c.tangential_spread, c.ratio_spread)]
        values = (f"{1e-6 * c.tangential:.0f}", spreads[0], f"{c.radial_ratio:.2f}", spreads[1], *edges)
        table.add_row(escape(m.name), *values, str(sources.index(m.source) + 1))
    show(table)
    for number, source in enumerate(sources, start=1):
        say(f"{number}: {source}")
    if name is not None:
        for m in chosen:
            say(f"{m.condition}. {m.notes}")
