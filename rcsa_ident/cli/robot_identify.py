"""robot identify: the springs of an arm, and the spindle in its hand, from what was measured on it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any

import typer

from rcsa_ident.base.errors import InputError
from rcsa_ident.cli.common import NOT_CONVERGED, Json, Seed, Stages, answers, emit, say, warn, writable
from rcsa_ident.cli.identify import read_and_judge
from rcsa_ident.cli.processes import Dask, Processes, workers_or_cluster
from rcsa_ident.cli.robot import RobotFile
from rcsa_ident.identification.status import Status


@answers
def identify(
    robot: RobotFile,
    records: Annotated[
        list[Path],
        typer.Argument(
            help="A campaign directory of cuts at several postures; or motions with both encoders and the motors' torques, RECORD.mat or "
            "RECORD.csv; or forces and how far they push the standing arm, TESTS.csv. One or more of the latter two.",
            show_default=False,
        ),
    ],
    out: Annotated[
        Path,
        typer.Option(
            help="ROBOT.toml to write, with what was found; from cuts RESULT.json, or ROBOT.toml without the spindle's modes.",
            show_default=False,
        ),
    ],
    check: Annotated[
        list[Path] | None,
        typer.Option(
            help="Another motion or table of tests: how much of its motor-minus-joint angles or displacements is explained. As often as "
            "wanted.",
            show_default=False,
        ),
    ] = None,
    seed: Seed = 1,
    processes: Processes = None,
    dask: Dask = None,
    json_: Json = False,
) -> None:
    """Find the springs of an arm from stable cuts at a few postures, from encoders on both sides of its gears, or from static tests.

    The file's stiffness is believed to about its own size. Cuts tell springs, dampers and the spindle in the hand: RESULT.json takes the
    place of ROBOT.toml in `tip`, `lobes`, `map` and `check` then, at any posture, with bands. A joint whose motions do not tell keeps
    the file's stiffness; static tests tell the springs across the axes and the play, too.
    """
    from rcsa_ident.io.settings.robot_static import is_static

    writable(out)
    folders = [path for path in records if path.is_dir()]
    if folders:
        if len(records) > 1:
            raise InputError("records", f"{folders[0]} beside others", "one campaign directory alone")
        if check:
            raise InputError("--check", str(check[0]), "motions or static tests: cuts are checked against each other")
        _from_cuts(robot, folders[0], out, seed, processes, dask, json_)
        return
    static = [path for path in records if is_static(path)]
    if static and len(static) < len(records):
        raise InputError("records", f"{static[0].name} beside others", "motions alone, or static tests alone")
    (_from_tests if static else _from_encoders)(robot, records, out, check or [], json_)


def _from_cuts(robot: Path, folder: Path, out: Path, seed: int, processes: int | None, dask: str | None, json_: bool) -> None:
    """What stable cuts at several postures tell."""
    from rcsa_ident.io.files import write_text
    from rcsa_ident.io.results.robot_results import robot_result_to_json, write_robot_result
    from rcsa_ident.io.settings.robots import read_robot, robot_keys
    from rcsa_ident.io.toml_text import toml_of
    from rcsa_ident.machine.robot.flexible import FlexibleRobot
    from rcsa_ident.workflows.identify import left_out
    from rcsa_ident.workflows.identify_robot import identify_robot

    arm, stages = FlexibleRobot(read_robot(robot)), Stages(quiet=json_)
    with workers_or_cluster(processes, dask) as pool:
        campaign, readings = read_and_judge(folder, pool, stages)
        with stages.stage("identification") as line:
            found = identify_robot(campaign, readings, arm, seed, pool.map, lambda stage, cost, _: line.tell("both", str(stage), cost))
    unused = left_out(readings)
    if out.suffix.lower() == ".toml":
        write_text(
            out, toml_of(robot_keys(found.posterior.arm.model), [f"springs, dampers and masses from cuts of {campaign.name}"], digits=6)
        )
    else:
        write_robot_result(out, found, campaign.name, unused)
    if json_:
        data = robot_result_to_json(found, campaign.name, unused)
        kept = ("status", "reasons", "notes", "seed", "campaign", "band_hz", "misfit", "springs", "masses", "spindle")
        emit({key: data[key] for key in kept} | {"seconds": stages.seconds, "result": str(out)})
    else:
        from rcsa_ident.cli.tables import show_identified_robot

        show_identified_robot(found)
        shares = " and ".join(f"{100.0 * share:.2g} %" for share in found.model_error)
        say(f"{shares} of each line of X and of Y are left unexplained")
        for id, reason in unused:
            warn(f"{id} left out: {reason}")
        for note in found.notes:
            say(f"note: {note}")
        say(", ".join(f"{name} {seconds:.1f} s" for name, seconds in stages.seconds.items()))
        say(f"written: {out}")
    for reason in found.reasons:
        warn(f"the result is {found.status}: {reason}")
    if found.status not in (Status.CONVERGED, Status.NOT_VALIDATED):
        raise typer.Exit(NOT_CONVERGED)


def _from_encoders(robot: Path, records: Sequence[Path], out: Path, check: Sequence[Path], json_: bool) -> None:
    """What motions tell, with encoders on both sides of the gears."""
    import numpy as np

    from rcsa_ident.identification.arm.joints import fit_joints
    from rcsa_ident.io.files import write_text
    from rcsa_ident.io.recordings.robot_records import read_joint_record
    from rcsa_ident.io.settings.robots import read_robot, robot_keys
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


def _from_tests(robot: Path, records: Sequence[Path], out: Path, check: Sequence[Path], json_: bool) -> None:
    """What forces tell that push the standing arm."""
    from rcsa_ident.identification.arm.static import fit_static
    from rcsa_ident.io.files import write_text
    from rcsa_ident.io.settings.robot_static import read_static_tests
    from rcsa_ident.io.settings.robots import read_robot, robot_keys
    from rcsa_ident.io.toml_text import toml_of

    arm = read_robot(robot)
    count = len(arm.joints)
    tests, others = ([read_static_tests(path, count) for path in paths] for paths in (records, check))
    stages = Stages(quiet=json_)
    with stages.stage("springs"):
        found = fit_static(arm, tests)
    write_text(out, toml_of(robot_keys(found.robot), [f"springs from {', '.join(path.name for path in records)}"], digits=6))
    names, explained = arm.spring_names(), {each.name: found.explained(each) for each in [*tests, *others]}
    together = [[names[i] for i in group] for group in found.together]
    grouped = {name for group in together for name in group}
    alone = [name for name, told in zip(names, found.told, strict=True) if not told and name not in grouped]
    warnings = [f"{' and '.join(group)}: the tests tell a sum of their compliances and neither by itself" for group in together]
    if alone:
        warnings.append(f"{', '.join(alone)}: the tests do not tell {'them' if len(alone) > 1 else 'it'} from rigid")
    if not arm.weighed:
        warnings.append("no masses are known: play is taken as if no weight held the joints on one side of it")
    if json_:
        springs = arm.freedoms()
        emit(
            {
                "springs": list(names),
                "stiffness_nm_per_rad": found.robot.chain().stiffness.tolist(),
                "stiffness_sd_percent": (100.0 * found.share).tolist(),
                "told": found.told.tolist(),
                "told_together": together,
                "joints": [joint.name for joint in arm.joints],
                "backlash_rad": [joint.backlash for joint in found.robot.joints],
                "backlash_sd_rad": found.deviation[springs:].tolist(),
                "noise_mm": 1e3 * found.noise[0],
                "noise_mrad": 1e3 * found.noise[1],
                "zero_mm": 1e3 * found.noise[0] * found.zero,
                "explained": explained,
                "warnings": warnings,
                "seconds": stages.seconds,
                "out": str(out),
            }
        )
        return
    from rcsa_ident.cli.tables import show_springs

    show_springs(names, found)
    say(f"readings scatter by {1e3 * found.noise[0]:.3f} mm, zeros by {1e3 * found.noise[0] * found.zero:.3f} mm")
    for name, share in explained.items():
        say(f"{name}: {100.0 * share:.2f} % of the squared displacements are explained")
    for warning in warnings:
        warn(warning)
    say(f"written: {out} ({stages.seconds['springs']:.2f} s)")


#: By their names on the command line.
COMMANDS: dict[str, Any] = {"identify": identify}
