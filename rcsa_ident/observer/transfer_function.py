"""Tip force to measured flange displacement as a sampled filter: the identified cross FRF, the sensors, the high-pass."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from rcsa_ident.base.arrays import ComplexArray, FloatArray, frozen
from rcsa_ident.base.errors import InputError, positive
from rcsa_ident.dynamics.poles import PoleResidue
from rcsa_ident.dynamics.rational import RationalFit, rational_fit
from rcsa_ident.dynamics.state_space import StateSpace
from rcsa_ident.observer._kernels import modal_filter

#: Relative rms misfit that the transfer function may have in its band.
TOLERANCE = 2e-3
#: How much less the response counts outside the band.
OUTSIDE = 0.05
#: The high-pass's corner as a share of the band's lower end.
CORNER = 0.25
#: Highest frequency of a fit as a share of the sampling rate.
HIGHEST = 0.45


@dataclass(frozen=True, slots=True, eq=False)
class SampledModes:
    """A stable filter y[k] = through u[k] + sum 2 Re(gain x[k]), x[k+1] = decay x[k] + u[k].

    `decay` [-], shape (m,): poles in the z-plane, one of each conjugate pair
    `gain`, shape (m,): output per state
    `through`: output per input at the same sample
    `step` [s]: time between samples
    """

    decay: ComplexArray
    gain: ComplexArray
    through: float
    step: float

    def __post_init__(self) -> None:
        for name in ("decay", "gain"):
            object.__setattr__(self, name, frozen(getattr(self, name), np.complex128))

    def response(self, omega: FloatArray) -> ComplexArray:
        """Return the frequency response, shape (n,)."""
        z = np.exp(1j * np.asarray(omega, dtype=float) * self.step)[:, None]
        pairs = self.gain / (z - self.decay) + self.gain.conj() / (z - self.decay.conj())
        return np.sum(pairs, axis=1) + self.through

    def pole_residue(self) -> PoleResidue:
        """Return the filter as poles in the z-plane and their residues."""
        return PoleResidue(self.decay, self.gain[None], np.ones((self.decay.size, 1)), np.array([[self.through]]))

    def state_space(self) -> StateSpace:
        """Return the filter as a real state space in modal form."""
        return replace(self.pole_residue().state_space(), step=self.step)

    def init(self) -> FloatArray:
        """Return the state of a filter at rest, shape (2, m)."""
        return np.zeros((2, self.decay.size))

    def run(self, state: FloatArray, signal: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the state after a block of samples and the block's output, shape (n,)."""
        state = np.array(state)
        decay, gain = (np.stack([each.real, each.imag]) for each in (self.decay, self.gain))
        return state, modal_filter(decay, gain, self.through, np.ascontiguousarray(signal, dtype=float), state)


@dataclass(frozen=True, slots=True, eq=False)
class TransferFunction:
    """Rational function of the bilinear frequency 2 / step tan(omega step / 2), stable and strictly proper ([inprocess], eq. 18).

    Parameters
    ----------
    fit : RationalFit
        Flange displacement as the sensor shows it per tip force [m/N].
    step : float [s]
    band : two floats [rad/s]
        Frequencies between which the fit was asked to be good.
    flatness : float [dB]
        Largest deviation of its magnitude from the response that was given, in the band.

    Notes
    -----
    A fit on the frequency axis that the bilinear transform bends makes the sampled filter's response that of the machine at
    every frequency, while a hold between samples droops: a first-order one by 9 % at a sixth of the sampling rate.
    """

    fit: RationalFit
    step: float
    band: tuple[float, float]
    flatness: float

    @property
    def order(self) -> int:
        """Degree n of the denominator ([inprocess], eq. 18)."""
        return self.fit.order

    def response(self, omega: FloatArray) -> ComplexArray:
        """Return displacement per force, shape (n,) [m/N]."""
        return self.fit.response(warped(omega, self.step))[:, 0, 0]

    def behind_high_pass(self, corner: float) -> SampledModes:
        """Return the sampled filter from force to high-passed displacement. `corner` [rad/s]: corner frequency of `high_pass`."""
        poles, rho = high_pass_pole(corner, self.step)
        pole, residue = self.fit.pole, self.fit.residue[:, 0, 0]
        passed = residue * pole**2 / ((pole - poles) * (pole - poles.conjugate()))
        there = np.sum(residue / (poles - pole) + residue.conj() / (poles - pole.conj()))
        return _bilinear(np.append(pole, poles), np.append(passed, there * rho), 0.0, self.step)


def warped(omega: FloatArray, step: float) -> FloatArray:
    """Return the bilinear transform's frequency [rad/s]."""
    return np.tan(0.5 * step * np.asarray(omega, dtype=float)) * (2.0 / step)


