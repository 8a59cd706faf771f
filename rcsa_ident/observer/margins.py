"""How far an observer's correction loop is from ringing by itself: the stability margins of its innovation loop."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from rcsa_ident.base.arrays import FloatArray
from rcsa_ident.base.errors import InputError
from rcsa_ident.dynamics.state_space import StateSpace
from rcsa_ident.observer.kalman import KalmanFilter

#: Frequencies evenly over the band up to half the sampling rate, evenly over its decades, and beside each weakly damped pole.
_EVEN, _DECADES, _BESIDE = 300, 300, 12


@dataclass(frozen=True, slots=True)
class ObserverMargins:
    """Margins of a loop L whose sensitivity is S = 1 / (1 + L).

    `gain_decrease`, `gain_increase` [-]: factors on the gain, below and above 1, at which the error no longer dies out: 0 and infinite
        where there is none
    `phase` [rad]: further lag (or lead) round the loop that it stands; infinite where |L| never is 1
    `delay` [s]: by which the corrections may come late
    `sensitivity_peak` [-]: M_s = max |S|: the most by which an innovation exceeds the displacement that the model did not foresee. 1 / M_s
        is the least distance of L from -1.
    `peak_frequency` [rad/s]: where it is
    `disk` [-]: disk margin, 1 / max |S - 1/2|, up to 2: gain and phase may change at once, by any factor in the disk that has (2 - disk) /
        (2 + disk) and its inverse as ends of a diameter
    """

    gain_decrease: float
    gain_increase: float
    phase: float
    delay: float
    sensitivity_peak: float
    peak_frequency: float
    disk: float


def observer_margins(kalman: KalmanFilter) -> ObserverMargins:
    """Return the margins of a Kalman filter's innovation loop in the steady state, by python-control.

    The observer predicts the displacement from its past corrections and corrects by what is left: a loop with
    L(z) = H (z I - A)^-1 A K. The machine does not stand in it: margins tell how the model and the force model together answer to
    what they do not foresee, and what a gain that was changed by hand, or a computer that answers late, may do. The steady Riccati
    equation promises M_s <= sqrt(variance of the innovation) / noise.
    """
    return loop_margins(kalman.loop())


def loop_margins(loop: StateSpace) -> ObserverMargins:
    """Return the margins of a sampled loop of one input and one output, closed with a minus sign.

    Raises `InputError` if there are more of them, or the closed loop is not stable.
    """
    import control

    if loop.D.size != 1:
        raise InputError("loop", f"{loop.D.shape[0]} measurements that feel each other", "the loop of one axis")
    closed = np.abs(np.linalg.eigvals(loop.A - loop.B @ np.linalg.solve(1.0 + loop.D, loop.C)))
    if not np.all(closed < 1.0):
        raise InputError("loop", f"a pole of magnitude {closed.max():.6g} when closed", "a loop that is stable when closed")
    omega = _frequencies(loop)
    # from the response itself: polynomials of this order lose every digit
    response: Any = control.frd(loop.response(omega)[:, 0, 0], omega, smooth=True)
    gains, phases, distances, _, crossovers, nearest = control.stability_margins(response, returnall=True)
    # at half the sampling rate the response is real, and no crossing is seen
    end = float(loop.response(omega[-1:])[0, 0, 0].real)
    gains = np.append(gains, -1.0 / end if end < 0.0 else np.inf)
    distances, nearest = np.append(distances, abs(1.0 + end)), np.append(nearest, omega[-1])
    phases, best = np.radians(phases), int(np.argmin(distances))
    return ObserverMargins(
        gain_decrease=float(np.max(gains[gains < 1.0], initial=0.0)),
        gain_increase=float(np.min(gains[gains > 1.0], initial=np.inf)),
        phase=float(np.min(np.abs(phases), initial=np.inf)),
        delay=float(np.min(np.mod(phases, 2.0 * np.pi) / crossovers, initial=np.inf)),
        sensitivity_peak=float(1.0 / distances[best]),
        peak_frequency=float(nearest[best]),
        disk=float(control.disk_margins(loop.to_control(), omega)[0]),
    )


def _frequencies(loop: StateSpace) -> FloatArray:
    """Up to half the sampling rate, dense where the loop's gain changes quickly, but not on a pole."""
    top = np.pi / loop.step
    poles = np.log(loop.pole[loop.pole.imag > 0.0]) / loop.step
    beside = np.geomspace(1e-4, 0.3, _BESIDE)
    near = poles.imag[:, None] + np.abs(poles)[:, None] * np.concatenate([-beside, beside])
    omega = np.concatenate([np.linspace(0.0, top, _EVEN + 1)[1:], np.geomspace(1e-4 * top, top, _DECADES), near.ravel()])
    omega = np.unique(omega[(omega > 0.0) & (omega <= top)])
    apart = np.min(np.abs(omega[:, None] - poles.imag), axis=1, initial=np.inf)
    return omega[apart > 1e-5 * omega]
