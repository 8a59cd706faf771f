"""The march through depths against NumPy's eigenvalues and plain loops; these tests run again without the compiler."""

from __future__ import annotations

import numpy as np
import pytest

from rcsa_ident.stability._kernels import depth as kernels
from rcsa_ident.stability._kernels import depth_at_speed as plain

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


@pytest.mark.parametrize("scale", [1e-6, 1.0, 1e5])
def test_roots_of_a_polynomial(scale):
    rng = np.random.default_rng(7)
    for size in (2, 4, 7):
        wanted = scale * (rng.standard_normal(size) + 1j * rng.standard_normal(size))
        values = 2.0 * scale * np.exp(2j * np.pi * (np.arange(size) + 0.3) / size)
        assert kernels._roots(np.poly(wanted).astype(complex), values)
        np.testing.assert_allclose(np.sort_complex(values), np.sort_complex(wanted), rtol=1e-9)


@pytest.mark.parametrize(
    ("polynomial", "start"),
    # from one place they cannot part; x^2 + 3 has no step at 1 and -1
    [([1.0, 0.0, -1.0], [2.0, 2.0]), ([1.0, 0.0, 3.0], [1.0, -1.0])],
)
def test_roots_that_are_not_found_are_told(polynomial, start):
    assert not kernels._roots(np.array(polynomial, dtype=complex), np.array(start, dtype=complex))


@pytest.mark.parametrize("steep", [2.0, 1e3, 1e6])
@pytest.mark.parametrize("falls", [True, False])
def test_a_crossing_at_a_bend(steep, falls):
    """The larger of 0 and a line that reaches 1 at one end of the step: the last root is half a line's length from there."""
    flat, top = np.diag([0.0, 1.0 - steep]), np.diag([0.0, 1.0])
    before, after = (top, flat) if falls else (flat, top)
    below, above = complex(before.max()), np.array([after.max(), after.min()], dtype=complex)
    scratch = np.empty((2, 2), dtype=complex), np.empty((2, 2)), np.empty(2, dtype=complex)
    share, value = kernels._crossing(before, after, np.eye(2, dtype=complex), 0, below, above, scratch)
    assert value == pytest.approx(0.5, abs=1e-9)
    assert share == pytest.approx(0.5 / steep if falls else 1.0 - 0.5 / steep, abs=1e-9 / steep)


@pytest.mark.parametrize("directions", [2, 3])
def test_every_change_of_side_is_told(directions):
    """Between the depths where NumPy's eigenvalues, in order of their real parts, pass a half: the first two of each."""
    h = tips(directions)[::5]
    depths = 4e-3 * np.linspace(1.0 / 120.0, 1.0, 120)
    bent = np.random.default_rng(6).standard_normal((2, directions, directions))
    stiffness = STIFFNESS * (depths[:, None, None] * bent[0] + 300.0 * (depths * (3e-3 - depths))[:, None, None] * bent[1])
    depth, _ = kernels.boundaries(h, depths, stiffness)
    values = np.linalg.eigvals(stiffness[:, None] @ h)
    over = np.zeros((len(depths) + 1, *values.shape[1:]), dtype=bool)
    over[1:] = -np.sort(-values.real, axis=-1) > 0.5
    twice = 0
    for i in range(len(h)):
        for k in range(directions):
            changes = np.flatnonzero(over[1:, i, k] != over[:-1, i, k])
            # back within a stride of steps: seen or not
            if changes.size and np.diff(changes).min(initial=4) < 4:
                continue
            found = depth[i, k][np.isfinite(depth[i, k])]
            np.testing.assert_array_equal(np.searchsorted(depths, found), changes[:2])
            twice += changes.size > 1
    assert twice > 5


