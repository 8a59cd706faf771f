"""Made-up records of cuts, stable and chattering, that share nothing with what judges them: sums of waves in the time domain.

`draw` gives the record of a seed; `speeds_to_tell` those of cutters whose run-out is small, whose speed may be taken for a multiple.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from rcsa_ident.base.arrays import FloatArray
from rcsa_ident.signals.recording import Quantity

#: Sampling rates [Hz] and spindle speeds [rev/min] that are drawn.
_RATES, _SPEEDS = (4096.0, 8192.0, 12000.0), (1500.0, 15000.0)
#: Amplitude of the strongest chatter line over that of the strongest tooth-passing line.
_CHATTER = (0.4, 8.0)


class MadeUp(NamedTuple):
    """A record and what it was made of.

    `samples`, shape (n, c); `rate` [Hz]
    `spindle` [Hz]: mean frequency
    `chatter` [Hz]: its mean frequency
    `kind`: what stands out beside the orders
    """

    samples: FloatArray
    rate: float
    quantity: Quantity
    teeth: int
    spindle: float
    chatter: float | None
    kind: str


def _slow(rng: np.random.Generator, n: int, rate: float, seconds: float) -> FloatArray:
    """A standard normal process with a correlation time."""
    knots = rng.standard_normal(int(n / rate / seconds) + 4)
    return np.interp(np.arange(n) / rate / seconds, np.arange(knots.size), knots)


def _log_uniform(rng: np.random.Generator, low: float, high: float) -> float:
    return float(np.exp(rng.uniform(np.log(low), np.log(high))))


def _resonant(rng: np.random.Generator, n: int, rate: float, frequency: float, damping: float) -> FloatArray:
    """Noise through one mode, of unit variance."""
    bins = np.fft.rfftfreq(n, 1.0 / rate) / frequency
    shape = 1.0 / (1.0 - bins**2 + 2j * damping * bins)
    out = np.fft.irfft(np.fft.rfft(rng.standard_normal(n)) * shape, n)
    return out / out.std()


def draw(seed: int, seconds: float = 6.0) -> MadeUp:
    """Return the record of a seed: every second one chatters. `seconds` [s]."""
    rng = np.random.default_rng([39, seed])
    rate, rpm, teeth = float(rng.choice(_RATES)), _log_uniform(rng, *_SPEEDS), int(rng.integers(2, 7))
    quantity = Quantity.SOUND if rng.uniform() < 0.4 else Quantity.ACCELERATION
    channels = 1 if quantity is Quantity.SOUND else int(rng.integers(1, 4))
    n, spindle = int(rate * seconds), rpm / 60.0
    time, top = np.arange(n) / rate, 0.42 * rate
    angle = 2.0 * np.pi * np.cumsum(spindle * (1.0 + _log_uniform(rng, 1e-5, 1.5e-3) * _slow(rng, n, rate, 0.4))) / rate
    # modes shape all that is heard
    modes = [(_log_uniform(rng, 120.0, min(2500.0, 0.7 * top)), _log_uniform(rng, 0.008, 0.05)) for _ in range(3)]

    def gain(frequency: float) -> float:
        return 0.15 + sum(abs(1.0 / (1.0 - (frequency / f) ** 2 + 2j * z * frequency / f)) * (frequency / f) ** 2 for f, z in modes) / 6.0

    orders: dict[int, float] = {}
    steep, runout = rng.uniform(0.6, 1.6), _log_uniform(rng, 0.02, 0.6)
    for m in range(1, max(int(min(top / spindle, 12 * teeth)), teeth) + 1):
        own = (m / teeth) ** -steep if m % teeth == 0 else runout * rng.uniform(0.2, 1.0) * (max(m / teeth, 1.0)) ** -steep
        orders[m] = own * gain(m * spindle)
    largest = max(size for m, size in orders.items() if m % teeth == 0)
    orders = {m: size / largest for m, size in orders.items() if size > 2e-3 * largest}
    # the cut's force is not quite even: its lines swing slowly
    even = 1.0 + rng.uniform(0.0, 0.3) * _slow(rng, n, rate, rng.uniform(0.1, 0.6))
    # a drive or a belt modulates it at a frequency of its own: every order gets sidebands, at the spacing of the spindle and of the teeth
    if rng.uniform() < 0.4:
        even = even + _log_uniform(rng, 0.05, 0.9) * np.cos(rng.uniform(0.06, 0.5) * angle)
    forced = [even * sum(a * np.cos(m * angle + rng.uniform(0.0, 2.0 * np.pi)) for m, a in orders.items()) for _ in range(channels)]
    level = rng.uniform(0.2, 1.0, channels)
    signal = np.stack(forced, axis=1) * level
    # broad noise, white and through the modes
    for c in range(channels):
        white, coloured = _log_uniform(rng, 0.01, 1.5), _log_uniform(rng, 0.01, 1.0)
        noise = sum(_resonant(rng, n, rate, f, z) for f, z in modes) / np.sqrt(len(modes))
        signal[:, c] += level[c] * (white * rng.standard_normal(n) + coloured * noise)
    kind, chatter = "noise alone", None
    if rng.uniform() < 0.35:
        mains = float(rng.choice((50.0, 60.0))) * (1.0 + 1e-3 * rng.standard_normal())
        size, kind = _log_uniform(rng, 0.05, 0.8), "hum"
        falls = rng.uniform(0.3, 1.5)
        for k in range(1, 8):
            signal += size / k**falls * np.outer(np.cos(2.0 * np.pi * k * mains * time + rng.uniform(0.0, 6.0)), level)
    if rng.uniform() < 0.35:
        kind = "bearing" if kind == "noise alone" else f"{kind} and bearing"
        for _ in range(int(rng.integers(1, 5))):
            own = spindle * rng.uniform(2.0, 14.0)
            if own < top:
                size = _log_uniform(rng, 0.01, 0.2)
                signal += size * np.outer(np.cos(own / spindle * angle + rng.uniform(0.0, 6.0)), level * rng.uniform(0.3, 1.0, channels))
    if seed % 2:
        chatter, kind = _add_chatter(rng, signal, angle, rate, spindle, teeth, modes, level), "chatter"
    return MadeUp(_log_uniform(rng, 0.1, 100.0) * signal, rate, quantity, teeth, spindle, chatter, kind)


def _add_chatter(
    rng: np.random.Generator,
    signal: FloatArray,
    angle: FloatArray,
    rate: float,
    spindle: float,
    teeth: int,
    modes: list[tuple[float, float]],
    level: FloatArray,
) -> float:
    """Add a limit cycle near a mode with its sidebands at the tooth-passing frequency; its mean frequency [Hz]."""
    n, channels = signal.shape
    mode = min(modes, key=lambda each: abs(np.log(each[0] / 700.0)))[0]
    frequency = mode * rng.uniform(1.0, 1.12)
    # as far from the orders as what wanders can be told from them
    off = rng.uniform(0.12, 0.88)
    frequency = (np.floor(frequency / spindle) + off) * spindle
    wander = _log_uniform(rng, 1e-5, 4e-3)
    phase = 2.0 * np.pi * np.cumsum(frequency * (1.0 + wander * _slow(rng, n, rate, rng.uniform(0.15, 1.0)))) / rate
    swell = np.exp(rng.uniform(0.0, 0.35) * _slow(rng, n, rate, rng.uniform(0.15, 1.0)))
    size, width = _log_uniform(rng, *_CHATTER), rng.uniform(0.5, 1.6)
    heard: FloatArray = rng.uniform(0.3, 1.0, channels)
    heard[int(rng.integers(channels))] = 1.0
    for k in range(-4, 5):
        own = frequency + k * teeth * spindle
        if abs(own) < 0.45 * rate and abs(own) > 10.0:
            part = size * (1.0 if k == 0 else rng.uniform(0.1, 0.6) * np.exp(-width * (abs(k) - 1)))
            wave = swell * np.cos(phase + k * teeth * angle + rng.uniform(0.0, 6.0))
            signal += part * np.outer(wave, level * heard)
    return float(frequency)


def speeds_to_tell(count: int = 24) -> list[MadeUp]:
    """Return sounds of stable cuts with little run-out: 2 to 6 teeth, 3000 to 12 000 rev/min, a run-out of 1 to 10 % of the tooth lines."""
    made = []
    for seed in range(count):
        rng = np.random.default_rng([40, seed])
        teeth, rpm = 2 + seed % 5, float(rng.uniform(3000.0, 12000.0))
        rate, spindle, runout = 25600.0, rpm / 60.0, (0.01, 0.02, 0.05, 0.1)[seed % 4]
        n = int(5.0 * rate)
        angle = 2.0 * np.pi * np.cumsum(spindle * (1.0 + 2e-4 * _slow(rng, n, rate, 0.4))) / rate
        signal = sum(k ** -rng.uniform(0.7, 1.3) * np.cos(k * teeth * angle + rng.uniform(0.0, 6.0)) for k in range(1, 7))
        few = [m for m in range(1, 3 * teeth) if m % teeth]
        signal = signal + sum(runout * rng.uniform(0.5, 1.0) * np.cos(m * angle + rng.uniform(0.0, 6.0)) for m in few)
        signal = signal + rng.choice((0.02, 0.05, 0.1)) * rng.standard_normal(n)
        made.append(MadeUp(signal[:, None], rate, Quantity.SOUND, teeth, spindle, None, f"run-out {runout:.0%}"))
    return made
