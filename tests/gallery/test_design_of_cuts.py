"""Which four of many spindle speeds tell most about a machine of one mode: those whose harmonics fall on its peak and flanks.

The mode is known to a few percent, each cut has three lines and an unknown delay. Four chosen cuts leave less than half of what
four at even distances leave.
"""

from __future__ import annotations

import numpy as np

from rcsa_ident.identification.experiment_design import CandidateCuts, MeanVariance, deviations, exchanged, greedy

# h = 1 / (k (1 - r^2 + 2 i zeta r)), r = omega / omega_n; unknowns: logarithms of k, omega_n, zeta, each known to 5 %
STIFFNESS, NATURAL, ZETA, KNOWN = 2e7, 2.0 * np.pi * 1200.0, 0.04, 0.05
NOISE, TEETH = 2e-10, 3


def slopes(omega):
    """Change of h with a standard deviation of each unknown, shape (n, 3)."""
    ratio = omega / NATURAL
    h = 1.0 / (STIFFNESS * (1.0 - ratio**2 + 2j * ZETA * ratio))
    by_frequency = STIFFNESS * h**2 * (-2.0 * ratio**2 + 2j * ZETA * ratio)
    return KNOWN * np.stack([-h, by_frequency, -STIFFNESS * h**2 * 2j * ZETA * ratio], axis=1), h


def cut(speed):
    """Lines of one cut in standard deviations, its unknown delay taken out, shape (2 n, 3)."""
    omega = TEETH * speed * np.arange(1, 4)
    change, h = slopes(omega)
    delay = 1j * omega * h
    rows, own = (np.concatenate([v.real, v.imag]) / NOISE for v in (change, delay))
    return rows - np.outer(own, own @ rows) / (own @ own)


def test_four_cuts():
    speeds = np.linspace(6000.0, 30000.0, 97) * np.pi / 30.0
    wanted, h = slopes(2.0 * np.pi * np.linspace(600.0, 2400.0, 200))
    target = np.concatenate([wanted.real, wanted.imag]).T / np.linalg.norm(h)
    prospects = CandidateCuts(tuple(cut(s) for s in speeds), (target,), (0.0,), np.eye(speeds.size, dtype=bool))
    chosen = exchanged(prospects, greedy(prospects, 4, MeanVariance()), MeanVariance())
    planned, even = (deviations(prospects, order)[:, 0] for order in (chosen, [0, 32, 64, 96]))
    assert planned[-1] < 0.5 * even[-1] < 0.1 * even[0]
    # every chosen cut has a harmonic on the peak or its flanks
    harmonics = TEETH * speeds[chosen][:, None] * np.arange(1, 4)
    nearest = np.min(np.abs(harmonics / NATURAL - 1.0), axis=1)
    assert np.all(nearest < 2.0 * ZETA)
