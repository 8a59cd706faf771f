"""Covariances of the observer from what a user knows: the sensor's noise floor, the wanted bandwidth, how fast a cut may change."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, Protocol

import numpy as np

from rcsa_ident.base.arrays import FloatArray
from rcsa_ident.base.errors import InputError, positive
from rcsa_ident.observer.force_model import ForceModel, RandomWalk, TeethResonators
from rcsa_ident.observer.transfer_function import TransferFunction

#: Signal power over noise power at which a smoothed estimate keeps all but 0.1 dB of the force, s / (1 + s) = 10^(-0.1/20): what a
#: live one loses beside that is mostly delay.
MARGIN = 1.0 / (10.0**0.005 - 1.0)
#: Time in which an oscillator follows a change, in revolutions.
RESPONSE_TURNS = 0.5
#: The walk of [inprocess] does not forget; behind a high-pass it must, and this share of the band's lower end is nearly never.
BASELINE_LEAK = 0.1
#: Intensity of the walk beside oscillators over that of a walk that has to follow everything.
BESIDE = 0.1


@dataclass(frozen=True, slots=True)
class Tuning:
    """What the covariances are chosen from.

    `noise_floor` [m]: standard deviation of a displacement sample without any motion
    `bandwidth` [rad/s]: frequency up to which the estimate shall follow the force
    `response_time` [s]: time in which an oscillator's amplitude follows a change of the cut
    """

    noise_floor: float
    bandwidth: float
    response_time: float

    def __post_init__(self) -> None:
        positive("noise floor", self.noise_floor, "m")
        positive("bandwidth", self.bandwidth, "rad/s")
        positive("response time", self.response_time, "s")

    def random_walk(self, transfer: TransferFunction, leak: float | None = None) -> RandomWalk:
        """Return the walk whose displacement stands above the noise everywhere in the band up to the bandwidth.

        Parameters
        ----------
        transfer : TransferFunction
        leak : float [rad/s], optional
            Rate at which the walk forgets; by default nearly none, as in [inprocess].

        Notes
        -----
        A walk of intensity q has the spectrum q^2 / w^2, the displacement's noise r^2 dt. The smoothed estimate has the gain
        s / (s + 1) with s = |C31|^2 q^2 / (w^2 r^2 dt), and q is the least with which that is -0.1 dB or better.
        """
        low, high = transfer.band[0], min(self.bandwidth, transfer.band[1])
        if high <= low:
            found = f"{self.bandwidth / (2.0 * np.pi):.0f} Hz"
            raise InputError("bandwidth", found, f"above the lower end of the band, {low / (2.0 * np.pi):.0f} Hz")
        omega = np.linspace(low, high, 200)
        quiet = self._noise(transfer, omega)
        return RandomWalk(float(np.max(omega * quiet) * np.sqrt(MARGIN)), BASELINE_LEAK * low if leak is None else leak)

    def resonators(self, transfer: TransferFunction, omega: FloatArray) -> TeethResonators:
        """Return oscillators at the given frequencies beside a walk of the band's own memory.

        Parameters
        ----------
        transfer : TransferFunction
        omega : array, shape (j,) [rad/s]
            Those outside the band are left out.

        Notes
        -----
        The amplitude of an oscillator of intensity q is found within 1 / beta, beta = q / sqrt(2 (q_walk^2 / w^2 + r^2 dt / |C31|^2)):
        sensor noise and the walk are what it has to be told from.
        """
        low, high = transfer.band
        omega = np.asarray(omega, dtype=float)
        omega = omega[(omega >= low) & (omega <= min(high, max(self.bandwidth, low)))]
        if omega.size == 0:
            found = "none"
            raise InputError("harmonics in the band", found, f"some between {low / (2 * np.pi):.0f} and {high / (2 * np.pi):.0f} Hz")
        alone = self.random_walk(transfer, low)
        walk = RandomWalk(BESIDE * alone.intensity, low)
        beside = (walk.intensity / omega) ** 2 + self._noise(transfer, omega) ** 2
        return TeethResonators(walk, omega, np.sqrt(2.0 * beside) / self.response_time)

    def _noise(self, transfer: TransferFunction, omega: FloatArray) -> FloatArray:
        """Square root of the noise's spectrum, as a force [N sqrt(s)]."""
        return self.noise_floor * np.sqrt(transfer.step) / np.abs(transfer.response(omega))


def harmonics(spindle_speed: float, teeth: int, band: tuple[float, float], run_out: bool = True) -> FloatArray:
    """Return the frequencies of a steady cut's force in a band, shape (j,) [rad/s].

    `spindle_speed` [rad/s]
    `band`: two floats [rad/s]
    `run_out`: True where teeth are not alike: all multiples of the spindle's frequency, else those of the tooth-passing frequency
    """
    step = positive("spindle speed", spindle_speed, "rad/s") * (1 if run_out else teeth)
    return step * np.arange(np.ceil(band[0] / step - 1e-9), np.floor(band[1] / step + 1e-9) + 1.0)


class ObserverMethod(Protocol):
    """Which force model an observer has; an object that carries its settings."""

    def force_model(self, tuning: Tuning, transfer: TransferFunction, spindle_speed: float, teeth: int) -> ForceModel:
        """Return the force model of one axis.

        Parameters
        ----------
        tuning : Tuning
        transfer : TransferFunction
        spindle_speed : float [rad/s]
        teeth : int
        """
        ...

    @property
    def colours_noise(self) -> bool:
        """Whether the integrated acceleration's noise and the orders below the band are modelled."""
        ...

    @property
    def response_turns(self) -> float:
        """Revolutions in which it follows a change of the cut."""
        ...


@dataclass(frozen=True, slots=True)
class Resonators:
    """Oscillators at the harmonics of the teeth beside a random walk: no lag in a steady cut.

    `run_out`: also at the spindle's other orders, on which an eccentric cutter cuts
    `response_turns`: revolutions in which an oscillator follows a change of the cut
    """

    run_out: bool = True
    response_turns: float = RESPONSE_TURNS
    colours_noise: ClassVar[bool] = True

    def force_model(self, tuning: Tuning, transfer: TransferFunction, spindle_speed: float, teeth: int) -> TeethResonators:
        """Return the oscillators in the transfer function's band (see `ObserverMethod`)."""
        return tuning.resonators(transfer, harmonics(spindle_speed, teeth, transfer.band, self.run_out))


@dataclass(frozen=True, slots=True)
class PaperWalk:
    """The random walk and white measurement noise of [inprocess], eq. 17: lags by the machine's own delay."""

    colours_noise: ClassVar[bool] = False
    response_turns: ClassVar[float] = RESPONSE_TURNS

    def force_model(self, tuning: Tuning, transfer: TransferFunction, spindle_speed: float, teeth: int) -> RandomWalk:
        """Return the walk (see `ObserverMethod`)."""
        return tuning.random_walk(transfer)
