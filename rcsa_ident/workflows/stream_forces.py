"""Forces while they come: a monitored cut's observer as a stream that keeps the spindle's angle and bridges lost samples."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from rcsa_ident.base.arrays import ComplexArray, FloatArray, frozen
from rcsa_ident.base.errors import InputError
from rcsa_ident.observer.force import ForceBlock, ForceObserver, ObserverState, RunOut
from rcsa_ident.signals.alignment import align
from rcsa_ident.signals.recording import Quantity, Recording
from rcsa_ident.signals.spectra import line_spectrum
from rcsa_ident.workflows.estimate_forces import LOOSE_ANGLE, MonitoredCut

#: The angle is looked at once in so many revolutions, at so many orders.
TURNS, ORDERS = 8, 16
#: Share of a deviation from which the speed is corrected; the angle takes all of it. Errors then halve with each look.
SPEED_SHARE = 0.5
#: Longer gaps are not bridged: the observer begins anew behind them [s].
LONGEST_BRIDGE = 0.1


@dataclass(frozen=True, slots=True, eq=False)
class AngleReference:
    """Lines whose phases tell the spindle's angle.

    `spindle_speed` [rad/s]: at which they were found
    `line` [m], shape (ORDERS + 1, a): of the gap sensors at orders 0 to ORDERS, phases from the stream's first sample
    `teeth`: orders that the teeth share are not looked at; 1: all are
    """

    spindle_speed: float
    line: ComplexArray
    teeth: int

    def __post_init__(self) -> None:
        object.__setattr__(self, "line", frozen(self.line, np.complex128))


@dataclass(frozen=True, slots=True, eq=False)
class AngleState:
    """Where the spindle stands beyond an angle that grows with the reference's speed.

    `first`: sample with which this look began
    `angle` [rad]: at that sample
    `slope` [rad]: what comes to it with each sample
    `sums` [m], shape (ORDERS, a): lines of the samples so far, under a Hann window
    `known`: whether the last look told the angle
    """

    first: int
    angle: float
    slope: float
    sums: ComplexArray
    known: bool


@dataclass(frozen=True, slots=True, eq=False)
class LiveState:
    """Where a stream stands.

    `count`: samples so far, lost ones among them
    `gap`, `acceleration`, shape (m, a): of the last revolution at most
    """

    count: int
    observer: ObserverState
    angle: AngleState
    gap: FloatArray
    acceleration: FloatArray


@dataclass(frozen=True, slots=True, eq=False)
class LiveObserver:
    """Forces of a stream that does not end; `run` gives the same in blocks of any size.

    Without `run_out` it is the observer itself, to the last digit. With it the run-out turns with the spindle, whose angle
    is followed: a speed known to a millionth is a radian off at the eighth order after two minutes.

    Parameters
    ----------
    observer : ForceObserver
    reference : AngleReference
    run_out : tuple of RunOut, one for each axis, or empty
        Taken out at the angle that is followed; the observer then takes out none itself.

    Notes
    -----
    The angle beyond the reference's speed is theta[k] = angle + slope k within a look of 8 revolutions. At its end the lines of the
    orders that teeth do not share, demodulated with theta, lie turned by the deviation d against the reference's (`align`);
    slope' = slope + d / 2n, angle' = angle + (slope + slope') n / 2 + d. For a constant speed all errors halve with each look.
    """

    observer: ForceObserver
    reference: AngleReference
    run_out: tuple[RunOut, ...] = ()

    @property
    def look(self) -> int:
        """Samples between two looks at the angle."""
        return round(TURNS * self._turn)

    @property
    def _turn(self) -> float:
        """Samples of a revolution."""
        return 2.0 * np.pi / (self.reference.spindle_speed * self.observer.step_time)

    def init(self) -> LiveState:
        """Return the state before the first sample."""
        none = np.zeros((0, len(self.observer.axes)))
        sums = np.zeros((ORDERS, len(self.observer.axes)), dtype=complex)
        return LiveState(0, self.observer.init(), AngleState(0, 0.0, 0.0, sums, True), none, none)

    def drift(self, state: LiveState) -> float:
        """Return how much faster the spindle turns than the reference's, as a share."""
        return state.angle.slope / (self.reference.spindle_speed * self.observer.step_time)

    def run(self, state: LiveState, gap: FloatArray, acceleration: FloatArray | None = None) -> tuple[LiveState, ForceBlock]:
        """Return the state after a block of samples and the estimates at them; arrays as `ForceObserver.run` takes them."""
        gap = np.asarray(gap, dtype=float)
        shaken = np.zeros_like(gap) if acceleration is None else np.asarray(acceleration, dtype=float)
        return self._scan(state, gap, shaken, lost=False)

    def bridge(self, state: LiveState, count: int) -> LiveState:
        """Return the state after `count` samples that were lost.

        Up to 0.1 s the filters are shown what came a revolution earlier (turned on by linear interpolation), while the Kalman
        filter predicts: in a steady cut forces go on without a transient. Behind a longer gap, or before a whole revolution has
        been seen, the observer begins anew and settles again, at the angle that the last known speed leads to.
        """
        turn = self._turn
        if count * self.observer.step_time > LONGEST_BRIDGE or state.gap.shape[0] < turn + 1.0:
            fresh = replace(self.observer.init(), count=state.observer.count + count)
            none = np.zeros_like(state.gap[:0])
            angle = self._from(state.angle, state.count + count, state.angle.known)
            return LiveState(state.count + count, fresh, angle, none, none)
        place = np.arange(count)
        place = state.gap.shape[0] + place - turn * np.ceil((place + 1.0) / turn)
        lower = np.floor(place).astype(int)
        share = (place - lower)[:, None]
        gap, shaken = ((1.0 - share) * each[lower] + share * each[lower + 1] for each in (state.gap, state.acceleration))
        return self._scan(state, gap, shaken, lost=True)[0]

    def _scan(self, state: LiveState, gap: FloatArray, shaken: FloatArray, lost: bool) -> tuple[LiveState, ForceBlock]:
        observer, angle, begin = state.observer, state.angle, 0
        blocks: list[ForceBlock] = []
        step = self.observer.bridge if lost else self.observer.run
        while begin < gap.shape[0] or not blocks:
            first = state.count + begin
            end = min(gap.shape[0], begin + angle.first + self.look - first)
            part, moved = gap[begin:end], shaken[begin:end]
            turn = self._turns(angle, first, end - begin)
            angle = replace(angle, sums=angle.sums + self._lines(part, turn, first - angle.first))
            if self.run_out:
                still = [each.at(turn) for each in self.run_out]
                part = part - np.stack([each[0] for each in still], axis=1)
                moved = moved - np.stack([each[1] for each in still], axis=1)
            observer, block = step(observer, part, moved)
            blocks.append(block)
            begin = end
            if state.count + end == angle.first + self.look:
                angle = self._looked(angle)
        keep = int(np.ceil(self._turn)) + 2
        gap, shaken = np.concatenate([state.gap, gap[-keep:]])[-keep:], np.concatenate([state.acceleration, shaken[-keep:]])[-keep:]
        joined = ForceBlock(*(np.concatenate([getattr(b, n) for b in blocks]) for n in ("force", "walking", "innovation")))
        return LiveState(state.count + begin, observer, angle, gap, shaken), joined

    def _turns(self, angle: AngleState, first: int, count: int) -> FloatArray:
        """Angle of the spindle at `count` samples from the `first` [turns]."""
        place = np.arange(first, first + count)
        beyond = (angle.angle + angle.slope * (place - angle.first)) / (2.0 * np.pi)
        return np.remainder(np.remainder(place / self._turn, 1.0) + beyond, 1.0)

    def _lines(self, gap: FloatArray, turn: FloatArray, place: int) -> ComplexArray:
        """Share of some samples in the lines of a look."""
        window = 1.0 - np.cos(2.0 * np.pi * (place + 0.5 + np.arange(turn.size)) / self.look)
        # a power by multiplication costs a tenth of an exponential
        waves = np.cumprod(np.broadcast_to(np.exp(-2j * np.pi * turn)[:, None], (turn.size, ORDERS)), axis=1)
        return waves.T @ (gap * (window * (2.0 / self.look))[:, None])

    def _looked(self, angle: AngleState) -> AngleState:
        """The angle after a whole look."""
        found = np.concatenate([self.reference.line[:1], angle.sums])
        deviation, std = align(found, self.reference.line, self.reference.teeth, ORDERS)
        after = self._from(angle, angle.first + self.look, std <= LOOSE_ANGLE)
        if not after.known:
            return after
        deviation = float(np.remainder(deviation + np.pi, 2.0 * np.pi) - np.pi)
        slope = angle.slope + SPEED_SHARE * deviation / self.look
        return replace(after, angle=after.angle + deviation + 0.5 * (slope - angle.slope) * self.look, slope=slope)

    @staticmethod
    def _from(angle: AngleState, first: int, known: bool) -> AngleState:
        """A look that begins at a sample, the spindle turning on as it did."""
        moved = np.remainder(angle.angle + angle.slope * (first - angle.first), 2.0 * np.pi)
        return AngleState(first, float(moved), angle.slope, np.zeros_like(angle.sums), known)


def live_observer(found: MonitoredCut, recording: Recording, follow: bool = True) -> LiveObserver:
    """Return the stream's observer of a monitored cut.

    `recording`: that it was made from: the stream's first samples
    `follow`: run-out follows the spindle; else it turns with the recording's mean speed for ever, as in `observe`
    """
    axes = found.observer.axes
    run_out = tuple(each.run_out for each in axes if each.run_out is not None)
    if run_out and len(run_out) < len(axes):
        raise InputError("run-out", f"{len(run_out)} of {len(axes)} axes", "all axes, or none")
    line = np.zeros((ORDERS + 1, len(axes)), dtype=complex)
    if run_out:
        for i, each in enumerate(run_out):
            low = each.order <= ORDERS
            line[each.order[low].astype(int), i] = each.gap[low]
    else:
        shown = [recording.channel(Quantity.DISPLACEMENT, each.axis) for each in axes]
        gap = np.stack([each[1] for each in shown if each is not None], axis=1)
        speed = found.spindle_speed
        amplitude = line_spectrum(gap, recording.rate, speed, (ORDERS + 0.5) * speed / (2.0 * np.pi)).amplitude
        line[1 : amplitude.shape[0]] = amplitude[1 : ORDERS + 1]
    reference = AngleReference(found.spindle_speed, line, found.teeth if run_out else 1)
    if not (run_out and follow):
        return LiveObserver(found.observer, reference)
    bare = replace(found.observer, axes=tuple(replace(each, run_out=None) for each in axes))
    return LiveObserver(bare, reference, run_out)
