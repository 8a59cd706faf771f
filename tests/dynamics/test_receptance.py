"""Receptances: names, shapes, and the sign of power."""

from __future__ import annotations

import numpy as np
import pytest

from rcsa_ident.base.arrays import frozen
from rcsa_ident.base.errors import InputError
from rcsa_ident.dynamics.coordinates import Coordinate, Dof, plane
from rcsa_ident.dynamics.receptance import Receptance, dissipation

ENDS = (*plane("tip"), *plane("flange"))
W = np.array([10.0, 20.0, 30.0])


def numbered():
    return Receptance(W, np.arange(48.0).reshape(3, 4, 4), ENDS, ENDS)


def test_blocks_and_entries_by_name():
    h = numbered()
    np.testing.assert_array_equal(h["flange", "tip"], h.values[:, 2:, :2])
    np.testing.assert_array_equal(h.between("tip.x'", "flange.x"), h.values[:, 1, 2])
    with pytest.raises(InputError, match=r"one of flange, tip"):
        h["nose", "tip"]
    with pytest.raises(InputError, match=r"tip\.x"):
        h.between("tip.y", "tip.x")


def test_shape_is_checked_and_values_are_read_only():
    with pytest.raises(InputError, match=r"\(3, 4, 4\)"):
        Receptance(W, np.zeros((3, 4, 3)), ENDS, ENDS)
    with pytest.raises(ValueError, match="read-only"):
        numbered().values[0, 0, 0] = 1.0


def test_a_frozen_array_leaves_the_callers_own_writeable():
    mine = np.ones(3)
    kept = frozen(mine)
    mine[0] = 7.0
    assert kept[0] == 1.0
    view = np.ones((4, 2))[::2]
    assert not frozen(view).flags.writeable
    window = mine[:2]
    held = frozen(window)
    mine[1] = 9.0
    assert held[1] == 1.0


def test_coordinates_read_as_they_are_written():
    for text in ("tip.x", "flange.y'", "a.b.z"):
        assert str(Coordinate.parse(text)) == text
    assert Dof.SLOPE_Y.is_slope
    assert not Dof.Z.is_slope
    for text in ("tip", "tip.q", ""):
        with pytest.raises(InputError, match=r"point\.dof"):
            Coordinate.parse(text)
    with pytest.raises(InputError, match="bending plane"):
        plane("tip", Dof.Z)


def test_dissipation_has_the_sign_of_the_damper():
    w = np.linspace(10.0, 3000.0, 40)
    for c in (20.0, -20.0):
        h = 1.0 / (4e5 + 1j * w * c - 2.0 * w**2)
        figure = dissipation(w, h[:, None, None])
        assert np.all(np.sign(figure) == np.sign(c))
        # the share of the mobility that is in phase with the force
        np.testing.assert_allclose(figure, (1j * w * h).real / np.abs(w * h), rtol=1e-12)


def test_dissipation_does_not_depend_on_units():
    rng = np.random.default_rng(2)
    w = np.linspace(10.0, 3000.0, 9)
    h = rng.normal(size=(9, 3, 3)) + 1j * rng.normal(size=(9, 3, 3))
    unit = np.array([1.0, 1e3, 1e-2])
    np.testing.assert_allclose(dissipation(w, h * unit[:, None] * unit), dissipation(w, h), rtol=1e-9, atol=1e-12)
