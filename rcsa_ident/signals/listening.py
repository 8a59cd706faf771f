"""What one recording says by itself, of any sensor and without a drawing: the speed, how steady it is, whether it cut, and chatter."""

from __future__ import annotations

from dataclasses import dataclass, replace
from enum import StrEnum
from typing import NamedTuple

import numpy as np

from rcsa_ident.base.arrays import FloatArray
from rcsa_ident.base.errors import InputError, positive
from rcsa_ident.base.remarks import Remark
from rcsa_ident.base.shown import Drawn
from rcsa_ident.base.units import from_hz, to_hz, to_rpm
from rcsa_ident.signals.active_segment import BAND, decimated, loud_part
from rcsa_ident.signals.recording import Quantity
from rcsa_ident.signals.sound.asynchronous_lines import OffOrders, off_orders
from rcsa_ident.signals.sound.order_lines import FOLDED_ORDERS, UNFILTERED, OrderLines, order_lines
from rcsa_ident.signals.sound.rotation import Rotation, follow_on
from rcsa_ident.signals.sound.speed_search import APART, HIGHEST_SHARE, TURNS, find_rotation, window_length
from rcsa_ident.signals.verdict import RecordCode

#: Spindle frequencies that are looked for where nothing is told [Hz]: 300 to 48 000 rev/min.
LOWEST, HIGHEST = 5.0, 800.0
#: Share of a told speed within which the true one is looked for.
AROUND = 0.03
#: Change of the speed over the part, as a share, above which it is a ramp, and how many times the wander about the ramp it has to be.
_RAMP, _RAMP_OVER_WANDER = 0.01, 3.0
#: Wander above which a speed is not steady.
_UNSTEADY = 0.02
#: Explained share below which nothing cuts, if the teeth do not stand out either.
_IDLE_SHARE = 0.15
#: Probability from which on lines beside the orders are chatter (fewer than one in fifty of the made-up stable records reach it), and
#: from which on it is not told; in what may be idle, also the least share of the record that they have to hold.
_CHATTER, _DOUBT, _CHATTER_SHARE = 0.8, 0.5, 0.15
#: Probability from which on a speed is named beside the likeliest.
_NAMED_SPEED = 0.02
#: Most teeth that are looked for, and the share of the orders' power, or of that of chatter's sidebands, that their multiples hold.
_MOST_TEETH, _TOOTH_SHARE, _SIDEBAND_SHARE = 12, 0.8, 0.6
#: How many times stronger than others lines are that stand out.
_STAND_OUT = 10.0
#: Highest frequency that a line may have been folded from [Hz].
_HIGHEST_ALIAS = 5e3
#: Explained share from which on folded orders are no chance.
_FOLDED_GAIN = 2e-3
#: Suggested speeds: most tooth passages in a period of the chatter, and how far from the present speed where no range is told.
_MOST_WAVES, _SLOWEST, _FASTEST = 8, 0.5, 3.0


class Heard(StrEnum):
    """What a recording holds."""

    STABLE = "stable"
    CHATTER = "chatter"
    IDLE = "idle"
    NO_CUT = "no cut"
    UNSTEADY = "unsteady"


class Event(NamedTuple):
    """Something that happens in a recording.

    `kind`: ``entry``, ``exit``, ``overload`` or ``drop-out``
    `time` [s]: None where it is not told
    """

    kind: str
    time: float | None


