"""Hammer hits to a receptance: where the hits are, which of them are good, and their average; estimators are those of [bendat2010]."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from rcsa_ident.base.arrays import ComplexArray, FloatArray
from rcsa_ident.base.errors import InputError, positive
from rcsa_ident.base.remarks import Remark
from rcsa_ident.base.shown import Drawn
from rcsa_ident.base.units import to_hz
from rcsa_ident.signals.frf import coherence, h1, h2, hv

#: Share of the strongest hit's force above which a sample belongs to a hit, and below which its pulse has ended.
_HIT, _PULSE = 0.2, 0.02
#: Time within which a second hit is a bounce of the hammer [s], and the share of the first one's force from which on it counts.
_BOUNCE, _BOUNCE_SHARE = 0.1, 0.05
#: Time before a hit that belongs to it [s], and the shortest record of one.
_BEFORE, _SHORTEST = 1e-3, 0.02
#: Sampling rate below which no hit has a shape [Hz].
_LEAST_RATE = 200.0
#: Equal samples in a row at an extreme that an overloaded input gives.
_FLAT = 4
#: Share of the response's largest value that may be left at its end; what is more is windowed away.
_LEFT = 0.01
#: Power of the force over that of its strongest line below which it excites nothing any more: zeros of its spectrum lie above.
_EXCITED = 1e-5
#: Relative distance of a hit's FRF from the average of the others above which it is left out, where there are three or more.
_APART = 0.5


class HitEstimator(StrEnum):
    """How hits are averaged."""

    H1 = "h1"
    H2 = "h2"
    HV = "hv"


_ESTIMATE: dict[HitEstimator, Callable[[ComplexArray, ComplexArray], ComplexArray]] = {
    HitEstimator.H1: h1,
    HitEstimator.H2: h2,
    HitEstimator.HV: hv,
}


@dataclass(frozen=True, slots=True)
class Hit:
    """A hit of the hammer.

    `record`: which recording it is in, from 0
    `time` [s]: of its largest force
    `force` [N]
    `reason`: why it is left out; empty where it is used
    """

    record: int
    time: float
    force: float
    reason: str = ""


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class TapFrf(Drawn):
    """A receptance from hammer hits.

    Parameters
    ----------
    omega : array, shape (n,) [rad/s]
        As far as the hammer excites.
    receptance : complex array, shape (n,) [m/N]
    variance : array, shape (n,) [m^2/N^2]
        Of its real and of its imaginary part each; from the noise in front of a single hit.
    coherence : array, shape (n,), or None
        None of a single hit, where it says nothing.
    hits : tuple of Hit
    window_decay : float [1/s]
        Of the exponential window of force and responses, 0 without one: the receptance is that at i omega + window_decay, every mode
        decays so much faster.
    axis : str
        Machine axis of hammer and response, X or Y.
    remarks : tuple of Remark
        What was assumed of the recordings: units, channels.

    Examples
    --------
    >>> import rcsa_ident as ri
    >>> found = ri.tap("hits.csv", axis="Y")
    >>> found.used, [hit.reason for hit in found.hits]
    (2, ['', ''])
    >>> print(found.save("TIP.uff"))
    TIP.uff
    """

    omega: FloatArray
    receptance: ComplexArray
    variance: FloatArray
    coherence: FloatArray | None
    hits: tuple[Hit, ...]
    window_decay: float = 0.0
    axis: str = "X"
    remarks: tuple[Remark, ...] = ()

    def __str__(self) -> str:
        band = f"{to_hz(float(self.omega[0])):.0f} to {to_hz(float(self.omega[-1])):.0f} Hz"
        return "; ".join([f"receptance {self.axis} from {self.used} of {len(self.hits)} hits, {band}", *self.remarks])

    @property
    def used(self) -> int:
        """Number of hits that are averaged."""
        return sum(not hit.reason for hit in self.hits)


def tap(
    rate: float,
    records: Sequence[tuple[FloatArray, FloatArray]],
    derivative: int = 2,
    estimator: HitEstimator = HitEstimator.H1,
    sensor_mass: float = 0.0,
) -> TapFrf:
    """Return the receptance of a structure that was hit by a hammer.

    `rate` [Hz]
    `records`: sequence of (force, response), shape (n,) each [N], [m, m/s or m/s^2]; each with one hit or several
    `derivative`: how many times the response is differentiated: 0 displacement, 1 velocity, 2 acceleration
    `sensor_mass` [kg]: mass of the sensor, which the structure does not have without it; 0 where hammer and sensor are at two points, or it
        is light
    Raises `InputError`: there is no hit that can be used; the message says why of each.

    Examples
    --------
    A mass of 2 kg on a spring of 8 MN/m:

    >>> rate, time = 20000.0, np.arange(20000) / 20000.0
    >>> force = np.where(time < 1e-3, 100.0 * np.sin(np.pi * time / 1e-3), 0.0)
    >>> decay, omega = 60.0, 2000.0
    >>> impulse = np.exp(-decay * time) * np.sin(omega * time) / (2.0 * omega)
    >>> found = tap(rate, [(force, np.convolve(force, impulse)[: time.size] / rate)], derivative=0)
    >>> round(float(found.omega[np.argmax(np.abs(found.receptance))]), -1)
    2000.0
    """
    positive("sampling_rate_hz", rate, "Hz")
    if rate < _LEAST_RATE:
        raise InputError("sampling_rate_hz", f"{rate:g} Hz", f"at least {_LEAST_RATE:g} Hz: a hit takes milliseconds")
    if derivative not in (0, 1, 2):
        raise InputError("quantity", derivative, "displacement (0), velocity (1) or acceleration (2)")
    hits: list[Hit] = []
    parts: list[tuple[int, FloatArray, FloatArray]] = []
    for k, (force, response) in enumerate(records):
        for hit, part in _hits(k, np.asarray(force, dtype=float), np.asarray(response, dtype=float), rate):
            if part is not None:
                parts.append((len(hits), *part))
            hits.append(hit)
    if not parts:
        raise InputError("hits", "; ".join(f"{hit.time:.3g} s: {hit.reason}" for hit in hits) or "none", "at least one good hit")
    length = min(force.size for _, force, _ in parts)
    decay = _decay([response[:length] for _, _, response in parts], rate)
    # over the force, too: then every pole is moved by the decay, and nothing else changes
    window = np.exp(-decay * np.arange(length) / rate)
    forces = np.array([_pulse(force[:length], rate) * window for _, force, _ in parts])
    responses = np.array([(response[:length] - _offset(response, rate)) * window for _, _, response in parts])
    spectrum, moved = np.fft.rfft(forces, axis=1), np.fft.rfft(responses, axis=1)
    omega = 2.0 * np.pi * np.fft.rfftfreq(length, 1.0 / rate)
    power = np.mean(np.abs(spectrum) ** 2, axis=0)
    kept = slice(1, int(np.flatnonzero(power >= _EXCITED * power.max())[-1]) + 1)
    spectrum, moved, omega = spectrum[:, kept], moved[:, kept], omega[kept]
    good = _agreeing(spectrum, moved)
    for (place, _, _), agrees in zip(parts, good, strict=True):
        if not agrees:
            hits[place] = Hit(hits[place].record, hits[place].time, hits[place].force, "its FRF differs from that of the other hits")
    spectrum, moved = spectrum[good], moved[good]
    found = _ESTIMATE[estimator](moved, spectrum)
    told = coherence(moved, spectrum) if good.sum() > 1 else None
    noise = np.mean([_noise(response, rate) for (_, _, response), agrees in zip(parts, good, strict=True) if agrees]) * length
    total = np.sum(np.abs(spectrum) ** 2, axis=0)
    if told is None:
        variance = 0.5 * noise / total
    else:
        variance = np.abs(found) ** 2 * np.maximum(1.0 - told, 0.0) / np.maximum(2.0 * told * good.sum(), 1e-12)
    # at s = i omega + decay, where the window has moved everything to
    s = 1j * omega + decay
    scale = s**derivative
    receptance = found / scale
    if sensor_mass:
        receptance = receptance / (1.0 - s**2 * sensor_mass * receptance)
    return TapFrf(omega, receptance, variance / np.abs(scale) ** 2, told, tuple(hits), decay)


def _hits(record: int, force: FloatArray, response: FloatArray, rate: float) -> list[tuple[Hit, tuple[FloatArray, FloatArray] | None]]:
    """The hits of a record, each with its force and response up to the next one where it is good."""
    if force.shape != response.shape or force.ndim != 1:
        raise InputError("records", f"{force.shape} and {response.shape}", "force and response of one length")
    if not (np.all(np.isfinite(force)) and np.all(np.isfinite(response))):
        raise InputError("recording", "lost samples", "a recording without gaps")
    size = np.abs(force - np.median(force))
    if not size.max() > 0.0:
        raise InputError("force", "a constant value", "a channel in which a hammer hits")
    above = np.flatnonzero(size > _HIT * size.max())
    firsts = above[np.concatenate([[True], np.diff(above) > _BOUNCE * rate])]
    ends = np.concatenate([firsts[1:], [force.size]])
    before, found = round(_BEFORE * rate), []
    for first, end in zip(firsts.tolist(), ends.tolist(), strict=True):
        start, stop = max(first - before, 0), int(end) if end == force.size else int(end) - before
        top = first + int(np.argmax(size[first : first + round(_BOUNCE * rate)]))
        reason = _fault(size, response, start, top, stop, rate)
        found.append((Hit(record, top / rate, float(size[top]), reason), None if reason else (force[start:stop], response[start:stop])))
    return found


def _fault(size: FloatArray, response: FloatArray, start: int, top: int, stop: int, rate: float) -> str:
    """Why a hit is left out, empty where it is good."""
    ended = top + int(np.argmax(size[top:stop] < _PULSE * size[top]))
    later = size[ended : min(ended + round(_BOUNCE * rate), stop)]
    if later.size and later.max() > _BOUNCE_SHARE * size[top]:
        after = (ended - top + int(np.argmax(later))) / rate
        return f"a double hit, {later.max():.3g} N after {1e3 * after:.3g} ms"
    for name, signal in (("force", size), ("response", response)):
        part = signal[start:stop]
        flat = (part == part.max()) | (part == part.min())
        if np.any(np.convolve(flat & (np.abs(part) > 0.5 * np.abs(part).max()), np.ones(_FLAT), "valid") >= _FLAT):
            return f"the {name} is overloaded"
    if stop - start < _SHORTEST * rate:
        return f"only {1e3 * (stop - start) / rate:.3g} ms up to the next hit"
    return ""


def _offset(response: FloatArray, rate: float) -> float:
    """Value of a response in front of the hit."""
    return float(np.mean(response[: max(round(0.5 * _BEFORE * rate), 1)]))


def _noise(response: FloatArray, rate: float) -> float:
    """Mean square of a response in front of the hit or at its end, the larger one: what is in front may be a trigger's zeros."""
    return float(max(np.var(response[: max(round(0.5 * _BEFORE * rate), 2)]), np.var(response[-max(response.size // 20, 2) :])))


def _pulse(force: FloatArray, rate: float) -> FloatArray:
    """A force without what the sensor shows when the hammer has left."""
    force = force - _offset(force, rate)
    size, top = np.abs(force), int(np.argmax(np.abs(force)))
    ended = top + int(np.argmax(size[top:] < _PULSE * size[top]))
    length = max(ended - top, 2)
    place = np.arange(force.size)
    fade = np.clip((place - ended - length) / length, 0.0, 1.0)
    faded: FloatArray = force * 0.5 * (1.0 + np.cos(np.pi * fade))
    return faded


def _decay(responses: Sequence[FloatArray], rate: float) -> float:
    """Decay of the window that the responses need to end, 0 where they end by themselves [1/s]."""
    left = max(float(np.std(r[-max(r.size // 20, 2) :]) / (np.abs(r - _offset(r, rate)).max() + 1e-300)) for r in responses)
    if left <= _LEFT:
        return 0.0
    return float(np.log(left / _LEFT) * rate / responses[0].size)


def _agreeing(force: ComplexArray, response: ComplexArray) -> np.ndarray:
    """Which hits have the FRF of the others; all of one or two."""
    count = force.shape[0]
    if count < 3:
        return np.ones(count, dtype=bool)
    single = response / force
    middle = np.median(single.real, axis=0) + 1j * np.median(single.imag, axis=0)
    apart = np.linalg.norm(single - middle, axis=1) / np.linalg.norm(middle)
    good: np.ndarray = apart < max(_APART, 3.0 * float(np.median(apart)))
    return good
