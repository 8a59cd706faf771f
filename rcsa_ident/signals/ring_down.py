"""Frequencies and damping of what rings after a hit, from a microphone: ESPRIT finds the exponentials, least squares refine them.

Each hit is fitted by itself, all its modes at once, from where the hit itself has ended until the ring is lost in the noise [roy1989];
the hits are then combined with the scatter between them, so that what a model of exponentials leaves out (reflections, a gain that
moves) widens the standard deviations instead of hiding in them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy.linalg
import scipy.signal

from rcsa_ident.arrays import FloatArray
from rcsa_ident.errors import InputError, positive
from rcsa_ident.signals._exponentials import Fit, esprit, refined
from rcsa_ident.units import to_hz

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
#: Longest ring [s], shortest one [s], and loudness over the noise at which it ends.
_LONGEST, _SHORTEST, _END = 0.6, 2.5e-3, 1.5
#: Starts that are tried, after the loudest moment [s]: the hit itself lasts some tenths of a millisecond, with a soft hammer more.
_STARTS = (0.3e-3, 0.6e-3, 1.0e-3, 1.6e-3, 2.5e-3)
#: Share of a ring's energy that has to be over after half of it: what rings dies away, what speaks or hums goes on.
_DIES = 0.8
#: Largest damping ratio, and smallest decay in a ring's length: what hardly decays is a steady tone.
_MOST_DAMPED, _STEADY = 0.2, 0.25
#: What is kept: standard deviations of the frequency, and of the damping ratio, as shares.
_SURE, _SURE_DAMPING = 0.02, 0.5
#: Lines of two hits are one within this share, or so many standard deviations.
_SAME, _SAME_STD = 0.008, 3.0
#: Factor on the standard deviation of what was heard once: nothing shows how it scatters.
_ONCE = 2.0
#: Least standard deviations, as shares: of frequency (recorders' clocks) and of damping.
_LEAST, _LEAST_DAMPING = 2e-5, 0.01
#: Lines below the loudest one that are still heard.
_FAINT = 3e-3
#: Change of the noise's loudness after a ring that shows a gain control, as a share.
_GAIN = 0.25


@dataclass(frozen=True, slots=True)
class RingingMode:
    """Something that rings down after a hit.

    Parameters
    ----------
    omega, omega_std : float [rad/s]
        Modulus of the pole: the undamped natural frequency.
    damping, damping_std : float [-]
        Damping ratio.
    level : float [-]
        Amplitude where the hit has ended, over that of the loudest mode; the median of the hits.
    hits : int
        In how many hits it was heard.
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

    Parameters
    ----------
    modes : tuple of RingingMode
        In ascending order of frequency.
    hits : int
        That were used.
    steady : tuple of float [rad/s]
        Tones that do not decay: hum, fans, whistles.
    damping_doubt : str
        Why the damping is not to be trusted; empty where it is.
    highest : float [rad/s]
        Up to which the recordings hear.
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
    peak: int
    """Sample of the loudest moment."""
    noise: float
    after: float
    """Loudness of the noise before and of what is left behind the ring."""


