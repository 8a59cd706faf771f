"""What is known of a robot before any cut: the springs and dampers of its data sheet, believed to a factor, and spindles as elsewhere."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import lru_cache

import numpy as np

from rcsa_ident.base.arrays import FloatArray, frozen
from rcsa_ident.identification.arm.parameters import PosedLayout, unknown_of
from rcsa_ident.identification.parameters import DAMPING_UNIT, lower_triangle
from rcsa_ident.identification.priors import PriorRows, Priors
from rcsa_ident.machine.robot.model import RobotModel

#: Standard deviations of a drive's compliance over the data sheet's, of that across a joint's axis, and of a damper's logarithm.
DRIVE, TILT, DAMPER = 0.6, 0.8, 1.0
#: Spread of what the housing's motion pulls a mode of the spindle with [sqrt(kg)]: a shaft of some kilograms.
PULL = 2.0
#: Standard deviations of the logarithms of a link's mass and of the payload's, which somebody has weighed.
MASS, PAYLOAD = 0.05, 0.02
#: Damping over the root of the stiffness [sqrt(N m) s] where a data sheet has none: that of the arm of [huynh2018].
_USUAL_DAMPING = 0.269


@dataclass(frozen=True, slots=True, eq=False)
class ArmPriors:
    """What is known of all freedoms of an arm, and of the spindle in its hand.

    Parameters
    ----------
    centre, spread : arrays, shape (2 n + b,)
        Of the compliances' unknowns, of the logarithms of damping [N m s/rad] and of the bodies' masses over those of the data sheet.
    springs : tuple of float, length n [N m/rad]
        The data sheet's.
    spindle : Priors
    """

    centre: FloatArray
    spread: FloatArray
    springs: tuple[float, ...]
    spindle: Priors = field(default_factory=Priors)


def arm_priors(robot: RobotModel, tilts: bool = True) -> ArmPriors:
    """Return what a robot's file says of its springs and dampers."""
    chain = robot.chain(tilts)
    damping = np.where(chain.damping > 0.0, chain.damping, _USUAL_DAMPING * np.sqrt(chain.stiffness))
    stiff = np.full(chain.stiffness.size, TILT)
    stiff[chain.driven] = DRIVE
    heavier = np.array([MASS] * len(robot.joints) + [PAYLOAD] * (robot.payload is not None))
    as_told = np.full(stiff.size, float(unknown_of(np.array(1.0))))
    centre = np.concatenate([as_told, np.log(damping), np.zeros(heavier.size)])
    spread = np.concatenate([stiff, np.full(stiff.size, DAMPER), heavier])
    return ArmPriors(frozen(centre), frozen(spread), tuple(chain.stiffness.tolist()))


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
    arm = slice(0, layout.weights.stop)
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
