"""FLANGE.csv: round trip, and what is refused."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest

from rcsa_ident.base.errors import InputError
from rcsa_ident.coupling.joint import LumpedJoint
from rcsa_ident.dynamics.coordinates import Dof, plane
from rcsa_ident.io.curves.flanges import read_flange_csv, read_flange_machine, write_flange_csv, write_flange_machine

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


JOINT = LumpedJoint(2.1e9, 5e6, 1900.0, 0.0)


def test_a_joint_goes_with_its_flange(tmp_path):
    """What is read is coupled through it; the axis without one holds its compliance already."""
    path = tmp_path / "F.csv"
    write_flange_csv(path, F, {Dof.X: block(1), Dof.Y: block(2)}, joints={Dof.Y: JOINT})
    machine = read_flange_machine(path)
    assert [part.believed.joint for part in machine.parts] == [None, JOINT]
    np.testing.assert_array_equal(read_flange_csv(path)[Dof.Y].measured.values, block(2))
    written = replace(machine, joint=dict.fromkeys((Dof.X, Dof.Y), JOINT), ends=True)
    write_flange_machine(path, written)
    again = read_flange_machine(path)
    omega = written.lines()
    for one, other in zip(written.parts, again.parts, strict=True):
        assert other.believed.joint == JOINT
        np.testing.assert_allclose(other.believed.interface(omega), one.believed.interface(omega), rtol=1e-9)


def test_a_joint_that_is_not_whole_is_refused(tmp_path):
    path = tmp_path / "F.csv"
    write_flange_csv(path, F, {Dof.X: block(1)}, joints={Dof.X: JOINT})
    text = path.read_text(encoding="utf-8")
    for change, words in (
        (lambda t: t.replace("X_joint_rotational_damping", "more"), "column X_joint_rotational_damping: found nothing"),
        (lambda t: t.replace("1900.0", "1901.0", 1), "the same number in every line"),
        (lambda t: t.replace("2100000000.0", "-1.0"), "joint translational_stiffness: found -1.0"),
    ):
        path.write_text(change(text), encoding="utf-8")
        with pytest.raises(InputError, match=re.escape(words)):
            read_flange_machine(path)


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
