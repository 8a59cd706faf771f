"""Each kernel beside a slow twin: complex numbers and dense matrices, one line of algebra a step."""

from __future__ import annotations

import numpy as np
import pytest

from rcsa_ident.observer._kernels import coupled_smoothed, coupled_steps, kalman_steps, modal_filter, smoothed_force

PLANTS, FORCES, NOISES, SAMPLES, SETTLING = 3, 2, 2, 60, 4


@pytest.fixture
def system():
    """Modes, gains that change for a few steps, measurements; dense matrices of the same."""
    rng = np.random.default_rng(7)
    m = PLANTS + FORCES + NOISES
    decay = rng.uniform(0.5, 0.95, m) * np.exp(1j * rng.uniform(0.1, 2.0, m))
    observed, through = rng.normal(size=(2, m)), 0.3
    observed[:, PLANTS : PLANTS + FORCES] = 0.0
    gain, row = 0.05 * rng.normal(size=(SETTLING, 2, m)), rng.normal(size=(SETTLING, 2, m))
    variance = rng.uniform(1.0, 2.0, SETTLING)
    a = np.zeros((2 * m, 2 * m))
    for k, z in enumerate(decay):
        a[2 * k : 2 * k + 2, 2 * k : 2 * k + 2] = [[z.real, -z.imag], [z.imag, z.real]]
    force = np.zeros(2 * m)
    force[2 * PLANTS : 2 * (PLANTS + FORCES) : 2] = 1.0
    plants = np.zeros(2 * m)
    plants[: 2 * PLANTS : 2] = 1.0
    a = a + np.outer(plants, force)
    seen = observed.T.ravel() + through * force
    parts = np.stack([decay.real, decay.imag])
    return (parts, observed, PLANTS, FORCES, through), gain, row, variance, (a, seen, force), rng.normal(size=SAMPLES)


def filtered(gain, dense, measured):
    a, seen, force = dense
    x, result = np.zeros(force.size), []
    for k, z in enumerate(measured):
        x = a @ x
        innovation = z - seen @ x
        x = x + gain[min(k, len(gain) - 1)].T.ravel() * innovation
        result.append((force @ x, x[2 * PLANTS], innovation))
    return np.array(result), x


