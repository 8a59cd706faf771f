"""The kernel of robots against one system of all freedoms; these tests run again without the compiler."""

import numpy as np
import pytest

from rcsa_ident.identification.arm._kernels import ArmArrays, LineArrays, PosedPoints, SpindleArrays, posed_lines


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
    shapes = (rows, outputs, 3), (rows, outputs, columns), (rows, outputs, 4), (rows, 4)
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
