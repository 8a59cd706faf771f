"""A spindle as modes; the published modes, which feed energy in."""

from __future__ import annotations

import numpy as np
import pytest

from rcsa_ident.dynamics.coordinates import Dof, plane
from rcsa_ident.dynamics.modal import ModalModel, normal_modes
from rcsa_ident.dynamics.receptance import dissipation
from rcsa_ident.machine.spindle import Spindle
from tests.oracles import literature

W = 2.0 * np.pi * np.linspace(300.0, 4500.0, 300)


def published(axis):
    table = literature.PUBLISHED_MODES[axis]
    phi_t, phi_r = table[:, 2] + 1j * table[:, 3], table[:, 4] + 1j * table[:, 5]
    # with r = dw/dz and z from the tip towards the spindle the printed rotation changes its sign
    phi = 1e-4 * np.stack([phi_t, -phi_r], axis=1)
    return Spindle(ModalModel(2.0 * np.pi * table[:, 0], table[:, 1] / 100.0, phi, np.zeros((2, 2)), plane("flange", Dof(axis.lower()))))


@pytest.mark.parametrize("axis", ["X", "Y"])
def test_published_modes_are_not_passive(axis):
    spindle = published(axis)
    assert spindle.coordinates == plane("flange", Dof(axis.lower()))
    h = spindle.receptance(W)
    assert np.min(dissipation(W, h.values)) < -0.1
    table = literature.PUBLISHED_MODES[axis]
    assert np.any(2.0 * table[:, 2] * table[:, 3] > 0.0)


def test_normal_modes_are_passive():
    table = literature.PUBLISHED_MODES["X"]
    psi = np.random.default_rng(1).normal(size=(10, 2)) * [0.2, 2.0]
    spindle = Spindle(normal_modes(2.0 * np.pi * table[:, 0], table[:, 1] / 100.0, psi, plane("flange")))
    assert np.min(dissipation(W, spindle.receptance(W).values)) > -1e-9


def test_tables_are_complete():
    for axis in "XY":
        table = literature.PUBLISHED_MODES[axis]
        assert table.shape == (10, 6)
        assert np.all((table[:, 0] >= 600.0) & (table[:, 0] <= 3500.0))
        assert np.all((table[:, 1] >= 5.0) & (table[:, 1] <= 20.0))
    for number, segments in literature.NOMINAL_TOOLINGS.items():
        carbide = sum(length for length, _, _, material in segments if material == "carbide")
        assert carbide == pytest.approx(literature.PUBLISHED_STICKOUT_MM[number])