class Record(NamedTuple):
    """What was listened to.

    `samples`, shape (n, c): lost samples are filled
    `rate` [Hz]
    `name`: of the recording
    `channels`: as the recording names them
    """

    samples: FloatArray
    rate: float
    quantity: Quantity
    name: str = ""
    channels: tuple[str, ...] = ()

    @property
    def loudest(self) -> FloatArray:
        """The channel that moves most, shape (n,)."""
        loudest: FloatArray = self.samples[:, int(np.argmax(self.samples.var(axis=0)))]
        return loudest


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Listening(Drawn):
    """What a recording says.

    Parameters
    ----------
    verdict : Heard
    reasons : tuple of str
        Sentences: why, and what was taken as given.
    duration : float [s]
    part : (float, float) [s]
        What was judged: the longest stretch that is loud.
    band : float [Hz]
        Frequency up to which it was judged.
    spindle_speed, spindle_speed_std : float or None [rad/s]
        Mean of the part; None where none was found.
    other_speeds : tuple of float [rad/s]
        Speeds that may be the spindle's instead: they differ by whole factors, or explain the record by other lines.
    speed_probabilities : tuple of float
        Probabilities of the spindle's speed and of the others, in this order; empty where no speed was found.
    chatter_probability : float or None
        That the cut chatters, given its lines beside the orders; None where no speed was found.
    wander : float or None
        Standard deviation of the speed in windows of a quarter of a second, about a ramp where there is one, as a share.
    ramp : (float, float) or None [rad/s]
        First and last speed where it changes on purpose.
    teeth : int or None
        As told, or as the lines show.
    explained_share : float or None
        Share of the variance that lines at multiples of the followed speed explain.
    folded : bool
        Orders above half the sampling rate stand folded back in the record.
    chatter : tuple of float [Hz]
        The structure's frequency, as the sampling shows it.
    aliases : tuple of float [Hz]
        All frequencies that the sampling cannot tell apart from it; one where it can.
    lines : tuple of float [Hz]
        Other lines beside the orders.
    suggested_speeds : tuple of float [rad/s]
        Speeds that put a whole number of tooth passages on the chatter's period.
    events : tuple of Event
    record : Record or None
        The samples, for the figure.

    Examples
    --------
    >>> import rcsa_ident as ri
    >>> path = "data/sample_runs/recordings/S1-ER32-00_cut.h5"
    >>> heard = ri.listen(path, channels=["flange_x"], quantity="displacement", teeth=4)
    >>> print(heard.verdict)
    stable
    >>> heard.chatter, heard.suggested_speeds
    ((), ())
    """

    verdict: Heard
    reasons: tuple[str, ...]
    duration: float
    part: tuple[float, float]
    band: float
    spindle_speed: float | None = None
    spindle_speed_std: float | None = None
    other_speeds: tuple[float, ...] = ()
    speed_probabilities: tuple[float, ...] = ()
    chatter_probability: float | None = None
    wander: float | None = None
    ramp: tuple[float, float] | None = None
    teeth: int | None = None
    explained_share: float | None = None
    folded: bool = False
    chatter: tuple[float, ...] = ()
    aliases: tuple[float, ...] = ()
    lines: tuple[float, ...] = ()
    suggested_speeds: tuple[float, ...] = ()
    events: tuple[Event, ...] = ()
    record: Record | None = None

    def __str__(self) -> str:
        if self.spindle_speed is None:
            return str(self.verdict)
        return f"{self.verdict} at {to_rpm(self.spindle_speed):.1f} rev/min"


def listen(
    samples: FloatArray,
    rate: float,
    quantity: Quantity = Quantity.ACCELERATION,
    teeth: int | None = None,
    spindle_speed: float | None = None,
    between: tuple[float, float] | None = None,
) -> Listening:
    """Return what a recording says: speed, teeth, verdict, chatter and speeds to try.

    `samples`, shape (n, c): channels of one quantity, without lost samples
    `rate` [Hz]
    `quantity`: what the channels measure. Which of the chatter's lines is the structure's is told by the motion, also of accelerations;
        sound is taken as it is heard. A displacement is mostly run-out and roundness, which are there in the air, too.
    `teeth`: as told; else they are found from the lines
    `spindle_speed` [rad/s]: as programmed; the true one is looked for near it
    `between`: (float, float) or None [rad/s]; speeds that the machine may turn at: where it is looked for, and suggested
    Raises `InputError`: the record is too short, or nothing moves in it.

    Examples
    --------
    >>> time, rng = np.arange(8192) / 4096.0, np.random.default_rng(1)
    >>> signal = np.sum([np.cos(2 * np.pi * 100.0 * m * time) for m in (1, 2, 4, 8)], axis=0) + 0.1 * rng.standard_normal(8192)
    >>> print(listen(signal[:, None], 4096.0))
    stable at 6000.0 rev/min
    """
    positive("sampling_rate_hz", rate, "Hz")
    if teeth is not None and not 1 <= teeth <= 100:
        raise InputError("teeth", teeth, "1 to 100")
    low, high = _search(spindle_speed, between)
    duration = samples.shape[0] / rate
    least = max(TURNS / high, 64.0 / rate)
    if duration < least:
        raise InputError("recording", f"{duration:.3g} s", f"at least {least:.2g} s")
    if not np.ptp(samples, axis=0).max() > 0.0:
        raise InputError("recording", "a constant value in every channel", "a signal that moves")
    samples, rate, band = decimated(samples, rate)
    loud = loud_part(samples, rate)
    start, stop = loud.start / rate, loud.stop / rate
    events = (Event("entry", start),) * (loud.start > 0) + (Event("exit", stop),) * (loud.stop < samples.shape[0])
    nothing = Listening(Heard.UNSTEADY, (), duration, (start, stop), band, events=events)
    low, high = max(low, TURNS / (stop - start)), min(high, HIGHEST_SHARE * rate)
    if high < 1.01 * low:
        words = f"the longest even stretch, {stop - start:.2g} s at {rate:.4g} Hz, is too short, or its rate too low, to tell the speed"
        return replace(nothing, reasons=(words,))
    part = samples[loud]
    fold = rate < UNFILTERED and quantity is not Quantity.SOUND
    # folded orders stand where those of other speeds would: teeth do not tell one from the other there
    found = find_rotation(part, rate, low, high, None if fold else teeth)
    if found is None:
        words = "there are no lines at the multiples of one frequency: the spindle does not turn, or is not heard"
        return replace(nothing, verdict=Heard.NO_CUT, reasons=(words,))
    lines, rotation, folded = _lines(part, rate, band, found.rotation, fold)
    others = [(hertz, probability) for hertz, probability in found.odds[1:] if probability >= _NAMED_SPEED]
    answer = replace(
        nothing,
        other_speeds=tuple(from_hz(hertz) for hertz, _ in others),
        speed_probabilities=tuple(probability for _, probability in (*found.odds[:1], *others)),
        folded=folded,
        explained_share=lines.explained,
    )
    return _judged(answer, part, rate, lines, rotation, quantity, teeth, between or _around(rotation), fold)


