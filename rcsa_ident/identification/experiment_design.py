"""What cuts that were not made yet would tell, and those that tell most: optimal experiment design [fedorov1972].

Unknowns are whitened: z = S^-1 (theta - theta_0) with S S^T the posterior's covariance, so that C = 1 before any further cut. A
cut whose lines change by J z, in standard deviations and with its own delay taken out (J = J' - c c^T J' / c^T c, the Schur
complement of one unknown), leaves C' = C - C J^T (1 + J C J^T)^-1 J C. What is wanted changes by W^T z: its variance is
trace(W^T C W).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
import scipy.linalg

from rcsa_ident.base.arrays import ComplexArray, FloatArray
from rcsa_ident.base.errors import InputError, positive
from rcsa_ident.dynamics.coordinates import Dof
from rcsa_ident.dynamics.receptance import Receptance
from rcsa_ident.identification._kernels.frf import cross_frf, cross_frf_gradient
from rcsa_ident.identification.data import LEVER, AxisData, IdentificationData
from rcsa_ident.identification.modal_parameters import residual_turn
from rcsa_ident.identification.posterior import Posterior
from rcsa_ident.identification.unknowns import JOINT, ModalBlock, chain, lower_triangle, scaled_joint, unpack
from rcsa_ident.signals.frf import AxisLines
from rcsa_ident.signals.measurement import MAX_FREQUENCY, WEAKEST_FORCE, CutMeasurement

#: Share of a line that the force model leaves unexplained at best.
LEAST_MODEL_ERROR = 5e-4
#: Information of a cut about a direction of unit variance that is left aside.
LEAST_INFORMATION = 1e-4
#: Share of the largest variance below which a direction of what is wanted is left aside.
NEGLIGIBLE = 1e-8


class Goal(Protocol):
    """What a further cut should serve."""

    def gain(self, inner: FloatArray, wanted: FloatArray) -> FloatArray:
        """Return what each candidate is worth, shape (k,), from 1 + J C J^T (k, r, r) and J C W (k, r, t)."""
        ...


@dataclass(frozen=True, slots=True)
class MeanVariance:
    """Lowest mean variance of what is wanted (V-optimal)."""

    def gain(self, inner: FloatArray, wanted: FloatArray) -> FloatArray:
        """Return by how much trace(W^T C W) falls."""
        return np.sum(wanted * np.linalg.solve(inner, wanted), axis=(1, 2))


@dataclass(frozen=True, slots=True)
class Volume:
    """Smallest volume of the unknowns' posterior (D-optimal): most information [nat, twice], whatever it is about."""

    def gain(self, inner: FloatArray, wanted: FloatArray) -> FloatArray:
        """Return by how much log det C falls."""
        return np.asarray(np.linalg.slogdet(inner)[1])


@dataclass(frozen=True, slots=True, eq=False)
class CandidateCuts:
    """Candidate cuts, and what is wanted of them.

    `rows`: tuple of k arrays, shape (r, d) each; J of each candidate, each with as many rows as it needs
    `targets`: tuple of arrays, shape (d, t) each; W of everything that is wanted, scaled so that trace(W^T C W) is a relative variance
    `floor`: relative variance of each target that no cut can lower
    `apart`: array of bool, shape (k, k); True for two candidates that may not both be cut; the diagonal is True
    """

    rows: tuple[FloatArray, ...]
    targets: tuple[FloatArray, ...]
    floor: tuple[float, ...]
    apart: np.ndarray

    def covariance(self, chosen: Sequence[int]) -> FloatArray:
        """Return C after some cuts, shape (d, d)."""
        information = np.eye(self.targets[0].shape[0])
        for k in chosen:
            information += self.rows[k].T @ self.rows[k]
        factor = scipy.linalg.cho_factor(information, check_finite=False)
        return np.asarray(scipy.linalg.cho_solve(factor, np.eye(information.shape[0]), check_finite=False))

    def deviation(self, covariance: FloatArray) -> FloatArray:
        """Return the relative standard deviation of each target, shape (targets,)."""
        pairs = zip(self.targets, self.floor, strict=True)
        return np.sqrt([max(float(np.sum((covariance @ w) * w)), 0.0) + floor for w, floor in pairs])


