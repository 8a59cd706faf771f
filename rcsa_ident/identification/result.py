"""The answer of an identification, and its story."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import StrEnum

from rcsa_ident.arrays import FloatArray
from rcsa_ident.coupling.joint import LumpedJoint
from rcsa_ident.cutting.force import ForceCoefficient
from rcsa_ident.dynamics.coordinates import Dof
from rcsa_ident.dynamics.modal import ModalModel
from rcsa_ident.identification.posterior import Posterior
from rcsa_ident.identification.progress import Step
from rcsa_ident.remarks import Remark, says


class Status(StrEnum):
    """May the answer be used? With doubts where it is suspect; one that has failed has no axes."""

    CONVERGED = "converged"
    SUSPECT = "suspect"
    FAILED = "failed"


class IdentificationCode(StrEnum):
    """What may be said of an identification: why it has failed, reasons for doubt, and what the data cannot tell."""

    NO_FINITE_FIT = "no-finite-fit"
    NOT_CONVERGED = "not-converged"
    WEAK_SIGNAL = "weak-signal"
    UNEXPLAINED = "unexplained"
    CONTRADICTING_CUTS = "contradicting-cuts"
    TWO_SOLUTIONS = "two-solutions"
    WIDE_POSTERIOR = "wide-posterior"
    ONE_TOOLING = "one-tooling"
    FEW_CUTS = "few-cuts"
    LINES_MISSED = "lines-missed"
    NOT_PASSIVE = "not-passive"
    JOINT_UNKNOWN = "joint-unknown"
    MODES_OUTSIDE_BAND = "modes-outside-band"
    COEFFICIENT_UNKNOWN = "coefficient-unknown"
    CUTS_WEIGHTED_DOWN = "cuts-weighted-down"


@dataclass(frozen=True, slots=True, eq=False)
class AxisResult:
    """What was found for one machine axis.

    Parameters
    ----------
    modes : ModalModel
        At the flange: translation and slope.
    joint : LumpedJoint
    chi2_per_point : float [-]
        Mean squared residual in standard deviations of noise and model error.
    per_tooling : mapping of str to float
    model_error : float [-]
        Share of each line that neither the model nor the records' noise explains, learned from the residuals.
    parameters : tuple of str
        Names of the unknowns of flange and joint, in the posterior's order.
    posterior : Posterior or None
        Where the method gives one.
    measured : mapping with arrays omega, value, model, cut (index), coherence
        Lines without delay beside the model's: what a plot shows.
    """

    modes: ModalModel
    joint: LumpedJoint
    chi2_per_point: float
    per_tooling: Mapping[str, float]
    model_error: float
    parameters: tuple[str, ...]
    posterior: Posterior | None
    measured: Mapping[str, FloatArray]


@dataclass(frozen=True, slots=True, eq=False)
class Identification:
    """Modes of machine and spindle, joint, delays; with status, statistics, seed.

    Parameters
    ----------
    status : Status
    reasons : tuple of Remark
        Why it is suspect or has failed.
    notes : tuple of Remark
        What the data cannot tell, and what was done about single cuts.
    coefficients : mapping of ForceCoefficient to (float, float)
        What was found of the forces' uncertain coefficients and its standard deviation: logarithms of scales, run-outs in units of
        the cutting model's reference.
    seed : int
    method : str
    axes : mapping of Dof to AxisResult
    cut_ids : tuple of str, length k
    delay, delay_std : arrays, shape (k,) [s]
        Tooth 1 stands at immersion 0 that much after the record's start.
    spindle_speed : array, shape (k,) [rad/s]
    trace : tuple of Step
        The search in order.
    """

    status: Status
    reasons: tuple[Remark, ...]
    seed: int
    method: str
    axes: Mapping[Dof, AxisResult]
    cut_ids: tuple[str, ...]
    delay: FloatArray
    delay_std: FloatArray
    spindle_speed: FloatArray
    trace: tuple[Step, ...]
    notes: tuple[Remark, ...] = ()
    coefficients: Mapping[ForceCoefficient, tuple[float, float]] = field(default_factory=dict)

    @property
    def at_minimum(self) -> bool:
        """False where the search has failed, or still gained when its steps ran out: there is no answer to be used."""
        return self.status is not Status.FAILED and not says(self.reasons, IdentificationCode.NOT_CONVERGED)
