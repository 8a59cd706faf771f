"""The kernel of both planes against dense solutions and other roads; these tests run again without the compiler."""

from dataclasses import replace
from itertools import product

import numpy as np
import pytest

from rcsa_ident.coupling.rcsa import couple
from rcsa_ident.dynamics.coordinates import Dof, plane
from rcsa_ident.dynamics.receptance import Receptance
from rcsa_ident.identification._kernels.frf import cross_frf, cross_frf_gradient
from rcsa_ident.identification.coupled._kernels import (
    ArmArrays,
    LineArrays,
    MachineArrays,
    PointArrays,
    PosedPoints,
    SpindleArrays,
    coupled_lines,
    posed_lines,
)
from rcsa_ident.identification.coupled.posterior import CoupledUnknowns
from rcsa_ident.identification.data import LEVER
from rcsa_ident.identification.modal_parameters import ModalParameters, side_by_side
from rcsa_ident.identification.unknowns import (
    EVERY_PAIR,
    CoupledLayout,
    Layout,
    ModalBlock,
    joint_of,
    scaled_joint,
    strict_triangle,
    unpack,
)
from rcsa_ident.identification.unknowns import unpack as unpack_axis
from rcsa_ident.machine.mode_synthesis import FLANGE
from rcsa_ident.signals.motion import FLANGE_ALONE, GAP_AND_FIXTURE
from rcsa_ident.tool_holder.geometry import MATERIALS, BeamSegment, ToolAssembly
from rcsa_ident.tool_holder.turning import turning_receptance
from tests.identification.coupled.models import coupled_vector, dense_lines
from tests.identification.models import vector_of

MODES = 3
KINDS = list(product((1, 2), (False, True), (0, EVERY_PAIR)))
SCALE = np.array([1.0, LEVER, 1.0, LEVER])
#: Sensors that look at the flange itself.
NOTHING = np.zeros((2, 2))
#: That along X behind it, that along Y in front of it, at the holder: distance over the lever, side; and the other way round.
ELSEWHERE = np.array([[0.3, 0.0], [-0.2, 1.0]])
SEEN = [NOTHING, ELSEWHERE, ELSEWHERE[::-1]]


def points(count=7, seed=3, symmetric=False):
    """Random substructures of a real one's size; some lines were measured in X only, some in Y, most in both, in no order."""
    rng = np.random.default_rng(seed)
    flange = 1e-8 * (rng.standard_normal((count, 4, 4)) + 1j * rng.standard_normal((count, 4, 4)))
    tip = 1e-8 * (rng.standard_normal((count, 4, 2)) + 1j * rng.standard_normal((count, 4, 2)))
    if symmetric:
        flange = flange + flange.transpose(0, 2, 1)
    place = np.stack([[*rng.permutation(count - 1).tolist(), -1], [-1, *rng.permutation(count - 1).tolist()]], axis=1)
    omega = 2.0 * np.pi * rng.uniform(300.0, 4500.0, count)
    force = 100.0 * (rng.standard_normal((count, 2)) + 1j * rng.standard_normal((count, 2)))
    return PointArrays(omega, rng.uniform(-1.0, 1.0, count), rng.uniform(800.0, 2100.0, count), place.astype(np.intp), flange, tip, force)


def machine_of(layout, seed=1):
    theta = coupled_vector(layout, seed)
    return unpack(theta, layout.block), scaled_joint(theta[layout.joint])


def arrays(machine, joint, seen=NOTHING):
    psi = np.hstack([machine.psi, machine.places])
    skew, fixture_residual = machine.skew, machine.place_residual
    return MachineArrays(machine.omega_n, psi, machine.factor, machine.softening, skew, machine.residual, fixture_residual, joint, seen)


def fill(machine, joint, at, outputs, gradient=True, seen=NOTHING):
    """What the kernel says of both axes; a place that it leaves out stays NaN."""
    m = machine.order
    columns = 5 * m + m * (m + 1) // 2 + 10 + 4
    columns += (2 * m + 8) * (outputs == 2) + m * (m + 1) // 2 * (machine.softening.size > 0) + m * (m - 1) // 2 * (machine.skew.size > 0)
    found = []
    for axis in range(2):
        n = int(np.sum(at.place[:, axis] >= 0))
        rows = n if gradient else 0
        shapes = (n, outputs, 2), (rows, outputs, columns), (rows, outputs, 4), (rows, 4), (rows,)
        found.append(LineArrays(*(np.full(shape, np.nan, dtype=complex) for shape in shapes)))
    coupled_lines(arrays(machine, joint, np.ascontiguousarray(seen)), at, *found)
    return found


