"""The kernels of the identification against other roads; these tests run again without the compiler."""

from itertools import pairwise

import numpy as np
import pytest
from scipy.optimize import minimize

from rcsa_ident.coupling.joint import LumpedJoint
from rcsa_ident.coupling.rcsa import couple
from rcsa_ident.dynamics.coordinates import Coordinate, Dof, plane
from rcsa_ident.dynamics.modal import ModalModel, damped_modes
from rcsa_ident.dynamics.receptance import Receptance
from rcsa_ident.identification import _kernels as kernels
from rcsa_ident.identification.data import LEVER
from rcsa_ident.identification.genetic_algorithm import modal_fractions


def substructure(rng, omega):
    """A free tool-holder's receptances: random, of a real one's size; symmetric as they must be."""
    scale = np.array([1.0, 1.0 / LEVER, 1.0, 1.0 / LEVER])
    values = 1e-8 * (rng.standard_normal((omega.size, 4, 4)) + 1j * rng.standard_normal((omega.size, 4, 4)))
    values = (values + np.swapaxes(values, 1, 2)) * np.outer(scale, scale)
    points = (*plane("tip"), *plane("flange"))
    response = Receptance(omega, values, points, points)
    a22, a21 = response["flange", "flange"], response["flange", "tip"]
    flange = np.stack([a22[:, 0, 0], LEVER * a22[:, 0, 1], LEVER**2 * a22[:, 1, 1]], axis=1)
    return response, flange, np.stack([a21[:, 0, 0], LEVER * a21[:, 1, 0]], axis=1)


