"""The tip of a tooling on a machine with what is not known of it: at a speed, along each direction of the posterior, and of the holder."""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import numpy as np
import pytest

from rcsa_ident.coupling.rcsa import couple
from rcsa_ident.dynamics.coordinates import Coordinate, Dof, plane
from rcsa_ident.dynamics.uncertain import Doubted as DoubtedOf
from rcsa_ident.identification.machine import IdentifiedMachine
from rcsa_ident.identification.modal_parameters import flange_modes, flange_of
from rcsa_ident.identification.posterior import MachineAxis, Posterior
from rcsa_ident.identification.unknowns import ModalBlock, joint_of, pack
from rcsa_ident.machine.flange_part import Doubt, FlangePart, JointedFlange, Perturbation
from rcsa_ident.machine.machine import STIFFNESS_SPREAD, Machine
from rcsa_ident.machine.spindle import Spindle
from rcsa_ident.tool_holder.alteration import Alteration, altered
from rcsa_ident.tool_holder.drawings import KnownToolings, RoughUnknown
from rcsa_ident.tool_holder.geometry import stiffened
from rcsa_ident.tool_holder.model import tool_holder_receptance
from rcsa_ident.tool_holder.spread import EXACT
from tests.fixtures import by_hand
from tests.machine.planes import BAND, FLANGES, JOINT, TIP, coupled_in_both_planes, oblique, tip_in_both_planes

OMEGA = 2.0 * np.pi * np.linspace(500.0, 4000.0, 60)
AXES = (Dof.X, Dof.Y)
SPEEDS = (1500.0, 600.0)
LOGS = np.log([2e9, 5e6, 1e4, 10.0])


@pytest.fixture
def assembly():
    return by_hand.tooling().assembly


def posterior_of(shift, softening):
    natural = 2.0 * np.pi * shift * np.array([900.0, 2000.0])
    damping = np.diag(2.0 * np.array([0.05, 0.04]) * natural)
    axis = flange_of(natural, np.array([[0.15, 0.1], [0.2, -0.3]]), np.linalg.cholesky(damping), np.diag([2e-5, 3e-5]))
    layout = ModalBlock(2, softening=softening)
    changes = np.array([[-0.04, 0.01], [0.01, -0.06]])
    theta = np.concatenate([pack(replace(axis, softening=changes), layout), LOGS])
    root = 2e-3 * np.random.default_rng(1).standard_normal((theta.size, theta.size))
    return Posterior(theta, root @ root.T / theta.size, layout, SPEEDS)


def machine_of(softening=True):
    found = {}
    for axis, shift in zip(AXES, (1.0, 0.95), strict=True):
        posterior = posterior_of(shift, softening)
        modes, joint = posterior.machine(axis)
        found[axis] = MachineAxis(Spindle(modes), joint, posterior)
    return IdentifiedMachine(found, BAND)


def direct(tip, axis):
    """Receptance along an axis, shape (n,)."""
    return tip.between(f"tip.{axis}", f"tip.{axis}")


def changes(tip, axis):
    """Its changes along the directions that this axis knows of, shape (p, n); what it shares with the other one comes last."""
    i, spread = AXES.index(axis), tip.spread
    assert not np.any(spread[:, :, 0, 1])
    assert not np.any(spread[:, :, 1, 0])
    return spread[np.any(spread[:, :, i, i], axis=1), :, i, i]


def coupled_by_hand(posterior, axis, assembly, x):
    """Coupled without the machine: the vector's own modes at relative speed x, by the coupling's general solution."""
    holder = tool_holder_receptance(assembly, OMEGA, axis)
    natural = np.exp(posterior.theta[:2])
    physics = flange_of(natural, posterior.theta[2:6].reshape(2, 2), np.zeros((2, 2)), np.diag([2e-5, 3e-5]))
    lower = np.zeros((2, 2))
    lower[np.tril_indices(2)] = 30.0 * np.where([True, False, True], np.exp(posterior.theta[6:9]), posterior.theta[6:9])
    change = np.zeros((2, 2))
    if posterior.layout.softening:
        change[np.tril_indices(2)] = posterior.theta[12:15]
        change.T[np.tril_indices(2)] = posterior.theta[12:15]
    stiffness = np.outer(natural, natural) * (np.eye(2) + x * change)
    squares, turn = np.linalg.eigh(stiffness)
    turned = replace(physics, omega_n=np.sqrt(squares), psi=turn.T @ physics.psi, factor=turn.T @ lower)
    return couple(holder, flange_modes(turned, axis).receptance(OMEGA), joint_of(LOGS))["tip", "tip"][:, 0, 0]


