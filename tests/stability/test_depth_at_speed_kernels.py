"""The lobe kernels against plain loops; these tests run again without the compiler."""

from __future__ import annotations

import math

import numpy as np
import pytest
import scipy.optimize
from numpy.polynomial import Polynomial

from rcsa_ident.stability._kernels import depth_at_speed as kernels
from tests.oracles import naive

ALPHA = np.array([[-0.4, -1.1], [0.9, -0.5]])
OMEGA = 2.0 * np.pi * np.arange(600.0, 1300.0, 4.0)
STIFFNESS = 7e8


def model(w):
    def mode(frequency, zeta, mass):
        wn = 2.0 * np.pi * frequency
        return 1.0 / (mass * (wn**2 - w**2 + 2j * zeta * wn * w))

    a, b, c = mode(800.0, 0.04, 0.05), mode(950.0, 0.04, 0.05), mode(1100.0, 0.03, 0.08)
    return np.array([[a + 0.36 * c, 0.6 * c], [0.6 * c, b + c]])


@pytest.fixture(scope="module")
def characteristic():
    loop = np.array([ALPHA @ model(w) for w in OMEGA])
    return np.trace(loop, axis1=1, axis2=2).astype(complex), np.linalg.det(loop)


def test_eigenvalues(characteristic):
    trace, determinant = characteristic
    root = kernels.roots_along(trace, determinant)
    for k in range(0, OMEGA.size, 7):
        expected = np.sort_complex(np.linalg.eigvals(ALPHA @ model(OMEGA[k])))
        np.testing.assert_allclose(np.sort_complex([0.5 * trace[k] + root[k], 0.5 * trace[k] - root[k]]), expected, rtol=1e-10)
    for sign in (1.0, -1.0):
        middle = 0.5 * (OMEGA[40] + OMEGA[41])
        found = kernels.eigenvalue_at(OMEGA, trace, determinant, kernels.node_weights(OMEGA), root, sign, 40, middle)
        assert np.min(np.abs(np.linalg.eigvals(ALPHA @ model(middle)) / found - 1.0)) < 1e-6


def test_largest_real_part(characteristic):
    fine = np.linspace(OMEGA[0], OMEGA[-1], 20001)
    expected = max(np.linalg.eigvals(ALPHA @ model(w)).real.max() for w in fine)
    value, place = kernels.largest_real_part(OMEGA, *characteristic)
    assert value == pytest.approx(expected, rel=1e-5)
    assert np.linalg.eigvals(ALPHA @ model(place)).real.max() == pytest.approx(expected, rel=1e-5)


def test_envelopes(characteristic):
    speeds = np.array([900.0, 1333.0, 2000.0])
    equal = np.full(3, 2.0 * np.pi / 3.0)
    uneven = np.array([1.9, 2.2, 2.0 * np.pi - 4.1])
    for pitch in (equal, uneven):
        if pitch is equal:
            limit, chatter, lobe = kernels.envelope(OMEGA, *characteristic, STIFFNESS, 3, speeds)
            np.testing.assert_array_equal(lobe, np.floor(chatter / (3 * speeds)).astype(int))
        else:
            limit, chatter, lobe = kernels.pitch_envelope(OMEGA, *characteristic, STIFFNESS, pitch, speeds)
        for i, speed in enumerate(speeds):
            depth, frequency = naive.zero_order_limit(model, ALPHA, STIFFNESS, pitch, speed, OMEGA)
            assert limit[i] == pytest.approx(depth, rel=1e-5)
            assert chatter[i] == pytest.approx(frequency, rel=1e-6)


