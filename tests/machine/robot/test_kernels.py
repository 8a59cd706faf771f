"""The kernels of the robot against sums over bodies and differences; these tests run again without the compiler."""

from dataclasses import replace

import numpy as np
import pytest

from rcsa_ident.machine.robot import _kernels as kernels
from rcsa_ident.machine.robot.inertia import accelerations, mass_matrix, torques
from rcsa_ident.machine.robot.kinematics import posed
from rcsa_ident.machine.robot.model import Body
from tests.fixtures.robots import robot
from tests.oracles import multibody

GRAVITY = np.array([0.3, -0.2, -9.7])


@pytest.fixture(params=["tx200", "kr210"], scope="module")
def arm(request):
    return robot(request.param)


@pytest.mark.parametrize("tilts", [False, True])
def test_frames_are_products_of_matrices(arm, tilts):
    angles = np.random.default_rng(1).uniform(-2.0, 2.0, arm.freedoms(tilts))
    chain = posed(arm, angles, tilts)
    for k, frame in enumerate(multibody.frames(chain.chain, angles)):
        np.testing.assert_allclose(chain.rotation[k], frame[:3, :3], atol=1e-14)
        np.testing.assert_allclose(chain.origin[k], frame[:3, 3], atol=1e-14)


def test_jacobian_is_what_differences_say(arm):
    angles = np.random.default_rng(2).uniform(-2.0, 2.0, arm.freedoms())
    chain = posed(arm, angles, True)
    found, step = chain.jacobian(chain.flange.offset), 1e-6
    for k in range(angles.size):
        change = step * np.eye(angles.size)[k]
        ahead, behind = (posed(arm, angles + sign * change, True).flange for sign in (1.0, -1.0))
        np.testing.assert_allclose(found[:3, k], (ahead.offset - behind.offset) / (2 * step), atol=1e-8)
        skew = (ahead.turn - behind.turn) / (2 * step) @ chain.flange.turn.T
        np.testing.assert_allclose(found[3:, k], [skew[2, 1], skew[0, 2], skew[1, 0]], atol=1e-8)


@pytest.mark.parametrize("tilts", [False, True])
def test_mass_matrix_is_the_sum_over_bodies(arm, tilts):
    angles = np.random.default_rng(3).uniform(-2.0, 2.0, arm.freedoms(tilts))
    chain = posed(arm, angles, tilts)
    expected = multibody.kinetic_matrix(chain.chain, angles)
    np.testing.assert_allclose(mass_matrix(chain), expected, atol=1e-8 * np.abs(expected).max())


def test_torques_are_those_of_lagrange(arm):
    rng = np.random.default_rng(4)
    angles, rate, acceleration = rng.uniform(-2.0, 2.0, (3, 6))
    chain = posed(arm, angles)
    expected = multibody.lagrange_torques(chain.chain, angles, rate, acceleration, GRAVITY)
    np.testing.assert_allclose(torques(chain, rate, acceleration, GRAVITY), expected, atol=2e-5 * np.abs(expected).max())


@pytest.mark.parametrize("tilts", [False, True])
def test_torques_are_linear_in_the_acceleration_by_the_mass_matrix(arm, tilts):
    rng = np.random.default_rng(5)
    n = arm.freedoms(tilts)
    chain, rate = posed(arm, rng.uniform(-2.0, 2.0, n), tilts), rng.uniform(-1.0, 1.0, n)
    acceleration = rng.uniform(-5.0, 5.0, n)
    bias = torques(chain, rate, np.zeros(n), GRAVITY)
    torque = torques(chain, rate, acceleration, GRAVITY)
    np.testing.assert_allclose(mass_matrix(chain) @ acceleration + bias, torque, rtol=1e-11, atol=1e-11 * np.abs(torque).max())
    np.testing.assert_allclose(accelerations(chain, rate, torque, GRAVITY), acceleration, rtol=1e-9, atol=1e-10)


