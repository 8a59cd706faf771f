"""The force observer: gap and fixture acceleration in, tip force out, axis by axis, live or from a record."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from rcsa_ident.base.arrays import ComplexArray, FloatArray, frozen
from rcsa_ident.base.errors import InputError
from rcsa_ident.base.shown import Saved
from rcsa_ident.dynamics.coordinates import Dof
from rcsa_ident.observer.kalman import FilterState, KalmanFilter
from rcsa_ident.observer.transfer_function import SampledModes, TransferFunction

#: What is left of the observer's start when it has settled: the settling time to 2 %.
LEFT = 0.02


@dataclass(frozen=True, slots=True, eq=False)
class RunOut:
    """What a turning spindle shows without cutting: lines of the air cut, turned to lie under the record.

    `spindle_speed` [rad/s]
    `order`, shape (o,): multiples of the spindle's frequency: whole numbers from 1, rising
    `gap`, `acceleration`: complex arrays, shape (o,) [m], [m/s^2]; signal = Re sum line e^{i order Omega t}, t from the record's first
        sample
    """

    spindle_speed: float
    order: FloatArray
    gap: ComplexArray
    acceleration: ComplexArray

    def __post_init__(self) -> None:
        object.__setattr__(self, "order", frozen(self.order))
        if np.any(self.order != np.rint(self.order)) or np.any(np.diff(self.order, prepend=0.0) <= 0.0):
            raise InputError("run-out orders", self.order.tolist(), "whole numbers from 1, rising")
        for name in ("gap", "acceleration"):
            object.__setattr__(self, name, frozen(getattr(self, name), np.complex128))

    def signals(self, first: int, count: int, step: float) -> tuple[FloatArray, FloatArray]:
        """Return gap and acceleration at `count` samples of a `step` [s] from the `first`, shape (count,) each [m], [m/s^2]."""
        return self.at(np.remainder(np.arange(first, first + count) * (self.spindle_speed * step / (2.0 * np.pi)), 1.0))

    def at(self, turn: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return gap and acceleration at angles of the spindle [turns], 0 where the record began, shape (n,) each."""
        gap, acceleration = np.zeros(turn.size), np.zeros(turn.size)
        once = np.exp(2j * np.pi * turn)
        # a power by multiplication costs a tenth of an exponential
        wave, power = np.ones_like(once), 0
        for order, g, a in zip(self.order.astype(int), self.gap, self.acceleration, strict=True):
            while power < order:
                wave, power = wave * once, power + 1
            gap += g.real * wave.real - g.imag * wave.imag
            acceleration += a.real * wave.real - a.imag * wave.imag
        return gap, acceleration


@dataclass(frozen=True, slots=True, eq=False)
class AxisSensors:
    """What one axis' sensors show of the flange's displacement, and how it follows the force.

    `transfer`: tip force to the flange's displacement as the sensor shows it
    `corner` [rad/s]: corner frequency of the high-pass that gap and fixture's motion share
    `gap_filter`, `acceleration_filter`: the latter None without an accelerometer: the gap is then taken for the flange's motion
    `run_out`: taken out of the signals where it is known
    """

    axis: Dof
    transfer: TransferFunction
    corner: float
    gap_filter: SampledModes
    acceleration_filter: SampledModes | None
    run_out: RunOut | None = None

    @property
    def filters(self) -> dict[str, SampledModes]:
        """What gap and, with an accelerometer, acceleration pass before they are added, by what they are called."""
        found = {"gap": self.gap_filter, "acceleration": self.acceleration_filter}
        return {name: each for name, each in found.items() if each is not None}


@dataclass(frozen=True, slots=True, eq=False)
class AxisState:
    """Where the sensors of one axis of a stream stand: the first gap sample (its mean is not observable) and both filters."""

    offset: float
    gap: FloatArray
    acceleration: FloatArray


@dataclass(frozen=True, slots=True, eq=False)
class ObserverState:
    """Where a stream stands. `count`: samples seen."""

    count: int
    axes: tuple[AxisState, ...]
    filters: tuple[FilterState, ...]

    @property
    def filtered(self) -> int:
        """Samples since the observer began, or began anew behind a gap."""
        return max(each.count for each in self.filters)


