"""Lines of a spindle whose speed changes, and of a machine that does: what it answers in one state, over what it answers in another.

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
from rcsa_ident.identification.further_unknowns import further_places
from rcsa_ident.identification.levenberg_marquardt import Solution
from rcsa_ident.identification.misfit import Misfit
from rcsa_ident.identification.priors import Priors
from rcsa_ident.identification.unknowns import Layout, Unknowns, pack, planes, unpack

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


def without_further(data: IdentificationData, priors: Priors, found: Solution) -> IdentificationData:
    """Return the data as a machine would give them that is warm at each speed, clamped alike, and cut with forces that are known.

    `data`: without smooth errors; themselves where nothing further was learned
    `found`: of these data or of some of their cuts; what was learned
    """
    if not data.further:
        return data
    first, count = further_places(data)[0][1].start, len(data.coefficient_spread)
    layout = replace(planes(found.layout), coefficients=count, clampings=0)
    theta = found.theta[: layout.size]
    logs = theta[layout.force].copy()
    logs[:first] = 0.0
    alike = theta.copy()
    alike[layout.force][first:] = 0.0
    warm = replace(data, warmth=data.steady * data.relative_speed if data.warmth.size else data.warmth)
    shares = (0.0,) * len(data.axes)
    here, there = Misfit(data, priors, shares).models(theta, layout), Misfit(warm, priors, shares).models(alike, layout)
    forces = [np.exp(axis.force_slope @ logs) for axis in data.axes]
    axes = []
    for i, axis in enumerate(data.axes):
        ratio = here[i] / there[i]
        across = axis.across
        if across.size:
            across = across * _at_lines(data.axes[1 - i], forces[1 - i], axis)
        axes.append(
            replace(
                axis,
                lines=axis.lines / ratio[:, :, None],
                talk=axis.talk / ratio[:, :, None] if axis.talk.size else axis.talk,
                variance=axis.variance / np.abs(ratio) ** 2,
                force_slope=axis.force_slope[:, :first],
                force=axis.force * forces[i] if axis.force.size else axis.force,
                across=across,
                across_slope=axis.across_slope[:, :first],
            )
        )
    return replace(
        data,
        axes=tuple(axes),
        coefficient_spread=data.coefficient_spread[:first],
        further=(),
        warmth=np.zeros(0),
        course=np.zeros((0, 0)),
        steady=0.0,
        grip=np.zeros((0, 0)),
        grip_places=np.zeros(0, dtype=np.intp),
    )


def start_without_further(data: IdentificationData, found: Solution, lines: IdentificationData) -> tuple[FloatArray, Layout, FloatArray]:
    """Return where the fit of what `without_further` returns begins, with smooth errors: unknowns, layout, the cuts' delays and angles.

    `data`, `found`: as there
    `lines`: what it has returned, or the first of its outputs
    """
    learned, old = slice(len(lines.coefficient_spread), len(data.coefficient_spread)), planes(found.layout)
    blocks, parts = [], []
    for own, block, axis in zip(old.places, old.axes, lines.axes, strict=True):
        machine = unpack(found.theta[own], block)
        warms = block.warming and data.steady != 0.0
        if warms:
            machine = replace(machine, softening=data.steady * machine.warming + (machine.softening if block.softening else 0.0))
        blocks.append(replace(block, places=axis.places, warming=False, softening=block.softening or warms))
        parts.append(pack(machine, blocks[-1]))
    layout = replace(old, axes=tuple(blocks), coefficients=old.coefficients - (learned.stop - learned.start))
    parts += [found.theta[old.joint], np.delete(found.theta[old.force], learned), found.theta[old.force.stop :]]
    return np.concatenate(parts), layout, found.evaluation.nuisance


def _at_lines(other: AxisData, values: ComplexArray, axis: AxisData) -> ComplexArray:
    """Values of another axis' lines at the lines of an axis, by cut and order; 1 where it has none there."""
    known = dict(zip(_keys(other), values.tolist(), strict=True))
    return np.array([known.get(key, 1.0) for key in _keys(axis)])


def _keys(axis: AxisData) -> list[tuple[int, int]]:
    return list(zip(axis.cut.tolist(), np.rint(axis.order).astype(int).tolist(), strict=True))


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
