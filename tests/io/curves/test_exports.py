"""What other programs get: the same numbers, named and placed."""

from __future__ import annotations

import json

import h5py
import numpy as np
import pytest

from rcsa_ident.base.errors import InputError
from rcsa_ident.dynamics.coordinates import Coordinate, Dof, plane
from rcsa_ident.dynamics.modal import ModalModel
from rcsa_ident.dynamics.receptance import Receptance
from rcsa_ident.io.curves.exports import (
    write_modes,
    write_receptances_csv,
    write_receptances_hdf5,
    write_receptances_json,
    write_receptances_uff,
)
from rcsa_ident.io.curves.frf_files import Source, read_tap_tests
from rcsa_ident.io.curves.tips import read_frf_csv
from rcsa_ident.io.uff import read_uff

OMEGA = 2.0 * np.pi * np.arange(400.0, 1500.0, 2.5)


def flange(axis, shift=1.0):
    phi = np.array([[1e-3 - 1e-3j, 2e-2 - 1.5e-2j], [5e-4 - 6e-4j, -1e-2 + 1e-2j]])
    return ModalModel(shift * np.array([4e3, 7e3]), np.array([0.04, 0.05]), phi, np.diag([1e-10, 1e-8]), plane("flange", axis))


AXES = {"X": flange(Dof.X), "Y": flange(Dof.Y, 0.95)}
FLANGE = {axis: model.receptance(OMEGA) for axis, model in AXES.items()}
TIP = {axis: Receptance(OMEGA, r.values[:, :1, :1], *[(Coordinate("tip", Dof(axis.lower())),)] * 2) for axis, r in FLANGE.items()}


@pytest.mark.parametrize("binary", [False, True])
def test_tips_in_a_universal_file_are_tap_tests(tmp_path, binary):
    path = tmp_path / "tip.uff"
    write_receptances_uff(path, TIP, "S1", binary)
    found = read_tap_tests([Source(path)])
    assert set(found) == {("X", "X"), ("Y", "Y")}
    for axis, receptance in TIP.items():
        np.testing.assert_allclose(found[axis, axis][0], OMEGA / (2.0 * np.pi), rtol=1e-9)
        np.testing.assert_allclose(found[axis, axis][1], receptance.values[:, 0, 0], rtol=1e-10)


def test_slopes_are_rotations_about_the_other_axis(tmp_path):
    path = tmp_path / "flange.uff"
    write_receptances_uff(path, FLANGE, "flange")
    places = {(f.response, f.reference): f for f in read_uff(path)}
    # dx/dz is a rotation about +Y, dy/dz one about -X
    assert set(places) == {((2, a), (2, b)) for pair in ((1, 5), (2, -4)) for a in pair for b in pair}
    cross = places[(2, 5), (2, 1)]
    np.testing.assert_allclose(cross.values, FLANGE["X"].values[:, 1, 0], rtol=1e-10)
    assert (cross.ordinate.unit, cross.denominator.unit) == ("rad", "N")
    assert places[(2, 2), (2, -4)].denominator.unit == "N m"
    assert cross.title == "flange: flange.x' / flange.x"


def test_csv_json_and_hdf5_hold_every_entry(tmp_path):
    write_receptances_csv(tmp_path / "F.csv", FLANGE)
    write_receptances_json(tmp_path / "F.json", FLANGE, "flange")
    write_receptances_hdf5(tmp_path / "F.h5", FLANGE, "flange")
    curves = read_frf_csv(tmp_path / "F.csv")
    data = json.loads((tmp_path / "F.json").read_text(encoding="utf-8"))
    np.testing.assert_array_equal(curves.frequency, OMEGA / (2.0 * np.pi))
    np.testing.assert_array_equal(data["frequency_hz"], OMEGA / (2.0 * np.pi))
    with h5py.File(tmp_path / "F.h5") as file:
        assert set(file) == {"frequency_hz", *data["receptances"]}
        for axis, receptance in FLANGE.items():
            np.testing.assert_array_equal(curves.values[axis], receptance.values[:, 0, 0])
            for name, i, j in ((axis, 0, 0), (f"{axis}_tM", 0, 1), (f"{axis}_rF", 1, 0), (f"{axis}_rM", 1, 1)):
                expected = receptance.values[:, i, j]
                np.testing.assert_array_equal(file[name][:], expected)
                np.testing.assert_array_equal(np.array(data["receptances"][name]["im"]), expected.imag)
                if i or j:
                    np.testing.assert_array_equal(curves.bands[f"{name}_re"], expected.real)


def test_modes_give_the_receptance_back(tmp_path):
    write_modes(tmp_path / "M.json", AXES, True)
    write_modes(tmp_path / "M.csv", AXES, False)
    data = json.loads((tmp_path / "M.json").read_text(encoding="utf-8"))
    table = np.genfromtxt(tmp_path / "M.csv", delimiter=",", names=True, dtype=None, encoding="utf-8")
    assert list(table["axis"]) == ["X", "X", "Y", "Y"]
    np.testing.assert_allclose(table["natural_frequency_hz"], [m["natural_frequency_hz"] for m in data["modes"]], rtol=1e-15)
    total = np.array(data["residual_compliance"]["Y"])[0, 1] + np.zeros(OMEGA.size, dtype=complex)
    for mode in data["modes"][2:]:
        w, z = 2.0 * np.pi * mode["natural_frequency_hz"], mode["damping_ratio"]
        pole = complex(-z * w, w * np.sqrt(1.0 - z**2))
        residue = complex(mode["phi_t_re"], mode["phi_t_im"]) * complex(mode["phi_r_re"], mode["phi_r_im"])
        total += residue / (1j * OMEGA - pole) + residue.conjugate() / (1j * OMEGA - pole.conjugate())
    np.testing.assert_allclose(total, FLANGE["Y"].values[:, 0, 1], rtol=1e-12)
    with pytest.raises(InputError, match="modes: found none"):
        write_modes(tmp_path / "N.csv", {}, False)
    assert not (tmp_path / "N.csv").exists()
