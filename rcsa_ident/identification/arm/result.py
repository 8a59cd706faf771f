"""The answer of an identification of a robot: its posterior, and whether it may be used."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from rcsa_ident.base.arrays import FloatArray
from rcsa_ident.base.errors import InputError
from rcsa_ident.base.remarks import Remark, RemarkCode
from rcsa_ident.base.shown import Shown
from rcsa_ident.identification.arm.misfit import PosedMisfit
from rcsa_ident.identification.arm.posterior import RobotPosterior, RobotUnknowns
from rcsa_ident.identification.arm.unknowns import posed, stiffening, unpack
from rcsa_ident.identification.levenberg_marquardt import Solution
from rcsa_ident.identification.status import Status
from rcsa_ident.machine.robot.model import RobotModel

#: Share of each line left unexplained above which the answer is suspect, and of the cuts that may contradict the others.
WORST_MODEL_ERROR, MOST_BAD_CUTS = 0.02, 0.1
#: Postures with fewer of which an answer is suspect.
FEWEST_POSTURES = 3
#: A spring is told by the cuts where its deviation is below this share of what was believed.
TOLD = 0.5


class RobotCode(RemarkCode):
    """What may be said of an identification of a robot."""

    NOT_CONVERGED = "not-converged"
    UNEXPLAINED = "unexplained"
    CONTRADICTING_CUTS = "contradicting-cuts"
    FEW_POSTURES = "few-postures"
    ONE_TOOLING = "one-tooling"
    NOT_PASSIVE = "not-passive"
    SPRINGS_UNKNOWN = "springs-unknown"
    DRAWINGS_EXACT = "drawings-exact"


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class RobotIdentification(Shown):
    """What was found of a robot.

    `reasons`, `notes`: reasons for doubt, and what the data cannot tell
    `model_error`: tuple of float [-], share of the lines of X and of Y that neither model nor noise explains
    `chi2_per_point` [-]
    `postures` [rad], shape (c, j): of the cuts, each once
    `band_hz`: (float, float) [Hz]
    """

    status: Status
    reasons: tuple[Remark, ...]
    notes: tuple[Remark, ...]
    seed: int
    posterior: RobotPosterior
    model_error: tuple[float, ...]
    chi2_per_point: float
    cut_ids: tuple[str, ...]
    postures: FloatArray
    band_hz: tuple[float, float]

    @property
    def springs(self) -> tuple[tuple[str, float, float, bool], ...]:
        """Name, stiffness [N m/rad], its deviation as a share, and whether the cuts tell it, of every freedom."""
        posterior = self.posterior
        best, own = posterior.best, posterior.best.layout.arm.parts["compliances"]
        spread, stiffness = np.sqrt(np.diag(posterior.covariance))[own], unpack(best.theta, best.layout).stiffness
        told = spread < TOLD * posterior.believed[own]
        share = spread * np.abs(stiffening(best.theta, best.layout))
        names = posterior.sheet.spring_names(posterior.tilts)
        return tuple(zip(names, stiffness.tolist(), share.tolist(), told.tolist(), strict=True))

    def __str__(self) -> str:
        best = self.posterior.best.layout
        told = sum(each[3] for each in self.springs)
        return (
            f"{self.posterior.sheet.name}, {self.status}: {told} of {best.arm.freedoms} springs told, {best.modes} modes of the spindle, "
            f"{len(self.cut_ids)} cuts at {len(self.postures)} postures"
        )


def answer(
    sheet: RobotModel, tilts: bool, found: Solution, misfit: PosedMisfit, rival: Solution, seed: int, postures: FloatArray
) -> RobotIdentification:
    """Return what a fit has found, and the doubts about it. `misfit`: the one whose minimum `found` is. `postures` [rad], shape (c, j)."""
    covariance = np.linalg.inv(found.evaluation.hessian)
    layout, data = posed(found.layout), misfit.data
    own = layout.machine
    prior = misfit.rows(layout).spread
    best, other = (_unknowns(each) for each in (found, rival))
    posterior = RobotPosterior(sheet, tilts, best, 0.5 * (covariance + covariance.T)[own, own], prior[own], (other,))
    chi2 = sum(found.evaluation.chi2) / misfit.points
    result = RobotIdentification(Status.CONVERGED, (), (), seed, posterior, misfit.model_error, chi2, data.cut_ids, postures, data.band_hz)
    reasons = _reasons(result, found, misfit)
    notes = _notes(result)
    return replace(result, status=Status.SUSPECT if reasons else Status.CONVERGED, reasons=tuple(reasons), notes=tuple(notes))


def _unknowns(solution: Solution) -> RobotUnknowns:
    layout = posed(solution.layout)
    return RobotUnknowns(solution.theta[layout.machine], replace(layout, coefficients=0, clampings=0))


def _reasons(result: RobotIdentification, found: Solution, misfit: PosedMisfit) -> list[Remark]:
    reasons = []
    if not found.converged:
        words = f"not converged: the fit was still improving after {found.steps} steps"
        reasons.append(Remark(RobotCode.NOT_CONVERGED, words))
    for axis, share in zip(misfit.data.axes, result.model_error, strict=True):
        if share > WORST_MODEL_ERROR:
            words = (
                f"{str(axis.axis).upper()}: the model leaves {100 * share:.1f} % of each line unexplained (limit "
                f"{100 * WORST_MODEL_ERROR:g} %): cutting coefficients, toolings, postures, masses or lengths of the arm may be wrong"
            )
            reasons.append(Remark(RobotCode.UNEXPLAINED, words))
    bad = misfit.cut_weight < 1.0
    if np.mean(bad) > MOST_BAD_CUTS:
        names = ", ".join(np.array(misfit.data.cut_ids)[bad][:5].tolist())
        words = f"cuts that contradict the others: {np.sum(bad)} of {bad.size}, among them {names}"
        reasons.append(Remark(RobotCode.CONTRADICTING_CUTS, words))
    if heavy := too_heavy_at(result.posterior, result.postures):
        words = (
            f"the spindle's modes swing more mass than the hand carries at {heavy} of {len(result.postures)} postures: no tip is told there"
        )
        reasons.append(Remark(RobotCode.NOT_PASSIVE, words))
    if len(result.postures) < FEWEST_POSTURES:
        words = f"cuts at {len(result.postures)} postures: at least {FEWEST_POSTURES} tell the joints apart, better 6"
        reasons.append(Remark(RobotCode.FEW_POSTURES, words))
    if len(misfit.data.toolings) < 2:
        words = "only one tooling: translation and slope of the flange cannot be separated; cut with a second, different holder"
        reasons.append(Remark(RobotCode.ONE_TOOLING, words))
    return reasons


def too_heavy_at(posterior: RobotPosterior, postures: FloatArray) -> int:
    """Return at how many postures the spindle's modes would swing more mass than the hand carries: nothing in the fit forbids it."""
    spindle, count = posterior.best.spindle, 0
    for posture in postures:
        try:
            spindle.on(posterior.arm.at(posture))
        except InputError:
            count += 1
    return count


def _notes(result: RobotIdentification) -> list[Remark]:
    unknown = [name for name, _, _, told in result.springs if not told]
    if not unknown:
        return []
    words = f"springs that these cuts do not tell, left near what the data sheet says: {', '.join(unknown)}"
    return [Remark(RobotCode.SPRINGS_UNKNOWN, words)]
