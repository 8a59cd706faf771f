"""Labels without physics: a smooth function of a cut's conditions, by which probabilities of cuts are told that were never made."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy.linalg
from scipy.special import ndtr

from rcsa_ident.base.arrays import FloatArray, frozen
from rcsa_ident.base.errors import InputError
from rcsa_ident.cutting.process import MillingProcess
from rcsa_ident.stability.labels.adaptive_importance import adaptive_importance, systematic
from rcsa_ident.stability.labels.cut_margins import points_of
from rcsa_ident.stability.labels.tested_cuts import TestedCuts

#: Medians of what the process does not know of itself, and the standard deviation of their logarithms. They were written down after some
#: twenty prototypes had been scored on the 187 cuts of docs/labelled_cuts_votes.md, and are no blind choice. Standard deviations of the
#: mean, of each direction's own, of what speed, depth, width and feed do each by itself; slopes as a share of these; what they do
#: together; lengths of the logarithms of the four; how far directions and edges differ; one cut beside its repeat, and one session beside
#: another.
_MEDIANS = np.array([1.0, 1.5, 1.5, 1.0, 1.0, 0.15, 1.0, 0.5, 0.4, 0.5, 0.5, 3.0, 2.0, 0.3, 0.3])
_SPREAD = 0.5
#: Draws of these: of the first round, of each further one, and how many are kept.
_FIRST, _FURTHER, _ROUNDS, _KEPT = 120, 60, 2, 12
#: Loudness, in standard deviations of the doubt of one verdict, between which a cut is called marginal; share of slips.
_BETWEEN, _SLIPS = 0.45, 0.02
#: Logarithms and counts beyond it are of no cut that anybody made.
_LARGEST = 1e3
_NUGGET, _LEAST_WEIGHT, _ROUNDS_OF_NEWTON = 1e-8, 1e-6, 50


@dataclass(frozen=True, slots=True, eq=False)
class CutFeatures:
    """What a cut's loudness may hang on.

    `numbers`, shape (n, 4): logarithms of speed, depth, radial immersion and feed per tooth, each less a middle
    `kinds`, shape (n, 2): 1 for up milling, 1 for worn edges
    `session`, shape (n,): number of its session, -1 where none is told
    """

    numbers: FloatArray
    kinds: FloatArray
    session: FloatArray

    @classmethod
    def of(cls, cuts: TestedCuts, process: MillingProcess, middle: FloatArray, sessions: tuple[str, ...]) -> CutFeatures:
        """Return the features of cuts.

        `process`: of what a cut does not tell of itself
        `middle`, shape (4,)
        `sessions`: names that have a number
        """
        points = points_of(cuts, process)
        feed = np.array([own.feed_per_tooth or process.feed_per_tooth or np.nan for own in cuts.own])
        numbers = np.log(np.column_stack([points[:, 0], cuts.axial_depth, points[:, 1], feed])) - middle
        # a feed that nobody tells is taken for the middle one
        numbers[:, 3] = np.where(np.isnan(numbers[:, 3]), 0.0, numbers[:, 3])
        worn = [float(own.edge_state == "worn") for own in cuts.own]
        session = np.array([sessions.index(own.session) if own.session in sessions else -1.0 for own in cuts.own])
        return cls(numbers, np.column_stack([points[:, 2], worn]), session)


@dataclass(frozen=True, eq=False)
class LabelProcess:
    """A Gaussian process of mean 0 whose value says how loud a cut is: verdicts are readings of it on an ordinal scale.

    A cut is called stable below -0.45, chatter above 0.45, with a normal doubt of deviation 1 in each verdict [chu2005].

    `features`: of the labelled cuts, n of them, less `middle`, shape (4,)
    `sessions`: names of the sessions
    `counts`, shape (n, 3): how many verdicts call each stable, marginal and chatter
    `drawn`, shape (r, 15): logarithms of what it does not know of itself, each draw as probable as the other
    `log_evidence`: logarithm of the probability of all verdicts before they were seen
    """

    features: CutFeatures
    middle: FloatArray
    sessions: tuple[str, ...]
    counts: FloatArray
    drawn: FloatArray
    log_evidence: float

    def __post_init__(self) -> None:
        for name in ("middle", "counts", "drawn"):
            object.__setattr__(self, name, frozen(getattr(self, name)))
        n, f = len(self.features.numbers), self.features
        shapes = {
            "numbers": (f.numbers, (n, 4)),
            "kinds": (f.kinds, (n, 2)),
            "session": (f.session, (n,)),
            "counts": (self.counts, (n, 3)),
            "draws": (self.drawn, (len(self.drawn), _MEDIANS.size)),
        }
        for name, (values, shape) in shapes.items():
            if values.shape != shape or not np.all(np.abs(values) <= _LARGEST) or (name == "counts" and np.any(values < 0.0)):
                raise InputError(name, values.shape, f"shape {shape}, numbers up to {_LARGEST:g}, and no count below 0")

    @classmethod
    def learnt(cls, cuts: TestedCuts, process: MillingProcess, rng: np.random.Generator) -> LabelProcess:
        """Return the process that verdicts teach, its deviations and lengths by importance sampling of their evidence.

        `process`: of what a cut does not tell of itself
        """
        sessions = tuple(dict.fromkeys(own.session for own in cuts.own if own.session))
        middle = CutFeatures.of(cuts, process, np.zeros(4), sessions).numbers.mean(axis=0)
        features, counts = CutFeatures.of(cuts, process, middle, sessions), cuts.counts

        def evidence(z: FloatArray) -> FloatArray:
            return np.array([_laplace(among(each, features), counts)[0] for each in _told(z)])

        first = rng.standard_normal((_FIRST, _MEDIANS.size))
        found = adaptive_importance(evidence, first, rng, _FURTHER, _ROUNDS)
        return cls(features, middle, sessions, counts, _told(found.z[systematic(found.weight, _KEPT, rng)]), found.log_evidence)

    @cached_property
    def _fits(self) -> list[tuple[FloatArray, FloatArray, FloatArray]]:
        """(gradient, root of the weights, root of B) of each draw, as of `_laplace`."""
        return [_laplace(among(each, self.features), self.counts)[1:] for each in self.drawn]

    def features_of(self, cuts: TestedCuts, process: MillingProcess) -> CutFeatures:
        """Return the features of further cuts."""
        return CutFeatures.of(cuts, process, self.middle, self.sessions)

    def told(self, at: CutFeatures) -> tuple[FloatArray, FloatArray]:
        """Return the probability that each cut is called stable, and how near it is to a label, shapes (n,).

        A label on a cut of the same numbers is at 1, one that is a length of the process away, whatever its direction, at e^-1/2.
        """
        stable, near = np.zeros((2, len(at.numbers)))
        for each, (gradient, root, chol) in zip(self.drawn, self._fits, strict=True):
            across, own = covariance(each, at, self.features), variance(each, at)
            taken = scipy.linalg.solve_triangular(chol, root[:, None] * across.T, lower=True)
            variances = np.maximum(own - np.sum(taken**2, axis=0), 0.0)
            stable += ndtr(-across @ gradient / np.sqrt(1.0 + variances))
            near += np.max(_near(each, at, self.features), axis=1)
        count = len(self.drawn)
        return _SLIPS + (1.0 - 2.0 * _SLIPS) * stable / count, near / count


def _told(z: FloatArray) -> FloatArray:
    found: FloatArray = np.log(_MEDIANS) + _SPREAD * z
    return found


def covariance(drawn: FloatArray, one: CutFeatures, other: CutFeatures) -> FloatArray:
    """Return the covariances of the loudness of different cuts, shape (n, m): a cut and its repeat share all but each one's own."""
    values = np.exp(drawn)
    mean, direction, slope, together, kind, session = (values[k] for k in (0, 1, 6, 7, 12, 14))
    alike = np.ones((len(one.numbers), len(other.numbers)))
    for a, b in zip(one.kinds.T, other.kinds.T, strict=True):
        alike = alike * np.where(a[:, None] == b, 1.0, 1.0 / (1.0 + kind))
    found = mean**2 + direction**2 * alike
    for a, b, deviation, length in zip(one.numbers.T, other.numbers.T, values[2:6], values[8:12], strict=True):
        apart = ((a[:, None] - b) / length) ** 2
        found = found + deviation**2 * alike * (np.exp(-apart / 8.0) + slope**2 * np.outer(a, b))
    found = found + together**2 * alike * _near(drawn, one, other)
    found = found + session**2 * ((one.session[:, None] == other.session) & (other.session >= 0.0))
    return found


