"""What a measured FRF must be, and what explains one that is not.

A structure dissipates power: where response and force share a point and a direction, Im h <= 0 at every frequency (time as e^{+iωt}).
Its FRFs, cross FRFs included, are circles that run clockwise through each resonance in the complex plane [ewins2000]. A reversed sensor or
hammer violates the first, a conjugated FRF both, exchanged columns the second.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from enum import StrEnum
from typing import NamedTuple

import numpy as np

from rcsa_ident.base.arrays import ComplexArray, FloatArray
from rcsa_ident.base.errors import InputError
from rcsa_ident.base.remarks import Remark, RemarkCode

#: Share of the largest accelerance below which the first lines are drift or silence. Chosen on six FRFs of hammer tests, as measured,
#: reversed, conjugated and with exchanged columns: from 0.001 to 0.02 they are judged alike; above, one is no longer turned by itself.
_STANDS_OUT = 0.02
#: Lines over which noise is estimated, by a median that a peak narrower than half of them does not move; fewer lines tell no noise.
_WINDOW = 41
_FEWEST = _WINDOW // 2
#: Standard deviations of the noise that count, and lines beyond them, at least. Of 3000 lines of Gaussian noise 0.2 are so far out, and
#: five of them in one record of half a million.
_BEYOND, _LEAST_LINES = 4.0, 5
#: A phase that sensors and filters may leave, and one halfway to 90 degrees, where an FRF gives back as much power as it takes up.
_SMALL_PHASE, _LARGE_PHASE = np.radians(30.0), np.radians(45.0)
#: Of a lightly damped mode that is turned by a phase p, e^{ip} / (1 + i x) over its detuning x, the share of the power's square that is
#: given back, (p - sin p cos p) / pi: of an FRF that is none of a driving point, and of one that is explained.
_WRONG, _RIGHT = ((p - np.sin(p) * np.cos(p)) / np.pi for p in (_LARGE_PHASE, _SMALL_PHASE))
#: Of the same mode the largest power that is given back over the largest one that is taken up, after a correction that is certain.
_LEFT = np.tan(0.5 * _SMALL_PHASE) ** 2
#: How one-sided an FRF turns, from -1 to 1: three quarters of the area that it sweeps, and nine tenths where it is certain. A sum of
#: lightly damped modes sweeps all of it one way; what is left is noise.
_TURNS, _SURELY = 0.5, 0.8
#: Logarithmic slope below the first resonance, halfway between a spring's, 0, and that of an accelerance that is called a receptance, 2.
_MASS_LINE = 1.0
#: Relative difference of two cross FRFs that reciprocity makes one, as that phase makes it, and half of it, which an explanation may leave.
_DIFFER = 2.0 * np.sin(0.5 * _SMALL_PHASE)
_ALIKE = 0.5 * _DIFFER


class FrfCode(RemarkCode):
    """What may be said of a measured FRF."""

    TURNED = "turned"
    NOT_PASSIVE = "not-passive"
    NOT_RECIPROCAL = "not-reciprocal"


class Correction(StrEnum):
    """What is done to a measured FRF.

    Examples
    --------
    >>> [str(each) for each in Correction]
    ['auto', 'none', 'reverse', 'conjugate', 'conjugate-reverse', 'exchange', 'exchange-reverse']
    """

    AUTO = "auto"
    NONE = "none"
    REVERSE = "reverse"
    CONJUGATE = "conjugate"
    CONJUGATE_REVERSE = "conjugate-reverse"
    EXCHANGE = "exchange"
    EXCHANGE_REVERSE = "exchange-reverse"


_TURN: dict[Correction, Callable[[ComplexArray], ComplexArray]] = {
    Correction.NONE: lambda h: h,
    Correction.REVERSE: lambda h: -h,
    Correction.CONJUGATE: np.conj,
    Correction.CONJUGATE_REVERSE: lambda h: -np.conj(h),
    Correction.EXCHANGE: lambda h: 1j * np.conj(h),
    Correction.EXCHANGE_REVERSE: lambda h: -1j * np.conj(h),
}
_EXPLAINS = {
    Correction.REVERSE: "a reversed sensor or hammer",
    Correction.CONJUGATE: "time as e^(-iωt)",
    Correction.CONJUGATE_REVERSE: "time as e^(-iωt) and a reversed sensor or hammer",
    Correction.EXCHANGE: "exchanged columns of real and imaginary part",
    Correction.EXCHANGE_REVERSE: "exchanged columns and a reversed sensor or hammer",
}


class _Look(NamedTuple):
    """How an FRF looks.

    `wrong`: share of the power's square that a driving point would give back
    `turns`: from -1, clockwise throughout, to 1
    `worst`: frequency of the largest power that is given back, in the unit of the frequencies
    `left`: the largest power that is given back over the largest one that is taken up
    `springs`: off its resonances the real part is the larger one, as of every structure that is not overdamped
    """

    wrong: float
    turns: float
    worst: float
    left: float
    springs: bool


def correction_of(text: str, field: str = "correction") -> Correction:
    """Return the correction of this name."""
    if text not in list(Correction):
        raise InputError(field, text, ", ".join(Correction))
    return Correction(text)


def judged(
    frequency: FloatArray,
    values: ComplexArray,
    correction: Correction = Correction.AUTO,
    driving: bool = True,
    unit_told: bool = True,
    band: tuple[float, float] = (0.0, np.inf),
) -> tuple[ComplexArray, tuple[Remark, ...]]:
    """Return a measured receptance, turned where that was asked for or is certain, and what is to be said of it.

    `frequency` [Hz], shape (n,); `values` [m/N], shape (n,)
    `driving`: response and force are one point and one direction
    `unit_told`: whether the file or the user says that it is a receptance
    `band`: (float, float) [Hz]; lines that are looked at

    Examples
    --------
    >>> frequency = np.arange(100.0, 2000.0)
    >>> h = 1.0 / (900.0**2 - frequency**2 + 36j * frequency)
    >>> turned, (remark,) = judged(frequency, np.conj(h))
    >>> np.array_equal(turned, h), str(remark)
    (True, 'Im > 0 at 900 Hz, which no driving point has: time as e^(-iωt) explains it, and the FRF was turned (correction conjugate)')
    """
    asked = correction not in (Correction.AUTO, Correction.NONE)
    values = _TURN[correction](values) if asked else values
    seen = _seen(frequency, values, band)
    if seen is None:
        return values, ()
    look = _look(*seen)
    if not _is_wrong(look, driving):
        return values, ()
    where = (
        f"Im > 0 at {look.worst:.4g} Hz, which no driving point has" if driving and look.wrong > _WRONG else "the FRF turns anticlockwise"
    )
    if asked:
        return values, (Remark(FrfCode.NOT_PASSIVE, f"{where}, after the correction {correction}"),)
    looks = {each: _look(seen[0], turn(seen[1]), seen[2]) for each, turn in _TURN.items()}
    # the sign of a cross FRF says nothing
    known = _EXPLAINS if driving else (Correction.CONJUGATE, Correction.EXCHANGE)
    fitting = [each for each in known if _explains(looks[each], driving)]
    other = "" if unit_told else _other_quantity(*seen)
    certain = len(fitting) == 1 and not other and abs(look.turns) > _SURELY and not (driving and looks[fitting[0]].left > _LEFT)
    if certain and correction is Correction.AUTO:
        words = f"{where}: {_EXPLAINS[fitting[0]]} explains it, and the FRF was turned (correction {fitting[0]})"
        return _TURN[fitting[0]](values), (Remark(FrfCode.TURNED, words),)
    named = [*([other] if other else []), *(f"{_EXPLAINS[each]} (correction {each})" for each in fitting)]
    words = f"{' or '.join(named)} would explain it" if named else "were response and force one point?"
    return values, (Remark(FrfCode.NOT_PASSIVE, f"{where}: {words}"),)


def reciprocal(frequency: FloatArray, one: ComplexArray, other: ComplexArray, names: Sequence[str]) -> tuple[Remark, ...]:
    """Return what is to be said of two cross FRFs that reciprocity makes one.

    `frequency` [Hz], shape (n,)
    `one`, `other`, shape (n,): response and force exchanged
    `names`: (str, str)
    """
    a, b = frequency**2 * one, frequency**2 * other
    size = 0.5 * (np.linalg.norm(a) + np.linalg.norm(b))
    apart = {each: float(np.linalg.norm(a - turn(b)) / size) if size else 0.0 for each, turn in _TURN.items()}
    if apart[Correction.NONE] <= _DIFFER:
        return ()
    best = min(_EXPLAINS, key=lambda each: apart[each])
    cause = f"{_EXPLAINS[best]} in one of them would explain it" if apart[best] < _ALIKE else "were they measured at the same two points?"
    words = f"{names[0]} and {names[1]} differ by {100.0 * apart[Correction.NONE]:.0f} %, against reciprocity: {cause}"
    return (Remark(FrfCode.NOT_RECIPROCAL, words),)


def _seen(frequency: FloatArray, values: ComplexArray, band: tuple[float, float]) -> tuple[FloatArray, ComplexArray, FloatArray] | None:
    """Frequencies, mobility (but for a factor) and its noise on the lines that are neither drift nor silence; None of too few."""
    inside = (frequency >= band[0]) & (frequency <= band[1])
    frequency, values = frequency[inside], values[inside]
    accelerance = frequency**2 * np.abs(values)
    first = int(np.argmax(accelerance >= _STANDS_OUT * accelerance.max())) if accelerance.size else 0
    frequency, values = frequency[first:], values[first:]
    if frequency.size < _FEWEST or not np.any(values):
        return None
    power = frequency * values
    # third differences leave no smooth curve, and 20 times the variance of white noise; its modulus is Rayleigh's, median sqrt(2 ln 2)
    differences = np.abs(np.diff(power, 3)) / np.sqrt(40.0 * np.log(2.0))
    half = min(_WINDOW, differences.size) // 2
    padded = np.pad(differences, (half, half), mode="reflect") if half else differences
    noise = np.median(np.lib.stride_tricks.sliding_window_view(padded, 2 * half + 1), axis=1)
    return frequency, values, np.pad(noise, (1, frequency.size - noise.size - 1), mode="edge")


def _look(frequency: FloatArray, values: ComplexArray, noise: FloatArray) -> _Look:
    power = frequency * values
    beyond = np.abs(power.imag) > _BEYOND * noise
    sure = np.where(beyond, power.imag, 0.0) if np.count_nonzero(beyond) >= _LEAST_LINES else np.zeros(frequency.size)
    total, back = float(np.sum(sure**2)), np.maximum(sure, 0.0)
    swept = np.imag(np.conj(power[:-1]) * power[1:])
    swept = np.where(np.abs(swept) > _BEYOND * np.abs(power[1:]) * noise[1:], swept, 0.0)
    turns = float(np.sum(swept) / (np.sum(np.abs(swept)) or 1.0)) if np.count_nonzero(swept) >= _LEAST_LINES else 0.0
    worst = float(frequency[np.argmax(back)])
    springs = bool(np.median(np.abs(values.imag)) < np.median(np.abs(values.real)))
    left = float(back.max() / (-sure.min() or 1e-300))
    return _Look(float(np.sum(back**2)) / total if total else 0.0, turns, worst, left, springs)


def _is_wrong(look: _Look, driving: bool) -> bool:
    return look.turns > _TURNS or (driving and look.wrong > _WRONG)


def _explains(look: _Look, driving: bool) -> bool:
    return look.springs and look.turns < -_TURNS and (not driving or look.wrong < _RIGHT)


def _other_quantity(frequency: FloatArray, values: ComplexArray, noise: FloatArray) -> str:
    """Which other quantity explains an FRF whose unit nobody told."""
    for order, name in ((1, "a mobility"), (2, "an accelerance")):
        if _explains(_look(frequency, values / (1j * frequency) ** order, noise / frequency**order), True) and (
            order == 1 or _slope(frequency, values) >= _MASS_LINE
        ):
            return f"{name} whose unit nobody told"
    return ""


def _slope(frequency: FloatArray, values: ComplexArray) -> float:
    """Logarithmic slope of an FRF below half its first resonance; that of a spring where nothing lies there."""
    peak = np.abs(values) >= 0.5 * np.abs(values).max()
    below = frequency < 0.5 * frequency[np.argmax(peak)]
    if np.count_nonzero(below) < 3:
        return _MASS_LINE
    return float(np.polyfit(np.log(frequency[below]), np.log(np.abs(values[below]) + 1e-300), 1)[0])
