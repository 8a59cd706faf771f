"""Figures of what is recommended: what stands against more, several toolings beside each other."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from rcsa_ident.report.advice import Mark, advice_figure, comparison_figure, usable_figure
from rcsa_ident.report.style import svg
from rcsa_ident.stability.advice import Advice, UsableDepths
from rcsa_ident.stability.operating_point import Bound, OperatingPoint
from rcsa_ident.stability.result import StabilityLobes

SPEED = np.linspace(400.0, 2000.0, 81)
LIMIT = 1e-3 * (1.5 + np.sin(SPEED / 60.0))


def depths(scale=1.0):
    power = 8e-3 * 400.0 / SPEED
    usable = np.minimum(0.9 * scale * LIMIT, power)
    bound = tuple(Bound.POWER if p == u else Bound.CHATTER for p, u in zip(power, usable, strict=True))
    return UsableDepths(SPEED, scale * LIMIT, 0.9 * scale * LIMIT, power, np.full(81, 10e-3), usable, bound, usable * SPEED * 1e-6, 9e-3)


def advice(name="T1", scale=1.0, fed=True):
    usable = depths(scale) if fed else replace(depths(scale), removal_rate=None)
    lobes = StabilityLobes(SPEED, scale * LIMIT, np.full(81, 5e3), np.full(81, 3), 10e-3, "by hand")
    known = (2e-6, 1.5e3, 1.5) if fed else (None, None, None)
    point = OperatingPoint(1000.0, 1e-3, 1.2e-3, Bound.CHATTER, *known)
    return Advice(name, 0.06, lobes, usable, (point,), (), (), None, ())


def labels(figure):
    return {line.get_label() for line in figure.axes[0].get_lines()}


@pytest.mark.slow
def test_what_ends_the_depth_is_drawn():
    figure = usable_figure(depths(), [Mark(1000.0, 1e-3, 2e-6, "best")], [Mark(1500.0, 3e-3, 1e-6, "wish")], 0.8 * LIMIT)
    text = svg(figure, "u")
    for words in (
        "limited by power",
        "recommended depth",
        "stability limit",
        "planned",
        "best",
        "wish",
        "all machines consistent with the recordings",
        "removal rate [cm³/min]",
    ):
        assert words in text
    assert {"recommended", "planned"} <= labels(figure)
    assert "limited by torque" not in text
    assert "planned" not in svg(usable_figure(depths()), "u")


def test_a_comparison_names_its_curves():
    text = svg(comparison_figure({"A $1$": depths(), "B": depths(2.0)}, {"B": Mark(1000.0, 1e-3, 2e-6, "120 cm³/min")}), "c")
    for words in ("A $1$", "B", "120 cm³/min", "recommended depth [mm]", "(thin: stability limit)"):
        assert words in text


@pytest.mark.slow
def test_one_advice_is_drawn_with_what_ends_it_and_several_beside_each_other():
    alone = svg(advice_figure([advice()]), "a")
    assert "limited by power" in alone
    assert "9549 rev/min, 1.00 mm" in alone
    assert "120 cm³/min, 1.5 kW" in alone
    both = advice_figure([advice(), advice("long", 0.5)])
    assert {"T1", "long"} <= labels(both)
    assert "limited by power" not in svg(both, "a")


def test_without_a_feed_it_is_the_figure_of_stability():
    text = svg(advice_figure([advice(fed=False)]), "a")
    assert "chatter [Hz]" in text
    assert "removal" not in text
    curve = next(line for line in advice_figure([advice(fed=False)]).axes[0].get_lines() if line.get_label() == "recommended depth")
    np.testing.assert_array_equal(curve.get_ydata(), 1e3 * depths().stable)
