"""robot plan: the postures at which measurements tell most of an arm."""

from __future__ import annotations

import math
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from rcsa_ident.base.errors import InputError
from rcsa_ident.cli.common import Json, Seed, Stages, answers, emit, say, warn, writable
from rcsa_ident.cli.robot import RobotFile

if TYPE_CHECKING:
    from rcsa_ident.base.arrays import FloatArray

#: Share of what is believed that a doubt keeps where nothing tells of it.
_UNTOLD = 0.95


class TestsName(StrEnum):
    """What is measured at the postures, by name."""

    static = "static"
    cuts = "cuts"
    modes = "modes"
    encoders = "encoders"
    payload = "payload"


@answers
def plan(
    robot: RobotFile,
    out: Annotated[Path, typer.Option(help="POSTURES.csv to write: q1_deg, q2_deg, ... as TESTS.csv has them.", show_default=False)],
    count: Annotated[int, typer.Option(min=1, max=100, help="Number of postures.")] = 6,
    tests: Annotated[
        TestsName,
        typer.Option(
            help="static: forces and displacements of the tool, for all springs and plays; cuts: slow stable cuts, for springs, dampers "
            "and masses; modes: natural frequencies from "
            "taps, for all springs; encoders: twist of the drives under the arm's "
            "weight, for their stiffness; payload: the same, for the payload's mass."
        ),
    ] = TestsName.static,
    box: Annotated[
        str | None,
        typer.Option(
            metavar="'X0 Y0 Z0 X1 Y1 Z1'",
            help="Lowest and highest place of the tool point in the base's axes, mm; default: wherever the joints' limits allow.",
            show_default=False,
        ),
    ] = None,
    candidates: Annotated[
        str, typer.Option(metavar="NUMBER|POSTURES.csv", help="Postures that are drawn and moved on, or a table to choose from.")
    ] = "200",
    force_n: Annotated[float, typer.Option(help="Largest force of a static test, N.")] = 1000.0,
    noise_mm: Annotated[float, typer.Option(help="Scatter of a displacement, mm.")] = 0.06,
    frequency_noise_percent: Annotated[float, typer.Option(help="Scatter of a natural frequency, %.")] = 0.5,
    cut_noise_percent: Annotated[float, typer.Option(help="Share of a cut's lines that nothing explains, %.")] = 0.5,
    encoder_noise_urad: Annotated[float, typer.Option(help="Scatter of a joint's encoder, µrad.")] = 1.0,
    seed: Seed = 0,
    json_: Json = False,
) -> None:
    """Choose the postures at which tests tell most of an arm: the smallest volume of what is left open (D-optimal)."""
    import numpy as np

    from rcsa_ident.identification.arm import design as robot_design
    from rcsa_ident.io.settings.postures import read_postures, write_postures
    from rcsa_ident.io.settings.robots import read_robot
    from rcsa_ident.machine.robot.kinematics import tool_point_at

    writable(out)
    arm = read_robot(robot)
    if tests is TestsName.static:
        experiment = robot_design.static_tests(arm, force_n, 1e-3 * noise_mm)
    elif tests is TestsName.cuts:
        experiment = robot_design.stable_cuts(arm, 1e-2 * cut_noise_percent)
    elif tests is TestsName.modes:
        experiment = robot_design.natural_frequencies(arm, 1e-2 * frequency_noise_percent)
    elif tests is TestsName.encoders:
        experiment = robot_design.encoders_at_rest(arm, 1e-6 * encoder_noise_urad)
    else:
        experiment = robot_design.payload_mass(arm, 1e-6 * encoder_noise_urad)
    reach = robot_design.Reach(arm, None if box is None else _box(box))
    stages = Stages(quiet=json_)
    with stages.stage("postures"):
        if candidates.isdecimal():
            found = robot_design.plan_postures(experiment, reach, count, int(candidates), seed)
        else:
            given = read_postures(candidates, arm)
            within = np.array([reach.holds(each) for each in given])
            if not within.any():
                raise InputError("--box", box, "a box with one of the given postures' tools in it", candidates)
            found = robot_design.best_of(experiment, given[within], count)
    write_postures(out, found.postures, arm)
    before, after = found.deviations
    untold = [name for name, one, other in zip(experiment.unknowns, before, after, strict=True) if other > _UNTOLD * one]
    warnings = [f"{', '.join(untold)}: these tests tell nothing of {'them' if len(untold) > 1 else 'it'}"] if untold else []
    if box is None:
        warnings.append("no --box is given: see that neither arm nor tool meets the floor or the cell")
    if json_:
        emit(
            {
                "postures_deg": np.degrees(found.postures).tolist(),
                "tool_points_m": [tool_point_at(arm, each).offset.tolist() for each in found.postures],
                "unknowns": list(experiment.unknowns),
                "sd_before": before.tolist(),
                "sd_after": after.tolist(),
                "information": np.sum(found.information, axis=0).tolist(),
                "gain_nat": found.gain,
                "warnings": warnings,
                "seconds": stages.seconds,
                "out": str(out),
            }
        )
        return
    from rcsa_ident.cli.tables import show_planned_postures

    places = np.array([tool_point_at(arm, each).offset for each in found.postures])
    show_planned_postures(found.postures, places, experiment.unknowns, after / before)
    for warning in warnings:
        warn(warning)
    say(f"written: {out} ({len(found.postures)} postures, {stages.seconds['postures']:.1f} s)")


def _box(text: str) -> tuple[FloatArray, FloatArray]:
    """The corners of a box, in metres."""
    import numpy as np

    try:
        found = [float(part) for part in text.replace(",", " ").split()]
    except ValueError:
        found = []
    if len(found) != 6 or not all(math.isfinite(each) for each in found):
        raise InputError("--box", text, "six lengths with blanks between: x, y, z of the lowest corner, then of the highest [mm]")
    return 1e-3 * np.array(found[:3]), 1e-3 * np.array(found[3:])


#: By their names on the command line.
COMMANDS: dict[str, Any] = {"plan": plan}