def test_envelopes_of_many_tips_are_those_of_each():
    x = np.array([model(w)[0, 0] for w in OMEGA]) * np.array([[1.0], [1.1], [0.9 - 0.1j], [1.0]])
    y = np.array([model(w)[1, 1] for w in OMEGA]) * np.array([[1.0], [0.8], [0.0], [np.nan]])
    speeds = np.array([900.0, 1333.0, 2000.0])
    alpha = ALPHA * np.array([[[1.0, 1.0], [1.0, 1.0]], [[1.0, 0.9], [1.2, 0.8]], [[0.7, 1.0], [1.0, 1.0]], [[1.0, 1.0], [1.0, 1.0]]])
    found = kernels.envelopes(OMEGA, x, y, alpha, STIFFNESS, 3, speeds)
    for i, each in enumerate(alpha[:3]):
        trace, determinant = each[0, 0] * x[i] + each[1, 1] * y[i], np.linalg.det(each) * x[i] * y[i]
        np.testing.assert_allclose(found[i], kernels.envelope(OMEGA, trace, determinant, STIFFNESS, 3, speeds)[0], rtol=1e-9)
    assert np.all(np.isnan(found[3]))


def test_between_nodes_the_curve_is_a_quintic():
    omega = np.cumsum(np.linspace(1.0, 2.0, 9))
    weights = kernels.node_weights(omega)
    for k in range(omega.size - 1):
        # exact for as many coefficients as there are nodes: six inside, four or five at the ends
        degree = min(k + 3, omega.size - 1) - max(k - 2, 0)
        trace, determinant = (1.0 + 0.5j) * omega**degree, (0.3 - 1.0j) * (omega - 4.0) ** degree
        for w in (omega[k], 0.3 * omega[k] + 0.7 * omega[k + 1], omega[k + 1]):
            t, d = kernels.between_nodes(omega, trace, determinant, weights, k, w)
            assert t == pytest.approx((1.0 + 0.5j) * w**degree, rel=1e-10)
            assert d == pytest.approx((0.3 - 1.0j) * (w - 4.0) ** degree, rel=1e-9, abs=1e-9)


@pytest.mark.parametrize("place", [0.15, 0.42, 0.5, 0.81])
def test_a_jump_between_close_eigenvalues_is_no_crossing(place):
    """Between two nodes both come so close that their names change: where the delay meets the jump nothing vibrates."""
    omega = 1000.0 + 4.0 * np.arange(40.0)
    middle, meeting = 1.0 + 0.4j, omega[20] + 4.0 * place

    def half(w):
        return 0.02 * (w - meeting) + 0.024j

    trace, determinant = np.full(40, 2.0 * middle), middle**2 - half(omega) ** 2
    weights, root = kernels.node_weights(omega), kernels.roots_along(trace, determinant)
    # the names do change: the root at the next node is the other one
    assert (root[20] / half(omega[20])).real * (root[21] / half(omega[21])).real < 0.0
    found = {}
    for sign in (1.0, -1.0):
        _, start, end = kernels.phase_steps(trace, root, sign)
        for share in np.linspace(0.02, 0.98, 49):
            half_delay = (start[20] + share * (end[20] - start[20])) / (omega[20] + share * 4.0)
            ends = start[20] - omega[20] * half_delay, end[20] - omega[21] * half_delay
            w, real = kernels.crossing(omega, trace, determinant, weights, root, sign, 20, *ends, half_delay)
            found[sign, share] = real
            if np.isfinite(real):
                beside = [
                    abs(mu.real - real) + abs(0.5 * np.pi + np.angle(mu) - w * half_delay) for mu in (middle + half(w), middle - half(w))
                ]
                assert min(beside) < 1e-7
    jumps = np.isnan(list(found.values()))
    assert 0 < jumps.sum() < jumps.size


def test_no_limit_where_no_eigenvalue_has_a_positive_real_part():
    trace = np.full(5, -2.0 + 0.1j)
    limit, chatter, lobe = kernels.envelope(OMEGA[:5], trace, np.full(5, 1.0 + 0j), STIFFNESS, 2, np.array([900.0]))
    assert np.isinf(limit[0])
    assert np.isnan(chatter[0])
    assert lobe[0] == -1


