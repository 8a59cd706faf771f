"""Noise that lines of a receptance show: its size whatever its kind, and none where a curve only bends."""

from __future__ import annotations

import numpy as np
import pytest

from rcsa_ident.dynamics.line_noise import differences_noise, line_noise

HERTZ = np.arange(100.0, 5001.0)
MODES = ((300.0, 0.03, 1.0), (900.0, 0.02, 0.4), (2500.0, 0.015, 0.2))


def curve(hertz=HERTZ):
    return sum(share / (1.0 - (hertz / f) ** 2 + 2j * zeta * hertz / f) for f, zeta, share in MODES)


def white(seed=1, size=HERTZ.size):
    rng = np.random.default_rng(seed)
    return rng.standard_normal(size) + 1j * rng.standard_normal(size)


@pytest.mark.parametrize("level", [1e-3, 0.1])
def test_white_noise(level):
    noise = line_noise(curve() + level * white())
    # the largest of three estimates is a little too large, and a median of 41 lines scatters
    low, middle, high = np.quantile(noise / level, (0.05, 0.5, 0.95))
    assert low > 0.85
    assert 1.0 < middle < 1.2
    assert high < 2.0
    # what bends at a resonance counts in part
    assert noise.max() < 2.5 * level + 0.01 * np.abs(curve()).max()


def test_noise_that_changes_with_frequency():
    level = 1e-2 * (1000.0 / HERTZ) ** 2
    low, high = np.quantile(line_noise(curve() + level * white()) / level, (0.05, 0.95))
    assert low > 0.8
    assert high < 1.6


@pytest.mark.parametrize("window", [[0.25, 0.5, 0.25], [-0.5, 1.0, -0.5], [0.1, 0.2, 0.4, 0.2, 0.1]])
def test_noise_that_a_window_has_smeared(window):
    """Neighbouring lines alone would tell as little as a quarter of it."""
    smeared = np.convolve(white(), np.array(window) / np.linalg.norm(window), "same")
    near, found = (float(np.median(f(curve() + 0.02 * smeared))) / 0.02 for f in (differences_noise, line_noise))
    assert 0.9 < found < 1.6
    assert near < 1.01 * found
    if min(window) > 0.0:
        assert near < 0.4


@pytest.mark.parametrize("step", [1.0, 4.0, 20.0])
def test_a_curve_without_noise_shows_none(step):
    """Also where a resonance has two lines."""
    hertz = np.arange(100.0, 5001.0, step)
    assert np.all(line_noise(curve(hertz)) < 1e-12)


def test_digits_that_a_file_leaves_out_are_noise():
    exact = curve()
    written = np.array([complex(f"{v.real:.3e}{v.imag:+.3e}j") for v in exact])
    found, true = line_noise(written), np.std((written - exact).real)
    assert 0.0 < np.median(found) < 3.0 * true


def test_a_sharp_resonance_is_told_the_noise_beside_it():
    """Its lines differ by far more than the noise."""
    sharp = 1.0 / (1.0 - (HERTZ / 1000.0) ** 2 + 2j * 5e-4 * HERTZ / 1000.0)
    found = line_noise(sharp + 0.01 * white())
    top = np.abs(HERTZ - 1000.0) < 2.0
    assert np.abs(np.diff(sharp[top])).max() > 100.0
    assert found[top].max() < 0.1


def test_each_entry_by_itself():
    values = np.zeros((HERTZ.size, 2, 2), dtype=complex)
    values[:, 0, 0], values[:, 1, 1] = curve() + 0.01 * white(), curve()
    found = line_noise(values)
    np.testing.assert_array_equal(found[:, 0, 0], line_noise(values[:, 0, 0]))
    assert np.all(found[:, 0, 0] > 0.0)
    assert np.all(found[:, 1, 1] < 1e-12)
    assert not found[:, 0, 1].any()


def test_few_lines_show_none():
    assert not line_noise(white(size=160)).any()
    assert line_noise(white(size=170)).all()
    assert differences_noise(white(size=8)).shape == (8,)
