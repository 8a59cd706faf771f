"""Milling force in a stable cut: Fourier lines and time histories ([inprocess], eqs. 2-4, with edges and helix)."""

from __future__ import annotations

from dataclasses import dataclass, replace
from enum import StrEnum
from itertools import pairwise

import numpy as np

from rcsa_ident.arrays import ComplexArray, FloatArray
from rcsa_ident.cutting.coefficients import CuttingCoefficients
from rcsa_ident.cutting.conditions import CuttingConditions, Engagement, same_everywhere
from rcsa_ident.cutting.cutter import Cutter


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


@dataclass(frozen=True, slots=True)
class ForceCoefficient:
    """An unknown of the simulated forces: the logarithm of a cutting coefficient's scale, or a run-out in `REFERENCE_RUNOUT`.

    Parameters
    ----------
    term : ForceTerm
    tooling : str
        Whose it is; empty where all toolings have it in common.
    """

    term: ForceTerm
    tooling: str = ""

    def __str__(self) -> str:
        return f"{self.term} of {self.tooling}" if self.tooling else str(self.term)


def tooth_force(phi: FloatArray, chip: FloatArray, coefficients: CuttingCoefficients) -> FloatArray:
    """Return the force of one cutting tooth on the tool per unit axial depth, (feed, normal, axial).

    Parameters
    ----------
    phi : array, shape (n,) [rad]
        Immersion, clockwise from the normal direction.
    chip : array, shape (n,) [m]
        Chip thickness; the tooth is taken to be in the material.
    coefficients : CuttingCoefficients

    Returns
    -------
    array, shape (n, 3) [N/m]
    """
    s, c = np.sin(phi), np.cos(phi)
    tangential = coefficients.tangential * chip + coefficients.tangential_edge
    radial = coefficients.tangential * coefficients.radial_ratio * chip + coefficients.radial_edge
    axial = coefficients.tangential * coefficients.axial_ratio * chip + coefficients.axial_edge
    return np.stack([-c * tangential - s * radial, s * tangential - c * radial, axial], axis=-1)


def force_lines(cutter: Cutter, conditions: CuttingConditions, coefficients: CuttingCoefficients, orders: np.ndarray) -> ComplexArray:
    """Return the amplitudes of the milling force at multiples of the spindle frequency.

    The force is F(t) = Re sum_m lines[m] e^{i m Omega t} with tooth 1 (at the tip) at immersion 0 when t = 0. Exact
    for any pitch and helix as long as each tooth cuts through the whole immersion; with run-out the chip thickness of
    a tooth may end early and `runout_force_lines` applies.

    Parameters
    ----------
    cutter : Cutter
    conditions : CuttingConditions
    coefficients : CuttingCoefficients
    orders : array of int, shape (m,)
        Multiples of the spindle frequency; tooth-passing harmonics are multiples of the number of teeth. Order 0
        gives the mean.

    Returns
    -------
    complex array, shape (m, 2) [N]
        Amplitudes in machine axes X, Y.

    Notes
    -----
    A tooth's force per depth is a sum of e^{i q phi}, q = -2..2, in its engagement, so each line is a sum of
    integrals of e^{i (q - m) phi}; a helix multiplies line m by the mean of e^{-i m 2 z tan(helix) / D} over the depth.
    """
    orders = np.asarray(orders)
    chip, _, edge = _forms(coefficients)
    return _over_depth(_per_depth(cutter, conditions, orders, chip, edge), cutter, conditions, orders)


def _per_depth(cutter: Cutter, conditions: CuttingConditions, orders: np.ndarray, chip: ComplexArray, edge: ComplexArray) -> ComplexArray:
    """Lines of forces per depth whose forms are columns, shape (m, n)."""
    entry, exit_ = same_everywhere(conditions.engagement).angles
    # teeth: sum_j e^{i m psi_j}, weighted by the feed that tooth j takes (its pitch)
    phases = np.exp(1j * np.outer(orders, cutter.tooth_angle))
    feed = conditions.feed_per_tooth * cutter.pitch * cutter.teeth / (2.0 * np.pi)
    q = np.arange(-2, 3)
    window = _exponential_integral(q[None, :] - orders[:, None], entry, exit_) / (2.0 * np.pi)
    return (phases @ feed)[:, None] * (window @ chip) + phases.sum(axis=1)[:, None] * (window @ edge)


