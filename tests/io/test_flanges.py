"""FLANGE.csv: round trip, and what is refused."""

from __future__ import annotations

import numpy as np
import pytest

from rcsa_ident.dynamics.coordinates import Dof, plane
from rcsa_ident.errors import InputError
from rcsa_ident.io.flanges import read_flange_csv, write_flange_csv

F = np.array([100.0, 120.0, 150.0, 160.0, 200.0])


def block(seed):
    rng = np.random.default_rng(seed)
    h = rng.normal(size=(5, 2, 2)) + 1j * rng.normal(size=(5, 2, 2))
    return (h + np.swapaxes(h, 1, 2)) * [[1e-8, 1e-6], [1e-6, 1e-4]]


def test_round_trip(tmp_path):
    path = tmp_path / "F.csv"
    values = {Dof.X: block(1), Dof.Y: block(2)}
    write_flange_csv(path, F, values, {axis: np.abs(v) for axis, v in values.items()})
    read = read_flange_csv(path)
    for axis, flange in read.items():
        assert flange.coordinates == plane("flange", axis)
        np.testing.assert_array_equal(flange.measured.values, values[axis])
        np.testing.assert_allclose(flange.measured.omega / (2.0 * np.pi), F)
    write_flange_csv(path, F, {Dof.Y: block(2)})
    assert list(read_flange_csv(path)) == [Dof.Y]


def test_what_is_refused(tmp_path):
    path = tmp_path / "F.csv"
    with pytest.raises(InputError, match="not finite"):
        write_flange_csv(path, F, {Dof.X: np.nan * block(1)})
    path.write_text("frequency_hz,X_tF_re\n1,2\n2,3\n")
    with pytest.raises(InputError, match="column X_tF_im"):
        read_flange_csv(path)
    path.write_text("frequency_hz,other\n1,2\n2,3\n")
    with pytest.raises(InputError, match="no columns X_tF_re"):
        read_flange_csv(path)
    write_flange_csv(path, F[::-1], {Dof.X: block(1)})
    with pytest.raises(InputError, match="at least four, increasing"):
        read_flange_csv(path)
