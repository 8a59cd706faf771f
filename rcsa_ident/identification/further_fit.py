"""What further cuts of a known machine tell of the toolings that they were made with."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from rcsa_ident.arrays import FloatArray
from rcsa_ident.errors import InputError
from rcsa_ident.identification.answer import WIDER
from rcsa_ident.identification.data import IdentificationData
from rcsa_ident.identification.evidence import SMOOTH_ERROR
from rcsa_ident.identification.known_machine import FurtherMisfit, Gaussian, KnownMachine
from rcsa_ident.identification.levenberg_marquardt import Solution, refine
from rcsa_ident.identification.model_order import cut_weights, evidence, model_error
from rcsa_ident.identification.parameters import JOINT, Layout

#: Logarithms of contact stiffnesses at which fits start: errors of a tip by a third and more are far from linear.
STARTS = (-0.6, 0.0, 0.6)
#: Model error of the first fit from each: it smooths the landscape while the delays are found.
COARSE = 0.1
#: Least model error that is believed of a few lines: they learn it badly.
LEAST = 0.01
#: Fits and estimates of the model error in turns.
ROUNDS = 4
_STIFFNESSES = ("translational_stiffness", "rotational_stiffness")


@dataclass(frozen=True, eq=False)
class FurtherFit:
    """The most probable toolings, machine and forces of further cuts.

    Parameters
    ----------
    data : IdentificationData
    known : Gaussian
        What was known before.
    solution : Solution
    misfit : FurtherMisfit
    """

    data: IdentificationData
    known: Gaussian
    solution: Solution
    misfit: FurtherMisfit

    @property
    def entries(self) -> np.ndarray:
        """Places of what the drawings do not tell."""
        place = self.data.rough_place
        return self.solution.layout.force.start + np.arange(place.start, place.stop)

    @property
    def values(self) -> FloatArray:
        """What the drawings did not tell, in units of its spreads, shape (u,)."""
        return np.asarray(self.solution.theta[self.entries])

    @property
    def before(self) -> tuple[FloatArray, FloatArray]:
        """What was believed of it before, and the covariance of that, shapes (u,) and (u, u)."""
        return self.known.centre[self.entries], self.known.covariance[np.ix_(self.entries, self.entries)]

    @cached_property
    def covariance_of_all(self) -> FloatArray:
        """Covariance of all unknowns, shape (p, p): lines count as in an identification, what was known before as it is."""
        prior = self.known.jacobian.T @ self.known.jacobian
        found: FloatArray = np.linalg.inv(prior + (self.solution.evaluation.hessian - prior) / WIDER**2)
        return 0.5 * (found + found.T)

    @property
    def covariance(self) -> FloatArray:
        """Covariance of what the drawings did not tell, shape (u, u), in units of its spreads."""
        return self.covariance_of_all[np.ix_(self.entries, self.entries)]

    def contradicting(self) -> list[str]:
        """Return the cuts that miss the answer by far more than most do."""
        weight = cut_weights(self.solution, self.misfit)
        return [name for name, each in zip(self.data.cut_ids, weight, strict=True) if each < 1.0]

    def surprise(self, tooling: int) -> float:
        """Return by how many standard deviations what a tooling's drawing did not tell has moved, at most."""
        assert self.data.rough is not None
        centre, covariance = self.before
        own = np.any(self.data.rough.weights[tooling], axis=0)
        moved = np.abs(self.values - centre) / np.sqrt(np.diag(covariance))
        return float(np.max(moved[own]))

    def machine(self, known: KnownMachine) -> KnownMachine:
        """Return the machine, and what was known of earlier toolings, with what these cuts tell of them.

        Of earlier toolings that have nothing in common with these ones, v, the machine's change tells by what they had in common with
        it, m: v + K dm with K = cov(v, m) cov(m)^-1, and cov(v) - K (cov(m) - cov'(m)) K^T.
        """
        layout, theta, covariance = self.solution.layout, self.solution.theta, self.covariance_of_all
        size, told = layout.tail + JOINT, [] if known.toolings is None else list(known.toolings.unknowns)
        before = known.joint_covariance(self.data)
        entries, unit = known.entries(self.data, size)
        ours = np.r_[np.arange(size), entries[entries >= 0]]
        scale = np.concatenate([np.ones(size), unit[entries >= 0]])
        places = np.r_[np.arange(size), size + np.flatnonzero(entries >= 0)]
        after = covariance[np.ix_(ours, ours)] / np.outer(scale, scale)
        gain = np.linalg.solve(before[np.ix_(places, places)], before[places]).T
        whole = before - gain @ (before[np.ix_(places, places)] - after) @ gain.T
        whole = 0.5 * (whole + whole.T)
        moved = gain @ ((theta - self.known.centre)[ours] / scale)
        toolings = None
        if known.toolings is not None:
            own = whole[size:, size:]
            toolings = replace(known.toolings, mean=known.toolings.mean + moved[size:], covariance=own)
        found = {}
        for i, axis in enumerate(self.data.axes):
            part, old = layout.axis(i), known.posteriors[axis.axis]
            here = np.r_[np.arange(part.start, part.stop), np.arange(layout.tail, size)]
            shift = moved[here]
            rivals = tuple(rival + shift if rival.size == shift.size else rival for rival in old.rivals)
            cross = {} if not told else {"tooling_cross": whole[here, size:], "tooling_covariance": whole[size:, size:]}
            found[axis.axis] = replace(old, theta=theta[here], covariance=whole[np.ix_(here, here)], rivals=rivals, **cross)
        return KnownMachine({**known.posteriors, **found}, toolings)