@dataclass(slots=True, eq=False)
class _State:
    """All candidates after some cuts: rows J (R, d) one after another, J C, J C U where U U^T = sum of W W^T (d, u)."""

    rows: FloatArray
    start: np.ndarray
    wanted: FloatArray
    carried: FloatArray
    seen: FloatArray

    @classmethod
    def of(cls, prospects: CandidateCuts) -> _State:
        rows = np.concatenate(prospects.rows)
        start = np.cumsum([0, *(len(r) for r in prospects.rows)])
        total = np.concatenate(prospects.targets, axis=1)
        values, vectors = np.linalg.eigh(total @ total.T)
        kept = values > NEGLIGIBLE * max(float(values[-1]), 1e-300)
        wanted = vectors[:, kept] * np.sqrt(values[kept])
        return cls(rows, start, wanted, rows.copy(), rows @ wanted)

    def restart(self, covariance: FloatArray) -> None:
        """Take another covariance for that of the cuts so far."""
        np.matmul(self.rows, covariance, out=self.carried)
        np.matmul(self.rows, covariance @ self.wanted, out=self.seen)

    def add(self, cut: int) -> None:
        """Follow a cut: C' = C - step^T step."""
        own = slice(self.start[cut], self.start[cut + 1])
        inner = np.eye(own.stop - own.start) + self.carried[own] @ self.rows[own].T
        step = scipy.linalg.solve_triangular(np.linalg.cholesky(inner), self.carried[own], lower=True, check_finite=False)
        share = self.rows @ step.T
        self.carried -= share @ step
        self.seen -= share @ (step @ self.wanted)

    def worth(self, goal: Goal, free: np.ndarray) -> FloatArray:
        """Return what each free candidate is worth next, -inf for the others, shape (k,)."""
        size = np.diff(self.start)
        worth = np.where(free, 0.0, -np.inf)
        # those with as many rows are one batch
        for r in np.unique(size[free & (size > 0)]):
            alike = np.flatnonzero(free & (size == r))
            place = self.start[alike][:, None] + np.arange(r)
            inner = np.eye(r) + self.carried[place] @ self.rows[place].transpose(0, 2, 1)
            worth[alike] = goal.gain(inner, self.seen[place])
        return worth


def greedy(prospects: CandidateCuts, count: int, goal: Goal, among: Sequence[int] | None = None) -> list[int]:
    """Return candidates in the order in which each next one is worth most; fewer where no other may be cut.

    Each cut is a rank-r update of J C for all candidates: about 4 R r d flops, R rows in all.

    `among`: candidates to choose from; by default all
    """
    state = _State.of(prospects)
    free = np.ones(len(prospects.rows), dtype=bool) if among is None else np.isin(np.arange(len(prospects.rows)), among)
    chosen: list[int] = []
    while len(chosen) < count and free.any():
        chosen.append(int(np.argmax(state.worth(goal, free))))
        free &= ~prospects.apart[chosen[-1]]
        state.add(chosen[-1])
    return chosen


def exchanged(prospects: CandidateCuts, chosen: Sequence[int], goal: Goal, passes: int = 1) -> list[int]:
    """Return the cuts after each in turn was put back against all others (Fedorov's exchange, [fedorov1972]), in greedy order.

    `chosen`: the cuts to start from
    `passes`: rounds at most; the first without a change is the last
    """
    state = _State.of(prospects)
    cuts = list(chosen)
    for _ in range(passes):
        before = cuts.copy()
        for place, old in enumerate(before):
            others = cuts[:place] + cuts[place + 1 :]
            free = ~np.any(prospects.apart[others], axis=0)
            state.restart(prospects.covariance(others))
            worth = state.worth(goal, free)
            best = int(np.argmax(worth))
            # a gain below rounding is none
            cuts[place] = best if worth[best] > worth[old] * (1.0 + 1e-9) else old
        if cuts == before:
            break
    return greedy(prospects, len(cuts), goal, cuts)


