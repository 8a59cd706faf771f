"""An arm as sums over its bodies, from homogeneous matrices and differences: another road to its dynamics, slow and plain."""

from __future__ import annotations

import numpy as np


def transform(turn, offset):
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = turn, offset
    return matrix


def rotation(axis, angle):
    """By the exponential series of its skew matrix, to rounding."""
    x, y, z = np.asarray(axis) * angle
    skew = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    total, term = np.eye(3), np.eye(3)
    for k in range(1, 60):
        term = term @ skew / k
        total = total + term
    return total


def frames(chain, angles):
    """Homogeneous matrices of all frames of a chain."""
    found, here = [], np.eye(4)
    for turn, offset, axis, angle in zip(chain.turn, chain.offset, chain.axis, angles, strict=True):
        here = here @ transform(turn, offset) @ transform(rotation(axis, angle), np.zeros(3))
        found.append(here)
    return found


def kinetic_matrix(chain, angles, step=1e-6):
    """Mass matrix from differences of every body's place and turn: sum m Jv^T Jv + Jw^T I Jw."""
    n = chain.mass.size
    total = np.zeros((n, n))
    here = frames(chain, angles)
    moved = [[frames(chain, angles + sign * step * np.eye(n)[k]) for sign in (1.0, -1.0)] for k in range(n)]
    for b in range(n):
        if chain.mass[b] == 0.0:
            continue
        rates, spins = np.zeros((3, n)), np.zeros((3, n))
        for k in range(n):
            ahead, behind = (each[b] for each in moved[k])
            rates[:, k] = ((ahead - behind) @ np.append(chain.centre[b], 1.0))[:3] / (2.0 * step)
            skew = (ahead[:3, :3] - behind[:3, :3]) / (2.0 * step) @ here[b][:3, :3].T
            spins[:, k] = 0.5 * np.array([skew[2, 1] - skew[1, 2], skew[0, 2] - skew[2, 0], skew[1, 0] - skew[0, 1]])
        inertia = here[b][:3, :3] @ chain.inertia[b] @ here[b][:3, :3].T
        total += chain.mass[b] * rates.T @ rates + spins.T @ inertia @ spins
    return total


def height_energy(chain, angles, gravity):
    """Potential energy of all bodies."""
    return -sum(
        m * gravity @ (frame @ np.append(c, 1.0))[:3] for m, c, frame in zip(chain.mass, chain.centre, frames(chain, angles), strict=True)
    )


def lagrange_torques(chain, angles, rate, acceleration, gravity, step=1e-4):
    """M q'' + dM/dt q' - d(q'^T M q' / 2)/dq + dV/dq, by differences."""
    moves = step * np.eye(angles.size)

    def slopes_of(function):
        return [(function(angles + move) - function(angles - move)) / (2 * step) for move in moves]

    mass = kinetic_matrix(chain, angles)
    slopes = slopes_of(lambda q: kinetic_matrix(chain, q))
    falling = slopes_of(lambda q: height_energy(chain, q, gravity))
    changing = sum(slope * r for slope, r in zip(slopes, rate, strict=True))
    bias = np.array([-0.5 * rate @ slope @ rate for slope in slopes])
    return mass @ acceleration + changing @ rate + bias + np.array(falling)
