"""A machine whose axes feel each other, as the observer sees it: C31 as a matrix, and one augmented state for all forces."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from rcsa_ident.arrays import ComplexArray, FloatArray, frozen
from rcsa_ident.dynamics.poles import PoleResidue
from rcsa_ident.dynamics.rational import RationalFit, rational_fit
from rcsa_ident.errors import InputError, non_negative, positive
from rcsa_ident.observer.force_model import FIRST_DISTURBANCE, FIRST_FORCE, ForceModel
from rcsa_ident.observer.transfer_function import (
    OUTSIDE,
    TOLERANCE,
    SampledModes,
    TransferFunction,
    fitted_range,
    high_pass_pole,
    warped,
)

#: Share of a residue's largest part below which its further rank-one parts are dropped: a pole of a machine has one shape.
RANK = 0.02
#: Highest order of the fit: the poles of both axes.
_HIGHEST_ORDER = 60


@dataclass(frozen=True, slots=True, eq=False)
class CoupledTransfer:
    """C31 as a matrix: tip forces to the flange's displacements as the sensors show them, with poles that all entries share.

    Parameters
    ----------
    fit : RationalFit
        Rows are displacements, columns forces [m/N]; left and right shapes differ, as gyroscopic moments want.
    step : float [s]
    band : two floats [rad/s]
        Frequencies between which the fit was asked to be good.
    flatness : array, shape (c,) [dB]
        Largest deviation of each direct entry's magnitude from the response that was given, in the band.
    """

    fit: RationalFit
    step: float
    band: tuple[float, float]
    flatness: FloatArray

    def response(self, omega: FloatArray) -> ComplexArray:
        """Return displacements per force, shape (n, c, c) [m/N]."""
        return self.fit.response(warped(omega, self.step))

    def direct(self, place: int) -> TransferFunction:
        """Return one axis' displacement over its own force."""
        one = slice(place, place + 1)
        fit = replace(self.fit, residue=self.fit.residue[:, one, one], constant=self.fit.constant[one, one])
        return TransferFunction(fit, self.step, self.band, float(self.flatness[place]))

    def behind_high_pass(self, corner: float) -> PoleResidue:
        """Return the sampled filter from forces to high-passed displacements: poles in the z-plane, inputs of length 1.

        Parameters
        ----------
        corner : float [rad/s]
            Corner frequency of `high_pass`.
        """
        modes = self.fit.modes(RANK)
        passing, rho = high_pass_pole(corner, self.step)
        passed = modes.pole**2 / ((modes.pole - passing) * (modes.pole - passing.conjugate()))
        there, mirrored = (
            modes.outputs / (passing - modes.pole) @ modes.inputs,
            modes.outputs / (passing.conjugate() - modes.pole) @ modes.inputs,
        )
        left, size, right = np.linalg.svd((there + mirrored.conj()) * rho)
        pole = np.concatenate([modes.pole, np.full(size.size, passing)])
        outputs, inputs = np.hstack([modes.outputs * passed, left * size]), np.vstack([modes.inputs, right])
        length = np.linalg.norm(inputs, axis=1)
        outputs, inputs = outputs * length, inputs / length[:, None]
        # the bilinear transform, s = 2 / step (z - 1) / (z + 1)
        half = 0.5 * self.step
        decay, share = (1.0 + half * pole) / (1.0 - half * pole), half / (1.0 - half * pole)
        return PoleResidue(decay, outputs * share * (1.0 + decay), inputs, 2.0 * ((outputs * share) @ inputs).real)


