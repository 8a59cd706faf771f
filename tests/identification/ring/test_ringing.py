"""What rings tell of a tooling: frequencies from finite elements of another kind, and lines that are not its own."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from rcsa_ident.base.errors import InputError
from rcsa_ident.base.units import from_hz, to_hz
from rcsa_ident.cutting.cutter import Cutter
from rcsa_ident.identification.ring.line_matching import gathered
from rcsa_ident.identification.ring.ringing import MODEL_HIGHER, UNKNOWNS, learned, prior_std
from rcsa_ident.setup.tooling import Tooling
from rcsa_ident.signals.sound.ring_down import RingDown, RingingMode
from rcsa_ident.tool_holder.alteration import Alteration, altered
from rcsa_ident.tool_holder.free_modes import bare, bending_modes
from rcsa_ident.tool_holder.geometry import BeamSegment
from rcsa_ident.tool_holder.spread import Spread
from rcsa_ident.tool_holder.taper import hung
from rcsa_ident.tool_holder.timoshenko import hutchinson
from tests.tool_holder.test_taper import slender

HEARD = from_hz(21600.0)
TRUE = Alteration(
    fluted_diameter=0.025,
    youngs_modulus=0.01,
    translational_stiffness=-0.35,
    rotational_stiffness=-0.3,
    translational_damping=0.6,
    rotational_damping=0.5,
)


def drawn(teeth=4, **spread):
    return Tooling("T", Cutter(teeth, 0.012, 0.5), slender(), Spread(**spread), "EM12", "ER32", taper="HSK-A63")


def ring(body, count=2, error=0.0, moved=1.0):
    """What is heard of a body: modes by Hutchinson's shear coefficient on a mesh for another frequency."""
    modes = bending_modes(body, count, 30e3, hutchinson)
    return RingDown(tuple(line(moved * mode.omega * (1.0 + error), mode.damping) for mode in modes), 4, (), "", HEARD)


def line(omega, damping, level=1.0):
    return RingingMode(omega, 2e-4 * omega, damping, 0.03 * damping, level, 4)


def test_what_a_drawing_does_not_tell_is_found():
    tooling = drawn()
    true = altered(tooling.assembly, TRUE)
    tool = bare(true.tool)
    mass = sum(segment.mass for segment in true.tool)
    found = learned(tooling, ring(hung(true, "HSK-A63")), ring(tool), mass)
    assert not found.suspect
    truth = np.array([getattr(TRUE, name, 0.0) for name in UNKNOWNS])
    assert np.all(np.abs(found.mean - truth) <= 3.0 * found.std + 1e-12)
    learnt = dict(zip(UNKNOWNS, found.std / np.where(found.prior_std > 0.0, found.prior_std, 1.0), strict=True))
    # the fluted diameter, modulus and density by the tool alone and its mass, the contact by the whole
    assert learnt["fluted_diameter"] < 0.3
    assert learnt["youngs_modulus"] < 0.5
    assert learnt["translational_stiffness"] < 0.7
    assert learnt["stickout"] > 0.9
    for entry in found.lines:
        # no nearer than the finite elements' own error in a higher mode is asked for
        assert to_hz(entry.after) == pytest.approx(to_hz(entry.heard.omega), rel=MODEL_HIGHER)
    before, after = found.before.spread, found.after.spread
    assert after.fluted_diameter < 0.3 * before.fluted_diameter
    assert (after.reclamping, after.spindle_joint) == (0.0, before.spindle_joint)
    # what cuts told of its models is not added to what the ring has told
    assert (found.before.tool_model, found.after.tool_model, found.after.holder_model) == ("EM12", "", "")


