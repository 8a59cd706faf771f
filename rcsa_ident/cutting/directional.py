"""Directional coefficients: dynamic force per regenerated displacement."""

from __future__ import annotations

import numpy as np

from rcsa_ident.base.arrays import FloatArray
from rcsa_ident.cutting.coefficients import CuttingCoefficients
from rcsa_ident.cutting.conditions import Engagement


def mean_directional_matrix(teeth: int, engagement: Engagement, coefficients: CuttingCoefficients, feed_angle: float = 0.0) -> FloatArray:
    """Return the mean over a revolution of the directional matrix [alpha] ([inprocess], eq. 3), in machine axes.

    F = a K_tc [alpha] {X(t) - X(t - tau)}; closed form, exact.

    `coefficients`: only the radial ratio counts
    `feed_angle` [rad]: direction of the feed in the machine's X-Y plane, from +X towards +Y
    Returns an array of shape (2, 2) [-].
    """

    def primitive(phi: float) -> FloatArray:
        # integrals of sin cos, sin^2, cos^2
        sc, ss, cc = -0.25 * np.cos(2 * phi), 0.5 * phi - 0.25 * np.sin(2 * phi), 0.5 * phi + 0.25 * np.sin(2 * phi)
        kr = coefficients.radial_ratio
        return np.array([[-sc - kr * ss, -cc - kr * sc], [ss - kr * sc, sc - kr * cc]])

    alpha = teeth / (2.0 * np.pi) * (primitive(engagement.exit) - primitive(engagement.entry))
    c, s = np.cos(feed_angle), np.sin(feed_angle)
    rotation = np.array([[c, -s], [s, c]])
    return rotation @ alpha @ rotation.T