@dataclass(frozen=True, slots=True, eq=False)
class ForceBlock:
    """Estimates at some samples.

    `force` [N], shape (n, a): the force without its mean: below the band the displacement says nothing of it
    `walking` [N], shape (n, a): the part that no oscillator holds; all of it with a random walk alone
    `innovation` [m], shape (n, a): measured less predicted displacement
    """

    force: FloatArray
    walking: FloatArray
    innovation: FloatArray


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class ForceEstimate(Saved):
    """Forces of a record.

    `step` [s]; `force` [N], shape (n, a)
    `standard_deviation` [N], shape (n, a): what follows from sensor noise and the force model, raised where the innovations scatter more
        than they should
    `consistency` [-], shape (a,): scatter of the innovations in the band over the expected; 1 where model, noise and force agree, more
        where they are too sure of themselves. None of forces from a file.
    `start` [s]: time of the first force from the record's first sample: 0 where the observer's start is among them
    """

    axes: tuple[Dof, ...]
    step: float
    force: FloatArray
    standard_deviation: FloatArray
    consistency: FloatArray | None = None
    start: float = 0.0

    @property
    def time(self) -> FloatArray:
        """Time from the record's first sample, shape (n,) [s]."""
        return self.start + np.arange(self.force.shape[0]) * self.step

    def after(self, count: int) -> ForceEstimate:
        """Return the forces without the first `count` samples."""
        rest = frozen(self.force[count:]), frozen(self.standard_deviation[count:])
        return replace(self, force=rest[0], standard_deviation=rest[1], start=self.start + count * self.step)

    def __str__(self) -> str:
        size, std = np.std(self.force, axis=0), np.median(self.standard_deviation, axis=0)
        rows = [f"{axis.upper()} {a:.3g} N rms (± {b:.2g} N)" for axis, a, b in zip(self.axes, size, std, strict=True)]
        return f"{', '.join(rows)} over {self.force.shape[0] * self.step:.3g} s"