def expected_lines(machine, joint, at, outputs, seen=NOTHING):
    """The same from dense solutions, by axis: shape (n, o, 2) each."""
    both = dense_lines(machine, joint, at, seen) * at.force[:, None, None, :]
    both = both if outputs == 2 else both.sum(axis=2, keepdims=True)
    found = []
    for axis in range(2):
        own = np.flatnonzero(at.place[:, axis] >= 0)
        lines = np.empty((own.size, outputs, 2), dtype=complex)
        lines[at.place[own, axis]] = both[own, axis]
        found.append(lines)
    return found


@pytest.mark.parametrize("seen", SEEN)
@pytest.mark.parametrize(("outputs", "softening", "skew"), KINDS)
def test_lines_are_those_of_dense_solutions(outputs, softening, skew, seen):
    at = points()
    machine, joint = machine_of(CoupledLayout(MODES, outputs == 2, softening, skew))
    expected = expected_lines(machine, joint, at, outputs, seen)
    for gradient in (True, False):
        for lines, truth in zip(fill(machine, joint, at, outputs, gradient, seen), expected, strict=True):
            np.testing.assert_allclose(lines.parts, truth, rtol=1e-10, atol=1e-12 * np.abs(truth).max())


def test_light_damping_and_strong_moments_need_no_pivoting():
    """At the very resonance, where the diagonal is next to nothing and the gyroscopic coupling beside it is not."""
    machine, joint = machine_of(CoupledLayout(6, skew=EVERY_PAIR))
    light = 1e-3 * machine.factor
    at = points(7)._replace(omega=np.append(machine.omega_n, 9000.0))
    machine = replace(machine, factor=light)
    for lines, truth in zip(fill(machine, joint, at, 1), expected_lines(machine, joint, at, 1), strict=True):
        np.testing.assert_allclose(lines.parts, truth, rtol=1e-7, atol=1e-8 * np.abs(truth).max())


def shifted(machine, joint, k, step, outputs):
    """The machine with the unknown of a column of the gradient moved; frequencies by a share."""
    m, lower = machine.order, np.tril_indices(machine.order)
    parts = [machine.omega_n.copy(), machine.psi.copy(), machine.factor[lower], machine.residual[np.tril_indices(4)]]
    parts += [np.hstack([machine.places.T, machine.place_residual])] if outputs == 2 else []
    parts += [machine.softening[lower]] if machine.softening.size else []
    parts += [machine.skew[strict_triangle(m)]] if machine.skew.size else []
    parts.append(joint.copy())
    for part in parts:
        if k < part.size:
            part.flat[k] *= np.exp(step) if part is parts[0] else 1.0
            part.flat[k] += 0.0 if part is parts[0] else step
            break
        k -= part.size
    factor, residual, softening, skew = np.zeros((m, m)), np.zeros((4, 4)), machine.softening, machine.skew
    factor[lower], residual[np.tril_indices(4)] = parts[2], parts[3]
    rest = parts[4:-1]
    fixture, fixture_residual = machine.places, machine.place_residual
    if outputs == 2:
        beside, *rest = rest
        fixture, fixture_residual = beside[:, :m].T, beside[:, m:]
    if softening.size:
        softening = np.zeros((m, m))
        softening[lower] = rest.pop(0)
        softening = softening + np.tril(softening, -1).T
    if skew.size:
        skew = np.zeros((m, m))
        skew[strict_triangle(m)] = rest.pop(0)
        skew = skew - skew.T
    return ModalParameters(parts[0], parts[1], factor, residual, fixture, fixture_residual, softening, skew=skew), parts[-1]