def d_optimal(information: Sequence[FloatArray], count: int, prior: FloatArray, passes: int = 20) -> list[int]:
    """Return the candidates, cuts or whatever tells something, after which the unknowns' posterior has the smallest volume.

    Greedy choice, then exchange, of det(prior + sum of the chosen information); the most telling first, none twice.

    `information`: sequence of k arrays, shape (p, p); what each candidate tells, S^T Sigma^-1 S with S the slopes of its readings with the
        unknowns and Sigma their covariance
    `prior`, shape (p, p): what is known before, positive definite
    `passes`: rounds of exchange at most

    Examples
    --------
    Two candidates that tell one unknown, one that tells the other:

    >>> one, other = np.diag([4.0, 0.0]), np.diag([0.0, 1.0])
    >>> d_optimal([one, 0.9 * one, other], 2, np.eye(2))
    [0, 2]
    """
    factor = np.linalg.cholesky(prior)
    rows = []
    for each in information:
        half = scipy.linalg.solve_triangular(factor, each, lower=True, check_finite=False)
        values, vectors = np.linalg.eigh(scipy.linalg.solve_triangular(factor, half.T, lower=True, check_finite=False))
        kept = values > LEAST_INFORMATION
        rows.append((vectors[:, kept] * np.sqrt(values[kept])).T)
    prospects = CandidateCuts(tuple(rows), (np.eye(len(prior)),), (0.0,), np.eye(len(rows), dtype=bool))
    return exchanged(prospects, greedy(prospects, count, Volume()), Volume(), passes)


def deviations(prospects: CandidateCuts, order: Sequence[int]) -> FloatArray:
    """Return the relative standard deviation of each target before and after each of some cuts, shape (n + 1, targets)."""
    return np.array([prospects.deviation(prospects.covariance(order[:n])) for n in range(len(order) + 1)])


def expected_cut(
    cut_id: str, tooling: str, spindle_speed: float, teeth: int, force: ComplexArray, slope: ComplexArray, noise: float, axes: Sequence[Dof]
) -> CutMeasurement:
    """Return what a cut would measure, with empty lines of the variance that they would have.

    `spindle_speed` [rad/s]
    `force`, `slope`: complex arrays, shapes (m, 2) [N] and (m, 2, 5) [-]; as `cutting.force.force_and_slope` gives them, at the
        tooth-passing harmonics from the first on: they do not depend on the speed, which only decides how many of them lie in the band
    `noise` [m]: standard deviation of a displacement line's real and imaginary part each; it falls with the root of a record's length
    `axes`: those that would be measured: X, Y or both
    """
    positive("noise", noise, "m")
    order = harmonics(teeth, spindle_speed)
    if order.size > force.shape[0]:
        raise InputError("force lines", force.shape[0], f"the {order.size} harmonics that lie in the band")
    force, slope = force[: order.size], slope[: order.size]
    size = np.abs(force)
    lines = {}
    for axis in axes:
        i = 0 if axis is Dof.X else 1
        kept = size[:, i] > WEAKEST_FORCE * np.max(size, initial=0.0)
        if kept.any():
            still = np.zeros((int(kept.sum()), 1), dtype=complex)
            variance = (noise / size[kept, i][:, None]) ** 2
            own = order[kept]
            both = force[kept, i], slope[kept, i], force[kept, 1 - i], slope[kept, 1 - i]
            lines[axis] = AxisLines(own, own * spindle_speed, still, still, variance, np.ones(own.size), *both)
    return CutMeasurement(cut_id, tooling, spindle_speed, lines, 0.0)


def harmonics(teeth: int, spindle_speed: float) -> np.ndarray:
    """Return the orders of the tooth-passing lines that are used at a spindle speed."""
    return np.arange(teeth, int(2.0 * np.pi * MAX_FREQUENCY / spindle_speed) + 1, teeth)


