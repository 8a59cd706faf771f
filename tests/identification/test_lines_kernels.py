"""The kernels of the identification against other roads; these tests run again without the compiler."""

import numpy as np
import pytest
from scipy.optimize import minimize

from rcsa_ident.coupling.rcsa import couple
from rcsa_ident.dynamics.coordinates import plane
from rcsa_ident.dynamics.modal import ModalModel
from rcsa_ident.identification._kernels import lines as kernels
from rcsa_ident.identification.data import LEVER
from rcsa_ident.identification.genetic_algorithm import modal_fractions
from tests.identification.substructures import candidate, lumped, substructure


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


@pytest.mark.parametrize(
    ("seed", "lines_of_cuts", "scatter", "times"),
    # lines without any order; and from the tops as from the slopes, over steps that are too long at first
    [(10, [6, 2], 1.0, 1.0 + 1e-12), (16, [6, 5], 0.1, 0.98)],
)
def test_fit_cuts_from_anywhere_comes_down(seed, lines_of_cuts, scatter, times):
    rng = np.random.default_rng(seed)
    for _ in range(12):
        lines, weights, model, start, prior, _ = cuts(rng, lines_of_cuts, scatter=scatter)
        before = np.stack([rng.uniform(0.0, prior[:, 3]), rng.uniform(-0.3, 0.3, 2)], axis=1)
        after = before.copy()
        kernels.fit_cuts(lines, weights, model, start, prior, after, 0)
        for k in range(2):
            part = slice(start[k], start[k + 1])
            here = [naive_misfit(lines[part], weights[part], model[part], prior[k], n[k]) for n in (before, after)]
            assert here[1] <= times * here[0]


@pytest.mark.parametrize("orders", [[1.0, 2.0, 3.0, 4.0], [1.0, 1.0, 2.0, 5.0], [3.0, 4.0, 5.0, 7.0]])
def test_misfits_of_a_cut_and_their_slopes(orders):
    """Of each helper, for any gaps between the harmonics, against plain sums and differences."""
    rng = np.random.default_rng(17)
    order, period = np.array(orders), 1.1e-3
    lines = rng.standard_normal((4, 2)) + 1j * rng.standard_normal((4, 2))
    model, weights = (
        rng.standard_normal(4) + 1j * rng.standard_normal(4),
        np.stack([order * 2.0 * np.pi / period, order, rng.uniform(1.0, 9.0, 4)]).T,
    )
    delay, angle, grid = 0.3e-3, 0.2, 5
    none, prior = np.zeros(4), np.array([0.1e-3, 4e7, 30.0, period])
    bare = naive_misfit(lines, weights, model, none, (delay, angle))
    assert kernels._cut_misfit(lines, weights, model, 0, 4, delay, angle) == pytest.approx(bare)
    for twist in (angle, 0.0):
        overlap = np.empty(grid)
        size = kernels._grid_overlap(lines, weights, model, 0, 4, period / grid, twist, overlap, np.empty((2, grid)), np.empty((2, grid)))
        expected = [naive_misfit(lines, weights, model, none, (k * period / grid, twist)) for k in range(grid)]
        np.testing.assert_allclose(size - 2.0 * overlap, expected)
    out = np.empty(6)
    kernels._cut_normal(lines, weights, model, 0, 4, prior, delay, angle, out)
    assert out[0] == pytest.approx(naive_misfit(lines, weights, model, prior, (delay, angle)))
    steps = np.array([1e-9, 1e-6])
    scale = np.sqrt(np.append(weights[:, 2], prior[1:3]))

    def residual(x):
        fit = (lines[:, 0] - lines[:, 1] * np.exp(1j * order * x[1])) * np.exp(1j * weights[:, 0] * x[0]) - model
        return scale * np.concatenate([fit, [x[0] - prior[0], x[1]]])

    here = np.array([delay, angle])
    slopes = np.stack([(residual(here + way) - residual(here - way)) / (2.0 * way.sum()) for way in np.diag(steps)])
    gradient, matrix = (slopes.conj() @ residual(here)).real, (slopes.conj() @ slopes.T).real
    np.testing.assert_allclose(out[1:], [*gradient, matrix[0, 0], matrix[0, 1], matrix[1, 1]], rtol=1e-6)


def test_best_of_a_grid_is_that_between_its_points():
    """A single line, whose overlap is a cosine: the parabola through three points misses it by less than a millionth of it."""
    grid = 64
    delay = np.arange(grid) / grid
    for late in (0.0, 0.003, 0.3081, 0.996):
        table = np.exp(2j * np.pi * (delay - late))[None]
        totals = np.zeros(1)
        given = np.array([[1.0], [0.0]]), np.array([1.2]), np.ones(1), np.stack([table.real, table.imag], axis=1)
        kernels.best_grid_misfit(*given, np.array([0, 1]), np.zeros(1, dtype=int), totals)
        assert totals[0] == pytest.approx(0.2, abs=5e-6)


def test_best_grid_misfit_against_loops():
    rng = np.random.default_rng(11)
    lines, weights, model, start, prior, _ = cuts(rng, [5, 3, 8], air=0.0, scatter=0.3)
    grid, cut = 64, np.repeat(np.arange(3), np.diff(start))
    measured, group = lines[:, 0], np.array([1, 0, 1])
    delays = np.arange(grid) / grid * prior[cut, 3][:, None]
    turned = measured[:, None] * np.exp(1j * weights[:, :1] * delays)
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


