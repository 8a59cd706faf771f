"""What the observer knows of the force between samples, and the augmented state {q, f} ([inprocess], eq. 17)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from rcsa_ident.base.arrays import ComplexArray, FloatArray, frozen
from rcsa_ident.base.errors import InputError, non_negative, positive
from rcsa_ident.dynamics.poles import PoleResidue
from rcsa_ident.observer.transfer_function import SampledModes

#: Standard deviation of every force mode before the first sample, more than a tooth brings [N], and of a disturbance's [m].
FIRST_FORCE, FIRST_DISTURBANCE = 300.0, 1e-6


class ForceModel(Protocol):
    """How the force may move between samples; an object that carries its settings."""

    def modes(self, step: float) -> tuple[ComplexArray, FloatArray]:
        """Return decay (j,) and, per step, the standard deviation of what is added to each mode's real and imaginary part (j,) [N]."""
        ...


@dataclass(frozen=True, slots=True)
class RandomWalk:
    """f[k+1] = f[k] + eta ([inprocess], eq. 17), which may slowly forget: behind a high-pass the mean cannot be seen.

    `intensity` [N/sqrt(s)]: standard deviation of the walk after a second
    `leak` [rad/s]: rate at which it forgets; 0 is the walk of [inprocess]
    """

    intensity: float
    leak: float = 0.0

    def __post_init__(self) -> None:
        positive("random-walk intensity", self.intensity, "N/sqrt(s)")
        non_negative("random-walk leak", self.leak, "rad/s")

    def modes(self, step: float) -> tuple[ComplexArray, FloatArray]:
        """Return the only mode."""
        return np.array([np.exp(-self.leak * step) + 0.0j]), np.array([self.intensity * np.sqrt(step)])


@dataclass(frozen=True, slots=True, eq=False)
class TeethResonators:
    """A random walk and an undamped oscillator at each harmonic, whose amplitude and phase walk at random.

    `walk`: what is not periodic
    `omega` [rad/s], shape (j,): multiples of the tooth-passing frequency; with cutter run-out, of the spindle's
    `intensity` [N/sqrt(s)], shape (j,): how fast each amplitude walks
    """

    walk: RandomWalk
    omega: FloatArray
    intensity: FloatArray

    def __post_init__(self) -> None:
        object.__setattr__(self, "omega", frozen(self.omega))
        object.__setattr__(self, "intensity", frozen(np.broadcast_to(self.intensity, self.omega.shape)))
        if not np.all(self.omega > 0.0) or not np.all(self.intensity > 0.0):
            raise InputError("harmonics", self.omega.tolist(), "frequencies and intensities above 0")

    def modes(self, step: float) -> tuple[ComplexArray, FloatArray]:
        """Return the walk, then the oscillators."""
        if np.any(self.omega * step >= np.pi):
            raise InputError("harmonics", float(self.omega.max() / (2.0 * np.pi)), f"below half the sampling rate, {0.5 / step:g} Hz")
        decay, spread = self.walk.modes(step)
        return np.append(decay, np.exp(1j * self.omega * step)), np.append(spread, self.intensity * np.sqrt(step))


@dataclass(frozen=True, slots=True, eq=False)
class AxisNoise:
    """What one axis' force and sensors add to the augmented model.

    `noise` [m]: standard deviation of a displacement sample: the measurement noise of [inprocess], eq. 17.
    `acceleration`: filter from the fixture's acceleration to displacement: it colours the accelerometer's noise
    `acceleration_noise` [m/s^2]: standard deviation of a sample
    `disturbance` [rad/s], shape (d,): frequencies at which the measurement is not believed: orders of the spindle below the identified band
    `disturbance_intensity` [m/sqrt(s)]
    """

    force: ForceModel
    noise: float
    acceleration: SampledModes | None = None
    acceleration_noise: float = 0.0
    disturbance: FloatArray | Sequence[float] = ()
    disturbance_intensity: float = 0.0


