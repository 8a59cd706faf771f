"""What is known of both planes before any cut."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from rcsa_ident.base.arrays import frozen
from rcsa_ident.identification.coupled.parameters import EVERY_PAIR, CoupledLayout
from rcsa_ident.identification.parameters import DAMPING_UNIT, lower_triangle
from rcsa_ident.identification.priors import PriorRows, Priors


@lru_cache(maxsize=64)
def coupled_prior_rows(layout: CoupledLayout, priors: Priors, coefficients: tuple[float, ...] = ()) -> PriorRows:
    """Return the priors of a layout's unknowns: those of one plane, with as much room for what is felt across.

    Parameters
    ----------
    layout : CoupledLayout
    priors : Priors
    coefficients : tuple of float
        Standard deviations of the logarithms of the cutting coefficients' scales.
    """
    m = layout.modes
    diagonal = lower_triangle(m)[2]
    centre, spread = np.zeros(layout.size), np.empty(layout.size)
    centre[:m], spread[:m] = np.log(2.0 * np.pi * priors.frequency_hz), priors.frequency_spread
    spread[layout.shapes] = priors.shape
    own = layout.damping.start + np.flatnonzero(diagonal)
    spread[layout.damping] = np.where(diagonal, 0.5 * priors.damping_spread, priors.damping_coupling)
    centre[own] = 0.5 * np.log(2.0 * priors.damping_ratio) - np.log(DAMPING_UNIT)
    spread[layout.residual] = priors.residual
    spread[layout.fixture_shapes], spread[layout.fixture_residual] = priors.shape, priors.residual**2
    spread[layout.softenings] = priors.softening
    # an entry of G is the product of two slopes; twice the share of rotary kinetic energy bounds it
    spread[layout.skews] = priors.skew if layout.skew == EVERY_PAIR else np.sqrt(priors.skew)
    centre[layout.joint], spread[layout.joint] = np.log(priors.joint), priors.joint_spread
    spread[layout.force], spread[layout.clamping] = coefficients, priors.tooth_angle
    jacobian = np.diag(1.0 / spread)
    jacobian[own, np.arange(m)] = -0.5 / spread[own]
    return PriorRows(frozen(centre), frozen(spread), frozen(own, np.intp), frozen(np.arange(m), np.intp), frozen(jacobian))
