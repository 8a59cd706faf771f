"""The map of one period of a milling cut, and its largest Floquet multiplier."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from rcsa_ident.base.arrays import ComplexArray, FloatArray
from rcsa_ident.base.errors import InputError
from rcsa_ident.cutting.process import MillingProcess
from rcsa_ident.cutting.rows import Rows, rows_of
from rcsa_ident.stability._kernels import cut as kernels
from rcsa_ident.stability._kernels import monodromy as _monodromy_kernels
from rcsa_ident.stability._kernels import step as _step_kernels
from rcsa_ident.stability.regeneration import directions_of, regeneration, regeneration_of, sliced
from rcsa_ident.stability.tip_modes import ModeArrays, TipModes

#: Residual of the multiplier, as a share of it.
RESIDUAL = 1e-6
#: Most swings of a varying speed after which the teeth have to stand as they did.
_SWINGS = 60
#: Cuts that are kept laid out.
_KEPT = 512
#: How often a depth that is surely stable is halved at most.
_SMALLER = 60
#: Samples of the noise that a vibration may grow from in a wave of the highest mode.
_PER_WAVE = 8.0
#: Slices of the edge per metre where modes have a shape along it.
SLICES = 6000.0


@dataclass(frozen=True, slots=True, eq=False)
class Multiplier:
    """By what the most persistent vibration is multiplied per period.

    `value`: of a pair the one above the real axis
    `period` [s]
    `vector`: state and motion that belong to it; a good start for the next search
    `omega` [rad/s], shape (k,): frequencies of that vibration, as they stand beside each other: arg(value) / period and multiples of 2 pi /
        period away
    `motion` [m], shape (k,): the tip's amplitude at each, to one common factor
    `residual`: of the eigenvalue, as a share of it
    """

    value: complex
    period: float
    vector: ComplexArray
    omega: FloatArray
    motion: FloatArray
    residual: float


class Windows(NamedTuple):
    """Which teeth stand where, as the kernels want it.

    `rows`, shape (w, 7): see `_cut_kernels`
    `forms`, `rubbing`, shape (w, 5, r, r): what each pushes and rubs with in the displacements that are kept; rubbing has none where
        nothing rubs
    `delays` [rad], shape (d,)
    """

    rows: FloatArray
    forms: FloatArray
    rubbing: FloatArray
    delays: FloatArray


class MonodromyOperator:
    """A cut that waits for its speed and depth.

    `degree`: of the polynomials for the force within a step
    `frozen`: constant coefficients within a step, and what was there a delay ago on a straight line
    """

    def __init__(self, modes: TipModes, process: MillingProcess, degree: int, frozen: bool = False) -> None:
        self.modes, self.process, self.frozen = modes, process, frozen
        cutter = process.cutter
        self.table = lobatto(degree)
        #: By which power of the step the error falls.
        self.order = 2 if frozen else 2 * degree
        if cutter.offset and process.feed_per_tooth is None:
            raise InputError("feed_per_tooth", "nothing", "the feed per tooth [m]: with run-out it decides which teeth cut")
        if modes.shape is not None or process.engagement_profile is not None:
            _require_plain(process, "modes with a shape" if modes.shape is not None else "an engagement that changes along the edge")
        self.spacing = float(cutter.pitch[0]) if cutter.equally_spaced else 2.0 * np.pi
        self.period = common_period(process, self.spacing)
        #: Directions of the tip that count: a plain cut pushes and feels in its plane only.
        self.count = directions_of(2 if process.is_plain else modes.directions)
        modes = modes.planar if self.count == 2 else modes
        # a direction that does not move needs no place in the equations
        if modes.shape is None:
            moving = np.any(modes.outputs != 0.0, axis=1) | np.any(modes.constant != 0.0, axis=1)
            outputs, inputs = modes.outputs[moving], modes.inputs[:, moving]
            constant = modes.constant[np.ix_(moving, moving)]
            self.directions = np.eye(self.count)[:, moving]
        else:
            outputs, inputs, self.directions = _planar(modes)
            constant = np.zeros((modes.pole.size, modes.pole.size))
        # modes scaled so that each moves the tip alike
        size = np.maximum(np.linalg.norm(outputs, axis=0), 1e-30 * np.linalg.norm(outputs))
        self.arrays = ModeArrays(
            modes.pole.copy(), np.ascontiguousarray(outputs / size), np.ascontiguousarray(inputs * size[:, None]), np.array(constant)
        )
        #: Whether every depth is cut alike: forces and lags are proportional to it.
        self.alike = process.is_plain and process.engagement_profile is None and modes.shape is None
        #: Whether all forces are proportional to the depth, and nothing else changes with it.
        self.proportional = self.alike and cutter.largest_lag == 0.0
        self._windows_of_unit: Windows | None = None
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

        `speed` [rad/s]; `depth` [m]
        `step` [s]: longest step
        `start`: vector of a similar cut
        `waves`: also look at the frequencies of the vibration
        `residual`: of the eigenvalue, as a share of it, at which the search for it ends
        """
        layout = self._laid_out(speed, depth, step)
        if layout.time.size == 0:
            return self._free(speed)
        first = np.zeros(0) if start is None else np.ascontiguousarray(start.real)
        steps = _step_kernels.steps(self.arrays, layout.places, self.table)
        value, left, _, vector, force = _monodromy_kernels.multiplier(
            self.arrays, layout, self.table, self.frozen, steps, residual, waves, first
        )
        value = complex(value)
        if value.imag < 0.0:
            value, vector, force = value.conjugate(), vector.conj(), force.conj()
        omega, motion = self._waves(value, speed, force, layout) if waves else (np.zeros(0), np.zeros(0))
        return Multiplier(value, self.duration(speed), vector, omega, motion, float(left))

    def growth(self, speed: float, depth: float, step: float, periods: int, most: float, seed: int = 0) -> float:
        """Return by what a vibration grows at most within some periods, whatever becomes of it after them.

        It begins as noise on the surface. With small multipliers it dies away in the end, and may have grown a million times by then
        [trefethen2005].

        `speed` [rad/s]; `depth` [m]
        `step` [s]: longest step
        `most`: growth beyond which nobody asks how much it is
        `seed`: of the noise
        """
        layout = self._laid_out(speed, depth, step)
        if layout.time.size == 0:
            return 1.0
        points, duration, r = layout.time.size, self.duration(speed), self.arrays.outputs.shape[0]
        samples = int(_PER_WAVE * duration * float(np.max(np.abs(self.arrays.pole))) / (2.0 * np.pi)) + 2
        noise, at = np.random.default_rng(seed).standard_normal((r, samples)), np.linspace(0.0, duration, samples)
        state, force = np.zeros(self.arrays.pole.size, dtype=complex), np.zeros((points, r))
        # the period before, and the one that follows it
        motion = np.concatenate([np.stack([np.interp(layout.time, at, each) for each in noise], axis=1), np.zeros((points, r))])
        steps = _step_kernels.steps(self.arrays, layout.places, self.table)
        prepared = _monodromy_kernels.prepare(self.arrays, layout, self.frozen, steps)
        first = largest = 0.0
        for _ in range(periods + 1):
            _monodromy_kernels.march(state, motion, force, self.arrays, layout, self.table, self.frozen, steps, prepared)
            motion[:points] = motion[points:]
            peak = float(np.max(np.abs(motion[points:])))
            first = first or max(peak, 1e-300)
            largest = max(largest, peak / first)
            if largest > most:
                break
        return largest

    def _free(self, speed: float) -> Multiplier:
        """The multiplier of a tool that cuts nothing: its slowest mode dies away."""
        duration = self.duration(speed)
        slowest = self.arrays.pole[np.argmax(self.arrays.pole.real)]
        return Multiplier(complex(np.exp(slowest * duration)), duration, np.zeros(0), np.array([abs(slowest)]), np.ones(1), 0.0)

    def _laid_out(self, speed: float, depth: float, step: float) -> kernels.CutLayout:
        """The cut over its period; without a helix it is laid out once for all depths, since every force grows with the depth."""
        if not self.proportional:
            return self._lay_out(speed, depth, step)
        if (speed, step) not in self._unit:
            if len(self._unit) >= _KEPT:
                self._unit.clear()
            self._unit[speed, step] = self._lay_out(speed, self.process.cutter.diameter, step)
        unit, share = self._unit[speed, step], depth / self.process.cutter.diameter
        return unit._replace(stiffness=share * unit.stiffness, damping=share * unit.damping)

    def _lay_out(self, speed: float, depth: float, step: float) -> kernels.CutLayout:
        windows, share = self._shared(speed, depth)
        plan = self._plan(speed, step, windows.delays, share)
        found: kernels.CutLayout = kernels.lay_out(windows.rows, windows.forms, windows.rubbing, plan, self.table)
        return found

    def _plan(self, speed: float, step: float, delays: FloatArray, share: float = 1.0) -> kernels.CutPlan:
        v = self.process.speed_variation
        return kernels.CutPlan(
            period=self.period,
            spacing=self.spacing,
            share=share,
            speed=float(speed),
            swing=0.0 if v is None else float(v.amplitude),
            swings=0.0 if v is None else float(v.ratio),
            step=float(step),
            frozen=self.frozen,
            delays=delays,
        )

    def _shared(self, speed: float, depth: float) -> tuple[Windows, float]:
        """Windows, and the share of their lags and forces that a depth has: where every depth is cut alike they are sought once."""
        if not self.alike:
            return self._windows(speed, depth), 1.0
        unit = self.process.cutter.diameter
        if self._windows_of_unit is None:
            self._windows_of_unit = self._windows(speed, unit)
        return self._windows_of_unit, depth / unit

    def _windows(self, speed: float, depth: float) -> Windows:
        rows = self._rows(speed, depth)
        known = regeneration_of(self.process, rows, self.count)
        delays, place = np.unique(np.round(rows.delay, 12), return_inverse=True)
        # cells of a wave that lag between their ends open gradually
        splits = (rows.far <= rows.near) | (self.process.cutter.serration is None)
        windows = np.stack([rows.angle, rows.start, rows.end, rows.near, rows.far, place, splits], axis=1)
        moved = self._directions(rows.z)
        forms = [_projected(moved, form) for form in (known.stiffness, known.rubbing) if form is not None]
        return Windows(windows, forms[0], forms[1] if len(forms) > 1 else np.zeros((0, *forms[0].shape[1:])), delays)

    def _rows(self, speed: float, depth: float) -> Rows:
        process = self.process
        rows = rows_of(process.cutter, process.engagement, depth, process.feed_per_tooth, along=self.count == 5)
        if process.engagement_profile is not None:
            return sliced(rows, process.engagement_profile(speed, depth))
        if self.modes.shape is not None:
            edges = np.linspace(0.0, 1.0, max(2, int(np.ceil(SLICES * depth))) + 1)
            return sliced(rows, np.stack([edges[:-1], edges[1:]], axis=1))
        return rows

    def _directions(self, height: FloatArray) -> FloatArray:
        """How the displacements that are kept move the edge at heights, shape (n or 1, directions, kept)."""
        if self.modes.shape is None or self.modes.heights is None:
            return self.directions[None]
        heights = self.modes.heights
        return self.directions * np.stack([np.interp(height, heights, each) for each in self.modes.shape.T], axis=1)[:, None]

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
    if process.is_plain:
        c, widest = process.coefficients, process.widest
        teeth = max(1.0, np.ceil((widest.exit - widest.entry) / float(np.min(process.cutter.pitch))))
        return float(0.9 / (2.0 * teeth * c.tangential * np.hypot(1.0, c.radial_ratio) * modes.planar.largest))
    depth, directions = process.within_reach(0.5 * process.cutter.diameter), directions_of(modes.directions)
    for _ in range(_SMALLER):
        if 2.0 * regeneration(process, depth, directions).strongest * modes.largest < 0.9:
            return depth
        depth *= 0.5
    raise InputError("tip modes", "a tip that any cut makes vibrate", "a stiffness beside which that of a thin cut is small")


def _projected(moved: FloatArray, forms: FloatArray) -> FloatArray:
    """Return moved^T form moved of each row and part, shape (n, 5, kept, kept)."""
    found: FloatArray = moved.transpose(0, 2, 1)[:, None] @ forms @ moved[:, None]
    return np.ascontiguousarray(found)


def _require_plain(process: MillingProcess, beside: str) -> None:
    cutter = process.cutter
    if cutter.offset:
        raise InputError("runout", cutter.runout.tolist(), f"equal teeth beside {beside}")
    if not process.is_plain:
        raise InputError("cutter", str(cutter), f"a cylinder and one engagement beside {beside}")


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
