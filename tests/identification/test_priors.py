import math

import numpy as np
import pytest

from rcsa_ident.identification.parameters import axis_size
from rcsa_ident.identification.priors import Priors, log_volume, prior_rows

PRIORS = Priors(frequency_hz=1200.0, frequency_spread=0.7, shape=0.8, damping_ratio=0.05, damping_coupling=0.5, residual=2.0)
UNIT = 30.0  # of the damping factor [sqrt(rad/s)]


def naive(theta, orders, priors):
    """Twice the negative log density without its constant, entry by entry from what the docstring promises."""
    total, k = 0.0, 0
    for m in orders:
        frequency = theta[k : k + m]
        total += sum(((f - math.log(2.0 * math.pi * priors.frequency_hz)) / priors.frequency_spread) ** 2 for f in frequency)
        k += m
        total += sum((p / priors.shape) ** 2 for p in theta[k : k + 2 * m])
        k += 2 * m
        for i in range(m):
            for j in range(i + 1):
                if i == j:
                    # the mode's own damping ratio L_nn^2 / (2 omega_n) is lognormal
                    ratio = (UNIT * math.exp(theta[k])) ** 2 / (2.0 * math.exp(frequency[i]))
                    total += (math.log(ratio / priors.damping_ratio) / priors.damping_spread) ** 2
                else:
                    total += (theta[k] / priors.damping_coupling) ** 2
                k += 1
        total += sum((r / priors.residual) ** 2 for r in theta[k : k + 3])
        k += 3
    return total + sum(((v - math.log(c)) / priors.joint_spread) ** 2 for v, c in zip(theta[k:], priors.joint, strict=True))


@pytest.fixture(params=[(1,), (3,), (2, 4)])
def orders(request):
    return request.param


@pytest.fixture
def theta(orders):
    rng = np.random.default_rng(4)
    vector = rng.standard_normal(sum(axis_size(m) for m in orders) + 4)
    vector[:1] += 8.0
    vector[-4:] += np.log(PRIORS.joint)
    return vector


def test_rows_are_the_density(theta, orders):
    rows, _ = prior_rows(theta, orders, PRIORS)
    assert rows @ rows == pytest.approx(naive(theta, orders, PRIORS), rel=1e-12)


def test_jacobian_against_differences(theta, orders):
    _, jacobian = prior_rows(theta, orders, PRIORS)
    for k in range(theta.size):
        step = np.zeros(theta.size)
        step[k] = 1e-5
        ahead, behind = (prior_rows(theta + s, orders, PRIORS)[0] for s in (step, -step))
        np.testing.assert_allclose(jacobian[:, k], (ahead - behind) / 2e-5, rtol=1e-6, atol=1e-9)


def test_log_volume_is_that_of_the_information(theta, orders):
    _, jacobian = prior_rows(theta, orders, PRIORS)
    sign, expected = np.linalg.slogdet(jacobian.T @ jacobian)
    assert sign == 1.0
    assert log_volume(orders, PRIORS) == pytest.approx(expected, rel=1e-12)


def test_wider_priors_fill_more():
    narrow, wide = Priors(shape=0.5), Priors(shape=5.0)
    assert log_volume((3,), narrow) - log_volume((3,), wide) == pytest.approx(2.0 * 6 * np.log(10.0))
