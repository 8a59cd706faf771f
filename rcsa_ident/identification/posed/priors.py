"""What is known of a robot before any cut: the springs and dampers of its data sheet, believed to a factor, and spindles as elsewhere."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import lru_cache

import numpy as np

from rcsa_ident.arrays import FloatArray, frozen
from rcsa_ident.identification.parameters import DAMPING_UNIT, lower_triangle
from rcsa_ident.identification.posed.parameters import PosedLayout
from rcsa_ident.identification.priors import PriorRows, Priors
from rcsa_ident.machine.robot.model import RobotModel

#: Standard deviations of the logarithms of a drive's stiffness, of that across a joint's axis, and of a damper.
DRIVE, TILT, DAMPER = 0.5, 0.7, 1.0
#: Spread of what the housing's motion pulls a mode of the spindle with [sqrt(kg)]: a shaft of some kilograms.
PULL = 2.0
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


@lru_cache(maxsize=64)
def posed_prior_rows(layout: PosedLayout, priors: ArmPriors, coefficients: tuple[float, ...] = ()) -> PriorRows:
    """Return the priors of a layout's unknowns.

    Parameters
    ----------
    layout : PosedLayout
    priors : ArmPriors
    coefficients : tuple of float
        Standard deviations of the logarithms of the cutting coefficients' scales.
    """
    known, m = priors.spindle, layout.modes
    diagonal = lower_triangle(m)[2]
    centre, spread = np.zeros(layout.size), np.empty(layout.size)
    arm = slice(0, 2 * layout.freedoms)
    centre[arm], spread[arm] = priors.centre, priors.spread
    centre[layout.frequencies], spread[layout.frequencies] = np.log(2.0 * np.pi * known.frequency_hz), known.frequency_spread
    spread[layout.shapes], spread[layout.pulls] = known.shape, PULL
    own = layout.factor.start + np.flatnonzero(diagonal)
    spread[layout.factor] = np.where(diagonal, 0.5 * known.damping_spread, known.damping_coupling)
    centre[own] = 0.5 * np.log(2.0 * known.damping_ratio) - np.log(DAMPING_UNIT)
    spread[layout.residual] = known.residual
    centre[layout.joint], spread[layout.joint] = np.log(known.joint), known.joint_spread
    spread[layout.force], spread[layout.clamping] = coefficients, known.tooth_angle
    frequency = np.arange(m) + layout.frequencies.start
    jacobian = np.diag(1.0 / spread)
    jacobian[own, frequency] = -0.5 / spread[own]
    return PriorRows(frozen(centre), frozen(spread), frozen(own, np.intp), frozen(frequency, np.intp), frozen(jacobian))
