"""Records of a robot's joints: MAT-files as a research group writes them, CSV, and what is wrong with them."""

import numpy as np
import pytest
from scipy.io import savemat

from rcsa_ident.base.errors import InputError
from rcsa_ident.io.recordings.robot_records import read_joint_record


@pytest.fixture
def motion():
    t = np.arange(600) * 4e-3
    motor = np.degrees(np.stack([np.sin(t + k) for k in range(3)]))
    return t, motor, motor - 0.01, np.cos(motor)


def structs(t, motor, joint, torque):
    rec = {"time_cont": t, "act_pos_mot_deg": motor, "act_pos_se_deg": joint, "act_torque_abs_nm": torque, "ref": {"a": 1.0}}
    return {"rec": rec, "para": {"u": np.array([257.0, 267.0, 252.0]), "J_mr": np.array([0.01, 0.02, 0.03]), "name": "K"}}


def test_mat_and_csv_say_the_same(motion, tmp_path):
    t, motor, joint, torque = motion
    savemat(tmp_path / "r.mat", structs(*motion), do_compression=True)
    ratio = np.array([257.0, 267.0, 252.0])
    columns = {"time_s": t}
    for what, unit, rows in (("motor", "deg", motor), ("joint", "deg", joint), ("torque", "nm", torque * ratio[:, None])):
        columns |= {f"{what}_{k + 1}_{unit}": row for k, row in enumerate(rows)}
    text = ",".join(columns) + "\n" + "\n".join(",".join(repr(float(v)) for v in row) for row in np.array([*columns.values()]).T)
    (tmp_path / "r.csv").write_text(text)
    one, other = (read_joint_record(tmp_path / name) for name in ("r.mat", "r.csv"))
    assert one.step == other.step == pytest.approx(4e-3)
    np.testing.assert_allclose(one.motor, np.radians(motor), rtol=1e-12)
    for name in ("motor", "joint", "torque"):
        np.testing.assert_allclose(getattr(one, name), getattr(other, name), rtol=1e-12)
    np.testing.assert_allclose(one.motor_inertia, [0.01, 0.02, 0.03] * ratio**2)
    np.testing.assert_array_equal(other.motor_inertia, 0.0)


def test_rows_and_columns_may_change_places(motion, tmp_path):
    t, *rows = motion
    savemat(tmp_path / "r.mat", structs(t, *(row.T for row in rows)))
    np.testing.assert_allclose(read_joint_record(tmp_path / "r.mat").motor, np.radians(rows[0]), rtol=1e-12)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda d: d["rec"].pop("act_pos_se_deg"), "act_pos_se_deg"),
        (lambda d: d["para"].update(u=np.array([257.0, 267.0])), "para.u"),
        (lambda d: d["rec"].update(time_cont=np.arange(600.0) ** 2), "even steps"),
        (lambda d: d["rec"].update(act_torque_abs_nm=np.full((3, 600), np.nan)), "torque: values that are not finite"),
        (lambda d: d["rec"].update(act_torque_abs_nm=np.zeros((600, 3))), "rec.act_torque_abs_nm 600 x 3, allowed is one row a joint"),
        (lambda d: d["rec"].update(time_cont=d["rec"]["time_cont"].ravel()[:500]), "500 columns each"),
    ],
)
def test_a_bad_mat_file_is_named(motion, tmp_path, change, message):
    data = structs(*motion)
    change(data)
    savemat(tmp_path / "r.mat", data)
    with pytest.raises(InputError, match=message):
        read_joint_record(tmp_path / "r.mat")


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("time_s,motor_1_deg,torque_1_nm\n0,1,2\n1,1,2\n", "column joint_1_deg"),
        ("t,a\n0,1\n1,2\n", "column time_s"),
        ("time_s,motor_1_deg,joint_1_deg,torque_1_nm\n0,1,2,3\n1,,2,3\n", "column motor_1_deg: found an empty cell"),
        ("time_s,motor_1_deg,joint_1_deg,torque_1_nm\n0,1,2,3\n0,1,2,3\n", "even steps"),
    ],
)
def test_a_bad_csv_is_named(tmp_path, text, message):
    (tmp_path / "r.csv").write_text(text)
    with pytest.raises(InputError, match=message):
        read_joint_record(tmp_path / "r.csv")
