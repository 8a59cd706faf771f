"""The finite-element tool-holder against exact solutions, limits and laws."""

from __future__ import annotations

import csv
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rcsa_ident.dynamics.receptance import dissipation
from rcsa_ident.dynamics.structure import natural_frequencies
from rcsa_ident.tool_holder import model
from rcsa_ident.tool_holder.geometry import MATERIALS, BeamSegment, Contact, Material, ToolAssembly
from rcsa_ident.tool_holder.model import mesh_error, tool_holder_receptance, tool_holder_structure
from tests.oracles import analytic
from tests.oracles import ross_table as peer

CARBIDE, STEEL = MATERIALS["carbide"], MATERIALS["steel"]
TOOL = (BeamSegment(0.026, 0.0096, CARBIDE), BeamSegment(0.0845, 0.012, CARBIDE))
HOLDER = (BeamSegment(0.04, 0.05, STEEL, 0.012), BeamSegment(0.032, 0.05, STEEL, 0.014), BeamSegment(0.026, 0.063, STEEL, 0.02))
CONTACT = Contact(2e10, 6e5, 6e4, 9.0)
BAND = 2.0 * np.pi * np.linspace(60.0, 5000.0, 50)


def beams(segments):
    return [
        analytic.Beam(
            s.length,
            s.diameter,
            s.inner_diameter,
            s.material.youngs_modulus,
            s.material.density,
            s.material.poisson,
            s.material.loss_factor,
        )
        for s in segments
    ]


def exact(assembly, omega):
    c = assembly.contact
    springs = None
    if c is not None:
        springs = (c.translational_stiffness, c.rotational_stiffness, c.translational_damping, c.rotational_damping)
    return analytic.assembly_receptance(beams(assembly.tool), beams(assembly.holder), assembly.insertion, springs, omega)


def error(found, expected):
    """Largest deviation of each entry over the band, against its largest value there."""
    return np.max(np.max(np.abs(found - expected), axis=0) / np.max(np.abs(expected), axis=0))


BUTT = ToolAssembly(
    (BeamSegment(0.05, 0.012, CARBIDE),), (BeamSegment(0.06, 0.04, STEEL), BeamSegment(0.03, 0.06, MATERIALS["aluminium"], 0.02)), 0.0
)
#: the tool's end, a step of the tool inside the bore, and steps of the holder at different places
STEPPED = ToolAssembly(
    (BeamSegment(0.05, 0.01, CARBIDE), BeamSegment(0.02, 0.014, CARBIDE, 0.003), BeamSegment(0.03, 0.012, STEEL)),
    (BeamSegment(0.015, 0.03, STEEL, 0.014), BeamSegment(0.05, 0.045, STEEL, 0.014), BeamSegment(0.03, 0.06, STEEL, 0.02)),
    0.042,
    Contact(5e9, 2e5, 2e4, 5.0),
)
ASSEMBLIES = {
    "contact": ToolAssembly(TOOL, HOLDER, 0.04, CONTACT),
    "rigid": ToolAssembly(TOOL, HOLDER, 0.04, None),
    "soft": ToolAssembly(TOOL, HOLDER, 0.04, Contact(1e9, 0.0, 1e5)),
    "butt": BUTT,
    "stepped": STEPPED,
    "tool alone": ToolAssembly(TOOL, (), 0.0),
}


@pytest.mark.parametrize("name", list(ASSEMBLIES))
def test_transcendental_solution(name):
    """Transfer matrices of the continuous beams, layer included; the default mesh is good to a few 1e-4 near resonances."""
    assembly = ASSEMBLIES[name]
    expected = exact(assembly, BAND)
    assert error(tool_holder_receptance(assembly, BAND).values, expected) < 4e-4
    fine = tool_holder_structure(assembly, 5000.0, refinement=2).receptance(BAND).values
    assert error(fine, expected) < 3e-5


def test_order_of_the_contact_is_four(monkeypatch):
    monkeypatch.setattr(model, "ELEMENTS_PER_DIAMETER", 0.6)
    monkeypatch.setattr(model, "ELEMENTS_PER_WAVELENGTH", 4.0)
    omega = BAND[::7]
    expected = exact(STEPPED, omega)
    errors = [error(tool_holder_structure(STEPPED, 5000.0, refinement=r).receptance(omega).values, expected) for r in (1, 2, 4)]
    assert np.log2(errors[1] / errors[2]) == pytest.approx(4.0, abs=0.5)


