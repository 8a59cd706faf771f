"""Figures of measurements beside: what is drawn is what was given, with units on every axis."""

from __future__ import annotations

import numpy as np
import pytest

from rcsa_ident.report.comparison import FlangePair, FrfPair, MeanForces, flange_comparison, frf_comparison, mean_forces, save

F = np.linspace(300.0, 3000.0, 200)
H = 1e-8 / (1.0 - (F / 1200.0) ** 2 + 0.06j * F / 1200.0)


def pair(**changed):
    values = {"title": "C11, tool tip, X", "colour": "X", "frequency": F, "identified": 1.1 * H, "hammer_frequency": F, "hammer": H}
    return FrfPair(**(values | changed))


def lines(ax):
    return {str(line.get_label()): line for line in ax.get_lines()}


@pytest.mark.parametrize("real", [False, True])
def test_frf_comparison(real):
    bands = np.array([400.0, 800.0]), np.array([0.99, 0.8])
    one = pair(deviation=(0.01 * np.abs(H), 0.01 * np.abs(H)), peaks=[(1200.0, 1190.0), (2500.0, None)], correlation=bands)
    figure = frf_comparison([one, pair(title="B33, Y", colour="Y")], band_hz=(450.0, 2800.0), real_and_imaginary=real)
    axes = figure.get_axes()
    assert len(axes) == 6
    top = lines(axes[0])
    expected = 1e6 * (H.real if real else np.abs(H))
    np.testing.assert_allclose(top["idle, hammer"].get_ydata(), expected)
    np.testing.assert_allclose(top["in process, identified"].get_ydata(), 1.1 * expected)
    assert axes[0].get_ylabel() == ("real [µm/N]" if real else "magnitude [µm/N]")
    assert axes[2].get_ylabel() == ("imaginary [µm/N]" if real else "phase [°]")
    assert axes[4].get_ylabel() == "FRAC [–]"
    assert all(ax.get_xlabel() == "frequency [Hz]" for ax in axes[4:])
    assert axes[0].get_yscale() == ("linear" if real else "log")
    marks = [line for line in axes[0].get_lines() if line.get_marker() in ("v", "^")]
    assert [float(np.ravel(m.get_xdata())[0]) for m in marks] == [1200.0, 1190.0, 2500.0]
    assert axes[0].get_title(loc="left") == "C11, tool tip, X"
    np.testing.assert_allclose(axes[4].get_lines()[0].get_ydata(), bands[1])


def test_without_correlation_there_are_two_rows():
    assert len(frf_comparison([pair()], names=("tap", "model")).get_axes()) == 2


def test_mean_forces():
    feed = np.array([4e-5, 8e-5])
    group = MeanForces("T, 1 mm", feed, np.array([[-5.0, 10.0, 2.0], [-8.0, 20.0, 3.0]]), np.array([0.0, 1e-4]), np.ones((2, 3)))
    figure = mean_forces([group])
    (ax,) = figure.get_axes()
    points = [line for line in ax.get_lines() if line.get_marker() == "o"]
    np.testing.assert_allclose(points[1].get_ydata(), [10.0, 20.0])
    np.testing.assert_allclose(points[0].get_xdata(), [0.04, 0.08])
    assert [p.get_label() for p in points] == ["F X", "F Y", "F axial"]
    assert (ax.get_xlabel(), ax.get_ylabel()) == ("feed per tooth [mm]", "mean force on the tool [N]")


def test_flange_comparison():
    block = np.stack([np.stack([H, 10 * H], axis=1), np.stack([10 * H, 300 * H], axis=1)], axis=1)
    figure = flange_comparison(FlangePair("X", F, {"idle": block, "in process": 1.2 * block}))
    axes = figure.get_axes()
    np.testing.assert_allclose(axes[2].get_lines()[1].get_ydata(), 1.2 * np.abs(300 * H))
    assert [ax.get_title(loc="left") for ax in axes[:3]] == ["h_tF [m/N]", "h_tM = h_rF [rad/N]", "h_rM [rad/(N m)]"]


@pytest.mark.parametrize("suffix", ["png", "svg"])
def test_files(tmp_path, suffix):
    path = tmp_path / f"compare.{suffix}"
    save(frf_comparison([pair()]), path)
    assert path.stat().st_size > 5000
