"""Units of the edges: inside everything is SI; files, commands and bodies speak of rev/min, hertz and cm³/min.

Powers of ten (mm, µm, MPa) are written in line beside the name that carries the unit; degrees are `math.degrees` and `math.radians`.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, TypeVar

if TYPE_CHECKING:  # commands start without numpy
    from typing import Any

    from numpy.typing import NDArray

Number = TypeVar("Number", float, "NDArray[Any]")

_RPM = 30.0 / math.pi
_RAD_PER_S = math.pi / 30.0
_TURN = 2.0 * math.pi


def to_rpm(speed: Number, digits: int | None = None) -> Number:
    """Return a speed [rad/s] in rev/min, rounded to `digits` decimals if given: the way to rad/s and back costs the last bit.

    >>> to_rpm(from_rpm(5500.0)), to_rpm(from_rpm(5500.0), 6)
    (5500.000000000001, 5500.0)
    """
    rpm = speed * _RPM
    if digits is None:
        return rpm
    return round(rpm, digits) if isinstance(rpm, float) else rpm.round(digits)


def from_rpm(speed: Number) -> Number:
    """Return a speed [rev/min] in rad/s.

    >>> from_rpm(60.0) == 2.0 * math.pi
    True
    """
    return speed * _RAD_PER_S


def to_hz(omega: Number) -> Number:
    """Return an angular frequency [rad/s] in hertz.

    >>> import numpy as np
    >>> to_hz(2.0 * np.pi * np.array([1.0, 50.0]))
    array([ 1., 50.])
    """
    return omega / _TURN


def from_hz(frequency: Number) -> Number:
    """Return a frequency [Hz] in rad/s.

    >>> round(from_hz(50.0), 6)
    314.159265
    """
    return _TURN * frequency


def to_cm3_per_min(rate: Number) -> Number:
    """Return a material removal rate [m³/s] in cm³/min.

    >>> to_cm3_per_min(1e-6)
    60.0
    """
    return 6e7 * rate
