"""Forces on a tool along its path: over time, without what is too fast for the arm to answer, or the same on all moves."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.signal

from rcsa_ident.base.arrays import FloatArray, frozen
from rcsa_ident.base.errors import InputError, positive
from rcsa_ident.toolpath.path import ToolPath

#: Above it forces are left aside [Hz]: teeth come and go faster than an arm follows.
CUTOFF = 100.0
_ORDER = 2
#: Instants of a period of the fastest that is kept, and how many instants there may be.
_PER_PERIOD, _MOST = 50.0, 10_000_000
#: A force's place may be that far from the path [m]: what the tool's own deviation is, and more.
_NEAR = 5e-3
#: Rounding of instants makes steps no shorter than by that share.
_ROUNDED = 1e-6


@dataclass(frozen=True, slots=True, eq=False)
class ForceAlongPath:
    """Forces of the workpiece on the tool over the path's time, in the axes of the base; the first and the last one hold beyond.

    `time` [s], shape (m,): rising
    `force` [N], shape (m, 3)

    Examples
    --------
    >>> ForceAlongPath(np.array([0.0, 1.0]), np.array([[0.0, 0.0, 0.0], [10.0, 0.0, 4.0]])).at(np.array([0.5, 2.0])).tolist()
    [[5.0, 0.0, 2.0], [10.0, 0.0, 4.0]]
    """

    time: FloatArray
    force: FloatArray

    def __post_init__(self) -> None:
        object.__setattr__(self, "time", frozen(self.time))
        object.__setattr__(self, "force", frozen(self.force))
        if self.time.ndim != 1 or not self.time.size or self.force.shape != (self.time.size, 3):
            raise InputError("forces", self.force.shape, "three forces an instant, shape (m, 3) [N]")
        if not (np.all(np.isfinite(self.time)) and np.all(np.isfinite(self.force)) and np.all(np.diff(self.time) > 0.0)):
            raise InputError("forces", "instants that do not rise, or no numbers", "finite forces [N] at rising instants [s]")

    def at(self, times: FloatArray) -> FloatArray:
        """Return the forces at instants [s], shape (k, 3) [N]."""
        return np.stack([np.interp(times, self.time, own) for own in self.force.T], axis=1)

    def low_passed(self, cutoff: float = CUTOFF) -> ForceAlongPath:
        """Return the forces without what is faster than a frequency [Hz], not delayed; as they are where they hold nothing faster."""
        positive("cutoff", cutoff, "Hz")
        # a filter's cutoff lies below half the rate
        if self.time.size < 3 or 0.5 / np.min(np.diff(self.time)) <= cutoff * (1.0 + _ROUNDED):
            return self
        span = self.time[-1] - self.time[0]
        step = max(np.min(np.diff(self.time)), 1.0 / (_PER_PERIOD * cutoff))
        count = int(np.ceil(span / step - 1e-9)) + 1
        if count > _MOST:
            raise InputError("forces", f"{span:.0f} s of them", f"at most {_MOST * step:.0f} s")
        even, step = np.linspace(self.time[0], self.time[-1], count), span / (count - 1)
        sections = scipy.signal.butter(_ORDER, cutoff, fs=1.0 / step, output="sos")
        # beyond the ends they go on as they are there, for two periods of what is left out
        beyond = min(int(np.ceil(2.0 / (cutoff * step))), count - 1)
        means = (self._impulse(even + 0.5 * step) - self._impulse(even - 0.5 * step)) / step
        return ForceAlongPath(even, scipy.signal.sosfiltfilt(sections, means, axis=0, padtype="constant", padlen=beyond))

    def _impulse(self, times: FloatArray) -> FloatArray:
        """Integral of the forces up to instants, shape (k, 3) [N s]."""
        gaps = np.diff(self.time)[:, None]
        sums = np.concatenate([np.zeros((1, 3)), np.cumsum(0.5 * (self.force[1:] + self.force[:-1]) * gaps, axis=0)])
        k = np.clip(np.searchsorted(self.time, times, side="right") - 1, 0, self.time.size - 2)
        within = np.clip(times, self.time[0], self.time[-1])
        ahead = (within - self.time[k])[:, None]
        slope = (self.force[k + 1] - self.force[k]) / gaps[k]
        return sums[k] + self.force[k] * ahead + 0.5 * slope * ahead**2 + self.at(times) * (times - within)[:, None]

    def check_places(self, places: FloatArray, path: ToolPath) -> None:
        """Refuse forces that were found at other places, shape (m, 3) [m], than the tool has on a path at their instants."""
        # where a rapid move takes no time the tool is at both of its ends
        ends = [np.append(True, np.diff(path.times) > 0.0), np.append(np.diff(path.times) > 0.0, True)]
        along = [np.stack([np.interp(self.time, path.times[kept], own) for own in path.places[kept].T], axis=1) for kept in ends]
        away = np.min([np.linalg.norm(places - own, axis=1) for own in along], axis=0)
        worst = int(np.argmax(away))
        if away[worst] > _NEAR:
            found = f"{1e3 * away[worst]:.1f} mm from the path at {self.time[worst]:.3f} s"
            raise InputError("forces", found, f"forces of this path: within {1e3 * _NEAR:g} mm of where it is then")


def on_all_moves(path: ToolPath, force: FloatArray, of_path: bool = False) -> ForceAlongPath:
    """Return the same force on all cutting moves of a path, none on the rapid ones.

    `force` [N], shape (3,): in the base's axes; or, `of_path`, along the feed, to its left as seen against the tool's axis, and along the
        tool's axis

    Examples
    --------
    Around a corner a force against the feed turns with it:

    >>> corner = ToolPath(np.array([[0.0, 0.0, 0.0], [0.1, 0.0, 0.0], [0.1, 0.1, 0.0]]), feed=np.full(3, 0.05))
    >>> on_all_moves(corner, np.array([-50.0, 0.0, 0.0]), of_path=True).at(np.array([1.0, 3.0])).tolist()
    [[-50.0, 0.0, 0.0], [0.0, -50.0, 0.0]]
    """
    told = np.asarray(force, dtype=float)
    if told.shape != (3,) or not np.all(np.isfinite(told)):
        raise InputError("force", told.tolist(), "three finite forces [N]")
    times, instants, forces = path.times, [], []
    for k, (move, cuts) in enumerate(zip(path.moves, path.cutting, strict=True)):
        if times[k + 1] <= times[k]:
            continue
        own = told
        if of_path:
            forward = move / np.linalg.norm(move)
            left = np.cross(path.axes[k + 1], forward)
            size = np.linalg.norm(left)
            # straight along the tool nothing is to its left
            left = left / size if size > 1e-6 else np.zeros(3)
            own = told[0] * forward + told[1] * left + told[2] * path.axes[k + 1]
        # it changes within a thousandth of a move
        margin = 1e-3 * (times[k + 1] - times[k])
        instants += [times[k] + margin, times[k + 1] - margin]
        forces += [own * cuts] * 2
    if not instants:
        raise InputError("path", "no move", "one or more at a feed")
    return ForceAlongPath(np.array(instants), np.array(forces))
