"""Enough cuts for an answer: two toolings with as many cuts as the diagnostics ask for."""

from __future__ import annotations

import pytest

from rcsa_ident.identification.status import FEWEST_CUTS, too_few


@pytest.mark.parametrize(
    ("first", "second", "enough"),
    [(0, 0, False), (80, 0, False), (80, FEWEST_CUTS - 1, False), (FEWEST_CUTS, FEWEST_CUTS, True), (20, 20, True)],
)
def test_two_toolings_with_enough_cuts_each(first, second, enough):
    found = too_few(["A"] * first + ["B"] * second)
    assert (found is None) is enough
    assert enough or "two toolings with 8 usable cuts each" in found


def test_where_no_sensor_sees_the_flange_three():
    assert "three toolings" in too_few(["A", "B"] * FEWEST_CUTS, of_flange=False)
    assert too_few(["A", "B", "C"] * FEWEST_CUTS, of_flange=False) is None
