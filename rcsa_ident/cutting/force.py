"""Milling force in a stable cut: Fourier lines and time histories ([inprocess], eqs. 2-4, with edges, helix and the cutter's shape)."""

from __future__ import annotations

import itertools
from collections.abc import Mapping
from dataclasses import dataclass, replace
from enum import StrEnum

import numpy as np

from rcsa_ident.base.arrays import ComplexArray, FloatArray
from rcsa_ident.cutting.coefficients import CuttingCoefficients
from rcsa_ident.cutting.conditions import CuttingConditions
from rcsa_ident.cutting.cutter import Cutter
from rcsa_ident.cutting.rows import Rows, rows_of
from rcsa_ident.cutting.teeth import slices_of


class ForceTerm(StrEnum):
    """What a simulated force changes with, and what is never known exactly of it."""

    TANGENTIAL = "tangential coefficient"
    RATIO = "radial ratio"
    TANGENTIAL_EDGE = "tangential edge force"
    RADIAL_EDGE = "radial edge force"
    RUNOUT = "run-out"


#: What `force_and_slope` varies, in its order.
SLOPES = tuple(ForceTerm)
#: A cutter's usual eccentricity in its clamping [m].
REFERENCE_RUNOUT = 2e-6
#: In what forces are linear, in the order of `unit_lines`; the last two reach X and Y where the edge leans.
UNIT_NAMES = ("K_tc", "K_rc", "K_te", "K_re", "K_ac", "K_ae")


@dataclass(frozen=True, slots=True)
class ForceCoefficient:
    """An unknown of the simulated forces: the logarithm of a cutting coefficient's scale, or a run-out in `REFERENCE_RUNOUT`.

    `tooling`: whose it is; empty where all toolings have it in common
    """

    term: ForceTerm
    tooling: str = ""

    def __str__(self) -> str:
        return f"{self.term} of {self.tooling}" if self.tooling else str(self.term)


def _turning_directions() -> ComplexArray:
    """What `_unit_lines` sums up, from the moments of rows, shape (5, 3, 3, 3, 6).

    For each e^{i q phi}, q = -2..2, chip made of run-out, chip of sin phi or edge, and direction on an upright edge, by sin kappa and by
    cos kappa: (x, y, z) per unit of each coefficient.
    """
    one, cos, sin = (np.array(values, dtype=complex) for values in ((0, 0, 1, 0, 0), (0, 0.5, 0, 0.5, 0), (0, 0.5j, 0, -0.5j, 0)))
    none = np.zeros(5)
    along, inward, upward = (np.stack(parts, axis=1) for parts in ([-cos, sin, none], [-sin, -cos, none], [none, none, one]))
    found = np.zeros((5, 3, 3, 3, 6), dtype=complex)
    for kind, (tangential, radial, axial) in enumerate(((0, 1, 4), (0, 1, 4), (2, 3, 5))):
        found[:, kind, 0, :, tangential] = along
        found[:, kind, 1, :, radial], found[:, kind, 2, :, radial] = inward, upward
        found[:, kind, 2, :, axial], found[:, kind, 1, :, axial] = inward, -upward
    # times sin phi
    found[:, 1] = np.apply_along_axis(lambda waves: np.convolve(waves, sin)[2:-2], 0, found[:, 1])
    return found


#: For the force in x and y, and in z beside them.
_DIRECTIONS = {n: _turning_directions()[..., :n, :].reshape(45, 6 * n) for n in (2, 3)}
_Q = np.arange(-2.0, 3.0)
#: Instants times slices of the edge whose force is computed at once: they fit a near cache.
_TOGETHER = 4096


