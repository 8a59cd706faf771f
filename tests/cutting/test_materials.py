"""The library: every entry has a source, a spread and numbers that a cut can have."""

from __future__ import annotations

import pytest

from rcsa_ident.cutting.materials import material, materials
from rcsa_ident.errors import InputError


def test_every_entry_says_where_it_comes_from():
    names = [m.name for m in materials()]
    assert len(set(names)) == len(names) >= 12
    for m in materials():
        assert len(m.source) > 20
        assert m.condition
        assert 1e8 < m.coefficients.tangential < 6e9, m.name
        assert 0.05 < m.coefficients.radial_ratio < 1.0
        if "benchmark" not in m.name:
            # another cutter is never known to a few percent
            assert m.coefficients.tangential_spread >= 0.2
            assert m.coefficients.ratio_spread >= 0.3


def test_published_numbers():
    """As printed: [inprocess], section 4; [duan2021], table 5 (K_rc as a ratio); [du2023], [huynh2018]."""
    c = material("EN AW-6082").coefficients
    assert (c.tangential, c.radial_ratio) == (902e6, 0.26)
    c = material("EN AW-7075-T6").coefficients
    assert c.tangential == pytest.approx(767.01e6)
    assert c.tangential * c.radial_ratio == pytest.approx(168.8e6, rel=2e-3)
    assert c.tangential * c.axial_ratio == pytest.approx(222e6, rel=2e-3)
    assert (c.tangential_edge, c.radial_edge, c.axial_edge) == pytest.approx((27.7e3, 26.6e3, 0.7e3))
    c = material("5A06 aluminium").coefficients
    assert c.tangential * c.radial_ratio == pytest.approx(270.93e6, rel=1e-4)
    c = material("Steel St 52-3 (S355)").coefficients
    assert c.tangential * c.radial_ratio == pytest.approx(2289e6, rel=1e-3)


def test_one_alloy_scatters_by_a_factor_of_two():
    found = [m.coefficients.tangential for m in materials() if "7075" in m.name]
    assert max(found) / min(found) > 2.0


def test_names_forgive_and_suggest():
    assert material(" en aw 6082 ").name == "EN AW-6082"
    with pytest.raises(InputError, match="did you mean EN AW-7075-T6 or"):
        material("7075")
    with pytest.raises(InputError, match="EN AW-6061-T6"):
        material("EN AW-6061")
    with pytest.raises(InputError, match="one of EN AW-6082"):
        material("")