def information(data: IdentificationData, posteriors: Mapping[Dof, Posterior], model_error: Mapping[Dof, float]) -> tuple[FloatArray, ...]:
    """Return J of each cut, its own delay taken out, shape (r, d) each.

    Unknowns: of each axis its posterior's directions and rivals (each axis with the joint as it knows it), then the uncertain
    coefficients of the forces, which all cuts share.

    `data`: cuts from `expected_cut`; what their lines hold does not matter
    `model_error`: share of each line that neither model nor noise explains; at least `LEAST_MODEL_ERROR`
    """
    cuts = len(data.cut_ids)
    sizes = [unknowns(posteriors[a.axis]) for a in data.axes]
    tail = sum(sizes)
    size = tail + len(data.coefficient_spread)
    parts: list[list[FloatArray]] = [[] for _ in range(cuts)]
    for i, axis in enumerate(data.axes):
        values, change = _lines(axis, data.spindle_speed[axis.cut], posteriors[axis.axis])
        share = max(model_error[axis.axis], LEAST_MODEL_ERROR)
        columns = np.zeros((values.size, size + 1), dtype=complex)
        first = sum(sizes[:i])
        columns[:, first : first + sizes[i]] = change
        columns[:, tail:size] = values[:, None] * axis.force_slope * np.asarray(data.coefficient_spread)
        columns[:, size] = 1j * axis.omega * values
        columns /= np.sqrt(axis.noise + 0.5 * share**2 * np.abs(values) ** 2)[:, None]
        edges = np.searchsorted(axis.cut, np.arange(cuts + 1))
        for k in range(cuts):
            own = columns[edges[k] : edges[k + 1]]
            parts[k] += [own.real, own.imag]
    return tuple(without_delay(np.concatenate(each)) if each else np.zeros((0, size)) for each in parts)


def without_delay(rows: FloatArray) -> FloatArray:
    """Return rows (r, d + 1) without their last column and what runs along it: the Schur complement of one unknown, (r, d)."""
    delay = rows[:, -1]
    length = float(delay @ delay)
    return rows[:, :-1] - np.outer(delay, delay @ rows[:, :-1]) / length if length > 0.0 else rows[:, :-1]


def compressed(rows: FloatArray, least: float = LEAST_INFORMATION) -> FloatArray:
    """Return as few rows as tell the same: J^T J stays but for what is below `least`."""
    values, vectors = np.linalg.eigh(rows @ rows.T)
    return vectors[:, values > least].T @ rows


def unknowns(posterior: Posterior) -> int:
    """Return how many whitened unknowns an axis has: its directions and its rivals."""
    return posterior.theta.size + len(posterior.rivals)


def tip_changes(posterior: Posterior, holder: Receptance) -> tuple[ComplexArray, ComplexArray]:
    """Return a tooltip FRF at the middle speed, shape (n,) [m/N], and its change with the axis' whitened unknowns, shape (n, unknowns).

    `holder`: tool-holder, free, in one bending plane: points ``tip`` and ``flange``
    """
    values, slopes = _tip(posterior.theta, posterior.layout, holder)
    rivals = [_tip(r, posterior.layout_of(r.size - JOINT), holder)[0] - values for r in posterior.rivals]
    return values, np.column_stack([slopes @ _directions(posterior), *rivals])


def _directions(posterior: Posterior) -> FloatArray:
    """S with S S^T the covariance, shape (p, p)."""
    values, vectors = np.linalg.eigh(posterior.covariance)
    return vectors * np.sqrt(np.maximum(values, 0.0))


def _lines(axis: AxisData, spindle_speed: FloatArray, posterior: Posterior) -> tuple[ComplexArray, ComplexArray]:
    """Cross FRF on an axis' lines, shape (n,), and its change with the axis' whitened unknowns, shape (n, unknowns)."""
    middle, half = posterior.speed_range
    # as `Posterior.machine`: outside the campaign's speeds the nearest of them answers
    x = np.clip((spindle_speed - middle) / half, -1.0, 1.0) if half > 0.0 else np.zeros(spindle_speed.size)
    points, holder = axis.kernel_points, axis.kernel_holder
    if posterior.layout.softening:
        points = np.column_stack([points, x])
    values, slopes = _cross(posterior.theta, posterior.layout, points, holder, True)
    rivals = [_cross(r, posterior.layout_of(r.size - JOINT), points, holder, False)[0] - values for r in posterior.rivals]
    return values, np.column_stack([slopes @ _directions(posterior), *rivals])


