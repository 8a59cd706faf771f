"""robot: an arm from its maker's description, what it does at a posture and along a path, its picture, and what a tool on it may cut."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from rcsa_ident.base.errors import InputError
from rcsa_ident.base.units import from_hz, inclusive, to_hz, to_rpm
from rcsa_ident.cli.common import Json, Stages, answers, emit, say, warn, writable
from rcsa_ident.cli.conditions import change_of, cut_of
from rcsa_ident.cli.lobes import Plot, ToolingFile, check_plot, tell_lobes, tell_tooltip
from rcsa_ident.cli.options import CutOptions, SpeedOptions, takes_groups

if TYPE_CHECKING:
    from rcsa_ident.base.arrays import FloatArray
    from rcsa_ident.identification.arm.posterior import RobotPosterior
    from rcsa_ident.machine.robot.flexible import FlexibleRobot
    from rcsa_ident.machine.robot.posed_robot import PosedRobot

RobotFile = Annotated[Path, typer.Argument(help="ROBOT.toml of an arm; three stand in data/robots.", show_default=False)]
FoundRobot = Annotated[
    Path,
    typer.Argument(help="ROBOT.toml of an arm, three stand in data/robots; or RESULT.json, as cuts have told it.", show_default=False),
]
Posture = Annotated[
    str, typer.Option(metavar="'Q1 Q2 ...'", help="Angles of the joints, degrees, as ROBOT.toml counts them.", show_default=False)
]
JointsOnly = Annotated[
    bool, typer.Option("--joints-only", help="Leave the springs across the joints' axes out: the drives alone give way.")
]

robot_app = typer.Typer(
    help="Milling robots: natural frequencies, tooltip FRFs and stability lobes at a posture and along a path.", no_args_is_help=True
)


@answers
def check(
    robot: FoundRobot,
    posture: Annotated[
        str | None,
        typer.Option(metavar="'Q1 Q2 ...'", help="Angles of the joints, degrees; default: all zero.", show_default=False),
    ] = None,
    joints_only: JointsOnly = False,
    json_: Json = False,
) -> None:
    """Say where an arm's tool sits at a posture, how it vibrates and gives way there, and what speaks against its description."""
    import numpy as np

    from rcsa_ident.workflows.robot_postures import at_posture

    arm = arm_of(robot, joints_only)
    angles = np.zeros(len(arm.model.joints)) if posture is None else joint_angles(posture, arm)
    found = at_posture(arm, angles)
    warnings = [*arm.model.beyond_limits(angles), *arm.model.warnings]
    if json_:
        emit(
            {
                "name": arm.model.name,
                "degrees_of_freedom": arm.model.freedoms(arm.tilts),
                "mass_kg": arm.model.mass if arm.model.weighed else None,
                "tcp_m": found.tool_point.offset.tolist(),
                "tcp_axes": found.tool_point.turn.tolist(),
                "natural_frequencies_hz": to_hz(found.natural_frequencies).tolist(),
                "damping_ratios": found.damping_ratios.tolist(),
                "gravity_torque_nm": found.gravity_torques.tolist(),
                "tcp_compliance_m_per_n": found.compliance.tolist(),
                "sag_m": found.sag.tolist(),
                "play_m": found.play.tolist(),
                "postures_deg": np.degrees(found.postures).tolist(),
                "warnings": warnings,
            }
        )
        return
    from rcsa_ident.cli.tables import show_robot

    say(f"{arm.model.name}: {len(arm.model.joints)} joints, {arm.model.freedoms(arm.tilts)} freedoms")
    show_robot(found, [not arm.model.beyond_limits(each) for each in found.postures])
    for warning in warnings:
        warn(warning)


@answers
def tip(
    robot: FoundRobot,
    tooling: ToolingFile,
    posture: Posture,
    out: Annotated[Path, typer.Option(help="FRF.csv to write, m/N.", show_default=False)],
    joints_only: JointsOnly = False,
    from_: Annotated[float, typer.Option("--from", help="Lowest frequency, Hz.")] = 1.0,
    to: Annotated[float, typer.Option("--to", help="Highest frequency, Hz.")] = 4500.0,
    step: Annotated[float, typer.Option(help="Frequency step, Hz.")] = 0.25,
    plot: Plot = None,
    json_: Json = False,
) -> None:
    """Predict the tooltip FRF of a tooling on an arm at a posture, along the tool's x, its y turned around, and into the spindle."""
    writable(out)
    check_plot(plot)
    machine = replace(posed_robot(robot, posture, joints_only), highest=from_hz(to))
    tell_tooltip(machine, tooling, out, inclusive(from_, to, step, ("--from", "--to", "--step"), "Hz"), plot=plot, json_=json_)


@answers
@takes_groups
def lobes(
    robot: FoundRobot,
    tooling: ToolingFile,
    posture: Posture,
    out: Annotated[Path, typer.Option(help="LOBES.csv to write.", show_default=False)],
    cut: CutOptions,
    speeds: SpeedOptions,
    joints_only: JointsOnly = False,
    plot: Plot = None,
    json_: Json = False,
) -> None:
    """Compute stability lobes of a tooling on an arm at a posture; --feed-direction turns the feed from the tool's x."""
    from rcsa_ident.io.settings.setups import read_tooling

    writable(out)
    check_plot(plot)
    machine = posed_robot(robot, posture, joints_only)
    change = change_of(machine, read_tooling(tooling), cut_of(cut, speeds.speed_variation), speeds, False, 0.0)
    tell_lobes(change, out, plot=plot, json_=json_)


