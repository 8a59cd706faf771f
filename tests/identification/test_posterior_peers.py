"""The posterior's covariance beside an ensemble sampler that others keep: with linearised residuals, and with the true ones."""

from __future__ import annotations

import emcee
import numpy as np
import pytest

from rcsa_ident.coupling.rcsa import couple
from rcsa_ident.dynamics.coordinates import Dof
from rcsa_ident.identification.levenberg_marquardt import refine
from rcsa_ident.identification.misfit import DELAY_UNIT, Misfit
from rcsa_ident.identification.posterior import Posterior
from rcsa_ident.identification.priors import Priors
from rcsa_ident.identification.unknowns import flange_layout
from rcsa_ident.tool_holder.model import tool_holder_receptance
from tests.identification.models import machine_vector, remade

pytestmark = pytest.mark.slow

LAYOUT = flange_layout(2)
OMEGA = 2.0 * np.pi * np.linspace(500.0, 3500.0, 40)
#: Walkers for 16 unknowns.
WALKERS = 64


class Problem:
    """Two modes and a joint, found from 14 cuts along X with 1 % of noise."""

    def __init__(self, few):
        truth = machine_vector((800.0, 1900.0))
        self.data, _ = remade(few.only(Dof.X), truth, LAYOUT, np.random.default_rng(8))
        self.misfit = Misfit(self.data, Priors(), (1e-6,))
        start = np.zeros((len(self.data.cut_ids), 2))
        self.solution = refine(self.misfit, truth, LAYOUT, start, 200, grid=32)
        self.theta, self.nuisance = self.solution.theta, self.solution.evaluation.nuisance
        self.posterior = Posterior(self.theta, np.linalg.inv(self.solution.evaluation.hessian), LAYOUT.axes[0])
        #: unknowns in standard deviations, none correlated with another
        self.root = np.linalg.cholesky(self.posterior.covariance)

    def slopes(self):
        """Residuals at the optimum and their change with the whitened unknowns, free of the cuts' delays and angles; by differences."""
        size, cuts = self.theta.size, self.nuisance.size
        unit = np.tile([DELAY_UNIT, 1.0], cuts // 2)

        def residual(step):
            there = self.nuisance + (step[size:] * unit).reshape(-1, 2)
            found = self.misfit.residual_at(self.theta + self.root @ step[:size], LAYOUT, there)
            return np.concatenate([*found.lines, found.own, found.cuts.ravel()])

        columns = np.array([(residual(h) - residual(-h)) / 2e-4 for h in 1e-4 * np.eye(size + cuts)]).T
        own, _ = np.linalg.qr(columns[:, size:])
        return tuple(a - own @ (own.T @ a) for a in (residual(np.zeros(size + cuts)), columns[:, :size]))

    def walk(self, log_probability, steps, vectorize):
        """A chain of whitened unknowns, its first quarter left out, shape (steps, walkers, p)."""
        # not its snooker move as well: that one weighs distances by half their power, and narrows a Gaussian of 16 unknowns by 8 %
        sampler = emcee.EnsembleSampler(WALKERS, self.theta.size, log_probability, moves=emcee.moves.DEMove(), vectorize=vectorize)
        sampler.random_state = np.random.RandomState(3).get_state()
        sampler.run_mcmc(np.random.default_rng(4).standard_normal((WALKERS, self.theta.size)), steps)
        return sampler.get_chain(discard=steps // 4)


@pytest.fixture(scope="module")
def problem(few):
    return Problem(few)


def effective(chain):
    """Independent draws that a chain of deviations is worth where it knows least: of squares, since widths are compared."""
    squares = (chain - chain.mean(axis=(0, 1))) ** 2
    return chain.shape[0] * chain.shape[1] / emcee.autocorr.integrated_time(squares, tol=0).max()


def test_covariance_is_what_a_sampler_finds_of_linearised_residuals(problem):
    rest, slopes = problem.slopes()
    chain = problem.walk(lambda z: -0.5 * np.sum((rest + z @ slopes.T) ** 2, axis=1), 16_000, True)
    draws = effective(chain)
    assert draws > 2000.0
    told, found = problem.posterior.covariance, np.cov(chain.reshape(-1, chain.shape[2]) @ problem.root.T, rowvar=False)
    width = np.sqrt(np.diag(told)), np.sqrt(np.diag(found))
    # four standard deviations of the sampling
    np.testing.assert_allclose(width[1], width[0], rtol=4.0 / np.sqrt(2.0 * draws))
    correlation = [c / np.outer(w, w) for c, w in zip((told, found), width, strict=True)]
    np.testing.assert_allclose(correlation[1], correlation[0], atol=4.0 / np.sqrt(draws))


def test_bands_of_a_tooltip_beside_the_true_posterior(problem, shop):
    """Of a tooling that never cut: what the records do not tell is far from linear, what it does to the tooltip hardly is."""
    holder = tool_holder_receptance(shop.held_out.assembly, OMEGA)

    def tip(modes, joint):
        return couple(holder, modes.receptance(holder.omega), joint)["tip", "tip"][:, 0, 0]

    def log_probability(z):
        return -0.5 * problem.misfit.evaluate(problem.theta + problem.root @ z, LAYOUT, problem.nuisance).cost

    chain = problem.walk(log_probability, 2500, False)
    thinned = chain[::60].reshape(-1, chain.shape[2])
    values = np.array([tip(*problem.posterior.machine(Dof.X, problem.theta + problem.root @ z)) for z in thinned])
    changes = problem.posterior.part(Dof.X).response(lambda c: tip(c.flange, c.joint))[1]
    told = np.sqrt(np.sum(np.abs(changes) ** 2, axis=0))
    found = np.sqrt(np.var(values.real, axis=0) + np.var(values.imag, axis=0))
    assert effective(chain) > 500.0
    np.testing.assert_allclose(found, told, rtol=0.1)
    np.testing.assert_array_less(np.abs(values.mean(axis=0) - tip(*problem.posterior.machine(Dof.X))), 0.25 * found)
    width = (chain @ problem.root.T).std(axis=(0, 1)) / np.sqrt(np.diag(problem.posterior.covariance))
    np.testing.assert_allclose(width[: LAYOUT.axes[0].modes], 1.0, atol=0.1)
    # residual compliance and joint trade places along a curve: its tangent is long, and the curve leaves it soon
    assert width[-3] < 0.3
