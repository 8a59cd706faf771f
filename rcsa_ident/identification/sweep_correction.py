"""Lines of a spindle whose speed changes: what a machine answers to a force that sweeps, and to one that does not.

A force F e^{i m theta} of a spindle at speed Omega that gains A moves the flange by F e^{i m theta} (H - (i/2) m A H'') to first order in
A, both at omega = m Omega: in the response's integral over the past e^{i m (theta(t - s) - theta(t))} is e^{-i omega s} (1 + (i/2) m A
s^2), and s^2 stands for -d^2/d omega^2. A line from a window of length T is the mean of that over the frequencies that it sweeps, omega
-+ m A T / 2. Both are small, and a machine that is roughly known tells them well: the lines are divided by what it says, and those of the
next fit are those of a spindle that keeps its speed.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from rcsa_ident.base.arrays import ComplexArray, FloatArray
from rcsa_ident.identification.data import AxisData, IdentificationData
from rcsa_ident.identification.misfit import Misfit
from rcsa_ident.identification.priors import Priors
from rcsa_ident.identification.unknowns import Unknowns, planes

#: Weights of a mean over an interval at its middle and, together, at `data.NODE` of its half to both sides: exact to the fifth power.
_MIDDLE, _SIDES = 8.0 / 18.0, 10.0 / 18.0


def unswept(data: IdentificationData, priors: Priors, theta: FloatArray, layout: Unknowns) -> IdentificationData:
    """Return the data as a spindle would give them that keeps each window's mean speed; the same data where nothing sweeps.

    The second order, which is left out, is about the square of the first: that much each line may be wrong by.

    `data`: as measured
    `theta`, shape (p,): about the machine and its joint; what else it holds does not matter
    """
    if not data.sweeps:
        return data
    # a force that is a little larger is so with a sweep and without
    machine = replace(planes(layout), coefficients=0, clampings=0)
    theta, layout = theta[: machine.size], machine
    middle, low, high = (Misfit(_moved(data, side), priors, (0.0,) * len(data.axes)).models(theta, layout) for side in (0, -1, 1))
    ratios = [_ratio(axis, *each) for axis, *each in zip(data.axes, middle, low, high, strict=True)]
    return replace(data, axes=tuple(_divided(axis, ratio) for axis, ratio in zip(data.axes, ratios, strict=True)))


def _moved(data: IdentificationData, side: int) -> IdentificationData:
    """The data's frequencies and tool-holders to one side of each line's middle."""
    if side == 0:
        return data
    axes = []
    for axis in data.axes:
        if not axis.sweep.size:
            axes.append(axis)
            continue
        around = axis.around[:, 0 if side < 0 else 1]
        axes.append(replace(axis, omega=axis.omega + side * axis.node, flange=around[:, :3], tip=around[:, 3:]))
    return replace(data, axes=tuple(axes))


def _ratio(axis: AxisData, middle: ComplexArray, low: ComplexArray, high: ComplexArray) -> ComplexArray:
    """What a machine answers in each line over what it would answer without a sweep, shape (n, o)."""
    if not axis.sweep.size:
        return np.ones_like(middle)
    swept = axis.node > 0.0
    distance = np.where(swept, axis.node, 1.0)[:, None]
    mean = _MIDDLE * middle + 0.5 * _SIDES * (low + high)
    lag = 0.5j * axis.sweep[:, :1] * (low - 2.0 * middle + high) / distance**2
    return np.where(swept[:, None], (mean - lag) / middle, 1.0)


def _divided(axis: AxisData, ratio: ComplexArray) -> AxisData:
    lines = axis.lines / ratio[:, :, None]
    more = 0.5 * np.abs(ratio - 1.0) ** 4 * np.abs(lines[:, :, 0] - lines[:, :, 1]) ** 2
    return replace(axis, lines=lines, variance=axis.variance / np.abs(ratio) ** 2 + more)
