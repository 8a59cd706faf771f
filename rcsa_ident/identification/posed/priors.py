"""What is known of a robot before any cut: the springs and dampers of its data sheet, believed to a factor, and spindles as elsewhere."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from rcsa_ident.arrays import FloatArray, frozen
from rcsa_ident.identification.coupled.priors import coupled_prior_rows
from rcsa_ident.identification.posed.parameters import PosedLayout
from rcsa_ident.identification.priors import PriorRows, Priors
from rcsa_ident.machine.robot.model import RobotModel

#: Standard deviations of the logarithms of a drive's stiffness, of that across a joint's axis, and of a damper.
DRIVE, TILT, DAMPER = 0.5, 0.7, 1.0
#: Damping over the root of the stiffness [sqrt(N m) s] where a data sheet has none: that of the arm of [huynh2020].
_USUAL_DAMPING = 0.269


@dataclass(frozen=True, slots=True, eq=False)
class ArmPriors:
    """What is known of all freedoms of an arm, and of the spindle in its hand.

    Parameters
    ----------
    centre, spread : arrays, shape (2 n,)
        Of the logarithms of stiffness [N m/rad] and damping [N m s/rad].
    spindle : Priors
    """

    centre: FloatArray
    spread: FloatArray
    spindle: Priors = field(default_factory=Priors)


def arm_priors(robot: RobotModel, tilts: bool = True) -> ArmPriors:
    """Return what a robot's file says of its springs and dampers."""
    chain = robot.chain(tilts)
    damping = np.where(chain.damping > 0.0, chain.damping, _USUAL_DAMPING * np.sqrt(chain.stiffness))
    stiff = np.full(chain.stiffness.size, TILT)
    stiff[chain.driven] = DRIVE
    centre = np.log(np.concatenate([chain.stiffness, damping]))
    return ArmPriors(frozen(centre), frozen(np.concatenate([stiff, np.full(stiff.size, DAMPER)])))


def posed_prior_rows(layout: PosedLayout, priors: ArmPriors, coefficients: tuple[float, ...] = ()) -> PriorRows:
    """Return the priors of a layout's unknowns.

    Parameters
    ----------
    layout : PosedLayout
    priors : ArmPriors
    coefficients : tuple of float
        Standard deviations of the logarithms of the cutting coefficients' scales.
    """
    rest, first = coupled_prior_rows(layout.spindle, priors.spindle, coefficients), 2 * layout.freedoms
    jacobian = np.zeros((first + rest.centre.size,) * 2)
    jacobian[np.arange(first), np.arange(first)] = 1.0 / priors.spread
    jacobian[first:, first:] = rest.jacobian
    centre, spread = (np.concatenate(pair) for pair in ((priors.centre, rest.centre), (priors.spread, rest.spread)))
    return PriorRows(
        frozen(centre), frozen(spread), frozen(first + rest.own, np.intp), frozen(first + rest.frequency, np.intp), frozen(jacobian)
    )
