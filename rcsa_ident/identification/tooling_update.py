"""What further cuts of a known machine tell of the toolings that they were made with."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from rcsa_ident.base.arrays import FloatArray
from rcsa_ident.base.errors import InputError
from rcsa_ident.identification.assemble_result import WIDER
from rcsa_ident.identification.data import SMOOTH_ERROR, IdentificationData
from rcsa_ident.identification.levenberg_marquardt import Solution, refine
from rcsa_ident.identification.machine_prior import FurtherMisfit, Gaussian, KnownMachine
from rcsa_ident.identification.model_order import OUTLYING, cut_weights, evidence, model_error
from rcsa_ident.identification.unknowns import JOINT, Layout, planes
from rcsa_ident.tool_holder.alteration import ALTERATIONS
from rcsa_ident.tool_holder.drawings import KnownToolings, RoughUnknown

#: Logarithms of contact stiffnesses at which fits start: errors of a tip by a third and more are far from linear.
STARTS = (-0.6, 0.0, 0.6)
#: Model error of the first fit from each: it smooths the landscape while the delays are found.
COARSE = 0.1
#: Least model error that is believed of a few lines: they learn it badly.
LEAST = 0.01
#: Fits and estimates of the model error in turns, and steps of each.
ROUNDS, STEPS = 4, 300
_STIFFNESSES = ("translational_stiffness", "rotational_stiffness")


@dataclass(frozen=True, eq=False)
class FurtherFit:
    """The most probable toolings, machine and forces of further cuts. `known`: what was known before."""

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
        """Return the cuts that miss the answer by far more than most do, and hits of a tip that miss it so beside cuts."""
        weight = cut_weights(self.solution, self.misfit)
        most = np.where(np.arange(weight.size) < self.data.cuts, 1.0, 1.0 / OUTLYING)
        return [name for name, each, limit in zip(self.data.cut_ids, weight, most, strict=True) if each < limit]

    def surprise(self, tooling: int) -> float:
        """Return by how many standard deviations what a tooling's drawing did not tell has moved, at most."""
        assert self.data.rough is not None
        centre, covariance = self.before
        own = np.any(self.data.rough.weights[tooling], axis=0)
        moved = np.abs(self.values - centre) / np.sqrt(np.diag(covariance))
        return float(np.max(moved[own]))

    def machine(self, known: KnownMachine, names: Sequence[str]) -> KnownMachine:
        """Return the machine, and what is known of toolings, with what these cuts tell of them.

        Of earlier toolings that have nothing in common with these ones, v, the machine's change tells by what they had in common with
        it, m: v + K dm with K = cov(v, m) cov(m)^-1, and cov(v) - K (cov(m) - cov'(m)) K^T. Of these cuts' own toolings it holds how they
        differ from what was learned of them: contact and section, hardly told apart, are known well together.

        `names`: of the toolings of these cuts
        """
        layout, theta, covariance = planes(self.solution.layout), self.solution.theta, self.covariance_of_all
        machine = known.places(layout)
        size = machine.size
        before = known.joint_covariance(self.data)
        entries, unit = known.entries(self.data, layout.force.start)
        ours = np.r_[machine, entries[entries >= 0]]
        scale = np.concatenate([np.ones(size), unit[entries >= 0]])
        places = np.r_[np.arange(size), size + np.flatnonzero(entries >= 0)]
        after = covariance[np.ix_(ours, ours)] / np.outer(scale, scale)
        gain = np.linalg.solve(before[np.ix_(places, places)], before[places]).T
        whole = before - gain @ (before[np.ix_(places, places)] - after) @ gain.T
        moved = gain @ ((theta - self.known.centre)[ours] / scale)
        unknowns, spread, shares = self._own_toolings(names)
        cross = gain @ (covariance[np.ix_(ours, self.entries)] / scale[:, None]) @ shares.T
        whole = np.block([[whole, cross], [cross.T, shares @ self.covariance @ shares.T]])
        toolings = known.toolings or KnownToolings((), np.zeros(0), np.zeros(0), np.zeros((0, 0)), ())
        # what was learned of a tooling before is in what was learned now
        kept = [k for k, each in enumerate(toolings.unknowns) if each.kind != "tooling" or each.owner not in names]
        tail = np.r_[size + np.array(kept, dtype=np.intp), np.arange(before.shape[0], whole.shape[0])]
        whole = 0.5 * (whole + whole.T)
        taught = KnownToolings(
            (*(toolings.unknowns[k] for k in kept), *unknowns),
            np.concatenate([toolings.spread[kept], spread]),
            np.concatenate([(toolings.mean + moved[size:])[kept], np.zeros(len(unknowns))]),
            whole[np.ix_(tail, tail)],
            toolings.toolings,
        )
        found, first = {}, 0
        for i, axis in enumerate(self.data.axes):
            old = known.posteriors[axis.axis]
            core = layout.axes[i].machine.size
            here = np.r_[np.arange(first, first + core), np.arange(size - JOINT, size)]
            first += core
            found[axis.axis] = replace(
                old,
                theta=theta[machine[here]],
                covariance=whole[np.ix_(here, here)],
                # how far they were away was asked before these cuts, which have ruled out much of it
                rivals=(),
                tooling_cross=whole[np.ix_(here, tail)],
                tooling_covariance=taught.covariance,
                rival_toolings=(),
            )
        return KnownMachine({**known.posteriors, **found}, taught)

    def _own_toolings(self, names: Sequence[str]) -> tuple[list[RoughUnknown], FloatArray, FloatArray]:
        """Numbers of the drawings of these cuts, their standard deviations before, and how those of the fit add up to them."""
        rough = self.data.rough
        assert rough is not None
        unknowns, rows = [], []
        for name, weights in zip(names, rough.weights * rough.spread, strict=True):
            for field, row in zip(ALTERATIONS, weights, strict=True):
                if np.any(row):
                    unknowns.append(RoughUnknown(field, name, "tooling"))
                    rows.append(row)
        shares = np.array(rows)
        spread = np.sqrt(np.einsum("fu,uv,fv->f", shares, self.before[1], shares))
        return unknowns, spread, shares / spread[:, None]


