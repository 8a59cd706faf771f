"""path compensate: a path of the same form that makes up for what a machine or an arm gives way under its forces."""

from __future__ import annotations

import inspect
import math
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from rcsa_ident.base.errors import InputError, positive
from rcsa_ident.cli.common import Json, Seed, Stages, answers, emit, say, warn, writable
from rcsa_ident.cli.lobes import ToolingFile
from rcsa_ident.cli.robot import is_robot

if TYPE_CHECKING:
    from rcsa_ident.setup.tooling import Tooling
    from rcsa_ident.toolpath.blending import Controller
    from rcsa_ident.toolpath.compensation import CompensatedPath
    from rcsa_ident.toolpath.deviation import Deviation
    from rcsa_ident.toolpath.forces import ForceAlongPath
    from rcsa_ident.toolpath.path import ToolPath

#: Shares of the draws between which a band lies.
_BAND = (5.0, 95.0)
#: How far forces may end from the path's end without a word, as a share of its time.
_SAME_TIME = 0.02
#: Parameters that a machine has no joints and drives for, and their options.
_OF_ARMS = {
    "posture": "--posture",
    "joints": "--joints",
    "method": "--method",
    "passes": "--passes",
    "blend": "--blend-ms",
    "lag": "--lag-ms",
    "weight": "--no-weight",
    "joints_only": "--joints-only",
}


class MethodName(StrEnum):
    """How a path is compensated."""

    ideal_force = "ideal-force"
    mirror = "mirror"


class ForceAxes(StrEnum):
    """In which axes a steady force stands."""

    base = "base"
    path = "path"


@answers
def compensate(
    machine: Annotated[
        Path,
        typer.Argument(
            help="ROBOT.toml of an arm, or RESULT.json of one as cuts have told it; or RESULT.json or FLANGE.csv of a machine.",
            show_default=False,
        ),
    ],
    tooling: ToolingFile,
    path: Annotated[Path, typer.Argument(help="PATH.nc (G-code) or PATH.csv of the tool's tip, in the base's axes.", show_default=False)],
    forces: Annotated[
        str,
        typer.Option(
            metavar="FORCES.csv|'FX FY FZ'",
            help="On the tool, N: time_s, force_x_n, force_y_n, force_z_n along the path; or three that are the same on all moves.",
            show_default=False,
        ),
    ],
    out: Annotated[Path, typer.Option(help="PATH to write, .nc or .csv.", show_default=False)],
    posture: Annotated[
        str | None,
        typer.Option(metavar="'Q1 Q2 ...'", help="Of an arm: angles near those of the first place, degrees.", show_default=False),
    ] = None,
    method: Annotated[
        MethodName,
        typer.Option(
            help="Of an arm: springs answer the torques of the ideal motion, or the simulated deviation is taken off; of a machine, always."
        ),
    ] = MethodName.ideal_force,
    passes: Annotated[int, typer.Option(help="Times that mirror simulates and takes off.", min=1, max=20)] = 1,
    force_axes: Annotated[
        ForceAxes, typer.Option(help="Of three steady forces: the base's, or along the feed, to its left, and along the tool.")
    ] = ForceAxes.base,
    cutoff: Annotated[float, typer.Option("--cutoff-hz", help="Forces that change faster are left aside.")] = 100.0,
    spacing: Annotated[float, typer.Option("--spacing-mm", help="Longest move at a feed in the path that is written.")] = 1.0,
    largest: Annotated[float, typer.Option("--largest-mm", help="Largest correction of a place; where it is too little is told.")] = 2.0,
    blend: Annotated[float, typer.Option("--blend-ms", help="Time in which an arm's controller turns from a move into the next.")] = 100.0,
    lag: Annotated[
        float | None, typer.Option("--lag-ms", help="Time by which its drives come late instead, as a first-order lag.", show_default=False)
    ] = None,
    weight: Annotated[bool, typer.Option("--weight/--no-weight", help="Whether the arm's weight holds the play of its joints.")] = True,
    joints_only: Annotated[bool, typer.Option("--joints-only", help="Leave the springs across an arm's joints out.")] = False,
    joints: Annotated[
        Path | None, typer.Option(help="JOINTS.csv to write: an arm's angles over the path's time.", show_default=False)
    ] = None,
    decimals: Annotated[int, typer.Option(help="Of the millimetres in a written program.", min=3, max=9)] = 4,
    draws: Annotated[int, typer.Option(help="Machines that the posterior of RESULT.json allows, on which the path is tried.", min=0)] = 20,
    seed: Seed = 0,
    json_: Json = False,
) -> None:
    """Correct a path so that the tool cuts where it should though arm or machine give way, and tell what is left and where it ends."""
    from rcsa_ident.io.paths.gcode import kept_words
    from rcsa_ident.io.paths.path_forces import write_joints
    from rcsa_ident.io.paths.tool_paths import PROGRAMS, check_path_name, read_tool_path, write_tool_path
    from rcsa_ident.io.settings.setups import read_tooling

    writable(out)
    check_path_name(out)
    told = read_tool_path(path)
    along = told.resampled(1e-3 * positive("--spacing-mm", spacing, "mm"), rapid=False)
    force = _forces(forces, told, force_axes).low_passed(positive("--cutoff-hz", cutoff, "Hz"))
    most, tool = 1e-3 * positive("--largest-mm", largest, "mm"), read_tooling(tooling)
    stages, arm = Stages(quiet=json_), is_robot(machine)
    if not arm:
        _refuse_joints(
            posture=posture, joints=joints, method=method, passes=passes, blend=blend, lag=lag, weight=weight, joints_only=joints_only
        )
    if joints is not None:
        writable(joints, "--joints")
    warnings = [*told.remarks, *_other_times(force, told)]
    with stages.stage("compensation"):
        if arm:
            if posture is None:
                raise InputError("--posture", "nothing", "the arm's angles near the first place")
            controller = _controller(blend, lag)
            found, said = _on_arm(
                machine, tool, along, force, posture, (method, passes), controller, weight, joints_only, most, draws, seed
            )
        else:
            found, said = _on_machine(machine, tool, along, force, most, draws, seed)
        warnings += said
    kept, led = kept_words(path) if path.suffix.lower() in PROGRAMS else ([], [])
    if led:
        lines = ", ".join(map(str, led[:5])) + (f" and {len(led) - 5} further" if len(led) > 5 else "")
        height = 1e3 * told.places[:, 2].max()
        warnings.append(
            f"G28, G30 or G53 in line {lines}: nobody knows where they lead; Z stands at {height:g} mm from there on, its highest, "
            "X and Y where they were, until they are told next"
        )
    write_tool_path(out, found.path, decimals, kept)
    if joints is not None and found.postures is not None:
        write_joints(joints, along.times, found.postures)
    used = method if arm else MethodName.mirror
    _tell(found, along, warnings, {"method": str(used), "seconds": stages.seconds, "out": str(out)}, joints, json_)


