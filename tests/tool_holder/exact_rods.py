"""Rods in a row, exactly: what no finite element has a part in."""

from __future__ import annotations

import numpy as np


def exact(rods, omega):
    """Receptances between both ends of rods in a row: state (displacement, force) carried over each of them in closed form."""
    carried = np.broadcast_to(np.eye(2, dtype=complex), (omega.size, 2, 2))
    for rod in rods:
        modulus = rod.material.youngs_modulus * (1.0 + 1j * rod.material.loss_factor)
        area = np.pi / 4.0 * (rod.diameter**2 - rod.inner_diameter**2)
        k = omega * np.sqrt(rod.material.density / modulus)
        across = np.array(
            [
                [np.cos(k * rod.length), np.sin(k * rod.length) / (modulus * area * k)],
                [-modulus * area * k * np.sin(k * rod.length), np.cos(k * rod.length)],
            ]
        ).transpose(2, 0, 1)
        carried = across @ carried
    # pushed at the tip with 1 N the rod's inner force there is -1 N, at the other end it is what pushes
    (a, _), (c, d) = carried[:, 0].T, carried[:, 1].T
    return np.array([[d / c, 1.0 / c], [1.0 / c, a / c]]).transpose(2, 0, 1)
