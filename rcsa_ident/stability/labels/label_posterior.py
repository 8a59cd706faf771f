"""What labelled cuts teach: draws of the tip, of the coefficients and of the limit's smooth error that agree with the labels."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from scipy.special import logsumexp

from rcsa_ident.base.arrays import FloatArray, frozen
from rcsa_ident.base.errors import InputError
from rcsa_ident.stability.labels.adaptive_importance import adaptive_importance, systematic
from rcsa_ident.stability.labels.cut_margins import DrawnMargins
from rcsa_ident.stability.labels.label_noise import LabelNoise
from rcsa_ident.stability.labels.limit_discrepancy import LimitDiscrepancy
from rcsa_ident.stability.labels.tested_cuts import TestedCuts

#: Draws of the limit's smooth error over which a likelihood is averaged, and moves that each kept draw's error makes in the end.
_ERRORS, _MOVES = 256, 30
#: Effective draws below which an answer is called suspect.
FEWEST = 30.0

#: Of z, shape (d, size).
Margins = Callable[[FloatArray], DrawnMargins]


@dataclass(frozen=True, slots=True)
class LabelModel:
    """How labels hang on limits; its numbers were fixed on forty real cuts (docs/labelled_cuts.md)."""

    noise: LabelNoise = field(default_factory=LabelNoise)
    discrepancy: LimitDiscrepancy = field(default_factory=LimitDiscrepancy)


@dataclass(frozen=True, slots=True)
class Effort:
    """Draws of the first round, of each further one, number of these, and draws that are kept.

    A draw costs a limit at every speed that was tested.
    """

    first: int = 1000
    further: int = 400
    rounds: int = 3
    kept: int = 300


@dataclass(frozen=True, slots=True, eq=False)
class LabelPosterior:
    """Draws that stand for what is believed after the labels, each as probable as the other.

    `z`, shape (r, size): numbers of the uncertain tip
    `points`, shape (n, 3): tested speeds [rad/s], immersions and directions, as `LimitDiscrepancy` takes them; none before the first label
    `error`, shape (r, n): of the logarithm of the limit, at these points
    `log_evidence`: logarithm of the probability of all labels before they were seen
    `log_score_before`: mean logarithm of the probability that each verdict had before any was seen
    `effective`: draws with equal weights that would tell as much as the weighted ones that these were chosen from
    """

    z: FloatArray
    points: FloatArray
    error: FloatArray
    log_evidence: float
    effective: float
    log_score_before: float = 0.0

    def __post_init__(self) -> None:
        for name in ("z", "points", "error"):
            object.__setattr__(self, name, frozen(getattr(self, name)))
        if self.error.shape != (len(self.z), len(self.points)) or len(self.z) == 0:
            raise InputError("error", self.error.shape, f"one or more draws, and shape {(len(self.z), len(self.points))}")

    def errors(self, discrepancy: LimitDiscrepancy, at: FloatArray, seed: int = 1) -> FloatArray:
        """Return each draw's error of the log limit at points, shape (m, 3) -> (r, m)."""
        return discrepancy.given(self.points, self.error, at, np.random.default_rng(seed))


def learn_labels(
    margins: Margins,
    size: int,
    cuts: TestedCuts,
    points: FloatArray,
    model: LabelModel,
    rng: np.random.Generator,
    effort: Effort | None = None,
    first: FloatArray | None = None,
) -> LabelPosterior:
    """Return what is believed after labels.

    Parameters
    ----------
    margins : callable
        Of numbers that are standard normal before the labels.
    size : int
        How many numbers.
    cuts : TestedCuts
        May be none.
    points : array, shape (n, 3)
        Speed, immersion and direction of each cut, as `LimitDiscrepancy` takes them.
    model : LabelModel
    rng : numpy.random.Generator
    effort : Effort, optional
    first : array, shape (n, size), optional
        The first round, drawn from the prior, where its margins are known already.

    Notes
    -----
    The error d of the log limit costs nothing to draw, the margins of a tip do: importance sampling learns where to draw tips, and each
    tip's likelihood is the mean over many errors, so that tip and error are weighted together. Tips are then drawn by their weights, an
    error for each by its share, and the errors move on by elliptical slices [murray2010], for which no margin has to be computed again.
    """
    effort = effort or Effort()
    where, place = np.unique(points, axis=0, return_inverse=True)
    if not len(where):
        return LabelPosterior(rng.standard_normal((effort.kept, size)), where, np.zeros((effort.kept, 0)), 0.0, float(effort.kept))
    start = rng.standard_normal((effort.first, size)) if first is None else first
    root = model.discrepancy.root(where)
    number = _even_normals(len(where), rng)
    joint = _Joint(model.noise, cuts, place)
    known: list[DrawnMargins] = []

    def log_likelihood(z: FloatArray) -> FloatArray:
        known.append(margins(z))
        return _mean(joint.of_all(known[-1], number @ root.T))

    found = adaptive_importance(log_likelihood, start, rng, effort.further, effort.rounds)
    chosen = systematic(found.weight, effort.kept, rng)
    tips = DrawnMargins(*(np.concatenate([getattr(part, name) for part in known]) for name in ("margin", "chatter")))
    drawn = DrawnMargins(tips.margin[chosen], tips.chatter[chosen])
    own = joint.of_all(drawn, number @ root.T)
    share = np.exp(own - logsumexp(own, axis=1, keepdims=True))
    first = np.array([rng.choice(_ERRORS, p=each / each.sum()) for each in share])
    moved = elliptical_slices(number[first], lambda u: joint.of_each(drawn, u @ root.T), rng, _MOVES)
    # the first round is drawn from the prior: what it says of each cut by itself
    before = joint.alone(known[0].margin, number @ root.T)
    order = rng.permutation(effort.kept)
    return LabelPosterior(found.z[chosen][order], where, (moved @ root.T)[order], found.log_evidence, found.effective, before)


