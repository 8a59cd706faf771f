"""Units of the edges: inside everything is SI; files, commands and bodies speak of rev/min, hertz and cm³/min.

Powers of ten (mm, µm, MPa) are written in line beside the name that carries the unit; degrees are `math.degrees` and `math.radians`.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, TypeVar, overload

from rcsa_ident.base.errors import InputError, positive

if TYPE_CHECKING:  # commands start without numpy
    from numpy.typing import NDArray

#: Unit of drawings and tables for an SI unit, and how many of it that is; other units are shown as they are.
SHOWN = {"m": ("mm", 1e3), "Pa": ("GPa", 1e-9)}
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


@overload
def rpm(first: float) -> float: ...
@overload
def rpm(first: float, last: float, step: float) -> NDArray[Any]: ...
def rpm(first: float, last: float | None = None, step: float | None = None) -> Any:
    """Return a spindle speed, or the speeds from the first to the last one, in rad/s from rev/min.

    Parameters
    ----------
    first : float [rev/min]
    last, step : float, optional [rev/min]
        Both or neither; the last one is among the speeds where the steps meet it.

    Examples
    --------
    >>> round(rpm(12_000), 3)
    1256.637
    >>> to_rpm(rpm(4000, 5000, 250), 6).tolist()
    [4000.0, 4250.0, 4500.0, 4750.0, 5000.0]
    """
    return from_rpm(_steps(first, last, step, "rev/min"))


@overload
def hz(first: float) -> float: ...
@overload
def hz(first: float, last: float, step: float) -> NDArray[Any]: ...
def hz(first: float, last: float | None = None, step: float | None = None) -> Any:
    """Return an angular frequency, or those from the first to the last one, in rad/s from hertz.

    Parameters
    ----------
    first : float [Hz]
    last, step : float, optional [Hz]
        Both or neither; the last one is among the frequencies where the steps meet it.

    Examples
    --------
    >>> round(hz(50.0), 3)
    314.159
    >>> to_hz(hz(100.0, 300.0, 100.0)).round(9).tolist()
    [100.0, 200.0, 300.0]
    """
    return from_hz(_steps(first, last, step, "Hz"))


def _steps(first: float, last: float | None, step: float | None, unit: str) -> Any:
    if last is None and step is None:
        return positive("value", first, unit)
    if last is None or step is None:
        raise InputError("last and step", "one of them", f"both, or neither [{unit}]")
    return inclusive(first, last, step, ("first", "last", "step"), unit)


def inclusive(first: float, last: float, step: float, names: tuple[str, str, str], unit: str) -> Any:
    """Return first, first + step, ... up to last, which is one of them if the steps meet it."""
    import numpy as np

    for name, value in zip(names, (first, last, step), strict=True):
        if not (value > 0.0 and value - value == 0.0):
            raise InputError(name, value, f"a finite number above 0 [{unit}]")
    if last < first:
        raise InputError(names[1], last, f"{names[0]} ({first:g}) or more [{unit}]")
    count = int(np.floor((last - first) / step * (1.0 + 1e-12) + 1e-9)) + 1
    if count > 1_000_000:
        raise InputError(names[2], step, f"a step that gives at most 1000000 values [{unit}]")
    return first + step * np.arange(count)
