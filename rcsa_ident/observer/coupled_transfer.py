"""A machine whose axes feel each other, as the observer sees it: C31 as a matrix."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from rcsa_ident.base.arrays import ComplexArray, FloatArray, frozen
from rcsa_ident.dynamics.poles import PoleResidue
from rcsa_ident.dynamics.rational import RationalFit, rational_fit
from rcsa_ident.observer.transfer_function import (
    OUTSIDE,
    TOLERANCE,
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

    `fit`: rows are displacements, columns forces [m/N]; left and right shapes differ, as gyroscopic moments want
    `step` [s]
    `band`: two floats [rad/s], frequencies between which the fit was asked to be good
    `flatness` [dB], shape (c,): largest deviation of each direct entry's magnitude from the response that was given, in the band
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

        `corner` [rad/s]: corner frequency of `high_pass`
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

    `omega` [rad/s], shape (n,): frequencies that reach beyond the band on both sides
    `receptance` [m/N], shape (n, c, c): C31: absolute motion of the flange (rows) per force at the tip (columns)
    `step` [s]: time between samples
    `band`: two floats [rad/s], frequencies between which the fit has to be good
    `sensor`, shape (n, c): frequency responses of the displacement sensors
    `tolerance`: rms misfit over the direct entries; a cross entry's misfit, too, counts over the largest entry of its row
    Raises `InputError` if the band lies outside the frequencies or above what the sampling rate can hold.
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