def among(drawn: FloatArray, features: CutFeatures) -> FloatArray:
    """Return the covariances of cuts among each other, what is each one's own included, shape (n, n)."""
    own = np.exp(2.0 * drawn[13]) * np.eye(len(features.numbers))
    return covariance(drawn, features, features) + own


def _near(drawn: FloatArray, one: CutFeatures, other: CutFeatures) -> FloatArray:
    """How near the numbers of cuts are to each other, in the lengths of the process, 1 where they are the same, shape (n, m)."""
    apart = (one.numbers[:, None] - other.numbers) / np.exp(drawn[8:12])
    found: FloatArray = np.exp(-0.5 * np.sum(apart**2, axis=2))
    return found


def variance(drawn: FloatArray, at: CutFeatures) -> FloatArray:
    """Return the variances of the loudness of cuts of sessions that are new, the cut's own included, shape (n,)."""
    values = np.exp(drawn)
    lines = np.sum(values[2:6] ** 2 * (1.0 + values[6] ** 2 * at.numbers**2), axis=1)
    found: FloatArray = values[0] ** 2 + values[1] ** 2 + lines + values[7] ** 2 + values[13] ** 2 + values[14] ** 2
    return found


def _laplace(k: FloatArray, counts: FloatArray) -> tuple[float, FloatArray, FloatArray, FloatArray]:
    """Log evidence, gradient and root of the curvature of the log likelihood at the mode, and the root of B [rasmussen2006]."""
    n = len(k)
    k = k + _NUGGET * np.eye(n)
    a, f = np.zeros(n), np.zeros(n)
    value, gradient, weight = _verdicts(f, counts)
    cost = value
    for _ in range(_ROUNDS_OF_NEWTON):
        root = np.sqrt(weight)
        chol = np.linalg.cholesky(np.eye(n) + root[:, None] * k * root)
        b = weight * f + gradient
        step = b - root * scipy.linalg.cho_solve((chol, True), root * (k @ b)) - a
        share, before = 1.0, cost
        while True:
            f = k @ (a + share * step)
            value, gradient, weight = _verdicts(f, counts)
            cost = value - 0.5 * float((a + share * step) @ f)
            if cost >= before - 1e-9 or share < 1e-3:
                break
            share *= 0.5
        a = a + share * step
        if abs(cost - before) < 1e-6:
            break
    root = np.sqrt(weight)
    chol = np.linalg.cholesky(np.eye(n) + root[:, None] * k * root)
    return cost - float(np.sum(np.log(np.diag(chol)))), a, root, chol


