"""Tips that were measured with noise: modes of the tip, not of the noise, and limits that are those of the tip without it."""

from __future__ import annotations

import numpy as np
import pytest

from rcsa_ident.dynamics.receptance import Receptance
from rcsa_ident.io.settings.machines import read_machine
from rcsa_ident.io.settings.setups import read_tooling
from rcsa_ident.stability.discretisation import FullDiscretisation
from rcsa_ident.stability.lobes import stability_lobes
from rcsa_ident.stability.multi_frequency import MultiFrequency
from rcsa_ident.stability.tip_modes import TIP, fitted_modes
from rcsa_ident.virtual.rotor import frequency_response, rotor
from tests.fixtures.paths import ROOT
from tests.stability.mills import RPM, SKEWED, mill, tip

MACHINES, ENDS = ROOT / "data" / "machines", tuple(str(each) for each in TIP)
HERTZ = np.arange(50.0, 4001.0)
OMEGA = 2.0 * np.pi * HERTZ
SPEEDS = RPM * np.array([6000.0, 9000.0, 12_000.0, 14_500.0, 18_000.0])
MILL = mill(3, 0.5, "up")
WINDOW = np.array([0.25, 0.5, 0.25])
#: Of a receptance's share of its largest value; an accelerometer's is alike in acceleration, a window's shared by neighbouring lines.
KINDS = {
    "white": lambda noise, _: 1e-3 * noise,
    "much": lambda noise, _: 1e-2 * noise,
    "accelerometer": lambda noise, _: 1e-3 * noise * (1000.0 / HERTZ) ** 2,
    "window": lambda noise, _: 1e-2 * np.convolve(noise, WINDOW / np.linalg.norm(WINDOW), "same"),
    "in proportion": lambda noise, share: 2e-2 * share * noise,
}


def limits(found):
    return stability_lobes(found, MILL, SPEEDS, 10e-3, FullDiscretisation()).limit_depth


def measured(kind, exact=None, seed=1):
    """The skewed mill's tip, or another one at the same frequencies, with noise."""
    values, rng = (tip(SKEWED).response(OMEGA) if exact is None else exact.copy()), np.random.default_rng(seed)
    for axis in range(2):
        noise = np.sqrt(0.5) * (rng.standard_normal(OMEGA.size) + 1j * rng.standard_normal(OMEGA.size))
        own = values[:, axis, axis]
        size = np.abs(own).max()
        own += size * KINDS[kind](noise, own / size)
    return Receptance(OMEGA, values, TIP, TIP)


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
def test_noise_is_not_taken_for_modes(kind):
    """Untold, a fit makes 20 to 57 modes of tip and noise."""
    modes, _ = fitted_modes(measured(kind))
    assert modes.pole.size <= 9
    true = limits(tip(SKEWED))
    assert np.all(np.isfinite(true))
    np.testing.assert_allclose(limits(modes), true, rtol=0.01)


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["much", "accelerometer"])
def test_a_virtual_machine_by_another_route(kind):
    """Finite elements whose materials lose a constant share; multi-frequency limits need no modes."""
    machine = read_machine(MACHINES / "hpm.toml")
    exact = frequency_response(rotor(machine.spindle, read_tooling(machine.toolings[0]).assembly), OMEGA, 0.0, ENDS, ENDS)
    true = stability_lobes(Receptance(OMEGA, exact, TIP, TIP), MILL, SPEEDS, 10e-3, MultiFrequency()).limit_depth
    assert np.all(np.isfinite(true))
    np.testing.assert_allclose(limits(fitted_modes(measured(kind, exact))[0]), true, rtol=0.02)


@pytest.mark.parametrize("step", [5, 10])
def test_noise_between_few_lines(step):
    """A resonance of some 20 Hz has two to four of them."""
    modes, _ = fitted_modes(Receptance(OMEGA[::step], measured("much").values[::step], TIP, TIP))
    assert modes.pole.size <= 5
    np.testing.assert_allclose(limits(modes), limits(tip(SKEWED)), rtol=0.01)


@pytest.mark.parametrize("step", [1, 5, 20])
def test_a_tip_without_noise_is_fitted_as_near_as_ever(step):
    lines = slice(None, None, step)
    exact = Receptance(OMEGA[lines], tip(SKEWED).response(OMEGA[lines]), TIP, TIP)
    modes, error = fitted_modes(exact)
    assert modes.pole.size == 3
    assert error < 1e-9


def test_directions_that_a_turned_machine_mixes():
    """Where planes feel each other, all their entries share the poles."""
    turned, rng = tip(SKEWED, turn=0.4), np.random.default_rng(2)
    values = turned.response(OMEGA)
    noise = rng.standard_normal(values.shape) + 1j * rng.standard_normal(values.shape)
    modes, _ = fitted_modes(Receptance(OMEGA, values + 1e-3 * np.abs(values).max() * noise, TIP, TIP))
    natural = np.abs(modes.pole) / (2.0 * np.pi)
    for _, hertz, zeta, _ in SKEWED:
        near = modes.pole[np.argmin(np.abs(natural - hertz))]
        assert abs(near) == pytest.approx(2.0 * np.pi * hertz, rel=2e-3)
        assert -near.real / abs(near) == pytest.approx(zeta, rel=0.05)
