"""Laws of the force observer: what comes later is estimated later, and nothing comes of nothing."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from rcsa_ident.observer.force_model import AxisNoise, RandomWalk
from rcsa_ident.observer.kalman import kalman_filter
from tests.observer.test_kalman import COMB, PLANT, WALK, model, one_axis, run


@settings(max_examples=10, deadline=None)
@given(st.integers(0, 150), st.integers(0, 2**31), st.sampled_from([WALK, COMB]))
def test_a_signal_that_comes_later_is_estimated_later(delay, seed, force):
    kalman = kalman_filter(model(force), longest_settling=0)
    signal = 1e-6 * np.random.default_rng(seed).normal(size=150)
    now = run(kalman, signal)[1]
    later = run(kalman, np.concatenate([np.zeros(delay), signal]))[1]
    np.testing.assert_array_equal(later[:delay], 0.0)
    np.testing.assert_allclose(later[delay:], now, rtol=0.0, atol=1e-12 * np.abs(now).max())


@settings(max_examples=10, deadline=None)
@given(st.floats(1e-3, 1e3), st.integers(0, 2**31))
def test_the_unit_of_force_does_not_matter(unit, seed):
    """A plant that yields more, and forces in a unit that much larger: the same steady filter, its estimates in that unit."""
    signal = 1e-6 * np.random.default_rng(seed).normal(size=200)
    yielding = replace(PLANT, gain=unit * PLANT.gain, through=unit * PLANT.through)
    found = []
    for plant, walk in ((PLANT, WALK), (yielding, RandomWalk(WALK.intensity / unit, WALK.leak))):
        kalman = kalman_filter(one_axis(plant, AxisNoise(walk, 5e-8)), longest_settling=0)
        found.append(run(kalman, signal)[1][:, 0])
    np.testing.assert_allclose(unit * found[1], found[0], rtol=0.0, atol=1e-12 * np.abs(found[0]).max())
