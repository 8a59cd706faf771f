"""The observer seen from the force: its frequency response, the compensated one, usable band and delay."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rcsa_ident.base.arrays import ComplexArray, FloatArray, frozen
from rcsa_ident.observer.force import ForceObserver

#: Deviation of the compensated response [dB] that a usable band allows.
FLAT = 1.0
#: Samples that stand for the whole future of a smoother's response.
_FAR = 2048


@dataclass(frozen=True, slots=True, eq=False)
class ObserverFRF:
    """Frequency response of one axis' observer in the steady state.

    `omega` [rad/s], shape (n,)
    `observer` [N/m], shape (n,): measured displacement to force
    `compensated` [-], shape (n,): the observer's response times the machine's from tip force to displacement: 1 where the observer is right
    `line` [rad/s], shape (j,): frequencies at which the force of a steady cut has its lines
    `at_line` [-], shape (j,): the compensated response there
    """

    omega: FloatArray
    observer: ComplexArray
    compensated: ComplexArray
    line: FloatArray
    at_line: ComplexArray

    @property
    def level(self) -> FloatArray:
        """Magnitude of the compensated response, shape (n,) [dB]."""
        return decibel(self.compensated)

    def flatness(self, band: tuple[float, float]) -> float:
        """Return the largest deviation from 0 dB in a band [dB]."""
        inside = (self.omega >= band[0]) & (self.omega <= band[1])
        return float(np.max(np.abs(self.level[inside]))) if inside.any() else np.nan

    def usable(self, start: float, at_lines: bool = False, within: float = FLAT) -> tuple[float, float]:
        """Return the band around or above `start` in which the compensated magnitude stays flat [rad/s]; NaN where there is none.

        `start` [rad/s]
        `at_lines`: look only where a steady cut has force: an oscillator is right at its own frequency
        `within` [dB]: deviation that is allowed
        """
        omega, level = (self.line, decibel(self.at_line)) if at_lines else (self.omega, self.level)
        good, above = np.abs(level) <= within, np.flatnonzero(omega >= start * (1.0 - 1e-9))
        if above.size == 0 or not good[above[0]]:
            return np.nan, np.nan
        first = last = int(above[0])
        while first > 0 and good[first - 1]:
            first -= 1
        while last + 1 < omega.size and good[last + 1]:
            last += 1
        return float(omega[first]), float(omega[last])

    def delay(self, band: tuple[float, float]) -> float:
        """Return by how much the estimate lags the force: minus the phase's mean slope over a band [s]."""
        inside = (self.omega >= band[0]) & (self.omega <= band[1])
        phase = np.unwrap(np.angle(self.compensated[inside]))
        return float(-np.polyfit(self.omega[inside], phase, 1)[0])

    @property
    def delay_at_lines(self) -> float:
        """The same from the phases at the lines, which is all that a steady cut feels [s]."""
        return float(-np.sum(np.unwrap(np.angle(self.at_line)) * self.line) / np.sum(self.line**2))


def decibel(values: ComplexArray) -> FloatArray:
    """Return 20 log10 |values|."""
    return 20.0 * np.log10(np.maximum(np.abs(values), 1e-300))


def observer_response(
    observer: ForceObserver,
    omega: FloatArray,
    machine: ComplexArray,
    line: FloatArray,
    machine_at_line: ComplexArray,
    smoothed: bool = False,
) -> tuple[ObserverFRF, ...]:
    """Return the observer's frequency responses and their products with the machine's, an axis each.

    Each is the estimate of a force over that force, the others being none: what the observer takes of one for another is not in it.

    `omega` [rad/s], shape (n,)
    `machine` [m/N], shape (n, a, a): response from tip forces (columns) to the flange's displacements as the sensors show them: the true
        one where it is known, else the identified
    `line`, `machine_at_line`: arrays, shape (j,) [rad/s], (j, a, a) [m/N]; frequencies of the force's lines, and the machine's response
        there
    `smoothed`: the estimate given all samples, instead of those before
    """
    omega, line = np.asarray(omega, dtype=float), np.asarray(line, dtype=float)
    passed = [np.stack([each.gap_filter.response(w) for each in observer.axes], axis=1) for w in (omega, line)]
    responses: list[ObserverFRF] = []
    for kalman, group in zip(observer.filters, observer.groups, strict=True):
        own, own_line = (
            kalman.response(w, _FAR if smoothed else 0)[0] * through[:, None, group]
            for w, through in zip((omega, line), passed, strict=True)
        )
        there, there_line = own @ machine[:, group, group], own_line @ machine_at_line[:, group, group]
        responses += (
            ObserverFRF(frozen(omega), own[:, i, i], there[:, i, i], frozen(line), there_line[:, i, i]) for i in range(kalman.count)
        )
    return tuple(responses)