def tooth_force(
    phi: FloatArray, chip: FloatArray, coefficients: CuttingCoefficients, kappa: float | FloatArray = 0.5 * np.pi
) -> FloatArray:
    """Return the force of one cutting tooth on the tool per width of edge, (feed, normal, axial).

    `phi` [rad], shape (n,): immersion, clockwise from the normal direction
    `chip` [m], shape (n,): chip thickness, across the edge; the tooth is taken to be in the material
    `kappa`: float or array, shape (n,) [rad], default a wall; angle of the edge's outward normal, from the axis pointing down
    Returns an array of shape (n, 3) [N/m]: the third one from the spindle towards the tip, -z.
    """
    s, c, sine, cosine = np.sin(phi), np.cos(phi), np.sin(kappa), np.cos(kappa)
    tangential = coefficients.tangential * chip + coefficients.tangential_edge
    radial = coefficients.tangential * coefficients.radial_ratio * chip + coefficients.radial_edge
    axial = coefficients.tangential * coefficients.axial_ratio * chip + coefficients.axial_edge
    inward = radial * sine + axial * cosine
    return np.stack([-c * tangential - s * inward, s * tangential - c * inward, axial * sine - radial * cosine], axis=-1)


def force_lines(cutter: Cutter, conditions: CuttingConditions, coefficients: CuttingCoefficients, orders: np.ndarray) -> ComplexArray:
    """Return the amplitudes of the milling force at multiples of the spindle frequency.

    The force is F(t) = Re sum_m lines[m] e^{i m Omega t} with tooth 1 (at the tip) at immersion 0 when t = 0. Exact
    for any shape, pitch and helix of a cutter that runs true; with run-out the chip of a tooth may begin late or end early
    and `runout_force_lines` applies.

    Parameters
    ----------
    cutter : Cutter
        Its run-out is left aside.
    conditions : CuttingConditions
    coefficients : CuttingCoefficients
    orders : array of int, shape (m,)
        Multiples of the spindle frequency; tooth-passing harmonics are multiples of the number of teeth. Order 0
        gives the mean.

    Returns
    -------
    complex array, shape (m, 2) [N]
        Amplitudes in machine axes X, Y.

    Raises
    ------
    InputError
        If nothing cuts, or the depth is beyond the edge.

    Notes
    -----
    A row of edge pushes with a sum of e^{i q phi}, q = -2..2, along its arc, so each line is a sum of integrals of
    e^{i (q - m) phi}; a wall's helix multiplies line m by the mean of e^{-i m 2 z tan(helix) / D} over the depth.

    Examples
    --------
    >>> import rcsa_ident as ri
    >>> import numpy as np
    >>> from rcsa_ident.cutting.force import force_lines
    >>> half = ri.Engagement.from_immersion(0.5, "down")
    >>> cut = ri.MillingProcess(ri.Cutter(2, 0.012), ri.CuttingCoefficients(7e8, 0.3), half, feed_per_tooth=0.1e-3)
    >>> conditions = cut.conditions(ri.rpm(12_000), 1e-3)
    >>> lines = force_lines(cut.cutter, conditions, cut.coefficients, np.array([0, 2, 4]))
    >>> abs(lines).round(1).tolist()
    [[5.9, 20.8], [12.0, 32.6], [8.7, 15.0]]
    """
    return unit_lines(cutter, conditions, orders) @ unit_values(coefficients)


def runout_force_lines(
    cutter: Cutter, conditions: CuttingConditions, coefficients: CuttingCoefficients, orders: np.ndarray
) -> ComplexArray:
    """Return the lines as `force_lines` does, with run-out: teeth may cut deeper, late or not at all. Exact.

    Parameters
    ----------
    cutter : Cutter
    conditions : CuttingConditions
    coefficients : CuttingCoefficients
    orders : array of int, shape (m,)
        Multiples of the spindle frequency.

    Returns
    -------
    complex array, shape (m, 2) [N]

    Notes
    -----
    A tooth's chip is the smallest of as many a sin(phi) + b as there are teeth, where positive: between the angles at
    which two of them, or one and zero, meet, each line is the integral that `force_lines` takes.
    """
    return unit_lines(cutter, conditions, orders, runout=True) @ unit_values(coefficients)


