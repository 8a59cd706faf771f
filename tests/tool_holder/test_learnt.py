"""What drawings said before and what is believed after, by hand."""

from __future__ import annotations

import numpy as np
import pytest

from rcsa_ident.io.results.drawings import known_toolings_to_json, learned_of
from rcsa_ident.report.summaries import drawing_rows
from rcsa_ident.tool_holder.alteration import ALTERATIONS, Alteration, altered
from rcsa_ident.tool_holder.drawings import Drawing, KnownToolings, RoughUnknown
from rcsa_ident.tool_holder.geometry import MATERIALS, BeamSegment, Contact, ToolAssembly
from rcsa_ident.tool_holder.learnt import drawn_value, learned
from rcsa_ident.tool_holder.spread import Spread

CARBIDE, STEEL = MATERIALS["carbide"], MATERIALS["steel"]
TOOL = (BeamSegment(0.030, 0.0096, CARBIDE), BeamSegment(0.070, 0.012, CARBIDE))
HOLDER = (BeamSegment(0.060, 0.050, STEEL, inner_diameter=0.012),)
ASSEMBLY = ToolAssembly(TOOL, HOLDER, 0.040, Contact(2e10, 6e5, 6e4, 9.0))
DRAWINGS = {name: Drawing(ASSEMBLY, Spread(), "EM12", "PG25") for name in ("a", "b", "never cut")}
UNKNOWNS = (
    RoughUnknown("stickout", "a", "tooling"),
    RoughUnknown("fluted_diameter", "EM12", "tool"),
    RoughUnknown("translational_stiffness", "PG25", "holder"),
    RoughUnknown("translational_stiffness", "a", "tooling"),
    RoughUnknown("translational_stiffness", "b", "tooling"),
)


@pytest.fixture
def known():
    covariance = np.diag([0.95, 0.1, 0.5, 0.9, 0.9]) ** 2
    covariance[2, 3] = covariance[3, 2] = -0.3
    return KnownToolings(UNKNOWNS, np.array([0.05e-3, 0.03, 0.4, 0.1, 0.1]), np.array([0.4, 0.38, 1.0, -1.0, 0.5]), covariance, ("a", "b"))


def test_numbers_stand_in_the_drawings_terms(known):
    rows = {(each.toolings, each.field): each for each in learned(known, DRAWINGS)}
    assert list(rows) == [
        (("a",), "stickout"),
        (("a", "b"), "fluted_diameter"),
        (("a",), "translational_stiffness"),
        (("b",), "translational_stiffness"),
    ]
    stickout, diameter, contact, _ = rows.values()
    assert stickout[2:] == pytest.approx((0.060, 0.05e-3, 0.060 + 0.02e-3, 0.0475e-3))
    found = 0.0096 * np.exp(0.03 * 0.38)
    assert diameter[2:] == pytest.approx((0.0096, 0.03 * 0.0096, found, 0.003 * found))
    # the model's contact with what this clamping adds, which hang together
    found = 2e10 * np.exp(0.4 - 0.1)
    deviation = np.sqrt((0.4 * 0.5) ** 2 + (0.1 * 0.9) ** 2 - 2.0 * 0.3 * 0.4 * 0.1)
    assert contact[2:] == pytest.approx((2e10, 2e10 * np.hypot(0.4, 0.1), found, found * deviation))
    assert [each.hardly for each in rows.values()] == [True, False, False, False]


def test_they_are_written_as_an_engineer_writes_them(known):
    told = [str(row) for row in drawing_rows(learned(known, DRAWINGS))]
    assert told[0] == "a: stickout 60.000 → 60.020 ± 0.048 mm"
    assert told[1] == "a, b: fluted diameter 9.60 → 9.710 ± 0.029 mm"
    assert told[2] == "a: contact stiffness, translational, per metre 2e+10 → 2.7e+10 ± 4.2e+09 N/m²"


def test_a_result_holds_them(known):
    rows = learned(known, DRAWINGS)
    content = known_toolings_to_json(known, rows)
    second = content["learned"][1]
    assert (second["toolings"], second["what"], second["unit"], second["hardly_taught"]) == (["a", "b"], "fluted diameter", "mm", False)
    assert second["drawn"] == pytest.approx(9.6)
    for one, other in zip(learned_of(content), rows, strict=True):
        assert one[:2] == other[:2]
        assert one[2:] == pytest.approx(other[2:])
    assert learned_of(known_toolings_to_json(known)) == ()


@pytest.mark.parametrize("field", ALTERATIONS)
def test_the_drawn_number_is_the_one_that_an_alteration_alters(field):
    change = 1e-3 if field in ("stickout", "fluted_length") else 0.1
    after = drawn_value(altered(ASSEMBLY, Alteration(**{field: change})), field)
    before = drawn_value(ASSEMBLY, field)
    assert after == pytest.approx(before + change if change < 0.01 else before * np.exp(change))