def _search(spindle_speed: float | None, between: tuple[float, float] | None) -> tuple[float, float]:
    """Frequencies between which the spindle's is looked for [Hz]."""
    if spindle_speed is not None:
        told = to_hz(positive("spindle_speed", spindle_speed, "rad/s"))
        return (1.0 - AROUND) * told, (1.0 + AROUND) * told
    if between is None:
        return LOWEST, HIGHEST
    if not 0.0 < between[0] < between[1]:
        raise InputError("speeds", between, "two speeds above 0, the lower one first")
    return (1.0 - APART) * to_hz(between[0]), (1.0 + APART) * to_hz(between[1])


def _around(rotation: Rotation) -> tuple[float, float]:
    """Speeds that are suggested where no range is told [rad/s]."""
    return _SLOWEST * rotation.spindle_speed, _FASTEST * rotation.spindle_speed


def _lines(part: FloatArray, rate: float, band: float, rotation: Rotation, fold: bool) -> tuple[OrderLines, Rotation, bool]:
    """The lines of the orders, the rotation that explains most by them, and whether orders stand folded back among them."""
    frequency = to_hz(rotation.spindle_speed)
    length = window_length(rate, frequency, part.shape[0])
    below = max(int(min(0.49 * rate, band) / frequency), 1)
    plain = order_lines(part, rotation.angle, length, below)
    if fold and below < FOLDED_ORDERS:
        both = order_lines(part, rotation.angle, length, FOLDED_ORDERS)
        # both per degree of freedom: more orders explain no more of noise
        if both.explained > plain.explained + _FOLDED_GAIN:
            closer = follow_on(part, rotation, FOLDED_ORDERS)
            again = order_lines(part, closer.angle, length, FOLDED_ORDERS)
            return (again, closer, True) if again.explained > both.explained else (both, rotation, True)
    return plain, rotation, False


