"""Calibrated coefficients as a file: what is written is read back, by itself and inside a campaign."""

from __future__ import annotations

import pytest

from rcsa_ident.base.errors import InputError
from rcsa_ident.cutting.coefficients import CuttingCoefficients
from rcsa_ident.io.settings.dynamometer import read_workpiece, write_workpiece
from rcsa_ident.setup.cut import Workpiece

FOUND = CuttingCoefficients(812.3456e6, 0.2987, 0.12, 12.3e3, 9.1e3, 1.2e3, 0.013, 0.021, 0.08)


def test_round_trip(tmp_path):
    path = tmp_path / "W.toml"
    write_workpiece(path, Workpiece('EN AW-6082 "T6" \\ Ü\t', FOUND), ["from 5 cuts", "two\nlines"])
    read = read_workpiece(path)
    assert read.name == 'EN AW-6082 "T6" \\ Ü\t'
    for name in CuttingCoefficients.__slots__:
        assert getattr(read.coefficients, name) == pytest.approx(getattr(FOUND, name), rel=1e-6)
    text = path.read_text(encoding="utf-8")
    assert text.startswith("# from 5 cuts\n# two lines\n[workpiece]\n")
    assert "tangential_coefficient_mpa = 812.3456" in text
    assert "tangential_coefficient_spread_percent = 1.3\n" in text


def test_other_tables_are_left_alone(tmp_path):
    path = tmp_path / "W.toml"
    path.write_text('[campaign]\nname = "x"\n[workpiece]\nname = "a"\ntangential_coefficient_mpa = 700\nradial_ratio = 0.3\n')
    assert read_workpiece(path).coefficients.tangential == 700e6


def test_what_is_refused(tmp_path):
    path = tmp_path / "W.toml"
    path.write_text('[workpiece]\nname = "a"\ntangential_mpa = 700\n')
    with pytest.raises(InputError, match="tangential_mpa: found an unknown key"):
        read_workpiece(path)
    path.write_text("[other]\n")
    with pytest.raises(InputError, match="workpiece"):
        read_workpiece(path)
