"""What may stand behind lines that the model leaves unexplained, and what each would do to the answer.

Each cause is a set of further unknowns with a prior, linearised at the answer: how the lines would change if the stiffness drifted with
time, if the joint differed from clamping to clamping, if the forces were wrong in each order of the teeth. With J of the answer's
unknowns, H its Gauss-Newton matrix, Z of the cause's (in units of their spreads) and r the residual,

    S = 1 + Z^T Z - Z^T J H^-1 J^T Z,   w = -S^-1 Z^T r,   gain = r^T Z S^-1 Z^T r,   evidence = gain - log det S:

twice the logarithm of how much likelier the lines are with the cause than without it [mackay1992]. The answer would move by
-H^-1 J^T Z w, and its covariance grow by H^-1 J^T Z S^-1 Z^T J H^-1.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from rcsa_ident.base.arrays import FloatArray
from rcsa_ident.identification.data import LEVER, IdentificationData
from rcsa_ident.identification.further_unknowns import (
    GIVING_WAY,
    CutScales,
    Further,
    GivingWay,
    Grips,
    Warming,
    loudness,
    order_factors,
    still_felt,
    warmth,
)
from rcsa_ident.identification.levenberg_marquardt import Solution
from rcsa_ident.identification.linearisation import Linearisation, Residual
from rcsa_ident.identification.misfit import Misfit
from rcsa_ident.identification.unknowns import JOINT

#: Steps of a polish with further unknowns, and how often the noise is learned anew.
_STEPS, _NOISES = 60, 3
#: Evidence above which a cause is believed.
BELIEVED = 25.0
#: Odds that a cause acts before anything was measured.
ODDS = 0.1
#: Time constants of the warmth that is asked for [s], and whether the spindle turned before.
_COURSES = tuple(itertools.product((450.0, 900.0, 1800.0), (False, True)))
#: Spreads: of a natural frequency from the first to the last cut and over the speeds, of a cut's scale, of the force in an order of the
#: teeth, of a clamping's joint stiffness; and of where the flange's sensor looks [m].
_DRIFT, _SCALE, _ORDER, _CLAMPING, _DISTANCE = 0.015, 0.03, 0.05, 0.06, 20e-3


class Cause(StrEnum):
    """What the lines may contradict the model for."""

    TIME = "time"
    TEMPERATURE = "temperature"
    SPEED = "speed"
    ORDER = "order"
    SCALE = "scale"
    CLAMPING = "clamping"
    AMPLITUDE = "amplitude"
    DISTANCE = "distance"


@dataclass(frozen=True, slots=True)
class Explanation:
    """How well a cause explains what is left.

    `evidence` [-]: twice the logarithm of the odds against no cause
    `share` [-]: of the squares of all residuals that it takes away
    `way`: the likeliest of the ways in which it may act
    """

    cause: Cause
    evidence: float
    share: float
    way: int = 0


@dataclass(frozen=True, slots=True, eq=False)
class Causes:
    """All causes that were asked, and what they would do to the answer together.

    `found`: the likeliest first
    `covariance`, shape (p, p): of the answer's unknowns if any of them may act, about where the answer is
    `without` [-]: probability that none of them acts
    """

    found: tuple[Explanation, ...]
    covariance: FloatArray
    without: float

    @property
    def believed(self) -> tuple[Explanation, ...]:
        """Those that the lines speak for."""
        return tuple(each for each in self.found if each.evidence > BELIEVED)

    def mixed(self, covariance: FloatArray) -> FloatArray:
        """Return the covariance of an answer that holds without any of them, and the wider one in so far as they act, shape (p, p)."""
        found: FloatArray = self.without * covariance + (1.0 - self.without) * self.covariance
        return 0.5 * (found + found.T)


def causes(solution: Solution, misfit: Misfit, wider: float = 1.0) -> Causes:
    """Return what may stand behind the residuals of an answer.

    `solution`: with its equations
    `misfit`: whose minimum it is
    `wider`: factor on all standard deviations
    """
    linear, residual = solution.evaluation.linear, solution.evaluation.residual
    assert linear is not None
    inverse = np.linalg.inv(linear.hessian)
    squares = sum(residual.chi2)
    found, columns = [], []
    # a hammer's lines have neither orders nor speeds, and hits are not cuts that follow each other
    for cause, ways in ({} if misfit.data.tests else _columns(solution, misfit)).items():
        asked = []
        for rows in ways:
            gradient, information, _ = _bordered(linear, residual, inverse, rows)
            gain = float(gradient @ np.linalg.solve(information, gradient))
            asked.append((gain - float(np.linalg.slogdet(information)[1]), gain))
        best = max(range(len(ways)), key=lambda k: asked[k][0])
        # the likeliest of several ways, any of which might have been it
        likelihood = asked[best][0] - 2.0 * float(np.log(len(ways)))
        found.append(Explanation(cause, likelihood, asked[best][1] / max(squares, 1e-300), best))
        columns.append(ways[best])
    if not found:
        return Causes((), wider**2 * inverse, 1.0)
    found.sort(key=lambda each: -each.evidence)
    together = [np.hstack([rows[i] for rows in columns]) for i in range(len(misfit.data.axes))]
    gradient, information, across = _bordered(linear, residual, inverse, together)
    moved = across @ np.linalg.solve(information, gradient)
    covariance = wider**2 * (inverse + across @ np.linalg.solve(information, across.T) + np.outer(moved, moved))
    rare = 2.0 * np.log(ODDS)
    # where sensors look that nobody has measured is as likely beside the flange as at it
    priors = [0.0 if each.cause is Cause.DISTANCE and not misfit.data.distance_told else rare for each in found]
    odds = np.exp(0.5 * np.clip([0.0, *(each.evidence + prior for each, prior in zip(found, priors, strict=True))], -100.0, 100.0))
    return Causes(tuple(found), covariance, float(odds[0] / odds.sum()))


def further_unknowns(found: Explanation, data: IdentificationData) -> Further | None:
    """Return what makes a cause a part of the model; None where nothing does, or where it is in the data already."""
    more: Further
    ids = data.cut_ids[: data.cuts]
    match found.cause:
        case Cause.ORDER:
            more = order_factors(data)
        case Cause.SCALE:
            more = CutScales(ids)
        case Cause.CLAMPING:
            more = Grips(data.toolings)
        case Cause.AMPLITUDE:
            more = GivingWay()
        case Cause.TEMPERATURE:
            if not _followed(data):
                return None
            more = Warming(ids, None)
        case Cause.TIME:
            # the first way is an even course, and a thermometer shows any better
            constant, warmed_up = _COURSES[found.way - 1] if found.way else (900.0, False)
            more = Warming(ids, None) if _followed(data) else Warming(ids, constant, warmed_up=warmed_up)
        case _:
            return None
    return None if any(isinstance(each, type(more)) for each in data.further) else more


def _bordered(
    linear: Linearisation, residual: Residual, inverse: FloatArray, rows: Sequence[FloatArray]
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Gradient and information of further unknowns of unit spread, those of the answer eliminated, and H^-1 J^T Z."""
    count = rows[0].shape[1]
    gradient, own, mixed = linear.border(dict(enumerate(rows)), count, residual)
    across = inverse @ mixed
    # along a ridge the polish ends early: what the answer's own unknowns would still gain is no cause's
    gradient = gradient - across.T @ linear.gradient
    return gradient, own[0] + np.eye(count) - mixed.T @ across, across


