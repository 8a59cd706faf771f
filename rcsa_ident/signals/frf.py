"""Lines of the cross FRF, tip force to flange displacement, and their estimators: H1, H2 and coherence are those of [bendat2010]."""

from __future__ import annotations

from dataclasses import dataclass, field, fields, replace
from typing import Protocol

import numpy as np

from rcsa_ident.base.arrays import ComplexArray, FloatArray
from rcsa_ident.dynamics.coordinates import Dof
from rcsa_ident.signals.motion import FLANGE_ALONE, ONE_PLACE, searched, usual_shares
from rcsa_ident.signals.steady import SteadyRecord


@dataclass(frozen=True, slots=True, eq=False)
class AxisLines:
    """Lines of one axis at the tooth-passing harmonics of one cut.

    `order`: array of int, shape (n,); multiples of the spindle frequency
    `omega` [rad/s], shape (n,)
    `cut`, `air` [m/N], shape (n, o): displacement over the simulated force with tooth 1 at immersion 0 at the record's start; the air cut's
        line is turned by the best estimate of the angle between both records. Outputs are gap and fixture, whose sum is the flange's
        absolute motion, or that alone, where `shares` does not tell otherwise.
    `variance` [m^2/N^2], shape (n, o): of the real and of the imaginary part of cut - air each
    `coherence` [-], shape (n,): of the flange's motion
    `force` [N], shape (n,)
    `force_slope` [-], shape (n, 5): change of the force's logarithm with `cutting.force.SLOPES`
    `across`, `across_slope`: complex arrays of the same shapes, or None; the force along the other machine axis in the same lines, with
        tooth 1 at immersion 0, too; None where it is not told
    `shares`: array, shape (o, 1 + e) or (0, 0) [-]; what of the flange's motion, and of that of other places of the machine, is in each
        output (`motion.shares_of`)
    """

    order: np.ndarray
    omega: FloatArray
    cut: ComplexArray
    air: ComplexArray
    variance: FloatArray
    coherence: FloatArray
    force: ComplexArray
    force_slope: ComplexArray
    across: ComplexArray | None = None
    across_slope: ComplexArray | None = None
    shares: FloatArray = field(default_factory=lambda: np.zeros((0, 0)))

    @property
    def outputs(self) -> int:
        """Number of outputs of each line."""
        return self.cut.shape[1]

    @property
    def output_shares(self) -> FloatArray:
        """What of the flange's motion and of that of other places is in each output, shape (o, 1 + e) [-]."""
        return self.shares if self.shares.size else usual_shares(self.outputs)

    @property
    def of_flange(self) -> bool:
        """Whether the flange's motion was measured, and not that of other places alone."""
        return bool(self.output_shares[0, 0])

    @property
    def receptance(self) -> ComplexArray:
        """Flange displacement per tip force, or the first other place's where nothing sees the flange, up to the cut's delay, shape (n,):
        true value times e^{-i omega delay}."""
        return np.sum((self.cut - self.air)[:, searched(self.output_shares)], axis=1)

    def first(self) -> AxisLines:
        """Return the lines with those outputs alone that are the flange's motion together, or the first one: without further places."""
        own = searched(self.output_shares)
        shares = usual_shares(own.stop) if self.of_flange else ONE_PLACE
        return replace(self, cut=self.cut[:, own], air=self.air[:, own], variance=self.variance[:, own], shares=shares)

    def summed(self) -> AxisLines:
        """Return the lines with the flange's motion as the only output, or that of the first place where nothing sees the flange."""
        first = self.first()
        cut, air, variance = (np.sum(each, axis=1, keepdims=True) for each in (first.cut, first.air, first.variance))
        return replace(first, cut=cut, air=air, variance=variance, shares=FLANGE_ALONE if self.of_flange else ONE_PLACE)

    def of(self, keep: np.ndarray) -> AxisLines:
        """Return some of the lines: a mask or indices, shape (n,)."""
        every = ((each.name, getattr(self, each.name)) for each in fields(self) if each.name != "shares")
        return replace(self, **{name: value[keep] for name, value in every if value is not None})


class Estimator(Protocol):
    """How lines of the cross FRF come out of a cut and its air cut: an object that carries its settings."""

    def lines(
        self,
        cut: SteadyRecord,
        air: SteadyRecord | None,
        angle: float,
        order: np.ndarray,
        force: ComplexArray,
        force_slope: ComplexArray,
    ) -> dict[Dof, AxisLines]:
        """Return the lines of each axis of the cut at the given orders.

        Parameters
        ----------
        cut : SteadyRecord
        air : SteadyRecord or None
            The air cut, where there is one.
        angle : float [rad]
            Angle by which the air cut must be turned to lie under the cut.
        order : array of int, shape (n,)
        force : complex array, shape (n, axes) [N]
            Without zeros.
        force_slope : complex array, shape (n, axes, 5) [-]
        """
        ...


