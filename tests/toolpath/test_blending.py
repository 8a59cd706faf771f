"""Controllers that blend corners or come late: distances that can be worked out by hand."""

import numpy as np
import pytest

from rcsa_ident.base.errors import InputError
from rcsa_ident.toolpath.blending import FirstOrderLag, QuadraticBlend

V, STEP = 0.05, 1e-3


def around_a_corner(seconds=4.0):
    """A right angle at constant speed, in the middle of the time."""
    t = np.arange(0.0, seconds + 0.5 * STEP, STEP)
    return np.stack([np.minimum(V * t, V * seconds / 2), np.maximum(V * t - V * seconds / 2, 0.0)], axis=1)


@pytest.mark.parametrize("corner", [1.5e-3, 1.7e-3])
def test_a_quadratic_blend_leaves_what_it_should(corner):
    sent = around_a_corner()
    blend = QuadraticBlend.leaving(corner, np.hypot(V, V))
    held = blend.follow(sent, STEP)
    vertex = sent[len(sent) // 2]
    assert np.linalg.norm(held - vertex, axis=1).min() == pytest.approx(corner, rel=0.01)
    # beyond the window, to both sides, nothing is changed
    far = int(np.ceil(blend.seconds / STEP / 2)) + 1
    for own in (slice(far, len(sent) // 2 - far), slice(len(sent) // 2 + far, len(sent) - far)):
        np.testing.assert_allclose(held[own], sent[own], atol=1e-15)
    # a parabola: the velocity turns evenly
    gain = np.diff(held, 2, axis=0) / STEP**2
    inside = gain[len(sent) // 2 - far + 4 : len(sent) // 2 + far - 6]
    np.testing.assert_allclose(inside, np.tile([-V, V], (len(inside), 1)) / blend.seconds, rtol=0.02)


def test_an_odd_window_delays_nothing():
    sent = around_a_corner()
    for seconds in (0.010, 0.011):
        held = QuadraticBlend(seconds).follow(sent, STEP)
        mirrored = QuadraticBlend(seconds).follow(sent[::-1], STEP)[::-1]
        np.testing.assert_allclose(held, mirrored, atol=1e-15)


def test_a_lag_passes_the_corner_at_its_distance_and_comes_late():
    sent, lag = around_a_corner(), FirstOrderLag(1.6e-3 / (0.509 * V))
    held = lag.follow(sent, STEP)
    vertex = sent[len(sent) // 2]
    assert np.linalg.norm(held - vertex, axis=1).min() == pytest.approx(1.6e-3, rel=0.01)
    late = round(lag.delay / STEP)
    assert np.linalg.norm(held[-1] - sent[-1 - late]) < 1e-4
    # the closed form of a ramp
    t = STEP * np.arange(len(sent))
    before = len(sent) // 2
    expected = V * (t - lag.seconds * (1.0 - np.exp(-t / lag.seconds)))
    np.testing.assert_allclose(held[:before, 0], expected[:before], atol=1e-12)


@pytest.mark.parametrize("wrong", [0.0, -1.0, np.nan])
def test_times_are_above_zero(wrong):
    for kind in (QuadraticBlend, FirstOrderLag):
        with pytest.raises(InputError):
            kind(wrong)
