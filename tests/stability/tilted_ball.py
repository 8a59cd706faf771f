"""A leaning ball on a plane that a pass beside it has cut: its arcs in tool axes, by looking at points of its surface."""

import numpy as np

from rcsa_ident.cutting.conditions import EngagementMap


def tilted_ball(radius, depth, stepover, lead, tilt, heights=560, angles=14400):
    """Return arcs over the height in the tool's frame and the area across the feed, previous pass on the side -c.

    The surface normal s, the feed f and the cross direction c are the axes; the tool's axis is s turned by the lead about c, then by the
    tilt about f. A normal n of the ball cuts where it is below the depth, moves forward and was outside the ball of the pass before.
    """
    f, c, s = np.eye(3)
    axis = np.array([np.sin(lead), np.cos(lead) * np.sin(tilt), np.cos(lead) * np.cos(tilt)])
    x = f - (f @ axis) * axis
    x /= np.linalg.norm(x)
    y = np.cross(axis, x)
    kappa = np.radians(np.linspace(0.0, 85.0, heights))
    phi = (np.arange(angles) + 0.5) / angles * 2.0 * np.pi
    rows = []
    for k in kappa:
        n = np.sin(k) * (np.sin(phi)[:, None] * x + np.cos(phi)[:, None] * y) - np.cos(k) * axis
        inside = (radius * (n @ s) <= -radius + depth) & (n @ f > 0.0)
        inside &= (radius * (n @ c) + stepover) ** 2 + (radius * (n @ s)) ** 2 >= radius**2
        edges = np.flatnonzero(np.diff(np.concatenate([[0], inside.astype(int), [0]])))
        step = 2.0 * np.pi / angles
        rows += [(radius * (1.0 - np.cos(k)), a * step, b * step) for a, b in edges.reshape(-1, 2)]
    table = np.array(rows)
    # the area across the feed that is cut: between the plane, this pass and the pass before
    u = np.linspace(-radius, radius, 400001)
    low = -np.sqrt(radius**2 - u**2)
    before = np.sqrt(np.maximum(radius**2 - (u + stepover) ** 2, 0.0))
    top = np.minimum(-radius + depth, np.where(np.abs(u + stepover) <= radius, -before, np.inf))
    area = np.trapezoid(np.maximum(top - low, 0.0), u)
    return EngagementMap(table[:, 0], table[:, 1], table[:, 2], feed_rise=float(np.arcsin(f @ axis))), float(area)