@pytest.mark.parametrize(("speed", "x"), [(None, 0.0), (1500.0, 0.0), (2100.0, 1.0), (1200.0, -0.5), (9000.0, 1.0)])
def test_tooltip_at_a_speed(assembly, speed, x):
    machine = machine_of()
    found = machine.at(speed).tip(assembly, OMEGA, spread=False)
    assert found.variation is None
    for axis in AXES:
        expected = coupled_by_hand(machine.identified[axis].posterior, axis, assembly, x)
        assert np.abs(direct(found, axis) - expected).max() < 1e-9 * np.abs(expected).max()


def test_a_machine_that_does_not_change_is_the_same_at_any_speed(assembly):
    one, other = (machine_of(False).at(speed).tip(assembly, OMEGA) for speed in (None, 2100.0))
    np.testing.assert_array_equal(one.values, other.values)
    np.testing.assert_array_equal(one.spread, other.spread)


def test_bands_are_those_of_the_posterior_at_that_speed(assembly):
    machine = machine_of()
    found = machine.at(2100.0).tip(assembly, OMEGA)
    for axis in AXES:
        holder = tool_holder_receptance(assembly, OMEGA, axis)

        def tip(candidate, holder=holder):
            return couple(holder, candidate.flange.receptance(OMEGA), candidate.joint)["tip", "tip"][:, 0, 0]

        _, expected = machine.identified[axis].posterior.part(axis, 2100.0).response(tip)
        own = changes(found, axis)
        np.testing.assert_allclose(own[:-1], expected, rtol=0.0, atol=1e-9 * np.abs(expected).max())
        real, imaginary = found.deviation()[(Coordinate("tip", axis),) * 2]
        total = np.sum(np.abs(own) ** 2, axis=0)
        np.testing.assert_allclose(real**2 + imaginary**2, total, rtol=1e-12)


@pytest.mark.parametrize("speed", [None, 2000.0])
@pytest.mark.parametrize("contact", [True, False])
def test_the_last_row_is_the_holders_stiffness(assembly, speed, contact):
    machine = machine_of().at(speed)
    assembly = assembly if contact else replace(assembly, contact=None)
    known = machine.tip(assembly, OMEGA, stiffness_spread=0.0)
    found = machine.tip(assembly, OMEGA)
    for axis in AXES:
        np.testing.assert_array_equal(changes(found, axis)[:-1], changes(known, axis))
        ahead, behind = (
            direct(machine.tip(stiffened(assembly, s), OMEGA, spread=False), axis) for s in (STIFFNESS_SPREAD, -STIFFNESS_SPREAD)
        )
        slope = 0.5 * (ahead - behind)
        assert np.linalg.norm(changes(found, axis)[-1] - slope) < 0.03 * np.linalg.norm(slope)
    # one tool-holder in both planes
    assert len(found.spread) == len(known.spread) + 1
    assert np.all(np.any(found.spread[-1], axis=0)[[0, 1], [0, 1]])


# drawings that are not exact


#: So small that a standard deviation stays linear.
MODULUS, CONTACT, STICKOUT = 1e-3, 5e-3, 2e-6
ROUGH = replace(EXACT, stickout=STICKOUT, youngs_modulus=MODULUS, contact_stiffness=CONTACT)
UNKNOWNS = (RoughUnknown("youngs_modulus", "T1", "tooling"), RoughUnknown("translational_stiffness", "T1", "tooling"))


