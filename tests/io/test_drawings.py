"""How well drawings are known, in tooling and campaign files, and what is known of toolings in results."""

import numpy as np
import pytest

from rcsa_ident.errors import InputError
from rcsa_ident.io.drawings import known_toolings_of, known_toolings_to_json
from rcsa_ident.io.setups import read_tooling, tooling_of
from rcsa_ident.io.toml_text import read_toml
from rcsa_ident.io.toolings import write_tooling
from rcsa_ident.io.validated_table import Table
from rcsa_ident.tool_holder.drawings import KnownToolings, RoughUnknown
from rcsa_ident.tool_holder.spread import EXACT, Spread
from tests.fixtures.paths import MACHINES

DRAWN = MACHINES / "toolings" / "S1-ER32.toml"


def keys():
    data = read_toml(DRAWN, "tooling")
    return {**data, "tool": dict(data["tool"]), "holder": dict(data["holder"])}


def test_without_a_table_the_drawing_is_exact_and_an_empty_one_is_honest():
    assert read_tooling(DRAWN).spread == EXACT
    assert tooling_of(keys() | {"spread": {}}, "", "t").spread == Spread()


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
    write_tooling(tmp_path / "exact.toml", read_tooling(DRAWN))
    assert "spread" not in (tmp_path / "exact.toml").read_text("utf-8")


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
