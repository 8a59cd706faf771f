"""Frequencies and damping of what rings after a hit, from a microphone: ESPRIT, and what comes again in many windows, orders and hits.

Exponentials are taken from windows of many lengths behind each hit, where the hit itself is over, at several orders [roy1989]. Poles of
noise are elsewhere each time; those of modes gather, as in a stabilisation diagram. The scatter over windows, which see other reflections,
and over hits is the standard deviation.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
import scipy.signal

from rcsa_ident.base.arrays import FloatArray
from rcsa_ident.base.errors import InputError, positive
from rcsa_ident.base.units import to_hz
from rcsa_ident.signals.sound.exponentials import Subspace, peaks, zoomed

#: Lowest frequency that is listened to [Hz]: below it are mains, steps and doors.
LOWEST = 250.0
#: Share of the rate up to which a recorder hears.
_HEARD = 0.45
#: Time over which loudness is taken [s], and by how much it rises within it in a hit.
_STEP, _RISE = 1e-3, 4.0
#: Loudness of a hit over the quiet before it, and over the loudest one of the recordings.
_OVER_QUIET, _OVER_LOUDEST = 8.0, 0.02
#: Quiet before a hit in which the noise is heard [s], and time in which a further onset is a second hit [s].
_QUIET, _APART = 0.05, 0.04
#: More onsets than this within twice that quiet are speech or clatter: nobody taps so fast.
_CLATTER = 3
#: Longest ring [s], shortest one [s], and loudness over the noise at which it ends.
_LONGEST, _SHORTEST, _END = 0.6, 3.5e-3, 1.5
#: Starts that are tried, after the loudest moment [s]: the hit itself lasts some tenths of a millisecond, with a soft hammer more.
_STARTS = (0.3e-3, 0.6e-3, 1.0e-3, 1.6e-3)
#: Lengths of windows [s]; up to the one whole, beyond it in bands [Hz] around so many peaks.
_WINDOWS, _WHOLE = (2e-3, 2.5e-3, 3.2e-3, 5e-3, 8e-3, 12e-3, 20e-3, 40e-3, 80e-3, 160e-3, 320e-3), 20e-3
_BAND, _PEAKS = 600.0, 6
#: Orders of the subspace: of the whole signal, and of a band.
_ORDERS, _ZOOMED = (8, 12, 16, 20, 24), (2, 3, 4, 6)
#: Hits that are listened to, of more the loudest: what a further one adds is less than a second of computing is worth.
_MOST_HITS = 12
#: Decays over a window's length between which a pole is told by it: where a ring has died, reflections are what is left.
_SHORT, _LONG = 0.7, 3.0
#: Share of a ring's energy that has to be over after half of it: what rings dies away, what speaks or hums goes on.
_DIES = 0.8
#: Largest damping ratio.
_MOST_DAMPED = 0.2
#: Poles are one within this share of the frequency, or this share of its damping ratio, and this difference of the damping's logarithm.
_SAME, _SAME_DAMPED, _SAME_DAMPING = 0.002, 0.4, 0.5
#: In how many windows, starts and orders a mode comes again, on the average of its hits, and at how many starts.
_AGAIN, _OFTEN = 5, 3
#: Standard deviation over the median of absolute differences; factor of a hit that stands alone; variance of windows that remains.
_MAD, _ONCE, _REFLECTED = 1.48, 1.5, 0.3
#: What is kept: standard deviations of the frequency, and of the damping ratio, as shares.
_SURE, _SURE_DAMPING = 0.02, 0.5
#: Least standard deviations, as shares: of frequency (recorders' clocks) and of damping.
_LEAST, _LEAST_DAMPING = 2e-5, 0.01
#: Modes fainter than this share of the loudest one, and more than so many, are not told.
_FAINT, _MOST_MODES = 3e-3, 12
#: A mode so many times louder, within this difference of the frequency's logarithm, makes ghosts of those beside it.
_GHOSTS = ((4.0, 0.03), (10.0, 0.15), (40.0, 0.5))
#: Damping ratios of a mode within which no fainter one can be told apart from it.
_WIDTH = 1.5
#: Power over the noise of a tone in front of a hit, and the damping below which a mode at it is that tone.
_TONE, _STEADY = 100.0, 5e-4
#: Change of the noise's loudness after a ring that shows a gain control, as a share.
_GAIN = 0.25


@dataclass(frozen=True, slots=True)
class RingingMode:
    """Something that rings down after a hit.

    `omega`, `omega_std` [rad/s]: modulus of the pole: the undamped natural frequency
    `damping`, `damping_std` [-]: damping ratio
    `level` [-]: amplitude where the hit has ended, over that of the loudest mode; the median of the hits
    `hits`: in how many hits it was heard
    """

    omega: float
    omega_std: float
    damping: float
    damping_std: float
    level: float
    hits: int

    def __str__(self) -> str:
        frequency = f"{to_hz(self.omega):.1f} ± {to_hz(self.omega_std):.1g} Hz"
        return f"{frequency}, damping {100.0 * self.damping:.3g} ± {100.0 * self.damping_std:.1g} %"


@dataclass(frozen=True, slots=True)
class RingDown:
    """What recordings of hits tell together.

    `modes`: in ascending order of frequency
    `hits`: that were used, at most 12
    `steady`: tuple of float [rad/s], tones that do not decay: hum, fans, whistles
    `damping_doubt`: why the damping is not to be trusted; empty where it is
    `highest` [rad/s]: up to which the recordings hear
    """

    modes: tuple[RingingMode, ...]
    hits: int
    steady: tuple[float, ...] = ()
    damping_doubt: str = ""
    highest: float = np.inf


@dataclass(frozen=True, slots=True, eq=False)
class _Ring:
    """A hit: what rings after it, and the noise before it."""

    samples: FloatArray
    rate: float
    noise: float
    after: float
    """Loudness of the noise before and of what is left behind the ring."""
    before: FloatArray
    """Quiet in front of the hit."""


def ring_down(recordings: Sequence[tuple[float, FloatArray]], lossy: bool = False) -> RingDown:
    """Return what rings after the hits in some recordings of one thing.

    `recordings`: sequence of (rate [Hz], samples); sound, or any motion; each with one hit or several
    `lossy`: they were compressed with loss: frequencies stay, decays do not
    Raises `InputError`: there is no hit, nothing rings after it, or the recordings are silent.

    Examples
    --------
    A ring of 2000 Hz and 1 % in noise, hit twice:

    >>> rng, time = np.random.default_rng(1), np.arange(24000) / 48000.0
    >>> ring = np.exp(-0.01 * 4e3 * np.pi * time) * np.sin(4e3 * np.pi * time)
    >>> sound = 1e-4 * rng.standard_normal(72000)
    >>> sound[12000:36000] += ring
    >>> sound[42000:66000] += ring
    >>> mode, = ring_down([(48000.0, sound)]).modes
    >>> round(to_hz(mode.omega), 1), round(100 * mode.damping, 2), mode.hits
    (2000.1, 1.0, 2)
    """
    rings: list[_Ring] = []
    loudest = 0.0
    heard = []
    for rate, samples in recordings:
        positive("sampling_rate_hz", rate, "Hz")
        sound = _audible(np.asarray(samples, dtype=float), rate)
        heard.append((rate, sound, _loudness(sound, rate)))
        loudest = max(loudest, float(heard[-1][2].max(initial=0.0)))
    if loudest <= 0.0:
        raise InputError("recording", "silence", "the sound of a hit and what rings after it")
    for rate, sound, loudness in heard:
        rings += _rings(sound, rate, loudness, loudest)
    if not rings:
        raise InputError("recording", "no hit", "a quiet moment, a hit, and what rings after it")
    rings = sorted(rings, key=lambda ring: -float(np.max(np.abs(ring.samples))))[:_MOST_HITS]
    highest = _HEARD * min(rate for rate, _ in recordings)
    steady = _steady_tones(rings, highest)
    modes = tuple(mode for mode in _combined(rings, highest) if not _is_steady(mode, steady))
    if not modes:
        raise InputError("recording", f"{_count(len(rings))} after which nothing rings down", "the ring of a thing that hangs free")
    doubt = "lossy compression does not keep decays" if lossy else _gain_control(rings)
    return RingDown(modes, len(rings), steady, doubt, 2.0 * np.pi * highest)


def _is_steady(mode: RingingMode, tones: Sequence[float]) -> bool:
    """Whether a mode is a tone that was there before: such a one hardly decays."""
    return mode.damping < _STEADY and any(abs(mode.omega - tone) < _SAME * tone for tone in tones)


def _count(hits: int) -> str:
    return "one hit" if hits == 1 else f"{hits} hits"


def _audible(samples: FloatArray, rate: float) -> FloatArray:
    """Samples without what is below the lowest frequency; lost ones are silent."""
    if rate < 8.0 * LOWEST:
        raise InputError("sampling_rate_hz", f"{rate:g}", f"at least {8.0 * LOWEST:g} [Hz]: rings of tools are above {LOWEST:g} Hz")
    samples = np.nan_to_num(samples)
    if samples.size < 0.05 * rate:
        raise InputError("recording", f"{samples.size / rate:.3g} s", "at least 0.05 s, a quiet moment, a hit and its ring")
    sections = scipy.signal.butter(2, LOWEST, "highpass", fs=rate, output="sos")
    # forwards only: what comes before a hit stays quiet
    return np.asarray(scipy.signal.sosfilt(sections, samples - np.median(samples)))


def _loudness(sound: FloatArray, rate: float) -> FloatArray:
    """Root mean square over each step."""
    width = max(int(_STEP * rate), 8)
    count = sound.size // width
    return np.asarray(np.sqrt(np.mean(sound[: count * width].reshape(count, width) ** 2, axis=1)))


def _rings(sound: FloatArray, rate: float, loudness: FloatArray, loudest: float) -> list[_Ring]:
    width = max(int(_STEP * rate), 8)
    before, apart = int(_QUIET / _STEP), int(_APART / _STEP)
    onsets: list[int] = []
    for i in range(3, loudness.size):
        quiet = np.median(loudness[max(0, i - before) : i - 1])
        rises = loudness[i] > _RISE * loudness[i - 2] and loudness[i] > _OVER_QUIET * quiet and loudness[i] > _OVER_LOUDEST * loudest
        if rises and (not onsets or i - onsets[-1] > 2):
            onsets.append(i)
        elif rises:
            # the same hit still rises
            onsets[-1] = onsets[-1] if loudness[i] <= loudness[onsets[-1]] else i
    rings = []
    for k, onset in enumerate(onsets):
        following = onsets[k + 1] if k + 1 < len(onsets) else loudness.size
        if sum(abs(other - onset) < 2 * before for other in onsets) > _CLATTER:
            continue
        if following - onset <= 2 or (k and onset - onsets[k - 1] < apart and loudness[onset] < loudness[onsets[k - 1]]):
            continue
        ring = _ring(sound, rate, loudness, onset, following, width)
        if ring is not None:
            rings.append(ring)
    return rings


def _ring(sound: FloatArray, rate: float, loudness: FloatArray, onset: int, following: int, width: int) -> _Ring | None:
    """The ring of a hit, None where it does not die away."""
    quiet = loudness[max(0, onset - int(_QUIET / _STEP)) : onset - 1]
    noise = float(np.median(quiet))
    first = onset * width - width // 2
    peak = first + int(np.argmax(np.abs(sound[first : (onset + 2) * width])))
    limit = min(following - 1, onset + int(_LONGEST / _STEP), loudness.size)
    tail = loudness[onset:limit]
    over = np.flatnonzero(tail <= max(_END * noise, 1e-5 * tail.max()))
    end = onset + (int(over[0]) if over.size else tail.size)
    samples = sound[peak : end * width]
    if samples.size < max(_SHORTEST * rate, 40):
        return None
    energy = samples**2
    if np.sum(energy[: samples.size // 2]) < _DIES * np.sum(energy):
        return None
    behind = loudness[end + 3 : min(end + int(_QUIET / _STEP), following - 2)]
    after = float(np.median(behind)) if behind.size >= 10 and over.size else noise
    quiet_from = max(0, onset - int(_QUIET / _STEP))
    return _Ring(samples, rate, noise, after, sound[quiet_from * width : (onset - 1) * width])


class _Pole(NamedTuple):
    """A pole of one hit in one window, and where that starts [s]."""

    omega: float
    damping: float
    amplitude: float
    hit: int
    start: float


def _poles(ring: _Ring, hit: int, highest: float) -> list[_Pole]:
    """Poles of a ring in windows of many lengths, at several starts and orders: what is real comes again."""
    found: list[_Pole] = []
    for start in _STARTS:
        samples = ring.samples[int(start * ring.rate) :]
        for length in _WINDOWS:
            count = int(length * ring.rate)
            if samples.size < 0.8 * count:
                break
            part = samples[:count]
            if length <= _WHOLE:
                bands = [(part, ring.rate, 0.0)]
            elif start != _STARTS[0]:
                tops = peaks(part, ring.rate, LOWEST, highest, _BAND, _PEAKS)
                bands = [(*zoomed(part, ring.rate, centre, _BAND), centre) for centre in tops]
            else:
                continue
            for signal, rate, centre in bands:
                if signal.size < 16 or not np.any(signal):
                    continue
                orders = _ORDERS if centre == 0.0 else _ZOOMED
                space = Subspace(signal, orders[-1])
                for order in orders:
                    poles, amplitudes = space.exponentials(order, rate)
                    poles = poles + 2j * np.pi * centre
                    for pole, amplitude in zip(poles, amplitudes, strict=True):
                        inside = 2.0 * np.pi * LOWEST < pole.imag < 2.0 * np.pi * highest
                        if centre and abs(pole.imag - 2.0 * np.pi * centre) > 0.8 * np.pi * _BAND:
                            continue
                        decays = _SHORT < -pole.real * length < _LONG
                        if inside and decays and -pole.real < _MOST_DAMPED * abs(pole):
                            found.append(_Pole(float(abs(pole)), float(-pole.real / abs(pole)), float(amplitude), hit, start))
    return found


def _combined(rings: Sequence[_Ring], highest: float) -> tuple[RingingMode, ...]:
    """The modes that most of the hits have in common, each where poles of many windows gather."""
    poles = [pole for hit, ring in enumerate(rings) for pole in _poles(ring, hit, highest)]
    modes: list[RingingMode] = []
    left = sorted(poles, key=lambda pole: pole.omega)
    while left:
        omega = np.log([pole.omega for pole in left])
        damping = np.log([pole.damping for pole in left])
        size = np.array([pole.amplitude for pole in left])
        # the densest place, loud poles counting more
        reach = np.maximum(_SAME, _SAME_DAMPED * np.exp(damping))
        near = np.array(
            [
                np.sum(size[(np.abs(omega - w) < r) & (np.abs(damping - d) < _SAME_DAMPING)])
                for w, d, r in zip(omega, damping, reach, strict=True)
            ]
        )
        centre = int(np.argmax(near))
        inside = (np.abs(omega - omega[centre]) < reach[centre]) & (np.abs(damping - damping[centre]) < _SAME_DAMPING)
        mode = _mode([pole for pole, chosen in zip(left, inside, strict=True) if chosen], len(rings))
        if mode is not None:
            modes.append(mode)
        # what lies about a mode is that mode seen badly
        gone = np.abs(omega - omega[centre]) < (reach[centre] if mode is not None else 0.0)
        left = [pole for pole, away in zip(left, gone | inside, strict=True) if not away]
        if len(modes) == _MOST_MODES:
            break
    loudest = max((mode.level for mode in modes), default=1.0)
    kept = [replace(mode, level=mode.level / loudest) for mode in modes if mode.level > _FAINT * loudest and not _is_ghost(mode, modes)]
    return tuple(sorted(kept, key=lambda mode: mode.omega))


def _is_ghost(mode: RingingMode, modes: Sequence[RingingMode]) -> bool:
    """Whether a mode is what reflections make of a much louder one beside it, or lies within the width of a louder one."""
    return any(
        other.level > over * mode.level and abs(np.log(other.omega / mode.omega)) < apart
        for other in modes
        for over, apart in (*_GHOSTS, (1.0, _WIDTH * other.damping))
    )


def _mode(poles: Sequence[_Pole], hits: int) -> RingingMode | None:
    """A mode of poles that gather; None where they are few."""
    heard = sorted({pole.hit for pole in poles})
    if 2 * len(heard) < hits or len(poles) < _AGAIN * len(heard) or len({pole.start for pole in poles}) < _OFTEN:
        return None
    middles, inner = [], []
    for hit in heard:
        own = np.array([(np.log(pole.omega), np.log(pole.damping)) for pole in poles if pole.hit == hit])
        middles.append(np.median(own, axis=0))
        inner.append(_MAD * np.median(np.abs(own - middles[-1]), axis=0) if len(own) > 2 else np.full(2, np.nan))
    middle = np.median(middles, axis=0)
    within = np.nan_to_num(np.nanmedian(inner, axis=0)) if np.isfinite(inner).any() else np.zeros(2)
    between = np.std(middles, axis=0, ddof=1) if len(heard) > 1 else _ONCE * within
    # windows and starts see other reflections: that does not average out over hits
    std = np.sqrt(_REFLECTED * within**2 + between**2 / len(heard))
    omega, damping = (float(value) for value in np.exp(middle))
    w_std, z_std = float(np.hypot(std[0], _LEAST)), float(np.hypot(std[1], _LEAST_DAMPING))
    if w_std > _SURE or z_std > _SURE_DAMPING:
        return None
    level = float(np.median([pole.amplitude for pole in poles]))
    return RingingMode(omega, omega * w_std, damping, damping * z_std, level, len(heard))


def _steady_tones(rings: Sequence[_Ring], highest: float) -> tuple[float, ...]:
    """Frequencies of tones that were there before most of the hits [rad/s]."""
    tones = np.sort([f for ring in rings if ring.before.size > 256 for f in _tones(ring.before, ring.rate, highest)])
    if not tones.size:
        return ()
    groups = np.split(tones, np.flatnonzero(np.diff(tones) > _SAME * tones[1:]) + 1)
    return tuple(float(2.0 * np.pi * np.median(group)) for group in groups if 2 * group.size >= max(len(rings), 2))


def _tones(before: FloatArray, rate: float, highest: float) -> list[float]:
    """Lines that stand out of the noise in front of a hit [Hz]."""
    power = np.abs(np.fft.rfft(before * np.hanning(before.size))) ** 2
    frequency = np.fft.rfftfreq(before.size, 1.0 / rate)
    inside = (frequency > LOWEST) & (frequency < highest)
    floor = np.median(power[inside])
    return [float(f) for f, p, left, right in zip(frequency[1:-1], power[1:-1], power[:-2], power[2:], strict=True)
            if p > _TONE * floor and p >= left and p >= right and LOWEST < f < highest]  # fmt: skip


def _gain_control(rings: Sequence[_Ring]) -> str:
    """Say what shows that the recorder turned its gain while the thing rang."""
    change = float(np.median([ring.after / ring.noise for ring in rings if ring.noise > 0.0] or [1.0]))
    if change < 1.0 - _GAIN:
        return f"the noise behind the rings is {100.0 * (1.0 - change):.0f} % fainter than before the hits: the recorder controls its gain"
    return ""