def test_a_body_that_falls_freely_needs_no_torque(arm):
    """All bodies fall as the base does: whatever the posture, no joint feels anything."""
    chain = posed(arm, np.random.default_rng(6).uniform(-2.0, 2.0, 6))
    still = np.zeros(6)
    np.testing.assert_array_equal(torques(chain, still, still, np.zeros(3)), 0.0)


def test_energy_is_kept_where_nothing_brakes():
    """A fifth of a second of free motion in steps of 2 ms, by fourth-order Runge-Kutta."""
    arm = robot("kr210")
    state, step = np.concatenate([np.radians([10.0, 20.0, 30.0, -40.0, 50.0, 60.0]), np.full(6, 0.3)]), 2e-3

    def slope(s):
        return np.concatenate([s[6:], accelerations(posed(arm, s[:6]), s[6:], np.zeros(6), GRAVITY)])

    def energy(s):
        chain = posed(arm, s[:6])
        return 0.5 * s[6:] @ mass_matrix(chain) @ s[6:] + multibody.height_energy(chain.chain, s[:6], GRAVITY)

    before = energy(state)
    for _ in range(100):
        a = slope(state)
        b = slope(state + 0.5 * step * a)
        c = slope(state + 0.5 * step * b)
        d = slope(state + step * c)
        state = state + step / 6.0 * (a + 2.0 * b + 2.0 * c + d)
    moving = 0.5 * state[6:] @ mass_matrix(posed(arm, state[:6])) @ state[6:]
    assert abs(energy(state) - before) < 1e-6 * moving


def test_solve_symmetric():
    rng = np.random.default_rng(7)
    root, right = rng.normal(size=(9, 9)), rng.normal(size=9)
    matrix = root @ root.T + np.eye(9)
    expected = np.linalg.solve(matrix, right)
    kernels.solve_symmetric(matrix, right)
    np.testing.assert_allclose(right, expected, rtol=1e-10, atol=1e-12)


def test_compiled_and_plain_agree(monkeypatch):
    """The same Python, run by the interpreter."""
    arm, rng = robot("tx200"), np.random.default_rng(8)
    angles, rate, acceleration = rng.uniform(-2.0, 2.0, (3, 18))

    def all_of_it():
        chain = posed(arm, angles, True)
        torque = torques(chain, rate, acceleration, GRAVITY)
        return chain.rotation, chain.jacobian(chain.flange.offset), mass_matrix(chain), torque, accelerations(chain, rate, torque, GRAVITY)

    compiled = all_of_it()
    for name in dir(kernels):
        plain = getattr(getattr(kernels, name), "py_func", None)
        if plain is not None:
            monkeypatch.setattr(kernels, name, plain)
    for one, other in zip(compiled, all_of_it(), strict=True):
        np.testing.assert_allclose(one, other, rtol=1e-12, atol=1e-12 * np.abs(other).max())


def test_points_of_unit_mass_weigh_as_bodies_do():
    """The torques of an arm whose links are points are the sum of theirs."""
    arm, rng = robot("kr210"), np.random.default_rng(9)
    place, weight = rng.uniform(-0.5, 0.5, (6, 3)), rng.uniform(10.0, 100.0, 6)
    points = tuple(replace(j, body=Body(m, p)) for j, m, p in zip(arm.joints, weight, place, strict=True))
    angles, rate, acceleration = rng.uniform(-2.0, 2.0, (3, 4, 6))
    own = posed(arm, angles[0]).chain
    out = np.empty((6, 6, 4))
    kernels.point_torques(own.turn, own.offset, own.axis, angles, rate, acceleration, GRAVITY, np.arange(6), place, out)
    light = replace(arm, joints=points)
    for t in range(4):
        expected = torques(posed(light, angles[t]), rate[t], acceleration[t], GRAVITY)
        np.testing.assert_allclose(weight @ out[:, :, t], expected, rtol=1e-10, atol=1e-10 * np.abs(expected).max())


