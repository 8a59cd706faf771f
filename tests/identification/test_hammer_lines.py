"""What is made of a hammer's curve before it is a line of an identification."""

import numpy as np
import pytest

from rcsa_ident.base.errors import InputError
from rcsa_ident.dynamics.coordinates import Dof
from rcsa_ident.identification.hammer_lines import MOST_LINES, HammerLines, noise_of, thinned

OMEGA = 2.0 * np.pi * np.arange(100.0, 4000.0, 1.0)
MODES = ((430.0, 0.03, 1.0), (1060.0, 0.006, 3.0), (2600.0, 0.02, -2.0))


def curve(omega):
    return sum(1e-1 * a / ((2 * np.pi * f) ** 2 * (1.0 + 2j * z * omega / (2 * np.pi * f)) - omega**2) for f, z, a in MODES)


def noisy(size, seed=3):
    rng = np.random.default_rng(seed)
    return curve(OMEGA) + size * (rng.standard_normal(OMEGA.size) + 1j * rng.standard_normal(OMEGA.size))


@pytest.mark.parametrize("size", [1e-10, 1e-9])
def test_noise_is_found_beside_resonances(size):
    found = np.sqrt(noise_of(noisy(size)))
    assert abs(np.median(found) / size - 1.0) < 0.05
    # where the curve bends within a few lines that counts as noise, and no more than the curve is there
    assert np.all(found < size * 2.0 + 0.03 * np.abs(curve(OMEGA)))


def test_a_curve_without_noise_has_next_to_none():
    assert np.all(np.sqrt(noise_of(curve(OMEGA))) < 0.01 * np.abs(curve(OMEGA)).max())
    assert not noise_of(np.ones(2)).any()


def test_lines_are_kept_where_the_curve_bends_and_everywhere_some():
    value = noisy(1e-10)
    kept = thinned(OMEGA, value, noise_of(value))
    assert MOST_LINES * 0.8 < kept.size <= MOST_LINES
    assert np.all(np.diff(kept) > 0)
    hertz = OMEGA[kept] / (2.0 * np.pi)
    # half the width of the sharpest resonance is 6 Hz
    near = hertz[np.abs(hertz - 1060.0) < 20.0]
    assert np.diff(near).max() <= 3.0
    assert np.diff(hertz).max() < 5.0 * 3900.0 / MOST_LINES / 0.3
    # both ends are flat here: no more lines than the even share asks for
    assert np.sum((hertz < 130.0) | (hertz > 3970.0)) < 8
    np.testing.assert_array_equal(thinned(OMEGA[:50], value[:50], noise_of(value[:50])), np.arange(50))


def test_lines_are_not_chosen_for_their_noise():
    """The mean square of what is kept is that of all lines: a line that sticks out must not be drawn for that."""
    value, size = noisy(1e-9), 1e-9
    kept = thinned(OMEGA, value, noise_of(value))
    rest = np.abs(value - curve(OMEGA)) ** 2 / (2.0 * size**2)
    # exponentially distributed with mean 1: three standard errors
    assert abs(rest[kept].mean() - 1.0) < 3.0 / np.sqrt(kept.size)


def test_one_of_both_points_is_on_the_tool_holder():
    with pytest.raises(InputError, match="at most one of response and force at the flange"):
        HammerLines("1", "T", Dof.X, OMEGA[:30], curve(OMEGA[:30]), np.ones(30), None, None)
