"""Arcs and helices as a controller follows them, cut up into chords that stay within a tolerance."""

from __future__ import annotations

import math

import numpy as np

from rcsa_ident.base.arrays import FloatArray
from rcsa_ident.base.errors import InputError, positive

#: Largest and smallest difference of an arc's radii at its ends that is taken for rounding [m]; between them a thousandth of the radius.
_ROUNDED = (5e-6, 5e-4)
#: Ends that are no further apart than this are one [m].
_SAME = 1e-9


def centre_of(start: tuple[float, float], end: tuple[float, float], radius: float, clockwise: bool) -> tuple[float, float]:
    """Return the centre of an arc of a told radius [m] in its plane; a negative one says the longer way around.

    Raises `InputError` if the ends are one, or further apart than the diameter.

    Examples
    --------
    >>> centre_of((1.0, 0.0), (0.0, 1.0), 1.0, clockwise=True)
    (1.0, 1.0)
    """
    du, dv = end[0] - start[0], end[1] - start[1]
    chord = math.hypot(du, dv)
    if chord <= _SAME:
        raise InputError("R", "an arc that ends where it begins", "the centre of a full circle, by I, J and K")
    if chord > 2.0 * abs(radius) + _ROUNDED[0]:
        raise InputError("R", f"{1e3 * radius:g} mm", f"half the way from end to end or more, {500.0 * chord:.6g} mm")
    # from the middle of the chord to its left where the centre lies there
    height = math.sqrt(max(radius * radius - 0.25 * chord * chord, 0.0)) / chord
    side = height if clockwise == (radius < 0.0) else -height
    return 0.5 * (start[0] + end[0]) - side * dv, 0.5 * (start[1] + end[1]) + side * du


def turned(start: tuple[float, float], end: tuple[float, float], centre: tuple[float, float], clockwise: bool) -> float:
    """Return by which angle an arc turns about its centre [rad], below 0 clockwise; a full turn where the ends are one.

    Raises `InputError` if the ends stand at different distances from the centre.

    Examples
    --------
    >>> turned((1.0, 0.0), (0.0, 1.0), (0.0, 0.0), clockwise=True) / math.pi
    -1.5
    """
    (u, v), (a, b) = ((p[0] - centre[0], p[1] - centre[1]) for p in (start, end))
    first, last = math.hypot(u, v), math.hypot(a, b)
    if first <= _SAME:
        raise InputError("centre of the arc", "the place where it begins", "another place")
    if abs(last - first) > min(max(_ROUNDED[0], 1e-3 * first), _ROUNDED[1]):
        found = f"{1e3 * first:.6g} mm from the arc's beginning, {1e3 * last:.6g} mm from its end"
        raise InputError("centre of the arc", found, "as far from the one as from the other")
    if math.hypot(a - u, b - v) <= _SAME:
        return -2.0 * math.pi if clockwise else 2.0 * math.pi
    way = math.atan2(u * b - v * a, u * a + v * b) % (2.0 * math.pi)
    return way - 2.0 * math.pi if clockwise else way


def chord_count(radius: float, angle: float, tolerance: float) -> int:
    """Return how many chords follow an arc nowhere further from it than a tolerance [m].

    Examples
    --------
    A quarter of a circle of 10 mm, within a micrometre:

    >>> chord_count(0.01, math.pi / 2.0, 1e-6)
    56
    """
    share = min(positive("tolerance", tolerance, "m") / radius, 1.0)
    # 2 acos(1 - share) without the loss of digits at small shares
    step = 4.0 * math.asin(math.sqrt(0.5 * share))
    return max(math.ceil(abs(angle) / step - 1e-9), 1)


def chords(
    start: FloatArray, end: FloatArray, centre: tuple[float, float], plane: tuple[int, int, int], angle: float, count: int
) -> FloatArray:
    """Return the ends of an arc's chords, shape (count, 3) [m]; the last one is the arc's end itself.

    `start`, `end` [m], shape (3,): apart along the plane's normal the arc is a helix
    `centre`: pair of float [m], in the plane
    `plane`: three of int, the plane's two axes and its normal, right-handed
    `angle` [rad]: by which it turns

    Examples
    --------
    Half a circle in two chords:

    >>> chords(np.zeros(3), np.array([2.0, 0.0, 0.0]), (1.0, 0.0), (0, 1, 2), -np.pi, 2).round(9).tolist()
    [[1.0, 1.0, 0.0], [2.0, 0.0, 0.0]]
    """
    u, v, w = plane
    share = np.arange(1, count + 1) / count
    first, last = (math.hypot(p[u] - centre[0], p[v] - centre[1]) for p in (start, end))
    at = math.atan2(start[v] - centre[1], start[u] - centre[0]) + angle * share
    # what rounding leaves between the radii is spread over the way
    radius = first + (last - first) * share
    places = np.empty((count, 3))
    places[:, u] = centre[0] + radius * np.cos(at)
    places[:, v] = centre[1] + radius * np.sin(at)
    places[:, w] = start[w] + (end[w] - start[w]) * share
    places[-1] = end
    return places