def marched(model, step, seconds, tilts=False):
    """An arm whose first drive is turned on, evenly faster, while a force on its tip rises."""
    chain = model.chain(tilts)
    t = np.arange(0.0, seconds + 0.5 * step, step)
    start, n = chain.angles(np.radians([0.0, 20.0, 30.0, 10.0, -40.0, 0.0])), chain.mass.size
    held, rate = np.tile(start, (t.size, 1)), np.zeros((t.size, n))
    held[:, 0] += 0.5 * t**2
    rate[:, 0] = t
    force = np.stack([200.0 * t, -1000.0 * t, 500.0 * t], axis=1)
    play = np.zeros(n)
    play[chain.driven] = [j.backlash for j in model.joints]
    point, out = np.array([0.1, 0.05, -0.3]), np.empty((t.size, n))
    out[0] = start
    done = kernels.march(chain, play, np.zeros(3), point, np.zeros((t.size, n)), force, held, rate, step, out)
    assert done == t.size
    return t, out, play, point, start


def test_a_march_converges_to_the_equations_of_motion():
    """Beside Runge and Kutta's method on the arm's accelerations, play and all; the step's square is what is left."""
    model = robot("kr210")
    light = replace(model, joints=tuple(replace(j, tilts=()) for j in model.joints))
    seconds = 0.02
    coarse, fine = (marched(light, step, seconds)[1][-1] for step in (1e-3, 5e-4))
    _, _, play, point, start = marched(light, 1e-3, seconds)

    def slope(t, state):
        angles, speed = state[:6], state[6:]
        chain = posed(light, angles)
        held = start + np.eye(6)[0] * 0.5 * t**2
        twist = angles - held
        torque = -chain.chain.stiffness * np.sign(twist) * np.maximum(np.abs(twist) - play, 0.0)
        torque = torque - chain.chain.damping * (speed - np.eye(6)[0] * t)
        tip = chain.origin[-1] + chain.rotation[-1] @ point
        torque = torque + chain.jacobian(tip)[:3].T @ np.array([200.0 * t, -1000.0 * t, 500.0 * t])
        return np.concatenate([speed, accelerations(chain, speed, torque, np.zeros(3))])

    state, step = np.concatenate([start, np.zeros(6)]), 2e-5
    for k in range(round(seconds / step)):
        t = k * step
        a = slope(t, state)
        b = slope(t + 0.5 * step, state + 0.5 * step * a)
        c = slope(t + 0.5 * step, state + 0.5 * step * b)
        d = slope(t + step, state + step * c)
        state = state + step / 6.0 * (a + 2.0 * b + 2.0 * c + d)
    moved = np.abs(state[:6] - start).max()
    off, finer = (np.abs(each - state[:6]).max() for each in (coarse, fine))
    assert off < 2e-3 * moved
    assert finer < 0.4 * off


def test_a_march_at_rest_stays_there():
    model = robot("kr210")
    n = model.freedoms()
    start = model.chain().angles(np.radians([0.0, 20.0, 30.0, 10.0, -40.0, 0.0]))
    held, still, out = np.tile(start, (20, 1)), np.zeros((20, n)), np.empty((20, n))
    out[0] = start
    done = kernels.march(model.chain(), np.zeros(n), np.zeros(3), np.zeros(3), still, np.zeros((20, 3)), held, still, 1e-3, out)
    assert done == 20
    np.testing.assert_array_equal(out, held)


def test_a_march_that_finds_nothing_says_where():
    model = robot("kr210")
    n = model.freedoms()
    held, still, out = np.zeros((5, n)), np.zeros((5, n)), np.zeros((5, n))
    force = np.zeros((5, 3))
    force[3] = np.nan
    assert kernels.march(model.chain(), np.zeros(n), np.zeros(3), np.zeros(3), still, force, held, still, 1e-3, out) == 3
