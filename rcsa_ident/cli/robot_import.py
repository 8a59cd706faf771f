"""robot import: an arm from the description that its maker or the Robot Operating System has of it."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Annotated, Any

import typer

from rcsa_ident.base.errors import InputError
from rcsa_ident.cli.common import Json, answers, emit, say, warn, writable


@answers
def import_(
    urdf: Annotated[Path, typer.Argument(help="ARM.urdf; of xacro what it expands to.", show_default=False)],
    out: Annotated[Path, typer.Option(help="ROBOT.toml to write.", show_default=False)],
    stiffness: Annotated[
        str,
        typer.Option(
            "--stiffness-nm-per-rad",
            metavar="'K1 K2 ...'",
            help="Of each joint from the base on, or one for all; URDF has none.",
            show_default=False,
        ),
    ],
    damping: Annotated[
        str | None,
        typer.Option("--damping-nms-per-rad", metavar="'D1 D2 ...'", help="Likewise; none without it.", show_default=False),
    ] = None,
    flange: Annotated[
        str | None,
        typer.Option(help="Link whose axes are the flange; by default the last one of an arm without branches.", show_default=False),
    ] = None,
    json_: Json = False,
) -> None:
    """Write ROBOT.toml from a URDF file: joints with their limits, and masses with their moments of inertia.

    URDF takes joints for rigid: their stiffness has to be told. That of milling arms with a payload of 130 to 600 kg is 1e6 to 1e7 N m/rad;
    `robot identify` finds it from records.
    """
    from rcsa_ident.io.files import write_text
    from rcsa_ident.io.settings.robots import robot_keys
    from rcsa_ident.io.settings.urdf import read_urdf
    from rcsa_ident.io.toml_text import toml_of

    writable(out)
    springs = _numbers(stiffness, "--stiffness-nm-per-rad", 1e-300)
    dampers = [0.0] if damping is None else _numbers(damping, "--damping-nms-per-rad", 0.0)
    arm, notes = read_urdf(urdf, springs, dampers, flange)
    warnings = list(notes)
    if damping is None:
        warnings.append("no damping is told: without --damping-nms-per-rad the arm's modes ring for ever, lobes mean nothing")
    write_text(out, toml_of(robot_keys(arm), [f"from {urdf.name}; stiffness as told, the tool point is the flange", *notes]))
    if json_:
        told = {"name": arm.name, "joints": [joint.name for joint in arm.joints], "mass_kg": arm.mass if arm.weighed else None}
        emit(told | {"warnings": warnings, "out": str(out)})
        return
    say(f"{arm.name}: {len(arm.joints)} joints ({', '.join(joint.name for joint in arm.joints)}), {arm.mass:.1f} kg")
    for warning in warnings:
        warn(warning)
    say(f"written: {out}")


def _numbers(text: str, option: str, least: float) -> list[float]:
    try:
        found = [float(part) for part in text.replace(",", " ").split()]
    except ValueError:
        found = []
    if not found or not all(math.isfinite(each) and each >= least for each in found):
        raise InputError(option, text, f"one number for all joints, or one a joint, {'0 or more' if least == 0.0 else 'above 0'}")
    return found


#: By its name on the command line.
COMMANDS: dict[str, Any] = {"import": import_}
