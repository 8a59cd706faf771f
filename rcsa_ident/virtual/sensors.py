"""What the sensors see: gap, fixture acceleration and trigger, with noise, drift and roundness, at the record's rate."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rcsa_ident.base.arrays import FloatArray
from rcsa_ident.base.errors import InputError, non_negative, positive
from rcsa_ident.virtual.disturbances import Disturbances, disturbed
from rcsa_ident.virtual.milling import CutHistory

#: A laboratory's records.
UNDISTURBED = Disturbances()


@dataclass(frozen=True, slots=True)
class SensorSuite:
    """The sensors of a virtual machine and their imperfections.

    `rate` [Hz]
    `gap_noise` [m]: standard deviation of a sample
    `gap_drift` [m]: size of the slow wandering within a record
    `acceleration_noise` [m/s^2]
    `roundness` [m]: sum of the amplitudes of the flange's out-of-roundness and run-out
    `roundness_orders`: spindle orders 1 to this
    `cutter_runout` [m]: eccentricity of the cutter in its clamping
    `speed_error` [-]: standard deviation of the true speed's relative deviation from the programmed one, new in every record
    `trigger`: whether there is a pulse once per revolution
    `tooth_angle` [rad]: immersion angle of tooth 1 at the trigger's edge
    `gap_sensitivity`, `acceleration_sensitivity`: float [V/m], [V/(m/s^2)]
    `gap_delay`, `acceleration_delay` [s]
    `gap_bandwidth`, `acceleration_bandwidth` [Hz]: first-order low-pass
    """

    rate: float = 25600.0
    gap_noise: float = 2e-9
    gap_drift: float = 1e-6
    acceleration_noise: float = 0.05
    roundness: float = 4e-6
    roundness_orders: int = 8
    cutter_runout: float = 2e-6
    speed_error: float = 1e-3
    trigger: bool = False
    tooth_angle: float = 0.0
    gap_sensitivity: float = 1.0
    acceleration_sensitivity: float = 1.0
    gap_delay: float = 0.0
    acceleration_delay: float = 0.0
    gap_bandwidth: float | None = None
    acceleration_bandwidth: float | None = None

    def __post_init__(self) -> None:
        positive("sensors.sampling_rate_hz", self.rate, "Hz")
        for name in ("gap_noise", "gap_drift", "acceleration_noise", "roundness", "cutter_runout", "gap_delay", "acceleration_delay"):
            non_negative(f"sensors.{name}", getattr(self, name))
        if not 0.0 <= self.speed_error < 0.05:
            raise InputError("sensors.speed_error", self.speed_error, "a ratio from 0 to below 0.05")
        if not 0 <= self.roundness_orders <= 64:
            raise InputError("sensors.roundness_orders", self.roundness_orders, "a whole number from 0 to 64")
        for name in ("gap_bandwidth", "acceleration_bandwidth"):
            if getattr(self, name) is not None:
                positive(f"sensors.{name}", getattr(self, name), "Hz")
        for name in ("gap_sensitivity", "acceleration_sensitivity"):
            if getattr(self, name) == 0.0 or not np.isfinite(getattr(self, name)):
                raise InputError(f"sensors.{name}", getattr(self, name), "a finite number other than 0")


@dataclass(frozen=True, slots=True, eq=False)
class Clamping:
    """What is fixed in the rotating frame as long as a tooling stays clamped.

    `roundness`: complex array, shape (orders,) [m]; amplitude of each order of the flange's outer surface, in the angle from tooth 1
    `runout` [m], shape (teeth,): radial offset of each edge
    """

    roundness: np.ndarray
    runout: FloatArray


def clamp(suite: SensorSuite, tooth_angle: FloatArray, rng: np.random.Generator) -> Clamping:
    """Draw a clamping: amplitudes that fall with the order, any phases, an eccentric cutter.

    `tooth_angle` [rad], shape (teeth,): angle of each tooth ahead of tooth 1
    """
    order = np.arange(1, suite.roundness_orders + 1)
    size = rng.uniform(0.5, 1.5, order.size) / order
    size *= suite.roundness / max(size.sum(), 1e-300)
    roundness = size * np.exp(2j * np.pi * rng.random(order.size))
    runout = suite.cutter_runout * np.cos(tooth_angle - 2.0 * np.pi * rng.random())
    return Clamping(roundness, runout)


def out_of_round(suite: SensorSuite, clamping: Clamping, angle: FloatArray, speed: float, factor: int) -> FloatArray:
    """Return what the gap sensors in +X and +Y record of the turning flange's surface, shape (n, 2) [m].

    `angle` [rad], shape (n,): angle of tooth 1 at each sample, clockwise from +Y to +X
    `speed` [rad/s]
    `factor`: fine instants per sample; the `decimator`'s flatness at each order is exact here
    """
    order = np.arange(1, clamping.roundness.size + 1)
    omega = order * speed
    taps = decimator(factor)
    place = np.arange(taps.size) - taps.size // 2
    response = (np.cos(np.outer(omega / (suite.rate * factor), place)) @ taps).astype(complex)
    if suite.gap_bandwidth is not None:
        response = response / (1.0 + 1j * omega / (2.0 * np.pi * suite.gap_bandwidth))
    # what is seen now has passed the sensor before
    turning = np.exp(1j * (angle if suite.gap_delay == 0.0 else angle - suite.gap_delay * suite.rate * np.gradient(angle)))
    seen = np.zeros((angle.size, 2))
    for i, position in enumerate((0.5 * np.pi, 0.0)):
        # the surface point under the sensor lies at position - angle ahead of tooth 1: it runs backwards
        line = (clamping.roundness * np.exp(1j * order * position)).conj() * response
        power = np.ones_like(turning)
        for amplitude in line:
            power = power * turning
            seen[:, i] += (amplitude * power).real
    return seen


def decimator(factor: int, attenuation: float = 90.0) -> FloatArray:
    """Return the taps of a linear-phase low-pass for sampling at 1 / factor of the rate.

    Flat to 0.4 of the new rate, down by `attenuation` dB from 0.6 of it on: what folds lands above 0.4.
    """
    from scipy.signal import firwin, kaiserord  # slow to import, and files are read without it

    count, beta = kaiserord(attenuation, 0.2 / factor * 2.0)
    half = int(np.ceil(count / 2 / factor)) * factor
    return firwin(2 * half + 1, 1.0 / factor, window=("kaiser", beta))


def padding(factor: int) -> int:
    """Return how many samples at the record's rate the decimator needs before and after the record."""
    return decimator(factor).size // 2 // factor