def force_and_slope(
    cutter: Cutter, conditions: CuttingConditions, coefficients: CuttingCoefficients, orders: np.ndarray
) -> tuple[ComplexArray, ComplexArray]:
    """Return the lines of `force_lines`, and how their logarithms change with what is never known exactly.

    Parameters
    ----------
    cutter : Cutter
    conditions : CuttingConditions
    coefficients : CuttingCoefficients
    orders : array of int, shape (m,)
        Multiples of the spindle frequency.

    Returns
    -------
    complex arrays, shapes (m, 2) [N] and (m, 2, 5) [-]
        The last axis is `SLOPES`: logarithms of K_tc, k_rc, K_te and K_re, and a run-out in units of `REFERENCE_RUNOUT`, whose
        effect on the lines that all teeth share is a secant: teeth leave the material early. 0 where there is no force.
    """

    def lines(**changed: float) -> ComplexArray:
        return force_lines(cutter, conditions, replace(coefficients, **changed), orders)

    total = lines()
    smooth = lines(tangential_edge=0.0, radial_edge=0.0)
    tangential = lines(tangential_edge=0.0, radial_edge=0.0, radial_ratio=0.0)
    edges = [lines(radial_edge=0.0) - smooth, lines(tangential_edge=0.0) - smooth]
    # no tooth stands where the eccentricity is 0 or largest
    eccentric = replace(cutter, runout=REFERENCE_RUNOUT * np.cos(cutter.tooth_angle - 0.125 * cutter.pitch[0]))
    runout = runout_force_lines(eccentric, conditions, coefficients, orders) - total
    change = np.stack([smooth, smooth - tangential, *edges, runout], axis=-1)
    return total, np.divide(change, total[..., None], out=np.zeros_like(change), where=total[..., None] != 0.0)


def _over_depth(lines: ComplexArray, cutter: Cutter, conditions: CuttingConditions, orders: np.ndarray) -> ComplexArray:
    """Integrate two-sided lines per depth over the depth, turn them to machine axes and make them one-sided."""
    lag = orders * np.tan(cutter.helix) / cutter.diameter * conditions.axial_depth
    lines = lines * (conditions.axial_depth * np.exp(-1j * lag) * np.sinc(lag / np.pi))[:, None]
    lines = np.where(orders[:, None] == 0, 1.0, 2.0) * lines
    return lines @ conditions.machine_from_feed.T


def _forms(coefficients: CuttingCoefficients) -> tuple[ComplexArray, ComplexArray, ComplexArray]:
    """Coefficients of e^{i q phi}, q = -2..2, of the (feed, normal) force per depth: per unit feed, per unit of chip, of the edge."""
    k, kr = coefficients.tangential, coefficients.tangential * coefficients.radial_ratio
    return _sine_form(k, kr), _constant_form(k, kr), _constant_form(coefficients.tangential_edge, coefficients.radial_edge)


def _sine_form(tangential: float, radial: float) -> ComplexArray:
    """Return the form of forces along the edge that are as sin phi, shape (5, 2)."""
    # rows q = -2..2 of sin cos, sin^2
    sin_cos = np.array([0.25j, 0, 0, 0, -0.25j])
    sin_sin = np.array([-0.25, 0, 0.5, 0, -0.25])
    return np.stack([-tangential * sin_cos - radial * sin_sin, tangential * sin_sin - radial * sin_cos], axis=1)


def _constant_form(tangential: float, radial: float) -> ComplexArray:
    """Return the form of forces along the edge that do not depend on phi, shape (5, 2)."""
    cos = np.array([0, 0.5, 0, 0.5, 0])
    sin = np.array([0, 0.5j, 0, -0.5j, 0])
    return np.stack([-tangential * cos - radial * sin, tangential * sin - radial * cos], axis=1)


