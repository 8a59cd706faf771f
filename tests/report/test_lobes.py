"""Figures of lobes say what they show, with units, and nothing but what there is."""

from __future__ import annotations

import numpy as np
import pytest

from rcsa_ident.report.figures import svg
from rcsa_ident.report.lobes import (
    Depths,
    Judged,
    Mark,
    Panel,
    cases_figure,
    comparison_figure,
    save_figure,
    stability_figure,
    usable_figure,
)
from rcsa_ident.stability.result import StabilityLobes
from rcsa_ident.stability.surface_error import SurfaceError, Wall
from rcsa_ident.stability.tested_cuts import TestedCuts, Verdict, tally

SPEED = np.linspace(400.0, 2000.0, 81)
LIMIT = 1e-3 * (1.5 + np.sin(SPEED / 60.0))
LOBES = StabilityLobes(SPEED, LIMIT, 900.0 * 2.0 * np.pi * np.ones(81), np.full(81, 3), 0.5e-3, 5.6e3, "by hand")
CUTS = TestedCuts(
    np.array([800.0, 800.0, 1200.0, 1600.0]),
    np.array([0.4, 2.9, 1.4, 4.0]) * 1e-3,
    (Verdict.STABLE, Verdict.STABLE, Verdict.MARGINAL, Verdict.CHATTER),
)
JUDGED = Judged(CUTS, tally(CUTS, np.interp(CUTS.spindle_speed, SPEED, LIMIT)))


def depths(scale=1.0):
    power = 8e-3 * 400.0 / SPEED
    usable = np.minimum(0.9 * scale * LIMIT, power)
    return Depths(SPEED, scale * LIMIT, 0.9 * scale * LIMIT, power, np.full(81, 10e-3), usable, usable * SPEED * 1e-6)


def test_tested_cuts_are_drawn_and_counted():
    text = svg(stability_figure(LOBES, 10e-3, tested=JUDGED), "t")
    for words in (
        "2 of 3 tested cuts classified correctly (1 stable above the limit)",
        "tested: stable",
        "tested: chatter",
        "tested: marginal",
    ):
        assert words in text
    axes = stability_figure(LOBES, 10e-3, tested=JUDGED).axes
    # the deepest cut is inside the picture
    assert axes[0].get_ylim()[1] > 4.0
    assert [a.get_ylabel() for a in axes] == ["axial depth [mm]", "chatter [Hz]"]


def test_flips_are_marked_only_where_there_are_some():
    flip = np.zeros(81, dtype=bool)
    assert "period doubling" not in svg(stability_figure(LOBES, 10e-3), "t")
    flip[40] = True
    marked = StabilityLobes(SPEED, LIMIT, LOBES.chatter_frequency, LOBES.lobe, 0.5e-3, 5.6e3, "by hand", (), flip)
    lines = stability_figure(marked, 10e-3).axes[0].get_lines()
    (points,) = [line for line in lines if line.get_label() == "by period doubling"]
    np.testing.assert_allclose(points.get_xydata(), [[SPEED[40] * 30.0 / np.pi, 1e3 * LIMIT[40]]])


def test_the_wall_has_its_own_axis():
    error = 1e-6 * np.outer(np.cos(SPEED / 100.0), [1.0, 2.0])
    figure = stability_figure(LOBES, 10e-3, surface=SurfaceError(SPEED, np.array([0.0, 1e-3]), error, Wall.EXIT))
    assert "[µm]" in figure.axes[2].get_ylabel()
    assert "1 mm depth, where teeth leave" in figure.axes[2].get_title(loc="left")
    mean = next(line for line in figure.axes[2].get_lines() if line.get_label() == "mean")
    np.testing.assert_allclose(mean.get_ydata(), 1.5 * np.cos(SPEED / 100.0))


@pytest.mark.parametrize("count", [1, 3, 4])
def test_cases_stand_side_by_side(count):
    panels = [Panel(f"case {i}: $A_b & <up>", LOBES, 10e-3, {"idle": 1.1 * LIMIT}, JUDGED if i else None) for i in range(count)]
    figure = cases_figure(panels)
    seen = [ax for ax in figure.axes if ax.get_visible()]
    assert len(seen) == count
    assert all(ax.get_xlabel() == "spindle speed [rev/min]" for ax in figure.axes[-min(2, count) :])
    text = svg(figure, "c")
    assert text.count("classified correctly") == count - 1
    assert "idle" in text
    assert "$A_b &amp; &lt;up&gt;" in text


def test_what_ends_the_depth_is_drawn():
    text = svg(usable_figure(depths(), [Mark(1000.0, 1e-3, 2e-6, "best")], [Mark(1500.0, 3e-3, 1e-6, "wish")], 0.8 * LIMIT), "u")
    for words in (
        "limited by power",
        "highest removal",
        "planned",
        "best",
        "wish",
        "all machines consistent with the recordings",
        "removal rate [cm³/min]",
    ):
        assert words in text
    assert "limited by torque" not in text
    assert "planned" not in svg(usable_figure(depths()), "u")


def test_a_comparison_names_its_curves():
    text = svg(comparison_figure({"A $1$": depths(), "B": depths(2.0)}, {"B": Mark(1000.0, 1e-3, 2e-6, "120 cm³/min")}), "c")
    for words in ("A $1$", "B", "120 cm³/min", "usable depth [mm]"):
        assert words in text


@pytest.mark.parametrize("suffix", ["png", "svg"])
def test_the_same_figure_gives_the_same_file(tmp_path, suffix):
    for name in "ab":
        save_figure(stability_figure(LOBES, 10e-3), str(tmp_path / f"{name}.{suffix}"))
    assert (tmp_path / f"a.{suffix}").read_bytes() == (tmp_path / f"b.{suffix}").read_bytes()
