"""Surface location error: where a stable, vibrating tool leaves the wall."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from rcsa_ident.base.arrays import ComplexArray, FloatArray, frozen
from rcsa_ident.base.errors import InputError
from rcsa_ident.base.plausibility import AXIAL_DEPTH
from rcsa_ident.base.shown import Drawn
from rcsa_ident.base.units import to_rpm
from rcsa_ident.cutting.conditions import Engagement
from rcsa_ident.cutting.cutter import Cutter
from rcsa_ident.cutting.force import force_lines, runout_force_lines
from rcsa_ident.cutting.process import MillingProcess
from rcsa_ident.cutting.segments import Arc
from rcsa_ident.cutting.teeth import edges_at, lags
from rcsa_ident.dynamics.receptance import Receptance
from rcsa_ident.stability.lobes import asked_speeds
from rcsa_ident.stability.tip_modes import TIP, TipModes

#: Most multiples of the spindle frequency; where the band holds more of them, the rest is left out.
MOST_ORDERS = 4000
#: Share of the sum of all orders that the upper quarter of them may have before something is said.
_LEFT = 0.02


class Wall(StrEnum):
    """Which wall: the one where teeth enter (up-milling) or the one where they leave (down-milling)."""

    ENTRY = "entry"
    EXIT = "exit"


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class SurfaceError(Drawn):
    """How far the wall lies from where a rigid tool would leave it; positive where material is left, negative where too much is gone.

    Parameters
    ----------
    spindle_speed : array, shape (n,) [rad/s]
    height : array, shape (h,) [m]
        Above the tip.
    error : array, shape (n, h) [m]
    wall : Wall
    warnings : tuple of str

    Examples
    --------
    >>> import rcsa_ident as ri
    >>> mode = ri.normal_modes([ri.hz(900.0)], [0.02], [[5.0]], (ri.Coordinate("tip", ri.Dof.Y),))
    >>> tip = ri.TipModes.of({ri.Dof.Y: mode})
    >>> finish = ri.Engagement.from_immersion(0.05, "down")
    >>> cut = ri.MillingProcess(ri.Cutter(2, 0.012), ri.CuttingCoefficients(7e8, 0.3), finish, feed_per_tooth=0.1e-3)
    >>> wall = ri.surface_location_error(tip, cut, ri.rpm(8000, 16_000, 2000), depth=0.5e-3)
    >>> (1e6 * wall.error[:, 0]).round(1)
    array([3.3, 4.8, 4.4, 4.4, 1.7])
    """

    spindle_speed: FloatArray
    height: FloatArray
    error: FloatArray
    wall: Wall
    warnings: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        for name in ("spindle_speed", "height", "error"):
            object.__setattr__(self, name, frozen(getattr(self, name)))
        if self.error.shape != (self.spindle_speed.size, self.height.size):
            raise InputError("error", self.error.shape, f"shape {(self.spindle_speed.size, self.height.size)}: speeds, heights")

    @property
    def largest(self) -> FloatArray:
        """The error that is largest in size, with its sign, shape (n,) [m]."""
        place = np.argmax(np.abs(self.error), axis=1)
        return self.error[np.arange(self.error.shape[0]), place]

    @property
    def mean(self) -> FloatArray:
        """Mean over the height, shape (n,) [m]."""
        return self.error.mean(axis=1)

    def __str__(self) -> str:
        speed, error = to_rpm(self.spindle_speed), 1e6 * self.error
        speeds, depth = f"{speed.min():.0f} to {speed.max():.0f} rev/min", f"{1e3 * float(self.height[-1]):.3g} mm deep"
        side = "enter" if self.wall is Wall.ENTRY else "leave"
        return f"{speeds}, {depth}: {error.min():.2g} to {error.max():.2g} µm at the wall where teeth {side}"


def surface_location_error(
    tip: Receptance | TipModes, process: MillingProcess, speeds: FloatArray, depth: float, wall: Wall | None = None, heights: int = 33
) -> SurfaceError:
    """Return the surface location error of stable cuts over spindle speed.

    Parameters
    ----------
    tip : Receptance or TipModes
        Between ``tip.x`` and ``tip.y`` (machine axes).
    process : MillingProcess
        With a feed per tooth.
    speeds : array, shape (n,) [rad/s]
    depth : float [m]
    wall : Wall or None
        None takes the wall that the engagement has; of a slot's two the one where teeth leave.
    heights : int
        Points over the depth, of a cutter with a shape over the part of it where its edge is a wall; a straight edge has the same error at
        all of them.

    Raises
    ------
    InputError
        If the engagement leaves no wall, or the cutter none at this depth.

    Notes
    -----
    A stable cut of equal teeth repeats itself from tooth to tooth, so that what one leaves is what the next would have left:
    regeneration drops out and the tip moves as x(t) = Re sum_m G(i m Omega) F_m e^{i m Omega t} with the force lines F_m of a
    rigid tool [schmitz1999], [mann2005]. A
    point of the wall is made by the edge that stands there, at immersion 0 (entry) or pi (exit): at height z that is at
    Omega t = phi_wall - psi_j + lag(z). Of unequal teeth the one that cuts deepest leaves the wall.

    Examples
    --------
    >>> import rcsa_ident as ri
    >>> mode = ri.normal_modes([ri.hz(900.0)], [0.02], [[5.0]], (ri.Coordinate("tip", ri.Dof.Y),))
    >>> finish = ri.Engagement.from_immersion(0.05, "down")
    >>> cut = ri.MillingProcess(ri.Cutter(2, 0.012), ri.CuttingCoefficients(7e8, 0.3), finish, feed_per_tooth=0.1e-3)
    >>> tip = ri.TipModes.of({ri.Dof.Y: mode})
    >>> print(ri.surface_location_error(tip, cut, ri.rpm(8000, 16_000, 50), depth=0.5e-3))
    8000 to 16000 rev/min, 0.5 mm deep: 1.7 to 25 µm at the wall where teeth leave
    """
    if process.feed_per_tooth is None:
        raise InputError("feed_per_tooth", "nothing", "the feed per tooth [m]: the force grows with it")
    depth = AXIAL_DEPTH.checked("depth", depth)
    if heights < 1:
        raise InputError("heights", heights, "1 or more")
    cutter = process.cutter
    height = np.linspace(_wall_begins(cutter, depth), depth, heights)
    side = _wall(_at_the_wall(process, float(height[-1])), wall)
    speeds = asked_speeds(speeds)
    # angle of tooth 1 when tooth j makes the wall at a height, shape (teeth, heights)
    angle = (np.pi if side is Wall.EXIT else 0.0) - cutter.tooth_angle[:, None] + lags(cutter, height)
    offset = edges_at(cutter, height, np.full(height.shape, 0.5 * np.pi)).offset
    outward = 1.0 if side is Wall.EXIT else -1.0
    normal = process.machine_from_feed[:, 1]
    response = _Tip(from_rest(tip))
    error = np.empty((speeds.size, heights))
    tail = 0.0
    for i, speed in enumerate(speeds.tolist()):
        orders = np.arange(min(int(response.omega[-1] / speed), MOST_ORDERS) + 1)
        lines = runout_force_lines if cutter.offset else force_lines
        force = lines(cutter, process.conditions(speed, depth), process.coefficients, orders)
        line = np.einsum("m,mrc,rc->r", normal, response.at(orders * speed).transpose(1, 0, 2), force)
        moved = np.einsum("r,rjz->jz", line, np.exp(1j * orders[:, None, None] * angle)).real
        error[i] = np.min(outward * moved - offset, axis=0)
        size = np.abs(line)
        tail = max(tail, float(size[3 * size.size // 4 :].sum() / max(size.sum(), 1e-300)))
    return SurfaceError(speeds, height, error, side, tuple(_doubts(process, response, speeds, tail)))


def forced_vibration(tip: Receptance | TipModes, process: MillingProcess, speed: float, depth: float, instants: int = 256) -> FloatArray:
    """Return how the tip moves in a stable cut over a revolution, shape (instants, 2) [m], machine axes X and Y.

    By the force lines of a rigid tool; instants are evenly apart, tooth 1 at immersion 0 at the first one.

    `process`: with a feed per tooth
    `speed` [rad/s]; `depth` [m]
    """
    response = _Tip(from_rest(tip))
    orders = np.arange(min(int(response.omega[-1] / speed), MOST_ORDERS, instants // 2 - 1) + 1)
    lines = runout_force_lines if process.cutter.offset else force_lines
    force = lines(process.cutter, process.conditions(speed, depth), process.coefficients, orders)
    moved = np.einsum("mrc,mc->mr", response.at(orders * speed), force)
    angle = 2.0 * np.pi * np.arange(instants) / instants
    return np.asarray((np.exp(1j * np.outer(angle, orders)) @ moved).real)


class _Tip:
    """The tip's receptance between its lines, from 0 Hz."""

    def __init__(self, receptance: Receptance) -> None:
        names = ("tip.x", "tip.y")
        self.omega = receptance.omega
        self.values = np.stack([np.stack([receptance.between(a, b) for b in names], axis=1) for a in names], axis=1)
        if self.omega.size < 2 or np.any(np.diff(self.omega) <= 0.0):
            raise InputError("tip receptance frequencies", f"{self.omega.size} frequencies", "two or more, ascending")

    def at(self, omega: FloatArray) -> ComplexArray:
        """Straight lines between the given frequencies, shape (k, 2, 2); below the first its real part, at 0 a real compliance."""
        flat = self.values.reshape(self.omega.size, 4)
        found = np.stack(
            [np.interp(omega, self.omega, flat[:, k].real) + 1j * np.interp(omega, self.omega, flat[:, k].imag) for k in range(4)], axis=1
        )
        found[omega < self.omega[0]] = flat[0].real
        found[omega == 0.0] = flat[0].real
        return found.reshape(-1, 2, 2)


