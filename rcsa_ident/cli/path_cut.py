"""path stability, path mill: how a machine or a robot cuts along a path."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from rcsa_ident.base.errors import InputError, positive
from rcsa_ident.base.remarks import counted
from rcsa_ident.base.units import from_rpm
from rcsa_ident.cli.common import Json, Stages, answers, emit, say, warn, writable
from rcsa_ident.cli.conditions import subjects_of
from rcsa_ident.cli.lobes import check_plot
from rcsa_ident.cli.options import TipOptions, option, takes_groups
from rcsa_ident.cli.path import CellMm, StepMm, Stock, metres, stock_of
from rcsa_ident.cli.processes import Dask, Processes, workers_or_cluster
from rcsa_ident.cli.robot import is_robot, posed_robot
from rcsa_ident.setup.fields import COEFFICIENTS, told_in_si
from rcsa_ident.stability.methods import MethodName

if TYPE_CHECKING:
    from rcsa_ident.machine.machine import TipSource
    from rcsa_ident.setup.tooling import Tooling
    from rcsa_ident.toolpath.path import ToolPath
    from rcsa_ident.workflows.paths.milling import PathMilling
    from rcsa_ident.workflows.paths.removal import PathRemoval
    from rcsa_ident.workflows.paths.stability import CutsAlong
    from rcsa_ident.workflows.tool_change import ToolChange

Files = Annotated[
    list[Path],
    typer.Argument(
        metavar="[MACHINE] TOOLING.toml PATH",
        help="RESULT.json, FLANGE.csv, or ROBOT.toml with --posture; with --modes or --frf none. PATH.nc is G-code, PATH.csv a table.",
        show_default=False,
    ),
]


@dataclass(frozen=True, slots=True)
class PathCutOptions:
    """Who cuts along a path, what, and from which stock."""

    stock: Stock
    posture: Annotated[
        str | None,
        typer.Option(metavar="'Q1 Q2 ...'", help="Of a robot: angles near those of the first place, degrees.", show_default=False),
    ] = None
    speed_rpm: Annotated[float | None, typer.Option(help="Spindle speed, rev/min, where the path has none.", show_default=False)] = None
    material: Annotated[str | None, option("material")] = None
    ktc_mpa: Annotated[float | None, option("ktc_mpa")] = None
    krc: Annotated[float | None, option("krc")] = None
    kac: Annotated[float | None, option("kac")] = None
    cell_mm: CellMm = None


@answers
@takes_groups
def stability(
    files: Files,
    out: Annotated[Path, typer.Option(help="STABILITY.csv to write: a row for every move that cuts.", show_default=False)],
    tip: TipOptions,
    cut: PathCutOptions,
    step_mm: StepMm = None,
    method: Annotated[MethodName, typer.Option(help="Stability method.")] = MethodName.FULL_DISCRETISATION,
    bands: Annotated[bool, typer.Option(help="Draw machines from what is left open of this one.")] = True,
    processes: Processes = None,
    dask: Dask = None,
    plot: Annotated[
        Path | None, typer.Option(help="PART.png or .svg: the part coloured by the margin to chatter.", show_default=False)
    ] = None,
    plot_error: Annotated[
        Path | None, typer.Option(help="PART.png or .svg: the part coloured by how far its walls are off.", show_default=False)
    ] = None,
    json_: Json = False,
) -> None:
    """Tell on every move of a path how far the cut is from chatter, its force, how the tip moves, and where it leaves the wall."""
    import numpy as np

    from rcsa_ident.io.paths.path_tables import stability_columns, write_columns
    from rcsa_ident.workflows.paths.removal import field_of, remove_along
    from rcsa_ident.workflows.paths.stability import cuts_along, described, stations_along

    writable(out)
    check_plot(plot)
    check_plot(plot_error, "--plot-error")
    machine, tooling, path = _subjects(files, tip, cut.posture)
    change = _change(machine, tooling, cut, method, bands)
    field = field_of(tooling, *stock_of(cut.stock), metres("--cell-mm", cut.cell_mm))
    stages = Stages(quiet=json_)
    with stages.stage("removal") as line:
        removal = remove_along(tooling, path, field, metres("--step-mm", step_mm), line)
    stations = stations_along(machine, tooling, removal.path)
    with stages.stage("stability") as line, workers_or_cluster(processes, dask, ("rcsa_ident.workflows.paths.judged_cuts",)) as pool:
        found = cuts_along(change, removal.path, removal.engagement, stations, line, pool.map)
    way, cutting = removal.path, np.flatnonzero(found.cutting)
    write_columns(out, stability_columns(found, way, cutting))
    _plots(removal, tooling, found, plot, plot_error)
    warnings = list(dict.fromkeys([*removal.warnings, *tooling.remarks, *machine.remarks, *found.warnings]))
    if json_:
        emit(_summary(found, way) | {"warnings": warnings, "seconds": stages.seconds, "out": str(out)})
        return
    say(described(found, way))
    if cutting.size:
        most = f"{np.nanmax(found.peak_force):.0f} N across the tool's axis"
        say(f"forces up to {most}; {found.groups} different cuts on {cutting.size} moves")
    errors = found.form_error[np.isfinite(found.form_error)]
    if errors.size:
        say(f"walls are off by {1e6 * errors.min():.1f} to {1e6 * errors.max():.1f} µm; above 0 material is left")
    for each in warnings:
        warn(each)
    say(f"written: {', '.join(str(each) for each in (out, plot, plot_error) if each is not None)} ({sum(stages.seconds.values()):.1f} s)")


@answers
@takes_groups
def mill(
    files: Files,
    out: Annotated[Path, typer.Option(help="FORCES.csv to write: a row for every turn of the tool in material.", show_default=False)],
    tip: TipOptions,
    cut: PathCutOptions,
    steps: Annotated[int, typer.Option(help="Instants of a turn.", min=60, max=20000)] = 360,
    play: Annotated[bool, typer.Option("--play/--no-play", help="With the play of a robot's drives.")] = True,
    weight: Annotated[bool, typer.Option("--weight/--no-weight", help="Whether the arm's weight holds that play.")] = True,
    surface: Annotated[Path | None, typer.Option(help="SURFACE.csv to write: the walls that are left.", show_default=False)] = None,
    cutoff_mm: Annotated[float, typer.Option(help="Of the Gaussian filter (ISO 16610-21) for Ra, Rq and Rt.")] = 0.8,
    json_: Json = False,
) -> None:
    """Mill along a path in time: chips, forces and vibrations instant by instant, and the walls that they leave."""
    from rcsa_ident.io.paths.path_tables import milling_columns, write_columns
    from rcsa_ident.workflows.paths.milling import mill_path
    from rcsa_ident.workflows.paths.removal import field_of

    writable(out)
    if surface is not None:
        writable(surface, "--surface")
    machine, tooling, path = _subjects(files, tip, cut.posture)
    change = _change(machine, tooling, cut, MethodName.ZERO_ORDER, False)
    field = field_of(tooling, *stock_of(cut.stock), metres("--cell-mm", cut.cell_mm))
    stages = Stages(quiet=json_)
    with stages.stage("milling") as line:
        found = mill_path(
            change, path, field, steps, play, weight, 1e-3 * positive("--cutoff-mm", cutoff_mm, "mm"), surface is not None, line
        )
    write_columns(out, milling_columns(found, path))
    if surface is not None:
        write_columns(surface, _surface_columns(found, path))
    warnings = list(dict.fromkeys([*path.remarks, *field.remarks, *tooling.remarks, *machine.remarks, *found.warnings]))
    if json_:
        emit(_mill_summary(found, path) | {"warnings": warnings, "seconds": stages.seconds, "out": str(out)})
        return
    say(found.described(path))
    for each in warnings:
        warn(each)
    written = ", ".join(str(each) for each in (out, surface) if each is not None)
    say(f"written: {written} ({found.time.size} turns, {stages.seconds['milling']:.1f} s)")


def _subjects(files: list[Path], tip: TipOptions, posture: str | None) -> tuple[TipSource, Tooling, ToolPath]:
    """The machine, the tooling and the path that a command line names."""
    from rcsa_ident.io.paths.tool_paths import read_tool_path
    from rcsa_ident.io.settings.setups import read_tooling

    if len(files) < 2:
        raise InputError(
            "files", counted(len(files), "file"), "a machine, a tooling and a path; with --modes or --frf a tooling and a path"
        )
    *subjects, path = files
    robot = len(subjects) == 2 and is_robot(subjects[0])
    if robot != (posture is not None):
        allowed = "the angles of a robot near the first place" if robot else "none: a machine has no joints to turn"
        raise InputError("--posture", "nothing" if posture is None else posture, allowed)
    if robot and posture is not None:
        return posed_robot(subjects[0], posture, False), read_tooling(subjects[1]), read_tool_path(path)
    machine, toolings = subjects_of(subjects, tip)
    return machine, toolings[0], read_tool_path(path)


def _change(machine: TipSource, tooling: Tooling, cut: PathCutOptions, method: MethodName, bands: bool) -> ToolChange:
    import numpy as np

    from rcsa_ident.setup.cut import CutSpec
    from rcsa_ident.stability.lobes import METHODS
    from rcsa_ident.workflows.paths.stability import DRAWS
    from rcsa_ident.workflows.tool_change import ToolChange

    speeds = np.zeros(0) if cut.speed_rpm is None else np.array([from_rpm(positive("--speed-rpm", cut.speed_rpm, "rev/min"))])
    given = told_in_si(COEFFICIENTS, {"ktc_mpa": cut.ktc_mpa, "krc": cut.krc, "kac": cut.kac})
    spec = CutSpec(material=cut.material, coefficients=given)
    # every move has a depth of its own: nothing is asked about the largest one
    change = ToolChange(machine, tooling, spec, speeds, 1.0, METHODS[method](), DRAWS if bands else 0)
    _ = change.process  # coefficients that are not known are said before anything is computed
    return change


def _summary(found: CutsAlong, path: ToolPath) -> dict[str, Any]:
    import numpy as np

    cutting = np.flatnonzero(found.cutting)
    data: dict[str, Any] = {"moves": len(path) - 1, "cutting_moves": int(cutting.size), "different_cuts": found.groups}
    if not cutting.size:
        return data
    worst = int(cutting[np.argmin(found.margin[cutting])])
    errors = found.form_error[np.isfinite(found.form_error)]
    return data | {
        "chattering_moves": int(np.count_nonzero(found.margin[cutting] < 1.0)),
        "doubtful_moves": int(np.count_nonzero((found.margin_low[cutting] < 1.0) & (found.margin[cutting] >= 1.0))),
        "least_margin": float(found.margin[worst]),
        "least_margin_low": float(found.margin_low[worst]),
        "at_mm": (1e3 * path.places[worst + 1]).tolist(),
        "at_line": int(path.line[worst + 1]) or None,
        "largest_force_n": float(np.nanmax(found.peak_force)),
        "largest_deflection_um": 1e6 * float(np.nanmax(found.deflection, initial=-math.inf)),
        "form_error_um": [1e6 * float(errors.min()), 1e6 * float(errors.max())] if errors.size else None,
    }


def _mill_summary(found: PathMilling, path: ToolPath) -> dict[str, Any]:
    import numpy as np

    rough = found.roughness
    return {
        "turns": int(found.time.size),
        "largest_force_n": float(np.max(found.peak_force, initial=0.0)),
        "largest_deflection_um": 1e6 * float(np.max(np.linalg.norm(found.mean_tip, axis=1), initial=0.0)),
        "chattering_lines": sorted({int(path.line[k + 1]) for k in found.chattering}),
        "status": found.status,
        "roughness_um": None
        if rough is None
        else {"ra": 1e6 * rough.mean, "rq": 1e6 * rough.rms, "rt": 1e6 * rough.total, "cutoff_mm": 1e3 * rough.cutoff},
        "form_error_um": None if found.form_error is None else [1e6 * each for each in found.form_error],
    }


def _surface_columns(found: PathMilling, path: ToolPath) -> dict[str, Any]:
    table = found.surface
    names = ("x_mm", "y_mm", "z_mm", "height_mm")
    columns = dict(zip(names, (1e3 * table[:, :4]).round(6).T, strict=True))
    return columns | {"error_um": 1e6 * table[:, 4], "line": path.line[1:][table[:, 5].astype(int)]}


def _plots(removal: PathRemoval, tooling: Tooling, found: CutsAlong, margin: Path | None, error: Path | None) -> None:
    """Draw the part coloured by what each move did to it."""
    if margin is None and error is None:
        return
    from rcsa_ident.report.part import save_coloured_part
    from rcsa_ident.workflows.paths.removal import solid_of

    for file, values, label, limits in (
        (margin, found.margin_low, "margin to chatter", (0.0, 2.0)),
        (error, 1e6 * found.form_error, "form error of the wall [µm]", None),
    ):
        if file is not None:
            save_coloured_part(file, removal.part, removal.path, values, label, limits, solid_of(tooling).radius)


#: By their names on the command line.
COMMANDS: dict[str, Any] = {"stability": stability, "mill": mill}
