import re
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rcsa_ident.dynamics.receptance import dissipation
from rcsa_ident.identification.coupled.posterior import CoupledUnknowns
from rcsa_ident.identification.data import LEVER
from rcsa_ident.identification.modal_parameters import side_by_side
from rcsa_ident.identification.unknowns import (
    DAMPING_UNIT,
    EVERY_PAIR,
    JOINT,
    PLACE_UNIT,
    RESIDUAL_UNIT,
    CoupledLayout,
    Layout,
    ModalBlock,
    chain,
    pack,
    parameter_names,
    strict_triangle,
    unpack,
)
from rcsa_ident.identification.unknowns import unpack as unpack_axis
from tests.identification.coupled.models import LAYOUTS, coupled_vector, dense_receptance, named
from tests.identification.models import vector_of
from tests.identification.test_unknowns import receptance

OMEGA = 2.0 * np.pi * np.geomspace(200.0, 5000.0, 40)
every_layout = pytest.mark.parametrize("layout", LAYOUTS, ids=named)


def discs_of(theta, layout):
    return layout.block.discs(theta) if layout.skew > 0 else None


@every_layout
def test_vector_and_physics_belong_together(layout):
    theta = coupled_vector(layout)
    packed = pack(unpack(theta, layout.block), layout.block, discs_of(theta, layout))
    np.testing.assert_allclose(packed, theta[: layout.tail], rtol=1e-13, atol=1e-13)


@every_layout
def test_every_place_of_the_vector_has_one_meaning(layout):
    layout = replace(layout, coefficients=3, clampings=2)
    places = [np.arange(layout.size)[place] for place in (*layout.block.parts.values(), layout.joint, layout.force, layout.clamping)]
    np.testing.assert_array_equal(np.concatenate(places), np.arange(layout.size))
    assert layout.tail == layout.joint.start
    assert layout.axis(0) == layout.axis(1) == slice(0, layout.tail)
    assert layout.modes_of_axes == (3,)


@every_layout
def test_the_flange_is_a_vector_of_its_own(layout):
    theta = coupled_vector(replace(layout, coefficients=3, clampings=2))
    whole, flange = unpack(theta, layout.block), unpack(theta[layout.block.machine], layout.flange.block)
    assert layout.block.machine.size + JOINT == layout.flange.size
    for name in ("omega_n", "psi", "factor", "residual", "softening", "skew"):
        np.testing.assert_array_equal(getattr(flange, name), getattr(whole, name))
    assert not flange.places.size


def entry(machine, discs, name):
    """What a name says stands in the vector, from the physics."""
    kind, *index = re.findall(r"[a-z_*]+|\d+", name.removeprefix("log "))
    if kind == "disc_":
        disc, side, n = index
        return discs[int(disc), "ab".index(side.strip("_")), int(n)]
    i = tuple(map(int, index))
    if kind == "natural_frequency_rad_s":
        return machine.omega_n[i]
    if kind.startswith("psi_"):
        return machine.psi[(*i, ("psi_x_t", "psi_lever*x_r", "psi_y_t", "psi_lever*y_r").index(kind))]
    values = {
        "damping_factor": machine.factor,
        "residual_factor": machine.residual,
        "softening": machine.softening,
        "gyroscopic": machine.skew,
    }
    unit = {"damping_factor": DAMPING_UNIT, "residual_factor": RESIDUAL_UNIT}.get(kind, 1.0)
    return values[kind][i] / unit


@every_layout
def test_names_say_what_stands_there(layout):
    layout = layout.flange
    theta = coupled_vector(layout)
    machine, names = unpack(theta, layout.block), parameter_names(layout.block)
    assert len(names) == len(set(names)) == layout.size
    for name, value in zip(names[:-JOINT], theta, strict=False):
        expected = np.exp(value) if name.startswith("log ") else value
        assert entry(machine, discs_of(theta, layout), name) == pytest.approx(expected, rel=1e-12)
    assert names[-JOINT:] == ("log joint.k_t", "log joint.k_r", "log joint.c_t", "log joint.c_r")


def physics(theta, layout):
    """In the order of the kernel's columns; frequencies as logarithms, the gyroscopic coupling above the diagonal."""
    machine = unpack(theta, layout.block)
    lower = np.tril_indices(layout.modes)
    parts = [np.log(machine.omega_n), machine.psi.ravel(), machine.factor[lower], machine.residual[np.tril_indices(4)]]
    parts.append(np.hstack([machine.places.T, machine.place_residual]).ravel())
    parts += [machine.softening[lower]] if layout.softening else []
    parts += [machine.skew[strict_triangle(layout.modes)]] if layout.skew else []
    return np.concatenate(parts)


@every_layout
def test_chain_against_differences(layout):
    theta = coupled_vector(layout)
    expected = np.zeros((physics(theta, layout).size, layout.tail))
    for k in range(layout.tail):
        step = np.zeros(layout.size)
        step[k] = 1e-6
        expected[:, k] = (physics(theta + step, layout) - physics(theta - step, layout)) / 2e-6
    found = np.zeros_like(expected)
    plain = layout.block.parts["skew"].start
    found[:plain, :plain] = np.diag(chain(unpack(theta, layout.block), layout.block)[:plain])
    if layout.skew:
        found[plain:, plain:] = layout.block.skew_chain(theta)
    units = np.abs(expected).max(axis=1, keepdims=True)
    np.testing.assert_allclose(found / units, expected / units, atol=1e-8)


