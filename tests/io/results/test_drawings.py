"""How well drawings are known, in tooling and campaign files, and what is known of toolings in results."""

from dataclasses import replace

import numpy as np
import pytest

from rcsa_ident.base.errors import InputError
from rcsa_ident.base.plausibility import PlausibilityCode
from rcsa_ident.io.results.drawings import known_toolings_of, known_toolings_to_json
from rcsa_ident.io.settings.setups import read_tooling, tooling_of
from rcsa_ident.io.settings.toolings import write_tooling
from rcsa_ident.io.toml_text import read_toml
from rcsa_ident.io.validated_table import Table
from rcsa_ident.tool_holder.drawings import KnownToolings, RoughUnknown
from rcsa_ident.tool_holder.spread import EXACT, Spread
from tests.fixtures.paths import MACHINES

DRAWN = MACHINES / "toolings" / "S1-ER32.toml"


def keys():
    data = read_toml(DRAWN, "tooling")
    del data["spread"]
    return {**data, "tool": dict(data["tool"]), "holder": dict(data["holder"])}


def test_without_a_table_the_drawing_is_exact_and_an_empty_one_is_honest():
    silent, told = tooling_of(keys(), "", "t").spread, read_tooling(DRAWN).spread
    assert (silent, silent.stated) == (EXACT, False)
    assert (told, told.stated) == (EXACT, True)
    measured = keys()["contact"] | {"rotational_stiffness": 6.1e5}
    assert tooling_of(keys() | {"spread": {}, "contact": measured}, "", "t").spread == Spread()


@pytest.mark.parametrize(
    ("spread", "remark"),
    [
        (None, "has the catalogue's assumed values of a collet, which nobody has measured, but it counts as exact: safe depths come out"),
        ({"contact_stiffness_percent": 40}, "[spread] states contact_stiffness_percent = 40 and contact_damping_percent = 100"),
        ({}, None),
        ({"contact_stiffness_percent": 70, "contact_damping_percent": 100}, None),
        ({"contact_stiffness_percent": 0, "contact_damping_percent": 0}, None),
    ],
)
def test_a_contact_of_the_catalogue_is_assumed(spread, remark):
    """It is known to 70 % and 100 % where [spread] does not say so, too; without the table, or with less, a remark says what is assumed."""
    data = keys() | ({} if spread is None else {"spread": spread})
    tooling = tooling_of(data, "", "t")
    # beside a tip that was measured the drawing is of no account
    assert spread is not None or tooling_of(data, "", "t", tip_known=True).remarks == ()
    if spread == {}:
        assert (tooling.spread.contact_stiffness, tooling.spread.contact_damping) == pytest.approx((0.7, 1.0))
        assert tooling.spread.stickout == Spread().stickout
    said = [each for each in tooling.remarks if each.code is PlausibilityCode.ASSUMED]
    assert [remark in each for each in said] == ([] if remark is None else [True])
    # the last digit of who wrote it down is nobody's measurement, two percent are
    for factor, count in ((1.0 + 1e-9, len(said)), (1.02, 0)):
        contact = replace(tooling.assembly.contact, rotational_stiffness=6e5 * factor)
        other = replace(tooling, assembly=replace(tooling.assembly, contact=contact))
        assert len(other.remarks) == count


def test_units_and_models_go_through_a_file(tmp_path):
    data = keys()
    data["tool"]["model"], data["holder"]["model"] = "EM12-4", "ER32"
    data["spread"] = {"stickout_mm": 0.3, "fluted_diameter_percent": 0, "contact_stiffness_percent": 25.0}
    tooling = tooling_of(data, "", "t")
    assert tooling.spread.stickout == pytest.approx(3e-4)
    assert (tooling.spread.fluted_diameter, tooling.spread.contact_stiffness) == (0.0, pytest.approx(0.25))
    assert tooling.spread.youngs_modulus == Spread().youngs_modulus
    assert (tooling.tool_model, tooling.holder_model) == ("EM12-4", "ER32")
    write_tooling(tmp_path / "t.toml", tooling)
    again = read_tooling(tmp_path / "t.toml")
    assert (again.spread, again.tool_model, again.holder_model) == (tooling.spread, "EM12-4", "ER32")
    # one that says nothing is written as one that says nothing
    write_tooling(tmp_path / "silent.toml", tooling_of(keys(), "", "t"))
    assert "spread" not in (tmp_path / "silent.toml").read_text("utf-8")
    write_tooling(tmp_path / "exact.toml", read_tooling(DRAWN))
    assert read_tooling(tmp_path / "exact.toml").spread.stated


@pytest.mark.parametrize(
    ("spread", "said"),
    [
        ({"fluted_diametre_percent": 3.0}, "did you mean fluted_diameter_percent"),
        ({"stickout_mm": -0.1}, "spread.stickout_mm"),
        ({"youngs_modulus_percent": 400.0}, "at most 300"),
        ({"contact_stiffness_percent": "forty"}, "spread.contact_stiffness_percent"),
    ],
)
def test_bad_spreads_are_named(spread, said):
    with pytest.raises(InputError, match=said):
        tooling_of(keys() | {"spread": spread}, "tooling.toml", "t")


@pytest.fixture
def known():
    unknowns = (RoughUnknown("stickout", "A", "tooling"), RoughUnknown("fluted_diameter", "EM12", "tool"))
    return KnownToolings(unknowns, np.array([5e-5, 0.03]), np.array([0.5, -1.0]), np.array([[0.9, 0.1], [0.1, 0.2]]), ("A", "B"))


def test_what_is_known_goes_through_a_result(known):
    data = known_toolings_to_json(known)
    assert data["unknowns"][0] == {
        "what": "stickout", "of": "A", "kind": "tooling", "spread_mm": pytest.approx(0.05), "found_mm": pytest.approx(0.025),
        "std_mm": pytest.approx(0.05 * np.sqrt(0.9)),
    }  # fmt: skip
    assert data["unknowns"][1]["found_percent"] == pytest.approx(-3.0)
    again = known_toolings_of(Table(data, "", "toolings"))
    assert (again.unknowns, again.toolings) == (known.unknowns, known.toolings)
    for name in ("spread", "mean", "covariance"):
        np.testing.assert_allclose(getattr(again, name), getattr(known, name), rtol=1e-12)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda d: d["unknowns"][0].update(what="stikout"), "stickout"),
        (lambda d: d["unknowns"][1].pop("found_percent"), "found_percent"),
        (lambda d: d.update(covariance=[[1.0, 0.0]]), "2 rows of 2"),
        (lambda d: d.update(covariance=[[1.0, 0.0], [0.0, float("inf")]]), "finite"),
        (lambda d: d["unknowns"][0].update(spread_mm=0.0), "spread_mm"),
    ],
)
def test_damaged_results_are_named(known, change, said):
    data = known_toolings_to_json(known)
    change(data)
    with pytest.raises(InputError, match=said):
        known_toolings_of(Table(data, "RESULT.json", "toolings"))