def unit_lines(
    cutter: Cutter, conditions: CuttingConditions, orders: np.ndarray, runout: bool = False, axial: bool = False
) -> ComplexArray:
    """Return the lines per unit of K_tc, K_rc, K_te, K_re, K_ac and K_ae: the force is linear in them.

    `orders`: array of int, shape (m,); multiples of the spindle frequency
    `runout`: whether teeth may cut deeper, late or not at all, as with `runout_force_lines`
    `axial`: whether the force along z, from the tip to the spindle, is told, too
    Returns a complex array of shape (m, 2 or 3, 6) [m^2, m^2, m, m, m^2, m]: in machine axes. Where the edge stands upright the last two
        columns have no part in X and Y; where it leans they go with those of K_rc and K_re, and one depth in X and Y tells their sum alone.
    Raises `InputError` as in `force_lines`.
    """
    orders = np.asarray(orders)
    components = 3 if axial else 2
    if conditions.axial_depth == 0.0:
        return np.zeros((orders.size, components, 6), dtype=complex)
    cutter = cutter if runout else cutter.running_true()
    lines = _unit_lines(rows_of(cutter, conditions.engagement, conditions.axial_depth, conditions.feed_per_tooth), orders, components)
    if conditions.feed_angle:
        lines[:, :2] = conditions.machine_from_feed @ lines[:, :2]
    return lines


def _unit_lines(rows: Rows, orders: np.ndarray, components: int) -> ComplexArray:
    """One-sided lines of all rows together per unit of each coefficient, in (feed, normal, z), shape (m, components, 6)."""
    sine, cosine = np.sin(rows.kappa), np.cos(rows.kappa)
    half = 0.5 * (rows.end - rows.start)
    # the integral over a row's arc, turned to where its tooth stands, times the mean over the lags along a wall
    n = _Q - orders[:, None, None]
    turned = rows.angle - 0.5 * (rows.near + rows.far)
    window = np.exp(1j * (n * (0.5 * (rows.start + rows.end))[:, None] + (orders[:, None] * turned)[:, :, None]))
    window *= np.sinc(n * (half / np.pi)[:, None])
    wall = np.sinc(orders[:, None] * ((0.5 / np.pi) * (rows.far - rows.near))) * (rows.width * half)
    window *= wall[:, :, None]
    ones = np.ones_like(sine)
    chip = np.array([sine * rows.step, sine * rows.feed, ones])[:, None] * np.array([ones, sine, cosine])
    moments = window.swapaxes(1, 2) @ chip.reshape(9, -1).T
    lines = (moments.reshape(orders.size, 45) @ _DIRECTIONS[components]).reshape(orders.size, components, 6)
    # teeth that are alike answer each other at other orders than their multiples
    copies = round(2.0 * np.pi / rows.spacing)
    lines *= (np.where(orders == 0, 1.0, 2.0) * (orders % copies == 0) * (copies / np.pi))[:, None, None]
    return lines


def unit_values(coefficients: CuttingCoefficients) -> FloatArray:
    """Return coefficients in the order of `UNIT_NAMES`, shape (6,) [N/m^2, N/m^2, N/m, N/m, N/m^2, N/m]."""
    c = coefficients
    return np.array(
        [c.tangential, c.tangential * c.radial_ratio, c.tangential_edge, c.radial_edge, c.tangential * c.axial_ratio, c.axial_edge]
    )