#: What is measured, as shares of the flange's motion and of other places': see `AxisData.shares`.
MEASURED = {
    "flange": np.array([[1.0]]),
    "gap and fixture": np.array([[1.0, -1.0], [0.0, 1.0]]),
    "housing": np.array([[0.0, 1.0]]),
    "gap, fixture, housing": np.array([[1.0, -1.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]),
}


def candidate(rng, m, soft=False, places=1):
    """Natural frequencies, shapes, damping factor, softening, residual, joint."""
    omega_n = 2.0 * np.pi * rng.uniform(300.0, 4000.0, m)
    psi = rng.standard_normal((m, 2 + places))
    factor = np.tril(10.0 * rng.standard_normal((m, m)))
    softening = 0.1 * rng.standard_normal((m, m)) if soft else np.zeros((0, 0))
    residual = np.array([[4e-5, 0.0], [1e-5, 3e-5], *[[2e-10, -3e-10], [1e-10, 4e-10]][:places]])
    joint = np.array([2e8, 3e8, 900.0, 700.0]) * rng.uniform(0.5, 2.0, 4)  # scaled: rotational ones per lever squared
    return omega_n, psi, factor, softening + softening.T, residual, joint


def lumped(joint):
    return LumpedJoint(joint[0], joint[1] * LEVER**2, joint[2], joint[3] * LEVER**2)


def relative_speed(omega):
    """Some speed for each line."""
    return np.cos(np.arange(omega.size))


def hit(omega):
    """Rows of points as a hammer makes them: every other one on the tool-holder, and all but every third at standstill."""
    place = np.arange(omega.size)
    return (place % 2).astype(float), (place % 3 > 0).astype(float)


def cross(function, candidate, omega, flange, tip, measured="flange", gradient=False, x=None, hammer=None):
    omega_n, psi, factor, softening, residual, joint = candidate
    shares = MEASURED[measured]
    outputs, places = shares.shape[0], shares.shape[1] - 1
    shapes = np.vstack([psi, residual.T])[:, : 2 + places].copy()
    m = omega_n.size
    own, still = (np.ones(omega.size), np.zeros(omega.size)) if hammer is None else hit(omega)
    points = np.column_stack([omega, relative_speed(omega) if x is None else np.full(omega.size, x), own, still])
    of_point = np.zeros((omega.size, 3)) if hammer is None else hammer * (1.0 - own)[:, None]
    values = np.empty((omega.size, outputs), dtype=complex)
    pairs = m * (m + 1) // 2
    size = 3 * m + pairs + 3 + joint.size + (m + 2) * places + pairs * (softening.size > 0)
    rows = np.empty((omega.size if gradient else 0, outputs, size), dtype=complex)
    function(omega_n, shapes, factor, softening, joint, shares, points, np.concatenate([flange, tip, of_point], axis=1), values, rows)
    return (values, rows) if gradient else values


def coupled(candidate, holder, x):
    """Gap and fixture by the room of couplings, from complex modes of the machine as it is at speed x, shape (n, 2)."""
    omega_n, psi, factor, softening, residual, joint = candidate
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
    spindle = modes.receptance(holder.omega)
    flange = couple(holder, spindle, lumped(joint))["spindle", "tip"][:, :, :1]
    # the force in the joint moves both
    force = np.linalg.solve(spindle["flange", "flange"], flange)
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
        both = cross(kernels.cross_frf, chosen, omega, flange, tip, "gap and fixture", x=x)
        np.testing.assert_allclose(both, expected, rtol=1e-7, atol=1e-11 * np.abs(expected).max())
        # one output is what two of them add up to
        one = cross(kernels.cross_frf, chosen, omega, flange, tip, x=x)
        np.testing.assert_allclose(one[:, 0], both.sum(axis=1), rtol=1e-10, atol=1e-12 * np.abs(one).max())
        # a place is the same, whether anything else is measured or not
        alone = cross(kernels.cross_frf, chosen, omega, flange, tip, "housing", x=x)
        np.testing.assert_allclose(alone[:, 0], both[:, 1], rtol=1e-10, atol=1e-12 * np.abs(alone).max())


def test_nothing_softens_at_the_middle_speed():
    rng = np.random.default_rng(4)
    omega = 2.0 * np.pi * rng.uniform(200.0, 4500.0, 9)
    _, flange, tip = substructure(rng, omega)
    soft = candidate(rng, 3, True)
    plain = (*soft[:3], np.zeros((0, 0)), *soft[4:])
    found = [cross(kernels.cross_frf, each, omega, flange, tip, "gap and fixture", gradient=True, x=0.0) for each in (soft, plain)]
    np.testing.assert_allclose(found[0][0], found[1][0], rtol=1e-12)
    first = 3 * 3 + 6 + 3 + 5
    np.testing.assert_array_equal(found[0][1][:, :, first : first + 6], 0.0)
    kept = np.delete(found[0][1], np.s_[first : first + 6], axis=2)
    np.testing.assert_allclose(kept, found[1][1], rtol=1e-9, atol=1e-14 * np.abs(kept).max())


@pytest.mark.parametrize("stands", [False, True])
@pytest.mark.parametrize("soft", [False, True])
@pytest.mark.parametrize("measured", MEASURED)
def test_cross_frf_gradient_against_differences(measured, soft, stands):
    outputs, places = MEASURED[measured].shape[0], MEASURED[measured].shape[1] - 1
    rng = np.random.default_rng(5)
    m = 3
    omega = 2.0 * np.pi * rng.uniform(200.0, 4500.0, 11)
    _, flange, tip = substructure(rng, omega)
    omega_n, psi, factor, softening, residual, joint = chosen = candidate(rng, m, soft, max(places, 1))
    hammer, still = None, []
    if stands:
        hammer, still = 1e-8 * (rng.standard_normal((11, 3)) + 1j * rng.standard_normal((11, 3))), [np.array([0.03, -0.2])]
        chosen = (*chosen[:-1], np.concatenate([joint, *still]))
    values, gradient = cross(kernels.cross_frf, chosen, omega, flange, tip, measured, gradient=True, hammer=hammer)
    np.testing.assert_array_equal(values, cross(kernels.cross_frf, chosen, omega, flange, tip, measured, hammer=hammer))
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
        return cross(kernels.cross_frf, changed, omega, flange, tip, measured, hammer=hammer)

    np.testing.assert_allclose(at(flat), values, rtol=1e-10)
    assert gradient.shape == (11, outputs, flat.size)
    for k in range(flat.size):
        step = np.zeros(flat.size)
        step[k] = 1e-5 if k < m else 1e-5 * abs(flat[k])
        difference = (at(flat + step) - at(flat - step)) / (2.0 * step[k])
        for o in range(outputs):
            size = max(np.abs(difference[:, o]).max(), 1e-7 * np.abs(values).max() / abs(flat[k]))
            assert np.abs(gradient[:, o, k] - difference[:, o]).max() < 1e-5 * size, (k, o)


@pytest.mark.parametrize("measured", MEASURED)
def test_cross_frf_gradient_of_the_tool_holder(measured):
    """The lines move with the tool-holder's own receptances as differences say; a hammer finds the tip in the first output alone."""
    rng = np.random.default_rng(7)
    omega = 2.0 * np.pi * rng.uniform(200.0, 4500.0, 11)
    _, flange, tip = substructure(rng, omega)
    shares = MEASURED[measured]
    omega_n, psi, factor, softening, residual, joint = candidate(rng, 3, False, max(shares.shape[1] - 1, 1))
    shapes = np.vstack([psi, residual.T])[:, : 1 + shares.shape[1]].copy()
    away = 1.0 - hit(omega)[0]
    points = np.column_stack([omega, np.zeros(11), 1.0 - away, np.zeros(11)])
    size = 9 + 6 + 3 + 5 * (shares.shape[1] - 1) + 4

    def at(change, rows):
        holder = np.column_stack([flange, tip, away * 1e-8, -away * tip[:, 0], -away * tip[:, 1]]).astype(complex)
        holder[:, :5] += change[:, :5]
        holder[:, 5] += away * change[:, 5]
        holder[:, 6:] -= away[:, None] * change[:, 3:5]
        values = np.empty((11, shares.shape[0]), dtype=complex)
        kernels.cross_frf(omega_n, shapes, factor, softening, joint, shares, points, holder, values, rows)
        return values

    gradient = np.empty((11, shares.shape[0], size + 6), dtype=complex)
    at(np.zeros((11, 6)), gradient)
    sizes = np.concatenate([np.abs(flange).mean(axis=0), np.abs(tip).mean(axis=0), [1e-8]])
    for k, step in enumerate(1e-5 * sizes):
        change = np.zeros((11, 6))
        change[:, k] = step
        none = np.empty((0, shares.shape[0], 0), dtype=complex)
        difference = (at(change, none) - at(-change, none)) / (2.0 * step)
        np.testing.assert_allclose(gradient[:, :, size + k], difference, rtol=1e-5, atol=1e-6 * np.abs(difference).max() + 1e-12)


@pytest.mark.slow
def test_modal_cross_frf_is_that_of_coupled_modes():
    rng = np.random.default_rng(6)
    omega = 2.0 * np.pi * rng.uniform(200.0, 4500.0, 17)
    holder, flange, tip = substructure(rng, omega)
    omega_n, zeta = 2.0 * np.pi * rng.uniform(300.0, 4000.0, 4), rng.uniform(0.01, 0.3, 4)
    phi = 5e-3 * (rng.standard_normal((4, 2)) + 1j * rng.standard_normal((4, 2))) * np.array([1.0, 1.0 / LEVER])
    joint = candidate(rng, 1)[-1]
    modes = ModalModel(omega_n, zeta, phi, np.zeros((2, 2)), plane("flange"))
    expected = couple(holder, modes.receptance(omega), lumped(joint))["spindle", "tip"][:, 0, 0]
    fractions = modal_fractions(omega_n, zeta, phi[:, 0], LEVER * phi[:, 1])
    out = np.empty((2, omega.size))
    parts = [np.ascontiguousarray(np.concatenate([[c.real, c.imag] for c in block.T])) for block in (flange, tip)]
    kernels.modal_cross_frf(fractions, joint, omega, *parts, out)
    np.testing.assert_allclose(out[0] + 1j * out[1], expected, rtol=1e-9)


def cuts(rng, sizes, trigger=0.0, air=0.3, scatter=0.05, outputs=1, holes=False):
    """Lines of a few cuts with a true delay and angle each, a model that fits them up to a scatter, priors.

    With `holes` some harmonics are missing: the force has no line there.
    """
    each = []
    for count in sizes:
        harmonic = np.arange(1, count + 1)
        each.append(np.sort(rng.choice(np.arange(1, 2 * count + 1), count, replace=False)) if holes else harmonic)
    sizes = [outputs * k for k in sizes]
    start = np.concatenate([[0], np.cumsum(sizes)])
    n = start[-1]
    period = rng.uniform(0.8e-3, 1.8e-3, len(sizes))
    truth = np.stack([rng.uniform(0.0, period), rng.uniform(-0.1, 0.1, len(sizes))], axis=1)
    cut = np.repeat(np.arange(len(sizes)), sizes)
    order = 4.0 * np.repeat(np.concatenate(each), outputs)
    omega = order / 4.0 * 2.0 * np.pi / period[cut]
    model = rng.standard_normal(n) + 1j * rng.standard_normal(n)
    still = air * (rng.standard_normal(n) + 1j * rng.standard_normal(n))
    noise = scatter * (rng.standard_normal(n) + 1j * rng.standard_normal(n))
    lines = np.stack([(model + noise) * np.exp(-1j * omega * truth[cut, 0]) + still * np.exp(1j * order * truth[cut, 1]), still], axis=1)
    weights = np.stack([omega, order, rng.uniform(1.0, 400.0, n)], axis=1)
    mean = truth[:, 0] + rng.integers(-2, 3, len(sizes)) * period if trigger else np.zeros(len(sizes))
    prior = np.stack([mean + 1e-5, np.full(len(sizes), trigger), np.full(len(sizes), 100.0), period], axis=1)
    return lines, weights, model, start, prior, truth


def naive_misfit(lines, weights, model, prior, unknowns):
    delay, angle = unknowns
    total = prior[1] * (delay - prior[0]) ** 2 + prior[2] * angle**2
    for (c, a), (omega, order, w), g in zip(lines, weights, model, strict=True):
        total += w * abs((c - a * np.exp(1j * order * angle)) * np.exp(1j * omega * delay) - g) ** 2
    return total


@pytest.mark.parametrize(("outputs", "holes"), [(1, False), (2, False), (2, True)])
@pytest.mark.parametrize("trigger", [0.0, 1e11])
def test_fit_cuts_against_brute_force(trigger, outputs, holes):
    lines, weights, model, start, prior, truth = cuts(np.random.default_rng(8), [5, 1, 7], trigger, outputs=outputs, holes=holes)
    nuisance = np.zeros((3, 2))
    kernels.fit_cuts(lines, weights, model, start, prior, nuisance, 32)
    for k in (0, 2):
        part = slice(start[k], start[k + 1])
        period = prior[k, 3]

        def value(x, part=part, k=k, period=period):
            return naive_misfit(lines[part], weights[part], model[part], prior[k], (x[0] * period, x[1]))

        centre = prior[k, 0] / period if trigger else 0.5
        starts = [(centre + d, 0.0) for d in np.linspace(-0.5, 0.5, 12, endpoint=False)]
        best = min((minimize(value, s, method="BFGS") for s in starts), key=lambda r: r.fun)
        found = value((nuisance[k, 0] / period, nuisance[k, 1]))
        assert found == pytest.approx(best.fun, rel=1e-6)
        away = nuisance[k, 0] - (prior[k, 0] if trigger else truth[k, 0])
        if trigger:
            assert abs(away) < 2e-5  # the prior says which period
        else:
            assert abs(away - period * np.round(away / period)) < 0.02 * period


def test_fit_cuts_leaves_alone_what_nothing_tells():
    lines, weights, model, start, prior, _ = cuts(np.random.default_rng(9), [4, 0, 3], air=0.0)
    nuisance = np.array([[1e-4, 0.0], [3e-4, 0.0], [2e-4, 0.0]])
    kernels.fit_cuts(lines, weights, model, start, prior, nuisance, 32)
    np.testing.assert_array_equal(nuisance[1], [3e-4, 0.0])  # a cut without lines
    np.testing.assert_allclose(nuisance[:, 1], 0.0, atol=1e-12)  # angles without an air cut


def test_fit_cuts_never_makes_it_worse():
    rng = np.random.default_rng(10)
    for _ in range(20):
        lines, weights, model, start, prior, _ = cuts(rng, [6, 2], scatter=1.0)
        before = np.stack([rng.uniform(0.0, prior[:, 3]), rng.uniform(-0.3, 0.3, 2)], axis=1)
        after = before.copy()
        kernels.fit_cuts(lines, weights, model, start, prior, after, 0)
        for k in range(2):
            part = slice(start[k], start[k + 1])
            here = [naive_misfit(lines[part], weights[part], model[part], prior[k], n[k]) for n in (before, after)]
            assert here[1] <= here[0] * (1.0 + 1e-12)


def test_best_grid_misfit_against_loops():
    rng = np.random.default_rng(11)
    lines, weights, model, start, prior, _ = cuts(rng, [5, 3, 8], air=0.0, scatter=0.3)
    grid, cut = 64, np.repeat(np.arange(3), np.diff(start))
    measured, group = lines[:, 0], np.array([1, 0, 1])
    delays = np.arange(grid)[:, None] / grid * prior[cut, 3]
    turned = measured * np.exp(1j * weights[:, 0] * delays)
    table = np.ascontiguousarray(np.stack([turned.real, turned.imag], axis=1))
    totals = np.array([1.0, 2.0])
    kernels.best_grid_misfit(np.stack([model.real, model.imag]), np.abs(measured) ** 2, weights[:, 2].copy(), table, start, group, totals)
    expected = np.array([1.0, 2.0])
    for k in range(3):
        on_grid, fine = np.inf, np.inf
        for d in range(grid * 64):
            delay = d / (64 * grid) * prior[k, 3]
            each = [
                weights[j, 2] * abs(measured[j] * np.exp(1j * weights[j, 0] * delay) - model[j]) ** 2 for j in range(start[k], start[k + 1])
            ]
            fine = min(fine, sum(each))
            on_grid = min(on_grid, sum(each)) if d % 64 == 0 else on_grid
        expected[group[k]] += fine
        assert fine <= on_grid
    # the parabola through three grid points stands in for the continuous delay
    np.testing.assert_allclose(totals, expected, rtol=0.02)


def test_whiten_is_the_chain_rule_in_standard_deviations():
    rng = np.random.default_rng(14)
    n, p, c = 6, 5, 3
    gradient, extra, model = (rng.standard_normal(s) + 1j * rng.standard_normal(s) for s in ((n, p), (n, c), (n,)))
    weight, chain = rng.uniform(1.0, 9.0, n), rng.standard_normal(p)
    out = np.empty((2 * n, p + c))
    kernels.whiten(gradient, extra, model, weight, chain, out)
    # residual = sqrt(weight) (measured - model)
    expected = -np.sqrt(weight)[:, None] * np.hstack([gradient * chain, extra * model[:, None]])
    np.testing.assert_allclose(out, np.vstack([expected.real, expected.imag]), rtol=1e-12)


def mixing(rng, n=9, cuts=4, own=3, tail=7, shared=2, size=10):
    """Arguments of `mix_cuts`; one cut has no line."""
    jacobian = rng.standard_normal((2 * n, own + shared))
    columns = rng.standard_normal((n, 2)) + 1j * rng.standard_normal((n, 2))
    cut = np.sort(rng.choice([0, 1, 3], n))
    return jacobian, columns, cut, own, 2, tail, rng.standard_normal((cuts, 2, 2)), rng.standard_normal((cuts, 2, size))


def test_mix_cuts_are_the_blocks_of_the_normal_matrix():
    jacobian, columns, cut, own, first, tail, inner, mixed = mixing(np.random.default_rng(15))
    before = inner.copy(), mixed.copy()
    kernels.mix_cuts(jacobian, columns, cut, own, first, tail, inner, mixed)
    whole = np.zeros((jacobian.shape[0], mixed.shape[2]))
    whole[:, first : first + own], whole[:, tail : tail + 2] = jacobian[:, :own], jacobian[:, own:]
    stacked = np.vstack([columns.real, columns.imag])
    for k in range(4):
        mine = np.concatenate([cut == k, cut == k])
        np.testing.assert_allclose(inner[k] - before[0][k], stacked[mine].T @ stacked[mine], atol=1e-12)
        np.testing.assert_allclose(mixed[k] - before[1][k], stacked[mine].T @ whole[mine], atol=1e-12)


NAMES = ["cross_frf", "modal_cross_frf", "fit_cuts", "best_grid_misfit", "whiten", "mix_cuts"]


def test_every_kernel_is_run_both_ways():
    public = [name for name, each in vars(kernels).items() if callable(each) and not name.startswith("_")]
    assert sorted(public) == sorted(NAMES)


@pytest.mark.parametrize("name", NAMES)
def test_compiled_and_plain_agree(name, monkeypatch):
    """The same Python, run by the interpreter: what the compiler may have reordered shows here."""
    rng = np.random.default_rng(12)
    omega = 2.0 * np.pi * rng.uniform(200.0, 4500.0, 9)
    _, flange, tip = substructure(rng, omega)
    chosen = candidate(rng, 3, True)
    compiled = getattr(kernels, name)
    plain = getattr(compiled, "py_func", compiled)
    results = []
    for function in (compiled, plain):
        if function is plain:
            for helper in ("_factor_solve", "_cut_misfit", "_cut_normal"):
                monkeypatch.setattr(kernels, helper, getattr(getattr(kernels, helper), "py_func", getattr(kernels, helper)))
        rng = np.random.default_rng(13)
        if name == "cross_frf":
            both = [
                cross(function, each, omega, flange, tip, measured, gradient=True)
                for measured in ("flange", "gap and fixture", "housing")
                for each in (chosen, (*chosen[:3], np.zeros((0, 0)), *chosen[4:]))
            ]
            results.append(np.concatenate([r.ravel() for pair in both for r in pair]))
        elif name == "modal_cross_frf":
            out = np.empty((2, omega.size))
            parts = [np.ascontiguousarray(np.concatenate([[c.real, c.imag] for c in block.T])) for block in (flange, tip)]
            fractions = modal_fractions(chosen[0], np.array([0.05, 0.1, 0.2]), 1e-3 * chosen[1][:, 0], 1e-3j * chosen[1][:, 1])
            function(fractions, chosen[-1], omega, *parts, out)
            results.append(out)
        elif name == "fit_cuts":
            lines, weights, model, start, prior, _ = cuts(rng, [5, 3], outputs=2, holes=True)
            nuisance = np.zeros((2, 2))
            function(lines, weights, model, start, prior, nuisance, 16)
            results.append(nuisance)
        elif name == "whiten":
            gradient, extra, model = (rng.standard_normal(s) + 1j * rng.standard_normal(s) for s in ((6, 5), (6, 2), (6,)))
            out = np.empty((12, 7))
            function(gradient, extra, model, rng.uniform(1.0, 9.0, 6), rng.standard_normal(5), out)
            results.append(out)
        elif name == "mix_cuts":
            arguments = mixing(rng)
            function(*arguments)
            results.append(np.concatenate([arguments[-2].ravel(), arguments[-1].ravel()]))
        else:
            totals = np.zeros(1)
            table = rng.standard_normal((8, 2, 9))
            start, group = np.array([0, 4, 9]), np.zeros(2, dtype=int)
            function(rng.standard_normal((2, 9)), rng.uniform(size=9), rng.uniform(size=9), table, start, group, totals)
            results.append(totals)
    np.testing.assert_allclose(results[0], results[1], rtol=1e-9, atol=1e-12 * np.abs(results[1]).max() if name == "cross_frf" else 0.0)