def test_turned_lines_are_those_without_delay():
    lines, weights, _, _, _, truth = cuts(np.random.default_rng(18), [5, 3])
    cut, turned = np.repeat([0, 1], [5, 3]), np.empty((8, 2), dtype=complex)
    truth[1, 1] = 0.0
    kernels.turn_lines(lines, weights, cut, truth, turned)
    back = np.exp(1j * weights[:, 0] * truth[cut, 0])
    air = lines[:, 1] * np.exp(1j * weights[:, 1] * truth[cut, 1]) * back
    np.testing.assert_allclose(turned, np.stack([lines[:, 0] * back - air, air], axis=1), rtol=1e-12)


def test_whiten_is_the_chain_rule_in_standard_deviations():
    rng = np.random.default_rng(14)
    n, p, c = 6, 5, 3
    gradient, extra = (rng.standard_normal(s) + 1j * rng.standard_normal(s) for s in ((n, p), (n, c)))
    weight, chain = rng.uniform(1.0, 9.0, n), rng.standard_normal(p)
    out = np.empty((p + c, 2 * n))
    kernels.whiten(gradient, extra, weight, chain, out)
    # residual = sqrt(weight) (measured - model)
    expected = -np.sqrt(weight)[:, None] * np.hstack([gradient * chain, extra])
    np.testing.assert_allclose(out, np.vstack([expected.real, expected.imag]).T, rtol=1e-12)


def test_force_rows_are_products_of_lines_and_slopes():
    rng = np.random.default_rng(19)
    slope, lines = (rng.standard_normal(s) + 1j * rng.standard_normal(s) for s in ((4, 3), (4, 2)))
    out = np.empty((3, 16))
    kernels.force_rows(slope, lines, out)
    expected = (lines[:, :, None] * slope[:, None, :]).reshape(8, 3)
    np.testing.assert_allclose(out, np.vstack([expected.real, expected.imag]).T, rtol=1e-12)


def test_sums_over_cuts():
    _, columns, cut, *_ = mixing(np.random.default_rng(20))
    rest, sums = np.random.default_rng(21).standard_normal(18), np.ones((4, 2))
    kernels.sum_cuts(columns, cut, rest, sums)
    for k in range(4):
        mine = cut == k
        expected = columns[mine].real.T @ rest[:9][mine] + columns[mine].imag.T @ rest[9:][mine]
        np.testing.assert_allclose(sums[k], 1.0 + expected, rtol=1e-12)


def mixing(rng, n=9, cuts=4, own=3, tail=7, shared=2, size=10):
    """Arguments of `mix_cuts`; one cut has no line."""
    jacobian = rng.standard_normal((own + shared, 2 * n))
    columns = rng.standard_normal((n, 2)) + 1j * rng.standard_normal((n, 2))
    cut = np.sort(rng.choice([0, 1, 3], n))
    return jacobian, columns, cut, own, 2, tail, rng.standard_normal((cuts, 2, 2)), rng.standard_normal((cuts, 2, size))


def test_mix_cuts_are_the_blocks_of_the_normal_matrix():
    jacobian, columns, cut, own, first, tail, inner, mixed = mixing(np.random.default_rng(15))
    before = inner.copy(), mixed.copy()
    kernels.mix_cuts(jacobian, columns, cut, own, first, tail, inner, mixed)
    whole = np.zeros((jacobian.shape[1], mixed.shape[2]))
    whole[:, first : first + own], whole[:, tail : tail + 2] = jacobian[:own].T, jacobian[own:].T
    stacked = np.vstack([columns.real, columns.imag])
    for k in range(4):
        mine = np.concatenate([cut == k, cut == k])
        np.testing.assert_allclose(inner[k] - before[0][k], stacked[mine].T @ stacked[mine], atol=1e-12)
        np.testing.assert_allclose(mixed[k] - before[1][k], stacked[mine].T @ whole[mine], atol=1e-12)


NAMES = ["modal_cross_frf", "fit_cuts", "best_grid_misfit", "turn_lines", "whiten", "force_rows", "mix_cuts", "sum_cuts"]


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
            for helper in ("_cut_misfit", "_cut_normal", "_grid_overlap"):
                monkeypatch.setattr(kernels, helper, getattr(getattr(kernels, helper), "py_func", getattr(kernels, helper)))
        rng = np.random.default_rng(13)
        if name == "modal_cross_frf":
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
        elif name == "turn_lines":
            lines, weights, _, _, _, truth = cuts(rng, [5, 3])
            turned = np.empty((8, 2), dtype=complex)
            function(lines, weights, np.repeat([0, 1], [5, 3]), truth, turned)
            results.append(turned)
        elif name == "whiten":
            gradient, extra = (rng.standard_normal(s) + 1j * rng.standard_normal(s) for s in ((6, 5), (6, 2)))
            out = np.empty((7, 12))
            function(gradient, extra, rng.uniform(1.0, 9.0, 6), rng.standard_normal(5), out)
            results.append(out)
        elif name == "force_rows":
            slope, lines = (rng.standard_normal(s) + 1j * rng.standard_normal(s) for s in ((4, 3), (4, 2)))
            out = np.empty((3, 16))
            function(slope, lines, out)
            results.append(out)
        elif name == "sum_cuts":
            _, columns, cut, *_ = mixing(rng)
            sums = np.zeros((4, 2))
            function(columns, cut, rng.standard_normal(18), sums)
            results.append(sums)
        elif name == "mix_cuts":
            arguments = mixing(rng)
            function(*arguments)
            results.append(np.concatenate([arguments[-2].ravel(), arguments[-1].ravel()]))
        else:
            totals = np.zeros(1)
            table = rng.standard_normal((9, 2, 8))
            start, group = np.array([0, 4, 9]), np.zeros(2, dtype=int)
            function(rng.standard_normal((2, 9)), rng.uniform(size=9), rng.uniform(size=9), table, start, group, totals)
            results.append(totals)
    np.testing.assert_allclose(results[0], results[1], rtol=1e-9)