def sample(values: FloatArray, factor: int, fine_step: float, delay: float, bandwidth: float | None) -> FloatArray:
    """Return a channel at the record's rate: sensor lag, anti-alias filter, every `factor`-th sample.

    `values`: array, shape (factor * (n - 1 + 2 pad) + 1,); with `padding` on both sides; the delay may not exceed the padding by much
    `factor`: fine instants per sample
    `fine_step` [s]
    `delay` [s]: the sensor lags by it
    `bandwidth` [Hz]: of the sensor's first-order low-pass
    Returns an array of shape (n,).
    """
    from scipy.signal import lfilter, upfirdn

    if bandwidth is not None:
        # exact for linear interpolation between the fine samples
        x = 2.0 * np.pi * bandwidth * fine_step
        decay = np.exp(-x)
        ramp = 1.0 - (1.0 - decay) / x
        start = values[0] * (1.0 - ramp)
        values, _ = lfilter([ramp, 1.0 - decay - ramp], [1.0, -decay], values, zi=[start])
    taps = decimator(factor)
    pad = taps.size // 2 // factor
    if delay > 0.0:
        taps = _delayed(taps, delay / fine_step)
    filtered = upfirdn(taps, values, down=factor)
    count = (values.size - 1) // factor + 1 - 2 * pad
    return filtered[2 * pad : 2 * pad + count]


def _delayed(taps: FloatArray, shift: float) -> FloatArray:
    """The same low-pass, later by `shift` fine samples; beyond its ends it is cut off."""
    frequency = np.fft.rfftfreq(4 * taps.size)
    padded = np.concatenate([np.zeros(taps.size), taps, np.zeros(2 * taps.size)])
    moved = np.fft.irfft(np.fft.rfft(padded) * np.exp(-2j * np.pi * frequency * shift), padded.size)
    return moved[taps.size : 2 * taps.size]