def _exponential_integral(n: np.ndarray, start: float, end: float) -> ComplexArray:
    """Integral of e^{i n phi} from start to end for whole n."""
    half = 0.5 * (end - start)
    return 2.0 * half * np.exp(0.5j * n * (start + end)) * np.sinc(n * half / np.pi)


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
        Axial slices of the depth, for the helix.

    Returns
    -------
    array, shape (n, 3) [N]
        Force along X, Y and the spindle's axis.
    """
    angle = np.asarray(angle, dtype=float)
    total = np.zeros((angle.size, 3))
    height = (np.arange(slices) + 0.5) / slices * conditions.axial_depth
    lag = 2.0 * height * np.tan(cutter.helix) / cutter.diameter
    feed = conditions.feed_per_tooth * cutter.teeth * cutter.pitch / (2.0 * np.pi)
    entry, exit_ = same_everywhere(conditions.engagement).angles
    for j in range(cutter.teeth):
        for each in lag:
            phi = np.mod(angle + cutter.tooth_angle[j] - each, 2.0 * np.pi)
            chip = _kinematic_chip(j, np.sin(phi), feed, cutter.runout)
            cuts = (phi >= entry) & (phi < exit_) & (chip > 0.0)
            force = tooth_force(phi, chip, coefficients)
            total += np.where(cuts[:, None], force, 0.0) * conditions.axial_depth / slices
    total[:, :2] = total[:, :2] @ conditions.machine_from_feed.T
    return total


def _kinematic_chip(j: int, sine: FloatArray, feed: FloatArray, runout: FloatArray) -> FloatArray:
    """Chip of tooth j: the smallest distance to the surfaces left by the teeth ahead, over one revolution of them."""
    moved, offset = _chip_bounds(j, feed, runout)
    return np.min(moved * sine[..., None] + offset, axis=-1)


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
    orders = np.asarray(orders)
    return _over_depth(_runout_per_depth(cutter, conditions, orders, *_forms(coefficients)), cutter, conditions, orders)


def unit_lines(cutter: Cutter, conditions: CuttingConditions, orders: np.ndarray, runout: bool = False) -> ComplexArray:
    """Return the lines per unit K_tc, K_rc, K_te and K_re: the force is linear in them.

    Parameters
    ----------
    cutter : Cutter
    conditions : CuttingConditions
    orders : array of int, shape (m,)
        Multiples of the spindle frequency.
    runout : bool
        Whether teeth may cut deeper, late or not at all, as with `runout_force_lines`.

    Returns
    -------
    complex array, shape (m, 2, 4) [m^2, m^2, m, m]
    """
    orders = np.asarray(orders)
    # (5, 2) of each coefficient side by side
    none = np.zeros((5, 4), dtype=complex)
    shear, edges = (np.hstack([form(1.0, 0.0), form(0.0, 1.0)]) for form in (_sine_form, _constant_form))
    chip, offset, edge = np.hstack([shear, none]), np.hstack([edges, none]), np.hstack([none, edges])
    if runout:
        lines = _runout_per_depth(cutter, conditions, orders, chip, offset, edge)
    else:
        lines = _per_depth(cutter, conditions, orders, chip, edge)
    columns = [_over_depth(lines[:, k : k + 2], cutter, conditions, orders) for k in range(0, 8, 2)]
    return np.stack(columns, axis=-1)


def _runout_per_depth(
    cutter: Cutter, conditions: CuttingConditions, orders: np.ndarray, per_feed: ComplexArray, per_depth: ComplexArray, edge: ComplexArray
) -> ComplexArray:
    """Lines of forces per depth whose forms are columns, piece by piece of each tooth's chip, shape (m, n)."""
    feed = conditions.feed_per_tooth * cutter.pitch * cutter.teeth / (2.0 * np.pi)
    q = np.arange(-2, 3)
    lines = np.zeros((orders.size, edge.shape[1]), dtype=complex)
    for j in range(cutter.teeth):
        moved, offset = _chip_bounds(j, feed, cutter.runout)
        tooth = np.zeros_like(lines)
        for start, end, k in _chip_pieces(moved, offset, same_everywhere(conditions.engagement)):
            a, b = moved[k], offset[k]
            window = _exponential_integral(q[None, :] - orders[:, None], start, end) / (2.0 * np.pi)
            tooth += window @ (a * per_feed + b * per_depth + edge)
        lines += np.exp(1j * orders * cutter.tooth_angle[j])[:, None] * tooth
    return lines


def _chip_bounds(j: int, feed: FloatArray, runout: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Distances a sin(phi) + b of tooth j to the surfaces of the teeth ahead, over one revolution of them: a and b, shape (teeth,)."""
    ahead = (j + np.arange(feed.size)) % feed.size
    return np.cumsum(feed[ahead]), runout[j] - runout[(ahead + 1) % feed.size]


def regenerations(cutter: Cutter, feed_per_tooth: float, engagement: Engagement) -> list[tuple[int, float, float, int]]:
    """Return which surface each tooth cuts into, with run-out: (tooth, start angle [rad], end angle [rad], teeth back).

    A tooth cuts what the tooth so many teeth back left; where it is not named it cuts nothing.

    Parameters
    ----------
    cutter : Cutter
    feed_per_tooth : float [m]
    engagement : Engagement
    """
    feed = feed_per_tooth * cutter.teeth * cutter.pitch / (2.0 * np.pi)
    found = []
    for j in range(cutter.teeth):
        moved, offset = _chip_bounds(j, feed, cutter.runout)
        found += [(j, start, end, k + 1) for start, end, k in _chip_pieces(moved, offset, engagement)]
    return found


def _chip_pieces(moved: FloatArray, offset: FloatArray, engagement: Engagement) -> list[tuple[float, float, int]]:
    """Angles between which the chip is one a sin(phi) + b, with its place; only where it is positive."""
    entry, exit_ = engagement.entry, engagement.exit
    meet = [-b / a for a, b in zip(moved, offset, strict=True) if a > 0.0]
    for i in range(moved.size):
        steeper = moved[:i] != moved[i]
        meet += ((offset[:i] - offset[i])[steeper] / (moved[i] - moved[:i])[steeper]).tolist()
    angles = np.arcsin([s for s in meet if 0.0 < s < 1.0])
    angles = np.concatenate([[entry, exit_], angles, np.pi - angles])
    angles = np.unique(angles[(angles >= entry) & (angles <= exit_)])
    pieces = []
    for start, end in pairwise(angles.tolist()):
        chips = moved * np.sin(0.5 * (start + end)) + offset
        k = int(np.argmin(chips))
        if chips[k] > 0.0:
            pieces.append((start, end, k))
    return pieces
