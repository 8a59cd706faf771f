"""Records of a cut whose every line is known, written down from formulas of their own."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rcsa_ident.cutting.coefficients import CuttingCoefficients
from rcsa_ident.cutting.conditions import CuttingConditions, Engagement
from rcsa_ident.cutting.cutter import Cutter
from rcsa_ident.cutting.force import force_lines
from rcsa_ident.dynamics.coordinates import Dof
from rcsa_ident.signals.measurement import measure_cut
from rcsa_ident.signals.recording import Quantity, Recording, Sensor

RATE = 25600.0
COEFFICIENTS = CuttingCoefficients(tangential=902e6, radial_ratio=0.26)
RPM = np.pi / 30.0
#: The fixture moves with this share of the flange, against the gap.
FIXTURE = 0.1 * np.exp(0.3j)


def conditions(rpm):
    return CuttingConditions(rpm * RPM, 0.4e-3, 0.1e-3, Engagement(np.pi / 2, np.pi))


def cross(omega):
    """Cross FRF of three modes that are not proportionally damped, X and Y, shape (n, 2) [m/N]."""
    total = np.zeros((omega.size, 2), dtype=complex)
    for hertz, zeta, residue in ((820.0, 0.05, 4e-5 - 6e-6j), (1450.0, 0.04, -2e-5 + 4e-6j), (2900.0, 0.03, 1.5e-5 + 3e-6j)):
        for axis, shift in enumerate((1.0, 0.93)):
            pole = 2.0 * np.pi * hertz * shift * (-zeta + 1j * np.sqrt(1.0 - zeta**2))
            total[:, axis] += residue / 1j / (1j * omega - pole) + np.conj(residue / 1j) / (1j * omega - np.conj(pole))
    return total


def wave(amplitude, speed, count, rate=RATE):
    """Re sum_m amplitude[m] e^{i m speed t}, shape (m + 1, c) -> (count, c)."""
    t = np.arange(count) / rate
    return np.real(np.exp(1j * np.outer(t, speed * np.arange(amplitude.shape[0]))) @ amplitude)


def profile(rng, size=4e-6, orders=8):
    """Roundness as two sensors at a right angle see it, for tooth angle 0, shape (orders + 1, 2) [m]."""
    k = np.arange(1, orders + 1)
    amplitude = rng.uniform(0.5, 1.5, orders) / k
    amplitude = amplitude * size / amplitude.sum() * np.exp(2j * np.pi * rng.random(orders))
    seen = np.zeros((orders + 1, 2), dtype=complex)
    for axis, position in enumerate((0.5 * np.pi, 0.0)):
        seen[1:, axis] = (amplitude * np.exp(1j * k * position)).conj()
    return seen


def drift(rng, count, size=1e-6):
    s = np.linspace(-0.5, 0.5, count)
    return size * (rng.normal() * s + 0.3 * rng.normal() * np.sin(np.pi * s + rng.uniform(0.0, 6.0)))


@dataclass
class Pair:
    """A cut and its air cut, with what is true of them."""

    cut: Recording
    air: Recording
    cutter: Cutter
    rpm: float
    speed: float
    angle: float
    air_angle: float

    def measure(self, **changes):
        given = {"cut": self.cut, "air": self.air, "cutter": self.cutter, "conditions": conditions(self.rpm)} | changes
        return measure_cut("c", "t", coefficients=COEFFICIENTS, **given)

    def expected(self, lines, axis):
        """What the receptance of these lines should be: the delay is that of tooth 1 from immersion 0."""
        return cross(lines.omega)[:, 0 if axis is Dof.X else 1] * np.exp(1j * lines.order * self.angle)


def pair(
    seed=0,
    rpm=9000.0,
    teeth=4,
    duration=0.28,
    noise=2e-9,
    roundness=4e-6,
    runout=0.0,
    accelerometers=True,
    bad_compensation=1.0,
    delay=0.0,
    bandwidth=None,
    trigger=None,
    off=1e-3,
    force=1.0,
    scatter=0.0,
):
    """Return a cut and its air cut; `trigger` holds the sensor's options, `scatter` the force's relative change between eighths."""
    rng = np.random.default_rng(seed)
    count = round(duration * RATE)
    cutter = Cutter(teeth, 16e-3, np.radians(30.0))
    shape = profile(rng, roundness)
    sensors = [Sensor(f"flange_{a}", Quantity.DISPLACEMENT, a, delay=delay, bandwidth=bandwidth) for a in (Dof.X, Dof.Y)]
    if accelerometers:
        sensors += [Sensor(f"fixture_{a}", Quantity.ACCELERATION, a) for a in (Dof.X, Dof.Y)]
    if trigger is not None:
        sensors.append(Sensor("trigger", Quantity.TRIGGER, **trigger))
    made, speeds, angles = [], [], []
    for cutting in (True, False):
        speed = rpm * RPM * (1.0 + off * rng.uniform(-1.0, 1.0))
        angle = rng.uniform(0.0, 2.0 * np.pi)
        order = np.arange(int(2.0 * np.pi * 5000.0 / speed) + 1)
        turned = np.exp(1j * order * angle)[:, None]
        gap = np.zeros((order.size, 2), dtype=complex)
        gap[: shape.shape[0]] = shape
        flange = np.zeros_like(gap)
        if cutting:
            harmonic = order[teeth::teeth]
            lines = force_lines(cutter, conditions(speed / RPM), COEFFICIENTS, harmonic)
            flange[harmonic] = force * cross(harmonic * speed) * lines
            free = order[(order > 0) & (order % teeth != 0)]
            random = rng.normal(size=(free.size, 2)) + 1j * rng.normal(size=(free.size, 2))
            flange[free] = runout * random / np.sqrt(2.0 * free)[:, None]
        fixture = FIXTURE * flange if accelerometers else 0.0 * flange
        lag = np.exp(-1j * order * speed * delay) / (1.0 + (1j * order * speed / (2.0 * np.pi * bandwidth) if bandwidth else 0.0))
        channels = [wave(gap * turned * lag[:, None], speed, count)]
        vibration = wave((flange - fixture) * turned * lag[:, None], speed, count)
        if scatter and cutting:
            vibration *= np.repeat(1.0 + scatter * rng.normal(size=8), -(-count // 8))[:count, None]
        channels[0] = channels[0] + vibration + noise * rng.normal(size=(count, 2)) + np.stack([drift(rng, count), drift(rng, count)], 1)
        if accelerometers:
            acceleration = -bad_compensation * (order * speed)[:, None] ** 2 * fixture * turned
            channels.append(wave(acceleration, speed, count) + 0.05 * rng.normal(size=(count, 2)))
        if trigger is not None:
            pulses, mark = trigger.get("pulses_per_revolution", 1), trigger.get("tooth_angle") or 0.0
            at = angle + speed * (np.arange(count) / RATE - trigger.get("delay", 0.0))
            channels.append((np.mod((at - mark) * pulses, 2.0 * np.pi) < 1.0).astype(float)[:, None])
        made.append(Recording(RATE, np.concatenate(channels, axis=1), tuple(sensors)))
        speeds.append(speed)
        angles.append(angle)
    return Pair(made[0], made[1], cutter, rpm, speeds[0], angles[0], angles[1])


def changed(recording, edit):
    """Return the recording with its samples run through `edit`, in place on a copy."""
    samples = recording.samples.copy()
    edit(samples)
    return Recording(recording.rate, samples, recording.sensors)