def sizes(machine, joint, outputs):
    """How large the unknown of each column of the gradient is, or its kind where it may be nothing."""
    m = machine.order
    pairs = m * (m + 1) // 2
    parts = [np.ones(m), np.full(4 * m, 0.3), np.full(pairs, 10.0), np.full(10, 3e-5)]
    parts += [*[np.full(m, 0.1), np.full(4, 1e-9)] * 2] if outputs == 2 else []
    parts += [np.full(pairs, 0.1)] if machine.softening.size else []
    parts += [np.full(m * (m - 1) // 2, 0.2)] if machine.skew.size else []
    return np.concatenate([*parts, joint])


@pytest.mark.parametrize("seen", SEEN[:2])
@pytest.mark.parametrize(("outputs", "softening", "skew"), KINDS)
def test_gradient_against_differences_of_dense_solutions(outputs, softening, skew, seen):
    at = points(4)
    machine, joint = machine_of(CoupledLayout(MODES, outputs == 2, softening, skew))
    found = fill(machine, joint, at, outputs, seen=seen)
    size = sizes(machine, joint, outputs)
    assert all(lines.gradient.shape[2] == size.size for lines in found)

    def lines_at(k, step):
        return [each.sum(axis=2) for each in expected_lines(*shifted(machine, joint, k, step, outputs), at, outputs, seen)]

    for k, unit in enumerate(size):
        h = 3e-4 * unit
        near, far = ([(a - b) for a, b in zip(lines_at(k, s), lines_at(k, -s), strict=True)] for s in (h, 2.0 * h))
        for axis, (one, two) in enumerate(zip(near, far, strict=True)):
            difference = (8.0 * one - two) / (12.0 * h)
            gradient = found[axis].gradient[:, :, k]
            scale = max(np.abs(difference).max(), 1e-4 * np.abs(found[axis].parts).max() / unit)
            assert np.abs(gradient - difference).max() < 1e-7 * scale, (axis, k)


@pytest.mark.parametrize("seen", SEEN)
@pytest.mark.parametrize("outputs", [1, 2])
def test_the_slope_is_the_change_with_the_distance(outputs, seen):
    at = points(5)
    machine, joint = machine_of(CoupledLayout(MODES, outputs == 2, skew=EVERY_PAIR))
    found = fill(machine, joint, at, outputs, seen=seen)
    step = np.array([[1e-3, 0.0]])
    near, far = (expected_lines(machine, joint, at, outputs, seen + sign * step) for sign in (-1.0, 1.0))
    for lines, a, b in zip(found, far, near, strict=True):
        np.testing.assert_allclose(lines.turned, (a - b).sum(axis=2)[:, 0] / 2e-3, rtol=1e-7)


@pytest.mark.parametrize("seen", SEEN)
@pytest.mark.parametrize("outputs", [1, 2])
def test_a_change_of_the_flange_moves_a_line_by_what_it_feels(outputs, seen):
    """v^T dB x for any dB: a static compliance more, between any two directions; the fixture does not move with it."""
    at = points(5)
    machine, joint = machine_of(CoupledLayout(MODES, outputs == 2, skew=EVERY_PAIR))
    found = fill(machine, joint, at, outputs, seen=seen)
    # a residual R R^T with a step along r r^T, r any direction
    static = machine.residual @ machine.residual.T
    for r in np.vstack([np.eye(4), [[1.0, -0.5, 2.0, 0.3]]]):
        step = 1e-5 * np.trace(static)
        ahead, behind = (
            ModalParameters(
                *(
                    np.linalg.cholesky(static + sign * step * np.outer(r, r)) if name == "residual" else getattr(machine, name)
                    for name in ModalParameters.__slots__
                )
            )
            for sign in (1.0, -1.0)
        )
        both = (expected_lines(each, joint, at, outputs, seen) for each in (ahead, behind))
        for lines, a, b in zip(found, *both, strict=True):
            difference = (a - b).sum(axis=2) / (2.0 * step)
            moved = np.einsum("noi,i,j,nj->no", lines.felt, r, r, lines.moved)
            np.testing.assert_allclose(moved, difference, atol=1e-7 * np.abs(difference).max())


@pytest.mark.parametrize("softening", [False, True])
@pytest.mark.parametrize("outputs", [1, 2])
def test_planes_that_feel_nothing_of_each_other_are_those_of_the_kernel_of_one(outputs, softening):
    layout = Layout((ModalBlock(3, outputs - 1, softening=softening), ModalBlock(2, outputs - 1, softening=softening)))
    theta = vector_of(layout, ((600.0, 1400.0, 2500.0), (900.0, 2100.0)))
    joint = scaled_joint(theta[layout.joint])
    at = points(9, symmetric=True)
    across = np.ix_(range(9), [0, 1], [2, 3])
    at.flange[across] = at.flange.transpose(0, 2, 1)[across] = 0.0
    at.tip[:, :2, 1] = at.tip[:, 2:, 0] = 0.0
    planes = [unpack_axis(theta[layout.axis(i)], part) for i, part in enumerate(layout.axes)]
    found = fill(side_by_side(*planes), joint, at, outputs, seen=ELSEWHERE)
    first = 0
    for i, (plane_of, lines) in enumerate(zip(planes, found, strict=True)):
        own = np.flatnonzero(at.place[:, i] >= 0)
        own = own[np.argsort(at.place[own, i])]
        d = 2 * i
        block = at.flange[own, d : d + 2, d : d + 2]
        holder = np.zeros((own.size, 8), dtype=complex)
        holder[:, :5] = np.stack([block[:, 0, 0], block[:, 0, 1], block[:, 1, 1], at.tip[own, d, i], at.tip[own, d + 1, i]], axis=1)
        size, half = layout.axes[i].size + 4, own.size * outputs
        points_of = np.stack([at.omega[own], np.ones(own.size), np.zeros(own.size), np.ones(own.size), at.x[own]], axis=1)
        shares = FLANGE_ALONE if outputs == 1 else GAP_AND_FIXTURE
        seen = ELSEWHERE[i].copy()
        machine = plane_of.omega_n, plane_of.shapes, plane_of.factor, plane_of.softening, joint
        values, kept, _ = cross_frf(*machine, (shares, seen), points_of, holder)
        rows, weight = np.empty((size, 2 * half)), np.ones((own.size, outputs), dtype=complex)
        machine = plane_of.omega_n, plane_of.factor, plane_of.softening, joint, (shares, seen)
        cross_frf_gradient(*machine, points_of, kept, weight, np.ones(size), rows)
        gradient = (rows[:, :half] + 1j * rows[:, half:]).T.reshape(own.size, outputs, size)
        force = at.force[own, i, None]
        np.testing.assert_allclose(lines.parts[:, :, i], values * force, rtol=1e-12, atol=1e-13 * np.abs(values * force).max())
        # the other plane's force does nothing here
        assert not lines.parts[:, :, 1 - i].any()
        m = plane_of.order
        # frequencies, and the joint, which both kernels hold in the same way
        np.testing.assert_allclose(lines.gradient[:, :, first : first + m], gradient[:, :, :m] * force[..., None], rtol=1e-9, atol=1e-20)
        np.testing.assert_allclose(lines.gradient[:, :, -4:], gradient[:, :, -4:] * force[..., None], rtol=1e-9, atol=1e-30)
        other = np.arange(3, 5) if i == 0 else np.arange(3)
        assert not lines.gradient[:, :, other].any()
        first += m


@pytest.mark.parametrize("sense", [1, -1])
def test_lines_are_those_of_a_turning_tool_holder_on_turning_modes(sense):
    """The room of couplings takes both as substructures: four directions, one spindle speed."""
    layout = CoupledLayout(4, softening=True, skew=2, turning=sense)
    theta = coupled_vector(layout)
    unknowns = CoupledUnknowns(theta, layout)
    steel = MATERIALS["steel"]
    assembly = ToolAssembly((BeamSegment(0.08, 0.06, steel), BeamSegment(0.05, 0.03, steel)), (BeamSegment(0.06, 0.016, steel),), 0.0)
    speed, x = 1800.0, 0.4
    omega = speed * 4.0 * np.arange(1.0, 5.0)
    holder = turning_receptance(assembly, omega, sense * speed)
    spindle = unknowns.modes(speed, x).receptance(omega)
    spindle = Receptance(omega, spindle.values, FLANGE, FLANGE)
    joint = theta[layout.joint]
    whole = couple(holder, spindle, joint_of(joint))["spindle", "tip"]
    directions = [i for i, c in enumerate(holder.rows) if str(c).startswith("flange")]
    tips = [i for i, c in enumerate(holder.rows) if c in (plane("tip", Dof.X)[0], plane("tip", Dof.Y)[0])]
    flange = holder.values[np.ix_(range(4), directions, directions)] * np.outer(SCALE, SCALE)
    tip = holder.values[np.ix_(range(4), directions, tips)] * SCALE[:, None]
    place = np.stack([np.arange(4)] * 2, axis=1)
    force = np.tile(np.array([30.0 + 10.0j, -20.0 + 5.0j]), (4, 1))
    at = PointArrays(omega, np.full(4, x), np.full(4, speed), place, flange, tip, force)
    for i, lines in enumerate(fill(unpack(theta, layout.block), scaled_joint(joint), at, 1)):
        expected = whole[:, 2 * i, [0, 2]] * force
        np.testing.assert_allclose(lines.parts[:, 0], expected, rtol=1e-7, atol=1e-9 * np.abs(expected).max())


def posed(seed=4, freedoms=5, modes=3, postures=2, bodies=2, count=4):
    """An arm, a spindle and points of random numbers, of a real robot's size."""
    rng = np.random.default_rng(seed)
    roots = rng.standard_normal((postures, bodies, 6, freedoms)) * 3.0
    mass = np.einsum("cbki,cbkj->cij", roots, roots) + np.eye(freedoms)
    arm = ArmArrays(
        mass, roots, rng.standard_normal((postures, freedoms, 6)), rng.uniform(1e5, 5e6, freedoms), rng.uniform(1e2, 1e3, freedoms)
    )
    factor = np.tril(rng.standard_normal((modes, modes))) + 8.0 * np.eye(modes)
    spindle = SpindleArrays(
        2.0 * np.pi * rng.uniform(500.0, 3000.0, modes),
        0.3 * rng.standard_normal((modes, 4)),
        0.3 * rng.standard_normal((modes, 4)),
        factor,
        3e-5 * np.tril(rng.standard_normal((4, 4))),
        np.array([2e9, 5e8, 1e3, 1e2]),
    )
    flange = 1e-8 * (rng.standard_normal((count, 6, 6)) + 1j * rng.standard_normal((count, 6, 6)))
    tip = 1e-8 * (rng.standard_normal((count, 6, 3)) + 1j * rng.standard_normal((count, 6, 3)))
    force = 100.0 * (rng.standard_normal((count, 3)) + 1j * rng.standard_normal((count, 3)))
    place = np.stack([[2, 0, 1, -1], [-1, 1, 0, 2]], axis=1).astype(np.intp)
    omega = 2.0 * np.pi * rng.uniform(10.0, 900.0, count)
    return arm, spindle, PosedPoints(omega, np.arange(count) % postures, place, flange, tip, force)


def room_of(outputs, columns, rows=3):
    shapes = (rows, outputs, 3), (rows, outputs, columns), (rows, outputs, 4), (rows, 4), (0,)
    return LineArrays(*(np.full(shape, np.nan, dtype=complex) for shape in shapes))


def posed_dense(arm, spindle, points, outputs):
    """The same by one system of all freedoms at a time, nothing eliminated: arm, spindle, and what the joint's force does to both sides."""
    found = np.full((2, 3, outputs, 3), np.nan, dtype=complex)
    n, m = arm.stiffness.size, spindle.omega_n.size
    for f, w in enumerate(points.omega):
        hand = arm.shapes[points.posture[f]]
        across = hand[:, :4] @ spindle.pull.T
        mass = np.block([[arm.mass[points.posture[f]], across], [across.T, np.eye(m)]])
        damping = np.zeros((n + m, n + m))
        damping[:n, :n], damping[n:, n:] = np.diag(arm.damping), spindle.factor @ spindle.factor.T
        stiffness = np.diag(np.concatenate([arm.stiffness, spindle.omega_n**2]))
        moves = np.vstack([hand, np.pad(spindle.psi, ((0, 0), (0, 2)))])
        gives = np.zeros((6, 6), dtype=complex)
        gives[:4, :4] = spindle.residual @ spindle.residual.T
        both = points.flange[f] + gives
        k_t, k_r, c_t, c_r = spindle.joint
        both += np.diag(np.tile([1.0 / (k_t + 1j * w * c_t), 1.0 / (k_r + 1j * w * c_r)], 3))
        # freedoms and the six forces through the joint
        whole = np.block([[stiffness - w**2 * mass + 1j * w * damping, -moves], [moves.T, both]])
        right = np.vstack([np.zeros((n + m, 3)), points.tip[f] * points.force[f]])
        answer = np.linalg.solve(whole, right)
        flange = moves.T @ answer[: n + m] + gives @ answer[n + m :]
        fixture = hand.T @ answer[:n]
        for axis in range(2):
            if points.place[f, axis] >= 0:
                own = [flange[2 * axis]] if outputs == 1 else [flange[2 * axis] - fixture[2 * axis], fixture[2 * axis]]
                found[axis, points.place[f, axis]] = own
    return found


@pytest.mark.parametrize("outputs", [1, 2])
def test_a_robots_lines_are_those_of_one_system(outputs):
    arm, spindle, points = posed()
    lines = [room_of(outputs, 60) for _ in range(2)]
    posed_lines(arm, spindle, points, *lines)
    expected = posed_dense(arm, spindle, points, outputs)
    for found, other in zip(lines, expected, strict=True):
        np.testing.assert_allclose(found.parts, other, rtol=1e-8, atol=1e-12 * np.abs(other).max())


def posed_parts(arm, spindle):
    """The unknowns of the gradient's columns as one vector, and how large each is."""
    m = spindle.omega_n.size
    parts = [arm.stiffness, arm.damping, np.zeros(arm.bodies.shape[1]), np.log(spindle.omega_n), spindle.psi.ravel(), spindle.pull.ravel()]
    parts += [spindle.factor[np.tril_indices(m)], spindle.residual[np.tril_indices(4)], spindle.joint]
    size = [*parts[:2], np.ones(parts[2].size), np.ones(m), *(np.full(4 * m, 0.3),) * 2, np.full(parts[6].size, 8.0), np.full(10, 3e-5)]
    return np.concatenate(parts), np.concatenate([*size, spindle.joint])


def posed_of(theta, arm, spindle):
    """Arm and spindle of such a vector."""
    n, b, m = arm.stiffness.size, arm.bodies.shape[1], spindle.omega_n.size
    stiffness, damping, bodies, omega_n, psi, pull, factor, residual, joint = np.split(
        theta, np.cumsum([n, n, b, m, 4 * m, 4 * m, m * (m + 1) // 2, 10])
    )
    mass = arm.mass + np.einsum("b,cbki,cbkj->cij", np.exp(bodies) - 1.0, arm.bodies, arm.bodies)
    lower = np.zeros((m, m)), np.zeros((4, 4))
    lower[0][np.tril_indices(m)], lower[1][np.tril_indices(4)] = factor, residual
    spindle = SpindleArrays(np.exp(omega_n), psi.reshape(m, 4), pull.reshape(m, 4), *lower, joint)
    return arm._replace(mass=mass, stiffness=stiffness, damping=damping), spindle


@pytest.mark.parametrize("outputs", [1, 2])
def test_a_robots_gradient_against_differences_of_one_system(outputs):
    arm, spindle, points = posed()
    theta, size = posed_parts(arm, spindle)
    lines = [room_of(outputs, theta.size) for _ in range(2)]
    posed_lines(arm, spindle, points, *lines)
    found = np.stack([each.gradient for each in lines])
    for k in range(theta.size):
        step = np.zeros(theta.size)
        step[k] = 1e-5 * size[k]
        ahead, behind = (posed_dense(*posed_of(theta + sign * step, arm, spindle), points, outputs).sum(axis=-1) for sign in (1.0, -1.0))
        slope = (ahead - behind) / 2e-5
        np.testing.assert_allclose(size[k] * found[..., k], slope, rtol=1e-5, atol=1e-6 * np.abs(slope).max(), err_msg=str(k))
    # without a gradient all are the same
    bare = [room_of(outputs, theta.size)._replace(gradient=np.empty((0, outputs, theta.size), dtype=complex)) for _ in range(2)]
    posed_lines(arm, spindle, points, *bare)
    for one, two in zip(bare, lines, strict=True):
        np.testing.assert_array_equal(one.parts, two.parts)


@pytest.mark.parametrize("outputs", [1, 2])
def test_a_change_of_a_robots_flange_moves_a_line_by_what_it_feels(outputs):
    arm, spindle, points = posed()
    lines = [room_of(outputs, posed_parts(arm, spindle)[0].size) for _ in range(2)]
    posed_lines(arm, spindle, points, *lines)
    rng = np.random.default_rng(5)
    for _ in range(4):
        way = 1e-5 * rng.standard_normal(4)
        static = spindle.residual @ spindle.residual.T
        changed = [spindle._replace(residual=np.linalg.cholesky(static + k * 1e-3 * np.outer(way, way))) for k in range(3)]
        still, ahead, further = (posed_dense(arm, each, points, outputs).sum(axis=-1) for each in changed)
        slope = (4.0 * ahead - 3.0 * still - further) / 2e-3
        felt = np.stack([(each.felt @ way) * (each.moved @ way)[:, None] for each in lines])
        np.testing.assert_allclose(felt, slope, rtol=1e-4, atol=1e-6 * np.abs(slope).max())
