"""Hammer hits as they were recorded to a receptance: which channel is the hammer, and what its response measures."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from rcsa_ident.arrays import FloatArray
from rcsa_ident.errors import InputError

#: How many times as long as the hammer's pulses the other channels go on.
_LONGER = 3.0


def hammer_channel(channels: Sequence[FloatArray]) -> int:
    """Return which channel is the hammer's: a force comes in pulses, a response rings.

    Parameters
    ----------
    channels : sequence of array, shape (n,)

    Raises
    ------
    InputError
        None is, or several are.
    """
    lasts = np.array([_duration(channel) for channel in channels])
    order = np.argsort(lasts)
    if lasts.size < 2 or lasts[order[1]] < _LONGER * lasts[order[0]]:
        raise InputError("force", f"{lasts.size} channels of one kind", "the name of the hammer's channel: its signal does not tell it")
    return int(order[0])


def _duration(channel: FloatArray) -> float:
    """Number of samples over which a signal's power is spread."""
    power = (channel - np.median(channel)) ** 2
    return float(np.sum(power) ** 2 / (np.sum(power**2) + 1e-300))
