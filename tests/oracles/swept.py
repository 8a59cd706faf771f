"""Slow twins of material removal: is a point in what a tool sweeps, is it in a field of lines."""

from itertools import pairwise

import numpy as np


def depth_in_tool(points, tips, axes, heights, radii):
    """How far points (n, 3) have been inside a tool at any of its places (k, 3), across its axis; below zero outside."""
    found = np.full(len(points), -np.inf)
    for tip, axis in zip(tips, axes, strict=True):
        height = (points - tip) @ axis
        away = np.linalg.norm(points - tip - height[:, None] * axis, axis=1)
        within = (height >= 0.0) & (height <= heights[-1])
        found = np.maximum(found, np.where(within, np.interp(height, heights, radii) - away, -np.inf))
    return found


def along(places, steps):
    """Places (k, 3) with as many more on each move."""
    share = np.linspace(0.0, 1.0, steps + 1)
    moves = [a + share[:, None] * (b - a) for a, b in pairwise(places)]
    return np.concatenate(moves)


def points_on_lines(field, grid, rng, number):
    """Points on random lines of a grid, and whether its segments hold them."""
    axis, one, two = ((0, 2, 1), (1, 2, 0), (2, 0, 1))[grid]
    count = field.counts[grid]
    points, held = np.empty((number, 3)), np.empty(number, dtype=bool)
    for k in range(number):
        m, n = rng.integers(count.shape[0]), rng.integers(count.shape[1])
        place = rng.uniform(field.low[axis], field.high[axis])
        points[k, [axis, one, two]] = place, field.lattice[0, one] + m * field.cell[one], field.lattice[0, two] + n * field.cell[two]
        segments = field.segs[grid][m, n, : count[m, n]]
        held[k] = bool(np.any((segments[:, 0] < place) & (place < segments[:, 1])))
    return points, held
