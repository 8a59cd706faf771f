"""Both planes together: from what each has found for itself to one machine, as far across as the evidence asks for."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from rcsa_ident.arrays import FloatArray
from rcsa_ident.identification.candidate import Candidate
from rcsa_ident.identification.coupled.data import CoupledData
from rcsa_ident.identification.coupled.misfit import CoupledMisfit
from rcsa_ident.identification.coupled.modes import COUPLED
from rcsa_ident.identification.coupled.parameters import CoupledLayout, pack, unpack
from rcsa_ident.identification.coupled.score import coupled_start
from rcsa_ident.identification.joint_fit import LEAST_SPEED_RANGE, AxisSearch, learned_noise, refine_and_learn_noise, tooth_angles
from rcsa_ident.identification.levenberg_marquardt import Solution, refine
from rcsa_ident.identification.misfit import Misfit
from rcsa_ident.identification.model_order import Report, evidence, exchange_modes, grow_modes
from rcsa_ident.identification.parameters import Layout, Unknowns, planes
from rcsa_ident.identification.priors import Priors
from rcsa_ident.identification.progress import Stage
from rcsa_ident.identification.task import Phase, finite, perform
from rcsa_ident.scaleout import Map

#: Model errors from coarse to fine: what each plane has found for itself was bent to explain the other one's forces.
SHARES = (0.05, 0.01, 0.003)
#: The first of them with gyroscopic coupling, which starts as weak as this share of its prior: at none it would have no gradient.
WITH_SKEW, FIRST_SKEW = 0.01, 0.3
#: Gain in evidence for which the spindle is believed to turn the other way: two valleys of one sense differ by up to half of it, and
#: where gyroscopic moments are strong the wrong sense loses by thousands.
OTHER_SENSE = 300.0
#: Most discs whose slopes make the gyroscopic coupling.
MOST_DISCS = 2


@dataclass(frozen=True, slots=True, eq=False)
class CoupledSearch:
    """What a start has come to.

    Parameters
    ----------
    candidate : Candidate
    evidence : float [-]
        Minus twice the log evidence at the finest of `SHARES`.
    """

    candidate: Candidate
    evidence: float


@dataclass(frozen=True, slots=True, eq=False)
class CoupledStart:
    """A polish of both planes from what each has found for itself, as one machine or still as two; it answers with a `CoupledSearch`.

    Parameters
    ----------
    data : CoupledData
        With the flange's motion as the only output.
    priors : Priors
    searched : list of AxisSearch
        Of X and of Y.
    skew, turning : int
        As in `CoupledLayout`.
    together : bool
        Whether they are one machine; as two they are the measure for it, with the same lines and weights.
    """

    phase: ClassVar[Phase] = Phase.COUPLED
    data: CoupledData
    priors: Priors
    searched: list[AxisSearch]
    skew: int = 0
    turning: int = 0
    together: bool = True

    def run(self) -> CoupledSearch:
        """Refine from coarse to fine."""
        theta, layout, nuisance = self._start()
        weight = learned_noise(self.searched)[1]
        for share in SHARES:
            if share == WITH_SKEW and isinstance(layout, CoupledLayout) and self.skew:
                theta, layout = with_discs(theta, layout, self.skew, self.priors)
            noise = self.priors, (share, share), weight
            misfit = CoupledMisfit(self.data, *noise) if self.together else Misfit(self.data.base, *noise)
            found = refine(misfit, theta, layout, nuisance, 60, grid=32 if share >= WITH_SKEW else 0, tolerance=1e-3)
            theta, nuisance = found.theta, found.evaluation.nuisance
        return CoupledSearch(found.candidate, evidence(found, misfit))

    def _start(self) -> tuple[FloatArray, Unknowns, FloatArray]:
        best = [s.candidates[0] for s in self.searched]
        named, coefficients = len(self.data.base.coefficients), len(self.data.base.coefficient_spread)
        force = np.zeros(coefficients)
        force[:named] = np.mean([c.theta[c.layout.force][:named] for c in best], axis=0)
        joint = np.mean([c.theta[c.layout.joint] for c in best], axis=0)
        theta = np.concatenate([*(c.theta[c.layout.axis(0)] for c in best), joint, force])
        layout = Layout(tuple(planes(c.layout).axes[0] for c in best), coefficients)
        start = coupled_start(theta, layout, turning=self.turning) if self.together else (theta, layout)
        return *start, best[0].nuisance


def with_discs(theta: FloatArray, layout: CoupledLayout, discs: int, priors: Priors) -> tuple[FloatArray, CoupledLayout]:
    """Return a vector with more discs than it has, the new ones so weak that nothing changes but the gradient."""
    wider = replace(layout, skew=discs)
    rng = np.random.default_rng(discs)
    new = FIRST_SKEW * np.sqrt(priors.skew) * rng.standard_normal(wider.skew_size - layout.skew_size)
    return np.concatenate([theta[: layout.tail], new, theta[layout.tail :]]), wider


def coupled_starts(data: CoupledData, priors: Priors, searched: list[AxisSearch], map: Map = map) -> list[CoupledSearch]:
    """Return where both planes have come to as one machine, best first; nothing where the evidence prefers two.

    The score test alone is not enough: few cuts, or an answer that has not settled, leave something that any further unknown takes.

    Parameters
    ----------
    data : CoupledData
    priors : Priors
    searched : list of AxisSearch
        Of X and of Y, each as if it did not feel the other.
    map : callable
        The builtin, or a pool's.
    """
    summed = data.summed()
    tasks = [CoupledStart(summed, priors, searched, together=False), CoupledStart(summed, priors, searched)]
    if data.turns:
        tasks.append(CoupledStart(summed, priors, searched, 1, 1))
    apart, *starts = finite(map(perform, tasks))
    starts.sort(key=lambda start: start.evidence)
    return starts if starts[0].evidence < apart.evidence else []


def fit_coupled(
    data: CoupledData, priors: Priors, searched: list[AxisSearch], best: CoupledSearch, report: Report
) -> tuple[Solution, CoupledMisfit, Solution]:
    """Return the solution of both planes together, its misfit, and a rival with one mode more.

    A whole machine's modes reach across both planes: one more than the evidence asks for is worse as an answer, but how far it differs
    belongs to what is not known.

    Parameters
    ----------
    data : CoupledData
        With both outputs where they were recorded.
    priors : Priors
    searched : list of AxisSearch
        Of X and of Y, each as if it did not feel the other.
    best : CoupledSearch
        Where it begins: the first of `coupled_starts`.
    report : callable of (stage, cost, solution)
    """
    summed = data.summed()
    omega = np.concatenate([a.omega for a in data.base.axes])
    band = float(omega.min() / (2.0 * np.pi)), float(omega.max() / (2.0 * np.pi))

    def rough_of(shares: tuple[float, ...], weight: FloatArray) -> CoupledMisfit:
        return CoupledMisfit(summed, priors, shares, weight)

    weight = learned_noise(searched)[1]
    found, rough = refine_and_learn_noise(rough_of, best.candidate.point, (SHARES[-1], SHARES[-1]), weight, report, 1e-4)
    if _layout(found).turning:
        other = refine_and_learn_noise(rough_of, turned_round(found), rough.model_error, rough.cut_weight, report, 1e-4)
        if evidence(*other) < evidence(found, rough) - OTHER_SENSE:
            found, rough = other
    found = exchange_modes(found, rough, band, report, rounds=2, steps=COUPLED)

    def misfit_of(shares: tuple[float, ...], weight: FloatArray) -> CoupledMisfit:
        return CoupledMisfit(data, priors, shares, weight)

    def better(here: tuple[Solution, Misfit], start: tuple[FloatArray, CoupledLayout, FloatArray]) -> tuple[Solution, Misfit]:
        there = refine_and_learn_noise(misfit_of, start, here[1].model_error, here[1].cut_weight, report, 1e-4)
        return there if evidence(*there) < evidence(*here) else here

    here = refine_and_learn_noise(misfit_of, _start(data, found), rough.model_error, rough.cut_weight, report, 1e-4)
    while 0 < _layout(here[0]).skew < MOST_DISCS:
        layout = _layout(here[0])
        there = better(here, (*with_discs(here[0].theta, layout, layout.skew + 1, priors), here[0].evaluation.nuisance))
        if there is here:
            break
        here = there
    middle, half = data.base.speed_range
    if half > LEAST_SPEED_RANGE * middle:
        here = better(here, _start(data, here[0], softening=True))
    found, misfit = refine_and_learn_noise(misfit_of, here[0].candidate.point, here[1].model_error, here[1].cut_weight, report)
    assert isinstance(misfit, CoupledMisfit)
    grown = grow_modes(found, misfit, band, steps=COUPLED)
    report(Stage.GROW, grown.cost, grown)
    return found, misfit, grown


def turned_round(found: Solution) -> tuple[FloatArray, CoupledLayout, FloatArray]:
    """Return where the search for the same machine begins whose spindle turns the other way: gyroscopic moments change their sign."""
    layout = _layout(found)
    theta = found.theta.copy()
    discs = theta[layout.skews].reshape(layout.skew, 2, layout.modes)
    discs[:, 0] *= -1.0
    return theta, replace(layout, turning=-layout.turning), found.evaluation.nuisance


def _layout(solution: Solution) -> CoupledLayout:
    assert isinstance(solution.layout, CoupledLayout)
    return solution.layout


def _start(data: CoupledData, found: Solution, softening: bool = False) -> tuple[FloatArray, CoupledLayout, FloatArray]:
    """Return a vector with all that the data may tell, from one with less: what is new starts at nothing."""
    old = _layout(found)
    layout = replace(old, fixture=data.base.axes[0].outputs == 2, softening=softening, clampings=data.base.clampings)
    discs = found.theta[old.skews].reshape(old.skew, 2, old.modes)
    nuisance, angles = found.evaluation.nuisance, found.theta[old.clamping]
    if not old.clampings and layout.clampings:
        angles, nuisance = tooth_angles(data.base, nuisance)
    machine = pack(unpack(found.theta, old), layout, discs)
    return np.concatenate([machine, found.theta[old.joint], found.theta[old.force], angles]), layout, nuisance