def transfer_function(
    omega: FloatArray,
    receptance: ComplexArray,
    step: float,
    band: tuple[float, float],
    sensor: ComplexArray | None = None,
    order: int | None = None,
    tolerance: float = TOLERANCE,
) -> TransferFunction:
    """Return the transfer function of one axis.

    `omega` [rad/s], shape (n,): frequencies that reach beyond the band on both sides, so that nothing odd happens there
    `receptance` [m/N], shape (n,): C31: absolute motion of the flange per force at the tip
    `step` [s]: time between samples
    `band`: two floats [rad/s], frequencies between which the fit has to be good
    `sensor`, shape (n,): frequency response of the displacement sensor: bandwidth and delay
    `order`: number of poles; by default the smallest that is good to the tolerance
    `tolerance`: relative rms misfit; outside the band it counts a twentieth
    Raises `InputError` if the band lies outside the frequencies or above what the sampling rate can hold.
    """
    omega, low, high = np.asarray(omega, dtype=float), *band
    keep, inside = fitted_range(omega, step, band)
    values = np.asarray(receptance, dtype=complex) * (1.0 if sensor is None else sensor)
    weight = np.where(inside, 1.0, OUTSIDE)
    fit = rational_fit(
        warped(omega[keep], step), values[keep], order=order, tolerance=tolerance, weight=weight[keep], constant=False, highest_order=40
    )
    ratio = fit.response(warped(omega[inside], step))[:, 0, 0] / values[inside]
    return TransferFunction(fit, step, (low, high), float(np.max(np.abs(20.0 * np.log10(np.abs(ratio))))))


def fitted_range(omega: FloatArray, step: float, band: tuple[float, float]) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Return which frequencies [rad/s] a fit looks at, and which of them have to be good, shape (n,) each.

    Raises `InputError` if the band lies outside the frequencies or above what the sampling rate can hold.
    """
    low, high = band
    keep = omega <= HIGHEST * 2.0 * np.pi / step
    inside = keep & (omega >= low) & (omega <= high)
    if not low < high or np.sum(inside) < 8:
        found = f"{low / (2 * np.pi):.0f} to {high / (2 * np.pi):.0f} Hz at {1.0 / step:.0f} samples a second"
        raise InputError("band", found, "a band that holds frequencies of the receptance below 0.45 of the sampling rate")
    return keep, inside


def high_pass(corner: float, step: float) -> SampledModes:
    """Return a second-order Butterworth high-pass: what gap and fixture pass before they are added.

    Below its corner the sum is not known: the accelerometer does not see it, and the gap sensor drifts.
    """
    pole, rho = high_pass_pole(corner, step)
    return _bilinear(np.array([pole]), np.array([rho]), 1.0, step)


def acceleration_filter(
    corner: float, step: float, band: tuple[float, float], ratio: ComplexArray | None = None, omega: FloatArray | None = None
) -> SampledModes:
    """Return the filter from the fixture's acceleration to its high-passed displacement: `high_pass` over -omega^2.

    `corner` [rad/s]: corner frequency of the high-pass
    `step` [s]: time between samples
    `band`: two floats [rad/s], frequencies between which the filter has to be good
    `ratio`, shape (n,): response of the displacement sensor over that of the accelerometer at `omega`, so that both arrive alike
    `omega` [rad/s], shape (n,): frequencies of the fit; by default 400 from half the corner to a fifth above the band
    """
    positive("corner", corner, "rad/s")
    if omega is None:
        omega = np.linspace(0.5 * corner, min(1.2 * band[1], HIGHEST * 2.0 * np.pi / step), 400)
    target = high_pass(corner, step).response(omega) / -(np.asarray(omega) ** 2) * (1.0 if ratio is None else ratio)
    weight = np.where((omega >= band[0]) & (omega <= band[1]), 1.0, OUTSIDE)
    fit = rational_fit(warped(omega, step), target, tolerance=3e-4, weight=weight, highest_order=12)
    return _bilinear(fit.pole, fit.residue[:, 0, 0], float(fit.constant[0, 0]), step)


def high_pass_pole(corner: float, step: float) -> tuple[complex, complex]:
    """Upper pole of s^2 / (s^2 + sqrt(2) c s + c^2) and its residue; c is the warped corner."""
    c = float(warped(np.array(corner), step))
    pole = c * complex(-1.0, 1.0) / np.sqrt(2.0)
    return pole, pole**2 / (pole - pole.conjugate())


def _bilinear(pole: ComplexArray, residue: ComplexArray, constant: float, step: float) -> SampledModes:
    """Sum residue / (s - pole) with s = 2 / step (z - 1) / (z + 1)."""
    half = 0.5 * step
    decay = (1.0 + half * pole) / (1.0 - half * pole)
    gain = half * residue / (1.0 - half * pole)
    return SampledModes(decay, gain * (1.0 + decay), constant + 2.0 * float(np.sum(gain.real)), step)
