"""Hammer tests as lines of an identification: receptances between points of a tool-holder, thinned, with their variance."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rcsa_ident.base.arrays import ComplexArray, FloatArray, frozen
from rcsa_ident.base.errors import InputError
from rcsa_ident.base.remarks import Remark
from rcsa_ident.dynamics.coordinates import Dof

#: Lines that a test has at least.
FEWEST_LINES = 20
#: Lines that are kept of a test: neighbours of a curve that is drawn finely say the same again.
MOST_LINES = 300
#: Lines from whose second differences the noise is taken, at least.
_WINDOW = 31
#: Share of the kept lines that stand at equal distances, wherever the curve bends.
_EVEN = 0.3
#: Lines over which the curve is averaged before it is asked where it bends.
_STRIDE = 10


@dataclass(frozen=True, slots=True, eq=False)
class HammerLines:
    """Lines of one hammer test.

    `omega` [rad/s], shape (n,): ascending
    `value` [m/N], shape (n,)
    `variance` [m^2/N^2], shape (n,): of the real and imaginary part each
    `response`, `force` [m]: distance of the point from the tip; None is the machine's side of the flange
    `sensor_mass` [kg]: fixed to the tool-holder where the response is measured
    `standstill`: the spindle did not turn
    `remarks`: what the file does not state and was assumed
    """

    id: str
    tooling: str
    axis: Dof
    omega: FloatArray
    value: ComplexArray
    variance: FloatArray
    response: float | None
    force: float | None
    sensor_mass: float = 0.0
    standstill: bool = True
    remarks: tuple[Remark, ...] = ()

    def __post_init__(self) -> None:
        object.__setattr__(self, "omega", frozen(self.omega))
        object.__setattr__(self, "value", frozen(self.value, np.complex128))
        object.__setattr__(self, "variance", frozen(self.variance))
        if self.response is None and self.force is None:
            raise InputError(
                "response", "flange, as the force", "at most one of response and force at the flange, a point mm from the tip else"
            )


def noise_of(value: ComplexArray) -> FloatArray:
    """Return the variance of the real and the imaginary part of each line of a curve that is drawn finely, shape (n,).

    A smooth curve's second differences are its noise alone: of white noise of variance v they have the variance 6 v. The median
    of the squares over `_WINDOW` lines is log 2 of their mean.

    `value`, shape (n,)
    """
    if value.size < 3:
        return np.zeros(value.size)
    squares = np.abs(np.diff(value, 2)) ** 2 / 12.0
    half = min(_WINDOW, squares.size) // 2
    padded = np.pad(squares, (half + 1, half + 1), mode="symmetric")
    windows = np.lib.stride_tricks.sliding_window_view(padded, 2 * half + 1)
    return np.median(windows, axis=1) / np.log(2.0)


def thinned(omega: FloatArray, value: ComplexArray, variance: FloatArray, most: int = MOST_LINES) -> np.ndarray:
    """Return which lines to keep, at most so many: where the curve bends, and some everywhere; indices, ascending.

    `omega`, `value`, `variance`, shape (n,)
    """
    if omega.size <= most:
        return np.arange(omega.size)
    # way along log H between every tenth line, less what noise walks: a line must not be chosen for its own noise
    coarse = np.unique(np.append(np.arange(0, omega.size, _STRIDE), omega.size - 1))
    # mirrored at both ends: against nothing it would bend there
    beyond = np.pad(value, (_STRIDE // 2, _STRIDE - 1 - _STRIDE // 2), mode="symmetric")
    at = np.convolve(beyond, np.ones(_STRIDE) / _STRIDE, mode="valid")[coarse]
    noise = np.sqrt(2.0 * variance[coarse] / _STRIDE)
    step = np.maximum(np.abs(np.diff(at)) - 2.0 * np.hypot(noise[1:], noise[:-1]), 0.0)
    way = step / np.maximum(0.5 * np.abs(at[1:] + at[:-1]), noise[1:] + 1e-300)
    even = np.diff(omega[coarse]) / (omega[-1] - omega[0])
    total = way.sum()
    density = even if total == 0.0 else _EVEN * even + (1.0 - _EVEN) * way / total
    place = np.interp(np.arange(omega.size), coarse, np.concatenate([[0.0], np.cumsum(density)]))
    return np.unique(np.searchsorted(place, np.linspace(0.0, place[-1] * (1.0 - 1e-12), most)))