def _cross(
    theta: FloatArray, layout: ModalBlock, points: FloatArray, holder: ComplexArray, slopes: bool
) -> tuple[ComplexArray, ComplexArray]:
    """Cross FRF of an axis and a joint, shape (n,), and its change with the vector where asked for, shape (n, p)."""
    if layout.places:
        raise InputError("layout", "a layout with other places' motion", "one of the flange's motion alone, as a posterior has")
    axis, joint = unpack(theta[:-JOINT], layout), scaled_joint(theta[-JOINT:])
    n, one = points.shape[0], np.ones((1, 1))
    here = np.zeros(2)
    values, kept, _ = cross_frf(axis.omega_n, axis.shapes, axis.factor, axis.changes, joint, (one, here), points, holder)
    rows = np.empty((theta.size, 2 * n if slopes else 0))
    if slopes:
        # the kernel's joint is in units of itself, its logarithm is the unknown
        scale, weight = np.concatenate([chain(axis, layout), joint]), np.ones((n, 1), dtype=complex)
        cross_frf_gradient(axis.omega_n, axis.factor, axis.changes, joint, (one, here), points, kept, weight, scale, rows)
    columns, core = (rows[:, : rows.shape[1] // 2] + 1j * rows[:, rows.shape[1] // 2 :]).T, layout.core
    columns[:, core - 3 : core] = columns[:, core - 3 : core] @ residual_turn(axis.residual)
    return values[:, 0], columns


def _tip(theta: FloatArray, layout: ModalBlock, holder: Receptance) -> tuple[ComplexArray, ComplexArray]:
    """C11 = A11 - a^T x with x = E^-1 a, and dC11 = x^T dE x, E = A22 + B + K^-1; shapes (n,), (n, p)."""
    axis, joint = unpack(theta[:-JOINT], layout), scaled_joint(theta[-JOINT:])
    omega, lever = holder.omega, np.array([1.0, LEVER])
    a21 = holder["flange", "tip"][:, :, 0] * lever
    dynamic = 1j * omega[:, None, None] * (axis.factor @ axis.factor.T)
    place = np.arange(axis.order)
    dynamic[:, place, place] += axis.omega_n**2 - omega[:, None] ** 2
    u = np.linalg.solve(dynamic, np.broadcast_to(axis.psi.astype(complex), (omega.size, *axis.psi.shape)))
    compliance = 1.0 / (joint[:2] + 1j * omega[:, None] * joint[2:])
    total = holder["flange", "flange"] * np.outer(lever, lever) + axis.psi.T @ u + axis.residual @ axis.residual.T
    total[:, [0, 1], [0, 1]] += compliance
    x = np.linalg.solve(total, a21[:, :, None])[:, :, 0]
    values = holder["tip", "tip"][:, 0, 0] - np.sum(a21 * x, axis=1)
    q = (u @ x[:, :, None])[:, :, 0]
    rows, cols, _ = lower_triangle(axis.order)
    opened = -((x * compliance) ** 2)
    parts = [
        -2.0 * (axis.omega_n * q) ** 2,
        (2.0 * q[:, :, None] * x[:, None, :]).reshape(omega.size, -1),
        -2j * omega[:, None] * q[:, rows] * (q @ axis.factor)[:, cols],
        np.stack([x[:, 0] ** 2, 2.0 * x[:, 0] * x[:, 1], x[:, 1] ** 2], axis=1) @ residual_turn(axis.residual),
        # at the middle speed the softening does nothing
        np.zeros((omega.size, layout.pairs * layout.softening)),
        opened,
        1j * omega[:, None] * opened,
    ]
    return values, np.hstack(parts) * np.concatenate([chain(axis, layout), joint])
