"""Zero-order limits of shaped cutters: the mean stiffness changes with the depth, which is marched through."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from rcsa_ident.base.arrays import ComplexArray, FloatArray
from rcsa_ident.cutting.process import MillingProcess
from rcsa_ident.cutting.teeth import edges_at
from rcsa_ident.dynamics.receptance import Receptance
from rcsa_ident.stability._kernels import depth as kernels
from rcsa_ident.stability._kernels.depth_at_speed import receptance_at
from rcsa_ident.stability.regeneration import directions_of, regeneration

#: Ratio of the depths at which the mean stiffness is asked, and how far below the largest they begin.
_RATIO, _LEAST = 1.08, 1e-3
#: Strengths of a material: the stiffness is proportional to them, so that few will do.
_STRENGTHS = 16
#: Change of a direct receptance, as a share, from one frequency to the next; and into how many at most those of the receptance are cut.
_CHANGE, _MOST = 0.05, 4


class Marched(NamedTuple):
    """Limits of a cut by the zero-order method.

    `limit`, `chatter`: arrays, shape (m,) [m], [rad/s]; infinite and not a number where there is none up to the ladder's end
    `lobe`, shape (m,): -1 where there is none
    `absolute`, `frequency`: float [m], [rad/s]; the smallest depth of all speeds and where it vibrates, of teeth that are alike; infinite
        and not a number where there is none
    """

    limit: FloatArray
    chatter: FloatArray
    lobe: NDArray[np.intp]
    absolute: float
    frequency: float


class DepthLadder(NamedTuple):
    """Depths of a cut, ascending, and what it does at each.

    `depth` [m], shape (d,)
    `stiffness` [N/m], shape (d, r, r): mean over a turn, of 1 - e^{-i w tau}
    `pitch`, `spread` [rad], shape (d, teeth): mean distance of each tooth to the one ahead of it, and its change from the tip to the depth
    """

    depth: FloatArray
    stiffness: FloatArray
    pitch: FloatArray
    spread: FloatArray


def ladder(process: MillingProcess, directions: int, max_depth: float) -> DepthLadder:
    """Return a cut's mean stiffness at depths up to the largest, or to how deep the cutter cuts."""
    count = int(np.ceil(-np.log(_LEAST) / np.log(_RATIO))) + 1
    depth = process.within_reach(max_depth) * np.geomspace(_LEAST, 1.0, count)
    stiffness = np.array([regeneration(process, float(a), directions_of(directions)).mean for a in depth])
    pitch = edges_at(process.cutter, depth, np.full(depth.size, 0.5 * np.pi)).pitch.T
    at_tip = process.cutter.pitch
    return DepthLadder(depth, stiffness, 0.5 * (pitch + at_tip), np.abs(pitch - at_tip))


def strengths(process: MillingProcess, directions: int, depth: float, most: float) -> DepthLadder:
    """Return a cut at one depth [m] as a ladder of strengths, up to so many times what it is; they stand in the place of the depths."""
    times = most * np.geomspace(_LEAST, 1.0, _STRENGTHS)
    mean = regeneration(process, depth, directions_of(directions)).mean
    pitch = edges_at(process.cutter, np.array([depth]), np.array([0.5 * np.pi])).pitch.T
    both = np.stack([0.5 * (pitch + process.cutter.pitch), np.abs(pitch - process.cutter.pitch)])
    distance, spread = np.repeat(both, times.size, axis=1)
    return DepthLadder(times, times[:, None, None] * mean, distance, spread)


def finer(tip: Receptance) -> tuple[FloatArray, ComplexArray]:
    """Return frequencies above 0, more than the receptance has where it changes quickly, and the receptance there, shape (n, r, r)."""
    kept = tip.omega > 0.0
    omega, values = np.ascontiguousarray(tip.omega[kept]), tip.values[kept]
    r = values.shape[1]
    own = np.einsum("nii->ni", values)
    size = np.maximum(np.maximum(np.abs(own[1:]), np.abs(own[:-1])), 1e-300)
    pieces = np.clip(np.ceil(np.max(np.abs(np.diff(own, axis=0)) / size, axis=1) / _CHANGE), 1, _MOST).astype(int)
    # each line, and behind it so many as its neighbour is far
    first = np.repeat(np.arange(pieces.size), pieces)
    share = (np.arange(first.size) - np.repeat(np.cumsum(pieces) - pieces, pieces)) / pieces[first]
    fine = np.append(omega[first] + share * np.diff(omega)[first], omega[-1])
    found = receptance_at(omega, np.ascontiguousarray(values.reshape(-1, r * r)), fine)
    return fine, np.ascontiguousarray(found.reshape(-1, r, r))


def march(omega: FloatArray, tips: ComplexArray, process: MillingProcess, steps: DepthLadder, speeds: FloatArray) -> Marched:
    """Return the zero-order limits at speeds [rad/s] of a tip at frequencies, as `finer` gives it.

    Notes
    -----
    With teeth that are alike each frequency has its depths and phases, and each speed the lowest depth whose phase it meets; with unlike
    ones each speed asks the ladder's depths one after the other.
    """
    teeth = process.cutter.teeth
    # a direction that is rigid has no part in the loop: its eigenvalues are those of the others, and a zero
    moves = np.flatnonzero(np.any(tips, axis=(0, 2)) | np.any(tips, axis=(0, 1)))
    tips, stiffness = (np.ascontiguousarray(each[:, moves[:, None], moves]) for each in (tips, steps.stiffness))
    if process.cutter.equally_spaced:
        depth, phase = kernels.boundaries(tips, steps.depth, stiffness)
        limit, chatter, lobe = kernels.lowest(omega, depth, phase, 2.0 * np.pi / (teeth * speeds))
        found = np.nanmin(np.where(np.isnan(depth), np.inf, depth), axis=(1, 2))
        k = int(np.argmin(found))
        exists = bool(np.isfinite(found[k]))
        return Marched(limit, chatter, lobe.astype(np.intp), float(found[k]), float(omega[k]) if exists else np.nan)
    each = [kernels.first_of_ladder(omega, tips, steps.depth, stiffness, steps.pitch / s, steps.spread / s) for s in speeds]
    limit, chatter = np.array(each).reshape(-1, 2).T
    lobe = np.where(np.isfinite(limit), np.nan_to_num(chatter) / (teeth * speeds), -1).astype(np.intp)
    return Marched(limit, chatter, lobe, np.inf, np.nan)