def test_peer_table():
    """A stepped shaft as a public rotor-dynamics package has it; its elements are of second order and 0.25 mm long."""
    material = Material(peer.MATERIAL["E"], peer.MATERIAL["rho"], peer.MATERIAL["Poisson"])
    shaft = ToolAssembly(tuple(BeamSegment(length, outer, material, inner) for length, outer, inner in peer.SEGMENTS), (), 0.0)
    with (Path(__file__).parents[1] / "oracles" / "ross_free_free.csv").open() as file:
        rows = list(csv.DictReader(file))
    theirs = [float(r["frequency_hz"]) for r in rows if r["kind"] == "natural frequency"]
    ours = natural_frequencies(tool_holder_structure(shaft, 50e3))[2:7] / (2.0 * np.pi)
    np.testing.assert_allclose(ours, theirs, rtol=2e-5)
    h = tool_holder_structure(shaft, 50e3).receptance(2.0 * np.pi * np.array(peer.FREQUENCIES_HZ))
    for row in (r for r in rows if r["kind"] != "natural frequency"):
        i = peer.FREQUENCIES_HZ.index(float(row["frequency_hz"]))
        expected = float(row["value"])
        entry = h.between(*row["kind"].split(" / "))
        assert entry[i].real == pytest.approx(expected, rel=3e-5, abs=1e-5 * np.median(np.abs(entry))), row


def test_rigid_body_at_low_frequency():
    assembly = ASSEMBLIES["contact"]
    pieces = [(start, s) for start, body in ((0.0, TOOL), (assembly.stickout, HOLDER)) for start, s in _placed(start, body)]
    mass = [s.material.density * np.pi / 4 * (s.diameter**2 - s.inner_diameter**2) * s.length for _, s in pieces]
    middle = [start + s.length / 2 for start, s in pieces]
    own = [m * (s.length**2 / 12 + (s.diameter**2 + s.inner_diameter**2) / 16) for m, (_, s) in zip(mass, pieces, strict=True)]
    centre = np.dot(mass, middle) / sum(mass)
    inertia = sum(own) + np.dot(mass, (np.array(middle) - centre) ** 2)
    omega = 2.0 * np.pi * np.array([1.0])
    expected = analytic.rigid_body(sum(mass), centre, inertia, (0.0, assembly.stickout + assembly.holder_length), omega)
    np.testing.assert_allclose(tool_holder_receptance(assembly, np.append(omega, BAND)).values[:1].real, expected, rtol=1e-4)


def _placed(start, segments):
    for s in segments:
        yield start, s
        start += s.length


def test_a_stiff_contact_is_a_rigid_one():
    """The springs yield over the length (B / k)^(1/4) behind the nose: a hundred times the stiffness, a third of it."""

    def elastic(contact):
        structure = tool_holder_structure(ToolAssembly(TOOL, HOLDER, 0.04, contact), 5000.0, refinement=2)
        return natural_frequencies(structure)[2:5]

    rigid = elastic(None)
    errors = [np.max(np.abs(elastic(Contact(k, k * 1e-4)) / rigid - 1.0)) for k in (1e12, 1e14, 1e16, 1e18)]
    assert errors[0] < 0.5
    for larger, smaller in pairwise(errors):
        assert smaller < 0.6 * larger
    assert errors[-1] < 5e-3


def test_a_soft_contact_leaves_two_free_bodies():
    loose = tool_holder_structure(ToolAssembly(TOOL, HOLDER, 0.04, Contact(1.0, 0.0)), 5000.0).receptance(BAND)
    tool = tool_holder_structure(ASSEMBLIES["tool alone"], 5000.0).receptance(BAND)
    assert error(loose["tip", "tip"], tool["tip", "tip"]) < 1e-5
    assert np.max(np.abs(loose.between("flange.x", "tip.x"))) < 1e-6 * np.max(np.abs(loose.between("tip.x", "tip.x")))


def test_static_compliance_of_the_clamped_assembly():
    """Rigid connection: the flexibility integral of each stretch, force at the tip, flange held."""
    structure = tool_holder_structure(ASSEMBLIES["rigid"], 1000.0)
    kept = np.setdiff1d(np.arange(structure.mass.shape[0]), structure.index[2:])
    force = np.zeros(kept.size)
    force[np.searchsorted(kept, structure.index[0])] = 1.0
    found = np.linalg.solve(structure.stiffness[np.ix_(kept, kept)], force)[np.searchsorted(kept, structure.index[0])]
    steps = [0.0, 0.026, 0.0705, 0.1105, 0.1425, 0.1685]
    bodies = [beams(TOOL)[:1], beams(TOOL)[1:], [beams(TOOL)[1], beams(HOLDER)[0]], beams(HOLDER)[1:2], beams(HOLDER)[2:]]
    expected = 0.0
    for a, b, beam in zip(steps[:-1], steps[1:], bodies, strict=True):
        bending, shear = (sum(each.numbers[k] for each in beam).real for k in (0, 1))
        expected += (b**3 - a**3) / (3.0 * bending) + (b - a) / shear
    assert found == pytest.approx(expected, rel=1e-7)


