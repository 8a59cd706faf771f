"""The kernel of both planes against dense solutions and other roads; these tests run again without the compiler."""

from dataclasses import replace
from itertools import product
from typing import NamedTuple

import numpy as np
import pytest

from rcsa_ident.coupling.rcsa import couple
from rcsa_ident.dynamics.coordinates import Dof, plane
from rcsa_ident.dynamics.receptance import Receptance
from rcsa_ident.identification._kernels.frf import cross_frf, cross_frf_gradient
from rcsa_ident.identification.coupled._kernels import BLOCK, MachineArrays, PointArrays, coupled_frf, coupled_frf_gradient
from rcsa_ident.identification.coupled.posterior import CoupledUnknowns
from rcsa_ident.identification.data import LEVER
from rcsa_ident.identification.misfit import complex_columns
from rcsa_ident.identification.modal_parameters import ModalParameters, residual_turn, side_by_side
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


class Found(NamedTuple):
    """What the kernels say of an axis: displacement by each force (n, o, 2), its gradient (n, o, q), that with B's upper triangle by rows
    (n, o, 10), and the slope that the flange's sensor sees (n,).
    """

    parts: np.ndarray
    gradient: np.ndarray
    felt: np.ndarray
    turned: np.ndarray


def fill(machine, joint, at, outputs, seen=NOTHING):
    """What the kernels say of both axes; a place that they leave out stays NaN."""
    m = machine.order
    pairs, gyroscopic = m * (m + 1) // 2, m * (m - 1) // 2 * (machine.skew.size > 0)
    rows = 5 * m + pairs + 10 + 4 + (2 * m + 8) * (outputs == 2) + pairs * (machine.softening.size > 0)
    counts = [int(np.sum(at.place[:, axis] >= 0)) for axis in range(2)]
    parts = tuple(np.full((n, outputs, 2), np.nan, dtype=complex) for n in counts)
    slopes = tuple(np.full(n, np.nan, dtype=complex) for n in counts)
    taken = arrays(machine, joint, np.ascontiguousarray(seen))
    kept = coupled_frf(taken, at, parts, slopes)
    found, bare = [], slice(5 * m + pairs, 5 * m + pairs + 10)
    for axis, n in enumerate(counts):
        out, across = np.full((rows, 2 * n * outputs), np.nan), np.full((gyroscopic, 2 * n * outputs), np.nan)
        coupled_frf_gradient(taken, at, axis, kept, np.ones((n, outputs), dtype=complex), np.ones(rows), out, across)
        felt = complex_columns(out[bare]).reshape(n, outputs, 10)
        out[bare] = residual_turn(machine.residual).T @ out[bare]
        gradient = complex_columns(np.vstack([out[:-4], across, out[-4:]])).reshape(n, outputs, rows + gyroscopic)
        found.append(Found(parts[axis], gradient, felt, slopes[axis]))
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
    for lines, truth in zip(fill(machine, joint, at, outputs, seen), expected, strict=True):
        np.testing.assert_allclose(lines.parts, truth, rtol=1e-10, atol=1e-12 * np.abs(truth).max())


def test_points_of_several_blocks_are_those_of_each_alone():
    """Also of the last one, which is not full."""
    at = points(2 * BLOCK + 3)
    machine, joint = machine_of(CoupledLayout(MODES, True, True, EVERY_PAIR))
    whole = fill(machine, joint, at, 2)
    for f in (0, BLOCK - 1, BLOCK, 2 * BLOCK + 2):
        own = PointArrays(*(each[f : f + 1] for each in at))
        alone = fill(machine, joint, own._replace(place=np.where(own.place < 0, -1, 0)), 2)
        for axis in range(2):
            if at.place[f, axis] >= 0:
                for one, other in zip(alone[axis], whole[axis], strict=True):
                    np.testing.assert_allclose(one[0], other[at.place[f, axis]], rtol=1e-12, atol=1e-300)


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
            moved = lines.felt @ np.outer(r, r)[np.triu_indices(4)]
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