def fit_further(data: IdentificationData, machine: KnownMachine, reclamped: float) -> FurtherFit:
    """Return what further cuts tell: the likeliest of fits that start from several contacts, first each tooling by itself.

    `data`: of rough toolings; the flange's motion was measured
    `reclamped`: as in `KnownMachine.prior`
    """
    if data.rough is None:
        raise InputError("toolings", "drawings that are exact", "toolings with a [spread] table: nothing of others is to be learned")
    rough, data = data.rough, data.summed().with_smooth_errors(SMOOTH_ERROR)
    known, layout = machine.prior(data, reclamped), machine.layout(data)
    stills = machine.standstills(data)
    frame = _Frame(machine, known, layout, float(np.mean(stills)))
    values = known.centre[layout.force][data.rough_place].copy()
    theta, nuisance = known.centre, np.zeros((len(data.cut_ids), 2))
    for tooling in range(len(data.toolings)):
        own = np.flatnonzero(data.cut_tooling == tooling)
        part = _of(data, own)
        fits = [_fit(part, frame, known.centre, start, nuisance[own], COARSE) for start in _starts(data, tooling, values)]
        best = min(fits, key=_evidence)
        nuisance[own] = best.solution.evaluation.nuisance
        told = np.any(rough.weights[tooling], axis=0)
        values[told] = best.values[told]
        theta = best.solution.theta
    # of several toolings each has moved the machine its own way
    theta = theta if len(data.toolings) == 1 else known.centre
    return min((_fit(data, replace(frame, still=still), theta, values, nuisance, None) for still in stills), key=_evidence)


@dataclass(frozen=True, slots=True, eq=False)
class _Frame:
    """What all fits have in common: the machine, what is known, the unknowns, and where a spindle that stands still counts."""

    machine: KnownMachine
    known: Gaussian
    layout: Layout
    still: float


def _evidence(fit: FurtherFit) -> float:
    return evidence(fit.solution, fit.misfit)


def _of(data: IdentificationData, keep: np.ndarray) -> IdentificationData:
    """The same data with some of the cuts and hits."""
    tests = tuple(data.tests[k - data.cuts] for k in keep.tolist() if k >= data.cuts)
    return replace(data.of_cuts(keep), tests=tests)


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
    data: IdentificationData, frame: _Frame, start: FloatArray, values: FloatArray, nuisance: FloatArray, coarse: float | None
) -> FurtherFit:
    """The fit from a vector with other values of what the drawings do not tell; coarse to fine where a coarse model error is given."""
    theta, layout, place = start.copy(), frame.layout, data.rough_place

    def misfit_of(shares: tuple[float, ...], weight: FloatArray) -> FurtherMisfit:
        return FurtherMisfit(data, frame.machine, frame.known, shares, weight, frame.still)

    theta[layout.force.start + place.start : layout.force.start + place.stop] = values
    grid = 0 if coarse is None else 32
    shares = ((LEAST if coarse is None else coarse),) * len(data.axes)
    weight = np.ones(len(data.cut_ids))
    if coarse is not None:
        rough = refine(misfit_of(shares, weight), theta, layout, nuisance, 60, grid=grid)
        theta, nuisance, shares = rough.theta, rough.evaluation.nuisance, (LEAST,) * len(data.axes)
    for _ in range(ROUNDS):
        misfit = misfit_of(shares, weight)
        found = refine(misfit, theta, layout, nuisance, STEPS, grid=grid)
        learned = tuple(max(each, LEAST) for each in model_error(found, misfit))
        theta, nuisance = found.theta, found.evaluation.nuisance
        if all(abs(a / b - 1.0) < 0.05 for a, b in zip(learned, shares, strict=True)):
            break
        shares, weight = learned, cut_weights(found, misfit)
    return FurtherFit(data, frame.known, found, misfit)