@dataclass(frozen=True, slots=True)
class LineEstimator:
    """Least-squares lines over the whole record, the air cut's subtracted as complex numbers."""

    def lines(
        self,
        cut: SteadyRecord,
        air: SteadyRecord | None,
        angle: float,
        order: np.ndarray,
        force: ComplexArray,
        force_slope: ComplexArray,
    ) -> dict[Dof, AxisLines]:
        """Return the lines; the variance is that of cut and air cut, from the noise beside them and their scatter."""
        moved, noise = cut.outputs[order], cut.output_variance[order]
        still = np.zeros_like(moved)
        if air is not None:
            still, still_noise = turned(air.outputs, air.output_variance, angle, int(order[-1]))
            still, noise = still[order], noise + still_noise[order]
        found = {}
        for i, axis in enumerate(cut.axes):
            own, size = cut.channels.outputs(axis), force[:, i, None]
            lines = moved[:, own] / size, still[:, own] / size, noise[:, own] / np.abs(size) ** 2
            omega, certain = order * cut.spindle_speed, np.ones(order.size)
            each = AxisLines(order, omega, *lines, certain, force[:, i], force_slope[:, i], shares=cut.channels.shares(axis))
            # the noise is in the power, too
            one = each.summed()
            power = np.maximum(np.abs(each.receptance) ** 2, 1e-300)
            found[axis] = replace(each, coherence=np.clip(1.0 - 2.0 * one.variance[:, 0] / power, 0.0, 1.0))
        return found


@dataclass(frozen=True, slots=True)
class AirCorrectedSpectra:
    """Spectra averaged over segments [welch1967], those of the air cut subtracted ([inprocess], eqs. 8 and 16).

    What cut and air cut share at an order goes only as far as it is uncorrelated with what the force does there; at the
    few harmonics where the flange's roundness reaches them this leaves a bias that `LineEstimator` does not have.

    `segments`: half-overlapping Hann segments of each record
    """

    segments: int = 8

    def lines(
        self,
        cut: SteadyRecord,
        air: SteadyRecord | None,
        angle: float,
        order: np.ndarray,
        force: ComplexArray,
        force_slope: ComplexArray,
    ) -> dict[Dof, AxisLines]:
        """Return the lines, nothing left to subtract; the variance is the jackknife's over the segments."""
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
        found = {}
        for i, axis in enumerate(cut.axes):
            value, omega = values[:, i, None], order * cut.spindle_speed
            nothing, spread = np.zeros_like(value), variance[:, i, None]
            found[axis] = AxisLines(order, omega, value, nothing, spread, shared[:, i], force[:, i], force_slope[:, i])
        return found


def turned_air(air: SteadyRecord, angle: float, highest: int) -> tuple[ComplexArray, FloatArray]:
    """Return an air cut's lines turned by an angle and their variance, orders 0..highest; 0 where there is no such order.

    `angle` [rad]
    `highest`: highest order that is returned
    """
    return turned(air.flange, air.variance, angle, highest)


def turned(lines: ComplexArray, noise: FloatArray, angle: float, highest: int) -> tuple[ComplexArray, FloatArray]:
    """Return lines turned by an angle, and their variance, orders 0..highest; 0 where there is no such order.

    `lines`, shape (orders, ...)
    `noise`: array of the same shape, their variance
    `angle` [rad]
    """
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

    `displacement`, `force`, `air`: complex arrays, shape (segments, ...) [m], [N], [m]; spectra of the segments of a cut, of its force and
        of its air cut
    """
    return (_mean(displacement, displacement) - _mean(air, air)) / (_mean(force, displacement) - _mean(force, air))


def coherence(displacement: ComplexArray, force: ComplexArray) -> FloatArray:
    """Return |E[D F*]|^2 / (E[D D*] E[F F*]), 0 to 1."""
    cross = np.abs(_mean(displacement, force)) ** 2
    return (cross / (_mean(displacement, displacement) * _mean(force, force))).real


def _mean(a: ComplexArray, b: ComplexArray) -> ComplexArray:
    return np.mean(a * np.conj(b), axis=0)
