"""The cross FRF's kernels against other roads; these tests run again without the compiler."""

from itertools import pairwise

import numpy as np
import pytest

from rcsa_ident.coupling.rcsa import couple
from rcsa_ident.dynamics.coordinates import Coordinate, Dof, plane
from rcsa_ident.dynamics.modal import damped_modes
from rcsa_ident.identification._kernels import frf as kernels
from rcsa_ident.identification.data import LEVER
from tests.identification.substructures import candidate, lumped, substructure

#: What is measured, as shares of the flange's motion and of other places': see `AxisData.shares`.
MEASURED = {
    "flange": np.array([[1.0]]),
    "gap and fixture": np.array([[1.0, -1.0], [0.0, 1.0]]),
    "housing": np.array([[0.0, 1.0]]),
    "gap, fixture, housing": np.array([[1.0, -1.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]),
}


#: A sensor that looks at the flange itself, others behind it and in front of it, at the holder: distance over the lever, side.
AT_FLANGE, BEHIND, IN_FRONT = (0.0, 0.0), (0.3, 0.0), (-0.2, 1.0)


def relative_speed(omega):
    """Some speed for each line."""
    return np.cos(np.arange(omega.size))


def hit(omega):
    """Rows of points as a hammer makes them: every other one on the tool-holder, and all but every third at standstill."""
    place = np.arange(omega.size)
    return (place % 2).astype(float), (place % 3 > 0).astype(float)


def cross(candidate, omega, flange, tip, measured="flange", gradient=False, x=None, hammer=None, seen=AT_FLANGE):
    """Values (n, o), and with `gradient` their change with each unknown (n, o, p)."""
    omega_n, psi, factor, softening, residual, joint = candidate
    shares = MEASURED[measured]
    outputs, places = shares.shape[0], shares.shape[1] - 1
    shapes = np.vstack([psi, residual.T])[:, : 2 + places].copy()
    m, n = omega_n.size, omega.size
    own, still = (np.ones(n), np.zeros(n)) if hammer is None else hit(omega)
    points = np.column_stack([omega, own, still, np.ones(n), relative_speed(omega) if x is None else np.full(n, x)])
    of_point = np.zeros((n, 3)) if hammer is None else hammer * (1.0 - own)[:, None]
    values, kept, turned = kernels.cross_frf(
        omega_n, shapes, factor, softening, joint, (shares, np.array(seen)), points, np.concatenate([flange, tip, of_point], axis=1)
    )
    if gradient == "turned":
        return turned
    if not gradient:
        return values
    pairs = m * (m + 1) // 2
    size = 3 * m + pairs + 3 + joint.size + (m + 2) * places + pairs * (softening.size > 0)
    rows = np.empty((size, 2 * n * outputs))
    weight = np.ones((n, outputs), dtype=complex)
    kernels.cross_frf_gradient(omega_n, factor, softening, joint, (shares, np.array(seen)), points, kept, weight, np.ones(size), rows)
    return values, as_columns(rows, n, outputs)


def as_columns(rows, n, outputs):
    return (rows[:, : n * outputs] + 1j * rows[:, n * outputs :]).T.reshape(n, outputs, -1)


def machine_of(candidate, omega, x):
    """Receptance of flange and fixture from complex modes of the machine as it is at speed x."""
    omega_n, psi, factor, softening, residual, _ = candidate
    stiffness = np.diag(omega_n**2)
    if softening.size:
        stiffness = stiffness + x * softening * np.outer(omega_n, omega_n)
    squares, turn = np.linalg.eigh(stiffness)
    assert squares.min() > 0.0
    lever = np.array([1.0, 1.0 / LEVER, 1.0])
    compliance = np.zeros((3, 3))
    compliance[:2, :2] = residual[:2] @ residual[:2].T
    compliance[2, :2] = compliance[:2, 2] = residual[2]
    points = (*plane("flange"), Coordinate("fixture", Dof.X))
    modes = damped_modes(
        np.sqrt(squares), turn.T @ factor @ factor.T @ turn, turn.T @ psi * lever, compliance * np.outer(lever, lever), points
    )
    return modes.receptance(omega)


def flange_of(candidate, omega, x):
    """That of the flange alone."""
    return machine_of(candidate, omega, x).block(plane("flange"))


def coupled(candidate, holder, x, seen=AT_FLANGE):
    """Gap and fixture by the room of couplings at speed x, shape (n, 2)."""
    joint, spindle = candidate[-1], machine_of(candidate, holder.omega, x)
    flange = couple(holder, spindle, lumped(joint))["spindle", "tip"][:, :, :1]
    # the force in the joint moves both
    force = np.linalg.solve(spindle["flange", "flange"], flange)
    if seen[1]:
        flange = flange + lumped(joint).compliance_along(holder.omega, (Dof.X, Dof.SLOPE_X))[:, :, None] * force
    flange[:, 0] += seen[0] * LEVER * flange[:, 1]
    fixture = (spindle["fixture", "flange"] @ force)[:, 0, 0]
    return np.stack([flange[:, 0, 0] - fixture, fixture], axis=1)


@pytest.mark.parametrize("soft", [False, True])
@pytest.mark.parametrize("m", [1, 2, 7])
def test_cross_frf_is_that_of_coupled_complex_modes(m, soft):
    rng = np.random.default_rng(m)
    omega = 2.0 * np.pi * rng.uniform(200.0, 4500.0, 23)
    holder, flange, tip = substructure(rng, omega)
    chosen = candidate(rng, m, soft)
    for x in (-1.0, 0.0, 0.7):
        expected = coupled(chosen, holder, x)
        both = cross(chosen, omega, flange, tip, "gap and fixture", x=x)
        np.testing.assert_allclose(both, expected, rtol=1e-7, atol=1e-11 * np.abs(expected).max())
        for seen in (BEHIND, IN_FRONT):
            looked = coupled(chosen, holder, x, seen)
            found = cross(chosen, omega, flange, tip, "gap and fixture", x=x, seen=seen)
            np.testing.assert_allclose(found, looked, rtol=1e-7, atol=1e-11 * np.abs(looked).max())
            joined = couple(holder, flange_of(chosen, omega, x), lumped(chosen[-1]), {Dof.X: seen[0] * LEVER})
            alone = joined.between("spindle.x", "tip.x")
            np.testing.assert_allclose(found.sum(axis=1), alone, rtol=1e-7, atol=1e-11 * np.abs(alone).max())
        # one output is what two of them add up to
        one = cross(chosen, omega, flange, tip, x=x)
        np.testing.assert_allclose(one[:, 0], both.sum(axis=1), rtol=1e-10, atol=1e-12 * np.abs(one).max())
        # a place is the same, whether anything else is measured or not
        alone = cross(chosen, omega, flange, tip, "housing", x=x)
        np.testing.assert_allclose(alone[:, 0], both[:, 1], rtol=1e-10, atol=1e-12 * np.abs(alone).max())


@pytest.mark.parametrize("soft", [False, True])
def test_a_spindle_that_stands_still_is_another_machine(soft):
    """Its natural frequencies are higher by one share, its damping by another; lines at speed stay as they are."""
    rng = np.random.default_rng(5)
    omega = 2.0 * np.pi * rng.uniform(200.0, 4500.0, 12)
    _, flange, tip = substructure(rng, omega)
    omega_n, psi, factor, softening, residual, joint = candidate(rng, 3, soft)
    whole = omega_n, psi, factor, softening, residual, np.append(joint, [0.06, -0.3])
    stiff = omega_n * 1.06, psi, factor * np.sqrt(0.7), softening, residual, joint
    at_speed = omega_n, psi, factor, softening, residual, joint
    hammer = np.zeros((12, 3))
    still = hit(omega)[1] > 0.0
    found, *others = (cross(each, omega, flange, tip, "gap and fixture", x=0.4, hammer=hammer) for each in (whole, stiff, at_speed))
    expected = np.where(still[:, None], *others)
    np.testing.assert_allclose(found, expected, rtol=1e-9, atol=1e-12 * np.abs(expected).max())


def test_nothing_softens_at_the_middle_speed():
    rng = np.random.default_rng(4)
    omega = 2.0 * np.pi * rng.uniform(200.0, 4500.0, 9)
    _, flange, tip = substructure(rng, omega)
    soft = candidate(rng, 3, True)
    plain = (*soft[:3], np.zeros((0, 0)), *soft[4:])
    found = [cross(each, omega, flange, tip, "gap and fixture", gradient=True, x=0.0) for each in (soft, plain)]
    np.testing.assert_allclose(found[0][0], found[1][0], rtol=1e-12)
    first = 3 * 3 + 6 + 3 + 5
    np.testing.assert_array_equal(found[0][1][:, :, first : first + 6], 0.0)
    kept = np.delete(found[0][1], np.s_[first : first + 6], axis=2)
    np.testing.assert_allclose(kept, found[1][1], rtol=1e-9, atol=1e-14 * np.abs(kept).max())


@pytest.mark.parametrize("seen", [AT_FLANGE, BEHIND, IN_FRONT])
@pytest.mark.parametrize("stands", [False, True])
@pytest.mark.parametrize("soft", [False, True])
@pytest.mark.parametrize("measured", MEASURED)
def test_cross_frf_gradient_against_differences(measured, soft, stands, seen):
    outputs, places = MEASURED[measured].shape[0], MEASURED[measured].shape[1] - 1
    rng = np.random.default_rng(5)
    m = 3
    side = {"seen": seen}
    omega = 2.0 * np.pi * rng.uniform(200.0, 4500.0, 11)
    _, flange, tip = substructure(rng, omega)
    omega_n, psi, factor, softening, residual, joint = chosen = candidate(rng, m, soft, max(places, 1))
    hammer, still = None, []
    if stands:
        hammer, still = 1e-8 * (rng.standard_normal((11, 3)) + 1j * rng.standard_normal((11, 3))), [np.array([0.03, -0.2])]
        chosen = (*chosen[:-1], np.concatenate([joint, *still]))
    values, gradient = cross(chosen, omega, flange, tip, measured, gradient=True, hammer=hammer, **side)
    np.testing.assert_array_equal(values, cross(chosen, omega, flange, tip, measured, hammer=hammer, **side))
    lower = np.tril_indices(m)
    compliance = (residual[:2] @ residual[:2].T)[np.tril_indices(2)]
    parts = [np.log(omega_n), psi[:, :2].ravel(), factor[lower], compliance]
    for e in range(places):
        parts += [psi[:, 2 + e], residual[2 + e]]
    parts += still
    parts += [softening[lower]] if soft else []
    flat = np.concatenate([*parts, joint])
    bounds = np.cumsum([0, *(p.size for p in parts), 4])

    def at(vector):
        each = [vector[a:b] for a, b in pairwise(bounds)]
        changed_factor, changed_psi, changed_residual = np.zeros((m, m)), psi.copy(), residual.copy()
        changed_factor[lower] = each[2]
        changed_psi[:, :2] = each[1].reshape(m, 2)
        # the columns are those of the compliance itself, not of its factor
        tt, tr, rr = each[3]
        changed_residual[:2] = np.linalg.cholesky([[tt, tr], [tr, rr]])
        for e in range(places):
            changed_psi[:, 2 + e], changed_residual[2 + e] = each[4 + 2 * e], each[5 + 2 * e]
        symmetric = np.zeros_like(softening)
        if soft:
            symmetric[lower] = each[-2]
            symmetric.T[lower] = each[-2]
        last = np.concatenate([each[-1], *([each[-2 - soft]] if stands else [])])
        changed = np.exp(each[0]), changed_psi, changed_factor, symmetric, changed_residual, last
        return cross(changed, omega, flange, tip, measured, hammer=hammer, **side)

    np.testing.assert_allclose(at(flat), values, rtol=1e-10)
    assert gradient.shape == (11, outputs, flat.size)
    for k in range(flat.size):
        step = np.zeros(flat.size)
        step[k] = 1e-5 if k < m else 1e-5 * abs(flat[k])
        difference = (at(flat + step) - at(flat - step)) / (2.0 * step[k])
        for o in range(outputs):
            size = max(np.abs(difference[:, o]).max(), 1e-7 * np.abs(values).max() / abs(flat[k]))
            assert np.abs(gradient[:, o, k] - difference[:, o]).max() < 1e-5 * size, (k, o)


@pytest.mark.parametrize("seen", [AT_FLANGE, BEHIND, IN_FRONT])
def test_the_slope_is_the_change_with_the_distance(seen):
    rng = np.random.default_rng(6)
    omega = 2.0 * np.pi * rng.uniform(200.0, 4500.0, 11)
    _, flange, tip = substructure(rng, omega)
    chosen = candidate(rng, 3, True)
    near, far = (cross(chosen, omega, flange, tip, "gap and fixture", seen=(seen[0] + d, seen[1])) for d in (-1e-3, 1e-3))
    slope = cross(chosen, omega, flange, tip, "gap and fixture", "turned", seen=seen)
    np.testing.assert_allclose((far - near)[:, 0] / 2e-3, slope, rtol=1e-8)
    # of the fixture nothing depends on it
    np.testing.assert_array_equal(far[:, 1], near[:, 1])


@pytest.mark.parametrize("further", [0, 1, 3])
def test_blocks_of_frequencies_are_independent(further):
    """As many lines as a block holds or more, and a last block that is not full, or has one line: each line is as it is alone."""
    rng = np.random.default_rng(16)
    omega = 2.0 * np.pi * rng.uniform(200.0, 4500.0, kernels.BLOCK + further)
    _, flange, tip = substructure(rng, omega)
    chosen = candidate(rng, 3, True)
    whole = cross(chosen, omega, flange, tip, "gap and fixture", gradient=True, x=0.3)
    last = np.s_[-5:]
    few = cross(chosen, omega[last], flange[last], tip[last], "gap and fixture", gradient=True, x=0.3)
    for many, one in zip(whole, few, strict=True):
        np.testing.assert_allclose(many[last], one, rtol=1e-10, atol=1e-13 * np.abs(one).max())


@pytest.mark.parametrize("measured", ["flange", "gap and fixture"])
def test_tool_holder_rows_weights_and_scales(measured):
    """The tip's own receptances move the lines as differences say; each row has its scale, each line its weight."""
    rng = np.random.default_rng(17)
    omega = 2.0 * np.pi * rng.uniform(200.0, 4500.0, 7)
    _, flange, tip = substructure(rng, omega)
    omega_n, psi, factor, softening, residual, joint = candidate(rng, 2)
    shares = MEASURED[measured]
    outputs = shares.shape[0]
    shapes = np.vstack([psi, residual.T])[:, : 1 + shares.shape[1]].copy()
    own = hit(omega)[0]
    points = np.column_stack([omega, own, np.zeros(7), np.ones(7)])
    direct = 1e-8 * (rng.standard_normal(7) + 1j * rng.standard_normal(7))

    def at(blocks):
        here = np.column_stack([blocks, -blocks[:, 3:5]])
        here[:, 5:] *= (1.0 - own)[:, None]
        return kernels.cross_frf(omega_n, shapes, factor, softening, joint, (shares, np.array(IN_FRONT)), points, here)

    blocks = np.column_stack([flange, tip, direct])
    _, kept, _ = at(blocks)
    size = 6 + 3 + 3 + 4 + 4 * (outputs - 1)
    weight, scale = rng.standard_normal((7, outputs)) + 1j * rng.standard_normal((7, outputs)), rng.standard_normal(size)
    rows, plain = np.empty((size + 6, 14 * outputs)), np.empty((size, 14 * outputs))
    kernels.cross_frf_gradient(omega_n, factor, softening, joint, (shares, np.array(IN_FRONT)), points, kept, weight, scale, rows)
    ones = np.ones((7, outputs), dtype=complex)
    kernels.cross_frf_gradient(omega_n, factor, softening, joint, (shares, np.array(IN_FRONT)), points, kept, ones, np.ones(size), plain)
    found, unweighted = as_columns(rows, 7, outputs), as_columns(plain, 7, outputs)
    expected = unweighted * weight[:, :, None] * scale
    np.testing.assert_allclose(found[:, :, :size], expected, rtol=1e-10, atol=1e-13 * np.abs(expected).max())
    for k in range(6):
        step = np.zeros(6)
        step[k] = 1e-6 * np.abs(blocks[:, k]).max()
        difference = (at(blocks + step)[0] - at(blocks - step)[0]) / (2.0 * step[k]) * weight
        np.testing.assert_allclose(found[:, :, size + k], difference, rtol=1e-5, atol=1e-6 * max(np.abs(difference).max(), 1e-3))


def test_compiled_and_plain_agree(monkeypatch):
    """The same Python, run by the interpreter: what the compiler may have reordered shows here."""
    rng = np.random.default_rng(12)
    omega = 2.0 * np.pi * rng.uniform(200.0, 4500.0, 9)
    _, flange, tip = substructure(rng, omega)
    soft = candidate(rng, 3, True)
    hammer = 1e-8 * (rng.standard_normal((9, 3)) + 1j * rng.standard_normal((9, 3)))
    stands = (*soft[:-1], np.append(soft[-1], [0.03, -0.2]))
    results = []
    for _ in range(2):
        for measured in ("flange", "gap and fixture", "housing"):
            for each in (soft, (*soft[:3], np.zeros((0, 0)), *soft[4:])):
                results.append(cross(each, omega, flange, tip, measured, gradient=True))
            results.append(cross(stands, omega, flange, tip, measured, gradient=True, hammer=hammer, seen=IN_FRONT))
        for name, function in list(vars(kernels).items()):
            if hasattr(function, "py_func"):
                monkeypatch.setattr(kernels, name, function.py_func)
    half = len(results) // 2
    for compiled, plain in zip(results[:half], results[half:], strict=True):
        for one, other in zip(compiled, plain, strict=True):
            np.testing.assert_allclose(one, other, rtol=1e-9, atol=1e-12 * np.abs(other).max())
