"""Tables of static tests: what stands in them, and what is said of bad ones."""

import numpy as np
import pytest

from rcsa_ident.base.errors import InputError
from rcsa_ident.io.settings.robot_static import is_static, read_static_tests

PLAIN = "q1_deg,q2_deg,fx_n,fy_n,fz_n,dx_mm,dy_mm,dz_mm\n"


def written(tmp_path, text):
    path = tmp_path / "TESTS.csv"
    path.write_text(text, encoding="utf-8")
    return path


def test_units(tmp_path):
    path = written(tmp_path, PLAIN + "90,-45,1000,0,-500,0.5,-0.25,2\n90,-45,-1000,0,0,0,0,0\n")
    assert is_static(path)
    tests = read_static_tests(path, 2)
    np.testing.assert_allclose(tests.angles[0], [np.pi / 2, -np.pi / 4])
    np.testing.assert_array_equal(tests.force[0], [1000.0, 0.0, -500.0, 0.0, 0.0, 0.0])
    np.testing.assert_allclose(tests.displacement, [[5e-4, -2.5e-4, 2e-3], [0.0, 0.0, 0.0]])
    assert tests.point is None
    assert tests.name == "TESTS.csv"


def test_moments_turns_and_point(tmp_path):
    more = "q1_deg,fx_n,fy_n,fz_n,mx_nm,my_nm,mz_nm,dx_mm,dy_mm,dz_mm,rx_mrad,ry_mrad,rz_mrad,point_x_mm,point_y_mm,point_z_mm\n"
    tests = read_static_tests(written(tmp_path, more + "10,1,2,3,4,5,6,0.1,0.2,0.3,0.4,0.5,0.6,270,0,120\n"), 1)
    np.testing.assert_array_equal(tests.force[0], [1.0, 2.0, 3.0, 4.0, 5.0, 6.0])
    np.testing.assert_allclose(tests.displacement[0], [1e-4, 2e-4, 3e-4, 4e-4, 5e-4, 6e-4])
    np.testing.assert_allclose(tests.point[0], [0.27, 0.0, 0.12])


def test_motions_are_none(tmp_path):
    assert not is_static(written(tmp_path, "time_s,motor_1_deg\n0,1\n"))
    assert not is_static(tmp_path / "MOTION.mat")


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (PLAIN + "1,2,,0,0,0,0,0\n", "line 2: column fx_n: found an empty cell or no number"),
        (PLAIN + "1,2,1,0,0,0,80,0\n", "are these millimetres"),
        (PLAIN + "1,2,1,0,2e6,0,0,0\n", "forces of at most"),
        (PLAIN.replace("fz_n,", "") + "1,2,1,0,0,0,0\n", "column fz_n"),
        (PLAIN.replace("\n", ",rx_mrad\n") + "1,2,1,0,0,0,0,0,1\n", "column ry_mrad"),
        (PLAIN.replace("q2", "q3") + "1,2,1,0,0,0,0,0\n", "column q2_deg"),
    ],
)
def test_bad_tables_are_named(text, message, tmp_path):
    with pytest.raises(InputError, match=message):
        read_static_tests(written(tmp_path, text), 2)
