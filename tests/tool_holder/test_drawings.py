"""Which toolings share what is not known of them, and what is believed of one that never cut."""

from dataclasses import replace

import numpy as np
import pytest

from rcsa_ident.base.errors import InputError
from rcsa_ident.tool_holder.alteration import Alteration, altered
from rcsa_ident.tool_holder.drawings import Drawing, KnownToolings, RoughUnknown, fitted, rough_toolings
from rcsa_ident.tool_holder.geometry import MATERIALS, BeamSegment, Contact, ToolAssembly
from rcsa_ident.tool_holder.spread import EXACT, Spread

CARBIDE, STEEL = MATERIALS["carbide"], MATERIALS["steel"]
TOOL = (BeamSegment(0.026, 0.0096, CARBIDE), BeamSegment(0.084, 0.012, CARBIDE))
ASSEMBLY = ToolAssembly(TOOL, (BeamSegment(0.06, 0.05, STEEL, 0.012),), 0.040, Contact(2e10, 6e5, 1e5, 40.0))
HONEST = Spread()


def test_exact_drawings_leave_nothing_open():
    assert rough_toolings({"A": Drawing(ASSEMBLY, EXACT)}) is None
    assert fitted("A", Drawing(ASSEMBLY, EXACT)).ends == ()


def test_toolings_without_models_share_nothing():
    found = rough_toolings({"A": Drawing(ASSEMBLY, HONEST), "B": Drawing(ASSEMBLY, HONEST)})
    assert {unknown.kind for unknown in found.unknowns} == {"tooling"}
    assert len(found.unknowns) == 18
    # one unknown holds what the model and the clamping leave open of a stiffness
    k = found.unknowns.index(RoughUnknown("translational_stiffness", "A", "tooling"))
    assert found.spread[k] == pytest.approx(np.hypot(0.4, 0.1))


def test_models_share_what_is_theirs_and_each_clamping_has_its_own():
    drawings = {name: Drawing(ASSEMBLY, HONEST, tool, "PG25") for name, tool in (("A", "EM12"), ("B", "EM12"), ("C", "other"))}
    found = rough_toolings(drawings)
    values = np.zeros(len(found.unknowns))
    values[found.unknowns.index(RoughUnknown("fluted_diameter", "EM12", "tool"))] = 2.0
    values[found.unknowns.index(RoughUnknown("rotational_stiffness", "PG25", "holder"))] = 1.0
    values[found.unknowns.index(RoughUnknown("rotational_stiffness", "B", "tooling"))] = -1.0
    a, b, c = (found.alteration(t, values) for t in range(3))
    assert (a.fluted_diameter, b.fluted_diameter, c.fluted_diameter) == pytest.approx((0.06, 0.06, 0.0))
    assert (a.rotational_stiffness, b.rotational_stiffness, c.rotational_stiffness) == pytest.approx((0.4, 0.3, 0.4))
    stickouts = [unknown for unknown in found.unknowns if unknown.field == "stickout"]
    assert [unknown.owner for unknown in stickouts] == ["A", "B", "C"]


def test_a_rigid_connection_and_a_plain_tool_have_fewer():
    plain = replace(ASSEMBLY, tool=(BeamSegment(0.11, 0.012, CARBIDE),), contact=None)
    found = rough_toolings({"A": Drawing(plain, HONEST)})
    assert [unknown.field for unknown in found.unknowns] == ["stickout", "youngs_modulus", "holder_diameter"]
    undamped = replace(ASSEMBLY, contact=Contact(2e10, 6e5))
    fields = {unknown.field for unknown in rough_toolings({"A": Drawing(undamped, HONEST)}).unknowns}
    assert not {"translational_damping", "rotational_damping"} & fields


@pytest.fixture
def known():
    unknowns = (
        RoughUnknown("fluted_diameter", "EM12", "tool"), RoughUnknown("translational_stiffness", "PG25", "holder"),
        RoughUnknown("stickout", "A", "tooling"),
    )  # fmt: skip
    return KnownToolings(unknowns, np.array([0.03, 0.4, 5e-5]), np.array([1.0, -2.0, 0.5]), np.diag([0.01, 0.25, 0.81]), ("A",))


def test_what_is_known_of_models_is_believed_of_their_toolings(known):
    new = fitted("new", Drawing(ASSEMBLY, HONEST, "EM12", "PG25"), known)
    expected = Alteration(fluted_diameter=0.03, translational_stiffness=-0.8)
    assert new.assembly == altered(ASSEMBLY, expected)
    assert sorted(new.known.tolist()) == [0, 1]
    np.testing.assert_allclose(new.deviation, np.array([0.1, 0.5])[new.known])
    # a deviation of what is known, then the spread of what is not: its stickout among it, and its own clamping
    ahead, behind = new.ends[new.known.tolist().index(1)]
    assert ahead.contact.translational_stiffness / behind.contact.translational_stiffness == pytest.approx(np.exp(2 * 0.4 * 0.5))
    again = [a.contact.translational_stiffness / b.contact.translational_stiffness for a, b in new.ends[2:]]
    assert max(again) == pytest.approx(np.exp(2 * np.sqrt(2.0) * 0.1))
    stickouts = {round(1e6 * (a.stickout - b.stickout)) for a, b in new.ends}
    assert stickouts == {0, 100}


def test_a_tooling_that_cut_has_its_own_stickout(known):
    own = fitted("A", Drawing(ASSEMBLY, HONEST, "EM12", "PG25"), known)
    assert own.assembly.stickout == pytest.approx(ASSEMBLY.stickout + 2.5e-5)
    assert sorted(own.known.tolist()) == [0, 1, 2]
    # what the cuts hold of this clamping is in what they told
    steps = [np.log(a.contact.translational_stiffness / b.contact.translational_stiffness) for a, b in own.ends]
    assert sorted(np.round(np.abs(steps), 6))[-2:] == pytest.approx([0.0, 0.4], abs=1e-6)


def test_another_model_is_as_drawn(known):
    other = fitted("new", Drawing(ASSEMBLY, HONEST, "EM16", "ER32"), known)
    assert other.assembly == altered(ASSEMBLY, Alteration())
    assert other.known.size == 0
    assert len(other.ends) == 9


def test_what_is_known_belongs_together():
    with pytest.raises(InputError, match="covariance"):
        KnownToolings((RoughUnknown("stickout", "A", "tooling"),), np.ones(1), np.zeros(1), np.eye(2), ("A",))
