"""Force lines of a cylinder as closed forms along its helix, tooth by tooth: what forces were computed by before they were sums over rows.

No code shared with the package; angles, pitches and offsets are plain arrays.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np


def exponential_integral(n, start, end):
    """Integral of e^{i n phi} from start to end for whole n."""
    half = 0.5 * (end - start)
    return 2.0 * half * np.exp(0.5j * n * (start + end)) * np.sinc(n * half / np.pi)


def sine_form(tangential, radial):
    """e^{i q phi}, q = -2..2, of the force of a chip of sin phi, shape (5, 2)."""
    sin_cos, sin_sin = np.array([0.25j, 0, 0, 0, -0.25j]), np.array([-0.25, 0, 0.5, 0, -0.25])
    return np.stack([-tangential * sin_cos - radial * sin_sin, tangential * sin_sin - radial * sin_cos], axis=1)


def constant_form(tangential, radial):
    """The same of a force that does not depend on phi."""
    cos, sin = np.array([0, 0.5, 0, 0.5, 0]), np.array([0, 0.5j, 0, -0.5j, 0])
    return np.stack([-tangential * cos - radial * sin, tangential * sin - radial * cos], axis=1)


def chip_bounds(j, feed, runout):
    ahead = (j + np.arange(feed.size)) % feed.size
    return np.cumsum(feed[ahead]), runout[j] - runout[(ahead + 1) % feed.size]


def chip_pieces(moved, offset, entry, leave):
    """(start, end, k) where the chip is the k-th a sin(phi) + b and above zero."""
    meet = [-b / a for a, b in zip(moved, offset, strict=True) if a > 0.0]
    for i in range(moved.size):
        steeper = moved[:i] != moved[i]
        meet += ((offset[:i] - offset[i])[steeper] / (moved[i] - moved[:i])[steeper]).tolist()
    angles = np.arcsin([s for s in meet if 0.0 < s < 1.0])
    angles = np.concatenate([[entry, leave], angles, np.pi - angles])
    angles = np.unique(angles[(angles >= entry) & (angles <= leave)])
    pieces = []
    for start, end in pairwise(angles.tolist()):
        chips = moved * np.sin(0.5 * (start + end)) + offset
        k = int(np.argmin(chips))
        if chips[k] > 0.0:
            pieces.append((start, end, k))
    return pieces


def unit_lines(pitch, runout, diameter, helix, depth, feed_per_tooth, entry, leave, feed_angle, orders):
    """One-sided lines in machine axes per unit of K_tc, K_rc, K_te and K_re, shape (m, 2, 4)."""
    teeth = pitch.size
    tooth_angle = np.concatenate([[0.0], np.cumsum(pitch)[:-1]])
    feed = feed_per_tooth * teeth * pitch / (2.0 * np.pi)
    q = np.arange(-2, 3)
    none = np.zeros((5, 4))
    shear, edges = (np.hstack([form(1.0, 0.0), form(0.0, 1.0)]) for form in (sine_form, constant_form))
    per_feed, per_offset, edge = np.hstack([shear, none]), np.hstack([edges, none]), np.hstack([none, edges])
    lines = np.zeros((orders.size, 8), dtype=complex)
    for j in range(teeth):
        moved, offset = chip_bounds(j, feed, runout)
        for start, end, k in chip_pieces(moved, offset, entry, leave):
            window = exponential_integral(q[None, :] - orders[:, None], start, end) / (2.0 * np.pi)
            turned = np.exp(1j * orders * tooth_angle[j])[:, None]
            lines += turned * (window @ (moved[k] * per_feed + offset[k] * per_offset + edge))
    lag = orders * np.tan(helix) / diameter * depth
    lines *= (depth * np.exp(-1j * lag) * np.sinc(lag / np.pi) * np.where(orders == 0, 1.0, 2.0))[:, None]
    c, s = np.cos(feed_angle), np.sin(feed_angle)
    return np.array([[c, -s], [s, c]]) @ np.moveaxis(lines.reshape(-1, 4, 2), 1, 2)


def true_unit_lines(pitch, diameter, helix, depth, feed_per_tooth, entry, leave, feed_angle, orders):
    """The same of teeth that run true, all of them at once."""
    phases = np.exp(1j * np.outer(orders, np.concatenate([[0.0], np.cumsum(pitch)[:-1]])))
    feed = feed_per_tooth * pitch * pitch.size / (2.0 * np.pi)
    none = np.zeros((5, 4))
    shear, edges = (np.hstack([form(1.0, 0.0), form(0.0, 1.0)]) for form in (sine_form, constant_form))
    window = exponential_integral(np.arange(-2, 3)[None, :] - orders[:, None], entry, leave) / (2.0 * np.pi)
    chip, edge = window @ np.hstack([shear, none]), window @ np.hstack([none, edges])
    lines = (phases @ feed)[:, None] * chip + phases.sum(axis=1)[:, None] * edge
    lag = orders * np.tan(helix) / diameter * depth
    lines *= (depth * np.exp(-1j * lag) * np.sinc(lag / np.pi) * np.where(orders == 0, 1.0, 2.0))[:, None]
    c, s = np.cos(feed_angle), np.sin(feed_angle)
    return np.array([[c, -s], [s, c]]) @ np.moveaxis(lines.reshape(-1, 4, 2), 1, 2)
