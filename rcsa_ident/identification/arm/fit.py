"""A robot from its cuts: the arm from the lowest lines, then the spindle in its hand, as many modes as the evidence asks for.

Below the spindle's own modes a robot has no other unknowns than its springs, dampers and masses, and their number does not grow with that
of the postures: a few dozen lines tell them, from any start within a factor of two. For the spindle, ones that could exist are drawn; the
modes of those that fit best go on as free ones.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from rcsa_ident.base.arrays import FloatArray
from rcsa_ident.base.errors import InputError
from rcsa_ident.base.scaleout import Map
from rcsa_ident.base.units import from_hz
from rcsa_ident.identification.arm.data import PosedData
from rcsa_ident.identification.arm.misfit import PosedMisfit
from rcsa_ident.identification.arm.spindle_starts import drawn, spindle_of
from rcsa_ident.identification.arm.unknowns import ArmPriors, PosedLayout, pack, posed, unpack
from rcsa_ident.identification.candidate import Candidate
from rcsa_ident.identification.joint_fit import refine_and_learn_noise, tooth_angles
from rcsa_ident.identification.levenberg_marquardt import Solution, refine
from rcsa_ident.identification.model_order import Report, evidence, grow_modes
from rcsa_ident.identification.progress import Stage
from rcsa_ident.identification.task import Phase, finite, perform
from rcsa_ident.identification.unknowns import DIRECTIONS, Unknowns

#: Up to which frequency a spindle is as good as rigid [Hz].
ARM_BAND = 120.0
#: Harmonics of the tooth passing that are used: a slow cut has two hundred, whose neighbours tell the same, and above the last of these a
#: simulated force is a matter of the edges' last micrometres.
HARMONICS = (1, 2, 3, 4, 5, 6, 7, 8, 10, 12, 15, 18, 22, 26, 30)
#: Model errors of the arm's fit and of the spindle's, from coarse to fine; down to `GRID` the cuts' delays are looked for over all of a
#: tooth passing: a fast cut has no line among the arm's.
ARM_SHARES, SPINDLE_SHARES, GRID = (1.0, 0.3, 0.1, 0.03, 0.01), (0.3, 0.1, 0.03), 0.1
#: Starts of the arm's fit: the data sheet's springs, and draws of what is believed of them.
STARTS = 8
#: Spindles that are drawn, in so many tasks, and those that go on.
DRAWS, TASKS, POLISHED = 400, 8, 4
#: Gain in evidence for which a mode is taken in.
WORTH = 5.0
_STEPS, _FEW_STEPS, _ROUGHLY, _WELL = 60, 25, 1e-3, 1e-4
#: Residual compliance's factor where it begins, in its unit.
_FIRST_RESIDUAL = 0.5


@dataclass(frozen=True, slots=True, eq=False)
class ArmStart:
    """A fit of the arm alone, from one start; it answers with a `Candidate`.

    `data`: lines up to `ARM_BAND`, the flange's motion as the only output
    `theta`, shape (p,): where it begins, no mode of the spindle in it
    """

    phase: ClassVar[Phase] = Phase.SEARCH
    data: PosedData
    priors: ArmPriors
    theta: FloatArray

    def run(self) -> Candidate:
        """Refine from coarse to fine."""
        theta, nuisance = self.theta, np.zeros((len(self.data.base.cut_ids), 2))
        layout = PosedLayout(self.priors.springs, self.data.masses, 0, len(self.data.base.coefficient_spread))
        for share in ARM_SHARES:
            misfit = PosedMisfit(self.data, self.priors, (share, share))
            found = refine(misfit, theta, layout, nuisance, _STEPS, grid=32 if share >= GRID else 0)
            theta, nuisance = found.theta, found.evaluation.nuisance
        return found.candidate


@dataclass(frozen=True, slots=True, eq=False)
class DrawnSpindles:
    """Spindles as they were drawn, on an arm that is known; it answers with the cost of each, shape (d,).

    `data`: the flange's motion as the only output
    `numbers`, shape (d, 11): as `spindle_starts.drawn` returns them
    """

    phase: ClassVar[Phase] = Phase.COUPLED
    data: PosedData
    priors: ArmPriors
    arm: Candidate
    numbers: FloatArray

    def run(self) -> FloatArray:
        """Compare each with the lines."""
        share = SPINDLE_SHARES[0]
        misfit = PosedMisfit(self.data, self.priors, (share, share))
        starts = (with_spindle(self.arm, numbers) for numbers in self.numbers)
        return np.array([misfit.evaluate(*start, grid=32).cost for start in starts])


@dataclass(frozen=True, slots=True, eq=False)
class SpindleStart:
    """A fit of arm and spindle from a drawn spindle; it answers with a `Candidate`. Parameters as of `DrawnSpindles`, of one spindle."""

    phase: ClassVar[Phase] = Phase.BOTH_AXES
    data: PosedData
    priors: ArmPriors
    arm: Candidate
    numbers: FloatArray

    def run(self) -> Candidate:
        """Refine from coarse to fine."""
        point: tuple[FloatArray, Unknowns, FloatArray] = with_spindle(self.arm, self.numbers)
        for share in SPINDLE_SHARES:
            misfit = PosedMisfit(self.data, self.priors, (share, share))
            found = refine(misfit, *point, _FEW_STEPS, grid=32 if share >= GRID else 0, tolerance=_ROUGHLY)
            point = found.candidate.point
        return found.candidate


def with_spindle(arm: Candidate, numbers: FloatArray) -> tuple[FloatArray, PosedLayout, FloatArray]:
    """Return where a fit begins: an arm that is known, with a drawn spindle and its joint."""
    old = posed(arm.layout)
    spindle, joint = spindle_of(numbers)
    robot = replace(unpack(arm.theta, old), spindle=spindle)
    rest = arm.theta[old.tail :].copy()
    rest[: joint.size] = joint
    return np.concatenate([pack(robot, old), rest]), replace(old, modes=spindle.order), arm.nuisance


def fit_robot(data: PosedData, priors: ArmPriors, seed: int, map: Map, report: Report) -> tuple[Solution, PosedMisfit, Solution]:
    """Return arm and spindle as the cuts tell them, the misfit whose minimum they are, and a rival with one mode more.

    `data`: of all outputs
    `seed`: of the starts
    `map`: the builtin, or a pool's
    `report`: callable of (stage, cost, solution)
    Raises `InputError` if no line is low enough to tell the arm.
    """
    data = data.at_harmonics(HARMONICS)
    summed = data.summed()
    rng = np.random.default_rng(seed)
    found, misfit = _spindle(summed, priors, _arm(summed, priors, rng, map), rng, map, report)
    found, misfit = _learned(data, priors, _with_all_outputs(data, found), misfit.model_error, misfit.cut_weight, report, _WELL)
    rival = grow_modes(found, misfit, data.base.band_hz)
    report(Stage.GROW, rival.cost, rival)
    return found, misfit, rival


def _arm(data: PosedData, priors: ArmPriors, rng: np.random.Generator, map: Map) -> Candidate:
    """The best of several fits of the lowest lines."""
    low = data.below(from_hz(ARM_BAND))
    if low.omega.size < data.freedoms:
        told = f"{low.omega.size} lines below {ARM_BAND:g} Hz"
        allowed = f"at least {data.freedoms}: an arm's own modes lie there; a slow cut has tooth-passing harmonics among them"
        raise InputError("cuts", told, allowed)
    draws = np.concatenate([np.zeros((1, priors.centre.size)), rng.standard_normal((STARTS - 1, priors.centre.size))])
    rest = [
        _FIRST_RESIDUAL * np.eye(DIRECTIONS)[np.tril_indices(DIRECTIONS)],
        np.log(priors.joint),
        np.zeros(len(data.base.coefficient_spread)),
    ]
    starts = [ArmStart(low, priors, np.concatenate([priors.centre + draw * priors.spread, *rest])) for draw in draws]
    return min(finite(map(perform, starts)), key=lambda each: each.cost)


def _spindle(
    data: PosedData, priors: ArmPriors, arm: Candidate, rng: np.random.Generator, map: Map, report: Report
) -> tuple[Solution, PosedMisfit]:
    """Arm and spindle: the best of those that begin at drawn spindles, its noise learned and modes taken in, twice."""
    numbers = drawn(DRAWS, rng)
    tasks = [DrawnSpindles(data, priors, arm, part) for part in np.split(numbers, TASKS)]
    costs = np.concatenate(finite(map(perform, tasks)))
    starts = [SpindleStart(data, priors, arm, numbers[k]) for k in np.argsort(costs, kind="stable")[:POLISHED]]
    best = min(finite(map(perform, starts)), key=lambda each: each.cost)
    point, weight, shares = best.point, np.ones(len(data.base.cut_ids)), (SPINDLE_SHARES[-1],) * len(data.base.axes)
    for _ in range(2):
        found, misfit = _learned(data, priors, point, shares, weight, report, _ROUGHLY)
        found = _grown(found, misfit, data, report)
        point, shares, weight = found.candidate.point, misfit.model_error, misfit.cut_weight
    return found, misfit


def _grown(found: Solution, misfit: PosedMisfit, data: PosedData, report: Report) -> Solution:
    """The solution with as many more modes as are worth it."""
    here = evidence(found, misfit)
    while True:
        grown = grow_modes(found, misfit, data.base.band_hz)
        value = evidence(grown, misfit)
        if value > here - WORTH:
            return found
        found, here = grown, value
        report(Stage.GROW, found.cost, found)


def _with_all_outputs(data: PosedData, found: Solution) -> tuple[FloatArray, Unknowns, FloatArray]:
    """Where the fit to gap and fixture apart begins, the triggers' tooth angles among the unknowns."""
    layout, nuisance = posed(found.layout), found.evaluation.nuisance
    angles, nuisance = tooth_angles(data.base, nuisance) if data.base.clampings else (np.zeros(0), nuisance)
    theta = np.concatenate([found.theta[: layout.force.stop], angles])
    return theta, replace(layout, clampings=angles.size), nuisance


def _learned(
    data: PosedData,
    priors: ArmPriors,
    start: tuple[FloatArray, Unknowns, FloatArray],
    shares: tuple[float, ...],
    weight: FloatArray,
    report: Report,
    tolerance: float,
) -> tuple[Solution, PosedMisfit]:
    """Polish and learn the noise in turns until it stays."""

    def misfit_of(shares: tuple[float, ...], weight: FloatArray) -> PosedMisfit:
        return PosedMisfit(data, priors, shares, weight)

    polished, misfit = refine_and_learn_noise(misfit_of, start, shares, weight, report, tolerance)
    assert isinstance(misfit, PosedMisfit)
    return polished, misfit