def drift(size: float, count: int, rng: np.random.Generator) -> FloatArray:
    """Return a slow wandering: a line and half a wave across the record, shape (count,). `size` [m]."""
    s = np.linspace(-0.5, 0.5, count)
    a, b, phase = rng.normal(), rng.normal(), rng.uniform(0.0, 2.0 * np.pi)
    return size * (a * s + 0.3 * b * np.sin(np.pi * s + phase))


def trigger_pulse(angle: FloatArray, edge: float, width: float = 0.35) -> FloatArray:
    """Return 1 while the reference mark passes, else 0; the edge rises where the tooth angle passes `edge`.

    `angle` [rad], shape (n,): angle of tooth 1
    `edge` [rad]: tooth angle at which the pulse rises
    `width` [rad]
    """
    return (np.mod(angle - edge, 2.0 * np.pi) < width).astype(float)


def accelerometer_places(housing: int, workpiece_side: str | None = None) -> tuple[str, ...]:
    """Return what the channels of accelerometers begin with: of the fixture, of so many pairs on the housing, then of what is told of the
    workpiece's side."""
    places = ("fixture", "housing", *(f"housing{k}" for k in range(2, housing + 1)))[: 1 + housing]
    return places if workpiece_side is None else (*places, workpiece_side)


def record(
    suite: SensorSuite,
    clamping: Clamping,
    angle: FloatArray,
    feed_angle: float,
    factor: int,
    history: CutHistory | None,
    rng: np.random.Generator,
    disturbances: Disturbances = UNDISTURBED,
    places: tuple[str, ...] = ("fixture",),
) -> dict[str, FloatArray]:
    """Return the channels of one record, in the sensors' signal units, shape (count,) each.

    `suite`: its rate is that at which samples are truly taken
    `angle` [rad], shape (count,): immersion angle of tooth 1 at each sample
    `feed_angle` [rad]
    `factor`: fine instants per sample
    `history`: the simulated cut with `padding` on both sides; None is an air cut
    `disturbances`: what is added; how the spindle turns is in the angle
    `places`: of the pairs of accelerometers (`accelerometer_places`); each is as that on the sensors' fixture
    """
    count = angle.size
    speed = float(angle[-1] - angle[0]) / (count - 1) * suite.rate
    gap = out_of_round(suite, clamping, angle - feed_angle, speed, factor)
    acceleration = np.zeros((count, 2 * len(places)))
    if history is not None:
        step = 1.0 / (suite.rate * factor)
        fine = (count - 1 + 2 * padding(factor)) * factor + 1
        if history.flange.shape[0] != fine or abs(history.step - step) > 1e-9 * step:
            raise InputError("history", f"{history.flange.shape[0]} instants", f"{fine} instants, {step:g} s apart")
        relative = history.flange - history.fixture
        for i in (0, 1):
            gap[:, i] += sample(relative[:, i], factor, step, suite.gap_delay, suite.gap_bandwidth)
        for i, felt in enumerate(history.acceleration.T):
            acceleration[:, i] += sample(felt, factor, step, suite.acceleration_delay, suite.acceleration_bandwidth)
    for channel, more in zip((gap, acceleration), disturbed(disturbances, suite.rate, count, rng, len(places)), strict=True):
        channel += more
    channels: dict[str, FloatArray] = {}
    for i, axis in enumerate("xy"):
        seen = gap[:, i] + suite.gap_noise * rng.normal(size=count) + drift(suite.gap_drift, count, rng)
        channels[f"flange_{axis}"] = suite.gap_sensitivity * seen
    for place, pair in zip(places, np.split(acceleration, len(places), axis=1), strict=True):
        for i, axis in enumerate("xy"):
            seen = pair[:, i] + suite.acceleration_noise * rng.normal(size=count)
            channels[f"{place}_{axis}"] = suite.acceleration_sensitivity * seen
    if suite.trigger:
        channels["trigger"] = trigger_pulse(angle, suite.tooth_angle)
    return channels
