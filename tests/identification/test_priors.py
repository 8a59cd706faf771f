import math

import numpy as np
import pytest

from rcsa_ident.identification.priors import Priors
from rcsa_ident.identification.unknowns import Layout, ModalBlock, flange_layout, prior_rows

PRIORS = Priors(
    frequency_hz=1200.0,
    frequency_spread=0.7,
    shape=0.8,
    damping_ratio=0.05,
    damping_coupling=0.5,
    residual=1.7,
    softening=0.02,
    tooth_angle=8.0,
)
UNIT = 30.0  # of the damping factor [sqrt(rad/s)]
LAYOUTS = {
    "one mode": flange_layout(1),
    "two axes": flange_layout(2, 4),
    "fixture": Layout((ModalBlock(3, places=1),), coefficients=2),
    "everything": Layout((ModalBlock(2, 1, True), ModalBlock(3, 1, True)), coefficients=3, clampings=2),
}
SPREADS = (0.05, 0.1, 3.0)


def naive(theta, layout, priors, coefficients):
    """Twice the negative log density without its constant, entry by entry from what the docstring promises."""
    total, k = 0.0, 0
    for axis in layout.axes:
        m = axis.modes
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
        for _ in range(axis.places):
            total += sum((p / priors.shape) ** 2 for p in theta[k : k + m])
            # a product of two factors, not a factor
            total += sum((r / priors.residual**2) ** 2 for r in theta[k + m : k + m + 2])
            k += m + 2
        if axis.softening:
            pairs = m * (m + 1) // 2
            total += sum((s / priors.softening) ** 2 for s in theta[k : k + pairs])
            k += pairs
    total += sum(((v - math.log(c)) / priors.joint_spread) ** 2 for v, c in zip(theta[k : k + 4], priors.joint, strict=True))
    k += 4
    total += sum((v / s) ** 2 for v, s in zip(theta[k : k + len(coefficients)], coefficients, strict=True))
    k += len(coefficients)
    return total + sum((angle / priors.tooth_angle) ** 2 for angle in theta[k:])


@pytest.fixture(params=list(LAYOUTS))
def layout(request):
    return LAYOUTS[request.param]


@pytest.fixture
def spreads(layout):
    return SPREADS[: layout.coefficients]


@pytest.fixture
def theta(layout):
    vector = np.random.default_rng(4).standard_normal(layout.size)
    vector[:1] += 8.0
    vector[layout.joint] += np.log(PRIORS.joint)
    return vector


def test_rows_are_the_density(theta, layout, spreads):
    rows = prior_rows(layout, PRIORS, spreads).residual(theta)
    assert rows.shape == theta.shape
    assert rows @ rows == pytest.approx(naive(theta, layout, PRIORS, spreads), rel=1e-12)


def test_residual_and_jacobian_are_one(theta, layout, spreads):
    """The rows are straight in the vector: their differences are the Jacobian, at any distance."""
    rows = prior_rows(layout, PRIORS, spreads)
    other = theta + np.random.default_rng(5).standard_normal(theta.size)
    np.testing.assert_allclose(rows.residual(other) - rows.residual(theta), rows.jacobian @ (other - theta), rtol=1e-9, atol=1e-9)
    for k in range(theta.size):
        step = np.zeros(theta.size)
        step[k] = 1.0
        np.testing.assert_allclose(rows.jacobian[:, k], rows.residual(theta + step) - rows.residual(theta), rtol=1e-9, atol=1e-9)


def test_the_vector_is_left_alone(theta, layout, spreads):
    before = theta.copy()
    prior_rows(layout, PRIORS, spreads).residual(theta)
    np.testing.assert_array_equal(theta, before)


def test_log_volume_is_that_of_the_information(layout, spreads):
    jacobian = prior_rows(layout, PRIORS, spreads).jacobian
    sign, expected = np.linalg.slogdet(jacobian.T @ jacobian)
    assert sign == 1.0
    assert prior_rows(layout, PRIORS, spreads).log_volume == pytest.approx(expected, rel=1e-12)


def test_wider_priors_fill_more():
    narrow, wide = Priors(shape=0.5), Priors(shape=5.0)
    assert prior_rows(flange_layout(3), narrow).log_volume - prior_rows(flange_layout(3), wide).log_volume == pytest.approx(
        2.0 * 6 * np.log(10.0)
    )
    fixture = Layout((ModalBlock(3, places=1),))
    assert prior_rows(fixture, narrow).log_volume - prior_rows(fixture, wide).log_volume == pytest.approx(2.0 * 9 * np.log(10.0))
