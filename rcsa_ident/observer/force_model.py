"""What the observer knows of the force between samples, and the augmented state {q, f} ([inprocess], eq. 17)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

from rcsa_ident.arrays import ComplexArray, FloatArray, frozen
from rcsa_ident.errors import InputError, non_negative, positive
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

    Parameters
    ----------
    intensity : float [N/sqrt(s)]
        Standard deviation of the walk after a second.
    leak : float [rad/s]
        Rate at which it forgets; 0 is the walk of [inprocess].
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

    Parameters
    ----------
    walk : RandomWalk
        What is not periodic.
    omega : array, shape (j,) [rad/s]
        Multiples of the tooth-passing frequency; with cutter run-out, of the spindle's.
    intensity : array, shape (j,) [N/sqrt(s)]
        How fast each amplitude walks.
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
class AugmentedModel:
    """Plant, force and what disturbs the measurement, as modes in that order (see `_kernels`).

    Parameters
    ----------
    decay : complex array, shape (m,) [-]
        Factor of each mode from one sample to the next.
    observed : complex array, shape (m,)
        The measurement is sum Re(observed x) + through * force + noise.
    counts : two ints
        Number of plant modes and of force modes.
    through : float [m/N]
    drive : array, shape (m,)
        Standard deviation of what is added, per step, to the real and to the imaginary part of a force or noise mode.
    common : array, shape (m,)
        Standard deviation of what one and the same noise adds to the modes' real parts: the unmodelled force to the plant's,
        the accelerometer's noise to those of its filter.
    noise : float [m]
        Standard deviation of a measured sample.
    step : float [s]
    """

    decay: ComplexArray
    observed: ComplexArray
    counts: tuple[int, int]
    through: float
    drive: FloatArray
    common: FloatArray
    noise: float
    step: float

    def __post_init__(self) -> None:
        for name, dtype in (("decay", complex), ("observed", complex), ("drive", float), ("common", float)):
            object.__setattr__(self, name, frozen(getattr(self, name), dtype))
        positive("measurement noise", self.noise, "m")

    @property
    def live(self) -> np.ndarray:
        """Which of the 2 m real states move: a real pole has no imaginary part, shape (2 m,)."""
        live = np.ones((self.decay.size, 2), dtype=bool)
        live[:, 1] = self.decay.imag != 0.0
        return live.ravel()

    def matrices(self) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
        """Return A (n, n), H (n,), the force's row (n,) and Q (n, n) of the live real states, the measurement in units of its noise."""
        m, (plants, forces) = self.decay.size, self.counts
        a, q = np.zeros((m, 2, m, 2)), np.zeros((m, 2, m, 2))
        i, re, im = np.arange(m), self.decay.real, self.decay.imag
        a[i, 0, i, 0], a[i, 0, i, 1], a[i, 1, i, 0], a[i, 1, i, 1] = re, -im, im, re
        a[:plants, 0, plants : plants + forces, 0] = 1.0
        row, seen = np.zeros((m, 2)), np.stack([self.observed.real, -self.observed.imag], axis=1)
        row[plants : plants + forces, 0] = 1.0
        seen = (seen + self.through * row) / self.noise
        for part in (0, 1):
            q[i, part, i, part] = self.drive**2
        for group in (i < plants, i >= plants + forces):
            shared = np.where(group, self.common, 0.0)
            q[:, 0, :, 0] += np.outer(shared, shared)
        live = self.live
        keep = np.ix_(live, live)
        return a.reshape(2 * m, 2 * m)[keep], seen.ravel()[live], row.ravel()[live], q.reshape(2 * m, 2 * m)[keep]

    def first_covariance(self) -> FloatArray:
        """Return the live states' covariance before the first sample: a machine at rest, a force that nobody knows."""
        plants, forces = self.counts
        spread = np.maximum(self.drive, 10.0 * self.common)
        spread[:plants] = 0.0
        spread[plants : plants + forces] = FIRST_FORCE
        later = np.arange(spread.size) >= plants + forces
        spread[later & (self.drive > 0.0)] = FIRST_DISTURBANCE
        return np.diag((np.repeat(spread, 2) ** 2)[self.live])


def augmented(
    plant: SampledModes,
    force: ForceModel,
    noise: float,
    *,
    unmodelled: float = 0.0,
    acceleration: SampledModes | None = None,
    acceleration_noise: float = 0.0,
    disturbance: Sequence[float] | FloatArray = (),
    disturbance_intensity: float = 0.0,
) -> AugmentedModel:
    """Return the augmented model of one axis.

    Parameters
    ----------
    plant : SampledModes
        Tip force to measured displacement [m/N].
    force : ForceModel
    noise : float [m]
        Standard deviation of a displacement sample: the measurement noise of [inprocess], eq. 17.
    unmodelled : float [N]
        Process noise of [inprocess], eq. 17: standard deviation of a force sample that the force model cannot follow.
    acceleration : SampledModes, optional
        Filter from the fixture's acceleration to displacement: it colours the accelerometer's noise.
    acceleration_noise : float [m/s^2]
        Standard deviation of a sample.
    disturbance : array, shape (d,) [rad/s]
        Frequencies at which the measurement holds what is not believed: orders of the spindle below the identified band.
    disturbance_intensity : float [m/sqrt(s)]
    """
    step = plant.step
    decay, drive = force.modes(step)
    kinds: list[tuple[Any, ...]] = [
        (plant.decay, 2.0 * plant.gain, 0.0, non_negative("unmodelled force", unmodelled, "N")),
        (decay, 0.0, drive, 0.0),
    ]
    direct = 0.0
    if acceleration is not None and acceleration_noise > 0.0:
        kinds.append((acceleration.decay, 2.0 * acceleration.gain, 0.0, acceleration_noise))
        direct = acceleration.through * acceleration_noise
    if len(disturbance):
        spread = positive("disturbance intensity", disturbance_intensity, "m/sqrt(s)") * np.sqrt(step)
        kinds.append((np.exp(1j * np.asarray(disturbance) * step), 1.0, spread, 0.0))
    columns = [np.concatenate([np.broadcast_to(kind[c], kind[0].shape) for kind in kinds]) for c in range(4)]
    total = float(np.hypot(positive("measurement noise", noise, "m"), direct))
    return AugmentedModel(
        columns[0], columns[1], (plant.decay.size, decay.size), plant.through, columns[2].real, columns[3].real, total, step
    )