@dataclass(frozen=True, slots=True, eq=False)
class ForceObserver:
    """Tip forces from the flange's vibration; `run` is a scan of `step`, in blocks of any size with the same result.

    `filters`: in the order of the axes, each for as many of them as feel each other
    """

    axes: tuple[AxisSensors, ...]
    filters: tuple[KalmanFilter, ...]

    @property
    def groups(self) -> tuple[slice, ...]:
        """The axes of each filter."""
        ends = itertools.accumulate((each.count for each in self.filters), initial=0)
        return tuple(slice(*each) for each in itertools.pairwise(ends))

    @property
    def step_time(self) -> float:
        """Time between samples [s]."""
        return self.axes[0].transfer.step

    @property
    def settling(self) -> int:
        """Samples from the first after which the start has died out: forces before them are those of the observer, not of the cut.

        The estimate's error dies out with the closed-loop poles z of the Kalman filters, and of the filters before them: to 2 % within
        ln 50 / -ln max |z| samples. By then all gains are steady, too.
        """
        before = [each for axis in self.axes for each in axis.filters.values()]
        poles = [*(np.linalg.eigvals(each.state_space().A) for each in self.filters), *(each.decay for each in before)]
        slowest = max(float(np.max(np.abs(each))) for each in poles if each.size)
        return max(int(np.ceil(np.log(LEFT) / np.log(slowest))), *(each.gain.shape[0] for each in self.filters))

    def init(self) -> ObserverState:
        """Return the state before the first sample."""
        states = []
        for each in self.axes:
            shaken = np.zeros((2, 0)) if each.acceleration_filter is None else each.acceleration_filter.init()
            states.append(AxisState(np.nan, each.gap_filter.init(), shaken))
        return ObserverState(0, tuple(states), tuple(each.init() for each in self.filters))

    def to_control(self) -> Any:
        """Return the observer in the steady state as python-control's sampled ``StateSpace``, all axes at once.

        Inputs are ``gap_x`` [m] and, with an accelerometer, ``acceleration_x`` [m/s^2], and so on for each axis, run-out taken out of all;
        outputs ``force_x`` [N] and ``innovation_x`` [m] of each axis.
        """
        import control

        parts, force, innovation = [], list[int](), list[int]()
        for kalman, group in zip(self.filters, self.groups, strict=True):
            own = []
            for each in self.axes[group]:
                filters = [one.state_space().to_control() for one in each.filters.values()]
                own.append(control.ss([], [], [], np.ones((1, len(filters))), self.step_time) * control.append(*filters))
            parts.append(kalman.state_space().to_control() * control.append(*own))
            first = len(force) + len(innovation)
            force += range(first, first + kalman.count)
            innovation += range(first + kalman.count, first + 2 * kalman.count)
        inputs = [f"{name}_{each.axis}" for each in self.axes for name in each.filters]
        outputs = [f"{kind}_{each.axis}" for kind in ("force", "innovation") for each in self.axes]
        return control.ss(control.append(*parts)[[*force, *innovation], :], inputs=inputs, outputs=outputs)

    def step(self, state: ObserverState, gap: FloatArray, acceleration: FloatArray | None = None) -> tuple[ObserverState, ForceBlock]:
        """Return the state and the estimates after one sample of each axis. `gap` [m], shape (a,). `acceleration` [m/s^2], shape (a,)."""
        return self.run(state, np.asarray(gap)[None], None if acceleration is None else np.asarray(acceleration)[None])

    def run(self, state: ObserverState, gap: FloatArray, acceleration: FloatArray | None = None) -> tuple[ObserverState, ForceBlock]:
        """Return the state after a block of samples and the estimates at them.

        `gap` [m], shape (n, a): the gap as the displacement sensors show it, in the order of `axes`
        `acceleration` [m/s^2], shape (n, a): acceleration of the sensors' fixture
        """
        return self._scan(state, gap, acceleration, lost=False)

    def _scan(self, state: ObserverState, gap: FloatArray, acceleration: FloatArray | None, lost: bool) -> tuple[ObserverState, ForceBlock]:
        gap = np.asarray(gap, dtype=float)
        if gap.ndim != 2 or gap.shape[1] != len(self.axes) or (acceleration is not None and np.shape(acceleration) != gap.shape):
            raise InputError("samples", np.shape(gap), f"one column for each of {len(self.axes)} axes, accelerations alike")
        if not np.all(np.isfinite(gap)) or (acceleration is not None and not np.all(np.isfinite(acceleration))):
            raise InputError("samples", "a lost sample", "finite numbers")
        states, displacement = [], np.empty(gap.shape, order="F")
        for i, each in enumerate(self.axes):
            after, displacement[:, i] = _displacement(
                each, state.axes[i], state.count, gap[:, i], None if acceleration is None else acceleration[:, i]
            )
            states.append(after)
        filters, parts = [], []
        for kalman, group, before in zip(self.filters, self.groups, state.filters, strict=True):
            own = displacement[:, group]
            now, found = kalman.predict(before, len(own)) if lost else kalman.run(before, own)
            filters.append(now)
            parts.append(found)
        found = np.concatenate(parts, axis=2)
        return ObserverState(state.count + gap.shape[0], tuple(states), tuple(filters)), ForceBlock(*(found[:, c] for c in range(3)))

    def bridge(self, state: ObserverState, gap: FloatArray, acceleration: FloatArray | None = None) -> tuple[ObserverState, ForceBlock]:
        """Return the state after samples that were lost, and what was to be expected at them.

        The Kalman filter predicts and corrects nothing: oscillators go on as they were. The filters before it need an input and
        get the substitutes; what is wrong with those they forget within a few periods of the high-pass.

        `gap`, `acceleration`: arrays, shape (n, a) [m], [m/s^2]; substitutes for the lost samples
        """
        return self._scan(state, gap, acceleration, lost=True)

    def observe(self, gap: FloatArray, acceleration: FloatArray | None = None, smooth: bool = False) -> ForceEstimate:
        """Return the forces of a whole record.

        `gap` [m], shape (n, a)
        `acceleration` [m/s^2], shape (n, a): acceleration of the sensors' fixture
        `smooth`: each sample given all others; else given those before it, as live
        Returns ForceEstimate: from the first sample on: until `settling` it is the observer's start.
        """
        block = self.run(self.init(), gap, acceleration)[1]
        n = block.force.shape[0]
        settled = min(self.settling, n // 2)
        force, deviation, consistency = np.array(block.force), np.empty_like(block.force), np.ones(len(self.axes))
        for kalman, group in zip(self.filters, self.groups, strict=True):
            if smooth:
                force[:, group] = kalman.smooth(
                    np.stack([block.force[:, group], block.walking[:, group], block.innovation[:, group]], axis=1)
                )
            deviation[:, group] = kalman.standard_deviation(n, smooth)
            consistency[group] = [
                _scatter(innovation, each.transfer, variance)
                for innovation, each, variance in zip(
                    block.innovation[settled:, group].T, self.axes[group], np.diagonal(kalman.variance[-1]), strict=True
                )
            ]
        deviation = deviation * np.maximum(consistency, 1.0)
        return ForceEstimate(tuple(each.axis for each in self.axes), self.step_time, frozen(force), frozen(deviation), frozen(consistency))


def restore_mean_force(estimate: ForceEstimate, idle: float) -> tuple[ForceEstimate, FloatArray]:
    """Return the estimate with the mean that an interrupted cut gives away: between its teeth the force is zero.

    `idle`: share of the time in which no tooth cuts, at least
    Returns ForceEstimate and array, shape (a,) [N]: the forces, and what was added to each axis: the middle of the narrowest range that
        holds half of the idle share, with its sign turned.
    """
    if not 0.0 < idle < 1.0:
        raise InputError("idle share", f"{100.0 * idle:g} %", "more than 0 % and less than 100 %: the time in which no tooth cuts")
    levels = []
    for values in np.sort(estimate.force, axis=0).T:
        held = max(int(0.5 * idle * values.size), 2)
        start = int(np.argmin(values[held - 1 :] - values[: values.size - held + 1]))
        levels.append(-float(np.mean(values[start : start + held])))
    return replace(estimate, force=frozen(estimate.force + np.array(levels))), frozen(levels)


def force_observer(parts: Sequence[ForceObserver]) -> ForceObserver:
    """Return the observer of the axes of several, all sampled alike, that do not feel each other."""
    axes = tuple(axis for each in parts for axis in each.axes)
    if not axes or len({each.transfer.step for each in axes}) > 1:
        raise InputError("axes", len(axes), "one or more with the same sampling rate")
    return ForceObserver(axes, tuple(kalman for each in parts for kalman in each.filters))


def _scatter(innovation: FloatArray, transfer: TransferFunction, variance: float) -> float:
    """Standard deviation of innovations in the observer's band over that of white noise of the filter's own variance."""
    n = innovation.size
    frequency = np.fft.rfftfreq(n, transfer.step) * 2.0 * np.pi if n else np.zeros(0)
    inside = (frequency >= transfer.band[0]) & (frequency <= transfer.band[1])
    if not inside.any():
        return 1.0
    # a taper keeps the lines above the band where they are
    taper = np.hanning(n + 2)[1:-1]
    power = np.abs(np.fft.rfft(innovation * taper)[inside]) ** 2
    return float(np.sqrt(np.mean(power) / (np.sum(taper**2) * variance)))


def _displacement(
    sensors: AxisSensors, state: AxisState, first: int, gap: FloatArray, acceleration: FloatArray | None
) -> tuple[AxisState, FloatArray]:
    """High-passed absolute displacement of the flange, run-out taken out, and the filters' new states."""
    if sensors.run_out is not None:
        still, shaken = sensors.run_out.signals(first, gap.size, sensors.transfer.step)
        gap = gap - still
        acceleration = None if acceleration is None else acceleration - shaken
    offset = state.offset
    if not np.isfinite(offset) and gap.size:
        # the mean is not observable: without it the high-pass has less to forget
        offset = float(gap[0])
    passed, measured = sensors.gap_filter.run(state.gap, gap - offset)
    shaken_state = state.acceleration
    if sensors.acceleration_filter is not None:
        if acceleration is None:
            raise InputError("acceleration", "none", "the fixture's acceleration, which this observer was made for")
        shaken_state, more = sensors.acceleration_filter.run(state.acceleration, acceleration)
        measured = measured + more
    return AxisState(offset, passed, shaken_state), measured
