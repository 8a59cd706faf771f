"""A record of the virtual machine without end: what a revolution shows, in air and in the cut, repeated at any angle of the spindle.

A steady cut of the simulator is periodic in the spindle's angle, forces and vibrations alike. One revolution is the mean of many from a
record without noise, finely tabulated; a spindle whose speed wanders reads the tables at its angle. Noise is new at every sample. What is
left out: the vibration's own change with the speed's (a thousandth), and the transient of the tool's entry, in whose place air fades
into cut.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from benchmarks.observer import CASE, VirtualCut, virtual_cut
from rcsa_ident.signals.recording import Recording

#: Points of a table to a sample of the simulator.
FINE = 64


@dataclass(frozen=True, slots=True, eq=False)
class TurningCut:
    """Tables over a revolution.

    Parameters
    ----------
    made : VirtualCut
        Without noise, at exactly 12 000 rev/min.
    air, cut : arrays, shape (m, 4), (m, 6)
        Gap and acceleration of X and Y [m, m/s^2], of the cut also the forces of X and Y [N], from tooth 1 at angle 0.
    noise : two floats [m], [m/s^2]
    """

    made: VirtualCut
    air: np.ndarray
    cut: np.ndarray
    noise: tuple[float, float]

    @property
    def rate(self) -> float:
        """Of the samples [Hz]."""
        return self.made.cut.rate

    @property
    def speed(self) -> float:
        """Of the spindle, where it does not wander [rad/s]."""
        return CASE.spindle_speed

    def blocks(
        self, duration: float, entry: float, block: int, wander: float = 0.0, sag: float = 0.0, seed: int = 1
    ) -> Iterator[tuple[np.ndarray, np.ndarray]]:
        """Yield samples, shape (n, 4) [m, m/s^2], and true forces, shape (n, 2) [N].

        Parameters
        ----------
        duration : float [s]
        entry : float [s]
            When the tool enters; before that it turns in air. Within 20 ms all of it cuts.
        block : int
            Samples at once.
        wander, sag : float
            Share by which the speed goes up and down every five seconds, and by which it is lower from 0.1 s after the entry on.
        """
        rng = np.random.default_rng(seed)
        turn, step, done, count = rng.random(), 1.0 / self.rate, 0, round(duration * self.rate)
        once = self.speed * step / (2.0 * np.pi)
        while done < count:
            n = min(block, count - done)
            time = (done + np.arange(n)) * step
            speed = 1.0 + wander * np.sin(0.4 * np.pi * time) - sag * np.clip((time - entry) / 0.1, 0.0, 1.0)
            place = turn + np.cumsum(speed) * once
            cutting = np.clip((time - entry) / 0.02, 0.0, 1.0)[:, None]
            seen = _read(self.cut, place) * cutting
            if time[0] < entry + 0.02:
                seen[:, :4] += _read(self.air, place) * (1.0 - cutting)
            samples, force = seen[:, :4], seen[:, 4:]
            samples += rng.standard_normal(samples.shape) * np.repeat(self.noise, 2)
            yield samples, force
            turn, done = float(place[-1]) % 1.0, done + n

    def recording(self, samples: np.ndarray) -> Recording:
        """Return samples as a recording."""
        return replace(self.made.cut, samples=samples)


def turning_cut(rate: float = 51200.0, noise: tuple[float, float] = (2e-9, 0.05)) -> TurningCut:
    """Return the tables of the sample machine in the cut of [inprocess]; `rate` makes whole samples of a revolution's 5 ms."""
    made = virtual_cut(duration=0.3, rate=rate, speed_error=0.0, gap_noise=0.0, gap_drift=0.0, acceleration_noise=0.0)
    air = _table(made.air.samples, made.air_angle, rate)
    cut = _table(np.column_stack([made.cut.samples, made.force]), made.angle, rate)
    return TurningCut(made, air, cut, noise)


def _table(values: np.ndarray, angle: float, rate: float) -> np.ndarray:
    """One revolution from angle 0, the mean of the last whole ones, by its Fourier series."""
    turn = round(2.0 * np.pi * rate / CASE.spindle_speed)
    whole = values.shape[0] // turn // 2
    lines = np.fft.rfft(values[-whole * turn :].reshape(whole, turn, -1).mean(axis=0), axis=0)
    begin = angle + CASE.spindle_speed / rate * (values.shape[0] - whole * turn)
    lines = lines * np.exp(-1j * np.arange(lines.shape[0]) * begin)[:, None]
    return np.fft.irfft(lines[:-1], turn * FINE, axis=0) * FINE


def _read(table: np.ndarray, turn: np.ndarray) -> np.ndarray:
    place = np.mod(turn, 1.0) * table.shape[0]
    lower = place.astype(int)
    share = (place - lower)[:, None]
    return table[lower % table.shape[0]] * (1.0 - share) + table[(lower + 1) % table.shape[0]] * share
