"""A workpiece's keys: what a file says comes back, what it leaves out is the noun's own, what is wrong is named."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rcsa_ident.base.errors import InputError
from rcsa_ident.cutting.coefficients import CuttingCoefficients
from rcsa_ident.io.settings.setups import read_campaign
from rcsa_ident.io.settings.workpieces import WORKPIECE_KEYS, workpiece_keys, workpiece_of
from rcsa_ident.io.validated_table import Table
from rcsa_ident.setup.cut import Workpiece

LEAST = {"name": "EN AW-6082", "tangential_coefficient_mpa": 902.0, "radial_ratio": 0.26}
SPREADS = ("tangential_coefficient_spread_percent", "radial_ratio_spread_percent", "edge_spread_percent")


def read(**more):
    return workpiece_of(Table(LEAST | more, "campaign.toml", "workpiece", WORKPIECE_KEYS)).coefficients


def test_silence_means_five_five_and_ten_percent():
    c = read()
    assert (c.tangential_spread, c.ratio_spread, c.edge_spread) == (0.05, 0.05, 0.1)
    assert c == CuttingCoefficients(902e6, 0.26)


def test_each_key_is_its_own_spread():
    c = read(**dict(zip(SPREADS, (0, 12.5, 100), strict=True)))
    assert (c.tangential_spread, c.ratio_spread, c.edge_spread) == (0.0, 0.125, 1.0)


def test_a_misspelt_spread_is_not_taken_for_silence():
    with pytest.raises(InputError, match="did you mean edge_spread_percent"):
        read(edge_spread_percents=3.0)


@given(st.integers(0, 10_000), st.integers(0, 10_000), st.integers(0, 10_000))
def test_percents_come_back_as_they_were_written(a, b, c):
    written = dict(zip(SPREADS, (a / 100.0, b / 100.0, c / 100.0), strict=True))
    piece = workpiece_of(Table(LEAST | written, ""))
    again = workpiece_keys(piece, all_spreads=True)
    assert {key: again[key] for key in SPREADS} == written
    assert workpiece_of(Table(again, "")) == piece


def test_what_a_reader_would_take_anyway_is_left_away_unless_asked_for():
    piece = Workpiece("steel", CuttingCoefficients(1.5e9, 0.4, tangential_edge=2e4, ratio_spread=0.0))
    keys = workpiece_keys(piece)
    assert set(keys) == {*LEAST, "tangential_edge_n_per_mm", "radial_ratio_spread_percent"}
    assert keys["tangential_edge_n_per_mm"] == pytest.approx(20.0)
    assert keys["radial_ratio_spread_percent"] == 0.0
    assert set(SPREADS) <= set(workpiece_keys(piece, all_spreads=True))


def test_a_campaign_may_say_how_well_its_coefficients_are_known(campaign):
    path = campaign / "campaign.toml"
    text = path.read_text(encoding="utf-8").replace("radial_ratio = 0.26", "radial_ratio = 0.26\nradial_ratio_spread_percent = 3")
    path.write_text(text, encoding="utf-8")
    assert read_campaign(campaign).workpiece.coefficients.ratio_spread == 0.03