def test_the_lowest_boundary_of_each_delay():
    """Drawn depths and phases, against every whole wave on every line between two frequencies."""
    rng = np.random.default_rng(8)
    omega, delays = np.cumsum(rng.uniform(0.5, 1.5, 12)) + 5.0, np.linspace(0.05, 2.5, 40)
    depth, phase = rng.uniform(1.0, 9.0, (12, 2, 2)), np.cumsum(rng.uniform(-0.6, 0.9, (12, 2, 2)), axis=0) + 1.0
    phase[5, 0, 0] += 1.5
    depth[8, 1, 0], depth[2, 0, 0] = np.nan, np.inf
    limit, place, lobe = kernels.lowest(omega, depth, phase, delays)
    for m, delay in enumerate(delays):
        waves = (omega[:, None, None] * delay - phase) / (2.0 * np.pi)
        candidates = [(np.inf, np.nan, -1)]
        for i, k, s in np.ndindex(11, 2, 2):
            if abs(phase[i + 1, k, s] - phase[i, k, s]) > 1.0 or not np.isfinite(depth[i : i + 2, k, s]).all():
                continue
            for whole in range(8):
                share = (whole - waves[i, k, s]) / (waves[i + 1, k, s] - waves[i, k, s])
                if 0.0 <= share <= 1.0:
                    told = (np.interp(share, [0.0, 1.0], each) for each in (depth[i : i + 2, k, s], omega[i : i + 2]))
                    candidates.append((*told, whole))
        assert (limit[m], place[m], lobe[m]) == pytest.approx(min(candidates), rel=1e-12, nan_ok=True)
    assert set(lobe) >= {-1, 0, 1, 2}


PITCH = np.radians([100.0, 121.0, 139.0]) / (9500.0 * np.pi / 30.0)


def ladder(depths, stiffness, delays=PITCH, spreads=0.0, every=40):
    size = (len(depths), np.shape(delays)[-1])
    delays, spreads = np.broadcast_to(delays, size).copy(), np.broadcast_to(spreads, size).copy()
    return kernels.first_of_ladder(OMEGA[::every], tips(2)[::every].copy(), depths, stiffness, delays, spreads)


def test_a_ladder_of_a_stiffness_in_proportion_needs_one_step():
    """The loop is then in proportion, too: wherever the steps stand, and if the first is too deep, straight lines are exact."""
    fine = np.geomspace(1e-4, 1e-2, 300)
    limit, place = ladder(fine, fine[:, None, None] * STIFFNESS * ALPHA)
    assert np.isfinite(limit)
    for depths in ([2.0 * limit], [0.3 * limit, 1.01 * limit], [0.1 * limit, 0.9 * limit, 50.0 * limit]):
        each = np.array(depths)
        assert ladder(each, each[:, None, None] * STIFFNESS * ALPHA) == pytest.approx((limit, place), rel=1e-9)
    # nothing is pushed down to the first step: no vibration is known there to take a mean with
    both = limit * np.array([1.0, 3.0])
    wanted = limit + (both[1] - limit) / 3.0
    assert ladder(both, (both * [0.0, 1.0])[:, None, None] * STIFFNESS * ALPHA) == pytest.approx((wanted, place), rel=1e-9)
    assert np.isinf(ladder(0.5 * both[:1], 0.5 * both[:1, None, None] * STIFFNESS * ALPHA)[0])


def test_a_ladder_finds_the_frequency_between_its_own():
    depths = np.array([4e-3])
    limit, place = ladder(depths, depths[:, None, None] * STIFFNESS * ALPHA, every=1)
    loop = ALPHA @ tips(2)
    curves = np.trace(loop, axis1=1, axis2=2).copy(), np.linalg.det(loop)
    expected = plain.pitch_envelope(OMEGA, *curves, STIFFNESS, PITCH, np.array([1.0]))
    assert (limit, place) == pytest.approx((expected[0][0], expected[1][0]), rel=2e-4)


def test_a_delay_that_spreads_is_many_delays():
    depths = np.array([1e-3, 4e-3])
    stiffness = depths[:, None, None] * STIFFNESS * ALPHA
    apart = np.array([[8e-4], [1.2e-3]])
    many = PITCH[:, None] + apart[:, :, None] * ((np.arange(200) + 0.5) / 200.0 - 0.5)
    found = ladder(depths, stiffness, spreads=apart)
    assert found == pytest.approx(ladder(depths, stiffness, many.reshape(2, -1)), rel=1e-4)
    assert found[0] != pytest.approx(ladder(depths, stiffness)[0], rel=1e-2)
