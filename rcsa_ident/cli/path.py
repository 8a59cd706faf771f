"""path: what a tool does along a path through stock."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from rcsa_ident.base.errors import InputError
from rcsa_ident.cli.common import Json, Stages, answers, emit, say, warn, writable
from rcsa_ident.cli.lobes import ToolingFile, check_plot

if TYPE_CHECKING:
    from rcsa_ident.base.arrays import FloatArray
    from rcsa_ident.toolpath.dexel import Surface

PathFile = Annotated[Path, typer.Argument(help="PATH.nc (G-code) or PATH.csv of the tool's tip.", show_default=False)]

Stock = Annotated[
    str,
    typer.Option(
        metavar="STOCK.stl|'X0 Y0 Z0 X1 Y1 Z1'",
        help="What is cut: a closed surface, .stl, .obj or .ply in mm, or a block by two corners, mm.",
        show_default=False,
    ),
]
CellMm = Annotated[
    float | None, typer.Option(help="Between lines of material; default: a twentieth of the tool's radius.", show_default=False)
]
StepMm = Annotated[
    float | None, typer.Option(help="Between places on the path; default: a tenth of the tool's radius.", show_default=False)
]

path_app = typer.Typer(help="A tool along a path: the material that it takes out, where its edges cut.", no_args_is_help=True)


@answers
def remove(
    tooling: ToolingFile,
    path: PathFile,
    stock: Stock,
    out: Annotated[Path, typer.Option(help="ENGAGEMENT.csv to write: the arcs at every place and slice.", show_default=False)],
    cell_mm: CellMm = None,
    step_mm: StepMm = None,
    part: Annotated[Path | None, typer.Option(help="PART.stl, .obj or .ply to write: what is left, in mm.", show_default=False)] = None,
    plot: Annotated[Path | None, typer.Option(help="PART.png or .svg to draw: what is left, and the path.", show_default=False)] = None,
    json_: Json = False,
) -> None:
    """Take out of the stock what the tool sweeps along the path, and tell where its edges are in the material."""
    from rcsa_ident.io.paths.meshes import check_mesh_name, write_mesh
    from rcsa_ident.io.paths.tool_paths import read_tool_path
    from rcsa_ident.io.settings.engagements import write_engagement
    from rcsa_ident.io.settings.setups import read_tooling
    from rcsa_ident.workflows.paths.removal import field_of, remove_along

    writable(out)
    check_plot(plot)
    if part is not None:
        check_mesh_name(part)
        writable(part, "--part")
    tool, way = read_tooling(tooling), read_tool_path(path)
    step = metres("--step-mm", step_mm)
    field = field_of(tool, *stock_of(stock), metres("--cell-mm", cell_mm))
    stages = Stages(quiet=json_)
    with stages.stage("removal") as line:
        found = remove_along(tool, way, field, step, line)
    write_engagement(out, found.path, found.engagement, found.arc_volume)
    if part is not None:
        with stages.stage("surface"):
            points, faces = found.part.mesh()
            if not len(faces):
                raise InputError("--part", "nothing that is left", "a path that leaves a part of the stock")
            write_mesh(part, points, faces)
    if plot is not None:
        from rcsa_ident.report.part import save_part

        with stages.stage("picture"):
            save_part(plot, found.part, found.path)
    if json_:
        emit(
            {
                "removed_volume_mm3": 1e9 * found.removed,
                "positions": len(found.path),
                "seconds": found.seconds,
                "dexel_updates": found.updates,
                "cell_mm": 1e3 * float(found.part.cell.max()),
                "memory_bytes": found.part.memory,
                "warnings": list(found.warnings),
                "out": str(out),
            }
        )
        return
    say(f"{1e9 * found.removed:.6g} mm³ are taken out of {1e9 * (found.removed + found.part.volume):.6g} mm³ on {len(found.path)} places")
    held = f"{found.part.memory / 1e6:.3g} MB"
    say(f"lines every {1e3 * float(found.part.cell.max()):.3g} mm, {held}, met {found.updates} times")
    for warning in found.warnings:
        warn(warning)
    for written in (out, part, plot):
        if written is not None:
            say(f"written: {written}" + (f" ({found.seconds:.2f} s)" if written == out else ""))


def stock_of(text: str) -> tuple[tuple[FloatArray, FloatArray] | None, Surface | None]:
    """Return a block by its corners [m] or a surface, whichever an option names."""
    from rcsa_ident.io.paths.meshes import read_mesh

    if Path(text).suffix and not _numbers(text):
        return None, read_mesh(text)
    return _block(text), None


def _numbers(text: str) -> list[float]:
    try:
        return [float(part) for part in text.replace(",", " ").split()]
    except ValueError:
        return []


def _block(text: str) -> tuple[FloatArray, FloatArray]:
    """The two corners of a block, in metres."""
    import numpy as np

    found = _numbers(text)
    if len(found) != 6 or not all(math.isfinite(each) for each in found):
        raise InputError("--stock", text, "a file that ends in .stl, .obj or .ply, or six numbers 'X0 Y0 Z0 X1 Y1 Z1' [mm]")
    low, high = np.array(found[:3]) * 1e-3, np.array(found[3:]) * 1e-3
    if not np.all(high > low):
        raise InputError("--stock", text, "the lower corner of the block first: X0 < X1, Y0 < Y1, Z0 < Z1 [mm]")
    return low, high


def metres(option: str, value: float | None) -> float | None:
    """Return a length above 0 that an option has in millimetres, where it has one."""
    if value is None:
        return None
    if not (math.isfinite(value) and value > 0.0):
        raise InputError(option, value, "a length above 0 [mm]")
    return 1e-3 * value


#: By its name on the command line.
COMMANDS: dict[str, Any] = {"remove": remove}