def test_kalman_steps(system):
    arrays, gain, _, _, dense, measured = system
    expected, last = filtered(gain, dense, measured)
    state, result = np.zeros((2, PLANTS + FORCES + NOISES)), np.empty((SAMPLES, 3))
    kalman_steps(*arrays, gain, 0, measured, state, result)
    np.testing.assert_allclose(result, expected, rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(state.T.ravel(), last, rtol=1e-9, atol=1e-12)
    # in two blocks, the second knows how many steps went before
    state, parts = np.zeros_like(state), []
    for first, last_sample in ((0, 2), (2, SAMPLES)):
        part = np.empty((last_sample - first, 3))
        kalman_steps(*arrays, gain, first, measured[first:last_sample], state, part)
        parts.append(part)
    np.testing.assert_array_equal(np.vstack(parts), result)


def test_smoothed_force(system):
    """The backward recursion with full matrices."""
    arrays, gain, row, variance, dense, measured = system
    a, seen, force = dense
    result, _ = filtered(gain, dense, measured)
    adjoint, expected = np.zeros(force.size), np.empty(SAMPLES)
    for k in range(SAMPLES - 1, -1, -1):
        j = min(k, SETTLING - 1)
        expected[k] = result[k, 0] - row[j].T.ravel() @ adjoint
        kept = np.eye(force.size) - np.outer(gain[j].T.ravel(), seen)
        adjoint = a.T @ (kept.T @ adjoint - seen * result[k, 2] / variance[j])
    found = smoothed_force(*arrays, gain, variance, row, np.ascontiguousarray(result[:, 2]), np.ascontiguousarray(result[:, 0]))
    np.testing.assert_allclose(found, expected, rtol=1e-9, atol=1e-12)


def test_modal_filter():
    rng = np.random.default_rng(5)
    decay = np.array([0.9 * np.exp(0.4j), 0.5, 0.7 * np.exp(2.0j)])
    gain, signal = rng.normal(size=3) + 1j * rng.normal(size=3), rng.normal(size=80)
    x, expected = np.zeros(3, dtype=complex), []
    for u in signal:
        expected.append(0.25 * u + 2.0 * np.sum(gain * x).real)
        x = decay * x + u
    state = np.zeros((2, 3))
    found = modal_filter(*(np.stack([v.real, v.imag]) for v in (decay, gain)), 0.25, signal, state)
    np.testing.assert_allclose(found, expected, rtol=1e-10, atol=1e-12)
    np.testing.assert_allclose(state[0] + 1j * state[1], x, rtol=1e-10)


@pytest.fixture
def coupled():
    """Two forces with two and one modes, two measurements that both see the plant; dense matrices of the same."""
    rng = np.random.default_rng(11)
    ends = np.array([PLANTS, PLANTS + 2, PLANTS + 3])
    m = ends[-1] + NOISES
    decay = rng.uniform(0.5, 0.9, m) * np.exp(1j * rng.uniform(0.1, 2.0, m))
    inputs, observed, through = rng.normal(size=(2, 2, PLANTS)), rng.normal(size=(2, 2, m)), rng.normal(size=(2, 2))
    observed[:, :, PLANTS : ends[-1]] = 0.0
    gain, row = 0.03 * rng.normal(size=(SETTLING, 2, 2, m)), rng.normal(size=(SETTLING, 2, 2, m))
    a, forces = np.zeros((2 * m, 2 * m)), np.zeros((2, 2 * m))
    for k, z in enumerate(decay):
        a[2 * k : 2 * k + 2, 2 * k : 2 * k + 2] = [[z.real, -z.imag], [z.imag, z.real]]
    for c in range(2):
        forces[c, 2 * ends[c] : 2 * ends[c + 1] : 2] = 1.0
        a[: 2 * PLANTS] += np.outer(inputs[c].T.ravel(), forces[c])
    seen = observed.transpose(0, 2, 1).reshape(2, -1) + through @ forces
    arrays = (np.stack([decay.real, decay.imag]), inputs, observed, ends, through)
    return arrays, gain, row, (a, seen, forces), rng.normal(size=(SAMPLES, 2))


def coupled_twin(gain, dense, ends, measured):
    a, seen, forces = dense
    x, result = np.zeros(len(a)), []
    for k, z in enumerate(measured):
        x = a @ x
        innovation = z - seen @ x
        x = x + gain[min(k, len(gain) - 1)].transpose(2, 1, 0).reshape(-1, 2) @ innovation
        result.append((forces @ x, x[2 * ends[:2]], innovation))
    return np.array(result), x


def test_coupled_steps(coupled):
    arrays, gain, _, dense, measured = coupled
    expected, last = coupled_twin(gain, dense, arrays[3], measured)
    state, result = np.zeros((2, arrays[0].shape[1])), np.empty((SAMPLES, 3, 2))
    coupled_steps(*arrays, gain, 0, measured, state, result)
    np.testing.assert_allclose(result, expected, rtol=1e-9, atol=1e-11)
    np.testing.assert_allclose(state.T.ravel(), last, rtol=1e-9, atol=1e-11)
    # in two blocks, the second knows how many steps went before
    state, parts = np.zeros_like(state), []
    for first, end in ((0, 2), (2, SAMPLES)):
        part = np.empty((end - first, 3, 2))
        coupled_steps(*arrays, gain, first, measured[first:end], state, part)
        parts.append(part)
    np.testing.assert_array_equal(np.concatenate(parts), result)


def test_coupled_smoothed(coupled):
    """The backward recursion with full matrices; the innovations come weighed already."""
    arrays, gain, row, dense, measured = coupled
    a, seen, _ = dense
    result, _ = coupled_twin(gain, dense, arrays[3], measured)
    weighed = result[:, 2] @ np.array([[0.7, 0.1], [0.1, 0.5]])
    adjoint, expected = np.zeros(len(a)), np.empty((SAMPLES, 2))
    for k in range(SAMPLES - 1, -1, -1):
        j = min(k, SETTLING - 1)
        expected[k] = result[k, 0] - row[j].transpose(0, 2, 1).reshape(2, -1) @ adjoint
        kept = np.eye(len(a)) - gain[j].transpose(2, 1, 0).reshape(-1, 2) @ seen
        adjoint = a.T @ (kept.T @ adjoint - seen.T @ weighed[k])
    found = coupled_smoothed(*arrays, gain, row, weighed, np.ascontiguousarray(result[:, 0]))
    np.testing.assert_allclose(found, expected, rtol=1e-9, atol=1e-10)
