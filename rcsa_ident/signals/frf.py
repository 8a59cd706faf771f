"""Cross FRF estimators: tip force to flange displacement. H1, H2 and coherence are those of [bendat2010]."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from rcsa_ident.arrays import ComplexArray, FloatArray
from rcsa_ident.signals.steady import SteadyRecord


@dataclass(frozen=True, slots=True, eq=False)
class HarmonicPoints:
    """Absolute flange displacement over the force at the tooth-passing harmonics of a cut, every axis on its own force.

    Parameters
    ----------
    cut, air : complex arrays, shape (n, axes, o) [m/N]
        The receptance is cut - air; the air cut's line is turned by the angle between both records. Outputs are gap and
        fixture, whose sum is the flange's motion, or that alone.
    variance : array, shape (n, axes, o) [m^2/N^2]
        Of the real and of the imaginary part of cut - air each.
    coherence : array, shape (n, axes) [-]
    """

    cut: ComplexArray
    air: ComplexArray
    variance: FloatArray
    coherence: FloatArray


class Estimator(Protocol):
    """How points of the cross FRF come out of a cut and its air cut: an object that carries its settings."""

    def points(self, cut: SteadyRecord, air: SteadyRecord | None, angle: float, order: np.ndarray, force: ComplexArray) -> HarmonicPoints:
        """Return the points at the given orders.

        Parameters
        ----------
        angle : float [rad]
            By which the air cut must be turned to lie under the cut.
        order : array of int, shape (n,)
        force : complex array, shape (n, axes) [N]
            Without zeros.
        """
        ...


@dataclass(frozen=True, slots=True)
class LineEstimator:
    """Least-squares lines over the whole record, the air cut's subtracted as complex numbers."""

    def points(self, cut: SteadyRecord, air: SteadyRecord | None, angle: float, order: np.ndarray, force: ComplexArray) -> HarmonicPoints:
        """Return the points; the variance is that of both lines, from the noise beside them and their scatter."""
        amplitude, noise = cut.outputs[order], cut.output_variance[order]
        still = np.zeros_like(amplitude)
        if air is not None:
            still, still_noise = turned(air.outputs, air.output_variance, angle, int(order[-1]))
            still, noise = still[order], noise + still_noise[order]
        variance = noise / np.abs(force[:, :, None]) ** 2
        power = np.abs(np.sum(amplitude - still, axis=2) / force) ** 2
        # the noise is in the power, too
        coherence = np.clip(1.0 - 2.0 * np.sum(variance, axis=2) / np.maximum(power, 1e-300), 0.0, 1.0)
        return HarmonicPoints(amplitude / force[:, :, None], still / force[:, :, None], variance, coherence)


@dataclass(frozen=True, slots=True)
class AirCorrectedSpectra:
    """Spectra averaged over segments [welch1967], those of the air cut subtracted ([inprocess], eqs. 8 and 16).

    What cut and air cut share at an order goes only as far as it is uncorrelated with what the force does there; at the
    few harmonics where the flange's roundness reaches them this leaves a bias that `LineEstimator` does not have.

    Parameters
    ----------
    segments : int
        Half-overlapping Hann segments of each record.
    """

    segments: int = 8

    def points(self, cut: SteadyRecord, air: SteadyRecord | None, angle: float, order: np.ndarray, force: ComplexArray) -> HarmonicPoints:
        """Return the points, nothing left to subtract; the variance is the jackknife's over the segments."""
        displacement = cut.segments(order, self.segments)
        still = np.zeros_like(displacement)
        if air is not None:
            still = air.segments(order, self.segments) * np.exp(1j * order * angle)[:, None]
        same = np.broadcast_to(force, displacement.shape)
        values = air_corrected(displacement, same, still)
        left = np.array([air_corrected(*(np.delete(x, s, axis=0) for x in (displacement, same, still))) for s in range(self.segments)])
        spread = (self.segments - 1) / self.segments * np.sum(np.abs(left - left.mean(axis=0)) ** 2, axis=0)
        variance = 0.5 * spread * _overlap_factor(self.segments)
        shared = coherence(displacement - still.mean(axis=0), same)
        return HarmonicPoints(values[:, :, None], np.zeros_like(values)[:, :, None], variance[:, :, None], shared)


def turned_air(air: SteadyRecord, angle: float, highest: int) -> tuple[ComplexArray, FloatArray]:
    """Return an air cut's lines turned by an angle and their variance, orders 0..highest; 0 where the record has no such order."""
    return turned(air.flange, air.variance, angle, highest)


def turned(lines: ComplexArray, noise: FloatArray, angle: float, highest: int) -> tuple[ComplexArray, FloatArray]:
    """Return lines (orders, ...) turned by an angle, and their variance, orders 0..highest; 0 where there is no such order."""
    rest = [(0, 0)] * (lines.ndim - 1)
    missing = max(highest + 1 - lines.shape[0], 0)
    amplitude = np.pad(lines, [(0, missing), *rest])[: highest + 1]
    variance = np.pad(noise, [(0, missing), *rest], mode="edge")[: highest + 1]
    phase = np.exp(1j * np.arange(highest + 1) * angle)
    return amplitude * phase.reshape(-1, *(1 for _ in rest)), variance


def _overlap_factor(segments: int) -> float:
    """Variance of a mean over half-overlapping Hann segments over what their scatter suggests; neighbours correlate by 1/6."""
    shared = (segments - 1) / segments / 6.0
    return (1.0 + 2.0 * shared) / (1.0 - 2.0 * shared / (segments - 1))


def h1(displacement: ComplexArray, force: ComplexArray) -> ComplexArray:
    """Return E[D F*] / E[F F*]: least error where the displacement is noisy; averages over the first axis."""
    return _mean(displacement, force) / _mean(force, force)


def h2(displacement: ComplexArray, force: ComplexArray) -> ComplexArray:
    """Return E[D D*] / E[F D*]: least error where the force is noisy."""
    return _mean(displacement, displacement) / _mean(force, displacement)


def hv(displacement: ComplexArray, force: ComplexArray) -> ComplexArray:
    """Return the geometric mean of H1 and H2, with H1's phase."""
    one = h1(displacement, force)
    return one / np.abs(one) * np.sqrt(np.abs(one) * np.abs(h2(displacement, force)))


def air_corrected(displacement: ComplexArray, force: ComplexArray, air: ComplexArray) -> ComplexArray:
    """Return (S_dd - S_aa) / (S_fd - S_fa) with S_fd = E[F D*] ([inprocess], eqs. 8 and 16).

    Spectra are subtracted, not lines: what the air cut shares with the cut is only taken out in the mean, which is
    exact where both are uncorrelated.
    """
    return (_mean(displacement, displacement) - _mean(air, air)) / (_mean(force, displacement) - _mean(force, air))


def coherence(displacement: ComplexArray, force: ComplexArray) -> FloatArray:
    """Return |E[D F*]|^2 / (E[D D*] E[F F*]), 0 to 1."""
    cross = np.abs(_mean(displacement, force)) ** 2
    return (cross / (_mean(displacement, displacement) * _mean(force, force))).real


def _mean(a: ComplexArray, b: ComplexArray) -> ComplexArray:
    return np.mean(a * np.conj(b), axis=0)
