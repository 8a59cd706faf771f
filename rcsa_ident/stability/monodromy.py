"""The map of one period of a milling cut, and its largest Floquet multiplier."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from rcsa_ident.arrays import ComplexArray, FloatArray
from rcsa_ident.cutting.conditions import same_everywhere
from rcsa_ident.cutting.force import regenerations
from rcsa_ident.cutting.process import MillingProcess
from rcsa_ident.errors import InputError
from rcsa_ident.stability import _cut_kernels as kernels
from rcsa_ident.stability import _monodromy_kernels
from rcsa_ident.stability.tip_modes import ModeArrays, TipModes

#: Residual of the multiplier, as a share of it.
RESIDUAL = 1e-6
#: Most swings of a varying speed after which the teeth have to stand as they did.
_SWINGS = 60
#: Cuts that are kept laid out.
_KEPT = 512
#: Slices of the edge per metre where modes have a shape along it.
SLICES = 6000.0


@dataclass(frozen=True, slots=True, eq=False)
class Multiplier:
    """By what the most persistent vibration is multiplied per period.

    Parameters
    ----------
    value : complex
        Of a pair the one above the real axis.
    period : float [s]
    vector : complex array
        State and motion that belong to it; a good start for the next search.
    omega : array, shape (k,) [rad/s]
        Frequencies of that vibration, as they stand beside each other: arg(value) / period and multiples of 2 pi / period away.
    motion : array, shape (k,) [m]
        The tip's amplitude at each, to one common factor.
    residual : float
        Of the eigenvalue, as a share of it.
    """

    value: complex
    period: float
    vector: ComplexArray
    omega: FloatArray
    motion: FloatArray
    residual: float


class MonodromyOperator:
    """A cut that waits for its speed and depth.

    Parameters
    ----------
    modes : TipModes
    process : MillingProcess
    degree : int
        Of the polynomials for the force within a step.
    frozen : bool
        Constant coefficients within a step, and what was there a delay ago on a straight line.
    """

    def __init__(self, modes: TipModes, process: MillingProcess, degree: int, frozen: bool = False) -> None:
        self.modes, self.process, self.frozen = modes, process, frozen
        cutter = process.cutter
        self.table = lobatto(degree)
        #: By which power of the step the error falls.
        self.order = 2 if frozen else 2 * degree
        equal = bool(np.ptp(cutter.pitch) < 1e-9)
        uneven = bool(np.ptp(cutter.runout) > 0.0)
        if uneven and process.feed_per_tooth is None:
            raise InputError("feed_per_tooth", "nothing", "the feed per tooth [m]: with run-out it decides which teeth cut")
        if uneven and process.engagement_profile is not None:
            raise InputError("runout", cutter.runout.tolist(), "equal teeth beside an engagement that changes along the edge")
        # (offset, start, end, delay) of the teeth that differ
        engagement = same_everywhere(process.engagement)
        entry, leave = engagement.angles
        if equal and not uneven:
            windows = [(0.0, entry, leave, float(cutter.pitch[0]))]
            self.spacing = float(cutter.pitch[0])
        else:
            pieces = (
                regenerations(cutter, process.feed_per_tooth, engagement)
                if uneven and process.feed_per_tooth is not None
                else [(j, entry, leave, 1) for j in range(cutter.teeth)]
            )
            windows = [(float(cutter.tooth_angle[j]), s, e, float(np.sum(np.roll(cutter.pitch, -j)[:back]))) for j, s, e, back in pieces]
            self.spacing = 2.0 * np.pi
        if not windows:
            raise InputError("runout", cutter.runout.tolist(), "teeth that cut at all with this feed")
        self.delays = np.unique(np.round([w[3] for w in windows], 12))
        self.windows = [(o, s, e, int(np.argmin(np.abs(self.delays - d)))) for o, s, e, d in windows]
        self.period = common_period(process, self.spacing)
        # a direction that does not move needs no place in the equations
        self.rotation = process.machine_from_feed.T
        if modes.shape is None:
            moving = np.any(modes.outputs != 0.0, axis=1) | np.any(modes.constant != 0.0, axis=1)
            outputs, inputs = modes.outputs[moving], modes.inputs[:, moving]
            constant = modes.constant[np.ix_(moving, moving)]
            self.directions = np.eye(2)[:, moving]
        else:
            outputs, inputs, self.directions = _planar(modes)
            constant = np.zeros((modes.pole.size, modes.pole.size))
        # modes scaled so that each moves the tip alike
        size = np.maximum(np.linalg.norm(outputs, axis=0), 1e-30 * np.linalg.norm(outputs))
        self.arrays = ModeArrays(
            modes.pole.copy(), np.ascontiguousarray(outputs / size), np.ascontiguousarray(inputs * size[:, None]), np.array(constant)
        )
        self._straight: tuple[FloatArray, FloatArray] | None = None
        #: Whether all forces are proportional to the depth.
        self.proportional = cutter.helix == 0.0 and process.engagement_profile is None and modes.shape is None
        self._unit: dict[tuple[float, float], kernels.CutLayout] = {}

    def duration(self, speed: float) -> float:
        """Seconds of a period."""
        return self.period / speed

    def multiplier(
        self,
        speed: float,
        depth: float,
        step: float,
        start: ComplexArray | None = None,
        waves: bool = False,
        residual: float = RESIDUAL,
    ) -> Multiplier:
        """Return the multiplier of largest magnitude.

        Parameters
        ----------
        speed : float [rad/s]
        depth : float [m]
        step : float [s]
            Longest step.
        start : complex array or None
            Vector of a similar cut.
        waves : bool
            Also look at the frequencies of the vibration.
        residual : float
            Of the eigenvalue, as a share of it, at which the search for it ends.
        """
        layout = self._laid_out(speed, depth, step)
        first = np.zeros(0) if start is None else np.ascontiguousarray(start.real)
        value, left, _, vector, force = _monodromy_kernels.multiplier(self.arrays, layout, self.table, self.frozen, residual, waves, first)
        value = complex(value)
        if value.imag < 0.0:
            value, vector, force = value.conjugate(), vector.conj(), force.conj()
        omega, motion = self._waves(value, speed, force, layout) if waves else (np.zeros(0), np.zeros(0))
        return Multiplier(value, self.duration(speed), vector, omega, motion, float(left))

    def _laid_out(self, speed: float, depth: float, step: float) -> kernels.CutLayout:
        """The cut over its period; without a helix it is laid out once for all depths, since every force grows with the depth."""
        if not self.proportional:
            return self._lay_out(speed, depth, step)
        if (speed, step) not in self._unit:
            if len(self._unit) >= _KEPT:
                self._unit.clear()
            self._unit[speed, step] = self._lay_out(speed, 1.0, step)
        unit = self._unit[speed, step]
        return unit._replace(stiffness=depth * unit.stiffness, damping=depth * unit.damping)

    def _lay_out(self, speed: float, depth: float, step: float) -> kernels.CutLayout:
        rows, shapes = self._rows(speed, depth)
        found: kernels.CutLayout = kernels.lay_out(rows, shapes, self._plan(speed, depth, step), self.table)
        return found

    def _plan(self, speed: float, depth: float, step: float) -> kernels.CutPlan:
        process = self.process
        c, d, v = process.coefficients, process.damping, process.speed_variation
        return kernels.CutPlan(
            period=self.period,
            spacing=self.spacing,
            speed=float(speed),
            depth=float(depth),
            lag=float(2.0 * np.tan(process.cutter.helix) / process.cutter.diameter),
            k_tangential=float(c.tangential),
            k_radial=float(c.tangential * c.radial_ratio),
            c_tangential=0.0 if d is None else float(d.friction * d.strength),
            c_radial=0.0 if d is None else float(d.strength),
            radius=float(0.5 * process.cutter.diameter),
            swing=0.0 if v is None else float(v.amplitude),
            swings=0.0 if v is None else float(v.ratio),
            step=float(step),
            frozen=self.frozen,
            delays=self.delays,
        )

    def _rows(self, speed: float, depth: float) -> tuple[FloatArray, FloatArray]:
        """Windows and the directions that they push in, as the kernels want them."""
        if self._straight is not None:
            return self._straight
        rows, shapes = [], []
        for offset, start, end, delay in self.windows:
            for upper, lower, opens, closes in self._slices(speed, depth, start, end):
                rows.append((offset, opens, closes, upper, lower, delay))
                shapes.append(self.rotation @ self._directions(0.5 * (upper + lower) * depth))
        found = np.array(rows), np.array(shapes)
        if self.process.engagement_profile is None and self.modes.shape is None:
            self._straight = found
        return found

    def _slices(self, speed: float, depth: float, start: float, end: float) -> FloatArray:
        if self.process.engagement_profile is not None:
            return self.process.engagement_profile(speed, depth)
        if self.modes.shape is None:
            return np.array([[0.0, 1.0, start, end]])
        edges = np.linspace(0.0, 1.0, max(2, int(np.ceil(SLICES * depth))) + 1)
        return np.stack([edges[:-1], edges[1:], np.full(edges.size - 1, start), np.full(edges.size - 1, end)], axis=1)

    def _directions(self, height: float) -> FloatArray:
        if self.modes.shape is None or self.modes.heights is None:
            return self.directions
        share = np.array([np.interp(height, self.modes.heights, each) for each in self.modes.shape.T])
        return self.directions * share

    def _waves(self, value: complex, speed: float, force: ComplexArray, layout: kernels.CutLayout) -> tuple[FloatArray, FloatArray]:
        """Frequencies of the vibration, and the tip's amplitude at each, from the force's lines and the modes."""
        (pole, outputs, inputs, constant), places, time = self.arrays, layout.places, layout.time
        period, nodes = self.duration(speed), self.table.shape[1] - 1
        base = float(np.angle(value)) / period
        highest = 2.0 * float(np.max(np.abs(pole)))
        k = np.arange(-int((highest + base) * period / (2.0 * np.pi)), int((highest - base) * period / (2.0 * np.pi)) + 1)
        apart = 2.0 * np.pi / period
        omega = base + apart * k
        growth = np.log(abs(value)) / period
        steps = [(first + nodes * np.arange(count), h) for _, h, count, first, _ in places[places[:, 3] >= 0.0]]
        p = np.concatenate([at[:, None] + np.arange(nodes + 1) for at, _ in steps]).astype(np.intp).ravel()
        weight = np.concatenate([np.tile(h / period * self.table[1], at.size) for at, h in steps])
        at = time[p]
        turned = (weight * np.exp((-growth - 1j * omega[0]) * at))[:, None] * force[p]
        # the lines are equally far apart: of so many beside each other the exponentials serve all the others, too
        beside = int(np.sqrt(omega.size)) + 1
        near = np.exp(-1j * apart * np.arange(beside)[:, None] * at)
        far = range(0, omega.size, beside)
        lines = np.concatenate([near @ (np.exp(-1j * apart * m * at)[:, None] * turned) for m in far])[: omega.size]
        decay = 1.0 / (1j * omega[:, None] - pole), 1.0 / (1j * omega[:, None] - pole.conj())
        pairs = (decay[0], inputs, outputs), (decay[1], inputs.conj(), outputs.conj())
        motion = lines @ constant.T + sum((d * (lines @ i.T)) @ o.T for d, i, o in pairs)
        return np.abs(omega), np.linalg.norm(motion @ self.directions.T, axis=1)


def stable_depth_bound(modes: TipModes, process: MillingProcess) -> float:
    """A depth at which nothing can grow: the gain round the loop is below one at every frequency [m]."""
    c = process.coefficients
    teeth = max(1.0, np.ceil((process.widest.exit - process.widest.entry) / float(np.min(process.cutter.pitch))))
    return float(0.9 / (2.0 * teeth * c.tangential * np.hypot(1.0, c.radial_ratio) * modes.largest))


def common_period(process: MillingProcess, spacing: float) -> float:
    """The rotation after which teeth and speed are as they were."""
    if process.speed_variation is None:
        return spacing
    swing = 2.0 * np.pi / process.speed_variation.ratio
    for count in range(1, _SWINGS + 1):
        turns = count * swing / spacing
        if turns > 0.5 and abs(turns - round(turns)) < 1e-9 * turns:
            return count * swing
    allowed = f"a ratio at which {_SWINGS} swings or fewer are a whole number of {'teeth' if spacing < 6.0 else 'revolutions'}"
    raise InputError("ratio", process.speed_variation.ratio, allowed)


def _planar(modes: TipModes) -> tuple[ComplexArray, ComplexArray, FloatArray]:
    """Modes one by one, each with its own direction in the plane: outputs (m, m), inputs (m, m), directions (2, m)."""
    m = modes.pole.size
    directions = np.empty((2, m))
    outputs, inputs = np.zeros((m, m), dtype=complex), np.zeros((m, m), dtype=complex)
    for k in range(m):
        u, _, vh = np.linalg.svd(np.outer(modes.outputs[:, k], modes.inputs[k]))
        turn = u[:, 0] * np.exp(-1j * np.angle(u[np.argmax(np.abs(u[:, 0])), 0]))
        if np.max(np.abs(turn.imag)) > 1e-9 or abs(abs(vh[0] @ turn.conj()) - 1.0) > 1e-9:
            raise InputError(
                "tip modes", f"mode {k + 1} that moves on an ellipse", "modes with one direction each, where they have a shape"
            )
        directions[:, k] = turn.real
        outputs[k, k] = directions[:, k] @ modes.outputs[:, k]
        inputs[k, k] = modes.inputs[k] @ directions[:, k]
    return outputs, inputs, directions


@lru_cache(maxsize=16)
def lobatto(degree: int) -> FloatArray:
    """Gauss-Lobatto nodes on [0, 1], their weights, and the coefficients of their Lagrange polynomials, shape (degree + 3, degree + 1)."""
    inner = np.polynomial.legendre.Legendre.basis(degree).deriv().roots().real if degree > 1 else np.zeros(0)
    node = 0.5 * (np.concatenate([[-1.0], np.sort(inner), [1.0]]) + 1.0)
    coefficients = np.linalg.inv(np.vander(node, increasing=True)).T
    return np.vstack([node, coefficients @ (1.0 / np.arange(1, degree + 2)), coefficients])