def force_and_slope(
    cutter: Cutter, conditions: CuttingConditions, coefficients: CuttingCoefficients, orders: np.ndarray
) -> tuple[ComplexArray, ComplexArray]:
    """Return the lines of `force_lines`, and how their logarithms change with what is never known exactly.

    `orders`: array of int, shape (m,); multiples of the spindle frequency
    Returns complex arrays, shapes (m, 2) [N] and (m, 2, 5) [-]: the last axis is `SLOPES`: logarithms of K_tc, k_rc, K_te and K_re, and a
        run-out in units of `REFERENCE_RUNOUT`, whose effect on the lines that all teeth share is a secant: teeth leave the material early.
        0 where there is no force.
    """
    values = unit_values(coefficients)
    parts = unit_lines(cutter, conditions, orders) * values
    total = parts.sum(axis=2)
    # no tooth stands where the eccentricity is 0 or largest
    eccentric = replace(cutter, runout=REFERENCE_RUNOUT * np.cos(cutter.tooth_angle - 0.125 * cutter.pitch[0]))
    runout = unit_lines(eccentric, conditions, orders, runout=True) @ values - total
    change = np.stack([parts[..., 0] + parts[..., 1] + parts[..., 4], parts[..., 1], parts[..., 2], parts[..., 3], runout], axis=-1)
    return total, np.divide(change, total[..., None], out=np.zeros_like(change), where=total[..., None] != 0.0)


def axial_and_slope(
    cutter: Cutter, conditions: CuttingConditions, coefficients: CuttingCoefficients, orders: np.ndarray
) -> tuple[ComplexArray, dict[ForceTerm, ComplexArray]]:
    """Return the lines of the force along z, from the tip to the spindle, and how their logarithms change; without run-out.

    `orders`: array of int, shape (m,); multiples of the spindle frequency
    Returns a complex array of shape (m,) [N], and one of the same shape for each term but the run-out; 0 where there is no force.
    """
    parts = unit_lines(cutter, conditions, orders, axial=True)[:, 2] * unit_values(coefficients)
    total = parts.sum(axis=1)
    change = {
        ForceTerm.TANGENTIAL: parts[:, 0] + parts[:, 1] + parts[:, 4],
        ForceTerm.RATIO: parts[:, 1],
        ForceTerm.TANGENTIAL_EDGE: parts[:, 2],
        ForceTerm.RADIAL_EDGE: parts[:, 3],
    }
    return total, {term: np.divide(each, total, out=np.zeros_like(each), where=total != 0.0) for term, each in change.items()}


