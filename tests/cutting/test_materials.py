"""The library: every entry has a source, a spread and numbers that a cut can have."""

from __future__ import annotations

import numpy as np
import pytest

from rcsa_ident.base.errors import InputError
from rcsa_ident.cutting.materials import material, materials


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


#: Specific cutting force [MPa] at a feed per tooth [mm], as the materials' sources print it.
FEED = np.array([0.1, 0.2, 0.3, 0.4, 0.6])
SPECIFIC = {
    "C45 (AISI 1045)": (2520, 2200, 2040, 1850, 1740),
    "42CrMo4 (AISI 4140)": (2540, 2250, 2140, 2000, 1800),
    "Stainless steel 304 and 316 (1.4301, 1.4401)": (2030, 1970, 1900, 1770, 1710),
    "Grey cast iron EN-GJL-250 (GG25)": (1750, 1400, 1240, 1050, 970),
}


@pytest.mark.parametrize("name", SPECIFIC)
def test_forces_over_feed_are_those_of_the_table(name):
    found = material(name)
    slope, edge = np.polyfit(FEED, FEED * SPECIFIC[name], 1)
    assert found.coefficients.tangential == pytest.approx(slope * 1e6, rel=1e-3)
    assert found.coefficients.tangential_edge == pytest.approx(edge * 1e3, rel=1e-3)
    assert all(str(value) in found.source for value in SPECIFIC[name])
    assert "typical" in found.notes


@pytest.mark.parametrize(
    ("name", "at_one", "exponent", "thickness"),
    [
        ("Ductile cast iron EN-GJS-600 (GGG60)", 1350, 0.28, FEED),
        ("Nickel alloy Inconel 718 (2.4668)", 3300, 0.24, np.array([0.05, 0.1, 0.15, 0.2, 0.3])),
    ],
)
def test_forces_over_chip_thickness_are_those_of_the_law(name, at_one, exponent, thickness):
    found = material(name)
    slope, edge = np.polyfit(thickness, at_one * thickness ** (1.0 - exponent), 1)
    assert found.coefficients.tangential == pytest.approx(slope * 1e6, rel=1e-3)
    assert found.coefficients.tangential_edge == pytest.approx(edge * 1e3, rel=1e-3)
    assert str(at_one) in found.source
    assert str(exponent) in found.source
    assert "typical" in found.notes


@pytest.mark.parametrize(("rake", "tangential", "ratio"), [(12.0, 1510e6, 0.1421), (0.0, 1775e6, 0.3148)])
def test_titanium_is_made_oblique_from_its_orthogonal_parameters(rake, tangential, ratio):
    """[altintas2012]: chip flow angle equal to the helix, shear angle from the chip ratio."""
    helix, alpha, chip = np.radians(30.0), np.radians(rake), (1.755 - 0.028 * rake) * 0.05 ** (0.331 - 0.0082 * rake)
    shear = np.arctan(chip * np.cos(alpha) / (1.0 - chip * np.sin(alpha)))
    friction = np.arctan(np.tan(np.radians(19.1 + 0.29 * rake)) * np.cos(helix))
    flow = np.tan(helix) * np.sin(friction)
    common = 613e6 / np.sin(shear) / np.hypot(np.cos(shear + friction - alpha), flow)
    found = common * (np.cos(friction - alpha) + np.tan(helix) * flow)
    assert found == pytest.approx(tangential, rel=1e-3)
    assert common * np.sin(friction - alpha) / np.cos(helix) / found == pytest.approx(ratio, rel=1e-3)
    axial = common * (np.cos(friction - alpha) * np.tan(helix) - flow)
    if rake:
        c = material("Titanium Ti-6Al-4V").coefficients
        assert (c.tangential, c.radial_ratio, c.axial_ratio) == pytest.approx((found, ratio, axial / found), rel=1e-3)
        assert (c.tangential_edge, c.radial_edge) == (24e3, 43e3)


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
