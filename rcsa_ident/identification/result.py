"""The answer of an identification, and its story."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from rcsa_ident.arrays import FloatArray
from rcsa_ident.coupling.joint import LumpedJoint
from rcsa_ident.dynamics.coordinates import Dof
from rcsa_ident.dynamics.modal import ModalModel
from rcsa_ident.identification.posterior import MachineAxis, Posterior
from rcsa_ident.identification.status import Status
from rcsa_ident.machine.spindle import Spindle


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

    @property
    def machine(self) -> MachineAxis:
        """This axis as a tip feels it."""
        return MachineAxis(Spindle(self.modes), self.joint, self.posterior)


@dataclass(frozen=True, slots=True, eq=False)
class Identification:
    """Modes of machine and spindle, joint, delays; with status, statistics, seed.

    Parameters
    ----------
    status : Status
    reasons : tuple of str
        Why it is suspect or has failed.
    notes : tuple of str
        What the data cannot tell, and what was done about single cuts.
    coefficients : mapping of str to (float, float)
        What was found of the forces' uncertain coefficients and its standard deviation: logarithms of scales, run-outs in units of
        the cutting model's reference.
    seed : int
    method : str
    axes : mapping of Dof to AxisResult
    cut_ids : tuple of str, length k
    delay, delay_std : arrays, shape (k,) [s]
        Tooth 1 stands at immersion 0 that much after the record's start.
    spindle_speed : array, shape (k,) [rad/s]
    trace : tuple of (axis, stage, cost)
        The search in order.
    """

    status: Status
    reasons: tuple[str, ...]
    seed: int
    method: str
    axes: Mapping[Dof, AxisResult]
    cut_ids: tuple[str, ...]
    delay: FloatArray
    delay_std: FloatArray
    spindle_speed: FloatArray
    trace: tuple[tuple[str, str, float], ...]
    notes: tuple[str, ...] = ()
    coefficients: Mapping[str, tuple[float, float]] = field(default_factory=dict)