def _wall_begins(cutter: Cutter, depth: float) -> float:
    """The height above which the cutter's edge is a wall up to a depth [m]."""
    begins = depth
    for segment, low, _ in reversed(cutter.outline.pieces(depth)):
        if abs(float(segment.at(np.array([low]))[2][0]) - 0.5 * np.pi) > 1e-9 or isinstance(segment, Arc):
            break
        begins = float(segment.at(np.array([low]))[1][0])
    if begins >= depth:
        allowed = "a depth at which the cutter's edge is a wall: elsewhere it leaves its own outline"
        raise InputError("depth", f"{1e3 * depth:g} mm with {cutter}", allowed)
    return begins


def _at_the_wall(process: MillingProcess, height: float) -> Engagement:
    """The engagement at a height of the wall."""
    arcs = process.engagement.arcs(np.array([process.cutter.outline.radius_at(height)]), np.array([height]))[:, 0]
    start, end = arcs[np.argmax(arcs[:, 1] - arcs[:, 0])]
    return Engagement(float(start), float(end))


def _wall(engagement: Engagement, wanted: Wall | None) -> Wall:
    there = [Wall.EXIT] if engagement.exit > np.pi - 1e-6 else []
    there += [Wall.ENTRY] if engagement.entry < 1e-6 else []
    if not there:
        degrees = f"{np.degrees(engagement.entry):g} to {np.degrees(engagement.exit):g} degrees"
        raise InputError("engagement", degrees, "one that begins at 0 or ends at 180 degrees: only there a wall is left")
    if wanted is not None and wanted not in there:
        raise InputError("wall", str(wanted), f"one of {', '.join(there)}: the engagement leaves no other")
    return wanted or there[0]


def _doubts(process: MillingProcess, tip: _Tip, speeds: FloatArray, tail: float) -> list[str]:
    doubts = []
    cutter = process.cutter
    first, last = (w / (2.0 * np.pi) for w in (tip.omega[0], tip.omega[-1]))
    if first > 0.0:
        doubts.append(f"surface error: the receptance begins at {first:.0f} Hz; below it, and for the mean force, its first value is taken")
    if tail > _LEFT:
        doubts.append(
            f"surface error: the receptance ends at {last:.0f} Hz, where the tip still follows the force: the error may be percents off"
        )
    if not cutter.equally_spaced:
        doubts.append("surface error: teeth are not alike; what their vibrations leave to each other is left out")
    if process.speed_variation is not None:
        doubts.append("surface error: that of a constant speed")
    return doubts


def from_rest(tip: Receptance | TipModes) -> Receptance:
    """Return the receptance of a tip's modes from 0 Hz to four times the highest, at frequencies that resolve the sharpest."""
    if not isinstance(tip, TipModes):
        return tip
    fine = tip.receptance().omega
    omega = np.arange(0.0, 2.0 * fine[-1], fine[1] - fine[0])
    return Receptance(omega, tip.planar.response(omega), TIP, TIP)
