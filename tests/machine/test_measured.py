"""A measured flange between its frequencies, and in a coupling."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import numpy as np
import pytest

from rcsa_ident.base.errors import InputError
from rcsa_ident.coupling.joint import LumpedJoint
from rcsa_ident.coupling.rcsa import couple
from rcsa_ident.dynamics.coordinates import Coordinate, Dof, plane
from rcsa_ident.dynamics.modal import normal_modes
from rcsa_ident.dynamics.receptance import Receptance, Substructure
from rcsa_ident.io.settings.machines import read_machine
from rcsa_ident.io.settings.setups import read_tooling
from rcsa_ident.machine.measured import MeasuredFlange, translations_only
from rcsa_ident.machine.spindle import Spindle
from rcsa_ident.tool_holder.model import tool_holder_receptance
from rcsa_ident.virtual.rotor import frequency_response, rotor

MACHINES = Path(__file__).resolve().parents[2] / "data" / "machines"
FINE = 2.0 * np.pi * np.arange(303.7, 3900.0, 7.3)
PORTS = ("flange.x", "flange.x'")


@cache
def true_flange(name, step):
    """The virtual machine's flange on a grid of `step` Hz, or on the fine one."""
    omega = FINE if step is None else 2.0 * np.pi * np.arange(300.0, 4000.0, step)
    return omega, frequency_response(rotor(read_machine(MACHINES / f"{name}.toml").spindle, None), omega, 0.0, inputs=PORTS, outputs=PORTS)


def measured(name, step):
    omega, values = true_flange(name, step)
    return MeasuredFlange(Receptance(omega, values, plane("flange"), plane("flange")))


def relative(found, true):
    size = np.sqrt(np.abs(np.einsum("nii->ni", true)))
    return np.max(np.abs(found - true) / size[:, :, None] / size[:, None, :], axis=(1, 2))


@pytest.mark.slow
@pytest.mark.parametrize("name", ["hpm", "stiff", "table2"])
def test_the_error_estimate_is_honest(name):
    """At least 95 % of the true errors lie below their estimates, on grids from fine to far too coarse; and it is no empty phrase."""
    true = true_flange(name, None)[1]
    last = np.inf
    for step in (100.0, 40.0, 20.0, 10.0):
        flange = measured(name, step)
        error = relative(flange.receptance(FINE).values, true)
        estimate = flange.interpolation_error(FINE)
        # at a measured frequency both are rounding
        assert np.mean((estimate >= error) | (error < 1e-9)) > 0.95
        assert estimate.max() < 60.0 * max(error.max(), 1e-7)
        assert np.median(error) < last
        last = np.median(error)
    assert relative(measured(name, 10.0).receptance(FINE).values, true).max() < 1e-3


def test_order_of_convergence():
    """Halving the grid takes an order of four or so off the error of a smooth flange."""
    errors = [
        np.median(relative(measured("table2", step).receptance(FINE).values, true_flange("table2", None)[1])) for step in (40.0, 20.0)
    ]
    assert errors[1] < errors[0] / 11.0


def test_a_coarse_grid_is_named():
    assert measured("table2", 20.0).coarse(FINE) is None
    warning = measured("hpm", 50.0).coarse(FINE)
    assert warning is not None
    assert "too coarsely" in warning
    assert "Hz" in warning


def test_measured_frequencies_come_back_and_nothing_outside():
    flange = measured("stiff", 20.0)
    omega, values = true_flange("stiff", 20.0)
    np.testing.assert_allclose(flange.receptance(omega).values, values, rtol=1e-9)
    np.testing.assert_allclose(flange.interpolation_error(omega), 0.0, atol=1e-9)
    for outside in (omega[0] * 0.99, omega[-1] * 1.01):
        with pytest.raises(InputError, match="where the flange was measured"):
            flange.receptance(np.array([1000.0 * 2.0 * np.pi, outside]))
    assert flange.band == (omega[0], omega[-1])


def test_it_stands_in_for_a_spindle_in_a_coupling():
    """Measured every 10 Hz it gives the same tooltip as the modes it was sampled from; both keep one protocol."""
    modes = normal_modes(
        2.0 * np.pi * np.array([700.0, 1300.0, 2500.0]), np.array([0.05, 0.04, 0.06]), np.array([[0.3, 3.0], [-0.25, 2.0], [0.2, -4.0]]),
        plane("flange"), np.diag([2e-10, 3e-8]),
    )  # fmt: skip
    spindle = Spindle(modes)
    grid = 2.0 * np.pi * np.arange(290.0, 4010.0, 10.0)
    flange = MeasuredFlange(spindle.receptance(grid))
    a = tool_holder_receptance(read_tooling(MACHINES / "toolings" / "S1-ER32.toml").assembly, FINE)
    joint = LumpedJoint(2e9, 5e6, 2000.0, 10.0)
    parts: list[Substructure] = [spindle, flange]
    one, other = (couple(a, part.receptance(FINE), joint)["tip", "tip"][:, 0, 0] for part in parts)
    assert spindle.coordinates == flange.coordinates
    assert np.linalg.norm(one - other) / np.linalg.norm(one) < 1e-4


def test_translations_alone_make_a_machine_statically_too_stiff():
    """A flange that does not turn: said in its documentation, seen in the tip below all resonances; off by far at them."""
    omega, values = true_flange("table2", 10.0)
    flange = translations_only(omega, values[:, 0, 0])
    a = tool_holder_receptance(read_tooling(MACHINES / "toolings" / "S1-ER32.toml").assembly, omega)
    joint = LumpedJoint(1e10, 1e9)
    stiff, true = (couple(a, f.receptance(omega), joint)["tip", "tip"][:, 0, 0] for f in (flange, measured("table2", 10.0)))
    assert stiff[0].real < 0.97 * true[0].real
    assert np.linalg.norm(stiff - true) > 0.1 * np.linalg.norm(true)
    np.testing.assert_allclose(flange.receptance(omega).values[:, 0, 0], values[:, 0, 0])
    assert translations_only(omega, values[:, 0, 0], Dof.Y).coordinates == plane("flange", Dof.Y)


def test_what_is_refused():
    omega, values = true_flange("hpm", 10.0)
    rows = plane("flange")
    with pytest.raises(InputError, match="coordinates of the point flange"):
        MeasuredFlange(Receptance(omega, values, (Coordinate("tip", Dof.X), rows[1]), rows))
    with pytest.raises(InputError, match="at least four"):
        MeasuredFlange(Receptance(omega[:3], values[:3], rows, rows))
    with pytest.raises(InputError, match="at least four, increasing"):
        MeasuredFlange(Receptance(omega[::-1], values, rows, rows))
    broken = values.copy()
    broken[3, 0, 0] = np.nan
    with pytest.raises(InputError, match="not finite"):
        MeasuredFlange(Receptance(omega, broken, rows, rows))
