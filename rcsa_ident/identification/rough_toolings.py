"""Toolings whose drawings are rough, at the lines of a campaign: functions of what the drawings do not tell."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from typing import NamedTuple

import numpy as np

from rcsa_ident.base.arrays import ComplexArray, FloatArray
from rcsa_ident.tool_holder.alteration import ALTERATIONS
from rcsa_ident.tool_holder.drawings import RoughToolings
from rcsa_ident.tool_holder.rough import RoughToolHolder


class ToolingAt(NamedTuple):
    """A rough tooling at the points of one axis that it cut.

    `points`: array of int, shape (k,)
    `values`: complex array, shape (k, 5) [m/N], or (k, 6) where its tip was hit; flange tt, tr, rr, flange over tip t, r, scaled by the
        lever, and the tip over the tip
    `slopes`: complex array, shape (k, 5, m) or (k, 6, m), no rows where nobody asked; their change with each of its unknowns
    `unknowns`: array of int, shape (m,); where these stand among the coefficients
    """

    points: np.ndarray
    values: ComplexArray
    slopes: ComplexArray
    unknowns: np.ndarray


def placed(holder: ComplexArray, toolings: Sequence[ToolingAt], hit: np.ndarray) -> ComplexArray:
    """Return receptances of tool-holders as the kernel takes them with those of rough toolings in place of the drawn ones, shape (n, 8).

    `holder` [m/N], shape (n, 8)
    `hit`: array of bool, shape (n,); points that are a hit tip's motion
    """
    found = holder.copy()
    for each in toolings:
        found[each.points, :5] = each.values[:, :5]
        own = hit[each.points]
        if np.any(own):
            place, values = each.points[own], each.values[own]
            found[place, 5], found[place, 6:] = values[:, 5], -values[:, 3:5]
    return found


class _Asked(NamedTuple):
    """What never changes about a rough tooling's lines: fields and how they change with its unknowns, frequencies and who asks for them."""

    tooling: int
    holder: RoughToolHolder
    fields: tuple[str, ...]
    rows: FloatArray
    members: np.ndarray
    omega: FloatArray
    points: list[np.ndarray]
    places: list[np.ndarray]
    tip: bool


class RoughLines:
    """Tool-holders at the lines of all axes, as functions of what their drawings do not tell.

    `holders`: one for each tooling
    `points`: sequence of (array, array); of each axis: frequency [rad/s] and number of the tooling at each point
    `lever` [m]
    `first`: where their unknowns begin among the coefficients
    `hit`: toolings whose tip was hit: its own receptance is among their lines
    """

    def __init__(
        self,
        toolings: RoughToolings,
        holders: Sequence[RoughToolHolder],
        points: Sequence[tuple[FloatArray, np.ndarray]],
        lever: float,
        first: int,
        hit: Collection[int] = (),
    ) -> None:
        self.toolings, self._lever, self._first = toolings, lever, first
        self._axes = len(points)
        self._asked = []
        for t, holder in enumerate(holders):
            own = [np.flatnonzero(tooling == t) for _, tooling in points]
            asked = [w[k] for (w, _), k in zip(points, own, strict=True)]
            omega = np.unique(np.concatenate(asked))
            fields = toolings.fields_of(t)
            if not fields or not omega.size:
                continue
            rows = toolings.weights[t, [ALTERATIONS.index(f) for f in fields]] * toolings.spread
            members = np.flatnonzero(np.any(rows, axis=0))
            places = [np.searchsorted(omega, w) for w in asked]
            self._asked.append(_Asked(t, holder, fields, rows[:, members], members, omega, own, places, t in hit))

    def at(self, values: FloatArray, slopes: bool) -> list[list[ToolingAt]]:
        """Return each axis' rough toolings. `values`, shape (u,): the unknowns, in units of their spreads."""
        found: list[list[ToolingAt]] = [[] for _ in range(self._axes)]
        for each in self._asked:
            by = self.toolings.alteration(each.tooling, values)
            receptances, changes = each.holder.receptances(by, each.omega, self._lever, each.fields if slopes else (), each.tip)
            # from fields to the unknowns that add up to them
            turned = changes @ each.rows if slopes else np.empty((0, receptances.shape[1], each.members.size), dtype=complex)
            for axis, points, place in zip(found, each.points, each.places, strict=True):
                axis.append(ToolingAt(points, receptances[place], turned[place] if slopes else turned, self._first + each.members))
        return found