def _verdicts(f: FloatArray, counts: FloatArray) -> tuple[float, FloatArray, FloatArray]:
    """Log likelihood of verdicts, its gradient, and its curvature with the sign turned and no less than a little."""
    value, gradient, curvature = 0.0, np.zeros(f.size), np.zeros(f.size)
    ends = ((-np.inf, -_BETWEEN), (-_BETWEEN, _BETWEEN), (_BETWEEN, np.inf))
    keep = 1.0 - 3.0 * _SLIPS
    for count, (low, high) in zip(counts.T, ends, strict=True):
        below, above = (_normal(end - f) if np.isfinite(end) else (np.zeros(f.size),) * 2 for end in (low, high))
        p = _SLIPS + keep * (ndtr(high - f) - ndtr(low - f))
        first, second = keep * (below[0] - above[0]) / p, keep * (below[1] - above[1]) / p
        value += float(count @ np.log(p))
        gradient += count * first
        curvature += count * (second - first**2)
    return value, gradient, np.maximum(-curvature, _LEAST_WEIGHT)


def _normal(x: FloatArray) -> tuple[FloatArray, FloatArray]:
    """The normal density, and x times it."""
    density = np.exp(-0.5 * x**2) / np.sqrt(2.0 * np.pi)
    return density, x * density
