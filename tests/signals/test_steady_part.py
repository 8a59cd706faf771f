import numpy as np
import pytest

from rcsa_ident.signals.steady_part import steady_part
from tests.fixtures.synthetic import RATE, RPM, profile, wave

SPEED = 9000.0 * RPM
TURN = 2.0 * np.pi / SPEED * RATE


def record(level, noise=2e-9, teeth=4, seed=0, roundness=4e-6):
    """Run-out all along, tooth-passing lines times `level`, shape (n,)."""
    rng = np.random.default_rng(seed)
    amplitude = np.zeros((17, 2), dtype=complex)
    amplitude[teeth::teeth] = 4e-7 * np.exp(2j * np.pi * rng.random((16 // teeth, 2)))
    n = level.size
    x = wave(profile(rng, roundness), SPEED, n) + level[:, None] * wave(amplitude, SPEED, n)
    return x + noise * rng.normal(size=(n, 2))


def ramp(n, start, full, end, out):
    return np.interp(np.arange(n), [start, full, end, out], [0.0, 1.0, 1.0, 0.0])


def test_a_steady_cut_is_used_whole():
    assert steady_part(record(np.ones(7168)), RATE, SPEED, 4) == slice(0, 7168)


@pytest.mark.parametrize(("full", "end"), [(1500, 9000), (3500, 9700), (6300, 10300)])
def test_entry_exit_and_air_are_left_out(full, end):
    n = 12000
    part = steady_part(record(ramp(n, full - 900, full, end, end + 900)), RATE, SPEED, 4)
    # where the ramp is still a tenth away from the full cut at most
    assert part.start >= full - 90
    assert part.stop <= end + 90
    assert part.stop - part.start > end - full - 6.0 * 2.0 * TURN


def test_a_bump_splits_the_record():
    level = np.ones(9000)
    level[3000:3600] = 1.9
    part = steady_part(record(level), RATE, SPEED, 4)
    assert part.start >= 3600
    assert part.stop == 9000


@pytest.mark.parametrize("noise", [2e-9, 2e-7])
def test_an_air_cut_without_roundness_is_steady(noise):
    # nothing to see but noise: no reason to throw it away
    kept = []
    for seed in range(10):
        part = steady_part(record(np.zeros(7168), noise, seed=seed, roundness=0.0), RATE, SPEED, 1)
        kept.append(part.stop - part.start)
    assert min(kept) > 8 * TURN
    assert np.median(kept) > 0.9 * 7168


def test_a_short_record_is_taken_as_it_is():
    assert steady_part(record(np.ones(1200)), RATE, SPEED, 4) == slice(0, 1200)
