"""The coupling kernels against plain algebra; these tests run again without the compiler."""

from __future__ import annotations

import numpy as np

from rcsa_ident.machine import _kernels as kernels

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


def blocks(rng, lines=LINES):
    """A11, A12, A21, A22 of two planes that feel each other."""
    return numbers(rng, lines, 2, 2), numbers(rng, lines, 2, 4), numbers(rng, lines, 4, 2), numbers(rng, lines, 4, 4)


def of_planes(tip_tip, forward, back, flange, w):
    """The same as `by_solving`, block by block."""
    return np.array([a - b @ np.linalg.inv(d + e) @ c for a, b, c, d, e in zip(tip_tip, forward, back, flange, w, strict=True)])


def test_tips_of_planes():
    rng = np.random.default_rng(5)
    parts = blocks(rng)
    behind = numbers(rng, STEPS, LINES, 4, 4)
    # a diagonal entry that is zero asks for another pivot
    behind[:, :, 0, 0] = -parts[3][:, 0, 0]
    found = kernels.tips_of_planes(*parts, behind)
    np.testing.assert_allclose(found, [of_planes(*parts, w) for w in behind], rtol=1e-8)


def test_changes_of_planes_at_some_of_the_frequencies():
    rng = np.random.default_rng(6)
    parts = blocks(rng)
    ahead, behind, weight = numbers(rng, STEPS, 30, 4, 4), numbers(rng, STEPS, 30, 4, 4), rng.uniform(0.5, 2.0, STEPS)
    places = np.sort(rng.choice(30, LINES, replace=False))
    found = kernels.changes_of_planes(*parts[1:], ahead, behind, weight, places)
    expected = [weight[i] * (of_planes(*parts, ahead[i, places]) - of_planes(*parts, behind[i, places])) for i in range(STEPS)]
    np.testing.assert_allclose(found, expected, rtol=1e-8)
    assert kernels.changes_of_planes(*parts[1:], ahead[:0], behind[:0], weight[:0], places).shape == (0, LINES, 2, 2)
