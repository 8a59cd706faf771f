"""What recordings of a workshop hold beside the cut: a spindle that does not turn evenly, a clock that is off, hum, knocks and noise."""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np

from rcsa_ident.base.arrays import FloatArray
from rcsa_ident.base.errors import InputError, non_negative, positive

#: Frequencies of the hum over the mains', and their amplitudes over the first one's.
_HUM = ((1.0, 1.0), (2.0, 0.4), (3.0, 0.5))
#: Frequencies [Hz] and damping ratios of what a knock lets ring.
_KNOCK_FREQUENCY, _KNOCK_DAMPING = (250.0, 1500.0), (0.02, 0.06)
#: Resonance of the machine's noise [Hz] and its damping ratio: most of it is heard there.
_NOISE_FREQUENCY, _NOISE_DAMPING = 900.0, 0.3
#: A spindle's speed follows what disturbs it with this share of the correlation time.
_SMOOTH = 0.1


@dataclass(frozen=True, slots=True)
class Disturbances:
    """What a workshop adds to the records of a virtual machine; nothing by default.

    `speed_wander` [-]: standard deviation of the spindle speed within a record, as a share
    `wander_time` [s]: correlation time of the speed
    `clock_error` [-]: by what share the recorder's clock runs fast: it takes that many more samples in a second than it says
    `hum` [m]: amplitude of the mains' frequency in the gap sensors; its multiples come with it
    `mains` [Hz]
    `machine_noise` [m/s^2]: standard deviation of what the accelerometers feel of pumps, fans and bearings, most of it around 900 Hz
    `knocks` [1/s]: how often something knocks against the machine
    `knock` [m]: what the gap sensors see of a knock
    """

    speed_wander: float = 0.0
    wander_time: float = 0.3
    clock_error: float = 0.0
    hum: float = 0.0
    mains: float = 50.0
    machine_noise: float = 0.0
    knocks: float = 0.0
    knock: float = 1e-6

    def __post_init__(self) -> None:
        for each in fields(self):
            if each.name not in ("clock_error", "wander_time", "mains"):
                non_negative(f"disturbances.{each.name}", getattr(self, each.name))
        positive("disturbances.wander_time", self.wander_time, "s")
        positive("disturbances.mains", self.mains, "Hz")
        if not self.speed_wander <= 0.02:
            raise InputError("disturbances.speed_wander", self.speed_wander, "a share from 0 to 0.02")
        if not -0.02 <= self.clock_error <= 0.02:
            raise InputError("disturbances.clock_error", self.clock_error, "a share from -0.02 to 0.02")


def turning(
    disturbances: Disturbances,
    speed: float,
    angle: float,
    step: float,
    count: int,
    first: int,
    rng: np.random.Generator,
    acceleration: float = 0.0,
) -> FloatArray:
    """Return the spindle's angle at instants `step` apart, shape (count,) [rad].

    `speed` [rad/s]: mean of the process; that of a record lies beside it
    `angle` [rad]: at instant number `first`
    `step` [s]
    `rng`: not used by a spindle that does not wander
    `acceleration` [rad/s^2]: by which the speed changes from instant number `first` on
    """
    from scipy.signal import lfilter  # slow to import, and files are read without it

    since = np.maximum(step * (np.arange(count) - first), 0.0)
    even = np.asarray(angle + speed * step * (np.arange(count) - first) + 0.5 * acceleration * since**2, dtype=np.float64)
    if disturbances.speed_wander == 0.0:
        return even
    decay, quick = np.exp(-step / disturbances.wander_time), np.exp(-step / (_SMOOTH * disturbances.wander_time))
    start = rng.normal()
    steps = np.sqrt(1.0 - decay**2) * rng.normal(size=count)
    wander = lfilter([1.0], [1.0, -decay], steps, zi=[decay * start])[0]
    wander = lfilter([1.0 - quick], [1.0, -quick], wander, zi=[quick * start])[0]
    # the second low-pass takes a tenth of the variance
    deviation = disturbances.speed_wander * np.sqrt(1.0 + _SMOOTH) * wander
    lead = np.concatenate([[0.0], np.cumsum(0.5 * (deviation[1:] + deviation[:-1]))]) * speed * step
    if acceleration != 0.0:
        wandering = deviation * (speed + acceleration * since)
        lead = np.concatenate([[0.0], np.cumsum(0.5 * (wandering[1:] + wandering[:-1]))]) * step
    return even + lead - lead[first]


def disturbed(
    disturbances: Disturbances, rate: float, count: int, rng: np.random.Generator, accelerometers: int = 1
) -> tuple[FloatArray, FloatArray]:
    """Return what is added to the gap and to the accelerations of both axes, shapes (count, 2) [m], (count, 2 accelerometers) [m/s^2].

    `rate` [Hz]: at which samples are truly taken
    `rng`: not used where nothing disturbs
    `accelerometers`: pairs of them: each feels the machine's noise for itself, and all the same knocks
    """
    from scipy.signal import lfilter

    time = np.arange(count) / rate
    gap, acceleration = np.zeros((count, 2)), np.zeros((count, 2 * accelerometers))
    if disturbances.hum > 0.0:
        for times, share in _HUM:
            phase = 2.0 * np.pi * rng.random(2)
            gap += share * disturbances.hum * np.cos(2.0 * np.pi * times * disturbances.mains * time[:, None] + phase)
    if disturbances.machine_noise > 0.0:
        omega = 2.0 * np.pi * _NOISE_FREQUENCY / rate
        pole = np.exp(omega * (-_NOISE_DAMPING + 1j * np.sqrt(1.0 - _NOISE_DAMPING**2)))
        for pair in acceleration.reshape(count, accelerometers, 2).transpose(1, 0, 2):
            noise = lfilter([1.0, -1.0], [1.0, -2.0 * pole.real, abs(pole) ** 2], rng.normal(size=(count + 1024, 2)), axis=0)[1024:]
            pair += disturbances.machine_noise * noise / noise.std(axis=0)
    for start in time[-1] * rng.random(rng.poisson(disturbances.knocks * time[-1])) if disturbances.knocks > 0.0 else ():
        omega = 2.0 * np.pi * np.exp(rng.uniform(*np.log(_KNOCK_FREQUENCY)))
        damping, since = rng.uniform(*_KNOCK_DAMPING), np.maximum(time - start, 0.0)
        ringing = np.exp(-damping * omega * since) * np.sin(omega * since)
        seen = disturbances.knock * ringing[:, None] * rng.normal(size=2)
        gap += seen
        acceleration -= omega**2 * np.tile(seen, accelerometers)
    return gap, acceleration