def told_with(machine):
    """The machine whose unknowns hang on a modulus and a contact stiffness: a joint covariance, drawn once for both planes."""
    rng = np.random.default_rng(7)
    size = machine.identified[Dof.X].posterior.theta.size
    root = np.vstack([2e-3 * rng.standard_normal((size, size + 2)) / np.sqrt(size), rng.uniform(-0.4, 0.4, (2, size + 2))])
    whole = root @ root.T
    cross, own = whole[:size, size:], whole[size:, size:]
    identified = {
        axis: replace(part, posterior=replace(part.posterior, covariance=whole[:size, :size], tooling_cross=cross, tooling_covariance=own))
        for axis, part in machine.identified.items()
    }
    known = KnownToolings(UNKNOWNS, np.array([MODULUS, CONTACT]), np.array([0.5, -0.3]), own, ("T1",))
    return replace(machine, identified=identified, toolings=known), whole


def test_what_cuts_told_of_machine_and_tooling_together_is_the_tips_spread():
    """Against the joint covariance with slopes of the coupled tip along every unknown of machine and tooling."""
    machine, whole = told_with(machine_of(False))
    tooling = replace(by_hand.tooling(), name="T1", spread=ROUGH)
    found = machine.tip(tooling, OMEGA, stiffness_spread=0.0)
    values = {"youngs_modulus": MODULUS * 0.5, "translational_stiffness": CONTACT * -0.3}
    for axis in AXES:
        posterior = machine.identified[axis].posterior

        def tip(step, axis=axis, posterior=posterior):
            """The coupled tip at a step of the unknowns; of stickout and rotational stiffness nothing was told."""
            by = Alteration(
                stickout=STICKOUT * step[-1],
                rotational_stiffness=CONTACT * step[-2],
                youngs_modulus=values["youngs_modulus"] + MODULUS * step[-4],
                translational_stiffness=values["translational_stiffness"] + CONTACT * step[-3],
            )
            each = posterior.candidate(axis, posterior.theta + step[:-4])
            holder = tool_holder_receptance(altered(tooling.assembly, by), OMEGA, axis)
            return couple(holder, each.flange.receptance(OMEGA), each.joint)["tip", "tip"][:, 0, 0]

        size = posterior.theta.size + 4
        slopes = np.array([(tip(1e-3 * step) - tip(-1e-3 * step)) / 2e-3 for step in np.eye(size)])
        covariance = np.zeros((size, size))
        covariance[:-2, :-2], covariance[-2:, -2:] = whole, np.eye(2)
        rows = changes(found, axis)
        for part in (np.real, np.imag):
            expected = np.einsum("in,ij,jn->n", part(slopes), covariance, part(slopes))
            np.testing.assert_allclose(np.sum(part(rows) ** 2, axis=0), expected, rtol=0.02, atol=1e-4 * expected.max())


def test_directions_tell_whose_they_are():
    """In deviations of each unknown its moves have the size of one, and those of two are correlated as the cuts have told."""
    machine, whole = told_with(machine_of(False))
    found = machine.tip(replace(by_hand.tooling(), name="T1", spread=ROUGH), OMEGA)
    told = found.unknowns()
    assert {each: len(moves) for each, moves in told.items()} == {
        DoubtedOf.TOOL: 2,
        DoubtedOf.CONTACT: 2 * 2,
        DoubtedOf.LENGTHS: 2,
        DoubtedOf.STIFFNESS: 2,
    }
    correlation = whole[-2, -1] / np.sqrt(whole[-2, -2] * whole[-1, -1])
    for plane_ in range(2):
        modulus, contact = told[DoubtedOf.TOOL][plane_], told[DoubtedOf.CONTACT][2 * plane_]
        assert modulus @ modulus == pytest.approx(1.0)
        assert contact @ contact == pytest.approx(1.0)
        assert modulus @ contact == pytest.approx(correlation)
    # one stickout in both planes
    np.testing.assert_array_equal(*told[DoubtedOf.LENGTHS])
    # the same one by one: what cuts have told of, and what the drawing alone states
    single = found.parameters()
    assert set(single) == {"identified youngs_modulus", "identified translational_stiffness", "rotational_stiffness", "stickout"}
    np.testing.assert_array_equal(single["identified youngs_modulus"], told[DoubtedOf.TOOL])
    contacts = np.stack([single["identified translational_stiffness"], single["rotational_stiffness"]], axis=1)
    np.testing.assert_array_equal(contacts.reshape(4, -1), told[DoubtedOf.CONTACT])