def test_receptance_at_any_frequency():
    values = np.array([model(w).ravel() for w in OMEGA])
    inside = np.array([OMEGA[0], OMEGA[1] + 1.0, OMEGA[80] + 11.0, OMEGA[-2] + 3.0, OMEGA[-1]])
    exact = np.array([model(w).ravel() for w in inside])
    found = kernels.receptance_at(OMEGA, values, inside)
    np.testing.assert_allclose(found, exact, rtol=0, atol=2e-5 * np.abs(values).max())
    np.testing.assert_allclose(kernels.receptance_at(OMEGA, values, OMEGA[::17]), values[::17], rtol=1e-12)
    # a real signal's response
    np.testing.assert_array_equal(kernels.receptance_at(OMEGA, values, -inside), found.conj())
    assert np.all(kernels.receptance_at(OMEGA, values, np.array([OMEGA[-1] + 1.0, -1e9])) == 0.0)
    # in any order, those beyond the end before the others
    mixed = kernels.receptance_at(OMEGA, values, np.append(OMEGA[-1] + 1.0, inside))
    np.testing.assert_array_equal(mixed, np.concatenate([np.zeros_like(found[:1]), found]))
    low = kernels.receptance_at(OMEGA, values, np.array([0.0, 0.5 * OMEGA[0]]))
    np.testing.assert_array_equal(low[0], values[0].real)
    np.testing.assert_allclose(low[1], values[0].real + 0.5j * values[0].imag, rtol=1e-12)
    # quintics are exact for polynomials of fifth degree, also where the lines lie unevenly
    uneven = np.cumsum(np.linspace(1.0, 2.0, 12))
    w = np.linspace(1.1, uneven[-1] - 0.1, 30)
    power = (np.array([1.0, 0.5j]) * uneven[:, None] ** np.array([5, 3])).astype(complex)
    np.testing.assert_allclose(kernels.receptance_at(uneven, power, w), np.array([1.0, 0.5j]) * w[:, None] ** np.array([5, 3]), rtol=1e-9)


def test_phases_go_on_within_an_interval(characteristic):
    """psi = pi / 2 + arg mu at nodes of a positive real part, and from there by the turn of mu to the other end of the interval."""
    # there and back, so that real parts become positive and cease to be
    trace, determinant = (np.append(each, each[-2::-1]) for each in characteristic)
    root = kernels.roots_along(trace, determinant)
    crossings = 0
    for sign in (1.0, -1.0):
        mu, start, end = kernels.phase_steps(trace, root, sign)
        np.testing.assert_allclose(mu, 0.5 * trace + sign * root, rtol=1e-12)
        for k in range(trace.size - 1):
            if mu[k].real <= 0.0 and mu[k + 1].real <= 0.0:
                assert np.isnan(start[k])
                assert np.isnan(end[k])
                continue
            crossings += (mu[k].real > 0.0) != (mu[k + 1].real > 0.0)
            for angle, value in ((start[k], mu[k]), (end[k], mu[k + 1])):
                assert np.exp(1j * (angle - 0.5 * np.pi)) == pytest.approx(value / abs(value), abs=1e-9)
            assert end[k] - start[k] == pytest.approx(np.angle(mu[k + 1] / mu[k]), abs=1e-9)
    assert crossings >= 2


def test_where_one_direction_is_rigid_its_eigenvalue_is_zero():
    trace = np.full(4, 2.0 - 1.0j)
    rounding = np.full(4, 1e-14 + 0.0j)
    mu, start, end = kernels.phase_steps(trace, kernels.roots_along(trace, rounding), -1.0)
    assert np.all(mu == 0.0)
    assert np.all(np.isnan(start))
    assert np.all(np.isnan(end))


@pytest.mark.parametrize("before", [1, 2])
def test_a_limit_in_the_first_interval_of_a_band_is_found(characteristic, before):
    """A band that begins right below the chatter frequency gives the limit that the whole band gives."""
    uneven, speed = np.array([1.9, 2.2, 2.0 * np.pi - 4.1]), np.array([1333.0])
    limit, chatter, _ = kernels.pitch_envelope(OMEGA, *characteristic, STIFFNESS, uneven, speed)
    first = int(np.searchsorted(OMEGA, chatter[0])) - before
    parts = (OMEGA[first:], characteristic[0][first:], characteristic[1][first:])
    again, frequency, _ = kernels.pitch_envelope(*parts, STIFFNESS, uneven, speed)
    assert again[0] == pytest.approx(limit[0], rel=1e-5)
    assert frequency[0] == pytest.approx(chatter[0], rel=1e-6)