def test_damping_alone_tells_the_contact_s_damping():
    tooling = drawn()
    true = altered(tooling.assembly, Alteration(translational_damping=0.7, rotational_damping=0.7))
    heard = ring(hung(true, "HSK-A63"))
    found = learned(tooling, heard)
    doubted = learned(tooling, replace(heard, damping_doubt="the recorder controls its gain"))
    places = [UNKNOWNS.index("translational_damping"), UNKNOWNS.index("rotational_damping")]
    first = bending_modes(hung(found.after.assembly, "HSK-A63"), 1, 12e3)[0]
    assert first.damping == pytest.approx(heard.modes[0].damping, rel=0.08)
    # one damping of a mode tells one of two together
    assert np.min(found.std[places] / found.prior_std[places]) < 0.5
    # heavy damping moves a frequency a little, and that is all that is left
    assert doubted.std[places] == pytest.approx(doubted.prior_std[places], rel=1e-2)
    assert "damping is not" in doubted.remarks[-1]


def test_the_taper_matters():
    """Forgotten, the lower frequency of what truly hangs there is taken for a softer contact."""
    tooling = drawn()
    heard = ring(hung(tooling.assembly, "HSK-A63"), count=1)
    place = UNKNOWNS.index("translational_stiffness")
    softness = {name: learned(replace(tooling, taper=name), heard).mean[place] for name in ("HSK-A63", "")}
    assert abs(softness["HSK-A63"]) < 0.05
    assert softness[""] < -0.15
    # a solid taper with its stud weighs too much to be anything but another tooling
    with pytest.raises(InputError, match="another one"):
        learned(replace(tooling, taper=""), ring(hung(tooling.assembly, "BT40")))


def test_planes_of_four_flutes_and_of_two():
    planes = [line(1000.0, 0.01), line(1006.0, 0.01), line(1080.0, 0.01), line(3000.0, 0.01)]
    assert [round(each.omega) for each in gathered(planes, 4)] == [1003, 1080, 3000]
    two = gathered([line(1000.0, 0.01), line(1080.0, 0.01), line(3000.0, 0.01)], 2)
    assert [round(each.omega) for each in two] == [1041, 3000]
    # one plane of two that differ
    assert two[1].omega_std / two[1].omega == pytest.approx(0.02, rel=1e-2)


def test_axial_and_torsional_lines_and_strangers_are_not_taken_for_bending():
    tooling = drawn()
    heard = ring(hung(tooling.assembly, "HSK-A63"))
    first, second = heard.modes
    clutter = (line(0.5 * first.omega, 0.008, 0.05), line(0.5 * (first.omega + second.omega), 0.02, 0.05))
    found = learned(tooling, replace(heard, modes=(clutter[0], first, clutter[1], second)))
    assert [None if each.mode is None else str(each.mode) for each in found.lines] == [None, "bending 1", None, "bending 2"]


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({"heard": RingDown((line(from_hz(900.0), 0.01),), 3, (), "", HEARD)}, "another one that rings"),
        ({"heard": None, "mass": 0.4}, r"mass: found 400 g, allowed is near 1"),
        ({"heard": RingDown((line(from_hz(1500.0), 0.01),), 3, (), "", from_hz(1800.0))}, r"sampling_rate_hz: .* rings at 25"),
    ],
    ids=["another tool", "another mass", "too slow"],
)
def test_what_cannot_be_is_refused(arguments, words):
    with pytest.raises(InputError, match=words):
        learned(drawn(), arguments["heard"], None, arguments.get("mass"))


def test_a_drawing_without_spread_is_an_honest_one():
    found = learned(replace(drawn(), spread=Spread(**dict.fromkeys(Spread.__slots__, 0.0))), ring(hung(slender(), "HSK-A63")))
    assert "honest" in found.remarks[0]
    np.testing.assert_array_equal(found.prior_std, prior_std(drawn()))


def test_the_rear_end_of_a_tool_belongs_to_it_alone():
    """A tool that is longer than stickout and insertion rings as the whole of it."""
    whole = drawn()
    behind = replace(whole, tool_behind=(BeamSegment(0.012, 0.012, slender().tool[-1].material),))
    tool = (*slender().tool[:-1], replace(slender().tool[-1], length=slender().tool[-1].length + 0.012))
    found = learned(behind, None, ring(bare(tool)))
    assert not found.suspect
    assert np.all(np.abs(found.mean) <= 0.2 * np.maximum(found.prior_std, 1e-12))
    assert sum(s.length for s in found.after.whole_tool) == pytest.approx(sum(s.length for s in tool), abs=1e-9)