def coupled_transfer(
    omega: FloatArray, receptance: ComplexArray, step: float, band: tuple[float, float], sensor: ComplexArray, tolerance: float = TOLERANCE
) -> CoupledTransfer:
    """Return the transfer function of axes that feel each other.

    Parameters
    ----------
    omega : array, shape (n,) [rad/s]
        Frequencies that reach beyond the band on both sides.
    receptance : complex array, shape (n, c, c) [m/N]
        C31: absolute motion of the flange (rows) per force at the tip (columns).
    step : float [s]
        Time between samples.
    band : two floats [rad/s]
        Frequencies between which the fit has to be good.
    sensor : complex array, shape (n, c)
        Frequency responses of the displacement sensors.
    tolerance : float
        Rms misfit over the direct entries; a cross entry's misfit, too, counts over the largest entry of its row.

    Raises
    ------
    InputError
        If the band lies outside the frequencies or above what the sampling rate can hold.
    """
    omega = np.asarray(omega, dtype=float)
    keep, inside = fitted_range(omega, step, band)
    values = np.asarray(receptance, dtype=complex) * sensor[:, :, None]
    size = np.linalg.norm(values[inside], axis=0)
    # a fit weighs each entry by its own size: one that is hardly there shall not ask for poles of its own
    weight = np.where(inside, 1.0, OUTSIDE)[:, None, None] * np.maximum(size / size.max(axis=1, keepdims=True), 1e-6)
    fit = rational_fit(
        warped(omega[keep], step), values[keep], tolerance=tolerance, weight=weight[keep], constant=False, highest_order=_HIGHEST_ORDER
    )
    own = np.arange(values.shape[1])
    ratio = (fit.response(warped(omega[inside], step)) / values[inside])[:, own, own]
    return CoupledTransfer(fit, step, band, frozen(np.max(np.abs(20.0 * np.log10(np.abs(ratio))), axis=0)))


@dataclass(frozen=True, slots=True, eq=False)
class AxisNoise:
    """What one axis' force and sensors add to a coupled model.

    Parameters
    ----------
    force : ForceModel
    noise : float [m]
        Standard deviation of a displacement sample.
    acceleration : SampledModes or None
        Filter from the fixture's acceleration to displacement, where its noise is modelled.
    acceleration_noise : float [m/s^2]
    disturbance : array, shape (d,) [rad/s]
        Frequencies at which the measurement is not believed.
    disturbance_intensity : float [m/sqrt(s)]
    """

    force: ForceModel
    noise: float
    acceleration: SampledModes | None = None
    acceleration_noise: float = 0.0
    disturbance: FloatArray | Sequence[float] = ()
    disturbance_intensity: float = 0.0


@dataclass(frozen=True, slots=True, eq=False)
class CoupledModel:
    """The augmented state of axes that feel each other: a plant that all forces enter, each force's modes, then each sensor's noise.

    Parameters
    ----------
    decay : complex array, shape (m,) [-]
        Factor of each mode from one sample to the next.
    inputs : complex array, shape (plants, c)
        What a force adds to the plant's modes.
    observed : complex array, shape (c, m)
        Measurement j is sum Re(observed[j] x) + through[j] @ force + noise.
    ends : tuple of c + 1 ints
        Where the plant's modes end, and then those of each force.
    through : array, shape (c, c) [m/N]
    drive : array, shape (m,)
        Standard deviation of what is added, per step, to the real and to the imaginary part of a force or noise mode.
    common : array, shape (c, m)
        Standard deviation of what each axis' accelerometer noise adds to the modes' real parts.
    noise : array, shape (c,) [m]
        Standard deviation of a measured sample.
    step : float [s]
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


def coupled_model(plant: PoleResidue, axes: Sequence[AxisNoise], step: float) -> CoupledModel:
    """Return the augmented model of axes that feel each other.

    Parameters
    ----------
    plant : PoleResidue
        Tip forces to measured displacements, sampled [m/N].
    axes : sequence of AxisNoise, one for each force and measurement
    step : float [s]
    """
    count, plants = len(axes), plant.pole.size
    decay, drive, ends = [plant.pole], [np.zeros(plants)], [plants]
    for each in axes:
        own, spread = each.force.modes(step)
        decay.append(own)
        drive.append(spread)
        ends.append(ends[-1] + own.size)
    observed = [2.0 * plant.outputs, np.zeros((count, ends[-1] - plants))]
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
            drive.append(
                np.full(believed.size, non_negative("disturbance intensity", each.disturbance_intensity, "m/sqrt(s)") * np.sqrt(step))
            )
            common.append(np.zeros((count, believed.size)))
        total.append(float(np.hypot(positive("measurement noise", each.noise, "m"), direct)))
    return CoupledModel(
        np.concatenate(decay),
        plant.inputs,
        np.hstack(observed),
        tuple(ends),
        plant.constant,
        np.concatenate(drive),
        np.hstack(common),
        np.array(total),
        step,
    )