def _judged(
    answer: Listening,
    part: FloatArray,
    rate: float,
    lines: OrderLines,
    rotation: Rotation,
    quantity: Quantity,
    told: int | None,
    between: tuple[float, float],
    fold: bool,
) -> Listening:
    """The answer with what is said of a part whose rotation is known."""
    power, gap = lines.power[1:], quantity is Quantity.DISPLACEMENT
    teeth = told if gap else told or _teeth(power)
    beside = _beside(part, rate, lines, rotation, answer.band, quantity, teeth)
    ramp, wander = _ramp(*rotation.speeds())
    answer = replace(
        answer,
        spindle_speed=rotation.spindle_speed,
        spindle_speed_std=rotation.speed_std,
        wander=wander,
        ramp=ramp,
        teeth=teeth,
        chatter_probability=beside.probability,
    )
    explained = max(lines.explained, 0.0)
    silent = explained < _IDLE_SHARE and not gap and (teeth is None or _on_multiples(power, teeth) < _TOOTH_SHARE)
    if beside.probability > _CHATTER and (not silent or beside.share > _CHATTER_SHARE):
        return _chattering(answer, beside, rate, told or _teeth(beside.beside, _SIDEBAND_SHARE) or teeth, between, fold)
    if silent:
        words = f"the spindle's orders explain {explained:.0%} of the record and the teeth do not stand out among them: nothing is cut"
        return replace(answer, verdict=Heard.IDLE, reasons=(words,), teeth=told, lines=tuple(beside.frequency))
    hum = () if beside.hum is None else (f"multiples of the mains, {beside.hum:.0f} Hz, are heard: they are not chatter",)
    if wander > _UNSTEADY:
        words = f"the speed changes by {wander:.1%} and not along a ramp"
        return replace(answer, verdict=Heard.UNSTEADY, reasons=(words, *hum), lines=tuple(beside.frequency))
    if beside.probability > _DOUBT:
        words = (
            f"lines beside the multiples of the spindle's frequency, the structure's may be {beside.frequency[0]:.1f} Hz: the record does "
            f"not show whether they are chatter (probability {beside.probability:.0%})"
        )
        return replace(answer, verdict=Heard.UNSTEADY, reasons=(words, *hum), lines=tuple(beside.frequency))
    words = f"lines at multiples of the spindle's frequency explain {explained:.0%} of the record"
    if beside.frequency.size:
        words += f", lines beside them {beside.share:.1%} (probability of chatter {beside.probability:.1%})"
    reasons = [words, *hum]
    if gap:
        reasons.append("a gap sensor sees run-out and roundness in the air, too: whether it cuts is not told")
    if teeth is not None and teeth % 2 == 0:
        reasons.append(f"chatter that repeats every second tooth would stand on the run-out's orders with {teeth} teeth: it is not judged")
    return replace(answer, verdict=Heard.STABLE, reasons=tuple(reasons), lines=tuple(beside.frequency))


def _beside(
    part: FloatArray, rate: float, lines: OrderLines, rotation: Rotation, band: float, quantity: Quantity, teeth: int | None
) -> OffOrders:
    """Lines beside the orders of a part."""
    order = np.arange(1, lines.power.size)
    apparent = np.abs((order * to_hz(rotation.spindle_speed) + 0.5 * rate) % rate - 0.5 * rate)
    forced = 0.5 * np.mean(np.sum(np.abs(lines.amplitude[:, 1:]) ** 2, axis=1), axis=0)
    rest, typical = lines.rest(part, rotation.angle), _typical(part, rate)
    return off_orders(rest, forced, typical, rate, apparent, band, quantity is Quantity.ACCELERATION, teeth)


def stands_beside(part: FloatArray, rate: float, rotation: Rotation, quantity: Quantity, teeth: int | None) -> tuple[OffOrders, float]:
    """Return the lines beside the orders of a part whose rotation is known, and the share of it that the orders explain.

    `part`, shape (n, c); `rate` [Hz]
    """
    band = min(BAND, 0.5 * rate)
    lines, rotation, _ = _lines(part, rate, band, rotation, rate < UNFILTERED and quantity is not Quantity.SOUND)
    return _beside(part, rate, lines, rotation, band, quantity, teeth), lines.explained


def heard_in_a_cut(part: FloatArray, rate: float, rotation: Rotation, teeth: int) -> Remark | None:
    """Return what accelerometers hear that speaks against a stable cut, None where nothing does.

    `part` [m/s^2], shape (n, c): the loud part of a record
    `rate` [Hz]
    `rotation`: of the spindle in it
    """
    lines, rotation, _ = _lines(part, rate, min(BAND, 0.5 * rate), rotation, rate < UNFILTERED)
    beside = _beside(part, rate, lines, rotation, min(BAND, 0.5 * rate), Quantity.ACCELERATION, teeth)
    spindle = f"{to_hz(rotation.spindle_speed):.1f} Hz"
    silent = lines.explained < _IDLE_SHARE and _on_multiples(lines.power[1:], teeth) < _TOOTH_SHARE
    # what may be chatter is no stable cut to identify from
    if beside.probability > _DOUBT and (not silent or beside.share > _CHATTER_SHARE):
        words = f"chatter: lines at no multiple of the spindle frequency, {spindle}, hold {min(beside.share, 1.0):.0%} of the record"
        return Remark(RecordCode.CHATTER, f"{words}; the structure's is at {beside.frequency[0]:.0f} Hz")
    if silent:
        words = f"no cutting: multiples of the spindle frequency, {spindle}, explain {max(lines.explained, 0.0):.0%} of the record"
        return Remark(RecordCode.NO_CUTTING, f"{words}, and the teeth do not stand out among them")
    return None


