"""What a tool that gives way along its axis would change, where nobody knows whether it does."""

from __future__ import annotations

import numpy as np

from rcsa_ident.cutting.process import MillingProcess
from rcsa_ident.dynamics.receptance import Receptance
from rcsa_ident.stability.depth_march import finer, ladder, march
from rcsa_ident.stability.result import StabilityLobes
from rcsa_ident.stability.tip_modes import DIRECTIONS

#: A usual axial stiffness and damping of a spindle [N/m], [-], and its resonances over the chatter's frequency.
STIFFNESS, DAMPING, PLACES = 5e7, 0.03, (0.9, 1.1)
#: Speeds that are asked, at most, beside that of the lowest limit.
_SPEEDS = 12
#: Change of a limit, as a share of it, that is worth a word.
_WORTH = 0.1


def axial_doubt(tip: Receptance, process: MillingProcess, found: StabilityLobes) -> str:
    """Return by how much limits of a shaped cutter, found with a rigid Z, would move if the spindle gave way along its axis.

    Parameters
    ----------
    tip : Receptance
        In X and Y, with slopes or without; Z rigid.
    process : MillingProcess
    found : StabilityLobes
        Its limits.

    Returns
    -------
    str
        Empty where limits would move by less than a tenth, or nothing chatters.

    Notes
    -----
    Asked by the zero-order method, with an axial mode beside the chatter at the lowest limit; proportions of its limits are told.
    """
    limits = found.limit_depth
    if not np.any(np.isfinite(limits)) or not np.isfinite(found.chatter_frequency[int(np.argmin(limits))]):
        return ""
    chatter = float(found.chatter_frequency[int(np.argmin(limits))])
    few = np.linspace(0, limits.size - 1, min(limits.size, _SPEEDS)).astype(int)
    speeds, max_depth = found.spindle_speed[np.union1d(few, np.argmin(limits))], found.max_depth
    omega, planar = finer(tip)
    known = planar.shape[1]
    rigid = march(omega, planar, process, ladder(process, known, max_depth), speeds).limit
    all_of_it = max(known, 3)
    steps, ratios = ladder(process, all_of_it, max_depth), []
    for place in PLACES:
        values = np.zeros((omega.size, all_of_it, all_of_it), dtype=complex)
        values[:, :known, :known] = planar
        x = omega / (place * chatter)
        values[:, 2, 2] = 1.0 / (STIFFNESS * (1.0 - x**2 + 2j * DAMPING * x))
        soft = march(omega, values, process, steps, speeds).limit
        both = np.isfinite(rigid) & np.isfinite(soft)
        ratios += (soft[both] / rigid[both]).tolist()
    if not ratios or max(abs(min(ratios) - 1.0), abs(max(ratios) - 1.0)) <= _WORTH:
        return ""
    return (
        f"{DIRECTIONS[2]} is taken as rigid: with an axial stiffness of {1e-6 * STIFFNESS:.0f} N/µm and a resonance near "
        f"{chatter / (2.0 * np.pi):.0f} Hz limits would be {min(ratios):.2f} to {max(ratios):.2f} times these; one tap along the axis tells"
    )