@dataclass(frozen=True, slots=True, eq=False)
class AugmentedModel:
    """A plant that all forces enter, the modes of each force, then those of each sensor's noise (see `_kernels`).

    `decay` [-], shape (m,): factor of each mode from one sample to the next
    `inputs`, shape (plants, c): what a force adds to the plant's modes
    `observed`, shape (c, m): measurement j is sum Re(observed[j] x) + through[j] @ force + noise
    `ends`: tuple of c + 1 ints, where the plant's modes end, and then those of each force
    `through` [m/N], shape (c, c)
    `drive`, shape (m,): standard deviation of what is added, per step, to the real and to the imaginary part of a force or noise mode
    `common`, shape (c, m): standard deviation of what each axis' accelerometer noise adds to the modes' real parts
    `noise` [m], shape (c,): standard deviation of a measured sample
    `step` [s]
    """

    decay: ComplexArray
    inputs: ComplexArray
    observed: ComplexArray
    ends: tuple[int, ...]
    through: FloatArray
    drive: FloatArray
    common: FloatArray
    noise: FloatArray
    step: float

    def __post_init__(self) -> None:
        for name in ("decay", "inputs", "observed"):
            object.__setattr__(self, name, frozen(getattr(self, name), np.complex128))
        for name in ("through", "drive", "common", "noise"):
            object.__setattr__(self, name, frozen(getattr(self, name)))
        if not np.all(self.noise > 0.0):
            raise InputError("measurement noise", self.noise.tolist(), "numbers above 0 [m]")

    @property
    def live(self) -> np.ndarray:
        """Which of the 2 m real states move: a real pole has no imaginary part, shape (2 m,)."""
        live = np.ones((self.decay.size, 2), dtype=bool)
        live[:, 1] = self.decay.imag != 0.0
        return live.ravel()

    def matrices(self) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
        """Return A (n, n), H (c, n), the forces' rows (c, n) and Q (n, n) of the live real states, measurements in units of their noise."""
        m, plants, count = self.decay.size, self.ends[0], self.noise.size
        a, q = np.zeros((m, 2, m, 2)), np.zeros((m, 2, m, 2))
        i, re, im = np.arange(m), self.decay.real, self.decay.imag
        a[i, 0, i, 0], a[i, 0, i, 1], a[i, 1, i, 0], a[i, 1, i, 1] = re, -im, im, re
        rows, seen = np.zeros((count, m, 2)), np.stack([self.observed.real, -self.observed.imag], axis=2)
        for c in range(count):
            own = slice(self.ends[c], self.ends[c + 1])
            a[:plants, 0, own, 0], a[:plants, 1, own, 0] = self.inputs[:, c, None].real, self.inputs[:, c, None].imag
            rows[c, own, 0] = 1.0
        seen = (seen + np.tensordot(self.through, rows, axes=1)) / self.noise[:, None, None]
        for part in (0, 1):
            q[i, part, i, part] = self.drive**2
        for shared in self.common:
            q[:, 0, :, 0] += np.outer(shared, shared)
        live = self.live
        keep = np.ix_(live, live)
        return (
            a.reshape(2 * m, 2 * m)[keep],
            seen.reshape(count, -1)[:, live],
            rows.reshape(count, -1)[:, live],
            q.reshape(2 * m, 2 * m)[keep],
        )

    def first_covariance(self) -> FloatArray:
        """Return the live states' covariance before the first sample: a machine at rest, forces that nobody knows."""
        spread = np.maximum(self.drive, 10.0 * self.common.max(axis=0))
        spread[: self.ends[0]] = 0.0
        spread[self.ends[0] : self.ends[-1]] = FIRST_FORCE
        later = np.arange(spread.size) >= self.ends[-1]
        spread[later & (self.drive > 0.0)] = FIRST_DISTURBANCE
        return np.diag((np.repeat(spread, 2) ** 2)[self.live])


def augmented(plant: PoleResidue, axes: Sequence[AxisNoise], step: float) -> AugmentedModel:
    """Return the augmented model of one axis, or of several that feel each other.

    `plant`: tip forces to measured displacements, sampled [m/N]
    `axes`: sequence of AxisNoise, one for each force and measurement
    `step` [s]
    """
    count, plants = len(axes), plant.pole.size
    outputs, inputs = plant.outputs, plant.inputs
    if count == 1:
        # one force enters the real parts alone
        outputs, inputs = outputs * inputs[:, 0], np.ones_like(inputs)
    decay, drive, ends = [plant.pole], [np.zeros(plants)], [plants]
    for each in axes:
        own, spread = each.force.modes(step)
        decay.append(own)
        drive.append(spread)
        ends.append(ends[-1] + own.size)
    observed = [2.0 * outputs, np.zeros((count, ends[-1] - plants))]
    common, total = [np.zeros((count, ends[-1]))], []
    for j, each in enumerate(axes):
        unit, direct = np.eye(count)[:, j : j + 1], 0.0
        if each.acceleration is not None and each.acceleration_noise > 0.0:
            coloured = each.acceleration
            decay.append(coloured.decay)
            observed.append(unit * 2.0 * coloured.gain)
            drive.append(np.zeros(coloured.decay.size))
            common.append(unit * np.full(coloured.decay.size, each.acceleration_noise))
            direct = coloured.through * each.acceleration_noise
        if len(each.disturbance):
            believed = np.asarray(each.disturbance, dtype=float)
            decay.append(np.exp(1j * believed * step))
            observed.append(unit * np.ones(believed.size))
            drive.append(np.full(believed.size, positive("disturbance intensity", each.disturbance_intensity, "m/sqrt(s)") * np.sqrt(step)))
            common.append(np.zeros((count, believed.size)))
        total.append(float(np.hypot(positive("measurement noise", each.noise, "m"), direct)))
    return AugmentedModel(
        np.concatenate(decay),
        inputs,
        np.hstack(observed),
        tuple(ends),
        plant.constant,
        np.concatenate(drive),
        np.hstack(common),
        np.array(total),
        step,
    )