@answers
@takes_groups
def map_(
    robot: FoundRobot,
    tooling: ToolingFile,
    posture: Annotated[
        str,
        typer.Option(
            metavar="'Q1 Q2 ...'",
            help="Angles near those of the first place, degrees: of all postures that reach it the nearest one is taken.",
            show_default=False,
        ),
    ],
    path: Annotated[
        Path,
        typer.Option(
            help="PATH.nc (G-code) or PATH.csv of the tool's tip: x_mm, y_mm, z_mm, and i, j, k of the tool's axis.", show_default=False
        ),
    ],
    out: Annotated[Path, typer.Option(help="MAP.csv to write: a limit for each place and speed.", show_default=False)],
    cut: CutOptions,
    speeds: SpeedOptions,
    joints_only: JointsOnly = False,
    json_: Json = False,
) -> None:
    """Compute the stability limit at every place of a path and every speed: where on a part an arm may cut how deep."""
    import numpy as np

    from rcsa_ident.io.paths.tool_paths import read_tool_path, write_limits_along
    from rcsa_ident.io.settings.setups import read_tooling
    from rcsa_ident.workflows.robot_postures import following, limits_along

    writable(out)
    machine, tool = posed_robot(robot, posture, joints_only), read_tooling(tooling)
    along = read_tool_path(path)
    change = change_of(machine, tool, cut_of(cut, speeds.speed_variation), speeds, False, 0.0)
    stages = Stages(quiet=json_)
    postures = following(machine.robot.model, machine.angles, along.places, along.axes, tool.assembly)
    with stages.stage("limits") as line:
        limits, chatter = limits_along(change, postures, line)
    write_limits_along(out, along.places, change.speeds, limits, chatter)
    # the depth that every place allows, and the speed at which that is most
    worst = np.min(limits, axis=0)
    best = int(np.argmax(worst))
    depth = None if not math.isfinite(worst[best]) else 1e3 * float(worst[best])
    if json_:
        emit(
            {
                "positions": len(along),
                "postures_deg": np.degrees(postures).tolist(),
                "best_speed_rpm": to_rpm(float(change.speeds[best])),
                "limit_everywhere_mm": depth,
                "warnings": [*along.remarks, *machine.remarks],
                "seconds": stages.seconds,
                "out": str(out),
            }
        )
        return
    told = f"deeper than {1e3 * change.max_depth:g} mm" if depth is None else f"{depth:.2f} mm"
    say(f"at {to_rpm(float(change.speeds[best])):.0f} rev/min every place is stable up to {told}")
    for remark in (*along.remarks, *machine.remarks):
        warn(remark)
    say(f"written: {out} ({len(along)} places, {change.speeds.size} speeds, {stages.seconds['limits']:.2f} s)")


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


def arm_of(path: Path, joints_only: bool) -> FlexibleRobot:
    from rcsa_ident.io.settings.robots import read_robot
    from rcsa_ident.machine.robot.flexible import FlexibleRobot

    found = posterior_of(path, joints_only)
    return FlexibleRobot(read_robot(path), tilts=not joints_only) if found is None else found.arm


def posterior_of(path: Path, joints_only: bool) -> RobotPosterior | None:
    """What cuts have told of a robot, where the file is RESULT.json."""
    if path.suffix.lower() != ".json":
        return None
    from rcsa_ident.io.results.robot_results import read_robot_result

    if joints_only:
        raise InputError("--joints-only", str(path), "ROBOT.toml: cuts have told all springs together")
    return read_robot_result(path)


def is_robot(path: Path) -> bool:
    """Return whether a file describes an arm: ROBOT.toml, or RESULT.json of one."""
    from rcsa_ident.io.results.parts import read_json
    from rcsa_ident.io.results.robot_results import KIND

    kind = path.suffix.lower()
    return kind == ".toml" or (kind == ".json" and read_json(path, "machine").get("kind") == KIND)


def posed_robot(path: Path, posture: str, joints_only: bool) -> PosedRobot:
    """Return an arm of a file at a posture that an option names."""
    from rcsa_ident.machine.robot.posed_robot import PosedRobot

    found = posterior_of(path, joints_only)
    if found is not None:
        return found.at(joint_angles(posture, found.arm))
    arm = arm_of(path, joints_only)
    return PosedRobot(arm, joint_angles(posture, arm))


def joint_angles(text: str, arm: FlexibleRobot) -> FloatArray:
    """The posture of an option, in radians."""
    import numpy as np

    count = len(arm.model.joints)
    try:
        found = [float(part) for part in text.replace(",", " ").split()]
    except ValueError:
        found = []
    if len(found) != count or not all(math.isfinite(each) for each in found):
        raise InputError("--posture", text, f"{count} angles with blanks between, one a joint [°]")
    if max(abs(each) for each in found) > 720.0:
        raise InputError("--posture", text, "angles within two turns [°]")
    return np.radians(found)


#: By their names on the command line.
COMMANDS: dict[str, Any] = {"check": check, "tip": tip, "lobes": lobes, "map": map_, "draw": draw, "import": import_}
