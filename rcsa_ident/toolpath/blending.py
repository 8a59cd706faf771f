"""What a controller makes of the places that it is sent to: corners are blended, or followed late."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
import scipy.ndimage
import scipy.signal

from rcsa_ident.base.arrays import FloatArray
from rcsa_ident.base.errors import positive


class Controller(Protocol):
    """How drives follow what they are sent."""

    @property
    def delay(self) -> float:
        """By how much they are late on a straight move [s]."""

    @property
    def lead(self) -> float:
        """How long before a move they begin, and behind it end, to see it [s]."""

    def follow(self, sent: FloatArray, step: float) -> FloatArray:
        """Return where drives are held, shape (t, j), that are sent to `sent` every `step` [s] and stood there before."""


@dataclass(frozen=True, slots=True)
class QuadraticBlend:
    """Straight moves at constant speed with parabolas between them: the mean of what is sent over a window of time.

    A corner between the velocities v and w is passed at a distance of |w - v| seconds / 8, without delay.

    `seconds` [s]: width of the window: how long it turns from one move into the next

    Examples
    --------
    Around a right angle at 50 mm/s so that 1.6 mm are left out:

    >>> blend = QuadraticBlend.leaving(1.6e-3, np.hypot(0.05, 0.05))
    >>> round(blend.seconds, 3)
    0.181
    >>> sent = np.array([[0.0], [0.0], [0.0], [0.0], [1.0], [2.0], [3.0], [4.0], [5.0]])
    >>> QuadraticBlend(4.0).follow(sent, 1.0)[:, 0].tolist()
    [0.0, 0.0, 0.125, 0.5, 1.125, 2.0, 3.0, 3.875, 4.5]
    """

    seconds: float

    def __post_init__(self) -> None:
        positive("blend", self.seconds, "s")

    @classmethod
    def leaving(cls, corner: float, turned: float) -> QuadraticBlend:
        """Return the blend that passes a corner at a distance [m] where the velocity turns by so much [m/s]."""
        return cls(8.0 * positive("corner", corner, "m") / positive("change of velocity", turned, "m/s"))

    @property
    def delay(self) -> float:
        """None."""
        return 0.0

    @property
    def lead(self) -> float:
        """Half the window."""
        return 0.5 * self.seconds

    def follow(self, sent: FloatArray, step: float) -> FloatArray:
        """Return the mean over the window, what is sent taken for straight between the instants."""
        width = max(round(self.seconds / step), 1)
        # between instants the mean of a straight line is that of its ends
        weights = np.full(width + 1, 1.0 / width)
        weights[[0, -1]] *= 0.5
        if width % 2:  # a window that ends between two instants, to both sides alike
            weights = 0.5 * (np.append(weights, 0.0) + np.append(0.0, weights))
        return scipy.ndimage.correlate1d(np.asarray(sent, dtype=float), weights, axis=0, mode="nearest")


@dataclass(frozen=True, slots=True)
class FirstOrderLag:
    """Drives that close in on what is sent at a rate of 1/T of what is missing.

    A right angle at the speed v is passed at a distance of 0.509 v T.

    `seconds` [s]: T

    Examples
    --------
    A ramp is followed late by T, once it has begun:

    >>> ramp = np.maximum(np.arange(200.0)[:, None] - 10.0, 0.0)
    >>> float((ramp - FirstOrderLag(5.0).follow(ramp, 1.0))[-1, 0].round(9))
    5.0
    """

    seconds: float

    def __post_init__(self) -> None:
        positive("lag", self.seconds, "s")

    @property
    def delay(self) -> float:
        """T."""
        return self.seconds

    @property
    def lead(self) -> float:
        """Until a thousandth of a step is left."""
        return 7.0 * self.seconds

    def follow(self, sent: FloatArray, step: float) -> FloatArray:
        """Return the exact answer to what is sent, taken for straight between the instants."""
        values = np.asarray(sent, dtype=float)
        ratio = step / self.seconds
        kept = np.exp(-ratio)
        # y' = (u - y) / T with u straight: y1 = kept y0 + before u0 + now u1
        now = 1.0 + np.expm1(-ratio) / ratio
        before = 1.0 - kept - now
        state = (values[0] - now * values[0])[None]
        return np.asarray(scipy.signal.lfilter([now, before], [1.0, -kept], values, axis=0, zi=state)[0])