def _columns(solution: Solution, misfit: Misfit) -> dict[Cause, list[list[FloatArray]]]:
    """Change of the whitened lines of each axis with the unknowns of each way in which a cause may act, shape (2 n, q) [deviations]."""
    data, layout, linear = misfit.data, solution.layout, solution.evaluation.linear
    assert linear is not None
    axes, toolings = range(len(data.axes)), range(len(data.toolings))
    cut = [np.tile(own, 2) for own in linear.cut]
    tooling = [data.cut_tooling[own] for own in cut]
    order = [np.tile(np.repeat(np.rint(axis.order).astype(np.intp), axis.outputs), 2) for axis in data.axes]
    model = [_model(solution, misfit, i) for i in axes]
    # behind an axis' own unknowns stand the joint's, then the coefficients
    behind = [layout.axis(i).stop - layout.axis(i).start for i in axes]
    stiffness = [linear.jacobians[i][behind[i] : behind[i] + JOINT // 2].T for i in axes]
    frequencies = [linear.jacobians[i][: layout.modes_of_axes[min(i, len(layout.modes_of_axes) - 1)]].T for i in axes]
    # planes that feel nothing of each other have modes of their own
    apart = len(layout.modes_of_axes) > 1

    def drift(course: FloatArray) -> list[FloatArray]:
        moved = [_DRIFT * course[cut[i]][:, None] * frequencies[i] for i in axes]
        return _side_by_side(moved) if apart else moved

    def by_key(keys: Sequence[Sequence[tuple[int, ...]]], values: Sequence[tuple[FloatArray, ...]]) -> list[FloatArray]:
        """One unknown, or a complex one, for each key of the lines."""
        known = {key: k for k, key in enumerate(sorted({key for own in keys for key in own}))}
        found = []
        for own, parts in zip(keys, values, strict=True):
            columns = np.zeros((len(own), len(parts), len(known)))
            at = np.array([known[key] for key in own])
            for k, part in enumerate(parts):
                columns[np.arange(at.size), k, at] = part
            found.append(columns.reshape(len(own), -1))
        return found

    # for all toolings alike, or for each its own
    orders = [[[(i, t * each, m) for t, m in zip(tooling[i].tolist(), order[i].tolist(), strict=True)] for i in axes] for each in (0, 1)]
    cuts = [[(k,) for k in own.tolist()] for own in cut]
    found = {
        Cause.TIME: [_beside(*(drift(course) for course in way)) for way in _courses(data)],
        # the model follows a straight line, as well as its prior lets it
        Cause.SPEED: [drift(misfit.relative_speed), drift(1.5 * misfit.relative_speed**2 - 0.5)],
        Cause.ORDER: [by_key(keys, [(_ORDER * real, _ORDER * turned) for real, turned in model]) for keys in orders],
        Cause.SCALE: [by_key(cuts, [(_SCALE * real,) for real, _ in model])],
        Cause.CLAMPING: [[np.hstack([_CLAMPING * stiffness[i] * (tooling[i] == t)[:, None] for t in toolings]) for i in axes]],
    }
    loud = loudness(data)
    found[Cause.AMPLITUDE] = [[GIVING_WAY * (stiffness[i].sum(axis=1) * loud[cut[i]])[:, None] for i in axes]]
    if _followed(data):
        found[Cause.TEMPERATURE] = [drift(_spread_out(data.made.temperature))]
    places = [misfit.distance_place(i, layout) for i in axes]
    if None not in places:
        steps = [_DISTANCE / LEVER * linear.jacobians[i][[behind[i] + JOINT + (places[i] or 0)]].T for i in axes]
        found[Cause.DISTANCE] = [_side_by_side(steps)]
    asked = {cause: [rows for rows in ways if any(np.any(each) for each in rows)] for cause, ways in found.items()}
    return {cause: ways for cause, ways in asked.items() if ways}


def _courses(data: IdentificationData) -> list[list[FloatArray]]:
    """Ways in which the machine may change with time: evenly, and as heat of friction that it takes up; courses of shape (k,) for each.

    Of a machine that had turned before, what it had taken up is a course of its own. Of one whose temperature is known that heat is none.
    """
    ways = [[data.made.started]]
    for constant, warmed_up in () if _followed(data) else _COURSES:
        before = still_felt(data, constant).T if warmed_up else ()
        ways.append([warmth(data, constant, warmed_up=warmed_up), *before])
    return [[_spread_out(course) for course in way] for way in ways]


def _followed(data: IdentificationData) -> bool:
    """Whether a thermometer shows how warm the machine was at each cut."""
    return not np.any(np.isnan(data.made.temperature)) and bool(np.ptp(data.made.temperature) > 0.0)


def _spread_out(course: FloatArray) -> FloatArray:
    """The course over all cuts, from -1 to 1."""
    low, high = float(course.min(initial=np.inf)), float(course.max(initial=-np.inf))
    if not high > low:
        return np.zeros(course.size)
    return 2.0 * (course - low) / (high - low) - 1.0


def _beside(*ways: Sequence[FloatArray]) -> list[FloatArray]:
    """Columns of several ways on each axis."""
    return [np.hstack(rows) for rows in zip(*ways, strict=True)]


def _side_by_side(own: Sequence[FloatArray]) -> list[FloatArray]:
    """Columns of each axis, zeros where they belong to another one."""
    return [
        np.hstack([each if i == k else np.zeros((own[i].shape[0], each.shape[1])) for k, each in enumerate(own)]) for i in range(len(own))
    ]


def _model(solution: Solution, misfit: Misfit, i: int) -> tuple[FloatArray, FloatArray]:
    """The model's lines of an axis and a quarter turn of them, whitened, shape (2 n,) each."""
    lines = solution.evaluation.models[i].ravel() * misfit.root_weight(i)
    return np.concatenate([lines.real, lines.imag]), np.concatenate([-lines.imag, lines.real])