def _refuse_joints(**given: Any) -> None:
    """Refuse what was said of an arm, of parameters by their names, beside a machine."""
    defaults = inspect.signature(compensate).parameters
    for name, value in given.items():
        if value != defaults[name].default:
            raise InputError(_OF_ARMS[name], str(value), "an arm: a machine has no joints to turn, its deviation at rest is mirrored")


def _controller(blend: float, lag: float | None) -> Controller:
    from rcsa_ident.toolpath.blending import FirstOrderLag, QuadraticBlend

    if lag is not None:
        return FirstOrderLag(1e-3 * positive("--lag-ms", lag, "ms"))
    return QuadraticBlend(1e-3 * positive("--blend-ms", blend, "ms"))


def _forces(text: str, path: ToolPath, axes: ForceAxes) -> ForceAlongPath:
    import numpy as np

    from rcsa_ident.io.paths.path_forces import read_path_forces
    from rcsa_ident.toolpath.forces import on_all_moves

    if text.lower().endswith(".csv"):
        if axes is ForceAxes.path:
            raise InputError("--force-axes", "path", "base, with FORCES.csv: its forces stand in the base's axes")
        return read_path_forces(text, path)
    try:
        steady = [float(part) for part in text.replace(",", " ").split()]
    except ValueError:
        steady = []
    if len(steady) != 3 or not all(math.isfinite(each) for each in steady):
        raise InputError("--forces", text, "FORCES.csv, or three forces with blanks between [N]")
    return on_all_moves(path, np.array(steady), axes is ForceAxes.path)


def _other_times(force: ForceAlongPath, path: ToolPath) -> list[str]:
    """What speaks against forces of another time, in words."""
    last, taken = float(force.time[-1]), float(path.times[-1])
    if force.time.size < 2 or abs(last - taken) <= _SAME_TIME * taken:
        return []
    return [f"the forces end at {last:.2f} s, the path at {taken:.2f} s; beyond their ends they are held"]


