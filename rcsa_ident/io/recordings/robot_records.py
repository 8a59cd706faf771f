"""Records of a robot's encoders and torques: MAT-files, and CSV.

A MAT-file has a struct ``rec`` with ``act_pos_mot_deg``, ``act_pos_se_deg`` (motor's and link's angle of each joint, a row each) and
``act_torque_abs_nm`` (of the motors), and ``para`` with ``u`` (gear ratios) and ``J_mr`` (the motors' inertia). A CSV has columns
``time_s``, ``motor_1_deg``, ``joint_1_deg``, ``torque_1_nm`` and so on, the torque at the joint: the motor's times the gear ratio.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from rcsa_ident.base.arrays import FloatArray
from rcsa_ident.base.errors import InputError
from rcsa_ident.identification.arm.joints import JointRecord
from rcsa_ident.io.recordings.matlab import tables_of
from rcsa_ident.io.text_columns import read_table

_MOTOR, _JOINT, _TORQUE = "rec.act_pos_mot_deg", "rec.act_pos_se_deg", "rec.act_torque_abs_nm"
_TIME, _RATIO, _INERTIA = "rec.time_cont", "para.u", "para.J_mr"
#: How far two time steps may differ, as a share.
_EVEN = 1e-3


def read_joint_record(path: str | Path) -> JointRecord:
    """Return a motion of a robot's joints. Raises `InputError`, which names the file, and the field or column that is missing or wrong."""
    path = Path(path)
    return _from_matlab(path) if path.suffix.lower() == ".mat" else _from_text(path)


def _from_matlab(path: Path) -> JointRecord:
    with tables_of(path) as tables:
        motor, joint, torque = (tables.table(name) for name in (_MOTOR, _JOINT, _TORQUE))
        time, ratio, inertia = (tables.table(name).ravel() for name in (_TIME, _RATIO, _INERTIA))
    if len(motor) != ratio.size:
        # rows and columns the other way around
        motor, joint, torque = motor.T, joint.T, torque.T
    if not len(motor) == ratio.size == inertia.size:
        raise InputError(_RATIO, f"{ratio.size} gear ratios", f"one a joint, of which there are {len(motor)}", str(path))
    shapes = {name: values.shape for name, values in ((_MOTOR, motor), (_JOINT, joint), (_TORQUE, torque))}
    if set(shapes.values()) != {(len(motor), time.size)}:
        found = ", ".join(f"{name} {rows} x {columns}" for name, (rows, columns) in shapes.items())
        raise InputError("record", found, f"one row a joint and {time.size} columns each, as {_TIME} has instants", str(path))
    ratios = ratio[:, None]
    return JointRecord(path.name, _step(time, path), np.radians(motor), np.radians(joint), torque * ratios, inertia * ratio**2)


def _from_text(path: Path) -> JointRecord:
    table = read_table(path, "robot record")
    count = sum(name.startswith("motor_") for name in table.header)
    names = [f"{what}_{k}_{unit}" for what, unit in (("motor", "deg"), ("joint", "deg"), ("torque", "nm")) for k in range(1, count + 1)]
    # without a joint the first one's columns are asked for
    table.check_header(("time_s", *names) if count else ("time_s", "motor_1_deg"), "time_s, and motor_1_deg, joint_1_deg, torque_1_nm, ...")
    time, *rows = table.columns(("time_s", *names))
    values = np.array(rows).reshape(3, count, -1)
    if not np.all(np.isfinite(values)):
        bad = names[int(np.argwhere(~np.isfinite(values.reshape(3 * count, -1)))[0][0])]
        raise InputError(f"column {bad}", "an empty cell or no number", "finite numbers", str(path))
    return JointRecord(path.name, _step(time, path), np.radians(values[0]), np.radians(values[1]), values[2], np.zeros(count))


def _step(time: FloatArray, path: Path) -> float:
    steps = np.diff(time)
    if time.size < 2 or not np.all(np.isfinite(time)) or np.ptp(steps) > _EVEN * abs(steps[0]) or steps[0] <= 0.0:
        raise InputError("time of the record", f"{time.size} instants", "even steps that rise [s]", str(path))
    return float(np.mean(steps))