def test_gyroscopic_coupling_of_discs_is_skew_and_of_low_rank():
    for discs in (1, 2):
        layout = CoupledLayout(6, skew=discs)
        skew = unpack(coupled_vector(layout), layout.block).skew
        np.testing.assert_array_equal(skew, -skew.T)
        assert np.linalg.matrix_rank(skew) == 2 * discs
    layout = CoupledLayout(6, skew=EVERY_PAIR)
    assert np.linalg.matrix_rank(unpack(coupled_vector(layout), layout.block).skew) == 6


def test_one_more_disc_leaves_the_first():
    """The second disc's unknowns stand behind the first one's: a vector grows at the end of the machine's part."""
    one, two = CoupledLayout(4, skew=1), CoupledLayout(4, skew=2)
    theta = coupled_vector(one)
    grown = np.concatenate([theta[: one.tail], np.zeros(8)])
    np.testing.assert_array_equal(unpack(grown, two.block).skew, unpack(theta, one.block).skew)


@pytest.mark.parametrize("fixture", [False, True])
@pytest.mark.parametrize("softening", [False, True])
def test_side_by_side_are_both_planes_receptances(fixture, softening):
    layout = Layout((ModalBlock(3, int(fixture), softening), ModalBlock(2, int(fixture), softening)))
    theta = vector_of(layout, ((600.0, 1400.0, 2500.0), (900.0, 2100.0)))
    planes = [unpack_axis(theta[layout.axis(i)], part) for i, part in enumerate(layout.axes)]
    lever = np.array([1.0, LEVER])
    for x in (0.0, -1.0, 0.6):
        # the tool turns, but nothing of the machine feels it
        whole = dense_receptance(side_by_side(*planes), OMEGA, x, speed=2000.0)
        for i, plane in enumerate(planes):
            own = receptance(plane, OMEGA, x)
            block = own[:, :2, :2] * np.outer(lever, lever)
            np.testing.assert_allclose(whole[:, 2 * i : 2 * i + 2, 2 * i : 2 * i + 2], block, rtol=1e-9)
            if fixture:
                np.testing.assert_allclose(whole[:, 4 + i, 2 * i : 2 * i + 2], own[:, 2, :2] * lever, rtol=1e-9, atol=1e-25)
            other = 2 - 2 * i
            assert not whole[:, 2 * i : 2 * i + 2, other : other + 2].any()
            assert not whole[:, 4 + i, other : other + 2].any()


@every_layout
def test_machine_at_a_speed_is_the_direct_solution(layout):
    machine = unpack(coupled_vector(layout), layout.block)
    for x, speed in ((0.0, 1000.0), (-1.0, 800.0), (1.0, 2000.0), (0.4, -1500.0)):
        there = machine.at(x)
        assert there.softening.size == 0
        assert np.all(np.triu(there.factor, 1) == 0.0)
        expected = dense_receptance(machine, OMEGA, x, speed)
        size = np.abs(expected).max(axis=0)
        assert np.all(np.abs(dense_receptance(there, OMEGA, 0.0, speed) - expected) <= 1e-9 * size)


@st.composite
def vectors(draw):
    """Any machine that the priors do not find absurd, and many that they do."""
    softening, skew = draw(st.booleans()), draw(st.sampled_from([0, 1, 2, EVERY_PAIR]))
    layout = CoupledLayout(draw(st.integers(1, 7)), False, softening, skew, draw(st.sampled_from([0, 1, -1])))
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    theta = rng.standard_normal(layout.size) * draw(st.sampled_from([0.1, 1.0, 2.0]))
    theta[: layout.modes] = np.log(2.0 * np.pi * rng.uniform(50.0, 6000.0, layout.modes))
    theta[layout.joint] = np.log([2e9, 5e6, 1e3, 10.0])
    return layout, theta


@settings(max_examples=60, deadline=None)
@given(vectors(), st.floats(-1.0, 1.0))
def test_every_vector_is_passive_at_every_speed(drawn, x):
    """Standing, at a campaign's highest speed and at twice of it; and turned round it is transposed."""
    layout, theta = drawn
    unknowns = CoupledUnknowns(theta, layout)
    for speed in (0.0, 2100.0, 4200.0):
        one, other = (unknowns.modes(sense * speed, x).receptance(OMEGA).values for sense in (1.0, -1.0))
        assert dissipation(OMEGA, one).min() > -1e-7
        size = np.sqrt(np.abs(np.einsum("nii->ni", one)))
        assert np.max(np.abs(one.transpose(0, 2, 1) - other) / size[:, :, None] / size[:, None, :]) < 1e-6


@pytest.mark.parametrize("sense", [1, -1])
def test_a_spindle_that_turns_the_other_way(sense):
    """The machine's own coupling is what the lines say; only tool-holders on it are told the other speed."""
    layout = CoupledLayout(4, skew=2, turning=sense)
    theta = coupled_vector(layout)
    modes = CoupledUnknowns(theta, layout).modes(1500.0)
    assert modes.speed == sense * 1500.0
    scale = np.array([1.0, LEVER, 1.0, LEVER])
    expected = dense_receptance(unpack(theta, layout.block), OMEGA, 0.0, 1500.0)[:, :4]
    found = modes.receptance(OMEGA).values * np.outer(scale, scale)
    np.testing.assert_allclose(found, expected, atol=1e-8 * np.abs(expected).max())


def test_fixture_residual_has_its_unit():
    layout = CoupledLayout(2, fixture=True)
    theta = coupled_vector(layout)
    found = unpack(theta, layout.block).place_residual
    np.testing.assert_allclose(found, PLACE_UNIT * theta[layout.block.parts["places"]].reshape(2, -1)[:, 2:])
