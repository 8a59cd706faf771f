"""The smooth error of the limit beside the closed form of a Gaussian process."""

from __future__ import annotations

import numpy as np
import pytest

from rcsa_ident.base.errors import InputError
from rcsa_ident.stability.labels.limit_discrepancy import LimitDiscrepancy

SPEEDS = np.array([600.0, 660.0, 800.0])


def points(speeds, share=0.5, up=0.0):
    """All of one width and direction."""
    speeds = np.asarray(speeds)
    return np.column_stack([speeds, np.full(speeds.size, share), np.full(speeds.size, up)])


def test_draws_have_the_covariance():
    error = LimitDiscrepancy(0.3, 0.15)
    root = error.root(points(SPEEDS))
    written = [[0.09 * np.exp(-0.5 * (np.log(a / b) / 0.15) ** 2) for b in SPEEDS] for a in SPEEDS]
    assert root @ root.T == pytest.approx(np.array(written), abs=1e-7)
    assert error.covariance(points(3.0 * SPEEDS), points(3.0 * SPEEDS)) == pytest.approx(np.array(written))


def test_between_known_errors_it_is_the_conditional_distribution():
    """Mean and covariance of 200 000 draws beside those of the normal distribution of five numbers, three of them known."""
    error, at, known = LimitDiscrepancy(0.3, 0.15), np.array([630.0, 1000.0]), np.array([0.2, -0.1, 0.3])
    drawn = error.given(points(SPEEDS), np.tile(known, (200_000, 1)), points(at), np.random.default_rng(1))
    every = np.concatenate([SPEEDS, at])
    c = 0.09 * np.exp(-0.5 * (np.subtract.outer(np.log(every), np.log(every)) / 0.15) ** 2)
    share = c[3:, :3] @ np.linalg.inv(c[:3, :3])
    assert drawn.mean(axis=0) == pytest.approx(share @ known, abs=3e-3)
    assert np.cov(drawn.T) == pytest.approx(c[3:, 3:] - share @ c[:3, 3:], abs=2e-3)


def test_a_known_speed_keeps_its_error_and_a_far_one_knows_nothing():
    error, known = LimitDiscrepancy(0.3, 0.1), np.random.default_rng(2).standard_normal((5000, 3)) * 0.3
    drawn = error.given(points(SPEEDS), known, points([660.0, 6000.0]), np.random.default_rng(3))
    assert drawn[:, 0] == pytest.approx(known[:, 1], abs=1e-3)
    assert drawn[:, 1].std() == pytest.approx(0.3, rel=0.05)
    assert abs(np.corrcoef(drawn[:, 1], known[:, 2])[0, 1]) < 0.05


def test_before_any_error_is_known():
    drawn = LimitDiscrepancy(0.3, 0.1).given(np.zeros((0, 3)), np.zeros((20_000, 0)), points(SPEEDS), np.random.default_rng(4))
    assert drawn.std(axis=0) == pytest.approx(0.3, rel=0.03)


@pytest.mark.parametrize(("deviation", "length"), [(0.0, 0.1), (0.1, 0.0), (np.inf, 0.1)])
def test_what_no_discrepancy_has(deviation, length):
    with pytest.raises(InputError, match=r"deviation|length"):
        LimitDiscrepancy(deviation, length)
    with pytest.raises(InputError, match="across"):
        LimitDiscrepancy(across=1.5)


def test_another_width_and_the_other_direction():
    """A factor e of the width is one length; the other direction knows a share."""
    error = LimitDiscrepancy(1.0, 0.15, width=1.0, across=0.4)
    here, wider, up = points([600.0]), points([600.0], 0.5 * np.e), points([600.0], up=1.0)
    assert error.covariance(here, wider)[0, 0] == pytest.approx(np.exp(-0.5))
    assert error.covariance(here, up)[0, 0] == pytest.approx(0.4)
