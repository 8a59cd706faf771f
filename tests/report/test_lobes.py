"""Figures of lobes say what they show, with units, and nothing but what there is."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from rcsa_ident.report.lobes import Judged, Panel, cases_figure, save_figure, stability_figure
from rcsa_ident.report.style import svg
from rcsa_ident.stability.advice import UsableDepths
from rcsa_ident.stability.labels.tested_cuts import TestedCuts, Verdict, tally
from rcsa_ident.stability.operating_point import Bound, OperatingPoint
from rcsa_ident.stability.result import StabilityLobes
from rcsa_ident.stability.surface_error import SurfaceError, Wall

SPEED = np.linspace(400.0, 2000.0, 81)
LIMIT = 1e-3 * (1.5 + np.sin(SPEED / 60.0))
LOBES = StabilityLobes(SPEED, LIMIT, 900.0 * 2.0 * np.pi * np.ones(81), np.full(81, 3), 10e-3, "by hand", 0.5e-3, 5.6e3)
CUTS = TestedCuts(
    np.array([800.0, 800.0, 1200.0, 1600.0]),
    np.array([0.4, 2.9, 1.4, 4.0]) * 1e-3,
    (Verdict.STABLE, Verdict.STABLE, Verdict.MARGINAL, Verdict.CHATTER),
)
JUDGED = Judged(CUTS, tally(CUTS, np.interp(CUTS.spindle_speed, SPEED, LIMIT)))


def test_tested_cuts_are_drawn_and_counted():
    text = svg(stability_figure(LOBES, tested=JUDGED), "t")
    for words in (
        "2 of 3 tested cuts classified correctly (1 stable above the limit)",
        "tested: stable",
        "tested: chatter",
        "tested: marginal",
    ):
        assert words in text
    axes = stability_figure(LOBES, tested=JUDGED).axes
    # the deepest cut is inside the picture
    assert axes[0].get_ylim()[1] > 4.0
    assert [a.get_ylabel() for a in axes] == ["axial depth [mm]", "chatter [Hz]"]


@pytest.mark.slow
def test_flips_are_marked_only_where_there_are_some():
    flip = np.zeros(81, dtype=bool)
    assert "period doubling" not in svg(stability_figure(LOBES), "t")
    flip[40] = True
    lines = stability_figure(replace(LOBES, flip=flip)).axes[0].get_lines()
    (points,) = [line for line in lines if line.get_label() == "by period doubling"]
    np.testing.assert_allclose(points.get_xydata(), [[SPEED[40] * 30.0 / np.pi, 1e3 * LIMIT[40]]])


def test_the_wall_has_its_own_axis():
    error = 1e-6 * np.outer(np.cos(SPEED / 100.0), [1.0, 2.0])
    figure = stability_figure(LOBES, surface=SurfaceError(SPEED, np.array([0.0, 1e-3]), error, Wall.EXIT))
    assert "[µm]" in figure.axes[2].get_ylabel()
    assert "1 mm depth, where teeth leave" in figure.axes[2].get_title(loc="left")
    mean = next(line for line in figure.axes[2].get_lines() if line.get_label() == "mean")
    np.testing.assert_allclose(mean.get_ydata(), 1.5 * np.cos(SPEED / 100.0))


@pytest.mark.slow
@pytest.mark.parametrize("count", [1, 3, 4])
def test_cases_stand_side_by_side(count):
    panels = [Panel(f"case {i}: $A_b & <up>", LOBES, {"idle": 1.1 * LIMIT}, JUDGED if i else None) for i in range(count)]
    figure = cases_figure(panels)
    seen = [ax for ax in figure.axes if ax.get_visible()]
    assert len(seen) == count
    assert all(ax.get_xlabel() == "spindle speed [rev/min]" for ax in figure.axes[-min(2, count) :])
    text = svg(figure, "c")
    assert text.count("classified correctly") == count - 1
    assert "idle" in text
    assert "$A_b &amp; &lt;up&gt;" in text


def labelled(ax):
    return {line.get_label(): line for line in ax.get_lines()}


def test_limit_and_recommended_depth_are_drawn_with_the_recommended_cuts():
    point = OperatingPoint(1000.0, 1.2e-3, 2.0e-3, Bound.CHATTER, None, None, None)
    assert "recommended depth" not in labelled(stability_figure(LOBES).axes[0])
    figure = stability_figure(LOBES, (point,))
    curve = labelled(figure.axes[0])["recommended depth"]
    np.testing.assert_allclose(curve.get_ydata(), 1e3 * LOBES.recommended_depth())
    assert "9549 rev/min\n1.20 mm" in {text.get_text() for text in figure.axes[0].texts}
    free = stability_figure(LOBES, (OperatingPoint(1000.0, np.inf, 10e-3, Bound.DEPTH, None, None, None),)).axes[0]
    assert "9549 rev/min\nno limit up to 10 mm" in {text.get_text() for text in free.texts}
    # what an advice knows better is drawn as it is
    stable = 0.5 * LIMIT
    usable = UsableDepths(SPEED, LIMIT, stable, np.full(81, 1.0), np.full(81, 1.0), stable, (Bound.CHATTER,) * 81, None, 9e-3)
    curve = labelled(stability_figure(LOBES, (point,), usable=usable).axes[0])["recommended depth"]
    np.testing.assert_array_equal(curve.get_ydata(), 1e3 * stable)


def test_the_band_and_the_depth_that_is_stable_at_any_speed_are_named():
    drawn = np.stack([0.9 * LIMIT, LIMIT, 1.1 * LIMIT])
    text = svg(stability_figure(replace(LOBES, drawn=drawn)), "t")
    assert "95 % uncertainty band" in text
    assert "stable at any speed: 0.50 mm" in text
    bare = svg(stability_figure(replace(LOBES, absolute_limit=None, absolute_frequency=None)), "t")
    assert "uncertainty" not in bare
    assert "stable at any speed" not in bare


@pytest.mark.slow
@pytest.mark.parametrize("suffix", ["png", "svg"])
def test_the_same_figure_gives_the_same_file(tmp_path, suffix):
    for name in "ab":
        save_figure(stability_figure(LOBES), str(tmp_path / f"{name}.{suffix}"))
    assert (tmp_path / f"a.{suffix}").read_bytes() == (tmp_path / f"b.{suffix}").read_bytes()