def force_history(
    cutter: Cutter,
    conditions: CuttingConditions,
    coefficients: CuttingCoefficients,
    angle: FloatArray,
    slices: int = 32,
) -> FloatArray:
    """Return the force over the rotation angle of tooth 1, in machine axes, with run-out and teeth that miss.

    The chip of a tooth is what the teeth before it left, over up to one revolution of them; a tooth whose path lies
    inside their surface cuts nothing.

    Parameters
    ----------
    cutter : Cutter
    conditions : CuttingConditions
    coefficients : CuttingCoefficients
    angle : array, shape (n,) [rad]
        Immersion of tooth 1 at the tip.
    slices : int
        Parts of the edge, at least.

    Returns
    -------
    array, shape (n, 3) [N]
        Force along X, Y and from the spindle towards the tip, -z.

    Examples
    --------
    >>> import rcsa_ident as ri
    >>> import numpy as np
    >>> from rcsa_ident.cutting.force import force_history
    >>> half = ri.Engagement.from_immersion(0.5, "down")
    >>> cut = ri.MillingProcess(ri.Cutter(2, 0.012), ri.CuttingCoefficients(7e8, 0.3), half, feed_per_tooth=0.1e-3)
    >>> conditions = cut.conditions(ri.rpm(12_000), 1e-3)
    >>> force = force_history(cut.cutter, conditions, cut.coefficients, np.radians([45.0, 100.0, 135.0]))
    >>> force[:, :2].round(1).tolist()
    [[0.0, 0.0], [-8.4, 71.5], [24.5, 45.5]]
    """
    angle = np.asarray(angle, dtype=float)
    total = np.zeros((angle.size, 3))
    depth, engagement = conditions.axial_depth, conditions.engagement
    feed = conditions.feed_per_tooth * cutter.teeth / (2.0 * np.pi)
    parts = slices_of(cutter, depth, slices, engagement.radii, engagement.heights)
    arcs = engagement.arcs(parts.radius, parts.height)
    teeth, count = parts.lag.shape
    block = max(1, _TOGETHER // max(angle.size, 1))
    for j, first in itertools.product(range(teeth), range(0, count, block)):
        own = slice(first, first + block)
        phi = np.mod(angle[:, None] + cutter.tooth_angle[j] - parts.lag[j, own], 2.0 * np.pi)
        chip = _kinematic_chip(j, np.sin(phi), feed * parts.pitch[:, own], parts.offset[:, own])
        inside = np.any((phi >= arcs[:, None, own, 0]) & (phi < arcs[:, None, own, 1]), axis=0)
        lean = parts.lean[j, own]
        force = tooth_force(phi, chip * np.sin(lean), coefficients, lean)
        total += np.einsum("nkd,nk->nd", force, np.where(inside & (chip > 0.0), parts.width[j, own], 0.0))
    total[:, :2] = total[:, :2] @ conditions.machine_from_feed.T
    return total


def _kinematic_chip(j: int, sine: FloatArray, feed: FloatArray, runout: FloatArray) -> FloatArray:
    """Chip of tooth j at slices of the edge, shape (n, k): the smallest distance to what the teeth ahead left, over one revolution of them.

    `sine`, shape (n, k); `feed`, `runout` [m], shape (teeth, k)
    """
    moved, offset = _chip_bounds(j, feed, runout)
    chip = moved[0] * sine + offset[0]
    for a, b in zip(moved[1:], offset[1:], strict=True):
        np.minimum(chip, a * sine + b, out=chip)
    return chip


def _chip_bounds(j: int, feed: FloatArray, runout: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Distances a sin(phi) + b of tooth j to the surfaces of the teeth ahead, over one revolution of them: a and b, shape (teeth, ...)."""
    ahead = (j + np.arange(len(feed))) % len(feed)
    return np.cumsum(feed[ahead], axis=0), runout[j] - runout[(ahead + 1) % len(feed)]


def scaled_force(slope: ComplexArray, logs: FloatArray, exact: Mapping[ForceTerm, int]) -> tuple[ComplexArray, ComplexArray]:
    """Return what forces are of those that were simulated, shape (n,), and how its logarithm changes with each unknown, shape (n, c).

    Terms that are told in `exact` add up, K_tc e^t (U_1 + k_rc e^r U_2) + K_te e^p U_3 + K_re e^q U_4, with the shares of the sum that
    their slopes are at the values that were told; the others multiply.

    `slope` [-], shape (n, c): change of the simulated force's logarithm with each unknown
    `logs`, shape (c,)
    `exact`: places of the terms that add up among the unknowns
    """
    if not exact:
        return np.exp(slope @ logs), slope
    places = {term: exact[term] for term in exact if exact[term] < logs.size}
    rest = logs.copy()
    rest[list(places.values())] = 0.0
    nothing = np.zeros(slope.shape[0])
    share = {term: slope[:, k] for term, k in places.items()}
    grown = {term: np.exp(logs[k]) for term, k in places.items()}
    edges = [term for term in (ForceTerm.TANGENTIAL_EDGE, ForceTerm.RADIAL_EDGE) if term in places]
    chip = share.get(ForceTerm.TANGENTIAL, 1.0 - sum((share[term] for term in edges), nothing))
    ratio, tangential = share.get(ForceTerm.RATIO, nothing), grown.get(ForceTerm.TANGENTIAL, 1.0)
    radial = tangential * ratio * grown.get(ForceTerm.RATIO, 1.0)
    parts = {ForceTerm.TANGENTIAL: tangential * (chip - ratio) + radial, ForceTerm.RATIO: radial}
    parts |= {term: share[term] * grown[term] for term in edges}
    total = parts[ForceTerm.TANGENTIAL] + sum((parts[term] for term in edges), 1.0 - chip - sum((share[term] for term in edges), nothing))
    moved = slope.copy()
    for term, k in places.items():
        moved[:, k] = parts[term] / total
    return total * np.exp(slope @ rest), moved
