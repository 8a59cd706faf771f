"""Regenerative milling in the time domain on the finite-element rotor."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from rcsa_ident.base.arrays import FloatArray
from rcsa_ident.base.errors import InputError
from rcsa_ident.cutting.coefficients import CuttingCoefficients
from rcsa_ident.cutting.conditions import CuttingConditions
from rcsa_ident.cutting.cutter import Cutter
from rcsa_ident.virtual._kernels import mill
from rcsa_ident.virtual.changes import ChipLaw
from rcsa_ident.virtual.levels import levels_of
from rcsa_ident.virtual.reduction import Poles
from rcsa_ident.virtual.workpiece_side import WORKPIECE

#: Harmonics of the spindle from which the state at the start is built.
_START_ORDERS = 512


@dataclass(frozen=True, slots=True, eq=False)
class Course:
    """How a cut goes on, instant by instant.

    `angle` [rad], shape (n,): immersion angle of tooth 1, growing, by less than the angle between two teeth each
    `way` [m], shape (n,): of the tool along the feed
    `width` [-], shape (n,): share of the axial depth that is in the material: it rises at the entry and falls at the exit
    """

    angle: FloatArray
    way: FloatArray
    width: FloatArray


@dataclass(frozen=True, slots=True, eq=False)
class CutHistory:
    """One simulated cut.

    `step` [s]
    `angle` [rad], shape (n,): immersion angle of tooth 1 at the tip, from the feed's normal, growing
    `force` [N], shape (n, 2): force on the tool, machine axes X and Y
    `tip`, `flange`, `fixture` [m], shape (n, 2): absolute displacements, X and Y; the tip's is relative to the workpiece where that gives
        way, too, and the flange's is seen where its sensors look
    `acceleration` [m/s^2], shape (n, 2 + 2 h): acceleration of the fixture, then of each of h further points, of the housing and last of
        the workpiece, X and Y
    `axial` [N], shape (n,): force on the tool along z, from the tip to the spindle; a machine without that input is rigid that way
    """

    step: float
    angle: FloatArray
    force: FloatArray
    tip: FloatArray
    flange: FloatArray
    fixture: FloatArray
    acceleration: FloatArray
    axial: FloatArray = field(default_factory=lambda: np.zeros(0))

    def after(self, count: int) -> CutHistory:
        """Return the history without its first `count` instants."""
        series = (self.angle, self.force, self.tip, self.flange, self.fixture, self.acceleration, self.axial)
        return CutHistory(self.step, *(values[count:] for values in series))


def mill_cut(
    dynamics: Poles | Sequence[Poles],
    cutter: Cutter,
    conditions: CuttingConditions,
    coefficients: CuttingCoefficients,
    step: float,
    count: int,
    start_angle: float = 0.0,
    slices: int = 8,
    course: Course | None = None,
    law: ChipLaw | None = None,
) -> CutHistory:
    """Simulate a cut of `count` instants, `step` apart, already in the material and near its steady state.

    The chip of a tooth is what lies between its path and the surfaces that all teeth left in the last revolution; a tooth
    whose path lies inside them cuts nothing. Run-out is the cutter's.

    Parameters
    ----------
    dynamics : Poles, or a sequence of them
        The machine with inputs ``tip.x``, ``tip.y``, a robot ``tip.z`` as well, and outputs at ``tip``, ``flange``, ``fixture``, and
        ``housing1``, ``housing2``, ... and ``workpiece`` where further accelerometers stand; of one that changes while it cuts, one
        for each of equal parts of the cut, in the same order and scale (`reduction.alike`).
    cutter : Cutter
    conditions : CuttingConditions
        The cut, with the true spindle speed.
    coefficients : CuttingCoefficients
    step : float [s]
        The force is linear between instants; displacements follow exactly.
    count : int
        Number of instants.
    start_angle : float [rad]
        Immersion of tooth 1 at the first instant.
    slices : int
        Levels of the depth, for helix and shape.
    course : Course, optional
        How the spindle turns and the tool moves on and into the material, `count` instants; it takes the place of `start_angle`. Else both
        are even, in the material from the start.
    law : ChipLaw, optional
        By which the force follows the chip where no straight line does; the edges' forces come on top.

    Notes
    -----
    The first state answers the force of a tool that does not vibrate; what regeneration adds has to settle.
    """
    speed = conditions.spindle_speed
    parts = (dynamics,) if isinstance(dynamics, Poles) else tuple(dynamics)
    dynamics = parts[0]
    inputs = dynamics.inputs.shape[1]
    if inputs not in (2, 3):
        raise InputError("inputs", inputs, "two or three: tip.x, tip.y, and tip.z where the machine gives way along it")
    lines = rigid_force_lines(cutter, conditions, coefficients, slices, law=law)[:, :inputs]
    order = np.arange(lines.shape[0])
    iw = 1j * speed * order
    course = _even(conditions, cutter.teeth, step, count, start_angle) if course is None else course
    rotated = course.width[0] * lines * np.exp(1j * order * course.angle[0])[:, None]
    # a real force has orders -m too: with half the line's conjugate, since lines are those of Re sum
    positive = np.where(order[:, None] == 0, 1.0, 0.5) * rotated
    state = (dynamics.inputs * ((1.0 / (iw[:, None] - dynamics.pole)).T @ positive)).sum(axis=1)
    state += (dynamics.inputs * ((1.0 / (-iw[1:, None] - dynamics.pole)).T @ positive[1:].conj())).sum(axis=1)

    x = np.stack([part.pole for part in parts]) * step
    first = np.expm1(x) / x
    second = (first - 1.0) / x
    gain = step * np.stack([first - second, second], axis=1)[:, :, :, None] * np.stack([part.inputs for part in parts])[:, None]
    names = [str(c) for c in dynamics.coordinates]
    looked_at = "seen" if "seen.x" in names else "flange"
    rows = [names.index(f"{point}.{axis}") for point in ("tip", looked_at, "fixture") for axis in "xy"]
    felt = rows[4:] + [k for k, name in enumerate(names) if name.startswith(("housing", WORKPIECE)) and "'" not in name]
    shape = 2.0 * np.stack([np.concatenate([part.outputs[rows], part.outputs[felt] * part.pole**2]) for part in parts])
    # a force at the tip accelerates the workpiece at once, the housing only through what the basis leaves out
    through = 2.0 * (dynamics.outputs[felt] * dynamics.pole) @ dynamics.inputs

    force = np.zeros((count, 3))
    teeth, ahead, cut, turn = _cut_arrays(cutter, conditions, coefficients, step, slices, law)
    columns = np.column_stack([course.angle, course.way, course.width])
    result = mill(np.exp(x), gain, np.ascontiguousarray(shape), state, teeth, ahead, cut, turn, columns, force)
    return CutHistory(
        step=step,
        angle=course.angle,
        force=force[:, :2],
        axial=force[:, 2],
        tip=result[:, 0:2],
        flange=result[:, 2:4],
        fixture=result[:, 4:6],
        acceleration=result[:, 6:] + force[:, :inputs] @ through.real.T,
    )


def rigid_force_lines(
    cutter: Cutter,
    conditions: CuttingConditions,
    coefficients: CuttingCoefficients,
    slices: int = 8,
    samples: int = 4 * _START_ORDERS,
    law: ChipLaw | None = None,
) -> np.ndarray:
    """Return the force of a tool that does not vibrate as F = Re sum_m lines[m] e^{i m Omega t}, shape (orders, 3) [N].

    Tooth 1 is at immersion 0 when t = 0; machine axes, and z towards the spindle.

    `slices`: levels of the depth, for helix and shape
    `samples`: instants of a revolution
    `law`: as in `mill_cut`
    """
    step = 2.0 * np.pi / conditions.spindle_speed / samples
    teeth, ahead, cut, turn = _cut_arrays(cutter, conditions, coefficients, step, slices, law)
    course = _even(conditions, cutter.teeth, step, samples, 0.0)
    columns = np.column_stack([course.angle, course.way, course.width])
    force = np.zeros((samples, 3))
    none = np.zeros((1, 2, 1), dtype=complex)
    mill(none[:, 0], none[..., None] * np.ones(2), none, none[0, 1].copy(), teeth, ahead, cut, turn, columns, force)
    lines = np.fft.rfft(force, axis=0)[:_START_ORDERS] / samples
    lines[1:] *= 2.0
    return lines


def _even(conditions: CuttingConditions, teeth: int, step: float, count: int, start: float) -> Course:
    """A spindle that turns and a tool that moves on evenly, in the material from the start."""
    instants = np.arange(count)
    speed = conditions.spindle_speed
    feed = conditions.feed_per_tooth * teeth * speed / (2.0 * np.pi)
    return Course(np.asarray(start + speed * step * instants, dtype=np.float64), feed * step * instants, np.ones(count))


def _cut_arrays(
    cutter: Cutter,
    conditions: CuttingConditions,
    coefficients: CuttingCoefficients,
    step: float,
    slices: int,
    law: ChipLaw | None,
) -> tuple[Any, ...]:
    """The kernel's view of a cut: teeth with their edges, angles between them, numbers, axes."""
    speed = conditions.spindle_speed
    levels = levels_of(cutter, conditions, slices)
    # angle from tooth j to the 1st, 2nd, ... one ahead of it, up to itself one turn earlier; where lags are unlike, level by level
    number = np.arange(cutter.teeth)
    ahead = np.array([np.cumsum(np.roll(cutter.pitch, -j)) for j in number])
    if np.ptp(levels.lag, axis=0).max() > 0.0:
        other = (number[:, None] + 1 + number) % cutter.teeth
        ahead = (ahead[:, :, None] + levels.lag[:, None] - levels.lag[other]).reshape(cutter.teeth, -1)
    if np.min(ahead) < speed * step:
        raise InputError("step", f"{step:g} s", f"at most a tooth period, {np.min(ahead) / speed:g} s")
    c = coefficients
    chip = c.tangential * np.array([1.0, c.radial_ratio, c.axial_ratio])
    curve = (0.0, 0.0) if law is None else (law.exponent, 1.0 / law.thickness)
    cut = np.array([0.0, speed * step, *chip, c.tangential_edge, c.radial_edge, c.axial_edge, *curve])
    return (cutter.tooth_angle.copy(), levels.columns), ahead, cut, np.ascontiguousarray(conditions.machine_from_feed)


def synchronous_lines(angle: FloatArray, values: FloatArray, orders: int) -> np.ndarray:
    """Return the amplitudes at spindle orders 0 to `orders` - 1 of the mean revolution, shape (orders, c).

    values = Re sum_m lines[m] e^{i m angle}; over the last whole revolutions.

    `angle` [rad], shape (n,): growing evenly
    `values`, shape (n, c)
    `orders`: number of spindle orders, 0 among them
    """
    turn = 2.0 * np.pi
    first, last = np.ceil(angle[0] / turn), np.floor(angle[-1] / turn)
    if last <= first:
        raise InputError("angle", f"{(angle[-1] - angle[0]) / turn:.2f} revolutions", "at least one whole revolution from angle 0")
    # a force that jumps has lines far above: as fine as the series itself, so that they do not fold down
    points = max(int(np.ceil(2.0 * turn / (angle[1] - angle[0]))), 2 * orders)
    places = turn * (first + np.arange(int(last - first) * points) / points)
    columns = [np.interp(places, angle, column).reshape(-1, points).mean(axis=0) for column in values.T]
    lines = np.fft.rfft(np.stack(columns, axis=-1), axis=0)[:orders] / points
    lines[1:] *= 2.0
    return lines
