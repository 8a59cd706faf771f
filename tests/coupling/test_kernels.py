"""The coupling kernels against plain algebra; these tests run again without the compiler."""

from __future__ import annotations

import numpy as np
import pytest

from rcsa_ident.coupling import _kernels as kernels

LINES, STEPS = 11, 4


def numbers(rng, *shape):
    return rng.normal(size=shape) + 1j * rng.normal(size=shape)


def parts(rng):
    """A11, the 2 x 2 block at the flange, and A12, A21 at each frequency."""
    flange = numbers(rng, 3, LINES)
    to, back = numbers(rng, 2, LINES), numbers(rng, 2, LINES)
    carried = np.stack([to[0] * back[0], to[0] * back[1] + to[1] * back[0], to[1] * back[1]])
    return numbers(rng, LINES), flange, to, back, carried


def by_solving(tip, flange, to, back, w):
    """C11 = A11 - A12 (A22 + W)^-1 A21."""
    found = np.empty(tip.size, dtype=complex)
    for k in range(tip.size):
        t, b, s = flange[:, k] + w[:, k]
        found[k] = tip[k] - to[:, k] @ np.linalg.solve(np.array([[t, b], [b, s]]), back[:, k])
    return found


def test_tips_over_many_things():
    rng = np.random.default_rng(2)
    tip, flange, to, back, carried = parts(rng)
    behind = numbers(rng, STEPS, 3, LINES)
    found = kernels.tips_over(tip, flange, carried, behind)
    np.testing.assert_allclose(found, [by_solving(tip, flange, to, back, w) for w in behind], rtol=1e-10)


@pytest.mark.slow
def test_changes_along_steps_at_some_of_the_frequencies():
    rng = np.random.default_rng(3)
    tip, flange, to, back, carried = parts(rng)
    ahead, behind, weight = numbers(rng, 30, STEPS, 3), numbers(rng, 30, STEPS, 3), rng.uniform(0.5, 2.0, STEPS)
    places = np.sort(rng.choice(30, LINES, replace=False))
    found = kernels.tip_changes(tip, flange, carried, ahead, behind, weight, places)
    assert found.shape == (STEPS, LINES)
    for i in range(STEPS):
        up, down = (by_solving(tip, flange, to, back, ends[places, i].T) for ends in (ahead, behind))
        np.testing.assert_allclose(found[i], weight[i] * (up - down), rtol=1e-9)


def test_no_steps_no_changes():
    rng = np.random.default_rng(4)
    tip, flange, _, _, carried = parts(rng)
    nothing = np.zeros((LINES, 0, 3), dtype=complex)
    assert kernels.tip_changes(tip, flange, carried, nothing, nothing, np.zeros(0), np.arange(LINES)).shape == (0, LINES)
