"""SPINDLE.csv."""

from __future__ import annotations

import numpy as np
import pytest

from rcsa_ident.base.errors import InputError
from rcsa_ident.io.settings.spindle_drives import read_spindle_drive

RPM = np.pi / 30.0


def test_a_curve_is_read_in_si(tmp_path):
    path = tmp_path / "S.csv"
    path.write_text("spindle_speed_rpm;power_kw;torque_nm\n1000;2,5;24\n5000;12;23\n20000;12;6\n", encoding="utf-8")
    drive = read_spindle_drive(path)
    np.testing.assert_allclose(drive.power_at(np.array([500.0, 3000.0, 20000.0, 20001.0]) * RPM), [2500.0, 7250.0, 12e3, 0.0])
    np.testing.assert_allclose(drive.torque_at(np.array([12500.0]) * RPM), [14.5])
    path.write_text("torque_nm,spindle_speed_rpm\n24,1000\n6,2000\n", encoding="utf-8")
    assert np.all(np.isinf(read_spindle_drive(path).power_at(np.array([1500.0]) * RPM)))


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("spindle_speed_rpm\n1\n", "found only spindle_speed_rpm, allowed is spindle_speed_rpm and power_kw, torque_nm or both"),
        ("power_kw\n1\n", "columns: found only power_kw"),
        ("spindle_speed_rpm,power_kw,power_kw\n1,1,1\n", "two columns"),
        ("spindle_speed_rpm,power_kw\n1,1\n2,0\n", "line 3: column power_kw: found 0"),
        ("spindle_speed_rpm,power_kw\n1,\n", "line 2: column power_kw: found nan"),
        ("spindle_speed_rpm,power_kw\n2,1\n1,1\n", "line 3: column spindle_speed_rpm: found 1, allowed is increasing speeds"),
    ],
)
def test_curves_that_are_not_read(tmp_path, text, words):
    path = tmp_path / "S.csv"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(InputError) as caught:
        read_spindle_drive(path)
    assert words in str(caught.value)
