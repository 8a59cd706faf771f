"""Feeds for a chip thickness."""

from __future__ import annotations

import numpy as np
import pytest

from rcsa_ident.base.errors import InputError
from rcsa_ident.cutting.chip import feed_for_chip, thickest_share
from rcsa_ident.cutting.conditions import Block, Engagement, Stepover
from rcsa_ident.cutting.cutter import Cutter
from rcsa_ident.cutting.profile import Profile
from rcsa_ident.cutting.rows import rows_of

SLOT = Engagement(0.0, np.pi)


def test_a_wall_takes_the_feed_as_its_chip():
    assert feed_for_chip(Cutter(4, 0.012), SLOT, 2e-3, 0.1e-3) == pytest.approx(0.1e-3)


@pytest.mark.parametrize(("angle", "times"), [(12.0, 4.81), (45.0, 1.4142), (90.0, 1.0)])
def test_a_flat_edge_takes_more(angle, times):
    cutter = Cutter(3, 0.032, profile=Profile.face(0.032, np.radians(angle), 2e-3))
    assert feed_for_chip(cutter, SLOT, 1e-3, 0.1e-3) == pytest.approx(times * 0.1e-3, rel=2e-3)


def test_a_thin_cut_takes_more_too():
    """Down-milling with a stepover of a hundredth of the diameter: the tooth enters at its thickest, sin phi = 2 sqrt(0.01 0.99)."""
    thin = Stepover(0.12e-3, "down")
    assert thickest_share(Cutter(2, 0.012), thin, 1e-3) == pytest.approx(2.0 * np.sqrt(0.01 * 0.99))


@pytest.mark.parametrize("engagement", [SLOT, Block(-0.006, -0.003), Stepover(0.8e-3, "up")])
def test_a_balls_is_the_thickest_of_its_rows(engagement):
    ball = Cutter(2, 0.012, profile=Profile.ball(0.012))
    rows = rows_of(ball, engagement, 2e-3, 1.0, nodes=200)
    most = np.max(np.sin(np.clip(0.5 * np.pi, rows.start, rows.end)) * np.sin(rows.kappa))
    assert thickest_share(ball, engagement, 2e-3) == pytest.approx(most, rel=2e-3)


def test_nothing_cut_has_no_chip():
    with pytest.raises(InputError, match="engagement"):
        feed_for_chip(Cutter(2, 0.012), Block(0.01, 0.02), 1e-3, 1e-4)
    with pytest.raises(InputError, match="chip thickness"):
        feed_for_chip(Cutter(2, 0.012), SLOT, 1e-3, 0.0)
