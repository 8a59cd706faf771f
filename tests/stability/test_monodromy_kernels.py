"""The map of a period against quadrature, dense matrices and matrix exponentials; these tests run again without the compiler."""

from __future__ import annotations

import numpy as np
import pytest

import rcsa_ident as ri
from rcsa_ident.cutting.process import ProcessDamping, SpeedVariation
from rcsa_ident.stability._kernels import monodromy as kernels
from rcsa_ident.stability._kernels import step as _step_kernels
from rcsa_ident.stability.monodromy import MonodromyOperator
from rcsa_ident.stability.multiplier_limits import longest_step
from tests.oracles import naive
from tests.stability.mills import ONE, RPM, SKEWED, Table, mill, tip


def test_solve():
    rng = np.random.default_rng(4)
    for n in (1, 2, 7):
        matrix, right = rng.standard_normal((n, n)), rng.standard_normal((n, 3))
        if n > 1:
            # a pivot that is zero
            matrix[0, 0] = 0.0
        expected = np.linalg.solve(matrix, right)
        kernels._solve(matrix.copy(), right, 0.0)
        np.testing.assert_allclose(right, expected, rtol=1e-9)


@pytest.mark.parametrize("seed", range(12))
def test_largest_of_hessenberg(seed):
    rng = np.random.default_rng(seed)
    n = (1, 2, 3, 5, 8, 13, 21, 80)[seed % 8]
    matrix = np.triu(rng.standard_normal((n, n)), -1)
    if seed in (4, 9):
        # split in two, and with alike eigenvalues
        matrix[n // 2, n // 2 - 1] = 0.0
    if seed == 10:
        matrix = np.diag(np.ones(n)) + np.diag(1e-3 * np.ones(n - 1), 1)
    value, vector = kernels.largest_of_hessenberg(matrix)
    values = np.linalg.eigvals(matrix)
    assert abs(value) == pytest.approx(np.abs(values).max(), rel=1e-9)
    assert np.min(np.abs(values - value)) < 1e-6 * np.abs(value)
    np.testing.assert_allclose(matrix @ vector, value * vector, rtol=0, atol=1e-7 * abs(value))
    assert np.linalg.norm(vector) == pytest.approx(1.0)


def test_largest_where_nothing_is_left_of_a_pivot():
    """As of a vibration that grows by 10^18 within a period: such eigenvalues are rounding, and large in any case."""
    matrix = np.array([[-3.4621539982830906e17, -1.0185108617691141e17], [1.176866222811554e18, 3.462153998283089e17]])
    value, vector = kernels.largest_of_hessenberg(matrix)
    assert 1e9 < abs(value) < 1e11
    np.testing.assert_allclose(matrix @ vector, value * vector, rtol=0, atol=1e-7 * np.abs(matrix).max())


@pytest.mark.parametrize("n", [3, 4, 6, 7, 12])
def test_largest_of_a_rotation(n):
    """Eigenvalues of one magnitude all round the circle."""
    matrix = np.roll(np.eye(n), 1, axis=0)
    value, vector = kernels.largest_of_hessenberg(matrix)
    assert abs(value) == pytest.approx(1.0)
    np.testing.assert_allclose(matrix @ vector, value * vector, atol=1e-9)


def dense(cut: MonodromyOperator, speed: float, depth: float, step: float) -> np.ndarray:
    """The map of a period written down, column by column."""
    layout = cut._lay_out(speed, depth, step)
    steps = _step_kernels.steps(cut.arrays, layout.places, cut.table)
    prepared = kernels.prepare(cut.arrays, layout, cut.frozen, steps)
    m, (points, r, _) = cut.arrays.pole.size, layout.damping.shape
    columns = []
    for unit in np.eye(2 * m + points * r):
        state, motion, force = unit[:m] + 1j * unit[m : 2 * m], np.zeros((2 * points, r)), np.zeros((points, r))
        motion[:points] = unit[2 * m :].reshape(points, r)
        kernels.march(state, motion, force, cut.arrays, layout, cut.table, cut.frozen, steps, prepared)
        columns.append(np.concatenate([state.real, state.imag, motion[points:].ravel()]))
    return np.array(columns).T


SMALL = {
    "half": (ONE, mill(2, 0.5), False),
    "constant in each step": (ONE, mill(2, 0.5), True),
    "unequal pitch": (SKEWED[:2], mill(2, 0.3, pitch=np.radians([165.0, 195.0])), False),
    "rubbing, speed": (ONE, mill(2, 0.3, damping=ProcessDamping(2e13, 5e-5), speed_variation=SpeedVariation(0.2, 1.0)), False),
}


@pytest.mark.parametrize("name", SMALL)
def test_arnoldi_against_all_eigenvalues(name):
    modes, process, frozen = SMALL[name]
    cut, speed, depth, step = MonodromyOperator(tip(modes), process, 3, frozen), 15000.0 * RPM, 1e-3, 4e-4
    values = np.linalg.eigvals(dense(cut, speed, depth, step))
    largest = values[np.argmax(np.abs(values))]
    found = cut.multiplier(speed, depth, step, residual=1e-9)
    assert abs(found.value - complex(largest.real, abs(largest.imag))) < 1e-8
    assert found.residual < 1e-9


def test_a_vibration_grows_for_a_dozen_passes_and_dies_away():
    """Worn teeth in a slow slot: all eigenvalues are small, and the largest motion of a pass is a million times that of a dozen before."""
    mode = ri.normal_modes([ri.hz(900.0)], [0.02], [[5.0]], (ri.Coordinate("tip", ri.Dof.Y),))
    slot, damping = ri.Engagement.from_immersion(1.0, "up"), ProcessDamping(1e14, 1e-4)
    process = ri.MillingProcess(ri.Cutter(2, 0.012), ri.CuttingCoefficients(7e8, 0.3), slot, damping=damping)
    cut = MonodromyOperator(ri.TipModes.of({ri.Dof.Y: mode}), process, 6)
    found = dense(cut, 1600.0 * RPM, 6.15e-3, longest_step(cut))
    assert np.abs(np.linalg.eigvals(found)).max() < 0.5
    motion = slice(2 * cut.arrays.pole.size, None)
    growth = [np.abs(np.linalg.matrix_power(found, n)[motion, motion]).sum(axis=1).max() for n in (1, 12, 100)]
    assert growth[1] > 1e6
    assert growth[2] < 1.0


@pytest.mark.parametrize("name", SMALL)
@pytest.mark.parametrize("tolerance", [1.0, 1e-4, 1e-13])
def test_what_arnoldi_tells_of_its_vector_is_true(name, tolerance):
    """The residual is that of the vector under the whole map; the forces are those that march with it."""
    modes, process, frozen = SMALL[name]
    cut = MonodromyOperator(tip(modes), process, 3, frozen)
    given = 15000.0 * RPM, 1e-3, 2e-4
    layout, whole = cut._lay_out(*given), dense(cut, *given)
    steps = _step_kernels.steps(cut.arrays, layout.places, cut.table)
    value, residual, used, vector, force = kernels.multiplier(cut.arrays, layout, cut.table, frozen, steps, tolerance, True, np.zeros(0))
    assert residual < tolerance
    m, (points, r, _) = cut.arrays.pole.size, layout.damping.shape
    # nobody asks for the motion of the period's first points
    seen = np.concatenate([np.arange(2 * m), 2 * m + np.arange(min(layout.where[layout.where >= 0]) * r, points * r)])
    assert np.all(np.delete(whole, seen, axis=1) == 0.0)
    assert np.linalg.norm(vector) == pytest.approx(1.0)
    left = np.linalg.norm(whole[np.ix_(seen, seen)] @ vector - value * vector) / abs(value)
    assert left == pytest.approx(residual, rel=1e-6, abs=1e-12)
    marched = np.zeros((points, r), dtype=complex)
    prepared = kernels.prepare(cut.arrays, layout, frozen, steps)
    for factor, part in ((1.0, vector.real), (1j, vector.imag)):
        every, forces = np.zeros(2 * m + points * r), np.zeros((points, r))
        every[seen] = part
        motion = np.concatenate([every[2 * m :].reshape(points, r), np.zeros((points, r))])
        kernels.march(every[:m] + 1j * every[m : 2 * m], motion, forces, cut.arrays, layout, cut.table, frozen, steps, prepared)
        marched += factor * forces
    np.testing.assert_allclose(force, marched, rtol=1e-9, atol=1e-9 * np.abs(force).max())
    assert used < len(seen)
    if tolerance == 1.0:
        assert used <= 8 + 2 * m


@pytest.mark.parametrize("rpm", [4500.0, 6000.0, 8000.0, 10500.0, 15000.0])
def test_as_many_vectors_as_the_structure_has_modes_that_last(rpm):
    """Two more for each that decays by less than 1.5 nepers in a period, and by no more than half of that faster than the slowest."""
    cut = MonodromyOperator(tip(SKEWED), SMALL["unequal pitch"][1], 3, False)
    layout = cut._lay_out(rpm * RPM, 1e-3, 1e-4)
    steps = _step_kernels.steps(cut.arrays, layout.places, cut.table)
    decays = -cut.arrays.pole.real * 60.0 / rpm
    first = 8 + 2 * np.sum((decays < 1.5) & (decays - decays.min() < 0.75))
    asked = cut.arrays, layout, cut.table, False, steps
    used = [kernels.multiplier(*asked, tolerance, False, np.zeros(0))[2] for tolerance in (np.inf, 1e-12)]
    assert used[0] == first
    # and then every third
    assert (used[1] - first) % 3 == 0


def test_length_and_a_start_that_is_known():
    assert kernels._length(np.array([3.0, -4.0, 12.0])) == pytest.approx(13.0)
    cut = MonodromyOperator(tip(SKEWED), SMALL["unequal pitch"][1], 3, False)
    layout = cut._lay_out(15000.0 * RPM, 1e-3, 2e-4)
    steps = _step_kernels.steps(cut.arrays, layout.places, cut.table)
    value, _, used, vector, _ = kernels.multiplier(cut.arrays, layout, cut.table, False, steps, 1e-12, False, np.zeros(0))
    again, _, fewer, _, _ = kernels.multiplier(cut.arrays, layout, cut.table, False, steps, 1e-12, False, 1e3 * vector.real)
    # of a conjugate pair either member may be the one that is found
    assert (again.real, abs(again.imag)) == pytest.approx((value.real, abs(value.imag)), rel=1e-10)
    assert fewer <= used


@pytest.mark.parametrize("name", ["half", "rubbing, a tool that gives way at once"])
def test_constant_steps_converge_to_polynomials(name):
    """Quadratically: the limit of halved steps that are constant is what polynomials find with long ones, however these are cut."""
    modes, process = tip(ONE), mill(2, 0.5)
    if name != "half":
        modes, process = tip(SKEWED, (3e-9, 2e-9)), mill(2, 0.3, damping=ProcessDamping(2e13, 5e-5))
    speed, depth = 15000.0 * RPM, 1e-3
    exact, again = (MonodromyOperator(modes, process, 5).multiplier(speed, depth, step, residual=1e-10).value for step in (1e-4, 1.7e-4))
    assert abs(exact - again) < 2e-7
    constant = MonodromyOperator(modes, process, 2, frozen=True)
    one, two = (constant.multiplier(speed, depth, step, residual=1e-10).value for step in (5e-5, 2.5e-5))
    assert 3.0 < abs(one - exact) / abs(two - exact) < 5.0
    assert abs(two + (two - one) / 3.0 - exact) < 0.05 * abs(two - exact)


def windows(process):
    """(angle, start, end, delay) of each tooth, equal or not, without run-out."""
    angles, pitch = process.cutter.tooth_angle, process.cutter.pitch
    return [(angles[j], process.engagement.entry, process.engagement.exit, pitch[j]) for j in range(process.cutter.teeth)]


FROZEN: dict[str, tuple[Table, object, float, float]] = {
    "half": (ONE, mill(2, 0.5), 0.5 * np.pi, 1e-6),
    "three teeth, rotated feed": (SKEWED, mill(3, 0.75, "up", feed_angle=0.4), np.pi / 3.0, 1e-6),
    "rubbing": (SKEWED, mill(2, 0.5, damping=ProcessDamping(2e13, 5e-5)), 0.5 * np.pi, 1e-6),
}


@pytest.mark.parametrize("name", FROZEN)
def test_semi_discretisation_with_matrix_exponentials(name):
    """The same steps, with dense matrices: what is left is the polynomials' error within a step."""
    modes, process, part, tolerance = FROZEN[name]
    speed, depth, count = 12000.0 * RPM, 0.8e-3, 14
    pitch = process.cutter.pitch[0]
    cut = MonodromyOperator(tip(modes), process, 3, frozen=True)
    found = cut.multiplier(speed, depth, part / count / speed * (1.0 + 1e-9), residual=1e-9).value
    d, strength = process.damping, 0.0 if process.damping is None else process.damping.strength
    rub = depth * strength / (speed * 0.006) * np.array([0.0 if d is None else d.friction, 1.0])
    kt, kr = depth * process.coefficients.tangential, depth * process.coefficients.tangential * process.coefficients.radial_ratio
    edges = np.linspace(0.0, pitch, round(pitch / part) * count + 1)
    slow = naive.milling_multiplier(modes, windows(process), (kt, kr), edges, lambda a: a / speed, process.feed_angle, rub=tuple(rub))
    assert abs(found - complex(slow.real, abs(slow.imag))) < tolerance * abs(slow)
