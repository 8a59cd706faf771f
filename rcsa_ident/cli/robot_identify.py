"""robot identify: the stiffness of an arm's joints from what was measured on it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Annotated

import typer

from rcsa_ident.cli.common import Json, Stages, answers, emit, say, warn, writable
from rcsa_ident.cli.robot import RobotFile
from rcsa_ident.errors import InputError


@answers
def identify(
    robot: RobotFile,
    records: Annotated[
        list[Path],
        typer.Argument(
            help="Motions with both encoders and the motors' torques: RECORD.mat or RECORD.csv, one or more.", show_default=False
        ),
    ],
    out: Annotated[Path, typer.Option(help="ROBOT.toml to write, with the stiffnesses that were found.", show_default=False)],
    check: Annotated[
        list[Path] | None,
        typer.Option(help="Another motion: how much of its motor-minus-joint angles is explained. As often as wanted.", show_default=False),
    ] = None,
    json_: Json = False,
) -> None:
    """Find the stiffness of an arm's joints from encoders on both sides of the gears while it moves.

    The file's stiffness is believed to its own size. A joint whose records do not tell keeps it.
    """
    writable(out)
    folders = [path for path in records if path.is_dir()]
    if folders:
        raise InputError("records", str(folders[0]), "files of a moving arm: stiffness from cuts is not there yet")
    _from_encoders(robot, records, out, check or [], json_)


def _from_encoders(robot: Path, records: Sequence[Path], out: Path, check: Sequence[Path], json_: bool) -> None:
    """What motions tell, with encoders on both sides of the gears."""
    import numpy as np

    from rcsa_ident.identification.robot_joints import fit_joints
    from rcsa_ident.io.files import write_text
    from rcsa_ident.io.robot_records import read_joint_record
    from rcsa_ident.io.robots import read_robot, robot_keys
    from rcsa_ident.io.toml_text import toml_of

    arm = read_robot(robot)
    motions, others = [read_joint_record(path) for path in records], [read_joint_record(path) for path in check]
    stages = Stages(quiet=json_)
    with stages.stage("joints"):
        found = fit_joints(arm, motions)
    changed = [replace(each, stiffness=float(found.stiffness[i])) if found.told[i] else each for i, each in enumerate(arm.joints)]
    names = ", ".join(path.name for path in records)
    write_text(out, toml_of(robot_keys(replace(arm, joints=tuple(changed))), [f"joints from {names}"], digits=6))
    explained = {each.name: found.explained(each) for each in [*motions, *others]}
    why = {True: "its motor turns other joints, too", False: "the records do not tell it from a rigid one"}
    warnings = [
        f"{joint.name}: {why[bool(np.isnan(found.lost_motion[i]))]}; its stiffness is left at {joint.stiffness:.3g} N m/rad"
        for i, joint in enumerate(arm.joints)
        if not found.told[i]
    ]
    if json_:
        emit(
            {
                "joints": [joint.name for joint in arm.joints],
                "stiffness_nm_per_rad": found.stiffness.tolist(),
                "stiffness_sd_percent": (100.0 * found.stiffness_share).tolist(),
                "lost_motion_rad": found.lost_motion.tolist(),
                "coulomb_friction_nm": found.coulomb.tolist(),
                "viscous_friction_nms_per_rad": found.viscous.tolist(),
                "delay_ms": 1e3 * found.delay,
                "delay_sd_ms": 1e3 * found.delay_spread,
                "explained": {name: share.tolist() for name, share in explained.items()},
                "warnings": warnings,
                "seconds": stages.seconds,
                "out": str(out),
            }
        )
        return
    from rcsa_ident.cli.tables import show_joints

    show_joints([joint.name for joint in arm.joints], found, explained)
    say(f"the links' encoders are read {1e3 * found.delay:.2f} ± {1e3 * found.delay_spread:.2f} ms after the motors'")
    for warning in warnings:
        warn(warning)
    say(f"written: {out} ({stages.seconds['joints']:.2f} s)")