def ring_down(recordings: Sequence[tuple[float, FloatArray]], lossy: bool = False) -> RingDown:
    """Return what rings after the hits in some recordings of one thing.

    Parameters
    ----------
    recordings : sequence of (rate [Hz], samples)
        Sound, or any motion; each with one hit or several.
    lossy : bool
        They were compressed with loss: frequencies stay, decays do not.

    Raises
    ------
    InputError
        There is no hit, nothing rings after it, or the recordings are silent.

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
    both = [fits for fits in (_fitted(ring) for ring in rings) if fits is not None]
    fits = [fit for fit, _ in both]
    modes = _combined(fits)
    if not modes:
        raise InputError("recording", f"{_count(len(rings))} after which nothing rings down", "the ring of a thing that hangs free")
    doubt = "lossy compression does not keep decays" if lossy else _gain_control(rings)
    return RingDown(modes, len(fits), _steady_tones([tones for _, tones in both]), doubt, 2.0 * np.pi * _HEARD * min(rate for rate, _ in recordings))


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
    return _Ring(samples, rate, 0, noise, after)


def _fitted(ring: _Ring) -> tuple[Fit, Fit] | None:
    """What rings down and what goes on, of several starts behind the hit after that which tells the loudest mode best."""
    starts = [start for start in (int(t * ring.rate) for t in _STARTS) if ring.samples.size - start >= 0.8 * _SHORTEST * ring.rate]
    if not starts:
        return None
    # poles are the same wherever one starts
    poles = esprit(ring.samples[starts[min(1, len(starts) - 1)] :], ring.rate, LOWEST, _HEARD * ring.rate)
    if not poles.size:
        return None
    fits = [refined(ring.samples[start:], ring.rate, poles, ring.noise) for start in starts]
    # the loudest mode says how good a start is
    scores = []
    for fit, start in zip(fits, starts, strict=True):
        ringing = _decaying(fit, (ring.samples.size - start) / ring.rate)
        loud = np.argmax(np.where(ringing, fit.amplitude, -1.0))
        scores.append(fit.std[loud] / np.abs(fit.pole[loud]) if ringing.any() else np.inf)
    best = int(np.argmin(scores))
    if not np.isfinite(scores[best]):
        return None
    fit, duration = fits[best], (ring.samples.size - starts[best]) / ring.rate
    return fit.chosen(_decaying(fit, duration)), fit.chosen(_going_on(fit, duration, ring.noise))


def _decaying(fit: Fit, duration: float) -> np.ndarray:
    """Which exponentials ring down: known well enough, neither steady nor dead."""
    omega, decay = np.abs(fit.pole), -fit.pole.real
    damping = decay / omega
    sure = (fit.std < _SURE * omega) & (fit.std < _SURE_DAMPING * decay)
    return np.asarray(sure & (damping < _MOST_DAMPED) & (decay * duration > _STEADY) & (fit.amplitude > _FAINT * fit.amplitude.max()))


def _going_on(fit: Fit, duration: float, noise: float) -> np.ndarray:
    """Which exponentials are steady tones above the noise."""
    return np.asarray((-fit.pole.real * duration < _STEADY) & (fit.amplitude > noise) & (fit.std < _SURE * np.abs(fit.pole)))


def _steady_tones(fits: Sequence[Fit]) -> tuple[float, ...]:
    """Frequencies of tones that most of the hits have in common [rad/s]."""
    tones = np.sort(np.concatenate([fit.pole.imag for fit in fits]))
    groups = np.split(tones, np.flatnonzero(np.diff(tones) > _SAME * tones[1:]) + 1)
    return tuple(float(np.median(group)) for group in groups if 2 * group.size >= max(len(fits), 2))


def _combined(fits: Sequence[Fit]) -> tuple[RingingMode, ...]:
    """The modes that most of the hits have in common."""
    lines = [(float(np.abs(s)), float(-s.real / np.abs(s)), float(d / np.abs(s)), float(a), k)
             for k, fit in enumerate(fits) for s, d, a in zip(fit.pole, fit.std, fit.amplitude / fit.amplitude.max(), strict=True)]  # fmt: skip
    lines.sort()
    groups: list[list[tuple[float, float, float, float, int]]] = []
    for line in lines:
        near = None
        if groups:
            middle = float(np.median([each[0] for each in groups[-1]]))
            reach = max(_SAME, _SAME_STD * min(line[2], 0.01))
            # two lines of one hit are two modes
            near = line[0] <= (1.0 + reach) * middle and all(each[4] != line[4] for each in groups[-1])
        (groups[-1].append(line) if near else groups.append([line]))
    needed = max(1, -(-len(fits) // 2))
    modes = []
    for group in groups:
        if len(group) < needed:
            continue
        omega, damping, std, level, _ = (np.array(column) for column in zip(*group, strict=True))
        w, w_std = _mean(omega, std * omega, _LEAST * omega.mean())
        z, z_std = _mean(damping, std, _LEAST_DAMPING * float(np.median(damping)))
        if z_std < _SURE_DAMPING * z:
            modes.append(RingingMode(w, w_std, z, z_std, float(np.median(level)), len(group)))
    return tuple(modes)


def _mean(values: FloatArray, std: FloatArray, least: float) -> tuple[float, float]:
    """Mean of values that scatter beyond their standard deviations [dersimonian1986], and its standard deviation."""
    if values.size == 1:
        return float(values[0]), float(np.hypot(_ONCE * std[0], least))
    weight = 1.0 / std**2
    middle = np.sum(weight * values) / np.sum(weight)
    excess = np.sum(weight * (values - middle) ** 2) - (values.size - 1)
    between = max(0.0, excess / (np.sum(weight) - np.sum(weight**2) / np.sum(weight)))
    weight = 1.0 / (std**2 + between)
    return float(np.sum(weight * values) / np.sum(weight)), float(np.hypot(1.0 / np.sqrt(np.sum(weight)), least))


def _gain_control(rings: Sequence[_Ring]) -> str:
    """Say what shows that the recorder turned its gain while the thing rang."""
    change = float(np.median([ring.after / ring.noise for ring in rings if ring.noise > 0.0] or [1.0]))
    if change < 1.0 - _GAIN:
        return f"the noise behind the rings is {100.0 * (1.0 - change):.0f} % fainter than before the hits: the recorder controls its gain"
    return ""