def _on_arm(
    machine: Path,
    tool: Tooling,
    along: ToolPath,
    force: ForceAlongPath,
    posture: str,
    method: tuple[MethodName, int],
    controller: Controller,
    weight: bool,
    joints_only: bool,
    largest: float,
    draws: int,
    seed: int,
) -> tuple[CompensatedPath, list[str]]:
    import numpy as np

    from rcsa_ident.cli.robot import arm_of, joint_angles, posterior_of
    from rcsa_ident.workflows.paths.robot import IdealForce, Mirror, RobotPath, compensate

    posterior = posterior_of(machine, joints_only)
    robot = arm_of(machine, joints_only) if posterior is None else posterior.arm
    others = () if posterior is None or not draws else posterior.draws(draws, np.random.default_rng(seed))
    task = RobotPath(robot, joint_angles(posture, robot), tool.assembly, along, force, controller, weight)
    name, passes = method
    found = compensate(task, IdealForce() if name is MethodName.ideal_force else Mirror(passes), largest, others)
    said = list(robot.model.warnings)
    if not robot.model.weighed:
        said.append("no masses of the arm are known: it is taken to rest at every place, without weight and inertia")
    loose = found.loose
    if loose is not None and np.any(loose > 0.0):
        count, most = int(np.sum(loose > 0.0)), 1e3 * float(np.max(loose))
        said.append(f"at {count} places no torque holds the play of some joint on one side: the tool may be up to {most:.3f} mm off there")
    return found, said


def _on_machine(
    machine: Path, tool: Tooling, along: ToolPath, force: ForceAlongPath, largest: float, draws: int, seed: int
) -> tuple[CompensatedPath, list[str]]:
    import numpy as np

    from rcsa_ident.cli.results import read_machine
    from rcsa_ident.workflows.paths.machine import compensate_machine, compliance_at_rest

    known = read_machine(machine)
    compliance, others = compliance_at_rest(known, tool, draws, np.random.default_rng(seed))
    said = list(known.remarks)
    rigid = [axis for axis, value in zip("XYZ", np.diag(compliance), strict=True) if value == 0.0]
    if rigid:
        said.append(f"nothing is known of how far the tool gives way along {' and '.join(rigid)}: taken for rigid, not corrected")
    return compensate_machine(along, force, compliance, others, largest), said


def _sizes(deviation: Deviation) -> dict[str, float]:
    return {
        "straight_rms_mm": 1e3 * deviation.rms,
        "straight_largest_mm": 1e3 * deviation.largest,
        "corner_mm": 1e3 * deviation.corner,
    }


def _tell(found: CompensatedPath, along: ToolPath, warnings: list[str], about: dict[str, Any], joints: Path | None, json_: bool) -> None:
    import numpy as np

    size = 1e3 * np.linalg.norm(found.correction, axis=1)
    bands = None
    if found.draws:
        low, high = np.percentile([1e3 * each.rms for each in found.draws], _BAND)
        bands = {"draws": len(found.draws), "straight_rms_mm": [float(low), float(high)]}
    ended = [{"place": k + 1, "line": int(along.line[k]), "status": str(found.became[k])} for k in found.limited]
    if ended:
        warnings = [*warnings, f"{len(ended)} of {len(along)} places are not corrected as asked, the first in line {ended[0]['line']}"]
    if json_:
        emit(
            {
                "status": "limited" if ended else "compensated",
                "places": len(along),
                "limited": ended,
                "largest_correction_mm": float(size.max()),
                "before": _sizes(found.before),
                "after": _sizes(found.after),
                "controller": _sizes(found.controller),
                "band": bands,
                "warnings": warnings,
                **about,
                "joints": None if joints is None else str(joints),
            }
        )
        return
    say(f"straight moves, rms: {1e3 * found.before.rms:.4f} mm as it was, {1e3 * found.after.rms:.4f} mm compensated")
    if bands is not None:
        low, high = bands["straight_rms_mm"]  # type: ignore[misc]
        say(f"what is known of the machine allows {low:.4f} to {high:.4f} mm ({bands['draws']} draws)")
    if found.controller.corner:
        alone, left = (1e3 * each.corner for each in (found.controller, found.after))
        say(f"corners: {left:.3f} mm are left; the controller's own blending leaves {alone:.3f} mm")
    say(f"largest correction: {size.max():.3f} mm")
    for status in dict.fromkeys(each["status"] for each in ended):
        own = [each for each in ended if each["status"] == status]
        say(f"{status}: {len(own)} places, the first is {own[0]['place']} in line {own[0]['line']}")
    for text in warnings:
        warn(text)
    say(f"written: {about['out']} ({len(along)} places, {about['seconds']['compensation']:.2f} s)")


#: By its name on the command line.
COMMANDS: dict[str, Any] = {"compensate": compensate}
