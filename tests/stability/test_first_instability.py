"""The search for the first loss of stability, on growths that are known."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rcsa_ident.stability.discretisation import FullDiscretisation
from rcsa_ident.stability.first_instability import first_loss
from rcsa_ident.stability.lobes import stability_lobes
from rcsa_ident.stability.monodromy import stable_depth_bound
from rcsa_ident.stability.multiplier_limits import ROUGH, Growth, longest_step
from tests.stability.mills import ONE, RPM, mill, tip


def test_a_root():
    assert first_loss(lambda d: d - 0.7, 1e-3, 10.0, 1e-6) == pytest.approx(0.7, rel=1e-6)
    assert first_loss(lambda d: np.log(d / 3.0), 1e-3, 3.001, 1e-6) == pytest.approx(3.0, rel=1e-5)
    assert first_loss(lambda d: d - 0.7, 1e-3, 0.69, 1e-6) is None


def test_the_lowest_depth_is_lowered():
    assert first_loss(lambda d: d - 0.01, 5.0, 10.0, 1e-6) == pytest.approx(0.01, rel=1e-6)
    # beyond what is asked for
    assert first_loss(lambda d: d - 20.0, 30.0, 10.0, 1e-6) is None
    # nothing is stable
    assert first_loss(lambda d: 1.0, 1.0, 10.0, 1e-6) < 1e-20


@settings(max_examples=40, deadline=None)
@given(place=st.floats(0.05, 8.0), width=st.floats(0.12, 0.6), height=st.floats(0.02, 0.5))
def test_an_island_below_the_other_lobes(place, width, height):
    """A peak of a growth that is negative on both sides; wider than a ladder's step it is never missed."""

    def growth(d):
        rise = np.log(d / 20.0) / 8.0
        return min(rise, -0.1) + (0.1 + height - min(rise + 0.1, 0.0)) * np.exp(-0.5 * (np.log(d / place) / width) ** 2)

    grid = np.geomspace(1e-3, 10.0, 4001)
    up = np.array([growth(d) for d in grid]) >= 0.0
    found = first_loss(growth, 1e-3, 10.0, 1e-6)
    assert found is not None
    assert found == pytest.approx(grid[np.argmax(up)], rel=5e-3)


def test_each_depth_is_looked_at_once():
    seen: list[float] = []

    def growth(d: float) -> float:
        seen.append(d)
        return d - 0.7

    first_loss(growth, 1e-3, 10.0, 1e-6)
    assert len(seen) == len(set(seen))
    assert len(seen) < 40


@pytest.mark.slow
def test_lenses_of_random_mills():
    """Against a dense ladder: mills with helix and little immersion, where closed lenses of instability lie below the lobes."""
    rng = np.random.default_rng(3)
    method, lenses = FullDiscretisation(), 0
    known = [(ONE, mill(2, 0.05, "up", np.radians(30.0)), np.linspace(9000.0, 23_000.0, 15) * RPM)]
    for _ in range(6):
        rows = tuple((0, rng.uniform(500, 1500), rng.uniform(0.005, 0.03), rng.uniform(0.03, 0.2)) for _ in range(rng.integers(1, 3)))
        process = mill(int(rng.integers(1, 4)), rng.choice([0.02, 0.05, 0.1]), rng.choice(["up", "down"]), rng.uniform(0.5, 0.9))
        known.append((rows, process, rng.uniform(5000.0, 40_000.0, 6) * RPM))
    for rows, process, speeds in known:
        cut = method.monodromy(tip(rows), process)
        grid = np.geomspace(stable_depth_bound(cut.modes, cut.process), 40e-3, 220)
        limits = stability_lobes(tip(rows), process, speeds, grid[-1], method).limit_depth
        for speed, limit in zip(speeds, limits, strict=True):
            growth = Growth(cut, speed, longest_step(cut), ROUGH)
            up = np.array([growth(d) for d in grid]) >= 0.0
            lenses += bool(np.any(np.diff(up.astype(int)) == -1))
            if not up.any():
                assert not limit < 0.98 * grid[-1]
            else:
                k = int(np.argmax(up))
                assert 0.99 * grid[max(k - 1, 0)] < limit < 1.01 * grid[k]
    assert lenses >= 2