def _even_normals(size: int, rng: np.random.Generator) -> FloatArray:
    """Standard normals whose mean is 0 and whose covariance is 1 to the last digit: a mean over them errs in higher moments alone."""
    half = rng.standard_normal((_ERRORS // 2, size))
    both = np.concatenate([half, -half])
    if size >= _ERRORS // 2:
        return both
    root = np.linalg.cholesky(both.T @ both / _ERRORS)
    found: FloatArray = np.linalg.solve(root, both.T).T
    return found


def _mean(log_values: FloatArray) -> FloatArray:
    found: FloatArray = logsumexp(log_values, axis=1) - np.log(log_values.shape[1])
    return found


@dataclass(frozen=True, slots=True, eq=False)
class _Joint:
    """Log probability of labels of tips and errors."""

    noise: LabelNoise
    cuts: TestedCuts
    place: FloatArray

    def of_all(self, tips: DrawnMargins, error: FloatArray) -> FloatArray:
        """Of each tip with each error, shapes (d, n), (e, p) -> (d, e)."""
        found = np.zeros((len(tips.margin), len(error)))
        for k, at in enumerate(self.place):
            margin = tips.margin[:, k, None] + error[:, at]
            found += self.noise.log_likelihood(self.cuts.at_places(np.array([k])), margin[..., None])
        return found + self.noise.heard(self.cuts, tips.chatter)[:, None]

    def alone(self, margin: FloatArray, error: FloatArray) -> float:
        """Mean log probability of each verdict by itself, by tips of shape (d, n) with one error each."""
        with_error = margin + np.resize(error, (len(margin), error.shape[1]))[:, self.place]
        each = [
            logsumexp(self.noise.log_likelihood(self.cuts.at_places(np.array([k])), with_error[:, k, None])) - np.log(len(margin))
            for k in range(len(self.place))
        ]
        return float(np.sum(each) / np.sum(self.cuts.counts))

    def of_each(self, tips: DrawnMargins, error: FloatArray) -> FloatArray:
        """Of each tip with its own error, shapes (d, n), (d, p) -> (d,)."""
        return self.noise.log_likelihood(self.cuts, tips.margin + error[:, self.place]) + self.noise.heard(self.cuts, tips.chatter)


def elliptical_slices(
    number: FloatArray, log_likelihood: Callable[[FloatArray], FloatArray], rng: np.random.Generator, moves: int
) -> FloatArray:
    """Return standard normal numbers after moves that leave their posterior as it is, every row by itself [murray2010].

    `number`, shape (r, n)
    `log_likelihood`: of such an array, returns shape (r,)
    """
    here, value = number.copy(), log_likelihood(number)
    for _ in range(moves):
        other = rng.standard_normal(here.shape)
        least = value + np.log(rng.random(len(here)))
        angle = 2.0 * np.pi * rng.random(len(here))
        low, high = angle - 2.0 * np.pi, angle.copy()
        left = np.ones(len(here), dtype=bool)
        while left.any():
            turned = here * np.cos(angle)[:, None] + other * np.sin(angle)[:, None]
            there = log_likelihood(turned)
            done = left & (there > least)
            here[done], value[done] = turned[done], there[done]
            left &= ~done
            low, high = np.where(left & (angle < 0.0), angle, low), np.where(left & (angle >= 0.0), angle, high)
            angle = np.where(left, low + (high - low) * rng.random(len(here)), 0.0)
    return here
