"""The march through depths against NumPy's eigenvalues and plain loops; these tests run again without the compiler."""

from __future__ import annotations

import numpy as np
import pytest

from rcsa_ident.stability import _depth_kernels as kernels
from rcsa_ident.stability import _kernels as plain

OMEGA = 2.0 * np.pi * np.arange(500.0, 1400.0, 2.0)
ALPHA = np.array([[-0.4, -1.1], [0.9, -0.5]])
STIFFNESS = 7e8


def mode(w, frequency, zeta, mass):
    wn = 2.0 * np.pi * frequency
    return 1.0 / (mass * (wn**2 - w**2 + 2j * zeta * wn * w))


def tips(directions):
    """Receptances of a tip whose directions feel each other, shape (n, r, r)."""
    shapes = np.array([[1.0, 0.2, 0.1, -4.0, 0.5], [0.1, 1.0, -0.2, 0.3, -5.0], [0.0, 0.3, 1.0, 0.0, -1.0]])[:, :directions]
    each = [mode(OMEGA, *known) for known in ((800.0, 0.04, 0.05), (950.0, 0.04, 0.05), (1150.0, 0.05, 0.03))]
    return np.ascontiguousarray(sum(h[:, None, None] * np.outer(u, u) for h, u in zip(each, shapes, strict=True)))


@pytest.mark.parametrize("size", [2, 3, 5])
@pytest.mark.parametrize("seed", range(4))
def test_eigenvalues(size, seed):
    rng = np.random.default_rng(seed)
    matrix = rng.standard_normal((size, size)) + 1j * rng.standard_normal((size, size))
    if seed == 3:
        # one direction that does not move
        matrix[:, -1] = 0.0
    values = np.zeros(size, dtype=complex)
    expected = np.linalg.eigvals(matrix)
    # from nowhere, and from those of a matrix beside it
    for change in (0.0, 1e-3, 0.0):
        kernels.eigenvalues(matrix * (1.0 + change), values)
        np.testing.assert_allclose(values, (1.0 + change) * expected[np.argsort(-expected.real)], atol=1e-12)


@pytest.mark.parametrize(
    "matrix",
    [np.diag(each) for each in ([0j] * 3, [2.0 + 1j] * 3, [1.0, 1.0, 3j], [0j] * 5, [2.0 + 1j] * 4, [1.0, 1.0, 3j, 0.0, 0.0])],
)
def test_eigenvalues_that_coincide(matrix):
    values = np.zeros(len(matrix), dtype=complex)
    kernels.eigenvalues(matrix, values)
    expected = np.diag(matrix)
    np.testing.assert_allclose(values, expected[np.argsort(-expected.real)], atol=1e-12)


def test_a_stiffness_in_proportion_to_the_depth_has_the_closed_forms_limits():
    """A cylinder, by steps over the depth instead of a division."""
    h = tips(2)
    depths = 4e-3 * np.geomspace(1e-3, 1.0, 90)
    depth, phase = kernels.boundaries(h, depths, depths[:, None, None] * STIFFNESS * ALPHA)
    speeds = np.linspace(6000.0, 16000.0, 41) * np.pi / 30.0
    limit, place, lobe = kernels.lowest(OMEGA, depth, phase, 2.0 * np.pi / (3.0 * speeds))
    loop = ALPHA @ h
    trace, determinant = np.trace(loop, axis1=1, axis2=2).copy(), np.linalg.det(loop)
    wanted = plain.envelope(OMEGA, trace, determinant, STIFFNESS, 3, speeds)
    near = wanted[0] < 4e-3
    assert near.sum() > 30
    np.testing.assert_allclose(limit[near], wanted[0][near], rtol=4e-3)
    np.testing.assert_allclose(place[near], wanted[1][near], rtol=2e-3)
    np.testing.assert_array_equal(lobe[near], wanted[2][near])


@pytest.mark.parametrize("directions", [2, 3, 5])
def test_on_the_boundary_the_loop_is_one(directions):
    """At each depth and frequency that is told 1 - v (1 - e^{-i w tau}) vanishes for some eigenvalue v."""
    h = tips(directions)[::7]
    rng = np.random.default_rng(5)
    depths = 3e-3 * np.geomspace(1e-2, 1.0, 60)
    bent = rng.standard_normal((2, directions, directions))
    stiffness = STIFFNESS * (depths[:, None, None] * bent[0] + 200.0 * depths[:, None, None] ** 2 * bent[1])
    depth, phase = kernels.boundaries(h, depths, stiffness)
    told = np.argwhere(np.isfinite(depth))
    assert len(told) > 20
    for i, k, s in told[:: max(1, len(told) // 25)]:
        a, delay = depth[i, k, s], phase[i, k, s]
        # nothing is pushed at no depth
        known, pushed = np.append(0.0, depths), np.concatenate([np.zeros((1, directions, directions)), stiffness])
        here = np.array([[np.interp(a, known, pushed[:, p, q]) for q in range(directions)] for p in range(directions)])
        loop = np.linalg.eigvals(here @ h[i]) * (1.0 - np.exp(-1j * delay))
        assert np.min(np.abs(loop - 1.0)) < 1e-6


def test_several_delays_that_are_one_have_its_limits():
    h = tips(2)
    depths = 4e-3 * np.geomspace(1e-3, 1.0, 90)
    stiffness = depths[:, None, None] * STIFFNESS * ALPHA
    depth, phase = kernels.boundaries(h, depths, stiffness)
    for rpm in (7000.0, 9500.0, 13000.0):
        delay = 2.0 * np.pi / (3.0 * rpm * np.pi / 30.0)
        wanted, place, _ = kernels.lowest(OMEGA, depth, phase, np.array([delay]))
        same = np.full((depths.size, 3), delay)
        limit, at = kernels.first_of_ladder(OMEGA, h, depths, stiffness, same, np.zeros_like(same))
        assert limit == pytest.approx(wanted[0], rel=5e-3)
        assert at == pytest.approx(place[0], rel=5e-3)
    # unequal pitch, against the walk along the frequencies of a cylinder
    pitch = np.radians([100.0, 121.0, 139.0])
    loop = ALPHA @ h
    trace, determinant = np.trace(loop, axis1=1, axis2=2).copy(), np.linalg.det(loop)
    speed = 9500.0 * np.pi / 30.0
    wanted = plain.pitch_envelope(OMEGA, trace, determinant, STIFFNESS, pitch, np.array([speed]))[0][0]
    each = np.tile(pitch / speed, (depths.size, 1))
    assert kernels.first_of_ladder(OMEGA, h, depths, stiffness, each, np.zeros_like(each))[0] == pytest.approx(wanted, rel=5e-3)