def fit_further(data: IdentificationData, machine: KnownMachine, reclamped: float) -> FurtherFit:
    """Return what further cuts tell: the likeliest of fits that start from several contacts, first each tooling by itself.

    Parameters
    ----------
    data : IdentificationData
        Of rough toolings; the flange's motion was measured.
    machine : KnownMachine
    reclamped : float
        As in `KnownMachine.prior`.
    """
    if data.rough is None:
        raise InputError("toolings", "drawings that are exact", "toolings with a [spread] table: nothing of others is to be learned")
    rough, data = data.rough, data.summed().with_smooth_errors(SMOOTH_ERROR)
    known, layout = machine.prior(data, reclamped), machine.layout(data)
    values = known.centre[layout.force][data.rough_place].copy()
    nuisance = np.zeros((len(data.cut_ids), 2))
    for tooling in range(len(data.toolings)):
        own = np.flatnonzero(data.cut_tooling == tooling)
        part = data.of_cuts(own)
        fits = [_fit(part, machine, known, layout, start, nuisance[own], COARSE) for start in _starts(data, tooling, values)]
        best = min(fits, key=lambda fit: evidence(fit.solution, fit.misfit))
        nuisance[own] = best.solution.evaluation.nuisance
        told = np.any(rough.weights[tooling], axis=0)
        values[told] = best.values[told]
    return _fit(data, machine, known, layout, values, nuisance, None)


def _starts(data: IdentificationData, tooling: int, values: FloatArray) -> list[FloatArray]:
    """Values of what drawings do not tell, with a tooling's contact stiffer and softer."""
    assert data.rough is not None
    stiff = [k for k, u in enumerate(data.rough.unknowns) if u.field in _STIFFNESSES and np.any(data.rough.weights[tooling][:, k])]
    # where a model's contact is known, its clamping alone differs, and little
    steps = {tuple(np.clip(step / data.rough.spread[stiff], -1.5, 1.5)) for step in STARTS} if stiff else {()}
    found = []
    for step in sorted(steps):
        start = values.copy()
        start[stiff] += step
        found.append(start)
    return found


def _fit(
    data: IdentificationData,
    machine: KnownMachine,
    known: Gaussian,
    layout: Layout,
    values: FloatArray,
    nuisance: FloatArray,
    coarse: float | None,
) -> FurtherFit:
    """The fit from values of what the drawings do not tell; coarse to fine where a coarse model error is given."""
    theta = known.centre.copy()
    place = data.rough_place
    theta[layout.force.start + place.start : layout.force.start + place.stop] = values
    grid = 0 if coarse is None else 32
    shares = ((LEAST if coarse is None else coarse),) * len(data.axes)
    weight = np.ones(len(data.cut_ids))
    if coarse is not None:
        rough = refine(FurtherMisfit(data, machine, known, shares, weight), theta, layout, nuisance, 60, grid=grid)
        theta, nuisance, shares = rough.theta, rough.evaluation.nuisance, (LEAST,) * len(data.axes)
    for _ in range(ROUNDS):
        misfit = FurtherMisfit(data, machine, known, shares, weight)
        found = refine(misfit, theta, layout, nuisance, 100, grid=grid)
        learned = tuple(max(each, LEAST) for each in model_error(found, misfit))
        theta, nuisance = found.theta, found.evaluation.nuisance
        if all(abs(a / b - 1.0) < 0.05 for a, b in zip(learned, shares, strict=True)):
            break
        shares, weight = learned, cut_weights(found, misfit)
    return FurtherFit(data, known, found, misfit)
