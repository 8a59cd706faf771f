"""
Which four cuts tell most about a machine
=========================================

A machine of one mode is known to a few percent; each cut shows three harmonics and brings an unknown delay. Out of 97
spindle speeds four are chosen so that what they leave open of the receptance is least: those whose harmonics fall on
the peak and its flanks.
"""

import matplotlib.pyplot as plt
import numpy as np

import rcsa_ident as ri
from rcsa_ident.base.units import to_hz, to_rpm
from rcsa_ident.identification.experiment_design import CandidateCuts, MeanVariance, deviations, exchanged, greedy

# %%
# h = 1 / (k (1 - r² + 2 i ζ r)) with r = ω / ω_n; the logarithms of k, ω_n and ζ are known to 5 %.
stiffness, natural, zeta, known = 2e7, ri.hz(1200.0), 0.04, 0.05
noise, teeth = 2e-10, 3


def slopes(omega: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return how h changes with a standard deviation of each unknown, shape (n, 3), and h."""
    ratio = omega / natural
    h = 1.0 / (stiffness * (1.0 - ratio**2 + 2j * zeta * ratio))
    by_frequency = stiffness * h**2 * (-2.0 * ratio**2 + 2j * zeta * ratio)
    return known * np.stack([-h, by_frequency, -stiffness * h**2 * 2j * zeta * ratio], axis=1), h


def cut(speed: float) -> np.ndarray:
    """Return the lines of a cut in standard deviations of their noise, its unknown delay taken out, shape (6, 3)."""
    omega = teeth * speed * np.arange(1, 4)
    change, h = slopes(omega)
    rows, own = (np.concatenate([v.real, v.imag]) / noise for v in (change, 1j * omega * h))
    return rows - np.outer(own, own @ rows) / (own @ own)


# %%
# Chosen one after the other, then exchanged as long as that gains; beside them four at even distances.
speeds = ri.rpm(6000, 30_000, 250)
band = ri.hz(600.0, 2400.0, 9.0)
wanted, h = slopes(band)
target = np.concatenate([wanted.real, wanted.imag]).T / np.linalg.norm(h)
prospects = CandidateCuts(tuple(cut(s) for s in speeds), (target,), (0.0,), np.eye(speeds.size, dtype=bool))
chosen = exchanged(prospects, greedy(prospects, 4, MeanVariance()), MeanVariance())
planned, even = (deviations(prospects, order)[:, 0] for order in (chosen, [0, 32, 64, 96]))
print("chosen [rev/min]:", sorted(np.round(to_rpm(speeds[chosen])).astype(int).tolist()))

fig, (left, right) = plt.subplots(1, 2, figsize=(9.2, 3.9), width_ratios=(1.4, 1.0), layout="constrained")
left.semilogy(to_hz(band), 1e6 * np.abs(h), color="0.5", label="receptance")
for speed in sorted(speeds[chosen]):
    lines = teeth * speed * np.arange(1, 4)
    left.semilogy(to_hz(lines), 1e6 * np.abs(slopes(lines)[1]), "o", ms=8, label=f"{to_rpm(speed):.0f} rev/min")
left.set(xlabel="frequency [Hz]", ylabel="receptance [µm/N]", xlim=(550, 2450), title="Lines of the chosen cuts")
left.legend()
right.semilogy(100.0 * even, "o-", color="0.5", label="even distances")
right.semilogy(100.0 * planned, "o-", color="C2", label="chosen")
right.set(xlabel="cuts [-]", ylabel="error left in the receptance [%]", xticks=range(len(planned)), title="What stays open")
right.legend()

# %%
# The four chosen cuts leave less than half of what the others do, and each has a harmonic on the peak or its flanks.
harmonics = teeth * speeds[chosen][:, None] * np.arange(1, 4)
assert np.all(np.min(np.abs(harmonics / natural - 1.0), axis=1) < 2.0 * zeta)
assert planned[-1] < 0.5 * even[-1] < 0.1 * even[0]