def _typical(part: FloatArray, rate: float) -> float:
    """Mean square about the mean of a second of the part, all channels together, median of its seconds."""
    length = min(round(rate), part.shape[0])
    seconds = part[: part.shape[0] // length * length].reshape(-1, length, part.shape[1])
    return float(np.median(np.sum(seconds.var(axis=1), axis=1)))


def _chattering(
    answer: Listening, beside: OffOrders, rate: float, teeth: int | None, between: tuple[float, float], fold: bool
) -> Listening:
    """The answer for a record with strong lines off the orders: which frequency is the structure's, and what speeds fit it."""
    assert answer.spindle_speed is not None
    strongest, frequency = float(beside.frequency[0]), to_hz(answer.spindle_speed)
    multiples = np.arange(_HIGHEST_ALIAS // rate + 1.0) * rate
    aliases = sorted({round(float(each), 3) for sign in (-1, 1) for each in np.abs(multiples + sign * strongest) if each < _HIGHEST_ALIAS})
    aliases = aliases if fold else [strongest]
    words = [
        f"lines at no multiple of the spindle's frequency, {frequency:.2f} Hz, hold {beside.share:.0%} of the record; the structure's "
        f"is {strongest:.1f} Hz (probability of chatter {beside.probability:.0%})"
    ]
    suggested: list[float] = []
    if len(aliases) > 1:
        shown = ", ".join(f"{each:.0f}" for each in aliases)
        words.append(f"a recorder of {rate:.0f} Hz without a filter cannot tell {shown} Hz apart: no speed is suggested")
    elif teeth is None:
        words.append("how many teeth the cutter has is neither told nor heard: no speed is suggested")
    else:
        speeds = [(waves, 2.0 * np.pi * strongest / (teeth * waves)) for waves in range(1, _MOST_WAVES + 1)]
        inside = [(waves, speed) for waves, speed in speeds if between[0] <= speed <= between[1]]
        suggested = [speed for _, speed in inside]
        if inside:
            shown = ", ".join(f"{to_rpm(speed):.0f} rev/min ({waves})" for waves, speed in inside)
            words.append(f"a whole number of chatter's waves between two teeth: {shown}")
    return replace(
        answer,
        verdict=Heard.CHATTER,
        teeth=teeth,
        reasons=tuple(words),
        chatter=(strongest,),
        aliases=tuple(aliases),
        lines=tuple(beside.frequency[1:]),
        suggested_speeds=tuple(suggested),
    )


def _ramp(speeds: FloatArray, weight: FloatArray) -> tuple[tuple[float, float] | None, float]:
    """First and last speed of a ramp, and the wander about it, or about the mean, as a share."""
    mean = float(np.average(speeds, weights=weight))
    place = np.arange(speeds.size) - np.average(np.arange(speeds.size), weights=weight)
    slope = float(np.sum(weight * place * speeds) / max(np.sum(weight * place**2), 1e-300))

    def wander(about: FloatArray) -> float:
        return float(np.sqrt(np.average((speeds - about) ** 2, weights=weight))) / mean

    change, about = slope * speeds.size, wander(mean + slope * place)
    if speeds.size > 3 and abs(change) > max(_RAMP, _RAMP_OVER_WANDER * about) * mean:
        return (float(mean + slope * (place[0] - 0.5)), float(mean + slope * (place[-1] + 0.5))), about
    return None, wander(np.full(speeds.size, mean))


def _on_multiples(power: FloatArray, teeth: int) -> float:
    """Share of the power of the lines 1, 2, ... that stands on the multiples of a number."""
    return float(power[teeth - 1 :: teeth].sum() / (power.sum() + 1e-300))


def _teeth(power: FloatArray, least: float = _TOOTH_SHARE) -> int | None:
    """Largest number whose multiples hold most of the power of the lines 1, 2, ...; None where none above 1 does.

    A line that a resonance lifts may hold most of it alone: where the other multiples of a part of the number stand out as well, the
    part is the number.
    """
    counts = [teeth for teeth in range(2, min(_MOST_TEETH, power.size) + 1) if _on_multiples(power, teeth) > least]
    teeth, order = max(counts, default=1), np.arange(1, power.size + 1)
    for part in (part for part in range(teeth - 1, 1, -1) if teeth % part == 0):
        shared, others = power[(order % part == 0) & (order % teeth != 0)], power[order % part != 0]
        if shared.size and shared.mean() > _STAND_OUT * others.mean():
            teeth = part
            break
    return teeth if teeth > 1 else None
