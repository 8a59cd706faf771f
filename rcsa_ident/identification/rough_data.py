"""The data of an identification whose drawings, depths and sensors are known only roughly: further unknowns with their spreads."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from rcsa_ident.base.arrays import ComplexArray, FloatArray
from rcsa_ident.dynamics.coordinates import Dof
from rcsa_ident.identification.data import LEVER, IdentificationData
from rcsa_ident.tool_holder.drawings import RoughToolings
from rcsa_ident.tool_holder.rough import RoughToolHolder

#: Standard deviation of a distance that is told as exact [m].
LEAST_SPREAD = 1e-5


def with_rough_cuts(
    data: IdentificationData, depth: FloatArray, gain: FloatArray, delay: FloatArray, talk: FloatArray, corners: Sequence[ComplexArray] = ()
) -> IdentificationData:
    """Return the same data whose forces and motions may be wrong by what is not known exactly; deviations are 0 where it is.

    `depth` [-], shape (toolings,): standard deviation of the logarithm of each tooling's axial depth
    `gain` [-], shape (axes,): of that of each axis' sensor's gain
    `delay` [s], shape (axes,): of each axis' sensor's delay
    `talk` [-], shape (axes,): of the share of the other axis' motion that each axis' displacement sensor feels
    `corners`: sequence of complex array, one an axis, shape (n, c); by what the logarithm of each line's force changes with a corner radius
        that is larger by its standard deviation
    """
    deep, loud, late = (np.flatnonzero(each) for each in (depth, gain, delay))
    columns = []
    for i, axis in enumerate(data.axes):
        of_tooling = data.cut_tooling[axis.cut][:, None] == deep
        own = np.broadcast_to(i == loud, (axis.omega.size, loud.size))
        lagging = -1j * axis.omega[:, None] * delay[late] * (i == late)
        columns.append(np.hstack([of_tooling, own, lagging, *corners[i : i + 1]]))
    # a delay and a corner radius stand in units of their spreads
    units = (1.0,) * (columns[0].shape[1] - deep.size - loud.size)
    return _with_rough_forces(_with_cross_talk(data.with_unknowns((*depth[deep].tolist(), *gain[loud].tolist(), *units), columns), talk))


def _with_cross_talk(data: IdentificationData, spread: FloatArray) -> IdentificationData:
    """The same data whose displacement sensors may feel a share of the other axis' motion."""
    if len(data.axes) < 2 or not np.any(spread) or not all(axis.force.size for axis in data.axes):
        return data
    axes, felt = [], dict[Dof, int]()
    for i, (axis, other) in enumerate(zip(data.axes, data.axes[::-1], strict=True)):
        if spread[i] > 0.0:
            felt[axis.axis] = len(data.coefficient_spread) + len(felt)
            place = {key: k for k, key in enumerate(zip(other.cut.tolist(), other.order.tolist(), strict=True))}
            here = np.array([place.get(key, -1) for key in zip(axis.cut.tolist(), axis.order.tolist(), strict=True)])
            talk = np.zeros_like(axis.lines)
            # a line that the other axis' force does not make is not among its lines, and small
            talk[:, 0] = other.lines[here, 0] * np.where(here < 0, 0.0, other.force[here] / axis.force)[:, None]
            axis = replace(axis, talk=talk)
        axes.append(axis)
    more = tuple(float(spread[i]) for i, axis in enumerate(axes) if axis.axis in felt)
    return replace(data, axes=tuple(axes), talk_place=felt).with_unknowns(more, None)


def with_distances(data: IdentificationData, distance: FloatArray, spread: FloatArray) -> IdentificationData:
    """Return the same data whose flange sensors look behind the joint.

    `distance` [m], shape (axes,): towards the spindle's rear; negative: at the holder
    `spread` [m], shape (axes,): its standard deviation; 0 where it is known exactly
    """
    axes = tuple(replace(axis, behind=float(d) / LEVER) for axis, d in zip(data.axes, distance, strict=True))
    seeing = [i for i, axis in enumerate(axes) if axis.of_flange]
    place = {axes[i].axis: len(data.coefficient_spread) + k for k, i in enumerate(seeing)}
    # an unknown all the same: whether the lines speak against what was told is asked of it
    more = tuple(max(float(spread[i]), LEAST_SPREAD) / LEVER for i in seeing)
    return replace(data, axes=axes, distance_place=place).with_unknowns(more, None)


def _with_rough_forces(data: IdentificationData) -> IdentificationData:
    """The same data whose forces are known no better than tools: an error of depth, edge or run-out is a share of the whole force.

    Where little of that points along an axis, it is much of the little.
    """
    told = [axis.across.size > 0 and not axis.beside.size for axis in data.axes]
    beside = [replace(a, beside=(a.power.T * np.abs(a.across / a.force) ** 2).T) if t else a for a, t in zip(data.axes, told, strict=True)]
    return replace(data, axes=tuple(beside))


def with_rough_toolings(data: IdentificationData, rough: RoughToolings, holders: Sequence[RoughToolHolder]) -> IdentificationData:
    """Return the same data whose tool-holders are known only roughly. `rough`: of all toolings, in the data's order."""
    count, first = len(rough.unknowns), len(data.coefficient_spread)
    held = replace(_with_rough_forces(data), rough=rough, rough_holders=tuple(holders), rough_first=first, rough_start=np.zeros(count))
    return held.with_unknowns((1.0,) * count, None)