def test_modes_without_a_posterior_have_no_bands(assembly):
    bare = {axis: MachineAxis(part.spindle, part.joint) for axis, part in machine_of().identified.items()}
    found = IdentifiedMachine(bare, BAND).at(2100.0).tip(assembly, OMEGA)
    assert found.variation is None
    assert not found.deviation()
    expected = machine_of().tip(assembly, OMEGA, spread=False)
    for axis in AXES:
        np.testing.assert_allclose(direct(found, axis), direct(expected, axis), rtol=1e-12)


def test_where_only_one_axis_is_doubted_only_that_one_varies(assembly):
    parts = machine_of().identified
    half = IdentifiedMachine({Dof.X: parts[Dof.X], Dof.Y: replace(parts[Dof.Y], posterior=None)}, BAND).tip(assembly, OMEGA)
    assert set(half.deviation()) == {(TIP[0], TIP[0])}
    assert not half.complete
    assert not np.any(half.spread[:, :, 1, 1])
    np.testing.assert_array_equal(half.spread[:, :, 0, 0], changes(machine_of().tip(assembly, OMEGA), Dof.X))


# planes that feel each other

FINE = 2.0 * np.pi * np.linspace(400.0, 2600.0, 89)
#: Standard deviations of the first frequency, of a shape and of the joint, and the steps from which their change is told.
DEVIATIONS, STEPS = np.array([0.01, 0.008, 0.2]), np.array([0.005, 0.004, 0.1])
RIVALS = (1.02, 0.97)


def candidate(vector):
    """A machine at three unknowns: a frequency, an oblique shape, the joint's stiffness."""
    frequency, shape, joint = vector
    modes = oblique(1.0 + frequency)
    phi = modes.phi.copy()
    phi[1] = phi[1] * (1.0 + shape) + shape * phi[2]
    stiff = {name: np.exp(joint) * getattr(JOINT, name) for name in ("translational_stiffness", "rotational_stiffness")}
    return JointedFlange(replace(modes, phi=phi), replace(JOINT, **stiff))


def doubt():
    """The steps as written down, and two rivals."""
    steps = []
    for direction, deviation, step in zip(np.eye(3), DEVIATIONS, STEPS, strict=True):
        steps.append(Perturbation(candidate(step * direction), candidate(-step * direction), deviation / (2.0 * step)))
    return Doubt(tuple(steps), tuple(JointedFlange(oblique(change), JOINT) for change in RIVALS))


class Doubted(Machine):
    """One part, both planes."""

    band = BAND

    def __init__(self, doubt):
        self.parts = (FlangePart(FLANGES, candidate(np.zeros(3)), doubt),)

    parts = ()


def tip_of(assembly, each):
    return tip_in_both_planes(assembly, each.flange, FINE, each.joint)


