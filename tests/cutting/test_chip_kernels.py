"""The chip kernel against a plain search; this test runs again without the compiler."""

import numpy as np

from rcsa_ident.cutting._chip_kernels import chip_pieces
from tests.oracles.naive import smallest_chip


def test_a_chip_is_the_smallest_distance_to_the_surfaces_ahead():
    rng = np.random.default_rng(11)
    moved = np.cumsum(rng.uniform(0.05, 0.15, (4, 9)), axis=0)
    step = rng.normal(0.0, 0.08, (4, 9))
    step[-1] = 0.0
    start, end = rng.uniform(0.0, 1.0, 9), rng.uniform(1.5, np.pi, 9)
    node, which, first, last = chip_pieces(moved, step, start, end, np.ones(9, dtype=bool))
    for i in range(9):
        phi = np.linspace(start[i], end[i], 4001)[1:-1]
        chip, surface = smallest_chip(moved[:, i], step[:, i], phi)
        found = np.full(phi.size, -1)
        for k in np.flatnonzero(node == i):
            found[(phi > first[k]) & (phi < last[k])] = which[k]
        assert np.mean(found == np.where(chip > 0.0, surface, -1)) > 0.998
    assert not np.any(chip_pieces(moved, step, start, end, np.zeros(9, dtype=bool))[0])