def drawn_eigenvalues(seed):
    """Uneven frequencies, and both eigenvalues as polynomials of them, low enough that the kernels' quintics hold trace and determinant."""
    rng = np.random.default_rng(seed)
    omega = np.cumsum(rng.uniform(0.15, 0.35, rng.integers(4, 13))) + 1.0
    from_middle = Polynomial([-omega.mean(), 1.0])
    drawn = 8.0 * (rng.standard_normal((2, 3)) + 1j * rng.standard_normal((2, 3))) * [1.0, 0.5, 0.1]
    return omega, (Polynomial(drawn[0, :2])(from_middle), Polynomial(drawn[1])(from_middle))


def lowest_limit(omega, eigenvalues, stiffness, pitch, speed):
    """Limit and chatter frequency by Brent's method around each change of sign of Im(mu W) on a fine scale."""

    def loop(w, mu):
        return mu(w) * np.mean(1.0 - np.exp(-1j * np.multiply.outer(w, pitch) / speed), axis=-1)

    fine, found = np.linspace(omega[0], omega[-1], 1001), [(np.inf, np.nan)]
    for mu in eigenvalues:
        imaginary = loop(fine, mu).imag
        for k in np.flatnonzero(imaginary[1:] * imaginary[:-1] < 0.0):
            w = scipy.optimize.brentq(lambda at, mu=mu: loop(at, mu).imag, fine[k], fine[k + 1], xtol=1e-14, rtol=1e-14)
            # where W vanishes the depth has no bound
            if loop(w, mu).real > 1e-9:
                found.append((1.0 / (stiffness * loop(w, mu).real), w))
    return min(found)


