"""The kernels of the identification against other roads; these tests run again without the compiler."""

import numpy as np
import pytest
from scipy.optimize import minimize

from rcsa_ident.coupling.joint import LumpedJoint
from rcsa_ident.coupling.rcsa import couple
from rcsa_ident.dynamics.coordinates import plane
from rcsa_ident.dynamics.modal import ModalModel, damped_modes
from rcsa_ident.dynamics.receptance import Receptance
from rcsa_ident.identification import _kernels as kernels
from rcsa_ident.identification.data import LEVER
from rcsa_ident.identification.paper import modal_fractions


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


def candidate(rng, m):
    omega_n = 2.0 * np.pi * rng.uniform(300.0, 4000.0, m)
    psi = rng.standard_normal((m, 2))
    factor = np.tril(10.0 * rng.standard_normal((m, m)))
    residual = np.tril(3e-5 * rng.standard_normal((2, 2)))
    joint = np.array([2e8, 3e8, 900.0, 700.0]) * rng.uniform(0.5, 2.0, 4)  # scaled: rotational ones per lever squared
    return omega_n, psi, factor, residual, joint


def lumped(joint):
    return LumpedJoint(joint[0], joint[1] * LEVER**2, joint[2], joint[3] * LEVER**2)


def cross(function, candidate, omega, flange, tip, gradient=False):
    omega_n, psi, factor, residual, joint = candidate
    m = omega_n.size
    values = np.empty(omega.size, dtype=complex)
    rows = np.empty((omega.size if gradient else 0, 3 * m + m * (m + 1) // 2 + 7), dtype=complex)
    function(omega_n**2, psi, factor, residual, joint, omega, flange, tip, values, rows)
    return (values, rows) if gradient else values


@pytest.mark.parametrize("m", [1, 2, 7])
def test_cross_frf_is_that_of_coupled_complex_modes(m):
    rng = np.random.default_rng(m)
    omega = 2.0 * np.pi * rng.uniform(200.0, 4500.0, 23)
    holder, flange, tip = substructure(rng, omega)
    omega_n, psi, factor, residual, joint = chosen = candidate(rng, m)
    lever = np.array([1.0, 1.0 / LEVER])
    modes = damped_modes(omega_n, factor @ factor.T, psi * lever, residual @ residual.T * np.outer(lever, lever), plane("flange"))
    expected = couple(holder, modes.receptance(omega), lumped(joint))["spindle", "tip"][:, 0, 0]
    found = cross(kernels.cross_frf, chosen, omega, flange, tip)
    np.testing.assert_allclose(found, expected, rtol=1e-8, atol=1e-12 * np.abs(expected).max())


def test_cross_frf_gradient_against_differences():
    rng = np.random.default_rng(5)
    m = 3
    omega = 2.0 * np.pi * rng.uniform(200.0, 4500.0, 11)
    _, flange, tip = substructure(rng, omega)
    omega_n, psi, factor, residual, joint = chosen = candidate(rng, m)
    values, gradient = cross(kernels.cross_frf, chosen, omega, flange, tip, gradient=True)
    np.testing.assert_array_equal(values, cross(kernels.cross_frf, chosen, omega, flange, tip))
    flat = np.concatenate([omega_n**2, psi.ravel(), factor[np.tril_indices(m)], residual[np.tril_indices(2)], joint])

    def at(vector):
        lower, rest = np.zeros((m, m)), np.zeros((2, 2))
        lower[np.tril_indices(m)] = vector[3 * m : -7]
        rest[np.tril_indices(2)] = vector[-7:-4]
        changed = np.sqrt(vector[:m]), vector[m : 3 * m].reshape(m, 2), lower, rest, vector[-4:]
        return cross(kernels.cross_frf, changed, omega, flange, tip)

    assert gradient.shape == (11, flat.size)
    for k in range(flat.size):
        step = np.zeros(flat.size)
        step[k] = 1e-5 * abs(flat[k])
        difference = (at(flat + step) - at(flat - step)) / (2.0 * step[k])
        size = max(np.abs(difference).max(), 1e-7 * np.abs(values).max() / abs(flat[k]))
        assert np.abs(gradient[:, k] - difference).max() < 1e-5 * size, k


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


def cuts(rng, sizes, trigger=0.0, air=0.3, scatter=0.05):
    """Lines of a few cuts with a true delay and angle each, a model that fits them up to a scatter, priors."""
    start = np.concatenate([[0], np.cumsum(sizes)])
    n = start[-1]
    period = rng.uniform(0.8e-3, 1.8e-3, len(sizes))
    truth = np.stack([rng.uniform(0.0, period), rng.uniform(-0.1, 0.1, len(sizes))], axis=1)
    cut = np.repeat(np.arange(len(sizes)), sizes)
    order = 4.0 * np.concatenate([np.arange(1, k + 1) for k in sizes])
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


@pytest.mark.parametrize("trigger", [0.0, 1e11])
def test_fit_cuts_against_brute_force(trigger):
    lines, weights, model, start, prior, truth = cuts(np.random.default_rng(8), [5, 1, 7], trigger)
    nuisance = np.zeros((3, 2))
    kernels.fit_cuts(lines, weights, model, start, prior, nuisance, 32)
    for k in (0, 2):
        part = slice(start[k], start[k + 1])
        period = prior[k, 3]

        def value(x, part=part, k=k, period=period):
            return naive_misfit(lines[part], weights[part], model[part], prior[k], (x[0] * period, x[1]))

        centre = prior[k, 0] / period if trigger else 0.5
        starts = [(centre + d, a) for d in np.linspace(-0.5, 0.5, 12, endpoint=False) for a in (-0.1, 0.0, 0.1)]
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


NAMES = ["cross_frf", "modal_cross_frf", "fit_cuts", "best_grid_misfit"]


@pytest.mark.parametrize("name", NAMES)
def test_compiled_and_plain_agree(name, monkeypatch):
    """The same Python, run by the interpreter: what the compiler may have reordered shows here."""
    rng = np.random.default_rng(12)
    omega = 2.0 * np.pi * rng.uniform(200.0, 4500.0, 9)
    _, flange, tip = substructure(rng, omega)
    chosen = candidate(rng, 3)
    compiled = getattr(kernels, name)
    plain = getattr(compiled, "py_func", compiled)
    results = []
    for function in (compiled, plain):
        if function is plain:
            for helper in ("_factor_solve", "_cut_misfit"):
                monkeypatch.setattr(kernels, helper, getattr(getattr(kernels, helper), "py_func", getattr(kernels, helper)))
        rng = np.random.default_rng(13)
        if name == "cross_frf":
            results.append(np.concatenate([r.ravel() for r in cross(function, chosen, omega, flange, tip, gradient=True)]))
        elif name == "modal_cross_frf":
            out = np.empty((2, omega.size))
            parts = [np.ascontiguousarray(np.concatenate([[c.real, c.imag] for c in block.T])) for block in (flange, tip)]
            fractions = modal_fractions(chosen[0], np.array([0.05, 0.1, 0.2]), 1e-3 * chosen[1][:, 0], 1e-3j * chosen[1][:, 1])
            function(fractions, chosen[-1], omega, *parts, out)
            results.append(out)
        elif name == "fit_cuts":
            lines, weights, model, start, prior, _ = cuts(rng, [5, 3])
            nuisance = np.zeros((2, 2))
            function(lines, weights, model, start, prior, nuisance, 16)
            results.append(nuisance)
        else:
            totals = np.zeros(1)
            table = rng.standard_normal((8, 2, 9))
            start, group = np.array([0, 4, 9]), np.zeros(2, dtype=int)
            function(rng.standard_normal((2, 9)), rng.uniform(size=9), rng.uniform(size=9), table, start, group, totals)
            results.append(totals)
    np.testing.assert_allclose(results[0], results[1], rtol=1e-9)