def test_the_spread_of_planes_that_feel_each_other_is_that_of_the_4_x_4_coupling(assembly):
    found = Doubted(doubt).tip(assembly, FINE, stiffness_spread=0.01)
    own, here = partial(tip_of, assembly), tip_of(assembly, candidate(np.zeros(3)))
    expected = [(own(s.ahead) - own(s.behind)) * s.weight for s in doubt().steps]
    expected += [own(rival) - here for rival in doubt().rivals]
    expected.append(tip_of(stiffened(assembly, 0.01), candidate(np.zeros(3))) - here)
    spread = found.spread
    assert spread.shape == (6, FINE.size, 2, 2)
    for k, each in enumerate(expected):
        np.testing.assert_allclose(spread[k], each, rtol=0.0, atol=1e-9 * np.abs(each).max())
        # reciprocal as the machine is (but for the digits that the difference of two tips loses), and oblique: cross terms vary along
        np.testing.assert_allclose(spread[k], np.swapaxes(spread[k], 1, 2), rtol=0.0, atol=1e-7 * np.abs(each).max())
        assert np.abs(spread[k][:, 0, 1]).max() > 1e-2 * np.abs(spread[k]).max()
    for (i, row), (j, col) in ((a, b) for a in enumerate(TIP) for b in enumerate(TIP)):
        real, imaginary = found.deviation()[row, col]
        np.testing.assert_allclose(real, np.linalg.norm(np.array(expected)[:, :, i, j].real, axis=0), rtol=1e-8)
        np.testing.assert_allclose(imaginary, np.linalg.norm(np.array(expected)[:, :, i, j].imag, axis=0), rtol=1e-8)


def test_the_spread_is_the_tips_slope_times_the_deviation(assembly):
    """Of the coupled tip by finite differences of a hundredth of the steps: it does not rest on them."""
    spread = Doubted(doubt).tip(assembly, FINE, stiffness_spread=0.0).spread
    for k, (direction, deviation) in enumerate(zip(np.eye(3), DEVIATIONS, strict=True)):
        small = 1e-2 * STEPS[k] * direction
        slope = (tip_of(assembly, candidate(small)) - tip_of(assembly, candidate(-small))) / (2e-2 * STEPS[k])
        assert np.linalg.norm(spread[k] - deviation * slope) < 0.02 * np.linalg.norm(spread[k])


def test_draws_are_sums_of_the_spread(assembly):
    """Steps, rivals and the holder's stiffness with independent weights, the same for all entries of the tip."""
    tip = Doubted(doubt).tip(assembly, FINE)
    drawn = tip.drawn(40, np.random.default_rng(5))
    weights = np.random.default_rng(5).standard_normal((40, len(tip.spread)))
    expected = tip.values + np.einsum("dp,pnij->dnij", weights, tip.spread)
    np.testing.assert_allclose(drawn, expected, rtol=0.0, atol=1e-12 * np.abs(expected).max())
    assert tip.complete


def test_without_a_doubt_of_the_machine_the_holder_is_not_doubted_either(assembly):
    assert Doubted(None).tip(assembly, FINE, stiffness_spread=0.01).variation is None
    nothing = Doubted(Doubt).tip(assembly, FINE, stiffness_spread=0.0)
    np.testing.assert_array_equal(nothing.spread, np.zeros((1, FINE.size, 2, 2)))
    holder = Doubted(Doubt).tip(assembly, FINE, stiffness_spread=0.01).spread
    np.testing.assert_array_equal(holder[0], Doubted(doubt).tip(assembly, FINE, stiffness_spread=0.01).spread[-1])


def test_a_flange_by_itself_and_the_spindles_end_vary_as_their_candidates_do(assembly):
    machine = Doubted(doubt)
    steps, rivals = doubt().steps, doubt().rivals
    here = candidate(np.zeros(3))
    for response, of in (
        (machine.receptance(FINE), lambda each: each.flange.receptance(FINE).values),
        (machine.coupled(assembly, FINE), lambda each: _ends(assembly, each)),
    ):
        expected = [(of(s.ahead) - of(s.behind)) * s.weight for s in steps] + [of(rival) - of(here) for rival in rivals]
        np.testing.assert_allclose(response.values, of(here), rtol=0.0, atol=1e-12 * np.abs(of(here)).max())
        for found, each in zip(response.spread, expected, strict=True):
            np.testing.assert_allclose(found, each, rtol=0.0, atol=1e-9 * np.abs(each).max())


def _ends(assembly, each):
    rows = (*plane("tip"), *plane("tip", Dof.Y), *plane("spindle"), *plane("spindle", Dof.Y))
    return coupled_in_both_planes(assembly, each.flange, FINE, each.joint).block(rows).values
