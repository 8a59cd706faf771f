"""robot draw: an arm at a posture as a picture, with the path that its tool follows."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from rcsa_ident.base.errors import InputError
from rcsa_ident.cli.common import Json, answers, emit, say, warn, writable
from rcsa_ident.cli.robot import Posture, RobotFile, arm_of, joint_angles

if TYPE_CHECKING:
    from rcsa_ident.base.arrays import FloatArray


@answers
def draw(
    robot: RobotFile,
    posture: Posture,
    out: Annotated[Path, typer.Option(help="ARM.svg to write; one unit is a millimetre of the arm.", show_default=False)],
    tooling: Annotated[
        Path | None, typer.Option(help="TOOLING.toml that sits at the tool point, drawn to scale.", show_default=False)
    ] = None,
    path: Annotated[
        Path | None,
        typer.Option(
            help="PATH.nc or PATH.csv of the tool's tip: it is drawn, and lightly the arm at its first and last place. "
            "--posture stands near the first one; needs --tooling.",
            show_default=False,
        ),
    ] = None,
    azimuth: Annotated[
        float, typer.Option("--azimuth-deg", help="Where one stands who looks at an angle, from the base's x.", min=-360.0, max=360.0)
    ] = -58.0,
    elevation: Annotated[float, typer.Option("--elevation-deg", help="By which one looks down.", min=-90.0, max=90.0)] = 22.0,
    json_: Json = False,
) -> None:
    """Draw an arm at a posture, at an angle and from the side: links, joints with their axes, spindle and tool, a scale in millimetres."""
    import numpy as np

    from rcsa_ident.io.files import write_text
    from rcsa_ident.io.settings.setups import read_tooling
    from rcsa_ident.report.robot_drawing import arm_svg

    writable(out)
    flexible = arm_of(robot, False)
    arm, angles = flexible.model, joint_angles(posture, flexible)
    assembly = None if tooling is None else read_tooling(tooling).assembly
    places: FloatArray | None = None
    ends: list[FloatArray] = []
    if path is not None:
        from rcsa_ident.io.paths.tool_paths import read_tool_path
        from rcsa_ident.workflows.robot_postures import following

        if assembly is None:
            raise InputError("--tooling", "nothing", "TOOLING.toml: the path is that of a tool's tip")
        along = read_tool_path(path)
        places = along.places
        postures = following(arm, angles, along.places, along.axes, assembly)
        ends = [postures[0], postures[-1]]
    write_text(out, arm_svg(arm, angles, assembly, places, ends, (azimuth, elevation)))
    warnings = list(arm.beyond_limits(angles))
    if json_:
        told = {"name": arm.name, "posture_deg": np.degrees(angles).tolist(), "ends_deg": [np.degrees(each).tolist() for each in ends]}
        emit(told | {"warnings": warnings, "out": str(out)})
        return
    for warning in warnings:
        warn(warning)
    say(f"written: {out}")


#: By its name on the command line.
COMMANDS: dict[str, Any] = {"draw": draw}