def test_order_on_a_taper_is_two(monkeypatch):
    expected = analytic.cone_tip_compliance(0.08, 0.01, 0.05, 205e9, 0.3)
    cone = ToolAssembly((BeamSegment(0.08, 0.01, STEEL, end_diameter=0.05),), (), 0.0)
    errors = []
    for refinement in (1, 2, 4):
        s = tool_holder_structure(cone, 1.0, refinement=refinement)
        kept = np.arange(s.index[2])
        errors.append(abs(np.linalg.inv(s.stiffness[np.ix_(kept, kept)])[0, 0] / expected - 1.0))
    assert errors[0] < 2e-2
    assert np.log2(errors[1] / errors[2]) == pytest.approx(2.0, abs=0.2)


def test_both_ways_to_the_receptance_agree():
    for assembly in ASSEMBLIES.values():
        full = tool_holder_structure(assembly, BAND.max() / (2.0 * np.pi)).receptance(BAND).values
        np.testing.assert_allclose(tool_holder_receptance(assembly, BAND).values, full, rtol=1e-6, atol=1e-9 * np.abs(full).max())


def test_mesh_error_is_what_it_says():
    assembly = ASSEMBLIES["contact"]
    omega = BAND[::5]
    found = tool_holder_structure(assembly, omega.max() / (2.0 * np.pi)).receptance(omega).values
    expected = exact(assembly, omega)
    truth = np.max(np.linalg.norm(found - expected, axis=0) / np.linalg.norm(expected, axis=0))
    assert mesh_error(assembly, omega) == pytest.approx(truth, rel=0.15)


@st.composite
def assemblies(draw):
    metre = st.floats(0.005, 0.06)
    material = st.builds(Material, st.floats(50e9, 600e9), st.floats(2000.0, 15000.0), st.floats(0.1, 0.4), st.floats(1e-4, 0.02))
    tool = tuple(BeamSegment(draw(metre), draw(st.floats(0.006, 0.02)), draw(material)) for _ in range(draw(st.integers(1, 3))))
    holder = tuple(
        BeamSegment(draw(metre), draw(st.floats(0.03, 0.07)), draw(material), draw(st.floats(0.0, 0.02)))
        for _ in range(draw(st.integers(1, 3)))
    )
    longest = min(0.95 * sum(s.length for s in tool), sum(s.length for s in holder))
    insertion = draw(st.floats(0.0, 1.0)) * longest
    insertion = insertion if insertion > 1e-3 else 0.0
    springs = st.builds(Contact, st.floats(1e8, 1e12), st.floats(0.0, 1e8), st.floats(0.0, 1e6), st.floats(0.0, 1e3))
    return ToolAssembly(tool, holder, insertion, draw(st.none() | springs))


@settings(max_examples=20, deadline=None)
@given(assembly=assemblies())
def test_laws_for_any_assembly(assembly):
    """Reciprocal, passive, with two rigid-body motions, and the fast way is the full one."""
    omega = 2.0 * np.pi * np.linspace(300.0, 5000.0, 12)
    structure = tool_holder_structure(assembly, 5000.0)
    natural = natural_frequencies(structure)
    # an eigenvalue is good to a few roundings of the largest one, and frequencies are their roots
    assert np.all(natural[:2] < 1e-7 * natural[-1])
    assert np.all(natural[:2] < 1e-2 * natural[2])
    fast, full = tool_holder_receptance(assembly, omega).values, structure.receptance(omega).values
    scale = np.sqrt(np.abs(np.einsum("nii->ni", full)))
    size = scale[:, :, None] * scale[:, None, :]
    assert np.max(np.abs(fast - full) / size) < 1e-6
    assert np.max(np.abs(fast - np.swapaxes(fast, 1, 2)) / size) < 1e-6
    assert np.min(dissipation(omega, full)) > -1e-7
    assert np.min(dissipation(omega, fast)) > -1e-6