@pytest.mark.parametrize("equal", [True, False])
def test_limits_of_drawn_eigenvalues(equal):
    """Few and wide intervals: the first and the last count, and either eigenvalue has its turn."""
    pitch = np.full(3, 2.0 * np.pi / 3.0) if equal else np.array([1.9, 2.2, 2.0 * np.pi - 4.1])
    speeds, limited = np.linspace(0.25, 2.0, 21 if equal else 8), 0
    # 15 and 57 of unequal pitch change their sign twice in a step
    for seed in (*range(30), 57):
        omega, eigenvalues = drawn_eigenvalues(seed)
        trace, determinant = (eigenvalues[0] + eigenvalues[1])(omega), (eigenvalues[0] * eigenvalues[1])(omega)
        if equal:
            limit, chatter, lobe = kernels.envelope(omega, trace, determinant, 0.5, 3, speeds)
        else:
            limit, chatter, lobe = kernels.pitch_envelope(omega, trace, determinant, 0.5, pitch, speeds)
        expected = np.array([lowest_limit(omega, eigenvalues, 0.5, pitch, speed) for speed in speeds])
        np.testing.assert_allclose(np.column_stack([limit, chatter]), expected, rtol=1e-11)
        np.testing.assert_array_equal(lobe, np.where(np.isfinite(limit), np.nan_to_num(expected[:, 1]) // (3.0 * speeds), -1))
        limited += np.isfinite(limit).sum()
    assert limited > 80


def test_the_largest_real_part_of_drawn_eigenvalues_stands_where_a_fine_scale_finds_it():
    at_ends = set()
    for seed in range(8):
        omega, eigenvalues = drawn_eigenvalues(seed)
        trace, determinant = (eigenvalues[0] + eigenvalues[1])(omega), (eigenvalues[0] * eigenvalues[1])(omega)
        fine = np.linspace(omega[0], omega[-1], 3001)
        real = np.max([mu(fine).real for mu in eigenvalues], axis=0)
        value, place = kernels.largest_real_part(omega, trace, determinant)
        assert value == pytest.approx(real.max(), rel=1e-6)
        assert place == pytest.approx(fine[real.argmax()], abs=2e-3)
        at_ends.add(np.flatnonzero(omega == place).tobytes())
    assert len(at_ends) > 1


@pytest.mark.parametrize("spacing", [1e-40, 0.3, 1e40])
def test_weights_of_even_nodes_are_binomials(spacing):
    weights = kernels.node_weights(spacing * np.arange(3.0, 12.0))
    assert weights.shape == (8, 6)
    inside = [(-1.0) ** (5 - i) * math.comb(5, i) / 120.0 for i in range(6)]
    np.testing.assert_allclose(weights[2:6], np.tile(inside, (4, 1)), rtol=1e-12)


def test_the_first_interval_that_ends_above():
    omega, kept = np.arange(10.0), np.array([0, 1, 4, 5, 7, -1])
    for value in np.arange(0.0, 9.5, 0.5):
        assert kernels.first_ending_at(omega, kept, 5, value) == np.searchsorted(omega[kept[:5] + 1], value)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_crossing_that_rounding_moves_past_an_end_lies_there(characteristic, sign):
    trace, determinant = characteristic
    weights, root = kernels.node_weights(OMEGA), kernels.roots_along(trace, determinant)
    for ends, k in (((1e-15, 2.0), 30), ((-2.0, -1e-15), 31), ((1e-15, 1e-15), 31)):
        found = kernels.crossing(OMEGA, trace, determinant, weights, root, sign, 30, *ends, 1.0)
        assert found == (OMEGA[k], (0.5 * trace[k] + sign * root[k]).real)


@pytest.mark.parametrize("turn", [1.0, -1.0])
def test_limits_where_the_phase_turns_as_fast_as_the_delay(turn):
    """An eigenvalue that passes zero: from interval to interval the lobe's speeds fall as its phase rises, or rise the faster."""
    omega, speeds = 12.0 + 0.25 * np.arange(11.0), np.geomspace(1.5, 40.0, 60)
    eigenvalues = Polynomial([0.5 - 0.65 - 13.3j * turn, 0.05 + 1j * turn]), Polynomial([-50.0])
    trace, determinant = (eigenvalues[0] + eigenvalues[1])(omega), (eigenvalues[0] * eigenvalues[1])(omega)
    limit, chatter, _ = kernels.envelope(omega, trace, determinant, 3.0, 3, speeds)
    alone = [kernels.envelope(omega, trace, determinant, 3.0, 3, speeds[i : i + 1])[0][0] for i in range(speeds.size)]
    expected = np.array([lowest_limit(omega, eigenvalues, 3.0, np.full(3, 2.0 * np.pi / 3.0), speed) for speed in speeds])
    assert np.isfinite(expected[:, 0]).sum() > 20
    np.testing.assert_allclose(np.column_stack([limit, chatter]), expected, rtol=1e-11)
    np.testing.assert_allclose(alone, limit, rtol=1e-11)


@pytest.mark.parametrize("gap", [1e-3, 0.03, 1.0])
@pytest.mark.parametrize("turn", [1.0, -1.0])
def test_a_crossing_where_the_phase_turns_sharply(gap, turn):
    """An eigenvalue that passes zero closely, at a third of the interval, turns by nearly half a circle: Brent's method finds the same."""
    omega = np.arange(10.0, 18.0)
    passing = Polynomial([gap - 13.3j * turn, 1j * turn])
    # the other eigenvalue stands far away
    trace, determinant = passing(omega) - 50.0, -50.0 * passing(omega)
    weights, root = kernels.node_weights(omega), kernels.roots_along(trace, determinant)
    _, start, end = kernels.phase_steps(trace, root, 1.0)
    for share in np.linspace(0.01, 0.99, 25):
        half_delay = (start[3] + share * (end[3] - start[3])) / (13.0 + share)
        ends = start[3] - 13.0 * half_delay, end[3] - 14.0 * half_delay
        w, real = kernels.crossing(omega, trace, determinant, weights, root, 1.0, 3, *ends, half_delay)
        exact = scipy.optimize.brentq(lambda at, tau=half_delay: 0.5 * np.pi + np.angle(passing(at)) - at * tau, 13.0, 14.0, xtol=1e-15)
        assert w == pytest.approx(exact, abs=1e-9)
        assert real == pytest.approx(gap)
