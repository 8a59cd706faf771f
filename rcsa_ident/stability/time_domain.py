"""Stability by simulation: teeth that leave the cut, run-out, helix, a flank that rubs one way only."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import partial
from typing import ClassVar, Literal

import numpy as np
from numpy.typing import NDArray

from rcsa_ident.base.arrays import FloatArray, frozen
from rcsa_ident.base.errors import InputError, positive
from rcsa_ident.cutting.conditions import same_everywhere
from rcsa_ident.cutting.process import MillingProcess
from rcsa_ident.cutting.rows import Places, places_of
from rcsa_ident.cutting.teeth import edges_at
from rcsa_ident.dynamics.receptance import Receptance
from rcsa_ident.stability._kernels import time as kernels
from rcsa_ident.stability.first_instability import first_loss
from rcsa_ident.stability.methods import ABOVE_TOP, FITTED_MODES, LOOKS, MethodName, Watch, coarse_to_fine
from rcsa_ident.stability.monodromy import common_period, stable_depth_bound
from rcsa_ident.stability.regeneration import SLOWEST, directions_of, turned
from rcsa_ident.stability.result import StabilityLobes
from rcsa_ident.stability.tip_modes import ModeArrays, TipModes, require_modes

#: Steps per wave of the highest mode that counts, and per tooth period at least.
_STEPS, _FEWEST = 40.0, 60
#: A mode counts whose own peak reaches this share of the strongest one's.
_WEAK = 0.02
#: Nodes of a wave of a serrated edge.
_WAVE = 24
#: Slices of the edge per angle that it lags over the depth [1/rad], at least one.
_SLICES = 12.0
#: Feed per tooth where none is given [m]; how far a cut is pushed off its steady state, and where it counts as chatter, as shares of it.
_FEED, _PUSH, _CHATTER = 1e-4, 1e-6, 0.02
#: Share of the periods that are left to what dies away faster.
_FASTER = 0.25
#: States that the search for a steady state looks back to, and how many periods it may take.
_MEMORY, _MOST = 25, 120
#: Of these, as many as it takes where teeth differ.
_SETTLING = 22.0
#: A disturbance that has fallen to this share of the push is gone.
_GONE = 1e-5
#: In the place of what is larger, or too large to be a number.
_BEYOND = 1e100
#: Share of the velocity that rubbing may take in a step, at which limits are those of finer steps to some thousandths; how much finer the
#: steps become where it takes more.
_RESOLVED, _FINER = 0.8, (1, 2, 4, 8, 16)
#: Steps of the ladder of depths.
_RATIO = 1.2


@dataclass(frozen=True, slots=True, eq=False)
class MillingHistory:
    """A simulated cut.

    `time` [s], shape (n,)
    `angle` [rad], shape (n,): immersion of tooth 1 at the tip, growing
    `tip`, `velocity`, `force`: arrays, shape (n, 2) [m], [m/s], [N]; machine axes
    """

    time: FloatArray
    angle: FloatArray
    tip: FloatArray
    velocity: FloatArray
    force: FloatArray

    def __post_init__(self) -> None:
        for name in ("time", "angle", "tip", "velocity", "force"):
            object.__setattr__(self, name, frozen(getattr(self, name)))


@dataclass(frozen=True, slots=True)
class TimeDomain:
    """Regenerative time-domain simulation [tlusty1981] with a Poincare test, the method that decides disputes.

    Two cuts run side by side, one of them a little pushed, and are looked at once per period (a tooth's, a revolution's where teeth
    differ, a swing's of a varying speed): what their states differ by grows or dies away. The limit is where it does neither. Teeth
    leave the cut, with run-out for longer, and the engagement may change along the edge; a worn flank rubs only while it moves into
    the material, twice as much as the equivalent viscous force of the other methods, half of the time.

    Parameters
    ----------
    periods : int, default 150
        Most tooth periods that a depth is simulated for: near the limit a growth below about 1 / periods is not told from none.
    tolerance : float, default 3e-3
        Of the limit depth, relative, for the search; the growth's own error comes on top.
    contact_loss : bool, default True
        False lets a tooth cut where it would without vibration, and makes the rubbing viscous: the linear equations of the other
        methods. Where teeth differ or the speed swings, the forced vibration alone can lift teeth out, and the limit moves by tens
        of percents.
    watch : callable or None
        Told of each speed once its limit is known.

    Examples
    --------
    >>> import rcsa_ident as ri
    >>> mode = ri.normal_modes([ri.hz(900.0)], [0.02], [[5.0]], (ri.Coordinate("tip", ri.Dof.Y),))
    >>> cut = ri.MillingProcess(ri.Cutter(2, 0.012), ri.CuttingCoefficients(7e8, 0.3), ri.Engagement.from_immersion(0.5, "down"))
    >>> tip = ri.TipModes.of({ri.Dof.Y: mode})
    >>> lobes = ri.stability_lobes(tip, cut, ri.rpm(8000, 10_000, 2000), 10e-3, ri.TimeDomain())
    >>> (1e3 * lobes.limit_depth).round(2).tolist()
    [0.62, 0.33]
    """

    name: ClassVar[str] = MethodName.TIME_DOMAIN.value
    needs: ClassVar[Literal["receptance", "modes"]] = "modes"
    seconds_per_operation: ClassVar[float] = 6e-8
    gives_maps: ClassVar[bool] = False

    periods: int = 150
    tolerance: float = 3e-3
    contact_loss: bool = True
    watch: Watch | None = field(default=None, repr=False, compare=False)

    def __post_init__(self) -> None:
        if not 20 <= self.periods <= 100_000:
            raise InputError("periods", self.periods, "a whole number from 20 to 100000")
        if not 1e-6 <= self.tolerance <= 0.1:
            raise InputError("tolerance", self.tolerance, "a share from 1e-6 to 0.1")

    def operations(self, process: MillingProcess, speeds: FloatArray, top: float, max_depth: float) -> FloatArray:
        """Return how often a mode or a tooth's slice is moved on by a step, at each speed."""
        cutter = process.cutter
        steps = np.maximum(_FEWEST, _STEPS * ABOVE_TOP * top / (cutter.teeth * speeds))
        # limits are some part of the depths that are allowed
        slices = 1.0 + 0.25 * _SLICES * max_depth * cutter.largest_lag
        periods = 2.0 * self.periods + (0.0 if cutter.equally_spaced else _SETTLING * cutter.teeth)
        return LOOKS * periods * steps * (FITTED_MODES + cutter.teeth * slices)

    def lobes(self, tip: Receptance | TipModes, process: MillingProcess, speeds: FloatArray, max_depth: float) -> StabilityLobes:
        """Return the limit at each speed by itself."""
        modes = require_modes(tip, self.name)
        limit = np.full(speeds.size, np.inf)
        chatter, lobe = np.full(speeds.size, np.nan), np.full(speeds.size, -1, dtype=np.intp)
        flip = np.zeros(speeds.size, dtype=bool)
        low, lost = stable_depth_bound(modes, process), 0
        for i in coarse_to_fine(speeds.size):
            speed = float(speeds[i])
            for finer in _FINER:
                cut = _Cut(modes, process, speed, self.contact_loss, finer)
                growth = partial(cut.growth, periods=self.periods)
                depth = first_loss(growth, low, process.within_reach(max_depth), self.tolerance, _RATIO)
                if depth is None or cut.resolves(depth):
                    break
            else:
                lost += 1
            if depth is not None:
                limit[i] = depth
                chatter[i], flip[i] = cut.vibration(depth, self.periods)
                lobe[i] = int(chatter[i] / (speed * process.cutter.teeth))
            if self.watch is not None:
                self.watch(speed, float(limit[i]), float(chatter[i]))
        told = f"at {lost} of {speeds.size} speeds the limit is that of the simulation's steps: the worn flank damps more than they resolve"
        return StabilityLobes(speeds, limit, chatter, lobe, max_depth, self.name, warnings=(told,) if lost else (), flip=flip)


def milling_history(
    tip: Receptance | TipModes, process: MillingProcess, speed: float, depth: float, revolutions: float, push: float = 0.0
) -> MillingHistory:
    """Simulate a cut that starts in the steady state of equal teeth.

    `process`: with its feed per tooth
    `speed` [rad/s]; `depth` [m]
    `push` [m]: off the steady state
    """
    if process.feed_per_tooth is None:
        raise InputError("feed_per_tooth", "nothing", "the feed per tooth [m] of the cut to simulate")
    cut = _Cut(require_modes(tip, TimeDomain.name), process, positive("speed", speed, "rad/s"), leaves=True)
    run = cut.begin(positive("depth", depth, "m")).pushed(push)
    samples = run.march(int(np.ceil(positive("revolutions", revolutions) * cut.per_turn)))
    back = process.machine_from_feed.T
    angle = cut.step * (cut.per_turn + np.arange(samples.shape[0]))
    r = cut.directions
    return MillingHistory(cut.time(angle), angle, *(samples[:, first : first + 2] @ back for first in (0, r, 2 * r)))


@dataclass(slots=True, eq=False)
class _Run:
    """A simulation that goes on."""

    cut: _Cut
    plan: kernels.TimePlan
    pieces: FloatArray
    memory: kernels.Memory
    number: int

    def pushed(self, push: float) -> _Run:
        """Return a copy whose modes are pushed aside by about `push` [m] at the tip, and the surface that it left as well."""
        state, force, past = self.memory
        aside = push * np.exp(1j * np.arange(state.size))
        return _Run(self.cut, self.plan, self.pieces, kernels.Memory(state + aside, force.copy(), past + push), self.number)

    def settle(self, tolerance: float) -> bool:
        """Go to the state that a period repeats, stable or not: Anderson's acceleration of one period after the other.

        Returns whether a period changes it by less than `tolerance` [m]; where it grows beyond all numbers it stays as it was.
        """
        states: list[FloatArray] = []
        changes: list[FloatArray] = []
        begun = x = self.vector
        for _ in range(_MOST):
            self.march(self.cut.per_period)
            after = self.vector
            change = after - x
            if not np.all(np.isfinite(change)):
                self.vector = begun
                return False
            if np.max(np.abs(change[-self.memory.past.size :])) < tolerance:
                return True
            states.append(after)
            changes.append(change)
            del states[:-_MEMORY], changes[:-_MEMORY]
            x = after
            if len(states) > 1:
                bent = np.array(changes[1:]) - np.array(changes[:-1])
                weight = np.linalg.lstsq(bent.T, change, rcond=1e-12)[0]
                x = after - weight @ (np.array(states[1:]) - np.array(states[:-1]))
            self.vector = x
        return False

    @property
    def vector(self) -> FloatArray:
        """State, force and past as one vector, the past from the newest on; scaled to displacements."""
        state, force, past = self.memory
        return np.concatenate([state.real, state.imag, force * self.cut.softness, past[self._newest_first].ravel()])

    @vector.setter
    def vector(self, values: FloatArray) -> None:
        state, force, past = self.memory
        m, r = state.size, force.size
        state[:] = values[:m] + 1j * values[m : 2 * m]
        force[:] = values[2 * m : 2 * m + r] / self.cut.softness
        past[self._newest_first] = values[2 * m + r :].reshape(-1, r)

    @property
    def _newest_first(self) -> NDArray[np.intp]:
        count = self.memory.past.shape[0]
        return (self.number - 1 - np.arange(count)) % count

    def march(self, count: int) -> FloatArray:
        """Return tip, velocity and force of the next steps, in feed, normal and further directions, shape (count, 3 r)."""
        samples = np.empty((count, 3 * self.cut.directions))
        kernels.simulate(self.cut.arrays, self.pieces, self.plan, self.memory, self.number, samples)
        self.number += count
        return samples


class _Cut:
    """A speed, with the steps that it is simulated in."""

    def __init__(self, modes: TipModes, process: MillingProcess, speed: float, leaves: bool, finer: int = 1) -> None:
        self.process, self.speed, self.leaves = process, speed, leaves
        self.feed = process.feed_per_tooth or _FEED
        if process.feed_per_tooth is None and process.cutter.offset:
            raise InputError("feed_per_tooth", "nothing", "the feed per tooth [m]: with run-out it decides which teeth cut")
        #: A plain cut pushes and feels in its plane only.
        self.directions = directions_of(2 if process.is_plain else modes.directions)
        modes = modes.planar if self.directions == 2 else modes
        turn = turned(process, self.directions)
        outputs, inputs = turn.T @ modes.outputs, modes.inputs @ turn
        cutter, teeth = process.cutter, process.cutter.teeth
        # modes scaled so that each moves the tip alike
        size = np.linalg.norm(outputs, axis=0)
        size[size == 0.0] = 1.0
        constant = turn.T @ modes.constant @ turn
        self.arrays = ModeArrays(
            modes.pole.copy(), np.ascontiguousarray(outputs / size), np.ascontiguousarray(inputs * size[:, None]), constant
        )
        self.softness = modes.largest
        strength = modes.strength
        self.highest = float(np.max(np.abs(modes.pole)[strength >= _WEAK * strength.max()]))
        slowest = speed * (1.0 - (process.speed_variation.amplitude if process.speed_variation else 0.0))
        tooth = finer * max(_FEWEST, int(np.ceil(_STEPS * self.highest / (teeth * slowest))))
        #: Steps per revolution and their angle; pitches are whole numbers of steps where the teeth are equally spaced.
        self.per_turn, self.step = tooth * teeth, 2.0 * np.pi / (tooth * teeth)
        period = common_period(process, float(cutter.pitch[0]) if cutter.equally_spaced else 2.0 * np.pi)
        self.per_period = max(1, round(period / self.step))
        self.tooth_periods = self.per_period / tooth
        self.radius = process.cutter.outline.largest_radius

    def resolves(self, depth: float) -> bool:
        """Return whether the rubbing of a cut, which is that of the step before, changes the velocity by less than there is in a step."""
        if self.process.damping is None:
            return True
        widest = self.process.widest
        engaged = max(1.0, self.process.cutter.teeth * (widest.exit - widest.entry) / (2.0 * np.pi))
        rub = engaged * (2.0 if self.leaves else 1.0) * self.process.damping.strength * depth / (self.radius * self.speed)
        # what a unit impulse makes of the velocity
        jump = float(np.max(np.abs(2.0 * ((self.arrays.outputs * self.arrays.pole) @ self.arrays.inputs).real)))
        return rub * jump * self.step / self.speed < _RESOLVED

    def time(self, angle: FloatArray) -> FloatArray:
        """Seconds from the rotation of 0 on."""
        v = self.process.speed_variation
        if v is None:
            return angle / self.speed
        swing, time = v.ratio * self.speed, angle / self.speed
        for _ in range(60):
            # Newton's method, no further than a part of a swing at once
            change = time + v.amplitude / swing * (1.0 - np.cos(swing * time)) - angle / self.speed
            change = np.clip(change / (1.0 + v.amplitude * np.sin(swing * time)), -1.0 / swing, 1.0 / swing)
            time = time - change
            if np.max(np.abs(change)) * swing < 1e-13:
                break
        return time

    def begin(self, depth: float) -> _Run:
        """Return a cut in the steady state of equal teeth, where nothing regenerates."""
        process = self.process
        c, d, v = process.coefficients, process.damping, process.speed_variation
        plan = kernels.TimePlan(
            step=float(self.step),
            speed=float(self.speed),
            k_tangential=float(c.tangential),
            k_radial=float(c.tangential * c.radial_ratio),
            k_axial=float(c.tangential * c.axial_ratio),
            edge_tangential=float(c.tangential_edge),
            edge_radial=float(c.radial_edge),
            edge_axial=float(c.axial_edge),
            rub=0.0 if d is None else (2.0 if self.leaves else 1.0) * float(d.strength),
            friction=0.0 if d is None else float(d.friction),
            swing=0.0 if v is None else float(v.amplitude),
            swings=0.0 if v is None else float(v.ratio),
            leaves=self.leaves,
            regenerate=False,
        )
        memory = kernels.Memory(np.zeros_like(self.arrays.pole), np.zeros(self.directions), np.zeros((self.per_turn + 2, self.directions)))
        run = _Run(self, plan, self._pieces(depth), memory, 0)
        # from rest through one period of a force that knows no vibration: what is left decides on the state that repeats itself;
        # a period before that one, for a tooth may be in the cut where it begins
        turns = int(np.ceil(memory.past.shape[0] / self.per_period))
        run.march(self.per_period)
        memory.state[:] = 0.0
        run.march(self.per_period)
        duration = float(np.diff(self.time(self.step * np.array([0.0, self.per_period])))[0])
        memory.state[:] /= 1.0 - np.exp(self.arrays.pole * duration)
        run.march(turns * self.per_period)
        run.plan = plan._replace(regenerate=True)
        return run

    def _pieces(self, depth: float) -> FloatArray:
        """Pieces of all teeth's edges as the kernel wants them, shape (s, 9 + 3 teeth)."""
        cutter, teeth = self.process.cutter, self.process.cutter.teeth
        found = []
        for piece in self._places(depth):
            # waves lean the edge and lengthen it, see `rows_of`
            for j in range(teeth):
                kappa = np.arctan2(np.sin(piece.kappa), np.cos(piece.kappa) + piece.edges.slope[j] * np.sin(piece.kappa))
                width = piece.width * np.sin(piece.kappa) / np.sin(kappa)
                ahead = (j + np.arange(teeth)) % teeth
                back = np.cumsum(piece.edges.pitch[ahead], axis=0)
                ago = back / self.step
                # a delay of a whole number of steps is one, in spite of rounding
                ago = np.where(np.abs(ago - np.round(ago)) < 1e-9 * ago, np.round(ago), ago)
                less = piece.edges.offset[j] - piece.edges.offset[(ahead + 1) % teeth]
                since = np.stack([ago, self.feed * teeth * back / (2.0 * np.pi), less], axis=1).reshape(3 * teeth, -1)
                angle = np.mod(cutter.tooth_angle[j] - piece.edges.lag[j], 2.0 * np.pi)
                slowest = np.maximum(piece.r, SLOWEST * self.radius)
                for arc in piece.arcs:
                    place = arc[:, 0], arc[:, 1], width, np.sin(kappa), np.cos(kappa), piece.r, piece.z, slowest
                    found.append(np.concatenate([[angle, *place], since])[:, arc[:, 1] > arc[:, 0]])
        return np.ascontiguousarray(np.concatenate(found, axis=1).T) if found else np.zeros((0, kernels.PIECE + 3 * teeth))

    def _places(self, depth: float) -> list[Places]:
        """Places along the edge: of a plain cut equal slices, with an engagement that changes along it if there is one."""
        process, cutter = self.process, self.process.cutter
        if not process.is_plain:
            return places_of(cutter, process.engagement, depth, along=True, wave=_WAVE)
        count = max(1, int(np.ceil(_SLICES * depth * cutter.largest_lag)))
        if process.engagement_profile is None:
            rows = np.array([[0.0, 1.0, *same_everywhere(process.engagement).angles]])
        else:
            rows = process.engagement_profile(self.speed, depth)
        each = int(np.ceil(count / len(rows)))
        found = []
        for upper, lower, start, end in rows:
            z = depth * (upper + (lower - upper) * (np.arange(each) + 0.5) / each)
            r, kappa, width = (np.full(each, value) for value in (0.5 * cutter.diameter, 0.5 * np.pi, depth * (lower - upper) / each))
            arcs = np.broadcast_to(np.array([start, end]), (1, each, 2))
            found.append(Places(z, r, kappa, width, edges_at(cutter, z, kappa), np.zeros((cutter.teeth, each)), arcs))
        return found

    def growth(self, depth: float, periods: int) -> float:
        """Return the logarithm of the growth of a disturbance per tooth period."""
        return self._rate(self._disturbance(depth, periods)[0]) / self.tooth_periods

    def _rate(self, sizes: FloatArray) -> float:
        """Logarithm of the growth per period."""
        logs = np.log(np.maximum(sizes, 1e-300))
        if logs.size < 6:
            # chatter, or peace, at once: from what it was pushed by
            return float(logs[-1] - np.log(_PUSH * self.feed)) / logs.size
        # the first part is left to what dies away faster; a line through the rest
        first = int(_FASTER * logs.size)
        return float(np.polyfit(np.arange(first, logs.size), logs[first:], 1)[0])

    def vibration(self, depth: float, periods: int) -> tuple[float, bool]:
        """Return the frequency of the disturbance [rad/s], and whether it comes back the other way round each period."""
        sizes, path = self._disturbance(depth, periods)
        first = int(_FASTER * sizes.size)
        rate = self._rate(sizes) / self.per_period
        path = path[first * self.per_period :]
        window = np.exp(-rate * np.arange(path.shape[0])) * np.hanning(path.shape[0])
        lines = np.linalg.norm(np.fft.rfft(path * window[:, None], 4 * path.shape[0], axis=0), axis=1)
        turns = float(np.argmax(lines)) / (4 * path.shape[0]) * self.per_period
        flip = abs(turns % 1.0 - 0.5) < 0.5 / max(sizes.size - first, 1)
        return turns * 2.0 * np.pi / (self.per_period * self.step) * self.speed, bool(flip)

    def _disturbance(self, depth: float, periods: int) -> tuple[FloatArray, FloatArray]:
        """What two cuts side by side, one of them pushed, differ by: the state's size after each period, and the tip's path."""
        push = _PUSH * self.feed
        still = self.begin(depth)
        # teeth that differ, or rub, do not start in their steady state
        still.settle(1e-3 * push)
        pushed = still.pushed(push)
        r = self.directions
        scale = np.concatenate([np.ones(r), np.full(r, 1.0 / self.highest)])
        # slopes count by what they move at the cutter's radius
        scale[3:r] *= self.radius
        scale[r + 3 :] *= self.radius
        sizes, paths = [], []
        for _ in range(max(8, int(np.ceil(periods / self.tooth_periods)))):
            with np.errstate(over="ignore", invalid="ignore"):
                apart = pushed.march(self.per_period) - still.march(self.per_period)
            change = np.clip(np.nan_to_num(apart, nan=_BEYOND), -_BEYOND, _BEYOND)
            paths.append(change[:, :2])
            sizes.append(float(np.linalg.norm(change[:, : 2 * r] * scale)) / np.sqrt(change.shape[0]))
            if not _GONE * push < sizes[-1] < _CHATTER * self.feed:
                break
        return np.array(sizes), np.concatenate(paths)
